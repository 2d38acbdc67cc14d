"""Elements sorted into cells, and a field of lower bounds of the distance from each cell to the nearest."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nmm.base.arrays import Array, Flags
from nmm.base.kernels.pointers import address_of
from nmm.model.collisions.elements.field import mark_full, sort_into_cells, take_finite, transform

#: More cells than this are made larger, in whole multiples.
MOST = 8_000_000
#: The field is less than the bound by this share: its numbers and those they come of are rounded to 24 bits.
ROUNDED = 1e-5
#: The field in cells inside of what is full, whose boxes are no elements, m.
INSIDE = -1.0


class Cells(NamedTuple):
    """N elements in nx × ny × nz cells.

    corner (3,), cell (3,) : the least corner of all cells, and a cell's edges, m
    starts (nx ny nz + 1,) : the first element of each cell, z fastest
    centres (N, 3), halves (N, 3), (1, 3) of all, or (0, 3) : the elements by cells, m; without halves points
    field (nx, ny, nz) : no point of a cell is nearer to a point of an element, m; `INSIDE` inside
    """

    corner: Array
    cell: Array
    starts: NDArray[np.int32]
    centres: Array
    halves: Array
    field: NDArray[np.float32]


def sorted_cells(
    centres: Array, halves: Array | None, cell: Array, corner: Array, inside: Array | None = None
) -> Cells:
    """The cells of elements, each of which lies within the cell of its centre; larger ones where there were
    too many."""
    everywhere = centres if inside is None or not len(inside) else np.vstack([centres, inside])
    low, high = ends(everywhere)
    first = np.floor((low - corner) / cell)
    corner, edge, times = corner + first * cell, cell, 1
    wide = high - corner
    while True:
        last = np.floor(wide / edge)
        counts = last.astype(np.int64) + 1
        excess = float(np.prod(last + 1.0)) / MOST
        if excess <= 1.0:
            break
        times = max(times + 1, int(times * np.cbrt(excess)))
        edge = cell * times
    if times > 1 and inside is not None and halves is not None and len(inside):
        # In larger cells those inside are elements, too: a cell may hold both.
        centres, halves = everywhere, np.vstack([halves, np.tile(0.5 * cell, (len(inside), 1))])
        inside = None
    starts, order, placed = sort_points(centres, corner, edge, counts)
    full = np.diff(starts).reshape(counts) > 0
    if inside is not None and len(inside):
        within = np.zeros(int(np.prod(counts)), dtype=bool)
        within[_numbers(inside, corner, edge, counts)] = True
        within = within.reshape(counts) & ~full
        full |= within
    field = far_field(full, edge)
    if inside is not None and len(inside):
        field[within] = INSIDE
    boxes = np.zeros((0, 3))
    if halves is not None:
        boxes = halves[:1].copy() if halves.strides[0] == 0 else halves[order]
    return Cells(corner, edge, starts, placed, boxes, field)


def ends(points: Array) -> tuple[Array, Array]:
    """The least and the greatest coordinates of points (N, 3), (3,) each: axis by axis, fifteen times as fast
    as NumPy's along all rows."""
    return np.array([axis.min() for axis in points.T]), np.array([axis.max() for axis in points.T])


def sort_points(
    points: Array, corner: Array, cell: Array, counts: NDArray[np.int64]
) -> tuple[NDArray[np.int32], NDArray[np.int32], Array]:
    """The first point of each cell (cells + 1,), the numbers of points by cells (N,), and the points so."""
    rows = np.ascontiguousarray(points, dtype=np.float64)
    starts = np.zeros(int(np.prod(counts)) + 2, dtype=np.int32)
    order, placed = np.empty(len(rows), dtype=np.int32), np.empty_like(rows)
    addresses = np.array([address_of(array) for array in (rows, placed, starts, order)], dtype=np.int64)
    sizes = np.array([*counts, len(rows)], dtype=np.int64)
    sort_into_cells(addresses, sizes, np.array(corner), np.array(cell))
    return starts[:-1], order, placed


def cells_of_scan(rows: Array, cell: Array) -> tuple[Array, Array, Cells | None]:
    """The finite ones of points (N, 3), their least and greatest coordinates (6,), and their cells; all that
    takes long without Python's lock. None for no points, and for more cells than `MOST`."""
    room, extent = np.empty_like(rows), np.empty(6)
    count = take_finite(np.array([address_of(rows), address_of(room)], dtype=np.int64), len(rows), extent)
    points, low = room[:count], extent[:3].copy()
    if not count or float(np.prod(np.floor((extent[3:] - low) / cell) + 1.0)) > MOST:
        return points, extent, None
    counts = np.floor((extent[3:] - low) / cell).astype(np.int64) + 1
    starts, _, placed = sort_points(points, low, cell, counts)
    field = np.empty(counts, dtype=np.float32)
    mark_full(np.array([address_of(starts), address_of(field)], dtype=np.int64), field.size)
    _spread(field, cell)
    return points, extent, Cells(low, cell, starts, placed, np.zeros((0, 3)), field)


def _numbers(points: Array, corner: Array, cell: Array, counts: NDArray[np.int64]) -> NDArray[np.int64]:
    index = np.floor((points - corner) / cell).astype(np.int64)
    np.clip(index, 0, counts - 1, out=index)
    return np.asarray((index[:, 0] * counts[1] + index[:, 1]) * counts[2] + index[:, 2])


def far_field(full: Flags, cell: Array) -> NDArray[np.float32]:
    """Lower bounds of the distance from anywhere in a cell to anywhere in the nearest full cell, m.

    Along an axis two cells with numbers i and j are at least (|i - j| - 1) h apart. The least of
    sqrt(sum (max(|i - j| - 1, 0) h)²) over full cells is the distance between the centres of a cell and of
    the nearest one among the full cells grown by their 26 neighbours.
    """
    field = np.where(full, np.float32(0.0), np.float32(np.inf))
    _spread(field, cell)
    return field


def _spread(field: NDArray[np.float32], cell: Array) -> None:
    counts = np.array(field.shape, dtype=np.int64)
    work = np.empty((4, int(counts.max()) + 1))
    transform(address_of(field), counts, np.array(cell), work, 1.0 - ROUNDED)
