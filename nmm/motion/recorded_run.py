"""A run over given times, recorded, with what is found at its start and in its rates."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import TypeAlias

import numpy as np

from nmm.base.arrays import Array
from nmm.base.findings import Finding
from nmm.control.controller import Controller
from nmm.control.goal import Goal
from nmm.control.integrators import Accelerated, Integrator
from nmm.control.standing_pose import standing_pose
from nmm.control.step.idle_inputs import idle_inputs
from nmm.model.robots.loading.ground import slip_warnings
from nmm.model.robots.loading.provenance import provenance_of
from nmm.motion.clearance import guarded
from nmm.motion.closed_loop import drive_loop
from nmm.motion.leg import Ended, Leaving
from nmm.motion.recording import Recorder
from nmm.motion.verdict import FindingLine, Outcome

#: Records a run over the times (N,) from q (n,), with progress and goal; returns how it ended.
Drive: TypeAlias = Callable[
    [Recorder, Array, Array, Callable[[float], None] | None, Goal | None], tuple[Outcome, FindingLine]
]


def sample_times(start: float, dt: float, steps: int, end: float) -> Array:
    """start, start + dt, ... for `steps` steps, up to the end, which is hit despite rounding."""
    times = np.minimum(start + np.arange(steps + 1) * dt, end)
    if end - times[-1] < 1e-6 * dt:
        times[-1] = end
    return times


def record_run(
    controller: Controller,
    advance: Integrator,
    times: Array,
    q: Array,
    progress: Callable[[float], None] | None,
    until: Goal | None = None,
    leg: Leaving | None = None,
    watch: Callable[[Recorder], None] | None = None,
    disturbed: Drive | None = None,
) -> tuple[Recorder, Ended]:
    """Integrate over the times (N,) from q; `watch` gets the recorder first. `disturbed` drives a robot that
    does not do as it is told."""
    recorder = Recorder(controller, times)
    recorder.at_middle = advance.at_middle
    if watch is not None:
        watch(recorder)
    if len(times) > 1 and not advance.tolerance:  # adaptive steps are shorter than the samples
        controller.dt = float(times[1] - times[0])
    recorder.findings += at_start(controller, q, times)
    guarded_advance = guarded(advance, controller)
    if controller.solver.second:
        own = controller.solver
        guarded_advance = Accelerated(advance, controller.robot, own.before, own.found.second.u_dot)
    if disturbed is None:
        outcome, reasons = drive_loop(controller, guarded_advance, recorder, times, q, progress, until, leg)
    else:
        outcome, reasons = disturbed(recorder, times, q, progress, until)
    if controller.solver.second:
        recorder.findings += rate_jumps(recorder, follows=leg is not None and math.isfinite(leg.earlier))
    recorder.blocking = controller.report.blocking()
    recorder.findings += recorder.noticed()
    if controller.safety_filter is not None:
        recorder.counts = controller.safety_filter.counts
    last = recorder.q[len(recorder) - 1] if len(recorder) else q
    return recorder, Ended(outcome, reasons, last, controller.solver.derivatives[0].copy())


#: A task's rate has jumped that changes by so many times what it changes by before and after,
JUMP = 10.0
#: if by more than this share of its largest size.
SMALL = 1e-2


def rate_jumps(recorder: Recorder, *, follows: bool) -> Iterator[Finding]:
    """Where the rate that tasks ask for jumps, which inputs of second order follow with bounded
    accelerations; `follows`: other tasks were active before."""
    found, t, k = recorder.so_far, recorder.t, float(recorder.controller.given.servo)
    if not len(t):
        return
    short = np.linalg.norm(found.rate - np.einsum("kij,kj->ki", found.J, found.u), axis=1)
    least = SMALL * max(1.0, float(np.linalg.norm(found.rate, axis=1).max()))
    where = []
    if follows and short[0] > least:
        where.append(0)
    if len(t) > 3:
        size = np.linalg.norm(np.diff(found.rate, axis=0), axis=1)
        beside = np.maximum(np.append(size[1:], np.inf), np.append(np.inf, size[:-1]))
        where += (1 + np.flatnonzero((size > JUMP * beside) & (size > least))).tolist()
    if where:
        times = [float(t[i]) for i in where]
        size_of = float(max(short[i] for i in where))
        yield Finding("rate_jumps", {"jumps": len(times), "size": size_of, "servo": k}, {"t": times[0]})


def in_degrees(angle: float) -> bool:
    """Whether an angle, rad, was probably meant in degrees: a whole number beyond a turn."""
    return abs(angle) >= 7.0 and float(angle).is_integer()


def at_start(controller: Controller, q: Array, times: Array) -> Iterator[Finding]:
    """Findings about a run over the times (N,), s, before its first sample at q (n,)."""
    robot, solver = controller.robot, controller.solver
    yield from provenance_of(robot).contradictions
    yield from slip_warnings(robot)
    yield from (Finding("python_costs", {"text": one}) for one in solver.program.costs)
    angles = (i for i in robot.following.independent if robot.q_units[i] == "rad")
    if degrees := {robot.q_names[i]: float(q[i]) for i in angles if in_degrees(q[i])}:
        yield Finding("start_in_degrees", {"angles": degrees})
    if controller.limits is not None:
        outside = robot.outside(q, solver.limits_on.coordinates)
        if outside:
            recovery = solver.limits_on.recovery
            yield Finding("start_outside_limits", {"outside": [*outside.values()], "recovery": recovery})
    if idle := idle_inputs(solver, q):
        yield Finding("idle_inputs", {"inputs": list(idle)})
    if held := standing_pose(solver, q, times[:: max(1, len(times) // 4)]):
        yield held
