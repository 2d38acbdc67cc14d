"""A sampled controller that sees a robot with noise, acts on it late, and whose wheels slip."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import types

from nmm.arrays import Array, Integers
from nmm.control.controller import Controller
from nmm.control.equations import ControlStep, write_equation
from nmm.control.stepping import hold_inputs
from nmm.functions.program import BESIDE, LaidOut, run
from nmm.kernels.compiled import checked_by_caller, compiled_without_gil, scratch
from nmm.kernels.memory import Matrix, Vector, record_type, views
from nmm.resolvers.answer import SINGULAR_J
from nmm.resolvers.partitions import PartitionState
from nmm.runs.compiled_loop import BOUND, sample, small
from nmm.runs.recorded import Recorded, note
from nmm.runs.recording import Recorder
from nmm.runs.trajectory import Outcome


class Disturbed(NamedTuple):
    """What becomes of a robot's inputs, and of what is measured of it.

    noise (N or 0, n) : what is added to q at each sample before the controller sees it, m and rad
    delay : after how many samples inputs act; before, the robot stands
    slip (m,) : the share of each input that acts
    """

    noise: Matrix
    delay: int
    slip: Vector


_DRIFT = types.int64(
    *(types.int64[::1], types.float64[::1], types.float64[::1], types.float64[::1]),
    *(record_type(Disturbed), types.int64, record_type(Recorded)),
)


@compiled_without_gil
def drift(
    integers: Integers,
    floats: Array,
    times: Array,
    start: Array,
    disturbed: Disturbed,
    partitioned: int,
    found: Recorded,
) -> int:
    """The samples at all times, inputs held between them, from q = start. Returns how many were recorded.

    q, r and errors are the robot's, not those that the controller sees; u is what the controller asks for.
    """
    e = views(ControlStep, integers, floats, BESIDE)
    b = views(LaidOut, integers, floats, 0).buffers
    n, m = start.shape[0], disturbed.slip.shape[0]
    q, seen, ahead, acting = scratch(n), scratch(n), scratch(n), scratch(m)
    for i in range(n):
        q[i] = start[i]
    for k in range(times.shape[0]):
        noisy = disturbed.noise.shape[0] > 0
        for i in range(n):
            seen[i] = q[i] + (disturbed.noise[k, i] if noisy else 0.0)
        status = sample(times[k], times[k - 1] if k > 0 else -math.inf, seen, integers, floats)
        for i in range(n):
            found.q[k, i] = q[i]
        if status >= SINGULAR_J or not small(e.answer.u) or not small(q):
            return k
        if noisy:  # the task as it is
            run(times[k], q, integers, floats)
            write_equation(e.task, b, e.arm, e.problem.J, e.problem.rate)
        note(e, b, q, partitioned, k, found)
        if k + 1 < times.shape[0]:
            for j in range(m):
                acting[j] = (
                    disturbed.slip[j] * found.u[k - disturbed.delay, j] if k >= disturbed.delay else 0.0
                )
            hold_inputs(q, acting, times[k + 1] - times[k], integers, floats, ahead)
            for i in range(n):
                q[i] = ahead[i]
    return times.shape[0]


def driven_disturbed(
    controller: Controller, recorder: Recorder, times: Array, q: Array, disturbed: Disturbed
) -> tuple[Outcome, str]:
    """Run and record; how that ended, and why."""
    controller.reset()
    partitioned, found = int(isinstance(controller.state, PartitionState)), recorder.found
    with controller.compiled() as blocks:
        count = checked_by_caller(drift, _DRIFT)(*blocks, times, q, disturbed, partitioned, found)
    recorder.flown(count - 1)
    if count == len(times):
        return Outcome.COMPLETED, ""
    seen = found.q[count] + (disturbed.noise[count] if len(disturbed.noise) else 0.0)
    if controller.failed and np.linalg.norm(seen) < BOUND:
        return Outcome.SINGULAR, str(controller.failure(times[count], seen))
    return Outcome.DIVERGED, f"at t = {times[count]:g} s the motion has diverged: beyond {BOUND:g}"
