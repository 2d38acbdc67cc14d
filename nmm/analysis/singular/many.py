"""J of many configurations in one compiled call, a fraction of a microsecond to some microseconds each."""

from __future__ import annotations

import math

import numpy as np

from nmm.arrays import Array, Integers
from nmm.control.controller import Controller
from nmm.control.equations import ControlStep, write_equation
from nmm.cores import Work, over_cores
from nmm.functions.program import BESIDE, LaidOut, run
from nmm.kernels.compiled import compiled_without_gil, view
from nmm.kernels.memory import views
from nmm.progress import Progress

#: Configurations a compiled call: what nothing interrupts.
AT_ONCE = 128


@compiled_without_gil
def write_matrices(t: Array, q: Array, integers: Integers, floats: Array, found: Array) -> None:
    """found (N, s, m): the equation's matrix at t (N,) and q (N, n); not a number where any part is none."""
    e = views(ControlStep, integers, floats, BESIDE)
    b = views(LaidOut, integers, floats, 0).buffers
    J, n = e.problem.J, q.shape[1]
    for k in range(q.shape[0]):
        run(t[k], view(q, k * n, (n,)), integers, floats)
        write_equation(e.task, b, e.arm, J, e.problem.rate)
        finite = True
        for i in range(J.shape[0]):
            for j in range(J.shape[1]):
                finite = finite and math.isfinite(J[i, j])
        for i in range(J.shape[0]):
            for j in range(J.shape[1]):
                found[k, i, j] = J[i, j] if finite else math.nan


def matrices(controller: Controller, t: Array, q: Array, progress: Progress | None = None) -> Array:
    """J (N, s, m) of the controller's task at t (N,), s, and q (N, n); not a number where there is none.

    Over the cores, where the controller is compiled as a whole; one by one where a Python function is in it.

    Parameters
    ----------
    progress : called with the fraction done
    """
    q = np.ascontiguousarray(q, dtype=np.float64)
    found = np.empty((len(q), len(controller.rows), controller.robot.n_u))
    if controller.compilable:
        with controller.compiled() as (integers, floats):
            integers, floats = integers.copy(), floats.copy()

        def worker() -> Work:
            own = floats.copy()
            return lambda first, last: write_matrices(
                t[first:last], q[first:last], integers, own, found[first:last]
            )

        over_cores(len(q), AT_ONCE, worker, progress)
        return found
    solve, J = controller.equation_solver()
    every = max(1, len(q) // 100)
    for k, point in enumerate(q):
        if progress is not None and k % every == 0:
            progress(k / len(q))
        solve(float(t[k]), point)
        found[k] = J
    found[~np.isfinite(found).all(axis=(1, 2))] = np.nan
    return found
