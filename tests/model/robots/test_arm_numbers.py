"""An arm's numbers: offsets, ratios, and where joints and fixed frames are."""

from __future__ import annotations

import math
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from odd_arm import JOINTS, KEYWORDS, elsewhere, loaded, odd_arm
from places import UR5
from urdf_parts import write

import nmm
from nmm.base.errors import InputError
from nmm.model.robots.loading.description import describe
from nmm.model.robots.loading.source import source_path
from nmm.model.robots.numbers import without_changes
from nmm.model.robots.origins import PARTS, movable_frames
from nmm.model.robots.robot import Robot

#: Fixed frames of the odd arm: one within another, one that joints are behind, that of a locked joint.
FRAMES = ("riser_joint", "bracket_joint", "camera_joint", "optical_joint", "held")


@pytest.fixture(scope="module")
def odd(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    return loaded(tmp_path_factory.mktemp("odd") / "odd.urdf")


def others(robot: Robot, frames: tuple[str, ...] = (), seed: int = 1) -> dict[str, float]:
    """Other values of all numbers of the arm and of these frames."""
    rng, values = np.random.default_rng(seed), dict[str, float]()
    for name, number in nmm.robot_numbers(robot, frames).items():
        if number.kind in ("offset", "origin"):
            values[name] = float(rng.uniform(-0.1, 0.1))
        elif number.kind == "ratio":
            values[name] = float(rng.choice([-1.0, 1.3]))
    return values


def places(robot: Robot, key: str) -> list[np.ndarray]:
    """All that says where joints, frames, masses and shapes are."""
    model = getattr(robot, key)
    rows = [placement.homogeneous for placement in model.jointPlacements]
    rows += [frame.placement.homogeneous for frame in model.frames]
    rows += [inertia.toDynamicParameters() for inertia in model.inertias]
    shapes = [robot.collision_model] if key == "model" else [robot.visual_model, robot.parts.collision_model]
    return rows + [shape.placement.homogeneous for some in shapes for shape in some.geometryObjects]


def assert_same(robot: Robot, other: Robot, atol: float = 0.0) -> None:
    for key in ("model", "display_model"):
        for ours, theirs in zip(places(robot, key), places(other, key), strict=True):
            np.testing.assert_allclose(ours, theirs, rtol=0, atol=atol)


def test_numbers_of_an_arm_by_name(odd: Robot) -> None:
    numbers = nmm.robot_numbers(odd)
    wanted = {
        "arm.1": PARTS,  # about no axis of its frame
        "slide": ("x", "z", "roll", "pitch", "yaw"),  # along -y
        "spin": ("x", "y", "z", "pitch", "yaw"),  # about x, which the file leaves out
        "finger": ("x", "z", "roll", "pitch", "yaw"),
    }
    assert [*wanted] == [*JOINTS]  # none of the joint that follows, nor of the locked one
    names = [
        name
        for joint, parts in wanted.items()
        for name in (f"offset.{joint}", f"ratio.{joint}", *(f"origin.{joint}.{part}" for part in parts))
    ]
    assert [*numbers] == names
    assert numbers["offset.slide"] == nmm.RobotNumber(0.0, 0.0, "m", "offset", "slide")
    assert numbers["offset.arm.1"].unit == numbers["origin.slide.yaw"].unit == "rad"
    assert numbers["ratio.spin"] == nmm.RobotNumber(1.0, 1.0, "1", "ratio", "spin")
    assert numbers["origin.arm.1.x"] == nmm.RobotNumber(0.0, 0.0, "m", "origin", "arm.1")


def test_frames_are_listed_that_are_asked_for_or_changed(odd: Robot) -> None:
    plain = [*nmm.robot_numbers(odd)]
    camera = [f"origin.camera.{part}" for part in PARTS]
    assert [*nmm.robot_numbers(odd, "camera")] == [*plain, *camera]
    assert [*nmm.robot_numbers(odd, ["camera", "finger", "camera"])] == [*plain, *camera]
    changed = nmm.with_numbers(odd, {"origin.camera.yaw": 0.1})
    assert [*nmm.robot_numbers(changed)] == [*plain, *camera]
    assert changed.changed_numbers == {"origin.camera.yaw": 0.1}
    assert changed.nominal == {"origin.camera.yaw": 0.0}
    assert changed.origins == {"camera": (0.0, 0.0, 0.0, 0.0, 0.0, 0.1)}
    assert changed.fingerprint != odd.fingerprint


@pytest.mark.parametrize("frames", [(), FRAMES])
def test_joints_and_frames_are_where_a_file_would_have_them(
    odd: Robot, frames: tuple[str, ...], tmp_path: Path
) -> None:
    values = {name: value for name, value in others(odd, frames).items() if name.startswith("origin.")}
    changed = nmm.with_numbers(odd, values)
    assert {*changed.origins} == {*JOINTS, *frames}
    # what a locked joint holds turned is in the file before it is turned: its axis is x
    origins = {name: np.array(row) for name, row in changed.origins.items()}
    if "held" in origins:
        turned, row = pin.SE3(pin.rpy.rpyToMatrix(0.3, 0, 0), np.zeros(3)), origins["held"]
        by = turned * pin.SE3(pin.rpy.rpyToMatrix(row[3:]), row[:3]) * turned.inverse()
        origins["held"] = np.concatenate([by.translation, pin.rpy.matrixToRpy(by.rotation)])
    expected = loaded(tmp_path / "odd.urdf", elsewhere(odd_arm(), origins))
    assert_same(changed, expected, 3e-8 if frames else 1e-12)  # a pitch near 90 degrees costs digits
    assert [frame.name for frame in changed.model.frames] == [frame.name for frame in expected.model.frames]


def test_a_real_arm_is_where_its_file_would_have_it(tmp_path: Path) -> None:
    file = source_path(UR5, ())
    robot = nmm.load(file, missing_meshes="skip")
    frames = ("world_joint", "ee_fixed_joint")
    values = {n: v for n, v in others(robot, frames, seed=2).items() if n.startswith("origin.")}
    changed = nmm.with_numbers(robot, values)
    text = elsewhere(describe(file).xml, {name: np.array(row) for name, row in changed.origins.items()})
    expected = nmm.load(write(tmp_path / "ur5.urdf", text), missing_meshes="skip")
    assert_same(changed, expected, 1e-9)


def test_a_link_is_another_name_of_its_fixed_joint(odd: Robot) -> None:
    values = dict(zip(PARTS, (0.01, -0.02, 0.03, 0.1, 0.2, -0.1), strict=True))
    by_joint, by_link = (
        nmm.with_numbers(odd, {f"origin.{name}.{part}": value for part, value in values.items()})
        for name in ("camera_joint", "camera")
    )
    q = odd.q({"arm.1": 0.3, "slide": 0.1, "spin": 1.0})
    placements = [nmm.Configuration(robot, q).placement("optical") for robot in (by_joint, by_link)]
    np.testing.assert_allclose(placements[0].homogeneous, placements[1].homogeneous, rtol=0, atol=1e-14)
    assert (
        np.abs(placements[0].homogeneous - nmm.Configuration(odd, q).placement("optical").homogeneous).max()
        > 0.01
    )


def test_nothing_is_lost_on_the_way_back(odd: Robot) -> None:
    values = others(odd, FRAMES)
    changed = nmm.with_numbers(odd, values)
    assert nmm.with_numbers(changed, values) is changed
    assert changed.changed_numbers == values
    assert nmm.with_numbers(odd, {name: n.value for name, n in nmm.robot_numbers(odd, FRAMES).items()}) is odd
    # by another way: numbers one after the other, and others in between
    step = odd
    for name, value in others(odd, FRAMES, seed=5).items():
        step = nmm.with_numbers(step, {name: value})
    assert_same(nmm.with_numbers(step, values), changed)
    for robot in (changed, step):
        back = without_changes(robot)
        assert_same(back, odd)
        assert (back.nominal, back.corrections, back.origins, back.unmoved) == ({}, {}, {}, None)
        np.testing.assert_allclose(back.q_limits, odd.q_limits, rtol=0, atol=1e-15)
        assert (back.notes, back.fingerprint) == (odd.notes, odd.fingerprint)
    assert_same(pickle.loads(pickle.dumps(changed)), changed)


def test_a_robot_without_an_arm_has_no_numbers_of_one() -> None:
    robot = nmm.load("differential_base")
    assert {number.kind for number in nmm.robot_numbers(robot).values()} == {"radius", "track"}
    assert (robot.origins, robot.unmoved) == ({}, None)


def test_limits_are_those_of_readings(odd: Robot) -> None:
    values = {"offset.arm.1": 0.1, "ratio.arm.1": -1.0, "offset.slide": 0.02, "ratio.slide": 0.5}
    changed = nmm.with_numbers(
        odd, {**values, "offset.spin": 0.3, "ratio.spin": -1.0, "offset.finger": 0.005}
    )
    limits = dict(zip(changed.q_names, changed.q_limits.tolist(), strict=True))
    assert limits["arm.1"] == pytest.approx([-1.9, 1.6])
    assert limits["slide"] == pytest.approx([-0.03, 0.22])
    assert limits["finger"] == pytest.approx([0.005, 0.04])  # up to where what follows it ends
    assert limits["spin"] == [-math.inf, math.inf]
    assert changed.endless.tolist() == odd.endless.tolist()
    speeds = changed.model.velocityLimit[3:] / odd.model.velocityLimit[3:]
    np.testing.assert_allclose(speeds, [1.0, 0.5, 1.0, 1.0, 1.0])
    assert changed.gear("slide") == (0.5, 0.02)
    assert changed.reading("arm.1", changed.q_limits[3, 0]) == pytest.approx(2.0)


def test_jacobians_are_those_of_the_changed_arm(odd: Robot) -> None:
    changed = nmm.with_numbers(odd, others(odd, FRAMES))
    q = np.array([0.3, -0.2, 0.7, 0.4, 0.1, -1.2, 0.02, 0.0])
    task = nmm.Task(nmm.Position("optical"), nmm.LiveTarget([0.0, 0.0, 0.0]), gain=1.0)
    controller = nmm.Controller(changed, task, nmm.DampedLeastSquares())
    J = controller.evaluate(0.0, q).J
    S = changed.S(q)

    def at(q: np.ndarray) -> np.ndarray:
        return np.array(nmm.Configuration(changed, q).placement("optical").translation)

    for column in range(changed.n_u):
        by = 1e-6 * S[:, column]
        np.testing.assert_allclose(J[:, column], (at(q + by) - at(q - by)) / 2e-6, rtol=0, atol=1e-8)


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ({"origin.camra.x": 0.1}, ["camra", "'camera'"]),
        ({"origin.slide.y": 0.1}, ["unknown number", "origin.slide.y", "origin.slide.x"]),
        ({"origin.slide.length": 0.1}, ["unknown number", "origin.slide"]),
        ({"origin.arm.x": 0.1}, ["'arm'", "arm.1"]),
        ({"origin.base_link.x": 0.1}, ["no place of its own"]),
        ({"origin.upper.x": 0.1}, ["arm.1 carries it"]),
        ({"origin.theta.x": 0.1}, ["a joint that moves"]),
        ({"origin.other.x": 0.1}, ["a joint that moves"]),
        ({"offset.other": 0.1}, ["unknown number", "offset.other"]),
        ({"offset.held": 0.1}, ["unknown number"]),
        ({"ratio.spin": 0.0}, ["ratio.spin", "other than 0"]),
        ({"offset.arm.1": 3.5}, ["offset.arm.1", "3.14159"]),
        ({"origin.camera.pitch": -4.0}, ["origin.camera.pitch", "3.14159"]),
        ({"origin.camera.x": math.nan}, ["origin.camera.x", "finite"]),
        ({"origin.camera.x": "wide"}, ["origin.camera.x"]),
        ({3: 0.1}, ["unknown number 3"]),
    ],
)
def test_what_is_no_number_is_told_by_name(odd: Robot, values: dict[Any, Any], told: list[str]) -> None:
    with pytest.raises(InputError) as error:
        nmm.with_numbers(odd, values)
    assert [text for text in told if text not in str(error.value)] == [], error.value
    assert len(str(error.value)) <= 300


