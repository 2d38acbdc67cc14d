"""What cameras see in a run: points, where the task wants them in the picture, and its border."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

import numpy as np

from nmm.base.arrays import Array
from nmm.base.errors import expect
from nmm.control.functions.function import Function, Sight
from nmm.control.functions.program import Program
from nmm.control.functions.tasks.image import optical_frame
from nmm.control.functions.tasks.task import Task
from nmm.control.limits.limit import Limit
from nmm.control.limits.limits import Limits
from nmm.model.robots.motion import NORMALISED, PICTURE, Camera
from nmm.model.robots.robot import Robot


class GoalRows(NamedTuple):
    """The rows of the task that place a camera's point in its picture, and the intrinsics of these rows."""

    point: int
    x: int
    y: int
    intrinsics: tuple[float, float, float, float]


class RunCamera(NamedTuple):
    """A camera of a run.

    frame : the camera's
    points : its points among those of the run's `seen`
    goals : the rows that place them
    border : x and y of the picture's upper left corner, then of the lower right one, normalised
    bounded : whether limits keep points within the border
    intrinsics : fx, fy, cx, cy, px, in which the picture is read; 1, 1, 0, 0 for normalised coordinates
    lines : pairs of its points whose line is seen
    """

    frame: str
    points: tuple[int, ...]
    goals: tuple[GoalRows, ...] = ()
    border: tuple[float, float, float, float] = PICTURE
    bounded: bool = False
    intrinsics: tuple[float, float, float, float] = NORMALISED
    lines: tuple[tuple[int, int], ...] = ()

    def as_json(self) -> dict[str, Any]:
        return {**self._asdict(), "goals": [goal._asdict() for goal in self.goals]}

    def on(self, seen: Array, r_d: Array) -> Camera:
        """What it sees of `seen` (N, K, 3), m, with targets r_d (N, s) of the task."""
        goals = np.full((len(seen), len(self.points), 2), np.nan)
        for point, x, y, (fx, fy, cx, cy) in self.goals:
            goals[:, point] = (r_d[:, [x, y]] - [cx, cy]) / [fx, fy]
        points = seen[:, list(self.points)]
        return Camera(self.frame, points, goals, self.border, self.bounded, self.intrinsics, self.lines)


