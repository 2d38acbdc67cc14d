"""A path among obstacles that move: when to wait on it and when to go slower, so that none comes too near.

The path is given, its timing is looked for (path-velocity decomposition: K. Kant, S. W. Zucker, Toward
efficient trajectory planning, 1986). It is cut into cells, and for each cell and interval of time it is
known whether the robot may be there: with bounds of how far it moves within the cell, and obstacles within
the interval. What is reached is kept for places to rest and times, as in safe interval path planning
(M. Phillips, M. Likhachev, 2011).
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from nmm.base.arrays import Array
from nmm.base.kernels.record_layout import views
from nmm.model.collisions.obstacle import shifts
from nmm.model.collisions.scene import Scene
from nmm.model.robots.joint_table import as_row
from nmm.model.robots.robot import Robot
from nmm.plugins.planning.collisions.legs_check import MovedShapes
from nmm.plugins.planning.collisions.motion_check import MotionCheck
from nmm.plugins.planning.timing import TimedLegs

#: Interval of time, s, and parts of it that are looked at alone where need be.
STEP, PARTS = 0.1, 4
#: What is looked at: so many s, and so many times the path's own time.
LONG, TIMES = 30.0, 3.0
#: Between two places to rest pass at least so many s; at most so many pieces a leg; cells are so long, m.
REST, PIECES, CELL = 0.8, 6, 0.06
#: Shares of a leg's own speed.
PACES = (1.0, 0.6, 0.3)


class Drive(NamedTuple):
    """From one place to rest to another along a leg: from share `a` to `b` of it, with its largest rates of
    the share; when it is at the borders of the cells between, s."""

    leg: int
    a: float
    b: float
    speed: float
    acceleration: float
    braking: float
    passes: Array


def waited(path: TimedLegs, robot: Robot, scene: Scene) -> tuple[TimedLegs | None, int]:
    """The path in the earliest timing that keeps its distance of a scene's moving obstacles, at its end for
    as long as is looked ahead, or None where there is none; and how many timings of drives between two places
    to rest were looked at."""
    looked = 0
    if not len(path.legs):
        return path, looked
    rooms = _Rooms(robot, scene, LONG + TIMES * path.duration)
    rests = [(0, 0.0)]
    cells: list[tuple[int, Array]] = []  # between two places to rest: the leg, and shares of it
    for k, leg in enumerate(path.legs):
        takes = path.stops[k + 1] - path.stops[k]
        pieces = int(np.clip(takes / REST, 1, PIECES))
        count = max(1, int(np.ceil(rooms.way(leg).max(initial=0.0) / (CELL * pieces))))
        for a in np.arange(pieces) / pieces:
            cells.append((k, a + np.linspace(0.0, 1.0 / pieces, count + 1)))
            rests.append((k, cells[-1][1][-1]))
    K = rooms.count
    taken = [
        np.array(
            [
                rooms.taken(_at(path, k, 0.5 * (a + b)), 0.5 * (b - a) * path.legs[k])
                for a, b in pairwise(shares)
            ]
        )
        for k, shares in cells
    ]
    still = [rooms.taken(_at(path, *rest), 0.0 * path.legs[0]) for rest in rests]
    reached = np.zeros((len(rests), K + 1), dtype=bool)
    before: dict[tuple[int, int], tuple[int, int, Drive]] = {}
    reached[0, 0] = True
    for i in range(len(rests)):
        for k in range(K):  # it waits where nothing comes
            reached[i, k + 1] |= reached[i, k] and not still[i][k]
        for j, drive in _drives(path, cells, i):
            free = rooms.free(np.vstack(taken[i:j]), drive.passes)
            after = int(np.ceil(drive.passes[-1] / STEP - 1e-9))
            looked += int(np.count_nonzero(reached[i, : K - after]))
            begins = np.flatnonzero(reached[i, : K - after] & free[: K - after])
            for k in begins[~reached[j, begins + after]].tolist():
                reached[j, k + after], before[j, k + after] = True, (i, k, drive)
    stays = np.append(~np.logical_or.accumulate(still[-1][::-1])[::-1], True)
    (ends,) = np.nonzero(reached[-1] & stays)
    return (_timing(path, before, len(rests) - 1, int(ends[0])) if len(ends) else None), looked


def _at(path: TimedLegs, leg: int, share: float) -> Array:
    return path.guide.at(path.corners[leg], path.legs[leg], share)


def _drives(path: TimedLegs, cells: list[tuple[int, Array]], i: int) -> Iterator[tuple[int, Drive]]:
    """Drives from the place i, each with the place where it ends."""
    j = i
    while j < len(cells) and cells[j][0] == cells[i][0]:
        j += 1
        leg, a, b = cells[i][0], cells[i][1][0], cells[j - 1][1][-1]
        borders = np.concatenate([cells[i][1], *(shares[1:] for _, shares in cells[i + 1 : j])]) - a
        V, A, B = float(path.speed[leg]), float(path.acceleration[leg]), float(path.braking[leg])
        way = float(b - a)
        V = min(V, np.sqrt(2.0 * way / (1.0 / A + 1.0 / B)) if np.isfinite(min(A, B)) else np.inf)
        rise, fall = V / A, V / B
        to_end = np.maximum(way - borders, 0.0)
        passes = 0.5 * rise + borders / V
        if rise > 0.0:
            passes = np.where(borders < 0.5 * V * rise, np.sqrt(2.0 * borders / A), passes)
        if fall > 0.0:
            last = way / V + 0.5 * (rise + fall)
            passes = np.where(to_end < 0.5 * V * fall, last - np.sqrt(2.0 * to_end / B), passes)
        for pace in PACES:
            yield j, Drive(leg, a, b, pace * V, pace * pace * A, pace * pace * B, passes / pace)


def _timing(
    path: TimedLegs, before: dict[tuple[int, int], tuple[int, int, Drive]], i: int, k: int
) -> TimedLegs:
    """The timing that is at the place i at interval k, from its drives."""
    rows: list[tuple[Array, Array, float, float, float, float]] = []
    nothing = np.zeros(path.legs.shape[1]), np.zeros(path.inputs.shape[1])
    end = k * STEP
    while True:
        while (i, k) not in before and k > 0:
            k -= 1
        i_before, begun, drive = before.get((i, k), (0, 0, None))
        arrives = 0.0 if drive is None else begun * STEP + float(drive.passes[-1])
        if end - arrives > 1e-9:
            rows.append((*nothing, 1.0 / (end - arrives), np.inf, np.inf, end))
        if drive is None:
            break
        share = drive.b - drive.a
        legs, inputs = share * path.legs[drive.leg], share * path.inputs[drive.leg]
        speed, acceleration, braking = (
            rate / share for rate in (drive.speed, drive.acceleration, drive.braking)
        )
        rows.append((legs, inputs, speed, acceleration, braking, arrives))
        i, k, end = i_before, begun, begun * STEP
    legs, inputs, fast, rises, falls, stops = (np.array(column) for column in zip(*rows[::-1], strict=True))
    corners = path.guide.corners(path.corners[0], legs)
    return TimedLegs(path.guide, legs, corners, inputs, fast, rises, falls, np.append(0.0, stops))


class _Rooms:
    """Whether the robot may be somewhere at a time."""

    def __init__(self, robot: Robot, scene: Scene, duration: float) -> None:
        self._check = MotionCheck(robot, scene)
        self._shapes = views(MovedShapes, *self._check.blocks, 0)
        self._kept = self._shapes.kept.copy()
        self.count = int(np.ceil(duration / STEP))
        count = 2 * PARTS * self.count
        times = np.linspace(0.0, self.count * STEP, count + 1)  # ends and middles of the parts
        first = len(scene.queries.shapes.geometryObjects) - len(scene.obstacles)
        self._shape = self._shapes.shapes.pairs[:, 1] - first
        self._places = np.array(
            [[as_row(obstacle.at(float(t))) for obstacle in scene.obstacles] for t in times]
        )
        far = np.array([shifts([obstacle], times) for obstacle in scene.obstacles]).T
        self._gone = np.vstack([np.zeros(len(scene.obstacles)), np.cumsum(far, axis=0)])
        self._movers = np.arange(first, first + len(scene.obstacles))

    def way(self, leg: Array) -> Array:
        """How far the robot's shapes of each pair move on a leg at most, (P,), m."""
        sizes = np.abs(leg)
        sizes[:2] = np.hypot(*leg[:2]), 0.0
        return self._shapes.levers @ sizes

    def taken(self, q: Array, leg: Array) -> Array:
        """For each interval, whether the robot at q (n,), give or take a leg, comes too near."""
        occupied = np.zeros(self.count, dtype=bool)
        self._look(q, self._kept + self.way(leg), 0, PARTS * self.count, occupied)
        return occupied

    def _look(self, q: Array, distances: Array, begin: int, end: int, occupied: Array) -> None:
        middle = begin + end  # in halves of the parts
        gone = self._gone
        far = np.maximum(gone[2 * end] - gone[middle], gone[middle] - gone[2 * begin])
        self._shapes.place[self._movers] = self._places[middle]
        self._shapes.kept[:] = distances + far[self._shape]
        if self._check.too_near(q) < 0:
            return
        if end - begin == 1:
            occupied[begin // PARTS] = True
            return
        half = (begin + end) // 2
        self._look(q, distances, begin, half, occupied)
        self._look(q, distances, half, end, occupied)

    def free(self, taken: Array, passes: Array) -> Array:
        """Whether a drive over cells (C, K), at their borders after `passes` (C + 1,), s, may begin at the
        beginnings of the intervals (K,); it rests where it ends until the next one begins."""
        K = self.count
        so_far = np.hstack([np.zeros((len(taken), 1), dtype=np.int64), np.cumsum(taken, axis=1)])
        first = np.floor(passes[:-1] / STEP + 1e-9).astype(int)
        last = np.ceil(passes[1:] / STEP - 1e-9).astype(int)
        last[-1] = max(last[-1], int(np.ceil(passes[-1] / STEP - 1e-9)))
        k = np.arange(K)
        free = np.ones(K, dtype=bool)
        for c in range(len(taken)):
            free &= so_far[c, np.minimum(k + last[c], K)] == so_far[c, np.minimum(k + first[c], K)]
        return free
