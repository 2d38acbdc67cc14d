"""A robot's shapes as distances are measured to them: primitives as they are, meshes as convex hulls."""

from __future__ import annotations

from typing import Any

import coal
import numpy as np
import pinocchio as pin

from nmm.arrays import Array
from nmm.collisions.hulls import hull
from nmm.errors import InputError
from nmm.robots.robot import Robot

HULLS, CAPSULES = "hulls", "capsules"
#: Half of the thickness that a mesh without volume is given, m.
THIN = 5e-4


def query_shapes(robot: Robot, meshes: str = HULLS) -> pin.GeometryModel:
    """A geometry model without pairs: the robot's collision shapes, every one of them convex.

    Parameters
    ----------
    meshes : what stands for a mesh, "hulls" or "capsules" (around its points, along their longest axis)
    """
    found = pin.GeometryModel()
    for shape in robot.collision_model.geometryObjects:
        copied, placement = pin.GeometryObject(shape), shape.placement
        if isinstance(shape.geometry, coal.BVHModelBase):
            points = np.array(shape.geometry.vertices()).reshape(-1, 3)
            copied.geometry, own = _capsule(points) if meshes == CAPSULES else (_hull(points), None)
            copied.placement = placement if own is None else placement * own
        found.addGeometryObject(copied)
    return found


def link_names(robot: Robot, shapes: pin.GeometryModel) -> tuple[str, ...]:
    """The link of each shape of the robot."""
    return tuple(robot.model.frames[shape.parentFrame].name for shape in shapes.geometryObjects)


def _hull(points: Array) -> Any:
    try:
        return hull(points)
    except InputError:  # a plate: both of its sides
        return hull(np.vstack([points + THIN * corner for corner in _CORNERS]))


_CORNERS = np.array(np.meshgrid([-1.0, 1.0], [-1.0, 1.0], [-1.0, 1.0])).reshape(3, -1).T


def _capsule(points: Array) -> tuple[Any, pin.SE3]:
    """A capsule around points (N, 3), and where it is."""
    middle = points.mean(axis=0)
    axes = np.linalg.svd(points - middle, full_matrices=False)[2]
    axes[2] = np.cross(axes[0], axes[1])
    turn = axes[[1, 2, 0]].T  # the longest along z
    local = (points - middle) @ turn
    center = np.append((local[:, :2].min(axis=0) + local[:, :2].max(axis=0)) / 2.0, 0.0)
    local -= center
    across = np.linalg.norm(local[:, :2], axis=1)
    radius = max(float(across.max()), THIN)
    caps = np.sqrt(np.maximum(radius**2 - across**2, 0.0))
    low, high = float((local[:, 2] + caps).min()), float((local[:, 2] - caps).max())
    if low > high:
        low = high = (low + high) / 2.0
    center[2] = (low + high) / 2.0
    return coal.Capsule(radius, max(high - low, THIN)), pin.SE3(turn, middle + turn @ center)
