"""What a resolver returns: inputs, status and certificate."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from nmm.base.arrays import Array
from nmm.base.kernels.compiled import compiled, inlined
from nmm.base.kernels.linear_algebra import norm, residual_norm
from nmm.base.kernels.record_layout import SampledCell, SampledVector
from nmm.control.resolvers.problem_arrays import ProblemArrays


class Status(IntEnum):
    """The outcome of a resolution; only those before `SINGULAR_J` have inputs.

    Examples
    --------
    >>> problem = nmm.Problem(J=[[0.0, 0.0]], rate=[2.0], h=[0.0, 0.0])
    >>> status = nmm.ProjectedGradient().resolve(problem).status
    >>> status.name, status.usable, status.meaning
    ('SINGULAR_J', False, 'the task Jacobian J lost rank')
    """

    SOLVED = 0
    RELAXED = 1
    INEXACT = 2
    FALLBACK = 3
    SINGULAR_J = 4
    SINGULAR_JA = 5
    SINGULAR_JE = 6
    NOT_FINITE = 7

    @property
    def usable(self) -> bool:
        """Whether there are inputs."""
        return self < Status.SINGULAR_J

    @property
    def meaning(self) -> str:
        """A sentence for people, with advice."""
        return _MEANINGS[self]


_MEANINGS = {
    Status.SOLVED: "solved",
    Status.RELAXED: "the rate of the task, or of an added one, was scaled or damped on purpose",
    Status.INEXACT: "J u differs from the rate that the task asks for, unintentionally",
    Status.FALLBACK: "there was no answer to bring within the limits: the inputs are those nearest to rest",
    Status.SINGULAR_J: "the task Jacobian J lost rank",
    Status.SINGULAR_JA: "the block Ja of the reduced gradient is singular though J is not: "
    "give more partitions, or partitions: automatic",
    Status.SINGULAR_JE: "the extended Jacobian J_e is singular though J is not (algorithmic singularity): "
    "the added task asks here for what the task already fixes",
    Status.NOT_FINITE: "an input is not finite",
}

#: The same as integers, for kernels.
SOLVED, RELAXED, INEXACT, FALLBACK, SINGULAR_J, SINGULAR_JA, SINGULAR_JE, NOT_FINITE = map(int, Status)

#: J u may differ from the rate by this much, times 1 + ‖rate‖, in the rows' units, due to rounding.
EXACT = 1e-9


class AnswerArrays(NamedTuple):
    """An `Answer` as kernels write it: u (m,); status, residual, measure, side, excess (); nu (levels,).

    Before the kernel is called u, residual, measure and excess are NaN, status is NOT_FINITE, side is 0 and
    nu is 1. A finite excess means that the kernel enforced limits. `side` is the sign of det J_e where the
    extended Jacobian inverts it: between samples on different sides J_e is singular.

    Examples
    --------
    >>> written = nmm.extending.AnswerArrays(
    ...     u=np.zeros(2), status=np.array(0.0), nu=np.ones(1),
    ...     residual=np.array(0.0), measure=np.array(1.0), side=np.array(0.0),
    ...     excess=np.array(0.0),
    ... )
    >>> nmm.Answer.of(written).status.name
    'SOLVED'
    """

    u: SampledVector
    status: SampledCell
    nu: SampledVector
    residual: SampledCell
    measure: SampledCell
    side: SampledCell
    excess: SampledCell


def unanswered(m: int, levels: int) -> AnswerArrays:
    return AnswerArrays(
        u=np.full(m, np.nan),
        status=np.array(float(NOT_FINITE)),
        nu=np.ones(levels),
        residual=np.array(np.nan),
        measure=np.array(np.nan),
        side=np.array(0.0),
        excess=np.array(np.nan),
    )


@dataclass(frozen=True, eq=False)
class Answer:
    """A resolver's answer, with its certificate.

    Attributes
    ----------
    u : (m,) the inputs; NaN where the status is not `usable`
    status : the outcome
    nu : (levels,) ν, the share of each level's rate that is given; below 1 where the status is RELAXED, 0
        where it is FALLBACK
    residual : ‖J u - rate‖
    measure : of the matrix inverted: PG and EJ, its last pivot (rows in their scales) over its first, or
        over 1 if that is larger; RG, |det Ja|, divided by sqrt(det J Jᵀ) with automatic partitions; DLS, the
        least singular value (rows in their scales)
    excess : by how much contradictory rows of limits had to be widened, in their units

    Examples
    --------
    >>> problem = nmm.Problem(J=[[1.0, 1.0]], rate=[2.0], h=[0.0, 0.0])
    >>> answer = nmm.ProjectedGradient().resolve(problem)
    >>> answer.u.round(3), answer.status.name, answer.residual < 1e-12
    (array([1., 1.]), 'SOLVED', True)
    """

    u: Array
    status: Status
    nu: Array
    residual: float
    measure: float
    excess: float = 0.0

    @property
    def singular(self) -> bool:
        """Whether there are no inputs, as the matrix to invert lost rank or something is not finite."""
        return not self.status.usable

    @classmethod
    def of(cls, written: AnswerArrays) -> Answer:
        """A copy of what a kernel wrote."""
        status, numbers = Status(int(written.status[()])), (written.residual, written.measure, written.excess)
        return cls(written.u.copy(), status, written.nu.copy(), *(float(cell[()]) for cell in numbers))


@inlined
def certified(residual: float, rounding: float, asked: float) -> int:
    """The status for a residual ‖J u - rate‖, part of which rounding may hide; asked = ‖rate‖. Where u is
    about 1e7 times larger than the rate, rounding prevents a certificate: the status is INEXACT, too."""
    if not math.isfinite(residual + rounding + asked):  # squares that overflow certify nothing
        return NOT_FINITE
    return INEXACT if residual + rounding > EXACT * (1.0 + asked) else SOLVED


@compiled
def certify(problem: ProblemArrays, answer: AnswerArrays) -> None:
    """Write residual and status (solved, inexact or not finite) of the u that was written."""
    residual, rounding = residual_norm(problem.J, answer.u, problem.rate)
    answer.residual[()] = residual
    answer.status[()] = certified(residual, rounding, norm(problem.rate))


@compiled
def added_residual(problem: ProblemArrays, u: Array) -> float:
    """‖J_added u - rate_added‖, 0 where rounding hides it and without an added task."""
    missed, _ = residual_norm(problem.added_J, u, problem.added_rate)
    return missed if missed > EXACT * (1.0 + norm(problem.added_rate)) else 0.0
