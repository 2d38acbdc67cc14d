"""A run shown by a tool while it is computed, in its own time."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from types import TracebackType
from typing import NamedTuple

import numpy as np

from nmm.base.arrays import Array
from nmm.base.text_format import one_line
from nmm.control.controller import Controller
from nmm.model.robots.surroundings import NO_SURROUNDINGS, Surroundings
from nmm.motion.recording import Recorder
from nmm.motion.trajectory import Trajectory
from nmm.plugins.streams.addresses import addresses
from nmm.plugins.streams.clock import RunClock, WallClock
from nmm.plugins.streams.followed import Followed, words_of
from nmm.plugins.streams.pictures import RobotPicture, Said
from nmm.plugins.streams.replay import about, lines_of
from nmm.plugins.streams.robot_scene import RobotScene
from nmm.plugins.streams.sending import Sending
from nmm.plugins.streams.shown import Stream
from nmm.plugins.streams.sinks import Destination

#: Time between two looks for samples, and for a viewer, s.
LOOK = 0.02
LONGEST = 300


class StreamedLeg(NamedTuple):
    """The record between two events, and the tasks that are active then."""

    recorder: Recorder
    active: tuple[bool, ...] | None


class RunStream(Stream):
    """Shows a run from another thread, which reads what is recorded:

        with RunStream(controller, q0, title, "rerun", 9876) as shown:
            run = simulate(controller, q0, duration, watch=shown.watch)
            shown.end(run)

    The clock begins when a viewer is there, and stands where the run is slower than its own time.

    Parameters
    ----------
    controller, q0 : of the run
    title : of the recording
    tool, port, rate : as of `nmm.stream`
    surroundings : what the robot carries, and scenery

    Raises
    ------
    InputError : the port is taken; no viewer runs
    """

    def __init__(
        self,
        controller: Controller,
        q0: Array,
        title: str,
        tool: str,
        port: int,
        rate: float,
        *,
        believed: bool = False,
        surroundings: Surroundings = NO_SURROUNDINGS,
    ) -> None:
        super().__init__(tool)
        self._rate, self._wall = rate, WallClock()
        self._followed = followed = Followed(controller)
        address, assets = addresses(tool, live=True)
        self._scene = RobotScene(
            controller.robot,
            title,
            followed.errors,
            self._wall.began,
            believed=believed,
            marks=followed.marks(q0),
            address=address,
            obstacles=followed.obstacles,
            surroundings=surroundings,
            q0=q0,
        )
        self._legs: list[StreamedLeg] = []
        self._run: Trajectory | None = None
        self._finished, self._ended = threading.Event(), threading.Event()
        self._done = threading.Event()  # a join that Ctrl-C ends says that the thread has ended (findings/)
        self._closed = False
        self._sending = Sending(Destination(tool, None, port, assets), self._scene.still, ends=True)
        self.address = self._sending.address
        self._thread = threading.Thread(target=self._work, name="nmm stream", daemon=True)
        self._thread.start()

    def watch(self, recorder: Recorder) -> None:
        """Show what the recorder gets from now on; `simulate` calls it."""
        self._legs.append(StreamedLeg(recorder, self._followed.active()))

    def end(self, run: Trajectory) -> None:
        """Show the rest of a computed run, what was found in it, and how it ended; Ctrl-C ends that."""
        self._run = run
        self._finished.set()
        self._done.wait()

    def close(self, why: str = "") -> None:
        if self._closed:
            return
        self._closed = True
        self._ended.set()
        self._finished.set()
        try:
            if not self._done.wait(2.0):  # the viewer takes nothing more
                self._sending.kill()
                self._done.wait()
            self._sending.close({"complete": "no", "why": why} if self._run is None else about(self._run))
        finally:
            self._sending.kill()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        self.close("" if kind is None else kind.__name__)

    def _work(self) -> None:
        try:
            while not self._sending.came.wait(LOOK):
                if self._ended.is_set() or self._sending.ended:
                    return
            clock: RunClock | None = None
            for item in self._items():
                if item is None:  # the run has not come so far
                    clock = None
                    if self._ended.wait(LOOK):
                        return
                    continue
                if clock is None:
                    clock = RunClock(self._wall, item.t)
                if self._ended.wait(clock.wait(item.t)):
                    return
                if isinstance(item, RobotPicture):  # what is found in the end may be of earlier
                    clock.late(item.t)
                self._sending.send(item.stamped(min(clock.stamp(item.t), self._wall.now())))
                self.sent += isinstance(item, RobotPicture)
        except Exception as error:  # beside a run nothing may end it
            self.trouble = one_line(f"{type(error).__name__}: {error}", LONGEST)
        finally:
            self._done.set()

    def _items(self) -> Iterator[RobotPicture | Said | None]:
        """Pictures, and lines before them, in the order of their times; None while there is nothing new."""
        leg = k = told = 0
        instant = -1
        for note in self._scene.still.notes:
            yield Said(0.0, 0, "", note, True)
        while True:
            finished = self._finished.is_set()
            times = self._final(leg, finished)
            if k >= len(times):
                if leg + 1 < len(self._legs):
                    leg, k = leg + 1, 0
                elif finished:
                    break
                else:
                    yield None
                continue
            t, last = float(times[k]), finished and leg + 1 == len(self._legs) and k + 1 == len(times)
            now = int(np.floor(t * self._rate + 1e-6))
            if now != instant or last:
                instant = now
                events = self._followed.events()
                while told < len(events) and events[told].t <= t:
                    event = events[told]
                    yield Said(event.t, 0, event.task, words_of(event), False)
                    told += 1
                yield self._picture(self._legs[leg], k, t)
            k += 1
        if self._run is not None:
            yield from lines_of(self._run, found_only=bool(self._legs))

    def _final(self, leg: int, finished: bool) -> Array:
        """Times of a leg's final samples: while a leg goes on, its last one may be taken again."""
        if leg >= len(self._legs):
            return np.zeros(0)
        ended = finished or leg + 1 < len(self._legs)
        times = self._legs[leg].recorder.t
        return times if ended else times[:-1]

    def _picture(self, leg: StreamedLeg, k: int, t: float) -> RobotPicture:
        found, believed = leg.recorder.found, leg.recorder.believed
        numbers = found.q[k].copy(), found.u[k].copy(), found.error[k].copy(), found.r_d[k].copy()
        seen = None if believed is None else believed[k].copy()
        return self._scene.picture(self._followed.sample(t, 0, *numbers, leg.active, seen))
