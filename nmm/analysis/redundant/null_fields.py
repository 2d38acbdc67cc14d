"""Directions of self-motion as fields: a unit null vector of J that is continuous in q."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import ArrayLike

from nmm.analysis.redundant.motion_words import listed
from nmm.analysis.redundant.null_space import readable_null_space
from nmm.arrays import Array, Integers, scalar, vector
from nmm.errors import InputError
from nmm.robot import Robot

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


def null_field(robot: Robot, J: Array, nearby: Array, rank: int, direction: Direction) -> Field:
    p = robot.platform.p
    basis = readable_null_space(J, rank, [1] * p + [0] * (robot.n_u - p))
    if not len(basis):
        raise InputError(f"self-motion: the task leaves no motion free: J has rank {rank}, as many as inputs")
    if isinstance(direction, bool) or not isinstance(direction, int | np.integer):
        wished = _of_wish(_wish(robot, direction), rank)
        try:
            wished(J, np.zeros(robot.n_u))
        except Ended as ended:
            raise InputError(f"direction: {ended}") from None
        return wished
    if not 0 <= direction < len(basis):
        raise InputError(f"direction: expected a number from 0 to {len(basis) - 1}, got {direction}")
    start = basis[int(direction)]
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
        along: Array = vector * np.sign(vector @ (last if last.any() else start))
        return along

    return field


def _of_wish(wish: Array, rank: int) -> Field:
    """The wished inputs as far as they leave the task at rest."""

    def field(J: Array, last: Array) -> Array:
        rows = np.linalg.svd(J)[2][:rank]
        left = wish - rows.T @ (rows @ wish)
        size = float(np.linalg.norm(left))
        if size < LITTLE_LEFT * float(np.linalg.norm(wish)):
            raise Ended("the wished inputs move the task: next to nothing of them leaves it at rest")
        unit: Array = left / size
        return unit

    return field


def _wish(robot: Robot, direction: Direction) -> Array:
    wish = np.zeros(robot.n_u)
    if isinstance(direction, str):
        wish[robot.input(direction)] = 1.0
    elif isinstance(direction, Mapping):
        for name, value in direction.items():
            wish[robot.input(name)] = scalar(value, f"direction: {name}")
    elif isinstance(direction, bool):
        raise InputError(f"direction: expected a number, an input or inputs, got {direction!r}")
    else:
        wish = vector(direction, robot.n_u, "direction")
    if not wish.any():
        raise InputError("direction: expected at least one input that is not 0")
    return wish
