"""Formulas of robots with every kind of joint and of known arms, and of what is too large."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy
from robot_grid import built, frame_of
from scipy.optimize import least_squares
from spatial_arms import load_tiago
from symbolic_checks import check_numbers
from thinned import thinned
from urdf_parts import AXIS, LIMIT, inertial, joint, link, write
from urdf_parts import robot as urdf

import nmm
from nmm.base.findings import Finding
from nmm.control.functions.tasks import CenterOfMass, Orientation, Pose, Position, Posture
from nmm.plugins.symbolic import TooLarge, from_robot, never_zero, singular_set, symbolic


@pytest.mark.parametrize("seen_from", [None, "link2"])
def test_pose_of_an_arm_whose_inputs_suffice(seen_from: str | None, rng: np.random.Generator) -> None:
    """Six rows, velocities in the frame's own axes; f is the pose's position over its rotation vector."""
    robot = built("unicycle", "small arm")
    task = Pose("ee", seen_from)
    analysis = symbolic(robot, task)
    check_numbers(robot, task, analysis, rng.uniform(-1.5, 1.5, (3, robot.n)))
    if seen_from is None:
        claim = singular_set(analysis)
        assert claim.proved
        # The tool upright, or the arm so that the wrist's circle does not turn with it: both found.
        assert len(claim.families) == 2


def test_singularities_of_the_ur5_on_a_fixed_base_are_shoulder_elbow_and_wrist(
    rng: np.random.Generator,
) -> None:
    """A textbook's result, from six rows and six joints."""
    robot = built("fixed", "UR5")
    analysis = symbolic(robot, Pose(frame_of("fixed", "UR5")))
    claim = singular_set(analysis)
    assert claim.proved
    q2, q3, q4, q5 = (analysis.q[name] for name in list(analysis.q)[1:5])
    a2, a3, d5 = (analysis.symbols[f"z_{name}_joint"] for name in ("elbow", "wrist_1", "wrist_3"))
    shoulder = a2 * sympy.cos(q2) + a3 * sympy.cos(q2 + q3) - d5 * sympy.sin(q2 + q3 + q4)
    found = {sympy.expand(condition) for (condition,) in claim.families}
    assert found == {sympy.sin(q3), sympy.sin(q5), sympy.expand(shoulder)}
    assert {note.code for note in analysis.notes} <= {"angle_rounded"}  # where the file's have ten digits
    check_numbers(robot, Pose("tool0"), analysis, rng.uniform(-3, 3, (3, 6)), 1e-9)


def test_wrist_of_the_ur5_has_one_minor_that_is_not_zero(rng: np.random.Generator) -> None:
    robot = built("fixed", "UR5")
    analysis = symbolic(robot, Position("wrist_1_link"))
    assert sum(minor != 0 for minor in analysis.minors.values()) == 1
    assert "the other 19 are 0" in analysis.text()
    claim = singular_set(analysis)
    assert claim.proved
    assert claim.statement.values["families"][0] == ["sin(elbow_joint)"]
    assert not analysis.notes
    check_numbers(robot, Position("wrist_1_link"), analysis, rng.uniform(-3, 3, (3, robot.n)))


OBLIQUE = '<axis xyz="0.36 0.48 0.8"/>'
CHAINS: dict[str, list[tuple[str, str, str]]] = {
    "slides": [
        ("revolute", AXIS, '<origin xyz="0.1 0.2 0.3" rpy="0.4 0 0"/>'),
        ("prismatic", OBLIQUE, '<origin xyz="0 0.1 0" rpy="0 0 -0.7"/>'),
    ],
    "turns about an oblique axis": [
        ("continuous", '<axis xyz="0 -1 0"/>', '<origin xyz="0 0.3 0" rpy="0 1.1 0"/>'),
        ("revolute", OBLIQUE, '<origin xyz="0.2 0 0.1"/>'),
    ],
    "fixed joints between": [
        ("fixed", "", '<origin xyz="0.1 0.2 0.3" rpy="0 0.5 0"/>'),
        ("revolute", '<axis xyz="-1 0 0"/>', '<origin xyz="0.3 -0.1 0"/>'),
        ("fixed", "", '<origin xyz="0 0 0.2" rpy="1.5707963267948966 0 0.3"/>'),
        ("fixed", "", '<origin xyz="0.1 0 0"/>'),
        ("prismatic", '<axis xyz="0 0 -1"/>', '<origin xyz="0 0 0.1"/>'),
    ],
    "turned about all axes": [
        ("revolute", AXIS, '<origin xyz="0.1 0.2 0.3" rpy="0.5 -0.4 0.3"/>'),
        ("prismatic", AXIS, '<origin xyz="0 0 0.1"/>'),
    ],
    "pitched by a quarter": [
        ("revolute", AXIS, '<origin xyz="0.1 0 0.3" rpy="0.6 1.5707963267948966 0.3"/>'),
        ("prismatic", '<axis xyz="0 1 0"/>', '<origin xyz="0.2 0 0" rpy="3.141592653589793 0 0"/>'),
    ],
}


