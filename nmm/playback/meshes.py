"""Mesh files for the browser: a piece a material, no more triangles than one sees, sharp edges kept."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from nmm.arrays import Array
from nmm.playback.decimation import Indices, decimated

if TYPE_CHECKING:
    import trimesh

Color = tuple[float, float, float, float]

#: Faces that meet at less than this angle are shaded as one smooth surface, rad.
SMOOTH = np.radians(35.0)
#: A file's surface may be off by this share of its size (the diagonal of the box around it): a pixel when it
#: fills the window.
OFF = 1e-3


@dataclass(frozen=True, eq=False)
class MeshPiece:
    """vertices (V, 3) in m, faces (F, 3), and the file's own colour, if it has one."""

    vertices: Array
    faces: Indices
    color: Color | None


def mesh_pieces(geometry: pin.GeometryObject) -> list[MeshPiece]:
    """The pieces of a mesh, in the geometry's frame.

    Pinocchio merges a file's parts and forgets their materials, so that the file is read again. It is
    believed only as long as it fills the box that Pinocchio's mesh fills (units, axes, scales).
    """
    loaded = _pinocchio_mesh(geometry.geometry)
    pieces = _file_pieces(str(geometry.meshPath))
    if not pieces:
        return loaded
    scale = np.asarray(geometry.meshScale, dtype=float)
    flip = np.prod(scale) < 0.0
    scaled = [
        MeshPiece(piece.vertices * scale, piece.faces[:, ::-1] if flip else piece.faces, piece.color)
        for piece in pieces
    ]
    if not loaded or np.allclose(
        _box(scaled), _box(loaded), atol=3.0 * OFF * np.ptp(_box(loaded), axis=0).max()
    ):
        return scaled
    return loaded


@lru_cache(maxsize=256)
def _file_pieces(path: str) -> tuple[MeshPiece, ...]:
    """A mesh file's pieces, unscaled; none when trimesh cannot read it."""
    if not Path(path).is_file():
        return ()
    import trimesh

    try:
        scene = trimesh.load_scene(path, process=False)
        meshes = [mesh for mesh in scene.dump() if isinstance(mesh, trimesh.Trimesh) and len(mesh.faces)]
    except Exception:  # trimesh's readers raise whatever they meet; Pinocchio's copy of the mesh is at hand
        return ()
    if not meshes:
        return ()
    ends = np.array([mesh.bounds for mesh in meshes])
    off = OFF * float(np.linalg.norm(ends[:, 1].max(axis=0) - ends[:, 0].min(axis=0)))
    return tuple(MeshPiece(*_light(mesh, off), _color(mesh)) for mesh in meshes)


def _light(mesh: trimesh.Trimesh, off: float) -> tuple[Array, Indices]:
    """A decimated mesh, whose vertices are shared between the faces of a smooth surface, and only there."""
    import trimesh

    mesh = mesh.copy()
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    vertices, faces = decimated(
        np.array(mesh.vertices, dtype=float), np.array(mesh.faces, dtype=np.uint32), off
    )
    mesh = trimesh.graph.smooth_shade(trimesh.Trimesh(vertices, faces, process=False), angle=SMOOTH)
    return np.array(mesh.vertices, dtype=float), np.array(mesh.faces, dtype=np.uint32)


def _color(mesh: trimesh.Trimesh) -> Color | None:
    visual = mesh.visual
    if visual.kind is None:
        return None
    color = visual.material.main_color if visual.kind == "texture" else visual.main_color
    red, green, blue, alpha = (float(c) / 255.0 for c in color)
    return red, green, blue, alpha


def _pinocchio_mesh(shape: pin.hppfcl.CollisionGeometry) -> list[MeshPiece]:
    """The mesh that Pinocchio loaded, as one piece."""
    if not isinstance(shape, pin.hppfcl.BVHModelBase) or not shape.num_tris:
        return []
    triangles = (shape.tri_indices(i) for i in range(shape.num_tris))
    faces = np.array([[t[0], t[1], t[2]] for t in triangles], dtype=np.uint32)
    return [MeshPiece(np.array(shape.vertices(), dtype=float), faces, None)]


def _box(pieces: list[MeshPiece]) -> Array:
    vertices = np.vstack([piece.vertices for piece in pieces])
    return np.array([vertices.min(axis=0), vertices.max(axis=0)])
