"""Wheels: found and measured in files, and rolling without slip on every base and platform."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from findings import assert_found, holds, of_code, refused
from scipy.integrate import solve_ivp
from urdf_parts import joint, link, robot, write

from nmm.base.errors import RobotError
from nmm.model.platforms import Omnidirectional, Unicycle
from nmm.model.robots.loading import load
from nmm.model.robots.loading.measured_joints import Measured
from nmm.model.robots.loading.measured_layout import measure_layout
from nmm.model.robots.robot import Robot
from nmm.model.robots.wheel import Wheel
from nmm.views.figures.silhouette import Silhouette
from nmm.views.playback import LiveViewer, Motion, wheel_rates, write_html
from nmm.views.playback.keyframes import LARGEST_TURN, ghost_samples, keyframes
from nmm.views.playback.placements import Placements, rolling_joints
from nmm.views.playback.rolling import Rolling, caster_step

Array = np.ndarray

UP, DOWN, LEFT, RIGHT = "0 0 1", "0 0 -1", "0 1 0", "0 -1 0"


def turning(name: str, parent: str, xyz: str, axis: str, rpy: str = "0 0 0", limit: str = "") -> str:
    """A continuous joint, or a revolute one between ±limit, with its child link `name`."""
    kind = "revolute" if limit else "continuous"
    body = f'<axis xyz="{axis}"/>'
    if limit:
        body += f'<limit lower="-{limit}" upper="{limit}" effort="1" velocity="1"/>'
    origin = f'<origin xyz="{xyz}" rpy="{rpy}"/>'
    return joint(f"{name}_joint", parent, name, kind, body, origin) + link(name)


#: Bases by hand: what the bundled ones do not have.
HAND_MADE = {
    # Casters ahead of and behind their swivels, an axis that points down, a wheel that turns backwards, twin
    # wheels, frames that are not parallel to the body's.
    "casters": [
        turning("a_wheel", "base", "0 0.2 0.1", LEFT),
        turning("b_swivel", "base", "0.3 0.1 0.2", UP, rpy="0 0 0.7"),
        turning("b_wheel", "b_swivel", "-0.04 0.01 -0.15", LEFT),
        turning("c_swivel", "base", "-0.3 0.1 0.2", DOWN),
        turning("c_wheel", "c_swivel", "0.05 0 -0.15", RIGHT),
        turning("d_swivel", "base", "-0.3 -0.1 0.2", UP, rpy="3.141592653589793 0 0"),
        turning("d_wheel", "d_swivel", "-0.05 0.01 0.16", "0.6 0.8 0"),
        turning("e_swivel", "base", "0.3 -0.1 0.2", UP),
        turning("e1_wheel", "e_swivel", "-0.03 0.02 -0.15", LEFT),
        turning("e2_wheel", "e_swivel", "-0.03 -0.02 -0.16", RIGHT),
    ],
    # Four wheels that steer to where they go, on the swivel's axis or beside it.
    "swerve": [
        part
        for i, (x, y, side) in enumerate(
            [(0.3, 0.2, 0.0), (0.3, -0.2, 0.03), (-0.3, 0.2, -0.02), (-0.3, -0.2, 0)]
        )
        for part in (
            turning(f"swivel{i}", "base", f"{x} {y} 0.2", DOWN if i == 1 else UP, rpy=f"0 0 {0.3 * i}"),
            turning(f"wheel{i}", f"swivel{i}", f"0 {side} -0.12", RIGHT if i == 2 else LEFT),
        )
    ],
    # One front wheel on the steering joint itself, and one beside it that follows.
    "tricycle": [
        turning("rear_wheel", "base", "0 0.2 0.1", LEFT),
        turning("steer", "base", "0.5 0 0.15", UP, limit="1.2"),
        turning("front_wheel", "steer", "0 0.04 -0.05", LEFT),
        turning("side_swivel", "base", "0.4 0.3 0.15", DOWN, rpy="0 0 0.4"),
        turning(
            "side_wheel", "side_swivel", "0.00778836684617301 0.01842121988005770 -0.05", LEFT, rpy="0 0 -0.4"
        ),
    ],
}

BUNDLED: dict[str, dict[str, object]] = {
    "differential_base": {},
    "differential_base as a unicycle": {"platform": "unicycle"},
    "differential_base described by its wheels": {"platform": "wheeled"},
    "car_base": {},
    "car_base with front drive": {"platform": "front_drive_car"},
    "trailer_base": {},
    "trailer_base described by its wheels": {"platform": "wheeled"},
    "trailer_base on the axle": {"arguments": {"hitch_offset": 0, "length": 0.5}},
    "omni_base": {},
    "omni_base as omnidirectional": {"platform": "omnidirectional"},
    "omni_base, long": {"arguments": {"length": 0.9, "width": 0.4}},
    "unicycle_2r": {},
}
PLATFORM_OF = {"casters": "unicycle", "swerve": "omnidirectional", "tricycle": "car"}
CASES = [*BUNDLED, *HAND_MADE, "casters as omnidirectional"]


@pytest.fixture(scope="module")
def base(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Robot]:
    folder = tmp_path_factory.mktemp("bases")

    @cache
    def made(case: str) -> Robot:
        name = case.split(" ")[0].rstrip(",")
        if case in BUNDLED:
            return load(name, **BUNDLED[case])  # type: ignore[arg-type]  # each case gives its own
        path = write(folder / f"{name}.urdf", robot(link("base"), *HAND_MADE[name]))
        kind = "omnidirectional" if "omnidirectional" in case else PLATFORM_OF[name]
        return load(path, platform=kind)

    return made


def random_state(robot: Robot, rng: np.random.Generator) -> tuple[Array, Array]:
    lower, upper = np.clip(robot.q_limits, -1.4, 1.4).T
    return rng.uniform(lower, upper), rng.normal(size=robot.n_u)


def contact(robot: Robot, data: pin.Data, wheel: Wheel) -> tuple[Array, Array]:
    """Velocity of the point of the wheel that touches the ground, and the direction in which it rolls."""
    spatial = pin.getVelocity(
        robot.display_model, data, robot.display_model.getJointId(wheel.joint), pin.LOCAL_WORLD_ALIGNED
    )
    below = np.array([0.0, 0.0, -wheel.radius])
    placement = data.oMi[robot.display_model.getJointId(wheel.joint)]
    model = robot.display_model
    kind = model.joints[model.getJointId(wheel.joint)]
    made = kind.createData()
    kind.calc(made, np.zeros(model.nq))
    spin = placement.rotation @ np.array(made.S).ravel()[3:]
    return spatial.linear + np.cross(spatial.angular, below), np.cross(spin, [0.0, 0.0, 1.0])


# Rolling


@pytest.mark.parametrize("case", CASES)
def test_no_wheel_slips_where_it_touches_the_ground(base: Callable[[str], Robot], case: str) -> None:
    """The reported rates, applied to the full model, at random coordinates, inputs and caster angles."""
    robot, rng = base(case), np.random.default_rng(1)
    rolling, placements, count = Rolling(robot), Placements(robot), len(robot.wheels)
    assert count >= 2
    model = robot.display_model
    data = model.createData()
    slides = isinstance(robot.platform, Omnidirectional)
    for _ in range(10):
        q, u = random_state(robot, rng)
        angles = rolling.settled(q, u)
        trailing = np.array([swivel.trail != 0.0 for swivel in rolling._swivels], dtype=bool)
        angles[count:][trailing] = rng.uniform(-4, 4, trailing.sum())
        angles[:count] = rng.uniform(-9, 9, count)
        rates = rolling.rates(q, u, angles)
        velocity = placements.configuration(robot.S(q) @ u, rates)
        pin.forwardKinematics(model, data, placements.configuration(q, angles), velocity)
        for wheel in robot.wheels:
            slip, ahead = contact(robot, data, wheel)
            np.testing.assert_allclose(np.linalg.norm(ahead), 1.0, atol=1e-6)
            if wheel.roller or (slides and not wheel.swivel):
                # A wheel with rollers grips along one direction only.
                gripping = pin.rpy.rpyToMatrix(0.0, 0.0, wheel.roller) @ ahead
                assert abs(gripping @ slip) < 1e-10
            else:
                np.testing.assert_allclose(slip, 0.0, atol=1e-10, err_msg=wheel.joint)


@pytest.mark.parametrize("case", ["car_base", "car_base with front drive", "swerve", "tricycle"])
def test_a_steered_wheel_turns_at_its_rate(base: Callable[[str], Robot], case: str) -> None:
    """Its rate against differences of its angle along the motion with the same inputs."""
    robot, rng, step = base(case), np.random.default_rng(2), 1e-5
    rolling, count = Rolling(robot), len(robot.wheels)
    for _ in range(10):
        q, u = random_state(robot, rng)
        q_dot = robot.S(q) @ u
        ahead, behind = (rolling.settled(q + sign * step * q_dot, u)[count:] for sign in (1, -1))
        change = (ahead - behind + np.pi / 2) % np.pi - np.pi / 2
        rates = rolling.rates(q, u)[count:]
        np.testing.assert_allclose(change / (2 * step), rates, rtol=1e-6, atol=1e-6)


def driven(robot: Robot, inputs: Callable[[float], Array], t: Array, start: Array) -> tuple[Array, Array]:
    """q (N, n) and angles (N, D) by integrating q_dot = S(q) u and the reported rates together."""
    rolling = Rolling(robot)

    def rate(now: float, state: Array) -> Array:
        q, u = state[: robot.n], inputs(now)
        return np.concatenate([robot.S(q) @ u, rolling.rates(q, u, state[robot.n :])])

    first = np.concatenate([np.zeros(robot.n), start])
    solved = solve_ivp(rate, (t[0], t[-1]), first, "DOP853", t, rtol=1e-11, atol=1e-11)
    return solved.y[: robot.n].T, solved.y[robot.n :].T


@pytest.mark.parametrize("case", ["differential_base", "omni_base", "casters", "casters as omnidirectional"])
def test_angles_are_exact_under_constant_inputs(base: Callable[[str], Robot], case: str) -> None:
    """Wheels and casters between a few samples against the differential equation that they solve."""
    robot = base(case)
    u = np.array([0.6, -0.5, 0.4])[: robot.n_u] * (8.0 if "omega" not in robot.u_names else 1.0)
    t = np.linspace(0.0, 2.0, 5)
    start = 0.3 * np.arange(len(rolling_joints(robot)))
    q, expected = driven(robot, lambda now: u, t, start)
    np.testing.assert_allclose(Rolling(robot).angles(q, start=start), expected, atol=2e-8)


@pytest.mark.parametrize("case", ["differential_base", "car_base", "trailer_base", "tricycle", "casters"])
def test_angles_between_samples_are_of_third_order(base: Callable[[str], Robot], case: str) -> None:
    """With inputs that change, and bodies that turn against each other: the error of a step falls with its
    third power, that at the end with the second."""
    robot = base(case)
    rolling = Rolling(robot)

    def inputs(now: float) -> Array:
        return np.array([0.5 + 0.2 * math.sin(now), 0.3 * math.cos(1.3 * now)])[: robot.n_u]

    if case == "differential_base":
        u_of, scale = inputs, 8.0
    else:
        u_of, scale = inputs, 1.0
    errors = []
    for samples in (21, 41, 81):
        t = np.linspace(0.0, 2.0, samples)
        start = rolling.settled(np.zeros(robot.n), scale * u_of(0.0))
        q, expected = driven(robot, lambda now: scale * u_of(now), t, start)
        u = np.array([scale * u_of(now) for now in t])
        errors.append(np.abs(rolling.angles(q, u, start)[-1] - expected[-1]).max())
    assert errors[2] < 1e-3
    assert errors[0] / errors[1] > 3.3
    assert errors[1] / errors[2] > 3.3


def test_a_caster_that_is_pulled_trails(base: Callable[[str], Robot]) -> None:
    """Whichever way it looked at first, after a few trails' lengths its wheel is behind its swivel."""
    robot = base("differential_base")
    rolling, count = Rolling(robot), len(robot.wheels)
    t = np.linspace(0.0, 1.0, 21)
    q = np.zeros((len(t), robot.n))
    for way in (1.0, -1.0):
        q[:, 0] = way * t
        for begun in np.linspace(-3.0, 3.0, 8):
            start = np.zeros(len(rolling.joints))
            start[count:] = begun
            angles = rolling.angles(q, start=start)[-1, count:]
            # The wheel, at -trail e from the pivot, is behind it: cos(angle) = way.
            np.testing.assert_allclose(np.cos(angles), way, atol=1e-9)


