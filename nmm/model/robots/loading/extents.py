"""How far shapes reach from an axis."""

from typing import Any

import numpy as np
import pinocchio as pin

from nmm.base.arrays import Array


def has_width(shape: pin.GeometryObject) -> bool:
    """Whether `width` measures it: boxes have no radius."""
    return len(points_of(shape.geometry)[0]) > 0


def width(points: Array, along: Array) -> float:
    """How far (m) points (k, 3) reach from an axis through the origin where they reach least: the radius of a
    wheel, also of one that a box stands for."""
    across = np.linalg.svd(along[np.newaxis])[2][1:]  # two directions at right angles to the axis
    turns = np.linspace(0.0, 2.0 * np.pi, 72, endpoint=False)
    ways = np.column_stack([np.cos(turns), np.sin(turns)]) @ across
    return float((points @ ways.T).max(axis=0).min())


def points_of(geometry: Any) -> tuple[Array, float]:
    """Points (k, 3) of a shape, m, and the radius of balls about them that fill it; none of a box."""
    match type(geometry).__name__:
        case "Sphere":
            return np.zeros((1, 3)), float(geometry.radius)
        case "Capsule":
            return np.outer((-1.0, 1.0), (0.0, 0.0, geometry.halfLength)), float(geometry.radius)
        case "Cylinder":
            turns = np.linspace(0.0, 2.0 * np.pi, 72, endpoint=False)
            rim = geometry.radius * np.column_stack([np.cos(turns), np.sin(turns)])
            ends = [np.column_stack([rim, np.full(72, end * geometry.halfLength)]) for end in (-1.0, 1.0)]
            return np.vstack(ends), 0.0
    mesh = getattr(geometry, "vertices", None)
    return (np.zeros((0, 3)) if mesh is None else np.array(mesh())), 0.0
