"""When a path along which the arm holds is where: as fast as the limits allow, at rest between legs.

The square x of the speed along a leg is linear in the way between two nodes, so that limits of velocity and
acceleration are linear in its values there. The fastest is found from the end to the beginning and back
(H. Pham, Q.-C. Pham, A new approach to time-optimal path parameterization based on reachability analysis,
2018). Each joint goes from node to node with the speeds it has there by two parabolas.
"""

from __future__ import annotations

import math

import numpy as np

from nmm.base.arrays import Array
from nmm.control.limits.limits import LimitsOn
from nmm.model.robots.zero_order_hold import inputs_of
from nmm.plugins.planning.collisions.legs_check import MARGIN
from nmm.plugins.planning.holding import ARRIVED, FollowedPath, Held
from nmm.plugins.planning.path import Guide
from nmm.plugins.planning.problem import TURN
from nmm.plugins.planning.samples import MotionSamples, SampledMotion
from nmm.plugins.planning.search_space import allowed
from nmm.plugins.planning.timing import inputs_of_legs, spins_of

#: The steps by which the arm follows, s, and its joints', rad or m, halved until what is held is off by no
#: more than KEPT, m and rad, between nodes.
TICK, FAR, HALVINGS, KEPT = 0.04, 0.03, 4, 5e-5
#: Paths keep so much more than the distance, m, for what joints do between nodes beside the straight way.
ROUND = 2.0 * MARGIN
#: What is looked at between two nodes, as shares of their time.
BETWEEN = np.array([0.2, 0.5, 0.8])
#: The share of the fastest that is driven, for rounding.
SHARE = 1.0 - 1e-9


class HeldTiming:
    """Makes motions of paths along which the arm holds something. usual (3 + n,) : speeds of a leg's numbers
    where inputs have none"""

    def __init__(self, held: Held, guide: Guide, limits: LimitsOn, usual: Array) -> None:
        self.robot, self.held, self.guide, self.limits, self.usual = held.robot, held, guide, limits, usual

    def __call__(self, start: Array, legs: Array) -> list[SampledMotion] | None:
        """A motion for each of legs (L, 3 + n) from start (n,); None where something is not kept."""
        for halving in range(HALVINGS + 1):
            path = self.held.along(start, legs, TICK / 2**halving, FAR / 2**halving)
            if path.ended != ARRIVED:
                continue
            motions = self._timed(start, legs, path)
            if motions is not None:
                return motions
        return None

    def _timed(self, start: Array, legs: Array, path: FollowedPath) -> list[SampledMotion] | None:
        motions, corner = [], start
        for k, leg in enumerate(legs):
            own = path.places[:, 0] == k
            nodes = np.vstack([corner, path.nodes[own]])
            share = np.concatenate([[0.0], path.places[own, 1]])
            motion, gone = self._leg(leg, nodes, share)
            if not self._kept(motion, nodes, gone):
                return None
            motions.append(motion)
            corner = nodes[-1]
        return motions

    def _leg(self, leg: Array, nodes: Array, share: Array) -> tuple[SampledMotion, Array]:
        """The motion along one leg, and how much of the way between two nodes is gone at BETWEEN, (K, 3)."""
        robot, limits, p = self.robot, self.limits, self.held.platform
        rates = np.array([self.held.tangent(q, self._platform_rates(q, leg)) for q in nodes])
        driven = inputs_of_legs(robot, nodes[:1], leg[np.newaxis])[0]
        moved, arm = robot.rate_coordinates, np.flatnonzero(robot.rate_coordinates >= p)
        U = np.tile(driven, (len(nodes), 1))
        U[:, arm] = rates[:, moved[arm]]
        change = np.gradient(rates, share, axis=0, edge_order=2 if len(share) > 2 else 1)
        U_share = np.zeros_like(U)
        U_share[:, arm] = change[:, moved[arm]]
        with np.errstate(divide="ignore", invalid="ignore"):
            speed = np.min(np.where(U >= 0.0, limits.inputs[:, 1], -limits.inputs[:, 0]) / np.abs(U), axis=1)
            usual = np.hstack([np.tile(leg[: 3 + p], (len(nodes), 1)), rates[:, p:]])
            speed = np.minimum(speed, np.min(self.usual / np.abs(usual), axis=1))
            spins = spins_of(robot, nodes[[0, -1]], np.tile(leg, (2, 1)), limits)
            speed = np.minimum(speed, np.min(limits.spin / spins, initial=np.inf))
        x = fastest(np.minimum(speed**2, 1e8), share, U, U_share, limits.changes)
        s = np.sqrt(x)
        times = 2.0 * np.diff(share) / (s[:-1] + s[1:])
        u = U * s[:, np.newaxis]
        middle = 0.5 * (u[:-1] + u[1:])
        rise = np.diff(nodes, axis=0) / times[:, np.newaxis]
        middle[:, arm] = 2.0 * rise[:, moved[arm]] - middle[:, arm]
        half = 0.5 * times[:, np.newaxis]
        at_middle = [
            self.guide.at(nodes[0], leg, float(gone))
            for gone in share[:-1] + times * (3.0 * s[:-1] + s[1:]) / 8.0
        ]
        between = np.array(at_middle)
        way = 0.5 * half * (u[:-1] + middle)
        between[:, moved[arm]] = nodes[:-1][:, moved[arm]] + way[:, arm]
        between = np.array([robot.following.placed(row) for row in between])
        q, whole = np.empty((2 * len(times) + 1, robot.n)), np.empty((2 * len(times) + 1, robot.n_u))
        q[::2], q[1::2], whole[::2], whole[1::2] = nodes, between, u, middle
        steps = np.repeat(0.5 * times, 2)
        a = np.diff(whole, axis=0) / steps[:, np.newaxis]
        with np.errstate(divide="ignore", invalid="ignore"):
            over = np.where(whole >= 0.0, whole / limits.inputs[:, 1], whole / limits.inputs[:, 0])
            harder = float(np.nanmax(a / np.where(a >= 0.0, *limits.changes.T[::-1]), initial=0.0))
        slower = max(1.0, float(np.nanmax(over, initial=0.0)), math.sqrt(harder)) * (1.0 + 1e-9)
        turn = float(np.abs(np.diff(q[:, 2:3], axis=0)).max(initial=0.0)) if p >= 3 else 0.0
        samples = MotionSamples(
            inputs_of(robot),
            np.concatenate([[0.0], np.cumsum(slower * steps)]),
            np.array(max(2, math.ceil(turn / TURN)), dtype=np.int64),
            q,
            whole / slower,
            a / slower**2,
        )
        speeds = s[:-1, np.newaxis] + 0.5 * BETWEEN * np.diff(s)[:, np.newaxis]
        return SampledMotion(samples, ()), speeds * BETWEEN * (times / np.diff(share))[:, np.newaxis]

    def _kept(self, motion: SampledMotion, nodes: Array, gone: Array) -> bool:
        """Whether between nodes joints keep their limits, the arm what it holds, and the robot's points are
        where legs between the nodes, which were looked at, have them, but for ROUND."""
        begin = motion.samples.begin[::2]
        t = begin[:-1, np.newaxis] + np.diff(begin)[:, np.newaxis] * BETWEEN
        q, _ = motion.at(t.ravel())
        within = allowed(self.robot, self.limits)
        if any(self.robot.outside(row, within) or max(self.held.off(row)) > KEPT for row in q):
            return False
        straight = nodes[:-1, np.newaxis] + gone[:, :, np.newaxis] * np.diff(nodes, axis=0)[:, np.newaxis]
        first = self.held.platform
        off = np.abs(q.reshape(straight.shape) - straight)[:, :, first:].reshape(-1, self.robot.n - first)
        return float((off @ self.held.check.levers[:, 3 + first :].T).max(initial=0.0)) <= ROUND

    def _platform_rates(self, q: Array, leg: Array) -> Array:
        """What a leg's twist does to the platform's coordinates at q, (n_p,), per share."""
        rates = leg[3 : 3 + self.held.platform].copy()
        c, s = np.cos(q[2]), np.sin(q[2])
        rates[:3] = c * leg[0] - s * leg[1], s * leg[0] + c * leg[1], leg[2]
        return rates