def test_a_caster_step_is_many_small_ones() -> None:
    rng = np.random.default_rng(4)
    for _ in range(50):
        angle, twist = float(rng.uniform(-3, 3)), rng.normal(size=3) * [0.3, 0.3, 1.0]
        trail = float(rng.choice([-1, 1]) * rng.uniform(0.02, 0.2))

        def rate(now: float, state: Array, twist: Array = twist, trail: float = trail) -> list[float]:
            v, w, turn = twist
            cosine, sine = math.cos(state[0]), math.sin(state[0])
            return [(v * sine - w * cosine) / trail - turn, v * cosine + w * sine]

        expected = solve_ivp(rate, (0, 1), [angle, 0.0], "LSODA", rtol=1e-11, atol=1e-11).y[:, -1]
        found = caster_step(angle, (twist[0], twist[1], twist[2]), trail)
        np.testing.assert_allclose(found, expected, atol=1e-6)


def test_a_wheel_that_follows_keeps_still_at_rest(base: Callable[[str], Robot]) -> None:
    robot = base("swerve")
    rolling, count = Rolling(robot), len(robot.wheels)
    q = np.zeros((9, 3))
    q[3:6, 1] = [0.1, 0.2, 0.3]
    q[6:, 1] = 0.3
    u = np.zeros((9, 3))
    u[3:6, 1] = 1.0
    for angles in (rolling.angles(q, u)[:, count:], rolling.angles(q)[:, count:]):
        # It looks sideways from the start on: the way that it will go.
        assert np.ptp(angles, axis=0).max() < 1e-12
        model, data = robot.display_model, robot.display_model.createData()
        full = Placements(robot).configuration(q[0], np.concatenate([np.zeros(count), angles[0]]))
        pin.forwardKinematics(model, data, full, np.zeros(model.nv))
        for wheel in robot.wheels:
            np.testing.assert_allclose(np.abs(contact(robot, data, wheel)[1]), [0, 1, 0], atol=1e-12)
    start = np.zeros(len(rolling.joints))
    assert np.array_equal(rolling.angles(q, u, start)[:3, count:], np.zeros((3, 4)))


