"""What formulas of J prove: where it loses rank, which minors vanish, the proofs' steps. Formulas are
`Formula`, text with LaTeX; each function turns a finding's values into a sentence in both forms."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from math import pi
from typing import Any

from nmm.base.latex import Formula, Typeset, block, formula, joined, minor_name, sentence, symbol

_J, _DET = Formula("J", "J"), Formula("det J J^T", r"\det J J^T")
_SEARCH = Typeset("--search", r"\texttt{-{}-search}")


def _each(factors: Iterable[Any], sign: str = " = ", mark: str = " and ") -> Typeset:
    """ "d = 0 and c1 = 0"."""
    return joined((formula(factor, sign, 0) for factor in factors), mark)


def _minors(minors: Iterable[Sequence[str]], last: str = ", ") -> Typeset:
    return joined(map(minor_name, minors), last=last)


def _values(values: Mapping[str, Sequence[Any]]) -> Typeset:
    """ "d = 0.3 m, l1 = 0.5 m" of (value, unit) by name."""
    return joined(
        sentence(formula(symbol(name), " = ", f"{value:g}"), f" {unit}")
        for name, (value, unit) in values.items()
    )


def _zero(gone: Sequence[str]) -> Formula:
    return formula(*(part for name in gone for part in (symbol(name), " = ")), 0)


def _domain(
    gone: Sequence[str] = (),
    zero: Sequence[Any] = (),
    nonzero: Sequence[Any] = (),
    moving: Sequence[Any] = (),
    exists: Sequence[Any] = (),
) -> Typeset:
    """The domain of a statement: conditions on lengths, and on q through auxiliary quantities."""
    parts: list[Typeset] = [_zero(gone)] if gone else []
    parts += [_each(zero)] if zero else []
    parts += [sentence("all nonzero ", joined(nonzero))] if nonzero else []
    return sentence(
        *((", for ", joined(parts, " and ")) if parts else ()),
        *((", wherever ", _each(moving, " != ")) if moving else ()),
        *((", where ", _J, " exists (", _each(exists, " != "), ")") if exists else ()),
    )


def _except(
    rank: int, families: Sequence[Sequence[Any]], named: Mapping[str, Any], **domain: Sequence[Any]
) -> Typeset:
    ways = [_each(family) for family in families]
    ways = [sentence("(", way, ")") if len(ways) > 1 and len(family) > 1 else way
            for way, family in zip(ways, families, strict=True)]  # fmt: skip
    meaning = joined(formula(symbol(name), " = ", form) for name, form in named.items())
    return sentence(
        _J, " has rank ", rank, " except exactly where ", joined(ways, " or "), _domain(**domain),
        *(("; ", meaning) if named else ()),
    )  # fmt: skip


def _undecided(gone: Sequence[str] = ()) -> Typeset:
    of = sentence(" for ", _zero(gone)) if gone else ""
    return sentence(
        "not decided: where ", _J, " loses rank", of, ", as its minors are too large for a proof; ",
        _SEARCH, " looks for it with numbers",
    )  # fmt: skip


def _bounded(
    rank: int, bound: Formula, nonzero: Sequence[str] = (), here: Mapping[str, Sequence[Any]] | None = None
) -> Typeset:
    when = sentence(" when ", _each(map(symbol, nonzero), " != ")) if nonzero else ""
    holds = sentence(". That holds here: ", _values(here)) if here else ""
    return sentence(
        _J, " has rank ", rank, " at every configuration", when, ", as ", formula(_DET, " >= ", bound), holds
    )


def _nullstellensatz(divided: Sequence[Any] = ()) -> Typeset:
    squares = Formula("cos^2 + sin^2 - 1", r"\cos^{2} + \sin^{2} - 1")
    by = sentence(", where ", joined(divided), " may be divided by") if divided else ""
    return sentence(1, " is a combination of the minors and ", squares, by, " (Nullstellensatz)")


def _case(conditions: Sequence[Any], *statement: object) -> Typeset:
    return sentence(*(("where ", _each(conditions, mark=", "), ": ") if conditions else ()), *statement)


def _split(
    minor: Sequence[str],
    form: Formula,
    ways: Sequence[Any],
    excluded: Sequence[Any],
    given: Sequence[Any] = (),
) -> Typeset:
    where = sentence("where ", _each(ways, mark=" or ")) if ways else "nowhere"
    reason = sentence("; ", _each(excluded), " cannot be there (Nullstellensatz)") if excluded else ""
    return _case(given, formula(minor_name(minor), " = ", form), " is ", 0, " ", where, reason)


def _squares(bound: Formula, count: int) -> Typeset:
    if count == 1:
        return sentence("so its square is ", bound)
    return sentence("so the squares of these minors sum to at least ", bound, " (Cauchy and Schwarz)")


def _angles(values: Sequence[Sequence[Any]]) -> Typeset:
    each = ", each" if len(values) > 1 else ","
    equal = joined((formula(symbol(name), " = ", value) for name, value in values), " and ")
    return sentence("that is ", equal, each, " up to half turns")


def _never_zero(
    minor: Sequence[str],
    larger: Sequence[Sequence[Any]],
    nonzero: Sequence[str],
    exact: bool,
    holds: bool | None = None,
    here: Mapping[str, Sequence[Any]] | None = None,
    through: Sequence[str] = (),
) -> Typeset:
    conditions = [formula(a, " > ", b) if b else formula(a, " != ", 0) for a, b in larger]
    conditions += [formula(symbol(name), " != ", 0) for name in nonzero]
    when = sentence(" when ", joined(conditions, " and ")) if conditions else ""
    only = ", and only then" if exact and larger else ""
    then: object = ""
    if through:
        then = sentence(". That depends on the configuration, through ", joined(map(symbol, through)))
    elif here:
        then = sentence(f". That {'holds' if holds else 'does not hold'} here: ", _values(here))
    return sentence(minor_name(minor), " never vanishes", when, only, then)


def _reach(terms: Sequence[Sequence[Any]]) -> Typeset:
    reached = [sentence("the terms beside ", beside, " reach at most ", most) for beside, most in terms]
    return sentence("cosines and sines are at most ", 1, ", so that ", joined(reached, "; "))


def _vanishing(count: int | None) -> Typeset:
    how_many = sentence(": ", count, " minors") if count else ""
    return sentence("Vanish somewhere, whatever the lengths, joint limits apart", how_many)


def _zero_because(minor: Sequence[str], factor: Any = None, mean_zero: bool = False) -> Typeset:
    if factor is None:
        why: object = sentence("it is ", 0)
    elif mean_zero:
        why = sentence(
            "its factor ", factor, " has mean ", 0, " over the joint angles, so that it changes its sign"
        )
    else:
        why = sentence(factor, " is a factor")
    return sentence(minor_name(minor), ", as ", why)


def _serving(partitions: Sequence[Sequence[str]]) -> Typeset:
    serves = " serves" if len(partitions) == 1 else " serve"
    return sentence("So ", joined(map(block, partitions), last=" and "), serves, " RG everywhere")


def _open(count: int, minors: Sequence[Sequence[str]]) -> Typeset:
    which = _minors(minors, " and ") if minors else sentence(count, " minors")
    return sentence("It is not decided whether ", which, " vanish", "es" if count == 1 else "", " somewhere")


def _rounded(name: str, value: float, quarters: int) -> Typeset:
    away = value - quarters * pi / 2
    near = formula(symbol(name), " = ", f"{value:.10g}")
    taken = Formula(f"{quarters} pi/2", rf"{quarters} \pi/2")
    return sentence(near, " rad taken as ", taken, f" ({away:.1e} rad away)")


def _mimic(joint: str, leader: str, multiplier: float, offset: float) -> Typeset:
    factor = {1.0: "", -1.0: "-"}.get(multiplier, f"{multiplier:.6g} ")
    added = f" {'-' if offset < 0.0 else '+'} {abs(offset):.6g}" if offset else ""
    return sentence(formula(symbol(joint), " = ", factor, symbol(leader), added))


WORDS: dict[str, str | Callable[..., str]] = {
    # where J loses rank
    "rank_lost": lambda rank, **domain: sentence(
        _J, " has rank below ", rank, " everywhere", _domain(**domain)
    ),
    "rank_full": lambda rank, **domain: sentence(
        _J, " has rank ", rank, " at every configuration", _domain(**domain)
    ),
    "rank_except": _except,
    "rank_undecided": _undecided,
    "rank_bounded": _bounded,
    "gram_bound": lambda bound: sentence(formula(_DET, " >= ", bound), " at every configuration"),
    "zero_angles": _angles,
    "formulas_without": "--set {key}=0 has the formulas",
    # steps of proofs
    "minors_identically_zero": lambda: sentence("every maximal minor is identically ", 0),
    "minors_zero": lambda minors, zero: sentence(
        joined([*map(minor_name, minors[:-1]), formula(minor_name(minors[-1]), " = ", 0)]),
        ", as ",
        _each(zero),
    ),
    "nullstellensatz": _nullstellensatz,
    "case_covered": lambda family, given=(): _case(given, "a part of ", _each(family, mark=", ")),
    "case_singular": lambda given=(): _case(given, "every minor has a factor that is ", 0),
    "case_regular": lambda minor, form, given=(): _case(
        given, formula(minor_name(minor), " = ", form), " is not ", 0
    ),
    "case_split": _split,
    "same_set": lambda family, simpler: sentence(
        _each(family, mark=", "),
        " is the same as ",
        _each(simpler, mark=", "),
        " (each vanishes on the other)",
    ),
    "part_of": lambda family, whole: sentence(
        _each(family, mark=", "), " is a part of ", _each(whole, mark=", ")
    ),
    "combination_constant": lambda combination, constant: sentence(
        formula(combination, " = ", constant), ", whatever ", symbol("q"), " is"
    ),
    "squares_bounded": _squares,
    "cauchy_binet": lambda: sentence(
        _DET, " is the sum of the squares of all maximal minors (Cauchy and Binet)"
    ),
    "terms_bounded": _reach,
    # minors
    "minor_never_zero": _never_zero,
    "minors_vanishing": _vanishing,
    "minor_vanishing": _zero_because,
    "no_partition_everywhere": "So every minor vanishes somewhere: no partition serves RG everywhere",
    "partitions_everywhere": _serving,
    "minors_undecided": _open,
    # notes
    "angle_rounded": _rounded,
    "length_symbol": lambda name, meaning: sentence(symbol(name), " is ", meaning),
    "mimic_joint": _mimic,
}