@pytest.mark.parametrize(
    ("name", "platform"),
    [*((name, "fixed") for name in CHAINS), ("pitched by a quarter", "unicycle")],
)
def test_joints_of_every_kind_however_placed(
    name: str, platform: str, rng: np.random.Generator, tmp_path: Path
) -> None:
    parts, last = [link("l", inertial(2.0, "0.1 0 0.2"))], "l"
    for i, (kind, axis, origin) in enumerate(CHAINS[name]):
        body = "" if kind == "fixed" else axis + LIMIT
        parts += [
            joint(f"j{i}", last, f"l{i}", kind, body, origin),
            link(f"l{i}", inertial(1.0, "0 0.1 0.2")),
        ]
        last = f"l{i}"
    parts += [joint("tip", last, "ee", "fixed", "", '<origin xyz="0.2 0 0.1"/>'), link("ee")]
    robot = nmm.load(write(tmp_path / "robot.urdf", urdf(*parts)), platform=platform)
    tasks = [Position("ee", axis) for axis in "xyz"] + [CenterOfMass("x"), Posture()]
    if robot.n_u > 3:
        tasks += [Position("ee"), Orientation("ee")]
    q = rng.uniform(-1, 1, (3, robot.n))
    for task in tasks:
        analysis = symbolic(robot, task)
        check_numbers(robot, task, analysis, q)
        assert not analysis.notes


#: Whether work is counted up to a tenth of what a user's analysis may take, or all of it.
each_budget = pytest.mark.parametrize("whole", [False, pytest.param(True, marks=pytest.mark.thorough)])