def test_a_car_steers_its_wheels_to_one_point(base: Callable[[str], Robot]) -> None:
    """Ackermann: the axles of both front wheels meet the rear axle where the car turns about."""
    robot = base("car_base")
    wheelbase = robot.platform.wheelbase  # type: ignore[attr-defined]  # it is a Car
    for steering in (-0.5, 0.2, 0.6):
        q = robot.q({"steering": steering})
        angles = Rolling(robot).settled(q)
        model, data = robot.display_model, robot.display_model.createData()
        pin.forwardKinematics(model, data, Placements(robot).configuration(q, angles))
        for name in ("front_left_wheel_joint", "front_right_wheel_joint"):
            placement = data.oMi[model.getJointId(name)]
            center, axle = placement.translation, placement.rotation[:, 1]
            meets = center - axle * center[0] / axle[0]
            assert meets[1] == pytest.approx(wheelbase / math.tan(steering), abs=1e-9)


def test_a_fixed_base_has_no_rolling_joints() -> None:
    robot = load("small_arm", platform="fixed")
    assert rolling_joints(robot) == ()
    assert wheel_rates(robot, robot.q(), np.ones(robot.n_u)).shape == (0,)
    assert Rolling(robot).angles(np.zeros((3, robot.n))).shape == (3, 0)


