"""Rows of tasks, and of references that depend on q: their kernels, run on symbols."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from nmm.analysis.formulas.auxiliaries import polar
from nmm.analysis.formulas.expansion import Expansion
from nmm.analysis.formulas.frames import Frames, unread
from nmm.analysis.formulas.kinematics import steps_to, turns, twists
from nmm.analysis.formulas.quotient import Linear, Quotient, Untraceable, quotient
from nmm.analysis.formulas.row_values import Arc, Share, Turn, Value
from nmm.analysis.formulas.tracing import traced
from nmm.analysis.singular.reached import Reached
from nmm.errors import InputError
from nmm.functions.function import Function, Stage
from nmm.functions.tasks import Stack
from nmm.functions.tasks.frame_pose import frame_pose
from nmm.functions.tasks.orientation import orientation_error
from nmm.functions.tasks.pose import pose_error
from nmm.kernels import records
from nmm.kernels.records import Rows
from nmm.robots.robot import CENTER_OF_MASS, Robot

#: The parts of a frame's velocity, linear over angular, that the errors of logarithms are, where they are 0.
_COMPARED = ((orientation_error, range(3, 6)), (pose_error, range(6)))


#: Two times, s, that are nothing to any motion: what differs between them depends on the time.
_INSTANTS = (0.7548776662, 1.5698402910)


class TracedRow(NamedTuple):
    """One row of f.

    Attributes
    ----------
    value : f's
    gradient : derivatives of f - g by the coordinates (n)
    target_moves : whether g has some
    defined : what f or g is undefined without
    """

    value: Value
    gradient: list[Quotient]
    target_moves: bool
    defined: tuple[Expansion, ...]


def frames_of(functions: Iterable[Function], robot: Robot) -> list[str]:
    """Names of the frames that functions read."""
    stages = [stage for function in functions for stage in function.stages(robot)]
    found = dict.fromkeys(frame for stage in stages for frame in stage.frames)
    return [frame for frame in found if frame != CENTER_OF_MASS]


def task_rows(stack: Stack, frames: Frames) -> list[TracedRow]:
    """The rows of f, with the derivatives of f - g, which J of eq. 13 is made of.

    Raises
    ------
    InputError : a function or a reference whose kernel does what has no formula
    """
    found = []
    for task in stack:
        task.rows(frames.robot)
        frames.undefined.clear()
        values, gradients = function_rows(task.function, frames)
        moves = [False] * len(values)
        reached = isinstance(task.reference, Reached)
        if task.function.comparison is not None:
            kind = type(task.function).__name__
            if not reached:
                raise InputError(
                    f"symbolic: the error of {kind} is a logarithm, which has no formula here; give the "
                    f"function without a target: J is then that of the error 0, in the frame's own axes"
                )
            gradients = _at_no_error(task.function, frames)
        elif not reached:
            targets = function_rows(task.reference, frames, target=True)[1]
            moves = [any(target) for target in targets]
            gradients = [
                [a - b for a, b in zip(row, target, strict=True)]
                for row, target in zip(gradients, targets, strict=True)
            ]
        defined = tuple(frames.undefined)
        found += [TracedRow(*row, defined) for row in zip(values, gradients, moves, strict=True)]
    return found


def function_rows(
    function: Function, frames: Frames, target: bool = False
) -> tuple[list[Value], list[list[Quotient]]]:
    """Values (s) and derivatives by the coordinates (s, n) of a function of the configuration.

    A target's values may depend on the time: they are those of some instant.

    Raises
    ------
    InputError : a function whose kernel does what has no formula
    """
    ring, s = frames.geometry.ring, len(function.rows(frames.robot))
    stages = function.stages(frames.robot)
    for stage in reversed(stages) if len(stages) > 1 else ():
        for frame in stage.frames:  # whose lengths come in this order
            frames.position(frame)
    try:
        rows, later = (_evaluated(stages, t, frames) for t in _INSTANTS)
        if (rows.value_q != later.value_q)[:s].any() or (
            not target and (rows.value != later.value)[:s].any()
        ):
            raise Untraceable("it depends on the time and on the configuration")
        values = [_value(value, frames) for value in rows.value[:s]]
        gradients = [[quotient(entry, ring) for entry in row] for row in rows.value_q[:s]]
    except (Untraceable, TypeError) as error:  # TypeError: of numbers alone
        raise InputError(
            f"symbolic: no formula for {type(function).__name__}: {error} (the numeric analysis takes every "
            "function)"
        ) from None
    return values, gradients


def _evaluated(stages: Sequence[Stage], t: float, frames: Frames) -> Rows:
    """A function's rows, as its stages write them."""
    n, size = frames.robot.n, max(stage.rows for stage in stages)
    rows = Rows(*(np.full(shape, 0.0, dtype=object) for shape in (size, size, (size, n))))
    for stage in stages:
        if stage.callback is not None:
            raise Untraceable("it is a Python function of the user's")
        if stage.kernel is frame_pose:
            _frame_pose(stage, rows, frames)
        else:
            _run(stage, t, rows, frames)
    return rows


