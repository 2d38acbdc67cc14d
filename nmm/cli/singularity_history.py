"""The numbers of a singularity analysis along a run, as tables and sentences."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from nmm.analysis.singular.algorithmic import volume
from nmm.analysis.singular.along import SingularityHistory
from nmm.analysis.singular.instants import Crossing, Dip
from nmm.analysis.singular.minors import determinants, minor_name
from nmm.arrays import Array
from nmm.cli.output import show_table
from nmm.cli.singularity_words import block, header, named_or_counted, number, say, sizes_note, without_twins
from nmm.runs.trajectory import Trajectory

if TYPE_CHECKING:
    from nmm.cli.subjects import Studied

#: A minor that stays this small beside sqrt(det J Jᵀ) is 0 on the whole motion, and its signs are rounding.
ALWAYS_ZERO = 1e-9
#: So many crossings, dips and changes of RG's partition are listed.
MOST = 40


def show_history(
    given: Studied, run: Trajectory, history: SingularityHistory, length: float | None, left_out: int
) -> None:
    """Print a history; `left_out` minors are not in it because they are many."""
    from nmm.analysis.singular.reached import stacked

    rows = stacked(given.task).rows(given.robot)
    for line in header(given):
        say(line)
    span = f"{run.t[0]:g} to {run.t[-1]:g} s" if len(run) > 1 else f"{run.t[0]:g} s"
    say(f"along a run of {run.resolver.upper()}, {span} in {len(run)} samples ({run.outcome})")
    note = sizes_note([*(row.unit for row in rows), *given.robot.u_units], length)
    if note:
        say(note)
    say()
    _show_parts(given, history)
    for line in _verdict(history):
        say(line)
    of_rg = given.controller is not None and bool(np.all(run.partition >= 0))  # for this very task
    if of_rg:
        say()
        _show_partitions(run, history)
    if len(history.minors):
        say()
        _show_crossings(run if of_rg else None, history)
    if left_out:
        say()
        named = ",".join(history.inputs[: len(history.rows)])
        say(f"{left_out} minors are not looked at: --minors does, --minor {named} looks at this one")
    if history.extended_sigma_min is not None:
        say()
        for line in _extended(history, history.extended_sigma_min):
            say(line)


def _show_parts(given: Studied, history: SingularityHistory) -> None:
    groups = {**given.robot.groups, "robot": given.robot.u_names}
    largest = float(history.singular_values.max())
    rows = []
    for key, label in without_twins([(name, groups[name]) for name in history.sigma_min]):
        sigma = history.sigma_min[key]
        rows.append(
            [
                label,
                named_or_counted(groups[key], "inputs"),
                number(sigma.min(), largest),
                f"{history.t[sigma.argmin()]:g} s",
                number(sigma.max(), largest),
            ]
        )
    show_table(
        ["part", "inputs", "smallest σ_min", "at", "largest σ_min"],
        rows,
        numeric=["smallest σ_min", "at", "largest σ_min"],
    )
    say()


def _verdict(history: SingularityHistory) -> Iterator[str]:
    """Rank, condition, low minima of σ_min, and what the platform does for the arm."""
    s, whole = len(history.rows), history.sigma_min["robot"]
    singular = np.flatnonzero(history.rank < s)
    if len(singular):
        yield (
            f"Singular at {len(singular)} of {len(history.t)} samples, the first at "
            f"{history.t[singular[0]]:g} s: rank {history.rank[singular].min()} of {s}."
        )
    else:
        worst = int(history.condition.argmax())
        yield (
            f"J has rank {s} at every sample; its condition is at most {number(history.condition[worst])}, "
            f"at {history.t[worst]:g} s."
        )
    if history.dips:
        yield f"σ_min comes below {history.threshold:.3g} at {_dips(history.dips)}."
    else:
        yield f"σ_min never comes below {history.threshold:.3g}."
    if "arm" in history.sigma_min and history.sigma_min["arm"].min() < history.threshold <= whole.min():
        arm = history.sigma_min["arm"]
        lowest = f"{number(arm.min(), float(history.singular_values.max()))} at {history.t[arm.argmin()]:g} s"
        yield f"The arm alone does, down to {lowest}: the platform makes up for it."


def _dips(dips: Sequence[Dip]) -> str:
    parts = [f"{dip.t:.4g} s ({dip.value:.2g}{', an end' if dip.at_end else ''})" for dip in dips[:MOST]]
    more = len(dips) - len(parts)
    return ", ".join(parts) + (f" and {more} more times" if more else "")


def _show_partitions(run: Trajectory, history: SingularityHistory) -> None:
    """When RG used which partition, and how near to singular it was."""
    used = run.partition
    starts = [0, *(np.flatnonzero(np.any(np.diff(used, axis=0) != 0, axis=1)) + 1), len(used)]
    rows = []
    for first, end in list(pairwise(starts))[:MOST]:
        share = _shares(history, used[first])[first:end]
        lowest = int(share.argmin())
        rows.append(
            [
                f"{run.t[first]:g} s",
                f"{run.t[end - 1]:g} s",
                f"{share[lowest]:.3g}",
                f"{run.t[first + lowest]:g} s",
                block([history.inputs[j] for j in used[first]]),
            ]
        )
    columns = ["from", "to", "smallest |det Ja|/√(det J Jᵀ)", "at", "RG's partition"]
    show_table(columns, rows, numeric=columns[:4])
    if len(starts) - 1 > MOST:
        say(f"and {len(starts) - 1 - MOST} more changes")


def _shares(history: SingularityHistory, columns: Array) -> Array:
    """|det Ja| / sqrt(det J Jᵀ) of one partition, (N,); 0 where J lost rank."""
    whole = volume(history.J)
    found = np.abs(determinants(history.J, np.array([columns])))[:, 0]
    return np.divide(found, whole, out=np.zeros_like(found), where=whole > 0.0)


def _show_crossings(run: Trajectory | None, history: SingularityHistory) -> None:
    """Changes of sign; with the partition then in use, of a run of RG."""
    dead = {
        name
        for name, ratio in zip(history.minors.names, history.ratios.max(axis=0), strict=True)
        if ratio <= ALWAYS_ZERO
    }
    crossings = [crossing for crossing in history.crossings if crossing.columns not in dead]
    if crossings:
        rows = [
            [
                f"{crossing.t:.4g} s",
                "+" if crossing.sign > 0 else "-",
                minor_name(crossing.columns),
                *([_used(run, crossing)] if run is not None else []),
            ]
            for crossing in crossings
        ]
        columns = ["at", "to", "minor that changes its sign", *(["RG uses"] if run is not None else [])]
        show_table(columns, rows[:MOST], numeric=["at"])
        if len(rows) > MOST:
            say(f"and {len(rows) - MOST} more: --json has all, --minor chooses")
    else:
        say("No minor changes its sign.")
    if dead:
        names = [minor_name(name) for name in sorted(dead)]
        say(f"0 on the whole motion: {named_or_counted(names, 'minors')}")


def _used(run: Trajectory, crossing: Crossing) -> str:
    """RG's partition at a crossing, or that it is this very one."""
    names = [run.robot.u_names[j] for j in run.partition[crossing.before]]
    return "this one" if set(names) == set(crossing.columns) else block(names)


def _extended(history: SingularityHistory, sigma: Array) -> Iterator[str]:
    lowest = int(sigma.argmin())
    yield f"EJ: σ_min of J_e is at least {number(float(sigma[lowest]))}, at {history.t[lowest]:g} s."
    if history.extended_dips:
        yield f"It comes below {history.threshold:.3g} at {_dips(history.extended_dips)}."
        if not history.dips:
            yield "J's does not: these are algorithmic, EJ's own."
