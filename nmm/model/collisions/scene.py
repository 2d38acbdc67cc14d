"""A robot among obstacles: its shapes and theirs, which pairs are kept apart, and what was left out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from nmm.base.arrays import Array
from nmm.base.errors import InputError, RobotError, few
from nmm.model.collisions.elements.boxes import Elements
from nmm.model.collisions.obstacle import Obstacle
from nmm.model.collisions.pairs import (
    Pair,
    always_near,
    boxes_around,
    link_names,
    named_pairs,
    own_shapes,
    pairs_of,
    perhaps_near,
    touching,
)
from nmm.model.collisions.queries import Queries
from nmm.model.collisions.shapes import Box, HalfSpace, Round, Shape, Sphere
from nmm.model.robots.joint_table import as_row
from nmm.model.robots.loading.srdf import read_srdf
from nmm.model.robots.loading.srdf_fitting import disabled_pairs
from nmm.model.robots.robot import Robot

#: A robot does not stand on, but is inside, an obstacle that contains every shape at least this deep, m.
DEEP = 0.01
#: A pair may have several rows where it is nearer than this beyond the distance to keep, m.
FACES = 0.05


@dataclass(frozen=True, eq=False)
class Scene:
    """A robot and obstacles between which distances are measured.

    Attributes
    ----------
    robot : the robot
    obstacles : in the order of their shapes, half-spaces last
    held : the obstacles' shapes when it was set up: records have the addresses of what was sensed
    shapes, boxes (G, 7) : the robot's, then theirs, with the pairs, and the boxes around them
    meshes : what the robot's are of, see `query_shapes`
    names (P,) : what the two of a pair are called: links, obstacles
    distance : to keep, m; band : within which pairs have rows, m
    notes : what was left out and why, a sentence each
    left_out : pairs with obstacles that were left out as always near
    """

    robot: Robot
    obstacles: tuple[Obstacle, ...]
    held: tuple[Shape, ...]
    shapes: pin.GeometryModel
    boxes: Array
    meshes: str
    names: tuple[tuple[str, str], ...]
    distance: float
    band: float
    notes: tuple[str, ...]
    left_out: tuple[Pair, ...]

    @cached_property
    def queries(self) -> Queries:
        """What measures distances."""
        faces = self.distance + FACES
        return Queries(self.robot, self.shapes, self.obstacles, self.held, self.band, faces)

    def words(self, pair: int) -> str:
        """The two of a pair, for messages; "nothing" for -1."""
        return "nothing" if pair < 0 else " and ".join(self.names[pair])

    def keep_nearer(self, nearer: Mapping[tuple[str, str], float]) -> Array:
        """Let pairs by these names be as near as this, m, where that is less than the distance; returns what
        each pair keeps, (P,)."""
        kept = np.array([min(self.distance, nearer.get(pair, self.distance)) for pair in self.names])
        self.queries.scene.nearer[:] = self.distance - kept
        return kept

    def places(self, t: float) -> tuple[Any, ...]:
        """Pinocchio's placements of the obstacles at t, s; None for one with a path, which a record knows."""
        return tuple(None if obstacle.moves else obstacle.at(t) for obstacle in self.obstacles)

    def moved(self, obstacles: Sequence[Obstacle]) -> Scene | None:
        """The same with these in place of the obstacles, where they differ from them by their places at most
        and no pair with one is always near, before or now; else None."""
        sorted_obstacles = in_order(obstacles)
        if self.left_out or len(obstacles) != len(self.obstacles):
            return None
        if not all(map(_same_but_for_place, self.obstacles, self.held, sorted_obstacles)):
            return None
        shapes = self.shapes.copy()
        count = len(shapes.geometryObjects) - len(sorted_obstacles)
        for j, obstacle in enumerate(sorted_obstacles, count):
            shapes.geometryObjects[j].placement = obstacle.at(0.0)
        of_robot = self.robot, shapes, self.boxes, self.meshes
        if always_near_obstacles(*of_robot, pairs_of(shapes), sorted_obstacles, self.held, self.distance):
            return None
        return replace(self, obstacles=sorted_obstacles, shapes=shapes)

    def check_start(self, t: float, q: Array) -> list[str]:
        """What is nearer than the distance at q (n,), a sentence each pair, the nearest first.

        Raises
        ------
        InputError : an obstacle contains a shape of the robot: no distance shows the way out
        """
        self.queries.renew()
        distances = self.queries.distances(t, q, range(len(self.names)))
        for k in np.flatnonzero(distances < 0.0):
            if self.queries.inside(int(k)):
                link, obstacle = self.names[k]
                what = f"contains {link} at the start ({-distances[k]:.3g} m deep)"
                raise InputError(what, where=f"obstacle {obstacle}")
        order = np.argsort(distances)
        return [
            f"{self.words(int(k))} are {distances[k]:.4g} m apart at the start"
            for k in order[: np.count_nonzero(distances < self.distance)]
        ]


def in_order(obstacles: Sequence[Obstacle]) -> tuple[Obstacle, ...]:
    """Obstacles in the order of their shapes in a scene: half-spaces last."""
    return tuple(sorted(obstacles, key=lambda obstacle: isinstance(obstacle.shape, HalfSpace)))


