"""The shapes of obstacles: lengths in m, axes of their own placement."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import coal
import numpy as np

from nmm.arrays import Array, array, positive, vector
from nmm.collisions.hulls import hull, hull_of_file
from nmm.errors import InputError


class Shape(ABC):
    """What Coal measures distances to; `geometry()` makes it.

    Examples
    --------
    >>> isinstance(nmm.Sphere(0.2), nmm.Shape), nmm.Sphere(0.2).geometry().radius
    (True, 0.2)
    """

    @abstractmethod
    def geometry(self) -> Any:
        """Coal's shape, convex."""


@dataclass(frozen=True)
class Box(Shape):
    """A box about its placement's origin: `size` (3,), its edges along x, y, z.

    Examples
    --------
    >>> wall = nmm.Obstacle(nmm.Box([2.0, 0.1, 1.0]), [0.0, 1.0, 0.5], name="wall")
    >>> wall.shape
    Box(size=(2.0, 0.1, 1.0))
    """

    size: Sequence[float]

    def __post_init__(self) -> None:
        size = vector(self.size, 3, "box: size")
        if np.any(size <= 0.0):
            raise InputError(f"box: size: expected three lengths above 0, got {list(self.size)}")
        object.__setattr__(self, "size", tuple(size.tolist()))

    def geometry(self) -> Any:
        return coal.Box(*self.size)


@dataclass(frozen=True)
class Sphere(Shape):
    """A sphere about its placement's origin.

    Examples
    --------
    >>> ball = nmm.Obstacle(nmm.Sphere(0.1), [1.0, 0.0, 0.8])
    >>> ball.move_to([1.2, 0.0, 0.8])
    >>> ball.at(0.0).translation
    array([1.2, 0. , 0.8])
    """

    radius: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "radius", positive(self.radius, "sphere: radius"))

    def geometry(self) -> Any:
        return coal.Sphere(self.radius)


@dataclass(frozen=True)
class Round(Shape):
    """A shape of `radius` and `length` along z, its middle in the origin."""

    radius: float
    length: float

    def __post_init__(self) -> None:
        for name in ("radius", "length"):
            positive_size = positive(getattr(self, name), f"{type(self).__name__.lower()}: {name}")
            object.__setattr__(self, name, positive_size)


class Cylinder(Round):
    """A cylinder along z, its middle in the origin.

    Examples
    --------
    >>> post = nmm.Obstacle(nmm.Cylinder(radius=0.2, length=0.8), [1.0, 0.0, 0.4], name="post")
    >>> post.shape
    Cylinder(radius=0.2, length=0.8)
    """

    def geometry(self) -> Any:
        return coal.Cylinder(self.radius, self.length)


class Capsule(Round):
    """All points within `radius` of a segment of `length` along z, its middle in the origin.

    Examples
    --------
    >>> rail = nmm.Obstacle(nmm.Capsule(radius=0.05, length=1.0), [1.0, 0.0, 0.5], name="rail")
    >>> rail.shape
    Capsule(radius=0.05, length=1.0)
    """

    def geometry(self) -> Any:
        return coal.Capsule(self.radius, self.length)


@dataclass(frozen=True)
class Plane(Shape):
    """A half-space: everything below the plane through the origin, whose `normal` (3,) points out of it.

    Examples
    --------
    >>> wall = nmm.Obstacle(nmm.Plane([-1, 0, 0]), [3.0, 0.0, 0.0], name="everything beyond x = 3 m")
    >>> wall.at(0.0).translation
    array([3., 0., 0.])
    """

    normal: Sequence[float] = (0.0, 0.0, 1.0)

    def __post_init__(self) -> None:
        normal = vector(self.normal, 3, "plane: normal")
        length = float(np.linalg.norm(normal))
        if length == 0.0:
            raise InputError("plane: normal: expected a direction, got 0, 0, 0")
        object.__setattr__(self, "normal", tuple((normal / length).tolist()))

    def geometry(self) -> Any:
        return coal.Halfspace(np.array(self.normal), 0.0)


@dataclass(frozen=True)
class Mesh(Shape):
    """The convex hull of a mesh file (STL, DAE, OBJ, PLY), its axes stretched by `scale` (3,).

    Examples
    --------
    >>> import trimesh
    >>> _ = trimesh.creation.icosphere(radius=0.5).export("stone.stl")
    >>> nmm.Obstacle(nmm.Mesh("stone.stl", scale=(1, 1, 0.5)), [2.0, 0.0, 0.0], name="stone").name
    'stone'
    """

    file: str | Path
    scale: Sequence[float] = (1.0, 1.0, 1.0)

    def __post_init__(self) -> None:
        object.__setattr__(self, "scale", tuple(vector(self.scale, 3, "mesh: scale").tolist()))
        self.geometry()

    def geometry(self) -> Any:
        return hull_of_file(Path(self.file), np.array(self.scale))


@dataclass(frozen=True, eq=False)
class Hull(Shape):
    """The convex hull of `points` (N, 3).

    Examples
    --------
    >>> ramp = nmm.Hull([[0, 0, 0], [1, 0, 0], [1, 0, 0.2], [0, 1, 0], [1, 1, 0], [1, 1, 0.2]])
    >>> nmm.Collisions(obstacles=[nmm.Obstacle(ramp, [1.0, 1.0, 0.0], name="ramp")]).distance
    0.03
    """

    points: Array

    def __post_init__(self) -> None:
        points = array(self.points, "hull: points")
        if points.ndim != 2 or points.shape[1] != 3:
            raise InputError(f"hull: points: expected shape (N, 3), got {points.shape}")
        object.__setattr__(self, "points", points)
        self.geometry()

    def geometry(self) -> Any:
        return hull(self.points)
