"""The numbers of a singularity analysis at one configuration, as tables and sentences."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from nmm.analysis.singular.restoration import Restoration
from nmm.analysis.singular.singularity import SingularityReport
from nmm.cli.output import console, show_table
from nmm.cli.singularity_minors import extended, idle_inputs, reduced_gradient, show_minors
from nmm.cli.singularity_words import (
    LARGE,
    configuration,
    direction,
    directions,
    header,
    named_or_counted,
    number,
    say,
    sizes_note,
    without_twins,
)

if TYPE_CHECKING:
    from nmm.cli.subjects import Studied

#: So many motions that change σ_min are named.
MOST_MOTIONS = 4


def show_report(given: Studied, report: SingularityReport, length: float | None, left_out: int) -> None:
    """Print a report; `left_out` minors are not in it because they are many."""
    for line in header(given):
        say(line)
    say(configuration(given))
    note = sizes_note([*report.row_units, *report.input_units], length)
    if note:
        say(note)
    say()
    _show_J(report)
    _show_parts(report)
    for line in (*_verdict(report), *_restoring(given, report)):
        say(line)
    say()
    show_minors(report, left_out)
    of_resolvers = [*reduced_gradient(given, report), *extended(report)]
    if of_resolvers:
        say()
    for line in of_resolvers:
        say(line)


def _show_J(report: SingularityReport) -> None:
    """J, or its transpose where that is narrower and J is too wide; in blocks where both are."""
    largest = float(np.abs(report.J).max())
    cells = [[number(value, largest) for value in row] for row in report.J]
    lines = [["J", *report.inputs], *([name, *row] for name, row in zip(report.rows, cells, strict=True))]
    table = list(zip(*lines, strict=True))
    turned = [("Jᵀ", *report.inputs), *((name, *row) for name, row in zip(report.rows, cells, strict=True))]
    wide = sum(map(_width, table)) > console().width
    for columns in _blocks(turned if wide and sum(map(_width, turned)) < sum(map(_width, table)) else table):
        names, *rows = zip(*columns, strict=True)
        show_table(names, rows, numeric=names[1:])
    idle = idle_inputs(report)
    if idle:
        say(f"do not move the task here: {', '.join(idle)}")
    say()


def _width(column: Sequence[str]) -> int:
    return max(map(len, column)) + 2


def _blocks(columns: Sequence[Sequence[str]]) -> Iterator[list[Sequence[str]]]:
    """Columns that fit beside the first one, with it."""
    first, *rest = columns
    room = console().width - _width(first)
    block: list[Sequence[str]] = []
    for column in rest:
        if block and sum(map(_width, block)) + _width(column) > room:
            yield [first, *block]
            block = []
        block.append(column)
    yield [first, *block]


def _show_parts(report: SingularityReport) -> None:
    s, largest = len(report.rows), report.singular_values[0]
    rows = []
    for key, label in without_twins([(name, part.inputs) for name, part in report.parts.items()]):
        part = report.parts[key]
        rows.append(
            [
                label,
                named_or_counted(part.inputs, "inputs"),
                f"{part.rank} of {s}",
                number(part.sigma_min, largest),
                number(part.condition),
                directions(part.lost, report.rows) if len(part.lost) else "-",
            ]
        )
    show_table(
        ["part", "inputs", "rank", "σ_min", "condition", "cannot move"],
        rows,
        numeric=["σ_min", "condition"],
    )
    say()


def _verdict(report: SingularityReport) -> Iterator[str]:
    """Singular or not, and what the platform gives back."""
    s = len(report.rows)
    arm = report.parts["arm"]
    if report.singular:
        lost = directions(report.lost, report.rows)
        yield f"Singular: J has rank {report.rank} of {s}. No input moves {lost}."
    else:
        weakest = direction(report.weakest, report.rows, LARGE)
        yield f"Nonsingular: J has rank {s}. Weakest is {weakest}, at σ_min = {number(report.sigma_min)}."
    if len(report.given_back):
        has = "has too few joints for" if arm.too_few and not arm.singular else "alone has lost"
        yield f"The platform gives back what the arm {has}: {directions(report.given_back, report.rows)}."
    elif report.singular and arm.singular and report.parts["platform"].inputs:
        yield "The platform gives back nothing of what the arm alone has lost."


def _restoring(given: Studied, report: SingularityReport) -> Iterator[str]:
    """Which motions bring back what is lost, or change σ_min."""
    inputs, coordinates = report.by_input, report.by_coordinate
    units = {name: unit.split("/")[0] for name, unit in zip(report.inputs, report.input_units, strict=True)}
    if not report.singular:
        if not inputs.effective:
            yield "No input changes σ_min to first order."
            return
        yield f"σ_min changes with {_rates(inputs, units, report)}."
        if len(inputs.effective) > 1:
            best = direction(inputs.best, inputs.names, LARGE)
            yield f"It grows fastest along {best} ({inputs.best_rate:+.2g})."
        return
    if inputs.effective:
        yield f"Comes back with {_rates(inputs, units, report)}."
        best = direction(inputs.best, inputs.names, LARGE)
        if len(inputs.effective) > 1 and inputs.best_rate > 0.0:
            yield f"Best together: {best} (σ_min {inputs.best_rate:+.2g})."
        return
    yield "No input brings it back, to first order."
    held = [name for name in coordinates.effective if name in given.robot.platform.coordinates]
    if held:
        yield f"A motion along {', '.join(held)} would, which the wheels do not admit."


def _rates(found: Restoration, units: dict[str, str], report: SingularityReport) -> str:
    """ "q1 (σ_min +0.76 per rad), q2 (+0.3 per rad)", the strongest first."""
    lost = len(report.lost)
    order = [j for j in np.argsort(-np.abs(found.rates), kind="stable") if found.names[j] in found.effective]
    parts: list[str] = []
    for j in order[:MOST_MOTIONS]:
        name = found.names[j]
        if 0 < found.regained[j] < lost:
            what = f"{found.regained[j]} of {lost} directions"
        else:
            what = f"{found.rates[j]:+.2g} per {units[name]}"
        parts.append(f"{name} ({'' if parts or 'of' in what else 'σ_min '}{what})")
    more = len(order) - len(parts)
    return ", ".join(parts) + (f" and {more} more" if more > 0 else "")
