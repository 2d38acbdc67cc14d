"""What was sensed as a shape: points, or boxes in the cells of a grid, all widened by a radius."""

from __future__ import annotations

from functools import cached_property
from threading import Lock
from typing import Any

import numpy as np

from nmm.base.arrays import Array, Flags, array, positive, scalar, unwritable, vector
from nmm.base.errors import InputError, expect
from nmm.model.collisions.elements.cell_mesh import cell_mesh
from nmm.model.collisions.elements.cells import Cells, cells_of_scan, ends, sorted_cells
from nmm.model.collisions.shapes import Shape, hull

#: Edge of the cells that points are sorted into, m.
CELL = 0.05
#: The box around all of it is larger by this, m, or this share of its longest edge.
THIN = 1e-4
_MAKING = Lock()


class Elements(Shape):
    """Boxes along the axes of their placement, or points, and all within `radius` of them.

    Parameters
    ----------
    centres (N, 3) : of the boxes, or the points, m; at least one
    halves (N, 3) or (3,) : half the boxes' edges, m; None for points. A box lies in the cell of its centre
    radius : m
    cell (3,) : edges of the cells, m
    corner (3,) : a corner of one of the cells, m; the least of the centres' coordinates when not given
    inside (M, 3) : centres of cells that are full and have full ones on all six sides; no boxes of these are
        among `centres`
    """

    def __init__(
        self,
        centres: Any,
        halves: Any = None,
        radius: float = 0.0,
        cell: Any = (CELL, CELL, CELL),
        corner: Any = None,
        inside: Any = None,
    ) -> None:
        self.centres = unwritable(array(centres, "elements: centres"))
        shaped = self.centres.ndim == 2 and self.centres.shape[1] == 3
        expect(shaped, "elements: centres", "shape (N, 3)", self.centres)
        expect(len(self.centres), "elements: centres", "at least one point")
        self.radius = scalar(radius, "elements: radius", least=0.0)
        self._cells: Cells | None = None
        self.halves: Array | None = None
        if halves is not None:
            self.halves = np.broadcast_to(array(halves, "elements: halves"), self.centres.shape)
        edges = vector(cell, 3, "elements: cell")
        self.cell = np.array([positive(edge, "elements: cell") for edge in edges])
        self.corner = ends(self.centres)[0] if corner is None else vector(corner, 3, "elements: corner")
        self.inside = None if inside is None else array(inside, "elements: inside").reshape(-1, 3)
        if self.halves is not None:
            index = np.floor((self.centres - self.corner) / self.cell)
            off = np.abs(self.centres - self.corner - (index + 0.5) * self.cell) + self.halves
            expect(np.all(off <= 0.5 * self.cell + 1e-9), "elements: halves", "boxes within their cells")

    @classmethod
    def of_scan(cls, rows: Array, radius: float, cell: Array) -> tuple[Elements | None, float]:
        """Points (N, 3) without those that are not finite, and the largest coordinate, m; mostly made without
        Python's lock. None where there are none, or too many cells."""
        points, extent, cells = cells_of_scan(np.ascontiguousarray(rows, dtype=np.float64), cell)
        if cells is None:
            return None, np.inf
        made = cls(points[:1], None, radius, cell, cells.corner)
        made.centres, made._cells = unwritable(points), cells
        made.__dict__["box"] = extent[:3] - radius, extent[3:] + radius
        return made, float(np.abs(extent).max())

    def __repr__(self) -> str:
        return f"Elements({len(self.centres)}, radius={self.radius:g})"

    @cached_property
    def box(self) -> tuple[Array, Array]:
        """The least and the greatest coordinates of all of it, (3,) each, m."""
        low, high = ends(self.centres)
        if self.halves is not None:
            low, high = ends(self.centres - self.halves)[0], ends(self.centres + self.halves)[1]
        return low - self.radius, high + self.radius

    @property
    def cells(self) -> Cells:
        """Its elements by cells, and the field of bounds; made when first asked for, and always the same."""
        if self._cells is None:
            with _MAKING:  # records have their addresses: a second thread is not to replace them
                if self._cells is None:
                    made = None
                    if self.halves is None and np.array_equal(self.corner, ends(self.centres)[0]):
                        made = cells_of_scan(self.centres, self.cell)[2]
                    if made is None:
                        made = sorted_cells(self.centres, self.halves, self.cell, self.corner, self.inside)
                    self._cells = made
        return self._cells

    def contains(self, point: Array) -> bool:
        """Whether a point (3,), m, is in a box or inside of what is full; points contain nothing."""
        cells, index = self.cells, np.floor((point - self.cells.corner) / self.cells.cell).astype(int)
        if self.halves is None or np.any(index < 0) or np.any(index >= cells.field.shape):
            return False
        if cells.field[tuple(index)] < 0.0:
            return True
        flat = int(np.ravel_multi_index(tuple(index), cells.field.shape))
        some = slice(int(cells.starts[flat]), int(cells.starts[flat + 1]))
        halves = cells.halves if len(cells.halves) == 1 else cells.halves[some]
        return bool(np.any(np.all(np.abs(cells.centres[some] - point) <= halves + 1e-9, axis=1)))

    def geometry(self) -> Any:
        """A box around all of it, which says where it is; distances to it are of `cells`."""
        low, high = self.box
        thick = max(THIN, THIN * float(np.max(high - low)))
        both = np.array([low - thick, high + thick])
        return hull(np.array([[both[i, 0], both[j, 1], both[k, 2]] for i, j, k in np.ndindex(2, 2, 2)]))

    def drawn(self) -> Any:
        """The outer faces of cells with elements, larger cells where there would be too many faces."""
        return cell_mesh(self.everywhere, self.corner, self.cell)

    @property
    def everywhere(self) -> Array:
        """The points, or the centres of all boxes, (K, 3), m."""
        return self.centres if self.inside is None else np.vstack([self.centres, self.inside])

    def as_json(self) -> tuple[dict[str, Any], Array]:
        """All of it as plain data and an array (N, 3), for a file."""
        parts = [self.centres]
        parts += [] if self.halves is None else [self.halves]
        parts += [] if self.inside is None else [self.inside]
        data = {"kind": "elements", "radius": self.radius, "cell": self.cell.tolist()}
        data |= {"corner": self.corner.tolist(), "count": len(self.centres), "boxes": self.halves is not None}
        return data, np.vstack(parts)

    @classmethod
    def from_json(cls, data: dict[str, Any], rows: Array) -> Elements:
        """What `as_json` described; `InputError` for what is no such thing."""
        known = {"kind", "radius", "cell", "corner", "count", "boxes"}
        if {*data} != known or not isinstance(data["count"], int):
            raise InputError(where="elements", expected=f"the keys {', '.join(sorted(known))}", got=[*data])
        count, boxes = data["count"], bool(data["boxes"])
        last = count * (1 + boxes)
        expect(count > 0 and last <= len(rows), "elements: count", f"at most {len(rows)} rows", count)
        halves = rows[count:last] if boxes else None
        inside = rows[last:] if len(rows) > last else None
        return cls(rows[:count], halves, data["radius"], data["cell"], data["corner"], inside)


def surface(full: Flags) -> Flags:
    """Which full cells (nx, ny, nz) have one beside them that is not; those outside are not."""
    padded = np.pad(full, 1)
    inner = padded[1:-1, 1:-1, 1:-1].copy()
    for axis in range(3):
        for shift in (-1, 1):
            inner &= np.roll(padded, shift, axis)[1:-1, 1:-1, 1:-1]
    return full & ~inner
