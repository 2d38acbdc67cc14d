"""The compiled control step: from functions to J_bar u = rate and h, from these to u and q_dot.

This is where the multiplication by S happens, once for all: J_bar = (∂f/∂q - ∂g/∂q) S,
h = Sᵀ ∂H/∂q, q_dot = S u (paper, eqs. 2, 6 and 13), S = blkdiag(G, C).
"""

from __future__ import annotations

import math
from typing import NamedTuple

from numba import types

from nmm.arrays import Array, Integers
from nmm.collisions.rows import Rows
from nmm.control.bounds import SAMPLE, LimitNumbers
from nmm.control.clearance_rows import Clearance
from nmm.control.steering import SteeringNumbers, steer
from nmm.functions.program import BESIDE, Buffers, LaidOut, run
from nmm.kernels.compiled import caller, compiled, kernel, scratch
from nmm.kernels.followers import add_to_leaders, move_followers
from nmm.kernels.linear_algebra import residual_norm
from nmm.kernels.memory import Cell, IntegerMatrix, IntegerVector, Matrix, Vector, views
from nmm.resolvers.answer import NOT_FINITE, RELAXED, SOLVED, AnswerArrays
from nmm.resolvers.base import call_resolver
from nmm.resolvers.problem_arrays import ProblemArrays
from nmm.resolvers.within import keep_limits, times


class TaskRows(NamedTuple):
    """The rows of a stack of tasks, s of them.

    rows (s, 3) : [row of f, row of g, row of e] among the program's; the row of e is PLAIN or WRAPPED where
        e = g - f, which then is not computed elsewhere
    gain (s, s) : K
    speed (s,), braking (s,) : ‖K e‖ <= speed, ‖K e‖² <= 2 braking ‖e‖ over the rows of a group
    group (s,) : which group each row is in
    full (s,) : ∂g/∂t + K e without that bound
    r, r_d, error (s,) : value, desired value and error, which a step writes
    """

    rows: IntegerMatrix
    gain: Matrix
    speed: Vector
    braking: Vector
    group: IntegerVector
    full: Vector
    r: Vector
    r_d: Vector
    error: Vector


class Arm(NamedTuple):
    """C of S = blkdiag(G, C): the identity, with a row of its own for every coordinate that follows another.

    moved (m - p,) : the coordinate that input p + j moves
    followers (4 k,) : see `nmm.kernels.followers`
    """

    moved: IntegerVector
    followers: Vector


class ControlStep(NamedTuple):
    """What a step reads and writes beside its program's functions; its place in memory is `BESIDE`.

    near, clearance : distances that are kept, and how
    task, added : the task, and the added task of the extended Jacobian
    arm : what its inputs move
    terms, weights : rows of the objective's terms, and what they count
    H () : the objective
    problem, answer : what the resolver gets and gives
    limits : from which the problem's come
    steering : what sets the steering inputs that the task does not feel
    resolver, numbers, options, state : its kernel, what that reads, and what it remembers
    q_dot (n,) : S u
    step : where the code of `step` begins, for loops, which hold no copy of it
    limits_code, clearance_code : where that of `write_limits` and `write_clearance` begins; 0 where there
        are none
    """

    near: Rows
    clearance: Clearance
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
    numbers: Vector
    options: IntegerVector
    state: IntegerVector
    answer: AnswerArrays
    q_dot: Vector
    step: int
    limits_code: int
    clearance_code: int


#: A step's arguments and what it returns.
STEP = types.float64(types.float64, types.float64[::1], types.int64[::1], types.float64[::1])

call_step = caller(STEP)

#: What writes bounds for the resolver: q, and the blocks.
BOUNDS = types.void(types.float64[::1], types.int64[::1], types.float64[::1])

call_bounds = caller(BOUNDS)

#: `resolve`'s.
ANSWER = types.float64(types.float64[::1], types.int64[::1], types.float64[::1])

#: Instead of the row of an error that is computed: the error is r_d - r; an angle's, wrapped.
PLAIN, WRAPPED = -1, -2


