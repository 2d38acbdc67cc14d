"""Whose pose, and when: bags of straight drives and turns, whose places are formulas."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from findings import codes, of_code, the
from robot_logs import CAMERA, Sent, bag, joints, odom, tf, transform, wheeled

import nmm
from nmm.base.errors import InputError

ARM = {"j1": 0.1, "j2": 0.2}
pytestmark = pytest.mark.filterwarnings("ignore:.*:RuntimeWarning")


def arm(t: float) -> Sent:
    return t, "/joint_states", joints(t, ARM)


def spin(t: float) -> tuple[float, float, float]:
    """x, y, yaw in odom after t, s, of a drive along an arc: 0.4 m/s, 0.5 rad/s."""
    return 0.8 * math.sin(0.5 * t), 0.8 * (1 - math.cos(0.5 * t)), 0.5 * t


def moved(pose: tuple[float, float, float], ahead: float, beside: float = 0.0) -> tuple[float, float, float]:
    x, y, yaw = pose
    c, s = math.cos(yaw), math.sin(yaw)
    return x + c * ahead - s * beside, y + s * ahead + c * beside, yaw


def clocked(n: int = 100, dt: float = 0.02, start: float = 10.0) -> Iterator[float]:
    return (start + dt * k for k in range(n))


def test_each_edge_is_interpolated_between_its_own_stamps(tmp_path: Path) -> None:
    """Odometry at 50 Hz; a drifting map → odom at 10 Hz, dated 0.5 s ahead; a constant edge between, at 3 Hz;
    joints 7 ms beside, between two 100 ms late."""
    robot = wheeled(tmp_path)
    sent: list[Sent] = []
    for k, t in enumerate(clocked(200)):
        x = 0.5 * (t - 10)
        sent += [arm(t + 0.007), (t, "/tf", tf(transform(t, "odom", "footprint", (x, 0))))]
        if k % 17 == 0:
            sent.append((t + 0.1, "/tf", tf(transform(t, "footprint", "base_link", (0.1, 0, 0.05)))))
        if k % 5 == 0:
            ahead = t + 0.5
            sent.append((t, "/tf", tf(transform(ahead, "map", "odom", (1 + 0.02 * (ahead - 10), 0)))))
    run = nmm.read_bag(bag(tmp_path, sent), robot)
    t = 0.007 + run.t
    late = round(float(run.q[0, 0] - 1.1 - 0.5 * 0.007 - 0.02 * 0.5), 12)
    assert late == 0.0  # from the first joint state on: what is dated ahead counts when it came
    drift = np.maximum(0.5, t) * 0.02
    np.testing.assert_allclose(run.q[:, 0], 1.1 + 0.5 * t + drift, atol=1e-9)
    assert run.believed is not None
    np.testing.assert_allclose(run.believed[:, 0], 0.1 + 0.5 * t, atol=1e-9)
    np.testing.assert_allclose(run.u[:, 0], 0.5, atol=1e-6)  # the drift is no motion
    assert not run.warnings


def test_an_arc_is_the_formula_s(tmp_path: Path) -> None:
    """Rotations in between, and θ over several turns though joints come once a second only."""
    robot = wheeled(tmp_path)
    sent = [arm(t) for t in clocked(20, 1.0037)]
    sent += [
        (t, "/tf", tf(transform(t, "odom", "base_link", spin(8 * (t - 10))[:2], 4.0 * (t - 10))))
        for t in clocked(2000, 0.01)
    ]
    run = nmm.read_bag(bag(tmp_path, sent), robot)
    np.testing.assert_allclose(run.q[:, 2], 4.0 * run.t, atol=1e-9)
    expected = np.array([spin(8 * t)[:2] for t in run.t])
    np.testing.assert_allclose(run.q[:, :2], expected, atol=1e-3 * 0.16)  # a chord's sag: r (ω dt)² / 8


def test_a_localisation_that_jumps_moves_nothing(tmp_path: Path) -> None:
    """At 12 s map → odom moves by 2 m and 1 rad at once: the platform is there from then on."""
    robot = wheeled(tmp_path)
    sent: list[Sent] = []
    for k, t in enumerate(clocked(200)):
        sent += [arm(t), (t, "/tf", tf(transform(t, "odom", "base_link", (0.5 * (t - 10), 0))))]
        if k % 5 == 0:
            at, yaw = ((0, 2.0), 1.0) if t >= 11.999 else ((0.0, 0), 0.0)
            sent.append((t, "/tf", tf(transform(t, "map", "odom", at, yaw))))
    run = nmm.read_bag(bag(tmp_path, sent), robot)
    before = run.t < 1.9999
    np.testing.assert_allclose(run.q[before, 1:3], 0.0, atol=1e-9)
    way = 0.5 * run.t[~before]
    np.testing.assert_allclose(run.q[~before, 1], 2.0 + way * math.sin(1.0), atol=1e-9)
    np.testing.assert_allclose(run.u[:, 0], 0.5, atol=1e-6)
    np.testing.assert_allclose(run.u[:, 1], 0.0, atol=1e-6)
    found = the(run, "pose_jumps")
    assert found.values["edge"] == "map → odom"
    assert (found.values["count"], found.values["m"], found.values["rad"]) == pytest.approx((1, 2.0, 1.0))
    assert found.where["t"] == pytest.approx(2.0)


@pytest.mark.parametrize("of", ["two localisers", "odometry begins anew", "a marker's pose alone"])
def test_other_jumps_are_told(tmp_path: Path, of: str) -> None:
    robot = wheeled(tmp_path)
    sent: list[Sent] = []
    for k, t in enumerate(clocked(200)):
        x = 0.5 * (t - 10)
        if of == "two localisers":  # both say map → odom, half a metre apart
            sent.append((t, "/tf", tf(transform(t, "map", "odom", (0.5 * (k % 2), 0)))))
        if of == "odometry begins anew":
            sent.append((t, "/odom", odom(t, (x if t < 12 else x - 1, 0, 0), (0.5, 0, 0, 0, 0, 0))))
        elif of == "a marker's pose alone":
            sent.append((t, "/tf", tf(transform(t, "map", "base_link", (x + 0.4 * (t >= 12), 0)))))
        else:
            sent.append((t, "/tf", tf(transform(t, "odom", "base_link", (x, 0)))))
        sent.append(arm(t))
    run = nmm.read_bag(bag(tmp_path, sent), robot)
    found = the(run, "pose_jumps")
    assert found.values["count"] == (199 if of == "two localisers" else 1)
    np.testing.assert_allclose(run.u[:, 0], 0.5, atol=1e-6)


def test_a_fast_robot_does_not_jump(tmp_path: Path) -> None:
    """8 m/s from 0 with 3 m/s², at 10 Hz, then a stop with 8 m/s²."""
    robot = wheeled(tmp_path)
    t = np.arange(0, 5, 0.1)
    v = np.minimum(3 * t, 8.0) * np.clip(4.5 - t, 0, 1)
    x = np.concatenate([[0.0], np.cumsum(0.05 * (v[1:] + v[:-1]))])
    sent = [
        one
        for now, at in zip(t + 10, x, strict=True)
        for one in (arm(now), (now, "/tf", tf(transform(now, "odom", "base_link", (at, 0)))))
    ]
    run = nmm.read_bag(bag(tmp_path, sent), robot)
    assert not run.warnings
    np.testing.assert_allclose(run.q[:, 0], x, atol=1e-9)


@pytest.mark.parametrize("where", ["the axle", "the camera", "TF"])
def test_a_link_s_odometry_is_the_reference_point_s(tmp_path: Path, where: str) -> None:
    """Odometry of base_link 0.2 m ahead of the axle; of a camera that looks ahead with z, beside and above;
    of a sensor that only TF knows. Twists are those of the link, in its axes."""
    robot = wheeled(tmp_path, -0.2, more=CAMERA.format(parent="base_link"))
    sent: list[Sent] = []
    if where == "TF":
        sent.append((10.0, "/tf_static", tf(transform(10.0, "base_link", "sensor", (0.5, 0.2), 0.3))))
    for t in clocked():
        axle = spin(t - 10)
        link, twist, child = moved(axle, 0.2), (0.4, 0.1, 0, 0, 0, 0.5), "base_link"
        if where == "TF":
            x, y, yaw = moved(axle, 0.7, 0.2)
            vx, vy = 0.4 - 0.5 * 0.2, 0.5 * 0.7
            c, s = math.cos(0.3), math.sin(0.3)
            link, child = (x, y, yaw + 0.3), "sensor"
            twist = (c * vx + s * vy, -s * vx + c * vy, 0, 0, 0, 0.5)
        message = odom(t, link, twist, child=child)
        if where == "the camera":
            x, y, yaw = moved(axle, 0.5, 0.1)
            turn = message.pose.pose.orientation
            half = [-0.5, 0.5, -0.5, 0.5]  # x right, y down, z ahead; then about the world's z
            c, s = math.cos(yaw / 2), math.sin(yaw / 2)
            ox, oy, oz, ow = half
            turn.x, turn.y, turn.z, turn.w = (
                c * ox - s * oy,
                c * oy + s * ox,
                c * oz + s * ow,
                c * ow - s * oz,
            )
            message.pose.pose.position.x, message.pose.pose.position.y = x, y
            message.child_frame_id, rates = "camera", message.twist.twist
            vx, vy = 0.4 - 0.5 * 0.1, 0.5 * 0.5
            rates.linear.x, rates.linear.y, rates.linear.z = -vy, 0.0, vx
            rates.angular.x, rates.angular.y, rates.angular.z = 0.0, -0.5, 0.0
        sent += [arm(t), (t, "/odom", message)]
    run = nmm.read_bag(bag(tmp_path, sent), robot)
    np.testing.assert_allclose(run.q[:, :3], [spin(t) for t in run.t], atol=1e-9)
    np.testing.assert_allclose(run.u[:, :2], np.tile([0.4, 0.5], (len(run), 1)), atol=1e-9)
    assert not run.warnings
    live, rates = nmm.ros.odometry(message, robot, *([frames_of(sent)] if where == "TF" else []))
    np.testing.assert_allclose(live, spin(1.98), atol=1e-9)
    np.testing.assert_allclose(rates, [0.4, 0.0, 0.5], atol=1e-9)


def frames_of(sent: list[Sent]) -> nmm.ros.Transforms:
    frames = nmm.ros.Transforms()
    for _, topic, message in sent:
        if topic.startswith("/tf"):
            frames.add(message)
    return frames


@pytest.mark.parametrize("base", [None, "base_link", "plate"])
def test_transforms_of_any_link_are_the_reference_point_s(tmp_path: Path, base: str | None) -> None:
    """base_footprint, which the file does not have, leads to base_link, which it has, and to a plate."""
    robot = wheeled(tmp_path, -0.2)
    sent: list[Sent] = [
        (10.0, "/tf_static", tf(transform(10.0, "base_footprint", "base_link", (0.3, 0, 0.05)))),
        (10.0, "/tf_static", tf(transform(10.0, "base_link", "plate", (0.1, -0.4), 1.0))),
    ]
    for t in clocked():
        x, y, yaw = moved(spin(t - 10), -0.1)
        sent += [arm(t), (t, "/tf", tf(transform(t, "odom", "base_footprint", (x, y), yaw)))]
    run = nmm.read_bag(bag(tmp_path, sent), robot, base=base)
    np.testing.assert_allclose(run.q[:, :3], [spin(t) for t in run.t], atol=1e-9)
    np.testing.assert_allclose(frames_of(sent).base("odom", robot), spin(1.98), atol=1e-9)


def test_frames_that_lead_nowhere_are_refused_by_name(tmp_path: Path) -> None:
    robot = wheeled(tmp_path, more=CAMERA.format(parent="a1"))
    for child in ("camera", "t265_pose"):  # on the arm; in no file and no transform
        sent = [one for t in clocked(5) for one in (arm(t), (t, "/odom", odom(t, (0, 0, 0), child=child)))]
        with pytest.raises(InputError, match=child) as error:
            nmm.read_bag(bag(tmp_path, sent), robot)
        assert len(str(error.value)) <= 300
        with pytest.raises(InputError, match=child):
            nmm.ros.odometry(sent[1][2], robot)
    same = nmm.read_bag(bag(tmp_path, sent), robot, base="t265_pose")  # one's word
    assert not np.any(same.q[:, :3])
    sent = [one for t in clocked(5) for one in (arm(t), (t, "/odom", odom(t, (0, 0, 0))))]
    with pytest.raises(InputError, match="base_lnk"):
        nmm.read_bag(bag(tmp_path, sent), robot, base="base_lnk")
    sent = [one for t in clocked(5) for one in (arm(t), (t, "/odom", odom(t, (0, 0, 0), child=str(t))))]
    with pytest.raises(InputError, match="several frames"):
        nmm.read_bag(bag(tmp_path, sent), robot)


def test_a_parked_robot_whose_transforms_are_static(tmp_path: Path) -> None:
    robot = wheeled(tmp_path)
    still = tf(transform(0, "map", "odom", (1, 2), 0.5), transform(0, "odom", "base_link", (0.5, 0)))
    run = nmm.read_bag(bag(tmp_path, [(9.0, "/tf_static", still), *(arm(t) for t in clocked(5))]), robot)
    place = moved((1, 2, 0.5), 0.5)
    np.testing.assert_allclose(run.q, np.tile([*place, 0.1, 0.2], (5, 1)), atol=1e-12)
    parts = tf(transform(0, "base_link", "lidar", (1, 2), 0.5))
    with pytest.raises(InputError) as error:
        nmm.read_bag(bag(tmp_path, [(9.0, "/tf_static", parts), arm(10.0)]), robot)
    assert error.value.available == ("base_link", "lidar")


def test_odometry_of_a_map_is_the_map_s(tmp_path: Path) -> None:
    """A filter's odometry in map, beside TF of odom; and map → odom where only messages say odom → base."""
    robot = wheeled(tmp_path)
    fused, joined = list[Sent](), list[Sent]()
    for t in clocked():
        x, y, yaw = spin(t - 10)
        low = tf(transform(t, "odom", "base_link", (x, y), yaw))
        fused += [
            arm(t),
            (t, "/odom", odom(t, (x + 3, y, yaw), (0.4, 0, 0, 0, 0, 0.5), "map")),
            (t, "/tf", low),
        ]
        level = tf(transform(t, "map", "odom_wheels", (3, 0)))
        joined += [
            arm(t),
            (t, "/tf", level),
            (t, "/odom", odom(t, (x, y, yaw), (0.4, 0, 0, 0, 0, 0.5), "odom_wheels")),
        ]
    for sent in (fused, joined):
        run = nmm.read_bag(bag(tmp_path, sent), robot)
        expected = np.array([spin(t) for t in run.t])
        assert run.believed is not None
        np.testing.assert_allclose(run.q[:, :3], expected + np.array([3, 0, 0]), atol=1e-9)
        np.testing.assert_allclose(run.believed[:, :3], expected, atol=1e-9)
        np.testing.assert_allclose(run.u[:, :2], np.tile([0.4, 0.5], (len(run), 1)), atol=1e-9)


