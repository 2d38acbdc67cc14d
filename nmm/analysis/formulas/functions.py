"""Formulas as numpy functions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
import sympy
from numpy.typing import ArrayLike

from nmm.analysis.formulas.result import Formulas
from nmm.analysis.formulas.written import ROTATION_VECTOR
from nmm.arrays import Array, scalar
from nmm.errors import InputError, expect_known
from nmm.kernels.rotations import log3


class SymbolicFunctions:
    """f, J and the minors at configurations q (..., n), for the robot's own lengths or for others.

    Lengths are given by name: `functions.J(q, d=0.0)`.
    """

    def __init__(self, formulas: Formulas) -> None:
        self._geometry = dict(formulas.geometry)
        self._n = len(formulas.q)
        self._columns = tuple(formulas.minors)
        self._shape = formulas.J.shape
        names = [*formulas.q, *self._geometry]
        arguments = [formulas.symbols[name] for name in names]
        modules = [
            {name: partial(_rotation_vector, part) for part, name in enumerate(ROTATION_VECTOR)},
            "numpy",
        ]

        def compiled(entries: list[Any], auxiliary: Sequence[Any] = ()) -> Any:
            entries = [sympy.sympify(entry) for entry in entries]
            return sympy.lambdify([*arguments, *auxiliary], entries, modules, cse=True)

        # Auxiliary quantities are computed first, and given to the others.
        auxiliary = [formulas.symbols[name] for name in formulas.definitions]
        self._auxiliary = compiled(list(formulas.definitions.values()))
        self._f = compiled(list(formulas.f), auxiliary)
        self._J = compiled(list(formulas.J), auxiliary)
        self._minors = compiled(list(formulas.minors.values()), auxiliary)

    def f(self, q: ArrayLike, **geometry: float) -> Array:
        """Task value, (..., s), m and rad; angles are not wrapped."""
        return self._evaluated(self._f, q, geometry)

    def J(self, q: ArrayLike, **geometry: float) -> Array:
        """Matrix of J u = rate, (..., s, m)."""
        flat = self._evaluated(self._J, q, geometry)
        return flat.reshape(*flat.shape[:-1], *self._shape)

    def minors(self, q: ArrayLike, **geometry: float) -> dict[tuple[str, ...], Array]:
        """Every maximal minor, (...), by the names of its columns."""
        values = self._evaluated(self._minors, q, geometry)
        return {columns: values[..., i] for i, columns in enumerate(self._columns)}

    def _evaluated(self, function: Any, q: ArrayLike, geometry: Mapping[str, float]) -> Array:
        q = np.asarray(q, dtype=np.float64)
        if q.ndim == 0 or q.shape[-1] != self._n:
            raise InputError(f"q: expected {self._n} numbers in the last dimension, got shape {q.shape}")
        values = dict(self._geometry)
        for name, value in geometry.items():
            expect_known("length", name, values)
            values[name] = scalar(value, name)
        given = [*np.moveaxis(q, -1, 0), *values.values()]
        found = function(*given, *self._auxiliary(*given))
        return np.stack([np.broadcast_to(entry, q.shape[:-1]) for entry in found], axis=-1).astype(np.float64)


def _rotation_vector(part: int, *entries: ArrayLike) -> Array:
    """One component (rad) of the rotation vectors of matrices, whose entries are given row by row."""
    full = np.broadcast_arrays(*(np.asarray(entry, dtype=np.float64) for entry in entries))
    matrices = np.stack(full, axis=-1).reshape(-1, 3, 3)
    vectors = np.empty((len(matrices), 3))
    for matrix, vector in zip(matrices, vectors, strict=True):
        log3(matrix, vector)
    return vectors[:, part].reshape(full[0].shape)
