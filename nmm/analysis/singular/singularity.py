"""Where a robot stands with a task at one configuration: rank, what is lost and how it comes back."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from nmm.analysis.singular.algorithmic import (
    ExtendedSingularity,
    PartitionSingularities,
    extended_singularity,
    partition_singularities,
)
from nmm.analysis.singular.jacobians import Candidates, Jacobians, Subject, Tasks, checked
from nmm.analysis.singular.minors import (
    MOST_MINORS,
    Choice,
    Minors,
    chosen_columns,
    determinant_rates,
    determinants,
)
from nmm.analysis.singular.parts import (
    WHOLE,
    Part,
    Ranked,
    Restoration,
    given_back,
    groups,
    part,
    restoration,
)
from nmm.base.arrays import Array, Integers, positive
from nmm.control.directions import direction_texts
from nmm.control.resolvers.partitions import candidate_columns
from nmm.control.resolvers.problem import Dimensions
from nmm.control.resolvers.reduced_gradient import ReducedGradient

#: Singular values this small beside the largest are zero; the resolvers' own tolerance.
TOLERANCE = 1e-10


@dataclass(frozen=True, eq=False)
class SingularityReport(Ranked):
    """The task's J at (t, q), taken apart. Parts, restorations and lost directions are those of `scaled_J`.

    Attributes
    ----------
    t, q (n,) : where
    rows, inputs : names of J's rows and columns, with `row_units`, `input_units`
    J (s, m) : J_bar as it is (paper, eq. 13); J_u (m, s, m) : its derivative along each input, per m or rad
    row_scales (s,) : natural sizes of the rows, in which lost ranks are judged
    row_sizes (s,), input_sizes (m,) : how much of each counts as 1
    parts : "platform", "arm", the arms by name, "robot": who can do what
    singular_values (s,), rank, lost (s - rank, s) : of all inputs together (see `Part`)
    weakest (s,) : the task's direction that moves least, a left singular vector of σ_min
    given_back (k, s) : directions that the arm has lost and the platform gives back
    minors : of J as it is, by the names of their columns
    by_input, by_coordinate : which motions bring back what is lost; those along the coordinates include
        motions that the wheels do not admit
    extended : J_e beside J; None without an added task
    partitions : every candidate's Ja beside J
    tolerance : singular values this small beside the largest, or beside a row of natural size, are zero

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> report = nmm.analysis.analyse((robot, nmm.Position("ee", "xy")), {"q1": 0.5})
    >>> report.singular, round(report.minors["v, omega"], 3), report.parts["arm"].singular
    (False, 1.002, True)
    """

    t: float
    q: Array
    rows: tuple[str, ...]
    row_units: tuple[str, ...]
    inputs: tuple[str, ...]
    input_units: tuple[str, ...]
    J: Array
    J_u: Array
    row_scales: Array
    row_sizes: Array
    input_sizes: Array
    parts: Mapping[str, Part]
    singular_values: Array
    rank: int
    lost: Array
    weakest: Array
    given_back: Array
    minors: Minors
    by_input: Restoration
    by_coordinate: Restoration
    extended: ExtendedSingularity | None
    partitions: PartitionSingularities
    tolerance: float

    @property
    def whole(self) -> Part:
        """All inputs together."""
        return self.parts[WHOLE]

    @property
    def scaled_J(self) -> Array:
        """J_ij * input_sizes[j] / row_sizes[i]."""
        return self.J * self.input_sizes / self.row_sizes[:, np.newaxis]

    @property
    def singular(self) -> bool:
        """Whether J lost rank: a kinematic singularity, for every resolver."""
        return self.rank < len(self.rows)

    @property
    def given_back_text(self) -> tuple[str, ...]:
        """`given_back` in the rows' names."""
        return direction_texts(self.given_back, self.rows)

    @cached_property
    def minor_rates(self) -> Minors:
        """Derivatives of the minors along each input, per m or rad: an item is (m,).

        Where J lost one rank, a motion restores it exactly if some minor changes along it.
        """
        rates = determinant_rates(self.J, self.J_u, self.minors.columns)
        return Minors(self.minors.columns, rates, self.inputs)


