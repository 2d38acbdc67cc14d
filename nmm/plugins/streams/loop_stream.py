"""A robot's loop as a stream, which cannot hold it up."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Hashable, Iterator
from contextlib import ExitStack, suppress
from functools import partial
from pathlib import Path
from queue import Empty, SimpleQueue
from types import TracebackType
from typing import NamedTuple

from nmm.base.arrays import Array
from nmm.base.errors import NmmError, expect
from nmm.base.files import whole_file, written_at
from nmm.base.findings import Finding
from nmm.base.text_format import one_line
from nmm.control.sequencing.sequence import Event
from nmm.plugins.robot.robot_loop import Loop
from nmm.plugins.streams.addresses import addresses
from nmm.plugins.streams.clock import WallClock
from nmm.plugins.streams.followed import Followed, identity, words_of
from nmm.plugins.streams.pictures import Said
from nmm.plugins.streams.robot_scene import RobotScene
from nmm.plugins.streams.sending import Sending, SendingEnded
from nmm.plugins.streams.shown import Stream
from nmm.plugins.streams.sinks import Destination

#: Samples that wait to be sent at most: live, where old ones are of no use, and into a file.
LIVE, WRITTEN = 120, 10_000
LONGEST = 300
IN_MAP = "fixes move the robot in odom: with nmm.stream(…, localised=True) they move odom in map"
#: Time between two looks whether all is sent, s.
LOOK = 0.1


class LoopLine(NamedTuple):
    """An event or a finding at t, s: by whom, in words; a warning or not."""

    t: float
    who: str
    text: str
    warns: bool


def line_of(event: Event) -> LoopLine:
    return LoopLine(event.t, event.task, words_of(event), False)


class SeenSample(NamedTuple):
    """What the loop's thread copies of a sample; `active` tasks; `seen` in odom, where the stream asks for
    it; whether q is not."""

    t: float
    stamp: int
    q: Array
    u: Array
    error: Array
    r_d: Array
    active: tuple[bool, ...] | None
    seen: Array | None
    corrected: bool
    state: str


class LoopStream(Stream):
    """See `nmm.stream`. The loop's thread copies a sample into a queue that does not grow; one of the
    stream's makes pictures of it, and a process of its own sends them."""

    def __init__(
        self,
        loop: Loop,
        tool: str,
        file: Path | None,
        port: int,
        rate: float,
        start: float | None,
        localised: bool = False,
    ) -> None:
        super().__init__(tool, file)
        self._loop, self._rate, self._instant = loop, rate, -1
        self._wall = WallClock()
        self._zero = None if start is None else round(1e9 * start)
        self._followed = followed = Followed(loop.controller)
        robot, live = loop.controller.robot, file is None
        expect(not localised or robot.platform.n_p, "localised", "a platform that moves", localised)
        self._localised = localised
        address, assets = addresses(tool, live)
        self._scene = RobotScene(
            robot,
            f"{robot.name}, loop",
            followed.errors,
            self._wall.began if self._zero is None else self._zero,
            believed=localised,
            marks=followed.marks(robot.rest),
            address=address,
            obstacles=followed.obstacles,
        )
        # Its `put` neither waits nor lets other threads run, as locks of Python would.
        self._waiting: SimpleQueue[SeenSample | None] = SimpleQueue()
        self._most, self._ended = LIVE if live else WRITTEN, threading.Event()
        self._done = (
            threading.Event()
        )  # Python 3.11 says of a thread that goes on that it has ended (findings/)
        self._closing = threading.Lock()
        self._state, self._events, self._said_of_map = "", 0, False
        self._notes = [*self._scene.still.notes]
        self._told: dict[Hashable, str | None] = {}
        with ExitStack() as stack:
            target = file
            if file is not None:
                stack.enter_context(written_at(file))
                target = stack.enter_context(whole_file(file))
            self._sending = Sending(Destination(tool, target, port, assets), self._scene.still)
            self._stack = stack.pop_all()
        self.address = self._sending.address
        self._worker = threading.Thread(target=self._work, name="nmm stream", daemon=True)
        self._worker.start()

    def __call__(self, loop: object = None) -> None:
        try:
            instant = math.floor(self._loop.t * self._rate + 1e-6)
            if instant != self._instant and not self._ended.is_set():
                self._instant = instant
                self._copy()
        except Exception as error:  # whatever is wrong here is no reason to stop a robot
            self._fails(error)

    def _copy(self) -> None:
        loop = self._loop
        if math.isinf(loop.age):  # nobody knows yet where it is
            return
        t, task = loop.t, loop.controller.solver.step_memory.task
        stamp = self._wall.now() if self._zero is None else self._zero + round(1e9 * t)
        numbers = loop.q, loop.u.copy(), task.error.copy(), task.r_d.copy()
        if self._waiting.qsize() >= self._most:
            with suppress(Empty):
                if self._waiting.get_nowait() is None:  # it is being closed
                    self._waiting.put(None)
                    return
                self.dropped += 1
        seen = loop.q_odom if self._localised else None
        active, state = self._followed.active(), str(loop.state)
        self._waiting.put(SeenSample(t, stamp, *numbers, active, seen, loop.corrected, state))

    def _fails(self, error: BaseException) -> None:
        self.trouble = self.trouble or one_line(f"{type(error).__name__}: {error}", LONGEST)

    def _work(self) -> None:
        try:
            self._send_all()
        finally:
            self._done.set()

    def _send_all(self) -> None:
        last: SeenSample | None = None
        while (seen := self._waiting.get()) is not None:
            last = seen
            self._send(seen)
        if last is not None:
            try:
                self._send_lines(last, again=True)
            except SendingEnded:
                pass
            except Exception as error:
                self._fails(error)

    def _send(self, seen: SeenSample) -> None:
        try:
            sample = self._followed.sample(*seen[:8])
            picture = self._scene.picture(sample)
            self._send_lines(seen)
            self._sending.send(picture)
            self.sent += 1
        except Exception as error:  # a user's obstacle, the viewer, its process
            self._fails(error)
            self.dropped += 1

    def _send_lines(self, seen: SeenSample, again: bool = False) -> None:
        """What was not told before; in the end also what is no longer as it was told. A line that cannot be
        made is tried once, and keeps no other one back."""
        for made in self._lines(seen, again):
            try:
                line = made()
            except Exception as error:
                self._fails(error)
                continue
            if line is not None:
                t, who, text, warns = line
                stamp = seen.stamp - max(0, round(1e9 * (seen.t - t)))
                self._sending.send(Said(t, stamp, who, text, warns))

    def _lines(self, seen: SeenSample, again: bool) -> Iterator[Callable[[], LoopLine | None]]:
        if seen.corrected and not self._localised and not self._said_of_map:
            self._said_of_map = True
            self._notes.append(IN_MAP)
        while self._notes:
            note = self._notes.pop(0)
            yield partial(LoopLine, seen.t, "", note, True)
        events = self._followed.events()
        begin = self._events if self._events <= len(events) else 0
        self._events = len(events)
        for event in events[begin:]:
            yield partial(line_of, event)
        if seen.state != self._state:
            self._state = seen.state
            yield partial(LoopLine, seen.t, "loop", seen.state, False)
        if (findings := self._findings()) is None:
            return
        known, self._told = self._told, {}  # what the loop has forgotten is forgotten here
        for finding in findings:
            key = identity(finding)
            self._told[key] = known.get(key)
            if key not in known or again:
                yield partial(self._found, key, finding)

    def _found(self, key: Hashable, finding: Finding) -> LoopLine | None:
        """The words of a finding, which take long to make; None where they were told."""
        known, self._told[key] = self._told[key], str(finding)
        if known == self._told[key]:
            return None
        return LoopLine(float(finding.where["t"]), "loop", str(self._told[key]), True)

    def _findings(self) -> tuple[Finding, ...] | None:
        try:
            return self._loop.findings
        except RuntimeError:  # one came while they were read: next time
            return None

    def close(self, why: str = "") -> None:
        with self._closing:
            if self._ended.is_set():
                return
            self._instant = -1
            self(self._loop)  # where it is in the end
            self._ended.set()
            self._waiting.put(None)
        live = self.file is None
        try:
            hurried = self._finish(self._sending.destination.patience if live else math.inf)
            if not self._done.is_set():  # the viewer takes nothing more
                self._sending.kill()
                self._done.wait()
            why = why or ("KeyboardInterrupt" if hurried else "")
            about = {"complete": "no" if why else "yes", "why": why, "dropped": str(self.dropped)}
            hurried |= self._sending.close(about)
        except BaseException as error:
            self._sending.kill()
            self._stack.__exit__(type(error), error, error.__traceback__)
            raise
        self._stack.close()
        if hurried:  # now that it is whole
            raise KeyboardInterrupt

    def _finish(self, seconds: float) -> bool:
        """Wait for what is left, so long at most; Ctrl-C drops it, not what was sent. Whether one came."""
        hurried, end = False, time.monotonic() + seconds
        while not self._done.is_set() and time.monotonic() < end:
            try:
                self._done.wait(LOOK)
            except KeyboardInterrupt:
                hurried = True
                with suppress(Empty):
                    while self._waiting.get_nowait() is not None:
                        self.dropped += 1
                self._waiting.put(None)
        return hurried

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        if kind is None:
            self.close()
            return
        try:
            self.close(one_line(f"{kind.__name__}: {error}" if str(error) else kind.__name__, LONGEST))
        except NmmError as raised:  # what broke off is the news
            self._fails(raised)
