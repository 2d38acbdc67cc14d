"""A path of legs: where it leads, shorter ones, and what compiled code says of its pieces."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from nmm.base.arrays import Array
from nmm.base.kernels.compiled import checked_by_caller, compiled
from nmm.base.kernels.record_layout import BLOCKS, Blocks, views
from nmm.base.kernels.signatures import float64, int64, void
from nmm.plugins.planning.collisions.legs_check import along
from nmm.plugins.planning.tree import PLACE, Trees
from nmm.plugins.planning.ways import LEGS, find_way, leg_time

#: A shorter way saves at least this, s.
WORTH = 1e-3
#: Two legs go the same way where their directions differ by less.
SAME = 1e-9


@compiled
def _find(blocks: Blocks, a: Array, b: Array, legs: Array) -> int:
    return find_way(views(Trees, blocks.integers, blocks.floats, PLACE).ways, a, b, legs)


@compiled
def _times(blocks: Blocks, legs: Array, out: Array) -> None:
    ways = views(Trees, blocks.integers, blocks.floats, PLACE).ways
    for k in range(legs.shape[0]):
        out[k] = leg_time(ways, legs[k]) + ways.pause[()]


_FLAT, _ROWS = float64[::1], float64[:, ::1]
_FIND = int64(BLOCKS, _FLAT, _FLAT, _ROWS)
_TIMES = void(BLOCKS, _ROWS, _FLAT)
_ALONG = void(int64, _FLAT, _FLAT, float64, _FLAT, _FLAT)


class Guide:
    """The ways of a robot, as `Trees` in memory have them: legs between configurations, and what they
    take."""

    def __init__(self, blocks: Blocks, planar: bool, mimic_joints: Array) -> None:
        self._blocks, self._planar, self._mimic_joints = blocks, int(planar), mimic_joints
        self._find = checked_by_caller(_find, _FIND)
        self._times = checked_by_caller(_times, _TIMES)
        self._along = checked_by_caller(along, _ALONG)

    def way(self, a: Array, b: Array) -> Array:
        """The legs (L, 3 + n) from a to b (n,)."""
        legs = np.empty((LEGS, 3 + len(a)))
        return legs[: self._find(self._blocks, a, b, legs)]

    def times(self, legs: Array) -> Array:
        """What each leg takes with its stop, (L,), s."""
        out = np.empty(len(legs))
        self._times(self._blocks, np.ascontiguousarray(legs), out)
        return out

    def at(self, q: Array, leg: Array, share: float) -> Array:
        """Where a share of a leg leads from q (n,)."""
        out = np.empty_like(q)
        self._along(self._planar, q, np.ascontiguousarray(leg), share, self._mimic_joints, out)
        return out

    def corners(self, q: Array, legs: Array) -> Array:
        """Where the legs lead one after the other from q (n,): (L + 1, n)."""
        corners = [q]
        for leg in legs:
            corners.append(self.at(corners[-1], leg, 1.0))
        return np.array(corners)

    def merged(self, legs: Array) -> Array:
        """The same motion with legs that go the same way as one."""
        merged: list[Array] = []
        for leg in legs:
            size = float(np.linalg.norm(leg))
            if size == 0.0:
                continue
            if merged:
                before = float(np.linalg.norm(merged[-1]))
                if np.abs(merged[-1] / before - leg / size).max() < SAME:
                    merged[-1] = merged[-1] + leg
                    continue
            merged.append(leg)
        return np.array(merged).reshape(-1, legs.shape[1])


def shortened(
    guide: Guide,
    blocked: Callable[[Array, Array, Array], int],
    start: Array,
    legs: Array,
    rounds: int,
    rng: np.random.Generator,
    first: int,
) -> Array:
    """A shorter path from start (n,): of two random points on it, the way between them in place of the path
    there, or the platform's path with the arm straight between them (its numbers of a leg begin at
    `first`). `blocked` looks at the new legs from a configuration, or at the whole path that has them."""
    known = False
    for _ in range(rounds):
        if not len(legs):
            break
        if not known:
            times, corners, known = guide.times(legs), guide.corners(start, legs), True
            until = np.cumsum(times)
        early, late = np.sort(rng.uniform(0.0, until[-1], 2))
        i, j = (int(k) for k in np.minimum(np.searchsorted(until, [early, late]), len(legs) - 1))
        share_a, share_b = ((t - until[k] + times[k]) / times[k] for t, k in ((early, i), (late, j)))
        a, b = guide.at(corners[i], legs[i], share_a), guide.at(corners[j], legs[j], share_b)
        if i == j:
            continue
        between = np.vstack([(1.0 - share_a) * legs[i], legs[i + 1 : j], share_b * legs[j]])
        for new in (guide.way(a, b), _with_straight_arm(guide, between, first)):
            parts = [
                legs[:i],
                share_a * legs[i : i + 1],
                new,
                (1.0 - share_b) * legs[j : j + 1],
                legs[j + 1 :],
            ]
            shorter = guide.merged(np.vstack(parts))  # with the stops where legs were cut
            if until[-1] - float(guide.times(shorter).sum()) > WORTH and blocked(a, new, shorter) < 0:
                legs, known = shorter, False
                break
    return legs


def _with_straight_arm(guide: Guide, legs: Array, first: int) -> Array:
    straight = legs.copy()
    straight[:, first:] = 0.0
    times = np.abs(straight).max(axis=1)
    if times.sum() > 0.0:
        straight[:, first:] = (times / times.sum())[:, np.newaxis] * legs[:, first:].sum(axis=0)
    else:
        straight = legs.sum(axis=0, keepdims=True)
    return straight
