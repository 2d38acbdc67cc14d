"""Playback without a browser: wheels that roll, and what the page holds."""

from __future__ import annotations

import base64
import json
import os
import sys
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
import trimesh
from playback_robot import drive, hand_built_robot, straight

from nmm.base.errors import InputError, RobotError
from nmm.base.files import UnwrittenError
from nmm.model.platforms import Unicycle
from nmm.model.robots.robot import Robot
from nmm.views.playback import Motion, play, wheel_angles, wheel_rates, write_html
from nmm.views.playback.keyframes import LARGEST_TURN, ghost_samples, ghost_times, keyframes
from nmm.views.playback.meshes import OFF
from nmm.views.playback.placements import Placements
from nmm.views.playback.scene import playback_scene
from nmm.views.playback.shapes import PageShape, shapes

fcl = pin.hppfcl
SHARE = Path(sys.prefix) / "lib" / f"python{sys.version_info[0]}.{sys.version_info[1]}" / "site-packages"
SHARE = SHARE / "cmeel.prefix" / "share"


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    return hand_built_robot(tmp_path_factory.mktemp("robot"))


# Rolling


def test_the_point_that_touches_the_ground_stands_still(robot: Robot) -> None:
    random = np.random.default_rng(1)
    placements = Placements(robot)
    model = robot.display_model
    data = model.createData()
    for _ in range(20):
        q, u = random.normal(size=robot.n), random.normal(size=robot.n_u)
        full = placements.configuration(q, random.normal(size=2))
        velocity = placements.configuration(robot.S(q) @ u, wheel_rates(robot, q, u))
        pin.forwardKinematics(model, data, full, velocity)
        for wheel in robot.wheels:
            joint = model.getJointId(wheel.joint)
            spatial = pin.getVelocity(model, data, joint, pin.LOCAL_WORLD_ALIGNED)
            contact = spatial.linear + np.cross(spatial.angular, [0.0, 0.0, -wheel.radius])
            np.testing.assert_allclose(contact, 0.0, atol=1e-13)


def test_a_wheel_turns_once_on_its_circumference(robot: Robot) -> None:
    motion = straight(robot, 2.0 * np.pi * 0.1, 0.0, np.linspace(0.0, 1.0, 7))
    left, right = wheel_angles(motion)[-1]
    assert left == pytest.approx(2.0 * np.pi, abs=1e-12)
    # Its axis points to the other side and it is half as large again.
    assert right == pytest.approx(-2.0 * np.pi * 0.1 / 0.15, abs=1e-12)


def test_on_the_spot_the_wheels_turn_oppositely(robot: Robot) -> None:
    motion = straight(robot, 0.0, 0.9, np.linspace(0.0, 5.0, 40))
    left, right = wheel_angles(motion)[-1]
    assert left == pytest.approx(-0.25 * 4.5 / 0.1, abs=1e-12)
    assert -right == pytest.approx(0.2 * 4.5 / 0.15, abs=1e-12)


@pytest.mark.parametrize("samples", [3, 60])
def test_constant_inputs_are_integrated_exactly(robot: Robot, samples: int) -> None:
    t = np.linspace(0.0, 3.0, samples)
    motion = straight(robot, 0.6, -0.8, t)
    expected = np.outer(t, wheel_rates(robot, motion.q[0], motion.u[0]))
    np.testing.assert_allclose(wheel_angles(motion), expected, atol=1e-12)


def test_angles_are_the_integral_of_the_rates(robot: Robot) -> None:
    motion = drive(robot, dt=0.002)
    rates = np.array([wheel_rates(robot, q, u) for q, u in zip(motion.q, motion.u, strict=True)])
    differences = (wheel_angles(motion)[2:] - wheel_angles(motion)[:-2]) / 0.004
    np.testing.assert_allclose(differences, rates[1:-1], atol=2e-5)


def test_a_robot_without_wheels_has_no_angles(robot: Robot) -> None:
    bare = Robot("bare", robot.model, robot.collision_model, robot.model, pin.GeometryModel(), Unicycle())
    motion = drive(bare)
    assert wheel_angles(motion).shape == (len(motion.t), 0)


# Motions and their frames


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"t": np.zeros(0), "q": np.zeros((0, 6)), "u": np.zeros((0, 5))}, "at least one sample"),
        ({"t": np.array([0.0, 0.0])}, "ascending"),
        ({"q": np.zeros((2, 5))}, r"q: expected a matrix of shape \(2, 6\)"),
        ({"u": np.zeros((3, 5))}, r"u: expected a matrix of shape \(2, 5\)"),
        ({"q": np.full((2, 6), np.nan)}, "q: expected finite numbers"),
        ({"path": np.zeros((2, 2))}, "path"),
        ({"desired": np.zeros(3)}, "desired"),
        ({"target": np.zeros(2)}, "target: expected 3 numbers"),
        ({"frame": "eee"}, "did you mean 'ee'"),
    ],
)
def test_a_wrong_motion_is_refused(robot: Robot, change: dict, message: str) -> None:
    fields = {"t": np.array([0.0, 1.0]), "q": np.zeros((2, 6)), "u": np.zeros((2, 5))} | change
    with pytest.raises(InputError, match=message):
        Motion(robot, **fields)


