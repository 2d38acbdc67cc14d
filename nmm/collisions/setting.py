"""A robot among obstacles: its shapes and theirs, which pairs are kept apart, and what was left out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from nmm.arrays import Array
from nmm.collisions import pairs as choice
from nmm.collisions.obstacle import Obstacle
from nmm.collisions.queries import Queries
from nmm.collisions.robot_shapes import link_names, query_shapes
from nmm.collisions.shapes import Plane
from nmm.errors import InputError
from nmm.robots.loading.srdf import read_srdf
from nmm.robots.robot import Robot

#: So many names are told.
SHOWN = 6
#: An obstacle that holds every shape at least this deep, m, is not one that the robot stands on.
DEEP = 0.01
#: Rows of a pair's further points are made where it is nearer than this beyond the distance to keep, m.
FACES = 0.05


@dataclass(frozen=True, eq=False)
class Setting:
    """What distances are measured between.

    Attributes
    ----------
    robot : the robot
    obstacles : in the order of their shapes, half-spaces last
    queries : which measures distances
    names (P,) : what the two of a pair are called: links, obstacles
    distance : to keep, m
    notes : what was left out and why, a sentence each
    """

    robot: Robot
    obstacles: tuple[Obstacle, ...]
    queries: Queries
    names: tuple[tuple[str, str], ...]
    distance: float
    notes: tuple[str, ...]

    def words(self, pair: int) -> str:
        """The two of a pair, for messages; "nothing" for -1."""
        return "nothing" if pair < 0 else " and ".join(self.names[pair])

    def places(self, t: float) -> tuple[Any, ...]:
        """Where the obstacles are at t, s, Pinocchio's; of those that move along a path the record knows."""
        return tuple(None if one.moves else one.at(t) for one in self.obstacles)

    def check_start(self, t: float, q: Array) -> list[str]:
        """What is nearer than the distance at q (n,), a sentence each pair, the nearest first.

        Raises
        ------
        InputError : an obstacle contains a shape of the robot: no way leads out that a distance could tell
        """
        found = self.queries.distances(t, q, range(len(self.names)))
        for k in np.flatnonzero(found < 0.0):
            inside = self.queries.inside(int(k))
            if inside:
                link, obstacle = self.names[k]
                raise InputError(f"obstacle {obstacle} contains {link} at the start ({-found[k]:.3g} m deep)")
        order = np.argsort(found)
        return [
            f"{self.words(int(k))} are {found[k]:.4g} m apart at the start"
            for k in order[: np.count_nonzero(found < self.distance)]
        ]


def set_up(
    robot: Robot,
    obstacles: Sequence[Obstacle],
    *,
    own: bool,
    distance: float,
    band: float,
    ignore: Sequence[tuple[str, str]],
    srdf: str | Path | bool | None,
    meshes: str,
) -> Setting:
    """The shapes and pairs of one robot among obstacles.

    Raises
    ------
    RobotError : a robot without collision shapes, or with meshes that cannot be read
    InputError : unknown names; nothing to keep apart
    """
    choice.expect_shapes(robot)
    shapes = query_shapes(robot, meshes)
    count = len(shapes.geometryObjects)
    links = link_names(robot, shapes)
    known: list[tuple[str, ...]] = [
        (shape.name, link) for shape, link in zip(shapes.geometryObjects, links, strict=True)
    ]
    clash = sorted({one.name for one in obstacles} & {name for names in known for name in names})
    if clash:
        raise InputError(f"collisions: obstacles: {clash[0]} is the name of a link or shape of the robot")
    sorted_obstacles = tuple(sorted(obstacles, key=lambda one: isinstance(one.shape, Plane)))
    for one in sorted_obstacles:
        shapes.addGeometryObject(pin.GeometryObject(one.name, 0, 0, one.at(0.0), one.shape.geometry()))
        known.append((one.name,))
    wanted = [(pair.first, pair.second) for pair in robot.collision_model.collisionPairs] if own else []
    wanted += [(i, j) for j in range(count, count + len(sorted_obstacles)) for i in range(count)]
    notes: list[str] = []

    def name(pair: tuple[int, int]) -> str:
        return f"{known[pair[0]][-1]} and {known[pair[1]][-1]}"

    left_out = choice.named_pairs(ignore, known, "collisions: ignore")
    if srdf is True and not robot.semantics.files:
        raise InputError(f"srdf: none was found beside the file of {robot.name}: expected one's path")
    if srdf:
        all_disabled = robot.semantics.disabled if srdf is True else read_srdf(srdf).disabled
        disabled = [pair for pair in all_disabled if all(any(one in n for n in known) for one in pair)]
        found = choice.named_pairs(disabled, known, "srdf") & {*wanted}
        touch = choice.touching(robot, shapes, sorted(found), 0.0)
        told = [f"{name(pair)} ({share:.1%})" for pair, share in touch.items() if 0.0 < share < 1.0]
        notes.append(f"left out by the SRDF: {len(found)} pairs of shapes")
        if told:
            notes.append(
                f"the SRDF disables pairs that do touch, in a share of random configurations: {_some(told)}"
            )
        left_out |= found
    wanted = [pair for pair in wanted if pair not in left_out]
    always = choice.always_near(robot, shapes, wanted, distance)
    if always:
        told = list(dict.fromkeys(name(pair) for pair in always))
        notes.append(
            f"left out, as nearer than {distance:g} m in every configuration tried: {len(always)} "
            f"pairs of shapes: {_some(told)}"
        )
    for j, one in enumerate(sorted_obstacles, count):
        pairs = [pair for pair in wanted if pair[1] == j]
        if (
            pairs
            and {*pairs} <= {*always}
            and len(choice.always_near(robot, shapes, pairs, -DEEP)) == len(pairs)
        ):
            raise InputError(f"obstacle {one.name} contains {robot.name} in every configuration tried")
    kept = [pair for pair in wanted if pair not in {*always}]
    if not kept:
        raise InputError(
            f"collisions: there is nothing to keep {robot.name} from, neither obstacles nor its own shapes"
        )
    shapes.removeAllCollisionPairs()
    for pair in kept:
        shapes.addCollisionPair(pin.CollisionPair(*pair))
    queries = Queries(robot, shapes, sorted_obstacles, band, distance + FACES)
    names = tuple((known[i][-1], known[j][-1]) for i, j in kept)
    return Setting(robot, sorted_obstacles, queries, names, distance, tuple(notes))


def _some(names: Sequence[str]) -> str:
    more = [f"and {len(names) - SHOWN} more"] if len(names) > SHOWN else []
    return ", ".join([*names[:SHOWN], *more])
