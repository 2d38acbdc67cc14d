"""Random problems within limits, and what a linear and a quadratic program say of them.

    python -m tests.limit_problems 20000

solves so many and prints how they agree.
"""

from __future__ import annotations

import math
import sys
from collections import Counter
from collections.abc import Iterator
from typing import NamedTuple

import daqp
import numpy as np
from scipy.optimize import linprog, nnls

from nmm.base.kernels.active_set import ConstraintRows, nearest_within

#: Rows of the task, inputs, rows of limits.
SIZES = ((2, 4, 4), (3, 5, 5), (6, 10, 10), (6, 10, 18), (6, 18, 40))
KINDS = ("plain", "degenerate", "near singular", "outside", "yielding", "empty")


class Example(NamedTuple):
    """J u = λ J target, lower - (1 - λ) give <= G u <= upper + (1 - λ) give."""

    kind: str
    J: np.ndarray
    G: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    target: np.ndarray
    give: np.ndarray

    def at(self, scale: float) -> Example:
        """The limits at a scale, as what does not give."""
        more = (1.0 - scale) * self.give
        return self._replace(lower=self.lower - more, upper=self.upper + more, give=0.0 * self.give)

    @property
    def rows(self) -> ConstraintRows:
        return ConstraintRows(
            self.J, np.zeros(len(self.J)), self.J @ self.target, self.G, self.lower, self.upper, self.give
        )


class Found(NamedTuple):
    scale: float
    u: np.ndarray
    active: np.ndarray


def examples(count: int, seed: int = 0) -> Iterator[Example]:
    """All kinds and sizes in turn."""
    rng = np.random.default_rng(seed)
    for i in range(count):
        s, m, c = SIZES[i % len(SIZES)]
        kind = KINDS[(i // len(SIZES)) % len(KINDS)]
        J = rng.normal(size=(s, m))
        if kind == "near singular":
            J[-1] = J[0] + 10.0 ** rng.uniform(-6.0, -3.0) * rng.normal(size=m)
        G = np.vstack([np.eye(m), rng.normal(size=(c - m, m))]) if c > m else np.eye(m)
        if kind == "degenerate":  # rows twice, sums of rows, a limit along the task's own row
            G = np.vstack([G, G[:2], G[:1] + G[1:2], J[:1]])
        inside = 0.3 * rng.normal(size=m)
        lower = G @ inside - rng.uniform(0.0, 1.0, len(G))
        upper = G @ inside + rng.uniform(0.0, 1.0, len(G))
        if kind == "outside":  # 0 is not allowed: what is begins at the edge
            lower[:2] = (G @ inside)[:2]
        if kind == "empty":
            G = np.vstack([G, G[:1]])
            lower = np.append(lower, upper[0] + rng.uniform(0.1, 1.0))
            upper = np.append(upper, math.inf)
        rate = rng.choice([0.1, 0.3, 1.0, 3.0]) * rng.normal(size=s)
        u = np.linalg.lstsq(J, rate, rcond=None)[0] + rng.choice([0.0, 0.3]) * rng.normal(size=m)
        if kind != "empty":  # from a point within the limits
            lower, upper, u = lower - G @ inside, upper - G @ inside, u - inside
        give = rng.uniform(0.0, 1.0, len(G)) if kind == "yielding" else np.zeros(len(G))
        yield Example(kind, J, np.ascontiguousarray(G), lower, upper, u, give)


def solved(example: Example, active: np.ndarray | None = None) -> Found:
    y = np.zeros(len(example.target))
    active = np.zeros(2 + len(example.G), dtype=np.int64) if active is None else active
    return Found(nearest_within(example.rows, example.target, 0.0, active, y), y, active)


def largest_scale(example: Example) -> float:
    """λ by a linear program; not a number where there is none."""
    s, m = example.J.shape
    finite, give = np.isfinite(example.upper), example.give[:, None]
    above = np.hstack([example.G[finite], give[finite]])
    result = linprog(
        np.append(np.zeros(m), -1.0),
        A_ub=np.vstack([above, np.hstack([-example.G, give])]),
        b_ub=np.concatenate([(example.upper + example.give)[finite], example.give - example.lower]),
        A_eq=np.hstack([example.J, -(example.J @ example.target)[:, None]]),
        b_eq=np.zeros(s),
        bounds=[(None, None)] * m + [(0.0, 1.0)],
        method="highs",
        options={"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10},
    )
    return float(result.x[-1]) if result.status == 0 else math.nan


def nearest(example: Example, scale: float) -> np.ndarray | None:
    """The point nearest to the target at that λ, by a quadratic program; None where it finds none."""
    s, m = example.J.shape
    A = np.ascontiguousarray(np.vstack([example.G, example.J]))
    asked = scale * (example.J @ example.target)
    sense = np.append(np.zeros(len(example.G), dtype=np.int32), np.full(s, 5, dtype=np.int32))
    u, _, flag, _ = daqp.solve(
        np.eye(m),
        -example.target,
        A,
        np.append(np.minimum(example.upper, 1e30), asked),
        np.append(example.lower, asked),
        sense,
        primal_tol=1e-10,
    )
    return np.array(u) if flag == 1 else None


def violation(example: Example, u: np.ndarray) -> float:
    """How far limits are broken, times the bound where that is above 1."""
    value = example.G @ u
    below = (example.lower - value) / np.maximum(1.0, np.abs(example.lower))
    size = np.maximum(1.0, np.where(np.isfinite(example.upper), np.abs(example.upper), 1.0))
    return float(max(below.max(), ((value - example.upper) / size).max(), 0.0))


def pull(example: Example, found: Found) -> float:
    """What is left of u - target after the active limits' and the task's normals, 0 for the nearest point."""
    c = len(example.G)
    sides = [
        example.G[i - 1] if i <= c else -example.G[i - 1 - c] for i in found.active[1 : 1 + found.active[0]]
    ]
    normals = np.vstack([example.J, -example.J, *sides])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    moved = found.u - example.target
    return float(nnls(normals.T, moved)[1]) / (1.0 + float(np.linalg.norm(moved)))


def main(count: int) -> None:
    """Print how many of each kind were solved, and the worst differences."""
    kinds: Counter[tuple[str, str]] = Counter()
    worst = dict.fromkeys(KINDS, (0.0, 0.0, 0.0, 0.0))
    for example in examples(count):
        found = solved(example)
        ended = "none" if math.isnan(found.scale) else "scaled" if found.scale < 1.0 else "whole"
        kinds[example.kind, ended] += 1
        expected = largest_scale(example)
        if math.isnan(found.scale) or math.isnan(expected):
            kinds[example.kind, "disagree"] += math.isnan(found.scale) != math.isnan(expected)
            continue
        by = nearest(example, found.scale) if found.scale == 1.0 else None
        apart = 0.0 if by is None else float(np.abs(by - found.u).max())
        kinds[example.kind, "compared with a QP"] += by is not None
        asked = found.scale * (example.J @ example.target)
        missed = float(np.abs(example.J @ found.u - asked).max()) / (1.0 + float(np.abs(asked).max()))
        new = (
            abs(found.scale - expected),
            max(apart, pull(example, found)),
            violation(example.at(found.scale), found.u),
            missed,
        )
        worst[example.kind] = tuple(map(max, worst[example.kind], new))  # type: ignore[assignment]  # as many as before
    for kind in KINDS:
        counts = {ended: number for (of, ended), number in sorted(kinds.items()) if of == kind}
        print(kind, counts, "λ {:.1e}, u {:.1e}, limits {:.1e}, task {:.1e}".format(*worst[kind]))


if __name__ == "__main__":
    main(int(sys.argv[1]))
