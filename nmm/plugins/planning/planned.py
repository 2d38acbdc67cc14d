"""Plans by their kinds: legs with rests, waiting for what moves, smooth, towed, and with something held."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import cast

import numpy as np

from nmm.base.arrays import Array
from nmm.base.errors import InputError, NmmError, RunError, few
from nmm.control.functions.tasks.task import Task
from nmm.model.collisions.obstacle import Obstacle
from nmm.model.collisions.scene import Scene
from nmm.model.platforms.tractor import Tractor
from nmm.model.robots.robot import Robot
from nmm.plugins.planning.goals import alternatives
from nmm.plugins.planning.held_motion import HeldTiming
from nmm.plugins.planning.held_search import HeldWays, refuse_beside_hold
from nmm.plugins.planning.holding import Held
from nmm.plugins.planning.plan import Found, Plan, TimedMotion
from nmm.plugins.planning.prepared import Prepared
from nmm.plugins.planning.samples import SampledMotion, joined
from nmm.plugins.planning.search import PlanSearch
from nmm.plugins.planning.search_space import USUAL
from nmm.plugins.planning.smoothing import Smoothing
from nmm.plugins.planning.timing import TimedLegs, timed
from nmm.plugins.planning.towing import Towing
from nmm.plugins.planning.waiting import LONG, waited

#: Ways that are tried among obstacles that move, and how often each but the first is shortened.
WAYS, SHORTEN = 8, 50


def planned(
    search: PlanSearch, seconds: float, shorten: int, progress: Callable[[float], None] | None
) -> Plan:
    """From a search's start through all its goals; each part ends where the next begins."""
    begin = partial(search.begin, seconds, progress)
    if isinstance(search.robot.platform, Tractor):
        return _towed(search, search.robot.platform, begin)
    if search.asked.hold is not None:
        return _holding(search, search.asked.hold, shorten, begin)
    begin()
    q, parts, least = search.start, [], search.asked_kept + search.asked.margin
    for wanted in search.goals:
        search.keep_asked()
        legs = search.shortened(q, search.farther(q, search.ends(wanted, q)), shorten)
        parts.append(legs)
        q, least = search.guide.corners(q, legs)[-1], np.minimum(least, search.check.kept)
    search.check.kept[:] = least
    return finished(search, *parts)


def finished(search: PlanSearch, *parts: Array) -> Plan:
    """The plan of legs from the start; a smooth one rests between the parts."""
    path = _timed(search, search.start, *parts)
    motion: TimedMotion = path
    if search.movers is not None:
        motion = _waited(search, path, search.movers)
    elif search.asked.smooth:
        motion = _smoothed(search, parts) or path
    return _found(search, motion)


def _waited(search: PlanSearch, path: TimedLegs, movers: Scene) -> TimedLegs:
    """The path, or another way, with a timing among what moves; `RunError` where none of them has one."""
    timing, looked = waited(path, search.robot, movers)
    ways = 1
    for k in range(1, WAYS):
        left = search.left()
        if timing is not None or left <= 0.0:
            break
        at = None if k % 2 == 0 else LONG if k == 1 else float(search.rng.uniform(0.0, path.duration))
        with suppress(NmmError):  # what stands there may touch the start, the goal, or leave no way
            other = _another_way(search, at, k, left / (WAYS - k))
            timing, more = waited(cast(TimedLegs, other.motion), search.robot, movers)
            search.tree = other.tree if timing is not None else search.tree
            ways, looked = ways + 1, looked + more
    if timing is None:
        names = few(sorted({obstacle.name for obstacle in movers.obstacles}))
        tried = f"{ways} way{'s'[: ways > 1]} and {looked} timings of their parts looked at"
        what = f"{tried}: none keeps its distance of {names}"
        raise RunError(what, where="plan", expected="nmm.Horizon, which steps aside")
    return timing


def _another_way(search: PlanSearch, at: float | None, k: int, seconds: float) -> Found:
    """The way of another seed, with what moves standing where it is at a time, s; without it at None."""
    collisions = search.asked.collisions
    standing = [obstacle for obstacle in collisions.obstacles if not obstacle.moves]
    if at is not None:
        moves = [obstacle for obstacle in collisions.obstacles if obstacle.moves]
        standing += [
            Obstacle(obstacle.shape, obstacle.placement(at), name=obstacle.name) for obstacle in moves
        ]
    asked = replace(search.asked, collisions=replace(collisions, obstacles=tuple(standing)), smooth=False)
    other = PlanSearch(Prepared(search.robot, asked), search.start, search.goals, search.seed + k)
    return planned(other, seconds, SHORTEN, None).found


