"""f, J = (∂f/∂q) S and its maximal minors as formulas, derived joint by joint from the robot itself."""

from __future__ import annotations

import importlib
import itertools
import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Literal

from nmm.analysis.formulas.arguments import argument_names
from nmm.analysis.formulas.derivation import Derivation, derived
from nmm.analysis.formulas.expansion import Expansion, Ring, TooLarge, maximal_minors
from nmm.analysis.formulas.form import factored, in_names, named
from nmm.analysis.formulas.functions import SymbolicFunctions
from nmm.analysis.formulas.geometry import Geometry
from nmm.analysis.formulas.row import Turn
from nmm.analysis.formulas.rows import frames_of
from nmm.analysis.formulas.tree import Product, to_sympy
from nmm.analysis.formulas.value import Written, auxiliary_written, matrix_latex, matrix_text, written
from nmm.analysis.formulas.words import latex_of, text_of
from nmm.analysis.singular.reached import Tasks, stacked
from nmm.errors import InputError, unknown
from nmm.robots.robot import Robot

__all__ = ["SymbolicAnalysis", "TooLarge", "symbolic"]

#: Products of terms that an analysis may take: some seconds.
BUDGET = 200_000


@dataclass(frozen=True, eq=False)
class SymbolicAnalysis:
    """Formulas of one robot and task. Angles are in rad, lengths in m; all symbols are real.

    Attributes
    ----------
    robot : the robot
    row_names, u_names : names of J's rows (s) and columns (m)
    symbols : SymPy symbol of every coordinate, length, fixed angle and auxiliary quantity, by name
    geometry : the robot's own values of the lengths and fixed angles, by name
    values : the rows of f, each as expression, text and LaTeX
    entry_forms, minor_forms : J's entries and the minors in factors (`symbolic_tree.Product`)
    named_forms, short_forms, short_entries : factors with a name; minors and entries in these names
    definitions : what auxiliary symbols are, such as rho and g of a bearing
    definition_texts, definition_latex : the same as text and LaTeX, and the matrix of a rotation vector
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
    short_entries: tuple[tuple[Product, ...], ...] = field(repr=False)
    minor_forms: Mapping[tuple[str, ...], Product] = field(repr=False)
    named_forms: Mapping[str, Product] = field(repr=False)
    short_forms: Mapping[tuple[str, ...], Product] = field(repr=False)
    definitions: Mapping[str, Any] = field(repr=False)
    definition_texts: Mapping[str, str] = field(repr=False)
    definition_latex: Mapping[str, str] = field(repr=False)
    numerators: Mapping[tuple[str, ...], Expansion] = field(repr=False)
    derivation: Derivation = field(repr=False)
    notes: tuple[str, ...] = ()

    @cached_property
    def q(self) -> dict[str, Any]:
        """The coordinates' symbols, by name."""
        return {name: self.symbols[name] for name in self.robot.q_names}

    @cached_property
    def f(self) -> Any:
        """Task value, (s, 1); an angle is not wrapped."""
        import sympy

        return sympy.Matrix([value.expression for value in self.values])

    @cached_property
    def J(self) -> Any:
        """Matrix (s, m) of J u = rate; with a reference that depends on q, J_bar of eq. 13."""
        import sympy

        return sympy.Matrix([[to_sympy(entry, self.symbols) for entry in row] for row in self.entry_forms])

    @cached_property
    def minors(self) -> dict[tuple[str, ...], Any]:
        """Every maximal minor in factors, by the names of its columns, in the order of the inputs."""
        return {columns: to_sympy(form, self.symbols) for columns, form in self.minor_forms.items()}

    @cached_property
    def named(self) -> dict[str, Any]:
        """Factors that several minors have (the paper's Λ), by name."""
        return {name: to_sympy(form, self.symbols) for name, form in self.named_forms.items()}

    def minor(self, *columns: str) -> Any:
        """One minor by the names of its columns, in any order (which gives the sign).

        Raises
        ------
        InputError : another number of names than rows, a name twice, or one that is no input
        """
        for name in columns:
            if name not in self.u_names:
                raise InputError(unknown("input", name, self.u_names, f"robot {self.robot.name}"))
        s = len(self.row_names)
        if len(columns) != s or len(set(columns)) != s:
            raise InputError(f"minor: expected {s} different inputs, got {', '.join(columns)}")
        order = [self.u_names.index(name) for name in columns]
        swaps = sum(a > b for a, b in itertools.combinations(order, 2))
        return (-1) ** swaps * self.minors[tuple(self.u_names[j] for j in sorted(order))]

    @property
    def divided(self) -> bool:
        """Whether J has denominators that may vanish."""
        return any(one.variables() for one in self.denominators)

    @property
    def denominators(self) -> list[Expansion]:
        """What J's rows and columns are divided by."""
        return [*self.derivation.row_denominators, *self.derivation.column_denominators]

    def without(self, *lengths: str) -> SymbolicAnalysis:
        """The same with lengths set to 0: what changes where d = 0.

        Raises
        ------
        InputError : a name that is no length of `geometry`, or one that J is divided by
        """
        with _reason(self.robot, len(self.row_names), self.derivation.ring):
            return _assembled(self.robot, self.row_names, self.derivation.without(lengths))

    def functions(self) -> SymbolicFunctions:
        """f, J and the minors as numpy functions of q."""
        return SymbolicFunctions(self)

    def text(self) -> str:
        """f, J and the minors as plain text; c12 is cos(q1 + q2)."""
        return text_of(self)

    def latex(self) -> str:
        """The same as LaTeX, one align* environment."""
        return latex_of(self)


