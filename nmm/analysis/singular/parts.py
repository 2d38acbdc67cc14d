"""Rank, singular values and lost directions of J's columns: the platform's, the arm's, the whole robot's."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from nmm.base.arrays import Array, Integers
from nmm.base.errors import InputError, expect_known
from nmm.base.kernels.spectra import spectra
from nmm.control.directions import direction_texts, readable_basis
from nmm.model.robots.robot import Robot

#: A rate this small beside the largest singular value is rounding of the differences.
SMALL_RATE = 1e-7


@dataclass(frozen=True, eq=False)
class Restoration:
    """What each of k motions of the robot does to the smallest singular value of J.

    Where J has full rank, `rates` are the signed derivatives of σ_min. Elsewhere σ_min is 0 and grows by
    rate * |ε| for a motion by ε of either sign: to first order, J + ε dJ has the s - rank small singular
    values |ε| σ(Nᵀ dJ V), N and V spanning the left and right null spaces of J.

    Attributes
    ----------
    names : of the motions: inputs (q moves along S(q) e_j) or coordinates (along e_i, with its mimic joints)
    rates (k,) : growth of σ_min, per m or rad of the motion
    regained (k,) : how many lost directions come back at first order; 0 where none is lost
    best (k,), best_rate : unit combination of the motions with the largest effect (‖Nᵀ dJ V‖ in Frobenius'
        norm, or the gradient of σ_min), zeros if none has any; growth of σ_min along it

    Examples
    --------
    >>> arm = nmm.load("unicycle_2r", platform="fixed")
    >>> report = nmm.analysis.analyse((arm, nmm.Position("ee", "xy")), {"q2": 0.0})
    >>> back = report.by_input
    >>> dict(zip(back.names, back.regained.tolist()))
    {'q1': 0, 'q2': 1}
    """

    names: tuple[str, ...]
    rates: Array
    regained: Integers
    best: Array
    best_rate: float
    threshold: float

    @property
    def effective(self) -> tuple[str, ...]:
        """The motions that bring something back; where nothing is lost, those that change σ_min."""
        useful = (np.abs(self.rates) > self.threshold) | (self.regained > 0)
        return tuple(name for name, yes in zip(self.names, useful, strict=True) if yes)


def restoration(J: Array, dJ: Array, names: Sequence[str], rank: int) -> Restoration:
    """From J (s, m), its derivatives dJ (k, s, m) along k motions, and its rank."""
    s, count = len(J), len(names)
    U, values, Vt = np.linalg.svd(J)
    threshold = SMALL_RATE * max(float(values[0]), 1e-300)
    regained = np.zeros(count, dtype=np.int64)
    if rank == s:
        rates = np.einsum("i,kij,j->k", U[:, -1], dJ, Vt[s - 1])
        size = float(np.linalg.norm(rates))
        best = rates / size if size > threshold else np.zeros(count)
        return Restoration(tuple(names), rates, regained, best, float(rates @ best), threshold)
    reduced = np.einsum("ia,kij,bj->kab", U[:, rank:], dJ, Vt[rank:])
    small = np.linalg.svd(reduced, compute_uv=False) if count else np.zeros((0, s - rank))
    regained[:] = np.sum(small > threshold, axis=1)
    best, best_rate = np.zeros(count), 0.0
    if np.any(regained):
        best = np.linalg.svd(reduced.reshape(count, -1).T)[2][0]
        best = np.where(np.abs(best) > 1e-9, best, 0.0)
        best *= np.sign(best[np.argmax(np.abs(best))])  # both signs do the same
        best_rate = float(np.linalg.svd(np.tensordot(best, reduced, 1), compute_uv=False)[-1])
    return Restoration(tuple(names), small[:, -1], regained, best, best_rate, threshold)


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
    """The s singular values of J (..., s, m), falling; zeros if there are fewer columns than rows."""
    s, m = J.shape[-2:]
    values = np.zeros((*J.shape[:-2], s))
    if m:
        values[..., : min(s, m)] = spectra(J.reshape(-1, s, m)).reshape(*J.shape[:-2], min(s, m))
    return values


def some_columns(J: Array, columns: Sequence[int]) -> Array:
    """Some columns of J (N, s, m); J itself, not a copy, if they are all."""
    return J if list(columns) == list(range(J.shape[2])) else J[:, :, list(columns)]


def ranks(values: Array, largest: Array, tolerance: float, natural: float = 1.0) -> Integers:
    """How many singular values (..., s) exceed tolerance * largest (...), or tolerance * natural if that is
    more: what rows of natural size would make of them (see `Jacobians.natural`)."""
    beside = np.maximum(largest, natural)
    return np.sum(values > tolerance * beside[..., np.newaxis], axis=-1, dtype=np.int64)


def rank_of(matrix: Array, tolerance: float) -> int:
    """How many singular values exceed `tolerance` times the largest, or times 1 if that is more."""
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
    columns = {part: [robot.input(name) for name in inputs] for part, inputs in robot.groups.items()}
    return {**columns, WHOLE: list(range(robot.n_u))}


def columns_of(robot: Robot, part: str) -> list[int]:
    """Columns of a part; `InputError` names the robot's parts."""
    columns = groups(robot)
    expect_known("part", part, columns, f"robot {robot.name}")
    return columns[part]


def expect_inputs(robot: Robot, part: str, what: str = "part") -> list[int]:
    """Columns of a part that must have some; `what` needs them."""
    columns = columns_of(robot, part)
    if not columns:
        raise InputError(f"{part} of robot {robot.name} has no inputs", where=what)
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
    inputs = tuple(robot.u_names[j] for j in columns)
    return Part(name, inputs, tuple(rows), values, rank, readable_basis(U[:, rank:].T))


def given_back(arm: Part, whole: Part) -> Array:
    """Directions (whole.rank - arm.rank, s) that the whole robot moves but the arm alone does not."""
    # What the whole robot lost, the arm lost too: the difference of the projectors is a projector.
    remaining = arm.lost.T @ arm.lost - whole.lost.T @ whole.lost
    count = whole.rank - arm.rank
    vectors = np.linalg.eigh(remaining)[1]
    return readable_basis(vectors[:, len(remaining) - count :].T)
