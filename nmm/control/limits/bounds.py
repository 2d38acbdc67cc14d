"""Bounds of the inputs for one sample, from limits and distances, in discrete time.

Bounds of the inputs never contradict each other. With room the distance to a position limit, Δt the sample,
a = A Δt and D = room / Δt, the fastest sampled approach from which braking at A still stops in time is

    u <= D / N + a (N - 1) / 2,  N = max(1, ⌈(√(1 + 8 D / a) - 1) / 2⌉).

It is exact: if it holds at one sample, it can hold at the next with |Δu| <= a, whatever smaller u is chosen.
Beyond the limit (D < 0) the coordinate returns at a given speed. Bounds hold from one sample to the next, so
the average over an integrator's stages obeys them, too. Distances are kept by velocity dampers with room to
brake: n·J S u >= -speed - ∂d/∂t.
"""

import math
from typing import NamedTuple

from nmm.base.arrays import Array
from nmm.base.kernels.compiled import clear, compiled
from nmm.base.kernels.record_layout import (
    Cell,
    IntegerCell,
    IntegerVector,
    Matrix,
    SampledCell,
    SampledIntegerCell,
    SampledIntegerVector,
    SampledVector,
    Vector,
)
from nmm.control.resolvers.problem_arrays import LOWER, UPPER, ProblemArrays
from nmm.model.collisions.rows import DistanceRows
from nmm.model.robots.wheel_rates import rolling

#: `LimitNumbers.mode`: a step at a sample, at an integrator's stage after it, or without limits.
SAMPLE, STAGE, OFF = 0, 1, 2
#: The share of the inputs' acceleration that a row's braking relies on, as the row's direction turns.
COUNTED_ON = 0.25
#: Bounds, and inputs at them, are alike to this share of an input's largest change.
ROUNDING = 1e-6
#: The farthest that an input of unlimited velocity moves in a sample, m or rad.
FARTHEST = 0.1


class LimitNumbers(NamedTuple):
    """Limits of m inputs, w wheels and f functions; infinite for none.

    slowest, fastest (m,) : of the inputs; falling, rising (m,) : how fast they may fall and rise, per second
    coordinate (m,) : the coordinate whose rate an input is, -1 for none; low, high (m,) : its limits
    recovery () : speed of the return from beyond a limit, m/s or rad/s
    wheels (w, 9) : see `nmm.model.robots.wheel_rates`; spin (w,) : the wheels' largest rates, rad/s
    rows (f,) : of the program; row_low, row_high (f,) : limits of these values
    braking (f,) : deceleration of these values; NaN for a share of the inputs' accelerations
    elapsed () : time since the previous inputs, s; NaN for the problem's dt
    mode () : SAMPLE, STAGE or OFF
    """

    slowest: Vector
    fastest: Vector
    falling: Vector
    rising: Vector
    coordinate: IntegerVector
    low: Vector
    high: Vector
    recovery: Cell
    wheels: Matrix
    spin: Vector
    rows: IntegerVector
    row_low: Vector
    row_high: Vector
    braking: Vector
    elapsed: SampledCell
    mode: IntegerCell


@compiled
def approach(room: float, dt: float, acceleration: float, recovery: float, wanted: float = math.inf) -> float:
    """The largest speed towards a limit `room` ahead; negative beyond the limit. Infinite where it is above
    `wanted` for certain: it is at least √(2 A room) - A dt / 2, also for a limit that is far away."""
    if math.isinf(room):  # no limit; dt may be unknown
        return room
    if 2.0 * acceleration * room > (wanted + 0.5 * acceleration * dt) ** 2:
        return math.inf
    D = room / dt
    if D < 0.0:
        return max(D, -recovery)
    a = acceleration * dt
    if a <= 0.0:
        return 0.0
    if a >= D:
        return D
    N = math.ceil((math.sqrt(1.0 + 8.0 * D / a) - 1.0) / 2.0)
    return D / N + 0.5 * a * (N - 1.0)


@compiled
def bound_inputs(limits: LimitNumbers, q: Array, problem: ProblemArrays) -> None:
    """Bounds of the inputs at q: position takes precedence over velocity, and acceleration over both."""
    dt = problem.dt[()]
    elapsed = limits.elapsed[()]
    if math.isnan(elapsed):
        elapsed = dt
    for j in range(limits.slowest.shape[0]):
        lower, upper = limits.slowest[j], limits.fastest[j]
        i = limits.coordinate[j]
        low, high = -math.inf, math.inf
        if i >= 0:
            recovery = limits.recovery[()]
            high = approach(limits.high[j] - q[i], dt, limits.falling[j], recovery, max(upper, 0.0))
            low = -approach(q[i] - limits.low[j], dt, limits.rising[j], recovery, max(-lower, 0.0))
            # The return obeys the velocity limits, and is slow enough to brake at the opposite limit.
            if high < 0.0:
                high = max(high, min(lower, 0.0), low)
            if low > 0.0:
                low = min(low, max(upper, 0.0), high)
            lower, upper = min(max(lower, low), high), max(min(upper, high), low)
        if not (math.isinf(limits.falling[j]) and math.isinf(limits.rising[j])):
            least = problem.before[j] - limits.falling[j] * elapsed
            most = problem.before[j] + limits.rising[j] * elapsed
            if least > upper:
                lower, upper = least, least
            elif most < lower:
                lower, upper = most, most
            else:
                lower, upper = max(lower, least), min(upper, most)
        problem.u_lower[j] = lower
        problem.u_upper[j] = upper
        problem.stops[j] = (UPPER if upper == high else 0) + (LOWER if lower == low else 0)


