"""Look-ahead along the motion that inputs cause, and at the standing after it: where a pair first comes too
near."""

from collections.abc import Iterator
from typing import NamedTuple

import coal
import numpy as np

from nmm.base.arrays import Array
from nmm.base.kernels.compiled import checked_by_caller
from nmm.base.kernels.record_layout import BLOCKS, Memory, views
from nmm.base.kernels.signatures import float64, int64, void
from nmm.model.collisions import swept
from nmm.model.collisions.queries import Queries
from nmm.model.collisions.swept import BRAKING, DRIVEN, LOOKS, SweptMotion
from nmm.model.robots.joint_table import as_row
from nmm.model.robots.zero_order_hold import inputs_of

#: Obstacles with a path are looked at so often while the robot stands, s.
EVERY = 0.05
_FLAT, _STRIDED = float64[::1], float64[:, :]
_BOTH = (BLOCKS, BLOCKS)
_LIST = int64(*_BOTH, _STRIDED, _STRIDED, _STRIDED, _FLAT, _FLAT, *(float64,) * 3, int64)
_LAY = int64(BLOCKS, _FLAT, _FLAT, float64)
_UNSURE = int64(*_BOTH, *(int64,) * 3)
_SHARE = float64(_FLAT, _FLAT, _FLAT, float64)
_RENEW = void(*_BOTH, _STRIDED, _STRIDED, int64)


class Short(NamedTuple):
    """A pair that comes too near, by `by` m, `after` s from now at q (n,); weight : see `SweptMotion`."""

    pair: int
    after: float
    weight: float
    q: Array
    by: float


class SweptCheck:
    """Look-ahead for one robot among obstacles; `distance` to keep, and `target` in motion, m; obstacles with
    a path are looked at for `horizon` s. `changes` : by how much inputs can fall and rise per second, (2, m),
    or both alike, (m,)."""

    def __init__(
        self, queries: Queries, changes: Array, distance: float, target: float, horizon: float = 0.0
    ) -> None:
        self._queries, self._distance, self._target = queries, distance, target
        self._paths = [obstacle for _, obstacle in queries.moving if obstacle.moves]
        count = max(2, round(horizon / EVERY)) if self._paths and horizon else 0
        self._first: int | None = None
        memory = Memory()
        memory.add(_way(queries, changes, count))
        self._blocks = memory.blocks()
        self._way = views(SweptMotion, *self._blocks, 0)
        self._both = queries.blocks, self._blocks
        self._listed = 0
        self._share = checked_by_caller(swept.braking_share, _SHARE)
        self._list = checked_by_caller(swept.list_risky, _LIST)
        self._lay = checked_by_caller(swept.lay, _LAY)
        self._unsure = checked_by_caller(swept.unsure, _UNSURE)
        self._renew = checked_by_caller(swept.renew, _RENEW)

    def look_ahead(self, t: float) -> None:
        """Place obstacles with a path, for the listing of pairs, where they will be after t, s."""
        later, grid = self._way.later, self._way.grid
        if not len(later):
            return
        first = int(np.floor(t / EVERY)) + 1
        known = 0  # of the places that are still ahead
        if self._first is not None and first >= self._first:
            known = max(0, len(later) - (first - self._first))
        grid[:, :known] = grid[:, len(later) - known :].copy()
        for k in range(known, len(later)):
            for path, obstacle in enumerate(self._paths):
                grid[path, k] = as_row(obstacle.at((first + k) * EVERY))
        self._first = first
        later[:] = (first + np.arange(len(later))) * EVERY - t

    @property
    def sees_paths(self) -> bool:
        """Whether it looks at obstacles beyond the time that the robot takes to stop."""
        return len(self._way.later) > 0

    def slower(self, u: Array, dt: float) -> float:
        return float(self._share(self._way.falling, self._way.rising, u, dt))

    def list_risky(self, q_dot: Array, u: Array, dt: float, anew: bool) -> int:
        """Count the pairs that could come too near before the robot stands; `anew` forgets earlier ones."""
        queries = self._queries
        at = queries.results, queries.places, queries.J
        listed = 0 if anew else self._listed
        self._listed = self._list(*self._both, *at, q_dot, u, dt, self._distance, self._target, listed)
        return self._listed

    def list_obstacles(self) -> None:
        """List the pairs with obstacles too, however far they are."""
        scene = self._queries.scene
        own = self._queries.moving[0][0]
        more = np.flatnonzero((scene.pairs[:, 1] >= own) & (scene.watched == 0))
        scene.risky[self._listed : self._listed + len(more)] = more
        scene.watched[more] = 1
        self._listed += len(more)

    def first_short(self, t: float, q: Array, u: Array, dt: float) -> Short | None:
        """Where a listed pair first comes too near while u lasts for dt and then brakes, if anywhere: the
        worst of consecutive looks while it gets worse."""
        worst: Short | None = None
        seen = -1
        for look, short in self._shorts(t, q, u, dt):
            if worst is not None and look > seen + 1:
                break
            if short is not None and (worst is None or short.by > worst.by):
                worst, seen = short, look
        return worst

    def contact(self, t: float, q: Array, u: Array, dt: float, driven: Array, lasts: float) -> float:
        """How long after t a listed pair first comes too near, s, while u lasts for dt, then changes towards
        `driven` (m,) for `lasts` s and brakes; infinite if none does."""
        way = self._way
        way.driven[:], way.lasts[()] = driven, lasts
        times = (short.after for _, short in self._shorts(t, q, u, dt, roughly=True) if short is not None)
        first = next(times, np.inf)
        way.lasts[()] = 0.0
        return first

    def _shorts(
        self, t: float, q: Array, u: Array, dt: float, roughly: bool = False
    ) -> Iterator[tuple[int, Short | None]]:
        """The looks at which a pair was not surely far enough, with what was found there, in order."""
        queries, ahead, scene = self._queries, self._way, self._queries.scene
        looks = self._lay(self._blocks, q, u, dt)
        if roughly:  # paths are straight from one known place to the next
            k = np.clip(np.searchsorted(ahead.later, ahead.after[:looks]), 1, len(ahead.later) - 1)
            share = (ahead.after[:looks] - ahead.later[k - 1]) / EVERY
            ahead.paths[:, :looks] = ahead.grid[:, k - 1] + share[:, np.newaxis] * (
                ahead.grid[:, k] - ahead.grid[:, k - 1]
            )
        else:
            self._follow_paths(t, looks)
        look, first = 0, 0
        while (index := self._unsure(*self._both, self._listed, look, first)) >= 0:
            look, first = divmod(index, len(scene.kept))
            pair, after = int(scene.risky[first]), float(ahead.after[look])
            (d,) = queries.distances(t + after, ahead.q[look], [pair])
            self._renew(*self._both, queries.results, queries.places, pair)
            by = float(scene.kept[pair] - d)
            at_contact = float(ahead.weight[look]), ahead.q[look].copy()
            yield look, Short(pair, after, *at_contact, by) if by > 0.0 else None
            first += 1

    def _follow_paths(self, t: float, looks: int) -> None:
        """Place obstacles that move along a path, where one of their pairs is listed."""
        ahead, scene = self._way, self._queries.scene
        if not len(ahead.paths):
            return
        shapes = {*scene.pairs[scene.risky[: self._listed], 1].tolist()}
        for i, obstacle in self._queries.moving:
            if obstacle.moves and i in shapes:
                stands, path = int(ahead.stands), ahead.path[i]
                for k in range(stands):
                    ahead.paths[path, k] = as_row(obstacle.at(t + float(ahead.after[k])))
                known = ahead.grid.shape[1]
                ahead.paths[path, stands:looks] = ahead.grid[path, known - (looks - stands) :]


