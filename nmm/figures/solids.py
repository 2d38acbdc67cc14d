"""Convex solids that a drawing of a robot is made of: the shapes of its bodies, its tyres."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from nmm.arrays import Array
from nmm.robots.loading.joint_kinds import axis
from nmm.robots.meshes import read_meshes
from nmm.robots.robot import Robot
from nmm.robots.wheel import Wheel

#: Directions, spread evenly over the sphere, in which a mesh's outermost points are kept.
_DIRECTIONS = 200
#: Points on a circle that stands for a round edge.
_AROUND = 28
#: Half width and half length of the neutral outline of a platform without shapes, m.
_NEUTRAL = 0.2


@dataclass(frozen=True, eq=False)
class Solid:
    """Points (k, 3), m, whose convex hull is a shape, in the frame of joint `joint`."""

    joint: int
    points: Array


def platform_shapes(robot: Robot, platform: Sequence[int]) -> list[Solid]:
    """The shapes that the platform's joints carry: what is seen, or else what collides."""
    names = {robot.model.names[joint]: joint for joint in platform}
    visual, collision = robot.shapes
    for model, geometry in ((robot.display_model, visual), (robot.model, collision)):
        carried = [shape for shape in geometry.geometryObjects if model.names[shape.parentJoint] in names]
        read_meshes(carried, robot.name)  # not the arm's, which is drawn as lines
        if carried:
            return _outermost(
                [Solid(names[model.names[shape.parentJoint]], _shape_points(shape)) for shape in carried]
            )
    return []


def outline_points(geometry: Any) -> Array | None:
    """Points (k, 3), m, whose convex hull is nearly a shape of Coal's, in its axes; None for a half-space."""
    name = type(geometry).__name__
    if name == "Halfspace":
        return None
    if name in ("Sphere", "Capsule"):
        k = np.linspace(-0.5 * np.pi, 0.5 * np.pi, _AROUND // 2 + 1)
        lift = float(geometry.halfLength) if name == "Capsule" else 0.0
        radius = float(geometry.radius)
        rings = [_cylinder(radius * np.cos(a), lift + radius * np.sin(a)) for a in k[k >= 0.0]]
        return np.vstack(rings)
    return _geometry_points(geometry)


def _shape_points(shape: Any) -> Array:
    """Points whose convex hull is that of a Pinocchio geometry object, in its joint's frame."""
    points = _geometry_points(shape.geometry)
    return points @ np.array(shape.placement.rotation).T + np.array(shape.placement.translation)


def _geometry_points(geometry: Any) -> Array:
    if hasattr(geometry, "halfSide"):
        points = _corners(-np.array(geometry.halfSide), np.array(geometry.halfSide))
    elif type(geometry).__name__ == "Cylinder":
        points = _cylinder(float(geometry.radius), float(geometry.halfLength))
    elif hasattr(geometry, "vertices") or hasattr(geometry, "points"):
        vertices = geometry.vertices() if hasattr(geometry, "vertices") else geometry.points()
        points = _extremes(np.array(vertices).reshape(-1, 3))  # Pinocchio has scaled them
    else:
        geometry.computeLocalAABB()
        box = geometry.aabb_local
        points = _corners(np.array(box.min_), np.array(box.max_))
    return points


def _corners(low: Array, high: Array) -> Array:
    x, y, z = np.meshgrid(*zip(low, high, strict=True), indexing="ij")
    return np.column_stack([x.ravel(), y.ravel(), z.ravel()])


def _cylinder(radius: float, half_length: float) -> Array:
    """Points on the two rims of a cylinder about z."""
    angles = np.linspace(0.0, 2.0 * np.pi, _AROUND, endpoint=False)
    rim = np.column_stack([radius * np.cos(angles), radius * np.sin(angles), np.full(_AROUND, half_length)])
    return np.vstack([rim, rim * (1.0, 1.0, -1.0)])


def _extremes(vertices: Array) -> Array:
    """The outermost of many points in directions spread over the sphere: nearly their convex hull."""
    if len(vertices) <= _DIRECTIONS:
        return vertices
    k = np.arange(_DIRECTIONS) + 0.5
    z = 1.0 - 2.0 * k / _DIRECTIONS
    angle = k * np.pi * (3.0 - np.sqrt(5.0))  # the golden angle: Fibonacci's sphere
    level = np.sqrt(1.0 - z * z)
    directions = np.column_stack([level * np.cos(angle), level * np.sin(angle), z])
    return np.asarray(vertices[np.unique(np.argmax(vertices @ directions.T, axis=0))])


def _outermost(solids: list[Solid]) -> list[Solid]:
    """Without the shapes that another of the same joint hides from above and from the side."""
    boxes = [(solid.joint, solid.points.min(axis=0), solid.points.max(axis=0)) for solid in solids]
    kept = []
    for i, (joint, low, high) in enumerate(boxes):
        hidden = any(
            i != j
            and joint == other
            and np.all(low >= outer_low - 1e-3)
            and np.all(high <= outer_high + 1e-3)
            and (i > j or not np.allclose([low, high], [outer_low, outer_high], atol=1e-3))
            for j, (other, outer_low, outer_high) in enumerate(boxes)
        )
        if not hidden:
            kept.append(solids[i])
    return kept


def body_wheels(robot: Robot) -> list[Wheel]:
    """The wheels on the root link's body."""
    return [wheel for wheel in robot.wheels if wheel.carrier == "theta"]


def wheel_points(robot: Robot, wheel: Wheel) -> Array:
    """The tyre, in the frame of the wheel's joint."""
    joint = robot.display_model.joints[robot.display_model.getJointId(wheel.joint)]
    return tyre(wheel.radius, axis(joint, np.zeros(robot.display_model.nq)))


def tyre(radius: float, along: Array) -> Array:
    """A tyre around the origin about an axis, half as wide as its radius."""
    across = np.eye(3)[int(np.argmin(np.abs(along)))]
    first = np.cross(along, across)
    first /= np.linalg.norm(first)
    R = np.column_stack([first, np.cross(along, first), along])
    return _cylinder(radius, 0.25 * radius) @ R.T


def neutral_outline(wheels: list[Array]) -> Array:
    """A box around the wheels, or of a neutral size where there is none."""
    if not wheels:
        return _corners(np.array([-_NEUTRAL, -_NEUTRAL, 0.0]), np.array([_NEUTRAL, _NEUTRAL, _NEUTRAL]))
    points = np.vstack(wheels)
    low, high = points.min(axis=0), points.max(axis=0)
    ahead = max(high[0], 0.5 * (high[1] - low[1]))
    return _corners(np.array([low[0], low[1], 0.0]), np.array([ahead, high[1], high[2]]))
