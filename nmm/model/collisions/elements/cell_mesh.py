"""Cells as a mesh of their outer faces: what pages draw of clouds and maps."""

from __future__ import annotations

from typing import Any

import coal
import numpy as np

from nmm.base.arrays import Array, Integers

#: No mesh has more faces of four corners: of 84 bytes each, a page of 2 MB holds as many.
FACES = 15_000


def cell_mesh(points: Array, corner: Array, cell: Array) -> Any:
    """A mesh of Coal's of the cells in which there are points (N, 3), m; edges are multiples of `cell`."""
    vertices, triangles = cell_triangles(points, corner, cell)
    mesh = coal.BVHModelOBBRSS()
    mesh.beginModel(len(triangles), len(vertices))
    mesh.addVertices(vertices)
    mesh.addTriangles(np.ascontiguousarray(triangles, dtype=np.int32))
    mesh.endModel()
    return mesh


def cell_triangles(points: Array, corner: Array, cell: Array) -> tuple[Array, Integers]:
    """Vertices (V, 3), m, and triangles (F, 3) of that mesh."""
    times = 1
    while True:
        edge = cell * times
        cells = np.unique(np.floor((points - corner) / edge).astype(np.int64), axis=0)
        faces = _merged(_outer_faces(cells))
        if len(faces) <= FACES:
            break
        times = max(times + 1, int(times * np.sqrt(len(faces) / FACES)))
    first, axis, side, long, wide = faces[:, :3], *faces[:, 3:].T
    vertices = np.zeros((len(faces), 4, 3))
    for k, (a, b) in enumerate(((0, 0), (1, 0), (1, 1), (0, 1))):
        at = first.astype(float)
        rows = np.arange(len(faces))
        at[rows, axis] += side
        # Counter-clockwise as seen from outside.
        at[rows, (axis + 1) % 3] += np.where(side == 1, a, b) * long
        at[rows, (axis + 2) % 3] += np.where(side == 1, b, a) * wide
        vertices[:, k] = corner + at * edge
    begin = 4 * np.arange(len(faces))[:, np.newaxis]
    triangles = np.vstack([begin + np.array([0, 1, 2]), begin + np.array([0, 2, 3])])
    return vertices.reshape(-1, 3), triangles


def _outer_faces(cells: Integers) -> Integers:
    """Faces (F, 5) of cells (N, 3), which are sorted, with none on their other side: cell, axis, and whether
    it is the upper one."""
    wide = cells.max(axis=0) - cells.min(axis=0) + 3
    shifted = cells - cells.min(axis=0) + 1
    numbers = (shifted[:, 0] * wide[1] + shifted[:, 1]) * wide[2] + shifted[:, 2]
    faces = []
    for axis, step in enumerate((wide[1] * wide[2], wide[2], 1)):
        for side in (0, 1):
            beside = numbers + (step if side else -step)
            place = np.searchsorted(numbers, beside)
            covered = numbers[np.minimum(place, len(numbers) - 1)] == beside
            outer = cells[~covered]
            marks = np.tile([axis, side], (len(outer), 1))
            faces.append(np.hstack([outer, marks]))
    return np.vstack(faces)


def _merged(faces: Integers) -> Integers:
    """Rectangles (R, 7) of faces (F, 5) of one plane beside each other: the first's numbers, and how many
    there are along the axis after the face's and along the one after that."""
    axis, rows = faces[:, 3], np.arange(len(faces))
    planes, along, across = (faces[rows, (axis + k) % 3] for k in range(3))
    sides = faces[:, 3] * 2 + faces[:, 4]
    begins, long = _runs(np.stack([sides, planes, across, along]))
    ends = np.stack([sides[begins], planes[begins], along[begins], long, across[begins]])
    again, wide = _runs(ends)
    return np.hstack([faces[begins[again]], long[again][:, np.newaxis], wide[:, np.newaxis]])


def _runs(keys: Integers) -> tuple[Integers, Integers]:
    """Of columns (K, N), those that begin a run, where the last number rises by 1 and the others stay, and
    how long the runs are."""
    order = np.lexsort(keys[::-1])
    steps = np.diff(keys[:, order], axis=1)
    goes_on = np.all(steps[:-1] == 0, axis=0) & (steps[-1] == 1)
    begins = np.flatnonzero(np.concatenate([[True], ~goes_on]))
    return order[begins], np.diff(np.append(begins, len(order)))
