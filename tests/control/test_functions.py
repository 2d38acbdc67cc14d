"""What functions, references and objectives are worth (their derivatives are checked elsewhere)."""

from __future__ import annotations

import math
from collections.abc import Callable
from math import pi

import numpy as np
import pinocchio as pin
import pytest
from function_grid import ENTRIES, random_configuration
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline, PPoly

from nmm.control.functions.function import Evaluation, Function
from nmm.control.functions.objectives import JointRange, Manipulability, Quadratic, QuadraticTerm, WeightedSum
from nmm.control.functions.program import evaluate
from nmm.control.functions.references import (
    Bearing,
    Circle,
    Constant,
    Line,
    PiecewisePolynomial,
    Polynomial,
    Spline,
    VelocityOf,
)
from nmm.control.functions.tasks import Heading, LinearCoordinates, Orientation, Pointing, Pose, Position
from nmm.model.robots.configuration import Configuration
from nmm.model.robots.robot import Robot

Array = NDArray[np.float64]

TIMES = np.array([0.0, 0.8, 2.0, 3.1, 4.4, 6.0])
POINTS = np.array([[0.3, 5.0], [1.0, 4.0], [0.2, 3.0], [-1.0, 3.5], [-0.5, 4.5], [0.3, 5.0]])


#: What a reference gives at a time; no reference here reads the configuration.
At = Callable[[Function, float], Evaluation]


@pytest.fixture
def at(robot_2r: Robot) -> At:
    configuration = Configuration(robot_2r, np.zeros(5))

    def evaluated(reference: Function, t: float) -> Evaluation:
        return evaluate(reference, t, configuration)

    return evaluated


def motion(at: At, spline: Spline, t: float, order: int) -> Array:
    """The derivative of that order at an end, from velocities inside the piece that begins or ends there."""
    h = 1e-3 if t < 3.0 else -1e-3
    velocities = np.array([at(spline, t + k * h).value_t for k in range(5)])
    # Exact for polynomials of the velocity's degree, four.
    powers = np.linalg.solve(np.vander(np.arange(5) * h, increasing=True), velocities)
    derivative: Array = powers[order - 1] * math.factorial(order - 1)
    return derivative


def test_constant(at: At) -> None:
    for t in (-1.0, 0.0, 0.5, 1.0, 99.0):
        assert list(at(Constant([1.0, -2.0]), t).value) == [1.0, -2.0]


def test_circle_and_its_planes(at: At) -> None:
    flat = Circle([1, 2], 3, 0.5, 0.2)
    for t in (0.0, 1.7, 40.0):
        phi = 0.2 + 0.5 * t
        a, b = 3 * np.cos(phi), 3 * np.sin(phi)
        np.testing.assert_allclose(at(flat, t).value, [1 + a, 2 + b], atol=1e-14)
        for plane, expected in (("xy", [a, b, 0]), ("yz", [0, a, b]), ("zx", [b, 0, a])):
            spatial = Circle([1, 2, 3], 3, 0.5, 0.2, plane)
            np.testing.assert_allclose(at(spatial, t).value, np.array([1, 2, 3]) + expected, atol=1e-14)


@pytest.mark.parametrize("profile", ["constant", "smooth"])
def test_line(profile: str, at: At) -> None:
    a, b = np.array([0.0, 1.0, 2.0]), np.array([3.0, -1.0, 2.5])
    line = Line(a, b, 4.0, profile)
    for t, share in ((-3.0, 0.0), (0.0, 0.0), (2.0, 0.5), (4.0, 1.0), (9.0, 1.0)):
        np.testing.assert_allclose(at(line, t).value, a + share * (b - a), atol=1e-14)
    for t in np.linspace(0.01, 3.99, 20):
        along = (at(line, t).value - a) / (b - a)
        np.testing.assert_allclose(along, along[0], atol=1e-13)
        speed = 0.25 if profile == "constant" else 30 / 4 * (t / 4) ** 2 * (1 - t / 4) ** 2
        np.testing.assert_allclose(at(line, t).value_t, speed * (b - a), atol=1e-13)


def test_polynomial(at: At) -> None:
    table = np.array([[1.0, 2.0], [0.5, -1.0], [0.1, 0.3]])
    for t, time in ((-1.0, 0.0), (1.5, 1.5), (5.0, 5.0), (7.0, 5.0)):
        expected = table[0] + table[1] * time + table[2] * time**2
        np.testing.assert_allclose(at(Polynomial(table, 5.0), t).value, expected, atol=1e-14)
    through = Polynomial.through([0.0, 1.0, 2.5], [[1.0], [0.0], [4.0]])
    for t, y in ((0.0, 1.0), (1.0, 0.0), (2.5, 4.0), (1.75, parabola(1.75))):
        assert at(through, t).value[0] == pytest.approx(y, abs=1e-13)


def parabola(t: float) -> float:
    """Through (0, 1), (1, 0), (2.5, 4), by Lagrange's formula."""
    return (t - 1) * (t - 2.5) / 2.5 + 4 * t * (t - 1) / (2.5 * 1.5)


