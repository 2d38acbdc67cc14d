"""Minors of J, RG's partitions and EJ's J_e at one configuration: zero, and whose zero it is."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import comb
from typing import TYPE_CHECKING

import numpy as np

from nmm.analysis.singular.algorithmic import PartitionSingularities, partition_singularities
from nmm.analysis.singular.minors import minor_name
from nmm.analysis.singular.singularity import SingularityReport
from nmm.cli.output import show_table
from nmm.cli.singularity_words import block, directions, number, say
from nmm.resolvers.reduced_gradient import ReducedGradient

if TYPE_CHECKING:
    from nmm.cli.subjects import Studied

#: So many of RG's partitions are named, and minors that are 0 have a row each.
MOST_BLOCKS, MOST_ZEROS = 6, 8
#: Names of minors that are 0 are listed up to so many characters.
MOST_TEXT = 160


def show_minors(report: SingularityReport, left_out: int) -> None:
    minors, count = report.minors, comb(len(report.inputs), len(report.rows))
    if report.singular:
        say(f"All {count} minors are 0, and det J Jᵀ with them." if count > 1 else "The only minor is 0.")
        return
    if len(minors):
        found = partition_singularities(
            report.J, report.row_scales, minors.columns, report.inputs, report.singular, report.tolerance
        )
        folded = _folded(report, found) if len(minors) == count else ()
        rows = [
            ["0" if zero else number(value), _ratio(share, zero), minor_name(name)]
            for name, value, share, zero in zip(
                found.names, found.determinants, found.ratios, found.singular, strict=True
            )
            if name not in folded
        ]
        columns = ["value", "|Δ|/√(det J Jᵀ)", "minor"]  # whose names may be long
        if rows:
            show_table(columns, rows, numeric=columns[:2])
        if folded:
            say(f"0: {_zeros(report, folded)}")
    gram = float(np.prod(np.linalg.svd(report.J, compute_uv=False) ** 2))
    if len(minors) == count:
        say(f"sum of their squares {np.sum(minors.array**2):.6g}, det J Jᵀ {gram:.6g} (equal: Cauchy-Binet)")
    else:
        say(f"det J Jᵀ {gram:.6g}, the sum of the squares of all {count} minors")
    if left_out:
        named = ",".join(report.inputs[: len(report.rows)])
        say(f"they are not listed: --minors lists all, --minor {named} that one")


def _ratio(share: float, zero: bool) -> str:
    return "0" if zero else f"{share:.3g}"


def _folded(report: SingularityReport, found: PartitionSingularities) -> tuple[tuple[str, ...], ...]:
    """Minors that are 0, when they are too many for a row each."""
    zeros = tuple(name for name, zero in zip(found.names, found.singular, strict=True) if zero)
    return zeros if len(zeros) > MOST_ZEROS else ()


def _zeros(report: SingularityReport, zeros: Sequence[tuple[str, ...]]) -> str:
    """Those with a column that is 0 in a word, then the others."""
    idle = idle_inputs(report)
    others = [name for name in zeros if not set(name) & set(idle)]
    parts = [f"every minor with {' or '.join(idle)}"] if idle else []
    if others:
        names = ", ".join(map(minor_name, others))
        parts.append(names if len(names) <= MOST_TEXT else f"{len(others)} {'others' if idle else 'minors'}")
    return "; ".join(parts)


def reduced_gradient(given: Studied, report: SingularityReport) -> Iterator[str]:
    """What RG's partitions do here, beside J."""
    found = report.partitions
    if not found.names:
        return
    if found.kinematic:
        yield "The singularity is kinematic, J's own: RG fails with every partition, as other resolvers do."
        return
    resolver = None if given.controller is None else given.controller.resolver
    own = isinstance(resolver, ReducedGradient) and not resolver.automatic
    who = "RG, with the scenario's partitions:" if own else "RG:"
    if found.exhausted:
        yield f"{who} {_partitions(found)} singular, algorithmic: J is not, but RG has no other partition."
        return
    best = "" if found.best is None else f"; best is {block(found.best)} ({_share(found):.3g})"
    if found.algorithmic:
        yield f"{who} {_partitions(found)} singular though J is not (algorithmic){best}."
    else:
        yield f"{who} no partition is singular here{best}."


def _partitions(found: PartitionSingularities) -> str:
    names = found.algorithmic
    if len(names) > MOST_BLOCKS:
        return f"{len(names)} of {len(found.names)} partitions are"
    return ", ".join(block(name) for name in names) + (" is" if len(names) == 1 else " are")


def _share(found: PartitionSingularities) -> float:
    return float(found.ratios[found.names.index(found.best)]) if found.best is not None else 0.0


def extended(report: SingularityReport) -> Iterator[str]:
    """What EJ's J_e does here, beside J."""
    found = report.extended
    if found is None:
        return
    added = ", ".join(found.rows[len(report.rows) :])
    count, largest = len(found.rows), float(found.singular_values[0])
    yield (
        f"EJ, with the added task {added}: det J_e = {number(found.determinant, largest**count)}, "
        f"rank {found.rank} of {count}, σ_min {number(found.sigma_min, largest)}, "
        f"condition {number(found.condition)}."
    )
    if found.kinematic:
        yield "J_e is singular because J is: a kinematic singularity."
    elif found.added_singular:
        yield "EJ fails here though J has full rank: the added task's own rows depend on each other."
    elif found.algorithmic:
        yield (
            "An algorithmic singularity: J_e is singular though neither J nor the added task's J_y is. "
            f"Both speak of the same: no input moves {directions(found.lost, found.rows)}."
        )
    else:
        yield (
            f"|det J_e|/√(det J Jᵀ det J_y J_yᵀ) = {found.angle_measure:.3g}: 1 where the added task moves "
            "only what the task leaves free, 0 where it asks for what the task fixes."
        )


def idle_inputs(report: SingularityReport) -> list[str]:
    """Inputs whose column of J is 0."""
    sizes = np.abs(report.J).max(axis=0)
    small = report.tolerance * sizes.max()
    return [name for name, size in zip(report.inputs, sizes, strict=True) if size <= small]
