"""What `nmm singularities` shows of a configuration: tables, findings, and the same for scripts."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby
from math import comb
from typing import TYPE_CHECKING, Any

import numpy as np

from nmm.analysis.singular.algorithmic import ExtendedSingularity, partition_singularities
from nmm.analysis.singular.jacobians import stacked
from nmm.analysis.singular.parts import Restoration
from nmm.analysis.singular.singularity import SingularityReport
from nmm.base.arrays import Array
from nmm.base.findings import Finding
from nmm.base.findings.singularities import named_or_counted
from nmm.base.latex import Typeset, joined, minor_name, sentence, symbol
from nmm.base.text_format import measured
from nmm.cli.document import DocumentTable, Item, fields, number, rounded
from nmm.control.directions import SMALL_PART, direction_text
from nmm.control.resolvers.reduced_gradient import ReducedGradient

if TYPE_CHECKING:
    from nmm.cli.subjects import Studied

#: Parts of a direction below it are not written: what two decimals can tell, and what matters most.
VISIBLE, LARGE = 0.005, 0.1
#: So many motions that change σ_min are named, and minors that are 0 have a row each.
MOST_MOTIONS, MOST_ZEROS = 4, 8


def header(study: Studied) -> Iterator[Typeset]:
    robot, tasks = study.robot, stacked(study.task)
    name = robot.name if study.name == robot.name else f"{study.name}: {robot.name}"
    yield sentence(f"{name}, {robot.platform.name} platform")
    inputs = [(symbol(name), unit) for name, unit in zip(robot.u_names, robot.u_units, strict=True)]
    yield sentence("inputs: ", _with_units(inputs))
    units = [row.unit for row in tasks.rows(robot)]
    yield sentence("task: ", _with_units(list(zip(row_names(study), units, strict=True))))
    turned = [task.function for task in tasks if task.function.comparison is not None]
    if turned:
        names = [row.name for function in turned for row in function.rows(robot)]
        rows = "the rows" if len(names) == len(tasks.rows(robot)) else ", ".join(names)
        yield sentence(f"{rows} are in the frame's own axes")


def row_names(study: Studied) -> list[str]:
    names = [row.name for row in stacked(study.task).rows(study.robot)]
    return [symbol(name) if name in study.robot.q_names else name for name in names]


def _with_units(named: Sequence[tuple[str, str]]) -> Typeset:
    """ "v (m/s); omega, q1, q2 (rad/s)"."""
    runs = groupby(named, key=lambda pair: pair[1])
    return joined((sentence(joined(name for name, _ in run), f" ({unit})") for unit, run in runs), "; ")


def sizes(units: Sequence[str], length: float | None) -> Iterator[Finding]:
    """What singular values compare, where rows or inputs have different units."""
    if length is not None:
        yield Finding("sizes_in_length", {"length": length})
    elif len({unit.split("/")[0] for unit in units}) > 1:
        yield Finding("sizes_mixed")


def without_twins(groups: Sequence[tuple[str, tuple[str, ...]]]) -> list[tuple[str, str]]:
    """Keys and labels of the parts to show, without parts that have no inputs or those of another part."""
    shown: dict[tuple[str, ...], tuple[str, str]] = {}
    for name, inputs in groups:
        if inputs in shown and name != "robot":
            key, label = shown[inputs]
            shown[inputs] = (key, f"{label} ({name})")
        elif inputs and inputs not in shown:
            shown[inputs] = (name, name)
    return list(shown.values())


def described(
    study: Studied, report: SingularityReport, length: float | None, left_out: int
) -> Iterator[Item]:
    yield from header(study)
    yield _where(study)
    yield from sizes([*report.row_units, *report.input_units], length)
    yield ""
    largest = float(np.abs(report.J).max())
    cells = [[name, *(number(value, largest) for value in row)]
             for name, row in zip(report.rows, report.J, strict=True)]  # fmt: skip
    yield DocumentTable(["J", *report.inputs], cells, report.inputs, wide=True)
    sizes_of_columns = np.abs(report.J).max(axis=0)
    small = sizes_of_columns <= report.tolerance * largest
    idle = [name for name, zero in zip(report.inputs, small, strict=True) if zero]
    if idle:
        yield Finding("inputs_idle_here", {"inputs": idle})
    yield ""
    yield _parts(report)
    yield ""
    yield from _verdict(report)
    yield from _restoring(study, report)
    yield ""
    yield from _minors(report, idle, left_out)
    of_resolvers = [*_reduced_gradient(study, report)]
    if report.extended is not None:
        of_resolvers += _extended(report, report.extended)
    if of_resolvers:
        yield ""
    yield from of_resolvers


def report_data(study: Studied, report: SingularityReport) -> dict[str, Any]:
    partitions, extended = report.partitions, report.extended
    restored = "names rates regained effective best best_rate"
    return {
        **subject_data(study),
        **fields(report, "t"),
        "q": dict(zip(study.robot.q_names, report.q, strict=True)),
        **fields(report, "rows row_units row_sizes inputs input_units input_sizes J rank singular"),
        **fields(report, "singular_values sigma_min condition"),
        "parts": {
            name: fields(part, "inputs rank singular_values sigma_min condition lost")
            for name, part in report.parts.items()
        },
        **fields(report, "lost weakest given_back"),
        "by_input": fields(report.by_input, restored),
        "by_coordinate": fields(report.by_coordinate, restored),
        "minors": {", ".join(name): value for name, value in report.minors.items()},
        "partitions": [
            {"inputs": name, "determinant": value, "ratio": ratio, "singular": bool(lost)}
            for name, value, ratio, lost in zip(
                partitions.names, partitions.determinants, partitions.ratios, partitions.singular, strict=True
            )
        ],
        "extended": None
        if extended is None
        else {
            **fields(extended, "rows determinant rank singular_values angle_measure lost kinematic"),
            **fields(extended, "algorithmic"),
            "constraint_singular": extended.added_singular,
        },
    }


def subject_data(study: Studied) -> dict[str, Any]:
    return {"name": study.name, "robot": study.robot.name, "platform": study.robot.platform.name}


def _where(study: Studied) -> str:
    """Coordinates that are not 0, angles in degrees too."""
    robot = study.robot
    named = zip(robot.q_names, study.q, robot.q_units, strict=True)
    parts = [f"{name} = {measured(value, unit)}" for name, value, unit in named if value]
    if len(parts) < robot.n:
        parts.append("the rest 0" if parts else "every coordinate 0")
    time = f"at t = {study.t:g} s, " if study.t else ""
    return f"{time}where " + ", ".join(parts)


def _direction(vector: Array, names: Sequence[str], visible: float = VISIBLE) -> str:
    """A unit vector in names, "0.71 ee.x - 0.71 ee.y"; "≈" before one whose small parts are not written."""
    large = np.abs(vector) >= visible
    left_out = np.any(~large & (np.abs(vector) > SMALL_PART))
    return ("≈ " if left_out else "") + direction_text(np.where(large, np.round(vector, 2), 0.0), names)


def _directions(vectors: Array, names: Sequence[str]) -> list[str]:
    return [_direction(vector, names) for vector in vectors]


def _parts(report: SingularityReport) -> DocumentTable:
    s, largest = len(report.rows), report.singular_values[0]
    rows = []
    for key, label in without_twins([(name, part.inputs) for name, part in report.parts.items()]):
        part = report.parts[key]
        inputs = named_or_counted(part.inputs, "inputs")
        lost = named_or_counted(_directions(part.lost, report.rows), "directions", "; ")
        sizes = number(part.sigma_min, largest), number(part.condition)
        rows.append([label, inputs, f"{part.rank} of {s}", *sizes, lost if len(part.lost) else "-"])
    columns = ["part", "inputs", "rank", "σ_min", "condition", "cannot move"]
    return DocumentTable(columns, rows, ["σ_min", "condition"])


def _verdict(report: SingularityReport) -> Iterator[Finding]:
    arm = report.parts["arm"]
    if report.singular:
        lost = _directions(report.lost, report.rows)
        yield Finding("rank_lost_here", {"rank": report.rank, "rows": len(report.rows), "lost": lost})
    else:
        weakest = _direction(report.weakest, report.rows, LARGE)
        values = {"rank": report.rank, "weakest": weakest, "sigma_min": report.sigma_min}
        yield Finding("nonsingular", values)
    if len(report.given_back):
        back = _directions(report.given_back, report.rows)
        yield Finding("given_back", {"directions": back, "too_few": arm.too_few and not arm.singular})
    elif report.singular and arm.singular and report.parts["platform"].inputs:
        yield Finding("nothing_given_back")


def _restoring(study: Studied, report: SingularityReport) -> Iterator[Finding]:
    inputs, singular = report.by_input, report.singular
    if not inputs.effective:
        yield Finding("rank_not_restored" if singular else "sigma_constant")
        across = [name for name in report.by_coordinate.effective if name in study.robot.platform.coordinates]
        if singular and across:
            yield Finding("restored_across", {"coordinates": across})
        return
    values = _rates(inputs, report)
    yield (
        Finding("rank_restored", {**values, "lost": len(report.lost)})
        if singular
        else Finding("sigma_changes", values)
    )
    if len(inputs.effective) > 1 and (inputs.best_rate > 0.0 or not singular):
        best = {"direction": _direction(inputs.best, inputs.names, LARGE), "rate": inputs.best_rate}
        yield Finding("rank_restored_best" if singular else "sigma_grows", best)


def _rates(inputs: Restoration, report: SingularityReport) -> dict[str, Any]:
    """The motions with name, growth of σ_min, per what, directions regained; the strongest first."""
    units = {name: unit.split("/")[0] for name, unit in zip(report.inputs, report.input_units, strict=True)}
    order = [
        j for j in np.argsort(-np.abs(inputs.rates), kind="stable") if inputs.names[j] in inputs.effective
    ]
    motions = [
        (inputs.names[j], float(inputs.rates[j]), units[inputs.names[j]], int(inputs.regained[j]))
        for j in order[:MOST_MOTIONS]
    ]
    return {"motions": motions, "more": len(order) - len(motions)}


def _minors(report: SingularityReport, idle: list[str], left_out: int) -> Iterator[Item]:
    minors, count = report.minors, comb(len(report.inputs), len(report.rows))
    if report.singular:
        yield Finding("all_minors_zero", {"count": count})
        return
    if len(minors):
        partitions = partition_singularities(
            report.J, report.row_scales, minors.columns, report.inputs, report.singular, report.tolerance
        )
        zeros = [name for name, zero in zip(partitions.names, partitions.singular, strict=True) if zero]
        folded = zeros if len(zeros) > MOST_ZEROS and len(minors) == count else []
        rows = [
            ["0" if zero else number(value), "0" if zero else f"{share:.3g}", minor_name(name)]
            for name, value, share, zero in zip(
                partitions.names, partitions.determinants, partitions.ratios, partitions.singular, strict=True
            )
            if name not in folded
        ]
        columns = ["value", "|Δ|/√(det J Jᵀ)", "minor"]  # whose names may be long
        if rows:
            yield DocumentTable(columns, rows, columns[:2])
        if folded:
            others = [name for name in folded if not set(name) & set(idle)]
            yield Finding("some_minors_zero", {"inputs": idle, "others": others})
    gram = float(np.prod(np.linalg.svd(report.J, compute_uv=False) ** 2))
    if len(minors) == count:
        yield Finding("minor_squares", {"squares": float(np.sum(minors.array**2)), "gram": gram})
    else:
        yield Finding("gram", {"gram": gram, "count": count})
    if left_out:
        yield Finding("minors_not_listed", {"first": report.inputs[: len(report.rows)]})


def _reduced_gradient(study: Studied, report: SingularityReport) -> Iterator[Finding]:
    partitions = report.partitions
    if not partitions.names:
        return
    if partitions.kinematic:
        yield Finding("rg_kinematic")
        return
    resolver = None if study.controller is None else study.controller.resolver
    values: dict[str, Any] = {"own": isinstance(resolver, ReducedGradient) and not resolver.automatic}
    singular = {"singular": partitions.algorithmic, "count": len(partitions.names)}
    best = {} if partitions.best is None else {
        "best": partitions.best, "ratio": float(partitions.ratios[partitions.names.index(partitions.best)]),
    }  # fmt: skip
    if partitions.exhausted:
        yield Finding("rg_exhausted", values | singular)
    elif partitions.algorithmic:
        yield Finding("rg_algorithmic", values | singular | best)
    else:
        yield Finding("rg_regular", values | best)


def _extended(report: SingularityReport, extended: ExtendedSingularity) -> Iterator[Finding]:
    count, largest = len(extended.rows), float(extended.singular_values[0])
    yield Finding(
        "ej_matrix",
        {
            "added": extended.rows[len(report.rows) :],
            "determinant": rounded(extended.determinant, largest**count),
            "rank": extended.rank,
            "count": count,
            "sigma_min": rounded(extended.sigma_min, largest),
            "condition": extended.condition,
        },
    )
    if extended.kinematic:
        yield Finding("ej_kinematic")
    elif extended.added_singular:
        yield Finding("ej_added_singular")
    elif extended.algorithmic:
        yield Finding("ej_algorithmic", {"lost": _directions(extended.lost, extended.rows)})
    else:
        yield Finding("ej_angle", {"measure": extended.angle_measure})
