"""A page that is open while something happens: its server, messages, clock, and how it ends."""

import json
import math
import os
import sys
import threading
import time
import webbrowser
from collections import deque
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from types import TracebackType
from typing import Any, Self

import numpy as np

from nmm.base.errors import InputError, expect
from nmm.base.resolver_style import RunStyle
from nmm.model.collisions.obstacle import Obstacle
from nmm.model.robots.motion import Camera
from nmm.model.robots.robot import Robot
from nmm.model.robots.surroundings import NO_SURROUNDINGS, Surroundings
from nmm.plugins.live.server import PageServer, Visitor
from nmm.views.playback.cameras import draw_camera, tell_cameras
from nmm.views.playback.channels import Channel, Channels, draw_curves
from nmm.views.playback.drawing import Command, Drawing, encode
from nmm.views.playback.extent import robot_boxes
from nmm.views.playback.html import socket_page
from nmm.views.playback.rolling import RolledRobot
from nmm.views.playback.scene import draw_beside, live_scene, still
from nmm.views.playback.sticks import appearance

FPS = 30.0
#: The clock skips the time of a picture later than this, s.
LATE = 0.25
#: Pictures on their way to a page at most: more would only delay them.
AHEAD = 2
NAMED = 4


class Session:
    """A page that is open while something happens: a motion played, a run computed, a robot driven.

    The server, on 127.0.0.1 only, ends with the process. The session's own thread (`begin`) or the caller
    changes what pages show; a new page gets the scene's commands, then what its visitor has. `ended` is set
    when the session ends. `InputError` of a port as `PageServer`.
    """

    def __init__(
        self,
        title: str,
        commands: Sequence[Command],
        visit: Callable[[], Visitor] | None = None,
        *,
        scripts: Sequence[str] = (),
        styles: Sequence[str] = (),
        port: int | None = None,
    ) -> None:
        self.ended = threading.Event()
        self.clock = Clock()
        self._thread: threading.Thread | None = None
        self._server = PageServer(
            lambda host, token: socket_page(title, host, token, scripts, styles),
            [encode(command) for command in commands],
            visit,
            port=port,
        )
        self.url = self._server.url

    def begin(self, loop: Callable[[], None], name: str) -> None:
        """Run a loop in a thread of that name; it returns when `ended` is set."""
        self._thread = threading.Thread(target=loop, name=name, daemon=True)
        self._thread.start()

    def changed(self) -> None:
        """Send pages what is new, without waiting for any; `RunError` once closed."""
        self._server.changed()

    def announce(self, what: str, robots: Sequence[Robot], *, open_browser: bool) -> None:
        """Print where the page is, and which links are drawn without visuals; open the user's browser."""
        print(f"{what} at {self.url} (Ctrl-C ends it)", flush=True)
        for note in dict.fromkeys(note for robot in robots for note in appearance(robot).notes()):
            print(note, flush=True)
        if open_browser:
            self.open_browser()

    def open_browser(self) -> None:
        """Open the user's browser, if there is a screen: a text browser would take over the terminal."""
        screen = sys.platform in ("darwin", "win32") or any(
            os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER")
        )
        if screen:
            # Some browsers block their caller.
            threading.Thread(target=webbrowser.open, args=(self.url,), daemon=True).start()

    def serve(
        self, what: str, robots: Sequence[Robot], *, open_browser: bool, stop: threading.Event | None = None
    ) -> None:
        """Announce the page, and return at Ctrl-C or when `stop` is set, with the session closed."""
        with self.ending():
            self.announce(what, robots, open_browser=open_browser)
            self.wait(stop)

    def wait(self, stop: threading.Event | None = None, then: Callable[[], None] = lambda: None) -> None:
        """Return when `stop` is set; `then` is called twice a second."""
        stop = stop or threading.Event()
        # With a timeout: on some systems Ctrl-C cannot interrupt an endless wait.
        while not stop.wait(timeout=0.5):
            then()

    @contextmanager
    def ending(self, last: Callable[[], None] = lambda: None) -> Iterator[None]:
        """Ctrl-C ends the block quietly; however it ends, `last` is called and the session closed."""
        try:
            yield
        except KeyboardInterrupt:
            print(flush=True)
        finally:
            last()
            self.close()

    def close(self) -> None:
        """End the thread and the server, and free its port; a second call does nothing."""
        self.ended.set()
        if self._thread is not None:
            self._thread.join(timeout=5.0)
        self._server.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()


