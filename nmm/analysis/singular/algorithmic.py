"""Singularities of the resolvers' own matrices: EJ's J_e and RG's Ja may lose rank where J does not."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nmm.analysis.singular.minors import determinants
from nmm.analysis.singular.parts import Ranked, ranks, singular_values
from nmm.base.arrays import Array, Flags, Integers
from nmm.control.directions import readable_basis


@dataclass(frozen=True, eq=False)
class ExtendedSingularity(Ranked):
    """The extended Jacobian J_e = [J; J_y] (m, m) beside J.

    Attributes
    ----------
    rows : names of J's rows and of the added task's
    determinant : of J_e, as it is
    singular_values (m,), rank : of J_e, scaled by the sizes
    angle_measure : |det J_e| / sqrt(det J Jᵀ det J_y J_yᵀ), from 0 to 1 (Fischer's inequality): 1 if the
        added task moves only what the task leaves free, 0 if it asks for what the task already fixes; NaN
        where J or J_y itself lost rank
    lost (m - rank, m) : combinations of the rows that no input moves
    kinematic, added_singular : J itself, or the added task's J_y itself, lost rank

    Examples
    --------
    >>> scenario = nmm.Scenario.load("unicycle_2r_extended_jacobian")
    >>> robot = scenario.robot()
    >>> report = nmm.analysis.analyse(scenario.controller(), robot.q(scenario.parts.q0))
    >>> report.extended.rank, report.extended.algorithmic
    (4, False)
    """

    rows: tuple[str, ...]
    determinant: float
    singular_values: Array
    rank: int
    angle_measure: float
    lost: Array
    kinematic: bool
    added_singular: bool

    @property
    def algorithmic(self) -> bool:
        """J_e lost rank though J did not: EJ fails where other resolvers do not."""
        return not self.kinematic and self.rank < len(self.rows)


@dataclass(frozen=True, eq=False)
class PartitionSingularities:
    """The blocks Ja of the reduced gradient, one a candidate, beside J.

    Attributes
    ----------
    names : the inputs of each candidate
    determinants (count,) : det Ja
    ratios (count,) : |det Ja| / sqrt(det J Jᵀ), from 0 to 1 (Cauchy-Binet), RG's measure with automatic
        partitions; zeros where J lost rank
    singular (count,) : whether Ja lost rank: with rows in their natural sizes, σ_min(Ja) is at most
        `tolerance` times J's largest singular value, or times 1 if that is more
    kinematic : J itself lost rank, and with it every Ja

    Examples
    --------
    >>> scenario = nmm.Scenario.load("unicycle_3r_position")
    >>> robot = scenario.robot()
    >>> report = nmm.analysis.analyse(scenario.controller(), robot.q(scenario.parts.q0))
    >>> len(report.partitions.names), report.partitions.algorithmic
    (3, ())
    """

    names: tuple[tuple[str, ...], ...]
    determinants: Array
    ratios: Array
    singular: Flags
    kinematic: bool

    @property
    def algorithmic(self) -> tuple[tuple[str, ...], ...]:
        """Candidates whose Ja is singular though J is not."""
        if self.kinematic:
            return ()
        return tuple(name for name, lost in zip(self.names, self.singular, strict=True) if lost)

    @property
    def best(self) -> tuple[str, ...] | None:
        """The candidate with the largest |det Ja|; None when all are singular."""
        if not self.names or np.all(self.singular):
            return None
        return self.names[int(np.argmax(np.where(self.singular, -1.0, np.abs(self.determinants))))]

    @property
    def exhausted(self) -> bool:
        """No candidate is left though J has full rank: RG fails where other resolvers do not."""
        return not self.kinematic and bool(self.names) and self.best is None


def volume(J: Array) -> Array:
    """sqrt(det J Jᵀ) of J (..., s, m): the product of its singular values."""
    return np.prod(singular_values(J), axis=-1)


def extended_singularity(
    J: Array,
    added_J: Array,
    sizes: tuple[Array, Array, Array],
    rows: tuple[str, ...],
    tolerance: float,
    natural: float,
) -> ExtendedSingularity:
    """From J (s, m) and added_J (m - s, m) as they are; `sizes` of rows, added rows and inputs."""
    *row_sizes, input_sizes = sizes
    s, extended = len(J), np.vstack([J, added_J])
    scaled = extended * input_sizes / np.concatenate(row_sizes)[:, np.newaxis]
    values = singular_values(scaled)
    U = np.linalg.svd(scaled)[0]
    rank = int(ranks(values, values[0], tolerance, natural))

    def lost_rank(block: Array) -> bool:
        own = singular_values(block)
        return len(block) > 0 and int(ranks(own, own[0], tolerance, natural)) < len(block)

    kinematic, added_singular = lost_rank(scaled[:s]), lost_rank(scaled[s:])
    regular = not (kinematic or added_singular)
    measure = np.prod(values) / (volume(scaled[:s]) * volume(scaled[s:])) if regular else np.nan
    return ExtendedSingularity(
        rows=rows,
        determinant=float(np.linalg.det(extended)),
        singular_values=values,
        rank=rank,
        angle_measure=float(measure),
        lost=readable_basis(U[:, rank:].T),
        kinematic=kinematic,
        added_singular=added_singular,
    )


def partition_singularities(
    J: Array, scales: Array, columns: Integers, inputs: tuple[str, ...], kinematic: bool, tolerance: float
) -> PartitionSingularities:
    """From J (s, m) as it is, its rows' natural sizes (s,) and the candidates' columns (count, s)."""
    natural = J / scales[:, np.newaxis]
    values = singular_values(np.moveaxis(natural[:, columns], 1, 0))
    dets = determinants(J, columns)
    # Judged beside J: a block of pure rounding may itself be well conditioned.
    lost = np.asarray(ranks(values, singular_values(natural)[0], tolerance) < len(J))
    whole = 0.0 if kinematic else float(volume(J))
    return PartitionSingularities(
        names=tuple(tuple(inputs[j] for j in row) for row in columns),
        determinants=dets,
        ratios=np.abs(dets) / whole if whole > 0.0 else np.zeros(len(dets)),
        singular=lost,
        kinematic=kinematic,
    )
