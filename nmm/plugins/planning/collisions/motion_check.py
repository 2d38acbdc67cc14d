"""Whether configurations and motions keep a scene's distances, with obstacles that stand: for planners."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from copy import copy
from typing import Any

import numpy as np

from nmm.base.arrays import Array, Integers
from nmm.base.kernels.compiled import checked_by_caller, compiled
from nmm.base.kernels.record_layout import BLOCKS, Blocks, Memory, views
from nmm.base.kernels.signatures import float64, int64
from nmm.model.collisions.elements.shapes_record import sensed_shapes
from nmm.model.collisions.pairs import measured_pairs, pairs_of
from nmm.model.collisions.scene import Scene
from nmm.model.collisions.separation import ConvexShapes
from nmm.model.collisions.shapes import HalfSpace
from nmm.model.robots.robot import Robot
from nmm.plugins.planning.collisions.legs_check import MARGIN, MovedShapes, first_blocked, too_near
from nmm.plugins.planning.collisions.own_parts import own_parts, place_on, shape_parts

#: The direction that separates a pair before the first look.
UP = (0.0, 0.0, 1.0)


@compiled
def _too_near(blocks: Blocks, q: Array) -> int:
    return too_near(views(MovedShapes, blocks.integers, blocks.floats, 0), q)


_FLAT = float64[::1]
_NEAR = int64(BLOCKS, _FLAT)
_BLOCKED = int64(*BLOCKS.types, _FLAT, float64[:, ::1], int64, _FLAT)


class MotionCheck:
    """Looks at configurations and legs (`nmm.plugins.planning.collisions.legs_check`) of a robot at t = 0, s.

    Parameters
    ----------
    scene : whose distances are kept; None for nothing to keep off
    beside : a record that lies in memory after `MovedShapes`
    """

    def __init__(self, robot: Robot, scene: Scene | None, beside: tuple[Any, ...] = ()) -> None:
        self.scene = scene
        self._shapes = moved_shapes(robot, scene)
        self._measure: Callable[[Array, float], Array] | None = None
        self.lay_out(beside)
        self._near = checked_by_caller(_too_near, _NEAR)
        self._blocked = checked_by_caller(first_blocked, _BLOCKED)

    def lay_out(self, beside: tuple[Any, ...]) -> None:
        """Place the shapes in new memory, with this record beside them."""
        memory = Memory()
        memory.add(self._shapes)
        if beside:
            memory.add(beside)
        self.blocks = memory.blocks()
        self._shapes = views(MovedShapes, *self.blocks, 0)

    def among(self, scene: Scene) -> MotionCheck:
        """The same in memory of its own, of a scene that is this one's `moved`."""
        other = copy(self)
        other.scene, other._measure = scene, None
        other.blocks = Blocks(self.blocks.integers.copy(), self.blocks.floats.copy())
        other._shapes = views(MovedShapes, *other.blocks, 0)
        first = len(scene.shapes.geometryObjects) - len(scene.obstacles)
        for j, obstacle in enumerate(scene.obstacles, first):
            other._shapes.place[j] = place_on(scene.robot.joint_axes[0], obstacle.at(0.0))
        return other

    def stay(self, limits: Array) -> None:
        """Keep a platform's x, y and theta within limits (3, 2), m and rad, on legs."""
        self._shapes.stays[:] = limits

    def keep(self, configurations: Array, nearer: Mapping[tuple[str, str], float] | None = None) -> None:
        """Keep the scene's distance, or what these (K, n) have where that is less; of pairs by name that may
        be `nearer`, m, that is enough."""
        if self.scene is None:
            return
        least = self._least(self.scene, configurations, self.scene.distance)
        kept = np.clip(least - 4.0 * MARGIN, 0.0, self.scene.distance)
        if nearer:
            enough = np.array([nearer.get(names, np.inf) for names in self.scene.names]) + MARGIN
            kept = np.where(least > enough + MARGIN, enough, np.minimum(kept, enough))
        self.kept[:] = kept

    def widen(self, configurations: Array, margin: float) -> None:
        """Keep so much more than the scene's distance, m, or as much as these (K, n) have."""
        if self.scene is not None and margin > 0.0:
            least = self._least(self.scene, configurations, self.scene.distance + margin)
            self.kept[:] = np.clip(least - 4.0 * MARGIN, self.kept, self.scene.distance + margin)

    def _least(self, scene: Scene, configurations: Array, most: float) -> Array:
        """The least distance of each pair, (P,), m; a lower bound where a pair surely keeps so much."""
        if self._measure is None:
            self._measure = measured_pairs(scene.robot, scene.shapes, self.pairs, scene.boxes)
        measure, enough = self._measure, most + 4.0 * MARGIN
        least = np.asarray(np.min([measure(q, enough) for q in configurations], axis=0))
        sensed = np.flatnonzero(self._shapes.sensed.row[self.pairs[:, 1]] >= 0)
        if len(sensed):  # of these Coal knows the box around all
            queries, pairs = scene.queries, sensed.tolist()
            reach = max(float(queries.scene.band[()]), enough)
            least[sensed] = np.min([queries.distances(0.0, q, pairs, reach) for q in configurations], axis=0)
        return least

    @property
    def kept(self) -> Array:
        """The distance that each pair keeps, (P,), m."""
        return self._shapes.kept

    @property
    def nearer(self) -> dict[tuple[str, str], float]:
        """Pairs, by name, that keep less than the scene's distance, and how near they may come, m."""
        pairs: dict[tuple[str, str], float] = {}
        if self.scene is not None:
            for names, kept in zip(self.scene.names, self.kept.tolist(), strict=True):
                if kept < self.scene.distance:
                    pairs[names] = min(max(kept - MARGIN, 0.0), pairs.get(names, np.inf))
        return pairs

    @property
    def levers(self) -> Array:
        """How far a unit of each number of a leg can move the two of a pair to each other, (P, 3 + n), m."""
        return self._shapes.levers

    def forget(self) -> None:
        """Forget what separated pairs last, which bounds begin with."""
        self._shapes.shapes.between[:] = UP
        self._shapes.shapes.last[:] = 0

    @property
    def pairs(self) -> Integers:
        """The shapes of each pair, (P, 2), obstacles second."""
        return self._shapes.shapes.pairs

    def too_near(self, q: Array) -> int:
        """The number of a pair that is nearer than its distance at q (n,), or -1."""
        return int(self._near(self.blocks, q))

    def blocked(self, q: Array, legs: Array) -> int:
        """The number of a pair that comes too near on legs (L, 3 + n) from q (n,), which is free,
        their number where the platform leaves where it stays, or -1."""
        return int(self._blocked(*self.blocks, q, legs, len(legs), np.empty_like(q)))


