"""Plans along which the arm holds a pose or a position of a frame while the platform goes to a pose.

One tree grows from the start (S. M. LaValle, J. J. Kuffner, Randomized kinodynamic planning, 2001) in the
platform's own coordinates; the arm follows to each of its configurations. So the arm is never asked to join
another of its branches, and where it ends comes of the way.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from typing import Any

import numpy as np

from nmm.base.arrays import Array
from nmm.base.errors import InputError, RunError
from nmm.model.platforms.tractor import Tractor
from nmm.model.robots.robot import Robot
from nmm.plugins.planning.collisions.legs_check import MARGIN
from nmm.plugins.planning.goals import (
    ATTEMPTS,
    GoalPostures,
    Wanted,
    alternatives,
    expect_within,
    nothing_found,
)
from nmm.plugins.planning.held_motion import ROUND, HeldTiming
from nmm.plugins.planning.holding import ARRIVED, BLOCKED, LOST, Held
from nmm.plugins.planning.prepared import Asked
from nmm.plugins.planning.samples import SampledMotion
from nmm.plugins.planning.shortening import shortened
from nmm.plugins.planning.tree import Trees

#: The steps by which the arm follows while a way is looked for, s, and of its joints, rad or m.
TICK, FAR = 0.1, 0.04
#: Ways that are looked for keep so much more, m, than is asked of them when they are timed, by smaller steps.
SPARE = 0.6 * MARGIN
#: The share of draws that are the goal; how many of the nearest nodes are compared by their ways.
TO_GOAL, NEAREST = 0.2, 5
#: The longest motion by which the tree grows, s.
STEP = 2.0
#: Of the rounds to shorten one in so many is made: the arm follows the whole path in each.
FEWER = 4


class HeldPostures(GoalPostures):
    """Configurations of the arm that hold it with the platform at a pose. off : by how much the nearest that
    was not kept missed it, m and rad"""

    held: Held
    off = (np.inf, np.inf)

    def _reaching(self, wanted: Any, start: Array, rng: np.random.Generator) -> Iterator[Array | None]:
        first = self.held.platform
        for k in range(ATTEMPTS):
            q = start.copy() if k == 0 else rng.uniform(self.low, self.high)
            q[:first] = wanted
            q = self.robot.following.placed(q)
            if self.held(q):
                yield q
            else:
                self.off = min(self.off, self.held.off(q))
                yield None


class HeldWays:
    """The platform's ways along which the arm holds something, and their motions.

    Parameters
    ----------
    trees : whose ways are the platform's, and which count what was looked at
    clock : the time that is left, s
    within (n, 2) : limits of coordinates, m and rad
    """

    def __init__(
        self,
        asked: Asked,
        timing: HeldTiming,
        trees: Trees,
        rng: np.random.Generator,
        clock: Callable[[], float],
        within: Array,
    ) -> None:
        self.asked, self.timing, self.trees, self.rng, self.clock = asked, timing, trees, rng, clock
        self.robot, self.held, self.check, self.guide = (
            timing.robot,
            timing.held,
            timing.held.check,
            timing.guide,
        )
        self._first, self.within = self.held.platform, within
        self.low, self.high = trees.low.copy(), trees.high.copy()
        self._ended: Counter[int] = Counter()

    def motions(self, start: Array, wanted: Wanted, shorten: int) -> list[SampledMotion]:
        """Motions from start (n,), which holds it, to a pose of the platform; `RunError` for none."""
        legs = self.way(start, wanted)
        if not len(legs):
            return []
        shorter = self.shortened(start, legs, shorten // FEWER)
        self.check.kept[:] -= SPARE
        motions = self.timing(start, shorter) or self.timing(start, legs)
        if motions is None:
            what = "a way was found, on which the arm is too near to where it cannot hold: try another seed"
            raise RunError(what, where="plan")
        return motions

    def way(self, start: Array, wanted: Wanted) -> Array:
        """Legs to a goal, with the margin where such are found in half of the time."""
        distances = self.check.kept.copy()
        if self.asked.margin > 0.0:
            self.check.widen(start[np.newaxis], self.asked.margin)
            self.check.kept[:] += ROUND + SPARE
            with suppress(RunError):
                return self.way_to(start, self.poses(wanted, start), 0.5 * self.clock())
            self.check.kept[:] = distances
        self.check.kept[:] += ROUND + SPARE
        return self.way_to(start, self.poses(wanted, start), 0.0)

    def poses(self, wanted: Wanted, start: Array) -> list[Array]:
        """Platform coordinates (n_p,) of those of a goal's alternatives at which the arm can hold."""
        postures = HeldPostures(
            self.robot, self.low, self.high, self.check, self.asked.tolerance, self.within
        )
        postures.held, poses = self.held, []
        for goal in alternatives(wanted):
            if not isinstance(goal, Mapping) or set(goal) != {"x", "y", "theta"}:
                expected = "x, y and theta of the platform: the arm goes where it holds"
                got = ", ".join(map(str, goal)) if isinstance(goal, Mapping) else goal
                raise InputError(where="plan: goal", expected=expected, got=got)
            pose = start[: self._first].copy()
            pose[:3] = self.robot.q(goal)[:3]
            expect_within(self.robot, self.robot.q(goal), range(3), self.within)
            if postures.find(pose, start, self.rng, 1):
                poses.append(pose)
        if poses:
            return poses
        if postures.in_the_way:
            raise nothing_found(postures)
        (metres, radians), tried = postures.off, postures.tried
        near = f"the nearest of {tried} postures is {metres:.2g} m and {radians:.2g} rad off"
        what = f"{self.held.name} is out of reach with the platform at the goal"
        raise RunError(f"{what}: {near}", where="plan")

    def follow(self, q: Array, pose: Array, most: float = np.inf) -> tuple[Array, Array, bool]:
        """From q (n,) towards a pose of the platform (n_p,), for some seconds at most: the legs, where they
        end, and whether they arrive."""
        target = q.copy()
        target[: self._first] = pose
        legs = self.guide.way(q, target)
        times = self.guide.times(legs)
        over = np.flatnonzero(np.cumsum(times) > most)
        whole = not len(over)
        if not whole:
            k = int(over[0])
            share = max(1.0 - (float(times[: k + 1].sum()) - most) / float(times[k]), 0.1)
            legs = np.vstack([legs[:k], share * legs[k : k + 1]])
        self.trees.looked[0] += 1
        path = self.held.along(q, legs, TICK, FAR)
        self._ended[path.ended] += 1
        if path.ended == ARRIVED:
            return legs, path.nodes[-1] if len(legs) else q, whole
        if not len(path.nodes):
            return legs[:0], q, False
        last, share = int(path.places[-1, 0]), float(path.places[-1, 1])
        return np.vstack([legs[:last], share * legs[last : last + 1]]), path.nodes[-1], False

    def way_to(self, start: Array, poses: Sequence[Array], least: float) -> Array:
        """Legs (L, 3 + n) from a configuration to one of the poses, as the arm can follow; `RunError` when
        less time than `least` is left, s."""
        nodes, parents, ways = [start], [-1], [np.zeros((0, 3 + self.robot.n))]
        around = 0.5 * self.robot.reach  # farther aside the arm seldom reaches what it holds
        self.low[:2] = np.min([start[:2], *(pose[:2] for pose in poses)], axis=0) - around
        self.high[:2] = np.max([start[:2], *(pose[:2] for pose in poses)], axis=0) + around

        def add(parent: int, pose: Array, most: float) -> tuple[int, bool]:
            legs, end, arrived = self.follow(nodes[parent], pose, most)
            if len(legs):
                nodes.append(end)
                parents.append(parent)
                ways.append(legs)
            return (len(nodes) - 1 if len(legs) else parent), arrived

        new = 0
        while True:
            for pose in poses:
                last, arrived = add(new, pose, np.inf)
                if arrived:
                    chain = []
                    while last >= 0:
                        chain.append(ways[last])
                        last = parents[last]
                    return self.guide.merged(np.vstack(chain[::-1]))
            new = self._grown(nodes, poses, add, least)

    def _grown(
        self,
        nodes: list[Array],
        poses: Sequence[Array],
        add: Callable[[int, Array, float], tuple[int, bool]],
        least: float,
    ) -> int:
        """The number of a node that is added towards a random pose."""
        while True:
            self._look_at_clock(least)
            pose = (
                poses[int(self.rng.integers(len(poses)))] if self.rng.uniform() < TO_GOAL else self._drawn()
            )
            off = np.array(nodes)[:, : self._first] - pose
            off[:, 2] = 2.0 * np.sin(0.5 * off[:, 2])
            best, soonest = 0, np.inf
            for i in np.argsort(np.abs(off).sum(axis=1))[:NEAREST]:
                target = nodes[i].copy()
                target[: self._first] = pose
                takes = float(self.guide.times(self.guide.way(nodes[i], target)).sum())
                if takes < soonest:
                    best, soonest = int(i), takes
            count = len(nodes)
            new, _ = add(best, pose, STEP)
            if len(nodes) > count:
                return new

    def _drawn(self) -> Array:
        self.trees.looked[1] += 1
        pose = self.rng.uniform(self.low[: self._first], self.high[: self._first])
        pose[3:] = 0.0  # a car's steering
        return pose

    def _look_at_clock(self, least: float) -> None:
        if self.clock() < least:
            what = f"no way found in time on which {self.held.name} is held"
            why = f"{self._ended[LOST]} left the arm's reach, {self._ended[BLOCKED]} came too near"
            raise RunError(f"{what}: of {self.trees.looked[0]} motions {why}", where="plan")

    def shortened(self, start: Array, legs: Array, rounds: int) -> Array:
        def blocked(whole: Array) -> bool:
            self.trees.looked[0] += 1
            return self.clock() < 0.0 or self.held.along(start, whole, TICK, FAR).ended != ARRIVED

        return shortened(self.guide, start, legs, rounds, 3 + self._first, blocked)


def refuse_beside_hold(robot: Robot, asked: Asked) -> None:
    """`InputError` for what does not go with holding."""
    if robot.platform.n_p < 3:
        raise InputError(f"{robot.name} stands", where="plan: hold", expected="a platform that moves")
    moves = any(obstacle.moves for obstacle in asked.collisions.obstacles)
    towed = isinstance(robot.platform, Tractor)
    if asked.smooth or moves or towed:
        what = "trailers" if towed else "smooth" if asked.smooth else "obstacles that move"
        raise InputError(f"it does not go with {what}", where="plan: hold")
