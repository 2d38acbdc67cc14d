"""Rows of tasks, and of references that depend on q: their kernels, run on symbols. Distances and directions
that would make formulas long get symbols of their own before a kernel runs."""

from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from nmm.analysis.singular.jacobians import Reached
from nmm.base.errors import InputError
from nmm.base.kernels import records
from nmm.base.kernels.records import Frames, Rows
from nmm.control.functions.function import Function, Stage
from nmm.control.functions.references.circle import bearing
from nmm.control.functions.tasks import Stack
from nmm.control.functions.tasks.image import image_points, log_depth
from nmm.control.functions.tasks.pointing import pointing
from nmm.control.functions.tasks.pose import frame_pose, orientation_error, pose_error
from nmm.control.functions.tasks.position import distance
from nmm.model.robots.robot import CENTER_OF_MASS, Robot
from nmm.plugins.symbolic.expansion import Expansion, exact
from nmm.plugins.symbolic.frames import SymbolicFrames, lazy, steps_to, turns, unread
from nmm.plugins.symbolic.geometry import back, cross, dot, signed_axis, turned
from nmm.plugins.symbolic.quotient import Linear, Quotient, Untraceable, quotient
from nmm.plugins.symbolic.tracing import traced
from nmm.plugins.symbolic.written import Arc, Share, Turn, Value

#: For errors that are logarithms, the rows of the frame's velocity, linear over angular, that J has at 0.
_COMPARED: dict[Any, range] = {orientation_error: range(3, 6), pose_error: range(6)}

#: Two times, s, special to no motion: what differs between them depends on the time.
_INSTANTS = (0.7548776662, 1.5698402910)


class TracedRow(NamedTuple):
    """One row of f: its value, derivatives of f - g by the coordinates (n), whether g depends on q, and what
    must not be 0 for f and g to be defined."""

    value: Value
    gradient: list[Quotient]
    target_moves: bool
    defined: tuple[Expansion, ...]


def frames_of(functions: Iterable[Function], robot: Robot) -> list[str]:
    """Names of the frames that functions read, the centre of mass not among them."""
    stages = [stage for function in functions for stage in function.stages(robot)]
    frames = dict.fromkeys(frame for stage in stages for frame in stage.frames)
    return [frame for frame in frames if frame != CENTER_OF_MASS]


def task_rows(stack: Stack, frames: SymbolicFrames) -> list[TracedRow]:
    """The rows of f, with the derivatives of f - g, from which J of eq. 13 is made."""
    rows = []
    for task in stack:
        task.rows(frames.robot)
        frames.undefined.clear()
        values, gradients = function_rows(task.function, frames)
        moves = [False] * len(values)
        reached = isinstance(task.reference, Reached)
        if task.function.comparison is not None:
            kind = type(task.function).__name__
            if not reached:
                problem = f"the error of {kind} is a logarithm, which has no formula here"
                other = (
                    "the function without a target: J is then that of the error 0, in the frame's own axes"
                )
                raise InputError(f"{problem}; give {other}", where="symbolic")
            if task.function.comparison not in _COMPARED:
                raise InputError(f"no formula for the error of {kind}", where="symbolic")
            (stage,) = task.function.stages(frames.robot)
            moving = frames.twists(steps_to(frames.robot, *stage.frames))
            parts = _COMPARED[task.function.comparison]  # of the frame's velocity in its own axes
            gradients = [[Quotient(twist[part]) for twist in moving] for part in parts]
        elif not reached:
            targets = function_rows(task.reference, frames, target=True)[1]
            moves = [any(target) for target in targets]
            gradients = [
                [a - b for a, b in zip(row, target, strict=True)]
                for row, target in zip(gradients, targets, strict=True)
            ]
        defined = tuple(frames.undefined)
        rows += [TracedRow(*row, defined) for row in zip(values, gradients, moves, strict=True)]
    return rows


def function_rows(
    function: Function, frames: SymbolicFrames, target: bool = False
) -> tuple[list[Value], list[list[Quotient]]]:
    """Values (s) of a function of the configuration and its derivatives by the coordinates (s, n). A target's
    values may be those of some instant. `InputError` says why its kernel has no formula."""
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
        problem = f"no formula for {type(function).__name__}: {error}"
        raise InputError(f"{problem} (the numeric analysis takes every function)", where="symbolic") from None
    return values, gradients


