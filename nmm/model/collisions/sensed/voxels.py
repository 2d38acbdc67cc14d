"""Occupied cells in space, and heights of the ground, as obstacles."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import coal
import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import Array, Flags, positive, vector
from nmm.base.errors import InputError, expect
from nmm.base.text_format import one_line
from nmm.model.collisions.elements.boxes import Elements, surface
from nmm.model.collisions.obstacle import Placement
from nmm.model.collisions.sensed.cloud_files import arrays_of, content_of
from nmm.model.collisions.sensed.sensed_obstacle import Attributes, SensedObstacle

#: No map has more cells.
MOST = 200_000_000


class VoxelMap(SensedObstacle):
    """Cubes of a grid that are occupied, as an obstacle.

    Parameters
    ----------
    occupied (nx, ny, nz) : whether each cell is
    resolution : a cell's edge, m
    origin (3,) : the corner of the first cell with the least coordinates, m
    name, placement : as of `Obstacle`

    Raises
    ------
    InputError : no such array; no cell is occupied

    Examples
    --------
    >>> occupied = np.zeros((40, 40, 20), dtype=bool)
    >>> occupied[30, :, :] = True
    >>> nmm.VoxelMap(occupied, 0.05, [0.0, -1.0, 0.0], name="wall")
    VoxelMap(wall, 800 cells of 0.05 m)
    """

    def __init__(
        self,
        occupied: ArrayLike,
        resolution: float,
        origin: ArrayLike = (0.0, 0.0, 0.0),
        name: str = "",
        placement: Placement | None = None,
    ) -> None:
        name = name or "voxel map"
        where = f"obstacle {name}"
        self.occupied = _cubes(occupied, where)
        expect(self.occupied.any(), f"{where}: occupied", "an occupied cell")
        self.resolution = positive(resolution, f"{where}: resolution")
        self.origin = self._last = vector(origin, 3, f"{where}: origin")
        super().__init__(solid(self.occupied, self.resolution, self.origin), placement, name)

    def __repr__(self) -> str:
        count = np.count_nonzero(self.occupied)
        return f"VoxelMap({self.name}, {count} cells of {self.resolution:g} m)"

    def update(self, occupied: ArrayLike, origin: ArrayLike | None = None, wait: bool = False) -> None:
        """Set its cells from now on, in the background, as `PointCloud.update` does.

        Parameters
        ----------
        occupied (nx, ny, nz) : as of the constructor, of any size; none, where nothing is seen
        origin (3,) : as of the constructor; the last one when not given
        wait : whether to return when they are in place

        Raises
        ------
        InputError : no such array or origin; what an earlier update could not make
        """
        where = f"obstacle {self.name}"
        seen = _cubes(occupied, where)
        self._last = self._last if origin is None else vector(origin, 3, f"{where}: origin")
        self._renew(wait, self._made, seen, self._last)

    def _made(self, occupied: Flags, origin: Array) -> Attributes:
        """What these cells (nx, ny, nz) set."""
        shape = solid(occupied, self.resolution, origin) if occupied.any() else None
        return self._seen(shape, occupied=occupied, origin=origin)

    @classmethod
    def load(cls, file: str | Path, name: str = "", placement: Placement | None = None) -> VoxelMap:
        """The occupied cells of OctoMap's binary file, .bt; unknown ones are free.

        Raises
        ------
        InputError : another kind of file, or a damaged one; for .ot it says what converts it
        """
        path = Path(file)
        if path.suffix.lower() == ".ot":
            mend = f"convert_octree {path.name} {path.stem}.bt"
            raise InputError("full trees are not read", where=file, expected="a .bt file", mend=mend)
        expect(path.suffix.lower() == ".bt", file, "a .bt file of OctoMap's", path.suffix)
        full, resolution, origin = _octree(path)
        return cls(full, resolution, origin, name or path.stem, placement)


def _cubes(occupied: ArrayLike, where: str) -> Flags:
    """Cells (nx, ny, nz) that are occupied or not."""
    full = np.array(occupied)
    shaped = full.ndim == 3 and full.dtype == bool and full.size <= MOST
    expect(shaped, f"{where}: occupied", f"truth values (nx, ny, nz), at most {MOST}", full)
    return full


def solid(full: Flags, resolution: float, origin: Array) -> Elements:
    """Full cells as boxes; those with full ones on all sides are `inside`."""
    outer = surface(full)
    centres, inside = (origin + (np.argwhere(which) + 0.5) * resolution for which in (outer, full & ~outer))
    return Elements(centres, (0.5 * resolution,) * 3, 0.0, (resolution,) * 3, origin, inside)


def _octree(path: Path) -> tuple[Flags, float, Array]:
    """Occupied cells (nx, ny, nz), resolution and corner of a file, read by Coal, which writes to standard
    error and goes on where one is damaged: its header and its count of nodes are looked at here."""
    try:
        content = content_of(path)
    except InputError as error:
        raise error.at(path) from None
    head, data, _ = content.partition(b"\ndata\n")
    keys = dict(line.split(None, 1) for line in head.decode("ascii", "replace").splitlines() if " " in line)
    try:
        size, resolution = int(keys["size"]), float(keys["res"])
        right = content.startswith(b"# Octomap OcTree binary file") and bool(data) and resolution > 0.0
    except (KeyError, ValueError):
        right = False
    if not right:
        raise InputError("is no binary file of OctoMap's", where=path)
    try:
        tree: Any = coal.MeshLoader().loadOctree(str(path))
    except Exception as error:  # whatever its reader meets
        raise InputError(f"cannot be read: {one_line(str(error))}", where=path) from None
    if tree.size() != size:
        raise InputError(f"it has {tree.size()} of {size} nodes", where=path)
    boxes = np.array(tree.toBoxes()).reshape(-1, 6)
    leaves = boxes[boxes[:, 4] >= tree.getOccupancyThres()]
    expect(len(leaves), path, "an occupied cell")
    edges = np.rint(leaves[:, 3] / resolution).astype(np.int64)
    low = np.rint(leaves[:, :3] / resolution - 0.5 * edges[:, np.newaxis]).astype(np.int64)
    first = low.min(axis=0)
    counts = (low + edges[:, np.newaxis]).max(axis=0) - first
    expect(float(np.prod(counts.astype(float))) <= MOST, path, f"at most {MOST} cells", counts.tolist())
    full = np.zeros(counts, dtype=bool)
    for (x, y, z), edge in zip((low - first).tolist(), edges.tolist(), strict=True):
        full[x : x + edge, y : y + edge, z : z + edge] = True
    return full, resolution, first * resolution


class ElevationMap(SensedObstacle):
    """Heights of the ground as an obstacle: all below them, down to a cell below the lowest.

    Parameters
    ----------
    heights (nx, ny) : of each cell's highest point, m; NaN where nobody knows, and nothing is
    resolution : a cell's edge, m
    origin (2,) or (3,) : the corner of the first cell with the least x and y, and the height from which the
        heights count, m
    name, placement : as of `Obstacle`

    Raises
    ------
    InputError : no such array, no finite height in it

    Examples
    --------
    >>> x = np.arange(0.0, 4.0, 0.1)
    >>> ramp = nmm.ElevationMap(np.tile(0.1 * x, (20, 1)).T, 0.1, [1.0, -1.0, -0.05], name="ramp")
    >>> ramp
    ElevationMap(ramp, 40 x 20 cells of 0.1 m)
    """

    def __init__(
        self,
        heights: ArrayLike,
        resolution: float,
        origin: ArrayLike = (0.0, 0.0, 0.0),
        name: str = "",
        placement: Placement | None = None,
    ) -> None:
        name = name or "elevation map"
        where = f"obstacle {name}"
        self.heights = _heights(heights, where)
        expect(np.isfinite(self.heights).any(), f"{where}: heights", "a finite height", self.heights)
        self.resolution = positive(resolution, f"{where}: resolution")
        self.origin = self._last = _corner(origin, where)
        super().__init__(columns(self.heights, self.resolution, self.origin, where), placement, name)

    @classmethod
    def load(cls, file: str | Path, name: str = "", placement: Placement | None = None) -> ElevationMap:
        """Of a .npz file the arrays `heights`, `resolution` and, where there is one, `origin`.

        Raises
        ------
        InputError : another kind of file, a damaged one, or one without these arrays
        """
        path = Path(file)
        expect(path.suffix.lower() == ".npz", file, "a .npz file", path.suffix)
        try:
            arrays = arrays_of(content_of(path))
            for key in ("heights", "resolution"):
                if key not in arrays:
                    raise InputError(expected=f"the array {key}", available=[*arrays])
            resolution, origin = arrays["resolution"], arrays.get("origin", (0.0, 0.0, 0.0))
            number = resolution.item() if resolution.size == 1 else resolution
            return cls(arrays["heights"], number, origin, name or path.stem, placement)
        except InputError as error:
            raise error.at(file) from None

    def __repr__(self) -> str:
        nx, ny = self.heights.shape
        return f"ElevationMap({self.name}, {nx} x {ny} cells of {self.resolution:g} m)"

    def update(self, heights: ArrayLike, origin: ArrayLike | None = None, wait: bool = False) -> None:
        """Set its heights from now on, in the background, as `PointCloud.update` does.

        Parameters
        ----------
        heights (nx, ny) : as of the constructor, of any size; NaN alone, where nothing is known
        origin (2,) or (3,) : as of the constructor; the last one when not given
        wait : whether to return when they are in place

        Raises
        ------
        InputError : no such array or origin; what an earlier update could not make
        """
        where = f"obstacle {self.name}"
        seen = _heights(heights, where)
        self._last = self._last if origin is None else _corner(origin, where)
        self._renew(wait, self._made, seen, self._last)

    def _made(self, heights: Array, origin: Array) -> Attributes:
        """What these heights (nx, ny) set."""
        known = np.isfinite(heights).any()
        shape = columns(heights, self.resolution, origin, f"obstacle {self.name}") if known else None
        return self._seen(shape, heights=heights, origin=origin)


def _corner(origin: ArrayLike, where: str) -> Array:
    """An origin (2,) or (3,) as (3,), m."""
    return np.append(vector(origin, (2, 3), f"{where}: origin"), 0.0)[:3]


def _heights(heights: ArrayLike, where: str) -> Array:
    """Heights (nx, ny), m."""
    try:
        rows = np.array(heights, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(where=f"{where}: heights", expected="numbers (nx, ny), m", got=heights) from None
    expect(rows.ndim == 2 and rows.size, f"{where}: heights", "numbers (nx, ny), m", rows)
    return rows


def columns(heights: Array, resolution: float, origin: Array, where: str) -> Elements:
    """Of each column of the ground the cells beside which one is free; the topmost is as high as it is."""
    edge, known = resolution, np.isfinite(heights)
    heights = np.where(known, heights, np.nan)
    low = float(np.nanmin(heights)) - edge
    tops = np.where(known, np.ceil((heights - low) / edge - 1e-9), 0).astype(np.int64)
    expect(float(tops.max()) * tops.size <= MOST, f"{where}: heights", f"at most {MOST} cells")
    padded = np.pad(tops, 1)
    beside = np.minimum.reduce([padded[2:, 1:-1], padded[:-2, 1:-1], padded[1:-1, 2:], padded[1:-1, :-2]])
    level = np.arange(int(tops.max()))
    full = level < tops[:, :, np.newaxis]
    # A cell as high as the lowest neighbour's topmost, which may be lower than its cell, is seen.
    outer = full & ((level >= np.minimum(beside, tops)[:, :, np.newaxis] - 1) | (level == 0))
    corner = np.append(origin[:2], origin[2] + low)
    index = np.argwhere(outer)
    centres, halves = corner + (index + 0.5) * edge, np.full((len(index), 3), 0.5 * edge)
    topmost = index[:, 2] == tops[index[:, 0], index[:, 1]] - 1
    x, y, z = index[topmost].T
    thick = np.maximum(heights[x, y] - low - z * edge, 1e-6)
    centres[topmost, 2], halves[topmost, 2] = corner[2] + z * edge + 0.5 * thick, 0.5 * thick
    inside = corner + (np.argwhere(full & ~outer) + 0.5) * edge
    return Elements(centres, halves, 0.0, (edge,) * 3, corner, inside)
