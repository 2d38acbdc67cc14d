"""An arm's calibration by what is not as it takes it to be: it says so, or knows its numbers less well."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from helpers import simulated_sightings as sim

import nmm
from nmm.base.errors import InputError
from nmm.plugins.robot.calibration.arm.fit import expect_most
from nmm.plugins.robot.calibration.arm.model import ArmModel

Array = np.ndarray
PARTS = ("x", "y", "z", "roll", "pitch", "yaw")
JOINTS = [f"q{i}" for i in range(1, 6)]
BALL = [0.03, 0.02, 0.01]


def arm(**truth: float) -> nmm.Robot:
    """The arm that stands there, whose second zero is off."""
    return nmm.with_numbers(nmm.load("small_arm"), {"offset.q2": 0.02} | truth)


def postures(count: int = 50) -> Array:
    robot = nmm.load("small_arm")
    limits = robot.q_limits[[robot.coordinate(name) for name in JOINTS]].clip(-1.9, 1.9)
    return np.random.default_rng(0).uniform(*limits.T, (count, 5))


def placed(robot: nmm.Robot, joints: list[str], q: Array, frame: str = "ee") -> Array:
    """(N, 4, 4)."""
    made = []
    for row in q:
        at = robot.q_from(dict(zip(joints, row, strict=True)), base=[0.0, 0.0, 0.0])
        made.append(nmm.Configuration(robot, at).placement(frame).homogeneous)
    return np.array(made)


def ball(robot: nmm.Robot, q: Array, noise: float = 1e-4) -> Array:
    """(N, 3) of a ball on the hand, as a tracker in the world sees it."""
    seen = (np.linalg.inv(sim.matrix(sim.TRACKER)) @ placed(robot, JOINTS, q) @ [*BALL, 1.0])[:, :3]
    return seen + noise * np.random.default_rng(1).normal(size=seen.shape)


def points(q: Array, seen: Array, name: str = "points") -> nmm.Sightings:
    return nmm.Sightings(name, dict(zip(JOINTS, q.T, strict=True)), seen, "points", on="ee")


def zeros(*logs: nmm.Sightings) -> nmm.ArmCalibration:
    return nmm.calibrate(nmm.load("small_arm"), [*logs], hold="origin")


def codes(found: nmm.ArmCalibration) -> list[str]:
    return [finding.code for finding in found.findings]


def test_a_mount_on_an_arm_that_is_off_is_within_its_deviations(tmp_path: Path) -> None:
    """The corners of a picture are off together: by how the arm stands."""
    there, off = sim.Arm(sim.TRUTH, tmp_path), []
    for seed in (0, 1):
        log = sim.corners(there, sim.looking(40, seed), seed=seed)
        found = nmm.calibrate(sim.ur5(), log, hold=("origin", "offset"))
        for part, true in zip(PARTS, [*sim.CAMERA[0], *sim.CAMERA[1]], strict=True):
            number = found.numbers[f"eye.{part}"]
            off.append((number.after - true) / number.deviation)
    assert np.sqrt(np.mean(np.square(off))) < 2.0


def test_a_tracker_that_stands_elsewhere_in_another_log_is_refused() -> None:
    q = postures()
    seen = ball(arm(), q)
    moved = seen @ np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]) + [0.1, 0.0, 0.0]
    logs = points(q[:25], seen[:25], "a"), points(q[25:], moved[25:], "b")
    with pytest.raises(InputError, match="each log fits by itself, and not together: tracker or point"):
        zeros(*logs)
    assert codes(zeros(logs[0], points(q[25:], seen[25:], "b"))) == []


def test_a_gear_the_other_way_round_is_found_where_it_hardly_moves_what_is_seen() -> None:
    q = postures()
    found = nmm.calibrate(nmm.load("small_arm"), points(q * [1, 1, 1, 1, -1], ball(arm(), q)))
    assert found.numbers["ratio.q5"].after == -1.0
    assert "joints_count_back" in codes(found)
    assert found.noise["points"].place < 2e-4


def test_noise_that_no_tracker_has_is_told() -> None:
    q = postures()
    (told,) = [f for f in zeros(points(q, ball(arm(), q, noise=4e-3))).findings if f.code == "arm_noisy"]
    assert told.values["noise"] == pytest.approx(4e-3, rel=0.3)
    logs = points(q[:25], ball(arm(), q[:25])), points(q[25:], ball(arm(), q[25:], noise=1e-3), "other")
    (told,) = zeros(*logs).findings
    assert (told.code, told.values["log"], told.values["other"]) == ("arm_noise_apart", "other", "points")


def test_a_hand_s_poses_by_the_joints_own_readings_are_told() -> None:
    q = postures()
    assert "arm_exact" not in codes(zeros(points(q, ball(arm(), q, noise=1e-5))))
    tool = ball(arm(), q, noise=0.0).astype(np.float32).astype(float)
    assert codes(zeros(points(q, tool))).count("arm_exact") == 1


@pytest.mark.parametrize("scale", [1.0, 1.02, 0.97])
def test_a_scale_of_what_sees_is_told(scale: float) -> None:
    q = postures()
    found = nmm.calibrate(nmm.load("small_arm"), points(q, scale * ball(arm(), q)))
    told = [f.values for f in found.findings if f.code == "arm_scaled"]
    if scale == 1.0:
        assert told == []
        return
    assert told[0]["percent"] == pytest.approx(100.0 * abs(scale - 1.0), abs=0.3)
    assert told[0]["longer"] == ("longer" if scale > 1.0 else "shorter")


def test_the_scale_of_a_board_is_told(tmp_path: Path) -> None:
    log = sim.corners(sim.Arm(sim.TRUTH, tmp_path), sim.looking(25))
    more = {"on": "world", "by": "tool0", "sensor": "eye", "camera": log.camera}
    printed = nmm.Sightings("fit", log.readings, log.seen, "corners", board=1.03 * sim.GRID, **more)
    (told,) = nmm.calibrate(sim.ur5(), printed).findings
    assert told.code == "arm_scaled"
    assert told.values["percent"] == pytest.approx(3.0, abs=0.6)


def test_mirrored_axes_are_refused() -> None:
    q = postures()
    for axis in range(3):
        mirrored = np.where(np.arange(3) == axis, -1.0, 1.0) * ball(arm(), q)
        with pytest.raises(InputError, match="seem left-handed"):
            zeros(points(q, mirrored))


def test_poses_whose_places_alone_are_mirrored_are_refused() -> None:
    q = postures()
    seen = np.linalg.inv(sim.matrix(sim.TRACKER)) @ placed(arm(), JOINTS, q) @ sim.matrix(sim.BODY)
    seen[:, 1, 3] *= -1.0
    log = nmm.Sightings("p", dict(zip(JOINTS, q.T, strict=True)), seen, "poses", on="ee")
    with pytest.raises(InputError, match="seem left-handed"):
        zeros(log)


def test_a_joint_that_slipped_is_told() -> None:
    q = postures()
    seen = np.concatenate([ball(arm(), q[:36]), ball(arm(**{"offset.q3": 0.003}), q[36:])])
    found = zeros(points(q, seen))
    assert found.held_out is not None
    (told,) = [f for f in found.findings if f.code == "arm_changed"]
    assert told.values["samples"] == found.held_out.samples == 15
    assert found.held_out.lost > 5
    assert found.held_out.times > 3.0
    assert found.held_out.verdict == "worse"
    clean = zeros(points(q, ball(arm(), q))).held_out
    assert clean is not None
    assert (clean.lost, clean.verdict) == (0, "better")
    assert clean.times < 1.3


def test_samples_that_all_of_them_explain_no_better_are_not_left_out_of_the_judgement() -> None:
    """By a fit of all of them the last are outliers; they are what was held out all the same."""
    q = postures()
    seen = np.concatenate([ball(arm(), q[:38]), ball(arm(**{"offset.q3": 0.02}), q[38:])])
    found = zeros(points(q, seen))
    assert found.held_out is not None
    assert found.held_out.samples == 15
    assert found.held_out.lost >= 8
    assert found.held_out.verdict == "worse"


def test_many_samples_left_out_are_told_and_most_are_refused() -> None:
    q = postures()
    rng = np.random.default_rng(2)
    order = rng.permutation(50)
    for count in (8, 20):
        seen = ball(arm(), q)
        seen[order[:count]] += 0.05 * rng.normal(size=(count, 3))
        told = [f.values for f in zeros(points(q, seen)).findings if f.code == "many_left_out"]
        assert [round(values["percent"]) for values in told] == ([] if count == 8 else [40])
    model = ArmModel(nmm.load("small_arm"), [points(q, ball(arm(), q))])
    expect_most(model)
    model.views[0].taken[order[:26]] = False
    with pytest.raises(InputError, match="26 samples of 50 are off as no noise explains"):
        expect_most(model)


def robot_of(tmp_path: Path, axes: dict[str, tuple[str, str]]) -> nmm.Robot:
    """A chain of joints (axis, place) that carries a camera; an axis "p 0 0 1" slides."""
    inertial = (
        '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
    )
    text, before = f'<robot name="r"><link name="base_link">{inertial}</link>', "base_link"
    rows = [(name, *axes[name]) for name in axes]
    for name, axis, at in [*rows, ("eye", "", "0.11 0 0.05"), ("camera_optical_frame", "", "0 0 0")]:
        kind = "fixed" if not axis else "prismatic" if axis.startswith("p") else "revolute"
        moves = f'<axis xyz="{axis.lstrip("p ")}"/><limit lower="-2" upper="2" effort="1" velocity="1"/>'
        turn = "-1.5708 0 -1.5708" if name == "camera_optical_frame" else "0 0 0"
        text += f'<link name="{name if not axis else name + "_link"}">{inertial}</link>'
        text += f'<joint name="{name if axis else name + "_joint"}" type="{kind}"><parent link="{before}"/>'
        before = name if not axis else name + "_link"
        text += f'<child link="{before}"/><origin xyz="{at}" rpy="{turn}"/>{moves if axis else ""}</joint>'
    file = tmp_path / "r.urdf"
    file.write_text(text + "</robot>")
    return nmm.load(file)


def of_camera(robot: nmm.Robot, joints: list[str], q: Array, there: nmm.Robot) -> nmm.ArmCalibration:
    """By poses of a board in the world that the camera on the hand sees, of zeros and origins that hold."""
    camera = "camera_optical_frame"
    board = sim.matrix(([0.5, 0.2, 0.1], [0.1, 0.2, 0.3]))
    seen = np.linalg.inv(placed(there, joints, q, camera)) @ board
    seen[:, :3, 3] += 1e-4 * np.random.default_rng(3).normal(size=(len(q), 3))
    readings = dict(zip(joints, q.T, strict=True))
    log = nmm.Sightings("poses", readings, seen, "poses", on="world", by=camera)
    return nmm.calibrate(robot, log, hold=("origin", "offset"))


def test_a_number_of_a_frame_that_others_do_as_well_stays(tmp_path: Path) -> None:
    axes = {"j1": ("0 0 1", "0 0 0.4"), "j2": ("0 0 1", "0.3 0 0"), "j3": ("0 0 1", "0.25 0 0")}
    robot = robot_of(tmp_path, axes | {"j4": ("p 0 0 1", "0 0 0")})
    rng = np.random.default_rng(0)
    q = np.column_stack([rng.uniform(-1.8, 1.8, (40, 3)), rng.uniform(-0.1, 0.1, 40)])
    found = of_camera(robot, ["j1", "j2", "j3", "j4"], q, robot)
    number = found.numbers["origin.camera_optical_frame.y"]
    assert number.why in ("as others", "not shown")
    assert number.after == 0.0
    assert "origin.camera_optical_frame.y" not in found.calibrated.changed_numbers
    assert found.numbers["board.z" if "board.z" in found.numbers else "body.z"].after == pytest.approx(
        0.1, abs=1e-3
    )


def test_a_frame_whose_turn_is_not_shown_stays_whole(tmp_path: Path) -> None:
    axes = {"j1": ("0 0 1", "0 0 0.2"), "j2": ("0 1 0", "0 0 0.1"), "j3": ("0 1 0", "0.3 0 0"),
            "j4": ("1 0 0", "0.1 0 0.05")}  # fmt: skip
    robot = robot_of(tmp_path, axes)
    q = np.tile([0.0, -0.4, 0.9, 0.3], (30, 1))
    q[:, 0] = np.random.default_rng(0).uniform(-1.8, 1.8, 30)
    found = of_camera(robot, [*axes], q, robot)
    frame = {name: number for name, number in found.numbers.items() if "camera" in name}
    assert {number.why for number in frame.values()} == {"not shown"}
    assert {number.after for number in frame.values()} == {0.0}
    assert not found.calibrated.changed_numbers
    (told,) = [f for f in found.findings if f.code == "not_seen"]
    assert {*told.values["names"]} == {*frame}
    assert found.noise["poses"].place < 2e-4
