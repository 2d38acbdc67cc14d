"""Convex hulls of meshes: made once, kept on disk under a digest of the mesh's points."""

from __future__ import annotations

import hashlib
import io
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from typing import Any

import coal
import numpy as np
import platformdirs

from nmm import kept
from nmm.arrays import Array, Integers
from nmm.errors import InputError
from nmm.robots.meshes import mesh_of
from nmm.words import one_line

#: A hull is flat where its volume is below this share of its longest edge cubed.
FLAT = 1e-9


def hull_of_file(file: Path, scale: Array) -> Any:
    """The convex hull of a mesh file.

    Raises
    ------
    InputError : the file is missing, cannot be read, or its points have no volume
    """
    if not file.is_file():
        raise InputError(f"mesh: there is no file {file}")
    try:
        mesh = mesh_of(str(file), scale)
    except (OSError, ValueError, RuntimeError) as error:
        said = one_line(str(error)).rpartition("message: ")[2]  # before it, where in Coal's source
        raise InputError(f"mesh: {file} cannot be read: {said}") from None
    try:
        return hull(np.array(mesh.vertices()).reshape(-1, 3))
    except InputError as error:
        raise InputError(f"mesh: {file}: {error}") from None


def hull(points: Array) -> Any:
    """The convex hull of points (N, 3), m, as Coal's convex shape; `InputError` where it has no volume."""
    points = np.ascontiguousarray(np.unique(points, axis=0))
    return _hull(points.tobytes())


@lru_cache(maxsize=256)
def _hull(data: bytes) -> Any:
    points = np.frombuffer(data).reshape(-1, 3)
    corners, faces = _kept(hashlib.sha256(data).hexdigest()[:24], points)
    mesh = coal.StdVec_Vec3s()
    for corner in corners:
        mesh.append(corner)
    triangles = coal.StdVec_Triangle()
    for face in faces:
        triangles.append(coal.Triangle(*map(int, face)))
    return coal.Convex(mesh, triangles)


def _kept(name: str, points: Array) -> tuple[Array, Integers]:
    """Corners (V, 3) and triangles (F, 3) of the hull, read where they were made before."""
    path = Path(platformdirs.user_cache_dir("nmm")) / "hulls" / f"{name}.hull"
    data = kept.read(path)
    if data is not None:
        with np.load(io.BytesIO(data)) as file:
            return file["corners"], file["faces"]
    corners, faces = _made(points)
    made = io.BytesIO()
    np.savez(made, corners=corners, faces=faces)
    with suppress(OSError):  # a disk that is full or read-only costs time, nothing else
        kept.write(path, made.getvalue())
    return corners, faces


def _made(points: Array) -> tuple[Array, Integers]:
    from scipy.spatial import ConvexHull, QhullError  # here: half a second that most need not pay

    size = float(np.ptp(points, axis=0).max()) if len(points) else 0.0
    try:
        found = ConvexHull(points)
    except (QhullError, ValueError):
        raise InputError(f"its {len(points)} points enclose no volume") from None
    if found.volume <= FLAT * size**3:
        raise InputError(f"its {len(points)} points enclose no volume")
    number = {int(vertex): i for i, vertex in enumerate(found.vertices)}
    faces = np.array([[number[int(i)] for i in face] for face in found.simplices], dtype=np.int64)
    corners = found.points[found.vertices]
    # Qhull's triangles turn either way; Coal wants them to turn about the normal that points out.
    a, b, c = (corners[faces[:, k]] for k in range(3))
    inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), found.equations[:, :3]) < 0.0
    faces[inward] = faces[inward][:, ::-1]
    return np.ascontiguousarray(corners), faces
