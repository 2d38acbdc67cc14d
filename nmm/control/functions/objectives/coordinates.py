"""Objectives of coordinates: quadratic (the paper's H1 to H4), of a posture, of joint ranges; a barrier."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import Array, positive, scalar, vector
from nmm.base.errors import InputError, expect, expect_known
from nmm.base.kernels.compiled import clear, kernel, scratch, view
from nmm.base.kernels.linear_algebra import add, copied
from nmm.base.kernels.records import FUNCTION, At, Frames, Rows
from nmm.control.functions.function import Function, Stage, only_row, stacked
from nmm.control.functions.objectives.base import Objective
from nmm.control.functions.references.polynomial import Constant
from nmm.control.functions.tasks.linear_coordinates import Combination, coefficients, label
from nmm.model.robots.robot import Robot

#: How many numbers a term begins with; its n coefficients follow.
HEAD = 4


@kernel(FUNCTION)
def quadratic(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
    """H = Σ w φ(x), x = a·q - c, φ = ½ x² or 1 - cos x; the rows hold moving targets. For every term, numbers
    = [w, c, row of the moving target or -1, whether it wraps, a...]."""
    n = at.q.shape[0]
    H, rate = 0.0, 0.0
    gradient = scratch(n)
    clear(gradient)
    for first in range(0, numbers.shape[0], HEAD + n):
        weight = numbers[first]
        moving = int(numbers[first + 2])
        difference = -(numbers[first + 1] if moving < 0 else rows.value[moving])
        for j in range(n):
            difference += numbers[first + HEAD + j] * at.q[j]
        if numbers[first + 3] == 0.0:
            H += 0.5 * weight * difference * difference
            slope = weight * difference
        else:
            half = math.sin(0.5 * difference)  # 1 - cos x without cancellation
            H += 2.0 * weight * half * half
            slope = weight * math.sin(difference)
        add(gradient, slope, view(numbers, first + HEAD, (n,)))
        if moving >= 0:
            rate -= slope * rows.value_t[moving]
            add(gradient, -slope, rows.value_q[moving])
    rows.value[0] = H
    rows.value_t[0] = rate
    copied(gradient, rows.value_q[0])


@dataclass(frozen=True)
class QuadraticTerm:
    """½ weight (combination - target)²: target in the combination's unit, rad or m, or a function of one row
    in it (a line, a spline, a signal, ...).

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> H = nmm.Quadratic(nmm.QuadraticTerm("q2", target=1.0, weight=4.0))
    >>> H.value(nmm.Configuration(robot, robot.rest))
    2.0
    """

    combination: Combination
    target: float | Function = 0.0
    weight: float = 1.0

    def check(self, name: str) -> None:
        """`InputError` for a target that is neither a number nor a function, or a weight not above 0."""
        if not isinstance(self.target, Function):
            scalar(self.target, f"{name}: target")
        positive(self.weight, f"{name}: weight")


def quadratic_stages(
    terms: Sequence[QuadraticTerm], robot: Robot, wraps: Sequence[bool] | None = None
) -> tuple[Stage, ...]:
    """`wraps` marks terms with 1 - cos; `InputError`: unknown coordinates, targets of several rows."""
    A = coefficients([term.combination for term in terms], robot)
    heads = np.zeros((len(terms), HEAD))
    moving: list[Function] = []
    for head, term, wrapping in zip(heads, terms, wraps or [False] * len(terms), strict=True):
        target, row = term.target, -1
        if isinstance(target, Function):
            only_row(target, robot, f"target of {label(term.combination)}", "one row")
            if isinstance(target, Constant):
                target = float(target.value[0])
            else:
                row = len(moving)
                moving.append(target)
                target = 0.0
        head[:] = term.weight, target, row, wrapping
    own = Stage(quadratic, max(1, len(moving)), (), np.hstack([heads, A]).ravel())
    return (*stacked(moving, robot), own)


class Quadratic(Objective):
    """H(q) = ½ Σ weight (combination(q) - target)². Angles are not wrapped.

    Parameters
    ----------
    squares : the terms; H1 of the paper is
        `Quadratic(Square({"theta": 1, "q1": 1, "q2": 1}, pi / 2), Square("q1", pi / 4))`

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> pointing = nmm.QuadraticTerm({"theta": 1, "q1": 1, "q2": 1}, np.pi / 2)
    >>> H = nmm.Quadratic(pointing, nmm.QuadraticTerm("q1", np.pi / 4))
    >>> round(H.value(nmm.Configuration(robot, robot.rest)), 3)
    1.542
    """

    def __init__(self, *squares: QuadraticTerm) -> None:
        expect(squares, "quadratic objective", "at least one term")
        for square in squares:
            expect(square.combination, "quadratic objective", "a coordinate in every term", None)
            square.check(f"term {label(square.combination)}")
        self.squares = squares

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        return quadratic_stages(self.squares, robot)


class PreferredPosture(Objective):
    """Distance from a posture, H(q) = Σ weight ½ (q_i - q_i*)², weight (1 - cos(q_i - q_i*)) for angles
    without limits.

    Parameters
    ----------
    posture : values by name, rad or m, each a number or a function of one row
    weights : numbers above 0 by name, 1 for the rest

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> H = nmm.PreferredPosture({"q1": 0.5, "q2": -0.5})
    >>> H.gradient(nmm.Configuration(robot, robot.rest)).round(3)
    array([ 0.   ,  0.   ,  0.   , -0.479,  0.479])
    """

    def __init__(
        self, posture: Mapping[str, Function | float], weights: Mapping[str, float] | None = None
    ) -> None:
        by_name = isinstance(posture, Mapping) and posture
        expect(by_name, "posture", 'values of coordinates by name, as in {"q1": 0.5}', posture)
        self.posture = dict(posture)
        self.weights = {
            name: positive(weight, f"weights: {name}") for name, weight in (weights or {}).items()
        }
        for name in self.weights:
            expect_known("coordinate", name, self.posture, "weights")
        for name, value in self.posture.items():
            QuadraticTerm(name, value).check(f"posture: {name}")

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        weights = self.weights
        terms = [QuadraticTerm(name, goal, weights.get(name, 1.0)) for name, goal in self.posture.items()]
        indices = [robot.coordinate(name) for name in self.posture]
        wraps = [bool(robot.endless[i]) for i in indices]
        return quadratic_stages(terms, robot, wraps)


class _OfRanges(Objective):
    """An objective of joints within limits: those given, or the robot's own."""

    def __init__(
        self,
        joints: Sequence[str] | None = None,
        lower: ArrayLike | None = None,
        upper: ArrayLike | None = None,
    ) -> None:
        self.joints = None if joints is None else tuple(joints)
        self.lower, self.upper = lower, upper

    def ranges(self, joints: Sequence[str], robot: Robot, what: str) -> tuple[Array, Array]:
        """Lower and upper limits (N,), rad and m; `InputError`: unknown joints, missing or reversed
        limits."""
        own = robot.q_limits[[robot.coordinate(name) for name in joints]]
        low, high = (
            own[:, k].copy() if bound is None else vector(bound, len(joints), f"{what}: {name}")
            for k, (name, bound) in enumerate((("lower", self.lower), ("upper", self.upper)))
        )
        for name, a, b in zip(joints, low, high, strict=True):
            if not (np.isfinite(a) and np.isfinite(b)):
                raise InputError(f"{robot.name} has no limits; give lower and upper", where=f"{what}: {name}")
            if a >= b:
                raise InputError(where=f"{what}: {name}", expected="lower below upper", got=(a, b))
        return low, high


