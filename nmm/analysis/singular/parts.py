"""Rank, singular values and lost directions of J's columns: the platform's, the arm's, the whole robot's."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from nmm.arrays import Array, Integers
from nmm.control.directions import direction_texts, readable_basis
from nmm.errors import InputError, expect_known
from nmm.kernels.spectra import spectra
from nmm.robots.robot import Robot

WHOLE = "robot"


class Ranked:
    """What a matrix's singular values, its rank and the directions that it has lost say."""

    rows: tuple[str, ...]
    singular_values: Array
    rank: int
    lost: Array

    @property
    def sigma_min(self) -> float:
        """Smallest singular value: how far the weakest direction of the rows moves for inputs of size 1."""
        return float(self.singular_values[-1])

    @property
    def condition(self) -> float:
        """Largest over smallest singular value; infinite without full rank."""
        return float(condition_numbers(self.singular_values, np.array(self.rank)))

    @property
    def lost_text(self) -> tuple[str, ...]:
        """`lost` in the rows' names."""
        return direction_texts(self.lost, self.rows)


@dataclass(frozen=True, eq=False)
class Part(Ranked):
    """What some of the inputs can do for the task.

    Attributes
    ----------
    name : "platform", "arm", the name of one of several arms, or "robot" for all inputs
    inputs : their names
    rows : names of the task's rows
    singular_values (s,) : of their columns of J, falling; with fewer columns than rows the last are 0
    rank : how many of them exceed `tolerance` times the largest of the whole J
    lost (s - rank, s) : orthonormal directions of the task that these inputs do not move

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> report = nmm.analysis.analyse((robot, nmm.Position("ee", "xy")), {"q2": 0.0})
    >>> arm = report.parts["arm"]
    >>> arm.inputs, arm.rank, arm.lost.round(3) + 0.0
    (('q1', 'q2'), 1, array([[1., 0.]]))
    """

    name: str
    inputs: tuple[str, ...]
    rows: tuple[str, ...]
    singular_values: Array
    rank: int
    lost: Array

    @property
    def does_task(self) -> bool:
        """Whether these inputs alone reach every direction of the task here."""
        return self.rank == len(self.rows)

    @property
    def too_few(self) -> bool:
        """Whether they are fewer than the task's rows, so that they never can."""
        return len(self.inputs) < len(self.rows)

    @property
    def singular(self) -> bool:
        """Whether the rank is below what so many inputs can have."""
        return self.rank < min(len(self.inputs), len(self.rows))


def singular_values(J: Array) -> Array:
    """The s singular values of J (..., s, m), falling; zeros where there are fewer columns than rows."""
    s, m = J.shape[-2:]
    found = np.zeros((*J.shape[:-2], s))
    if m:
        found[..., : min(s, m)] = spectra(J.reshape(-1, s, m)).reshape(*J.shape[:-2], min(s, m))
    return found


def some_columns(J: Array, columns: Sequence[int]) -> Array:
    """Some columns of J (N, s, m); J itself, not a copy, where they are all."""
    return J if list(columns) == list(range(J.shape[2])) else J[:, :, list(columns)]


def ranks(values: Array, largest: Array, tolerance: float, natural: float = 1.0) -> Integers:
    """How many singular values (..., s) exceed tolerance * largest (...), or * natural if that is more.

    natural : what rows of natural size would make of them (see `Jacobians.natural`)
    """
    beside = np.maximum(largest, natural)
    return np.sum(values > tolerance * beside[..., np.newaxis], axis=-1, dtype=np.int64)


def rank_of(matrix: Array, tolerance: float) -> int:
    """How many singular values of one matrix exceed `tolerance` times the largest, or 1 if that is more."""
    values = singular_values(matrix)
    return int(ranks(values, np.array(values.max(initial=0.0)), tolerance))


def null_space(J: Array, rank: int) -> Array:
    """Orthonormal rows (m - rank, m) with J v = 0, J (s, m) of that rank."""
    return np.asarray(np.linalg.svd(J)[2][rank:] if J.size else np.eye(J.shape[1]))


def condition_numbers(values: Array, rank: Integers) -> Array:
    """Largest over smallest of singular values (..., s); infinite where the rank (...) is below s."""
    full = rank == values.shape[-1]
    smallest = np.where(full, values[..., -1], 1.0)
    return np.where(full, values[..., 0] / smallest, np.inf)


def groups(robot: Robot) -> dict[str, list[int]]:
    """Columns of each part: "platform", "arm", the arms by name, "robot" last."""
    columns = {name: [robot.input(one) for one in inputs] for name, inputs in robot.groups.items()}
    return {**columns, WHOLE: list(range(robot.n_u))}


def columns_of(robot: Robot, part: str) -> list[int]:
    """Columns of a part; `InputError` names the parts that the robot has."""
    columns = groups(robot)
    expect_known("part", part, columns, f"robot {robot.name}")
    return columns[part]


def expect_inputs(robot: Robot, part: str, what: str = "part") -> list[int]:
    """Columns of a part that has some; `what` needs them."""
    columns = columns_of(robot, part)
    if not columns:
        raise InputError(f"{what}: {part} of robot {robot.name} has no inputs")
    return columns


def part(
    name: str,
    J: Array,
    columns: Sequence[int],
    robot: Robot,
    rows: Sequence[str],
    tolerance: float,
    natural: float,
) -> Part:
    """The part made of some columns of J (s, m), its rank judged beside the whole J and natural rows."""
    own = J[:, list(columns)]
    values = singular_values(own)
    rank = int(ranks(values, singular_values(J)[0], tolerance, natural))
    U = np.linalg.svd(own)[0] if len(columns) else np.eye(len(J))
    return Part(
        name,
        tuple(robot.u_names[j] for j in columns),
        tuple(rows),
        values,
        rank,
        readable_basis(U[:, rank:].T),
    )


def given_back(arm: Part, whole: Part) -> Array:
    """Directions (whole.rank - arm.rank, s) that the arm alone does not move and the whole robot does."""
    # What the whole robot has lost the arm has lost too, so that the difference of the projectors is one.
    remaining = arm.lost.T @ arm.lost - whole.lost.T @ whole.lost
    count = whole.rank - arm.rank
    vectors = np.linalg.eigh(remaining)[1]
    return readable_basis(vectors[:, len(remaining) - count :].T)
