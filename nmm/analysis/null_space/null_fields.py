"""Null spaces of J: a sparse basis that a person can read; and directions of self-motion as fields, a unit
null vector that is continuous in q, with the task held."""

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import Array, Flags, Integers, scalar, vector
from nmm.base.errors import InputError, expect, expect_known
from nmm.base.kernels.compiled import checked_by_caller, compiled, integer_scratch, scratch
from nmm.base.kernels.linear_algebra import residual_norm, singular_rows
from nmm.base.kernels.record_layout import IntegerVector, Vector, record_type, views
from nmm.base.kernels.signatures import boolean, float64, int64
from nmm.control.functions.program import BESIDE, LaidOut
from nmm.control.step.equations import ControlStep, drive
from nmm.model.robots.robot import Robot

#: The motion ends where a singular value that it needs is below this part of the largest.
NEARLY_SINGULAR = 1e-3
#: It ends where less than this part of the wished inputs leaves the task at rest.
LITTLE_LEFT = 0.05
#: What was found: a direction; that J is not a number; that J, or the columns of the inputs that move alone,
#: are nearly singular; that too little is left of the wish.
FOLLOWED, UNDEFINED, NEARLY, ALONE, LITTLE = range(5)
#: What moves: a vector of `RedundancyReport.readable` by its number, an input by name, inputs by name or all.
Direction = int | str | Mapping[str, float] | ArrayLike
#: Null vectors move the task by less than this.
DEPENDENT = 1e-9
#: Why a field ends.
WORDS = {
    NEARLY: "J comes close to a singular configuration",
    LITTLE: "the wished inputs move the task: next to nothing of them leaves it at rest",
}


class Field(NamedTuple):
    """A unit null vector n of J that is continuous in q.

    columns (c,) : the inputs that move: all, or, with `fewest` 1, a minimal dependent set
    wish (c,) : its projection onto null J is n; for a minimal set, only n's initial sign
    """

    columns: IntegerVector
    wish: Vector
    rank: int
    fewest: int


#: J (s, m), the field, the n before (zeros at first), n (m,) to be written.
DIRECTION = int64(float64[:, ::1], record_type(Field), float64[::1], float64[::1])
#: Blocks, the field, e0 (s,), which rows are angles (s,), the n before, ṡ, K, n (m,) to be written.
FOLLOW = int64(
    *(int64[::1], float64[::1], record_type(Field), float64[::1], boolean[::1]),
    *(float64[::1], float64, float64, float64[::1]),
)


@compiled
def largest_rows(A: Array, count: int, squares: Array, which: Integers) -> None:
    """which (count,): the longest rows of A (s, m), the longest first; squares (s,): of their lengths."""
    for i in range(A.shape[0]):
        squares[i] = 0.0
        for j in range(A.shape[1]):
            squares[i] += A[i, j] * A[i, j]
    for k in range(count):
        which[k] = -1
        for i in range(A.shape[0]):
            taken = False
            for earlier in range(k):
                taken = taken or which[earlier] == i
            if not taken and (which[k] < 0 or squares[i] > squares[which[k]]):
                which[k] = i


@compiled
def write_direction(J: Array, field: Field, last: Array, along: Array) -> int:
    """along (m,): n at J (s, m), `last` (m,) being the one before, or zeros. Returns what became of it."""
    s, c = J.shape[0], field.columns.shape[0]
    A, R, squares, which = scratch((s, c)), scratch((s, s)), scratch(s), integer_scratch(s)
    for i in range(s):
        for j in range(c):
            A[i, j] = J[i, field.columns[j]]
    count = c - 1 if field.fewest == 1 else field.rank
    singular_rows(A, R)
    largest_rows(A, count, squares, which)
    if field.fewest == 1 and count > 0:
        whole = scratch(J.shape)
        for i in range(s):
            for j in range(J.shape[1]):
                whole[i, j] = J[i, j]
        _, largest = singular_rows(whole, R)
        if math.sqrt(squares[which[count - 1]]) < NEARLY_SINGULAR * largest:
            return ALONE
    goes_on, asked = False, 0.0
    for j in range(c):
        goes_on = goes_on or last[field.columns[j]] != 0.0
    left = scratch(c)
    for j in range(c):
        left[j] = last[field.columns[j]] if field.fewest == 1 and goes_on else field.wish[j]
        asked += left[j] * left[j]
    for _ in range(2):  # the second time for what rounding left
        for k in range(count):
            overlap = 0.0
            for j in range(c):
                overlap += A[which[k], j] * left[j]
            for j in range(c):
                left[j] -= overlap / squares[which[k]] * A[which[k], j]
    size = 0.0
    for j in range(c):
        size += left[j] * left[j]
    if field.fewest == 0 and math.sqrt(size) < LITTLE_LEFT * math.sqrt(asked):
        return LITTLE
    for j in range(along.shape[0]):
        along[j] = 0.0
    for j in range(c):
        along[field.columns[j]] = left[j] / math.sqrt(size)
    return FOLLOWED