@pytest.mark.parametrize("frames", ["lens", ["camera", "lens"], ["base_link"], 3, [3]])
def test_frames_that_are_none_are_told(odd: Robot, frames: Any) -> None:
    with pytest.raises(InputError) as error:
        nmm.robot_numbers(odd, frames)
    assert "frames" in str(error.value)


def test_frames_of_models_made_by_hand_are_moved_too() -> None:
    model, at = pin.Model(), pin.SE3(pin.rpy.rpyToMatrix(0.3, -0.2, 0.5), np.array([0.1, 0.2, 0.3]))
    turn = model.addJoint(0, pin.JointModelRevoluteUnaligned(np.array([0.6, 0.0, 0.8])), at, "turn")
    screw = model.addJoint(turn, pin.JointModelHX(0.1), at, "screw")
    model.addFrame(pin.Frame("tool", screw, 0, at, pin.FrameType.OP_FRAME))
    robot = nmm.load(model, platform="unicycle")
    assert {number.of for number in nmm.robot_numbers(robot).values()} == {"turn"}  # no screw has an offset
    changed = nmm.with_numbers(robot, {"origin.tool.z": 0.1, "origin.turn.yaw": 0.2})
    q = robot.q({"turn": 0.4, "screw": -0.3})
    there = nmm.Configuration(changed, q).placement("tool")
    data, own = model.createData(), model.copy()
    own.jointPlacements[turn] = at * pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, 0.2), np.zeros(3))
    pin.framesForwardKinematics(own, data, q[3:])
    place = data.oMf[own.getFrameId("tool")] * pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.1]))
    np.testing.assert_allclose(there.homogeneous, place.homogeneous, rtol=0, atol=1e-12)


