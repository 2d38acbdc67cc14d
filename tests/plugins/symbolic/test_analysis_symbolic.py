"""Formulas against the paper's corrected lists, against the compiled numbers, and in their own words."""

from __future__ import annotations

import itertools
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pytest
import sympy
import twin
from symbolic_checks import PAPER, TASKS, TIP, check_numbers, made, minors_of

from nmm.base.errors import InputError
from nmm.control.functions.tasks import Distance, Orientation, Pointing, Position
from nmm.model.platforms import DifferentialDrive
from nmm.model.robots.loading import load
from nmm.plugins.symbolic import symbolic
from nmm.plugins.symbolic.expressions import shown
from nmm.plugins.symbolic.symbolic_analysis import latex_lines

ARGUMENTS = [None, {"d": -0.2, "h": 0.4, "l1": 0.35, "l2": 0.35}, {"d": 0}]


def same(found: Any, expected: Any) -> bool:
    """Trigonometric polynomials, compared as sums of exponentials."""
    return bool(sympy.expand((found - expected).rewrite(sympy.exp)) == 0)


@pytest.mark.parametrize("arguments", ARGUMENTS, ids=["paper", "other", "d=0"])
@pytest.mark.parametrize(("name", "task"), PAPER)
def test_formulas_are_the_compiled_numbers(
    name: str, task: str, arguments: dict[str, float] | None, rng: np.random.Generator
) -> None:
    robot, tasks, analysis = made(name, task, arguments)
    check_numbers(robot, tasks, analysis, rng.uniform(-3, 3, (5, robot.n)))


@pytest.mark.parametrize(("name", "task"), PAPER)
def test_one_formula_serves_other_lengths(name: str, task: str, rng: np.random.Generator) -> None:
    """Against the paper written out again; arrays of configurations at once."""
    robot, _, analysis = made(name, task)
    functions = analysis.functions()
    for _ in range(3):
        d, l1, l2, l3 = rng.uniform(-1, 1, 4)
        q = rng.uniform(-3, 3, (2, 4, robot.n))
        if name == "unicycle_2r":
            other = twin.Planar(d, l1, l2)
            J = {"position": other.J, "pointing": other.J_pointing, "link heading": other.J_link_pointing,
                 "link pointing": other.J_bar}[task]  # fmt: skip
            given = {"d": d, "l1": l1, "l2": l2}
        else:
            J = twin.Elbow(d=d, l1=l1, l2=l2, l3=l3).J
            given = {"d": d, "l1": l1, "l2": l2, "l3": l3}
        found, minors = functions.J(q, **given), functions.minors(q, **given)
        assert found.shape == (2, 4, len(analysis.row_names), robot.n_u)
        for i, j in itertools.product(range(2), range(4)):
            assert np.max(np.abs(found[i, j] - J(q[i, j]))) < 1e-10
            values = np.array([minor[i, j] for minor in minors.values()])
            assert np.max(np.abs(values - minors_of(J(q[i, j])))) < 1e-10


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
    analysis = made("unicycle_3r", "spatial position")[2]
    d, l2, l3, q1, q2, q3 = (analysis.symbols[name] for name in ("d", "l2", "l3", "q1", "q2", "q3"))
    s1, c1, s3, s23 = sympy.sin(q1), sympy.cos(q1), sympy.sin(q3), sympy.sin(q2 + q3)
    L = l2 * sympy.sin(q2) + l3 * s23
    expected = [0, -L * (L * c1 + d), -l3 * s23 * (L * c1 + d), -(L**2) * c1, -l3 * s23 * L * c1,
                -l2 * l3 * s1 * s3, -d * L**2 * s1, -d * l3 * s1 * s23 * L, l2 * l3 * s3 * (d * c1 + L),
                l2 * l3 * L * s3]  # fmt: skip
    assert all(same(*pair) for pair in zip(analysis.minors.values(), expected, strict=True))
    assert list(analysis.named) == ["Lambda"]
    assert same(analysis.named["Lambda"], L)


def test_jacobian_is_the_derivative_of_the_value() -> None:
    """SymPy differentiates what the chain rule never saw."""
    for name in ("unicycle_2r", "unicycle_3r"):
        analysis = made(name, "pointing" if name == "unicycle_2r" else "spatial position")[2]
        q = list(analysis.q.values())
        theta = analysis.symbols["theta"]
        S = sympy.diag(
            sympy.Matrix([[sympy.cos(theta), 0], [sympy.sin(theta), 0], [0, 1]]), sympy.eye(len(q) - 3)
        )
        difference = analysis.f.jacobian(q) * S - analysis.J
        assert all(same(entry, 0) for entry in difference)


def test_text_is_what_a_person_would_write() -> None:
    lines = made("unicycle_3r", "spatial position")[2].text().splitlines()
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