class SeenPoints:
    """The points that the cameras of tasks and limits see, each once, and the cameras; `calls_python` tells
    whether users' functions say where they are. Points that are set from outside are none, unless they are
    looked at `live`: afterwards nobody knows where they were.

    Raises
    ------
    InputError : a sight with rows that its function does not have
    """

    cameras: tuple[RunCamera, ...]

    def __init__(
        self, tasks: Iterable[Task], limits: Limits | None, robot: Robot, live: bool = False
    ) -> None:
        self._robot, self._live = robot, live
        self._functions: dict[object, Function] = {}
        cameras: dict[str, RunCamera] = {}
        first = 0
        for task in tasks:
            for camera, sight, points in self._sights(task.function):
                goals = [
                    GoalRows(points[k], first + x, first + y, sight.intrinsics)
                    for k, (x, y) in enumerate(sight.rows)
                    if points[k] >= 0
                ]
                _add(cameras, camera, sight, points, goals)
            first += len(task.function.rows(robot))
        edges: dict[str, list[Array]] = {}
        for bound in () if limits is None else limits.bounds:
            if isinstance(bound, Limit):
                continue
            for camera, sight, points in self._sights(bound.function):
                _add(cameras, camera, sight, points, [])
                ranges = np.array([[row.lower, row.upper] for row in bound.rows(robot)])
                fx, fy, cx, cy = sight.intrinsics
                for x, y in sight.rows:
                    ends = np.array([(ranges[x] - cx) / fx, (ranges[y] - cy) / fy])
                    edges.setdefault(camera, []).append(ends)
        self.cameras = tuple(_bordered(camera, edges.get(camera.frame, [])) for camera in cameras.values())
        self._program = Program(robot, list(self._functions.values()))
        self._program.lay_out()
        self.calls_python = self._program.calls_python

    def _sights(self, function: Function) -> Iterator[tuple[str, Sight, list[int]]]:
        """What a function sees: the camera's frame, and the number of each point, -1 for one that is not
        drawn."""
        if (sight := function.shown().sees) is None:
            return
        count = len(function.rows(self._robot))
        fits = all(row in range(count) for two in sight.rows for row in two)
        fits = fits and len(sight.rows) in (0, len(sight.points))
        expect(fits, f"{type(function).__name__}.shown", "two rows of its own for each point", sight.rows)
        yield optical_frame(sight.camera, self._robot), sight, [self._number(point) for point in sight.points]

    def _number(self, point: Function) -> int:
        same = same_point(point, self._robot, self._live)
        if same is None:
            return -1
        self._functions.setdefault(same, point)
        return list(self._functions).index(same)

    def by_camera(self, t: Array, q: Array, r_d: Array) -> tuple[Camera, ...]:
        """What each camera sees at times (N,), s, and q (N, n), with targets r_d (N, s) of the tasks."""
        seen = self.at(t, q)
        return () if seen is None else tuple(camera.on(seen, r_d) for camera in self.cameras)

    def at(self, t: Array, q: Array) -> Array | None:
        """Where they are at times (N,), s, and q (N, n): (N, K, 3), m, world axes; None without any."""
        if not self._functions:
            return None
        positions = np.empty((len(t), len(self._functions), 3))
        for k, (time, q_k) in enumerate(zip(t.tolist(), q, strict=True)):
            positions[k] = [point.value for point in self._program.evaluate(time, q_k)]
        return positions


def same_point(point: Function, robot: Robot, live: bool = False) -> object:
    """What two functions share that are the same point, the same kernels with the same numbers; None for one
    that is set from outside, unless `live` ones have it."""
    stages = point.stages(robot)
    if any((stage.live is not None and not live) or stage.remembers for stage in stages):
        return None
    return tuple(
        (stage.kernel, stage.rows, stage.before, stage.frames, stage.numbers.tobytes(), stage.callback)
        for stage in stages
    )


def _add(
    cameras: dict[str, RunCamera], frame: str, sight: Sight, points: list[int], goals: list[GoalRows]
) -> None:
    """Add to a frame's camera what a sight has: numbers of points of the run become those of the camera."""
    before = cameras.get(frame, RunCamera(frame, ()))
    every = tuple(dict.fromkeys([*before.points, *(point for point in points if point >= 0)]))
    own = [goal._replace(point=every.index(goal.point)) for goal in goals]
    through = [(every.index(points[0]), every.index(points[1]))] if sight.line and min(points) >= 0 else []
    cameras[frame] = before._replace(
        points=every,
        goals=(*before.goals, *own),
        intrinsics=sight.intrinsics if before.intrinsics == NORMALISED else before.intrinsics,
        lines=tuple(dict.fromkeys([*before.lines, *through])),
    )


def _bordered(camera: RunCamera, edges: list[Array]) -> RunCamera:
    """With the border that limits imply, each the ends (2, 2) of x and y, normalised; where they have none,
    the picture's, which ends as far behind the principal point as it begins before it."""
    fx, fy, cx, cy = camera.intrinsics
    right, bottom = (cx / fx, cy / fy) if cx > 0.0 and cy > 0.0 else PICTURE[2:]
    usual = np.array([-right, -bottom, right, bottom])
    ends = np.array(edges).reshape(-1, 2, 2)
    limits = np.array([*ends[..., 0].min(axis=0, initial=np.inf), *ends[..., 1].max(axis=0, initial=-np.inf)])
    known = np.isfinite(limits)
    left, top, right, bottom = np.where(known, limits, usual).tolist()
    return camera._replace(border=(left, top, right, bottom), bounded=bool(known.any()))