def test_frames_that_wheels_are_on_stay() -> None:
    robot = nmm.mount("differential_base", "small_arm")
    assert movable_frames(robot) == (
        "arm_mount_joint", "arm_mount", "arm_base_link", "ee_joint", "ee", "gripper_joint", "gripper",
    )  # fmt: skip
    for frame in ("base_joint", "left_wheel", "left_wheel_joint", "front_caster_wheel_joint"):
        with pytest.raises(InputError):
            nmm.with_numbers(robot, {f"origin.{frame}.x": 0.1})


def test_a_mounted_arm_keeps_its_numbers() -> None:
    arm = nmm.with_numbers(
        nmm.load("small_arm", platform="fixed"),
        {"offset.q1": 0.1, "ratio.q2": -1.0, "origin.q3.x": 0.02, "origin.ee.yaw": 0.3},
    )
    base = nmm.with_numbers(nmm.load("differential_base"), {"track": 0.56, "origin.arm_mount.z": 0.01})
    for prefix in ("", "left_"):
        mounted = nmm.mount(base, arm, prefix=prefix)
        assert mounted.changed_numbers == {
            "track": 0.56, f"offset.{prefix}q1": 0.1, f"ratio.{prefix}q2": -1.0,
            f"origin.{prefix}q3.x": 0.02, "origin.arm_mount.z": 0.01, f"origin.{prefix}ee.yaw": 0.3,
        }  # fmt: skip
        plain = nmm.mount("differential_base", "small_arm", prefix=prefix)
        assert_same(without_changes(mounted), plain)
        assert_same(nmm.with_numbers(plain, mounted.changed_numbers), mounted)
    # an arm of a car: the numbers of its own platform go, its steering is a joint like others then
    cart = nmm.with_numbers(nmm.load("car_base"), {"wheelbase": 0.7, "offset.steering": 0.1})
    with_cart = nmm.mount("differential_base", cart, prefix="cart_")
    assert {*with_cart.changed_numbers} <= {"offset.cart_steering"}


