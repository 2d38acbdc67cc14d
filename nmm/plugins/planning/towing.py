"""Plans of a tractor with trailers: ways that are driven roughly, of which the solver makes exact motions."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np

from nmm.base.arrays import Array
from nmm.base.errors import RunError
from nmm.base.kernels.compiled import checked_by_caller
from nmm.base.kernels.record_layout import Memory, views
from nmm.control.limits.limits import LimitsOn
from nmm.model.platforms.tractor import Tractor
from nmm.model.robots.robot import Robot
from nmm.model.robots.zero_order_hold import inputs_of
from nmm.plugins.planning.collisions.motion_check import MotionCheck
from nmm.plugins.planning.objective import SampleCosts
from nmm.plugins.planning.samples import SampledMotion
from nmm.plugins.planning.search_space import allowed
from nmm.plugins.planning.smoothing import Smoothing
from nmm.plugins.planning.trailers import DRIVEN, SEARCH, SPACING, TRACE, Trains, search_trains, trace
from nmm.plugins.planning.tree import MODULUS

#: Room for configurations in each tree; rounds between two looks at the clock. Once the trees have joined
#: they grow on for so many rounds, for a shorter way.
ROOM, ROUNDS, MORE = 1500, 20, 60
#: So many rough ways of which no motion could be made are not tried again.
TRIED = 32
#: Steady hitches on arcs have this share of their limits, rad, and of FOLDED where they have none.
STEADY, FOLDED = 0.8, 1.2
#: Hitches keep off their limits by so much while trees grow, rad.
INSIDE = 0.03
#: Shares of the limits of inputs and accelerations that a rough motion has.
SPEED, HARD = 0.7, 0.4
#: Pieces this short are none, m.
SHORT = 1e-9
#: Around all that is known poses are drawn so many lengths of the train farther.
AROUND = 1.0


def least_radius(tractor: Tractor, folds: Array) -> float:
    """Of arcs, m, on which steady hitches are folded to `STEADY` of their limits, folds (trailers, 2).

    The hitch is h behind an axle that rolls on a circle of radius r, at √(r² + h²); the trailer's axle, l
    behind it, on one of √(r² + h² - l²). The angle between them is atan(h / r) + atan(l / that).
    """
    allowed = STEADY * np.minimum(np.abs(folds).min(axis=1), FOLDED)

    def holds(radius: float) -> bool:
        for trailer, most in zip(tractor.trailers, allowed, strict=True):
            h, length = trailer.hitch, trailer.length
            square = radius * radius + h * h - length * length
            if square <= 0.0:
                return False
            after = math.sqrt(square)
            if abs(math.atan(h / radius) + math.atan(length / after)) > most:
                return False
            radius = after
        return True

    low, high = 0.0, 1.0
    while not holds(high):
        low, high = high, 2.0 * high
    while high - low > 1e-3 * high:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if holds(middle) else (middle, high)
    return high


@dataclass(frozen=True)
class RoughMotion:
    """Configurations q (K, n) at times t (K,), s, and the inputs u (K - 1, m) between them."""

    t: Array
    q: Array
    u: Array

    @property
    def duration(self) -> float:
        return float(self.t[-1])

    def at(self, t: Array) -> tuple[Array, Array]:
        """q (N, n) and u (N, m) at times t (N,), s."""
        middles = 0.5 * (self.t[1:] + self.t[:-1])
        return _between(t, self.t, self.q), _between(t, middles, self.u)


def _between(t: Array, known: Array, rows: Array) -> Array:
    return np.column_stack([np.interp(t, known, column) for column in rows.T])


class Towing:
    """Looks for motions of a tractor with trailers.

    Parameters
    ----------
    usual : speeds of inputs without limits, m/s and rad/s
    low, high (n,) : where configurations are drawn, m and rad
    left : how much time is left, s
    costs : of an objective

    Attributes
    ----------
    motions, configurations : how many were looked at: rough motions, and nodes of trees
    """

    def __init__(
        self,
        robot: Robot,
        limits: LimitsOn,
        usual: float,
        check: MotionCheck,
        low: Array,
        high: Array,
        seed: int,
        left: Callable[[], float],
        costs: SampleCosts | None = None,
    ) -> None:
        self.robot, self.limits, self.check, self.left = robot, limits, check, left
        self.tractor = cast(Tractor, robot.platform)
        self.smoothing = Smoothing(robot, limits, usual, check, costs)
        self.motions = self.configurations = 0
        n, count = robot.n, len(self.tractor.trailers)
        folds = allowed(robot, limits)[3 : 3 + count]
        radius = least_radius(self.tractor, folds)
        train = sum(abs(trailer.hitch) + trailer.length for trailer in self.tractor.trailers)
        around = np.array([AROUND * train, AROUND * train, 0.0])
        memory = Memory()
        memory.add(
            Trains(
                inputs=inputs_of(robot),
                radius=np.array(radius),
                folds=folds + np.array([INSIDE, -INSIDE]),
                low=low[:3] - around,
                high=high[:3] + around,
                far=np.array(2.0 * math.pi * radius),
                line=np.array(0.75 * train),
                reverses=np.array(int(limits.inputs[0, 0] < 0.0), dtype=np.int64),
                loose=np.array(0, dtype=np.int64),
                nodes=np.zeros((2, ROOM, n)),
                parents=np.zeros((2, ROOM), dtype=np.int64),
                counts=np.zeros(2, dtype=np.int64),
                driven=np.zeros((2, ROOM, DRIVEN, 2)),
                lengths=np.zeros((2, ROOM)),
                random=np.array([1 + seed % (MODULUS - 1)], dtype=np.int64),
                joint=np.zeros((DRIVEN, 2)),
                met=np.zeros(3, dtype=np.int64),
                shortest=np.array(math.inf),
                tried=np.full(TRIED, -1.0),
            )
        )
        self._own = memory.blocks()
        self.trains = views(Trains, *self._own, 0)
        self._search = checked_by_caller(search_trains, SEARCH)
        self._trace = checked_by_caller(trace, TRACE)

    def __call__(self, start: Array, goals: Sequence[Array], loose: bool) -> SampledMotion:
        """A motion from start (n,) to one of the goals.

        loose : whether the goals' hitches may have any angle

        Raises
        ------
        RunError : where none is found before there is no time left
        """
        self.trains.tried[:] = -1.0
        while self.left() > 0.0:
            if self._joined(start, goals, loose):
                self.motions += 1
                motion = self.smoothing(self._timed(*self._way()), rough=True)
                if motion is not None:
                    return motion
                self.trains.tried[self.motions % TRIED] = self.trains.shortest
        raise RunError(
            f"no motion with trailers found: {self.configurations} configurations and "
            f"{self.motions} rough ways looked at",
            where="plan",
        )

    def _joined(self, start: Array, goals: Sequence[Array], loose: bool) -> bool:
        """Grow new trees until they join, and a little longer; whether they did before room or time ended."""
        trains, count = self.trains, len(self.tractor.trailers)
        roots = list(goals)
        if loose:
            straight = [np.concatenate([q[:3], np.zeros(count), q[3 + count :]]) for q in goals]
            roots = [q for q in straight if self.check.too_near(q) < 0] + roots
        for k, own in enumerate(([start], roots[:ROOM])):
            trains.counts[k] = len(own)
            trains.nodes[k, : len(own)] = own
            trains.parents[k, : len(own)], trains.lengths[k, : len(own)] = -1, 0.0
        trains.loose[()], trains.shortest[()] = int(loose), math.inf
        more = MORE
        while more > 0 and self.left() > 0.0:
            done = self._search(*self.check.blocks, *self._own, ROUNDS)
            if trains.shortest[()] < math.inf:
                more -= ROUNDS
            if done < ROUNDS:
                break
        self.configurations += int(trains.counts.sum())
        return bool(trains.shortest[()] < math.inf)

    def _way(self) -> tuple[Array, Array]:
        """Configurations (K, n) along the way on which the trees joined, and the lengths driven between them
        (K - 1,), m, negative backwards."""
        trains = self.trains
        met, from_tree = trains.met[:2], int(trains.met[2])
        forth, back = (
            [(k, trains.nodes[k, trains.parents[k, i]], trains.driven[k, i]) for i in self._chain(k)]
            for k in (0, 1)
        )
        between = (from_tree, trains.nodes[from_tree, met[from_tree]], trains.joint)
        rows, lengths = [trains.nodes[0, 0].copy()], [np.zeros(0)]
        for tree, first, motion in [*forth[::-1], between, *back]:
            q, own = self._along(first, motion)
            if tree == 1:
                q, own = q[::-1], -own[::-1]
            q[:, 2] += 2.0 * math.pi * round((rows[-1][2] - q[0, 2]) / (2.0 * math.pi))
            rows += list(q[1:])
            lengths.append(own)
        driven = np.concatenate(lengths)
        goes = np.abs(driven) > SHORT
        q, driven, root = np.array(rows)[[True, *goes]], driven[goes], met[1]
        while trains.parents[1, root] >= 0:
            root = trains.parents[1, root]
        end = trains.nodes[1, root].copy()
        end[2] += 2.0 * math.pi * round((q[-1, 2] - end[2]) / (2.0 * math.pi))
        if trains.loose[()] and not back and from_tree == 0:
            hitches = slice(3, 3 + len(self.tractor.trailers))
            end[hitches] = q[-1, hitches]
        if len(q) == 1:
            return np.array([q[0], end]), np.zeros(1)
        q[-1] = end
        return q, driven

    def _chain(self, tree: int) -> list[int]:
        """The nodes of a tree from where both met to its root, without that."""
        nodes, node = [], int(self.trains.met[tree])
        while (parent := int(self.trains.parents[tree, node])) >= 0:
            nodes.append(node)
            node = parent
        return nodes

    def _along(self, q: Array, motion: Array) -> tuple[Array, Array]:
        """Configurations (K + 1, n) along a motion (DRIVEN, 2) from q, and lengths between them (K,), m."""
        counts = np.ceil(np.abs(motion[:, 1]) / SPACING).astype(np.int64)
        rows = np.zeros((1 + int(counts.sum()), len(q)))
        rows[0] = q
        self._trace(*self._own, rows[0].copy(), np.ascontiguousarray(motion), rows[1:])
        each = np.divide(motion[:, 1], counts, out=np.zeros(DRIVEN), where=counts > 0)
        return rows, np.repeat(each, counts)

    def _timed(self, q: Array, lengths: Array) -> RoughMotion:
        """The way within limits of speed and, along it, of acceleration; at rest where it turns back. The arm
        moves evenly."""
        far, top = np.abs(lengths), SPEED * np.abs(self.smoothing.top).max(axis=1)
        A = HARD * min(float(self.limits.accelerations[0]), 2.0 * top[0])
        until = np.concatenate([[0.0], np.cumsum(far)])
        back = np.flatnonzero(np.diff(np.sign(lengths)) != 0) + 1
        rests = until[np.concatenate([[0], back, [len(far)]])]
        to_rest = np.abs(0.5 * (until[1:] + until[:-1])[:, np.newaxis] - rests).min(axis=1)
        speed = np.minimum(top[0], np.sqrt(2.0 * A * to_rest))
        dt = np.divide(far, speed, out=np.full(len(far), 1e-3), where=far > 0.0)
        t = np.concatenate([[0.0], np.cumsum(dt)])
        first, q = 3 + len(self.tractor.trailers), q.copy()
        q[:, first:] = q[0, first:] + (t / t[-1])[:, np.newaxis] * (q[-1, first:] - q[0, first:])
        turning = np.diff(q[:, [2, *self.robot.rate_coordinates[2:]]], axis=0)
        u = np.column_stack([lengths, turning]) / dt[:, np.newaxis]
        # An even motion takes √(6 way / acceleration) from rest to rest.
        accelerations = self.limits.accelerations[2:]
        arm = np.sqrt(6.0 * np.abs(turning[:, 1:].sum(axis=0)) / accelerations) / t[-1]
        slower = max(1.0, float((np.abs(u) / top).max()), float(arm.max(initial=0.0)))
        return RoughMotion(slower * t, q, u / slower)
