"""Which platform a file's wheels allow, against rolling without slip by Pinocchio's own reader."""

from __future__ import annotations

import math
import re
import shlex
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
import trimesh
from findings import assert_found, codes, of_code
from rolling_law import LEFT, Rolling, base, turns, wheel
from urdf_parts import write
from wheeled_cases import CASES, DRIVE, Case, all_corners, corners, pair, steered

import nmm
from nmm.cli.exit_status import status_of
from nmm.model.robots.loading.report import file_report


def loaded(tmp_path: Path, case: Case, **more: Any) -> nmm.Robot:
    return nmm.load(write(tmp_path / "robot.urdf", case.text), **{**case.options, **more})


def twists(robot: nmm.Robot, q: np.ndarray) -> np.ndarray:
    """(3, p) The twists of the file's root link, on its own axes, for inputs of 1."""
    data, found = robot.model.createData(), []
    frame = robot.model.getFrameId("base_link", pin.FrameType.BODY)
    for u in np.eye(robot.n_u)[: robot.platform.p]:
        pin.forwardKinematics(robot.model, data, q, robot.S(q) @ u)
        motion = pin.getFrameVelocity(robot.model, data, frame, pin.ReferenceFrame.LOCAL)
        np.testing.assert_allclose([motion.linear[2], *motion.angular[:2]], 0.0, atol=1e-12)
        found.append([*motion.linear[:2], motion.angular[2]])
    return np.array(found).T


def postures(robot: nmm.Robot, case: Case, law: Rolling) -> list[np.ndarray]:
    """At rest and at two angles of what steers, turned in the world; of several steered wheels such that all
    roll about one point."""
    found = [robot.q({"x": 0.3, "theta": 0.4})]
    own = list(robot.q_names[3 : robot.platform.n_p])
    if len(own) > 1:
        middle = np.mean([0.0 if not case.fixed else law.centre(name) for name in case.fixed or ("",)])
        for turn in (0.3, -0.2):
            twist = np.array([1.0 + turn * complex(middle).imag, -turn * complex(middle).real, turn])
            angles = {
                pivot: law.pointed(name, pivot, twist) * law.sign(pivot)
                for name, pivot in case.steered.items()
            }
            found.append(robot.q({"theta": -1.0, **angles}))
    elif own:
        found += [robot.q({"theta": -1.0, own[0]: angle}) for angle in (0.3, -0.2)]
    return found


@pytest.mark.parametrize("case", CASES.values(), ids=CASES)
def test_the_platform_is_what_the_wheels_allow(tmp_path: Path, case: Case) -> None:
    robot, law = loaded(tmp_path, case), Rolling(case.text)
    assert robot.platform.name == case.kind
    assert {wheel.joint for wheel in robot.wheels} >= {*case.fixed, *case.steered}
    names = {str(name) for name in robot.display_model.names}
    assert not {*case.stand} & (names | {*robot.q_names})
    assert {*robot.q_names[robot.platform.n_p :]} == {"pan", "lift", *case.arm}
    shown = loaded(tmp_path, case, platform=case.measured_as) if case.measured_as else robot
    lengths = shown.platform.lengths
    assert {name: lengths[name] for name in case.lengths} == pytest.approx(dict(case.lengths), abs=1e-9)
    for q in postures(robot, case, law):
        follows(robot, q, case, law)


