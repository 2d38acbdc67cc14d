"""A run shown in a browser while it is computed, in real time: the robot, its path and its curves."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import Array, Integers
from nmm.base.ellipsoid_options import Wanted
from nmm.base.errors import NmmError
from nmm.base.resolver_style import looks_of_labels
from nmm.control.controller import Controller
from nmm.control.step.quantities import Record
from nmm.control.step.recorded import Recorded
from nmm.model.robots.frame_path import FramePath
from nmm.model.robots.motion import Camera
from nmm.model.robots.surroundings import NO_SURROUNDINGS, Surroundings
from nmm.motion.components import Axes
from nmm.motion.joining import row_names
from nmm.motion.recording import Recorder
from nmm.motion.seen import SeenPoints
from nmm.motion.shown_frame import shown_frame
from nmm.motion.trajectory import Trajectory
from nmm.plugins.live.server import Visitor
from nmm.plugins.live.session import RobotSession, Watching, counted
from nmm.views.playback.cameras import live_numbers
from nmm.views.playback.channels import live_channels, partition_text
from nmm.views.playback.drawing import Drawing, encode, packed
from nmm.views.playback.rolling import RolledRobot
from nmm.views.playback.scene import playback_scene

#: Samples per second of a page's curves at most, besides those of its pictures, Hz.
KEPT = 60.0
#: Requests all that has been computed.
ALL = '{"type":"all"}'
BEGINS = "the run begins"
#: How long to wait for an answer at the end, s.
PATIENCE = 1.0
#: Samples that wheels roll through between two pictures at most.
ROLLED = 32


class LiveLeg(NamedTuple):
    """The record between two events, and the rows of the tasks active then."""

    recorder: Recorder
    rows: Integers


class Picture(NamedTuple):
    """Its number, how many samples curves have, commands that place the robot, and a text."""

    number: int
    samples: int
    lines: list[str]
    text: str


class LiveRun(RobotSession):
    """A run in a browser while it is computed: what has been computed is shown at its own time, 30 pictures a
    second, and all of it, to be played and looked through, afterwards.

        with LiveRun(controller, q0, duration) as live:
            run = simulate(controller, q0, duration, watch=live.watch)
            live.stay(run)

    The clock begins when the first page comes, and waits where the run is slower than its own time. Pages
    cannot change or delay the run: a thread of their own reads what is recorded.

    Parameters
    ----------
    controller, q0, duration : of the run, as `simulate` takes them
    title : heading; the robot's name when not given
    surroundings : what the robot carries, and scenery
    port : port on 127.0.0.1; a free one when not given
    open_browser : whether to open the page in the user's browser

    Raises
    ------
    InputError : wrong q0; the port is taken, not allowed or not a port

    Examples
    --------
    >>> scenario = nmm.Scenario.load("unicycle_2r_position")
    >>> controller, q0 = scenario.controller(), scenario.robot().q(scenario.parts.q0)
    >>> with nmm.playback.LiveRun(controller, q0, 1.0, open_browser=False) as live:
    ...     run = nmm.simulate(controller, q0, 1.0, watch=live.watch)
    Playing at http://127.0.0.1:.../ (Ctrl-C ends it)
    >>> run.complete
    True
    """

    def __init__(
        self,
        controller: Controller,
        q0: ArrayLike | Mapping[str, float],
        duration: float,
        *,
        title: str | None = None,
        surroundings: Surroundings = NO_SURROUNDINGS,
        port: int | None = None,
        open_browser: bool = True,
    ) -> None:
        robot = controller.robot
        self._title = robot.name if title is None else title
        self._end = float(duration)
        self._growing = Growing(controller)
        self._legs: list[LiveLeg] = []
        self._leg, self._sample, self._instant = 0, 0, -1.0  # the next one to show, and what KEPT counts
        self._times: list[float] = []
        self._values: list[Array] = []
        self._pages: list[Watching] = []
        self._came = threading.Event()
        self._began, self._t = math.nan, 0.0
        self._finished = self._over = self._reported = False
        self._whole: list[str] | None = None
        self._picture = Picture(1, 0, [], BEGINS)
        look = looks_of_labels([controller.resolver.name.upper()])[0]
        running = Drawing()
        frame, desired = self._growing.drawn
        running.add("running", duration=self._end, frame=frame, desired=desired, color=list(look.rgb))
        collisions, start = controller.given.collisions, robot.following.placed(robot.q(q0))
        super().__init__(
            RolledRobot(robot, start),
            self._title,
            self._visit,
            obstacles=() if collisions is None else collisions.obstacles,
            surroundings=surroundings,
            channels=self._growing.channels,
            look=look,
            cameras=self._growing.cameras(start),
            further=running.commands,
            scripts=("running.js",),
            styles=("running.css",),
            port=port,
        )
        self.begin(self._show, "nmm live run")
        self.announce("Playing", [robot], open_browser=open_browser)

    def watch(self, recorder: Recorder) -> None:
        """Show what that recorder gets from now on; `simulate` calls it."""
        if not self._legs:
            self._began = time.monotonic()
        self._legs.append(LiveLeg(recorder, self._growing.active_rows()))

    def stay(
        self, run: Trajectory, *, ellipsoids: Wanted = False, stop: threading.Event | None = None
    ) -> None:
        """Show the rest of a computed run, then all of it; returns at Ctrl-C or when `stop` is set, with the
        server closed. How many pictures were drawn and dropped is printed.

        Raises
        ------
        InputError : ellipsoids as in `write_html`
        """
        with self.ending(self._print_report):
            self._end, self._finished = float(run.t[-1]), True
            commands = playback_scene([run], title=self._title, ellipsoids=ellipsoids)
            self._whole = [encode(command) for command in commands]
            self.wait(stop, lambda: self._print_report() if self._over else None)

    def _print_report(self) -> None:
        if self._pages and not self._reported:
            self._reported = True
            print(self.report(), flush=True)

    def report(self) -> str:
        """How many pictures were made, of how much of the run, and how many pages drew and dropped."""
        made = self._picture.number
        late = f"{self.clock.late} could not be made in time; " if self.clock.late else ""
        return f"shown as it ran: {made} pictures of {self._t:.4g} s; {late}{counted(self._pages, made)}"

    def _visit(self) -> Visitor:
        """A new page; called in the server's thread."""
        if self._over:
            return Visitor(lambda: "")
        page = Watching(self._picture.number - 1)
        self._pages.append(page)
        self._came.set()
        seen = 0

        def latest() -> str:
            nonlocal seen
            if self._over:
                return encode({"type": "whole"})
            picture = self._picture
            if not page.takes(picture.number):
                return ""
            fresh, seen = slice(seen, picture.samples), picture.samples
            run = {
                "type": "run",
                "picture": picture.number,
                "t": packed(np.array(self._times[fresh]), np.float64),
                "values": packed(np.array(self._values[fresh]), np.float32),
                "partitions": list(self._growing.partitions),
                "told": picture.text,
                "whole": self._whole is not None,
                "dropped": page.dropped(picture.number) + self.clock.late,
            }
            return "\n".join([*picture.lines, encode(run)])

        def heard(text: str | bytes) -> bool:
            if text == ALL and self._whole is not None:
                self._t = self._end
            return page.heard(text)

        return Visitor(latest, heard, lambda: page.leaves(self._picture.number))

    def _show(self) -> None:
        shown = time.monotonic()
        while not self.ended.is_set() and not self._over:
            if not self._came.is_set():  # no page yet
                self._came.wait(0.05)
                self.clock.stand()
                shown = time.monotonic()
                continue
            known, wanted = self._known(), self._t + self.clock.passed()
            waits = wanted > known and not self._finished
            self._t = max(self._t, min(wanted, known))
            self._make(waits)
            now = time.monotonic()
            if not self._finished or self._t < self._end or self._whole is None:
                shown = now
            elif all(page.has_drawn(self._picture.number) for page in self._pages) or now - shown > PATIENCE:
                self._server.hello = self._whole
                self._over = True
            try:
                self.changed()
            except NmmError:  # it has been closed
                return
            self.clock.rest(self.ended, stands=waits or not self._legs)

    def _known(self) -> float:
        """Time of the last final sample, s."""
        safe_times = (self._safe(i) for i in reversed(range(len(self._legs))))
        return next((float(times[-1]) for times in safe_times if len(times)), 0.0)

    def _safe(self, leg: int) -> Array:
        """Times of a leg's final samples: while a leg goes on, its last one may be taken again."""
        ended = self._finished or leg + 1 < len(self._legs)
        times = self._legs[leg].recorder.t
        return times if ended else times[:-1]

    def _make(self, waits: bool) -> None:
        new = False
        while self._leg < len(self._legs):
            ended = self._leg + 1 < len(self._legs)
            times = self._safe(self._leg)
            last = int(np.searchsorted(times, self._t + 1e-9, side="right"))
            if last > self._sample:
                self._take(self._legs[self._leg], np.arange(self._sample, last))
                self._sample, new = last, True
            if not ended or last < len(times):
                break
            self._leg, self._sample = self._leg + 1, 0
        text = self._state(waits)
        before = self._picture
        if new or text != before.text:
            self._picture = Picture(before.number + 1, len(self._times), self.placed(self._t), text)

    def _take(self, leg: LiveLeg, at: Integers) -> None:
        """Take a leg's samples `at`: the robot's place at the last one, and the curves' samples."""
        recorded, times = leg.recorder.found, leg.recorder.t
        rolled = at[np.unique(np.linspace(0, len(at) - 1, min(len(at), ROLLED)).astype(int))]
        self.shown.roll(recorded.q[rolled])
        instants = np.floor(times[at] * KEPT + 1e-6)
        samples = np.union1d(at[np.diff(instants, prepend=self._instant) > 0], at[-1:])
        self._instant = float(instants[-1])
        self._values += list(self._growing.values(leg.recorder, leg.rows, samples))
        self._times += times[samples].tolist()

    def _state(self, waits: bool) -> str:
        if not self._legs:
            return BEGINS
        if waits:
            rate = self._known() / max(time.monotonic() - self._began, 1e-9)
            return f"waits for the computation, at {rate:.1g} times real time"
        return "" if self._t < self._end else "drawing all of it"


