"""Where the arm puts a frame, for many postures at once, and postures that put it somewhere."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from nmm.analysis.maps.coordinates import checked_range, usual_range
from nmm.arrays import Array, Flags, Integers
from nmm.errors import InputError, expect_known
from nmm.progress import Progress
from nmm.robots.frame_path import FramePath
from nmm.robots.robot import Robot

AXES = "xyz"
#: Newton steps onto a place, and the longest of them, rad or m: a stretched arm would leap.
STEPS, LEAP = 12, 0.5


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
        self._carried = who.carried[:, np.searchsorted(who.independent, moving)]
        self._path = FramePath(robot, frame)

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
        return self._stepped(q, targets, *self._rates(q))

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
        best, points, left = q.copy(), np.zeros((len(q), 3)), np.full(len(q), np.inf)
        going, here = np.arange(len(q)), q
        for k in range(STEPS + 1):
            now, rates = self._rates(here)
            apart = np.linalg.norm(now[:, self.in_plane] - targets[going], axis=1)
            closer = self.held(now) & (apart < left[going])
            rows = going[closer]
            best[rows], points[rows], left[rows] = here[closer], now[closer], apart[closer]
            on = left[going] > near
            if progress is not None:
                # Most are there after three steps; the few on the rim need many.
                progress(1.0 - 0.5 ** (k + 1))
            if k == STEPS or not on.any():
                break
            going = going[on]
            here = self._stepped(here[on], targets[going], now[on], rates[on])
        return best, points, left

    def _rates(self, q: Array) -> tuple[Array, Array]:
        """Where the frame is (N, 3), and the derivatives (N, s, k) of what counts of that by the joints."""
        points, jacobians = self._path.jacobians(q)
        rows = [*self.in_plane, *([] if self.slab is None else [self.third])]
        return points, jacobians[:, rows] @ self._carried

    def _stepped(self, q: Array, targets: Array, points: Array, rates: Array) -> Array:
        """Configurations a Newton step from q, where the frame is at points and moves by rates."""
        goals = points.copy()
        goals[:, self.in_plane] = targets
        if self.slab is not None:
            # Somewhat inside: a step never ends quite where it aims.
            lower, upper = self.slab
            inset = 0.1 * (upper - lower)
            goals[:, self.third] = np.clip(points[:, self.third], lower + inset, upper - inset)
        wanted = (goals - points)[:, [*self.in_plane, *([] if self.slab is None else [self.third])]]
        joints = q[:, self.moving]
        step = _shortest(rates, wanted)
        beyond = (joints + step < self.lower) | (joints + step > self.upper)
        stopped = beyond.any(axis=1)
        if stopped.any():
            # The other joints do what a joint at its limit cannot.
            free = np.where(beyond[stopped, np.newaxis, :], 0.0, rates[stopped])
            step[stopped] = _shortest(free, wanted[stopped])
        return self.placed(np.clip(joints + step, self.lower, self.upper))


def _shortest(rates: Array, wanted: Array) -> Array:
    """The shortest steps (N, k) with rates (N, s, k) step = wanted (N, s); a stretched arm takes no leap."""
    gram = np.einsum("nik,njk->nij", rates, rates)
    damping = 1e-9 * np.trace(gram, axis1=1, axis2=2) + 1e-12
    gram += damping[:, np.newaxis, np.newaxis] * np.eye(rates.shape[1])
    forces = np.linalg.solve(gram, wanted[:, :, np.newaxis])[:, :, 0]
    step = np.einsum("nik,ni->nk", rates, forces)
    length = np.abs(step).max(axis=1, keepdims=True)
    return np.asarray(step * np.minimum(1.0, LEAP / np.where(length == 0.0, 1.0, length)))