def _evaluated(stages: Sequence[Stage], t: float, frames: SymbolicFrames) -> Rows:
    n, size = frames.robot.n, max(stage.rows for stage in stages)
    rows = Rows(*(np.full(shape, 0.0, dtype=object) for shape in (size, size, (size, n))))
    for stage in stages:
        if stage.callback is not None:
            raise Untraceable("it is a Python function of the user's")
        if not np.isfinite(stage.numbers).all():
            raise Untraceable("its numbers are not known yet")
        if stage.kernel is frame_pose:
            _frame_pose(stage, rows, frames)
        else:
            _run(stage, t, rows, frames)
    return rows


def _run(stage: Stage, t: float, rows: Rows, frames: SymbolicFrames) -> None:
    """Call a stage's kernel: the only place that knows its arguments."""
    q = np.array(frames.coordinates(), dtype=object)
    at = records.At(t, q, unread("G", 2), unread("G's derivatives", 3))
    read, change = frames.read(stage.frames), _CHANGES.get(stage.kernel)
    if change is not None:
        read = change(stage, read, rows, frames)
    own = Rows(*(block[: stage.rows] for block in rows))
    traced(stage.kernel, frames)(at, read, stage.numbers, own)


def _value(value: Any, frames: SymbolicFrames) -> Value:
    ring = frames.geometry.ring
    if isinstance(value, Arc | Turn):
        return value
    if isinstance(value, Linear) and any(ring.is_angle[i] for i in value.terms):
        return value
    ratio = quotient(value, ring)
    if ratio.under.variables():
        raise Untraceable("its value is a quotient")
    for angle, name in ring.ratios.items():  # kappa sin(alpha) is alpha
        kappa = ring.scalar(name)
        rest = ratio.over.divided(kappa * ring.sin({angle: 1}))
        if rest is not None and kappa.variables().isdisjoint(rest.variables()):
            return Share(ring.names[angle], rest)
    return ratio.over


def _frame_pose(stage: Stage, rows: Rows, frames: SymbolicFrames) -> None:
    """What the kernel `frame_pose` computes. Its rotation vector, a logarithm, stays a name, and has
    derivatives where a task compares it (see `task_rows`)."""
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


def _bearing(stage: Stage, read: Frames, rows: Rows, frames: SymbolicFrames) -> Frames:
    """T - p = rho (cos g, sin g)."""
    ring, value = frames.geometry.ring, rows.value
    towards = [ring.number(exact(float(entry))) for entry in stage.numbers]
    seen = [to - at for to, at in zip(towards, _polynomials(value[:2], frames), strict=True)]
    if any(entry.variables() for entry in seen):
        rho, turn = frames.auxiliary(("rho", "length", seen), ("g", "bearing", seen))
        g = {ring.variable(turn, True): 1}
        for i, wave in enumerate((ring.cos(g), ring.sin(g))):
            value[i] = Quotient(towards[i] - ring.scalar(rho) * wave)
    return read


def _distance(stage: Stage, read: Frames, rows: Rows, frames: SymbolicFrames) -> Frames:
    """d = to - p = rho (cos beta cos alpha, cos beta sin alpha, sin beta)."""
    ring, value, at = frames.geometry.ring, rows.value, frames.position(stage.frames[0])
    d = [to - p for to, p in zip(_polynomials(value, frames), at, strict=True)]
    level = not d[2]
    up = [] if level else [("beta", "elevation", d)]
    rho, azimuth, *rest = frames.auxiliary(
        ("rho", "length", d[:2] if level else d), ("alpha", "bearing", d[:2]), *up
    )
    alpha = {ring.variable(azimuth, True): 1}
    along = [ring.cos(alpha), ring.sin(alpha), ring.number(0)]
    if not level:
        beta = {ring.variable(rest[0], True): 1}
        along = [entry * ring.cos(beta) for entry in along[:2]] + [ring.sin(beta)]
    value[:] = [Quotient(p + ring.scalar(rho) * entry) for p, entry in zip(at, along, strict=True)]
    return read