def follows(robot: nmm.Robot, q: np.ndarray, case: Case, law: Rolling) -> None:
    """The law of the kind, at q."""
    moves, platform = twists(robot, q), robot.platform
    fixed = np.array([law.row(name, {}) for name in case.fixed]).reshape(-1, 3)
    if case.kind in ("omnidirectional", "mecanum"):
        assert np.linalg.matrix_rank(moves) == 3
        if case.fixed and case.kind == "omnidirectional":
            # Without rollers it could turn in place at most; their own turns tell every motion.
            along = [np.cross([0, 0, 1.0], [*row[:2], 0.0])[:2] for row in fixed]
            lines = [
                [*way, way @ [-law.centre(name).imag, law.centre(name).real]]
                for name, way in zip(case.fixed, along, strict=True)
            ]
            assert np.linalg.matrix_rank(fixed, tol=1e-6) == 2
            assert np.linalg.matrix_rank(lines, tol=1e-6) == 3
        for name, pivot in case.steered.items():
            for twist in moves.T:
                trails = abs(law.row(name, {}, [pivot])[3]) > 1e-6
                angle = 0.0 if trails else law.pointed(name, pivot, twist)
                assert trails or abs(law.row(name, {pivot: angle}) @ twist) < 1e-9
                assert np.ptp(law.ends(pivot)) > math.pi
        return
    if case.kind == "skid_steer":
        # Without slip they roll straight ahead at most.
        assert np.linalg.matrix_rank(fixed, tol=1e-6) == 2
        straight = moves @ np.ones(platform.p)
        assert np.abs(fixed @ straight).max() < case.slack
        assert np.linalg.norm(straight) > 1e-3
        return
    own = [name for name in robot.q_names[3 : platform.n_p] if law.model.existJointName(name)]
    rates = robot.S(q)[3 : platform.n_p, : platform.p]
    turned = np.array([rate * law.sign(name) for name, rate in zip(own, rates, strict=False)])
    turned = turned.reshape(len(own), platform.p)
    angles = {name: float(q[robot.coordinate(name)]) * law.sign(name) for name in own}
    rows = [law.row(name, {}, own) for name in case.fixed]
    fastest = moves[:, np.abs(moves).max(axis=0).argmax()]
    for name, pivot in case.steered.items():
        at = angles if pivot in own else {pivot: law.pointed(name, pivot, fastest)}
        lower, upper = law.ends(pivot)
        assert lower <= at[pivot] <= upper
        rows.append(law.row(name, at, own))
    sideways = np.array(rows) @ np.vstack([moves, turned])
    assert np.abs(sideways).max() < case.slack
    if case.slack == 1e-9:
        # The body's motions, and the ways in which the point about which all roll can be moved.
        free = 3 - np.linalg.matrix_rank(np.array(rows)[:, :3], tol=1e-6)
        ways = 2 - (np.linalg.matrix_rank(fixed, tol=1e-6) if len(fixed) else 0)
        assert platform.p == free + min(len({*case.steered.values()}), ways)
    if case.kind == "car" and not own:  # the angle of a wheel midway (Ackermann)
        steer = q[robot.coordinate("steer")]
        if steer and case.steered:
            axes = [
                law.row(name, {pivot: law.pointed(name, pivot, fastest)})
                for name, pivot in case.steered.items()
            ]
            middle = np.mean([-axis[1] / axis[0] for axis in axes])
            assert middle == pytest.approx(1.0 / math.tan(steer), rel=max(case.slack, 1e-9))


@pytest.mark.parametrize(
    ("name", "ahead"),
    [("along y, left at -x", [0, 1]), ("along y, left at +x", [0, -1]), ("along y, by axle", [0, 1])],
)
def test_ahead_has_left_to_its_left(tmp_path: Path, name: str, ahead: list[float]) -> None:
    robot = loaded(tmp_path, CASES[name])
    forward, turning = twists(robot, robot.q()).T
    np.testing.assert_allclose(forward, [*ahead, 0.0], atol=1e-12)
    # The middle of the axle stands still while it turns.
    middle = sum(Rolling(CASES[name].text).centre(wheel) for wheel in DRIVE) / 2
    np.testing.assert_allclose(turning, [middle.imag, -middle.real, 1.0], atol=1e-12)


@pytest.mark.parametrize("name", ["the root off the axle", "along y, left at +x", "a car from its middle"])
def test_where_the_platform_is_is_told(tmp_path: Path, name: str) -> None:
    case = CASES[name]
    robot = loaded(tmp_path, case)
    (note,) = of_code(robot.notes, "reference_moved")
    middle = np.mean([Rolling(case.text).centre(wheel) for wheel in case.fixed])
    np.testing.assert_allclose(note.values["at"][:2], [middle.real, middle.imag], atol=1e-12)


@pytest.mark.parametrize("name", ["sprung", "rockers", "wheel drops", "mecanum wheels with rollers"])
def test_what_stands_still_is_told(tmp_path: Path, name: str) -> None:
    (note,) = of_code(loaded(tmp_path, CASES[name]).notes, "undercarriage_held")
    assert set(note.values["values"]) == {*CASES[name].stand}
    assert set(note.values["values"].values()) == {0.0}


def test_wheels_that_do_not_turn_are_told(tmp_path: Path) -> None:
    fixed = base(pair().replace('type="continuous"', 'type="fixed"'))
    robot = nmm.load(write(tmp_path / "fixed.urdf", fixed))
    assert robot.platform.name == "unicycle"
    assert "wheels_fixed" in {note.code for note in robot.notes}
    bare = nmm.load(write(tmp_path / "bare.urdf", base()))
    assert "no_wheels" in {note.code for note in bare.notes}


BLIND = re.compile("<visual>.*?</visual>", re.DOTALL)


