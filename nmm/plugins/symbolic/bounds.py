"""How far J stays from losing rank; which minors vanish nowhere, and which always vanish somewhere."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import sympy
from sympy.printing.str import StrPrinter

from nmm.base.findings import Finding
from nmm.base.latex import Formula, formula, linear_formula, minor_name, symbol
from nmm.plugins.symbolic.claims import NOTHING, RankClaim
from nmm.plugins.symbolic.expressions import Product, Sum, Symbol, Trig, alone, inline, is_constant, to_sympy
from nmm.plugins.symbolic.readable import condition, expanded
from nmm.plugins.symbolic.symbolic_analysis import SymbolicAnalysis


@dataclass(frozen=True)
class NonzeroMinor:
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
        return str(self.finding())

    def finding(
        self,
        values: Mapping[str, float] | None = None,
        moving: Collection[str] = (),
        units: Mapping[str, str] | None = None,
    ) -> Finding:
        """The bound as a finding, with whether it holds for lengths `values`, in m unless `units` says
        otherwise; `moving` are quantities that depend on the configuration and are never negative."""
        known = values or {}
        larger: list[tuple[Formula, Formula | None]] = []
        for a, b in self.requires:
            left = sympy_formula(a, known)
            size = left if b == 0 or left in moving else formula("|", left, "|")
            larger.append((size, sympy_formula(b, known) if b != 0 else None))
        fields: dict[str, Any] = {"minor": self.columns, "larger": larger}
        fields |= {"nonzero": self.nonzero, "exact": self.exact}
        if values is not None and (larger or self.nonzero):
            names = self._names
            fields["holds"] = self.holds(values)
            if fields["holds"] is None:
                fields["through"] = [name for name in moving if name in names]
            else:
                used, units = (name for name in values if name in names), units or {}
                fields["here"] = {name: (values[name], units.get(name, "m")) for name in used}
        return Finding("minor_never_zero", fields)

    def reasons(self, values: Mapping[str, float]) -> tuple[Finding, ...]:
        """The proof, "terms_bounded"; empty where lengths only have to differ from 0."""
        terms = [
            tuple(sympy_formula(side, values) for side in pair) for pair in self.requires if pair[1] != 0
        ]
        return (Finding("terms_bounded", {"terms": terms}),) if terms else ()

    @property
    def _names(self) -> set[str]:
        names = {str(symbol) for pair in self.requires for side in pair for symbol in side.free_symbols}
        return names | set(self.nonzero)

    def holds(self, values: Mapping[str, float]) -> bool | None:
        """Whether the conditions hold for these values; None when they involve further quantities."""
        if not self._names <= set(values):
            return None
        numbers = [
            [float(part.subs({s: values[str(s)] for s in part.free_symbols})) for part in pair]
            for pair in self.requires
        ]
        nonzero = all(values[name] != 0.0 for name in self.nonzero)
        return nonzero and all(abs(a) > (b or NOTHING) for a, b in numbers)


def sympy_formula(expression: Any, values: Mapping[str, float]) -> Formula:
    """Format a SymPy expression; |l1| is written l1 where l1 is above 0."""
    plain = expression.replace(
        sympy.Abs, lambda of: of if values.get(str(of), -1.0) > 0.0 else sympy.Abs(of, evaluate=False)
    )
    names = {leaf: symbol(str(leaf)).latex for leaf in plain.free_symbols}
    text = _Text().doprint(plain).replace("**", "^").replace("*", " ")
    return Formula(text, sympy.latex(plain, symbol_names=names, fold_short_frac=True))


class _Text(StrPrinter):
    def _print_Abs(self, of: Any) -> str:
        return f"|{self._print(of.args[0])}|"


def lower_bound(analysis: SymbolicAnalysis) -> RankClaim | None:
    """det J Jᵀ >= C² / Σ a² by Cauchy and Schwarz, where Σ a Δ = C has no coordinates; None without such a C.

    If C is a product of lengths, J never loses rank.
    """
    derivation, ring = analysis.derivation, analysis.derivation.ring
    if any(denominator.variables() for denominator in derivation.row_denominators):
        return None
    below = zip(analysis.u_names, derivation.column_denominators, strict=True)
    divided = {name for name, denominator in below if denominator.variables()}
    columns = [key for key, value in analysis.numerators.items() if value and divided.isdisjoint(key)]
    if not columns:
        return None
    moving = {i for i, name in enumerate(ring.names) if ring.is_angle[i] or name not in analysis.geometry}
    terms = [analysis.numerators[name].terms for name in columns]
    keys = sorted({key for poly in terms for key in poly if any(i in moving for i, _ in key)})
    rows = [
        [sympy.Rational(*poly[key][part].as_integer_ratio()) if key in poly else 0 for poly in terms]
        for key in keys
        for part in (0, 1)
    ]
    matrix = sympy.Matrix(rows or [[0] * len(columns)])
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
        combination = linear_formula((w, minor_name(name)) for w, name in used)
        over = Fraction(int(square.p), int(square.q))
        bound = inline(Product(number**2 / over, tuple((f, 2 * n) for f, n in constant.factors)))
        steps = (
            Finding("combination_constant", {"combination": combination, "constant": inline(constant)}),
            Finding("squares_bounded", {"bound": bound, "count": len(used)}),
            Finding("cauchy_binet"),
        )
        return RankClaim(
            Finding("gram_bound", {"bound": bound}), steps, (to_sympy(constant, analysis.symbols),)
        )
    return None


def never_zero(analysis: SymbolicAnalysis) -> dict[tuple[str, ...], NonzeroMinor]:
    """The minors that vanish nowhere under a condition on the lengths, and the condition.

    A factor that is a sum vanishes nowhere if its term without coordinates exceeds the sum of the others'
    bounds, with cosines and sines at most 1; otherwise it vanishes somewhere, if each reaches its bound
    independently. A minor with a cosine or sine as a factor is not listed.
    """
    bounds = {}
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
            bounds[columns] = NonzeroMinor(columns, tuple(requires), tuple(nonzero), exact)
    return bounds


def vanishing(analysis: SymbolicAnalysis) -> dict[tuple[str, ...], Finding]:
    """The minors that vanish somewhere whatever the lengths, and why, "minor_vanishing".

    Joint limits are ignored. Such a minor is 0, or has as a factor a coordinate, a cosine or sine, or a sum
    whose mean over all angles is 0, which takes both signs and so 0 between them.
    """
    findings: dict[tuple[str, ...], Finding] = {}

    def add(columns: tuple[str, ...], **values: Any) -> None:
        findings[columns] = Finding("minor_vanishing", {"minor": columns, **values})

    for columns, form in analysis.minor_forms.items():
        if not form.number:
            add(columns)
        for factor, power in form.factors:
            if power > 0 and isinstance(factor, Symbol) and factor.name in analysis.q:
                add(columns, factor=symbol(factor.name))
            if power < 0 or isinstance(factor, Symbol):
                continue
            value, ring = expanded(alone(factor), analysis.derivation.ring), analysis.derivation.ring
            names = {ring.names[i] for i in value.variables()}
            if not names <= {*analysis.geometry, *_angles(analysis)}:
                continue
            if not value.without({ring.names.index(name) for name in _angles(analysis)}):
                of = condition(alone(factor), analysis.named_forms)
                add(columns, factor=of, mean_zero=not isinstance(factor, Trig))
                break
    return findings


def _angles(analysis: SymbolicAnalysis) -> list[str]:
    units = zip(analysis.robot.q_names, analysis.robot.q_units, strict=True)
    return [name for name, unit in units if unit == "rad"]


def _attained(factor: Sum, analysis: SymbolicAnalysis) -> bool:
    """Whether the terms with coordinates, a cosine or sine each, reach all values from -1 to 1 independently:
    the combinations of coordinates in them are linearly independent."""
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
    """The constant term and the bound of the others; None without a constant term or a bound."""
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
    """The largest absolute value of a term; None where a coordinate in it has no bound."""
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
