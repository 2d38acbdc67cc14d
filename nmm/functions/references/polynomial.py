"""Piecewise polynomials of time: constants, lines, polynomials and splines through waypoints."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from nmm.arrays import Array, array, positive, vector
from nmm.errors import InputError, expect_known
from nmm.functions.function import Function, Row, Stage
from nmm.kernels.compiled import kernel
from nmm.kernels.records import FUNCTION, At, Frames, Rows
from nmm.robots.robot import Robot

if TYPE_CHECKING:  # SciPy is imported where it is used: a third of a second that a circle need not pay
    from scipy.interpolate import BSpline


@kernel(FUNCTION)
def piecewise_polynomial(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
    """Horner's rule in the piece that holds t; at rest before the first and after the last break.

    numbers = [pieces, coefficients a piece, breaks..., coefficients (component, piece, power)],
    highest power first, in the time since the piece's beginning.
    """
    pieces = int(numbers[0])
    order = int(numbers[1])
    breaks = numbers[2 : 3 + pieces]
    piece = 0
    while piece < pieces - 1 and at.t >= breaks[piece + 1]:
        piece += 1
    outside = at.t < breaks[0] or at.t > breaks[pieces]
    local = min(max(at.t, breaks[0]), breaks[pieces]) - breaks[piece]
    for i in range(rows.value.shape[0]):
        first = 3 + pieces + (i * pieces + piece) * order
        y = 0.0
        y_t = 0.0
        for k in range(order):
            y_t = y_t * local + y
            y = y * local + numbers[first + k]
        rows.value[i] = y
        rows.value_t[i] = 0.0 if outside else y_t


class PiecewisePolynomial(Function):
    """Polynomials of time, piece after piece; from SciPy: `PiecewisePolynomial(p.x, p.c)` for a `PPoly` p.

    Before the first break and after the last it stays where it is, at rest.

    Parameters
    ----------
    breaks : (pieces + 1,) s, increasing
    coefficients : (order, pieces, s), highest power first, in the time since the piece's beginning
    unit : unit of the values, for tables and plots

    Examples
    --------
    >>> from scipy.interpolate import CubicSpline
    >>> robot = nmm.load("unicycle_2r")
    >>> path = CubicSpline([0, 1, 2], [[0, 0], [1, 0], [1, 1]])
    >>> reference = nmm.PiecewisePolynomial(path.x, path.c)
    >>> nmm.evaluate(reference, 1.0, nmm.Configuration(robot, robot.rest)).value.round(3)
    array([1., 0.])
    """

    def __init__(self, breaks: ArrayLike, coefficients: ArrayLike, unit: str = "m") -> None:
        self.unit = unit
        self.breaks = vector(breaks, None, "breaks")
        self.coefficients = array(coefficients, "coefficients")
        pieces = self.breaks.size - 1
        if pieces < 1:
            raise InputError(f"breaks: expected at least 2, got {pieces + 1}")
        if self.coefficients.ndim != 3 or self.coefficients.shape[1] != pieces or not self.coefficients.size:
            raise InputError(
                f"coefficients: expected shape (order, {pieces}, components) for {pieces + 1} breaks, "
                f"got {self.coefficients.shape}"
            )
        if np.any(np.diff(self.breaks) <= 0.0):
            raise InputError("breaks: expected them to increase")

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        return tuple(Row(f"r{i}", self.unit) for i in range(self.coefficients.shape[2]))

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        order, pieces, s = self.coefficients.shape
        numbers = [
            np.array([pieces, order], dtype=np.float64),
            self.breaks,
            self.coefficients.transpose(2, 1, 0).ravel(),
        ]
        return (Stage(piecewise_polynomial, s, (), np.concatenate(numbers)),)


class Constant(PiecewisePolynomial):
    """A target that does not move. A number or numbers in place of a reference are one too.

    Parameters
    ----------
    value : s numbers
    unit : of the values: m, rad or 1

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
    unit : of the values: m, rad or 1

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> throw = nmm.Polynomial([[0, 1], [1, 2], [0, -1]], duration=2)
    >>> nmm.evaluate(throw, 1.0, nmm.Configuration(robot, robot.rest)).value
    array([1., 2.])
    """

    def __init__(self, coefficients: ArrayLike, duration: float, unit: str = "m") -> None:
        table = array(coefficients, "coefficients")
        if table.ndim != 2 or table.size == 0:
            raise InputError(f"coefficients: expected a table (power, component), got shape {table.shape}")
        super().__init__([0.0, positive(duration, "duration")], table[::-1, None, :], unit)

    @classmethod
    def through(cls, times: ArrayLike, points: ArrayLike, unit: str = "m") -> Polynomial:
        """The polynomial of lowest degree through `points` (k, s) at `times` (k,), the first of them 0."""
        from scipy.interpolate import KroghInterpolator

        breaks, table = _waypoints(times, points)
        if breaks[0] != 0.0:
            raise InputError(f"times: expected the first to be 0, got {breaks[0]:g}")
        derivatives = np.atleast_2d(KroghInterpolator(breaks, table).derivatives(0.0, len(breaks)))
        factorials = np.cumprod([1.0, *range(1, len(breaks))])
        return cls(derivatives / factorials[:, None], float(breaks[-1]), unit)


#: How a way is gone: at a constant rate, or from rest to rest.
Profile = Literal["constant", "smooth"]


def share_of_way(profile: Profile, T: float) -> list[float]:
    """Coefficients, of the highest power of t first, of the share of the way gone at t, from 0 to 1 at T.

    Raises
    ------
    InputError : an unknown profile
    """
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
    profile : "constant" speed, or "smooth": a fifth-degree polynomial that starts and stops at
        rest with zero acceleration
    unit : of the values: m, rad or 1

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
    """A spline through waypoints; before the first and after the last it rests.

    Parameters
    ----------
    times : (k,) s, increasing
    points : (k, s), a point a time
    degree : 3, twice continuously differentiable, or 5, four times
    ends : "rest" (velocity zero at both ends; for degree 5 the acceleration too), "natural" (free
        ends; the second derivative is zero, for degree 5 the third and fourth), or "periodic" (the
        last point equals the first; degree 3)
    unit : of the values: m, rad or 1

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
        if degree not in (3, 5) or (degree == 5 and ends == "periodic"):
            raise InputError(
                f"spline: expected degree 3, or 5 with ends rest or natural, got {degree} with {ends}"
            )
        expect_known("ends", ends, ("rest", "natural", "periodic"))
        if ends == "periodic" and not np.allclose(table[0], table[-1], rtol=0, atol=1e-12):
            raise InputError("points: expected the last to equal the first for periodic ends")
        if ends == "periodic":
            table[-1] = table[0]  # SciPy wants them equal to the last bit
        if degree == 5 and ends == "natural" and len(breaks) < 3:
            raise InputError(f"points: expected at least 3 for degree 5 with natural ends, got {len(breaks)}")
        if degree == 3:
            coefficients = CubicSpline(breaks, table, bc_type="clamped" if ends == "rest" else ends).c
        else:
            zero = np.zeros(table.shape[1])
            orders = (1, 2) if ends == "rest" else (3, 4)
            conditions: Any = [(order, zero) for order in orders]  # the stubs know no derivative conditions
            spline = make_interp_spline(breaks, table, k=5, bc_type=(conditions, conditions))
            coefficients = _pieces(spline, breaks)
        super().__init__(breaks, coefficients, unit)


def _pieces(spline: BSpline, breaks: Array) -> Array:
    """A B-spline as polynomials between the breaks (`PPoly.from_spline` takes one component only)."""
    starts = breaks[:-1]
    taylor = [spline(starts, nu=power) / math.factorial(power) for power in range(spline.k, -1, -1)]
    return np.array(taylor)


def _waypoints(times: ArrayLike, points: ArrayLike) -> tuple[Array, Array]:
    breaks = vector(times, None, "times")
    table = array(points, "points")
    if table.ndim == 1:
        table = table[:, None]
    if breaks.size < 2 or table.ndim != 2 or len(table) != breaks.size:
        raise InputError(
            f"waypoints: expected at least two times and as many points, got {breaks.size} times and "
            f"points of shape {table.shape}"
        )
    if np.any(np.diff(breaks) <= 0.0):
        raise InputError("times: expected them to increase")
    return breaks, table