def test_minors_of_the_matrix_that_case_3_inverts() -> None:
    """All four of J_bar, by hand from eq. 13: the target is seen from the elbow at e = rho (cos g, sin g)."""
    analysis = made("unicycle_2r", "link pointing")[2]
    names = ("x", "y", "theta", "q1", "q2", "d", "l1", "l2", "rho", "g")
    x, y, theta, q1, q2, d, l1, l2, rho, g = (analysis.symbols[name] for name in names)
    c, s, q = sympy.cos, sympy.sin, [x, y, theta, q1, q2]
    elbow = sympy.Matrix([x + d * c(theta) + l1 * c(theta + q1), y + d * s(theta) + l1 * s(theta + q1)])
    tip = elbow + l2 * sympy.Matrix([c(theta + q1 + q2), s(theta + q1 + q2)])
    moving = elbow.jacobian(q)
    # g = atan2(e_y, e_x) turns by (e_x de_y - e_y de_x) / rho^2, and de is the elbow's motion, backwards.
    bearing = (rho * s(g) * moving[0, :] - rho * c(g) * moving[1, :]) / rho**2
    S = sympy.diag(sympy.Matrix([[c(theta), 0], [s(theta), 0], [0, 1]]), sympy.eye(2))
    J = sympy.Matrix.vstack(tip.jacobian(q), sympy.Matrix([[0, 0, 1, 1, 0]]) - bearing) * S
    for columns in itertools.combinations(range(4), 3):
        minor = analysis.minor(*(analysis.u_names[j] for j in columns))
        assert same(minor, J[:, list(columns)].det())
    expected = d * (rho - l2 * c(theta + q1 + q2 - g)) / rho
    assert same(analysis.minor("v", "omega", "q1"), expected)
    assert same(analysis.minor("omega", "v", "q1"), -expected)


def test_a_length_set_to_zero_is_the_robot_without_it(rng: np.random.Generator) -> None:
    for name, task in PAPER:
        robot, tasks, there = made(name, task, {"d": 0})
        without = made(name, task)[2].without("d")
        assert "d" not in without.geometry
        assert [str(minor) for minor in without.minors.values()] == [str(m) for m in there.minors.values()]
        check_numbers(robot, tasks, without, rng.uniform(-3, 3, (2, robot.n)))


@pytest.mark.parametrize(("name", "task"), PAPER)
def test_latex_can_be_typeset(name: str, task: str) -> None:
    """By Matplotlib, formula by formula; it knows neither align nor matrices."""
    analysis = made(name, task)[2]
    typeset(latex_lines(analysis))
    typeset([("a", shown(entry).latex) for row in analysis.short_entries for entry in row])
    written = analysis.latex()
    assert written.count("{") == written.count("}")
    assert len(written) < 2500


def test_latex_of_auxiliary_quantities_can_be_typeset() -> None:
    robot = made("unicycle_3r", "spatial position")[0]
    for tasks in ([Orientation("ee"), Distance("ee", [1, 2, 3])], Pointing("link1", "ee", "x")):
        typeset(latex_lines(symbolic(robot, tasks)))


def typeset(lines: list[tuple[str, str]]) -> None:
    figure = plt.figure()
    for left, right in lines:
        figure.text(0, 0, f"${left} = {right}$")
    figure.canvas.draw()
    plt.close(figure)


def test_latex_names_the_factor() -> None:
    lines = dict(latex_lines(made("unicycle_3r", "spatial position")[2]))
    assert lines[r"\Lambda"] == "l_2 s_{2} + l_3 s_{23}"
    assert lines[r"\Delta_{v,\omega,q_2}"] == r"-\Lambda (d + \Lambda c_{1})"


def test_names_that_cannot_be_had(rng: np.random.Generator) -> None:
    robot = load("unicycle_2r")
    for arguments, message in (
        ({"x_q2": "a", "x_ee": "a"}, "'a' for x_ee = 0.3: it is the name of another length of 0.5 m"),
        ({"x_q2": "q1"}, "it is the name of the coordinate"),
    ):
        with pytest.raises(InputError, match=message):
            symbolic(robot, TIP, arguments=arguments)
    equal = load("unicycle_2r", arguments={"l1": 0.3})
    shared = symbolic(equal, TIP, arguments={"x_q2": "a", "x_ee": "a"})
    assert str(shared.minor("q1", "q2")) == "a**2*sin(q2)"
    # A name that another quantity would have had: that one gets another.
    driven = load("unicycle_2r", platform=DifferentialDrive(0.1, 0.4))
    analysis = symbolic(driven, TIP, arguments={"x_q2": "r"})
    assert (analysis.geometry["r"], analysis.geometry["r_"]) == (0.5, 0.1)
    check_numbers(driven, TIP, analysis, rng.uniform(-3, 3, (2, 5)))
    seen = symbolic(robot, TASKS["link pointing"], arguments={"x_q2": "rho"})
    assert list(seen.definitions) == ["rho2", "g2"]
    check_numbers(robot, TASKS["link pointing"], seen, rng.uniform(-3, 3, (2, 5)))


def test_bad_input_is_named() -> None:
    robot, _, analysis = made("unicycle_2r")
    with pytest.raises(InputError, match="unknown geometry 'symbol'"):
        symbolic(robot, TIP, geometry="symbol")  # type: ignore[arg-type]  # wrong on purpose
    with pytest.raises(InputError, match="at most 4 rows"):
        symbolic(robot, [TIP, TIP, TIP])
    with pytest.raises(InputError, match="unknown frame"):
        symbolic(robot, Position("hand"))
    with pytest.raises(InputError, match="expected 2 different inputs"):
        analysis.minor("v")
    with pytest.raises(InputError, match="unknown length 'l9'"):
        analysis.functions().J(np.zeros(5), l9=1.0)
    with pytest.raises(InputError, match="unknown length 'l9'"):
        analysis.without("l9")
