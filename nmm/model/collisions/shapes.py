"""The shapes of obstacles: lengths in m, axes of their own placement. Hulls of meshes are cached on disk."""

from __future__ import annotations

import hashlib
import io
from abc import ABC, abstractmethod
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import coal
import numpy as np
import platformdirs

from nmm.base import disk_cache
from nmm.base.arrays import Array, Integers, array, nonzero_vector, positive, vector
from nmm.base.errors import InputError, expect
from nmm.base.text_format import one_line
from nmm.model.robots.mesh_files import mesh_arrays

#: A hull is flat where its volume is below this share of its longest edge cubed.
FLAT = 1e-9
#: Coal counts a corner's neighbours in a byte.
MOST_NEIGHBORS = 255


class Shape(ABC):
    """What Coal measures distances to; `geometry()` makes it.

    Examples
    --------
    >>> isinstance(nmm.Sphere(0.2), nmm.extending.Shape), nmm.Sphere(0.2).geometry().radius
    (True, 0.2)
    """

    @abstractmethod
    def geometry(self) -> Any:
        """Coal's shape, convex."""

    def drawn(self) -> Any:
        """What is drawn of it, a shape of Coal's, too, or a mesh."""
        return self.geometry()


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
        expect(np.all(size > 0.0), "box: size", "three lengths above 0", list(self.size))
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
class HalfSpace(Shape):
    """A half-space: everything below the plane through the origin, whose `normal` (3,) points out of it.

    Examples
    --------
    >>> wall = nmm.Obstacle(nmm.HalfSpace([-1, 0, 0]), [3.0, 0.0, 0.0], name="everything beyond x = 3 m")
    >>> wall.at(0.0).translation
    array([3., 0., 0.])
    """

    normal: Sequence[float] = (0.0, 0.0, 1.0)

    def __post_init__(self) -> None:
        normal = nonzero_vector(self.normal, 3, "plane: normal")
        object.__setattr__(self, "normal", tuple((normal / np.linalg.norm(normal)).tolist()))

    def geometry(self) -> Any:
        return coal.Halfspace(np.array(self.normal), 0.0)


@dataclass(frozen=True)
class ConvexMesh(Shape):
    """The convex hull of a mesh file (STL, DAE, OBJ, PLY), its axes stretched by `scale` (3,).

    Examples
    --------
    >>> import trimesh
    >>> _ = trimesh.creation.icosphere(radius=0.5).export("stone.stl")
    >>> nmm.Obstacle(nmm.ConvexMesh("stone.stl", scale=(1, 1, 0.5)), [2.0, 0.0, 0.0], name="stone").name
    'stone'
    """

    file: str | Path
    scale: Sequence[float] = (1.0, 1.0, 1.0)

    def __post_init__(self) -> None:
        object.__setattr__(self, "scale", tuple(vector(self.scale, 3, "mesh: scale").tolist()))
        self.geometry()

    def geometry(self) -> Any:
        file, where = Path(self.file), f"mesh: {self.file}"
        expect(file.is_file(), "mesh", "a file", str(file))
        try:
            return hull(mesh_arrays(str(file), self.scale)[0])
        except (OSError, ValueError) as error:
            if isinstance(error, InputError):
                raise error.at(where) from None
            raise InputError(f"cannot be read: {one_line(str(error))}", where=where) from None


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
        expect(points.ndim == 2 and points.shape[1] == 3, "hull: points", "shape (N, 3)", points)
        object.__setattr__(self, "points", points)
        self.geometry()

    def geometry(self) -> Any:
        return hull(self.points)


def hull(points: Array) -> Any:
    """The convex hull of points (N, 3), m, as Coal's convex shape; `InputError` where it has no volume."""
    points = np.ascontiguousarray(np.unique(points, axis=0))
    return _hull(points.tobytes())


#: Hulls of so many points, as of the box around a cloud, are made faster than they are read.
FEW = 8


@lru_cache(maxsize=256)
def _hull(data: bytes) -> Any:
    points = np.frombuffer(data).reshape(-1, 3)
    corners, faces = _kept(hashlib.sha256(data).hexdigest()[:24], points)
    mesh, triangles = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
    mesh.extend([*corners])
    triangles.extend([coal.Triangle(*face) for face in faces.tolist()])
    return coal.Convex(mesh, triangles)


def _kept(name: str, points: Array) -> tuple[Array, Integers]:
    """Corners (V, 3) and triangles (F, 3) of the hull, from the cache if they are there."""
    if len(points) <= FEW:
        return _made(points)
    path = Path(platformdirs.user_cache_dir("nmm")) / "hulls" / f"{name}.convex"
    data = disk_cache.read(path)
    if data is not None:
        with np.load(io.BytesIO(data)) as file:
            return file["corners"], file["faces"]
    corners, faces = _made(points)
    made = io.BytesIO()
    np.savez(made, corners=corners, faces=faces)
    with suppress(OSError):  # without a cache it is only slower
        disk_cache.write(path, made.getvalue())
    return corners, faces


def _made(points: Array) -> tuple[Array, Integers]:
    from scipy.spatial import ConvexHull, QhullError  # here: half a second that most need not pay

    size = float(np.ptp(points, axis=0).max()) if len(points) else 0.0
    try:
        hull = ConvexHull(points)
        if np.bincount(hull.simplices.ravel()).max() > MOST_NEIGHBORS:
            hull = ConvexHull(points, qhull_options="QJ")  # moved by rounding, a flat side is no fan
    except (QhullError, ValueError):
        hull = None
    if hull is None or hull.volume <= FLAT * size**3:
        raise InputError(f"its {len(points)} points enclose no volume")
    number = np.empty(len(points), dtype=np.int64)
    number[hull.vertices] = np.arange(len(hull.vertices))
    corners, faces = hull.points[hull.vertices], number[hull.simplices]
    # Qhull's triangles have either orientation; Coal expects outward normals.
    a, b, c = (corners[faces[:, k]] for k in range(3))
    inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), hull.equations[:, :3]) < 0.0
    faces[inward] = faces[inward][:, ::-1]
    return np.ascontiguousarray(corners), faces