def test_the_driven_path_is_the_frames(robot: Robot) -> None:
    motion = drive(robot)
    data = robot.model.createData()
    for k in (0, 137, -1):
        pin.framesForwardKinematics(robot.model, data, motion.q[k])
        np.testing.assert_allclose(motion.driven[k], data.oMf[robot.frame_id("ee")].translation, atol=1e-15)


def test_frames_are_samples_and_both_ends_are_among_them(robot: Robot) -> None:
    motion = drive(robot, duration=3.98, dt=0.005)
    frames = keyframes(motion, fps=30)
    assert frames.t[0] == motion.t[0]
    assert frames.t[-1] == motion.t[-1]
    assert len(frames) == pytest.approx(3.98 * 30 + 1, abs=1)
    at = np.searchsorted(motion.t, frames.t)
    np.testing.assert_array_equal(motion.q[at], frames.q)
    np.testing.assert_array_equal(wheel_angles(motion)[at], frames.wheels)


def test_wheels_that_turn_fast_get_frames_in_between(robot: Robot) -> None:
    motion = straight(robot, 1.5, 0.0, np.linspace(0.0, 1.0, 3))
    frames = keyframes(motion, fps=30)
    assert np.abs(np.diff(frames.wheels, axis=0)).max() <= LARGEST_TURN
    assert frames.wheels[-1, 0] == pytest.approx(15.0)
    assert set(motion.t) <= set(frames.t)


def test_ghosts_stand_evenly_along_the_way(robot: Robot) -> None:
    # Fast at first, slow afterwards: even in time would crowd the end.
    t = np.linspace(0.0, 10.0, 2001)
    motion = straight(robot, 1.0, 0.0, t)
    slow = Motion(robot, 10.0 * (t / 10.0) ** 3 + 1e-9 * t, motion.q, motion.u)
    samples = ghost_samples(slow, 5)
    np.testing.assert_allclose(motion.q[samples, 0] / motion.q[-1, 0], np.linspace(0, 1, 5), atol=1e-3)
    assert ghost_samples(slow, 0) == []


@pytest.mark.parametrize("duration", [9.9, 14.0, 20.0, 25.0, 60.0])
def test_ghosts_stand_clear_of_one_another_at_round_times(duration: float) -> None:
    """One that drives on has three or four; one that parks, those before; one that stays, none."""
    times = np.linspace(0.0, duration, 80)

    def boxes(x: np.ndarray) -> np.ndarray:
        return np.array([[[at, -0.3, 0.0], [at + 0.8, 0.3, 1.0]] for at in x])

    found = ghost_times(0.0, duration, times, boxes(times))
    assert 3 <= len(found) <= 4
    digits = {f"{np.diff(found).min():e}"[0]}
    assert digits <= {"1", "2", "4", "5"}
    parked = ghost_times(0.0, duration, times, boxes(np.minimum(times, 0.3 * duration)))
    assert 2 <= len(parked) <= 4
    assert sum(t >= 0.3 * duration for t in parked) <= 1
    assert ghost_times(0.0, duration, times, boxes(0.1 * np.sin(times))) == []
    assert ghost_times(0.0, 0.0, times[:1], boxes(times[:1])) == []


# What the page holds


def unpacked(value: dict[str, str]) -> np.ndarray:
    (kind, text), *_ = value.items()
    return np.frombuffer(
        base64.b64decode(text), {"f32": "<f4", "f64": "<f8", "u32": "<u4", "u16": "<u2"}[kind]
    )


def mesh(shape: PageShape) -> trimesh.Trimesh:
    """The triangles that the page draws."""
    data = shape.geometry["data"]
    vertices = unpacked(data["attributes"]["position"]["array"]).reshape(-1, 3)
    return trimesh.Trimesh(vertices, unpacked(data["index"]["array"]).reshape(-1, 3))


def box(points: np.ndarray) -> np.ndarray:
    return np.array([points.min(axis=0), points.max(axis=0)])


def test_a_geometry_is_sent_once_however_many_motions_and_ghosts(robot: Robot) -> None:
    motions = [drive(robot, label="RG"), drive(robot, label="PG")]
    commands = playback_scene(motions, title="", ghosts=6)
    geometries = [json.dumps(c["data"], sort_keys=True) for c in commands if c["type"] == "geometry"]
    assert len(geometries) == len(set(geometries))
    one = playback_scene(motions[:1], title="", ghosts=0)
    assert len([c for c in one if c["type"] == "geometry"]) == len(geometries)
    assert [len(unpacked(c["joints"][0]["poses"])) for c in commands if c["type"] == "ghosts"] == [42, 42]