def analyse(
    subject: Subject,
    q: ArrayLike | Mapping[str, float],
    t: float = 0.0,
    *,
    length: float | None = None,
    sizes: Mapping[str, float] | None = None,
    minors: Choice = True,
    most_minors: int = MOST_MINORS,
    added_task: Tasks | None = None,
    partitions: Candidates = None,
    tolerance: float = TOLERANCE,
) -> SingularityReport:
    """Analyse the task's J_bar at (t, q).

    Singular values compare different units. Without `length` and `sizes`, 1 m, 1 rad, 1 m/s and 1 rad/s
    count as equal. With a characteristic length L, such as the arm's reach, rows in m and inputs in m/s
    count in L: σ_min and condition then do not depend on the unit of length. Rank, minors and which motions
    restore rank do not depend on L; lost directions are written in those sizes.

    Parameters
    ----------
    subject : a controller, or (robot, task); the controller is not run and keeps its partition
    q : (n,) m and rad, or by name
    t : s
    length : characteristic length L, m
    sizes : how much of a row or input counts as 1, by name, in its unit; overrides `length`
    minors : True for all, False for none, or a list of those wanted, ["v, q1", ("v", "omega")]
    most_minors : `InputError` when there are more
    added_task : EJ's added task; None for the controller's own
    partitions : RG's candidates: lists of inputs or "automatic"; None for the controller's RG's, or else the
        minors'
    tolerance : singular values this small beside the largest, or beside a row of natural size, are zero

    Raises
    ------
    InputError : a task of more rows than inputs, q of another length, an unknown name, too many minors
    SingularError : there is no J: the wheels cannot roll there, or the task is undefined

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> report = nmm.analysis.analyse((robot, nmm.Position("ee", "xy")), {"q2": 0.0})
    >>> report.rank, round(report.sigma_min, 3), report.given_back_text
    (2, 1.0, ('ee.x',))
    """
    jacobians = Jacobians(subject, added_task)
    t, q = checked(jacobians, t, q)
    tolerance = positive(tolerance, "tolerance")
    robot, rows = jacobians.robot, jacobians.row_names
    columns = chosen_columns(minors, robot.u_names, len(rows), most_minors)
    all_sizes = row_sizes, _, input_sizes = jacobians.sizes(length, sizes)
    blocks = _candidates(jacobians, partitions, minors, columns)

    def scaled(matrix: Array) -> Array:
        return matrix * input_sizes / row_sizes[:, np.newaxis]

    J, added_J = jacobians.J(t, q), jacobians.added_J(t, q)
    scaled_J = scaled(J)
    J_u, J_q = (jacobians.along(t, q, motions) for motions in (robot.S(q), robot.following.carried))
    coordinates = [robot.q_names[i] for i in robot.following.independent]
    natural = jacobians.natural(row_sizes)
    parts = {
        name: part(name, scaled_J, own, robot, rows, tolerance, natural)
        for name, own in groups(robot).items()
    }
    extended = None
    if len(added_J):
        every = (*rows, *(row.name for row in jacobians.added_rows))
        extended = extended_singularity(J, added_J, all_sizes, every, tolerance, natural)
    whole = parts[WHOLE]
    singular = whole.rank < len(rows)
    weakest = np.linalg.svd(scaled_J)[0][:, -1]
    return SingularityReport(
        t=t,
        q=q,
        rows=rows,
        row_units=tuple(row.unit for row in jacobians.rows),
        inputs=robot.u_names,
        input_units=robot.u_units,
        J=J,
        J_u=J_u,
        row_scales=jacobians.scales,
        row_sizes=row_sizes,
        input_sizes=input_sizes,
        parts=parts,
        singular_values=whole.singular_values,
        rank=whole.rank,
        lost=whole.lost,
        weakest=weakest * np.sign(weakest[np.argmax(np.abs(weakest))]),
        given_back=given_back(parts["arm"], whole),
        minors=Minors(columns, determinants(J, columns), robot.u_names),
        by_input=restoration(scaled_J, scaled(J_u), robot.u_names, whole.rank),
        by_coordinate=restoration(scaled_J, scaled(J_q), coordinates, whole.rank),
        extended=extended,
        partitions=partition_singularities(J, jacobians.scales, blocks, robot.u_names, singular, tolerance),
        tolerance=tolerance,
    )


def _candidates(jacobians: Jacobians, partitions: Candidates, minors: Choice, columns: Integers) -> Integers:
    """Columns (count, s) of RG's candidates: those given, the controller's, the minors', or all."""
    own = jacobians.resolver
    if partitions is not None or not isinstance(own, ReducedGradient):
        if partitions is None and minors is not True:
            return columns
        own = ReducedGradient(partitions="automatic" if partitions is None else partitions)
    s, robot = len(jacobians.rows), jacobians.robot
    return candidate_columns(own.partitions, Dimensions(s, 0, robot.u_names, robot.groups)).reshape(-1, s)
