"""A task's directions in words ("0.71 ee.x - 0.71 ee.y"), those that no input moves; why it has no answer."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import Array
from nmm.base.findings import Finding
from nmm.base.text_format import signed_sum
from nmm.control.functions.function import Function, Row, row_scales
from nmm.control.functions.tasks.pose import Orientation, Pose
from nmm.control.functions.tasks.task import Stack
from nmm.control.resolvers.answer import Status
from nmm.control.resolvers.problem_arrays import ProblemArrays
from nmm.model.robots.configuration import Configuration
from nmm.model.robots.robot import Robot

#: Singular values this small beside the largest are zero.
TOLERANCE = 1e-10
#: The place of each component among the six of a frame's pose.
WORLD_PARTS = {"x": 0, "y": 1, "z": 2, "rx": 3, "ry": 4, "rz": 5}
#: A component this small beside the direction's length is not mentioned.
LEFT_OUT = 0.05
#: A component this small beside a unit vector is not written.
SMALL_PART = 1e-6


def readable_basis(basis: Array) -> Array:
    """Another orthonormal basis (k, s) of the span of orthonormal rows (k, s), each row close to an axis.

    The axis with the largest part in the space is projected on it, then the same is done with what remains. A
    space spanned by axes thus gets these axes; each row's largest component is positive.
    """
    projector = basis.T @ basis
    readable = np.zeros_like(basis)
    for row in range(len(basis)):
        axis = int(np.argmax(np.round(np.diag(projector), 12)))  # the first of equals, despite rounding
        direction = projector[axis] / np.linalg.norm(projector[axis])
        direction /= np.linalg.norm(direction)
        readable[row] = direction
        projector = projector - np.outer(direction, direction)
    return readable


def direction_text(direction: Array, names: Sequence[str]) -> str:
    """A vector as a combination of names: "0.71 ee.x - 0.71 ee.y"; "ee.x" for an axis, "0" for none."""
    terms = [
        (value, f"{abs(value):.2g} {name}" if abs(abs(value) - 1.0) > SMALL_PART else name)
        for value, name in zip(direction, names, strict=True)
        if abs(value) > SMALL_PART
    ]
    return signed_sum(terms) or "0"


def direction_texts(directions: Array, names: Sequence[str]) -> tuple[str, ...]:
    """`direction_text` of each row."""
    return tuple(direction_text(direction, names) for direction in directions)


def lost_directions(
    J: Array, rows: Sequence[Row], scales: ArrayLike, tolerance: float = TOLERANCE
) -> list[str]:
    """The directions of a task that no input moves, in words.

    Parameters
    ----------
    J (s, m) : the task's matrix, its frames' rows in world axes (see `in_world_axes`)
    rows : its rows
    scales (s,) : natural size of each row: the robot's reach for m, 1 for rad
    tolerance : singular values of J / scales this small beside the largest, or beside 1, are zero

    Returns
    -------
    A phrase each, for directions that are orthogonal in those scales; none where J has full rank
    """
    U, values = _left_vectors(J, scales)
    rank = int(np.sum(values > tolerance * max(1.0, float(values[0]))))
    return [direction_words(y, rows) for y in readable_basis(U[:, rank:].T)]


def weakest_direction(J: Array, rows: Sequence[Row], scales: ArrayLike) -> str:
    """The direction of a task that inputs move the least, in words; parameters as for `lost_directions`."""
    y = _left_vectors(J, scales)[0][:, -1]
    return direction_words(y * np.sign(y[np.argmax(np.abs(y))]), rows)


def direction_words(direction: Array, rows: Sequence[Row]) -> str:
    """A direction (s,) of a task's scaled rows in words: by frames and world axes, or by the rows' names."""
    direction = np.where(np.abs(direction) > LEFT_OUT * np.linalg.norm(direction), direction, 0.0)
    parts = np.zeros(6)
    frames = set()
    for value, row in zip(direction, rows, strict=True):
        frame, _, part = row.name.partition(" ")[0].rpartition(".")
        if abs(value) <= SMALL_PART:
            continue
        if not frame or part not in WORLD_PARTS:
            return direction_text(direction / np.linalg.norm(direction), [row.name for row in rows])
        parts[WORLD_PARTS[part]] += value
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
    """J (s, m) with the rows of a frame's pose or orientation in world axes.

    Their errors are logarithms in the frame's own axes, with rate A(e) times a velocity and A regular. The
    rows of that velocity in world axes replace them; they lose rank together. All other rows stay, also those
    relative to another frame.
    """
    configuration = Configuration(robot, q)
    turned = J.copy()
    first = 0
    for part in task:
        function = part.function
        rows = len(function.rows(robot))
        if isinstance(function, Pose | Orientation) and function.relative_to is None:
            turned[first : first + rows] = (configuration.jacobian(function.frame) @ configuration.S)[-rows:]
        first += rows
    return turned


def failure(
    status: Status,
    problem: ProblemArrays,
    robot: Robot,
    task: Stack,
    t: float,
    q: Array,
    limited: Sequence[Function] = (),
) -> Finding:
    """Why a call at t (s) and q (n,) gave no inputs: directions that J lost and at which level of the stack,
    what is not finite (among it the `limited` functions), or what is wrong with the platform there."""
    J = problem.J
    values: dict[str, Any] = {"status": status.name.lower(), "meaning": status.meaning, "lost": []}
    values |= {"level": None, "tasks": [], "undefined": "", "platform": ""}
    if status is Status.NOT_FINITE:
        parts = (J, problem.rate, problem.h, problem.limit_rows)
        finite = all(np.isfinite(part).all() for part in parts)
        functions = [*(part.function for part in task), *limited]
        values["undefined"] = (
            "the resolver's answer, though J, rate and h are finite"
            if finite
            else next(filter(None, (function.undefined(robot, t, q) for function in functions)), "")
            or "the task, its reference, the objective or a limit is undefined here"
        )
    elif status is Status.SINGULAR_J and np.all(np.isfinite(J)):
        rows = task.rows(robot)
        turned, scales = in_world_axes(J, task, robot, q), row_scales(rows, robot)
        for level, end in enumerate(problem.ends.tolist()):
            if lost := lost_directions(turned[:end], rows[:end], scales[:end]):
                values["lost"] = lost
                if level:
                    priority = sorted({part.priority for part in task})[level]
                    names = [part.called(robot) for part in task if part.priority == priority]
                    values |= {"level": priority, "tasks": names}
                break
    if (problematic := robot.platform.problem(q[: robot.platform.n_p])) is not None:
        values["platform"] = problematic
    return Finding("singular", values, {"t": t})


def _left_vectors(J: Array, scales: ArrayLike) -> tuple[Array, Array]:
    """Left singular vectors (s, s) of J / scales, and its singular values (s,), padded with zeros."""
    U, values, _ = np.linalg.svd(J / np.asarray(scales, dtype=np.float64)[:, np.newaxis])
    return U, np.concatenate([values, np.zeros(len(J) - len(values))])