def test_a_frame_with_two_parents(tmp_path: Path) -> None:
    robot = wheeled(tmp_path)
    sent: list[Sent] = []
    for t in clocked():
        x, y, yaw = spin(t - 10)
        both = tf(
            transform(t, "odom", "base_link", (x, y), yaw), transform(t, "map", "base_link", (x + 1, y), yaw)
        )
        sent += [arm(t), (t, "/tf", both)]
    run = nmm.read_bag(bag(tmp_path, sent), robot)
    np.testing.assert_allclose(run.q[:, 0] - 1, [spin(t)[0] for t in run.t], atol=1e-9)
    told = of_code(run.findings, "parents_differ")
    assert {one.values["edge"] for one in told} == {"map → base_link", "odom → base_link"}


@pytest.mark.parametrize("twist", [(0, 0, 0, 0, 0, 0), (22.9, 0, 0, 0, 0, 28.6), (-0.4, 0, 0, 0, 0, 0.5)])
def test_twists_that_contradict_the_poses_are_told(tmp_path: Path, twist: Any) -> None:
    """Zeros; another unit; another sign."""
    robot = wheeled(tmp_path)
    sent = [one for t in clocked() for one in (arm(t), (t, "/odom", odom(t, spin(t - 10), twist)))]
    run = nmm.read_bag(bag(tmp_path, sent), robot)
    np.testing.assert_allclose(run.u[1:-1, :2], np.tile([0.4, 0.5], (len(run) - 2, 1)), atol=1e-4)
    found = the(run, "rates_contradict")
    assert found.values == {"names": ["the twist of /odom"], "zero": not any(twist)}


