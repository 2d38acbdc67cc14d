"""Formulas against the paper's corrected lists, against the compiled numbers, and in their own words."""

from __future__ import annotations

import itertools
import sys
from typing import Any

import numpy as np
import pytest
import twin
from paper_cases import CIRCLE
from spatial_arms import load_ur5

from nmm.analysis.symbolic import SymbolicAnalysis, TooLarge, symbolic
from nmm.analysis.symbolic_claims import lower_bound, never_zero, singular_set
from nmm.controller import Controller
from nmm.errors import InputError
from nmm.loading import load
from nmm.platforms import Car, DifferentialDrive, FrontDriveCar, Omnidirectional
from nmm.references import Bearing
from nmm.resolvers import ProjectedGradient
from nmm.robot import Robot
from nmm.tasks import Coordinates, Distance, Heading, Position, Posture, Stack, Task

sympy = pytest.importorskip("sympy")

TIP = Task(Position("ee", "xy"), CIRCLE)
POINTING = [TIP, Task(Heading("link2"), Bearing(CIRCLE, twin.TARGET))]
LINK_POINTING = [TIP, Task(Heading("link1"), Bearing(Position("link2", "xy"), twin.TARGET))]
TASKS_2R: dict[str, Any] = {
    "position": TIP,
    "pointing": POINTING,
    "link pointing": LINK_POINTING,
    "linear": [TIP, Task(Coordinates({"theta": 1, "q1": 0.5, "q2": -2}), 0.0)],
    "seen from link1": Task(Position("ee", "xy", relative_to="link1"), [0.0, 0.0]),
    "posture": Task(Posture(), [0.0, 0.0]),
    "follows a joint": Task(Heading("link1"), Coordinates("q2")),
}
TASKS_3R: dict[str, Any] = {
    "position": Task(Position("ee", "xyz"), [0.0, 0.0, 0.0]),
    "turned": [Task(Position("ee", "xz"), [0.0, 0.0]), Task(Heading("link1"), 0.0)],
}
EVERY = [("unicycle_2r", name) for name in TASKS_2R] + [("unicycle_3r", name) for name in TASKS_3R]
ARGUMENTS = [None, {"d": -0.2, "h": 0.4, "l1": 0.35, "l2": 0.35}, {"d": 0}]

_MADE: dict[Any, tuple[Robot, Any, SymbolicAnalysis]] = {}


def made(robot: str, task: str = "position", arguments: dict[str, float] | None = None) -> Any:
    """Robot, task and analysis, each made once."""
    key = robot, task, tuple((arguments or {}).items())
    if key not in _MADE:
        loaded = load(robot, arguments=arguments or {})
        tasks = (TASKS_2R if robot == "unicycle_2r" else TASKS_3R)[task]
        _MADE[key] = loaded, tasks, symbolic(loaded, tasks)
    return _MADE[key]


def numeric(robot: Robot, task: Any, q: Any) -> Any:
    return Controller(robot, task, ProjectedGradient()).evaluate(0.0, q)


def minors_of(J: Any) -> list[float]:
    s, m = J.shape
    return [float(np.linalg.det(J[:, list(c)])) for c in itertools.combinations(range(m), s)]


def same(found: Any, expected: Any) -> bool:
    return bool(sympy.simplify(sympy.expand(sympy.expand_trig(found - expected))) == 0)


@pytest.mark.parametrize("arguments", ARGUMENTS, ids=["paper", "other", "d=0"])
@pytest.mark.parametrize(("name", "task"), EVERY)
def test_formulas_are_the_compiled_numbers(
    name: str, task: str, arguments: dict[str, float] | None, rng: np.random.Generator
) -> None:
    robot, tasks, analysis = made(name, task, arguments)
    functions = analysis.functions()
    for q in rng.uniform(-3, 3, (5, robot.n)):
        step = numeric(robot, tasks, q)
        value = functions.f(q)
        angular = np.array([row.angular for row in Stack.of(tasks).rows(robot)])
        difference = np.where(
            angular, np.remainder(value - step.r + np.pi, 2 * np.pi) - np.pi, value - step.r
        )
        assert np.max(np.abs(difference)) < 1e-10
        assert np.max(np.abs(functions.J(q) - step.J)) < 1e-10
        assert np.max(np.abs(np.array(list(functions.minors(q).values())) - minors_of(step.J))) < 1e-10


