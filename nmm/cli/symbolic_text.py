"""What `nmm singularities --symbolic` prints: formulas, and what follows from them, each with its reason."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from nmm.analysis.singular.minors import Columns, chosen_columns, minor_name
from nmm.cli.singularity_words import block, header, say
from nmm.errors import InputError
from nmm.words import listed

if TYPE_CHECKING:
    from nmm.analysis.formulas import Bound, Claim, SymbolicAnalysis
    from nmm.cli.subjects import Studied
    from nmm.robots.robot import Robot

#: Reasons for more minors than these are not given.
MANY_REASONS = 12
#: How the line begins that says that where J loses rank was not decided.
NOT_DECIDED = "Not decided: "


def formulas(given: Studied) -> tuple[SymbolicAnalysis | None, str]:
    """The analysis; or None and the reason why there is none.

    Raises
    ------
    InputError : the task does not fit the robot
    """
    from nmm.analysis.formulas import symbolic
    from nmm.analysis.singular.jacobians import Jacobians

    Jacobians(given.subject)  # complains about what is wrong with the input, formulas or not
    try:
        return symbolic(given.robot, given.task), ""
    except InputError as error:
        return None, str(error).removeprefix("symbolic: ")


def show_formulas(given: Studied, analysis: SymbolicAnalysis, chosen: Sequence[Columns] | None) -> None:
    """Print formulas and claims."""
    formulas = [line for line in only(analysis, chosen).text().splitlines() if not line.startswith("note: ")]
    body = "\n".join(formulas)
    for line in (*header(given), *geometry(analysis, body)):
        say(line)
    abbreviations = _abbreviations(analysis, body)
    if abbreviations:
        say(abbreviations)
    say()
    for line in formulas:
        say(line)
    say("what follows")
    for line in what_follows(given, analysis):
        say(f"  {line}")
    for note in analysis.notes:
        say(f"note: {note}")


def only(analysis: SymbolicAnalysis, chosen: Sequence[Columns] | None) -> SymbolicAnalysis:
    """With the chosen minors alone to be written."""
    if chosen is None:
        return analysis
    indices = chosen_columns(chosen, analysis.u_names, len(analysis.row_names))
    wanted = {tuple(analysis.u_names[j] for j in sorted(row)) for row in indices}
    return replace(
        analysis, short_forms={name: form for name, form in analysis.short_forms.items() if name in wanted}
    )


def _abbreviations(analysis: SymbolicAnalysis, body: str) -> str:
    """ "c1 is cos(q1), s12 is sin(q1 + q2)": of names that occur, a short one and one of a sum."""
    found = sorted(
        set(re.findall(r"\b[cs]\d+\b", body)) - set(analysis.symbols), key=lambda name: (len(name), name)
    )
    single = [name for name in found if len(name) == 2]
    sums = sorted(
        (name for name in found if len(name) > 2), key=lambda name: (len(name), name[0] != "s", name)
    )
    said = []
    for name in (*single[:1], *sums[:1]):
        kind = "cos" if name[0] == "c" else "sin"
        said.append(f"{name} is {kind}({' + '.join(f'q{digit}' for digit in name[1:])})")
    return ", ".join(said)


def geometry(analysis: SymbolicAnalysis, body: str) -> Iterator[str]:
    """Values of the lengths in the formulas, and the arguments that are 0."""
    used = {name: value for name, value in analysis.geometry.items() if re.search(rf"\b{name}\b", body)}
    if used:
        yield "geometry: " + _values(analysis, used)
    zero = _zero(analysis)
    if zero:
        yield f"zero, and so not in the formulas: {', '.join(zero)}"


def _values(analysis: SymbolicAnalysis, values: dict[str, float]) -> str:
    ring = analysis.derivation.ring
    angles = {name for name, is_angle in zip(ring.names, ring.is_angle, strict=True) if is_angle}
    return ", ".join(
        f"{name} = {value:g} {'rad' if name in angles else 'm'}" for name, value in values.items()
    )


def _zero(analysis: SymbolicAnalysis) -> list[str]:
    """Arguments of the robot's file that are 0."""
    found = []
    for name, text in analysis.robot.arguments.items():
        try:
            if float(text) == 0.0:
                found.append(name)
        except ValueError:
            continue
    return found


