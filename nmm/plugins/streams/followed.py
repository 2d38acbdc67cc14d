"""What a controller's tasks show of themselves while it runs, for another thread than its own."""

from __future__ import annotations

from typing import Any

import numpy as np

from nmm.base.arrays import Array
from nmm.base.findings import Finding
from nmm.control.controller import Controller
from nmm.control.sequencing.sequence import Event
from nmm.model.robots.frame_path import FramePath
from nmm.motion.joining import row_names
from nmm.motion.shown_frame import shown_frame
from nmm.plugins.streams.pictures import Near
from nmm.plugins.streams.robot_scene import Sample


class Followed:
    """The rows of all tasks of a controller, the frame that they position, and distances, measured anew in a
    scene of its own.

    errors : names and units of the rows
    """

    def __init__(self, controller: Controller) -> None:
        self.robot, self._schedule = controller.robot, controller.schedule
        tasks = controller.solver.tasks_on if self._schedule is None else self._schedule.tasks_on
        names = [row.name for row in tasks.rows] if self._schedule is None else row_names(self._schedule)
        self.errors = [*zip(names, (row.unit for row in tasks.rows), strict=True)]
        self._counts = np.array([*map(len, tasks.each)], dtype=int)
        self._shown = shown_frame(tasks.stack, self.robot)
        frame = self._shown.frame
        self._path = None if frame is None else FramePath(self.robot, frame)
        collisions = controller.given.collisions
        self._scene = None if collisions is None else collisions.on(self.robot)
        self.obstacles = () if collisions is None else tuple(collisions.obstacles)

    def active(self) -> tuple[bool, ...] | None:
        """The tasks that are active now; None for all."""
        return None if self._schedule is None else self._schedule.moment.active

    def events(self) -> list[Event]:
        """Tasks that began and ended up to now."""
        return [] if self._schedule is None else [*self._schedule.events]

    def marks(self, q: Array) -> Array | None:
        """The point that tasks look at, (1, 3) m, from q (n,)."""
        mark = self._shown.mark(None if self._path is None else self._path.positions(q[np.newaxis]))
        return None if mark is None else mark[np.newaxis]

    def sample(
        self,
        t: float,
        stamp: int,
        q: Array,
        u: Array,
        error: Array,
        r_d: Array,
        active: tuple[bool, ...] | None,
        seen: Array | None = None,
    ) -> Sample:
        """A sample, of the error and the targets of the rows that are active."""
        reached = wanted = None
        if self._path is not None:
            path = self._path.positions(q[np.newaxis])
            reached = path[0]
            if self._shown.rows:
                targets = self._of_all(r_d, active)
                known = np.isfinite(targets[[*self._shown.rows.values()]]).all()
                wanted = self._shown.desired(path, targets[np.newaxis])[0] if known else None
        errors = self._of_all(error, active)
        return Sample(t, stamp, q, u, errors, seen, reached, wanted, self._near(t, q))

    def _of_all(self, own: Array, active: tuple[bool, ...] | None) -> Array:
        """Numbers of the active rows among those of all, NaN where a task is not active."""
        count = int(self._counts.sum())
        on = np.ones(count, dtype=bool) if active is None else np.repeat(np.array(active), self._counts)
        whole = np.full(count, np.nan)
        whole[on] = own[: int(on.sum())]  # without a task there is a row of its own
        return whole

    def _near(self, t: float, q: Array) -> Near | None:
        if self._scene is None:
            return None
        queries = self._scene.queries
        queries.renew()
        distance, pair = queries.nearest(t, q)
        return near(distance, pair, queries.results[pair, 1:], self._scene.words(pair))


def near(distance: float, pair: int, normal_and_points: Array, words: str) -> Near | None:
    """The nearest points of a pair, without points where only a bound is known (there is no normal)."""
    if pair < 0 or not np.isfinite(distance):
        return None
    points = normal_and_points[3:].reshape(2, 3).copy() if np.any(normal_and_points[:3]) else None
    return Near(points, float(distance), words)


def words_of(event: Event) -> str:
    return f"{event.what}: {event.why}" if event.why else event.what


def identity(finding: Finding) -> Any:
    """What tells one finding from another while their numbers grow."""
    return finding.code, finding.where.get("t")
