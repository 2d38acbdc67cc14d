"""What `nmm singularities` shows of a run: tables, findings, and the same for scripts."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from nmm.analysis.singular.algorithmic import volume
from nmm.analysis.singular.along import Dip, SingularityHistory
from nmm.analysis.singular.jacobians import stacked
from nmm.analysis.singular.minors import determinants
from nmm.base.arrays import Array
from nmm.base.findings import Finding
from nmm.base.findings.singularities import named_or_counted
from nmm.base.latex import block, minor_name
from nmm.cli.document import DocumentTable, Item, fields, number, rounded
from nmm.cli.singularity_report import header, sizes, subject_data, without_twins
from nmm.motion.trajectory import Trajectory

if TYPE_CHECKING:
    from nmm.cli.subjects import Studied

#: A minor that stays this small beside sqrt(det J Jᵀ) is 0 on the whole motion, and its signs are rounding.
ALWAYS_ZERO = 1e-9
#: So many crossings, dips and changes of RG's partition are listed.
MOST = 40


def described(
    study: Studied, run: Trajectory, history: SingularityHistory, length: float | None, left_out: int
) -> Iterator[Item]:
    yield from header(study)
    span = f"{run.t[0]:g} to {run.t[-1]:g} s" if len(run) > 1 else f"{run.t[0]:g} s"
    yield f"along a run of {run.resolver.upper()}, {span} in {len(run)} samples ({run.outcome})"
    rows = stacked(study.task).rows(study.robot)
    yield from sizes([*(row.unit for row in rows), *study.robot.u_units], length)
    yield ""
    yield _parts(study, history)
    yield ""
    yield from _verdict(history)
    of_rg = study.controller is not None and bool(np.all(run.partition >= 0))  # for this very task
    if of_rg:
        yield ""
        yield from _partitions(run, history)
    if len(history.minors):
        yield ""
        yield from _crossings(run if of_rg else None, history)
    if left_out:
        yield ""
        first = history.inputs[: len(history.rows)]
        yield Finding("minors_not_followed", {"count": left_out, "first": first})
    if history.extended_sigma_min is not None:
        yield ""
        yield from _extended(history, history.extended_sigma_min)


def history_data(study: Studied, history: SingularityHistory) -> dict[str, Any]:
    return {
        **subject_data(study),
        **fields(history, "rows inputs t rank condition"),
        "sigma_min": dict(history.sigma_min),
        "extended_sigma_min": history.extended_sigma_min,
        "minors": {", ".join(name): values for name, values in history.minors.items()},
        "threshold": history.threshold,
        "crossings": [fields(crossing, "t columns sign") for crossing in history.crossings],
        "dips": [fields(dip, "t value at_end") for dip in history.dips],
        "extended_dips": [fields(dip, "t value at_end") for dip in history.extended_dips],
    }


def _parts(study: Studied, history: SingularityHistory) -> DocumentTable:
    groups = {**study.robot.groups, "robot": study.robot.u_names}
    largest = float(history.singular_values.max())
    rows = []
    for key, label in without_twins([(name, groups[name]) for name in history.sigma_min]):
        sigma = history.sigma_min[key]
        inputs, at = named_or_counted(groups[key], "inputs"), f"{history.t[sigma.argmin()]:g} s"
        rows.append([label, inputs, number(sigma.min(), largest), at, number(sigma.max(), largest)])
    columns = ["part", "inputs", "smallest σ_min", "at", "largest σ_min"]
    return DocumentTable(columns, rows, columns[2:])


def _verdict(history: SingularityHistory) -> Iterator[Finding]:
    s, whole, t = len(history.rows), history.sigma_min["robot"], history.t
    singular = np.flatnonzero(history.rank < s)
    if len(singular):
        counts = {"singular": len(singular), "samples": len(t), "t": float(t[singular[0]])}
        yield Finding("run_singular", {**counts, "rank": int(history.rank[singular].min()), "rows": s})
    else:
        worst = int(history.condition.argmax())
        condition = float(history.condition[worst])
        yield Finding("run_regular", {"rows": s, "condition": condition, "t": float(t[worst])})
    if history.dips:
        yield Finding("sigma_dips", {"threshold": history.threshold, **_dips(history.dips)})
    else:
        yield Finding("sigma_stays", {"threshold": history.threshold})
    arm = history.sigma_min.get("arm")
    if arm is not None and arm.min() < history.threshold <= whole.min():
        lowest = rounded(arm.min(), float(history.singular_values.max()))
        yield Finding("arm_dips", {"sigma_min": lowest, "t": float(t[arm.argmin()])})


def _dips(dips: Sequence[Dip]) -> dict[str, Any]:
    """The first ones as (s, σ_min, whether at an end), and how many more."""
    shown = [(dip.t, dip.value, dip.at_end) for dip in dips[:MOST]]
    return {"dips": shown, "more": len(dips) - len(shown)}


def _partitions(run: Trajectory, history: SingularityHistory) -> Iterator[Item]:
    """When RG used which partition, and how near to singular it was."""
    used = run.partition
    starts = [0, *(np.flatnonzero(np.any(np.diff(used, axis=0) != 0, axis=1)) + 1), len(used)]
    rows = []
    for first, end in list(pairwise(starts))[:MOST]:
        J = history.J[first:end]
        whole, minors = volume(J), np.abs(determinants(J, np.array([used[first]])))[:, 0]
        share = np.divide(minors, whole, out=np.zeros_like(minors), where=whole > 0.0)  # 0 where J lost rank
        lowest = int(share.argmin())
        begins, ends, at = (f"{run.t[k]:g} s" for k in (first, end - 1, first + lowest))
        columns = block([history.inputs[j] for j in used[first]])
        rows.append([begins, ends, f"{share[lowest]:.3g}", at, columns])
    names = ["from", "to", "smallest |det Ja|/√(det J Jᵀ)", "at", "RG's partition"]
    yield DocumentTable(names, rows, names[:4])
    if len(starts) - 1 > MOST:
        yield Finding("more_partition_changes", {"count": len(starts) - 1 - MOST})


def _crossings(run: Trajectory | None, history: SingularityHistory) -> Iterator[Item]:
    ratios = zip(history.minors.names, history.ratios.max(axis=0), strict=True)
    dead = {name for name, ratio in ratios if ratio <= ALWAYS_ZERO}
    crossings = [crossing for crossing in history.crossings if crossing.columns not in dead]
    if crossings:
        rows = []
        for crossing in crossings:
            used = []
            if run is not None:
                names = [run.robot.u_names[j] for j in run.partition[crossing.before]]
                used.append("this one" if set(names) == set(crossing.columns) else block(names))
            rows.append(
                [
                    f"{crossing.t:.4g} s",
                    "+" if crossing.sign > 0 else "-",
                    minor_name(crossing.columns),
                    *used,
                ]
            )
        columns = ["at", "to", "minor that changes its sign", *(["RG uses"] if run is not None else [])]
        yield DocumentTable(columns, rows[:MOST], ["at"])
        if len(rows) > MOST:
            yield Finding("more_crossings", {"count": len(rows) - MOST})
    else:
        yield Finding("no_crossing")
    if dead:
        yield Finding("zero_throughout", {"minors": sorted(dead)})


def _extended(history: SingularityHistory, sigma: Array) -> Iterator[Finding]:
    lowest = int(sigma.argmin())
    yield Finding("ej_sigma", {"sigma_min": float(sigma[lowest]), "t": float(history.t[lowest])})
    if history.extended_dips:
        yield Finding("ej_dips", {"threshold": history.threshold, **_dips(history.extended_dips)})
        if not history.dips:
            yield Finding("ej_algorithmic_dips")
