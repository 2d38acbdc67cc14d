"""Weighted differences of combinations of coordinates from where they should be: one kernel for all."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from nmm.arrays import Array, positive, scalar
from nmm.errors import InputError
from nmm.functions.function import Function, Stage
from nmm.functions.references.polynomial import Constant
from nmm.functions.stacking import stacked
from nmm.functions.tasks.coordinates import Combination, coefficients, label
from nmm.kernels.compiled import kernel, scratch
from nmm.kernels.records import FUNCTION, At, Frames, Rows
from nmm.robots.robot import Robot

#: What a term's numbers begin with; its n coefficients come after them.
HEAD = 4


class Term(NamedTuple):
    """weight ½ (combination - target)², or weight (1 - cos(combination - target)) where it wraps."""

    combination: Combination
    target: float | Function
    weight: float
    wraps: bool = False


@kernel(FUNCTION)
def differences(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
    """H = Σ w φ(x), x = a·q - c, φ = ½ x² or 1 - cos x; the rows hold the targets that move.

    numbers = for every term [w, c, row of the target that moves or -1, whether it wraps, a...].
    """
    n = at.q.shape[0]
    H, rate = 0.0, 0.0
    gradient = scratch(n)
    for j in range(n):
        gradient[j] = 0.0
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
        for j in range(n):
            gradient[j] += slope * numbers[first + HEAD + j]
        if moving >= 0:
            rate -= slope * rows.value_t[moving]
            for j in range(n):
                gradient[j] -= slope * rows.value_q[moving, j]
    rows.value[0] = H
    rows.value_t[0] = rate
    for j in range(n):
        rows.value_q[0, j] = gradient[j]


def checked(term: Term, name: str) -> None:
    """`InputError` for a target that is no number (or function), and for a weight not above 0."""
    if not isinstance(term.target, Function):
        scalar(term.target, f"{name}: target")
    positive(term.weight, f"{name}: weight")


def difference_stages(terms: Sequence[Term], robot: Robot) -> tuple[Stage, ...]:
    """The stages of H; `InputError` for coordinates that the robot lacks and targets of several rows."""
    A = coefficients([term.combination for term in terms], robot)
    heads = np.zeros((len(terms), HEAD))
    moving: list[Function] = []
    for head, term in zip(heads, terms, strict=True):
        target, row = term.target, -1
        if isinstance(target, Function):
            rows = target.rows(robot)
            if len(rows) != 1:
                came = ", ".join(one.name for one in rows)
                raise InputError(f"target of {label(term.combination)}: expected one row, got {came}")
            if isinstance(target, Constant):
                target = float(target.value[0])
            else:
                row = len(moving)
                moving.append(target)
                target = 0.0
        head[:] = term.weight, target, row, term.wraps
    own = Stage(differences, max(1, len(moving)), (), np.hstack([heads, A]).ravel())
    return (*stacked(moving, robot), own)
