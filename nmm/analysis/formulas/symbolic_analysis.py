"""f, J = (∂f/∂q) S and its maximal minors as formulas, derived joint by joint from the robot itself."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Literal

import numpy as np
import sympy

from nmm.analysis.formulas.arguments import argument_names
from nmm.analysis.formulas.derivation import Derivation, derived
from nmm.analysis.formulas.expansion import Expansion, Ring, TooLarge, maximal_minors
from nmm.analysis.formulas.expressions import Product
from nmm.analysis.formulas.functions import SymbolicFunctions
from nmm.analysis.formulas.geometry import Geometry
from nmm.analysis.formulas.readable import factored, in_names, named
from nmm.analysis.formulas.result import Formulas
from nmm.analysis.formulas.row_values import Turn
from nmm.analysis.formulas.task_rows import frames_of
from nmm.analysis.formulas.text import latex_of, text_of
from nmm.analysis.formulas.written import auxiliary_written, matrix_latex, matrix_text, written
from nmm.analysis.singular.jacobians import Jacobians
from nmm.analysis.singular.reached import Tasks, stacked
from nmm.errors import InputError, SingularError, expect_known
from nmm.functions.tasks.task import Stack
from nmm.robots.robot import Robot

__all__ = ["SymbolicAnalysis", "TooLarge", "symbolic"]

#: Products of terms that an analysis may take: some seconds.
BUDGET = 200_000
#: Where a formula is compared with its kernel, if that branches; what a file's rounded angles may do to it.
_PLACES, _ROUNDED = 10, 1e-3


class SymbolicAnalysis(Formulas):
    """Formulas of one robot and task, with what can be made of them."""

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
    robot : on any platform whose kernel has a formula, as almost all have
    task : functions of the configuration, or tasks made of them, one or several; no Python function of the
        user's. A task's reference counts where it depends on the configuration (`Bearing` of a `Position`,
        or one of these functions): J is then J_bar = (∂f/∂q - ∂g/∂q) S (paper, eq. 13). `Orientation` and
        `Pose` are taken without a reference: J is that of the error 0, velocities in the frame's own axes
    geometry : "symbols" for the robot's lengths that are not zero, or "numbers"
    arguments : names for lengths by their label, {"x_q2": "l1"} for the offset of joint q2 along x; by
        default the names of the xacro file's arguments, for which the file is read again

    Raises
    ------
    TooLarge : (an InputError) the formulas would be too long to read
    InputError : a function or platform whose kernel does what has no formula, more rows than inputs
    """
    expect_known("geometry", geometry, ("symbols", "numbers"))
    stack = stacked(task)
    if len(stack.rows(robot)) > robot.n_u:
        raise InputError(
            f"symbolic: expected a task of at most {robot.n_u} rows, as {robot.name} has inputs, "
            f"got {len(stack.rows(robot))}"
        )
    demanded = arguments is not None
    if arguments is None:
        every = [f for task in stack for f in (task.function, task.reference)]
        arguments = argument_names(robot, frames_of(every, robot)) if geometry == "symbols" else {}
    lengths = Geometry(Ring(BUDGET), arguments, demanded, geometry == "numbers", robot.q_names)
    names = tuple(row.name for row in stack.rows(robot))
    with _reason(robot, len(names), lengths.ring):
        analysis = _assembled(robot, names, derived(robot, stack, lengths))
    if lengths.ring.branched:
        _check_branches(analysis, stack)
    return analysis


def _check_branches(analysis: SymbolicAnalysis, stack: Stack) -> None:
    """`InputError` when a kernel that branches on the configuration has another formula elsewhere."""
    jacobians, functions = Jacobians((analysis.robot, stack)), analysis.functions()
    for q in np.random.default_rng(0).uniform(-3.0, 3.0, (_PLACES, analysis.robot.n)):
        try:
            J = jacobians.J(0.0, q)
        except SingularError:
            continue
        if not np.allclose(functions.J(q), J, rtol=_ROUNDED, atol=_ROUNDED * np.abs(J).max(initial=1.0)):
            raise InputError(
                "symbolic: expected kernels with one formula, one of these branches on the configuration "
                "(the numeric analysis takes it)"
            )


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