@compiled
def times_S(rows: Array, row: int, G: Array, C: Arm, out: Array) -> None:
    """out = rows[row] S: a derivative in the coordinates, seen by the inputs.

    In place: what followers add to their leaders stays in rows[row].
    """
    n_p, p = G.shape
    add_to_leaders(rows, row, C.followers)
    for j in range(p):
        out[j] = 0.0
        for i in range(n_p):
            out[j] += rows[row, i] * G[i, j]
    for j in range(C.moved.shape[0]):
        out[p + j] = rows[row, C.moved[j]]


@compiled
def drive(u: Array, G: Array, C: Arm, q_dot: Array) -> None:
    """q_dot = S u."""
    n_p, p = G.shape
    for i in range(n_p):
        q_dot[i] = 0.0
        for j in range(p):
            q_dot[i] += G[i, j] * u[j]
    for j in range(C.moved.shape[0]):
        q_dot[C.moved[j]] = u[p + j]
    move_followers(q_dot, C.followers)


@compiled
def write_equation(task: TaskRows, b: Buffers, C: Arm, J: Array, rate: Array) -> None:
    """rate = ∂g/∂t + K e, J_bar = (∂f/∂q - ∂g/∂q) S.

    Where an error is computed, rate = ∂e/∂t + K e and J_bar = -∂e/∂q S: the same equation for any e.
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
        for j in range(n):  # in place: f's derivative is not read again
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
def told(task: TaskRows, problem: ProblemArrays, answer: AnswerArrays) -> None:
    """The scale of each level as its share of the rate: 1 - ‖rate - J u‖ / ‖rate‖, rows in their scales.

    That is λ where rest is allowed. Where it is not, λ counts from inputs that may do most of the task. The
    rate is all of it: where feedback was bounded, that was on purpose.
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
            missed += (weight * (task.full[i] - times(problem.J, i, answer.u))) ** 2
            less = less or task.full[i] != problem.rate[i]
        first = problem.ends[level]
        bounded = bounded or less
        if less or answer.scale[level] < 1.0:
            answer.scale[level] = max(0.0, 1.0 - math.sqrt(missed / asked)) if asked > 0.0 else 0.0
    if bounded:
        answer.residual[()], _ = residual_norm(problem.J, answer.u, task.full)
        if answer.status[()] == SOLVED:
            answer.status[()] = RELAXED


@compiled
def finish(q: Array, integers: Integers, floats: Array) -> None:
    """From the resolver's inputs to the robot's: limits, the steering that the task does not feel, q_dot."""
    b = views(LaidOut, integers, floats, 0).buffers
    e = views(ControlStep, integers, floats, BESIDE)
    keep_limits(e.problem, e.answer)
    told(e.task, e.problem, e.answer)
    if e.steering.on[()] == 1:
        steer(e.steering, q, b.value, b.G, e.problem, e.answer.u)
    if e.limits.mode[()] == SAMPLE:
        for j in range(e.answer.u.shape[0]):
            e.problem.before[j] = e.answer.u[j]
    drive(e.answer.u, b.G, e.arm, e.q_dot)


@compiled
def resolve(q: Array, integers: Integers, floats: Array) -> float:
    """The resolver's inputs for the equations that are there, within limits. Returns its status."""
    e = views(ControlStep, integers, floats, BESIDE)
    if e.clearance_code != 0:
        call_bounds(e.clearance_code, q, integers, floats)
    answer = e.answer
    for j in range(answer.u.shape[0]):
        answer.u[j] = math.nan  # what a resolver that finds no solution leaves behind
    answer.status[()] = NOT_FINITE
    for level in range(answer.scale.shape[0]):
        answer.scale[level] = 1.0
    answer.residual[()] = math.nan
    answer.measure[()] = math.nan
    answer.side[()] = 0.0
    answer.excess[()] = math.nan
    call_resolver(e.resolver, e.problem, e.numbers, e.options, e.state, answer)
    finish(q, integers, floats)
    return float(answer.status[()])


@kernel(STEP)
def step(t: float, q: Array, integers: Integers, floats: Array) -> float:
    """One control step: functions, equations, gradient, inputs. Returns the resolver's status.

    Pinocchio's part is in memory already.
    """
    run(t, q, integers, floats)
    b = views(LaidOut, integers, floats, 0).buffers
    e = views(ControlStep, integers, floats, BESIDE)
    problem = e.problem
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
    if e.limits_code != 0:
        call_bounds(e.limits_code, q, integers, floats)
    return resolve(q, integers, floats)
