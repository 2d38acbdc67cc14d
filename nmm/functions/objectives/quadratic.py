"""Quadratic objectives in linear combinations of coordinates (the paper's H1 to H4)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from nmm.arrays import Array, positive, scalar, vector
from nmm.errors import InputError
from nmm.functions.function import Stage
from nmm.functions.objectives.base import Objective
from nmm.functions.tasks.coordinates import Combination, coefficients, label
from nmm.kernels.compiled import kernel
from nmm.kernels.records import FUNCTION, At, Frames, Rows
from nmm.robots.robot import Robot


@kernel(FUNCTION)
def half_sum_of_squares(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
    """H = ½ Σ w (a·q - c)²; numbers = rows of [w, c, a...]."""
    n = at.q.shape[0]
    rows.value[0] = 0.0
    for row in range(numbers.shape[0] // (n + 2)):
        weight = numbers[row * (n + 2)]
        difference = -numbers[row * (n + 2) + 1]
        for j in range(n):
            difference += numbers[row * (n + 2) + 2 + j] * at.q[j]
        rows.value[0] += 0.5 * weight * difference * difference
        for j in range(n):
            rows.value_q[0, j] += weight * difference * numbers[row * (n + 2) + 2 + j]


@dataclass(frozen=True)
class Square:
    """½ weight (combination - target)²: target in the combination's unit, rad or m."""

    combination: Combination
    target: float = 0.0
    weight: float = 1.0


class Quadratic(Objective):
    """H(q) = ½ Σ weight (combination(q) - target)². Angles are read as they are, never wrapped.

    Parameters
    ----------
    squares : the terms; H1 of the paper is
        `Quadratic(Square({"theta": 1, "q1": 1, "q2": 1}, pi / 2), Square("q1", pi / 4))`
    """

    def __init__(self, *squares: Square) -> None:
        if not squares:
            raise InputError("quadratic objective: expected at least one term")
        for square in squares:
            if not square.combination:
                raise InputError("quadratic objective: expected a coordinate in every term, got none")
            name = f"term {label(square.combination)}"
            scalar(square.target, f"{name}: target")
            positive(square.weight, f"{name}: weight")
        self.squares = squares

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        A = coefficients([square.combination for square in self.squares], robot)
        head = np.array([[square.weight, square.target] for square in self.squares])
        return (Stage(half_sum_of_squares, 1, (), np.hstack([head, A]).ravel()),)


class JointRange(Objective):
    """Distance from the middle of the joint ranges, H = 1/(2N) Σ ((q - middle) / (upper - lower))²
    (Liégeois 1977); N joints, H from 0 (all in the middle) to 1/8 (all at a limit).

    Parameters
    ----------
    joints : names of coordinates; all the arm's, but those that follow others, when not given
    lower : their lower limits, rad or m; the robot's own when not given
    upper : their upper limits
    """

    def __init__(
        self,
        joints: Sequence[str] | None = None,
        lower: ArrayLike | None = None,
        upper: ArrayLike | None = None,
    ) -> None:
        self.joints = None if joints is None else tuple(joints)
        self.lower = lower
        self.upper = upper

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        joints = robot.u_names[robot.platform.p :] if self.joints is None else self.joints
        indices = [robot.coordinate(name) for name in joints]
        if not indices:
            raise InputError(f"joint range: robot {robot.name} has no arm joint")
        lower = self._limits(self.lower, robot.q_limits[indices, 0], "lower")
        upper = self._limits(self.upper, robot.q_limits[indices, 1], "upper")
        for name, low, high in zip(joints, lower, upper, strict=True):
            if not (np.isfinite(low) and np.isfinite(high)):
                raise InputError(
                    f"joint range: {name} of robot {robot.name} has no limits; give lower and upper"
                )
            if low >= high:
                raise InputError(
                    f"joint range: expected lower below upper for {name}, got {low:g} and {high:g}"
                )
        rows = np.zeros((len(indices), robot.n + 2))
        rows[:, 0] = 1.0 / (len(indices) * (upper - lower) ** 2)
        rows[:, 1] = (lower + upper) / 2
        rows[np.arange(len(indices)), 2 + np.array(indices)] = 1.0
        return (Stage(half_sum_of_squares, 1, (), rows.ravel()),)

    @staticmethod
    def _limits(given: ArrayLike | None, own: Array, name: str) -> Array:
        return np.array(own) if given is None else vector(given, own.size, f"joint range: {name}")