def test_few_of_many_numbers_are_told(odd: Robot) -> None:
    changed = nmm.with_numbers(odd, others(odd, FRAMES))
    (note,) = [note for note in changed.notes if note.code == "calibrated"]
    assert len(note.values["numbers"]) > 40
    assert len(str(note)) < 350
    assert "more" in str(note)


def test_runs_keep_an_arm_s_numbers(tmp_path: Path) -> None:
    values = {"offset.q1": 0.02, "ratio.q2": -1.0, "origin.q2.x": 0.01, "origin.ee.yaw": 0.1}
    nmm.CalibrationFile.of(nmm.load("unicycle_2r"), values).save(tmp_path / "calibration.yaml")
    scenario = nmm.Scenario.load(
        "unicycle_2r_position", {"duration": 0.2, "robot.calibration": str(tmp_path / "calibration.yaml")}
    )
    run = scenario.run()
    run.save(tmp_path / "run")
    again = nmm.Trajectory.load(tmp_path / "run")
    assert again.robot.changed_numbers == run.robot.changed_numbers == values
    assert again.robot.fingerprint == run.robot.fingerprint


def test_calibration_files_have_an_arm_s_numbers(odd: Robot, tmp_path: Path) -> None:
    values = {**others(odd, ("camera",)), "origin.camera.z": 0.0}
    learned = nmm.CalibrationFile.of(odd, values, {"origin.camera.z": 0.001, "ratio.arm.1": 0.1})
    assert {*learned.numbers} == {*values}
    assert {*learned.places} == {*JOINTS, "camera"}
    assert learned.places["slide"] == (0.0,) * 7 + (-1.0, 0.0)
    assert learned.places["camera"] == pytest.approx((0.0, 0.03, 0.2, 0.3, 1.5701, 0.9, 0.0, 0.0, 0.0))
    read = nmm.CalibrationFile.load(learned.save(tmp_path / "calibration.yaml"))
    assert read.places == learned.places
    for robot in (odd, nmm.with_numbers(odd, others(odd, FRAMES, seed=7))):
        assert robot.apart_in_file(read.places) == dict.fromkeys(read.places, 0.0)
    turned = loaded(tmp_path / "turned.urdf", odd_arm().replace("0.6 0 0.8", "-0.6 0 -0.8"))
    moved = loaded(tmp_path / "moved.urdf", odd_arm().replace("0 0.03 0.2", "0 0.0301 0.2"))
    for other, joint in ((turned, "arm.1"), (moved, "arm.1")):
        with pytest.raises(InputError) as error:
            read.applied(other)
        assert f"its file has changed: {joint}" in str(error.value)
    read.applied(loaded(tmp_path / "mass.urdf", odd_arm().replace('mass value="0.5"', 'mass value="0.7"')))
    assert read.numbers["origin.camera.z"] == nmm.Calibrated(0.0, 0.0, 0.001)
    calibrated = nmm.load(
        write(tmp_path / "odd.urdf", odd_arm()), calibration=tmp_path / "calibration.yaml", **KEYWORDS
    )
    assert_same(calibrated, nmm.with_numbers(odd, values))
    for name, told in (("origin.camera.x", "origin.camra.x"), ("offset.spin", "offset.other")):
        text = (tmp_path / "calibration.yaml").read_text("utf-8").replace(f"{name}:", f"{told}:")
        with pytest.raises(InputError) as error:
            nmm.CalibrationFile.load(write(tmp_path / "wrong.yaml", text)).applied(odd)
        assert f"has no {told}" in str(error.value)
        assert name in str(error.value)  # among those that it has
