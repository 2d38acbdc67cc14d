"""A robot in a browser, with a slider for each coordinate and its frames: what `nmm view` shows."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from typing import TYPE_CHECKING

from numpy.typing import ArrayLike

from nmm.arrays import Array
from nmm.functions.function import Function
from nmm.functions.tasks.task import Stack, Task
from nmm.playback.encoding import encode
from nmm.playback.live import serve
from nmm.playback.page import socket_page
from nmm.playback.server import PageServer
from nmm.playback.viewer_scene import viewer_scene
from nmm.robots.motion import Motion
from nmm.robots.robot import Robot

if TYPE_CHECKING:
    from nmm.playback.viewed_task import ViewedTask

SCRIPTS = ("viewer_joints.js", "viewer_labels.js", "viewer_frames.js", "viewer_task.js")
STYLES = ("viewer.css",)


def view(
    robot: Robot,
    q: ArrayLike | None = None,
    *,
    frames: bool = True,
    task: Task | Function | Sequence[Task | Function] | None = None,
    beside: Motion | None = None,
    port: int | None = None,
    open_browser: bool = True,
    stop: threading.Event | None = None,
) -> None:
    """Show a robot in a browser, to be moved by hand; returns at Ctrl-C or when `stop` is set.

    The address is printed. Each page that opens it has sliders of its own: the page computes where the
    joints are, from their placements and axes. Of a task the program tells what the robot can do for it
    where the sliders are: singular values of J, manipulability, ellipsoids, and what is lost. Only this
    machine can reach it.

    Parameters
    ----------
    robot : the robot
    q : (n,) m and rad, where it stands at first; when not given, zero, or the limit that is nearest to zero
    frames : whether frames are shown at first: the root link's, each joint's link, and those at the tips
    task : what the robot shall do: one task or several, or functions of the robot alone
    beside : what stands around it: the desired path, the target and the bodies of a motion
    port : port on 127.0.0.1; a free one when not given
    open_browser : whether to open the page in the user's browser
    stop : ends it when set (by another thread)

    Raises
    ------
    InputError : wrong q; a task of more rows than the robot has inputs; the port is taken, not allowed or
        not a port

    Examples
    --------
    >>> from threading import Event, Timer
    >>> ended = Event()
    >>> Timer(0.5, ended.set).start()
    >>> nmm.playback.view(nmm.load("unicycle_3r"), open_browser=False, stop=ended)
    Showing the robot at http://127.0.0.1:.../ (Ctrl-C ends it)
    """
    at = robot.rest if q is None else robot.q(q)
    viewed = None if task is None else _viewed(robot, task, at)
    commands = viewer_scene(robot, at, frames=frames, task=viewed, beside=beside)
    server = PageServer(
        lambda host, token: socket_page(robot.name, host, token, scripts=SCRIPTS, styles=STYLES),
        [encode(command) for command in commands],
        None if viewed is None else viewed.visitor,
        port=port,
    )
    serve(server, "Showing the robot", [robot], open_browser=open_browser, stop=stop)


def _viewed(robot: Robot, task: Task | Function | Sequence[Task | Function], q: Array) -> ViewedTask:
    # Not before: with it comes the whole of the analysis.
    from nmm.playback.viewed_task import ViewedTask

    several = task.tasks if isinstance(task, Stack) else task if isinstance(task, Sequence) else (task,)
    return ViewedTask(robot, tuple(several), q)
