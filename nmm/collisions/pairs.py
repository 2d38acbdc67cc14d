"""Which pairs of shapes are kept apart, and which are left out and why."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import coal
import numpy as np
import pinocchio as pin

from nmm.arrays import Array
from nmm.errors import InputError, RobotError, expect_known
from nmm.robots.robot import Robot

#: How many configurations are drawn to see which pairs always touch.
SAMPLES = 200
#: Coordinates without limits are drawn from ± this, m or rad.
RANGE = 4.0
#: Limits of this size are none.
ENDLESS = 1e3


def sampled(robot: Robot, count: int = SAMPLES, seed: int = 0) -> Array:
    """Random configurations within limits, (count, n)."""
    rng = np.random.default_rng(seed)
    limits = robot.q_limits
    ends = np.where(robot.limited & (np.abs(limits) < ENDLESS), limits, [-RANGE, RANGE])
    drawn = rng.uniform(ends[:, 0], ends[:, 1], (count, robot.n))
    return np.array([robot.following.placed(q) for q in drawn])


def touching(
    robot: Robot, shapes: pin.GeometryModel, pairs: Sequence[tuple[int, int]], distance: float
) -> dict[tuple[int, int], float]:
    """In which share of random configurations each pair of shapes is nearer than `distance`, m."""
    near = np.zeros(len(pairs))
    measure = measured(robot, shapes, pairs)
    for q in sampled(robot):
        near += measure(q) < distance
    return dict(zip(pairs, (near / SAMPLES).tolist(), strict=True))


def always_near(
    robot: Robot, shapes: pin.GeometryModel, pairs: Sequence[tuple[int, int]], distance: float
) -> list[tuple[int, int]]:
    """The pairs that are nearer than `distance`, m, in every one of the random configurations."""
    left = list(pairs)
    for q in sampled(robot):
        if not left:
            break
        near = measured(robot, shapes, left)(q) < distance
        left = [pair for pair, is_near in zip(left, near, strict=True) if is_near]
    return left


def measured(
    robot: Robot, shapes: pin.GeometryModel, pairs: Sequence[tuple[int, int]]
) -> Callable[[Array], Array]:
    """A function of q (n,): each pair's distance there (pairs,), m; below 0 inside each other."""
    model, data, found = robot.model, robot.model.createData(), pin.GeometryData(shapes)
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    objects = shapes.geometryObjects

    def measure(q: Array) -> Array:
        pin.updateGeometryPlacements(model, data, shapes, found, q)
        distances = np.zeros(len(pairs))
        for k, (i, j) in enumerate(pairs):
            result.clear()
            poses = (coal.Transform3s(found.oMg[x].rotation, found.oMg[x].translation) for x in (i, j))
            one, two = poses
            distances[k] = coal.distance(objects[i].geometry, one, objects[j].geometry, two, request, result)
        return distances

    return measure


def named_pairs(
    given: Sequence[tuple[str, str]], names: Sequence[Sequence[str]], what: str
) -> set[tuple[int, int]]:
    """The pairs of shapes that pairs of names mean.

    Parameters
    ----------
    given : names of links, shapes or obstacles, two by two
    names (shapes, ...) : what each shape is called

    Raises
    ------
    InputError : a name that no shape has, or not two
    """
    known = list(dict.fromkeys(name for of_one in names for name in of_one))
    found: set[tuple[int, int]] = set()
    for pair in given:
        if isinstance(pair, str) or not isinstance(pair, Sequence) or len(pair) != 2:
            raise InputError(f"{what}: expected two names, got {pair!r}")
        first, second = ([i for i, of_one in enumerate(names) if name in of_one] for name in pair)
        for name in pair:
            expect_known("link, shape or obstacle", name, known, what)
        found |= {(min(i, j), max(i, j)) for i in first for j in second}
    return found


def expect_shapes(robot: Robot) -> None:
    """`RobotError` for a robot without collision shapes."""
    if not len(robot.collision_model.geometryObjects):
        raise RobotError(f"{robot.name}: it has no collision shapes: nothing keeps it from touching anything")
