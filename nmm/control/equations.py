"""The compiled control step: from functions to J_bar u = rate and h, from these to u and q_dot.

This is where the multiplication by S happens, once for all: J_bar = (∂f/∂q - ∂g/∂q) S,
h = Sᵀ ∂H/∂q, q_dot = S u (paper, eqs. 2, 6 and 13).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from nmm.arrays import Array
from nmm.functions.program import MEMORY, NUMBERS, SIZES, TABLES, Buffers, run
from nmm.kernels.compiled import compiled, inlined, view
from nmm.kernels.packing import section
from nmm.resolvers.answer import NOT_FINITE, AnswerArrays
from nmm.resolvers.base import call_resolver
from nmm.resolvers.problem import ProblemArrays


class Equation(NamedTuple):
    """J u = rate for a stack of tasks: r (s,), desired r_d (s,), error (s,), rate (s,), J (s, m)."""

    r: Array
    r_d: Array
    error: Array
    rate: Array
    J: Array


class Results(NamedTuple):
    """What one step leaves behind, as views of one block of memory.

    task, added : the equations of the task and of the extended Jacobian's added task
    H (1,), h (m,) : the objective and its gradient seen by the inputs
    before (m,), dt (1,) : the inputs of the step before, and for how long those of this one will stand, s
    answer : the resolver's
    q_dot (n,) : S u
    """

    task: Equation
    added: Equation
    H: Array
    h: Array
    before: Array
    dt: Array
    answer: AnswerArrays
    q_dot: Array


# Sections of the packed vectors, after the program's own.
SHAPE, ROWS, TERMS, OPTIONS, ENDS = TABLES, TABLES + 1, TABLES + 2, TABLES + 3, TABLES + 4
GAINS, ADDED_GAINS, WEIGHTS, RESOLVER = NUMBERS, NUMBERS + 1, NUMBERS + 2, NUMBERS + 3
SCALES, ADDED_SCALES = NUMBERS + 4, NUMBERS + 5
BLOCK = MEMORY

#: Instead of the row of an error that is computed: the error is target - value; an angle's, wrapped.
PLAIN, WRAPPED = -1, -2


@inlined
def equation_views(s: int, m: int, memory: Array, first: int) -> Equation:
    """The views of s (4 + m) numbers."""
    return Equation(
        view(memory, first, (s,)),
        view(memory, first + s, (s,)),
        view(memory, first + 2 * s, (s,)),
        view(memory, first + 3 * s, (s,)),
        view(memory, first + 4 * s, (s, m)),
    )


@inlined
def results(tables: Array, memory: Array) -> Results:
    """The views; shape = [s, k, m, ...]."""
    shape = section(tables, SHAPE)
    s, k, m = shape[0], shape[1], shape[2]
    a = int(memory[BLOCK])
    b = a + s * (4 + m)
    c = b + k * (4 + m)
    d = c + 2 + 2 * m
    levels = section(tables, ENDS).shape[0]
    return Results(
        equation_views(s, m, memory, a),
        equation_views(k, m, memory, b),
        view(memory, c, (1,)),
        view(memory, c + 1, (m,)),
        view(memory, c + 1 + m, (m,)),
        view(memory, c + 1 + 2 * m, (1,)),
        AnswerArrays(
            view(memory, d, (m,)),
            view(memory, d + m, (1,)),
            view(memory, d + m + 1, (levels,)),
            view(memory, d + m + 1 + levels, (1,)),
            view(memory, d + m + 2 + levels, (1,)),
        ),
        view(memory, d + m + 3 + levels, (section(tables, SIZES)[0],)),
    )


@compiled
def times_S(rows: Array, row: int, G: Array, out: Array) -> None:
    """out = rows[row] S, S = blkdiag(G, I): a derivative in the coordinates, seen by the inputs."""
    n_p, p = G.shape
    for j in range(p):
        out[j] = 0.0
        for i in range(n_p):
            out[j] += rows[row, i] * G[i, j]
    for j in range(rows.shape[1] - n_p):
        out[p + j] = rows[row, n_p + j]


@compiled
def drive(u: Array, G: Array, q_dot: Array) -> None:
    """q_dot = S u."""
    n_p, p = G.shape
    for i in range(n_p):
        q_dot[i] = 0.0
        for j in range(p):
            q_dot[i] += G[i, j] * u[j]
    for j in range(u.shape[0] - p):
        q_dot[n_p + j] = u[p + j]


@compiled
def write_equation(rows: Array, gain: Array, b: Buffers, e: Equation) -> None:
    """rate = ∂g/∂t + K e, J_bar = (∂f/∂q - ∂g/∂q) S; a row is [row of f, row of g, row of e].

    The row of e is PLAIN or WRAPPED where e = g - f, which then is not computed elsewhere. Where it is,
    rate = ∂e/∂t + K e and J_bar = -∂e/∂q S: the same equation for any e.
    """
    s = e.r.shape[0]
    n = b.value_q.shape[1]
    for i in range(s):
        f = rows[3 * i]
        g = rows[3 * i + 1]
        compared = rows[3 * i + 2]
        e.r[i] = b.value[f]
        e.r_d[i] = b.value[g]
        if compared >= 0:
            e.error[i] = b.value[compared]
            e.rate[i] = b.value_t[compared]
            for j in range(n):
                b.value_q[compared, j] = -b.value_q[compared, j]
            times_S(b.value_q, compared, b.G, e.J[i])
            continue
        error = b.value[g] - b.value[f]
        if compared == WRAPPED:  # to (-π, π]
            error = math.pi - (math.pi - error) % (2.0 * math.pi)
        e.error[i] = error
        e.rate[i] = b.value_t[g] - b.value_t[f]
        for j in range(n):  # in place: f's derivative is not read again
            b.value_q[f, j] -= b.value_q[g, j]
        times_S(b.value_q, f, b.G, e.J[i])
    for i in range(s):
        for j in range(s):
            e.rate[i] += gain[i * s + j] * e.error[j]


@compiled
def step(t: float, q: Array, tables: Array, numbers: Array, memory: Array, state: Array) -> float:
    """One control step: functions, equations, gradient, inputs. Returns the resolver's status.

    Pinocchio's part is in `memory` already. shape = [s, k, m, resolver kernel]; terms: the rows
    of the objective's terms.
    """
    b = run(t, q, tables, numbers, memory)
    e = results(tables, memory)
    shape = section(tables, SHAPE)
    rows = section(tables, ROWS)
    write_equation(rows, section(numbers, GAINS), b, e.task)
    write_equation(rows[3 * shape[0] :], section(numbers, ADDED_GAINS), b, e.added)
    terms = section(tables, TERMS)
    weights = section(numbers, WEIGHTS)
    gradient = np.zeros((1, q.shape[0]))
    e.H[0] = 0.0
    for i in range(terms.shape[0]):
        e.H[0] += weights[i] * b.value[terms[i]]
        for j in range(q.shape[0]):
            gradient[0, j] += weights[i] * b.value_q[terms[i], j]
    times_S(gradient, 0, b.G, e.h)
    answer = e.answer
    for j in range(answer.u.shape[0]):
        answer.u[j] = math.nan
    answer.status[0] = NOT_FINITE
    for level in range(answer.scale.shape[0]):
        answer.scale[level] = 1.0
    answer.residual[0] = math.nan
    answer.measure[0] = math.nan
    problem = stated(e, tables, numbers)
    call_resolver(shape[3], problem, section(numbers, RESOLVER), section(tables, OPTIONS), state, answer)
    drive(answer.u, b.G, e.q_dot)
    return answer.status[0]


@inlined
def stated(e: Results, tables: Array, numbers: Array) -> ProblemArrays:
    """The problem that the resolver gets; it has no limits."""
    m = e.h.shape[0]
    none = view(e.h, 0, (0,))
    return ProblemArrays(
        e.task.J,
        e.task.rate,
        section(numbers, SCALES),
        section(tables, ENDS),
        e.added.J,
        e.added.rate,
        section(numbers, ADDED_SCALES),
        e.h,
        view(e.h, 0, (0, m)),
        none,
        none,
        e.before,
        e.dt[0],
    )
