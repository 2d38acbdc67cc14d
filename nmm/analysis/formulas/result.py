"""What is derived of one robot and task: formulas in factors, and the same as SymPy's expressions."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import sympy

from nmm.analysis.formulas.derivation import Derivation
from nmm.analysis.formulas.expansion import Expansion
from nmm.analysis.formulas.expressions import Product, to_sympy
from nmm.analysis.formulas.written import Written
from nmm.errors import InputError, expect_known
from nmm.robots.robot import Robot


@dataclass(frozen=True, eq=False)
class Formulas:
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
        """Factors that several minors have (the paper's Λ), by name."""
        return {name: to_sympy(form, self.symbols) for name, form in self.named_forms.items()}

    def minor(self, *columns: str) -> Any:
        """One minor by the names of its columns, in any order (which gives the sign).

        Raises
        ------
        InputError : another number of names than rows, a name twice, or one that is no input
        """
        for name in columns:
            expect_known("input", name, self.u_names, f"robot {self.robot.name}")
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
