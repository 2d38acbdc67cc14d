"""f, J = (∂f/∂q) S and its maximal minors as formulas, derived joint by joint from the robot itself, and as
numpy functions."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Any

import numpy as np
import sympy
from numpy.typing import ArrayLike

from nmm.analysis.singular.minors import column_indices, permutation_sign
from nmm.base.arrays import Array, scalar
from nmm.base.errors import expect, expect_known
from nmm.base.findings import Finding
from nmm.base.kernels.rotations import log3
from nmm.base.latex import Formula, minor_name, symbol
from nmm.model.robots.robot import Robot
from nmm.plugins.symbolic.derivation import Derivation
from nmm.plugins.symbolic.expansion import Expansion, Ring, TooLarge, maximal_minors
from nmm.plugins.symbolic.expressions import Product, shown, to_sympy
from nmm.plugins.symbolic.readable import factored, in_names, named
from nmm.plugins.symbolic.written import (
    ROTATION_VECTOR,
    Turn,
    Written,
    auxiliary_written,
    rotation_formula,
    written,
)

#: Minors that are 0 are counted, not listed, if they are at least so many.
_MANY = 4


@dataclass(frozen=True, eq=False)
class SymbolicAnalysis:
    """Formulas of one robot and task. Angles are in rad, lengths in m; all symbols are real.

    Attributes
    ----------
    row_names, u_names : names of J's rows (s) and columns (m)
    symbols : SymPy symbol of every coordinate, length, fixed angle and auxiliary quantity, by name
    geometry : the robot's own values of the lengths and fixed angles, by name
    values : the rows of f, each as expression and as it is shown
    entry_forms, minor_forms : J's entries and the minors in factors (`expressions.Product`)
    named_forms, short_forms : factors with a name; the minors in these names
    auxiliaries : definitions of auxiliary symbols, such as rho and g of a bearing
    numerators : the minors times J's denominators, multiplied out
    derivation : what the formulas were written from
    notes : what was rounded or summed up
    """

    robot: Robot
    row_names: tuple[str, ...]
    u_names: tuple[str, ...]
    symbols: Mapping[str, Any] = field(repr=False)
    geometry: Mapping[str, float]
    values: tuple[Written, ...] = field(repr=False)
    entry_forms: tuple[tuple[Product, ...], ...] = field(repr=False)
    minor_forms: Mapping[tuple[str, ...], Product] = field(repr=False)
    named_forms: Mapping[str, Product] = field(repr=False)
    short_forms: Mapping[tuple[str, ...], Product] = field(repr=False)
    auxiliaries: Mapping[str, Written] = field(repr=False)
    numerators: Mapping[tuple[str, ...], Expansion] = field(repr=False)
    derivation: Derivation = field(repr=False)
    notes: tuple[Finding, ...] = ()

    @cached_property
    def q(self) -> dict[str, Any]:
        """The coordinates' symbols, by name."""
        return {name: self.symbols[name] for name in self.robot.q_names}

    @cached_property
    def f(self) -> Any:
        """Task value, (s, 1); an angle is not wrapped."""
        return sympy.Matrix([value.expression for value in self.values])

    @cached_property
    def J(self) -> Any:
        """Matrix (s, m) of J u = rate; with a reference that depends on q, J_bar of eq. 13."""
        return sympy.Matrix([[to_sympy(entry, self.symbols) for entry in row] for row in self.entry_forms])

    @cached_property
    def minors(self) -> dict[tuple[str, ...], Any]:
        """Every maximal minor in factors, by the names of its columns, in the order of the inputs."""
        return {columns: to_sympy(form, self.symbols) for columns, form in self.minor_forms.items()}

    @cached_property
    def named(self) -> dict[str, Any]:
        """Factors shared by several minors (the paper's Λ), by name."""
        return {name: to_sympy(form, self.symbols) for name, form in self.named_forms.items()}

    @property
    def definitions(self) -> dict[str, Any]:
        """Definitions of auxiliary symbols, by name."""
        return {name: auxiliary.expression for name, auxiliary in self.auxiliaries.items()}

    @cached_property
    def short_entries(self) -> tuple[tuple[Product, ...], ...]:
        """J's entries with factors by name."""
        return tuple(tuple(in_names(entry, self.named_forms) for entry in row) for row in self.entry_forms)

    @property
    def denominators(self) -> list[Expansion]:
        """What J's rows and columns are divided by."""
        return [*self.derivation.row_denominators, *self.derivation.column_denominators]

    def minor(self, *columns: str) -> Any:
        """One minor by the names of its columns, in any order (which gives the sign).

        Raises
        ------
        InputError : another number of names than rows, a name twice, or one that is no input
        """
        picked = column_indices(columns, self.u_names, len(self.row_names))
        return permutation_sign(picked) * self.minors[tuple(self.u_names[j] for j in sorted(picked))]

    def without(self, *lengths: str) -> SymbolicAnalysis:
        """The same with lengths set to 0: what changes where d = 0.

        Raises
        ------
        InputError : a name that is no length of `geometry`, or one that J is divided by
        """
        with too_large_explained(self.robot, len(self.row_names), self.derivation.ring):
            return assembled(self.robot, self.row_names, self.derivation.without(lengths))

    def functions(self) -> SymbolicFunctions:
        """f, J and the minors as numpy functions of q."""
        return SymbolicFunctions(self)

    def text(self) -> str:
        """f, J and the minors as plain text; c12 is cos(q1 + q2)."""
        return "\n".join([*text_lines(self), *(f"note: {note}" for note in self.notes)])

    def latex(self) -> str:
        """The same as LaTeX, one align*: after f, J column by column, as columns of a page are narrow."""
        lines = latex_lines(self)
        names = [f"J_{{{symbol(name).latex}}}" for name in self.u_names]
        moving = self.derivation.target_moves
        of = r"\frac{\partial f}{\partial q}"
        of = rf"\left({of} - \frac{{\partial g}}{{\partial q}}\right)" if moving else of
        side_by_side = r" \; ".join(names)
        columns = [("J", rf"{of} S = [\, {side_by_side} \,]")]
        for name, column in zip(names, zip(*self.short_entries, strict=True), strict=True):
            entries = r" \\ ".join(shown(entry).latex for entry in column)
            columns.append((name, rf"\begin{{bmatrix}} {entries} \end{{bmatrix}}"))
        lines[len(self.values) : len(self.values)] = columns
        written = " \\\\\n  ".join(f"{left} &= {right}" for left, right in lines)
        return f"\\begin{{align*}}\n  {written}\n\\end{{align*}}"


