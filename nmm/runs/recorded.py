"""What a run records of each sample, as arrays that compiled code writes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from nmm.arrays import Array
from nmm.control.equations import ControlStep
from nmm.functions.program import Buffers
from nmm.kernels.compiled import compiled
from nmm.kernels.memory import IntegerMatrix, IntegerVector, Matrices, Matrix, Vector
from nmm.resolvers.answer import FALLBACK, added_residual
from nmm.resolvers.partitions import COLUMNS


class Recorded(NamedTuple):
    """Quantities of N samples, as in `Step`.

    q, q_dot (N, n), u (N, m), r, r_d, error, rate (N, s), objective, residual, added_residual (N,),
    J (N, s, m), scale (N, levels), partition (N, s) : as there
    limited (N, k) : what limits name (`LimitReport.row_values`)
    unanswered (N,) : 1 where the resolver had no answer
    excess (N,) : by how much limits were widened
    step_size (N,) : the share of α that was taken
    side (N,) : the sign of det J_e where the extended Jacobian inverted it, else 0
    """

    q: Matrix
    q_dot: Matrix
    u: Matrix
    r: Matrix
    r_d: Matrix
    error: Matrix
    rate: Matrix
    objective: Vector
    residual: Vector
    added_residual: Vector
    J: Matrices
    scale: Matrix
    partition: IntegerMatrix
    limited: Matrix
    unanswered: IntegerVector
    excess: Vector
    step_size: Vector
    side: IntegerVector


def room(count: int, n: int, m: int, s: int, levels: int, limited: int) -> Recorded:
    """Room for that many samples."""
    return Recorded(
        q=np.empty((count, n)),
        q_dot=np.empty((count, n)),
        u=np.empty((count, m)),
        r=np.empty((count, s)),
        r_d=np.empty((count, s)),
        error=np.empty((count, s)),
        rate=np.empty((count, s)),
        objective=np.empty(count),
        residual=np.empty(count),
        added_residual=np.zeros(count),
        J=np.empty((count, s, m)),
        scale=np.ones((count, levels)),
        partition=np.full((count, s), -1, dtype=np.int64),
        limited=np.empty((count, limited)),
        unanswered=np.zeros(count, dtype=np.int64),
        excess=np.zeros(count),
        step_size=np.ones(count),
        side=np.zeros(count, dtype=np.int64),
    )


@compiled
def note(e: ControlStep, b: Buffers, q: Array, partitioned: int, k: int, found: Recorded) -> None:
    """Record the sample just made at q as the k-th."""
    n, m, s = q.shape[0], e.answer.u.shape[0], e.task.r.shape[0]
    for i in range(n):
        found.q[k, i] = q[i]
        found.q_dot[k, i] = e.q_dot[i]
    for j in range(m):
        found.u[k, j] = e.answer.u[j]
    for i in range(s):
        found.r[k, i] = e.task.r[i]
        found.r_d[k, i] = e.task.r_d[i]
        found.error[k, i] = e.task.error[i]
        found.rate[k, i] = e.task.full[i]
        found.partition[k, i] = e.state[COLUMNS + i] if partitioned == 1 else -1
        for j in range(m):
            found.J[k, i, j] = e.problem.J[i, j]
    found.objective[k] = e.H[()]
    found.residual[k] = e.answer.residual[()]
    found.excess[k] = e.answer.excess[()]
    found.side[k] = int(e.answer.side[()])
    found.added_residual[k] = added_residual(e.problem, e.answer.u)
    for level in range(found.scale.shape[1]):
        found.scale[k, level] = e.answer.scale[level]
    found.unanswered[k] = int(e.answer.status[()] == FALLBACK)
    w = e.limits.spin.shape[0] if found.limited.shape[1] > 0 else 0
    for i in range(w):
        found.limited[k, i] = 0.0
        for j in range(m):
            found.limited[k, i] += e.problem.limit_rows[i, j] * e.answer.u[j]
    for i in range(w, found.limited.shape[1]):
        found.limited[k, i] = b.value[e.limits.rows[i - w]]
