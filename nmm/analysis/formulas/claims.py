"""Where J loses rank: a statement with its proof, or that none was found."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import sympy

from nmm.analysis.formulas.expressions import GREEK, Product, Symbol, alone, is_constant, text, to_sympy
from nmm.analysis.formulas.families import Cases, TooMany
from nmm.analysis.formulas.groebner import Undecided
from nmm.analysis.formulas.readable import condition_text, factored
from nmm.analysis.formulas.symbolic_analysis import SymbolicAnalysis
from nmm.analysis.formulas.zeros import Zeros
from nmm.analysis.singular.minors import minor_name

#: What rounding and the digits of a file leave of zero.
NOTHING = 1e-9
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

    A factor of a minor that depends on lengths alone counts as zero, or as not zero, as this robot's own is.

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
    nonzero, below, zeros = _quantities(analysis, list(forms.values()))
    gone_minors = [columns for columns, form in forms.items() if _has(form, zeros)]
    steps = [f"{', '.join(map(minor_name, gone_minors))} = 0, as {_zero_text(zeros)}"] if gone_minors else []
    forms = {columns: form for columns, form in forms.items() if columns not in gone_minors}
    if not forms:
        where = _where(analysis, [], below, zeros)
        return Claim(f"J has rank below {s} everywhere{where}", True, tuple(steps))
    try:
        nowhere = _nowhere(list(forms.values()), nonzero, below, zeros)
        if nowhere is not None:
            where = _where(analysis, nowhere, below, zeros)
            step = "1 is a combination of the minors and cos^2 + sin^2 - 1"
            step += f", where {', '.join(map(text, nowhere))} may be divided by" if nowhere else ""
            step += " (Nullstellensatz)"
            return Claim(f"J has rank {s} at every configuration{where}", True, (*steps, step))
        cases = _cases(analysis, forms, nonzero, below, zeros)
    except (Undecided, TooMany):
        return Claim(
            f"not decided: where J loses rank{gone}, as its minors are too large for a proof", False, ()
        )
    cases.steps[:0] = steps
    where = _where(analysis, nonzero, below, zeros)
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


def _quantities(
    analysis: SymbolicAnalysis, forms: list[Product]
) -> tuple[list[Product], list[Product], list[Product]]:
    """What is not 0: lengths, auxiliary ones too, and sums of them; what else J is divided by; what is 0."""
    ring = analysis.derivation.ring
    lengths = {*analysis.geometry, *analysis.definitions}
    used = set().union(*(numerator.variables() for numerator in analysis.numerators.values()))
    nonzero, zero = _constants(forms, analysis)
    below: dict[Product, None] = {}
    for denominator in analysis.denominators:
        used |= denominator.variables()
        for factor, _ in factored(denominator).factors:
            if not isinstance(factor, Symbol) and alone(factor) not in nonzero:
                below[alone(factor)] = None
    names = [ring.names[i] for i in sorted(used) if not ring.is_angle[i] and ring.names[i] in lengths]
    return (
        [*(alone(Symbol(name)) for name in names), *nonzero],
        list(below),
        [one for one in zero if one not in below],
    )


def _constants(
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
            value = float(to_sympy(alone(factor), analysis.symbols).subs(values))
            (zero if abs(value) < NOTHING else nonzero)[alone(factor)] = None
    return nonzero, zero


def _has(form: Product, factors: list[Product]) -> bool:
    """Whether some of these are factors of a product."""
    return any(alone(factor) in factors for factor, _ in form.factors)


def _nowhere(
    forms: list[Product], nonzero: list[Product], below: list[Product], zero: list[Product]
) -> list[Product] | None:
    """What must not be 0 for the minors to have no common zero; None when they may have one."""

    def empty(nonzero: list[Product]) -> bool:
        zeros = Zeros(forms, [*nonzero, *below], _BRIEF, zero)
        return zeros.within(zeros.everywhere, *forms).is_one

    try:
        if not empty(nonzero):
            return None
    except Undecided:
        return None
    needed = list(nonzero)
    for quantity in reversed(nonzero):
        fewer = [one for one in needed if one != quantity]
        try:
            needed = fewer if empty(fewer) else needed
        except Undecided:
            continue
    return needed


def _cases(
    analysis: SymbolicAnalysis,
    forms: dict[tuple[str, ...], Product],
    nonzero: list[Product],
    below: list[Product],
    zero: list[Product],
) -> Cases:
    """The case distinction, gone through."""
    minors = []
    for columns, form in forms.items():
        factors = [alone(factor) for factor, power in form.factors if power > 0]
        said = f"{minor_name(columns)} = {text(analysis.short_forms[columns])}"
        minors.append((said, [factor for factor in factors if factor not in [*nonzero, *below]]))
    zeros = Zeros(list(forms.values()), [*nonzero, *below], zero=zero)
    cases = Cases(zeros, minors, dict(analysis.named_forms))
    cases.explore()
    return cases


def _zero_text(zero: list[Product]) -> str:
    return " and ".join(f"{condition_text(one, {})} = 0" for one in zero)


def _where(
    analysis: SymbolicAnalysis, nonzero: list[Product], below: list[Product], zero: list[Product]
) -> str:
    """For which lengths a statement is made, and where: an auxiliary quantity depends on q."""
    gone = analysis.derivation.zero
    moving = [alone(Symbol(name)) for name in analysis.definitions]
    lengths = ", ".join(condition_text(one, {}) for one in nonzero if one not in moving)
    parts = [f"{' = '.join(gone)} = 0"] if gone else []
    parts += [_zero_text(zero)] if zero else []
    parts += [f"all nonzero {lengths}"] if lengths else []
    elsewhere = " and ".join(f"{text(one)} != 0" for one in nonzero if one in moving)
    exists = " and ".join(f"{condition_text(one, analysis.named_forms)} != 0" for one in below)
    return (
        (f", for {' and '.join(parts)}" if parts else "")
        + (f", wherever {elsewhere}" if elsewhere else "")
        + (f", where J exists ({exists})" if exists else "")
    )


def _as_one(families: tuple[tuple[Any, ...], ...]) -> tuple[Any, ...]:
    """Expressions that all vanish exactly in the union of the families."""
    if len(families) == 1:
        return families[0]
    single = [
        family[0] if len(family) == 1 else sympy.Add(*(expression**2 for expression in family))
        for family in families
    ]
    return (sympy.Mul(*single),)
