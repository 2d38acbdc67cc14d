"""`nmm.calibrate` by sightings: what they show of an arm, by oracles that share none of its code."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pinocchio as pin
import pytest
from helpers import simulated_sightings as sim
from places import DATA
from scipy.linalg import sqrtm
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

import nmm
from nmm.base.errors import InputError
from nmm.plugins.robot.calibration.arm.model import ArmModel

Array = np.ndarray


@cache
def arm(exact: bool = False, **truth: float) -> sim.Arm:
    """UR5 as it stands there; by its file's numbers where it is exact."""
    import tempfile

    return sim.Arm(truth or ({} if exact else sim.TRUTH), Path(tempfile.mkdtemp()))


def log_of(kind: str, count: int = 40, seed: int = 1, exact: bool = False, **more: Any) -> nmm.Sightings:
    made: Callable[..., nmm.Sightings] = getattr(sim, kind)
    readings = sim.looking(count) if kind == "corners" else sim.postures(count, seed)
    return made(arm(exact), readings, seed=seed, **more)


@cache
def calibration(kind: str, count: int = 40) -> nmm.ArmCalibration:
    return nmm.calibrate(sim.ur5(), log_of(kind, count))


def codes(found: nmm.ArmCalibration) -> list[str]:
    return [finding.code for finding in found.findings]


def mounted(found: nmm.ArmCalibration, name: str) -> Array:
    """(4, 4) of a mount that was learned."""
    at = [found.numbers[f"{name}.{part}"].after for part in PARTS]
    return sim.matrix((at[:3], at[3:]))


TIAGO = DATA + "tiago_description/robots/tiago_no_hand.urdf"
PARTS = ("x", "y", "z", "roll", "pitch", "yaw")
TRUE_MOUNTS = {
    f"{name}.{part}": value
    for name, at in (("tracker", sim.TRACKER), ("body", sim.BODY), ("eye", sim.CAMERA), ("board", sim.BOARD))
    for part, value in zip(PARTS, [*at[0], *at[1]], strict=True)
} | {f"point.{part}": value for part, value in zip("xyz", sim.POINT, strict=True)}


@pytest.mark.parametrize("kind", ["points", "poses", "corners"])
def test_what_is_learned_is_the_truth_within_its_deviations(kind: str) -> None:
    found = calibration(kind, 25 if kind == "corners" else 40)
    truth = dict.fromkeys(found.numbers, 0.0) | sim.TRUTH | TRUE_MOUNTS
    names = found.learned
    off = np.array([found.numbers[n].after - truth[n] for n in names])
    chi = off @ np.linalg.solve(found.covariance, off)
    assert chi < len(names) + 5.0 * np.sqrt(2.0 * len(names))
    learned = [name for name in sim.TRUTH if found.numbers[name].why == "learned"]
    assert len(learned) == len(sim.TRUTH)
    assert all(found.numbers[name].deviation < 1e-3 for name in learned)
    noise = found.noise[found.logs[0]]
    true = {"points": (2e-4, np.nan, np.nan), "poses": (2e-4, 1e-3, np.nan), "corners": (np.nan, np.nan, 0.2)}
    np.testing.assert_allclose(noise, true[kind], rtol=0.25)
    assert found.held_out is not None
    assert found.held_out.verdict == "better"
    assert codes(found) == []


def test_the_robot_that_was_learned_moves_as_the_one_that_stands_there() -> None:
    found = calibration("poses")
    readings = sim.postures(30, seed=99)
    true = np.linalg.inv(sim.matrix(sim.TRACKER)) @ arm().placements(readings, "tool0") @ sim.matrix(sim.BODY)

    def off(robot: nmm.Robot, mounts: nmm.ArmCalibration) -> Array:
        S, T = mounted(mounts, "tracker"), mounted(mounts, "body")
        made = []
        for row in zip(*readings.values(), strict=True):
            q = robot.q_from(dict(zip(readings, row, strict=True)), base=[0.0, 0.0, 0.0])
            made.append(np.linalg.inv(S) @ nmm.Configuration(robot, q).placement("tool0").homogeneous @ T)
        return np.linalg.norm((np.array(made) - true)[:, :3, 3], axis=1)

    held = nmm.calibrate(sim.ur5(), log_of("poses"), hold=("offset", "origin"))
    assert off(found.calibrated, found).max() < 3e-4
    assert np.median(off(sim.ur5(), held)) > 3e-3


