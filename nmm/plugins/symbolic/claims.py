"""Where J loses rank: a statement with its proof, by cases of which factors of the minors vanish."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import sympy

from nmm.base.findings import Finding
from nmm.base.latex import Formula
from nmm.plugins.symbolic.expressions import (
    Product,
    Symbol,
    Trig,
    alone,
    inline,
    is_constant,
    leaves,
    to_sympy,
)
from nmm.plugins.symbolic.readable import condition, factored, in_names
from nmm.plugins.symbolic.symbolic_analysis import SymbolicAnalysis
from nmm.plugins.symbolic.zeros import GroebnerBasis, GroebnerLimits, Undecided, Zeros

#: Smaller values are rounding, also by a file's digits, and count as zero.
NOTHING = 1e-9
#: A longer proof is not readable.
_CASES = 200
#: For a proof in one step; beyond them, cases are distinguished.
_BRIEF = GroebnerLimits(100, 1000, 10_000)


@dataclass(frozen=True)
class RankClaim:
    """A statement and the steps of its proof; `str` of each is a sentence.

    Attributes
    ----------
    statement : "rank_lost", "rank_full", "rank_except", "gram_bound", or "rank_undecided" without a proof
    steps : of the proof
    families : the exceptional set of the statement: it is where all expressions of one family vanish
    conditions : expressions that all vanish in that set, and nowhere else; none when it is empty
    """

    statement: Finding
    steps: tuple[Finding, ...] = ()
    conditions: tuple[Any, ...] = ()
    families: tuple[tuple[Any, ...], ...] = ()

    @property
    def proved(self) -> bool:
        """Whether the steps are a proof; if not, the statement says what was not decided."""
        return self.statement.code != "rank_undecided"


def singular_set(analysis: SymbolicAnalysis, zero: Sequence[str] = ()) -> RankClaim:
    """Where J loses rank, for all values of the lengths that are not zero.

    A factor of a minor that depends on lengths alone counts as zero, or not, as it is for this robot.

    All minors vanish where one factor of each does. A case is impossible if 1 is in the ideal of its factors
    and cos² + sin² - 1, lengths divided out (Nullstellensatz, over the complex numbers, hence over the real
    ones), and ends when each minor has a factor that vanishes throughout it. Nothing is said about
    configurations where J does not exist (cos(steering) = 0, say).

    Parameters
    ----------
    zero : lengths that are 0, by name

    Raises
    ------
    InputError : a name in `zero` that is no length, or of one that J is divided by
    """
    if zero:
        analysis = analysis.without(*zero)
    forms = {columns: form for columns, form in analysis.minor_forms.items() if form.number}
    s = len(analysis.row_names)
    gone = list(analysis.derivation.zero)
    if not forms:
        step = Finding("minors_identically_zero")
        return RankClaim(Finding("rank_lost", {"rank": s, **_some(gone=gone)}), (step,))
    domain = _domain(analysis, list(forms.values()))
    vanish = [
        columns for columns, form in forms.items() if any(alone(f) in domain.zero for f, _ in form.factors)
    ]
    zero_formulas = [condition(quantity, {}) for quantity in domain.zero]
    steps = [Finding("minors_zero", {"minors": vanish, "zero": zero_formulas})] if vanish else []
    forms = {columns: form for columns, form in forms.items() if columns not in vanish}
    if not forms:
        nowhere = domain._replace(nonzero=[])
        return RankClaim(Finding("rank_lost", {"rank": s, **nowhere.assumptions(analysis)}), tuple(steps))
    try:
        needed = _nowhere(list(forms.values()), domain)
        if needed is not None:
            steps.append(Finding("nullstellensatz", _some(divided=[inline(f) for f in needed.nonzero])))
            return RankClaim(Finding("rank_full", {"rank": s, **needed.assumptions(analysis)}), tuple(steps))
        cases = Cases(analysis, forms, domain)
    except Undecided:
        return RankClaim(Finding("rank_undecided", _some(gone=gone)))
    steps += cases.steps
    assumptions = domain.assumptions(analysis)
    if not cases.families:
        return RankClaim(Finding("rank_full", {"rank": s, **assumptions}), tuple(steps))
    conditions = [[condition(factor, analysis.named_forms) for factor in family] for family in cases.families]
    factors = [in_names(factor, analysis.named_forms) for family in cases.families for factor in family]
    used = {leaf.name for leaf in leaves(*factors) if isinstance(leaf, Symbol)}
    named = {name: inline(form) for name, form in analysis.named_forms.items() if name in used}
    statement = Finding("rank_except", {"rank": s, "families": conditions, "named": named, **assumptions})
    families = tuple(
        tuple(to_sympy(factor, analysis.symbols) for factor in family) for family in cases.families
    )
    vanishing = families[0]
    if len(families) > 1:  # a product that vanishes exactly in the union of the families
        sums = [
            family[0] if len(family) == 1 else sympy.Add(*(part**2 for part in family)) for family in families
        ]
        vanishing = (sympy.Mul(*sums),)
    return RankClaim(statement, tuple(steps), vanishing, families)


def _some(**values: list[Any]) -> dict[str, Any]:
    return {name: value for name, value in values.items() if value}


class Domain(NamedTuple):
    """Where a statement holds: what is not 0 (lengths, auxiliary ones too, and sums of them), the other
    divisors of J, and what is 0 for this robot."""

    nonzero: list[Product]
    below: list[Product]
    zero: list[Product]

    def zeros(self, products: Sequence[Product], limits: GroebnerLimits | None = None) -> Zeros:
        return Zeros(products, [*self.nonzero, *self.below], limits, self.zero)

    def assumptions(self, analysis: SymbolicAnalysis) -> dict[str, Any]:
        """The domain as values of a finding; auxiliary quantities, which depend on q, are "moving"."""
        moving = [alone(Symbol(name)) for name in analysis.definitions]
        return _some(
            gone=list(analysis.derivation.zero),
            zero=[condition(quantity, {}) for quantity in self.zero],
            nonzero=[condition(quantity, {}) for quantity in self.nonzero if quantity not in moving],
            moving=[inline(quantity) for quantity in self.nonzero if quantity in moving],
            exists=[condition(divisor, analysis.named_forms) for divisor in self.below],
        )


def _domain(analysis: SymbolicAnalysis, forms: Sequence[Product]) -> Domain:
    ring, symbols = analysis.derivation.ring, analysis.symbols
    values = {symbols[name]: value for name, value in analysis.geometry.items()}
    nonzero: dict[Product, None] = {}
    zero: dict[Product, None] = {}
    for factor in (factor for form in forms for factor, _ in form.factors):
        if is_constant(factor, analysis.geometry) and not isinstance(factor, Symbol):
            value = float(to_sympy(alone(factor), symbols).subs(values))
            (zero if abs(value) < NOTHING else nonzero)[alone(factor)] = None
    denominators = [alone(factor) for value in analysis.denominators for factor, _ in factored(value).factors]
    below = [d for d in denominators if not isinstance(d.factors[0][0], Symbol) and d not in nonzero]
    divisible = [*analysis.numerators.values(), *analysis.denominators]
    used = {ring.names[i] for value in divisible for i in value.variables() if not ring.is_angle[i]}
    may_vanish = {aux.name for aux in analysis.derivation.auxiliaries if aux.kind == "share"}
    lengths = used & {*analysis.geometry, *analysis.definitions} - may_vanish
    names = [alone(Symbol(name)) for name in ring.names if name in lengths]
    return Domain([*names, *nonzero], list(dict.fromkeys(below)), [f for f in zero if f not in below])


def _nowhere(forms: Sequence[Product], domain: Domain) -> Domain | None:
    """The domain reduced to what keeps the minors from a common zero; None when they may have one."""

    def empty(nonzero: list[Product]) -> bool:
        try:
            zeros = domain._replace(nonzero=nonzero).zeros(forms, _BRIEF)
            return zeros.within(zeros.everywhere, *forms).is_one
        except Undecided:
            return False

    needed = domain.nonzero
    if not empty(needed):
        return None
    for quantity in reversed(domain.nonzero):
        fewer = [other for other in needed if other != quantity]
        needed = fewer if empty(fewer) else needed
    return domain._replace(nonzero=needed)


class Cases:
    """The case distinction of minors that are not 0: the `steps` of the proof, and `families` of factors. All
    minors vanish exactly where all factors of one family do. `Undecided` beyond the limits."""

    def __init__(
        self, analysis: SymbolicAnalysis, forms: Mapping[tuple[str, ...], Product], domain: Domain
    ) -> None:
        self.families: list[list[Product]] = []
        self.steps: list[Finding] = []
        self._zeros = domain.zeros(list(forms.values()))
        self._names, self._count = analysis.named_forms, 0
        known = [*domain.nonzero, *domain.below]
        #: (columns, as it is shown, the factors that may vanish) of each minor.
        self._minors = [
            (
                columns,
                inline(analysis.short_forms[columns]),
                [alone(factor) for factor, power in form.factors if power > 0 and alone(factor) not in known],
            )
            for columns, form in forms.items()
        ]
        self._case([], self._zeros.everywhere)
        self.families = [self._plain(family) for family in self.families]
        self._drop_parts()

    def _case(self, vanishing: list[Product], basis: GroebnerBasis) -> None:
        self._count += 1
        if self._count > _CASES:
            raise Undecided
        for family in self.families:
            if all(self._zeros.vanishes(factor, basis) for factor in family):
                self._step("case_covered", vanishing, family=self._shown(family))
                return
        left = [minor for minor in self._minors if not any(self._zeros.contains(f, basis) for f in minor[2])]
        while left:  # the easy question is answered; the hard one only for the minor that is taken
            minor = min(left, key=lambda minor: len(minor[2]))
            hidden = [factor for factor in minor[2] if self._zeros.vanishes(factor, basis)]
            if not hidden:
                break
            basis = self._zeros.within(basis, hidden[0])
            left = [other for other in left if not any(self._zeros.contains(f, basis) for f in other[2])]
        if not left:
            self._step("case_singular", vanishing)
            self.families.append(vanishing)
            return
        columns, form, factors = minor
        if not factors:
            self._step("case_regular", vanishing, minor=columns, form=form)
            return
        possible = [(factor, self._zeros.within(basis, factor)) for factor in factors]
        ways = self._shown([factor for factor, inside in possible if not inside.is_one])
        excluded = self._shown([factor for factor, inside in possible if inside.is_one])
        self._step("case_split", vanishing, minor=columns, form=form, ways=ways, excluded=excluded)
        for factor, inside in possible:
            if not inside.is_one:
                self._case([*vanishing, factor], inside)

    def _plain(self, family: list[Product]) -> list[Product]:
        """The same set by fewer and simpler factors: cosines and sines of single angles where possible."""
        zeros, basis = self._zeros, self._zeros.within(self._zeros.everywhere, *family)
        angles = [leaf.angle for leaf in leaves(*family) if isinstance(leaf, Trig)]
        names = dict.fromkeys(name for angle in angles for name, _ in angle if zeros.known(name))
        waves = [alone(Trig(kind, ((name, 1),))) for name in names for kind in ("sin", "cos")]
        single = [wave for wave in waves if zeros.vanishes(wave, basis)]
        chosen: list[Product] = []
        inside = zeros.everywhere
        for factor in [*single, *sorted(family, key=lambda factor: len(condition(factor, {})))]:
            if all(zeros.vanishes(f, inside) for f in family):
                break
            if not zeros.vanishes(factor, inside):
                chosen.append(factor)
                inside = zeros.within(inside, factor)
        for factor in list(chosen):
            others = [other for other in chosen if other is not factor]
            if others and zeros.vanishes(factor, zeros.within(zeros.everywhere, *others)):
                chosen = others
        if set(chosen) != set(family):
            self._step("same_set", family=self._shown(family), simpler=self._shown(chosen))
        return chosen

    def _drop_parts(self) -> None:
        """Drop families whose set is part of another's."""
        remaining: list[list[Product]] = []
        for family in sorted(self.families, key=len):
            basis = self._zeros.within(self._zeros.everywhere, *family)
            for other in remaining:
                if all(self._zeros.vanishes(factor, basis) for factor in other):
                    if set(family) != set(other):
                        self._step("part_of", family=self._shown(family), whole=self._shown(other))
                    break
            else:
                remaining.append(family)
        self.families = remaining

    def _shown(self, factors: list[Product]) -> list[Formula]:
        return [condition(factor, self._names) for factor in factors]

    def _step(self, code: str, vanishing: Sequence[Product] = (), **values: Any) -> None:
        case = {"given": self._shown(list(vanishing))} if vanishing else {}
        self.steps.append(Finding(code, case | values))