def what_follows(given: Studied, analysis: SymbolicAnalysis) -> list[str]:
    """Statements, a line each, with reasons indented below them.

    That the main question was not decided comes first: no one looks for it below the proofs.
    """
    return sorted(_claims(given, analysis), key=lambda line: not line.startswith(NOT_DECIDED))


def _claims(given: Studied, analysis: SymbolicAnalysis) -> Iterator[str]:
    """Where J loses rank, also without the first length of the file, and which minors never vanish."""
    from nmm.analysis.formulas import lower_bound, singular_set

    bound = lower_bound(analysis)
    if bound is None:
        yield from _claim(singular_set(analysis))
    else:
        rank, constant = len(analysis.row_names), bound.conditions[0]
        why = bound.statement.removesuffix(" at every configuration")
        when, here = _nonzero(constant, analysis), _here(constant, analysis)
        yield f"J has rank {rank} at every configuration{when}, as {why}.{here}"
        yield from _because(bound.steps)
    first = next((name for name in _in_minors(analysis) if name in given.robot.arguments), None)
    if first and given.robot.platform.p and not _zero(analysis) and _may_be_zero(given.robot, first):
        try:
            without = singular_set(analysis, (first,))
        except InputError:  # J is divided by it
            pass
        else:
            yield from _claim(without, f"With {first} = 0 instead: ")
            if without.proved:
                key = first if given.scenario is None else f"robot.arguments.{first}"
                yield f"  --set {key}=0 has the formulas"
    yield from _minors(analysis)


def _because(steps: Sequence[str]) -> Iterator[str]:
    for i, step in enumerate(steps):
        yield f"  {'         ' if i else 'because: '}{step}"


def _may_be_zero(robot: Robot, argument: str) -> bool:
    """Whether the robot's file takes 0 for an argument: an arm without an upper arm is none."""
    from nmm.robots.loading import load

    try:
        load(robot.source, arguments={**robot.arguments, argument: "0"})
    except InputError:
        return False
    return True


def _lengths(constant: Any, analysis: SymbolicAnalysis) -> list[str]:
    """The lengths in a product."""
    symbols = {str(symbol) for symbol in constant.free_symbols}
    return [name for name in analysis.geometry if name in symbols]


def _nonzero(constant: Any, analysis: SymbolicAnalysis) -> str:
    """ " when d != 0": of the lengths in a product."""
    names = _lengths(constant, analysis)
    return f" when {' and '.join(f'{name} != 0' for name in names)}" if names else ""


def _here(constant: Any, analysis: SymbolicAnalysis) -> str:
    """ " That holds here: d = 0.3 m.": of lengths that are not 0."""
    values = {name: analysis.geometry[name] for name in _lengths(constant, analysis)}
    return f" That holds here: {_values(analysis, values)}." if values and all(values.values()) else ""


def _in_minors(analysis: SymbolicAnalysis) -> list[str]:
    """The lengths that some minor has."""
    minors = [value for value in analysis.minors.values() if value != 0]
    symbols = {str(symbol) for value in minors for symbol in value.free_symbols}
    return [name for name in analysis.geometry if name in symbols]


def _claim(claim: Claim, given: str = "") -> Iterator[str]:
    """A statement, what it means for single joints, and the proof."""
    if not claim.proved:
        yield f"{claim.statement[0].upper()}{claim.statement[1:]}; --search looks for it with numbers."
        return
    yield f"{given}{claim.statement}."
    values = [_value(condition) for condition in claim.conditions]
    if values and all(values):
        each = ", each" if len(values) > 1 else ","
        yield f"  that is {' and '.join(filter(None, values))}{each} up to half turns"
    yield from _because(claim.steps)


