"""Mesh files for the browser: a piece per material, decimated, with sharp edges kept."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import manifold3d
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from nmm.base.arrays import Array, Flags, Integers
from nmm.model.robots.mesh_files import meshes_of

if TYPE_CHECKING:
    import trimesh

Color = tuple[float, float, float, float]
#: Faces that meet at less than this angle are shaded as one smooth surface, rad.
SMOOTH = np.radians(35.0)
#: A surface may be off by this share of its box's diagonal: a pixel when it fills the window.
OFF = 1e-3
Indices = NDArray[np.uint32]
#: From a mesh's middle to the tips of the cones that close openings, in its size; along no drawing's faces.
AWAY = 3.0 * np.array([0.37, -0.52, 0.77])


@dataclass(frozen=True, eq=False)
class MeshPiece:
    """vertices (V, 3) in m, faces (F, 3), and the file's own colour, if it has one."""

    vertices: Array
    faces: Indices
    color: Color | None


def mesh_pieces(geometry: pin.GeometryObject, off: float = OFF) -> list[MeshPiece]:
    """A mesh's pieces in the geometry's frame, off by at most that share of its box's diagonal. They are read
    again from the file because Pinocchio merges parts and drops materials, and used only if they fill the box
    of Pinocchio's mesh (units, axes, scales)."""
    loaded = _pinocchio_mesh(geometry.geometry)
    pieces = _file_pieces(str(geometry.meshPath), off)
    if not pieces:
        return loaded
    scale = np.asarray(geometry.meshScale, dtype=float)
    way = -1 if np.prod(scale) < 0.0 else 1
    scaled = [MeshPiece(piece.vertices * scale, piece.faces[:, ::way], piece.color) for piece in pieces]
    if not loaded:
        return scaled
    box = _box(loaded)
    return scaled if np.allclose(_box(scaled), box, atol=3.0 * off * np.ptp(box, axis=0).max()) else loaded


@lru_cache(maxsize=256)
def _file_pieces(path: str, share: float) -> tuple[MeshPiece, ...]:
    try:
        meshes = meshes_of(path)
        ends = np.array([mesh.bounds for mesh in meshes])
        off = share * float(np.linalg.norm(ends[:, 1].max(axis=0) - ends[:, 0].min(axis=0)))
        return tuple(MeshPiece(*_light(mesh, off), _color(mesh)) for mesh in meshes)
    except Exception:  # trimesh raises whatever it meets in colours; Pinocchio's copy of the mesh is at hand
        return ()


def _light(mesh: trimesh.Trimesh, off: float) -> tuple[Array, Indices]:
    """A decimated mesh whose vertices are shared only within smooth surfaces."""
    import trimesh

    mesh = mesh.copy()
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    original = np.array(mesh.vertices, dtype=float), np.array(mesh.faces, dtype=np.uint32)
    # Of a part that is thinner than this nothing would be left: then by less.
    vertices, faces = next(
        (
            lighter
            for finer in range(5)
            if len((lighter := decimated(*original, off / 2.0**finer))[1]) < len(original[1])
        ),
        original,
    )
    mesh = trimesh.graph.smooth_shade(trimesh.Trimesh(vertices, faces, process=False), angle=SMOOTH)
    return np.array(mesh.vertices, dtype=float), np.array(mesh.faces, dtype=np.uint32)


def _color(mesh: trimesh.Trimesh) -> Color | None:
    visual = mesh.visual
    if visual.kind is None:
        return None
    color = (visual.material if visual.kind == "texture" else visual).main_color
    red, green, blue, alpha = (float(part) / 255.0 for part in color)
    return red, green, blue, alpha


def _pinocchio_mesh(shape: pin.hppfcl.CollisionGeometry) -> list[MeshPiece]:
    if not isinstance(shape, pin.hppfcl.BVHModelBase) or not shape.num_tris:
        return []
    triangles = (shape.tri_indices(i) for i in range(shape.num_tris))
    faces = np.array([[t[k] for k in range(3)] for t in triangles], dtype=np.uint32)
    return [MeshPiece(np.array(shape.vertices(), dtype=float), faces, None)]