def test_piecewise_polynomial_is_scipys_between_its_ends(at: At, rng: np.random.Generator) -> None:
    polynomial = PPoly(rng.normal(size=(5, 4, 3)), [-1.0, 0.5, 0.7, 3.0, 4.5])
    reference = PiecewisePolynomial(polynomial.x, polynomial.c)
    for t in (*np.linspace(-1.0, 4.5, 57), 0.5, 0.7, 3.0):
        found = at(reference, t)
        np.testing.assert_allclose(found.value, polynomial(t), rtol=1e-12, atol=1e-12)
        if t < 4.5:  # at the end SciPy and we stop at the same place, we with the speed of arrival
            np.testing.assert_allclose(found.value_t, polynomial(t, 1), rtol=1e-12, atol=1e-12)
    for t, end in ((-1.01, -1.0), (-9.0, -1.0), (4.51, 4.5), (80.0, 4.5)):
        np.testing.assert_allclose(at(reference, t).value, polynomial(end), rtol=1e-12)
        assert np.all(at(reference, t).value_t == 0.0)


@pytest.mark.parametrize(
    ("degree", "ends"), [(3, "rest"), (3, "natural"), (3, "periodic"), (5, "rest"), (5, "natural")]
)
def test_splines_pass_their_points_smoothly(degree: int, ends: str, at: At) -> None:
    spline = Spline(TIMES, POINTS, degree, ends)
    for t, point in zip(TIMES, POINTS, strict=True):
        np.testing.assert_allclose(at(spline, t).value, point, atol=1e-12)
    for t in TIMES[1:-1]:
        before, after = at(spline, t - 1e-9), at(spline, t + 1e-9)
        np.testing.assert_allclose(before.value, after.value, atol=1e-7)
        np.testing.assert_allclose(before.value_t, after.value_t, atol=1e-7)
    begin, end = TIMES[0], TIMES[-1]
    vanishing = {(3, "rest"): (1,), (3, "natural"): (2,), (5, "rest"): (1, 2), (5, "natural"): (3, 4)}
    for order in vanishing.get((degree, ends), ()):
        for t in (begin, end):
            # Differences of a polynomial are exact but for rounding, which their order magnifies.
            tolerance = 10.0 ** (3 * (order - 1) - 10)
            np.testing.assert_allclose(motion(at, spline, t, order), 0.0, atol=tolerance)
    if ends == "periodic":
        for order in (1, 2):
            a, b = motion(at, spline, begin, order), motion(at, spline, end, order)
            np.testing.assert_allclose(a, b, atol=1e-6)
        round_ = CubicSpline(TIMES, POINTS, bc_type="periodic")
        for t in np.concatenate(
            [begin + (end - begin) * np.linspace(-2.0, 3.0, 41), [end + 1e-9, end - 1e-9]]
        ):
            found = at(spline, t)
            np.testing.assert_allclose(found.value, round_(t), atol=1e-12)
            np.testing.assert_allclose(found.value_t, round_(t, 1), atol=1e-6)
            np.testing.assert_allclose(at(VelocityOf(spline), t).value, round_(t, 1), atol=1e-6)


def test_periodic_spline_takes_points_that_meet_but_for_rounding(at: At) -> None:
    angle = np.linspace(0, 2 * pi, 7)
    spline = Spline(angle, np.c_[50 * np.cos(angle), 50 * np.sin(angle)], ends="periodic")
    np.testing.assert_allclose(at(spline, 2 * pi).value, [50, 0], atol=1e-12)


def test_bearing(at: At) -> None:
    for T, angle in (([6, 2], 0.0), ([1, 9], pi / 2), ([-4, 2], pi), ([3, 0], -pi / 4)):
        for point, target in (([1.0, 2.0], T), ([1.0, 2.0, 7.0], [*T, 3.0])):
            found = at(Bearing(Constant(point), target), 0.0).value
            assert found[0] == pytest.approx(angle, abs=1e-15)


def test_position_and_heading(robot_3r: Robot, rng: np.random.Generator) -> None:
    for _ in range(10):
        configuration = Configuration(robot_3r, random_configuration(robot_3r, rng))
        pose = configuration.placement("ee")
        for picked, indices in (("x", [0]), ("zy", [2, 1]), ("xyz", [0, 1, 2])):
            found = evaluate(Position("ee", picked), 0.0, configuration).value
            np.testing.assert_array_equal(found, pose.translation[indices])
        direction = np.array([0.6, -0.3, 0.7])
        for about, (first, second) in {"z": (0, 1), "x": (1, 2), "y": (2, 0)}.items():
            d = pose.rotation @ direction
            found = evaluate(Heading("ee", direction, about), 0.0, configuration).value[0]
            assert found == pytest.approx(np.arctan2(d[second], d[first]), abs=1e-13)


