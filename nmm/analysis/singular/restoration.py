"""Which motions bring a lost direction back: the growth of the smallest singular value, to first order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from nmm.arrays import Array, Integers

#: A rate this small beside the largest singular value is rounding of the differences.
SMALL_RATE = 1e-7


@dataclass(frozen=True, eq=False)
class Restoration:
    """What each of k motions of the robot does to the smallest singular value of J.

    Where J has full rank, `rates` are derivatives of σ_min, with their signs. Where it has not, σ_min is 0
    and grows by rate * |ε| on both sides of a motion by ε: J(ε) = J + ε dJ has, to first order in ε, the
    s - rank small singular values |ε| σ(Nᵀ dJ V), N and V spanning the left and right null spaces of J.

    Attributes
    ----------
    names : of the motions: inputs (q moves along S(q) e_j) or coordinates (along e_i, with
        what follows that one)
    rates (k,) : growth of σ_min, per m or rad of the motion
    regained (k,) : how many lost directions come back at first order; 0 where none is lost
    best (k,) : unit combination of the motions with the largest effect (‖Nᵀ dJ V‖ in Frobenius' norm, or the
        gradient of σ_min); zeros when nothing has an effect
    best_rate : growth of σ_min along it

    Examples
    --------
    >>> arm = nmm.load("unicycle_2r", platform="fixed")
    >>> report = nmm.analysis.analyse((arm, nmm.Position("ee", "xy")), {"q2": 0.0})
    >>> back = report.by_input
    >>> dict(zip(back.names, back.regained.tolist()))
    {'q1': 0, 'q2': 1}
    """

    names: tuple[str, ...]
    rates: Array
    regained: Integers
    best: Array
    best_rate: float
    threshold: float

    @property
    def effective(self) -> tuple[str, ...]:
        """The motions that bring something back; where nothing is lost, those that change σ_min."""
        useful = (np.abs(self.rates) > self.threshold) | (self.regained > 0)
        return tuple(name for name, yes in zip(self.names, useful, strict=True) if yes)


def restoration(J: Array, dJ: Array, names: Sequence[str], rank: int) -> Restoration:
    """From J (s, m), its derivatives dJ (k, s, m) along k motions, and its rank."""
    s, count = len(J), len(names)
    U, values, Vt = np.linalg.svd(J)
    threshold = SMALL_RATE * max(float(values[0]), 1e-300)
    regained = np.zeros(count, dtype=np.int64)
    if rank == s:
        rates = np.einsum("i,kij,j->k", U[:, -1], dJ, Vt[s - 1])
        size = float(np.linalg.norm(rates))
        best = rates / size if size > threshold else np.zeros(count)
        return Restoration(tuple(names), rates, regained, best, float(rates @ best), threshold)
    reduced = np.einsum("ia,kij,bj->kab", U[:, rank:], dJ, Vt[rank:])
    small = np.linalg.svd(reduced, compute_uv=False) if count else np.zeros((0, s - rank))
    regained[:] = np.sum(small > threshold, axis=1)
    best, best_rate = np.zeros(count), 0.0
    if np.any(regained):
        best = np.linalg.svd(reduced.reshape(count, -1).T)[2][0]
        best = np.where(np.abs(best) > 1e-9, best, 0.0)
        best *= np.sign(best[np.argmax(np.abs(best))])  # both signs do the same
        best_rate = float(np.linalg.svd(np.tensordot(best, reduced, 1), compute_uv=False)[-1])
    return Restoration(tuple(names), small[:, -1], regained, best, best_rate, threshold)
