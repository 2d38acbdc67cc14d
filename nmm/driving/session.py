"""The loop in real time, between the messages of the pages and their pictures."""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any

import numpy as np

from nmm.driving.choices import Choice, named
from nmm.driving.driven import Driven, Look
from nmm.driving.making import Making
from nmm.driving.messages import FAR, Aim, Order, Pick, parsed
from nmm.driving.plotted import channels, numbers, values
from nmm.driving.setups import DriveSetup
from nmm.errors import InputError, NmmError
from nmm.looks import looks
from nmm.playback.channels import Channels
from nmm.playback.curves import draw_curves
from nmm.playback.drawing import Drawing
from nmm.playback.encoding import encode
from nmm.playback.live import serve
from nmm.playback.page import socket_page
from nmm.playback.scene import live_scene
from nmm.playback.server import PageServer, Visitor
from nmm.playback.surroundings import Surroundings

SCRIPTS = ("drive_gizmo.js", "drive.js")
STYLES = ("drive.css",)
#: Pictures a second.
FPS = 30.0
#: A loop that is later than this, s, lets the time go that it has lost.
LATE = 0.25
#: Samples that a page which comes late is told, at FPS.
KEPT = int(30 * FPS)
#: Messages that wait for the loop at most; more are dropped.
WAITING = 256
#: How long a notice is told, s.
TOLD = 5.0


def drive(
    setup: DriveSetup,
    *,
    port: int | None = None,
    open_browser: bool = True,
    stop: threading.Event | None = None,
) -> None:
    """Let a robot follow targets that are dragged in a browser; returns at Ctrl-C or when `stop` is set.

    The address is printed. Only this machine can reach it; the program listens to pages that it sent itself,
    and to nothing that they would not say. All pages show and move the same robot.

    Parameters
    ----------
    setup : what is driven
    port : port on 127.0.0.1; a free one when not given
    open_browser : whether to open the page in the user's browser
    stop : ends it when set (by another thread)

    Raises
    ------
    InputError : the port is taken, not allowed or not a port; a scenario that nobody can drive

    Examples
    --------
    >>> from threading import Event, Timer
    >>> ended = Event()
    >>> Timer(0.5, ended.set).start()
    >>> setup = nmm.driving.ScenarioSetup(nmm.Scenario.load("unicycle_2r_position"))
    >>> nmm.driving.drive(setup, open_browser=False, stop=ended)
    Driving at http://127.0.0.1:.../ (Ctrl-C ends it)
    """
    session = Session(Driven(setup))
    server = PageServer(
        lambda host, token: socket_page(setup.name, host, token, scripts=SCRIPTS, styles=STYLES),
        [encode(command) for command in session.commands],
        lambda: Visitor(session.follow(), session.receive),
        port=port,
    )
    ended = stop or threading.Event()
    loop = threading.Thread(target=session.run, args=(server.changed, ended), name="nmm drive", daemon=True)
    loop.start()
    try:
        serve(server, "Driving", [setup.robot], open_browser=open_browser, stop=ended)
    finally:
        ended.set()
        loop.join(timeout=5.0)


