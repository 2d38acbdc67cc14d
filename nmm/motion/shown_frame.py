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
            said = np.isfinite(r_d[:, row])
            desired[said, axis] = r_d[said, row]
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
        count = len(task.rows(robot))
        said = _said(task.function, robot, count)
        if said.positions is not None and frame in (None, said.positions):
            frame = said.positions
            rows |= {AXES[axis]: row + i for axis, i in said.axes.items()}
        turned = turned or said.turns
        for part in (_said(task.reference, robot, count), said):
            target = target if part.looks_at is None else np.array(part.looks_at, dtype=np.float64)
        row += count
    return ShownFrame(frame or turned, rows, target)


def _said(function: Function, robot: Robot, rows: int) -> Shown:
    """What the function shows, validated before the run."""
    said, name = function.shown(), f"{type(function).__name__}.shown"
    for frame in (said.positions, said.turns):
        if frame is not None:
            robot.frame_id(frame)
    fits = all(axis in AXES and row in range(rows) for axis, row in said.axes.items())
    expect(fits, name, f"axes from x, y, z with rows from 0 to {rows - 1}", dict(said.axes))
    fits = len(said.rotation) in (0, 3) and all(row in range(rows) for row in said.rotation)
    expect(fits, name, f"three rows from 0 to {rows - 1} as rotation, or none", said.rotation)
    fits = said.looks_at is None or np.shape(said.looks_at) in ((2,), (3,))
    expect(fits, name, "2 or 3 numbers as looks_at", said.looks_at)
    return said