def _run(stage: Stage, t: float, rows: Rows, frames: Frames) -> None:
    """Call a stage's kernel: the one place that knows what a function's kernel gets."""
    q = np.array(frames.coordinates(), dtype=object)
    at = records.At(t, q, unread("G", 2), unread("G's derivatives", 3))
    read = polar(stage, frames.read(stage.frames), rows, frames)
    own = Rows(*(block[: stage.rows] for block in rows))
    traced(stage.kernel, frames)(at, read, stage.numbers, own)


def _value(value: Any, frames: Frames) -> Value:
    """A row's value as it is written."""
    ring = frames.geometry.ring
    if isinstance(value, Arc | Turn):
        return value
    if isinstance(value, Linear) and any(ring.is_angle[i] for i in value.terms):
        return value
    found = quotient(value, ring)
    if found.under.variables():
        raise Untraceable("its value is a quotient")
    for angle, name in ring.ratios.items():  # kappa sin(alpha) is alpha
        kappa = ring.scalar(name)
        rest = found.over.divided(kappa * ring.sin({angle: 1}))
        if rest is not None and kappa.variables().isdisjoint(rest.variables()):
            return Share(ring.names[angle], rest)
    return found.over


def _frame_pose(stage: Stage, rows: Rows, frames: Frames) -> None:
    """What the kernel `frame_pose` computes, whose rotation vector is a logarithm: that stays a name, and has
    derivatives where a task compares it (see `_at_no_error`)."""
    geometry, ring = frames.geometry, frames.geometry.ring
    product = tuple(
        (turn.axis, tuple((ring.names[i], k) for i, k in turn.angle), turn.quarters)
        for turn in turns(steps_to(frames.robot, *stage.frames), geometry)
    )
    for row, part in enumerate(map(int, stage.numbers)):
        if part < 3:
            at = frames.position(*stage.frames)[part]
            rows.value[row] = Quotient(at)
            rows.value_q[row] = [Quotient(entry) for entry in frames.gradient(at)]
        else:
            rows.value[row] = Turn(part - 3, frames.matrix(product), product)


def _at_no_error(function: Function, frames: Frames) -> list[list[Quotient]]:
    """J of a logarithm's error where it is 0: the frame's velocity in its own axes."""
    parts = next((parts for kernel, parts in _COMPARED if kernel is function.comparison), None)
    if parts is None:
        raise InputError(f"symbolic: no formula for the error of {type(function).__name__}")
    (stage,) = function.stages(frames.robot)
    moving = twists(steps_to(frames.robot, *stage.frames), frames.geometry)
    zero = [frames.geometry.ring.number(0)] * 3
    return [
        [
            Quotient((moving.linear, moving.angular)[part // 3].get(joint, zero)[part % 3])
            for joint in frames.robot.q_names
        ]
        for part in parts
    ]
