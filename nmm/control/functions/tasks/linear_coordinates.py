"""Linear combinations of coordinates (joint couplings, absolute angles, EJ's y = h(q)), and postures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from nmm.base.arrays import Array, scalar
from nmm.base.errors import expect, expect_kind
from nmm.base.kernels.compiled import kernel
from nmm.base.kernels.records import FUNCTION, At, Frames, Rows
from nmm.base.text_format import signed_sum
from nmm.control.functions.function import Function, Row, Stage
from nmm.model.robots.robot import Robot

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
    """The matrix A (rows, n) of combinations of coordinates; `InputError` for unknown ones."""
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


class LinearCoordinates(Function):
    """y = A q, one component per combination; angles are not wrapped.

    As a task it couples joints: `Task(Coordinates({"q1": 1, "q2": -2}), 0)` keeps q1 = 2 q2. For single
    coordinates see `Posture`.

    Parameters
    ----------
    combinations : coordinates by name (q2), or combinations of them ({theta: 1, q1: 1})

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> here = nmm.Configuration(robot, robot.q({"q1": 0.2, "q2": 0.4}))
    >>> nmm.evaluate(nmm.LinearCoordinates({"q1": 1, "q2": 1}), 0.0, here).value.round(3)
    array([0.6])
    """

    def __init__(self, *combinations: Combination) -> None:
        nonempty = combinations and all(combinations)
        expect(nonempty, "coordinates", "one or more, as 'q1' or {'q1': 1, 'q2': -1}")
        self.combinations = combinations

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        matrix = coefficients(self.combinations, robot)
        kinds = [set(np.array(robot.q_units)[row != 0.0]) for row in matrix]
        units = [kind.pop() if len(kind) == 1 else "1" for kind in kinds]
        return tuple(map(Row, map(label, self.combinations), units))

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        matrix = coefficients(self.combinations, robot)
        return (Stage(linear, len(matrix), (), matrix.ravel()),)


class Posture(Function):
    """The values of coordinates, rad and m, one component each. As a task θ and continuous joints go the
    short way to their targets, at most half a turn, unless turns count or `Limits` bound them.

    Parameters
    ----------
    names : names of coordinates; by default all of the arm's that have an input
    turns : whether full turns count: 0 and 2π are then two targets

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> here = nmm.Configuration(robot, robot.q({"q1": 0.2, "q2": 0.4}))
    >>> nmm.evaluate(nmm.Posture("q1", "q2"), 0.0, here).value
    array([0.2, 0.4])
    >>> both = nmm.Posture("q1"), nmm.Posture("q1", turns=True)
    >>> [[row.angular for row in one.rows(robot)] for one in both]
    [[True], [False]]
    """

    def __init__(self, *names: str, turns: bool = False) -> None:
        for name in names:
            expect_kind(name, str, "posture", "names (Coordinates has sums)")
        expect(len(set(names)) == len(names), "posture", "each coordinate once", names)
        expect_kind(turns, bool, "posture: turns", "true or false")
        self.names, self.turns = names, turns

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        rows = self._coordinates(robot).rows(robot)
        return tuple(
            row._replace(angular=not self.turns and bool(robot.continuous[robot.coordinate(row.name)]))
            for row in rows
        )

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        return self._coordinates(robot).stages(robot)

    def _coordinates(self, robot: Robot) -> LinearCoordinates:
        names = self.names or robot.u_names[robot.platform.p :]
        expect(names, "posture", f"names of coordinates, {robot.name} has no manipulator")
        return LinearCoordinates(*names)
