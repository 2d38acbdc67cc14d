"""Clouds of points as obstacles."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import Array, matrix, positive, scalar, vector
from nmm.base.errors import InputError, expect
from nmm.model.collisions.elements.boxes import CELL, Elements
from nmm.model.collisions.obstacle import Obstacle, Placement
from nmm.model.collisions.sensed.cloud_files import points_of_file
from nmm.model.collisions.sensed.sensed_obstacle import Attributes, SensedObstacle

if TYPE_CHECKING:
    from nmm.model.robots.robot import Robot

#: A coordinate beyond this, m, is taken for a fault.
FARTHEST = 1e6
#: So many points are looked at for `spacing`.
LOOKED_AT = 2000


class PointCloud(SensedObstacle):
    """Points that were seen, as an obstacle: all within `radius` of them.

    Distances to it are never more than those to the balls about its points. To the surface that was seen they
    are wrong by noise and by the gaps between points: `radius` is to be half of the spacing and two standard
    deviations of the noise.

    Parameters
    ----------
    points (N, 3) : f32 or f64, m; rows with NaN or infinite numbers are left out
    radius : of the balls about the points, m
    name : for messages
    placement : of the axes of the points in the world, as of `Obstacle`
    cell : edge of the cells into which they are sorted, m: smaller ones take more time to make, and less to
        look far

    Attributes
    ----------
    left_out : how many rows were left out

    Raises
    ------
    InputError : no array (N, 3), no finite point in it, a coordinate beyond 10⁶ m

    Examples
    --------
    >>> wall = [[2.0, 0.02 * i, 0.02 * k] for i in range(-50, 50) for k in range(60)]
    >>> cloud = nmm.PointCloud(np.array(wall), radius=0.02, name="wall")
    >>> cloud
    PointCloud(wall, 6000 points, radius=0.02)
    """

    def __init__(
        self,
        points: ArrayLike,
        radius: float = 0.01,
        name: str = "",
        placement: Placement | None = None,
        cell: float = CELL,
    ) -> None:
        name = name or "point cloud"
        where = f"obstacle {name}: points"
        rows = _rows(points, where)
        self.left_out = 0
        if rows.dtype.kind == "f" and not np.isfinite([rows.min(initial=0.0), rows.max(initial=0.0)]).all():
            finite = np.isfinite(rows).all(axis=1)
            self.left_out = int(len(rows) - np.count_nonzero(finite))
            rows = rows[finite]
        rows = np.asarray(rows, dtype=np.float64)
        expect(len(rows), where, "at least one point of finite coordinates")
        far = float(max(-rows.min(), rows.max()))
        expect(far <= FARTHEST, where, f"coordinates within {FARTHEST:g} m", far)
        radius = scalar(radius, f"obstacle {name}: radius", least=0.0)
        cell = positive(cell, f"obstacle {name}: cell")
        super().__init__(Elements(rows, None, radius, (cell,) * 3), placement, name)
        self._cell = cell

    def __repr__(self) -> str:
        return f"PointCloud({self.name}, {len(self.points)} points, radius={self.radius:g})"

    @property
    def points(self) -> Array:
        """The points (N, 3) that are finite, m, in the axes of its placement."""
        return self._elements.centres[:0] if self._blank else self._elements.centres

    @property
    def radius(self) -> float:
        """Of the balls about the points, m."""
        return self._elements.radius

    @property
    def spacing(self) -> float:
        """The median distance of a point to the nearest other, m; of up to 2000 points."""
        from scipy.spatial import cKDTree

        if len(self.points) < 2:
            return 0.0
        some = self.points[:: max(1, len(self.points) // LOOKED_AT)]
        apart: Any = cKDTree(self.points).query(some, k=2)[0]
        return float(np.median(apart[:, 1]))

    def _like(self, points: ArrayLike, radius: float) -> PointCloud:
        made = PointCloud(points, radius, self.name, self.placement(0.0), self._cell)
        made.left_out = self.left_out
        return made

    def update(self, points: ArrayLike, wait: bool = False) -> None:
        """Set its points from now on: of a newer scan, in the axes of its placement.

        Their cells are made in a background thread, without Python's lock. A controller takes them at the
        first sample after that, a `Planner` at its next plan; until then the earlier ones hold. Of scans that
        come faster than they are made the last one is. The array is not copied: it must not change later.

        Parameters
        ----------
        points (N, 3) : as of the constructor; none, where nothing is seen: then `points` are none
        wait : whether to return when they are in place

        Raises
        ------
        InputError : no array (N, 3), or, of these points where it waits and else of earlier ones, none of
            them finite

        Examples
        --------
        >>> cloud = nmm.PointCloud([[2.0, 0.0, 0.3], [2.0, 0.1, 0.3]], name="scan")
        >>> cloud.update([[1.5, 0.0, 0.3]], wait=True)
        >>> cloud
        PointCloud(scan, 1 points, radius=0.01)
        """
        self._renew(wait, self._made, _rows(points, f"obstacle {self.name}: points"))

    def _made(self, rows: Array) -> Attributes:
        """What these points (N, 3) set."""
        if not len(rows):
            return self._seen(None, left_out=0)
        made, far = Elements.of_scan(rows, self.radius, np.full(3, self._cell))
        if made is None or far > FARTHEST:  # says what is wrong, or takes its time
            made = PointCloud(rows, self.radius, self.name, cell=self._cell)._elements
        return self._seen(made, left_out=len(rows) - len(made.centres))

    def transformed(self, T: ArrayLike) -> PointCloud:
        """The cloud with its points in other axes.

        Parameters
        ----------
        T (4, 4) : of the axes of the points in the new ones, as a sensor's placement in the world, m

        Raises
        ------
        InputError : no rotation and translation

        Examples
        --------
        >>> camera = np.array([[0, 0, 1, 0.2], [-1, 0, 0, 0], [0, -1, 0, 1.1], [0, 0, 0, 1]])
        >>> nmm.PointCloud([[0.0, 0.0, 2.0]]).transformed(camera).points
        array([[2.2, 0. , 1.1]])
        """
        where = f"obstacle {self.name}: T"
        matrix(T, (4, 4), where)
        pose = Obstacle(self.shape, T, name=f"{self.name}: T").at(0.0)
        return self._like(self.points @ pose.rotation.T + pose.translation, self.radius)

    def cropped(self, low: ArrayLike = (-FARTHEST,) * 3, high: ArrayLike = (FARTHEST,) * 3) -> PointCloud:
        """The cloud without the points outside of a box along its axes; without the floor by
        `low=(-10, -10, 0.05)`.

        Parameters
        ----------
        low (3,), high (3,) : m

        Raises
        ------
        InputError : no point is within

        Examples
        --------
        >>> nmm.PointCloud([[0.0, 0.0, 0.0], [1.0, 0.0, 0.4]]).cropped(low=[-9, -9, 0.05]).points
        array([[1. , 0. , 0.4]])
        """
        least, most = (vector(end, 3, f"obstacle {self.name}: cropped") for end in (low, high))
        within = np.all((self.points >= least) & (self.points <= most), axis=1)
        expect(within.any(), f"obstacle {self.name}: cropped", "points within the box")
        return self._like(self.points[within], self.radius)

    def thinned(self, size: float) -> PointCloud:
        """One point in the middle of each cell of `size`, m, in which there were some. Its radius grows by
        half the cell's diagonal: distances to it are still none beyond those to the cloud.

        Raises
        ------
        InputError : a size not above 0

        Examples
        --------
        >>> cloud = nmm.PointCloud(np.random.default_rng(0).uniform(size=(10_000, 3)), radius=0.01)
        >>> thin = cloud.thinned(0.1)
        >>> len(thin.points), round(thin.radius, 4)
        (1000, 0.0966)
        """
        size = positive(size, f"obstacle {self.name}: size")
        cells = np.unique(np.floor(self.points / size).astype(np.int64), axis=0)
        return self._like((cells + 0.5) * size, self.radius + 0.5 * np.sqrt(3.0) * size)

    def without(self, robot: Robot, q: ArrayLike | Mapping[str, float], padding: float = 0.03) -> PointCloud:
        """The cloud without what it shows of the robot itself: points within `padding`, m, of its collision
        shapes where q (n,) puts them.

        Raises
        ------
        InputError : nothing is left

        Examples
        --------
        >>> robot = nmm.load("unicycle_3r")
        >>> seen = nmm.PointCloud([[0.0, 0.0, 0.1], [1.5, 0.0, 0.3]])
        >>> seen.without(robot, robot.rest).points
        array([[1.5, 0. , 0.3]])
        """
        from nmm.model.collisions.sensed.self_filter import near_robot

        padding = scalar(padding, f"obstacle {self.name}: padding", least=0.0)
        pose = self.at(0.0)
        world = self.points @ pose.rotation.T + pose.translation
        others = ~near_robot(robot, robot.following.placed(robot.q(q)), world, padding)
        expect(others.any(), f"obstacle {self.name}: without", "points that are not the robot's")
        return self._like(self.points[others], self.radius)

    @classmethod
    def load(
        cls, file: str | Path, radius: float = 0.01, name: str = "", placement: Placement | None = None
    ) -> PointCloud:
        """The points of a file.

        Parameters
        ----------
        file : .ply (the vertices), .pcd (ascii or binary), or .npz (the array `points`, or the only one)
        radius, name, placement : as of the constructor; the name is the file's when not given

        Raises
        ------
        InputError : another kind of file, or a damaged one

        Examples
        --------
        >>> np.savez("scan.npz", points=np.random.default_rng(0).uniform(size=(100, 3)))
        >>> nmm.PointCloud.load("scan.npz")
        PointCloud(scan, 100 points, radius=0.01)
        """
        return cls(points_of_file(file), radius, name or Path(file).stem, placement)


def _rows(points: ArrayLike, where: str) -> Array:
    """Points (N, 3) as an array of numbers, as it is where it is one."""
    try:
        rows = np.asarray(points, dtype=None if isinstance(points, np.ndarray) else np.float64)
        numeric = rows.dtype.kind in "fiu"
    except (TypeError, ValueError):
        numeric = False
    if not numeric or rows.ndim != 2 or rows.shape[1] != 3:
        raise InputError(where=where, expected="an array of shape (N, 3), m", got=points)
    return rows
