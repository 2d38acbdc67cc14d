"""The compiled control step: from functions to J_bar u = rate and h, from these to u and q_dot.

This is where the multiplication by S happens, once for all: J_bar = (∂f/∂q - ∂g/∂q) S,
h = Sᵀ ∂H/∂q, q_dot = S u (paper, eqs. 2, 6 and 13).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from nmm.arrays import Array, Integers
from nmm.functions.program import BESIDE, Buffers, run
from nmm.kernels.compiled import call_resolver, compiled
from nmm.kernels.memory import IntegerMatrix, IntegerVector, Matrix, Vector, views
from nmm.resolvers.base import REPORT


class Equation(NamedTuple):
    """J u = rate for a stack of tasks: value r (s,), target (s,), error (s,), rate (s,), J (s, m)."""

    r: Vector
    target: Vector
    error: Vector
    rate: Vector
    J: Matrix


class Results(NamedTuple):
    """What one step leaves behind.

    task, constraint : their equations
    H (1,), h (m,) : the objective and its gradient seen by the inputs
    u (m,) : the inputs
    report : [status, residual, measure]
    q_dot (n,) : S u
    """

    task: Equation
    constraint: Equation
    H: Vector
    h: Vector
    u: Vector
    report: Vector
    q_dot: Vector


class Laws(NamedTuple):
    """What a step reads and writes beside its program's functions; its place in memory is `BESIDE`.

    rows (s, 3), gain (s, s) : of the task: [row of f, row of g, row of e] among the program's rows
    constraint_rows (k, 3), constraint_gain (k, k) : of the constraint
    terms, weights : rows of the objective's terms, and what they count
    resolver, numbers, options : the resolver's kernel and what it reads
    """

    results: Results
    rows: IntegerMatrix
    gain: Matrix
    constraint_rows: IntegerMatrix
    constraint_gain: Matrix
    terms: IntegerVector
    weights: Vector
    resolver: int
    numbers: Vector
    options: IntegerVector


#: Instead of the row of an error that is computed: the error is target - value; an angle's, wrapped.
PLAIN, WRAPPED = -1, -2


def empty_results(s: int, k: int, m: int, n: int) -> Results:
    """Room for the results of s rows of a task, k of a constraint, m inputs and n coordinates."""
    task, constraint = (
        Equation(
            r=np.zeros(rows),
            target=np.zeros(rows),
            error=np.zeros(rows),
            rate=np.zeros(rows),
            J=np.zeros((rows, m)),
        )
        for rows in (s, k)
    )
    return Results(task, constraint, np.zeros(1), np.zeros(m), np.zeros(m), np.zeros(REPORT), np.zeros(n))


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
def write_equation(rows: Integers, gain: Array, b: Buffers, e: Equation) -> None:
    """rate = ∂g/∂t + K e, J_bar = (∂f/∂q - ∂g/∂q) S; a row is [row of f, row of g, row of e].

    The row of e is PLAIN or WRAPPED where e = g - f, which then is not computed elsewhere. Where it is,
    rate = ∂e/∂t + K e and J_bar = -∂e/∂q S: the same equation for any e.
    """
    s = e.r.shape[0]
    n = b.value_q.shape[1]
    for i in range(s):
        f = rows[i, 0]
        g = rows[i, 1]
        compared = rows[i, 2]
        e.r[i] = b.value[f]
        e.target[i] = b.value[g]
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
            e.rate[i] += gain[i, j] * e.error[j]


@compiled
def step(t: float, q: Array, integers: Integers, floats: Array, state: Integers) -> float:
    """One control step: functions, equations, gradient, inputs. Returns the resolver's status.

    Pinocchio's part is in memory already.
    """
    b = run(t, q, integers, floats)
    laws = views(Laws, integers, floats, BESIDE)
    e = laws.results
    write_equation(laws.rows, laws.gain, b, e.task)
    write_equation(laws.constraint_rows, laws.constraint_gain, b, e.constraint)
    gradient = np.zeros((1, q.shape[0]))
    e.H[0] = 0.0
    for i in range(laws.terms.shape[0]):
        term = laws.terms[i]
        e.H[0] += laws.weights[i] * b.value[term]
        for j in range(q.shape[0]):
            gradient[0, j] += laws.weights[i] * b.value_q[term, j]
    times_S(gradient, 0, b.G, e.h)
    for j in range(e.u.shape[0]):
        e.u[j] = math.nan  # what a resolver that finds no solution leaves behind
    for j in range(e.report.shape[0]):
        e.report[j] = math.nan
    call_resolver(
        laws.resolver,
        e.task.J,
        e.task.rate,
        e.constraint.J,
        e.constraint.rate,
        e.h,
        laws.numbers,
        laws.options,
        state,
        e.u,
        e.report,
    )
    drive(e.u, b.G, e.q_dot)
    return e.report[0]