def test_one_formula_serves_other_lengths(rng: np.random.Generator) -> None:
    for robot_name in ("unicycle_2r", "unicycle_3r"):
        functions = made(robot_name)[2].functions()
        other = {"d": 0.11, "h": 0.33, "l1": 0.42, "l2": 0.27}
        robot, task, _ = made(robot_name, "position", other)
        q = rng.uniform(-3, 3, (4, robot.n))
        given = {name: value for name, value in other.items() if name in made(robot_name)[2].geometry}
        found = functions.J(q, **given)
        assert found.shape == (4, len(task.rows(robot)), robot.n_u)
        for i in range(4):
            assert np.max(np.abs(found[i] - numeric(robot, task, q[i]).J)) < 1e-10


@pytest.mark.parametrize("task", ["position", "pointing"])
def test_minors_of_the_2r_are_those_of_the_paper_corrected(task: str) -> None:
    analysis = made("unicycle_2r", task)[2]
    d, l1, l2, q1, q2 = (analysis.symbols[name] for name in ("d", "l1", "l2", "q1", "q2"))
    c, s = sympy.cos, sympy.sin
    expected = {
        "position": [d + l1 * c(q1) + l2 * c(q1 + q2), l1 * c(q1) + l2 * c(q1 + q2), l2 * c(q1 + q2),
                     d * (l1 * s(q1) + l2 * s(q1 + q2)), l2 * (l1 * s(q2) + d * s(q1 + q2)), l1 * l2 * s(q2)],
        "pointing": [d, d + l1 * c(q1), l1 * c(q1), d * l1 * s(q1)],
    }[task]  # fmt: skip
    assert list(analysis.minors) == list(itertools.combinations(analysis.u_names, len(analysis.row_names)))
    assert all(same(*pair) for pair in zip(analysis.minors.values(), expected, strict=True))


def test_minors_of_the_3r_are_those_of_the_paper_corrected_and_lambda_is_named() -> None:
    analysis = made("unicycle_3r")[2]
    d, l2, l3, q1, q2, q3 = (analysis.symbols[name] for name in ("d", "l2", "l3", "q1", "q2", "q3"))
    s1, c1, s3, s23 = sympy.sin(q1), sympy.cos(q1), sympy.sin(q3), sympy.sin(q2 + q3)
    L = l2 * sympy.sin(q2) + l3 * s23
    expected = [0, -L * (L * c1 + d), -l3 * s23 * (L * c1 + d), -(L**2) * c1, -l3 * s23 * L * c1,
                -l2 * l3 * s1 * s3, -d * L**2 * s1, -d * l3 * s1 * s23 * L, l2 * l3 * s3 * (d * c1 + L),
                l2 * l3 * L * s3]  # fmt: skip
    assert all(same(*pair) for pair in zip(analysis.minors.values(), expected, strict=True))
    assert list(analysis.named) == ["Lambda"]
    assert same(analysis.named["Lambda"], L)


def test_minor_of_the_matrix_that_case_3_inverts() -> None:
    analysis = made("unicycle_2r", "link pointing")[2]
    names = ("d", "l2", "rho", "g", "theta", "q1", "q2")
    d, l2, rho, g, theta, q1, q2 = (analysis.symbols[name] for name in names)
    expected = d * (rho - l2 * sympy.cos(theta + q1 + q2 - g)) / rho
    assert same(analysis.minor("v", "omega", "q1"), expected)
    assert same(analysis.minor("omega", "v", "q1"), -expected)


def test_jacobian_is_the_derivative_of_the_value() -> None:
    """SymPy differentiates what the chain rule never saw."""
    for name in ("unicycle_2r", "unicycle_3r"):
        analysis = made(name, "pointing" if name == "unicycle_2r" else "position")[2]
        q = list(analysis.q.values())
        theta = analysis.symbols["theta"]
        S = sympy.diag(
            sympy.Matrix([[sympy.cos(theta), 0], [sympy.sin(theta), 0], [0, 1]]), sympy.eye(len(q) - 3)
        )
        difference = analysis.f.jacobian(q) * S - analysis.J
        assert all(same(entry, 0) for entry in difference)


def test_text_is_what_a_person_would_write() -> None:
    lines = made("unicycle_3r")[2].text().splitlines()
    assert "  Λ = l2 s2 + l3 s23" in lines
    assert "  Δ[v, omega, q2] = -Λ (d + Λ c1)" in lines
    assert "  Δ[omega, q2, q3] = l2 l3 s3 (d c1 + Λ)" in lines
    assert max(map(len, lines)) < 70
    lines = made("unicycle_2r")[2].text().splitlines()
    assert "  Δ[omega, q2] = l2 (l1 s2 + d s12)" in lines
    assert max(map(len, lines)) < 80
    lines = made("unicycle_2r", "link pointing")[2].text().splitlines()
    assert "  Δ[v, omega, q1] = d (rho - l2 cos(theta + q1 + q2 - g))/rho" in lines
    assert max(len(line) for line in lines if "Δ" in line) < 90


