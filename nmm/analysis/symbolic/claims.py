"""Where J loses rank: a statement with its proof, or that none was found."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from nmm.analysis.symbolic.analysis import SymbolicAnalysis
from nmm.analysis.symbolic.families import Cases, TooMany
from nmm.analysis.symbolic.form import factored
from nmm.analysis.symbolic.groebner import Undecided
from nmm.analysis.symbolic.tree import GREEK, Product, Symbol, text, to_sympy
from nmm.analysis.symbolic.words import condition_text, minor_name
from nmm.analysis.symbolic.zeros import Zeros

#: Products of terms for a proof in one step; there is another way when they are not enough.
_BRIEF = 100_000


@dataclass(frozen=True)
class Claim:
    """A statement, whether it is proved, and the steps.

    Attributes
    ----------
    statement : one sentence
    proved : whether the steps are a proof; if not, `statement` says what was not decided
    steps : one sentence each
    families : the exceptional set of the statement: it is where all expressions of one family vanish
    conditions : expressions that all vanish in that set, and nowhere else; none when it is empty
    """

    statement: str
    proved: bool
    steps: tuple[str, ...]
    conditions: tuple[Any, ...] = ()
    families: tuple[tuple[Any, ...], ...] = ()


def singular_set(analysis: SymbolicAnalysis, zero: Sequence[str] = ()) -> Claim:
    """Where J loses rank, for all values of the lengths that are not zero.

    All minors vanish where one factor of each does. The cases are gone through; one is impossible when 1 is
    in the ideal of its factors and cos² + sin² - 1, lengths divided out (Nullstellensatz, over the complex
    numbers, hence over the real ones), and ends when each minor has a factor that vanishes all over it.
    J's rank where it does not exist (cos(steering) = 0, say) is not spoken of.

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
    gone = f" for {' = '.join(analysis.derivation.zero)} = 0" if analysis.derivation.zero else ""
    if not forms:
        return Claim(
            f"J has rank below {s} everywhere{gone}", True, ("every maximal minor is identically 0",)
        )
    lengths, below = _nonzero(analysis, forms)
    try:
        nowhere = _nowhere(list(forms.values()), lengths, below)
        if nowhere is not None:
            where = _where(analysis, nowhere, below)
            step = "1 is a combination of the minors and cos^2 + sin^2 - 1"
            step += f", where {', '.join(nowhere)} may be divided by" if nowhere else ""
            return Claim(f"J has rank {s} at every configuration{where}", True, (step,))
        cases = _cases(analysis, forms, lengths, below)
    except (Undecided, TooMany):
        return Claim("not decided: the minors are too large for a proof", False, ())
    where = _where(analysis, lengths, below)
    families = tuple(
        tuple(to_sympy(factor, analysis.symbols) for factor in family) for family in cases.families
    )
    said = [
        " and ".join(f"{condition_text(factor, analysis.named_forms)} = 0" for factor in family)
        for family in cases.families
    ]
    if not said:
        return Claim(f"J has rank {s} at every configuration{where}", True, tuple(cases.steps))
    alternatives = " or ".join(f"({one})" if len(said) > 1 and " and " in one else one for one in said)
    used = [
        f"{GREEK[name]} = {text(form)}"
        for name, form in analysis.named_forms.items()
        if GREEK[name] in alternatives
    ]
    meaning = f"; {', '.join(used)}" if used else ""
    statement = f"J has rank {s} except exactly where {alternatives}{where}{meaning}"
    return Claim(statement, True, tuple(cases.steps), _as_one(families), families)


def _nonzero(
    analysis: SymbolicAnalysis, forms: dict[tuple[str, ...], Product]
) -> tuple[list[str], list[Product]]:
    """Names of the lengths in the minors, auxiliary ones too, and what else J is divided by."""
    ring = analysis.derivation.ring
    lengths = {*analysis.geometry, *analysis.definitions}
    used = set().union(*(numerator.variables() for numerator in analysis.numerators.values()))
    below: dict[Product, None] = {}
    for denominator in analysis.denominators:
        used |= denominator.variables()
        for factor, _ in factored(denominator).factors:
            if not isinstance(factor, Symbol):
                below[Product(Fraction(1), ((factor, 1),))] = None
    names = [ring.names[i] for i in sorted(used) if not ring.is_angle[i] and ring.names[i] in lengths]
    return names, list(below)


def _nowhere(forms: list[Product], lengths: list[str], below: list[Product]) -> list[str] | None:
    """Lengths that must not be 0 for the minors to have no common zero; None when they may have one."""

    def empty(nonzero: list[str]) -> bool:
        zeros = Zeros(forms, [*(_symbol(name) for name in nonzero), *below], _BRIEF)
        return zeros.within(zeros.everywhere, *forms).is_one

    try:
        if not empty(lengths):
            return None
    except Undecided:
        return None
    needed = list(lengths)
    for name in reversed(lengths):
        fewer = [one for one in needed if one != name]
        try:
            needed = fewer if empty(fewer) else needed
        except Undecided:
            continue
    return needed


def _cases(
    analysis: SymbolicAnalysis,
    forms: dict[tuple[str, ...], Product],
    lengths: list[str],
    below: list[Product],
) -> Cases:
    """The case distinction, gone through."""
    minors = []
    for columns, form in forms.items():
        factors = [
            Product(Fraction(1), ((factor, 1),))
            for factor, power in form.factors
            if power > 0 and not (isinstance(factor, Symbol) and factor.name in lengths)
        ]
        said = f"{minor_name(columns)} = {text(analysis.short_forms[columns])}"
        minors.append((said, [factor for factor in factors if factor not in below]))
    nonzero = [*(_symbol(name) for name in lengths), *below]
    cases = Cases(Zeros(list(forms.values()), nonzero), minors, dict(analysis.named_forms))
    cases.explore()
    return cases


def _symbol(name: str) -> Product:
    return Product(Fraction(1), ((Symbol(name), 1),))


def _where(analysis: SymbolicAnalysis, nonzero: list[str], below: list[Product]) -> str:
    """For which lengths a statement is made."""
    zero = analysis.derivation.zero
    parts = [f"{' = '.join(zero)} = 0"] if zero else []
    parts += [f"all nonzero {', '.join(nonzero)}"] if nonzero else []
    exists = " and ".join(f"{condition_text(one, analysis.named_forms)} != 0" for one in below)
    return (f", for {' and '.join(parts)}" if parts else "") + (
        f", where J exists ({exists})" if exists else ""
    )


def _as_one(families: tuple[tuple[Any, ...], ...]) -> tuple[Any, ...]:
    """Expressions that all vanish exactly in the union of the families."""
    import sympy

    if len(families) == 1:
        return families[0]
    single = [
        family[0] if len(family) == 1 else sympy.Add(*(expression**2 for expression in family))
        for family in families
    ]
    return (sympy.Mul(*single),)