def _box(pieces: list[MeshPiece]) -> Array:
    vertices = np.vstack([piece.vertices for piece in pieces])
    return np.array([vertices.min(axis=0), vertices.max(axis=0)])


def decimated(vertices: Array, faces: Indices, off: float) -> tuple[Array, Indices]:
    """A mesh of vertices (V, 3), m, and faces (F, 3) with fewer triangles, off by at most about `off`, m.

    Manifold (Julian Smith, Emmett Lalish) simplifies closed surfaces only. So the mesh is cut where more or
    fewer than two faces meet, and each opening is closed by a cone, removed afterwards; a mesh that Manifold
    still refuses stays as it is.
    """
    corners, open_edges = _cut(faces)
    points = np.zeros((corners.max() + 1, 3))
    points[corners] = vertices[faces]
    begins, ends = corners[open_edges], np.roll(corners, -1, axis=1)[open_edges]
    loops, tip = np.unique(_components(begins, ends, len(points))[begins], return_inverse=True)
    low, high = points.min(axis=0), points.max(axis=0)
    tips = np.tile(0.5 * (low + high) + np.linalg.norm(high - low) * AWAY, (len(loops), 1))
    cones = np.column_stack([ends, begins, len(points) + tip])
    own = manifold3d.Manifold.reserve_ids(2)
    ends_of_parts = np.unique([0, 3 * len(corners), 3 * (len(corners) + len(cones))])
    closed = manifold3d.Manifold(
        manifold3d.Mesh(
            vert_properties=np.vstack([points, tips]).astype(np.float32),
            tri_verts=np.vstack([corners, cones]).astype(np.uint32),
            run_index=ends_of_parts.astype(np.uint32),
            run_original_id=np.arange(own, own + len(ends_of_parts) - 1, dtype=np.uint32),
        )
    )
    if closed.status() != manifold3d.Error.NoError:
        return vertices, faces
    mesh = closed.simplify(off).to_mesh()
    runs = zip(mesh.run_original_id, mesh.run_index, mesh.run_index[1:], strict=False)
    triangles = [mesh.tri_verts[start // 3 : end // 3] for run, start, end in runs if run == own]
    used, numbered = np.unique(np.vstack([np.zeros((0, 3), np.uint32), *triangles]), return_inverse=True)
    if not len(used):
        return vertices, faces
    return np.array(mesh.vert_properties[used, :3], dtype=float), numbered.reshape(-1, 3).astype(np.uint32)


def _cut(faces: Indices) -> tuple[Integers, Flags]:
    """The vertex of each face's corners (F, 3), shared by faces that edges of exactly two faces connect; and
    which edges (F, 3), from corner to corner, have no other face."""
    begins, ends = faces.astype(np.int64), np.roll(faces, -1, axis=1).astype(np.int64)
    code = np.minimum(begins, ends) * (int(faces.max()) + 1) + np.maximum(begins, ends)
    _, edge, count = np.unique(code, return_inverse=True, return_counts=True)
    edge, forward = edge.reshape(-1), (begins < ends).reshape(-1)
    # Two faces that traverse it in opposite directions.
    paired = ((count == 2) & (np.bincount(edge, forward) == 1))[edge]
    order = np.argsort(2 * edge[paired] + forward[paired], kind="stable")
    one, other = np.flatnonzero(paired)[order].reshape(-1, 2).T
    corner = np.arange(faces.size)
    following = np.roll(corner.reshape(-1, 3), -1, axis=1).reshape(-1)
    same = _components(
        np.concatenate([corner[one], following[one]]),
        np.concatenate([following[other], corner[other]]),
        faces.size,
    )
    return same.reshape(-1, 3), ~paired.reshape(-1, 3)


def _components(begins: Integers, ends: Integers, count: int) -> Integers:
    import trimesh

    edges = np.column_stack([begins, ends])
    return np.asarray(trimesh.graph.connected_component_labels(edges, count), dtype=np.int64)
