"""Maps of occupied cells as walls: Nav2's files, and occupancy grids."""

from __future__ import annotations

import math
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nmm.base.arrays import Array, Flags, counted, positive, vector
from nmm.base.errors import expect, expect_known
from nmm.model.collisions.elements.boxes import Elements
from nmm.model.collisions.sensed.map_files import read_map
from nmm.model.collisions.sensed.sensed_obstacle import Attributes, SensedObstacle

OCCUPIED, FREE = "occupied", "free"
#: No map has more cells.
MOST = 100_000_000


class OccupancyMap(SensedObstacle):
    """A map of cells as an obstacle: walls as high as is said, where cells are occupied or unknown.

    Parameters
    ----------
    cells (ny, nx) : 0 to 100, how surely a cell is occupied, -1 where nobody knows, as of an OccupancyGrid:
        the first row has the least y
    resolution : a cell's edge, m
    origin : x, y, m, and yaw, rad, of the lower left corner of the first cell; the map is turned about it
    height : of the walls above z = 0, m
    unknown : what unknown cells are, "occupied" or "free"
    lethal : cells from this on are walls, as Nav2's `lethal_cost_threshold`
    name : for messages

    Attributes
    ----------
    cells, resolution, origin, height, unknown, lethal : as they came, or came last

    Raises
    ------
    InputError : no such cells or numbers; no cell is occupied

    Examples
    --------
    >>> cells = np.zeros((40, 60), dtype=int)
    >>> cells[:, 30] = 100
    >>> cells[15:33, 30] = 0
    >>> room = nmm.OccupancyMap(cells, 0.05, [0.0, -1.0, 0.0], height=1.0)
    >>> room
    OccupancyMap(occupancy map, 60 x 40 cells of 0.05 m, height=1)
    """

    def __init__(
        self,
        cells: ArrayLike,
        resolution: float,
        origin: ArrayLike = (0.0, 0.0, 0.0),
        height: float = 2.0,
        unknown: str = OCCUPIED,
        lethal: int = 100,
        name: str = "",
    ) -> None:
        name = name or "occupancy map"
        where = f"obstacle {name}"
        self.cells: NDArray[np.int8] = _checked(cells, where)
        self.resolution = positive(resolution, f"{where}: resolution")
        self.origin = vector(origin, 3, f"{where}: origin")
        self.height = positive(height, f"{where}: height")
        expect_known("kind of unknown cells", unknown, (OCCUPIED, FREE), where)
        self.unknown, self.lethal = unknown, counted(lethal, f"{where}: lethal")
        x, y, yaw = self.origin
        full = self.full
        expect(full.any(), f"{where}: cells", f"an occupied cell (from {self.lethal} on)")
        self._first, self._last, self._corner = self.origin, self.origin, np.zeros(3)
        super().__init__(self._walls(full, self._corner), [x, y, 0.0, 0.0, 0.0, yaw], name)

    def __repr__(self) -> str:
        ny, nx = self.cells.shape
        size = f"{nx} x {ny} cells of {self.resolution:g} m"
        return f"OccupancyMap({self.name}, {size}, height={self.height:g})"

    @property
    def full(self) -> Flags:
        """Which cells (ny, nx) are walls."""
        return self._full(self.cells)

    def _full(self, cells: NDArray[np.int8]) -> Flags:
        walls = cells >= self.lethal
        return walls | (cells < 0) if self.unknown == OCCUPIED else walls

    def _walls(self, full: Flags, corner: Array) -> Elements:
        """Boxes in those cells (ny, nx); the corner (3,) of the first one in the axes of the placement, m."""
        edge = np.array([self.resolution, self.resolution, self.height])
        centres = (np.argwhere(full.T[:, :, np.newaxis]) + 0.5) * edge + corner
        return Elements(centres, 0.5 * edge, 0.0, edge, corner)

    def update(self, cells: ArrayLike, origin: ArrayLike | None = None, wait: bool = False) -> None:
        """Set its cells from now on, in the background, as `PointCloud.update` does: of a newer map, as of a
        costmap that goes along with the robot.

        Parameters
        ----------
        cells (ny, nx) : as of the constructor, of any size; all free, where nothing is seen
        origin : as of the constructor, with the same yaw; the last one when not given
        wait : whether to return when they are in place

        Raises
        ------
        InputError : no such cells or origin; what an earlier update could not make

        Examples
        --------
        >>> costmap = nmm.OccupancyMap([[0, 100], [0, 0]], 0.5, name="costmap")
        >>> costmap.update([[0, 0, 0], [100, 0, 0]], origin=[2.0, 1.0, 0.0], wait=True)
        >>> costmap
        OccupancyMap(costmap, 3 x 2 cells of 0.5 m, height=2)
        """
        where = f"obstacle {self.name}"
        seen = _checked(cells, where)
        last = self._last if origin is None else vector(origin, 3, f"{where}: origin")
        yaw = self._first[2]
        turned = math.remainder(last[2] - yaw, 2.0 * math.pi)
        expect(abs(turned) < 1e-9, f"{where}: origin", f"the yaw of the map, {yaw:g} rad", last[2])
        self._last = last
        self._renew(wait, self._made, seen, last)

    def _made(self, cells: NDArray[np.int8], origin: Array) -> Attributes:
        """What these cells (ny, nx) set."""
        full, (x, y, _) = self._full(cells), origin - self._first
        cosine, sine = math.cos(self._first[2]), math.sin(self._first[2])
        corner = np.array([cosine * x + sine * y, cosine * y - sine * x, 0.0])
        shape = self._walls(full, corner) if full.any() else None
        return self._seen(shape, cells=cells, origin=origin, _corner=corner)

    @classmethod
    def load(
        cls,
        file: str | Path,
        height: float = 2.0,
        unknown: str = OCCUPIED,
        lethal: int = 100,
        name: str = "",
    ) -> OccupancyMap:
        """The map of a YAML file of Nav2's, or of ROS 1's map server, and its image (PGM, PNG or BMP).

        Its rules are those of `nav2_map_server`: `mode` trinary, scale or raw, `negate`, and both thresholds.
        Where most of the free cells have the value that savers write for unknown ones (205), the file's
        free_thresh makes what is unknown free: that is a `RuntimeWarning`.

        Parameters
        ----------
        file : the YAML file
        height, unknown, lethal, name : as of the constructor; the name is the file's when not given

        Raises
        ------
        InputError : a key is missing or wrong, the image cannot be read

        Examples
        --------
        >>> from PIL import Image
        >>> pixels = np.full((20, 30), 254, dtype=np.uint8)
        >>> pixels[:, 12] = 0
        >>> Image.fromarray(pixels).save("room.png")
        >>> keys = "image: room.png, resolution: 0.1, origin: [0, 0, 0], negate: 0"
        >>> keys += ", free_thresh: 0.196, occupied_thresh: 0.65"
        >>> with open("room.yaml", "w") as written:
        ...     _ = written.write("{" + keys + "}")
        >>> nmm.OccupancyMap.load("room.yaml", height=1.5)
        OccupancyMap(room, 30 x 20 cells of 0.1 m, height=1.5)
        """
        seen = read_map(file)
        if seen.unknown_as_free and unknown == OCCUPIED:
            warnings.warn(
                f"{file}: {seen.unknown_as_free} of its free cells have the value 205, which savers write "
                f"for unknown ones: free_thresh {seen.free_thresh:g} makes them free, 0.196 unknown",
                RuntimeWarning,
                stacklevel=2,
            )
        return cls(seen.cells, seen.resolution, seen.origin, height, unknown, lethal, name or Path(file).stem)

    def cell_of(self, x: float, y: float) -> tuple[int, int]:
        """Row and column of the cell in which a point of the world is, m; they may be outside of the map."""
        pose = self.at(0.0)
        along, across, _ = (pose.actInv(np.array([x, y, pose.translation[2]])) - self._corner).tolist()
        return math.floor(across / self.resolution), math.floor(along / self.resolution)


def _checked(cells: ArrayLike, where: str) -> NDArray[np.int8]:
    """Cells (ny, nx) of -1 to 100."""
    rows: NDArray[Any] = np.asarray(cells)
    right = rows.ndim == 2 and rows.size and rows.dtype.kind in "iu"
    expect(right, f"{where}: cells", "whole numbers of shape (ny, nx)", rows)
    within = rows.size <= MOST and int(rows.min()) >= -1 and int(rows.max()) <= 100
    expect(within, f"{where}: cells", f"at most {MOST} numbers from -1 to 100", rows)
    return rows.astype(np.int8)
