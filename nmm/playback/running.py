"""A run in a browser while it is computed, at the pace of its own time."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Mapping
from types import TracebackType
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from nmm.arrays import Array, Integers
from nmm.control.controller import Controller
from nmm.errors import NmmError
from nmm.looks import looks_of_labels
from nmm.playback.channels import Channels
from nmm.playback.curves import draw_curves
from nmm.playback.drawing import Drawing
from nmm.playback.encoding import encode, packed
from nmm.playback.growing import Growing
from nmm.playback.live import announce
from nmm.playback.page import socket_page
from nmm.playback.rolling import Rolling
from nmm.playback.scene import live_scene, playback_scene
from nmm.playback.server import PageServer, Visitor
from nmm.playback.surroundings import Surroundings
from nmm.playback.watching import Watching, counted
from nmm.runs.ellipsoid_options import Wanted
from nmm.runs.recording import Recorder
from nmm.runs.trajectory import Trajectory

SCRIPTS, STYLES = ("running.js",), ("running.css",)
#: Pictures a second.
FPS = 30.0
#: A page's curves have at most so many samples a second, besides those of its pictures, Hz.
KEPT = 60.0
#: The clock lets the time go that a picture is later than this, s.
LATE = 0.25
#: What a page sends that wants all of a run that has been computed.
ALL = '{"type":"all"}'
#: What a page is told first.
BEGINS = "the run begins"
#: How long an answer is waited for at the end, s.
PATIENCE = 1.0
#: Wheels roll through at most so many samples between two pictures.
ROLLED = 32


class Leg(NamedTuple):
    """What is recorded from one event to the next, and which of all rows the tasks have that are then
    active."""

    recorder: Recorder
    rows: Integers


class Picture(NamedTuple):
    """What pages are told from now on: its number, how many samples curves have, the robot as lines of
    commands, and words."""

    number: int
    samples: int
    lines: list[str]
    told: str


class LiveRun:
    """A run in a browser while it is computed: what has been computed is shown at its own time, 30 pictures a
    second, and all of it, to be played and looked through, afterwards.

        with LiveRun(controller, q0, duration) as live:
            run = simulate(controller, q0, duration, watch=live.watch)
            live.stay(run)

    The clock begins when the first page comes, and waits where the run is slower than its own time. What
    pages do, and whether they answer, changes nothing of the run: a thread of its own reads what is recorded.

    Parameters
    ----------
    controller, q0, duration : of the run, as `simulate` takes them
    title : heading; the robot's name when not given
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
        port: int | None = None,
        open_browser: bool = True,
    ) -> None:
        self._robot = robot = controller.robot
        self._title = robot.name if title is None else title
        self._end = float(duration)
        self._growing = Growing(controller)
        self._rolling = Rolling(robot)
        self._q = robot.following.placed(robot.q(q0))
        self._wheels = self._rolling.settled(self._q)
        self._legs: list[Leg] = []
        self._leg, self._sample, self._instant = 0, 0, -1.0  # the next one to show, and what KEPT counts
        self._times: list[float] = []
        self._values: list[Array] = []
        self._pages: list[Watching] = []
        self._came, self._stop = threading.Event(), threading.Event()
        self._began = math.nan
        self._t = 0.0
        self._late = 0
        self._finished = self._over = False
        self._whole: list[str] | None = None
        resolver = getattr(controller, "resolver_name", controller.resolver.name)
        commands, self._drawn = live_scene(
            robot, self._q, self._wheels, title=self._title, room=float(robot.reach)
        )
        collisions = controller.collisions
        obstacles = () if collisions is None else tuple(collisions.obstacles)
        self._surroundings = Surroundings(obstacles, robot, self._q, self._wheels)
        drawing = Drawing()
        self._surroundings.draw(drawing, 2.0 * float(robot.reach))
        look = looks_of_labels([resolver.upper()])
        draw_curves(drawing, [Channels(np.zeros(0), 0, self._growing.channels)], look, 0.0)
        running = Drawing()
        running.add(
            "running",
            duration=self._end,
            path=self._growing.drawn[0],
            desired=self._growing.drawn[1],
            color=list(look[0].rgb),
        )
        # The last command of a scene says that it has come.
        commands = [*commands[:-1], *drawing.commands, commands[-1], *running.commands]
        self._picture = Picture(1, 0, [], BEGINS)
        self._server = PageServer(
            lambda host, token: socket_page(self._title, host, token, scripts=SCRIPTS, styles=STYLES),
            [encode(command) for command in commands],
            self._visit,
            port=port,
        )
        self._thread = threading.Thread(target=self._show, name="nmm live run", daemon=True)
        self._thread.start()
        announce(self._server, "Playing", [robot], open_browser=open_browser)

    @property
    def url(self) -> str:
        """Address of the page."""
        return self._server.url

    def watch(self, recorder: Recorder) -> None:
        """Show what that recorder gets from now on: what `simulate` calls."""
        if not self._legs:
            self._began = time.monotonic()
        self._legs.append(Leg(recorder, self._growing.active_rows()))

    def stay(
        self, run: Trajectory, *, ellipsoids: Wanted = False, stop: threading.Event | None = None
    ) -> None:
        """Show the rest of the run, which is computed, and then all of it; returns at Ctrl-C or when `stop`
        is set, with the server closed. How many pictures were drawn and dropped is printed.

        Raises
        ------
        InputError : ellipsoids as in `playback_scene`
        """
        told, stop = False, stop or threading.Event()
        try:
            self._end, self._finished = float(run.t[-1]), True
            commands = playback_scene([run], title=self._title, ellipsoids=ellipsoids)
            self._whole = [encode(command) for command in commands]
            # Not for ever at once: on some systems Ctrl-C cannot end that.
            while not stop.wait(timeout=0.5):
                if self._over and not told:
                    told = True
                    print(self.report(), flush=True)
        except KeyboardInterrupt:
            print(flush=True)
        finally:
            if not told and self._pages:
                print(self.report(), flush=True)
            self.close()

    def report(self) -> str:
        """How many pictures were made of how long a time of the run, and what became of them."""
        made = self._picture.number
        late = f"{self._late} could not be made in time; " if self._late else ""
        return f"shown as it ran: {made} pictures of {self._t:.4g} s; {late}{counted(self._pages, made)}"

    def close(self) -> None:
        """End the server and free its port; again is nothing."""
        self._stop.set()
        self._thread.join(timeout=5.0)
        self._server.close()

    def __enter__(self) -> LiveRun:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    def _visit(self) -> Visitor:
        """A page that has come, in the server's thread."""
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
                "told": picture.told,
                "whole": self._whole is not None,
                "dropped": page.dropped(picture.number) + self._late,
            }
            return "\n".join([*picture.lines, encode(run)])

        def heard(text: str | bytes) -> bool:
            if text == ALL and self._whole is not None:
                self._t = self._end
            return page.heard(text)

        return Visitor(latest, heard, lambda: page.leaves(self._picture.number))

    def _show(self) -> None:
        """Make pictures at the run's own time, until all of it has been shown; the thread that does so."""
        before = due = shown = time.monotonic()
        while not self._stop.is_set() and not self._over:
            now = time.monotonic()
            if not self._came.is_set():  # nobody looks yet
                self._came.wait(0.05)
                before = due = shown = time.monotonic()
                continue
            known = self._known()
            wanted, before = self._t + min(now - before, LATE), now
            waits = wanted > known and not self._finished
            self._t = max(self._t, min(wanted, known))
            self._make(waits)
            if waits or not self._legs:
                due = now
            elif now - due > 1.0 / FPS:
                self._late += int((now - due) * FPS)
                due = now
            if not self._finished or self._t < self._end or self._whole is None:
                shown = now
            elif all(page.has_drawn(self._picture.number) for page in self._pages) or now - shown > PATIENCE:
                self._server.hello = self._whole
                self._over = True
            try:
                self._server.changed()
            except NmmError:  # it has been closed
                return
            due += 1.0 / FPS
            self._stop.wait(max(0.0, due - time.monotonic()))

    def _known(self) -> float:
        """Up to which time samples are known that stay as they are."""
        for i in range(len(self._legs) - 1, -1, -1):
            times = self._safe(i)
            if len(times):
                return float(times[-1])
        return 0.0

    def _safe(self, leg: int) -> Array:
        """The times of a leg's samples that stay as they are: the last one may be taken again."""
        ended = self._finished or leg + 1 < len(self._legs)
        times = self._legs[leg].recorder.t
        return times if ended else times[:-1]

    def _make(self, waits: bool) -> None:
        """The next picture, where there is something new to see."""
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
        told = self._words(waits)
        before = self._picture
        if new or told != before.told:
            lines = [self._surroundings.moved(self._t), self._drawn.pose(self._q, self._wheels)]
            self._picture = Picture(
                before.number + 1, len(self._times), [encode(line) for line in lines], told
            )

    def _take(self, leg: Leg, at: Integers) -> None:
        """Take the samples numbered `at` of a leg: where the robot is at the last, and what curves keep."""
        found, times = leg.recorder.found, leg.recorder.t
        rolled = at[np.unique(np.linspace(0, len(at) - 1, min(len(at), ROLLED)).astype(int))]
        way = np.vstack([self._q, found.q[rolled]])
        self._wheels = self._rolling.angles(way, start=self._wheels)[-1]
        self._q = way[-1]
        instants = np.floor(times[at] * KEPT + 1e-6)
        kept = at[np.diff(instants, prepend=self._instant) > 0]
        kept = np.union1d(kept, at[-1:])
        self._instant = float(instants[-1])
        self._values += list(self._growing.values(leg.recorder, leg.rows, kept))
        self._times += times[kept].tolist()

    def _words(self, waits: bool) -> str:
        """What a page says of the state."""
        if not self._legs:
            return BEGINS
        if waits:
            rate = self._known() / max(time.monotonic() - self._began, 1e-9)
            return f"waits for the computation, at {rate:.1g} times real time"
        return "" if self._t < self._end else "drawing all of it"
