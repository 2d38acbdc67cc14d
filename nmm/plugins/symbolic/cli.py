"""What `nmm singularities --symbolic` says: formulas, and what follows from them, as text or as LaTeX."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

from nmm.analysis.singular.minors import Columns, chosen_columns
from nmm.base.errors import InputError
from nmm.base.findings import Finding
from nmm.base.latex import Formula, Typeset, capitalised, formula, joined, sentence, symbol
from nmm.base.text_format import counted
from nmm.cli.document import say
from nmm.cli.singularity_report import header, row_names

if TYPE_CHECKING:
    from nmm.cli.subjects import Studied
    from nmm.model.robots.robot import Robot
    from nmm.plugins.symbolic import RankClaim, SymbolicAnalysis

#: Reasons for more minors than these are not given.
MANY_REASONS = 12


class Conclusion(NamedTuple):
    """What follows from formulas: a finding, remarks below it, its proof, a hint; and words before it."""

    finding: Finding
    below: tuple[Finding, ...] = ()
    steps: tuple[Finding, ...] = ()
    hint: Finding | None = None
    before: str = ""

    def text(self) -> Typeset:
        statement = str(self.finding) if self.before else capitalised(str(self.finding))
        announces = self.finding.code == "minors_vanishing" and self.below
        return sentence(self.before, statement, ":" if announces else ".")

    def reasons(self) -> list[Typeset]:
        return [sentence("" if i else "because: ", str(step)) for i, step in enumerate(self.steps)]


def show_formulas(studied: Studied, analysis: SymbolicAnalysis, chosen: Sequence[Columns] | None) -> None:
    from nmm.plugins.symbolic.symbolic_analysis import text_lines

    shown = only(analysis, chosen)
    body = list(text_lines(shown))
    for line in (*header(studied), *_geometry(analysis, "\n".join(body))):
        say(line)
    short = _short_forms("\n".join(body), analysis)
    single, several = [name for name in short if len(name) == 2], [name for name in short if len(name) > 2]
    several.sort(key=lambda name: (len(name), name[0] != "s", name))
    examples = [f"{name} is {short[name]}" for name in (*single[:1], *several[:1])]
    if examples:
        say(", ".join(examples))
    say()
    for text in body:
        say(text)
    say("what follows")
    for conclusion in conclusions(studied, analysis):
        say(f"  {conclusion.text()}")
        for remark in conclusion.below:
            say(f"    {remark}")
        for i, step in enumerate(conclusion.reasons()):
            say(f"    {'         ' if i else ''}{step}")
        if conclusion.hint:
            say(f"    {conclusion.hint}")
    for note in analysis.notes:
        say(f"note: {note}")


def show_latex(studied: Studied, analysis: SymbolicAnalysis, chosen: Sequence[Columns] | None) -> None:
    """Print the same as the body of a LaTeX document, and nothing else."""
    print("\n".join(_body(studied, analysis, only(analysis, chosen))))


def _body(studied: Studied, analysis: SymbolicAnalysis, shown: SymbolicAnalysis) -> Iterator[str]:
    """The lines of that body: formulas with the minors of `shown` alone, conclusions from all minors."""
    from nmm import __version__
    from nmm.plugins.symbolic.symbolic_analysis import text_lines, zeros_summed

    body, follows = shown.latex(), conclusions(studied, analysis)
    items = list(_items(follows))
    yield f"% nmm {__version__}; needs \\usepackage{{amsmath}}"
    who, *what = header(studied)
    yield f"{sentence(who).latex}."
    for line in (*what, *_geometry(analysis, "\n".join(text_lines(shown)))):
        yield f"{capitalised(line).latex}."  # type: ignore[attr-defined]  # typeset as they were
    values = (Formula(f"f{i}", f"f_{{{i}}}") for i in range(1, len(analysis.row_names) + 1))
    pairs = zip(values, row_names(studied), strict=True)
    rows = joined((sentence(value, " (", name, ")") for value, name in pairs), last=" and ")
    yield f"The task's value has the rows {rows.latex}; the columns of $J$ are named after the inputs."
    if analysis.derivation.target_moves:
        yield "The target $g$ depends on $q$, too."
    yield r"$\Delta$ with the names of columns is their minor."
    lines = (line for item in follows for line in (item.text(), *map(str, item.below), *item.reasons()))
    short = _short_forms("\n".join([*text_lines(shown), *lines]), analysis)
    if short:
        names = (Formula(name, f"{name[0]}_{{{name[1:]}}}") for name in short)
        meant = joined(formula(name, " = ", of) for name, of in zip(names, short.values(), strict=True))
        yield f"Short forms: {meant.latex}."
    yield rf"\begingroup\allowdisplaybreaks{chr(10)}{body}{chr(10)}\endgroup"
    if summed := zeros_summed(shown):
        yield f"The other {counted(summed, 'maximal minor')} are $0$."
    yield "What follows:"
    yield from items
    for note in analysis.notes:
        yield f"{capitalised(str(note)).latex}."  # type: ignore[attr-defined]  # typeset by its words


def _items(follows: Sequence[Conclusion]) -> Iterator[str]:
    """Conclusions as items, with their reasons as nested items, and hints about the command as comments."""
    yield r"\begin{itemize}"
    for conclusion in follows:
        yield rf"\item {conclusion.text().latex}"
        if conclusion.hint:
            yield f"% {conclusion.hint}"
        below = [*(sentence(str(remark)) for remark in conclusion.below), *conclusion.reasons()]
        if below:
            yield r"  \begin{itemize}"
            yield from (rf"  \item {line.latex}" for line in below)
            yield r"  \end{itemize}"
    yield r"\end{itemize}"


def only(analysis: SymbolicAnalysis, chosen: Sequence[Columns] | None) -> SymbolicAnalysis:
    if chosen is None:
        return analysis
    indices = chosen_columns(chosen, analysis.u_names, len(analysis.row_names))
    wanted = {tuple(analysis.u_names[j] for j in sorted(row)) for row in indices}
    return replace(
        analysis, short_forms={name: form for name, form in analysis.short_forms.items() if name in wanted}
    )


def _short_forms(body: str, analysis: SymbolicAnalysis) -> dict[str, Formula]:
    """The meaning of each cosine and sine in short form: s12 is sin(q1 + q2)."""
    names = sorted(
        set(re.findall(r"\b[cs]\d+\b", body)) - set(analysis.symbols),
        key=lambda name: (len(name), name[1:], name[0]),
    )
    kinds = {"c": Formula("cos", r"\cos"), "s": Formula("sin", r"\sin")}

    def meaning(name: str) -> Formula:
        angles = [symbol(f"q{digit}") for digit in name[1:]]
        total = formula(angles[0], *(part for angle in angles[1:] for part in (" + ", angle)))
        return formula(kinds[name[0]], "(", total, ")")

    return {name: meaning(name) for name in names}


def _geometry(analysis: SymbolicAnalysis, body: str) -> Iterator[Typeset]:
    """Values of the lengths in the formulas, and the arguments that are 0."""
    used = [name for name in analysis.geometry if re.search(rf"\b{name}\b", body)]
    if used:
        values = (
            sentence(formula(symbol(name), " = ", f"{value:g}"), f" {unit}")
            for name, (value, unit) in _values(analysis, used).items()
        )
        yield sentence("geometry: ", joined(values))
    zero = _zero(analysis)
    if zero:
        yield sentence("zero, and so not in the formulas: ", joined(map(symbol, zero)))


def _values(analysis: SymbolicAnalysis, names: Sequence[str]) -> dict[str, tuple[float, str]]:
    units = _units(analysis)
    return {name: (analysis.geometry[name], units.get(name, "m")) for name in names}


def _units(analysis: SymbolicAnalysis) -> Mapping[str, str]:
    ring = analysis.derivation.ring
    return {name: "rad" for name, is_angle in zip(ring.names, ring.is_angle, strict=True) if is_angle}


def _zero(analysis: SymbolicAnalysis) -> list[str]:
    from nmm.plugins.symbolic.from_robot import numeric_arguments

    return [name for name, value in numeric_arguments(analysis.robot).items() if value == 0.0]


def conclusions(studied: Studied, analysis: SymbolicAnalysis) -> list[Conclusion]:
    results = [*_of_rank(studied, analysis), *_of_minors(analysis)]
    return sorted(results, key=lambda conclusion: conclusion.finding.code != "rank_undecided")


def _of_rank(studied: Studied, analysis: SymbolicAnalysis) -> Iterator[Conclusion]:
    from nmm.plugins.symbolic import lower_bound, singular_set

    bound = lower_bound(analysis)
    if bound is None:
        yield _conclusion(singular_set(analysis))
    else:
        symbols = {str(symbol) for symbol in bound.conditions[0].free_symbols}
        lengths = [name for name in analysis.geometry if name in symbols]
        values: dict[str, Any] = {"rank": len(analysis.row_names), "bound": bound.statement.values["bound"]}
        if lengths:
            values["nonzero"] = lengths
        if lengths and all(analysis.geometry[name] for name in lengths):
            values["here"] = _values(analysis, lengths)
        yield Conclusion(Finding("rank_bounded", values), steps=bound.steps)
    used = {str(symbol) for minor in analysis.minors.values() for symbol in minor.free_symbols}
    lengths = [name for name in analysis.geometry if name in used]
    first = next((name for name in lengths if name in studied.robot.arguments), None)
    if first and studied.robot.platform.p and not _zero(analysis) and _may_be_zero(studied.robot, first):
        try:
            without = singular_set(analysis, (first,))
        except InputError:  # J is divided by it
            return
        key = first if studied.scenario is None else f"robot.arguments.{first}"
        hint = Finding("formulas_without", {"key": key}) if without.proved else None
        before = sentence("With ", formula(symbol(first), " = ", 0), " instead: ") if without.proved else ""
        yield _conclusion(without, hint, before)


def _conclusion(claim: RankClaim, hint: Finding | None = None, before: str = "") -> Conclusion:
    angles = [_angle(condition) for condition in claim.conditions]
    values = [angle for angle in angles if angle is not None]
    means = (Finding("zero_angles", {"values": values}),) if values and len(values) == len(angles) else ()
    return Conclusion(claim.statement, means, claim.steps, hint, before)


def _angle(condition: Any) -> tuple[str, Formula] | None:
    """(q1, pi/2) for cos(q1), (q2, 0) for sin(q2); None for what is not of one angle."""
    import sympy

    if not isinstance(condition, sympy.sin | sympy.cos) or not condition.args[0].is_Symbol:
        return None
    zero = Formula("0", "0") if isinstance(condition, sympy.sin) else Formula("pi/2", r"\pi/2")
    return str(condition.args[0]), zero


def _may_be_zero(robot: Robot, argument: str) -> bool:
    """Whether the robot's file takes 0 for an argument: an arm without an upper arm is none."""
    from nmm.model.robots.loading import load

    try:
        load(robot.source, arguments={**robot.arguments, argument: "0"})
    except InputError:
        return False
    return True


