"""The records that a function's kernel reads and writes.

    @kernel(FUNCTION)
    def height(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
        frame = frames.slots[0]
        rows.value[0] = frames.placements[frame, 2, 3]
        for k in range(at.q.shape[0]):
            rows.value_q[0, k] = frames.jacobians[frame, 2, k]

A new quantity for kernels becomes a field here and in `program.py`; existing kernels do not change.
"""

from __future__ import annotations

from typing import NamedTuple

from nmm.base.kernels.compiled import caller
from nmm.base.kernels.record_layout import IntegerVector, Matrices, Matrix, Tensors, Vector, record_type
from nmm.base.kernels.signatures import float64, void


class At(NamedTuple):
    """Time t (s), coordinates q (n,), m and rad, and the platform there.

    G (n_p, p) : its velocity map, qp_dot = G up
    G_q (n_p, p, n_p) : dG[i, j] / dqp[k]
    """

    t: float
    q: Vector
    G: Matrix
    G_q: Matrices


class Frames(NamedTuple):
    """Kinematics at q, world axes; frame k of those that the stage names has index slots[k].

    slots : (frames of the stage,)
    placements : (..., 3, 4) = [R | p], m
    jacobians : (..., 6, n), linear over angular velocity
    hessians : (..., 6, n, n), dJ[i, j] / dq[k]; empty unless some stage requests them
    """

    slots: IntegerVector
    placements: Matrices
    jacobians: Matrices
    hessians: Tensors


class Rows(NamedTuple):
    """The stage's rows of y = phi(t, q): value (rows,), value_t (rows,) = ∂y/∂t, value_q (rows, n) = ∂y/∂q.

    They are zero before the first stage of a function; each later one finds what those before it wrote.
    """

    value: Vector
    value_t: Vector
    value_q: Matrix


#: y = phi(t, q) with its partial derivatives: (at, frames, numbers, rows), the numbers being the stage's own.
FUNCTION = void(record_type(At), record_type(Frames), float64[::1], record_type(Rows))

call_function = caller(FUNCTION)