def test_what_is_shown_of_a_function_is_where_it_is(
    robots: dict[str, Robot], rng: np.random.Generator
) -> None:
    """The rows that are said to hold a frame's position along world axes do."""
    positioned, turned, rotated = set(), set(), set()
    for entry in ENTRIES:
        said = entry.function.shown()
        configuration = Configuration(robots["unicycle_3r"], random_configuration(robots["unicycle_3r"], rng))
        if said.positions is not None:
            positioned.add(type(entry.function))
            found = evaluate(entry.function, 0.0, configuration).value
            place = configuration.placement(said.positions).translation
            assert said.axes
            for axis, row in said.axes.items():
                assert found[row] == place["xyz".index(axis)]
        if said.turns is not None:
            turned.add(type(entry.function))
            if said.rotation:
                rotated.add(type(entry.function))
                found = evaluate(entry.function, 0.0, configuration).value[list(said.rotation)]
                rotation = configuration.placement(said.turns).rotation
                np.testing.assert_allclose(pin.exp3(found), rotation, atol=1e-12)
    assert positioned == {Position, Pose}
    assert turned == {Orientation, Pointing, Pose}
    assert rotated == {Orientation, Pose}
    assert Orientation("ee", "link1").shown().rotation == ()
    for seen in (Position("ee", relative_to="link1"), Pose("ee", "link1"), Pointing("ee", "link1")):
        assert (seen.shown().positions, seen.shown().looks_at) == (None, None)
    np.testing.assert_array_equal(Pointing("ee", [6, 2, 1]).shown().looks_at, [6, 2, 1])
    np.testing.assert_array_equal(Bearing(Constant([1, 2]), [6, 2]).shown().looks_at, [6, 2])


def test_coordinates(robot_2r: Robot) -> None:
    task = LinearCoordinates("q2", {"theta": 1, "q1": -2}, {"x": 0.5, "theta": 1})
    found = evaluate(task, 0.0, Configuration(robot_2r, [1, 2, 30, 4, 5]))
    np.testing.assert_array_equal(found.value, [5.0, 22.0, 30.5])
    rows = task.rows(robot_2r)
    assert [row.name for row in rows] == ["q2", "theta - 2 q1", "0.5 x + theta"]
    assert [row.unit for row in rows] == ["rad", "rad", "1"]
    assert not any(row.angular for row in rows)


def test_sums(robot_2r: Robot) -> None:
    configuration = Configuration(robot_2r, [1, 2, 30, 4, 5])
    a, b = Quadratic(QuadraticTerm("q1")), Quadratic(QuadraticTerm("q2"))  # worth 8 and 12.5
    for objective, worth in (
        (a + b, 20.5),
        (a - b, -4.5),
        (-a, -8.0),
        (2.0 * a - (a + b) * 3.0, -45.5),
        (WeightedSum((2.0, a), (-1.0, b)), 3.5),
        (
            WeightedSum(
                (2.0, WeightedSum((3.0, a), (1.0, b))), (1.0, -(a + b)), (10.0, LinearCoordinates("x"))
            ),
            62.5,
        ),
    ):
        assert objective.value(configuration) == worth


def test_quadratic_and_joint_range(robot_2r: Robot) -> None:
    q = Configuration(robot_2r, [1, 2, 30, 4, 5])
    assert (
        Quadratic(QuadraticTerm({"theta": 1, "q1": -2}, 20, 3.0), QuadraticTerm("q2", 4)).value(q)
        == 3 * 2.0**2 / 2 + 0.5
    )
    middle, lower, upper = [0.5, 1.0], [-1.0, -3.0], [2.0, 5.0]
    objective = JointRange(["q1", "q2"], lower, upper)
    for arm, expected in ((middle, 0.0), (lower, 1 / 8), (upper, 1 / 8), ([2.0, 1.0], 1 / 16)):
        value = objective.value(Configuration(robot_2r, [9, 9, 9, *arm]))
        assert value == pytest.approx(expected, abs=1e-15)


@pytest.mark.parametrize(
    ("of", "rows"), [("robot", "xyz"), ("robot", ("z", "rx")), ("arm", "xz"), ("arm", "xyz")]
)
def test_manipulability(of: str, rows: tuple[str, ...], robot_3r: Robot, rng: np.random.Generator) -> None:
    index = {"x": 0, "y": 1, "z": 2, "rx": 3, "ry": 4, "rz": 5}
    for _ in range(10):
        configuration = Configuration(robot_3r, random_configuration(robot_3r, rng))
        J = configuration.jacobian("ee")[[index[row] for row in rows]]
        J = J @ configuration.S if of == "robot" else J[:, 3:]
        volume = np.prod(np.linalg.svd(J, compute_uv=False))
        assert Manipulability("ee", rows, of).value(configuration) == pytest.approx(volume, rel=1e-11)


def test_manipulability_of_a_singular_arm_is_zero_without_a_gradient(robot_3r: Robot) -> None:
    upright = Configuration(robot_3r, [0.3, 0.2, 1.0, 0.5, 0.0, 0.0])
    for of in ("robot", "arm"):
        w = Manipulability("ee", "xyz", of)
        assert w.value(upright) == 0.0
        np.testing.assert_array_equal(w.gradient(upright), np.zeros(6))