def test_latex_is_balanced_and_names_the_factor() -> None:
    written = made("unicycle_3r")[2].latex()
    assert written.count("{") == written.count("}")
    assert r"\Lambda &= l_2 s_{2} + l_3 s_{23}" in written
    assert len(written) < 1600


def test_lengths_of_equal_value_are_told_apart() -> None:
    """d, h and l2 of the 2R are all 0.3."""
    assert made("unicycle_2r")[2].geometry == {
        "d": 0.3, "h": 0.3, "l1": 0.5, "l2": 0.3, "z_q2": 0.066, "z_ee": 0.034
    }  # fmt: skip


def test_names_of_ones_own_and_numbers() -> None:
    robot = load("unicycle_2r")
    own = symbolic(robot, TIP, arguments={"x_q2": "a"})
    assert str(own.minor("q1", "q2")) == "a*x_ee*sin(q2)"
    numbers = symbolic(robot, TIP, geometry="numbers")
    assert numbers.minor("q1", "q2") == sympy.Rational(3, 20) * sympy.sin(numbers.symbols["q2"])
    assert not numbers.geometry


def test_the_planar_arm_with_d_never_loses_rank() -> None:
    for task in ("position", "pointing", "link pointing"):
        analysis = made("unicycle_2r", task)[2]
        claim = singular_set(analysis)
        assert claim.proved
        assert not claim.conditions
        assert "d" in claim.statement
    bound = lower_bound(made("unicycle_2r")[2])
    assert bound is not None
    assert bound.steps[0] == "Δ[v, omega] - Δ[v, q1] = d, whatever q is"


def test_the_lower_bound_holds_and_is_not_idle(rng: np.random.Generator) -> None:
    robot, _, analysis = made("unicycle_2r")
    C = float(lower_bound(analysis).conditions[0].subs(analysis.symbols["d"], 0.3))
    determinants = [
        np.linalg.det(J @ J.T) for J in analysis.functions().J(rng.uniform(-np.pi, np.pi, (4000, robot.n)))
    ]
    assert min(determinants) >= C**2 / 2
    assert min(determinants) < 2 * C**2


def test_without_d_the_planar_arm_loses_rank_where_the_claim_says() -> None:
    _, _, analysis = made("unicycle_2r", "position", {"d": 0})
    claim = singular_set(analysis)
    q1, q2 = analysis.symbols["q1"], analysis.symbols["q2"]
    assert claim.proved
    assert set(claim.conditions) == {sympy.cos(q1), sympy.sin(q2)}
    J = analysis.functions().J
    assert np.linalg.matrix_rank(J([0.3, 0.1, 0.7, np.pi / 2, np.pi])) == 1
    assert np.linalg.matrix_rank(J([0.3, 0.1, 0.7, np.pi / 2, 1.0])) == 2
    pointing = singular_set(made("unicycle_2r", "link pointing", {"d": 0})[2])
    assert pointing.proved
    assert len(pointing.conditions) == 1


def test_the_3r_loses_rank_exactly_where_it_is_vertical(rng: np.random.Generator) -> None:
    _, _, analysis = made("unicycle_3r")
    claim = singular_set(analysis)
    assert claim.proved
    assert "except exactly where" in claim.statement
    assert set(claim.conditions) == {sympy.sin(analysis.symbols["q2"]), sympy.sin(analysis.symbols["q3"])}
    J = analysis.functions().J
    for q in rng.uniform(-np.pi, np.pi, (20, 6)):
        for q2, q3 in itertools.product((0.0, np.pi), repeat=2):
            assert np.linalg.matrix_rank(J([*q[:4], q2, q3]), tol=1e-10) < 3
        assert np.linalg.matrix_rank(J([*q[:4], 0.0, 0.4])) == 3
        assert np.linalg.matrix_rank(J([*q[:4], 0.4, 0.0])) == 3


