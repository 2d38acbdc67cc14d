"""nmm singularities --symbolic: the paper's formulas and statements, and arms that have none to read."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from cli_tables import expect_report
from command_line import Result
from numpy import pi
from spatial_arms import load_ur5

from nmm.analysis import analyse
from nmm.cli.exit_status import status_of
from nmm.control.functions.tasks import Pose, Position
from nmm.model.robots.loading import load
from nmm.plugins.symbolic import from_robot
from nmm.plugins.symbolic.zeros import GroebnerLimits

Command = Callable[..., Result]

POSITION = ("unicycle_2r", "--task", "position")


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Command:
    """Run `nmm singularities` in an empty folder, in this process."""
    monkeypatch.chdir(tmp_path)
    return lambda *arguments: Result(status_of(["singularities", *arguments]), *capfd.readouterr())


@pytest.fixture(scope="module")
def known() -> dict[tuple[str, ...], Result]:
    return {}


@pytest.fixture
def formulas(run: Command, known: dict[tuple[str, ...], Result]) -> Command:
    """`nmm singularities --symbolic`; what it has said once it does not work out again."""

    def said(*arguments: str) -> Result:
        if arguments not in known:
            known[arguments] = run(*arguments, "--symbolic")
        return known[arguments]

    return said


STATEMENTS = {
    POSITION: [
        "geometry: d = 0.3 m, l1 = 0.5 m, l2 = 0.3 m",
        "ee.x = x + d cos(theta) + l1 cos(theta + q1) + l2 cos(theta + q1 + q2)",
        "Δ[v, omega] = d + l1 c1 + l2 c12",
        "Δ[omega, q2] = l2 (l1 s2 + d s12)",
        "J has rank 2 at every configuration when d != 0, as det J J^T >= d^2/2.",
        "because: Δ[v, omega] - Δ[v, q1] = d, whatever q is",
        "J has rank 2 except exactly where cos(q1) = 0 and sin(q2) = 0, for d = 0",
        "Δ[v, omega] never vanishes when |d| > l1 + l2, and only then. That does not hold here: d = 0.3 m",
        "So every minor vanishes somewhere: no partition serves RG everywhere.",
        "--set d=0 has the formulas",
    ],
    (*POSITION, "--set", "d=0.9"): ["That holds here: d = 0.9 m, l1 = 0.5 m, l2 = 0.3 m."],
    (*POSITION, "--task", "heading:link2"): [
        "Δ[v, omega, q1] = d",
        "Δ[v, omega, q2] = d + l1 c1",
        "J has rank 3 at every configuration when d != 0, as det J J^T >= d^2.",
        "Δ[v, omega, q1] never vanishes when d != 0. That holds here: d = 0.3 m.",
        "Δ[v, omega, q2] never vanishes when |d| > l1, and only then. That does not hold here",
        "Δ[v, q1, q2], as cos(q1) is a factor",
    ],
    (*POSITION, "--set", "d=0"): [
        "zero, and so not in the formulas: d",
        "Δ[v, omega] = l1 c1 + l2 c12",
        "Δ[omega, q1] = 0",
        "J has rank 2 except exactly where cos(q1) = 0 and sin(q2) = 0",
        "that is q1 = pi/2 and q2 = 0, each up to half turns",
    ],
    (*POSITION, "--task", "heading:link2", "--set", "d=0"): [
        "J has rank 3 except exactly where cos(q1) = 0",
        "that is q1 = pi/2, up to half turns",
    ],
    ("unicycle_3r", "--task", "position"): [
        "Λ = l2 s2 + l3 s23",
        "Δ[v, omega, q2] = -Λ (d + Λ c1)",
        "J has rank 3 except exactly where sin(q2) = 0 and sin(q3) = 0",
        "that is q2 = 0 and q3 = 0, each up to half turns",
        "So every minor vanishes somewhere: no partition serves RG everywhere.",
    ],
    ("unicycle_2r_link_pointing",): [
        "Δ[v, omega, q1] = d (rho - l2 cos(theta + q1 + q2 - g))/rho",
        "  It is not decided whether Δ[v, omega, q2], Δ[v, q1, q2] and Δ[omega, q1, q2] vanish",
        "J has rank 3 at every configuration, for all nonzero d, wherever rho != 0.",
        "never vanishes when rho > l2 and d != 0. That depends on the configuration, through rho.",
        "--set robot.arguments.d=0 has the formulas",
    ],
    ("small_arm", "--task", "position"): [
        "(cos(q1) = 0 and sin(q3) = 0 and sin(q4) = 0) or (sin(q3) = 0 and sin(q4) = 0 and Λ = 0), for all",
        "nonzero upper, fore, z_q5, z_ee, z_q5 + z_ee; Λ = upper s2 + fore s23 + s234 (z_q5 + z_ee).",
        "c1 is cos(q1), s23 is sin(q2 + q3)",
    ],
    (*POSITION, "--platform", "fixed"): [
        "Δ[q1, q2] = l1 l2 s2",
        "J has rank 2 except exactly where sin(q2) = 0",
    ],
}


@pytest.mark.parametrize("arguments", STATEMENTS, ids=" ".join)
def test_the_papers_statements(arguments: tuple[str, ...], formulas: Command) -> None:
    result = formulas(*arguments)
    assert (result.status, result.err) == (0, "")
    for text in STATEMENTS[arguments]:
        assert text in result.out, result.out


def test_without_offset_its_symbol_is_gone(formulas: Command) -> None:
    for robot in ("unicycle_2r", "unicycle_3r"):
        out = formulas(robot, "--task", "position", "--set", "d=0").out
        assert not re.search(r"\bd\b", out[out.index("\nf\n") :])


def test_without_offset_the_3r_loses_rank_where_it_says(formulas: Command, rng: np.random.Generator) -> None:
    out = formulas("unicycle_3r", "--task", "position", "--set", "d=0").out
    line = next(line for line in out.splitlines() if "J has rank 3 except exactly where" in line)
    cases = re.findall(r"\((\S+) = 0 and (\S+) = 0\)", line)
    expected = [{"cos(q1)", "sin(q3)"}, {"sin(q1)", "Λ"}, {"sin(q3)", "Λ"}]
    assert sorted(map(sorted, cases)) == sorted(map(sorted, expected))
    robot = load("unicycle_3r", arguments={"d": 0})
    l2, l3 = (float(robot.arguments[name]) for name in ("l2", "l3"))

    def rank(shoulder: bool = False, **chosen: float) -> int:
        """Of J with some coordinates chosen; with Λ = 0 by q2: tan q2 = -l3 s3 / (l2 + l3 c3)."""
        q = dict(zip(robot.q_names, rng.uniform(-2, 2, robot.n), strict=True)) | chosen
        if shoulder:
            q["q2"] = np.arctan2(-l3 * np.sin(q["q3"]), l2 + l3 * np.cos(q["q3"]))
        return analyse((robot, Position("ee")), q).rank

    for _ in range(5):
        assert rank(True, q1=0.0) == rank(True, q3=pi) == rank(q1=pi / 2, q3=0.0) == 2
        assert rank(True) == rank(q1=0.0) == rank(q1=pi / 2) == rank(q3=0.0) == rank() == 3


@pytest.mark.parametrize("robot", ["unicycle_2r", "unicycle_3r", "small_arm"])
def test_abbreviations_are_explained_by_names_that_occur(robot: str, formulas: Command) -> None:
    out = formulas(robot, "--task", "position").out
    explained = re.findall(r"\b([cs]\d+) is (?:cos|sin)\(", out)
    assert explained
    for name in explained:
        assert re.search(rf"\b{name}\b(?! is )", out[out.index("\nf\n") :])


def test_what_is_not_decided_comes_first(run: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("nmm.plugins.symbolic.zeros._SET", GroebnerLimits(2, 5, 100))
    monkeypatch.setattr("nmm.plugins.symbolic.claims._BRIEF", GroebnerLimits(2, 5, 100))
    out = run("unicycle_3r", "--task", "position", "--symbolic").out
    follows = out[out.index("what follows\n") :].splitlines()
    assert follows[1].startswith("  Not decided: where J loses rank, as")
    assert follows[2].startswith("  Not decided: where J loses rank for d = 0, as")
    assert "Not decided" not in "".join(follows[3:])
    assert "has the formulas" not in out


def test_only_the_minors_asked_for(run: Command) -> None:
    out = run(*POSITION, "--symbolic", "--minor", "omega,v").out
    listed = out[out.index("maximal minors") : out.index("what follows")].splitlines()[1:]
    assert listed == ["  Δ[v, omega] = d + l1 c1 + l2 c12"]
    assert run(*POSITION, "--symbolic", "--minor", "v").status == 2


@pytest.mark.parametrize("task", ["position:tool0", "pose:tool0"])
def test_a_large_arm_gives_its_numbers_instead(
    task: str, run: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(from_robot, "BUDGET", from_robot.BUDGET // 10)  # sooner than at a user's
    robot = load_ur5()
    result = run(robot.source, "--task", task, "--symbolic", "--at", "elbow_joint=1")
    assert result.status == 0
    assert result.out.startswith("No formulas: too large")
    function = Position("tool0") if task.startswith("position") else Pose("tool0")
    report = analyse((robot, function), {"elbow_joint": 1.0})
    numbers = Result(0, result.out[result.out.index("\n\n") :], result.err)
    expect_report(numbers, report)


def test_what_has_no_formula_gives_its_numbers_instead(run: Command, formulas: Command) -> None:
    """The error of a pose with a target is a logarithm."""
    result = formulas("ur5_unicycle_pose")
    assert (result.status, result.err) == (0, "")
    assert result.out.startswith("No formulas: ")
    assert "Nonsingular: J has rank 6." in result.out
    latex = run("ur5_unicycle_pose", "--symbolic", "--latex")
    assert (latex.status, latex.out) == (2, "")
    assert latex.err.startswith("nmm singularities: --latex: ")