def test_a_mirrored_mesh_is_mirrored_and_seen_from_outside(robot: Robot) -> None:
    drawn = {}
    for geometry in robot.visual_model.geometryObjects:
        if "mesh" in geometry.name:
            (shape,) = shapes(geometry)
            drawn[geometry.name] = mesh(shape)
            expected = box(geometry.geometry.vertices())
            np.testing.assert_allclose(drawn[geometry.name].bounds, expected, atol=1e-6)
    assert drawn["mesh"].bounds[1, 1] == pytest.approx(0.2)
    assert drawn["mirrored mesh"].bounds[0, 1] == pytest.approx(-0.2)
    assert drawn["mesh"].volume == pytest.approx(0.001)
    assert drawn["mirrored mesh"].volume == pytest.approx(0.001)


def test_a_file_of_several_parts_keeps_them_and_their_colours() -> None:
    folder = SHARE / "example-robot-data" / "robots" / "ur_description"
    path = folder / "urdf" / "ur5_robot.urdf"
    _, _, visuals = pin.buildModelsFromUrdf(str(path), package_dirs=[str(SHARE)])
    assert len(visuals.geometryObjects) == 7
    for geometry in visuals.geometryObjects:
        pieces = shapes(geometry)
        assert len({piece.color for piece in pieces}) > 1
        drawn = box(np.vstack([mesh(piece).vertices for piece in pieces]))
        whole = box(geometry.geometry.vertices())
        np.testing.assert_allclose(drawn, whole, atol=OFF * float(np.linalg.norm(whole[1] - whole[0])))


def test_a_convex_shape_is_drawn_whole() -> None:
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 2) for z in (0, 3)], dtype=float)
    vertices = fcl.StdVec_Vec3s()
    for corner in corners:
        vertices.append(corner)
    convex = fcl.ConvexBase.convexHull(vertices, False, "")
    geometry = pin.GeometryObject("convex", 0, pin.SE3.Identity(), convex)
    (shape,) = shapes(geometry)
    assert mesh(shape).volume == pytest.approx(6.0)


def test_a_display_model_that_lacks_a_wheel_is_refused(robot: Robot) -> None:
    nothing = pin.GeometryModel()
    wrong = Robot("wrong", robot.model, nothing, robot.model, nothing, Unicycle(), robot.wheels)
    with pytest.raises(RobotError, match="joint 'left'"):
        playback_scene([drive(wrong)], title="")


def test_the_last_frame_is_not_after_the_end(robot: Robot) -> None:
    # In single precision 0.1 is more than 0.1: the player, which stops at 0.1, would never reach that frame.
    for duration in (0.1, 0.3, 1.7):
        commands = playback_scene([drive(robot, duration=duration)], title="")
        (animation,) = [c for c in commands if c["type"] == "set_animation"]
        for moving in animation["animations"]:
            for track in moving["clip"]["tracks"]:
                times = unpacked(track["times"])
                assert duration - 1e-6 < float(times[-1]) <= duration
                assert np.all(np.diff(times) > 0.0)


# The file


def test_the_same_motion_makes_the_same_small_file(robot: Robot, tmp_path: Path) -> None:
    motion = drive(robot, duration=20.0, target=np.array([1.0, 2.0, 0.5]))
    first = write_html([motion], tmp_path / "a.html", title="A & B")
    second = write_html([motion], tmp_path / "b.html", title="A & B")
    assert first.read_bytes() == second.read_bytes()
    assert first.stat().st_size < 2_000_000
    assert "<title>A &amp; B</title>" in first.read_text(encoding="utf-8")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.html", "b.html"]


def test_a_label_cannot_leave_its_place(robot: Robot, tmp_path: Path) -> None:
    motion = drive(robot, duration=1.0, label="</script><script>alert(1)</script>")
    text = write_html([motion], tmp_path / "a.html", title="</title><b>").read_text(encoding="utf-8")
    assert "alert(1)</script>" not in text
    assert "</title><b>" not in text


def test_a_file_that_cannot_be_written_leaves_the_old_one(
    robot: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.html"
    path.write_text("old", encoding="utf-8")

    def full(*names: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", full)
    with pytest.raises(UnwrittenError, match=r"a\.html: cannot be written: No space left"):
        write_html([drive(robot, duration=1.0)], path)
    assert [p.read_text(encoding="utf-8") for p in tmp_path.iterdir()] == ["old"]


def test_no_motion_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="at least one motion"):
        write_html([], tmp_path / "a.html")
    with pytest.raises(InputError, match="at least one motion"):
        play([])


def test_one_sample_is_a_motion(robot: Robot, tmp_path: Path) -> None:
    motion = Motion(robot, np.zeros(1), np.ones((1, 6)), np.zeros((1, 5)), frame="ee")
    assert write_html([motion], tmp_path / "a.html").exists()
