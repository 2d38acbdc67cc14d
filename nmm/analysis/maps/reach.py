"""Where the arm puts a frame, for many postures at once, and postures that put it somewhere."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from nmm.analysis.maps.coordinates import checked_range, usual_range
from nmm.analysis.maps.newton import Plane, lead_onto, step_towards
from nmm.arrays import Array, Flags, Integers
from nmm.cores import over_cores
from nmm.errors import InputError, expect_known
from nmm.progress import Progress
from nmm.robots.frame_path import FramePath
from nmm.robots.robot import Robot

AXES = "xyz"
#: Newton steps onto a place.
STEPS = 12
#: Postures a compiled call: what nothing interrupts.
AT_ONCE = 128


class Reach:
    """The arm's joints over their limits, the platform where it stands.

    Parameters
    ----------
    robot, frame : whose origin is meant
    plane : two of x, y, z
    slab : (lower, upper) of the third, m, or None
    q (n,) : where the platform stands, and the joints that have no part in it
    moving : columns of q that are varied
    ranges : of joints, (lower, upper); the others over their limits, at most one turn

    Raises
    ------
    InputError : an unknown joint, an empty range, a sliding joint without limits
    """

    def __init__(
        self,
        robot: Robot,
        frame: str,
        plane: str,
        slab: tuple[float, float] | None,
        q: Array,
        moving: Integers,
        ranges: Mapping[str, Sequence[float]] | None,
    ) -> None:
        self.robot, self.frame, self.slab, self.q = robot, frame, slab, q
        self.in_plane = [AXES.index(axis) for axis in plane]
        (self.third,) = {0, 1, 2} - set(self.in_plane)
        self.moving = moving
        names = [robot.q_names[j] for j in moving]
        given = dict(ranges or {})
        for name in given:
            expect_known("joint", name, names, "ranges")
        limits = [checked_range(given[name], name) if name in given else self._usual(name) for name in names]
        self.lower, self.upper = np.array(limits).reshape(-1, 2).T
        who = robot.following
        self._path = FramePath(robot, frame)
        self._numbers = Plane(
            axes=np.array(self.in_plane, dtype=np.int64),
            third=np.array([self.third], dtype=np.int64),
            slab=np.array([-np.inf, np.inf] if slab is None else slab, dtype=np.float64),
            moving=np.ascontiguousarray(moving, dtype=np.int64),
            lower=np.ascontiguousarray(self.lower),
            upper=np.ascontiguousarray(self.upper),
            carried=np.ascontiguousarray(who.carried[:, np.searchsorted(who.independent, moving)]),
            followers=who.table.ravel(),
        )

    def _usual(self, name: str) -> tuple[float, float]:
        index = self.robot.coordinate(name)
        if self.robot.q_units[index] == "m" and not self.robot.limited[index].all():
            raise InputError(f"ranges: expected one for {name}, which has no limits")
        return usual_range(self.robot, name, self.q)

    def postures(self, count: int, seed: int = 2006) -> Array:
        """`count` (a power of 2) configurations (count, n), spread evenly over the joints' ranges (Sobol)."""
        # Here, as it takes a second to import: a map over coordinates does without.
        from scipy.stats import qmc

        unit = qmc.Sobol(len(self.moving), rng=seed).random(count)
        return self.placed(self.lower + unit * (self.upper - self.lower))

    def placed(self, joints: Array) -> Array:
        """Configurations (N, n) with these varied joints (N, k)."""
        q = np.tile(self.q, (len(joints), 1))
        q[:, self.moving] = joints
        return self.robot.following.placed(q)

    def positions(self, q: Array, progress: Progress | None = None) -> Array:
        """Where the frame is, (N, 3), m."""
        return self._path.positions(q, progress)

    def held(self, points: Array) -> Flags:
        """Whether each point (N, 3) is in the slab."""
        if self.slab is None:
            return np.ones(len(points), dtype=bool)
        return np.asarray((points[:, self.third] >= self.slab[0]) & (points[:, self.third] <= self.slab[1]))

    def towards(self, q: Array, targets: Array) -> Array:
        """Configurations (N, n) a Newton step nearer to targets (N, 2) in the plane, in ranges and slab."""
        found = np.array(q, order="C")

        def step(first: int, last: int) -> None:
            step_towards(*self._path.blocks, self._numbers, found[first:last], targets[first:last])

        over_cores(len(q), AT_ONCE, lambda: step)
        return found

    def onto(
        self, q: Array, targets: Array, near: float, progress: Progress | None = None
    ) -> tuple[Array, Array, Array]:
        """Configurations (N, n) from q that put the frame onto targets (N, 2), as near as Newton steps lead.

        Parameters
        ----------
        near : so near, m, is there

        Returns
        -------
        configurations, where they put the frame (N, 3), and how far from the targets that is (N,); infinite,
        with the configuration given, where none was in the slab
        """
        best, points, left = np.array(q, order="C"), np.empty((len(q), 3)), np.empty(len(q))

        def lead(first: int, last: int) -> None:
            some = slice(first, last)
            lead_onto(
                *self._path.blocks,
                self._numbers,
                targets[some],
                near,
                STEPS,
                best[some],
                points[some],
                left[some],
            )

        over_cores(len(q), AT_ONCE, lambda: lead, progress)
        return best, points, left