def test_wrong_numbers_are_refused(base: Callable[[str], Robot]) -> None:
    robot = base("car_base")
    with refused("u"):
        wheel_rates(robot, robot.q(), [1.0])
    with refused("angles"):
        wheel_rates(robot, robot.q(), [1.0, 0.0], [0.0])


# Pictures


def test_a_drawing_shows_the_wheels_as_they_steer(base: Callable[[str], Robot]) -> None:
    """Seen from above, the front tyres lie along the way in which their centres move; the rear ones ahead."""
    robot = base("car_base")
    q = robot.q({"x": 1.0, "theta": 0.4, "steering": 0.5})
    q_dot = robot.S(q)[:, 0]
    tyres = Silhouette(robot).at(q).wheels
    assert len(tyres) == 4
    for points in tyres:
        center = points.mean(axis=0)
        spread = np.linalg.svd((points - center)[:, :2])[2]
        # A tyre is longer than wide: its first principal direction is the one in which it rolls.
        way = q_dot[:2] + q_dot[2] * np.array([-(center[1] - q[1]), center[0] - q[0]])
        assert abs(spread[0] @ way) == pytest.approx(np.linalg.norm(way), rel=2e-3)


def test_a_drawing_shows_trailers_and_a_fixed_base() -> None:
    trailers = load("trailer_base")
    pose = Silhouette(trailers).at(trailers.q({"hitch1": 0.5, "hitch2": -0.3}))
    tail = np.array([-0.25, 0.0]) - 0.95 * np.array([math.cos(0.5), math.sin(0.5)])
    tail -= 0.7 * np.array([math.cos(0.2), math.sin(0.2)])
    axles = [0.5 * (one.mean(axis=0) + two.mean(axis=0))[:2] for one, two in pairwise(pose.wheels)]
    assert min(np.linalg.norm(axle - tail) for axle in axles) < 1e-9
    assert len(pose.heading) == 3
    arm = load("small_arm", platform="fixed")
    pose = Silhouette(arm, "ee").at(arm.q({"q2": 0.3}))
    assert pose.wheels == []
    assert pose.heading.shape == (0, 3)
    assert np.vstack(pose.body)[:, 2].min() == pytest.approx(0.0)
    # A column from the foot's underside up to the first joint.
    foot = [ends for ends in pose.links if np.allclose(ends[0], 0.0)]
    np.testing.assert_allclose(foot, [[[0, 0, 0], [0, 0, 0.03]]], atol=1e-12)


