"""The loop in real time, between the pages' messages and their pictures."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import asdict
from typing import Any

import numpy as np

from nmm.base.arrays import finite
from nmm.base.errors import InputError, NmmError
from nmm.base.resolver_style import looks
from nmm.control.controller import Controller
from nmm.model.robots.motion import Camera
from nmm.motion.components import Axes
from nmm.motion.seen import SeenPoints
from nmm.plugins.live.driving.driven import Driven, DrivenState, PendingController
from nmm.plugins.live.driving.jogging import Jogging
from nmm.plugins.live.driving.messages import FAR, Aim, Jog, Order, Pick, parsed
from nmm.plugins.live.driving.planning import NO_PLAN, Planning, later, why
from nmm.plugins.live.driving.setups import Choice, DriveSetup, named
from nmm.plugins.live.server import Visitor
from nmm.plugins.live.session import FPS, RobotSession
from nmm.views.playback.cameras import live_numbers
from nmm.views.playback.channels import live_channels
from nmm.views.playback.drawing import Drawing, encode

#: Samples that a new page gets, at FPS.
KEPT = int(30 * FPS)
#: Messages that wait for the loop at most; more are dropped.
WAITING = 256
SCRIPTS = ("drive_gizmo.js", "drive_border.js", "drive_choices.js", "drive.js", "jog_devices.js", "jog.js")
#: How long a notice is shown, s.
NOTICE = 5.0


def drive(
    setup: DriveSetup,
    *,
    jog_speeds: Mapping[str, float] | None = None,
    port: int | None = None,
    open_browser: bool = True,
    stop: threading.Event | None = None,
) -> None:
    """Let a robot follow targets that are dragged in a browser, or jog it; until Ctrl-C, or `stop` is set.

    The address is printed. Only this machine can reach it, and only pages that this program has sent may send
    messages, which are checked. All pages show and move the same robot.

    Parameters
    ----------
    setup : what is driven
    jog_speeds : of full keys and sticks, by name: "linear", m/s, and "angular", rad/s, of the hand, and the
        platform's inputs; when not given 0.25 m/s and 0.5 rad/s, or less for a slower robot; the page changes
        them
    port : port on 127.0.0.1; a free one when not given
    open_browser : whether to open the page in the user's browser
    stop : ends it when set (by another thread)

    Raises
    ------
    InputError : the port is taken, not allowed or not a port; a scenario that cannot be driven; a speed of
        what is not there, or above the robot's own limit

    Examples
    --------
    >>> from threading import Event, Timer
    >>> ended = Event()
    >>> Timer(0.5, ended.set).start()
    >>> setup = nmm.driving.ScenarioSetup(nmm.Scenario.load("unicycle_2r_position"))
    >>> nmm.driving.drive(setup, open_browser=False, stop=ended)
    Driving at http://127.0.0.1:.../ (Ctrl-C ends it)
    """
    session = DriveSession(Driven(setup), jog_speeds, port=port)
    session.serve("Driving", [setup.robot], open_browser=open_browser, stop=stop)


class DriveSession(RobotSession):
    """A driven robot, its pages' messages and their pictures. Three threads meet here: the loop, the server
    (`receive`, `follow`), and one that makes a controller or a plan. They share what is written in one go: a
    deque, and references to values that never change."""

    def __init__(
        self, driven: Driven, jog_speeds: Mapping[str, float] | None = None, *, port: int | None = None
    ) -> None:
        self._driven, self._jogging = driven, Jogging(driven, jog_speeds)
        self._look = look = driven.look()
        self._waiting: deque[Aim | Pick | Order] = deque(maxlen=WAITING)
        self._aimed = threading.Event()
        self._samples: deque[tuple[int, list[float | None]]] = deque(maxlen=KEPT)
        self._picks: dict[str, object] = {}
        #: The number of the last aim that each task's target has had.
        self._heard: dict[int, int] = {}
        self._making: Future[tuple[PendingController, Controller]] | None = None
        self._paused = False
        self._notice, self._until = "", 0.0
        self._count = 0
        self._planning, self._plan = Planning(driven), (0, "")
        self._choices: tuple[int, list[Choice]] = (0, [])
        self._offer()
        self._picture: tuple[list[str], dict[str, Any]] | None = None
        first = driven.reacting
        self._seen = SeenPoints(first.given.task, first.limits, driven.robot, live=True)
        targets = Drawing()
        targets.add(
            "targets",
            targets=[
                *(target.for_page() for target in driven.targets),
                *(thing.for_page() for thing in driven.things),
            ],
            values=driven.places,
            at=finite(look.at),
            goals=self._goals(),
            reach=float(driven.robot.reach),
            far=FAR,
        )
        targets.add("jog", **self._jogging.for_page())
        names, units = zip(*(row for target in driven.targets for row in target.rows), strict=True)
        hidden = {"residual", "u_dot", "drift"} | (
            set() if driven.has_objective else {"objective"}
        )  # it drives at order 1
        self._curves, channels = live_channels(Axes(driven.robot, names, units, 1), hidden)
        super().__init__(
            driven.shown,
            driven.setup.name,
            self._visit,
            obstacles=driven.obstacles,
            surroundings=driven.setup.surroundings,
            channels=channels,
            look=looks([_kind(driven.choices)])[0],
            cameras=self._cameras(look),
            further=targets.commands,
            scripts=SCRIPTS,
            styles=("drive.css",),
            port=port,
        )
        self._publish(look)
        self.begin(self._run, "nmm drive")

    def _cameras(self, look: DrivenState) -> tuple[Camera, ...]:
        t, q, r_d = np.array([look.t]), look.step.q[np.newaxis], look.step.r_d[np.newaxis]
        return self._seen.by_camera(t, q, r_d)

    def _goals(self) -> list[list[dict[str, Any]]]:
        """The goals in each camera's picture: the point, its target, that one's rows of x and y,
        with their intrinsics."""
        counts = [len(target.rows) for target in self._driven.targets]
        whose = [(task, row) for task, count in enumerate(counts) for row in range(count)]
        return [
            [
                {
                    "point": goal.point,
                    "target": whose[goal.x][0],
                    "rows": [whose[goal.x][1], whose[goal.y][1]],
                    "intrinsics": list(goal.intrinsics),
                }
                for goal in camera.goals
            ]
            for camera in self._seen.cameras
        ]

    def close(self) -> None:
        self.ended.set()
        self._aimed.set()  # the loop waits for that, too
        super().close()

    def _visit(self) -> Visitor:
        """A new page; what it holds is let go of when it is gone."""
        page = object()

        def gone() -> None:
            self._jogging.gone(page)
            self._aimed.set()

        return Visitor(self.follow(), lambda text: self.receive(text, page), gone)

    def receive(self, text: str | bytes, page: object = None) -> bool:
        """Queue a page's message for the loop, ignoring invalid ones. False: there is no answer."""
        with suppress(InputError):
            heard = parsed(text)
            if isinstance(heard, Jog):
                self._jogging.hear(heard, page)
            else:
                self._waiting.append(heard)
            if isinstance(heard, Aim | Jog):
                self._aimed.set()
        return False

    def follow(self) -> Callable[[], str]:
        seen, version, plan = -1, -1, 0

        def latest() -> str:
            nonlocal seen, version, plan
            if self._picture is None:  # the page came before the first picture
                return ""
            lines = []
            number, choices = self._choices
            if number != version:
                version, color = number, looks([_kind(choices)])[0].color
                listed = [asdict(choice) for choice in choices]
                lines.append(encode({"type": "choices", "choices": listed, "color": color}))
            if plan != self._plan[0]:
                plan, line = self._plan
                lines.append(line)
            placed, picture = self._picture
            samples = tuple(self._samples)  # looked at once: the loop may add one at any time
            fresh = [sample for count, sample in samples if count > seen]
            seen = samples[-1][0] if samples else seen
            return "\n".join([*lines, *placed, encode({**picture, "samples": fresh})])

        return latest

    def _run(self) -> None:
        driven, dt, owed = self._driven, self._driven.setup.dt, 0.0
        while not self.ended.is_set():
            self._aimed.clear()
            try:
                self._attend()
            except Exception as error:  # of what a page or a plan asked for; the robot goes on
                self._note(error)
            passed = self.clock.passed()
            owed = 0.0 if self._paused or driven.trouble else owed + passed
            try:
                while owed >= dt:
                    self._jogging.prepare()
                    if not driven.step():
                        break
                    owed -= dt
                self._look = driven.look()
            except (Exception, SystemExit) as error:  # a user's function may raise whatever it likes
                driven.trouble = why(error)
            try:
                self._publish(self._look)
            except Exception as error:  # the page gets the picture before, and why
                self._note(error)
                self._repeat()
            try:
                self.changed()
            except NmmError:  # the server has been closed
                return
            if self.clock.rest(self._aimed):
                # What is aimed at shows one step later, not when the next picture is due.
                self.ended.wait(self.clock.until(dt - owed))

    def _note(self, error: Exception) -> None:
        self._notice, self._until = why(error), time.monotonic() + NOTICE

    def _repeat(self) -> None:
        """The picture before, with what went wrong with this one."""
        if self._picture is not None:
            placed, picture = self._picture
            self._picture = placed, {**picture, "told": self._notice, "wrong": True}

    def _offer(self) -> None:
        """Tell the pages what may be chosen; one whose choice was refused shows the present one again."""
        self._choices = self._choices[0] + 1, [*self._driven.choices, *self._jogging.choices]

    def _attend(self) -> None:
        while self._waiting:
            message = self._waiting.popleft()
            with suppress(NmmError):  # no page of ours has that task; what has no value is not aimed at
                self._take(message)
        if self._making is not None and self._making.done():
            try:
                made, standing = self._making.result()
                self._driven.use(made)
                self._planning.begin_again()
                self._jogging.renew(standing)
            except Exception as error:
                self._note(error)
            self._making = None
            self._offer()
        if self._picks and self._making is None:
            key = next(iter(self._picks))
            value = self._picks.pop(key)
            self._making = later(lambda: self._made(key, value))
        self._jogging.paused = self._paused
        jog = self._jogging.wanted
        if self._planning.on and jog is not None:  # who holds on moves it, not a plan
            self._planning.turn(False)
        try:
            self._jogging.attend(jog)
        except Exception as error:
            self._note(error)
        try:
            self._planning.attend()
            if self._plan[0] != self._planning.number:
                line = encode(self._planning.shown(self._drawn, self.shown.now[1]))
                self._plan = self._planning.number, line
        except Exception as error:  # what goes wrong with a plan ends the plan, not the loop
            self._planning.turn(False)
            self._plan = self._planning.number, encode(NO_PLAN)
            self._note(error)

    def _made(self, key: str, value: object) -> tuple[PendingController, Controller]:
        """A controller for a choice, and one that stands by its limits; a resolver new to this machine has to
        be compiled."""
        driven = self._driven
        made = driven.with_choice(key, value)
        with suppress(NmmError):  # the loop meets it again, and reports it
            made.controller.step(driven.t, driven.q, driven.setup.dt)  # the first call compiles
        made.controller.reset()
        return made, self._jogging.standing(made.controller)

    def _take(self, message: Aim | Pick | Order) -> None:
        """Do what a page says; `NmmError` for what cannot be."""
        if isinstance(message, Aim):
            # also of a value that is refused: no page waits for it
            self._heard[message.task] = message.number
            self._driven.aim(message.task, np.array(message.value))
            self._jogging.leave()
            self._planning.aims(message.task)
        elif isinstance(message, Pick):
            if message.key.startswith("jog."):
                try:
                    self._jogging.choose(message.key, message.value)
                finally:
                    self._offer()
            else:
                self._picks[message.key] = message.value
        elif message.what in ("pause", "go"):
            self._paused = message.what == "pause"
        else:
            self._jogging.leave()
            if message.what == "restart":
                self._driven.restart()
                self._planning.begin_again()
            elif message.what == "here":
                self._driven.aim_here()
            else:
                self._planning.turn(message.what == "plan")

    def _publish(self, look: DrivenState) -> None:
        driven = self._driven
        self._count += 1
        if not self._samples or self._samples[-1][1][0] != look.t:
            self._samples.append((self._count, [look.t, *self._values(look)]))
        text, wrong = self._state(look)
        picture: dict[str, Any] = {
            "type": "drive",
            "t": look.t,
            "targets": driven.places,
            "heard": [self._heard.get(task) for task in range(len(driven.places))],
            "at": finite(look.at),
            "paused": self._paused,
            "plans": self._planning.on,
            "jogs": self._jogging.part,
            "base": self._jogging.base_axes,
            "told": text,
            "wrong": wrong,
        }
        self._picture = self.placed(look.t), picture

    def _values(self, look: DrivenState) -> list[float | None]:
        step = look.step
        known: dict[str, Iterable[float]] = {
            "error_norm": [float(np.sqrt(np.nansum(step.error**2)))],
            "error": step.error,
            "objective": [step.objective],
            "sigma_min": [look.sigma_min],
            "scale": [step.scale.min(initial=1.0)],
        }
        seen = live_numbers(self._cameras(look), self.robot, step.q[np.newaxis])[0]
        return finite([*(x for curve in self._curves for x in known[curve.name]), *step.u, *step.q, *seen])

    def _state(self, look: DrivenState) -> tuple[str, bool]:
        if self._driven.trouble:
            return "; ".join(filter(None, [f"Stands still: {self._driven.trouble}", look.against])), True
        if time.monotonic() < self._until:
            return self._notice, True
        if self._planning.on:
            text, wrong = self._planning.words()
            return f"t = {look.t:.1f} s. {text}." if not wrong else text, wrong
        if jogged := self._jogging.words():
            return f"t = {look.t:.1f} s, {jogged}.", False
        if look.against:
            return f"{look.against[0].upper()}{look.against[1:]}.", True
        parts = [f"t = {look.t:.1f} s"]
        if self._making is not None:
            parts.append("another controller is being made")
        if self.clock.lost:
            parts.append(f"{self.clock.lost / FPS:.1f} s of real time skipped: the machine was busy")
        return ", ".join(parts), False


def _kind(choices: Sequence[Choice]) -> str:
    """The kind of the resolver, whose colour the curves have."""
    return str(named(choices, "resolver.kind").value)
