"""MeshCat live in a browser: motions that are played, or a robot that a control loop moves."""

from __future__ import annotations

import os
import sys
import threading
import webbrowser
from collections.abc import Sequence
from types import TracebackType

import numpy as np
from numpy.typing import ArrayLike

from nmm.arrays import vector
from nmm.playback.encoding import encode
from nmm.playback.page import socket_page
from nmm.playback.rolling import Rolling
from nmm.playback.scene import Shown, live_scene, playback_scene
from nmm.playback.server import PageServer, Visitor
from nmm.playback.sticks import appearance
from nmm.robots.robot import Robot
from nmm.runs.ellipsoid_options import Wanted


def play(
    motions: Sequence[Shown],
    *,
    port: int | None = None,
    open_browser: bool = True,
    title: str | None = None,
    ghosts: int | None = None,
    ellipsoids: Wanted = False,
    stop: threading.Event | None = None,
) -> None:
    """Play motions in a browser, in real time; returns at Ctrl-C or when `stop` is set.

    The address is printed. Each page that opens it plays by itself, with the same controls as the file
    of `write_html`. Only this machine can reach it, and nothing stays behind however the process ends.

    Parameters
    ----------
    motions : at least one run (`Trajectory`) or `Motion`
    port : port on 127.0.0.1; a free one when not given
    open_browser : whether to open the page in the user's browser
    title : heading; the first robot's name when not given
    ghosts : transparent copies of each robot along its way; 6 when not given, 3 of each of several
    ellipsoids : whether manipulability ellipsoids are drawn, or how (`EllipsoidOptions`)
    stop : ends the playback when set (by another thread)

    Raises
    ------
    InputError : no motion; the port is taken, not allowed or not a port; ellipsoids as in `playback_scene`

    Examples
    --------
    >>> from threading import Event, Timer
    >>> ended = Event()
    >>> Timer(0.5, ended.set).start()
    >>> run = nmm.Scenario.load("unicycle_2r_position").run()
    >>> nmm.playback.play([run], open_browser=False, stop=ended)
    Playing at http://127.0.0.1:.../ (Ctrl-C ends it)
    """
    if title is None:
        title = motions[0].robot.name if motions else ""
    heading = title
    commands = playback_scene(motions, title=heading, ghosts=ghosts, autoplay=True, ellipsoids=ellipsoids)
    hello = [encode(command) for command in commands]
    server = PageServer(lambda host, token: socket_page(heading, host, token), hello, port=port)
    serve(server, "Playing", [motion.robot for motion in motions], open_browser=open_browser, stop=stop)


def serve(
    server: PageServer,
    what: str,
    robots: Sequence[Robot],
    *,
    open_browser: bool = True,
    stop: threading.Event | None = None,
) -> None:
    """Print where a server's page is and which links of the robots are drawn without visuals, and return at
    Ctrl-C or when `stop` is set, with the server closed."""
    try:
        announce(server, what, robots, open_browser=open_browser)
        stop = stop or threading.Event()
        # Not for ever at once: on some systems Ctrl-C cannot end that.
        while not stop.wait(timeout=0.5):
            pass
    except KeyboardInterrupt:
        print(flush=True)
    finally:
        server.close()


def announce(server: PageServer, what: str, robots: Sequence[Robot], *, open_browser: bool) -> None:
    """Print where a server's page is, and open it; the rest as `serve`."""
    print(f"{what} at {server.url} (Ctrl-C ends it)", flush=True)
    for note in dict.fromkeys(note for robot in robots for note in appearance(robot).notes()):
        print(note, flush=True)
    if open_browser:
        _open(server.url)


class LiveViewer:
    """A robot in a browser that your own loop moves: `display(q)` returns at once.

        with LiveViewer(robot) as viewer:
            print(viewer.url)
            while ...:
                viewer.display(q)

    Pages are drawn at most 60 times a second, with the newest q; a slow page, or none, costs the loop
    nothing. The server lives in this process, on 127.0.0.1 only, and ends with it.

    Parameters
    ----------
    robot : the robot
    q : where it stands at first; zero when not given
    port : port on 127.0.0.1; a free one when not given
    open_browser : whether to open the page in the user's browser

    Raises
    ------
    InputError : wrong q; the port is taken, not allowed or not a port

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> viewer = nmm.playback.LiveViewer(robot)
    >>> viewer.display(robot.q({"q1": 0.5}))
    >>> viewer.close()
    """

    def __init__(
        self, robot: Robot, q: ArrayLike | None = None, *, port: int | None = None, open_browser: bool = False
    ) -> None:
        self.robot = robot
        self._rolling = Rolling(robot)
        self._state = robot.q(q), self._rolling.settled(robot.q(q))
        commands, self._drawn = live_scene(robot, *self._state, title=robot.name)
        self._server = PageServer(
            lambda host, token: socket_page(robot.name, host, token),
            [encode(command) for command in commands],
            lambda: Visitor(self._pose),
            port=port,
        )
        if open_browser:
            _open(self.url)

    @property
    def url(self) -> str:
        """Address of the page."""
        return self._server.url

    def display(self, q: ArrayLike, wheel_angles: ArrayLike | None = None) -> None:
        """Show the robot at q.

        Parameters
        ----------
        q : (n,) coordinates in m and rad
        wheel_angles : rad, of the wheels, then of their swivels; when not given, the wheels roll from the
            last q to this one

        Raises
        ------
        InputError : wrong lengths, numbers that are not finite
        RunError : the viewer has been closed
        """
        after = self.robot.q(q)
        if wheel_angles is None:
            before, turned = self._state
            wheels = self._rolling.angles(np.array([before, after]), start=turned)[-1]
        else:
            wheels = vector(wheel_angles, len(self._rolling.joints), "wheel_angles")
        self._state = after, wheels
        self._server.changed()

    def _pose(self) -> str:
        """The newest placements as a command; the server's thread asks for it."""
        return encode(self._drawn.pose(*self._state))

    def close(self) -> None:
        """End the server and free its port; again is nothing."""
        self._server.close()

    def __enter__(self) -> LiveViewer:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()


def _open(url: str) -> None:
    """Open the user's browser, if there is a screen: a browser for the terminal would take it over."""
    screen = sys.platform in ("darwin", "win32") or any(
        os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER")
    )
    if screen:
        # Some browsers keep the one who opened them waiting.
        threading.Thread(target=webbrowser.open, args=(url,), daemon=True).start()
