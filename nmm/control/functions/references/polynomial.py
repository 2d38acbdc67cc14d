"""Piecewise polynomials of time: constants, lines, polynomials and splines through waypoints."""

from __future__ import annotations

import math
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import Array, array, increasing, positive, vector
from nmm.base.errors import expect, expect_known
from nmm.base.kernels.compiled import kernel
from nmm.base.kernels.records import FUNCTION, At, Frames, Rows
from nmm.control.functions.function import Function, Row, Stage
from nmm.model.robots.robot import Robot


@kernel(FUNCTION)
def piecewise_polynomial(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
    """Horner's rule in the piece that holds t; before the first and after the last break at rest or, with
    `repeats`, a whole number of rounds away. numbers = [pieces, coefficients a piece, repeats, breaks...,
    coefficients (component, piece, power)], highest power first, in the time since the piece's beginning."""
    pieces = int(numbers[0])
    order = int(numbers[1])
    repeats = numbers[2] != 0.0
    breaks = numbers[3 : 4 + pieces]
    t = at.t
    if repeats:
        t = breaks[0] + (t - breaks[0]) % (breaks[pieces] - breaks[0])
    piece = 0
    while piece < pieces - 1 and t >= breaks[piece + 1]:
        piece += 1
    rests = not repeats and (t < breaks[0] or t > breaks[pieces])
    local = min(max(t, breaks[0]), breaks[pieces]) - breaks[piece]
    for i in range(rows.value.shape[0]):
        first = 4 + pieces + (i * pieces + piece) * order
        y = 0.0
        y_t = 0.0
        for k in range(order):
            y_t = y_t * local + y
            y = y * local + numbers[first + k]
        rows.value[i] = y
        rows.value_t[i] = 0.0 if rests else y_t


class PiecewisePolynomial(Function):
    """Polynomials of time, piece after piece; from SciPy: `PiecewisePolynomial(p.x, p.c)` for a `PPoly` p.

    Before the first break and after the last it stays where it is, at rest, unless it repeats.

    Parameters
    ----------
    breaks : (pieces + 1,) s, increasing
    coefficients : (order, pieces, s), highest power first, in the time since the piece's beginning
    unit : unit of the values, for tables and plots
    repeats : whether it goes round again and again, as `extrapolate="periodic"` of a `PPoly`

    Examples
    --------
    >>> from scipy.interpolate import CubicSpline
    >>> robot = nmm.load("unicycle_2r")
    >>> path = CubicSpline([0, 1, 2], [[0, 0], [1, 0], [1, 1]])
    >>> reference = nmm.extending.PiecewisePolynomial(path.x, path.c)
    >>> nmm.evaluate(reference, 1.0, nmm.Configuration(robot, robot.rest)).value.round(3)
    array([1., 0.])
    """

    def __init__(
        self, breaks: ArrayLike, coefficients: ArrayLike, unit: str = "m", repeats: bool = False
    ) -> None:
        self.unit = unit
        self.repeats = repeats
        self.breaks = vector(breaks, None, "breaks")
        self.coefficients = array(coefficients, "coefficients")
        pieces, c = self.breaks.size - 1, self.coefficients
        expect(pieces >= 1, "breaks", "at least 2", pieces + 1)
        table = c.ndim == 3 and c.shape[1] == pieces and c.size
        expect(table, "coefficients", f"shape (order, {pieces}, components) for {pieces + 1} breaks", c)
        increasing(self.breaks, "breaks")

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        return tuple(Row(f"r{i}", self.unit) for i in range(self.coefficients.shape[2]))

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        order, pieces, s = self.coefficients.shape
        table = self.coefficients.transpose(2, 1, 0).ravel()
        return (Stage(piecewise_polynomial, s, (), np.r_[pieces, order, self.repeats, self.breaks, table]),)


class Constant(PiecewisePolynomial):
    """A target that does not move. A number or numbers in place of a reference are one too.

    Parameters
    ----------
    value : s numbers
    unit : m, rad or 1

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> task = nmm.Task(nmm.Position("ee", "xy"), nmm.Constant([2.0, 1.0]))
    >>> nmm.Controller(robot, task, nmm.ProjectedGradient()).evaluate(0.0, robot.rest).r_d
    array([2., 1.])
    """

    def __init__(self, value: ArrayLike, unit: str = "m") -> None:
        self.value = value = vector(np.atleast_1d(array(value, "value")), None, "value")
        super().__init__([0.0, 1.0], value[None, None, :], unit)


class Polynomial(PiecewisePolynomial):
    """r(t) = c0 + c1 t + c2 t² + ... up to `duration`, then at rest.

    Parameters
    ----------
    coefficients : (order, s), lowest power first, in m/s^k
    duration : s, above 0
    unit : m, rad or 1

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> throw = nmm.Polynomial([[0, 1], [1, 2], [0, -1]], duration=2)
    >>> nmm.evaluate(throw, 1.0, nmm.Configuration(robot, robot.rest)).value
    array([1., 2.])
    """

    def __init__(self, coefficients: ArrayLike, duration: float, unit: str = "m") -> None:
        table = array(coefficients, "coefficients")
        expect(table.ndim == 2 and table.size != 0, "coefficients", "a table (power, component)", table)
        super().__init__([0.0, positive(duration, "duration")], table[::-1, None, :], unit)

    @classmethod
    def through(cls, times: ArrayLike, points: ArrayLike, unit: str = "m") -> Polynomial:
        """The polynomial of lowest degree through `points` (k, s) at `times` (k,), the first of them 0."""
        from scipy.interpolate import KroghInterpolator  # here: a circle need not wait for SciPy

        breaks, table = _waypoints(times, points)
        expect(breaks[0] == 0.0, "times", "the first to be 0", breaks[0])
        derivatives = np.atleast_2d(KroghInterpolator(breaks, table).derivatives(0.0, len(breaks)))
        factorials = np.cumprod([1.0, *range(1, len(breaks))])
        return cls(derivatives / factorials[:, None], float(breaks[-1]), unit)


#: How a way is gone: at a constant rate, or from rest to rest.
Profile = Literal["constant", "smooth"]


def share_of_way(profile: Profile, T: float) -> list[float]:
    """Coefficients, highest power first, of s(t) from 0 to 1 at T; `InputError` for an unknown profile."""
    profiles = {"constant": [1 / T, 0.0], "smooth": [6 / T**5, -15 / T**4, 10 / T**3, 0.0, 0.0, 0.0]}
    expect_known("profile", profile, profiles)
    return profiles[profile]


class Line(PiecewisePolynomial):
    """A straight line from `start` to `end` in `duration` s, then at rest.

    Parameters
    ----------
    start : where it begins, s numbers
    end : where it ends, s numbers
    duration : s, above 0
    profile : "constant" speed, or "smooth", a fifth-degree polynomial from rest to rest
    unit : m, rad or 1

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> line = nmm.Line([0, 0], [2, 1], duration=4)
    >>> nmm.evaluate(line, 2.0, nmm.Configuration(robot, robot.rest)).value
    array([1. , 0.5])
    """

    def __init__(
        self,
        start: ArrayLike,
        end: ArrayLike,
        duration: float,
        profile: Profile = "constant",
        unit: str = "m",
    ) -> None:
        a = vector(np.atleast_1d(array(start, "start")), None, "start")
        b = vector(np.atleast_1d(array(end, "end")), a.size, "end")
        T = positive(duration, "duration")
        coefficients = np.array(share_of_way(profile, T))[:, None, None] * (b - a)
        coefficients[-1, 0] += a
        super().__init__([0.0, T], coefficients, unit)


class Spline(PiecewisePolynomial):
    """A spline through waypoints; before the first and after the last it rests, or goes round if periodic.

    Parameters
    ----------
    times : (k,) s, increasing
    points : (k, s), a point a time
    degree : 3, twice continuously differentiable, or 5, four times
    ends : "rest" (at both ends), "natural" (free ends), or "periodic" (the last point equals the first,
        from where it goes round again; degree 3)
    unit : m, rad or 1

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> spline = nmm.Spline([0, 2, 4], [[0, 0], [1, 1], [2, 0]])
    >>> nmm.evaluate(spline, 2.0, nmm.Configuration(robot, robot.rest)).value.round(3)
    array([1., 1.])
    """

    def __init__(
        self,
        times: ArrayLike,
        points: ArrayLike,
        degree: int = 3,
        ends: Literal["rest", "natural", "periodic"] = "rest",
        unit: str = "m",
    ) -> None:
        from scipy.interpolate import CubicSpline, make_interp_spline

        breaks, table = _waypoints(times, points)
        known = degree == 3 or (degree == 5 and ends != "periodic")
        expect(known, "spline: degree", "3, or 5 with other ends", (degree, ends))
        expect_known("ends", ends, ("rest", "natural", "periodic"))
        if ends == "periodic":
            closed = np.allclose(table[0], table[-1], rtol=0, atol=1e-12)
            expect(closed, "points", "the last to equal the first for periodic ends")
            table[-1] = table[0]  # SciPy wants them equal to the last bit
        if degree == 3:
            coefficients = CubicSpline(breaks, table, bc_type="clamped" if ends == "rest" else ends).c
        else:
            enough = ends != "natural" or len(breaks) >= 3
            expect(enough, "points", "at least 3 for natural ends", len(breaks))
            zero = np.zeros(table.shape[1])
            orders = (1, 2) if ends == "rest" else (3, 4)
            conditions: Any = [(order, zero) for order in orders]  # the stubs know no derivative conditions
            spline = make_interp_spline(breaks, table, k=5, bc_type=(conditions, conditions))
            # As polynomials between the breaks; `PPoly.from_spline` takes one component only.
            powers = range(spline.k, -1, -1)
            coefficients = np.array([spline(breaks[:-1], nu=nu) / math.factorial(nu) for nu in powers])
        super().__init__(breaks, coefficients, unit, repeats=ends == "periodic")


def _waypoints(times: ArrayLike, points: ArrayLike) -> tuple[Array, Array]:
    breaks = vector(times, None, "times")
    table = array(points, "points")
    if table.ndim == 1:
        table = table[:, None]
    even = table.ndim == 2 and len(table) == breaks.size >= 2
    expect(even, "points", f"as many as times, {breaks.size}, and at least 2", table)
    increasing(breaks, "times")
    return breaks, table
