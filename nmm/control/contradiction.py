"""Which limits contradict each other where no input keeps them all."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from nmm.resolvers.problem_arrays import ProblemArrays


def contradicting(problem: ProblemArrays, inputs: Sequence[str], rows: Sequence[str]) -> tuple[str, ...]:
    """Names of limits that no u (m,) keeps together; () where there is one that keeps all.

    Rows are widened by the least number with which there is a u within the limits of the inputs: the limits
    that have a price in this linear program leave nothing between them (Farkas).
    """
    from scipy.optimize import linprog  # here: a quarter of a second that most runs need not pay

    m, count = len(inputs), len(rows)
    if not count:
        return ()
    one = np.ones((count, 1))
    A = np.vstack([np.hstack([problem.limit_rows, -one]), np.hstack([-problem.limit_rows, -one])])
    b = np.concatenate([problem.upper, -problem.lower])
    some = np.isfinite(b)
    bounds = [*zip(problem.u_lower, problem.u_upper, strict=True), (0.0, None)]
    found = linprog(np.append(np.zeros(m), 1.0), A[some], b[some], bounds=bounds)
    if found.x is None or found.x[-1] <= 0.0:
        return ()
    prices = np.zeros(2 * count)
    prices[some] = np.abs(found.ineqlin.marginals)
    of_rows = prices.reshape(2, count).max(axis=0)
    of_inputs = np.abs(found.lower.marginals[:m]) + np.abs(found.upper.marginals[:m])
    return tuple(
        name for name, price in zip([*rows, *inputs], [*of_rows, *of_inputs], strict=True) if price > 1e-9
    )
