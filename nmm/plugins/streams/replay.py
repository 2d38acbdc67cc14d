"""A trajectory as pictures and lines of text."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from nmm.base.arrays import Array, Integers
from nmm.base.findings.run import line
from nmm.motion.trajectory import Trajectory
from nmm.plugins.streams.followed import words_of
from nmm.plugins.streams.pictures import Near, RobotPicture, Said
from nmm.plugins.streams.robot_scene import RobotScene, Sample
from nmm.views.playback.rolling import Rolling


def scene_of(run: Trajectory, start: int, address: Callable[[str], str] | None = None) -> RobotScene:
    """The scene of a run whose first sample is at `start`, ns."""
    name = (run.scenario or {}).get("name", "") or run.robot.name
    return RobotScene(
        run.robot,
        f"{name}, {run.called}",
        [*zip(run.r_names, run.r_units, strict=True)],
        start,
        believed=run.believed is not None,
        desired=run.moving,
        marks=run.marks,
        address=address,
        begin=float(run.t[0]),
        obstacles=run.obstacles,
        surroundings=run.surroundings,
        q0=run.q[0],
    )


def about(run: Trajectory) -> dict[str, str]:
    """What is to be said of the whole."""
    return {"complete": "yes" if run.complete else "no", "outcome": str(run.outcome), "why": run.message}


class Replay:
    """A run's pictures and lines in the order of their times; `stamp` is the clock's time, ns, of a time of
    the run, s."""

    def __init__(self, run: Trajectory, scene: RobotScene, stamp: Callable[[float], int]) -> None:
        self._run, self._scene, self._stamp = run, scene, stamp
        counted = run.q if run.believed is None else run.believed
        self._wheels = Rolling(run.robot).angles(counted, run.u)
        notes = [Said(float(run.t[0]), 0, "", note, True) for note in scene.still.notes]
        self._lines = [*notes, *lines_of(run)]

    def items(self, at: Integers) -> Iterator[RobotPicture | Said]:
        """The pictures of the samples `at`, with the lines before each; all lines in the end."""
        for k in at.tolist():
            yield from self._until(float(self._run.t[k]))
            yield self._scene.picture(self._sample(k))
        yield from self._until(np.inf)

    def _until(self, t: float) -> Iterator[Said]:
        while self._lines and self._lines[0].t <= t:
            said = self._lines.pop(0)
            yield said.stamped(self._stamp(said.t))

    def _sample(self, k: int) -> Sample:
        run = self._run
        t = float(run.t[k])
        return Sample(
            t=t,
            stamp=self._stamp(t),
            q=run.q[k],
            u=run.u[k],
            error=run.error[k],
            seen=None if run.believed is None else run.believed[k],
            reached=None if run.path is None else run.path[k],
            wanted=None if run.desired is None else run.desired[k],
            near=self._near(k),
            wheels=self._wheels[k],
        )

    def _near(self, k: int) -> Near | None:
        run = self._run
        if len(run.clearance) != len(run) or not np.isfinite(run.clearance[k]) or run.clearance_pairs[k] < 0:
            return None
        points: Array = run.clearance_points[k].reshape(2, 3)
        between = run.clearance_names[run.clearance_pairs[k]]
        return Near(points if np.isfinite(points).all() else None, float(run.clearance[k]), between)


def lines_of(run: Trajectory, *, found_only: bool = False) -> list[Said]:
    """What happened in a run, unless `found_only`, what was found in it, and how it ended, in the order of
    their times."""
    begin, end = (float(run.t[0]), float(run.t[-1])) if len(run) else (0.0, 0.0)
    events = () if found_only else run.events
    lines = [
        Said(float(np.clip(event.t, begin, end)), 0, event.task, words_of(event), False) for event in events
    ]
    for findings in run.verdict.warnings:
        times = [found.where["t"] for found in findings if isinstance(found.where.get("t"), int | float)]
        t = float(np.clip(min(times, default=end), begin, end))
        lines.append(Said(t, 0, run.called, line(findings), True))
    ended = str(run.outcome) + (f": {run.message}" if run.message else "")
    lines.append(Said(end, 0, run.called, ended, not run.complete))
    return sorted(lines, key=lambda said: said.t)


def thinned(t: Array, rate: float | None) -> Integers:
    """The samples at times t (N,), s, that are shown: at most `rate` a second, the first and the last among
    them; all for None."""
    if rate is None or not len(t):
        return np.arange(len(t))
    instants = np.floor((t - t[0]) * rate + 1e-6)
    return np.union1d(np.flatnonzero(np.diff(instants, prepend=-1.0) > 0), len(t) - 1)
