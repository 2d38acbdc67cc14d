"""Problems with levels of priority, and what linear and quadratic programs make of them.

`python -m tests.level_problems COUNT` compares that many.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from typing import NamedTuple

import daqp
import numpy as np
from scipy.linalg import null_space
from scipy.optimize import linprog

import nmm
from nmm.base.arrays import Array
from nmm.control.resolvers.problem import Problem

#: (rows of each level, inputs, rows of limits)
SIZES = (((1, 1, 1), 5, 3), ((2, 1, 2), 8, 4), ((3, 3, 2), 10, 8), ((3, 2, 3), 12, 6))


def problems(count: int, seed: int, *, if_possible: bool) -> Iterator[Problem]:
    """Random ones, of all sizes in turn; with rows that are kept if possible, at any level."""
    rng = np.random.default_rng(seed)
    for k in range(count):
        levels, m, limited = SIZES[k % len(SIZES)]
        s = sum(levels)
        centre = 0.2 * rng.standard_normal(m)
        yield Problem(
            J=rng.standard_normal((s, m)),
            rate=rng.uniform(0.1, 3.0) * rng.standard_normal(s),
            h=rng.standard_normal(m),
            levels=levels,
            u_lower=centre - rng.uniform(0.2, 1.0, m),
            u_upper=centre + rng.uniform(0.2, 1.0, m),
            limit_rows=rng.standard_normal((limited, m)),
            lower=-rng.uniform(0.3, 2.0, limited),
            upper=rng.uniform(0.3, 2.0, limited),
            limit_levels=rng.integers(0, len(levels) + 2, limited) if if_possible else None,
        )


class Room(NamedTuple):
    """lower <= A d <= upper for a change d of the inputs; d = 0 is within."""

    A: Array
    lower: Array
    upper: Array


def nearest(point: Array, E: Array, room: Room) -> Array:
    """The d with E d = 0 in the room that is nearest to a point."""
    # In the null space: a vertex where E d = 0 and other rows than that meet has been called empty.
    Z = null_space(E)
    rows = np.ascontiguousarray(room.A @ Z)
    upper, lower = np.minimum(room.upper, 1e6), np.maximum(room.lower, -1e6)
    sense = np.zeros(len(rows), dtype=np.int32)
    z, _, flag, _ = daqp.solve(np.eye(Z.shape[1]), -Z.T @ point, rows, upper, lower, sense, primal_tol=1e-11)
    if flag < 1:
        raise ArithmeticError(f"the quadratic program is not solved: {flag}")
    return Z @ z


def farthest(E: Array, along: Array, room: Room, gives: Array) -> float:
    """The largest τ <= 1 with E d = τ along, in a room that loses τ of `gives` on both sides."""
    m = room.A.shape[1]
    rows = np.vstack([np.column_stack([room.A, gives]), np.column_stack([-room.A, gives])])
    b = np.concatenate([room.upper, -room.lower])
    some = np.isfinite(b)
    equal = {"A_eq": np.column_stack([E, -along]), "b_eq": np.zeros(len(E))} if len(E) else {}
    options = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}
    bounds = [*[(None, None)] * m, (0.0, 1.0)]
    found = linprog(
        np.append(np.zeros(m), -1.0), rows[some], b[some], **equal, bounds=bounds, options=options
    )
    if found.x is None:
        raise ArithmeticError(f"the linear program is not solved: {found.message}")
    return float(found.x[-1])


class Off(NamedTuple):
    """What programs could do better than an answer, level by level, without taking anything from the levels
    above: for the task's rate, along the line to what it asks for; for limits that are kept if possible; for
    the distance to the unlimited inputs. And what the answer breaks of the limits that are always kept."""

    rate: float
    kept: float
    nearer: float
    broken: float


def compared(problem: Problem) -> Off:
    """The projected gradient's answer beside what linear and quadratic programs find from there."""
    resolver = nmm.ProjectedGradient(alpha=0.5)
    arrays = problem.arrays
    unlimited = resolver.resolve(Problem(problem.J, problem.rate, problem.h, levels=problem.levels)).u
    u = resolver.resolve(problem).u
    m = len(u)
    A = np.vstack([np.eye(m), arrays.limit_rows])
    low, high = np.append(arrays.u_lower, arrays.lower), np.append(arrays.u_upper, arrays.upper)
    levels = np.append(np.zeros(m), arrays.limit_levels)
    missed = np.maximum(0.0, np.maximum(low - A @ u, A @ u - high))
    rate, kept, first = 0.0, 0.0, 0
    for k, end in enumerate([*arrays.ends.tolist(), first], start=1):
        of = levels == k
        wider = np.where(of, missed[of].max(initial=0.0), missed)
        counted = levels <= k
        lower = np.where(counted, np.minimum(low - wider - A @ u, 0.0), -np.inf)
        upper = np.where(counted, np.maximum(high + wider - A @ u, 0.0), np.inf)
        room = Room(A, lower, upper)
        if wider[of].max(initial=0.0) > 0.0:
            back = farthest(arrays.J[:first], np.zeros(first), room, np.where(of, wider, 0.0))
            kept = max(kept, back * float(wider[of].max()))
        if k <= len(arrays.ends):
            rows = arrays.J[:end]
            along = np.where(np.arange(end) >= first, rows @ (unlimited - u), 0.0)
            rate = max(rate, farthest(rows, along, room, 0.0 * low) * float(np.abs(along).max()))
            first = end
    best = u + nearest(unlimited - u, arrays.J, room)
    nearer = float(np.linalg.norm(u - unlimited) - np.linalg.norm(best - unlimited))
    return Off(rate, kept, nearer, float(missed[levels == 0].max()))


def main(count: int) -> None:
    """Compare, and print the largest differences."""
    for if_possible in (False, True):
        offs = [compared(problem) for problem in problems(count, 1, if_possible=if_possible)]
        worst = Off(*np.array(offs).max(axis=0).tolist())
        print(f"{count} problems, rows {'at any level' if if_possible else 'always kept'}: {worst}")


if __name__ == "__main__":
    main(int(sys.argv[1]))