def moved_shapes(robot: Robot, scene: Scene | None) -> MovedShapes:
    """The record of a scene with obstacles where they are at t = 0."""
    n, none = 3 + robot.n, np.zeros(0, dtype=np.int64)
    parts, pairs = shape_parts((), none, robot.joint_axes, np.zeros((0, 7))), none.reshape(0, 2)
    levers, stems, planes, sensed = *np.zeros((2, 0, n)), 0, sensed_shapes((), (), 0)
    if scene is not None:
        own, listed = own_parts(robot, scene.meshes, scene.distance), pairs_of(scene.shapes)
        count, objects = len(own.levers), scene.shapes.geometryObjects.tolist()
        standing = np.zeros(len(objects) - count, dtype=np.int64)
        parts = own.parts.beside(
            shape_parts(objects[count:], standing, robot.joint_axes, scene.boxes[count:])
        )
        pairs = np.array(listed, dtype=np.int64).reshape(-1, 2)
        levers, stems = own.levers[pairs[:, 0]], np.full((len(pairs), n), np.inf)
        for k, pair in enumerate(listed):
            if pair[1] < count:
                levers[k], stems[k] = own.between[pair]
        planes = sum(isinstance(obstacle.shape, HalfSpace) for obstacle in scene.obstacles)
        geometries = [shape.geometry for shape in objects]
        sensed = sensed_shapes(geometries, scene.held, count)
    first_corner = np.cumsum([0, *map(len, parts.corners)], dtype=np.int64)
    corners = np.concatenate([*parts.corners, np.zeros((0, 3))])
    degrees, neighbours = np.zeros(len(corners), dtype=np.int64), []
    for first, edges in zip(first_corner.tolist(), parts.edges, strict=False):
        degrees[first : first + len(edges)] = [len(ends) for ends in edges]
        neighbours += [first + end for ends in edges for end in ends]
    convex = ConvexShapes(
        boxes=parts.boxes,
        planes=np.array(len(parts.boxes) - planes, dtype=np.int64),
        first_corner=first_corner,
        corners=corners,
        first_neighbour=np.cumsum([0, *degrees], dtype=np.int64),
        neighbours=np.array(neighbours, dtype=np.int64),
        rounding=parts.rounding,
        disc=parts.disc,
        pairs=pairs,
        between=np.tile(UP, (len(pairs), 1)).reshape(-1, 3),
        last=np.zeros(4 * len(pairs), dtype=np.int64),
    )
    return MovedShapes(
        shapes=convex,
        joints=robot.joints,
        mimic_joints=robot.following.table.ravel(),
        planar=np.array(int(robot.platform.n_p >= 3), dtype=np.int64),
        carrier=parts.carrier,
        place=parts.place,
        levers=levers,
        stems=stems,
        kept=np.full(len(pairs), 0.0 if scene is None else scene.distance),
        stays=np.tile([-np.inf, np.inf], (3, 1)),
        drift=np.zeros(len(pairs)),
        until=np.zeros(len(pairs)),
        fastest=np.zeros(len(pairs)),
        bends=np.zeros(len(pairs)),
        places=np.zeros((len(parts.boxes), 12)),
        centres=np.zeros((len(parts.boxes), 3)),
        sensed=sensed,
    )
