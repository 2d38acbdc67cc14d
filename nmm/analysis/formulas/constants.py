"""Factors of minors without coordinates: the robot's own lengths and fixed angles say whether they are 0."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from fractions import Fraction
from typing import TYPE_CHECKING

from nmm.analysis.formulas.tree import Node, Product, Symbol, Trig, to_sympy

if TYPE_CHECKING:
    from nmm.analysis.formulas.analysis import SymbolicAnalysis

#: What rounding and the digits of a file leave of zero.
NOTHING = 1e-9


def is_constant(factor: Node, lengths: Collection[str]) -> bool:
    """Whether a factor is made of lengths and fixed angles alone."""
    if isinstance(factor, Symbol):
        return factor.name in lengths
    if isinstance(factor, Trig):
        return all(name in lengths for name, _ in factor.angle)
    return all(is_constant(inner, lengths) for term in factor.terms for inner, _ in term.factors)


def constants(
    forms: Iterable[Product], analysis: SymbolicAnalysis
) -> tuple[dict[Product, None], dict[Product, None]]:
    """Constant sums, cosines and sines among the factors: not 0 for this robot, and 0 for it."""
    nonzero: dict[Product, None] = {}
    zero: dict[Product, None] = {}
    values = {analysis.symbols[name]: value for name, value in analysis.geometry.items()}
    for form in forms:
        for factor, _ in form.factors:
            if isinstance(factor, Symbol) or not is_constant(factor, analysis.geometry):
                continue
            alone = Product(Fraction(1), ((factor, 1),))
            value = float(to_sympy(alone, analysis.symbols).subs(values))
            (zero if abs(value) < NOTHING else nonzero)[alone] = None
    return nonzero, zero
