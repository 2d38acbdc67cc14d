"""What limits leave the inputs for one sample: bounds in discrete time, which never contradict each other.

With room = distance to a limit of position, Δt the sample, a = A Δt, D = room / Δt, the fastest approach from
which braking at A still stops in time, sampled, is

    u <= D / N + a (N - 1) / 2,  N = max(1, ⌈(√(1 + 8 D / a) - 1) / 2⌉),

which is exact: obeyed at one sample, it can be obeyed at the next with |Δu| <= a, whatever is chosen below
it. Beyond the limit (D < 0) the way back is at a stated speed. These bounds are taken at a sample and hold
until the next: what an integrator averages over its stages is within them, too.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from nmm.arrays import Array
from nmm.kernels.compiled import compiled
from nmm.kernels.memory import Cell, IntegerCell, IntegerVector, Matrix, Vector
from nmm.resolvers.problem_arrays import LOWER, UPPER, ProblemArrays
from nmm.robots.wheel_rates import rolling

#: What `LimitNumbers.mode` says of a step: a sample's, an integrator's stage after it, one without limits.
SAMPLE, STAGE, OFF = 0, 1, 2
#: As its direction turns, a row's braking is counted on with this share of what the accelerations give.
COUNTED_ON = 0.25


class LimitNumbers(NamedTuple):
    """Limits of m inputs, w wheels and f functions; infinite where there is none.

    slowest, fastest, acceleration (m,) : of the inputs
    coordinate (m,) : the coordinate whose rate an input is, -1 where none; low, high (m,) : its limits
    recovery () : speed of the way back from beyond a limit, m/s or rad/s
    wheels (w, 9) : how they turn (`nmm.robots.wheel_rates`); spin (w,) : their largest rates, rad/s
    rows (f,) : of the program; row_low, row_high (f,) : limits of these values; braking (f,) : counted on for
        them, not a number where it is a share of what the inputs' accelerations give
    elapsed () : time since the inputs before, s
    mode () : SAMPLE, STAGE or OFF
    """

    slowest: Vector
    fastest: Vector
    acceleration: Vector
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
    elapsed: Cell
    mode: IntegerCell


@compiled
def approach(room: float, dt: float, acceleration: float, recovery: float) -> float:
    """The largest speed towards a limit that is `room` ahead; negative where it is behind."""
    if math.isinf(room):  # no limit, and perhaps no dt either
        return room
    D = room / dt
    if D < 0.0:
        return max(D, -recovery)
    if math.isinf(acceleration):
        return D
    a = acceleration * dt
    if a <= 0.0:
        return 0.0
    N = max(1.0, math.ceil((math.sqrt(1.0 + 8.0 * D / a) - 1.0) / 2.0))
    return D / N + 0.5 * a * (N - 1.0)


@compiled
def bound_inputs(limits: LimitNumbers, q: Array, problem: ProblemArrays) -> None:
    """Bounds of the inputs at q: position wins over velocity, and acceleration over both."""
    dt = problem.dt[()]
    for j in range(limits.slowest.shape[0]):
        lower, upper = limits.slowest[j], limits.fastest[j]
        A = limits.acceleration[j]
        i = limits.coordinate[j]
        low, high = -math.inf, math.inf
        if i >= 0:
            high = approach(limits.high[j] - q[i], dt, A, limits.recovery[()])
            low = -approach(q[i] - limits.low[j], dt, A, limits.recovery[()])
            # The way back is no faster than the velocities allow, nor than can be braked at the other end.
            if high < 0.0:
                high = max(high, min(lower, 0.0), low)
            if low > 0.0:
                low = min(low, max(upper, 0.0), high)
            lower, upper = min(max(lower, low), high), max(min(upper, high), low)
        if not math.isinf(A):
            change = A * limits.elapsed[()]
            least, most = problem.before[j] - change, problem.before[j] + change
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
def wheel_rows(limits: LimitNumbers, q: Array, G: Array, problem: ProblemArrays) -> None:
    """The wheels' rolling rates, rad/s, as rows on the inputs; their bounds stay."""
    for i in range(limits.spin.shape[0]):
        steer = int(limits.wheels[i, 4])
        along, across, turn, steered = rolling(limits.wheels[i], q[2], q[steer] if steer >= 0 else 0.0)
        for j in range(problem.u_lower.shape[0]):
            problem.limit_rows[i, j] = 0.0
        for j in range(G.shape[1]):
            rate = along * G[0, j] + across * G[1, j] + turn * G[2, j]
            if steer >= 0:
                rate += steered * G[steer, j]
            problem.limit_rows[i, j] = rate
        problem.lower[i] = -limits.spin[i]
        problem.upper[i] = limits.spin[i]


@compiled
def function_bounds(limits: LimitNumbers, value: Array, value_t: Array, problem: ProblemArrays) -> None:
    """Bounds of the functions' rates, whose rows on the inputs are there: dampers with room to brake."""
    dt = problem.dt[()]
    w = limits.spin.shape[0]
    for i in range(limits.rows.shape[0]):
        row = limits.rows[i]
        braking = limits.braking[i]
        if math.isnan(braking):
            braking = 0.0
            for j in range(limits.slowest.shape[0]):
                if problem.limit_rows[w + i, j] != 0.0:
                    braking += COUNTED_ON * abs(problem.limit_rows[w + i, j]) * limits.acceleration[j]
        recovery = limits.recovery[()]
        problem.upper[w + i] = approach(limits.row_high[i] - value[row], dt, braking, recovery) - value_t[row]
        problem.lower[w + i] = -approach(value[row] - limits.row_low[i], dt, braking, recovery) - value_t[row]