def test_a_file_brings_the_same_robot_back(tmp_path: Path) -> None:
    found = calibration("points")
    found.save(tmp_path / "calibration.yaml")
    again = nmm.load(sim.ur5_file(), calibration=tmp_path / "calibration.yaml")
    assert again.changed_numbers == found.calibrated.changed_numbers
    assert len(again.changed_numbers) > 10
    told = nmm.CalibrationFile.load(tmp_path / "calibration.yaml").measured
    assert told["tracker.x"]["value"] == pytest.approx(3.0, abs=2e-3)
    assert told["held_out"]["verdict"] == "better"


@pytest.mark.parametrize("kind", ["points", "poses", "corners"])
def test_slopes_are_those_of_differences(kind: str) -> None:
    model = ArmModel(sim.ur5(), [log_of(kind, 6)], ratios=sim.UR5)
    rng = np.random.default_rng(3)
    values = model.first + 0.05 * rng.normal(size=len(model.first))
    for name, at in (("eye", sim.CAMERA), ("board", sim.BOARD), ("tracker", sim.TRACKER), ("body", sim.BODY)):
        for part, x in zip(PARTS, [*at[0], *at[1]], strict=True):
            if (i := model.index(f"{name}.{part}")) >= 0:
                values[i] = x
    free = [*range(len(values))]
    J = model.rows(values, free).J
    for k in free:
        step = np.zeros(len(values))
        step[k] = 1e-6
        slope = (model.rows(values + step).r - model.rows(values - step).r) / 2e-6
        np.testing.assert_allclose(J[:, k], slope, atol=1e-5 * max(1.0, np.abs(slope).max()))


def test_least_squares_are_those_of_a_plain_model_with_numeric_derivatives() -> None:
    there, log = arm(), log_of("points", 20)
    found = nmm.calibrate(sim.ur5(), log, hold="origin")
    names = found.learned
    plain = arm(exact=True)
    assert {n.split(".")[0] for n in names} == {"tracker", "point", "offset"}
    assert there is not plain

    def off(x: Array) -> Array:
        at = dict(zip(names, x, strict=True))
        readings = {j: log.readings[j] + at.get(f"offset.{j}", 0.0) for j in sim.UR5}
        hand = plain.placements(readings, "tool0")
        S = sim.matrix(
            ([at[f"tracker.{p}"] for p in "xyz"], [at[f"tracker.{p}"] for p in ("roll", "pitch", "yaw")])
        )
        point = np.array([*(at[f"point.{p}"] for p in "xyz"), 1.0])
        return ((np.linalg.inv(S) @ hand @ point)[:, :3] - log.seen).ravel()

    start = np.array([found.numbers[n].after for n in names])
    deviations = np.sqrt(np.diag(found.covariance))
    moved = start + 20.0 * deviations * np.where(np.arange(len(names)) % 2, 1.0, -1.0)
    fitted = least_squares(off, moved, x_scale=deviations, xtol=1e-12, ftol=1e-12)
    assert np.all(np.abs(fitted.x - start) < 0.01 * deviations)
    square = 2.0 * fitted.cost / (3 * len(log) - len(names))
    back = np.linalg.inv(fitted.jac.T @ fitted.jac)
    grouped = np.zeros_like(back)
    for J, e in zip(fitted.jac.reshape(-1, 3, len(names)), fitted.fun.reshape(-1, 3), strict=True):
        own = back @ J.T @ np.linalg.inv(sqrtm(np.eye(3) - J @ back @ J.T)) @ e
        grouped += np.outer(own, own)
    larger = np.maximum(np.diag(square * back), np.diag(grouped))
    assert np.any(larger > np.diag(square * back))
    np.testing.assert_allclose(deviations, np.sqrt(larger), rtol=0.01)


def park_martin(A: Array, B: Array) -> Array:
    """X (4, 4) of A X = X B for motions (K, 4, 4). (F. C. Park, B. J. Martin, Robot sensor calibration:
    solving AX = XB on the Euclidean group, IEEE Trans. Robotics and Automation 10, 1994.)"""
    a, b = (Rotation.from_matrix(m[:, :3, :3]).as_rotvec() for m in (A, B))
    M = b.T @ a
    values, vectors = np.linalg.eigh(M.T @ M)
    X = np.eye(4)
    X[:3, :3] = vectors @ np.diag(values**-0.5) @ vectors.T @ M.T
    rows = (A[:, :3, :3] - np.eye(3)).reshape(-1, 3)
    right = (np.einsum("ij,kj->ki", X[:3, :3], B[:, :3, 3]) - A[:, :3, 3]).ravel()
    X[:3, 3] = np.linalg.lstsq(rows, right, rcond=None)[0]
    return X