def test_a_robot_that_stands_still_can_be_played(tmp_path: Path) -> None:
    """A fixed base: nothing rolls, ghosts stand along the arm's way, the camera follows the origin."""
    arm = load("small_arm", platform="fixed")
    t = np.linspace(0.0, 2.0, 41)
    q = np.outer(np.sin(t), np.ones(arm.n))
    motion = Motion(arm, t, q, np.outer(np.cos(t), np.ones(arm.n)), frame="ee")
    assert write_html([motion], tmp_path / "a.html").exists()
    assert len(ghost_samples(motion, 4)) == 4
    with LiveViewer(arm) as viewer:
        viewer.display(q[-1])


def test_steering_and_trailing_wheels_are_in_the_frames(base: Callable[[str], Robot]) -> None:
    """No part, swivels among them, turns too far between two frames; samples keep their angles."""
    robot = base("differential_base")
    t = np.linspace(0.0, 2.0, 9)
    u = np.tile([4.0, -6.0], (9, 1))
    q, _ = driven(robot, lambda now: u[0], t, np.zeros(len(rolling_joints(robot))))
    frames = keyframes(Motion(robot, t, q, u), fps=30)
    assert frames.wheels.shape[1] == 6
    assert np.abs(np.diff(frames.wheels, axis=0)).max() <= LARGEST_TURN
    assert set(t) <= set(frames.t)


# Finding and measuring


@pytest.mark.parametrize("case", list(HAND_MADE))
def test_wheels_are_where_pinocchio_has_them(base: Callable[[str], Robot], case: str) -> None:
    """Centre, axis and pivot against forward kinematics of the display model at zero."""
    robot = base(case)
    model, data = robot.display_model, robot.display_model.createData()
    pin.forwardKinematics(model, data, np.zeros(model.nq))
    for wheel in robot.wheels:
        carrier = data.oMi[model.getJointId(wheel.carrier)]
        joint = data.oMi[model.getJointId(wheel.joint)]
        np.testing.assert_allclose(carrier.act(wheel.center), joint.translation, atol=1e-12)
        assert wheel.radius == pytest.approx(joint.translation[2], abs=1e-12)
        assert abs((carrier.rotation @ wheel.axis)[2]) < 1e-6
        if wheel.swivel:
            pivot = data.oMi[model.getJointId(wheel.swivel)].translation
            np.testing.assert_allclose(carrier.act(wheel.pivot), pivot, atol=1e-12)
    moving = set(model.names) - set(robot.model.names)
    assert moving == set(rolling_joints(robot))


def test_a_layout_measures_along_the_roots_axes(tmp_path: Path) -> None:
    """A hitch whose frame is turned and upside down: lengths still count along the body's axes at zero."""
    hitch = joint(
        "hitch", "base", "trailer", "revolute",
        f'<axis xyz="{DOWN}"/><limit lower="-1" upper="1.5" effort="1" velocity="1"/>',
        '<origin xyz="-0.3 0 0.2" rpy="3.141592653589793 0 0.5"/>',
    )  # fmt: skip
    # The wheel is 0.8 m behind the hitch and 0.2 m to its left; in the hitch's frame y is turned over.
    cosine, sine = math.cos(0.5), math.sin(0.5)
    x, y = -0.8 * cosine + 0.2 * sine, -(0.8 * sine + 0.2 * cosine)
    wheel = turning("wheel", "trailer", f"{x} {y} 0.1", f"{sine} {-cosine} 0")
    shoulder = turning("shoulder", "base", "0 0 1", UP)
    text = robot(link("base"), hitch, link("trailer"), wheel, shoulder)
    model = pin.buildModelFromXML(text)
    layout = measure_layout(Measured(model, (), "here"), None)
    assert [(p.joint, p.carrier, p.lower, p.upper) for p in layout.pivots] == [("hitch", "theta", -1, 1.5)]
    (found,) = layout.wheels
    assert (found.joint, found.carrier) == ("wheel_joint", "hitch")
    np.testing.assert_allclose([found.x, found.y, found.radius], [-0.8, 0.2, 0.1], atol=1e-12)
    assert math.remainder(found.heading, 2 * math.pi) == pytest.approx(0.0, abs=1e-9)


