"""A wheel's size and the middle of its tyre, m, from its shapes."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Sequence
from contextlib import suppress
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from nmm.base.arrays import Array
from nmm.model.robots.loading.extents import points_of, width
from nmm.model.robots.mesh_files import mesh_arrays
from nmm.model.robots.meshes import is_unread

_ROUND = ("Cylinder", "Sphere", "Capsule")
#: A shape is round about an axis where it reaches as far in all directions to this share, and a cylinder's
#: axis is so near to it.
_EVEN, _COAXIAL = 0.9, 0.99
#: Of a mesh, what is at least this share of its radius from the axis is its tread.
_TREAD = 0.95


class Tyre(NamedTuple):
    """How far it reaches from its axis, where its middle is along that axis from the joint's origin, m, and
    whether it is round about it."""

    radius: float
    middle: float
    is_round: bool = False


def tyres(geometries: Sequence[pin.GeometryModel], joint: int, along: Array) -> Iterator[Tyre]:
    """The widest of the joint's round shapes in each geometry model that has any; then of its meshes, those
    of the last model first, for shapes that are shown are finer. `along` (3,) is the axis in the joint's
    frame. Meshes are read only where they are asked for."""
    for geometry in geometries:
        shapes = [shape for shape in geometry.geometryObjects if shape.parentJoint == joint]
        candidates = [_of_round(shape, along) for shape in shapes if type(shape.geometry).__name__ in _ROUND]
        yield from _widest(candidates)
    for geometry in reversed(geometries):
        shapes = [shape for shape in geometry.geometryObjects if shape.parentJoint == joint]
        yield from _widest([_of_mesh(shape, along) for shape in shapes])


def _widest(candidates: Sequence[Tyre]) -> Iterator[Tyre]:
    usable = [tyre for tyre in candidates if math.isfinite(tyre.radius) and tyre.radius > 0.0]
    if usable:
        widest = max(tyre.radius for tyre in usable)
        middles = [tyre.middle for tyre in usable if tyre.radius >= _TREAD * widest]
        yield Tyre(widest, 0.5 * (min(middles) + max(middles)), any(tyre.is_round for tyre in usable))


def _of_round(shape: Any, along: Array) -> Tyre:
    coaxial = abs(float(shape.placement.rotation[:, 2] @ along)) >= _COAXIAL
    is_round = coaxial or type(shape.geometry).__name__ == "Sphere"
    return Tyre(float(shape.geometry.radius), float(shape.placement.translation @ along), is_round)


def _of_mesh(shape: Any, along: Array) -> Tyre:
    """Of a mesh, unread or not; nothing of one that cannot be read, which says so where it is drawn."""
    rotation, place = np.array(shape.placement.rotation), np.array(shape.placement.translation)
    if not is_unread(shape):
        return _of_points(points_of(shape.geometry)[0] @ rotation.T + place, along)
    with suppress(OSError, ValueError):
        state = os.stat(shape.meshPath)
        arrays = (rotation, place, np.array(shape.meshScale), along)
        numbers = tuple(tuple(map(float, array.ravel())) for array in arrays)
        return _of_file(str(shape.meshPath), state.st_mtime_ns, state.st_size, *numbers)
    return Tyre(0.0, 0.0)


@lru_cache(maxsize=256)  # wheels are measured when they are looked for, when fitted, and when described
def _of_file(file: str, _changed: int, _size: int, rotation: Any, place: Any, scale: Any, along: Any) -> Tyre:
    points = mesh_arrays(file, scale)[0] @ np.reshape(rotation, (3, 3)).T + np.array(place)
    return _of_points(points, np.array(along))


def _of_points(points: Array, along: Array) -> Tyre:
    """Of points (k, 3) in the joint's frame, whose axis is `along`."""
    if not len(points):
        return Tyre(0.0, 0.0)
    heights = points @ along
    far = np.linalg.norm(points - np.outer(heights, along), axis=1)
    tread = heights[far >= _TREAD * far.max()]
    radius = width(points[far >= 0.5 * far.max()], along)
    return Tyre(radius, 0.5 * float(tread.min() + tread.max()), radius >= _EVEN * float(far.max()))