def fastest(top: Array, share: Array, U: Array, U_share: Array, changes: Array) -> Array:
    """The largest squares of the speed x (K + 1,), below top and 0 at both ends, with which accelerations
    U_share x + U x_share / 2 (K + 1, m) are within `changes` (m, 2) at both ends of each piece."""
    h = np.diff(share)[:, np.newaxis]
    near, far = 0.5 * U[:-1] / h, 0.5 * U[1:] / h
    limited = np.isfinite(changes).any(axis=1)
    a = np.hstack([(U_share[:-1] - near)[:, limited], -far[:, limited]])
    b = np.hstack([near[:, limited], (U_share[1:] + far)[:, limited]])
    low, high = np.tile(changes[limited].T, 2)
    a, b = np.hstack([a / high, a / low]), np.hstack([b / high, b / low])
    x = top.copy()
    x[0] = x[-1] = 0.0
    for k in range(len(h) - 1, 0, -1):
        x[k] = reaching(x[k], x[k + 1], a[k], b[k])
    for k in range(len(h) - 1):
        up = b[k] > 0.0
        x[k + 1] = min(x[k + 1], float(np.min((1.0 - a[k, up] * x[k]) / b[k, up], initial=np.inf)))
    return x * SHARE


def reaching(most: float, after: float, a: Array, b: Array) -> float:
    """The largest x ≤ most for which a y between 0 and `after` keeps a x + b y ≤ 1: each pair of a bound from
    above and one from below on y bounds x."""
    up, down = b > 0.0, b < 0.0
    flat = ~up & ~down & (a > 0.0)
    # y ≤ high - up_by x, y ≥ low - down_by x
    high, up_by = np.append(1.0 / b[up], after), np.append(a[up] / b[up], 0.0)
    low, down_by = np.append(1.0 / b[down], 0.0), np.append(a[down] / b[down], 0.0)
    slope = up_by[:, np.newaxis] - down_by
    room = high[:, np.newaxis] - low
    bounds = room[slope > 0.0] / slope[slope > 0.0]
    return float(min(most, bounds.min(initial=np.inf), (1.0 / a[flat]).min(initial=np.inf)))