def board_poses(log: nmm.Sightings) -> Array:
    """(N, 4, 4) of the board in the camera, by OpenCV."""
    made = []
    for row in log.seen:
        there = np.isfinite(row[:, 0])
        _, turn, place = cv2.solvePnP(
            sim.GRID[there], row[there], sim.INTRINSICS.matrix, sim.INTRINSICS.distortion
        )
        at = np.eye(4)
        at[:3, :3], at[:3, 3] = cv2.Rodrigues(turn)[0], place[:, 0]
        made.append(at)
    return np.array(made)


def test_hand_eye_is_that_of_park_and_martin_and_nearer_by_corners() -> None:
    log = log_of("corners", 25, exact=True, noise=0.3)
    found = nmm.calibrate(sim.ur5(), log, hold=("offset", "origin"))
    assert {n.split(".")[0] for n in found.learned} == {"eye", "board"}
    hand, seen = arm(exact=True).placements(log.readings, "tool0"), board_poses(log)
    pairs = [(i, j) for i in range(25) for j in range(i)]
    A = np.array([np.linalg.inv(hand[j]) @ hand[i] for i, j in pairs])
    B = np.array([seen[j] @ np.linalg.inv(seen[i]) for i, j in pairs])
    closed, ours, true = park_martin(A, B), mounted(found, "eye"), sim.matrix(sim.CAMERA)
    theirs = np.linalg.norm(closed[:3, 3] - true[:3, 3])
    assert theirs < 3e-3
    assert np.linalg.norm(ours[:3, 3] - true[:3, 3]) < min(theirs, 2e-4)
    assert Rotation.from_matrix(ours[:3, :3].T @ closed[:3, :3]).magnitude() < 5e-3
    assert Rotation.from_matrix(ours[:3, :3].T @ true[:3, :3]).magnitude() < 5e-4


def test_hand_eye_of_poses_without_noise_is_exact() -> None:
    """Both mounts anywhere, also where roll and yaw are one."""
    log = log_of("poses", 12, exact=True, noise=(0.0, 0.0))
    for angles in ([0.3, np.pi / 2, 0.7], [3.0, -1.5, 2.0]):
        more = sim.matrix(([5.0, 1.0, -2.0], angles))
        seen = np.linalg.inv(more) @ log.seen
        other = nmm.Sightings("turned", log.readings, seen, "poses", on="tool0")
        found = nmm.calibrate(sim.ur5(), other, hold=("offset", "origin"))
        np.testing.assert_allclose(mounted(found, "tracker"), sim.matrix(sim.TRACKER) @ more, atol=1e-6)
        np.testing.assert_allclose(mounted(found, "body"), sim.matrix(sim.BODY), atol=1e-6)


