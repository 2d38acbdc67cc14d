"""Which points are a robot's own: those within a distance of its shapes."""

from __future__ import annotations

from typing import Any

import coal
import numpy as np
import pinocchio as pin

from nmm.base.arrays import Array, Flags
from nmm.model.collisions.pairs import query_shapes
from nmm.model.robots.robot import Robot


def near_robot(robot: Robot, q: Array, points: Array, padding: float) -> Flags:
    """Which points (N, 3), m, world axes, are within `padding`, m, of the robot's collision shapes at q."""
    shapes = query_shapes(robot)
    placed = pin.GeometryData(shapes)
    pin.updateGeometryPlacements(robot.model, robot.model.createData(), shapes, placed, q)
    near = np.zeros(len(points), dtype=bool)
    for i, shape in enumerate(shapes.geometryObjects):
        pose, geometry = placed.oMg[i], shape.geometry
        geometry.computeLocalAABB()
        low, high = geometry.aabb_local.min_ - padding, geometry.aabb_local.max_ + padding
        local = (points - pose.translation) @ pose.rotation
        within = np.flatnonzero(~near & np.all((local >= low) & (local <= high), axis=1))
        near[within] = point_distances(geometry, local[within]) <= padding
    return near


def point_distances(geometry: Any, points: Array) -> Array:
    """Distances (N,) of points (N, 3) from a convex shape of Coal's, in its axes; at most 0 inside, m."""
    if isinstance(geometry, coal.Box):
        beyond = np.abs(points) - np.array(geometry.halfSide)
        return np.asarray(
            np.linalg.norm(np.maximum(beyond, 0.0), axis=1) + np.minimum(beyond.max(axis=1), 0.0)
        )
    if isinstance(geometry, coal.Sphere):
        return np.asarray(np.linalg.norm(points, axis=1) - geometry.radius)
    if isinstance(geometry, coal.Capsule):
        along = np.clip(points[:, 2], -geometry.halfLength, geometry.halfLength)
        off = points - np.column_stack([0.0 * along, 0.0 * along, along])
        return np.asarray(np.linalg.norm(off, axis=1) - geometry.radius)
    if isinstance(geometry, coal.Cylinder):
        sides = np.hypot(points[:, 0], points[:, 1]) - geometry.radius
        beyond = np.column_stack([sides, np.abs(points[:, 2]) - geometry.halfLength])
        return np.asarray(
            np.linalg.norm(np.maximum(beyond, 0.0), axis=1) + np.minimum(beyond.max(axis=1), 0.0)
        )
    still, point = coal.Transform3s(), coal.Sphere(1e-9)
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    distances = np.zeros(len(points))
    for k, at in enumerate(points):
        result.clear()
        place = coal.Transform3s(np.eye(3), at)
        distances[k] = coal.distance(geometry, still, point, place, request, result)
    return distances
