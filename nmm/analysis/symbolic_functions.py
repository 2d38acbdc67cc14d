"""Formulas as numpy functions."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from nmm.arrays import Array, scalar
from nmm.errors import InputError, unknown

if TYPE_CHECKING:
    from nmm.analysis.symbolic import SymbolicAnalysis


class SymbolicFunctions:
    """f, J and the minors at configurations q (..., n), for the robot's own lengths or for others.

    Lengths are given by name: `functions.J(q, d=0.0)`.
    """

    def __init__(self, analysis: SymbolicAnalysis) -> None:
        import sympy

        self._geometry = dict(analysis.geometry)
        self._n = len(analysis.q)
        self._columns = tuple(analysis.minors)
        names = [*analysis.q, *self._geometry]
        arguments = [analysis.symbols[name] for name in names]
        aux = [(analysis.symbols[name], value) for name, value in analysis.definitions.items()]

        def compiled(entries: list[Any]) -> Any:
            entries = [sympy.sympify(entry).subs(aux) for entry in entries]
            return sympy.lambdify(arguments, entries, "numpy", cse=True)

        self._shape = analysis.J.shape
        self._f = compiled(list(analysis.f))
        self._J = compiled(list(analysis.J))
        self._minors = compiled(list(analysis.minors.values()))

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
            if name not in values:
                raise InputError(unknown("length", name, values))
            values[name] = scalar(value, name)
        found = function(*np.moveaxis(q, -1, 0), *values.values())
        return np.stack([np.broadcast_to(entry, q.shape[:-1]) for entry in found], axis=-1).astype(np.float64)