@compiled
def follow(
    integers: Integers,
    floats: Array,
    field: Field,
    e0: Array,
    angular: Flags,
    last: Array,
    rate: float,
    gain: float,
    along: Array,
) -> int:
    """u = ṡ n + J⁺ K (e - e0) of the step just made, with q_dot, error, rate and residual.

    Writes n to along (m,) and returns the outcome; writes nothing unless that is FOLLOWED.
    """
    e = views(ControlStep, integers, floats, BESIDE)
    b = views(LaidOut, integers, floats, 0).buffers
    J = e.problem.J
    s, m = J.shape
    A, R, squares, which = scratch((s, m)), scratch((s, s)), scratch(s), integer_scratch(s)
    for i in range(s):
        for j in range(m):
            if not math.isfinite(J[i, j]):
                return UNDEFINED
            A[i, j] = J[i, j]
    singular_rows(A, R)
    largest_rows(A, field.rank, squares, which)
    if field.rank > 0:
        least = math.sqrt(squares[which[field.rank - 1]])
        if least < NEARLY_SINGULAR * math.sqrt(squares[which[0]]):
            return NEARLY
    outcome = write_direction(J, field, last, along)
    if outcome != FOLLOWED:
        return outcome
    error, u = e.task.error, e.answer.u
    for i in range(s):
        error[i] -= e0[i]
        if angular[i]:
            error[i] -= 2.0 * math.pi * math.floor(error[i] / (2.0 * math.pi) + 0.5)
        e.task.full[i] = gain * error[i]
    for j in range(m):
        u[j] = rate * along[j]
    for k in range(field.rank):
        wanted = 0.0
        for i in range(s):
            wanted += R[which[k], i] * e.task.full[i]
        for j in range(m):
            u[j] += wanted / squares[which[k]] * A[which[k], j]
    e.answer.residual[()], _ = residual_norm(J, u, e.task.full)
    drive(u, b.G, e.arm, e.q_dot)
    return FOLLOWED


class MotionEnded(Exception):
    """The motion cannot go on, and why."""


def expect_direction(
    robot: Robot, J: Array, rank: int, direction: Direction, name: str = "direction"
) -> Array | int:
    """The number of a readable null vector, or else the wished inputs (m,).

    `InputError`, naming `name`: no free motion, no such number or input, or a wish that only moves the task.
    """
    free = J.shape[1] - rank
    if not free:
        what = f"the task leaves no motion free: J has rank {rank}, and there are {rank} inputs"
        raise InputError(what, where=name)
    if not isinstance(direction, bool) and isinstance(direction, int | np.integer):
        numbers = "0, the only number" if free == 1 else f"a number from 0 to {free - 1}"
        expect(0 <= direction < free, name, numbers, direction)
        return int(direction)
    wish = _wish(robot, direction, name)
    try:
        direction_at(J, _of_wish(wish, rank))
    except MotionEnded as ended:
        raise InputError(str(ended), where=name) from None
    return wish


def null_field(robot: Robot, J: Array, nearby: Array, rank: int, direction: Direction) -> Field:
    """The field of a direction that `expect_direction` accepts; `nearby` is J (k, s, m) at some q nearby."""
    chosen = expect_direction(robot, J, rank, direction)
    if not isinstance(chosen, int):
        return _of_wish(chosen, rank)
    p = robot.platform.p
    start = readable_null_space(J, rank, [1] * p + [0] * (robot.n_u - p))[chosen]
    columns = np.flatnonzero(start)
    smallest = [np.linalg.svd(J_near[:, columns])[2][-1] @ J_near[:, columns].T for J_near in nearby]
    if np.abs(smallest).max(initial=0.0) > DEPENDENT:
        return _of_wish(start, rank)  # these inputs depend on each other at q and not beside it
    return Field(columns, start[columns], rank, 1)


def _of_wish(wish: Array, rank: int) -> Field:
    """The wished inputs as far as they leave the task at rest."""
    return Field(np.arange(wish.size), wish, rank, 0)


def direction_at(J: Array, field: Field) -> Array:
    """The unit null vector (m,) of J (s, m) with which a field begins; `MotionEnded` where it cannot."""
    along = np.zeros(J.shape[1])
    arguments = np.ascontiguousarray(J, dtype=np.float64), field, np.zeros_like(along), along
    outcome = checked_by_caller(write_direction, DIRECTION)(*arguments)
    if outcome != FOLLOWED:
        raise MotionEnded(WORDS[outcome])
    return along


def _wish(robot: Robot, direction: Direction, what: str) -> Array:
    wish = np.zeros(robot.n_u)
    if isinstance(direction, str | Mapping):
        wished = {direction: 1.0} if isinstance(direction, str) else direction
        for name, value in wished.items():
            expect_known("input", name, robot.u_names, what)
            wish[robot.input(name)] = scalar(value, f"{what}: {name}")
    else:
        expect(not isinstance(direction, bool), what, "a number, an input or inputs", direction)
        wish = vector(direction, robot.n_u, what)
    expect(wish.any(), what, "at least one input that is not 0")
    return wish


#: Singular values and components this small beside the largest belong to a smaller set of columns.
TIGHT = 1e-12
#: The part of a unit vector that the vectors chosen before it must not already span.
NEW = 1e-3
#: With more sets of columns than this the sparsest vectors are not looked for.
MOST_SETS = 20_000


