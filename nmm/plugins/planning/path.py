"""A path of legs: what compiled code says of the ways between configurations, and where legs lead."""

from __future__ import annotations

import numpy as np

from nmm.base.arrays import Array, Integers
from nmm.base.kernels.compiled import checked_by_caller, compiled
from nmm.base.kernels.linear_algebra import copied, norm
from nmm.base.kernels.record_layout import BLOCKS, Blocks, views
from nmm.base.kernels.signatures import float64, int64, void
from nmm.plugins.planning.collisions.legs_check import along
from nmm.plugins.planning.tree import PLACE, Trees
from nmm.plugins.planning.ways import LEGS, find_way, leg_time

#: Two legs go the same way where their directions differ by less.
SAME = 1e-9


@compiled
def join_leg(legs: Array, count: int, leg: Array, share: float) -> int:
    """Add a share of a leg to `count` legs, to the last of them where it goes the same way, and return their
    number."""
    size = share * norm(leg)
    if size == 0.0:
        return count
    before = norm(legs[count - 1]) if count > 0 else 0.0
    same = count > 0
    for i in range(leg.shape[0] if same else 0):
        same = same and abs(legs[count - 1, i] / before - share * leg[i] / size) < SAME
    for i in range(leg.shape[0]):
        if same:
            legs[count - 1, i] += share * leg[i]
        else:
            legs[count, i] = share * leg[i]
    return count if same else count + 1


@compiled
def _merge(legs: Array, out: Array) -> int:
    count = 0
    for k in range(legs.shape[0]):
        count = join_leg(out, count, legs[k], 1.0)
    return count


@compiled
def _find(blocks: Blocks, a: Array, b: Array, legs: Array) -> int:
    return find_way(views(Trees, blocks.integers, blocks.floats, PLACE).ways, a, b, legs)


@compiled
def _times(blocks: Blocks, legs: Array, out: Array) -> None:
    ways = views(Trees, blocks.integers, blocks.floats, PLACE).ways
    for k in range(legs.shape[0]):
        out[k] = leg_time(ways, legs[k]) + ways.pause[()]


@compiled
def _corners(planar: int, q: Array, legs: Array, mimic_joints: Array, out: Array) -> None:
    copied(q, out[0])
    for k in range(legs.shape[0]):
        along(planar, out[k], legs[k], 1.0, mimic_joints, out[k + 1])


@compiled
def _points(
    planar: int, corners: Array, legs: Array, which: Integers, shares: Array, mimic_joints: Array, out: Array
) -> None:
    for k in range(which.shape[0]):
        along(planar, corners[which[k]], legs[which[k]], shares[k], mimic_joints, out[k])


_FLAT, _ROWS = float64[::1], float64[:, ::1]
_FIND = int64(BLOCKS, _FLAT, _FLAT, _ROWS)
_TIMES = void(BLOCKS, _ROWS, _FLAT)
_ALONG = void(int64, _FLAT, _FLAT, float64, _FLAT, _FLAT)
_POINTS = void(int64, _ROWS, _ROWS, int64[::1], _FLAT, _FLAT, _ROWS)
_CORNERS = void(int64, _FLAT, _ROWS, _FLAT, _ROWS)
_MERGE = int64(_ROWS, _ROWS)


class Guide:
    """The ways of a robot, as `Trees` in memory have them: legs between configurations, and what they
    take."""

    def __init__(self, blocks: Blocks, planar: bool, mimic_joints: Array) -> None:
        self.blocks, self._planar, self._mimic_joints = blocks, int(planar), mimic_joints
        self._find = checked_by_caller(_find, _FIND)
        self._times = checked_by_caller(_times, _TIMES)
        self._along = checked_by_caller(along, _ALONG)
        self._points = checked_by_caller(_points, _POINTS)
        self._corners = checked_by_caller(_corners, _CORNERS)
        self._merge = checked_by_caller(_merge, _MERGE)

    def way(self, a: Array, b: Array) -> Array:
        """The legs (L, 3 + n) from a to b (n,)."""
        legs = np.empty((LEGS, 3 + len(a)))
        return legs[: self._find(self.blocks, a, b, legs)]

    def times(self, legs: Array) -> Array:
        """What each leg takes with its stop, (L,), s."""
        out = np.empty(len(legs))
        self._times(self.blocks, np.ascontiguousarray(legs), out)
        return out

    def at(self, q: Array, leg: Array, share: float) -> Array:
        """Where a share of a leg leads from q (n,)."""
        out = np.empty_like(q)
        self._along(self._planar, q, np.ascontiguousarray(leg), share, self._mimic_joints, out)
        return out

    def points(self, corners: Array, legs: Array, which: Integers, shares: Array) -> Array:
        """Where shares (N,) of legs (L, 3 + n), the leg `which` (N,) of each, lead from their corners
        (L + 1, n): (N, n)."""
        out = np.empty((len(which), corners.shape[1]))
        legs = np.ascontiguousarray(legs)
        self._points(self._planar, corners, legs, which, shares, self._mimic_joints, out)
        return out

    def corners(self, q: Array, legs: Array) -> Array:
        """Where the legs lead one after the other from q (n,): (L + 1, n)."""
        corners = np.empty((len(legs) + 1, len(q)))
        self._corners(self._planar, q, np.ascontiguousarray(legs), self._mimic_joints, corners)
        return corners

    def merged(self, legs: Array) -> Array:
        """The same motion with legs that go the same way as one."""
        merged = np.empty_like(legs)
        return merged[: self._merge(np.ascontiguousarray(legs), merged)]
