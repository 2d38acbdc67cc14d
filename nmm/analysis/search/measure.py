"""How far from singular: the smallest singular value of a part's J at many configurations, and its slopes."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from nmm.analysis.singular.jacobians import STEP, Jacobians
from nmm.analysis.singular.parts import WHOLE, expect_inputs, singular_values
from nmm.arrays import Array, Integers
from nmm.control.directions import direction_texts, readable_basis

#: Singular values beside the largest, at a point that has converged: what is above it is not zero.
ROUNDING = 1e-13
#: So many times the usual largest singular value there is no J to speak of.
BLOWN = 100.0
#: Components of a unit vector that are too small for a text.
UNWRITTEN = 1e-4


class Measure:
    """Singular values of some columns of the scaled J, and the equations that make them vanish.

    With k = min(rows, inputs of the part), J has full rank when its k-th singular value σ is not zero. Where
    c of them vanish, with left and right singular vectors W (rows, rows - k + c) and V (inputs, inputs - k +
    c) that belong to these and to the null spaces, a motion along q_j keeps them at zero, to first order,
    exactly when Wᵀ (∂J/∂q_j) V = 0.

    Parameters
    ----------
    jacobians : what is searched
    part : "robot", "arm", "platform" or the name of one of several arms: whose columns
    length, sizes : as in `analyse`
    t : s

    Raises
    ------
    InputError : an unknown part, or one without inputs; a wrong size
    """

    def __init__(
        self,
        jacobians: Jacobians,
        part: str = WHOLE,
        length: float | None = None,
        sizes: Mapping[str, float] | None = None,
        t: float = 0.0,
    ) -> None:
        self.columns = expect_inputs(jacobians.robot, part)
        self.jacobians, self.robot, self.part, self.t = jacobians, jacobians.robot, part, t
        row_sizes, _, input_sizes = jacobians.sizes(length, sizes)
        self._scale = input_sizes / row_sizes[:, np.newaxis]
        self.rows, self.inputs = len(row_sizes), len(self.columns)
        self.full_rank = min(self.rows, self.inputs)
        self.natural = jacobians.natural(row_sizes)
        self.typical = np.inf

    def settle(self, q: Array) -> None:
        """Let σ stand beside no more than ten times the usual largest singular value, that at q (N, n)."""
        values, largest = self.values(q)
        exists = np.isfinite(values).all(axis=1)
        self.typical = 10.0 * float(np.median(largest[exists])) if exists.any() else np.inf

    def whole_J(self, q: Array) -> Array:
        """Scaled J (N, s, m) of the whole robot; not a number where there is none."""
        return self.jacobians.batch(q, self.t) * self._scale

    def J(self, q: Array) -> Array:
        """Scaled J (N, s, inputs) of the part."""
        return self.whole_J(q)[:, :, self.columns]

    def sigma(self, q: Array) -> tuple[Array, Array]:
        """The k-th singular value (N,), and that beside the largest of the whole J; infinite without a J."""
        values, largest = self.values(q)
        return values[:, -1], ratio(values[:, -1], largest)

    def values(self, q: Array) -> tuple[Array, Array]:
        """The part's k singular values (N, k), falling, and what they stand beside (N,).

        That is the largest of the whole J, but no more than ten times its median over the space and no less
        than a row of natural size. Where it is far more than that, J counts as none.
        """
        whole = self.whole_J(q)
        exists = np.isfinite(whole).all(axis=(1, 2))
        whole[~exists] = 0.0
        values = singular_values(whole[:, :, self.columns])[:, : self.full_rank]
        largest = values[:, 0]
        if len(self.columns) < whole.shape[2]:
            largest = singular_values(whole)[:, 0]
        # Beside the target of a bearing J grows without bound: that takes no rank away.
        exists &= largest <= BLOWN * self.typical
        values[~exists] = np.inf
        beside = np.maximum(np.minimum(largest, self.typical), self.natural)
        return values, np.asarray(np.where(exists, beside, 1.0))

    def ranks(self, q: Array, tolerance: float) -> Integers:
        """Rank of the part's J (N,), beside the largest singular value of the whole J."""
        values, largest = self.values(q)
        return np.sum(values > tolerance * largest[:, np.newaxis], axis=1, dtype=np.int64)

    def lost_text(self, q: Array, rank: int) -> tuple[str, ...]:
        """The task's directions that the part does not move at q (n,), in the rows' names."""
        left = np.linalg.svd(self.J(q[np.newaxis])[0])[0]
        lost = readable_basis(left[:, rank:].T)
        return direction_texts(np.where(np.abs(lost) < UNWRITTEN, 0.0, lost), self.jacobians.row_names)

    def equations(self, q: Array, axes: Integers, units: Array, corank: int) -> tuple[Array, Array, Array]:
        """Wᵀ J V (N, e), its derivatives (N, e, a) along the coordinates `axes` in their `units`, and σs.

        The third is the singular values (N, k). Derivatives are central differences; they are 0 where there
        is no J beside q.
        """
        count, a = len(q), len(axes)
        steps = np.zeros((2, a, q.shape[1]))
        steps[0, range(a), axes] = STEP * units
        steps[1] = -steps[0]
        around = self.J((q[:, np.newaxis] + steps.reshape(1, 2 * a, -1)).reshape(-1, q.shape[1]))
        around = around.reshape(count, 2, a, self.rows, self.inputs)
        slopes = np.nan_to_num((around[:, 0] - around[:, 1]) / (2.0 * STEP))
        U, values, Vt = np.linalg.svd(np.nan_to_num(self.J(q)))
        keep = self.full_rank - corank
        W, V = U[:, :, keep:], np.swapaxes(Vt[:, keep:], 1, 2)
        C = np.swapaxes(W, 1, 2)[:, np.newaxis] @ slopes @ V[:, np.newaxis]
        F = np.zeros((count, W.shape[2], V.shape[2]))
        F[:, range(corank), range(corank)] = values[:, keep:]
        return F.reshape(count, -1), np.swapaxes(C.reshape(count, a, -1), 1, 2), values


def ratio(small: Array, largest: Array) -> Array:
    """small / largest, 0 for 0 / 0, infinite where `small` is."""
    return np.asarray(np.where(largest > 0.0, small / np.where(largest > 0.0, largest, 1.0), 0.0))
