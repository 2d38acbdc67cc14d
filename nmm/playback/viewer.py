"""A robot in a browser, with a slider for each coordinate and its frames: what `nmm view` shows."""

from __future__ import annotations

import threading

from numpy.typing import ArrayLike

from nmm.playback.encoding import encode
from nmm.playback.live import serve
from nmm.playback.page import socket_page
from nmm.playback.server import PageServer
from nmm.playback.viewer_scene import viewer_scene
from nmm.robots.robot import Robot

SCRIPTS = ("viewer_joints.js", "viewer_labels.js", "viewer_frames.js")
STYLES = ("viewer.css",)


def view(
    robot: Robot,
    q: ArrayLike | None = None,
    *,
    frames: bool = True,
    port: int | None = None,
    open_browser: bool = True,
    stop: threading.Event | None = None,
) -> None:
    """Show a robot in a browser, to be moved by hand; returns at Ctrl-C or when `stop` is set.

    The address is printed. Each page that opens it has sliders of its own: the page computes where the
    joints are, from their placements and axes. Only this machine can reach it.

    Parameters
    ----------
    robot : the robot
    q : (n,) m and rad, where it stands at first; when not given, zero, or the limit that is nearest to zero
    frames : whether frames are shown at first: the root link's, each joint's link, and those at the tips
    port : port on 127.0.0.1; a free one when not given
    open_browser : whether to open the page in the user's browser
    stop : ends it when set (by another thread)

    Raises
    ------
    InputError : wrong q; the port is taken, not allowed or not a port
    """
    commands = viewer_scene(robot, robot.rest if q is None else robot.q(q), frames=frames)
    server = PageServer(
        lambda host, token: socket_page(robot.name, host, token, scripts=SCRIPTS, styles=STYLES),
        [encode(command) for command in commands],
        port=port,
    )
    serve(server, "Showing the robot", [robot], open_browser=open_browser, stop=stop)