class JointRange(_OfRanges):
    """Distance from the middle of N joint ranges, H = 1/(2N) Σ ((q - middle) / (upper - lower))² (Liégeois
    1977), from 0 to 1/8.

    Parameters
    ----------
    joints : names of coordinates; by default all of the arm's that have an input
    lower : their lower limits, rad or m; the robot's own when not given
    upper : their upper limits

    Examples
    --------
    >>> robot = nmm.load("unicycle_3r")
    >>> H = nmm.JointRange(["q2"], lower=[-1.0], upper=[1.0])
    >>> H.value(nmm.Configuration(robot, robot.q({"q2": 1.0})))
    0.125
    """

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        joints = robot.u_names[robot.platform.p :] if self.joints is None else self.joints
        if not joints:
            raise InputError(f"robot {robot.name} has no arm joint", where="joint range")
        lower, upper = self.ranges(joints, robot, "joint range")
        weights = 1.0 / (len(joints) * (upper - lower) ** 2)
        return quadratic_stages(list(map(QuadraticTerm, joints, (lower + upper) / 2, weights)), robot)


@kernel(FUNCTION)
def limit_barrier(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
    """H = Σ b(x), x = (q - l) / (u - l), b = 1 / (4 x (1 - x)), its Taylor parabola beyond the margin;
    numbers = [margin, then for every coordinate its index, l, u - l]."""
    margin = numbers[0]
    for i in range(1, numbers.shape[0], 3):
        k = int(numbers[i])
        x = (at.q[k] - numbers[i + 1]) / numbers[i + 2]
        clamped = min(max(x, margin), 1.0 - margin)
        y = 1.0 - clamped
        slope = 0.25 / (y * y) - 0.25 / (clamped * clamped)
        curvature = 0.5 / (clamped * clamped * clamped) + 0.5 / (y * y * y)
        beyond = x - clamped
        rows.value[0] += 0.25 / (clamped * y) + beyond * (slope + 0.5 * curvature * beyond)
        rows.value_q[0, k] += (slope + curvature * beyond) / numbers[i + 2]


class LimitBarrier(_OfRanges):
    """Barrier at the limits, H = Σ (u - l)² / (4 (u - q) (q - l)) (Zghal, Dubey, Euler 1990), 1 each in the
    middle.

    Within `margin` of a limit, and beyond it, a term continues as the parabola with its value, slope and
    curvature there (a relaxed barrier: Feller, Ebenbauer 2017). So H is finite and twice differentiable, a
    run may start at a limit, and a coordinate outside is pulled back. It guarantees nothing: hard limits are
    `Limits`. Near a limit its curvature is 1 / (2 margin³) over the range squared: α dt must be small there,
    or chosen by the resolver (`step: armijo`).

    Parameters
    ----------
    joints : names of coordinates; by default all with two limits and an input
    lower : their lower limits, rad or m; the robot's own when not given
    upper : their upper limits
    margin : share of the range, below 1/2, next to each limit where a parabola replaces it

    Examples
    --------
    >>> robot = nmm.load("unicycle_3r")
    >>> H = nmm.LimitBarrier(["q2"], lower=[-1.0], upper=[1.0])
    >>> [round(H.value(nmm.Configuration(robot, robot.q({"q2": q2}))), 2) for q2 in (0.0, 0.5, 0.9)]
    [1.0, 1.33, 5.26]
    """

    def __init__(
        self,
        joints: Sequence[str] | None = None,
        lower: ArrayLike | None = None,
        upper: ArrayLike | None = None,
        margin: float = 0.01,
    ) -> None:
        super().__init__(joints, lower, upper)
        self.margin = scalar(margin, "margin", above=0.0, below=0.5)

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        limited = (robot.q_names[i] for i in robot.following.independent if robot.limited[i].all())
        joints = tuple(limited) if self.joints is None else self.joints
        if not joints:
            raise InputError(f"{robot.name} has no coordinate with two limits", where="limit barrier")
        lower, upper = self.ranges(joints, robot, "limit barrier")
        table = np.column_stack([[robot.coordinate(name) for name in joints], lower, upper - lower])
        return (Stage(limit_barrier, 1, (), np.append(self.margin, table.ravel())),)
