"""Null spaces of J: an orthonormal basis for machines, and a sparse one that a person can read."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np

from nmm.analysis.singular.parts import null_space
from nmm.arrays import Array, Integers

#: Singular values and components this small beside the largest belong to a smaller set of columns.
TIGHT = 1e-12
#: The part of a unit vector that the vectors chosen before it must not already span.
NEW = 1e-3
#: With more sets of columns than this the sparsest vectors are not looked for.
MOST_SETS = 20_000


def projector(J: Array, rank: int) -> Array:
    """The orthogonal projector (m, m) on the null space of J, I - J⁺ J."""
    N = null_space(J, rank)
    return N.T @ N


def readable_null_space(J: Array, rank: int, costs: Sequence[int], given: Array | None = None) -> Array:
    """A basis (m - rank, m) of J's null space, each vector with as few non-zero components as there can be.

    Its vectors are circuits: columns of J that depend on each other while no fewer of them do, so that at
    most rank + 1 components differ from 0. Taken are, one after another, the smallest circuits that say
    something new (for a matroid, as columns are one, this greedy choice has the fewest non-zeros in all; of
    equally small ones those of least cost come first, then those of the best condition). Each vector's
    largest component is 1. With very many columns it is the reduced row echelon form's basis instead.

    Parameters
    ----------
    J : (s, m)
    rank : of J
    costs : (m,) of each column
    given : (k, m) vectors of the null space that are there already: the basis completes them

    Returns
    -------
    (m - rank - rank of given, m)
    """
    m = J.shape[1]
    own = np.zeros((0, m)) if given is None else given
    count = m - rank - len(own)
    if count <= 0:
        return np.zeros((0, m))
    _, values, Vt = np.linalg.svd(J, full_matrices=False) if J.size else (None, np.zeros(0), np.zeros((0, m)))
    core = values[:rank, np.newaxis] * Vt[:rank]
    sets = sum(math.comb(m, size) for size in range(1, rank + 2))
    candidates = _circuits(core, costs) if sets <= MOST_SETS else _echelon(core, costs)
    chosen = _new_ones(candidates, own, count)
    if len(chosen) < count:  # circuits that all but repeat each other
        chosen += _new_ones(_echelon(core, costs), np.vstack([own, *chosen]), count - len(chosen))
    return np.array([_scaled(vector) for vector in chosen]).reshape(-1, m)


def _scaled(vector: Array) -> Array:
    """The largest component 1: of equals the first, whatever the rounding."""
    return np.asarray(vector / vector[np.argmax(np.round(np.abs(vector) / np.abs(vector).max(), 9))])


def _circuits(core: Array, costs: Sequence[int]) -> list[Array]:
    """All circuits of the columns of `core` (rank, m) as unit vectors, the most readable first."""
    rank, m = core.shape
    largest = float(np.linalg.norm(core, 2)) if core.size else 0.0
    found: list[tuple[tuple[float, ...], Array]] = []
    for size in range(1, rank + 2):
        columns = np.array(list(itertools.combinations(range(m), size)), dtype=np.int64).reshape(-1, size)
        for own, null, gap in zip(columns, *_dependence(core, columns, largest), strict=True):
            if np.isnan(gap):
                continue
            vector = np.zeros(m)
            vector[own] = null
            # Condition in steps of a half decade: within one, cheaper columns and earlier ones win.
            condition = float(round(-2.0 * math.log10(gap))) if size > 1 else 0.0
            found.append(((size, sum(costs[column] for column in own), condition), vector))
    return [vector for _, vector in sorted(found, key=lambda item: item[0])]


def _dependence(core: Array, columns: Integers, largest: float) -> tuple[Array, Array]:
    """For sets of columns (N, size): null vectors (N, size) and how far from a second one (N,).

    Not a number where the set is no circuit.
    """
    size, rank = columns.shape[1], core.shape[0]
    blocks = np.zeros((len(columns), max(rank, size), size))
    blocks[:, :rank] = core[:, columns].transpose(1, 0, 2)
    _, values, Vt = np.linalg.svd(blocks, full_matrices=False)
    null = Vt[:, -1, :]
    smallest = np.abs(null).min(axis=1)
    gap = values[:, -2] / largest if size > 1 and largest > 0.0 else np.ones(len(columns))
    circuit = (values[:, -1] <= TIGHT * largest) & (gap > TIGHT) & (smallest > TIGHT)
    return null, np.where(circuit, np.maximum(gap, TIGHT), np.nan)


def _echelon(core: Array, costs: Sequence[int]) -> list[Array]:
    """The basis of the reduced row echelon form, cheap columns pivots last: rank + 1 components at most."""
    from scipy.linalg import qr

    rank, m = core.shape
    if not rank:
        return list(np.eye(m))
    weights = 1.0 + 1e-3 * np.asarray(costs, dtype=np.float64)
    pivots = qr(core * weights, mode="r", pivoting=True)[1]
    basic, free = pivots[:rank], pivots[rank:]
    found = []
    for column in free:
        vector = np.zeros(m)
        vector[basic] = -np.linalg.solve(core[:, basic], core[:, column])
        vector[column] = 1.0
        vector[np.abs(vector) <= TIGHT * np.abs(vector).max()] = 0.0
        found.append(vector / np.linalg.norm(vector))
    return sorted(found, key=lambda vector: int(np.count_nonzero(vector)))


def _new_ones(candidates: Sequence[Array], own: Array, count: int) -> list[Array]:
    """The first `count` candidates that neither those given nor those before them span."""
    spanned = np.linalg.qr(own.T)[0] if len(own) else np.zeros((own.shape[1], 0))
    chosen: list[Array] = []
    for candidate in candidates:
        if len(chosen) == count:
            break
        rest = candidate - spanned @ (spanned.T @ candidate)
        rest -= spanned @ (spanned.T @ rest)
        size = float(np.linalg.norm(rest))
        if size > NEW:
            chosen.append(candidate)
            spanned = np.column_stack([spanned, rest / size])
    return chosen
