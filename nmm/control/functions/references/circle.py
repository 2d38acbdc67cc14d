"""The paper's references: a circle (eq. 16), the bearing of a moving point (section VI); and velocities."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import Array, positive, scalar, vector
from nmm.base.errors import InputError, expect
from nmm.base.kernels.compiled import kernel
from nmm.base.kernels.records import FUNCTION, At, Frames, Rows
from nmm.control.functions.function import Function, Row, Shown, Stage, named
from nmm.control.functions.references.polynomial import PiecewisePolynomial, piecewise_polynomial
from nmm.model.robots.robot import Robot


@kernel(FUNCTION)
def circle(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
    """c + ρ (cos φ e1 + sin φ e2), φ = φ0 + rate t, later by half the run-up T, within which the rate grows
    as 3 (t/T)² - 2 (t/T)³; numbers = [ρ, rate, φ0, i1, i2, T, c...]."""
    radius = numbers[0]
    rate = numbers[1]
    passed = at.t
    T = numbers[5]
    if T > 0.0:
        share = min(max(at.t / T, 0.0), 1.0)
        passed = T * share**3 * (1.0 - 0.5 * share) + max(at.t - T, 0.0)
        rate *= share * share * (3.0 - 2.0 * share)
    phase = numbers[2] + numbers[1] * passed
    first = int(numbers[3])
    second = int(numbers[4])
    for i in range(rows.value.shape[0]):
        rows.value[i] = numbers[6 + i]
    rows.value[first] += radius * math.cos(phase)
    rows.value[second] += radius * math.sin(phase)
    rows.value_t[first] = -radius * rate * math.sin(phase)
    rows.value_t[second] = radius * rate * math.cos(phase)


class Circle(Function):
    """A point on a circle: center + radius (cos φ, sin φ), φ = phase + rate t.

    Parameters
    ----------
    center : 2 numbers in the plane or 3 in space, m
    radius : m, above 0
    rate : angular speed, rad/s; negative runs clockwise
    phase : φ at t = 0, rad
    plane : xy, yz or zx, for a centre in space: the axes along which φ is 0 and π/2
    run_up : how long it takes from rest at t = 0 to its speed, s; by default it has it at all times

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> circle = nmm.Circle([2, 2], radius=3, rate=0.25)
    >>> nmm.evaluate(circle, 0.0, nmm.Configuration(robot, robot.rest)).value
    array([5., 2.])
    """

    def __init__(
        self,
        center: ArrayLike,
        radius: float,
        rate: float,
        phase: float = 0.0,
        plane: str = "xy",
        run_up: float = 0.0,
    ) -> None:
        self.center = vector(center, (2, 3), "center")
        valid = plane == "xy" or (plane in ("yz", "zx") and self.center.size == 3)
        expect(valid, "plane", "xy, or yz or zx with a center of 3 numbers", plane)
        self.radius = positive(radius, "radius")
        self.rate = scalar(rate, "rate")
        self.phase = scalar(phase, "phase")
        self.plane = plane
        self.run_up = scalar(run_up, "run_up")
        expect(self.run_up >= 0.0, "run_up", "a time, s, 0 for none", run_up)

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        return tuple(Row(axis, "m") for axis in "xyz"[: self.center.size])

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        first, second = ("xyz".index(axis) for axis in self.plane)
        numbers = np.array([self.radius, self.rate, self.phase, first, second, self.run_up, *self.center])
        return (Stage(circle, self.center.size, (), numbers),)


class VelocityOf(Function):
    """∂g/∂t of a reference of time, a row for each of its own; zero where the reference rests.

    Parameters
    ----------
    of : a circle, line, polynomial, spline or constant

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> along = nmm.VelocityOf(nmm.Circle([0, 0], radius=2, rate=0.5))
    >>> nmm.evaluate(along, 0.0, nmm.Configuration(robot, robot.rest)).value.round(3)
    array([0., 1.])
    """

    def __init__(self, of: Function) -> None:
        if not isinstance(of, Circle | PiecewisePolynomial) or getattr(of, "run_up", 0.0) > 0.0:
            expected = "a circle without run_up, line, polynomial, spline or constant"
            raise InputError(where="of", expected=expected, got=of)
        self.of = of

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        return tuple(Row(f"{row.name}_dot", f"{row.unit}/s") for row in self.of.rows(robot))

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        (stage,) = self.of.stages(robot)
        if isinstance(self.of, Circle):  # another circle, a quarter ahead, about the origin
            numbers = stage.numbers.copy()
            numbers[0] *= self.of.rate
            numbers[2] += math.pi / 2
            numbers[6:] = 0.0
            return (Stage(circle, stage.rows, (), numbers),)
        breaks, c = self.of.breaks, self.of.coefficients
        powers = np.arange(len(c) - 1, 0, -1)[:, None, None]
        slopes = np.zeros((max(1, len(powers)), len(breaks) + 1, stage.rows))  # at rest before and after
        slopes[:, 1:-1] = c[:-1] * powers if len(powers) else 0.0
        around = np.concatenate([[breaks[0] - 1.0], breaks, [breaks[-1] + 1.0]])
        if self.of.repeats:
            slopes, around = slopes[:, 1:-1], breaks
        layout = [len(around) - 1, len(slopes), self.of.repeats]
        numbers = np.concatenate([layout, around, slopes.transpose(2, 1, 0).ravel()])
        return (Stage(piecewise_polynomial, stage.rows, (), numbers),)


@kernel(FUNCTION)
def bearing(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
    """atan2(T - p) by the chain rule, in place: the first two rows hold p and its derivatives."""
    dx = numbers[0] - rows.value[0]
    dy = numbers[1] - rows.value[1]
    square = dx * dx + dy * dy
    rows.value_t[0] = (dy * rows.value_t[0] - dx * rows.value_t[1]) / square
    for j in range(at.q.shape[0]):
        rows.value_q[0, j] = (dy * rows.value_q[0, j] - dx * rows.value_q[1, j]) / square
    rows.value[0] = math.atan2(dy, dx)


class Bearing(Function):
    """Angle (rad) from the world's x axis at which a fixed point is seen from a moving one.

    Parameters
    ----------
    of : the moving point (its x and y): a reference of time (case 2), or a position of the robot (case 3),
        with which the bearing depends on q
    towards : the fixed point, 2 numbers, m (a third, z, is only drawn)

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> looks = nmm.Bearing(of=nmm.Position("ee", "xy"), towards=[5.0, 5.0])
    >>> float(nmm.evaluate(looks, 0.0, nmm.Configuration(robot, robot.rest)).value[0].round(3))
    0.908
    """

    def __init__(self, of: Function, towards: ArrayLike) -> None:
        self.of = of
        self.towards = vector(towards, (2, 3), "towards")

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        rows = self.of.rows(robot)
        point = len(rows) >= 2 and all(row.unit == "m" for row in rows[:2])
        expect(point, "bearing", "the point it is taken from to have x and y in m", named(rows))
        return (Row("bearing", "rad", angular=True),)

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        self.rows(robot)
        return (*self.of.stages(robot), Stage(bearing, 2, (), np.array(self.towards[:2])))

    def shown(self) -> Shown:
        return Shown(looks_at=self.towards)
