"""Maximal minors of J by the names of their columns: all of them are zero where J loses rank."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import TypeAlias

import numpy as np

from nmm.base.arrays import Array, Integers
from nmm.base.errors import InputError, expect, expect_known

#: A minor's columns: names of inputs, or "v, omega, q2".
Columns: TypeAlias = str | Sequence[str]
#: Which minors: all, none, or those listed.
Choice: TypeAlias = bool | Sequence[Columns]

MOST_MINORS = 20_000
#: Most numbers in the square blocks whose determinants are taken at once.
BLOCK = 4_000_000
#: A determinant this small beside the product of its columns' lengths (Hadamard's bound) is rounding.
ROUNDING = 1e-12


class Minors(Mapping[tuple[str, ...], float | Array]):
    """Minors keyed by tuples of input names: `minors["v", "q2"]`, or `minors["v, q2"]`.

    A key may name the columns in any order; an odd permutation changes the sign. Unknown keys raise
    `InputError`, which lists the names.

    Attributes
    ----------
    columns (count, s) : indices of the columns of each minor, in the order of the names
    array (..., count) : values, in the product of the rows' units over that of the inputs'; with leading
        axes, such as a trajectory's samples, an item is an array
    inputs : names of J's columns

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> minors = nmm.analysis.analyse((robot, nmm.Position("ee", "xy")), {"q2": 0.5}).minors
    >>> len(minors), round(minors["q1, q2"], 3)
    (6, 0.072)
    """

    def __init__(self, columns: Integers, values: Array, inputs: Sequence[str]) -> None:
        self.columns = columns
        self.array = values
        self.inputs = tuple(inputs)
        self._place = {tuple(sorted(map(int, row))): i for i, row in enumerate(columns)}

    @property
    def names(self) -> tuple[tuple[str, ...], ...]:
        """The keys, in order."""
        return tuple(tuple(self.inputs[j] for j in row) for row in self.columns)

    def _find(self, key: Columns) -> tuple[int, int]:
        wanted = column_indices(key, self.inputs, self.columns.shape[1])
        place = self._place.get(tuple(sorted(wanted)))
        if place is None:
            raise InputError("not among those chosen", where=f"minor {', '.join(split(key))}")
        own = [int(j) for j in self.columns[place]]
        return place, permutation_sign([own.index(j) for j in wanted])

    def __getitem__(self, key: Columns) -> float | Array:
        place, sign = self._find(key)
        value = sign * self.array[..., place]
        return float(value) if value.ndim == 0 else value

    def __contains__(self, key: object) -> bool:
        try:
            self._find(key)  # type: ignore[arg-type]  # which is what is asked
        except (InputError, TypeError):
            return False
        return True

    def __iter__(self) -> Iterator[tuple[str, ...]]:
        return iter(self.names)

    def __len__(self) -> int:
        return len(self.columns)


def permutation_sign(order: Sequence[int]) -> int:
    swaps = sum(a > b for a, b in itertools.combinations(order, 2))
    return -1 if swaps % 2 else 1


def split(key: Columns) -> tuple[str, ...]:
    return tuple(part.strip() for part in key.split(",")) if isinstance(key, str) else tuple(key)


def column_indices(key: Columns, inputs: Sequence[str], s: int) -> tuple[int, ...]:
    """Indices of s different columns; `InputError` for an unknown name or another number of them."""
    names = split(key)
    for name in names:
        expect_known("input", name, inputs, "minor")
    expected = f"{s} different inputs, as many as J has rows, got {', '.join(names)}"
    expect(len(names) == len(set(names)) == s, "minor", expected)
    return tuple(list(inputs).index(name) for name in names)


def chosen_columns(choice: Choice, inputs: Sequence[str], s: int, most: int = MOST_MINORS) -> Integers:
    """Columns (count, s) of the minors chosen; `InputError` for unknown inputs, or more than `most`."""
    expect(not isinstance(choice, str), "minors", f"a list of them, as in [{choice!r}]", choice)
    if choice is True:
        count = math.comb(len(inputs), s)
        if count > most:
            has = f"J ({s} x {len(inputs)}) has {count}, expected at most {most}"
            raise InputError(f"{has}; list those wanted, or ask for none (minors=False)", where="minors")
        listed = list(itertools.combinations(range(len(inputs)), s))
    else:
        listed = [] if choice is False else [column_indices(key, inputs, s) for key in choice]
    return np.array(listed, dtype=np.int64).reshape(len(listed), s)


def determinants(J: Array, columns: Integers) -> Array:
    """det J[:, columns] for each row of columns (count, s) and J (..., s, m): (..., count)."""
    s = J.shape[-2]
    flat = J.reshape(-1, s, J.shape[-1])
    minors = np.empty((len(flat), len(columns)))
    step = max(1, BLOCK // max(1, columns.size * s))
    for first in range(0, len(flat), step):
        block = flat[first : first + step][:, :, columns]  # (.., s, count, s)
        minors[first : first + step] = np.linalg.det(np.moveaxis(block, 1, 2))
    return minors.reshape(*J.shape[:-2], len(columns))


def determinant_rates(J: Array, J_u: Array, columns: Integers) -> Array:
    """Derivatives (k, count) of those determinants along k motions, from J_u (k, s, m)."""
    A = np.moveaxis(J[:, columns], 1, 0)
    rates = np.zeros((len(J_u), len(columns)))
    for k, derivative in enumerate(J_u):
        dA = np.moveaxis(derivative[:, columns], 1, 0)
        for c in range(J.shape[0]):
            replaced = A.copy()
            replaced[:, :, c] = dA[:, :, c]
            rates[k] += np.linalg.det(replaced)
    return rates


def hadamard_bounds(J: Array, columns: Integers) -> Array:
    """Product of the lengths of each minor's columns, (..., count), each at least a hundredth of the longest.
    Entries of J are good to some 1e-14 of the longest column: without this floor, a column of rounding alone
    would be significant beside itself (see `ROUNDING`)."""
    lengths = np.linalg.norm(J, axis=-2)
    floor = 1e-2 * np.max(lengths, axis=-1, keepdims=True, initial=0.0)
    return np.prod(np.maximum(lengths, floor)[..., columns], axis=-1)
