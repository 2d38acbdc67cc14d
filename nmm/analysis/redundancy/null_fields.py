"""Directions of self-motion as fields: a unit null vector of J that is continuous in q."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from nmm.analysis.redundancy.following import DIRECTION, FOLLOWED, LITTLE, NEARLY, Field, write_direction
from nmm.analysis.redundancy.null_space import readable_null_space
from nmm.arrays import Array, scalar, vector
from nmm.errors import InputError, expect_known
from nmm.kernels.compiled import checked_by_caller
from nmm.robots.robot import Robot

#: What moves: a vector of `RedundancyReport.readable` by its number, an input by name, inputs by name or all.
Direction = int | str | Mapping[str, float] | ArrayLike
#: Null vectors move the task by less than this.
DEPENDENT = 1e-9
#: Why a field ends.
WORDS = {
    NEARLY: "J comes close to a singular configuration",
    LITTLE: "the wished inputs move the task: next to nothing of them leaves it at rest",
}


class Ended(Exception):
    """The motion cannot go on, and why."""


def expect_direction(
    robot: Robot, J: Array, rank: int, direction: Direction, name: str = "direction"
) -> Array | int:
    """A direction checked: the number of a readable null vector, or else the wished inputs (m,).

    Errors call it `name`.

    Raises
    ------
    InputError : no motion is free, no such number, an unknown input, or a wish that only moves the task
    """
    free = J.shape[1] - rank
    if not free:
        raise InputError(
            f"{name}: the task leaves no motion free: J has rank {rank}, and there are {rank} inputs"
        )
    if not isinstance(direction, bool) and isinstance(direction, int | np.integer):
        if not 0 <= direction < free:
            numbers = "0, the only number" if free == 1 else f"a number from 0 to {free - 1}"
            raise InputError(f"{name}: expected {numbers}, got {direction}")
        return int(direction)
    wish = _wish(robot, direction, name)
    try:
        direction_at(J, _of_wish(wish, rank))
    except Ended as ended:
        raise InputError(f"{name}: {ended}") from None
    return wish


def null_field(robot: Robot, J: Array, nearby: Array, rank: int, direction: Direction) -> Field:
    """The field of a direction that `expect_direction` accepts, J (k, s, m) being known at some q nearby."""
    chosen = expect_direction(robot, J, rank, direction)
    if not isinstance(chosen, int):
        return _of_wish(chosen, rank)
    p = robot.platform.p
    start = readable_null_space(J, rank, [1] * p + [0] * (robot.n_u - p))[chosen]
    columns = np.flatnonzero(start)
    smallest = [np.linalg.svd(one[:, columns])[2][-1] @ one[:, columns].T for one in nearby]
    if np.abs(smallest).max(initial=0.0) > DEPENDENT:
        return _of_wish(start, rank)  # these inputs depend on each other at q and not beside it
    return Field(columns, start[columns], rank, 1)


def _of_wish(wish: Array, rank: int) -> Field:
    """The wished inputs as far as they leave the task at rest."""
    return Field(np.arange(wish.size), wish, rank, 0)


def direction_at(J: Array, field: Field) -> Array:
    """The unit null vector (m,) of J (s, m) with which a field begins.

    Raises
    ------
    Ended : too little is left of the wish, or the inputs that move are nearly singular
    """
    along = np.zeros(J.shape[1])
    given = np.ascontiguousarray(J, dtype=np.float64), field, np.zeros_like(along), along
    found = checked_by_caller(write_direction, DIRECTION)(*given)
    if found != FOLLOWED:
        raise Ended(WORDS[found])
    return along


def _wish(robot: Robot, direction: Direction, what: str) -> Array:
    wish = np.zeros(robot.n_u)
    if isinstance(direction, str | Mapping):
        wished = {direction: 1.0} if isinstance(direction, str) else direction
        for name, value in wished.items():
            expect_known("input", name, robot.u_names, what)
            wish[robot.input(name)] = scalar(value, f"{what}: {name}")
    elif isinstance(direction, bool):
        raise InputError(f"{what}: expected a number, an input or inputs, got {direction!r}")
    else:
        wish = vector(direction, robot.n_u, what)
    if not wish.any():
        raise InputError(f"{what}: expected at least one input that is not 0")
    return wish