@contextmanager
def too_large_explained(robot: Robot, s: int, ring: Ring) -> Iterator[None]:
    """Give a `TooLarge` raised inside a message that says what is too large, and why."""
    try:
        yield
    except TooLarge:
        angles = zip(ring.names, ring.is_angle, strict=True)
        general = [name for name, angle in angles if angle and name not in robot.q_names]
        few = f"{', '.join(general[:3])}{', ...' if general[3:] else ''}"
        why = f"so many joints{f' with general angles between their axes ({few})' if general else ''}"
        raise TooLarge(
            f"too large: {robot.name} with {robot.n_u} inputs and a task of {s} rows "
            f"({math.comb(robot.n_u, s)} minors): {why} make formulas too long to be read; use the numeric "
            "analysis, a task of fewer rows, or lock joints",
            where="symbolic",
        ) from None


def assembled(robot: Robot, row_names: tuple[str, ...], derivation: Derivation) -> SymbolicAnalysis:
    ring, rows, columns = derivation.ring, derivation.row_denominators, derivation.column_denominators
    numbers = maximal_minors([list(line) for line in derivation.matrix])
    entries = tuple(
        tuple(_quotient(entry, [row, column]) for entry, column in zip(line, columns, strict=True))
        for line, row in zip(derivation.matrix, rows, strict=True)
    )
    keys = {tuple(robot.u_names[j] for j in picked): picked for picked in numbers}
    minors = {
        key: _quotient(numbers[picked], [*rows, *(columns[j] for j in picked)])
        for key, picked in keys.items()
    }
    names, short = named(list(minors.values()), {*ring.names, *robot.q_names}, derivation.lengths)
    symbols = {name: sympy.Symbol(name, real=True) for name in (*robot.q_names, *ring.names, *names)}
    return SymbolicAnalysis(
        robot=robot,
        row_names=row_names,
        u_names=robot.u_names,
        symbols=symbols,
        geometry=derivation.lengths,
        values=tuple(written(value, symbols) for value in derivation.values),
        entry_forms=entries,
        minor_forms=minors,
        named_forms=names,
        short_forms=dict(zip(minors, short, strict=True)),
        auxiliaries={aux.name: auxiliary_written(aux, symbols) for aux in derivation.auxiliaries},
        numerators={key: numbers[picked] for key, picked in keys.items()},
        derivation=derivation,
        notes=derivation.notes,
    )


def _quotient(value: Expansion, divisors: list[Expansion]) -> Product:
    result = factored(value)
    if not result.number:
        return result
    for divisor in divisors:
        if divisor != divisor.ring.number(1):
            below = factored(divisor)
            result = result.times(Product(1 / below.number, tuple((f, -n) for f, n in below.factors)))
    return result