class Session:
    """A robot that is driven, what pages have said, and what they are told.

    Three threads meet here: the loop (`run`), the server (`receive`, and what `follow` makes), and one that
    makes a controller. They share what is written in one go: a deque, and references to values that nobody
    changes.

    Attributes
    ----------
    commands : of a page that has just come
    """

    def __init__(self, driven: Driven) -> None:
        self._driven = driven
        self._look = look = driven.look()
        self._waiting: deque[Aim | Pick | Order] = deque(maxlen=WAITING)
        self._samples: deque[tuple[int, list[float | None]]] = deque(maxlen=KEPT)
        self._picks: dict[str, object] = {}
        self._making: Making | None = None
        self._paused = False
        self._lost = 0
        self._notice, self._until = "", 0.0
        self._count = 0
        self._choices: tuple[int, list[Choice]] = (0, driven.choices)
        robot = driven.robot
        commands, self._drawn = live_scene(
            robot, driven.q, driven.wheels, title=driven.setup.name, room=float(robot.reach)
        )
        self._surroundings = Surroundings(driven.obstacles, robot, driven.q, driven.wheels)
        drawing = Drawing()
        self._surroundings.draw(drawing, 2.0 * float(robot.reach))
        draw_curves(
            drawing, [Channels(np.zeros(0), 0, channels(driven))], looks([_kind(driven.choices)]), 0.0
        )
        targets = Drawing()
        targets.add(
            "targets",
            targets=[target.told() for target in driven.targets],
            values=[target.signal.value.tolist() for target in driven.targets],
            at=[numbers(at) for at in look.at],
            reach=float(robot.reach),
            far=FAR,
        )
        # The last command of a scene says that it has come.
        self.commands = [*commands[:-1], *drawing.commands, commands[-1], *targets.commands]
        self._publish(look)

    def receive(self, text: str | bytes) -> bool:
        """A page's message; what no page of ours says is left aside. The loop answers: never at once."""
        with suppress(InputError):
            self._waiting.append(parsed(text))
        return False

    def follow(self) -> Callable[[], str]:
        """For a page that has come: what is new to it, as lines."""
        seen, version = -1, -1

        def latest() -> str:
            nonlocal seen, version
            lines = []
            number, choices = self._choices
            if number != version:
                version = number
                told, (worn,) = [choice.told() for choice in choices], looks([_kind(choices)])
                lines.append(encode({"type": "choices", "choices": told, "color": worn.color}))
            *placed, picture = self._picture
            fresh = [sample for count, sample in tuple(self._samples) if count > seen]
            seen = self._samples[-1][0] if self._samples else seen
            lines += [encode(command) for command in placed]
            return "\n".join([*lines, encode({**picture, "samples": fresh})])

        return latest

    def run(self, changed: Callable[[], None], stop: threading.Event) -> None:
        """Move in real time and tell `changed` of each picture, until `stop` is set."""
        clock = time.monotonic()
        while not stop.is_set():
            self._attend()
            now = time.monotonic()
            if self._paused or self._driven.trouble:
                clock = now
            if now - clock > LATE:
                self._lost += math.ceil((now - clock) * FPS) - 1
                clock = now - 1.0 / FPS
            dt = self._driven.setup.dt
            while clock + dt <= now and self._driven.step():
                clock += dt
            try:
                self._look = self._driven.look()
            except NmmError as error:  # a user's function may raise
                self._driven.trouble = str(error)
            self._publish(self._look)
            try:
                changed()
            except NmmError:  # the server has been closed
                return
            stop.wait(max(0.0, 1.0 / FPS - (time.monotonic() - now)))

    def _attend(self) -> None:
        """Do what pages have said."""
        while self._waiting:
            message = self._waiting.popleft()
            try:
                if isinstance(message, Aim):
                    self._driven.aim(message.task, np.array(message.value))
                elif isinstance(message, Pick):
                    self._picks[message.key] = message.value
                elif message.what == "restart":
                    self._driven.restart()
                else:
                    self._paused = message.what == "pause"
            except InputError:
                continue  # no page of ours has that task
        if self._making is not None and self._making.done:
            self._take(self._making)
            self._making = None
        if self._picks and self._making is None:
            key = next(iter(self._picks))
            self._making = Making(self._driven, key, self._picks.pop(key))

    def _take(self, making: Making) -> None:
        if making.made is not None:
            self._driven.use(making.made)
        else:
            self._notice, self._until = making.wrong, time.monotonic() + TOLD
        # A page whose wish was not met shows what is.
        self._choices = (self._choices[0] + 1, self._driven.choices)

    def _publish(self, look: Look) -> None:
        """What pages are told from now on."""
        driven = self._driven
        self._count += 1
        if not self._samples or self._samples[-1][1][0] != look.t:
            self._samples.append((self._count, [look.t, *values(driven, look)]))
        told, wrong = self._told(look)
        picture: dict[str, Any] = {
            "type": "drive",
            "t": look.t,
            "targets": [target.signal.value.tolist() for target in driven.targets],
            "at": [numbers(at) for at in look.at],
            "paused": self._paused,
            "told": told,
            "wrong": wrong,
        }
        self._picture = self._surroundings.moved(look.t), self._drawn.pose(driven.q, driven.wheels), picture

    def _told(self, look: Look) -> tuple[str, bool]:
        """What a page says of the state, and whether that is bad news."""
        if self._driven.trouble:
            return "; ".join(filter(None, [f"Stands still: {self._driven.trouble}", look.against])), True
        if time.monotonic() < self._until:
            return self._notice, True
        if look.against:
            return f"{look.against[0].upper()}{look.against[1:]}.", True
        parts = [f"t = {look.t:.1f} s"]
        if self._making is not None:
            parts.append("another controller is being made")
        if self._lost:
            parts.append(f"{self._lost} pictures late")
        return ", ".join(parts), False


def _kind(choices: Sequence[Choice]) -> str:
    """The resolver's, whose colour the curves have."""
    return str(named(choices, "resolver.kind").value)
