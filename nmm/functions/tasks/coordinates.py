"""Linear combinations of the coordinates: couplings of joints, absolute angles, and EJ's y = h(q)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from nmm.arrays import Array, scalar
from nmm.errors import InputError
from nmm.functions.function import Function, Row, Stage
from nmm.kernels.compiled import kernel
from nmm.kernels.records import FUNCTION, At, Frames, Rows
from nmm.robots.robot import Robot
from nmm.words import signed_sum

#: A coordinate's name, or the coefficients of several.
Combination = str | Mapping[str, float]


@kernel(FUNCTION)
def linear(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
    """y = A q; `numbers` holds A, row after row."""
    n = at.q.shape[0]
    for i in range(rows.value.shape[0]):
        rows.value[i] = 0.0
        for j in range(n):
            rows.value[i] += numbers[i * n + j] * at.q[j]
            rows.value_q[i, j] = numbers[i * n + j]


def coefficients(combinations: Sequence[Combination], robot: Robot) -> Array:
    """The matrix A (rows, n) of combinations of a robot's coordinates; `InputError` names what it lacks."""
    A = np.zeros((len(combinations), robot.n))
    for row, combination in zip(A, combinations, strict=True):
        named = {combination: 1.0} if isinstance(combination, str) else combination
        for name, value in named.items():
            row[robot.coordinate(name)] = scalar(value, f"coefficient of {name}")
    return A


def label(combination: Combination) -> str:
    """How a combination is written: "theta + q1 - 2 q2"."""
    if isinstance(combination, str):
        return combination
    return signed_sum(
        (value, name if abs(value) == 1.0 else f"{abs(value):g} {name}")
        for name, value in combination.items()
    )


class Coordinates(Function):
    """y = A q, a row a combination; angles are not wrapped.

    A joint coupling is such a task: `Task(Coordinates({"q1": 1, "q2": -2}), 0)` keeps q1 = 2 q2. For
    coordinates as they are, see `Posture`.

    Parameters
    ----------
    combinations : coordinates by name (q2), or combinations of them ({theta: 1, q1: 1})

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> here = nmm.Configuration(robot, robot.q({"q1": 0.2, "q2": 0.4}))
    >>> nmm.evaluate(nmm.Coordinates({"q1": 1, "q2": 1}), 0.0, here).value.round(3)
    array([0.6])
    """

    def __init__(self, *combinations: Combination) -> None:
        if not combinations or any(not combination for combination in combinations):
            raise InputError(
                "coordinates: expected at least one, as in Coordinates('q1', {'q1': 1, 'q2': -1})"
            )
        self.combinations = combinations

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        matrix = coefficients(self.combinations, robot)
        units = np.array(robot.q_units)
        rows = []
        for combination, row in zip(self.combinations, matrix, strict=True):
            kinds = set(units[row != 0.0])
            rows.append(Row(label(combination), kinds.pop() if len(kinds) == 1 else "1"))
        return tuple(rows)

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        matrix = coefficients(self.combinations, robot)
        return (Stage(linear, len(matrix), (), matrix.ravel()),)
