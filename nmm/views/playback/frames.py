"""A robot's frames in a page: a node for each, at which its axes are drawn."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pinocchio as pin

from nmm.base.arrays import Array
from nmm.model.robots.reach import tips
from nmm.model.robots.robot import Robot
from nmm.views.playback.drawing import Drawing, segment
from nmm.views.playback.shapes import DrawnRobot


def axes_length(box: Array) -> float:
    """Of the axes of a robot's frames, m; box (2, 3) : its least and largest coordinates, m."""
    return float(np.clip(0.08 * np.linalg.norm(np.ptp(box, axis=0)), 0.02, 0.25))


def frame_nodes(
    robot: Robot, drawn: DrawnRobot, drawing: Drawing, *, every: bool = True
) -> Iterator[dict[str, Any]]:
    """The name and node of each frame that a task may name, and whether it and its name are shown at first;
    unless `every`, of those that are."""
    model = robot.display_model
    ends = set(tips(robot))
    links = list(_joint_links(robot))
    chosen, named = {*links, *ends}, {links[0], *ends}
    for i, name in enumerate(robot.frames):
        frame = _frame(model, name)
        if frame is None or name in robot.platform.coordinates[:2]:
            continue  # x and y are steps on the way to the root
        if not every and name not in chosen:
            continue
        parent = drawn.paths[frame.parentJoint - 1] if frame.parentJoint else drawn.paths[0].rsplit("/", 1)[0]
        path = f"{parent}/frame {i} {segment(name)}"
        drawing.transform(path, np.array(frame.placement.homogeneous))
        yield {"name": name, "path": path, "shown": name in chosen, "named": name in named}


def _frame(model: pin.Model, name: str) -> pin.Frame | None:
    """The display model's frame of that name, chosen as by `Robot.frame_id`."""
    for kind in (pin.FrameType.BODY, pin.FrameType.OP_FRAME):
        if model.existFrame(name, kind):
            return model.frames[model.getFrameId(name, kind)]
    return model.frames[model.getFrameId(name)] if model.existFrame(name) else None


def _joint_links(robot: Robot) -> Iterator[str]:
    """The root link and the link below each joint, or the joint's own frame where there is no link."""
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
