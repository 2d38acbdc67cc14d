"""Look-ahead along the motion that inputs cause: where a pair first comes too near."""

from typing import NamedTuple

import coal
import numpy as np
from numba import types

from nmm.arrays import Array
from nmm.collisions import swept
from nmm.collisions.queries import Queries
from nmm.collisions.swept import BRAKING, LOOKS, SweptMotion
from nmm.kernels.compiled import checked_by_caller
from nmm.kernels.record_layout import BLOCKS, Memory, views
from nmm.robots.joint_table import as_row
from nmm.robots.zero_order_hold import inputs_of

_FLAT, _STRIDED = types.float64[::1], types.float64[:, :]
_BOTH = (BLOCKS, BLOCKS)
_LIST = types.int64(*_BOTH, _STRIDED, _STRIDED, _STRIDED, _FLAT, _FLAT, *(types.float64,) * 3, types.int64)
_LAY = types.int64(BLOCKS, _FLAT, _FLAT, types.float64)
_UNSURE = types.int64(*_BOTH, *(types.int64,) * 3)
_SHARE = types.float64(_FLAT, _FLAT, types.float64)
_RENEW = types.void(*_BOTH, _STRIDED, _STRIDED, types.int64)


class Short(NamedTuple):
    """A pair that comes too near, by `by` m, `after` s from now at q (n,); weight : see `SweptMotion`."""

    pair: int
    after: float
    weight: float
    q: Array
    by: float


class SweptCheck:
    """Look-ahead for one robot among obstacles; `distance` to keep, and `target` in motion, m."""

    def __init__(self, queries: Queries, deceleration: Array, distance: float, target: float) -> None:
        self._queries, self._distance, self._target = queries, distance, target
        memory = Memory()
        memory.add(_way(queries, deceleration))
        self._blocks = memory.blocks()
        self._way = views(SweptMotion, *self._blocks, 0)
        self._both = queries.blocks, self._blocks
        self._listed = 0
        self._share = checked_by_caller(swept.braking_share, _SHARE)
        self._list = checked_by_caller(swept.list_risky, _LIST)
        self._lay = checked_by_caller(swept.lay, _LAY)
        self._unsure = checked_by_caller(swept.unsure, _UNSURE)
        self._renew = checked_by_caller(swept.renew, _RENEW)

    def slower(self, u: Array, dt: float) -> float:
        return float(self._share(self._way.deceleration, u, dt))

    def list_risky(self, q_dot: Array, u: Array, dt: float, anew: bool) -> int:
        """Count the pairs that could come too near before the robot stands; `anew` forgets earlier ones."""
        queries = self._queries
        at = queries.results, queries.places, queries.J
        listed = 0 if anew else self._listed
        self._listed = self._list(*self._both, *at, q_dot, u, dt, self._distance, self._target, listed)
        return self._listed

    def first_short(self, t: float, q: Array, u: Array, dt: float) -> Short | None:
        """Where a listed pair first comes too near while u lasts for dt and then brakes, if anywhere: the
        worst of consecutive looks while it gets worse."""
        queries, ahead, scene = self._queries, self._way, self._queries.scene
        looks = self._lay(self._blocks, q, u, dt)
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
        """Place obstacles that move along a path, where one of their pairs is listed."""
        ahead, scene = self._way, self._queries.scene
        if not len(ahead.paths):
            return
        shapes = {*scene.pairs[scene.risky[: self._listed], 1].tolist()}
        for i, obstacle in self._queries.moving:
            if obstacle.moves and i in shapes:
                for k in range(looks):
                    ahead.paths[ahead.path[i], k] = as_row(obstacle.at(t + float(ahead.after[k])))


def _way(queries: Queries, deceleration: Array) -> SweptMotion:
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
    below = scene.pairs[:, 1] >= scene.planes
    planes[below, 1] = scene.boxes[scene.pairs[below, 1], :4]
    discs = [one.geometry.radius if isinstance(one.geometry, coal.Cylinder) else 0.0 for one in objects]
    return SweptMotion(
        joints=robot.joints,
        inputs=inputs_of(robot),
        deceleration=deceleration,
        carrier=carrier,
        place=np.array([as_row(turned[shape.parentJoint].inverse() * shape.placement) for shape in objects]),
        path=path,
        paths=np.zeros((moving, L, 12)),
        disc=np.array(discs),
        planes=planes,
        looks=np.array(0, dtype=np.int64),
        after=np.zeros(L),
        weight=np.zeros(L),
        q=np.zeros((L, robot.n)),
    )