def commands(error: nmm.RobotError) -> list[list[str]]:
    """The options that a refusal names, as typed."""
    found = re.findall(r"--platform [a-z_]+|--wheels \S+", str(error))
    assert found
    return [shlex.split(one.rstrip(",:?")) for one in found]


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (base(pair(), wheel("back_wheel", "base_link", "-0.3 0 0.1")), "several_axles"),
        (
            base(
                wheel("left_wheel", "base_link", "0 0.2 0.1", "0.3 0.95 0"),
                wheel("right_wheel", "base_link", "0 -0.2 0.1", "-0.3 0.95 0"),
            ),
            "not_parallel",
        ),
        (
            base(pair(), steered(0.3, 0.1, "odd_steer", "odd_wheel"), pair(-0.4, names="{}_tail_wheel")),
            "steered_otherwise",
        ),
    ],
    ids=["three in a triangle", "two that are not parallel", "two axles and one that steers"],
)
def test_what_the_wheels_do_not_tell_is_refused_with_commands_that_load(
    tmp_path: Path, text: str, why: str, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write(tmp_path / "r.urdf", text)
    with pytest.raises(nmm.RobotError) as caught:
        nmm.load(path)
    assert_found(file_report(path).problems, ("platform_unclear", {"why": why}))
    assert len(str(caught.value)) <= 300 + len(str(path))
    for options in commands(caught.value):
        assert status_of(["info", str(path), *options]) == 0
        assert f"{options[1]} platform" in capsys.readouterr().out
    for command in ("info", "check", "init"):
        assert status_of([command, str(path)]) != 0
        told = capsys.readouterr()
        assert "the wheels do not tell the platform" in told.out + told.err


def test_a_radius_that_nothing_tells(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A unicycle needs none; what is driven by wheel speeds says how to give it."""
    low = BLIND.sub("", base(pair())).replace(' 0.1"', ' 0"')
    robot = nmm.load(write(tmp_path / "pair.urdf", low))
    (note,) = of_code(robot.notes, "radius_unknown")
    assert set(note.values["names"]) == {*DRIVE}
    assert robot.platform.name == "unicycle"
    assert {*DRIVE}.isdisjoint(robot.q_names)
    four = write(tmp_path / "four.urdf", BLIND.sub("", base(corners())).replace(' 0.1"', ' 0"'))
    with pytest.raises(nmm.RobotError, match="--wheels NAME=METRES") as caught:
        nmm.load(four)
    assert commands(caught.value)
    given = ",".join(f"{name}=0.15" for name in all_corners())
    assert status_of(["info", str(four), "--wheels", given]) == 0
    assert "radius: 0.15 m" in capsys.readouterr().out
    made = nmm.load(four, wheels=dict.fromkeys(all_corners(), 0.15))
    assert dict(made.platform.lengths) == pytest.approx({"radius": 0.15, "length": 0.5, "width": 0.4})


def test_a_mesh_beside_its_joint(tmp_path: Path) -> None:
    """The track is between tyres: MuJoCo rolls such a base as if its wheels were 0.561 m apart."""
    tire = trimesh.creation.cylinder(0.1, 0.04, sections=64)
    tire.apply_transform(trimesh.transformations.rotation_matrix(0.5 * math.pi, [1, 0, 0]))
    for side, beside in (("left", 0.03), ("right", -0.03)):
        moved = tire.copy()
        moved.apply_translation([0, beside, 0])
        moved.export(tmp_path / f"{side}.stl")
    text = base(
        *(
            turns(
                f"{side}_wheel",
                "base_link",
                f"0 {y} 0.1",
                LEFT,
                body=f'<visual><geometry><mesh filename="{side}.stl"/></geometry></visual>',
            )
            for side, y in (("left", 0.25), ("right", -0.25))
        )
    )
    robot = nmm.load(write(tmp_path / "r.urdf", text), platform="differential")
    assert robot.platform.lengths["track"] == pytest.approx(0.56, abs=1e-6)
    assert robot.platform.lengths["radius"] == pytest.approx(0.1, abs=1e-6)


def test_a_run_says_that_wheels_slid(tmp_path: Path) -> None:
    """By the file's own kinematics: 0.3 m before the reference point they slide at 0.3 m/s for 1 rad/s."""
    path = write(tmp_path / "r.urdf", base(pair(0.3)))
    task = nmm.Task(nmm.LinearCoordinates("theta"), nmm.Line([0.0], [0.5], 0.5))
    runs = {
        at: nmm.simulate(nmm.Controller(robot, task, nmm.ProjectedGradient()), {}, 0.5, 0.05)
        for at in (None, (0.0, 0.0))
        for robot in (nmm.load(path, axle=at),)
    }
    assert "wheels_slid" not in codes(runs[None])
    (found,) = of_code(runs[0.0, 0.0].findings, "wheels_slid")
    turning = np.abs(runs[0.0, 0.0].q_dot[:, 2]).max()
    assert found.values["speeds"] == pytest.approx(dict.fromkeys(DRIVE, 0.3 * turning), rel=1e-9)


def test_what_is_called_a_wheel_and_cannot_roll_is_no_silence(tmp_path: Path) -> None:
    """Wheels drawn at 17 degrees: the note on a base without wheels names them."""
    lying = [
        wheel(f"{side}_wheel", "base_link", f"0 {y} 0.1", rpy="0.3 0 0")
        for side, y in (("left", 0.2), ("right", -0.2))
    ]
    (note,) = of_code(nmm.load(write(tmp_path / "lying.urdf", base(*lying))).notes, "no_wheels")
    assert note.values["names"] == [*DRIVE]
    assert "left_wheel, right_wheel cannot" in str(note)