def symbolic(
    robot: Robot,
    task: Tasks,
    *,
    geometry: Literal["symbols", "numbers"] = "symbols",
    arguments: Mapping[str, str] | None = None,
) -> SymbolicAnalysis:
    """Derive f, J and all maximal minors of J as formulas.

    Parameters
    ----------
    robot : on any platform but one described by its wheels
    task : functions of `nmm.functions.tasks` but a user's own, or tasks made of them, one or several. A
        task's reference counts where it depends on the configuration (`Bearing` of a `Position`, or one of
        these functions): J is then J_bar = (∂f/∂q - ∂g/∂q) S (paper, eq. 13). `Orientation` and `Pose` are
        taken without a reference: J is that of the error 0, velocities in the frame's own axes
    geometry : "symbols" for the robot's lengths that are not zero, or "numbers"
    arguments : names for lengths by their label, {"x_q2": "l1"} for the offset of joint q2 along x; by
        default the names of the xacro file's arguments, for which the file is read again

    Raises
    ------
    TooLarge : (an InputError) the formulas would be too long to read
    InputError : SymPy is not installed, a function or platform without a formula here, more rows than inputs
    """
    try:
        importlib.import_module("sympy")
    except ImportError:
        raise InputError("symbolic: needs SymPy: pip install nmm[symbolic]") from None
    if geometry not in ("symbols", "numbers"):
        raise InputError(unknown("geometry", geometry, ("symbols", "numbers")))
    stack = stacked(task)
    if len(stack.rows(robot)) > robot.n_u:
        raise InputError(
            f"symbolic: expected a task of at most {robot.n_u} rows, as {robot.name} has inputs, "
            f"got {len(stack.rows(robot))}"
        )
    demanded = arguments is not None
    if arguments is None:
        every = [f for task in stack for f in (task.function, task.reference)]
        arguments = argument_names(robot, frames_of(every)) if geometry == "symbols" else {}
    lengths = Geometry(Ring(BUDGET), arguments, demanded, geometry == "numbers", robot.q_names)
    names = tuple(row.name for row in stack.rows(robot))
    with _reason(robot, len(names), lengths.ring):
        return _assembled(robot, names, derived(robot, stack, lengths))


@contextmanager
def _reason(robot: Robot, s: int, ring: Ring) -> Iterator[None]:
    """`TooLarge` says of what, and why."""
    try:
        yield
    except TooLarge:
        angles = zip(ring.names, ring.is_angle, strict=True)
        general = [name for name, angle in angles if angle and name not in robot.q_names]
        why = "so many joints"
        if general:
            few = f"{', '.join(general[:3])}{', ...' if general[3:] else ''}"
            why += f" with general angles between their axes ({few})"
        raise TooLarge(
            f"symbolic: too large: {robot.name} with {robot.n_u} inputs and a task of {s} rows "
            f"({math.comb(robot.n_u, s)} minors): {why} make formulas too long to be read; use the numeric "
            "analysis, a task of fewer rows, or lock joints"
        ) from None


def _assembled(robot: Robot, row_names: tuple[str, ...], derivation: Derivation) -> SymbolicAnalysis:
    """The formulas of a derivation."""
    import sympy

    ring, rows, columns = derivation.ring, derivation.row_denominators, derivation.column_denominators
    numbers = maximal_minors([list(line) for line in derivation.matrix])
    entries = tuple(
        tuple(_quotient(entry, [row, column]) for entry, column in zip(line, columns, strict=True))
        for line, row in zip(derivation.matrix, rows, strict=True)
    )
    keys = {picked: tuple(robot.u_names[j] for j in picked) for picked in numbers}
    minors = {
        key: _quotient(numbers[picked], [*rows, *(columns[j] for j in picked)])
        for picked, key in keys.items()
    }
    names, short = named(list(minors.values()), {*ring.names, *robot.q_names}, derivation.lengths)
    symbols = {name: sympy.Symbol(name, real=True) for name in (*robot.q_names, *ring.names, *names)}
    meanings = {one.name: auxiliary_written(one, symbols) for one in derivation.auxiliaries}
    turns = {value.name: value for value in derivation.values if isinstance(value, Turn)}
    return SymbolicAnalysis(
        robot=robot,
        row_names=row_names,
        u_names=robot.u_names,
        symbols=symbols,
        geometry=derivation.lengths,
        values=tuple(written(value, symbols) for value in derivation.values),
        entry_forms=entries,
        short_entries=tuple(tuple(in_names(entry, names) for entry in line) for line in entries),
        minor_forms=minors,
        named_forms=names,
        short_forms=dict(zip(minors, short, strict=True)),
        definitions={name: one.expression for name, one in meanings.items()},
        definition_texts={name: one.text for name, one in meanings.items()}
        | {name: matrix_text(turn) for name, turn in turns.items()},
        definition_latex={name: one.latex for name, one in meanings.items()}
        | {name: matrix_latex(turn) for name, turn in turns.items()},
        numerators={key: numbers[picked] for picked, key in keys.items()},
        derivation=derivation,
        notes=derivation.notes,
    )


def _quotient(value: Expansion, divisors: list[Expansion]) -> Product:
    """A value over its divisors, common factors cancelled."""
    result = factored(value)
    if not result.number:
        return result
    for divisor in divisors:
        if divisor != divisor.ring.number(1):
            below = factored(divisor)
            result = result.times(Product(1 / below.number, tuple((f, -n) for f, n in below.factors)))
    return result
