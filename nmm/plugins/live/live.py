"""MeshCat live in a browser: motions played, or a robot that a control loop moves."""

from __future__ import annotations

import threading
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import vector
from nmm.base.ellipsoid_options import Wanted
from nmm.model.robots.robot import Robot
from nmm.plugins.live.server import Visitor
from nmm.plugins.live.session import RobotSession, Session
from nmm.views.playback.rolling import RolledRobot
from nmm.views.playback.scene import Shown, playback_scene


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

    The address is printed. Each page that opens it plays by itself, with the controls of `write_html`. Only
    this machine can reach it, and nothing stays behind however the process ends.

    Parameters
    ----------
    motions : at least one run (`Trajectory`) or `Motion`
    port : port on 127.0.0.1; a free one when not given
    open_browser : whether to open the page in the user's browser
    title, ghosts, ellipsoids : as of `write_html`
    stop : ends the playback when set (by another thread)

    Raises
    ------
    InputError : no motion; the port is taken, not allowed or not a port; ellipsoids as in `write_html`

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
    commands = playback_scene(motions, title=title, ghosts=ghosts, autoplay=True, ellipsoids=ellipsoids)
    session = Session(title, commands, port=port)
    session.serve("Playing", [motion.robot for motion in motions], open_browser=open_browser, stop=stop)


class LiveViewer(RobotSession):
    """A robot in a browser that your own loop moves: `display(q)` returns at once.

        with LiveViewer(robot) as viewer:
            print(viewer.url)
            while ...:
                viewer.display(q)

    Pages are drawn at most 60 times a second, with the newest q; a slow page, or none, costs the loop
    nothing. The server lives in this process, on 127.0.0.1 only, and ends with it.

    Parameters
    ----------
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
        super().__init__(RolledRobot(robot, robot.q(q)), robot.name, lambda: Visitor(self.pose), port=port)
        if open_browser:
            self.open_browser()

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
            self.shown.roll(after[np.newaxis])
        else:
            angles = vector(wheel_angles, len(self.shown.rolling.joints), "wheel_angles")
            self.shown.now = after, angles
        self.changed()