def fleet(space: str, frames: str, whole_tf: bool) -> list[Sent]:
    """Two robots, the second 5 m ahead; a map for both."""
    sent: list[Sent] = [(10.0, "/tf_static", tf(transform(10.0, "map", f"{frames.format(1)}odom", (1, 0))))]
    for i in (1, 2):
        prefix, name = frames.format(i), space.format(i)
        for t in clocked(50):
            x, y, yaw = spin(t - 10)
            message = tf(transform(t, f"{prefix}odom", f"{prefix}base_link", (x + 5 * (i - 1), y), yaw))
            sent += [(t, "/tf" if whole_tf else f"/{name}/tf", message)]
            sent += [(t, f"/{name}/joint_states", joints(t, {"j1": 0.1 * i, "j2": 0.2}))]
    return sent


@pytest.mark.parametrize(
    ("frames", "whole_tf", "names"),
    [
        ("robot{}/", True, {"namespace": "robot1"}),
        ("robot{}/", True, {"namespace": "/robot1/", "prefix": "robot1"}),
        ("r{}_", True, {"namespace": "robot1", "prefix": "r1_"}),
        ("", False, {"namespace": "robot1"}),
        ("robot{}/", False, {"joints": "/robot1/joint_states", "tf": "/robot1/tf", "prefix": "robot1/"}),
    ],
)
def test_one_robot_of_a_fleet(tmp_path: Path, frames: str, whole_tf: bool, names: dict[str, str]) -> None:
    robot = wheeled(tmp_path)
    run = nmm.read_bag(bag(tmp_path, fleet("robot{}", frames, whole_tf)), robot, **names)  # type: ignore[arg-type]
    mapped = 1.0 if whole_tf or frames == "" else 0.0
    np.testing.assert_allclose(run.q[:, 0] - mapped, [spin(t)[0] for t in run.t], atol=1e-9)
    np.testing.assert_allclose(run.q[:, 3], 0.1)