@pytest.fixture
def _budget(whole: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    if not whole:
        monkeypatch.setattr(from_robot, "BUDGET", from_robot.BUDGET // 10)


@each_budget
@pytest.mark.usefixtures("_budget")
@pytest.mark.parametrize(
    ("robot", "frame", "task"),
    [
        (lambda: built("fixed", "Panda"), "panda_hand", Position),
        (load_tiago, "arm_tool_link", Pose),
        (lambda: built("unicycle", "UR5"), "ur5_tool0", Pose),
    ],
    ids=["Panda", "TIAGo", "UR5"],
)
def test_what_is_too_large_is_refused_and_says_why(robot: Any, frame: str, task: Any) -> None:
    """The work is counted: how long it takes depends on the machine, some seconds at most."""
    made_robot = robot()
    with pytest.raises(
        TooLarge,
        match=r"with \d+ inputs and a task of . rows \(\d+ minors\): so many joints .*make .* read; use",
    ):
        symbolic(made_robot, task(frame))


@each_budget
@pytest.mark.usefixtures("_budget")
def test_general_angles_between_the_axes_are_named_where_they_make_formulas_too_large(tmp_path: Path) -> None:
    parts, last = [link("l", inertial(2.0, "0.1 0 0.2"))], "l"
    for i in range(4):
        placed = f'<origin xyz="0.1 0.2 0.3" rpy="0.{i + 3} 0.5 -0.7"/>'
        parts += [joint(f"j{i}", last, f"l{i}", "revolute", AXIS + LIMIT, placed), link(f"l{i}")]
        last = f"l{i}"
    robot = nmm.load(write(tmp_path / "robot.urdf", urdf(*parts)), platform="fixed")
    with pytest.raises(
        TooLarge, match=r"general angles between their axes \(.*roll_j.*\) make formulas too long"
    ):
        symbolic(robot, Position(last))


#: Shoulder, elbow and a forearm that turns about itself: the wrist's offset and the tip's add up.
FOREARM = {"turn": ("0 0 1", ""), "lift": ("0 1 0", "0 0 0.1"), "elbow": ("0 1 0", "0.3 0 0"),
           "roll": ("1 0 0", "0.2 0 0")}  # fmt: skip


def _forearm(folder: Path, tip: float, platform: str, joints: Sequence[str] = tuple(FOREARM)) -> nmm.Robot:
    parts, last = [link("l", inertial(2.0, "0.1 0 0.2"))], "l"
    for name, (axis, place) in ((name, FOREARM[name]) for name in joints):
        body = f'<axis xyz="{axis}"/>' + LIMIT
        parts += [
            joint(name, last, f"{name}_link", "revolute", body, f'<origin xyz="{place or "0 0 0"}"/>'),
            link(f"{name}_link", inertial(1.0, "0 0.1 0.2")),
        ]
        last = f"{name}_link"
    parts += [joint("tip", last, "ee", "fixed", "", f'<origin xyz="{tip} 0 0"/>'), link("ee")]
    return nmm.load(write(folder / "robot.urdf", urdf(*parts)), platform=platform)


def test_a_sum_of_lengths_is_no_condition_on_the_configuration(tmp_path: Path) -> None:
    claim = singular_set(symbolic(_forearm(tmp_path, 0.1, "fixed"), Position("ee")))
    assert len(claim.families) == 2
    assert claim.statement.values["nonzero"] == ["x_elbow", "x_roll", "x_ee", "x_roll + x_ee"]
    assert not any("x_roll + x_ee" in step.values.get("ways", ()) for step in claim.steps)


@pytest.mark.parametrize(
    ("tip", "platform"),
    thinned(product([0.1, -0.2], ["fixed", "unicycle"]), [(-0.2, "fixed"), (0.1, "unicycle")].__contains__),
)
def test_a_sum_of_lengths_is_zero_where_it_is_for_this_robot(
    tip: float, platform: str, rng: np.random.Generator, tmp_path: Path
) -> None:
    """With the tip back in the elbow an arm has two joints that move it: its rank is 2, and 3 on wheels."""
    robot = _forearm(tmp_path, tip, platform)
    analysis = symbolic(robot, Position("ee"))
    claim = singular_set(analysis)
    assert claim.proved
    assert claim.statement.values.get("zero", []) == (["x_roll + x_ee"] if tip < 0.0 else [])
    J = analysis.functions().J
    expected = 2 if (tip, platform) == (-0.2, "fixed") else 3
    assert (claim.statement.code == "rank_lost") == (expected == 2)
    anywhere = rng.uniform(-3, 3, (20, robot.n))
    assert (np.linalg.matrix_rank(J(anywhere), tol=1e-9) == expected).all()
    for family in claim.families:
        for q in _zeros(analysis, family, rng):
            assert np.linalg.svd(J(q))[1][2] < 1e-9
    assert bool(claim.families) == (expected == 3)


@pytest.mark.parametrize("tip", [0.1, -0.2])
def test_a_minor_that_is_a_sum_of_lengths(tip: float, tmp_path: Path) -> None:
    analysis = symbolic(_forearm(tmp_path, tip, "unicycle", ["roll"]), Position("ee", "xy"))
    claim, bound = singular_set(analysis), never_zero(analysis)["v", "omega"]
    assert bound.finding().values["larger"] == [("x_ee + x_roll", None)]
    assert bound.holds(analysis.geometry) is (tip > 0.0)
    code, key = ("rank_full", "nonzero") if tip > 0.0 else ("rank_lost", "zero")
    assert claim.statement == Finding(code, {"rank": 2, key: ["x_roll + x_ee"]})


def _zeros(analysis: Any, family: Any, rng: np.random.Generator) -> list[Any]:
    """Configurations where all expressions vanish, by least squares from random starts."""
    lengths = {analysis.symbols[name]: value for name, value in analysis.geometry.items()}
    values = sympy.lambdify([list(analysis.q.values())], [one.subs(lengths) for one in family])

    def residuals(q: Any) -> Any:
        return np.array(values(q), dtype=float)

    found: list[Any] = []
    for q0 in rng.uniform(-3, 3, (8, len(analysis.q))):
        solution = least_squares(residuals, q0, xtol=1e-15, ftol=1e-15, gtol=1e-15)
        if np.max(np.abs(solution.fun)) < 1e-12:
            found.append(solution.x)
    assert found
    return found