def test_minors_that_never_vanish_when_d_is_longer_than_the_arm(rng: np.random.Generator) -> None:
    analysis = made("unicycle_2r")[2]
    bounds = never_zero(analysis)
    assert list(bounds) == [("v", "omega")]
    bound = bounds["v", "omega"]
    assert str(bound) == "Δ[v, omega] vanishes nowhere when |d| > |l1| + |l2|"
    assert bound.holds(analysis.geometry) is False
    assert bound.holds({"d": -0.9, "l1": 0.5, "l2": 0.3}) is True
    assert bound.holds({"d": 0.9}) is None
    q = rng.uniform(-np.pi, np.pi, (4000, 5))
    functions = analysis.functions()
    longer = {columns: np.ptp(np.sign(values)) for columns, values in functions.minors(q, d=0.81).items()}
    assert [columns for columns, changes in longer.items() if changes == 0] == [("v", "omega")]
    assert all(np.ptp(np.sign(values)) > 0 for values in functions.minors(q, d=0.7).values())
    assert [str(b) for b in never_zero(made("unicycle_2r", "pointing")[2]).values()] == [
        "Δ[v, omega, q1] vanishes nowhere when d != 0", "Δ[v, omega, q2] vanishes nowhere when |d| > |l1|"
    ]  # fmt: skip


@pytest.mark.parametrize(
    "platform",
    [DifferentialDrive(0.1, 0.4), Omnidirectional(), "fixed", "car", "front"],
    ids=lambda given: getattr(given, "name", given),
)
def test_other_platforms(platform: Any, rng: np.random.Generator) -> None:
    if isinstance(platform, str) and platform != "fixed":
        base = load("car_base")
        kind = Car if platform == "car" else FrontDriveCar
        robot = load("car_base", platform=kind(0.5, steering=base.platform.coordinates[3]))
        frames = [
            frame
            for frame in robot.frames
            if abs(robot.model.frames[robot.frame_id(frame)].placement.translation[0]) > 0.01
        ]
        task: Any = Task(Position(frames[-1], "xy"), [0.0, 0.0])
    else:
        robot, task = load("unicycle_2r", platform=platform), TIP
    functions = symbolic(robot, task).functions()
    for q in rng.uniform(-1, 1, (5, robot.n)):
        J = numeric(robot, task, q).J
        assert np.max(np.abs(functions.J(q) - J)) < 1e-10
        assert np.max(np.abs(np.array(list(functions.minors(q).values())) - minors_of(J))) < 1e-10


def test_wrist_of_the_ur5_on_a_fixed_base_has_the_known_singularities(rng: np.random.Generator) -> None:
    robot = load(load_ur5().source, platform="fixed")
    task = Task(Position("wrist_1_link"), [0.0, 0.0, 0.0])
    analysis = symbolic(robot, task)
    minors = [minor for minor in analysis.minors.values() if minor != 0]
    assert len(minors) == 1
    elbow = sympy.sin(analysis.symbols["elbow_joint"])
    assert elbow in minors[0].args
    assert "the other 19 are 0" in analysis.text()
    claim = singular_set(analysis)
    assert claim.proved
    assert "exactly where sin(elbow_joint) = 0 or" in claim.statement
    J = analysis.functions().J
    assert not analysis.notes
    for q in rng.uniform(-3, 3, (3, robot.n)):
        assert np.max(np.abs(J(q) - numeric(robot, task, q).J)) < 1e-10


def test_six_rows_of_the_ur5_are_refused_politely() -> None:
    rows = [Position("tool0"), *(Heading("tool0", *axes) for axes in (("x", "z"), ("x", "y"), ("y", "x")))]
    with pytest.raises(TooLarge, match="use the numeric analysis"):
        symbolic(load_ur5(), rows)


def test_what_has_no_formula_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    robot = load("unicycle_2r")
    with pytest.raises(InputError, match="no formula for Distance; there are Position, Heading"):
        symbolic(robot, Distance("ee", [0.0, 0.0, 0.0]))
    with pytest.raises(InputError, match="unknown geometry 'symbol'"):
        symbolic(robot, TIP, geometry="symbol")  # type: ignore[arg-type]  # wrong on purpose
    with pytest.raises(InputError, match="at most 4 rows"):
        symbolic(robot, [TIP, TIP, TIP])
    with pytest.raises(InputError, match="unknown frame"):
        symbolic(robot, Position("hand"))
    with pytest.raises(InputError, match="expected 2 different inputs"):
        made("unicycle_2r")[2].minor("v")
    with pytest.raises(InputError, match="unknown length 'l9'"):
        made("unicycle_2r")[2].functions().J(np.zeros(5), l9=1.0)
    monkeypatch.setitem(sys.modules, "sympy", None)
    with pytest.raises(InputError, match=r"pip install nmm\[symbolic\]"):
        symbolic(robot, TIP)
