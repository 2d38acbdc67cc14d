"""Surfaces of a robot's shapes: how far down they reach, and which of them coincide."""

from __future__ import annotations

import coal
import numpy as np
from numpy.typing import NDArray


def reach_down(shape: coal.ShapeBase, rotation: NDArray[np.float64]) -> float:
    """How far the turned shape extends below its centre (its support function in the direction -z)."""
    down = np.abs(rotation[2])
    if isinstance(shape, coal.Box):
        return float(down @ shape.halfSide)
    if isinstance(shape, coal.Cylinder):
        return float(down[2] * shape.halfLength + np.hypot(down[0], down[1]) * shape.radius)
    return float(shape.radius)


def surface(shape: coal.ShapeBase) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Points on the faces of a shape and their outward normals, in its frame."""
    grid = np.linspace(-0.97, 0.97, 15)
    u, v = (k.ravel() for k in np.meshgrid(grid, grid))
    one = np.ones_like(u)
    if isinstance(shape, coal.Box):
        cube = [np.roll(np.stack([sign * one, u, v], 1), k, 1) for k in range(3) for sign in (-1, 1)]
        normals = [np.roll([[sign, 0.0, 0.0]] * len(u), k, 1) for k in range(3) for sign in (-1, 1)]
        return np.concatenate(cube) * shape.halfSide, np.concatenate(normals)
    if isinstance(shape, coal.Sphere):
        return np.zeros((0, 3)), np.zeros((0, 3))
    size = [shape.radius, shape.radius, shape.halfLength]
    ring, radius = np.pi * u, np.sqrt((v + 1) / 2)
    side = np.stack([np.cos(ring), np.sin(ring), 0 * one], 1)
    disc = side * radius[:, None]
    up = np.array([0.0, 0.0, 1.0])
    points = np.concatenate([side + v[:, None] * up, disc - up, disc + up]) * size
    return points, np.concatenate([side, -up + 0 * disc, up + 0 * disc])


def coincident(
    shape: coal.ShapeBase, points: NDArray[np.float64], normals: NDArray[np.float64], tolerance: float
) -> NDArray[np.bool_]:
    """Which points, in the shape's frame, lie on one of its faces that looks in the point's direction."""
    if isinstance(shape, coal.Box):
        on = np.abs(points * np.sign(normals.round(3)) - shape.halfSide) < tolerance
        within = np.abs(points) < shape.halfSide
        facing = np.abs(normals) > 0.99999
        others = np.stack([within[:, (k + 1) % 3] & within[:, (k + 2) % 3] for k in range(3)], 1)
        return (on & others & facing).any(1)
    if isinstance(shape, coal.Sphere):
        return np.zeros(len(points), dtype=bool)
    radial, height = np.hypot(points[:, 0], points[:, 1]), points[:, 2]
    cap = (normals[:, 2] * np.sign(height) > 0.99999) & (
        np.abs(np.abs(height) - shape.halfLength) < tolerance
    )
    outward = (normals[:, :2] * points[:, :2]).sum(1) > 0.99999 * radial
    side = outward & (np.abs(radial - shape.radius) < tolerance) & (np.abs(height) < shape.halfLength)
    return (cap & (radial < shape.radius)) | side
