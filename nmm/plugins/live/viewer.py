"""A robot in a browser, with its frames and a slider for each coordinate: what `nmm view` shows."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import Array
from nmm.control.functions.function import Function
from nmm.control.functions.program import Program
from nmm.control.functions.tasks.task import Stack, Task
from nmm.model.robots.motion import Motion
from nmm.model.robots.reach import first_tip
from nmm.model.robots.robot import Robot
from nmm.motion.shown_frame import shown_frame
from nmm.plugins.live.session import Session
from nmm.views.playback.drawing import Command, Drawing
from nmm.views.playback.extent import robot_boxes
from nmm.views.playback.frames import axes_length, frame_nodes
from nmm.views.playback.html import HEIGHT, file_page, framed
from nmm.views.playback.placements import joint_screw, position_and_quaternion
from nmm.views.playback.rolling import Rolling
from nmm.views.playback.scene import draw_beside, live_scene, points_beside, still
from nmm.views.playback.shapes import DrawnRobot

if TYPE_CHECKING:
    from nmm.plugins.live.viewed_task import ViewedTask
    from nmm.scenario import Scenario

SCRIPTS = ("viewer_joints.js", "viewer_labels.js", "viewer_frames.js", "viewer_task.js")
STYLES = ("viewer.css",)
#: Limits beyond this, m or rad, are none.
UNBOUNDED = 1e3
#: About this many points beside the robot are kept in view.
HELD = 60
#: A slider's ends where there is no limit: rad, m of the platform, m of the arm.
ANGLE, WAY, REACH = float(np.pi), 3.0, 1.0
#: Instants at which a scenario's desired path is evaluated.
INSTANTS = 400
#: A shorter path, m, is a point.
STANDS = 1e-6


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

    The address is printed; only this machine can reach it. Each page has sliders of its own, and computes
    where the joints are. Of a task, the page shows what the robot can do for it there: singular values of J,
    manipulability, ellipsoids, and what is lost.

    Parameters
    ----------
    q : (n,) m and rad, where it stands at first; when not given, zero, or the limit nearest to zero
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
    viewed = None
    if task is not None:
        from nmm.plugins.live.viewed_task import ViewedTask  # with it comes the whole of the analysis

        several = task.tasks if isinstance(task, Stack) else task if isinstance(task, Sequence) else (task,)
        viewed = ViewedTask(robot, tuple(several), at)
    commands = viewer_scene(robot, at, frames=frames, task=viewed, beside=beside)
    visit = None if viewed is None else viewed.visitor
    session = Session(robot.name, commands, visit, scripts=SCRIPTS, styles=STYLES, port=port)
    session.serve("Showing the robot", [robot], open_browser=open_browser, stop=stop)


def of_robot(robot: Robot) -> str:
    page = file_page(viewer_scene(robot, robot.rest), robot.name, scripts=SCRIPTS, styles=STYLES)
    return framed(page, robot.name, HEIGHT)


def viewer_scene(
    robot: Robot,
    q: Array,
    *,
    frames: bool = True,
    task: ViewedTask | None = None,
    beside: Motion | None = None,
) -> list[Command]:
    """Commands for a robot at q (n,) that the page's sliders move; options as of `view`."""
    wheels = Rolling(robot).settled(q)
    boxes = robot_boxes(robot, q[np.newaxis], wheels[np.newaxis])
    seen = np.zeros((0, 3)) if beside is None else points_beside(beside, boxes)
    commands, drawn = live_scene(robot, q, wheels, title=robot.name, room=1.0, seen=seen)
    length = axes_length(boxes[0])
    drawing = Drawing()
    if beside is not None:
        draw_beside(drawing, beside, boxes, drawn)
    if task is not None:
        task.draw(drawing)
    listed = list(frame_nodes(robot, drawn, drawing))
    drawing.add("joints", coordinates=list(_coordinates(robot, drawn, q)))
    pose = first_tip(robot) or next((frame["name"] for frame in listed if frame["shown"]), "")
    drawing.add("frames", frames=listed, shown=frames, length=length, pose=pose)
    if task is not None:
        drawing.commands.append(task.answer(q))
    drawing.add("hold", beside=seen[:: max(1, len(seen) // HELD)].tolist())
    # The last command tells that all is there.
    return [*commands[:-1], *drawing.commands, commands[-1]]


def _coordinates(robot: Robot, drawn: DrawnRobot, q: Array) -> Iterator[dict[str, Any]]:
    """Each coordinate: its slider or what it follows, its joint's placement at zero in the parent's frame,
    and its screw: for a unit of it the joint turns by `angular` and slides by `linear`."""
    model = robot.display_model
    mimic_joints = {mimic.joint: mimic for mimic in robot.mimic_joints}
    for i, (name, unit, (lower, upper)) in enumerate(
        zip(robot.q_names, robot.q_units, robot.q_limits, strict=True)
    ):
        joint = model.getJointId(name)
        linear, angular = joint_screw(model, joint)
        position, quaternion = position_and_quaternion(model.jointPlacements[joint].homogeneous)
        of_platform = i < robot.platform.n_p
        end = ANGLE if unit == "rad" else WAY if of_platform else REACH
        arms = [arm for arm, joints in robot.arms.items() if name in joints]
        follower = mimic_joints.get(name)
        yield {
            "name": name,
            "follows": None if follower is None else asdict(follower),
            "unit": unit,
            "of": "platform" if of_platform else next(iter(arms), "arm"),
            "lower": float(lower) if abs(lower) < UNBOUNDED else min(-end, float(q[i])),
            "upper": float(upper) if abs(upper) < UNBOUNDED else max(end, float(q[i])),
            "value": float(q[i]),
            "path": drawn.paths[joint - 1],
            "position": position.tolist(),
            "quaternion": quaternion.tolist(),
            "linear": linear.tolist(),
            "angular": angular.tolist(),
        }


def asked_for(scenario: Scenario, robot: Robot) -> Motion:
    """The robot at the scenario's start, in one sample, with desired path, target and obstacles. A path that
    depends on the robot's place, or on tasks that come and go, is left out."""
    q = robot.following.placed(robot.q(scenario.parts.q0))
    tasks = tuple(scenario.controller().task)
    frame = shown_frame(tasks, robot)
    path = frame.path(robot, q[np.newaxis])
    desired, target = None, frame.mark(path)
    if path is not None and frame.rows and not any(task.when for task in tasks):
        times = np.linspace(0.0, float(scenario.parts.duration), INSTANTS)
        r_d = _references(tasks, robot, q, times)
        known = np.isfinite(r_d[:, list(frame.rows.values())]).all(axis=1)
        points = frame.desired(np.repeat(path, INSTANTS, axis=0), r_d)[known]
        if len(points) and np.ptp(points, axis=0).max() > STANDS:
            desired = points
        elif len(points) and target is None:
            target = points[0]
    beside = {"desired": desired, "target": target, "surroundings": scenario.surroundings(robot)}
    return still(robot, q, scenario.obstacles(robot), **beside)


def _references(tasks: tuple[Task, ...], robot: Robot, q: Array, times: Array) -> Array:
    """Targets (N, s) of the tasks' rows at times, s; NaN where they depend on q."""
    program = Program(robot, [task.reference for task in tasks])
    program.lay_out()
    values = []
    for t in times:
        rows = program.evaluate(float(t), q)
        values.append(np.concatenate([np.where(row.value_q.any(axis=1), np.nan, row.value) for row in rows]))
    return np.array(values)
