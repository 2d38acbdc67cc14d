"""Shorter paths of legs: parts of a path give way to the way between their ends."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from nmm.base.arrays import Array, Integers
from nmm.base.kernels.compiled import checked_by_caller, clear, compiled, compiled_without_gil, scratch
from nmm.base.kernels.linear_algebra import copied
from nmm.base.kernels.record_layout import (
    BLOCKS,
    Blocks,
    IntegerCell,
    IntegerVector,
    Matrix,
    Memory,
    Vector,
    views,
)
from nmm.base.kernels.signatures import int64, void
from nmm.plugins.planning.collisions.legs_check import MovedShapes, along, first_blocked
from nmm.plugins.planning.path import Guide, join_leg
from nmm.plugins.planning.tree import PLACE, Trees, draw
from nmm.plugins.planning.ways import LEGS, Ways, find_way, leg_time

#: A shorter way saves at least this, s.
WORTH = 1e-3
#: What takes the place of a part of a path: the way between its ends, or its platform's path with the arm
#: straight between them.
WAY, STRAIGHT_ARM = 0, 1


class ShortenedPath(NamedTuple):
    """A path that is made shorter, with room for R legs.

    start (n,) : where it begins; arm () : a leg's numbers from this one on are the arm's
    legs, new, trial (R, 3 + n) : its legs; those that are to take a part's place; the path that has them
    counts (3,) : how many legs each of these has
    corners (R + 1, n), times (R,) : of `legs`, where they begin, and what each takes with its stop, s
    known () : 1 while `corners` and `times` are those of `legs`
    parts (2,), shares (2,) : the legs that are cut, and where; ends (2, n) : the configurations there
    """

    start: Vector
    arm: IntegerCell
    legs: Matrix
    new: Matrix
    trial: Matrix
    counts: IntegerVector
    corners: Matrix
    times: Vector
    known: IntegerCell
    parts: IntegerVector
    shares: Vector
    ends: Matrix


@compiled
def straighten_arm(ways: Ways, legs: Array, count: int, arm: int) -> int:
    """Let the arm go straight from its place before so many legs to that after them; as one leg where only
    the arm moves."""
    n, total, longest = legs.shape[1], 0.0, scratch(count)
    way = scratch(n)
    clear(way)
    for k in range(count):
        longest[k] = 0.0
        for i in range(n):
            way[i] += legs[k, i]
            if i < arm:
                longest[k] = max(longest[k], abs(legs[k, i]))
        total += longest[k]
    if total == 0.0:
        copied(way, legs[0])
        return 1
    for k in range(count):
        for i in range(arm, n):
            legs[k, i] = longest[k] / total * way[i]
    return count


@compiled
def cut(path: ShortenedPath, trees: Trees, planar: int, mimic_joints: Array) -> int:
    """Choose two random points on the path; 1 where they are on two legs, else 0."""
    count, total = path.counts[0], 0.0
    if path.known[()] == 0:
        copied(path.start, path.corners[0])
        for k in range(count):
            path.times[k] = leg_time(trees.ways, path.legs[k]) + trees.ways.pause[()]
            along(planar, path.corners[k], path.legs[k], 1.0, mimic_joints, path.corners[k + 1])
        path.known[()] = 1
    for k in range(count):
        total += path.times[k]
    a, b = total * draw(trees.random), total * draw(trees.random)
    for side in range(2):
        left, k = min(a, b) if side == 0 else max(a, b), 0
        while k < count - 1 and left > path.times[k]:
            left -= path.times[k]
            k += 1
        path.parts[side], path.shares[side] = k, min(left / path.times[k], 1.0)
    if path.parts[0] == path.parts[1]:
        return 0
    for side in range(2):
        k = path.parts[side]
        along(planar, path.corners[k], path.legs[k], path.shares[side], mimic_joints, path.ends[side])
    return 1


@compiled
def propose(path: ShortenedPath, trees: Trees, which: int) -> int:
    """Write `new` (of this kind) and `trial` for the path that is cut; 1 where it is shorter, else 0."""
    legs, i, j = path.legs, path.parts[0], path.parts[1]
    ways, count = trees.ways, path.counts[0]
    if which == WAY:
        new = find_way(ways, path.ends[0], path.ends[1], path.new)
    else:
        new = j - i + 1
        for k in range(i, j + 1):
            share = 1.0 - path.shares[0] if k == i else path.shares[1] if k == j else 1.0
            for c in range(legs.shape[1]):
                path.new[k - i, c] = share * legs[k, c]
        new = straighten_arm(ways, path.new, new, path.arm[()])
    made = 0
    for k in range(i + 1):
        made = join_leg(path.trial, made, legs[k], path.shares[0] if k == i else 1.0)
    for k in range(new):
        made = join_leg(path.trial, made, path.new[k], 1.0)
    for k in range(j, count):
        made = join_leg(path.trial, made, legs[k], 1.0 - path.shares[1] if k == j else 1.0)
    path.counts[1], path.counts[2] = new, made
    saved = -WORTH
    for k in range(count):
        saved += path.times[k]
    for k in range(made):
        saved -= leg_time(ways, path.trial[k]) + ways.pause[()]
    return 1 if saved > 0.0 else 0


@compiled
def take_trial(path: ShortenedPath) -> None:
    """Make the trial the path."""
    for k in range(path.counts[2]):
        copied(path.trial[k], path.legs[k])
    path.counts[0], path.known[()] = path.counts[2], 0


@compiled
def _proposed(blocks: Blocks, own: Blocks, which: int) -> int:
    """Cut the path anew for the first kind, and `propose` that one."""
    scene = views(MovedShapes, blocks.integers, blocks.floats, 0)
    trees = views(Trees, blocks.integers, blocks.floats, PLACE)
    path = views(ShortenedPath, own.integers, own.floats, 0)
    if which == WAY and cut(path, trees, scene.planar[()], scene.mimic_joints) == 0:
        return 0
    return 1 if path.parts[0] < path.parts[1] and propose(path, trees, which) == 1 else 0


@compiled
def _take(own: Blocks) -> None:
    take_trial(views(ShortenedPath, own.integers, own.floats, 0))


@compiled_without_gil
def _shorten(
    integers: Integers, floats: Array, own_integers: Integers, own_floats: Array, rounds: int
) -> None:
    """Make a path shorter, in so many rounds, where what takes a part's place is free."""
    scene, trees = views(MovedShapes, integers, floats, 0), views(Trees, integers, floats, PLACE)
    path = views(ShortenedPath, own_integers, own_floats, 0)
    end = scratch(path.start.shape[0])
    for _ in range(rounds):
        if path.counts[0] == 0:
            return
        if cut(path, trees, scene.planar[()], scene.mimic_joints) == 0:
            continue
        for which in range(2):
            if propose(path, trees, which) == 0:
                continue
            trees.looked[0] += 1
            if first_blocked(integers, floats, path.ends[0], path.new, path.counts[1], end) < 0:
                take_trial(path)
                break


