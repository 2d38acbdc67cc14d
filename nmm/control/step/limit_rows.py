"""The rows of limits, each by its own kernel, which a step calls by its address."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from nmm.base.arrays import Array, Integers
from nmm.base.kernels.compiled import call_platform, clear, compiled, scratch, view
from nmm.base.kernels.kinematics import Kinematics, place_frames
from nmm.base.kernels.linear_algebra import dot
from nmm.base.kernels.record_layout import IntegerVector, Vector, header_length, views
from nmm.base.kernels.records import Frames
from nmm.control.functions.program import BESIDE, Buffers, LaidOut
from nmm.control.limits.limit import (
    LimitRows,
    LimitSample,
    call_limit_rows,
    call_limit_values,
)
from nmm.control.step.equations import ControlStep, drive

KINEMATICS = header_length(Kinematics)


class LaidOutLimit(NamedTuple):
    """A limit in memory: its kernels, its rows among those of limits, [first, end), its quantities among
    those recorded, its frames' slots, its numbers; rates : 1 where its rows are rates."""

    kernel: int
    values: int
    first: int
    end: int
    quantity: int
    last_quantity: int
    rates: int
    slots: IntegerVector
    numbers: Vector


@compiled
def sample_of(t: float, elapsed: float, q: Array, u: Array, q_dot: Array, e: ControlStep, b: Buffers) -> Any:
    """The sample that a limit's kernels see, with the inputs u (m,) and q_dot = S u (n,)."""
    n = q.shape[0]
    arm = e.arm
    return LimitSample(
        *(t, float(e.problem.dt[()]), elapsed, view(q, 0, (n,)), b.G, b.G_q),
        *(view(u, 0, u.shape), view(q_dot, 0, (n,)), arm.moved, arm.mimic_joints),
    )


@compiled
def elapsed_of(e: ControlStep) -> float:
    """The time since the previous inputs, s."""
    elapsed = float(e.limits.elapsed[()])
    return float(e.problem.dt[()]) if math.isnan(elapsed) else elapsed


@compiled
def write_limit(
    limit: LaidOutLimit, t: float, q: Array, q_dot: Array, e: ControlStep, b: Buffers, rows: LimitRows
) -> None:
    """Write the rows of one limit at (t, q), with the kinematics in b."""
    clear(rows.A)
    for i in range(rows.lower.shape[0]):
        rows.lower[i], rows.upper[i] = -math.inf, math.inf
    sample = sample_of(t, elapsed_of(e), q, e.problem.before, q_dot, e, b)
    frames = Frames(limit.slots, b.placements, b.jacobians, b.hessians)
    call_limit_rows(limit.kernel, sample, frames, limit.numbers, rows)


@compiled
def write_rows(q: Array, stage: bool, integers: Integers, floats: Array) -> None:
    """The rows and bounds of all limits at q; at an integrator's stages only the rows of rates are anew."""
    b = views(LaidOut, integers, floats, 0).buffers
    e = views(ControlStep, integers, floats, BESIDE)
    problem, m = e.problem, e.answer.u.shape[0]
    q_dot = scratch(q.shape[0])
    clear(q_dot)
    drive(problem.before, b.G, e.arm, q_dot)
    for j in range(0 if stage else m):
        e.inputs_before[j] = problem.before[j]
    for k in range(e.own_limits.shape[0]):
        limit = views(LaidOutLimit, integers, floats, e.own_limits[k])
        count = limit.end - limit.first
        A = view(problem.limit_rows, limit.first * m, (count, m))
        if not stage:
            lower, upper = (
                view(problem.lower, limit.first, (count,)),
                view(problem.upper, limit.first, (count,)),
            )
            write_limit(limit, float(e.t[()]), q, q_dot, e, b, LimitRows(A, lower, upper))
        elif limit.rates == 1:
            write_limit(limit, float(e.t[()]), q, q_dot, e, b, LimitRows(A, scratch(count), scratch(count)))


@compiled
def write_rates_beside(t: float, side: int, drift: int, integers: Integers, floats: Array) -> None:
    """Of second order: A u of the limits of rates, at t and `beside`, as rows of y from `drift` on."""
    e = views(ControlStep, integers, floats, BESIDE)
    own, u, n, m = e.second, e.problem.before, e.q_dot.shape[0], e.answer.u.shape[0]
    q_dot = scratch(n)
    clear(q_dot)
    drive(u, own.buffers.G, e.arm, q_dot)
    for k in range(e.own_limits.shape[0]):
        limit = views(LaidOutLimit, integers, floats, e.own_limits[k])
        if limit.rates == 0:
            continue
        count = limit.end - limit.first
        rows = LimitRows(scratch((count, m)), scratch(count), scratch(count))
        write_limit(limit, t, own.beside, q_dot, e, own.buffers, rows)
        for i in range(count):
            own.y[side, drift + limit.first + i] = dot(rows.A[i], u)


@compiled
def note_values(q: Array, u: Array, u_dot: Array, integers: Integers, floats: Array, out: Array) -> None:
    """The limited quantities at a sample with inputs u (m,), in its record (w,); u_dot (m,) : not a number
    for the change from the inputs before, over the time since then."""
    b = views(LaidOut, integers, floats, 0).buffers
    e = views(ControlStep, integers, floats, BESIDE)
    m = u.shape[0]
    q_dot, change, elapsed = scratch(q.shape[0]), scratch(m), elapsed_of(e)
    clear(q_dot)
    drive(u, b.G, e.arm, q_dot)
    for j in range(m):
        change[j] = (u[j] - e.inputs_before[j]) / elapsed if math.isnan(u_dot[j]) else u_dot[j]
    sample = sample_of(float(e.t[()]), elapsed, q, u, q_dot, e, b)
    for k in range(e.own_limits.shape[0]):
        limit = views(LaidOutLimit, integers, floats, e.own_limits[k])
        frames = Frames(limit.slots, b.placements, b.jacobians, b.hessians)
        values = view(out, limit.quantity, (limit.last_quantity - limit.quantity,))
        call_limit_values(limit.values, sample, frames, limit.numbers, change, values)


@compiled
def note_held_values(q: Array, u: Array, integers: Integers, floats: Array, out: Array) -> None:
    """As `note_values`, of inputs that are held from q on, after stages elsewhere: with G and frames anew."""
    program = views(LaidOut, integers, floats, 0)
    e = views(ControlStep, integers, floats, BESIDE)
    b, unknown = program.buffers, scratch(u.shape[0])
    for j in range(u.shape[0]):
        unknown[j] = math.nan
    clear(b.G)
    clear(b.G_q)
    call_platform(program.platform_kernel, view(q, 0, (b.G.shape[0],)), program.platform_numbers, b.G, b.G_q)
    # The kinematics' record is the one before the first limit's.
    kinematics = views(Kinematics, integers, floats, int(e.own_limits[0]) - KINEMATICS)
    place_frames(kinematics.joints, kinematics.frames, q, b.placements, b.jacobians, b.hessians)
    note_values(q, u, unknown, integers, floats, out)
