"""The compiled control step: functions give J_bar u = rate and h, these give u and q_dot.

J_bar = (∂f/∂q - ∂g/∂q) S, h = Sᵀ ∂H/∂q, q_dot = S u (paper, eqs. 2, 6 and 13), S = blkdiag(G, C).
"""

from __future__ import annotations

import math
from typing import NamedTuple

from nmm.base.arrays import Array, Integers
from nmm.base.kernels.compiled import caller, compiled, kernel, scratch
from nmm.base.kernels.linear_algebra import dot, residual_norm
from nmm.base.kernels.record_layout import (
    Cell,
    IntegerVector,
    SampledIntegerVector,
    SampledVector,
    Vector,
    views,
)
from nmm.base.kernels.signatures import boolean, float64, int64, void
from nmm.base.kernels.velocity_map import to_coordinates, to_inputs
from nmm.control.functions.program import BESIDE, Buffers, LaidOut, run_program
from nmm.control.limits.bounds import SAMPLE, DistanceDamper, LimitNumbers, gathers_speed
from nmm.control.period_monitor import PeriodNumbers
from nmm.control.resolvers.answer import NOT_FINITE, RELAXED, SINGULAR_J, SOLVED, AnswerArrays
from nmm.control.resolvers.base import call_resolver
from nmm.control.resolvers.limit_check import keep_limits
from nmm.control.resolvers.problem_arrays import ProblemArrays
from nmm.control.resolvers.saturation import replace_by_nearest
from nmm.control.retreat import RetreatNumbers, stalls
from nmm.control.steering import SteeringNumbers, steer
from nmm.control.step.step_records import SecondOrder, TaskRows
from nmm.model.collisions.rows import DistanceRows


class Arm(NamedTuple):
    """C of S = blkdiag(G, C): the identity, with a further row for each mimic joint.

    moved (m - p,) : the coordinate that input p + j moves
    mimic_joints (4 k,) : see `nmm.base.kernels.velocity_map`
    """

    moved: IntegerVector
    mimic_joints: Vector


class ControlStep(NamedTuple):
    """What a step reads and writes besides its program's functions; its place in memory is `BESIDE`.

    near, clearance : distances that are kept, and how
    task, added : the task, and the added task of the extended Jacobian
    arm : what its inputs move
    terms, weights : rows of the objective's terms, and their weights
    H () : the objective
    problem, answer : the resolver's input and output
    limits : from which the problem's limits are computed
    steering : the law for steering inputs that do not affect the task
    resolver, numbers, options, state : its kernel, what that reads (α included), and what it remembers
    scale (levels,) : λ, the share of each level's rate that was given
    q_dot (n,) : S u
    retreat, period : the retreat from a stalled error, and the times of calls
    second : what a controller of second order computes with
    t () : the time of the sample, s
    own_limits : where each `LaidOutLimit` is; inputs_before (m,) : the inputs before the sample; without such
        limits, none
    step : address of `step`, or of `accelerate`, for compiled loops, which contain no copy of it
    limits_code, clearance_code : addresses of `write_limits` and `write_clearance`; 0 where not used
    """

    near: DistanceRows
    clearance: DistanceDamper
    task: TaskRows
    added: TaskRows
    arm: Arm
    terms: IntegerVector
    weights: Vector
    H: Cell
    problem: ProblemArrays
    limits: LimitNumbers
    steering: SteeringNumbers
    resolver: int
    numbers: SampledVector
    options: IntegerVector
    state: SampledIntegerVector
    answer: AnswerArrays
    scale: SampledVector
    q_dot: SampledVector
    retreat: RetreatNumbers
    period: PeriodNumbers
    second: SecondOrder
    t: Cell
    own_limits: IntegerVector
    inputs_before: SampledVector
    step: int
    limits_code: int
    clearance_code: int


#: The signature of `step`.
STEP = float64(float64, float64[::1], int64[::1], float64[::1])

call_step = caller(STEP)

#: The signature of kernels that write bounds for the resolver: q, and the blocks.
BOUNDS = void(float64[::1], int64[::1], float64[::1])

call_bounds = caller(BOUNDS)

#: The signatures of `resolve`, `watch_error` and `drive_inputs`; `replace_inputs` has BOUNDS.
ANSWER = float64(float64[::1], int64[::1], float64[::1])
WATCH = boolean(int64[::1], float64[::1])
DRIVE = void(int64[::1], float64[::1])

