"""Meshes with as many triangles as a picture shows, for the page: what collides keeps all of its own."""

from __future__ import annotations

import manifold3d
import numpy as np
from numpy.typing import NDArray

from nmm.arrays import Array, Flags, Integers

Indices = NDArray[np.uint32]

#: From a mesh's middle towards where its openings are closed, in its size. No face of a drawing is along it.
AWAY = 3.0 * np.array([0.37, -0.52, 0.77])


def decimated(vertices: Array, faces: Indices, off: float) -> tuple[Array, Indices]:
    """A mesh with fewer triangles, whose surface is nowhere further than about `off` from where it was.

    Manifold (Julian Smith, Emmett Lalish) removes vertices as long as that holds, but knows closed surfaces
    only. So the mesh is cut where more or fewer than two faces meet, and each opening closed by a cone, which
    is taken away again. A mesh that is none even then stays as it is.

    Parameters
    ----------
    vertices (V, 3), faces (F, 3) : m; faces that touch share their vertices
    off : m
    """
    corners, open_edges = _cut(faces)
    points = np.zeros((corners.max() + 1, 3))
    points[corners] = vertices[faces]
    begins, ends = corners[open_edges], np.roll(corners, -1, axis=1)[open_edges]
    loop = _components(begins, ends, len(points))[begins]
    loops, tip = np.unique(loop, return_inverse=True)
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
    found = closed.simplify(off).to_mesh()
    runs = zip(found.run_original_id, found.run_index, found.run_index[1:], strict=False)
    kept = [found.tri_verts[start // 3 : end // 3] for run, start, end in runs if run == own]
    used, numbered = np.unique(np.vstack([np.zeros((0, 3), np.uint32), *kept]), return_inverse=True)
    if not len(used):
        return vertices, faces
    return np.array(found.vert_properties[used, :3], dtype=float), numbered.reshape(-1, 3).astype(np.uint32)


def _cut(faces: Indices) -> tuple[Integers, Flags]:
    """Which vertex each face's corners are, (F, 3), where those are one that the faces around connect through
    edges of two faces; and which edges, from corner to corner, have no other face, (F, 3)."""
    begins, ends = faces.astype(np.int64), np.roll(faces, -1, axis=1).astype(np.int64)
    code = np.minimum(begins, ends) * (int(faces.max()) + 1) + np.maximum(begins, ends)
    _, edge, count = np.unique(code, return_inverse=True, return_counts=True)
    edge, forward = edge.reshape(-1), (begins < ends).reshape(-1)
    # Two faces, which go along it in opposite ways.
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
    """The number of the component of each of so many nodes, of a graph with these edges."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    graph = coo_array((np.ones(len(begins), dtype=bool), (begins, ends)), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)