def _smoothed(search: PlanSearch, parts: Sequence[Array]) -> SampledMotion | None:
    """The parts as smooth motions with rests between them; None where one of them is not found."""
    smoothing = Smoothing(search.robot, search.limits, USUAL, search.check, search.costs)
    motions, q = [], search.start
    for legs in parts:
        path = _timed(search, q, legs)
        q = path.corners[-1]
        if path.duration > 0.0:
            motion = smoothing(path)
            if motion is None:
                return None
            motions.append(_within_efforts(search, motion))
    return joined(motions) if motions else None


def _towed(search: PlanSearch, tractor: Tractor, begin: Callable[[], None]) -> Plan:
    """The plan of a tractor with trailers, which is smooth."""
    robot = search.robot
    if search.movers is not None:
        raise InputError("a tractor with trailers waits for none that move", where="plan: obstacles")
    arguments = robot, search.limits, USUAL, search.check, search.low, search.high, search.seed, search.left
    towing = Towing(*arguments, search.costs)
    begin()
    hitches, q, motions = {trailer.joint for trailer in tractor.trailers}, search.start, []
    for wanted in search.goals:
        search.keep_asked()
        ends, named = search.ends(wanted, q), _named(robot, wanted)
        if any(np.array_equal(q, end) for end in ends):
            continue
        find = partial(towing, q, ends, loose=named is not None and not hitches & named)
        motion = search.with_margin(find, q, ends)
        motions.append(_within_efforts(search, motion))
        q = motion.corners[-1]
    whole = joined(motions) if motions else _still(search, q)
    return _plan(search, whole, towing.motions, towing.configurations)


def _named(robot: Robot, wanted: object) -> set[str] | None:
    """The coordinates that goals name, and their postures; None where one of them is no goal by name."""
    named: set[str] = set()
    for goal in alternatives(wanted):
        if not isinstance(goal, Mapping):
            return None
        named |= {*goal, *robot.postures.get(str(goal.get("posture")), {})}
    return named


def _holding(search: PlanSearch, hold: Task | str, shorten: int, begin: Callable[[], None]) -> Plan:
    """The plan along which the arm holds something."""
    robot, asked = search.robot, search.asked
    refuse_beside_hold(robot, asked)
    held = Held(robot, hold, search.start, asked.tolerance, search.check, search.within)
    timing = HeldTiming(held, search.guide, search.limits, search.usual)
    ways = HeldWays(asked, timing, search.trees, search.rng, search.left, search.within)
    begin()
    q, motions = search.start, list[SampledMotion]()
    for wanted in search.goals:
        search.keep_asked()
        motions += ways.motions(q, wanted, shorten)
        q = motions[-1].corners[-1] if motions else q
    motions = [_within_efforts(search, motion) for motion in motions]
    return _found(search, joined(motions) if motions else _still(search, q))


def _timed(search: PlanSearch, start: Array, *parts: Array) -> TimedLegs:
    """The parts one after the other, with a rest between two of them."""
    guide, legs = search.guide, np.vstack([search.guide.merged(part) for part in parts])
    motion = timed(guide, search.robot, start, legs, search.limits, search.usual)
    return motion if search.efforts is None else search.efforts.legs(motion)


def _still(search: PlanSearch, q: Array) -> TimedLegs:
    return _timed(search, q, np.zeros((0, 3 + search.robot.n)))


def _within_efforts(search: PlanSearch, motion: SampledMotion) -> SampledMotion:
    return motion if search.efforts is None else search.efforts.samples(motion)


def _found(search: PlanSearch, motion: TimedMotion) -> Plan:
    motions, postures = (int(count) for count in search.trees.looked)
    return _plan(search, motion, motions, postures)


def _plan(search: PlanSearch, motion: TimedMotion, motions: int, postures: int) -> Plan:
    search.keep_asked()  # no margin, and nothing that the last part added
    result = Found(motion, search.goals[-1], search.tree, search.prepared, search.check.nearer)
    return Plan(search.robot, motions, postures, result)