#: In place of the row of a computed error: the error is r_d - r; that of an angle is wrapped.
PLAIN, WRAPPED = -1, -2


@compiled
def times_S(rows: Array, row: int, G: Array, C: Arm, out: Array) -> None:
    """out = rows[row] S: a derivative by the coordinates becomes one by the inputs. Changes rows[row], as
    mimic joints' contributions are added to the joints that drive them."""
    to_inputs(rows, row, G, G.shape[1], C.moved, C.mimic_joints, out)


@compiled
def drive(u: Array, G: Array, C: Arm, q_dot: Array) -> None:
    """q_dot = S u."""
    to_coordinates(u, G, G.shape[1], C.moved, C.mimic_joints, q_dot)


@compiled
def write_equation(task: TaskRows, b: Buffers, C: Arm, J: Array, rate: Array) -> None:
    """rate = ∂g/∂t + K e, J_bar = (∂f/∂q - ∂g/∂q) S.

    For a computed error, rate = ∂e/∂t + K e and J_bar = -∂e/∂q S: the same equation for any e.
    """
    s = task.r.shape[0]
    n = b.value_q.shape[1]
    for i in range(s):
        f = task.rows[i, 0]
        g = task.rows[i, 1]
        compared = task.rows[i, 2]
        task.r[i] = b.value[f]
        task.r_d[i] = b.value[g]
        if compared >= 0:
            task.error[i] = b.value[compared]
            rate[i] = b.value_t[compared]
            for j in range(n):
                b.value_q[compared, j] = -b.value_q[compared, j]
            times_S(b.value_q, compared, b.G, C, J[i])
            continue
        error = b.value[g] - b.value[f]
        if compared == WRAPPED:  # to (-π, π]
            error = math.pi - (math.pi - error) % (2.0 * math.pi)
        task.error[i] = error
        rate[i] = b.value_t[g] - b.value_t[f]
        for j in range(n):  # in place, as f's derivative is not read again
            b.value_q[f, j] -= b.value_q[g, j]
        times_S(b.value_q, f, b.G, C, J[i])
    feedback = scratch(s)
    for i in range(s):
        feedback[i] = 0.0
        for j in range(s):
            feedback[i] += task.gain[i, j] * task.error[j]
        task.full[i] = rate[i] + feedback[i]
    for i in range(s):
        share = 1.0
        if not (math.isinf(task.speed[i]) and math.isinf(task.braking[i])):
            square = 0.0
            far = 0.0
            for j in range(s):
                if task.group[j] == task.group[i]:
                    square += feedback[j] * feedback[j]
                    far += task.error[j] * task.error[j]
            most = min(task.speed[i] * task.speed[i], 2.0 * task.braking[i] * math.sqrt(far))
            if square > most:
                share = math.sqrt(most / square)
        rate[i] = task.full[i] if share == 1.0 else rate[i] + share * feedback[i]


@compiled
def write_shares(task: TaskRows, problem: ProblemArrays, answer: AnswerArrays, scale: Array) -> None:
    """scale (levels,): λ, the share of each level's rate, 1 - ‖rate - J u‖ / ‖rate‖, rows in their scales.

    It equals the answer's ν where rest is within the limits; otherwise ν is relative to inputs that may
    already do most of the task. The rate includes all feedback, also where the task bounds it.
    """
    first = 0
    bounded = False
    for level in range(problem.ends.shape[0]):
        asked = 0.0
        missed = 0.0
        less = False
        for i in range(first, problem.ends[level]):
            weight = 1.0 / problem.row_scales[i]
            asked += (weight * task.full[i]) ** 2
            missed += (weight * (task.full[i] - dot(problem.J[i], answer.u))) ** 2
            less = less or task.full[i] != problem.rate[i]
        first = problem.ends[level]
        bounded = bounded or less
        scale[level] = 1.0
        if less or answer.nu[level] < 1.0:
            scale[level] = max(0.0, 1.0 - math.sqrt(missed / asked)) if asked > 0.0 else 0.0
    if bounded:
        answer.residual[()], _ = residual_norm(problem.J, answer.u, task.full)
        if answer.status[()] == SOLVED:
            answer.status[()] = RELAXED


