"""Looking along the way that inputs make: where which pair first comes too near."""

from __future__ import annotations

from typing import NamedTuple

import coal
import numpy as np
from numba import types

from nmm.arrays import Array, Integers
from nmm.collisions import way
from nmm.collisions.near import Scene
from nmm.collisions.queries import Queries
from nmm.collisions.way import BRAKING, LOOKS, Way
from nmm.kernels.compiled import checked_by_caller, compiled
from nmm.kernels.memory import Memory, views
from nmm.robots.held import inputs_of
from nmm.robots.joint_table import as_row

_FLAT, _INTEGERS, _STRIDED = types.float64[::1], types.int64[::1], types.float64[:, :]
_BOTH = (_INTEGERS, _FLAT, _INTEGERS, _FLAT)
_LIST = types.int64(*_BOTH, _STRIDED, _STRIDED, _STRIDED, _FLAT, _FLAT, *(types.float64,) * 3, types.int64)
_LAY = types.int64(_INTEGERS, _FLAT, _FLAT, _FLAT, types.float64)
_UNSURE = types.int64(*_BOTH, *(types.int64,) * 3)
_RENEW = types.void(*_BOTH, _STRIDED, _STRIDED, types.int64)


@compiled
def _list(
    integers: Integers,
    floats: Array,
    way_integers: Integers,
    way_floats: Array,
    results: Array,
    places: Array,
    J: Array,
    q_dot: Array,
    u: Array,
    dt: float,
    asked: float,
    target: float,
    listed: int,
) -> int:
    scene, ahead = views(Scene, integers, floats, 0), views(Way, way_integers, way_floats, 0)
    if listed == 0:
        way.allow(scene, asked, target)
        for i in range(ahead.carrier.shape[0]):
            if ahead.path[i] == -1:
                for k in range(12):
                    ahead.place[i, k] = places[i, k]
    time = dt + 0.5 * dt / way.braking_share(ahead.deceleration, u, dt)
    return way.list_risky(scene, ahead, results, places, J, q_dot, time, listed)


@compiled
def _lay(way_integers: Integers, way_floats: Array, q: Array, u: Array, dt: float) -> int:
    return way.lay(views(Way, way_integers, way_floats, 0), q, u, dt)


@compiled
def _unsure(
    integers: Integers,
    floats: Array,
    way_integers: Integers,
    way_floats: Array,
    listed: int,
    look: int,
    first: int,
) -> int:
    return way.unsure(
        views(Scene, integers, floats, 0), views(Way, way_integers, way_floats, 0), listed, look, first
    )


@compiled
def _renew(
    integers: Integers,
    floats: Array,
    way_integers: Integers,
    way_floats: Array,
    results: Array,
    places: Array,
    pair: int,
) -> None:
    scene = views(Scene, integers, floats, 0)
    way.renew(scene, views(Way, way_integers, way_floats, 0), results, places, pair)


class Short(NamedTuple):
    """A pair that comes too near.

    after : s from now; weight : for how long the inputs would have gone as far, s
    q (n,) : where; by : m
    """

    pair: int
    after: float
    weight: float
    q: Array
    by: float


class Lookout:
    """What looks ahead for one robot among obstacles.

    Parameters
    ----------
    queries : its shapes, and what measures distances
    deceleration : (m,) by how much inputs can change a second; infinite where nothing says so
    distance : asked for, m; target : what ways have to keep, m
    """

    def __init__(self, queries: Queries, deceleration: Array, distance: float, target: float) -> None:
        self._queries, self._distance, self._target = queries, distance, target
        memory = Memory()
        memory.add(_way(queries, deceleration))
        self._blocks = memory.blocks()
        self._way = views(Way, *self._blocks, 0)
        self._both = (*queries.blocks, *self._blocks)
        self._listed = 0
        self._list = checked_by_caller(_list, _LIST)
        self._lay = checked_by_caller(_lay, _LAY)
        self._unsure = checked_by_caller(_unsure, _UNSURE)
        self._renew = checked_by_caller(_renew, _RENEW)

    def slower(self, u: Array, dt: float) -> float:
        """See `way.braking_share`."""
        return float(way.braking_share(self._way.deceleration, u, dt))

    def list_risky(self, q_dot: Array, u: Array, dt: float, anew: bool) -> int:
        """How many pairs could come nearer than they may before the robot stands, with those of before."""
        queries = self._queries
        at = queries.results, queries.places, queries.J
        listed = 0 if anew else self._listed
        self._listed = self._list(*self._both, *at, q_dot, u, dt, self._distance, self._target, listed)
        return self._listed

    def first_short(self, t: float, q: Array, u: Array, dt: float) -> Short | None:
        """Where a listed pair first comes too near on the way that u makes, dt with u, then braking; by how
        much, there and as long as it becomes more from look to look."""
        queries, ahead, scene = self._queries, self._way, self._queries.scene
        looks = self._lay(*self._blocks, q, u, dt)
        self._follow_paths(t, looks)
        worst: Short | None = None
        look, first, seen = 0, 0, -1
        while (found := self._unsure(*self._both, self._listed, look, first)) >= 0:
            look, first = divmod(found, len(scene.kept))
            if worst is not None and look > seen + 1:
                break
            pair, after = int(scene.risky[first]), float(ahead.after[look])
            (d,) = queries.distances(t + after, ahead.q[look], [pair])
            self._renew(*self._both, queries.results, queries.places, pair)
            by = float(scene.kept[pair] - d)
            if by > 0.0 and (worst is None or by > worst.by):
                worst = Short(pair, after, float(ahead.weight[look]), ahead.q[look].copy(), by)
                seen = look
            first += 1
        return worst

    def _follow_paths(self, t: float, looks: int) -> None:
        """Where obstacles that move along a path will be, if a pair of one is listed."""
        ahead, scene = self._way, self._queries.scene
        if not len(ahead.paths):
            return
        shapes = {*scene.pairs[scene.risky[: self._listed], 1].tolist()}
        for i, obstacle in self._queries.moving:
            if obstacle.moves and i in shapes:
                for k in range(looks):
                    ahead.paths[ahead.path[i], k] = as_row(obstacle.at(t + float(ahead.after[k])))


def _way(queries: Queries, deceleration: Array) -> Way:
    objects, robot = queries.shapes.geometryObjects, queries.robot
    scene, L = queries.scene, LOOKS + BRAKING + 1
    turned = robot.joint_axes
    carrier = np.array([shape.parentJoint for shape in objects], dtype=np.int64)
    path = np.full(len(objects), -2)
    moving = 0
    for i, obstacle in queries.moving:
        carrier[i], path[i] = 0, moving if obstacle.moves else -1
        moving += obstacle.moves
    planes = np.full((len(scene.pairs), 2, 4), np.inf)
    for k, (_, j) in enumerate(scene.pairs):
        if j >= scene.planes:
            planes[k, 1] = scene.boxes[j, :4]
    return Way(
        joints=robot.joints,
        inputs=inputs_of(robot),
        deceleration=deceleration,
        carrier=carrier,
        place=np.array([as_row(turned[shape.parentJoint].inverse() * shape.placement) for shape in objects]),
        path=path,
        paths=np.zeros((moving, L, 12)),
        disc=np.array(
            [shape.geometry.radius if isinstance(shape.geometry, coal.Cylinder) else 0.0 for shape in objects]
        ),
        planes=planes,
        looks=np.array(0, dtype=np.int64),
        after=np.zeros(L),
        weight=np.zeros(L),
        q=np.zeros((L, robot.n)),
    )
