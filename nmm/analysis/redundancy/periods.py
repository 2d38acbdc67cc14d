"""Periods of references, and whether they come round."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

from nmm.arrays import Array
from nmm.control.controller import Controller
from nmm.errors import InputError
from nmm.functions.function import Function
from nmm.functions.program import evaluate
from nmm.functions.references import Bearing, Circle, PoseReference
from nmm.kernels.rotations import exp3
from nmm.robots.configuration import Configuration

#: References may differ by this after a period, m and rad.
SAME = 1e-6
#: Periods of several references are taken together up to so many of the longest.
MOST_ROUNDS = 12


def common_period(controllers: Iterable[Controller], q: Array) -> float:
    """The time in which all references of tasks, the added one too, have come round, s.

    Parameters
    ----------
    q : (n,) where references that depend on the configuration are looked at

    Raises
    ------
    InputError : nothing moves, a reference of a kind that has no period to say, no common one
    """
    periods: list[float] = []
    for controller in controllers:
        configuration = Configuration(controller.robot, q)
        for task in (*controller.task, *controller.added_task):
            periods += _periods(task.reference, configuration)
    if not periods:
        raise InputError(
            "period: the task stands still: expected a reference that goes round, as a circle, or period="
        )
    longest = max(periods)
    for rounds in range(1, MOST_ROUNDS + 1):
        T = rounds * longest
        if all(abs(T / one - round(T / one)) < 1e-9 * T / one for one in periods):
            return T
    raise InputError(
        f"period: the references go round in {', '.join(f'{one:.6g} s' for one in dict.fromkeys(periods))}, "
        "which have no common period; expected period="
    )


def _periods(reference: Function, configuration: Configuration) -> list[float]:
    """The periods of what moves in a reference, s; none for what stands still."""
    if isinstance(reference, Circle):
        return [2.0 * math.pi / abs(reference.rate)] if reference.rate else []
    if isinstance(reference, Bearing):
        return _periods(reference.of, configuration)
    if isinstance(reference, PoseReference):
        return _periods(reference.position, configuration) + _periods(reference.orientation, configuration)
    values = [evaluate(reference, t, configuration).value for t in (0.0, 0.37, 1.7, 7.3, 31.0)]
    if all(np.array_equal(values[0], value) for value in values[1:]):
        return []
    raise InputError(
        f"period: {type(reference).__name__} does not say its period; expected period=, the time in which "
        "the reference goes round"
    )


def expect_periodic(controller: Controller, q: Array, T: float, laps: int) -> None:
    """`InputError` where a reference is elsewhere a period later, at any time of the laps."""
    configuration = Configuration(controller.robot, q)
    starts = T * np.array([0.0, 0.1234, 0.3579, 0.61803, 0.9])
    for task in (*controller.task, *controller.added_task):
        rows, turns = task.rows(controller.robot), task.function.comparison is not None
        angular = [row.angular for row in rows]
        values = [evaluate(task.reference, t, configuration).value for t in starts]
        first = [_comparable(value, angular, turns) for value in values]
        for lap in range(1, laps + 1):
            for k, t in enumerate(starts[:1] if lap == laps else starts):
                value = evaluate(task.reference, t + lap * T, configuration).value
                moved = np.abs(_comparable(value, angular, turns) - first[k]).max()
                if not moved < SAME:
                    raise InputError(
                        f"period: the reference of {', '.join(row.name for row in rows)} is not where it "
                        f"was {T:.6g} s before, at t = {t + lap * T:.4g} s ({moved:.3g} away): expected a "
                        "path that goes round, and its period"
                    )


def _comparable(value: Array, angular: Sequence[bool], turns: bool) -> Array:
    """The same for the same target: of an angle its cosine and sine, of a turn its matrix."""
    if turns:
        R = np.empty((3, 3))
        exp3(np.ascontiguousarray(value[-3:]), R)
        return np.concatenate([value[:-3], R.ravel()])
    parts = [[np.cos(v), np.sin(v)] if is_angle else [v] for v, is_angle in zip(value, angular, strict=True)]
    return np.concatenate(parts)
