"""A run over given times, recorded, with what is found at its start and in its rates."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np

from nmm.base.arrays import Array
from nmm.base.errors import InputError, RunError
from nmm.base.findings import Finding
from nmm.base.progress import between
from nmm.control.controller import Controller
from nmm.control.goal import Goal
from nmm.control.plant import Plant
from nmm.control.sequencing.sequence import Schedule
from nmm.control.standing_pose import standing_pose
from nmm.control.step.idle_inputs import idle_inputs
from nmm.model.robots.loading.ground import slip_warnings
from nmm.model.robots.loading.provenance import provenance_of
from nmm.motion.closed_loop import drive_loop, finding_in
from nmm.motion.leg import Leaving, Leg, RunEnd
from nmm.motion.recording import Recorder
from nmm.motion.verdict import Outcome


def sample_times(start: float, dt: float, steps: int, end: float) -> Array:
    """start, start + dt, ... for `steps` steps, up to the end, which is hit despite rounding."""
    times = np.minimum(start + np.arange(steps + 1) * dt, end)
    if end - times[-1] < 1e-6 * dt:
        times[-1] = end
    return times


def record_run(
    controller: Controller,
    plant: Plant,
    times: Array,
    q: Array,
    progress: Callable[[float], None] | None = None,
    until: Goal | None = None,
    leg: Leaving | None = None,
    watch: Callable[[Recorder], object] | None = None,
) -> tuple[Recorder, RunEnd]:
    """Run over the times (N,) from q; `watch` gets the recorder first."""
    recorder = Recorder(controller, times)
    recorder.at_middle = plant.integrator.at_middle
    if watch is not None:
        watch(recorder)
    if len(times) > 1 and not plant.integrator.tolerance:  # adaptive steps are shorter than the samples
        controller.dt = float(times[1] - times[0])
    recorder.findings += at_start(controller, q, times)
    outcome, reasons = drive_loop(controller, plant, recorder, times, q, progress, until, leg)
    if controller.solver.second:
        recorder.findings += rate_jumps(recorder, follows=leg is not None and math.isfinite(leg.earlier))
    recorder.blocking = controller.report.blocking()
    recorder.findings += recorder.noticed()
    if controller.safety_filter is not None:
        recorder.counts = controller.safety_filter.counts
    last = recorder.q[len(recorder) - 1] if len(recorder) else q
    return recorder, RunEnd(outcome, reasons, last, controller.solver.derivatives[0].copy())


def run_legs(
    controller: Controller,
    schedule: Schedule,
    plant: Plant,
    times: Array,
    q: Array,
    progress: Callable[[float], None] | None = None,
    until: Goal | None = None,
    watch: Callable[[Recorder], object] | None = None,
) -> list[Leg]:
    """The run of tasks that come and go, a leg for each set of active tasks from event to event; an event's
    sample is the next leg's."""
    legs: list[Leg] = []
    controller.reset()
    plant.begin(q)
    schedule.changes(float(times[0]), plant.seen(0, q))
    first, steps = 0, max(1, len(times) - 1)
    while True:
        try:
            inner = controller.switch()
        except RunError as error:
            if not legs:
                raise error.at("", InputError) from None
            legs[-1].ended = legs[-1].ended._replace(outcome=Outcome.FAILED, reasons=(finding_in(error),))
            return legs
        leaving = Leaving(schedule, float(times[first - 1]) if first else -math.inf)
        active, waiting = schedule.moment.active, schedule.sequence.waiting(schedule.moment)
        share = between(progress, first / steps, 1.0 - first / steps)
        goal = until if any(active) and not waiting else None
        moved = plant.later(first)
        recorder, ended = record_run(inner, moved, times[first:], q, share, goal, leaving, watch)
        end = float(times[-1]) if leaving.q is None else float(times[first + len(recorder)])
        recorder.goes_on = leaving.q is not None
        legs.append(Leg(inner, active, plant.integrator, recorder, ended, end))
        if leaving.q is None:
            return legs
        first, q = first + len(recorder), leaving.q


#: A task's rate has jumped that changes by so many times what it changes by before and after,
JUMP = 10.0
#: if by more than this share of its largest size.
SMALL = 1e-2


def rate_jumps(recorder: Recorder, *, follows: bool) -> Iterator[Finding]:
    """Where the rate that tasks ask for jumps, which inputs of second order follow with bounded
    accelerations; `follows`: other tasks were active before."""
    recorded, t, k = recorder.so_far, recorder.t, float(recorder.controller.given.servo)
    if not len(t):
        return
    short = np.linalg.norm(recorded.rate - np.einsum("kij,kj->ki", recorded.J, recorded.u), axis=1)
    least = SMALL * max(1.0, float(np.linalg.norm(recorded.rate, axis=1).max()))
    where = []
    if follows and short[0] > least:
        where.append(0)
    if len(t) > 3:
        size = np.linalg.norm(np.diff(recorded.rate, axis=0), axis=1)
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
    yield from (Finding("python_costs", {"text": cost}) for cost in solver.program.costs)
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