def readable_null_space(J: Array, rank: int, costs: Sequence[int], known: Array | None = None) -> Array:
    """The sparsest basis (m - rank - rank of known, m) that completes `known` (k, m) to null J (s, m).

    Its vectors are circuits: minimal dependent sets of columns, so at most rank + 1 components differ from 0.
    The smallest independent circuits are taken first, of these those of least cost (m,), then of best
    condition; as columns form a matroid, this greedy choice is optimal. The largest component of
    each vector is 1. Beyond MOST_SETS sets, the reduced row echelon form's basis is used instead.
    """
    m = J.shape[1]
    own = np.zeros((0, m)) if known is None else known
    count = m - rank - len(own)
    if count <= 0:
        return np.zeros((0, m))
    _, values, Vt = np.linalg.svd(J, full_matrices=False) if J.size else (None, np.zeros(0), np.zeros((0, m)))
    core = values[:rank, np.newaxis] * Vt[:rank]
    sets = sum(math.comb(m, size) for size in range(1, rank + 2))
    candidates = _circuits(core, costs) if sets <= MOST_SETS else _echelon(core, costs)
    chosen = _new_ones(candidates, own, count)
    if len(chosen) < count:  # circuits that all but repeat each other
        chosen += _new_ones(_echelon(core, costs), np.vstack([own, *chosen]), count - len(chosen))
    for circuit in chosen:  # the largest component 1: of equals the first, whatever the rounding
        circuit /= circuit[np.argmax(np.round(np.abs(circuit) / np.abs(circuit).max(), 9))]
    return np.array(chosen).reshape(-1, m)


def _circuits(core: Array, costs: Sequence[int]) -> list[Array]:
    """All circuits of the columns of `core` (rank, m) as unit vectors, the most readable first."""
    rank, m = core.shape
    largest = float(np.linalg.norm(core, 2)) if core.size else 0.0
    circuits: list[tuple[tuple[float, ...], Array]] = []
    for size in range(1, rank + 2):
        columns = np.array(list(itertools.combinations(range(m), size)), dtype=np.int64).reshape(-1, size)
        for own, null, gap in zip(columns, *_dependence(core, columns, largest), strict=True):
            if np.isnan(gap):
                continue
            vector = np.zeros(m)
            vector[own] = null
            # Condition in steps of a half decade: within one, cheaper columns and earlier ones win.
            condition = float(round(-2.0 * math.log10(gap))) if size > 1 else 0.0
            circuits.append(((size, sum(costs[column] for column in own), condition), vector))
    return [vector for _, vector in sorted(circuits, key=lambda item: item[0])]


def _dependence(core: Array, columns: Integers, largest: float) -> tuple[Array, Array]:
    """Null vectors (N, size) of sets of columns, and the gap to a second (N,), NaN where no circuit."""
    size, rank = columns.shape[1], core.shape[0]
    blocks = np.zeros((len(columns), max(rank, size), size))
    blocks[:, :rank] = core[:, columns].transpose(1, 0, 2)
    _, values, Vt = np.linalg.svd(blocks, full_matrices=False)
    null = Vt[:, -1, :]
    smallest = np.abs(null).min(axis=1)
    gap = values[:, -2] / largest if size > 1 and largest > 0.0 else np.ones(len(columns))
    circuit = (values[:, -1] <= TIGHT * largest) & (gap > TIGHT) & (smallest > TIGHT)
    return null, np.where(circuit, np.maximum(gap, TIGHT), np.nan)


def _echelon(core: Array, costs: Sequence[int]) -> list[Array]:
    """The basis of the reduced row echelon form, cheap columns pivots last: rank + 1 components at most."""
    from scipy.linalg import qr

    rank, m = core.shape
    if not rank:
        return list(np.eye(m))
    weights = 1.0 + 1e-3 * np.asarray(costs, dtype=np.float64)
    pivots = qr(core * weights, mode="r", pivoting=True)[1]
    basic, free = pivots[:rank], pivots[rank:]
    basis = []
    for column in free:
        vector = np.zeros(m)
        vector[basic] = -np.linalg.solve(core[:, basic], core[:, column])
        vector[column] = 1.0
        vector[np.abs(vector) <= TIGHT * np.abs(vector).max()] = 0.0
        basis.append(vector / np.linalg.norm(vector))
    return sorted(basis, key=lambda vector: int(np.count_nonzero(vector)))


def _new_ones(candidates: Sequence[Array], own: Array, count: int) -> list[Array]:
    """The first `count` candidates that neither those given nor those before them span."""
    spanned = np.linalg.qr(own.T)[0] if len(own) else np.zeros((own.shape[1], 0))
    chosen: list[Array] = []
    for candidate in candidates:
        if len(chosen) == count:
            break
        rest = candidate - spanned @ (spanned.T @ candidate)
        rest -= spanned @ (spanned.T @ rest)
        size = float(np.linalg.norm(rest))
        if size > NEW:
            chosen.append(candidate)
            spanned = np.column_stack([spanned, rest / size])
    return chosen