def test_a_layout_counts_to_the_left_and_leaves_out_what_is_an_arm() -> None:
    text = robot(
        link("base"),
        turning("steering", "base", "0.5 0 0.1", DOWN),
        turning("shoulder", "base", "0 0 0.5", UP),
        turning("elbow", "shoulder", "0.3 0 0", LEFT),
    )
    layout = measure_layout(Measured(pin.buildModelFromXML(text), (), "here"), None)
    assert [(p.joint, p.lower, p.upper) for p in layout.pivots] == [("steering_joint", -math.inf, math.inf)]
    assert layout.wheels == ()


@pytest.mark.parametrize(
    ("wheels", "code"),
    [
        ("wheel_joint", ""),
        (["nothing"], ""),
        (["arm_joint"], "no_wheel"),
        (["up_joint"], "no_wheel"),
        ({"wheel_joint": 0.0}, ""),
        (["far_joint"], "no_wheel"),
    ],
)
def test_wheels_that_are_none_are_refused(tmp_path: Path, wheels: Any, code: str) -> None:
    """By `load`, and by the layout that a platform is measured from."""
    text = robot(
        link("base"),
        turning("wheel", "base", "0 0.2 0.1", LEFT),
        turning("up", "base", "0.3 0 0.1", UP),
        turning("arm", "base", "0 0 1", LEFT),
        turning("far", "arm", "0.5 0 0", LEFT),
        turning("hand", "arm", "0.5 0 0.1", LEFT),
    )
    path = write(tmp_path / "robot.urdf", text)
    for call in (
        lambda: load(path, platform=Unicycle(), wheels=wheels),
        lambda: measure_layout(Measured(pin.buildModelFromXML(text), (), "here"), wheels),
    ):
        with pytest.raises(RobotError) as caught:
            call()
        if code:
            found = [(one.code, one.values["name"]) for one in caught.value.findings]
            assert found == [(code, wheels[0])]
        else:
            given = [wheels, wheels[0]] if not isinstance(wheels, dict) else [0.0]
            assert caught.value.got in given


def test_a_swivel_with_something_else_on_it_stays(tmp_path: Path) -> None:
    """A turret that happens to carry a wheel beside a camera; a wheel on a suspension is a wheel."""
    text = robot(
        link("base"),
        turning("turret", "base", "0 0 0.3", UP),
        turning("wheel", "turret", "0.1 0 -0.2", LEFT),
        turning("camera", "turret", "0.1 0 0.2", LEFT),
        joint("spring", "base", "strut", "prismatic", f'<axis xyz="{UP}"/>'
              '<limit lower="-1" upper="1" effort="1" velocity="1"/>', '<origin xyz="0 0.2 0.1"/>'),
        link("strut"),
        turning("other_wheel", "strut", "0 0.1 0", LEFT),
    )  # fmt: skip
    path = write(tmp_path / "robot.urdf", text)
    loaded = load(path)
    (sprung,) = loaded.wheels
    assert (sprung.joint, sprung.carrier, sprung.swivel) == ("other_wheel_joint", "theta", "")
    assert_found(
        of_code(loaded.notes, "undercarriage_held"), ("undercarriage_held", {"values": {"spring": 0.0}})
    )
    assert {*loaded.q_names[3:]} == {"wheel_joint", "turret_joint", "camera_joint"}
    found = {note.values["name"]: note for note in of_code(loaded.notes, "not_a_wheel")}
    assert holds(found["wheel_joint"], "not_a_wheel", why="swivel_carries_more", swivel="turret_joint")
    # Its spring may stand elsewhere.
    (low,) = load(path, lock={"spring": -0.05}).wheels
    np.testing.assert_allclose(low.center - sprung.center, [0, 0, -0.05], rtol=0, atol=1e-15)
