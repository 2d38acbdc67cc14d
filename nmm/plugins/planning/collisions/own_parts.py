"""What a check of motions knows of a robot's own shapes, whatever is around it: computed once a robot."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import coal
import numpy as np
import pinocchio as pin

from nmm.base.arrays import Array, Integers
from nmm.model.collisions.pairs import Pair, own_shapes, pairs_of
from nmm.model.collisions.queries import corners_of
from nmm.model.robots.joint_table import as_row
from nmm.model.robots.robot import Robot

#: Of so many corners the farthest is found among all of them.
FEW = 24


class ShapeParts(NamedTuple):
    """G shapes as `ConvexShapes` and `MovedShapes` have them; corners, edges : (V, 3) of each, and the
    neighbours of each corner."""

    boxes: Array
    corners: tuple[Array, ...]
    edges: tuple[tuple[tuple[int, ...], ...], ...]
    rounding: Array
    disc: Array
    carrier: Integers
    place: Array

    def beside(self, others: ShapeParts) -> ShapeParts:
        """These shapes, then the others."""
        arrays = {
            name: np.concatenate([getattr(self, name), getattr(others, name)])
            for name in ("boxes", "rounding", "disc", "carrier", "place")
        }
        return ShapeParts(corners=self.corners + others.corners, edges=self.edges + others.edges, **arrays)


class OwnParts(NamedTuple):
    """A robot's shapes.

    levers (G, 3 + n) : how far a unit of each number of a leg can move a shape, m
    between : `levers` and `stems` (2, 3 + n) of `MovedShapes` of the pairs of two of them
    """

    parts: ShapeParts
    levers: Array
    between: dict[Pair, Array]


def edges_of(geometry: Any) -> tuple[tuple[int, ...], ...]:
    """Of each corner of a hull those at the other ends of its edges; none of what has few corners."""
    if not isinstance(geometry, coal.Convex):
        return ()
    ends: list[set[int]] = [set() for _ in range(geometry.num_points)]
    if len(ends) <= FEW:
        return ()
    for k in range(geometry.num_polygons):
        triangle = geometry.polygons(k)
        a, b, c = triangle[0], triangle[1], triangle[2]
        ends[a] |= {b, c}
        ends[b] |= {a, c}
        ends[c] |= {a, b}
    return tuple(tuple(sorted(other)) for other in ends)


def place_on(axes: pin.SE3, placement: pin.SE3) -> Array:
    """Where a shape is on a joint with these axes, (12,), of its placement on Pinocchio's."""
    return as_row(axes.inverse() * placement)


def shape_parts(objects: Any, carrier: Integers, joint_axes: list[pin.SE3], boxes: Array) -> ShapeParts:
    """Those of shapes that these joints carry, with the boxes around them."""
    rounded = [corners_of(shape.geometry) for shape in objects]
    discs = [shape.geometry.radius if isinstance(shape.geometry, coal.Cylinder) else 0.0 for shape in objects]
    places = [place_on(joint_axes[i], shape.placement) for i, shape in zip(carrier, objects, strict=True)]
    return ShapeParts(
        boxes=boxes,
        corners=tuple(corners for corners, _ in rounded),
        edges=tuple(edges_of(shape.geometry) for shape in objects),
        rounding=np.array([radius for _, radius in rounded]),
        disc=np.array(discs),
        carrier=carrier,
        place=np.array(places).reshape(-1, 12),
    )


@lru_cache(maxsize=8)
def own_parts(robot: Robot, meshes: str, distance: float) -> OwnParts:
    """Those of a robot; meshes, distance : of `own_shapes`.

    What a joint moves is no farther from it than the lengths between joints, and the travel of sliding ones,
    together."""
    model, n = robot.model, robot.n
    shapes, boxes, _ = own_shapes(robot, meshes, distance)
    objects = shapes.geometryObjects
    carrier = np.array([shape.parentJoint for shape in objects], dtype=np.int64)
    parts = shape_parts(objects, carrier, robot.joint_axes, boxes)
    lengths = np.array([float(np.linalg.norm(placement.translation)) for placement in model.jointPlacements])
    for joint in range(1, model.njoints):
        c = model.joints[joint].idx_v
        if robot.q_units[c] == "m" and c >= robot.platform.n_p:
            lengths[joint] += float(np.abs(robot.q_limits[c]).max())
    # How far a shape reaches from each joint's origin on its way to the root.
    far: list[dict[int, float]] = []
    for i, shape in enumerate(objects):
        reached, joint = {}, int(carrier[i])
        so_far = float(np.linalg.norm(shape.placement.act(parts.boxes[i, :3]))) + parts.boxes[i, 6]
        while True:
            reached[joint] = so_far
            if joint == 0:
                break
            so_far += lengths[joint]
            joint = int(model.parents[joint])
        far.append(reached)
    levers = np.zeros((len(objects), 3 + n))
    slides = {joint: robot.q_units[model.joints[joint].idx_v] == "m" for joint in range(1, model.njoints)}
    for i, reached in enumerate(far):
        for joint, lever in reached.items():
            if joint > 0:
                levers[i, 3 + model.joints[joint].idx_v] = 1.0 if slides[joint] else lever
    between: dict[Pair, Array] = {}
    for i, j in pairs_of(robot.collision_model):
        rows = np.array([np.zeros(3 + n), np.full(3 + n, np.inf)])
        for mover, other in ((i, j), (j, i)):
            shared = next(joint for joint in far[mover] if joint in far[other])
            length = 0.0  # how far a joint's origin can be from that of the one that moves both
            for joint in reversed([joint for joint in far[mover] if joint not in far[other]]):
                length += lengths[joint]
                rows[0, 3 + model.joints[joint].idx_v] = levers[mover, 3 + model.joints[joint].idx_v]
                if not slides[joint]:
                    rows[1, 3 + model.joints[joint].idx_v] = far[other][shared] + length
        between[i, j] = rows
    if robot.platform.n_p >= 3:
        for numbers in (levers, *between.values()):
            numbers[..., :3] = numbers[..., 3:6]
            numbers[..., 3:6] = 0.0
    return OwnParts(parts, levers, between)
