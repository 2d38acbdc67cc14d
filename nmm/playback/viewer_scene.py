"""The commands of the viewer's page: a robot, where its joints turn, and its frames."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from typing import Any

import numpy as np
import pinocchio as pin

from nmm.arrays import Array
from nmm.playback.drawing import Command, Drawing, DrawnRobot, segment
from nmm.playback.extent import robot_boxes
from nmm.playback.placements import position_and_quaternion
from nmm.playback.rolling import Rolling
from nmm.playback.scene import draw_beside, live_scene, points_beside
from nmm.playback.viewed_task import ViewedTask
from nmm.robots.loading.tips import first_tip, tips
from nmm.robots.motion import Motion
from nmm.robots.robot import Robot

#: Limits beyond this, m or rad, are none.
UNBOUNDED = 1e3
#: About so many points of what stands beside the robot are kept in the picture.
HELD = 60
#: Where a slider ends to which there is no limit: rad, m of the platform, m of the arm.
ANGLE, WAY, REACH = float(np.pi), 3.0, 1.0


def viewer_scene(
    robot: Robot,
    q: Array,
    *,
    frames: bool = True,
    task: ViewedTask | None = None,
    beside: Motion | None = None,
) -> list[Command]:
    """Commands for a robot at q (n,) that the page's sliders move.

    Parameters
    ----------
    frames : whether frames are shown at first
    task : what the page tells of a task
    beside : its desired path, target and bodies are drawn as they are at its first sample
    """
    wheels = Rolling(robot).settled(q)
    boxes = robot_boxes(robot, q[np.newaxis], wheels[np.newaxis])
    seen = np.zeros((0, 3)) if beside is None else points_beside(beside, boxes)
    commands, drawn = live_scene(robot, q, wheels, title=robot.name, room=1.0, seen=seen)
    box = boxes[0]
    length = float(np.clip(0.08 * np.linalg.norm(np.ptp(box, axis=0)), 0.02, 0.25))
    drawing = Drawing()
    if beside is not None:
        draw_beside(drawing, beside, boxes)
    if task is not None:
        task.draw(drawing)
    listed = list(_frames(robot, drawn, drawing))
    drawing.add("joints", coordinates=list(_coordinates(robot, drawn, q)))
    shown_pose = first_tip(robot) or _first_shown(listed)
    drawing.add("frames", frames=listed, shown=frames, length=length, pose=shown_pose)
    if task is not None:
        drawing.commands.append(task.told(q))
    drawing.add("hold", beside=seen[:: max(1, len(seen) // HELD)].tolist())
    # The last command says that everything has come.
    return [*commands[:-1], *drawing.commands, commands[-1]]


def _coordinates(robot: Robot, drawn: DrawnRobot, q: Array) -> Iterator[dict[str, Any]]:
    """Each coordinate: its slider or what it follows, its joint's placement at zero in the parent's frame,
    and its screw: for a unit of it the joint turns by `angular` and slides by `linear`."""
    model = robot.display_model
    neutral = pin.neutral(model)
    followers = {one.joint: one for one in robot.followers}
    for i, (name, unit, (lower, upper)) in enumerate(
        zip(robot.q_names, robot.q_units, robot.q_limits, strict=True)
    ):
        joint = model.getJointId(name)
        data = model.joints[joint].createData()
        model.joints[joint].calc(data, neutral)
        screw = np.array(data.S, dtype=np.float64).reshape(6)
        position, quaternion = position_and_quaternion(model.jointPlacements[joint].homogeneous)
        of_platform = i < robot.platform.n_p
        end = ANGLE if unit == "rad" else WAY if of_platform else REACH
        arms = [arm for arm, joints in robot.arms.items() if name in joints]
        follower = followers.get(name)
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
            "linear": screw[:3].tolist(),
            "angular": screw[3:].tolist(),
        }


def _frames(robot: Robot, drawn: DrawnRobot, drawing: Drawing) -> Iterator[dict[str, Any]]:
    """Each frame that a task may speak of: its node, and whether it is shown at first."""
    model = robot.display_model
    ends = set(tips(robot))
    chosen = {*_joint_links(robot), *ends}
    for i, name in enumerate(robot.frames):
        frame = _frame(model, name)
        if frame is None or name in robot.platform.coordinates[:2]:
            continue  # x and y are steps on the way to the root
        parent = drawn.paths[frame.parentJoint - 1] if frame.parentJoint else drawn.paths[0].rsplit("/", 1)[0]
        path = f"{parent}/frame {i} {segment(name)}"
        drawing.transform(path, np.array(frame.placement.homogeneous))
        yield {"name": name, "path": path, "shown": name in chosen, "tip": name in ends}


def _frame(model: pin.Model, name: str) -> pin.Frame | None:
    """The frame that `Robot.frame_id` means by a name, in the display model."""
    for kind in (pin.FrameType.BODY, pin.FrameType.OP_FRAME):
        if model.existFrame(name, kind):
            return model.frames[model.getFrameId(name, kind)]
    return model.frames[model.getFrameId(name)] if model.existFrame(name) else None


def _joint_links(robot: Robot) -> Iterator[str]:
    """The root link, and the link below each joint of the arm and of the platform, or the joint's own frame
    where there is no link."""
    model, n_p = robot.model, robot.platform.n_p
    root = model.getJointId("theta") if n_p else 0
    joints = [root, *(model.getJointId(name) for name in robot.q_names[3 if n_p else 0 :])]
    for joint in joints:
        links = [
            frame.name
            for frame in model.frames
            if frame.parentJoint == joint
            and frame.type == pin.FrameType.BODY
            and (joint == root or frame.placement.isIdentity(1e-9))
        ]
        yield links[0] if links else str(model.names[joint])


def _first_shown(frames: list[dict[str, Any]]) -> str:
    """The frame whose pose is told at first, of a robot without an arm."""
    return str(next((frame["name"] for frame in frames if frame["shown"]), ""))
