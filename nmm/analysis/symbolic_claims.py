"""What follows from the minors: where J loses rank, how far it stays from it, which minors never vanish.

Each claim carries its proof, or says that there is none.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from nmm.analysis.symbolic import SymbolicAnalysis
from nmm.analysis.symbolic_ideal import Ideal
from nmm.analysis.symbolic_tree import Product, Sum, Symbol, text, to_sympy
from nmm.analysis.symbolic_words import minor_name


def _bars(expression: Any) -> str:
    return re.sub(r"Abs\((\w+)\)", r"|\1|", str(expression))


@dataclass(frozen=True)
class Claim:
    """A statement, whether it is proved, and the steps.

    Attributes
    ----------
    statement : one sentence
    proved : whether the steps are a proof; if not, `statement` says what was not decided
    steps : one sentence each
    conditions : expressions that all vanish in the statement's exceptional set; none when it is empty
    """

    statement: str
    proved: bool
    steps: tuple[str, ...]
    conditions: tuple[Any, ...] = ()


@dataclass(frozen=True)
class Bound:
    """Conditions on the lengths under which a minor vanishes nowhere.

    Attributes
    ----------
    columns : the minor's
    requires : pairs (a, b) of expressions; |a| > b has to hold for each
    nonzero : lengths that must not be 0
    """

    columns: tuple[str, ...]
    requires: tuple[tuple[Any, Any], ...]
    nonzero: tuple[str, ...]

    def __str__(self) -> str:
        parts = [f"|{a}| > {_bars(b)}" for a, b in self.requires]
        parts += [f"{name} != 0" for name in self.nonzero]
        return f"{minor_name(self.columns)} vanishes nowhere" + (
            f" when {' and '.join(parts)}" if parts else ""
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
        return nonzero and all(abs(a) > b for a, b in numbers)


def singular_set(analysis: SymbolicAnalysis) -> Claim:
    """Where J loses rank, for all values of the lengths that are not zero.

    Candidates are the factors of the minors, and the sines and cosines of the joints in them. One of them
    vanishes wherever all minors do when 1 is in the ideal of the minors, cos² + sin² - 1 and 1 - y times the
    candidate (Nullstellensatz, over the complex numbers, hence over the real ones). Exactly there: each minor
    is in the ideal of the candidates found.
    """
    import sympy

    minors = [minor for minor in analysis.minors.values() if minor != 0]
    s = len(analysis.row_names)
    if not minors:
        return Claim(f"J has rank below {s} everywhere", True, ("every maximal minor is identically 0",))
    ideal = Ideal.of(analysis)
    if ideal is None:
        return Claim("not decided: the minors are too large", False, ())
    where = f"for all nonzero {', '.join(ideal.nonzero)}" if ideal.nonzero else "everywhere"
    shared = _shared_by_all(analysis)
    if not shared and ideal.is_empty():
        step = "1 is a combination of the minors, cos^2 + sin^2 - 1 and 1 - w " + " ".join(ideal.nonzero)
        return Claim(f"J has rank {s} at every configuration, {where}", True, (step,))
    if shared and ideal.is_empty(without=[factor for _, factor in shared]):
        any_of = " or ".join(f"{name} = 0" for name, _ in shared)
        product = sympy.Mul(*(factor for _, factor in shared))
        step = "it divides every minor, and the quotients have no common zero (Nullstellensatz)"
        return Claim(f"J has rank {s} except exactly where {any_of}, {where}", True, (step,), (product,))
    if ideal.is_wide:
        return Claim("not decided: the minors have too many variables", False, ())
    found: list[tuple[str, Any]] = []
    for name, candidate in _candidates(analysis):
        implied = found and Ideal.vanishes_on(analysis, candidate, [c for _, c in found])
        if not implied and ideal.forces(candidate):
            found.append((name, candidate))
    steps = tuple(f"where all minors vanish, {name} = 0 (Nullstellensatz)" for name, _ in found)
    conditions = tuple(candidate for _, candidate in found)
    named = " and ".join(f"{name} = 0" for name, _ in found)
    if not found:
        return Claim("not decided: no factor vanishes wherever J loses rank", False, steps)
    if all(Ideal.vanishes_on(analysis, minor, list(conditions)) for minor in minors):
        steps += ("where these are 0, every minor is 0 (each is in their ideal)",)
        return Claim(f"J has rank {s} except exactly where {named}, {where}", True, steps, conditions)
    statement = (
        f"J has rank {s} except at most where {named}, {where}; whether it loses rank there is not decided"
    )
    return Claim(statement, True, steps, conditions)


def lower_bound(analysis: SymbolicAnalysis) -> Claim | None:
    """det J Jᵀ >= C² / Σ a² by Cauchy and Schwarz, where Σ a Δ = C without coordinates; None without one.

    A C that is a product of lengths proves that J never loses rank.
    """
    if analysis.divided:
        return None
    import sympy

    columns = [key for key, value in analysis.numerators.items() if value]
    ring = next(iter(analysis.numerators.values())).ring
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
    if not columns:
        return None
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
        written = " ".join(
            f"{'-' if w < 0 else '+'} {'' if abs(w) == 1 else f'{abs(w)} '}{minor_name(n)}" for w, n in used
        )
        C = text(constant)
        C = C if C.isidentifier() else f"({C})"
        over = "" if square == 1 else f"/{square}"
        return Claim(
            f"det J J^T >= {C}^2{over} at every configuration",
            True,
            (
                f"{written.removeprefix('+ ')} = {C}, whatever q is",
                f"so the squares of these minors sum to at least {C}^2{over} (Cauchy and Schwarz)",
                "det J J^T is the sum of the squares of all maximal minors (Cauchy and Binet)",
            ),
            (to_sympy(constant, analysis.symbols),),
        )
    return None


def never_zero(analysis: SymbolicAnalysis) -> dict[tuple[str, ...], Bound]:
    """The minors that vanish nowhere under a condition on the lengths (sufficient), and the condition.

    A factor that is a sum vanishes nowhere when its term without coordinates is larger than what the others
    can reach, cosines and sines being at most 1. A minor with a cosine or sine as a factor is not listed.
    """
    found = {}
    for columns, form in analysis.minor_forms.items():
        if not form.number:
            continue
        requires, nonzero = [], []
        for factor, power in form.factors:
            if power < 0:
                continue
            if isinstance(factor, Symbol) and factor.name in analysis.geometry:
                nonzero.append(factor.name)
                continue
            condition = _condition(factor, analysis) if isinstance(factor, Sum) else None
            if condition is None:
                break
            requires.append(condition)
        else:
            found[columns] = Bound(columns, tuple(requires), tuple(nonzero))
    return found


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
    import sympy

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


def _shared_by_all(analysis: SymbolicAnalysis) -> list[tuple[str, Any]]:
    """Factors, lengths apart, that every minor has which is not 0."""
    forms = [form for form in analysis.minor_forms.values() if form.number]
    shared = [
        factor
        for factor, power in forms[0].factors
        if power > 0
        and not isinstance(factor, Symbol)
        and all(dict(form.factors).get(factor, 0) > 0 for form in forms)
    ]
    alone = [Product(Fraction(1), ((factor, 1),)) for factor in shared]
    return [(text(product), to_sympy(product, analysis.symbols)) for product in alone]


def _candidates(analysis: SymbolicAnalysis) -> list[tuple[str, Any]]:
    """Expressions that may vanish on the singular set, simple ones first: sines, cosines, then factors."""
    import sympy

    names = list(analysis.symbols)
    minors = [minor for minor in analysis.minors.values() if minor != 0]
    waves = {wave for minor in minors for wave in minor.atoms(sympy.sin, sympy.cos)}
    angles = sorted({a for wave in waves for a in wave.free_symbols}, key=lambda a: names.index(str(a)))
    found: dict[Any, str] = {}
    for angle in angles:
        found[sympy.sin(angle)] = f"sin({angle})"
        found[sympy.cos(angle)] = f"cos({angle})"
    for form in analysis.minor_forms.values():
        for factor, power in form.factors:
            if power > 0 and not isinstance(factor, Symbol):
                alone = Product(Fraction(1), ((factor, 1),))
                found.setdefault(to_sympy(alone, analysis.symbols), text(alone))
    return [(name, candidate) for candidate, name in found.items()]