@compiled
def gathers_speed(limits: LimitNumbers, problem: ProblemArrays, u: Array, count: int, share: float) -> bool:
    """Whether one of the first `count` inputs speeds up, held back by its limit of acceleration alone: then
    its bounds are the largest fall and rise apart, over the share of u that is followed in a sample."""
    for j in range(count):
        change = (limits.falling[j] + limits.rising[j]) * problem.dt[()] / share
        lower, upper = problem.u_lower[j], problem.u_upper[j]
        alone = not math.isinf(change) and upper - lower >= change * (1.0 - ROUNDING)
        fastest = upper if u[j] > 0.0 else -lower
        if alone and abs(u[j]) >= fastest - 0.5 * ROUNDING * change:
            return True
    return False


@compiled
def wheel_rows(limits: LimitNumbers, q: Array, G: Array, problem: ProblemArrays) -> None:
    """The rows that give the wheels' rolling rates, rad/s; their bounds are constant."""
    for i in range(limits.spin.shape[0]):
        steer = int(limits.wheels[i, 4])
        along, across, turn, steered = rolling(limits.wheels[i], q[2], q[steer] if steer >= 0 else 0.0)
        clear(problem.limit_rows[i])
        for j in range(G.shape[1]):
            rate = along * G[0, j] + across * G[1, j] + turn * G[2, j]
            if steer >= 0:
                rate += steered * G[steer, j]
            problem.limit_rows[i, j] = rate
        problem.lower[i] = -limits.spin[i]
        problem.upper[i] = limits.spin[i]


@compiled
def counted_on(braking: float, row: Array, side: int, falling: Array, rising: Array) -> float:
    """The deceleration of a row's value towards its limit at a side, to rely on: as given, or a share of what
    the inputs' give along the row (m,)."""
    if not math.isnan(braking):
        return braking
    total = 0.0
    for j in range(row.shape[0]):
        if row[j] != 0.0:
            falls = (row[j] > 0.0) == (side == UPPER)
            total += COUNTED_ON * abs(row[j]) * (falling[j] if falls else rising[j])
    return total


@compiled
def brakings(limits: LimitNumbers, i: int, row: Array) -> tuple[float, float]:
    """`counted_on` of function i at its upper and its lower limit."""
    above = counted_on(limits.braking[i], row, UPPER, limits.falling, limits.rising)
    return above, counted_on(limits.braking[i], row, LOWER, limits.falling, limits.rising)


@compiled
def function_bounds(limits: LimitNumbers, value: Array, value_t: Array, problem: ProblemArrays) -> None:
    """Bounds of the functions' rates: dampers with room to brake."""
    dt = problem.dt[()]
    w = limits.spin.shape[0]
    for i in range(limits.rows.shape[0]):
        row = limits.rows[i]
        recovery = limits.recovery[()]
        above, below = brakings(limits, i, problem.limit_rows[w + i])
        problem.upper[w + i] = approach(limits.row_high[i] - value[row], dt, above, recovery) - value_t[row]
        problem.lower[w + i] = -approach(value[row] - limits.row_low[i], dt, below, recovery) - value_t[row]


class DistanceDamper(NamedTuple):
    """How distances are kept.

    first () : the first of their rows among those of the limits
    distance (P,) : the distance that each pair keeps, m; margin () : what rows keep beyond it, m
    gain () : 1/s, d falls at most at this times the room left; recovery () : speed of the return, m/s
    braking () : deceleration, m/s²; NaN for a share of the inputs' accelerations
    least (K,) : a rate that a row has to keep instead, m/s; -inf for none
    held (), counts (4,) : `held` and `counts` of `nmm.control.step.safety_filter`
    """

    first: IntegerCell
    distance: Vector
    margin: Cell
    gain: Cell
    recovery: Cell
    braking: Cell
    least: SampledVector
    held: SampledIntegerCell
    counts: SampledIntegerVector


@compiled
def bound_unlimited(limits: LimitNumbers, problem: ProblemArrays) -> None:
    """Bound inputs of unlimited velocity: rows that leave hardly a direction would make them arbitrarily
    large, and so the motion to be checked for collisions."""
    most = FARTHEST / problem.dt[()]
    for j in range(limits.slowest.shape[0]):
        if math.isinf(limits.fastest[j]):
            problem.u_upper[j] = max(min(problem.u_upper[j], most), problem.u_lower[j])
        if math.isinf(limits.slowest[j]):
            problem.u_lower[j] = min(max(problem.u_lower[j], -most), problem.u_upper[j])


@compiled
def clearance_bounds(
    keep: DistanceDamper, near: DistanceRows, limits: LimitNumbers, problem: ProblemArrays
) -> None:
    dt = problem.dt[()]
    for k in range(near.d.shape[0]):
        row = keep.first[()] + k
        problem.lower[row], problem.upper[row] = -math.inf, math.inf
        if k >= near.used[()]:
            continue
        if keep.least[k] > -math.inf:
            problem.lower[row] = keep.least[k] - near.d_t[k]
            continue
        braking = counted_on(keep.braking[()], problem.limit_rows[row], LOWER, limits.falling, limits.rising)
        room = near.d[k] - keep.distance[near.pair[k]]
        speed = keep.gain[()] * (room - keep.margin[()])  # within the margin the return may be slow
        if room < 0.0:
            speed = approach(room, dt, braking, float(keep.recovery[()]))
        elif speed > 0.0:
            speed = min(speed, approach(room, dt, braking, float(keep.recovery[()])))
        problem.lower[row] = -speed - near.d_t[k]
