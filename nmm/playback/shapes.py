"""Pinocchio's visual geometries as three.js geometries, each with the placement that its axes need."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from nmm.arrays import Array
from nmm.playback.encoding import packed
from nmm.playback.meshes import Color, Indices, mesh_pieces

fcl = pin.hppfcl

#: three.js turns its cylinders, cones and capsules about y, Pinocchio about z.
Y_TO_Z = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])


@dataclass(frozen=True, eq=False)
class Shape:
    """A three.js geometry (its JSON, without uuid), its colour, and its placement in the geometry's frame."""

    geometry: dict[str, Any]
    color: Color
    matrix: Array


def shapes(geometry: pin.GeometryObject) -> list[Shape]:
    """What to draw for a visual geometry; nothing for kinds that have no bounded surface."""
    red, green, blue, alpha = (float(c) for c in geometry.meshColor)
    color = (red, green, blue, alpha if alpha > 0.0 else 1.0)
    primitive = _primitive(geometry.geometry)
    if primitive is not None:
        data, matrix = primitive
        return [Shape(data, color, matrix)]
    return [
        Shape(
            triangles(piece.vertices, piece.faces),
            color if piece.color is None or geometry.overrideMaterial else piece.color,
            np.eye(4),
        )
        for piece in mesh_pieces(geometry)
    ]


def triangles(vertices: Array, faces: Indices) -> dict[str, Any]:
    """Triangles; the browser computes the normals."""
    short = len(vertices) <= 2**16
    kind, dtype = ("Uint16Array", np.uint16) if short else ("Uint32Array", np.uint32)
    return {
        "type": "BufferGeometry",
        "data": {
            "attributes": {
                "position": {"itemSize": 3, "type": "Float32Array", "array": packed(vertices, np.float32)}
            },
            "index": {"type": kind, "array": packed(faces, dtype)},
        },
    }


def sphere(radius: float) -> dict[str, Any]:
    """A sphere, radius in m."""
    sides = _sides(radius)
    return {"type": "SphereGeometry", "radius": radius, "widthSegments": sides, "heightSegments": sides // 2}


def cylinder(radius: float, length: float) -> dict[str, Any]:
    """A cylinder along y, m."""
    return {
        "type": "CylinderGeometry",
        "radiusTop": radius,
        "radiusBottom": radius,
        "height": length,
        "radialSegments": _sides(radius),
    }


def _sides(radius: float) -> int:
    """Flat sides that look round: a bolt needs fewer than a wheel. Four of them touch the round one's box."""
    return int(np.clip(4 * round(1.2 + 22.0 * np.sqrt(radius)), 8, 48))


def _primitive(shape: pin.hppfcl.CollisionGeometry) -> tuple[dict[str, Any], Array] | None:
    if isinstance(shape, fcl.Box):
        width, height, depth = (2.0 * float(half) for half in shape.halfSide)
        return {"type": "BoxGeometry", "width": width, "height": height, "depth": depth}, np.eye(4)
    if isinstance(shape, fcl.Sphere):
        return sphere(float(shape.radius)), np.eye(4)
    if isinstance(shape, fcl.Ellipsoid):
        return sphere(1.0), np.diag([*(float(radius) for radius in shape.radii), 1.0])
    if isinstance(shape, fcl.Cylinder):
        return cylinder(float(shape.radius), 2.0 * float(shape.halfLength)), Y_TO_Z
    if isinstance(shape, fcl.Cone):
        height, radius = 2.0 * float(shape.halfLength), float(shape.radius)
        return {
            "type": "ConeGeometry",
            "radius": radius,
            "height": height,
            "radialSegments": _sides(radius),
        }, Y_TO_Z
    if isinstance(shape, fcl.Capsule):
        return _capsule(float(shape.radius), float(shape.halfLength)), Y_TO_Z
    if isinstance(shape, fcl.ConvexBase):
        return _convex(np.array(shape.points(), dtype=float)), np.eye(4)
    return None


def _capsule(radius: float, half_length: float) -> dict[str, Any]:
    """A capsule along y: its outline turned about y."""
    sides = _sides(radius)
    angles = np.linspace(-np.pi / 2.0, np.pi / 2.0, sides // 2 + 2)
    heights = radius * np.sin(angles) + np.where(angles < 0.0, -half_length, half_length)
    outline = [{"x": float(x), "y": float(y)} for x, y in zip(radius * np.cos(angles), heights, strict=True)]
    return {"type": "LatheGeometry", "points": outline, "segments": sides}


def _convex(points: Array) -> dict[str, Any]:
    """A convex polyhedron, flat faces, seen from outside."""
    from scipy.spatial import ConvexHull

    hull = ConvexHull(points)
    corners = points[hull.simplices]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inward = np.sum(normals * hull.equations[:, :3], axis=1) < 0.0
    corners[inward] = corners[inward][:, ::-1]
    vertices = corners.reshape(-1, 3)
    return triangles(vertices, np.arange(len(vertices), dtype=np.uint32).reshape(-1, 3))
