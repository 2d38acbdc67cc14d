"""Directions of self-motion as fields: a unit null vector of J that is continuous in q."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import ArrayLike

from nmm.analysis.redundancy.null_space import readable_null_space
from nmm.arrays import Array, Integers, scalar, vector
from nmm.errors import InputError, expect_known
from nmm.robots.robot import Robot
from nmm.words import listed

#: What moves: a vector of `RedundancyReport.readable` by its number, an input by name, inputs by name or all.
Direction = int | str | Mapping[str, float] | ArrayLike
#: The motion ends where a singular value that it needs is below this part of the largest.
NEARLY_SINGULAR = 1e-3
#: It ends where less than this part of the wished inputs leaves the task at rest.
LITTLE_LEFT = 0.05
#: Null vectors move the task by less than this.
DEPENDENT = 1e-9


class Ended(Exception):
    """The motion cannot go on, and why."""


#: n(J, last): the unit null vector to follow, near the last one.
Field = Callable[[Array, Array], Array]


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
        _of_wish(wish, rank)(J, np.zeros(robot.n_u))
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
    return _of_circuit(columns, start, listed([robot.u_names[column] for column in columns]))


def _of_circuit(columns: Integers, start: Array, names: str) -> Field:
    """The null vector of the few inputs of a readable one, near the last, first near `start`."""

    def field(J: Array, last: Array) -> Array:
        _, values, Vt = np.linalg.svd(J[:, columns])
        needed = len(columns) - 1
        if needed and values[needed - 1] < NEARLY_SINGULAR * np.linalg.norm(J, 2):
            raise Ended(f"{names} alone come close to a singular configuration")
        vector = np.zeros(J.shape[1])
        vector[columns] = Vt[-1]
        return np.asarray(vector * np.sign(vector @ (last if last.any() else start)))

    return field


def _of_wish(wish: Array, rank: int) -> Field:
    """The wished inputs as far as they leave the task at rest."""

    def field(J: Array, last: Array) -> Array:
        rows = np.linalg.svd(J)[2][:rank]
        left = wish - rows.T @ (rows @ wish)
        size = float(np.linalg.norm(left))
        if size < LITTLE_LEFT * float(np.linalg.norm(wish)):
            raise Ended("the wished inputs move the task: next to nothing of them leaves it at rest")
        return np.asarray(left / size)

    return field


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
