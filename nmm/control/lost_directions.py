"""What of a task nothing moves, in words: "tilt of tool about x", "motion of ee along z"."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from nmm.arrays import Array
from nmm.control.directions import SMALL, direction_text, readable_basis
from nmm.functions.function import Row
from nmm.functions.tasks.orientation import Orientation
from nmm.functions.tasks.pose import Pose
from nmm.functions.tasks.task import Stack
from nmm.robots.configuration import Configuration
from nmm.robots.robot import Robot

#: Singular values this small beside the largest are zero.
TOLERANCE = 1e-10
#: Rows of frames' poses: which of six numbers they are.
PARTS = {"x": 0, "y": 1, "z": 2, "rx": 3, "ry": 4, "rz": 5}
#: A component this small beside the direction's length is left out of words.
LEFT_OUT = 0.05


def lost_directions(
    J: Array, rows: Sequence[Row], scales: ArrayLike, tolerance: float = TOLERANCE
) -> list[str]:
    """The directions of a task that no input moves, in words.

    Parameters
    ----------
    J (s, m) : the task's matrix, its frames' rows in world axes (see `in_world_axes`)
    rows : its rows
    scales (s,) : how much of each row counts as 1: the robot's reach for m, 1 for rad
    tolerance : singular values of J / scales this small beside the largest, or beside 1, are zero

    Returns
    -------
    A phrase each, for directions that are orthogonal in those scales; none where J has full rank
    """
    U, values = _left_vectors(J, scales)
    rank = int(np.sum(values > tolerance * max(1.0, float(values[0]))))
    return [direction_words(y, rows) for y in readable_basis(U[:, rank:].T)]


def weakest_direction(J: Array, rows: Sequence[Row], scales: ArrayLike) -> str:
    """The direction of a task that inputs move the least, in words. Parameters as for `lost_directions`."""
    y = _left_vectors(J, scales)[0][:, -1]
    return direction_words(y * np.sign(y[np.argmax(np.abs(y))]), rows)


def direction_words(direction: Array, rows: Sequence[Row]) -> str:
    """A direction (s,) of a task's scaled rows in words: by frames and world axes, or by the rows' names."""
    direction = np.where(np.abs(direction) > LEFT_OUT * np.linalg.norm(direction), direction, 0.0)
    parts = np.zeros(6)
    frames = set()
    for value, row in zip(direction, rows, strict=True):
        frame, _, part = row.name.partition(" ")[0].rpartition(".")
        if abs(value) <= SMALL:
            continue
        if not frame or part not in PARTS:
            return direction_text(direction / np.linalg.norm(direction), [row.name for row in rows])
        parts[PARTS[part]] += value
        frames.add(frame + row.name.partition(" ")[1] + row.name.partition(" ")[2])
    if len(frames) != 1:
        return direction_text(direction / np.linalg.norm(direction), [row.name for row in rows])
    linear, angular = np.linalg.norm(parts[:3]), np.linalg.norm(parts[3:])
    frame = frames.pop()
    phrases = []
    if linear > 0.0:
        phrases.append(f"motion of {frame} along {direction_text(parts[:3] / linear, 'xyz')}")
    if angular > 0.0:
        word = "tilt" if abs(parts[5]) < LEFT_OUT * angular else "turn"
        of = "" if phrases else f" of {frame}"
        phrases.append(f"{word}{of} about {direction_text(parts[3:] / angular, 'xyz')}")
    return " with ".join(phrases)


def in_world_axes(J: Array, task: Stack, robot: Robot, q: ArrayLike) -> Array:
    """J (s, m) with those rows in world axes that are of a frame's pose or orientation.

    Their errors are logarithms, in the frame's own axes, whose rate is A(e) times a velocity, with A regular.
    The velocity's rows, in the world's axes, are put in their place, which lose rank together with them. Rows
    relative to another frame, and all other rows, stay.
    """
    here = Configuration(robot, q)
    turned = J.copy()
    first = 0
    for one in task:
        function = one.function
        rows = len(function.rows(robot))
        if isinstance(function, Pose | Orientation) and function.relative_to is None:
            turned[first : first + rows] = (here.jacobian(function.frame) @ here.S)[-rows:]
        first += rows
    return turned


def _left_vectors(J: Array, scales: ArrayLike) -> tuple[Array, Array]:
    """Left singular vectors (s, s) of J / scales, and its singular values (s,), zeros where columns lack."""
    U, values, _ = np.linalg.svd(J / np.asarray(scales, dtype=np.float64)[:, np.newaxis])
    return U, np.concatenate([values, np.zeros(len(J) - len(values))])