def _value(condition: Any) -> str | None:
    """ "q1 = pi/2" for cos(q1), "q2 = 0" for sin(q2); None for what is not of one angle."""
    import sympy

    if not isinstance(condition, sympy.sin | sympy.cos) or not condition.args[0].is_Symbol:
        return None
    return f"{condition.args[0]} = {'0' if isinstance(condition, sympy.sin) else 'pi/2'}"


def _minors(analysis: SymbolicAnalysis) -> Iterator[str]:
    """Which minors never vanish, and when; which do somewhere."""
    from nmm.analysis.formulas import never_zero, vanishing

    nonzero = [columns for columns, form in analysis.minor_forms.items() if form.number]
    if len(nonzero) < 2:  # the only one vanishes where J is singular
        return
    bounds = never_zero(analysis)
    for bound in bounds.values():
        yield from _bound(analysis, bound)
    reasons = {columns: why for columns, why in vanishing(analysis).items() if columns in nonzero}
    if reasons:
        few = len(reasons) <= MANY_REASONS
        count = ":" if few else f": {len(reasons)} minors"
        yield f"Vanish somewhere, whatever the lengths, joint limits apart{count}"
        for columns, why in reasons.items() if few else ():
            yield f"  {minor_name(columns)}, as {why}"
    lost = {
        columns
        for columns, bound in bounds.items()
        if bound.exact and bound.holds(analysis.geometry) is False
    }
    if lost | set(reasons) == set(nonzero):
        yield "So every minor vanishes somewhere: no partition serves RG everywhere."
    serving = [columns for columns, bound in bounds.items() if bound.holds(analysis.geometry)]
    if serving:
        serves = "serves" if len(serving) == 1 else "serve"
        yield f"So {listed([block(columns) for columns in serving])} {serves} RG everywhere."
    open_ = [columns for columns in nonzero if columns not in reasons and columns not in bounds]
    if open_:
        few = len(open_) <= MANY_REASONS
        which = listed([minor_name(columns) for columns in open_]) if few else f"{len(open_)} minors"
        yield f"It is not decided whether {which} vanish{'es' if len(open_) == 1 else ''} somewhere."


def _bound(analysis: SymbolicAnalysis, bound: Bound) -> Iterator[str]:
    conditions = [_larger(analysis, a, b) for a, b in bound.requires]
    conditions += [f"{name} != 0" for name in bound.nonzero]
    when = f" when {' and '.join(conditions)}" if conditions else ""
    names = {str(symbol) for pair in bound.requires for part in pair for symbol in part.free_symbols}
    values = {k: v for k, v in analysis.geometry.items() if k in names | set(bound.nonzero)}
    holds = bound.holds(analysis.geometry)
    here = ""
    if holds is None:
        moving = ", ".join(name for name in analysis.definitions if name in names)
        here = f" That depends on the configuration, through {moving}."
    elif conditions:
        here = f" That {'holds' if holds else 'does not hold'} here: {_values(analysis, values)}."
    otherwise = ", and only then" if bound.exact and bound.requires else ""
    yield f"{minor_name(bound.columns)} never vanishes{when}{otherwise}.{here}"
    reasons = [
        f"the terms beside {_plain(analysis, left)} reach at most {_plain(analysis, right)}"
        for left, right in bound.requires
        if right != 0
    ]
    if reasons:
        yield from _because([f"cosines and sines are at most 1, so that {'; '.join(reasons)}"])


def _larger(analysis: SymbolicAnalysis, a: Any, b: Any) -> str:
    left = _plain(analysis, a)
    if b == 0:
        return f"{left} != 0"
    return f"{left if left in analysis.definitions else f'|{left}|'} > {_plain(analysis, b)}"


def _plain(analysis: SymbolicAnalysis, expression: Any) -> str:
    """An expression as text; |l1| is l1 where the robot's l1 is above 0."""

    def without_bars(match: re.Match[str]) -> str:
        name = match[1]
        return name if analysis.geometry.get(name, -1.0) > 0.0 else f"|{name}|"

    return re.sub(r"Abs\((\w+)\)", without_bars, str(expression)).replace("**", "^").replace("*", " ")