class Growing:
    """What a page plots of a run while it is recorded; tasks that come and go have NaN rows while inactive.
    `channels` have no values; `partitions` names RG's partitions by number, as they come; `drawn` tells
    the frame whose path is drawn, or None, and whether its desired one is."""

    def __init__(self, controller: Controller) -> None:
        self._robot = robot = controller.robot
        self._schedule = controller.schedule
        tasks = controller.solver.tasks_on if self._schedule is None else self._schedule.tasks_on
        self._counts, rows = [*map(len, tasks.each)], tasks.rows
        self._rows = len(rows)
        self._shown = shown_frame(tasks.stack, robot)
        self._seen = SeenPoints(tasks.stack, controller.limits, robot)
        self._path = None if self._shown.frame is None else FramePath(robot, self._shown.frame)
        self.drawn = self._shown.frame, self._path is not None and bool(self._shown.rows)
        self.partitions: list[str] = []
        self._numbers: dict[tuple[int, ...], int] = {}
        names = [row.name for row in rows] if self._schedule is None else row_names(self._schedule)
        # Of tasks that come and go the levels come and go, too.
        some = controller.limits is not None and self._schedule is None
        self._levels = len(tasks.levels) if some else 0
        axes = Axes(robot, tuple(names), tuple(row.unit for row in rows), self._levels)
        hidden = {"objective"} if controller.given.objective is None else set()
        hidden |= {"drift"}  # known at the end
        hidden |= {"u_dot"} if controller.order == 1 else set()
        self._partitioned = controller.resolver.name.lower() == "rg"
        self._curves, self.channels = live_channels(axes, hidden, partitioned=self._partitioned)

    def cameras(self, q: Array) -> tuple[Camera, ...]:
        """Those of the robot at q (n,), without goals; none where a thread of the page's own would call
        users' functions."""
        none = np.full((1, self._rows), np.nan)
        return () if self._seen.calls_python else self._seen.by_camera(np.zeros(1), q[np.newaxis], none)

    def active_rows(self) -> Integers:
        """Rows of the tasks active now, among all rows; called when a leg of the run begins."""
        on = [True] * len(self._counts) if self._schedule is None else self._schedule.moment.active
        return np.flatnonzero(np.repeat(np.array(on, dtype=bool), np.array(self._counts, dtype=int)))

    def values(self, recorder: Recorder, rows: Integers, at: Integers) -> Array:
        """Values (K, channels) at samples `at` (K,) of a recorder with those rows, then the drawn frame's
        position (K, 3), m, and its desired one, as `drawn` has them, then what its cameras see."""
        recorded = Recorded._make(whole[at] for whole in recorder.found)
        record = Record(self._robot, {"t": recorder.t[at], **recorded._asdict()})
        known = slice(len(rows))  # without a task, a recorder has a row of its own

        def of_all(own: Array) -> Array:
            whole = np.full((len(at), self._rows), np.nan)
            whole[:, rows] = own[:, known]
            return whole

        parts = []
        for quantity in self._curves:
            own = getattr(recorded, quantity.name) if quantity.of is None else quantity.of(record)
            if quantity.shape == "Nl":
                own = own[:, : self._levels]
            parts.append(of_all(own) if quantity.shape == "Ns" else own)
        if self._partitioned:
            parts.append(self._partition(recorded.partition))
        parts += [recorded.u, recorded.q]
        if self._path is not None:
            place = self._path.positions(recorded.q)
            parts.append(place)
            if self._shown.rows:
                parts.append(self._shown.desired(place, of_all(recorded.r_d)))
        if not self._seen.calls_python:
            cameras = self._seen.by_camera(recorder.t[at], recorded.q, of_all(recorded.r_d))
            parts.append(live_numbers(cameras, self._robot, recorded.q))
        return np.column_stack(parts)

    def _partition(self, columns: Integers) -> Array:
        keys = [tuple(row[row >= 0].tolist()) for row in np.sort(columns, axis=1)]
        numbers = [self._numbers.setdefault(key, len(self._numbers)) for key in keys]
        new = list(self._numbers)[len(self.partitions) :]
        self.partitions += [partition_text(self._robot, key) for key in new]
        return np.array(numbers, dtype=np.float64)