def _of_minors(analysis: SymbolicAnalysis) -> Iterator[Conclusion]:
    from nmm.plugins.symbolic import never_zero, vanishing

    nonzero = [columns for columns, form in analysis.minor_forms.items() if form.number]
    if len(nonzero) < 2:  # the only one vanishes where J is singular
        return
    bounds = never_zero(analysis)
    for bound in bounds.values():
        finding = bound.finding(analysis.geometry, list(analysis.definitions), _units(analysis))
        yield Conclusion(finding, steps=bound.reasons(analysis.geometry))
    reasons = {columns: why for columns, why in vanishing(analysis).items() if columns in nonzero}
    if reasons:
        few = len(reasons) <= MANY_REASONS
        below = tuple(reasons.values()) if few else ()
        yield Conclusion(Finding("minors_vanishing", {"count": None if few else len(reasons)}), below)
    lost = {
        columns
        for columns, bound in bounds.items()
        if bound.exact and bound.holds(analysis.geometry) is False
    }
    if lost | set(reasons) == set(nonzero):
        yield Conclusion(Finding("no_partition_everywhere"))
    serving = [columns for columns, bound in bounds.items() if bound.holds(analysis.geometry)]
    if serving:
        yield Conclusion(Finding("partitions_everywhere", {"partitions": serving}))
    undecided = [columns for columns in nonzero if columns not in reasons and columns not in bounds]
    if undecided:
        shown = undecided if len(undecided) <= MANY_REASONS else []
        yield Conclusion(Finding("minors_undecided", {"count": len(undecided), "minors": shown}))