def _same_but_for_place(first: Obstacle, held: Shape, second: Obstacle) -> bool:
    """Whether two obstacles that stand have one name and shape; a mesh's file, or a cloud, may have
    changed."""
    shape = second.shape
    same = shape is held or (isinstance(shape, Box | Sphere | Round | HalfSpace) and shape == held)
    return same and first.name == second.name and not first.moves and not second.moves


def always_near_obstacles(
    robot: Robot,
    shapes: pin.GeometryModel,
    boxes: Array,
    meshes: str,
    pairs: Sequence[Pair],
    obstacles: Sequence[Obstacle],
    held: Sequence[Shape],
    distance: float,
) -> list[Pair]:
    """Of the pairs those with obstacles, the last shapes, that are always nearer than `distance`, m. None is
    with what was sensed: of it Coal knows a box around all."""
    count = len(shapes.geometryObjects) - len(obstacles)
    sensed = {j for j, shape in enumerate(held, count) if isinstance(shape, Elements)}
    others = [pair for pair in pairs if pair[1] >= count and pair[1] not in sensed]
    places = np.array([as_row(obstacle.at(0.0)) for obstacle in obstacles]).reshape(-1, 12)
    near = perhaps_near(robot, meshes, places, boxes, others, distance)
    return always_near(robot, shapes, boxes, near, distance)


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
) -> Scene:
    """`RobotError` without collision shapes or readable meshes; `InputError`: unknown names, no pairs."""
    if not len(robot.collision_model.geometryObjects):
        what = "it has no collision shapes; <collision> in its file, a box or cylinder a link, makes some"
        raise RobotError(what, where=robot.name)
    own_ones, own_boxes, own_near = own_shapes(robot, meshes, distance)
    shapes = own_ones.copy()
    count = len(shapes.geometryObjects)
    links = link_names(robot, shapes)
    known: list[tuple[str, ...]] = [
        (shape.name, link) for shape, link in zip(shapes.geometryObjects, links, strict=True)
    ]
    clash = sorted({obstacle.name for obstacle in obstacles} & {name for names in known for name in names})
    if clash:
        raise InputError(f"{clash[0]} is a link or shape of the robot", where="collisions: obstacles")
    sorted_obstacles = in_order(obstacles)
    held = tuple(obstacle.shape for obstacle in sorted_obstacles)
    for obstacle, shape in zip(sorted_obstacles, held, strict=True):
        shapes.addGeometryObject(pin.GeometryObject(obstacle.name, 0, 0, obstacle.at(0.0), shape.geometry()))
        known.append((obstacle.name,))
    boxes = np.vstack([own_boxes, boxes_around(shapes.geometryObjects.tolist()[count:])])
    wanted = pairs_of(robot.collision_model) if own else []
    wanted += [(i, j) for j in range(count, count + len(sorted_obstacles)) for i in range(count)]
    notes: list[str] = []

    def name(pair: tuple[int, int]) -> str:
        return f"{known[pair[0]][-1]} and {known[pair[1]][-1]}"

    left_out = named_pairs(ignore, known, "collisions: ignore")
    if srdf is True and not robot.semantics.files:
        raise InputError(f"none is beside the file of {robot.name}", where="srdf", expected="a path")
    if srdf:
        all_disabled = robot.semantics.disabled if srdf is True else disabled_pairs(read_srdf(srdf), robot)
        disabled = [pair for pair in all_disabled if all(any(link in n for n in known) for link in pair)]
        matches = named_pairs(disabled, known, "srdf") & {*wanted}
        touch = touching(robot, shapes, sorted(matches), 0.0)
        often = [f"{name(pair)} ({share:.1%})" for pair, share in touch.items() if 0.0 < share < 1.0]
        notes.append(f"left out by the SRDF: {len(matches)} pairs of shapes")
        disables = "the SRDF disables pairs that do touch, in a share of random configurations"
        notes += [f"{disables}: {few(often)}"] if often else []
        left_out |= matches
    wanted = [pair for pair in wanted if pair not in left_out]
    near_obstacles = always_near_obstacles(
        *(robot, shapes, boxes, meshes, wanted, sorted_obstacles, held, distance)
    )
    always = [pair for pair in wanted if pair in own_near] + near_obstacles
    if always:
        near = list(dict.fromkeys(name(pair) for pair in always))
        notes.append(
            f"left out, as nearer than {distance:g} m in every configuration tried: {len(always)} "
            f"pairs of shapes: {few(near)}"
        )
    for j, obstacle in enumerate(sorted_obstacles, count):
        pairs = [pair for pair in wanted if pair[1] == j]
        touches = bool(pairs) and {*pairs} <= {*always}
        if touches and len(always_near(robot, shapes, boxes, pairs, -DEEP)) == len(pairs):
            what = f"contains {robot.name} in every configuration tried"
            raise InputError(what, where=f"obstacle {obstacle.name}")
    remaining = [pair for pair in wanted if pair not in {*always}]
    if not remaining:
        raise InputError(f"nothing to keep {robot.name} from: no obstacle, no own shape", where="collisions")
    shapes.removeAllCollisionPairs()
    for pair in remaining:
        shapes.addCollisionPair(pin.CollisionPair(*pair))
    names = tuple((known[i][-1], known[j][-1]) for i, j in remaining)
    return Scene(
        *(robot, sorted_obstacles, held, shapes, boxes, meshes, names, distance, band, tuple(notes)),
        tuple(near_obstacles),
    )
