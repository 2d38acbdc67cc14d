"""What is drawn of a run's tasks: the frame that they position, where they want it, what they look at."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from nmm.base.arrays import Array
from nmm.base.errors import expect
from nmm.control.functions.function import Function, Shown
from nmm.control.functions.tasks.position import AXES
from nmm.control.functions.tasks.task import Task
from nmm.model.robots.frame_path import FramePath
from nmm.model.robots.robot import Robot


class ShownFrame(NamedTuple):
    """The frame that tasks position, else turn; the row of each world axis; a point to look at, (2,) or (3,)
    m."""

    frame: str | None
    rows: dict[int, int]
    target: Array | None

    def path(self, robot: Robot, q: Array) -> Array | None:
        return None if self.frame is None else FramePath(robot, self.frame).positions(q)

    def desired(self, path: Array, r_d: Array) -> Array:
        """Where r_d (N, s) puts the frame, (N, 3) m; `path` along axes and at times without a task."""
        desired = path.copy()
        for axis, row in self.rows.items():
            known = np.isfinite(r_d[:, row])
            desired[known, axis] = r_d[known, row]
        return desired

    def mark(self, path: Array | None) -> Array | None:
        """The point looked at, (3,) m; a planar one at the frame's initial height."""
        if self.target is None or path is None:
            return None
        return np.array([*self.target, path[0, 2]]) if len(path) and self.target.size == 2 else self.target


def shown_frame(tasks: Iterable[Task], robot: Robot) -> ShownFrame:
    """What tasks show of themselves; `InputError` for what cannot be drawn."""
    frame: str | None = None
    turned: str | None = None
    target: Array | None = None
    rows: dict[int, int] = {}
    row = 0
    for task in tasks:
        count = len(task.function.rows(robot))
        shown = _shown(task.function, robot, count)
        if shown.positions is not None and frame in (None, shown.positions):
            frame = shown.positions
            rows |= {AXES[axis]: row + i for axis, i in shown.axes.items()}
        turned = turned or shown.turns
        for part in (_shown(task.reference, robot, count), shown):
            target = target if part.looks_at is None else np.array(part.looks_at, dtype=np.float64)
        row += count
    return ShownFrame(frame or turned, rows, target)


def _shown(function: Function, robot: Robot, rows: int) -> Shown:
    """What the function shows, validated before the run."""
    shown, name = function.shown(), f"{type(function).__name__}.shown"
    for frame in (shown.positions, shown.turns):
        if frame is not None:
            robot.frame_id(frame)
    fits = all(axis in AXES and row in range(rows) for axis, row in shown.axes.items())
    expect(fits, name, f"axes from x, y, z with rows from 0 to {rows - 1}", dict(shown.axes))
    fits = len(shown.rotation) in (0, 3) and all(row in range(rows) for row in shown.rotation)
    expect(fits, name, f"three rows from 0 to {rows - 1} as rotation, or none", shown.rotation)
    fits = shown.looks_at is None or np.shape(shown.looks_at) in ((2,), (3,))
    expect(fits, name, "2 or 3 numbers as looks_at", shown.looks_at)
    return shown