def _way(queries: Queries, changes: Array, standing: int) -> SweptMotion:
    objects, robot = queries.shapes.geometryObjects, queries.robot
    scene, L = queries.scene, LOOKS + DRIVEN + BRAKING + 1 + standing
    turned = robot.joint_axes
    falling, rising = np.array(np.broadcast_to(changes, (2, robot.n_u)))
    carrier = np.array([shape.parentJoint for shape in objects], dtype=np.int64)
    path = np.full(len(objects), -2)
    moving = 0
    for i, obstacle in queries.moving:
        carrier[i], path[i] = 0, moving if obstacle.moves else -1
        moving += obstacle.moves
    planes = np.full((len(scene.pairs), 2, 4), np.inf)
    below = scene.pairs[:, 1] >= scene.planes
    planes[below, 1] = scene.boxes[scene.pairs[below, 1], :4]
    discs = [shape.geometry.radius if isinstance(shape.geometry, coal.Cylinder) else 0.0 for shape in objects]
    return SweptMotion(
        joints=robot.joints,
        inputs=inputs_of(robot),
        falling=falling,
        rising=rising,
        driven=np.zeros(robot.n_u),
        lasts=np.array(0.0),
        carrier=carrier,
        place=np.array([as_row(turned[shape.parentJoint].inverse() * shape.placement) for shape in objects]),
        path=path,
        paths=np.zeros((moving, L, 12)),
        disc=np.array(discs),
        later=np.zeros(standing),
        grid=np.zeros((moving, standing, 12)),
        planes=planes,
        looks=np.array(0, dtype=np.int64),
        stands=np.array(0, dtype=np.int64),
        after=np.zeros(L),
        weight=np.zeros(L),
        q=np.zeros((L, robot.n)),
    )