@compiled
def finish(q: Array, integers: Integers, floats: Array) -> None:
    """Apply the limits and the steering law to the resolver's inputs, and write q_dot."""
    b = views(LaidOut, integers, floats, 0).buffers
    e = views(ControlStep, integers, floats, BESIDE)
    keep_limits(e.problem, e.answer)
    write_shares(e.task, e.problem, e.answer, e.scale)
    if e.steering.on[()] == 1:
        steer(e.steering, q, b.value, b.G, e.problem, e.answer.u)
    answered = e.answer.status[()] < SINGULAR_J  # else the robot still has those before
    if answered and e.limits.mode[()] == SAMPLE and e.second.u_dot.shape[0] == 0:
        for j in range(e.answer.u.shape[0]):
            e.problem.before[j] = e.answer.u[j]
    drive(e.answer.u, b.G, e.arm, e.q_dot)


@compiled
def resolve(q: Array, integers: Integers, floats: Array) -> float:
    """Compute the resolver's inputs, within limits, for the equations in memory; returns the status."""
    e = views(ControlStep, integers, floats, BESIDE)
    if e.clearance_code != 0:
        call_bounds(e.clearance_code, q, integers, floats)
    answer = e.answer
    for j in range(answer.u.shape[0]):
        answer.u[j] = math.nan  # stays where the resolver finds no solution
    answer.status[()] = NOT_FINITE
    for level in range(answer.nu.shape[0]):
        answer.nu[level] = 1.0
    answer.residual[()] = math.nan
    answer.measure[()] = math.nan
    answer.side[()] = 0.0
    answer.excess[()] = math.nan
    call_resolver(e.resolver, e.problem, e.numbers, e.options, e.state, answer)
    finish(q, integers, floats)
    return float(answer.status[()])


@compiled
def write_problem(t: float, q: Array, integers: Integers, floats: Array) -> None:
    """Evaluate the functions (except Pinocchio's), the equations and the gradient at (t, q)."""
    run_program(t, q, integers, floats)
    b = views(LaidOut, integers, floats, 0).buffers
    e = views(ControlStep, integers, floats, BESIDE)
    problem = e.problem
    e.t[()] = t
    write_equation(e.task, b, e.arm, problem.J, problem.rate)
    write_equation(e.added, b, e.arm, problem.added_J, problem.added_rate)
    n = q.shape[0]
    gradient = scratch((1, n))
    for j in range(n):
        gradient[0, j] = 0.0
    e.H[()] = 0.0
    for i in range(e.terms.shape[0]):
        term = e.terms[i]
        e.H[()] += e.weights[i] * b.value[term]
        for j in range(n):
            gradient[0, j] += e.weights[i] * b.value_q[term, j]
    if e.steering.on[()] == 1:
        spring = e.steering.row[()] + e.steering.inputs.shape[0]
        for j in range(n):
            gradient[0, j] += e.steering.spring[()] * b.value_q[spring, j]
    times_S(gradient, 0, b.G, e.arm, problem.h)


@kernel(STEP)
def step(t: float, q: Array, integers: Integers, floats: Array) -> float:
    """Compute one control step: functions, equations, gradient, inputs; returns the status."""
    write_problem(t, q, integers, floats)
    e = views(ControlStep, integers, floats, BESIDE)
    if e.limits_code != 0:
        call_bounds(e.limits_code, q, integers, floats)
    return resolve(q, integers, floats)


@compiled
def drive_inputs(integers: Integers, floats: Array) -> None:
    """Write the q_dot of the inputs in memory."""
    e = views(ControlStep, integers, floats, BESIDE)
    drive(e.answer.u, views(LaidOut, integers, floats, 0).buffers.G, e.arm, e.q_dot)


@compiled
def replace_inputs(wanted: Array, integers: Integers, floats: Array) -> None:
    """Answer with the inputs nearest to `wanted` (m,) within the limits, in place of the resolver's."""
    e = views(ControlStep, integers, floats, BESIDE)
    replace_by_nearest(e.problem, wanted, e.answer)
    write_shares(e.task, e.problem, e.answer, e.scale)
    drive_inputs(integers, floats)


@compiled
def watch_error(integers: Integers, floats: Array) -> bool:
    e = views(ControlStep, integers, floats, BESIDE)
    if e.retreat.durations.shape[0] == 0:
        return False
    platform = views(LaidOut, integers, floats, 0).buffers.G.shape[1]
    speeds_up = gathers_speed(e.limits, e.problem, e.answer.u, platform, e.second.share[()])
    return bool(stalls(e.retreat, e.task.error, e.problem.dt[()], speeds_up))
