"""How far J stays from losing rank; which minors vanish nowhere, and which do somewhere in any case."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import sympy

from nmm.analysis.formulas.claims import NOTHING, Claim
from nmm.analysis.formulas.expressions import Product, Sum, Symbol, Trig, alone, is_constant, text, to_sympy
from nmm.analysis.formulas.readable import condition_text, expanded
from nmm.analysis.formulas.symbolic_analysis import SymbolicAnalysis
from nmm.analysis.singular.minors import minor_name
from nmm.words import signed_sum


@dataclass(frozen=True)
class Bound:
    """Conditions on the lengths under which a minor vanishes nowhere.

    Attributes
    ----------
    columns : the minor's
    requires : pairs (a, b) of expressions; |a| > b has to hold for each; b is 0 for a sum of lengths alone
    nonzero : lengths that must not be 0
    exact : whether the minor vanishes somewhere when the conditions do not hold
    """

    columns: tuple[str, ...]
    requires: tuple[tuple[Any, Any], ...]
    nonzero: tuple[str, ...]
    exact: bool = False

    def __str__(self) -> str:
        parts = [f"|{a}| > {_bars(b)}" if b != 0 else f"{a} != 0" for a, b in self.requires]
        parts += [f"{name} != 0" for name in self.nonzero]
        return f"{minor_name(self.columns)} vanishes nowhere" + (
            f" {'exactly when' if self.exact else 'when'} {' and '.join(parts)}" if parts else ""
        )

    def holds(self, values: Mapping[str, float]) -> bool | None:
        """Whether the conditions hold for these values; None when they speak of more than these."""
        known = all(str(s) in values for pair in self.requires for part in pair for s in part.free_symbols)
        if not known or not set(self.nonzero) <= set(values):
            return None
        numbers = [
            [float(part.subs({s: values[str(s)] for s in part.free_symbols})) for part in pair]
            for pair in self.requires
        ]
        nonzero = all(values[name] != 0.0 for name in self.nonzero)
        return nonzero and all(abs(a) > (b or NOTHING) for a, b in numbers)


def _bars(expression: Any) -> str:
    return re.sub(r"Abs\((\w+)\)", r"|\1|", str(expression))


def lower_bound(analysis: SymbolicAnalysis) -> Claim | None:
    """det J Jᵀ >= C² / Σ a² by Cauchy and Schwarz, where Σ a Δ = C without coordinates; None without one.

    A C that is a product of lengths proves that J never loses rank.
    """
    derivation, ring = analysis.derivation, analysis.derivation.ring
    if any(one.variables() for one in derivation.row_denominators):
        return None
    divided = {
        name
        for name, one in zip(analysis.u_names, derivation.column_denominators, strict=True)
        if one.variables()
    }
    columns = [key for key, value in analysis.numerators.items() if value and divided.isdisjoint(key)]
    if not columns:
        return None
    keys = {
        key
        for name in columns
        for key in analysis.numerators[name].terms
        if any(ring.is_angle[i] or ring.names[i] not in analysis.geometry for i, _ in key)
    }
    rows = [
        [
            Fraction(0) if (v := analysis.numerators[name].terms.get(key)) is None else v[part]
            for name in columns
        ]
        for key in sorted(keys)
        for part in (0, 1)
    ]
    matrix = sympy.Matrix(
        [[sympy.Rational(v.numerator, v.denominator) for v in row] for row in rows] or [[0] * len(columns)]
    )
    for vector in sorted(matrix.nullspace(), key=lambda v: sum(bool(entry) for entry in v)):
        total = ring.number(0)
        for name, weight in zip(columns, vector, strict=True):
            total = total + analysis.numerators[name].scaled(Fraction(int(weight.p), int(weight.q)))
        if not total or len(total.terms) != 1:
            continue
        if next(iter(total.terms.values()))[0] < 0:
            total, vector = -total, -vector
        ((key, (number, _)),) = total.terms.items()
        constant = Product(number, tuple((Symbol(ring.names[i]), n) for i, n in key))
        square = sum(weight**2 for weight in vector)
        used = [(w, name) for name, w in zip(columns, vector, strict=True) if w]
        written = signed_sum((w, f"{'' if abs(w) == 1 else f'{abs(w)} '}{minor_name(n)}") for w, n in used)
        over = Fraction(int(square.p), int(square.q))
        bound = text(Product(number**2 / over, tuple((f, 2 * n) for f, n in constant.factors)))
        return Claim(
            f"det J J^T >= {bound} at every configuration",
            True,
            (
                f"{written} = {text(constant)}, whatever q is",
                f"so the squares of these minors sum to at least {bound} (Cauchy and Schwarz)"
                if len(used) > 1
                else f"so its square is {bound}",
                "det J J^T is the sum of the squares of all maximal minors (Cauchy and Binet)",
            ),
            (to_sympy(constant, analysis.symbols),),
        )
    return None


def never_zero(analysis: SymbolicAnalysis) -> dict[tuple[str, ...], Bound]:
    """The minors that vanish nowhere under a condition on the lengths, and the condition.

    A factor that is a sum vanishes nowhere when its term without coordinates is larger than what the others
    can reach, cosines and sines being at most 1; where each of them can be reached alone, it vanishes
    somewhere otherwise, too. A minor with a cosine or sine as a factor is not listed.
    """
    found = {}
    for columns, form in analysis.minor_forms.items():
        if not form.number:
            continue
        requires, nonzero, exact = [], [], True
        for factor, power in form.factors:
            if power < 0:
                continue
            if isinstance(factor, Symbol) and factor.name in analysis.geometry:
                nonzero.append(factor.name)
                continue
            if is_constant(factor, analysis.geometry):
                requires.append((to_sympy(alone(factor), analysis.symbols), sympy.Integer(0)))
                continue
            condition = _condition(factor, analysis) if isinstance(factor, Sum) else None
            if condition is None:
                break
            requires.append(condition)
            exact = exact and isinstance(factor, Sum) and _attained(factor, analysis)
        else:
            found[columns] = Bound(columns, tuple(requires), tuple(nonzero), exact)
    return found


def vanishing(analysis: SymbolicAnalysis) -> dict[tuple[str, ...], str]:
    """The minors that vanish somewhere whatever the lengths, and why; joint limits are not looked at.

    One that is 0, or has as a factor a coordinate, the cosine or sine of some, or a sum whose mean over all
    angles is 0: it takes both signs, and 0 between them.
    """
    found = {}
    for columns, form in analysis.minor_forms.items():
        if not form.number:
            found[columns] = "it is 0"
        for factor, power in form.factors:
            if power > 0 and isinstance(factor, Symbol) and factor.name in analysis.q:
                found[columns] = f"{factor.name} is a factor"
            if power < 0 or isinstance(factor, Symbol):
                continue
            value, ring = expanded(alone(factor), analysis.derivation.ring), analysis.derivation.ring
            names = {ring.names[i] for i in value.variables()}
            if not names <= {*analysis.geometry, *_angles(analysis)}:
                continue
            if not value.without({ring.names.index(name) for name in _angles(analysis)}):
                said = condition_text(alone(factor), analysis.named_forms)
                found[columns] = (
                    f"{said} is a factor"
                    if isinstance(factor, Trig)
                    else f"its factor {said} has mean 0 over the joint angles, so that it changes its sign"
                )
                break
    return found


def _angles(analysis: SymbolicAnalysis) -> list[str]:
    """The coordinates in rad."""
    units = zip(analysis.robot.q_names, analysis.robot.q_units, strict=True)
    return [name for name, unit in units if unit == "rad"]


def _attained(factor: Sum, analysis: SymbolicAnalysis) -> bool:
    """Whether the terms with coordinates, a cosine or sine each, take any values between -1 and 1 together.

    They do when the combinations of coordinates in them are linearly independent.
    """
    angles = _angles(analysis)
    rows = []
    for term in factor.terms:
        waves = [(f, n) for f, n in term.factors if not isinstance(f, Symbol)]
        if any(isinstance(f, Symbol) and f.name not in analysis.geometry for f, _ in term.factors):
            return False
        if not waves:
            continue
        ((wave, power),) = waves if len(waves) == 1 else ((None, 0),)
        if not isinstance(wave, Trig) or power != 1 or any(name not in angles for name, _ in wave.angle):
            return False
        rows.append([dict(wave.angle).get(name, 0) for name in angles])
    return bool(rows) and sympy.Matrix(rows).rank() == len(rows)


def _condition(factor: Sum, analysis: SymbolicAnalysis) -> tuple[Any, Any] | None:
    """The constant term, and the bound of the others; None without a constant term."""
    constant, reach = 0, 0
    for term in factor.terms:
        if all(isinstance(f, Symbol) and f.name not in analysis.q for f, _ in term.factors):
            constant = constant + to_sympy(term, analysis.symbols)
            continue
        bound = _reach(term, analysis)
        if bound is None:
            return None
        reach = reach + bound
    return (constant, reach) if constant != 0 else None


def _reach(term: Product, analysis: SymbolicAnalysis) -> Any:
    """The largest absolute value that a term may take; None where a coordinate in it has no bound."""
    total = sympy.Rational(abs(term.number).numerator, term.number.denominator)
    for factor, power in term.factors:
        if isinstance(factor, Symbol):
            if factor.name in analysis.q:
                return None
            symbol = analysis.symbols[factor.name]  # a bearing's rho is not below zero
            total *= (symbol if factor.name in analysis.definitions else sympy.Abs(symbol)) ** power
        elif isinstance(factor, Sum):
            parts = [_reach(inner, analysis) for inner in factor.terms]
            if any(part is None for part in parts) or power < 0:
                return None
            total *= sympy.Add(*parts) ** power
    return total