def _pointing(stage: Stage, read: Frames, rows: Rows, frames: SymbolicFrames) -> Frames:
    """l = rho (cos alpha, sin alpha (cos beta, sin beta)) along the task's axes; kappa is alpha / sin alpha.
    All is in the frame's own axes; in others, the result would be the same."""
    ring = frames.geometry.ring
    if signed_axis(stage.numbers[:3]) is None:
        raise Untraceable("its axis is not x, y or z (or its negative)")
    axes = [[ring.number(exact(float(entry))) for entry in axis] for axis in stage.numbers.reshape(3, 3)]
    steps, at = steps_to(frames.robot, *stage.frames), frames.position(*stage.frames)
    d = [to - p for to, p in zip(_polynomials(rows.value, frames), at, strict=True)]
    seen = turned(back(turns(steps, frames.geometry)), d, ring)
    fixed = not any(quotient(entry, ring) for entry in rows.value_q.flat)  # in the world
    along = [dot(axis, seen) for axis in axes]
    rho, off, around, kappa = frames.auxiliary(
        ("rho", "length", seen),
        ("alpha", "off axis", along),
        ("beta", "bearing", along[1:]),
        ("kappa", "over sine", along),
    )
    alpha, beta = ring.variable(off, True), ring.variable(around, True)
    ring.ratios[alpha] = kappa
    length, sine = ring.scalar(rho), ring.sin({alpha: 1})
    parts = [
        length * ring.cos({alpha: 1}),
        *(length * sine * wave({beta: 1}) for wave in (ring.cos, ring.sin)),
    ]
    point = [dot([axis[i] for axis in axes], parts) for i in range(3)]
    velocity = frames.twists(steps)
    rows.value[:] = list(map(Quotient, point))
    if not fixed:
        gradients = [frames.gradient(entry) for entry in seen]
        for k, motion in enumerate(velocity):
            carried = [a + b for a, b in zip(motion[:3], cross(motion[3:], point), strict=True)]
            rows.value_q[:, k] = [Quotient(gradients[i][k] + carried[i]) for i in range(3)]
    return read._replace(
        placements=lazy(lambda k, i, j: float(i == j), 1, 3, 4),
        jacobians=lazy(lambda k, i, j: Quotient(velocity[j][i]), 1, 6, frames.robot.n),
    )


def _seen(stage: Stage, read: Frames, rows: Rows, frames: SymbolicFrames) -> Frames:
    """P = Z (xi, eta, 1) of each point, in the camera's own axes: J is the interaction matrix times the
    frame's motion."""
    ring = frames.geometry.ring
    steps, at = steps_to(frames.robot, *stage.frames), frames.position(*stage.frames)
    home, velocity, identity = back(turns(steps, frames.geometry)), frames.twists(steps), np.eye(3)
    for first in range(0, stage.rows, 3):
        own = slice(first, first + 3)
        d = [to - p for to, p in zip(_polynomials(rows.value[own], frames), at, strict=True)]
        P = turned(home, d, ring)
        fixed = not any(quotient(entry, ring) for entry in rows.value_q[own].flat)  # in the world
        Z, x, y = (
            ring.scalar(name)
            for name in frames.auxiliary(
                ("Z", "ahead", P[2:]), ("xi", "share", P[::2]), ("eta", "share", P[1:])
            )
        )
        point = [Z * x, Z * y, Z]
        if not fixed:
            gradients = [frames.gradient(entry) for entry in P]
            for k, motion in enumerate(velocity):
                carried = [a + b for a, b in zip(motion[:3], cross(motion[3:], point), strict=True)]
                rows.value_q[own, k] = [Quotient(gradients[i][k] + carried[i]) for i in range(3)]
        rows.value[own] = list(map(Quotient, point))
    return read._replace(
        placements=lazy(lambda k, i, j: float(identity[i, j]) if j < 3 else 0.0, 1, 3, 4),
        jacobians=lazy(lambda k, i, j: Quotient(velocity[j][i]), 1, 6, frames.robot.n),
    )


def _polynomials(values: Any, frames: SymbolicFrames) -> list[Expansion]:
    ratios = [quotient(value, frames.geometry.ring) for value in values]
    if any(ratio.under.variables() for ratio in ratios):
        raise Untraceable("it is taken of quotients")
    return [ratio.over for ratio in ratios]


#: Rewrite the point in a kernel's rows by its distance rho and angles from another, which keeps formulas
#: short; return the placements and Jacobians that the kernel then reads.
_CHANGES: dict[Any, Callable[..., Frames]] = {
    bearing: _bearing,
    distance: _distance,
    pointing: _pointing,
    image_points: _seen,
    log_depth: _seen,
}