def text_lines(formulas: SymbolicAnalysis) -> Iterator[str]:
    """Task, nonzero entries of the matrix, named factors and minors, one formula a line."""
    yield "f"
    for name, value in zip(formulas.row_names, formulas.values, strict=True):
        yield f"  {name} = {value.formula}"
    moving = formulas.derivation.target_moves
    matrix = "J_bar = (df/dq - dg/dq) S, as the target g depends on q, too, and its" if moving else "J, whose"
    yield f"{matrix} columns are {', '.join(formulas.u_names)}"
    for name, row in zip(formulas.row_names, formulas.short_entries, strict=True):
        for column, entry in zip(formulas.u_names, row, strict=True):
            if entry.number:
                yield f"  [{name}, {column}] = {shown(entry)}"
    if definitions := _definitions(formulas):
        yield "with"
        yield from (f"  {left} = {right}" for left, right in definitions)
    yield "maximal minors"
    yield from (f"  {left} = {right}" for left, right in _minors(formulas))
    if summed := zeros_summed(formulas):
        yield f"  the other {summed} are 0"


def zeros_summed(formulas: SymbolicAnalysis) -> int:
    """How many zero minors are counted rather than listed; 0 where they are few."""
    zeros = sum(not form.number for form in formulas.short_forms.values())
    return zeros if zeros >= _MANY else 0


def _definitions(formulas: SymbolicAnalysis) -> list[tuple[Formula, Formula]]:
    """Auxiliary symbols, matrices of rotation vectors, named factors."""
    turns = [value for value in formulas.derivation.values if isinstance(value, Turn)]
    definitions = {name: auxiliary.formula for name, auxiliary in formulas.auxiliaries.items()}
    definitions |= {turn.name: rotation_formula(turn) for turn in turns}
    definitions |= {name: shown(form) for name, form in formulas.named_forms.items()}
    return [(symbol(name), value) for name, value in definitions.items()]


def latex_lines(formulas: SymbolicAnalysis) -> list[tuple[str, str]]:
    """Left and right sides: f, auxiliary symbols, named factors, minors."""
    values = [(f"f_{{{i}}}", value.formula.latex) for i, value in enumerate(formulas.values, 1)]
    rest = (*_definitions(formulas), *_minors(formulas))
    return [*values, *((left.latex, right.latex) for left, right in rest)]


def _minors(formulas: SymbolicAnalysis) -> list[tuple[Formula, Formula]]:
    every, summed = formulas.short_forms.items(), zeros_summed(formulas)
    return [(minor_name(columns), shown(form)) for columns, form in every if form.number or not summed]


class SymbolicFunctions:
    """f, J and the minors at q (..., n), for the robot's own lengths or others by name: `J(q, d=0.0)`."""

    def __init__(self, formulas: SymbolicAnalysis) -> None:
        self._geometry, J, minors = dict(formulas.geometry), formulas.J, formulas.minors
        self._n, self._columns, self._shape = len(formulas.q), tuple(minors), J.shape
        rotations = {name: partial(_rotation_vector, part) for part, name in enumerate(ROTATION_VECTOR)}
        arguments = [formulas.symbols[name] for name in (*formulas.q, *formulas.geometry)]
        auxiliary = [formulas.symbols[name] for name in formulas.definitions]

        def compiled(entries: Iterable[Any], more: Sequence[Any] = ()) -> Any:
            entries = [sympy.sympify(entry) for entry in entries]
            return sympy.lambdify([*arguments, *more], entries, [rotations, "numpy"], cse=True)

        self._auxiliary = compiled(formulas.definitions.values())
        self._f, self._J, self._minors = (
            compiled(expressions, auxiliary) for expressions in (formulas.f, J, minors.values())
        )

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
        expected = f"{self._n} numbers in the last dimension, got shape {q.shape}"
        expect(q.ndim and q.shape[-1] == self._n, "q", expected)
        values = dict(self._geometry)
        for name, value in geometry.items():
            expect_known("length", name, values)
            values[name] = scalar(value, name)
        arguments = [*np.moveaxis(q, -1, 0), *values.values()]
        flat = function(*arguments, *self._auxiliary(*arguments))
        return np.stack([np.broadcast_to(entry, q.shape[:-1]) for entry in flat], axis=-1).astype(np.float64)


def _rotation_vector(part: int, *entries: ArrayLike) -> Array:
    """One component (rad) of the rotation vectors of matrices given by their entries, row by row."""
    full = np.broadcast_arrays(*(np.asarray(entry, dtype=np.float64) for entry in entries))
    matrices = np.stack(full, axis=-1).reshape(-1, 3, 3)
    vectors = np.empty((len(matrices), 3))
    for matrix, vector in zip(matrices, vectors, strict=True):
        log3(matrix, vector)
    return vectors[:, part].reshape(full[0].shape)