def test_what_is_there_is_listed(tmp_path: Path) -> None:
    robot, path = wheeled(tmp_path), bag(tmp_path, fleet("robot{}", "robot{}/", True))
    with pytest.raises(InputError) as error:
        nmm.read_bag(path, robot)
    assert "/robot2/joint_states (sensor_msgs/msg/JointState)" in (error.value.available or ())
    with pytest.raises(InputError) as error:
        nmm.read_bag(path, robot, joints="/robot1/joint_states")
    assert "robot1/odom" in (error.value.available or ())
    assert "prefix=" in str(error.value)
    run = nmm.read_bag(
        path, robot, joints="/robot1/joint_states", map="none", odom="robot1/odom", base="robot1/base_link"
    )
    np.testing.assert_allclose(run.q[:, 0], [spin(t)[0] for t in run.t], atol=1e-9)


def test_other_names_of_frames_and_topics(tmp_path: Path) -> None:
    robot = wheeled(tmp_path)
    sent: list[Sent] = []
    for t in clocked(50):
        x, y, yaw = spin(t - 10)
        sent += [
            (t, "/arm/joint_states", joints(t, {"j1": 0.1})),
            (t, "/wrist/joint_states", joints(t, {"j2": 0.2})),
            (t, "/tf_all", tf(transform(t, "world", "odom_combined", (2, 0)))),
            (t, "/tf_all", tf(transform(t, "odom_combined", "chassis", (x, y), yaw))),
        ]
    run = nmm.read_bag(
        bag(tmp_path, sent),
        robot,
        joints=["arm/joint_states", "/wrist/joint_states"],
        tf="tf_all",
        map="world",
        odom="odom_combined",
        base="chassis",
    )
    expected = np.array([spin(t) for t in run.t])
    np.testing.assert_allclose(run.q[:, :3], expected + np.array([2, 0, 0]), atol=1e-9)
    assert run.believed is not None
    np.testing.assert_allclose(run.believed[:, :3], expected, atol=1e-9)


def test_poses_that_are_missing_are_told(tmp_path: Path) -> None:
    robot = wheeled(tmp_path)
    sent = [arm(t) for t in clocked(500)]
    sent += [
        (t, "/odom", odom(t, (0.1 * (t - 10), 0, 0), (0.1, 0, 0, 0, 0, 0), child=""))
        for t in clocked(400)
        if not 12 < t < 15
    ]
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        run = nmm.read_bag(bag(tmp_path, sent), robot)
    assert codes(run) == {"platform_silent", "platform_unknown", "child_unnamed"}
    gap = the(run, "platform_silent").where
    assert (gap["t"], gap["end"]) == pytest.approx((2.0, 5.0), abs=0.03)
    assert the(run, "platform_unknown").values["s"] == pytest.approx(2.0, abs=0.03)
    assert len(heard) == len(run.warnings) == 3
    assert not {*map(str, (one.message for one in heard))} - {f"{run.label}: {one}" for one in run.warnings}