@pytest.mark.parametrize("kind", ["points", "poses", "corners"])
def test_outliers_are_left_out_and_named(kind: str) -> None:
    log = log_of(kind, 25 if kind == "corners" else 40)
    seen = np.array(log.seen)
    if kind == "corners":
        there = np.argwhere(log.visible)
        wrong = there[:: len(there) // 9][:8]
        seen[wrong[:, 0], wrong[:, 1]] += [7.0, -9.0]
    else:
        places = seen[:, :3, 3] if kind == "poses" else seen
        places[[3, 17, 30]] += [[0.05], [0.3], [-0.02]]
    more = {"camera": log.camera, "board": log.board} if kind == "corners" else {}
    sensor = "eye" if kind == "corners" else ""
    bad = nmm.Sightings(log.name, log.readings, seen, log.kind, log.on, log.by, sensor=sensor, **more)
    found, clean = nmm.calibrate(sim.ur5(), bad), calibration(kind, 25 if kind == "corners" else 40)
    (told,) = [f for f in found.findings if f.code.endswith("_left_out")]
    if kind == "corners":
        assert told.code == "corners_left_out"
        assert told.values["count"] in range(8, 12)
    else:
        assert (told.values["count"], told.values["sample"]) == (3, 3)
    for name in sim.TRUTH:
        number = found.numbers[name]
        assert abs(number.after - clean.numbers[name].after) < 3.0 * number.deviation


def test_a_gear_the_other_way_round_is_found() -> None:
    readings = sim.postures(30)
    log = sim.points(arm(), readings)
    turned = {name: -x if name == "elbow_joint" else x for name, x in log.readings.items()}
    wrong = nmm.Sightings(log.name, turned, log.seen, "points", on="tool0")
    found = nmm.calibrate(sim.ur5(), wrong)
    number = found.numbers["ratio.elbow_joint"]
    assert (number.before, number.after, number.why) == (1.0, -1.0, "sign")
    assert "joints_count_back" in codes(found)
    assert abs(found.numbers["offset.elbow_joint"].after - sim.TRUTH["offset.elbow_joint"]) < 2e-3
    robot = found.calibrated
    assert robot.corrections["elbow_joint"][0] == -1.0
    q = robot.q_from({name: x[4] for name, x in turned.items()}, base=[0.0, 0.0, 0.0])
    at = nmm.Configuration(robot, q).placement("tool0").homogeneous
    expected = arm().placements({name: x[4:5] for name, x in readings.items()}, "tool0")[0]
    S, T = mounted(found, "tracker"), np.array([*(found.numbers[f"point.{p}"].after for p in "xyz"), 1.0])
    true = np.linalg.inv(sim.matrix(sim.TRACKER)) @ expected @ [*sim.POINT, 1.0]
    np.testing.assert_allclose(np.linalg.inv(S) @ at @ T, true, atol=5e-4)


def test_ratios_are_learned_where_they_are_asked_for() -> None:
    readings = sim.postures(60)
    there = arm(**{"ratio.elbow_joint": 1.03, "offset.elbow_joint": 0.05})
    found = nmm.calibrate(sim.ur5(), sim.points(there, readings), hold="origin", ratios="elbow_joint")
    ratio, offset = found.numbers["ratio.elbow_joint"], found.numbers["offset.elbow_joint"]
    assert ratio.why == "learned"
    assert abs(ratio.after - 1.03) < 4.0 * ratio.deviation < 1e-3
    assert abs(offset.after - 0.05) < 4.0 * offset.deviation < 2e-3
    with pytest.raises(InputError, match="unknown joint 'elbow'"):
        nmm.calibrate(sim.ur5(), log_of("points"), ratios=["elbow"])


def test_what_is_not_shown_stays_with_the_motion_that_would_show_it() -> None:
    readings = sim.postures(40) | {"wrist_3_joint": np.full(40, 0.4)}
    found = nmm.calibrate(sim.ur5(), sim.points(arm(), readings), hold="origin")
    (told,) = [f for f in found.findings if f.code == "not_seen"]
    assert told.values == {"names": ["offset.wrist_2_joint"], "motion": "move wrist_3_joint by more"}
    number = found.numbers["offset.wrist_2_joint"]
    assert (number.why, number.after, number.deviation) == ("not shown", 0.0, 0.0)
    assert found.numbers["offset.elbow_joint"].why == "learned"
    few = {name: 0.05 * x for name, x in sim.postures(40).items()}
    found = nmm.calibrate(sim.ur5(), sim.points(arm(), few))
    (told,) = [f for f in found.findings if f.code == "not_seen"]
    assert len(told.values["names"]) >= 5
    assert "shoulder_lift_joint" in told.values["motion"]


def test_numbers_that_others_do_as_well_stay_and_are_named() -> None:
    found = calibration("points")
    same = [name for name, number in found.numbers.items() if number.why == "as others"]
    assert {"offset.shoulder_pan_joint", "origin.shoulder_pan_joint.x"} <= {*same}
    assert all(found.numbers[name].after == 0.0 for name in same)
    # Of n turning joints 4 n + 6 numbers tell all (C. W. Wampler et al., 1995), but for a point's rotation.
    assert len(found.learned) + sum(n.why == "not shown" for n in found.numbers.values()) == 4 * 6 + 6 - 3
    # A tracker whose place is known tells the first joint's zero, too.
    known = dict(zip((f"tracker.{p}" for p in ("x", "y", "z", "roll", "pitch", "yaw")),
                     [*sim.TRACKER[0], *sim.TRACKER[1]], strict=True))  # fmt: skip
    assert nmm.calibrate(sim.ur5(), log_of("points"), hold=known).numbers[
        "offset.shoulder_pan_joint"
    ].why == "learned"  # fmt: skip


@pytest.mark.parametrize(
    ("first", "verdict"),
    [(sim.TRUTH, "better"), ({}, "no difference"), ({"offset.elbow_joint": 0.03}, "worse")],
)
def test_samples_that_were_not_learned_from_judge(first: Mapping[str, float], verdict: str) -> None:
    """In the last case the first samples are of another arm than the last."""
    readings, rest = sim.postures(70, 1), sim.postures(30, 2)
    other = arm(**first) if first else arm(exact=True)
    last = other if verdict == "better" else arm(exact=True)
    logs = sim.points(other, readings), sim.points(last, rest, seed=2)
    joined = {name: np.concatenate([readings[name], rest[name]]) for name in sim.UR5}
    seen = np.concatenate([log.seen for log in logs])
    log = nmm.Sightings("both", joined, seen, "points", on="tool0")
    found = nmm.calibrate(sim.ur5(), log)
    if verdict == "worse":
        assert found.held_out is None or found.held_out.verdict != "better"
        assert {"base_seems_moved", "samples_left_out", "arm_not_better"} & {*codes(found)}
        return
    assert found.held_out is not None
    assert found.held_out.verdict == verdict
    assert found.held_out.samples == 30


def test_a_base_that_moved_in_between_is_told() -> None:
    log = log_of("points", 40)
    seen = np.array(log.seen)
    seen[25:] += [0.004, -0.003, 0.0]
    moved = nmm.Sightings(log.name, log.readings, seen, "points", on="tool0")
    (told,) = [f for f in nmm.calibrate(sim.ur5(), moved).findings if f.code == "base_seems_moved"]
    assert told.values["sample"] == 25


def test_a_base_that_is_told_may_move() -> None:
    readings = sim.postures(40)
    rng = np.random.default_rng(5)
    base = np.column_stack([rng.uniform(-1.0, 1.0, (40, 2)), rng.uniform(-3.0, 3.0, 40)])
    at = np.tile(np.eye(4), (40, 1, 1))
    for k, (x, y, theta) in enumerate(base):
        at[k] = sim.matrix(([x, y, 0.0], [0.0, 0.0, theta]))
    hand = at @ arm().placements(readings, "tool0")
    seen = (np.linalg.inv(sim.matrix(sim.TRACKER)) @ hand @ [*sim.POINT, 1.0])[:, :3]
    seen += 2e-4 * rng.normal(size=seen.shape)
    log = nmm.Sightings("moved", readings, seen, "points", on="tool0", base=base)
    found = nmm.calibrate(sim.ur5(), log)
    assert found.noise["moved"].place == pytest.approx(2e-4, rel=0.25)
    # Where the base turns, the tracker's place does not make up for the first joint's.
    assert found.numbers["origin.shoulder_pan_joint.x"].why == "learned"
    assert found.numbers["offset.shoulder_pan_joint"].why == "learned"
    still = nmm.Sightings("still", readings, seen, "points", on="tool0")
    with pytest.raises(InputError, match="disagree by"):
        nmm.calibrate(sim.ur5(), still)
    once = np.array(sim.points(arm(), readings).seen)
    once[22:] += [0.4, -0.2, 0.0]
    moved = nmm.Sightings("once", readings, once, "points", on="tool0")
    with pytest.raises(InputError, match="seems to have moved before sample 22"):
        nmm.calibrate(sim.ur5(), moved)


def test_two_logs_share_what_has_one_name() -> None:
    a, b = log_of("points", 20, seed=1), log_of("points", 20, seed=2)
    b = nmm.Sightings("second.csv", b.readings, b.seen, "points", on="tool0")
    found = nmm.calibrate(sim.ur5(), [a, b])
    assert [*found.noise] == ["tracker.csv", "second.csv"]
    assert sum(name.startswith("tracker.") for name in found.learned) == 6
    other = nmm.Sightings("other.csv", b.readings, b.seen, "points", on="tool0", target="ball")
    names = nmm.calibrate(sim.ur5(), [a, other]).learned
    assert {"ball.x", "point.x"} <= {*names}
    elsewhere = nmm.Sightings("else.csv", b.readings, b.seen, "points", on="wrist_3_link")
    with pytest.raises(InputError, match=r"point is on wrist_3_link here, and on tool0"):
        nmm.calibrate(sim.ur5(), [a, elsewhere])


def test_logs_of_one_name_are_told_apart() -> None:
    """The second of them is numbered, and has a noise of its own."""
    a, b = (sim.points(arm(exact=True), sim.postures(20, k), noise, k) for k, noise in ((1, 1e-4), (2, 8e-4)))
    found = nmm.calibrate(sim.ur5(), [a, b], hold="origin")
    assert found.logs == ("tracker.csv", "tracker.csv (2)")
    assert [*found.noise] == [*found.logs]
    assert found.noise["tracker.csv"].place == pytest.approx(1e-4, rel=0.4)
    assert found.noise["tracker.csv (2)"].place == pytest.approx(8e-4, rel=0.4)
    assert b.name == "tracker.csv"


def test_a_robot_that_was_calibrated_goes_on_from_there() -> None:
    once = calibration("points").calibrated
    again = nmm.calibrate(once, log_of("points", 40))
    for name in sim.TRUTH:
        first, second = calibration("points").numbers[name], again.numbers[name]
        assert second.before == pytest.approx(first.after, abs=1e-12)
        assert second.after == pytest.approx(first.after, abs=0.02 * first.deviation)
    assert again.held_out is not None
    assert again.held_out.before == pytest.approx(again.held_out.after, rel=0.5)


def test_numbers_of_an_earlier_calibration_stay_in_the_file(tmp_path: Path) -> None:
    """Those that are held, and those that others do as well."""
    first = {"offset.shoulder_pan_joint": 0.3, "origin.wrist_1_joint.z": 0.004}
    before = nmm.with_numbers(sim.ur5(), first)
    found = nmm.calibrate(before, sim.points(arm(), sim.postures(30)), hold="origin")
    found.save(tmp_path / "calibration.yaml")
    again = nmm.load(sim.ur5_file(), calibration=tmp_path / "calibration.yaml")
    assert again.changed_numbers == found.calibrated.changed_numbers
    assert again.changed_numbers.items() >= first.items()
    number = nmm.CalibrationFile.load(tmp_path / "calibration.yaml").numbers["origin.wrist_1_joint.z"]
    assert np.isnan(number.deviation)


def test_a_camera_on_the_head_sees_a_marker_on_the_hand() -> None:
    """Two branches of one robot: the camera's own frame is learned, and joints of both with it."""
    robot = nmm.load(TIAGO)
    moved = ["torso_lift_joint", *(f"arm_{i}_joint" for i in range(1, 8)), "head_1_joint", "head_2_joint"]
    there = nmm.with_numbers(
        robot,
        {"offset.arm_4_joint": -0.015, "origin.xtion_rgb_optical_frame.x": 0.01},
    )
    rng = np.random.default_rng(2)
    limits = robot.q_limits[[robot.coordinate(name) for name in moved]].clip(-2.0, 2.0)
    readings = {name: rng.uniform(*limits[k], 60) for k, name in enumerate(moved)}
    data, camera, hand = there.model.createData(), "xtion_rgb_optical_frame", "arm_tool_link"
    seen = []
    for row in zip(*readings.values(), strict=True):
        q = np.zeros(there.n)
        for name, value in zip(moved, row, strict=True):
            factor, offset = there.gear(name)
            q[there.coordinate(name)] = factor * value + offset
        pin.framesForwardKinematics(there.model, data, there.following.placed(q))
        eye, tool = (data.oMf[there.frame_id(frame)] for frame in (camera, hand))
        seen.append((eye.inverse() * tool).homogeneous @ sim.matrix(sim.BODY))
    rows = np.array(seen)
    rows[:, :3, 3] += 3e-4 * rng.normal(size=(60, 3))
    log = nmm.Sightings("head", readings, rows, "poses", on=hand, by=camera)
    found = nmm.calibrate(robot, log, hold="origin")
    assert "torso_lift_joint" not in {name.partition(".")[2] for name in found.numbers}
    true = {"offset.arm_4_joint": -0.015, f"origin.{camera}.x": 0.01, "body.y": 0.05}
    for name, value in true.items():
        number = found.numbers[name]
        assert number.why == "learned"
        assert abs(number.after - value) < 4.0 * number.deviation < 4e-3, name
    assert found.calibrated.origins[camera][0] == found.numbers[f"origin.{camera}.x"].after