class RobotSession(Session):
    """A session whose page shows one robot where it is now, what its cameras see, and, with a look,
    obstacles, surroundings and curves of channels, empty at first; `further` commands follow the scene's,
    `page` are options of `Session`."""

    def __init__(
        self,
        shown: RolledRobot,
        title: str,
        visit: Callable[[], Visitor],
        *,
        obstacles: Sequence[Obstacle] = (),
        surroundings: Surroundings = NO_SURROUNDINGS,
        channels: Sequence[Channel] = (),
        look: RunStyle | None = None,
        cameras: Sequence[Camera] = (),
        further: Sequence[Command] = (),
        **page: Any,
    ) -> None:
        self.shown, self.robot = shown, shown.robot
        self._obstacles = tuple(obstacles)
        q, wheels = shown.now
        reach = float(self.robot.reach)
        room = 2.0 if look is None else reach
        commands, self._drawn = live_scene(self.robot, q, wheels, title=title, room=room)
        drawing = Drawing()
        for i, camera in enumerate(cameras):
            draw_camera(drawing, camera, self._drawn, "/nmm/motion 0", i, 2.0 * reach)
        tell_cameras(drawing, cameras)
        if look is not None:
            boxes = robot_boxes(self.robot, q[np.newaxis], wheels[np.newaxis])
            beside = still(self.robot, q, self._obstacles, surroundings=surroundings)
            draw_beside(drawing, beside, boxes, self._drawn, size=2.0 * reach)
            draw_curves(drawing, [Channels(np.zeros(0), 0, tuple(channels))], [look], 0.0)
        # A scene's last command tells that it is complete.
        self.commands = [*commands[:-1], *drawing.commands, commands[-1], *further]
        super().__init__(title, self.commands, visit, **page)

    def placed(self, t: float) -> list[str]:
        """Lines that put the robot where it is now, and obstacles that move where they are at t, s."""
        transforms = [
            [f"/nmm/obstacle {i}", np.array(obstacle.placement(t)).T.ravel().tolist()]
            for i, obstacle in enumerate(self._obstacles)
            if obstacle.moves
        ]
        return [encode({"type": "places", "transforms": transforms}), self.pose()]

    def pose(self) -> str:
        """The line that puts the robot where it is now."""
        return encode(self._drawn.pose(*self.shown.now))


class Clock:
    """Real time by picture: `lost` counts pictures of skipped time, `late` those not made when due."""

    def __init__(self) -> None:
        self.lost = self.late = 0
        self.stand()

    def stand(self) -> None:
        self._now = self._due = time.monotonic()

    def passed(self) -> float:
        """Seconds since the last call; instead of more than `LATE`, one picture's time."""
        before, self._now = self._now, time.monotonic()
        gone = self._now - before
        if gone <= LATE:
            return gone
        self.lost += math.ceil(gone * FPS) - 1
        return 1.0 / FPS

    def rest(self, woken: threading.Event, *, stands: bool = False) -> bool:
        """Wait until the next picture is due, or `woken` is set, and tell which; while time stands nothing is
        late."""
        behind = self._now - self._due
        if stands or behind < 0.0:
            self._due = self._now
        elif behind > 1.0 / FPS:
            late = int(behind * FPS)
            self.late += late
            # The rest of a picture's time is not forgotten, except where time is skipped.
            self._due = self._due + late / FPS if behind <= LATE else self._now
        self._due += 1.0 / FPS
        return woken.wait(max(0.0, self._due - time.monotonic()))

    def until(self, seconds: float) -> float:
        """How long it is until so many seconds after the last `passed`, s; 0 when they are over."""
        return max(0.0, self._now + seconds - time.monotonic())


def message(text: str | bytes, kinds: Mapping[str, Collection[str]]) -> dict[str, Any]:
    """A page's message: JSON with a "type" among `kinds` and exactly that kind's keys; else `InputError`."""
    try:
        data = json.loads(text)
    except (ValueError, RecursionError):
        data = None
    kind = data.get("type") if isinstance(data, dict) else None
    if not isinstance(data, dict) or not isinstance(kind, str) or kind not in kinds:
        raise InputError(where="message", expected=f"JSON of a type among {', '.join(kinds)}")
    whole = data.keys() == {"type", *kinds[kind]}
    expect(whole, f"message {kind}", f"the keys {', '.join(kinds[kind])}")
    return data


class Watching:
    """One page, which gets the pictures after number `made` in order, and answers each with how many it has
    `drawn`. One that does not answer gets no more; it misses pictures and delays no other."""

    def __init__(self, made: int) -> None:
        self._first = self._last = self._answered = made
        self._sent = 0
        self._waiting: deque[int] = deque()
        self._left: int | None = None
        self.drawn = 0

    def takes(self, number: int) -> bool:
        """Whether the picture of that number is sent now; if so, it is on its way."""
        if number == self._last or len(self._waiting) >= AHEAD:
            return False
        self._last = number
        self._sent += 1
        self._waiting.append(number)
        return True

    def heard(self, text: str | bytes) -> bool:
        try:
            data = message(text, {"drawn": ("picture", "drawn")})
        except InputError:
            return False
        picture, drawn = data["picture"], data["drawn"]
        if type(picture) is not int or type(drawn) is not int:
            return False
        if not (self._answered < picture <= self._last and self.drawn < drawn <= self._sent):
            return False
        self._answered, self.drawn = picture, drawn
        while self._waiting and self._waiting[0] <= picture:
            self._waiting.popleft()
        return True

    def has_drawn(self, number: int) -> bool:
        """Whether the picture is drawn, or never will be because the page is closed."""
        return self._left is not None or self._answered >= number

    def leaves(self, made: int) -> None:
        self._left = made

    def dropped(self, made: int) -> int:
        """How many pictures up to `made` it missed since it came, without those on their way."""
        last = made if self._left is None else self._left
        return max(0, last - self._first - self.drawn - len(self._waiting))


def counted(pages: Sequence[Watching], made: int) -> str:
    texts = [f"drew {page.drawn} and dropped {page.dropped(made)}" for page in pages[:NAMED]]
    if len(pages) <= 1:
        return "".join(f"the page {text}" for text in texts) or "no page was open"
    more = f", {len(pages) - NAMED} more" if len(pages) > NAMED else ""
    return ", ".join(f"page {i} {text}" for i, text in enumerate(texts, 1)) + more
