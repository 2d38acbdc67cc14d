"""f, J = (∂f/∂q) S and its maximal minors as formulas, derived joint by joint from the robot itself."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Literal

from nmm.analysis.reached import Tasks, stacked
from nmm.analysis.symbolic_arguments import argument_names
from nmm.analysis.symbolic_expansion import Expansion, Ring, TooLarge, determinant
from nmm.analysis.symbolic_form import factored, in_names, named
from nmm.analysis.symbolic_functions import SymbolicFunctions
from nmm.analysis.symbolic_geometry import Geometry
from nmm.analysis.symbolic_platforms import platform_columns
from nmm.analysis.symbolic_rows import Frames, SymbolicRow, bearing_suffix, frames_of, task_rows
from nmm.analysis.symbolic_tree import Product, to_sympy
from nmm.analysis.symbolic_value import Written, written
from nmm.analysis.symbolic_words import latex_of, text_of
from nmm.errors import InputError, unknown
from nmm.robot import Robot

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
    definition_texts : the same as text
    numerators : the minors times J's denominators, multiplied out
    divided : whether J has denominators
    notes : what was rounded
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
    numerators: Mapping[tuple[str, ...], Expansion] = field(repr=False)
    divided: bool
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
    robot : a robot on a unicycle, differential, car, front_drive_car, omnidirectional platform or fixed base
    task : functions (`Position`, `Heading`, `Coordinates`, `Posture`) or tasks made of them, one or several.
        A task's reference counts where it depends on the configuration (`Bearing` of a `Position`, or one of
        these functions): J is then J_bar = (∂f/∂q - ∂g/∂q) S (paper, eq. 13)
    geometry : "symbols" for the robot's lengths that are not zero, or "numbers"
    arguments : names for lengths by their label, {"x_q2": "l1"} for the offset of joint q2 along x; by
        default the names of the xacro file's arguments, for which the file is read again

    Raises
    ------
    TooLarge : (an InputError) the formulas would be too long to read
    InputError : SymPy is not installed, a function or platform without a formula here, more rows than inputs
    """
    try:
        import sympy
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
    if arguments is None:
        arguments = {}
        if geometry == "symbols":
            every = [f for task in stack for f in (task.function, task.reference)]
            arguments = argument_names(robot, frames_of(every))
    ring = Ring(BUDGET)
    lengths = Geometry(ring, arguments, geometry == "numbers")
    frames = Frames(robot, lengths)
    plain, controlled = task_rows(stack, frames)
    J, denominators, column_denominators = _matrix(controlled, frames)
    entries = tuple(
        tuple(
            _quotient(entry, [row, column]) for entry, column in zip(line, column_denominators, strict=True)
        )
        for line, row in zip(J, denominators, strict=True)
    )
    minors: dict[tuple[str, ...], Product] = {}
    numerators: dict[tuple[str, ...], Expansion] = {}
    for columns in itertools.combinations(range(robot.n_u), len(J)):
        value = determinant([[line[j] for j in columns] for line in J])
        divisors = [*denominators, *(column_denominators[j] for j in columns)]
        key = tuple(robot.u_names[j] for j in columns)
        numerators[key], minors[key] = value, _quotient(value, divisors)
    names, short = named(list(minors.values()))
    symbols = {name: sympy.Symbol(name, real=True) for name in (*robot.q_names, *ring.names, *names)}
    values = tuple(written(row.value, symbols) for row in plain)
    definitions, texts = _definitions(frames, symbols)
    return SymbolicAnalysis(
        robot=robot,
        row_names=tuple(row.name for row in stack.rows(robot)),
        u_names=robot.u_names,
        symbols=symbols,
        geometry=lengths.values,
        values=values,
        entry_forms=entries,
        short_entries=tuple(tuple(in_names(entry, names) for entry in line) for line in entries),
        minor_forms=minors,
        named_forms=names,
        short_forms=dict(zip(minors, short, strict=True)),
        definitions=definitions,
        definition_texts=texts,
        numerators=numerators,
        divided=any(divisor != ring.number(1) for divisor in (*denominators, *column_denominators)),
        notes=tuple(dict.fromkeys(lengths.notes)),
    )


def _matrix(
    rows: list[SymbolicRow], frames: Frames
) -> tuple[list[list[Expansion]], list[Expansion], list[Expansion]]:
    """(∂f/∂q) S times a denominator for each row and column, and these denominators."""
    platform, ring = frames.robot.platform, frames.geometry.ring
    G, column_denominators = platform_columns(platform, frames.geometry)
    n_p, p = platform.n_p, platform.p
    matrix = []
    for row in rows:
        moved = []
        for j in range(p):
            total = ring.number(0)
            for i in range(n_p):
                if G[i][j] and row.gradient[i]:
                    total = total + row.gradient[i] * G[i][j]
            moved.append(total)
        matrix.append(moved + row.gradient[n_p:])
    ones = [ring.number(1)] * (frames.robot.n - n_p)
    return matrix, [row.denominator for row in rows], column_denominators + ones


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


def _definitions(frames: Frames, symbols: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, str]]:
    """rho and g of each bearing: T - p = rho (cos g, sin g)."""
    import sympy

    expressions: dict[str, Any] = {}
    texts: dict[str, str] = {}
    ring = frames.geometry.ring
    for i, (x, y, to_x, to_y) in enumerate(frames.bearings, 1):
        dx, dy = (written(ring.number(to) - at, symbols) for to, at in ((to_x, x), (to_y, y)))
        rho, g = (f"{name}{bearing_suffix(i)}" for name in ("rho", "g"))
        expressions[rho] = sympy.sqrt(dx.expression**2 + dy.expression**2)
        expressions[g] = sympy.atan2(dy.expression, dx.expression)
        texts[rho], texts[g] = f"hypot({dx.text}, {dy.text})", f"atan2({dy.text}, {dx.text})"
    return expressions, texts