_PROPOSED, _TAKE = int64(BLOCKS, BLOCKS, int64), void(BLOCKS)
_SHORTEN = void(*BLOCKS.types, *BLOCKS.types, int64)


def shortened(
    guide: Guide,
    start: Array,
    legs: Array,
    rounds: int,
    arm: int,
    blocked: Callable[[Array], bool] | None = None,
) -> Array:
    """A shorter path from start (n,): of two random points on it, the way between them in place of the
    path there, or the platform's path with the arm, a leg's numbers from `arm` on, straight between them.
    It is looked at in compiled code, or the whole path by `blocked`."""
    if not len(legs):
        return legs
    n = len(start)
    stop = float(guide.times(np.zeros((1, 3 + n)))[0])  # no leg takes less
    room = int(guide.times(legs).sum() / stop) + LEGS + 4
    rows = [np.zeros((room, 3 + n)) for _ in range(3)]
    rows[0][: len(legs)] = legs
    memory = Memory()
    memory.add(
        ShortenedPath(
            start=start,
            arm=np.array(arm, dtype=np.int64),
            legs=rows[0],
            new=rows[1],
            trial=rows[2],
            counts=np.array([len(legs), 0, 0], dtype=np.int64),
            corners=np.zeros((room + 1, n)),
            times=np.zeros(room),
            known=np.array(0, dtype=np.int64),
            parts=np.zeros(2, dtype=np.int64),
            shares=np.zeros(2),
            ends=np.zeros((2, n)),
        )
    )
    own = memory.blocks()
    path = views(ShortenedPath, *own, 0)
    if blocked is None:
        checked_by_caller(_shorten, _SHORTEN)(*guide.blocks, *own, rounds)
    else:
        proposed, take = checked_by_caller(_proposed, _PROPOSED), checked_by_caller(_take, _TAKE)
        for _ in range(rounds):
            for which in (WAY, STRAIGHT_ARM):
                if proposed(guide.blocks, own, which) and not blocked(path.trial[: path.counts[2]]):
                    take(own)
                    break
    return path.legs[: path.counts[0]]
