"""How much room robots take while they move: what the camera and the ground have to hold."""

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from nmm.base.arrays import Array, interpolated
from nmm.model.robots.motion import Motion
from nmm.model.robots.robot import Robot
from nmm.model.robots.surroundings import Carried
from nmm.views.playback.keyframes import Keyframes
from nmm.views.playback.placements import Placements, base_position
from nmm.views.playback.rolling import Rolling
from nmm.views.playback.sticks import appearance

_CORNERS = np.array(list(itertools.product((0, 1), repeat=3)))
#: Random poses that measure the room a robot can take.
POSES = 100


def corners(boxes: Array) -> Array:
    """The eight corners (…, 8, 3) of boxes (…, 2, 3) given by their lowest and highest point."""
    return np.stack([boxes[..., _CORNERS[:, axis], axis] for axis in range(3)], axis=-1)


def robot_boxes(robot: Robot, q: Array, wheels: Array, *, carried: Sequence[Carried] = ()) -> Array:
    """Boxes along the world's axes around everything visible, what is carried too, (K, 2, 3) m, for q (K, n)
    and wheels (K, D)."""
    placements = Placements(robot)
    model, visuals = robot.display_model, appearance(robot).shapes
    data, geometry_data = model.createData(), visuals.createData()
    local = [shape_corners(geometry.geometry) for geometry in visuals.geometryObjects]
    boxes = np.empty((len(q), 2, 3))
    for k in range(len(q)):
        at = placements.configuration(q[k], wheels[k])
        pin.updateGeometryPlacements(model, data, visuals, geometry_data, at)
        points = [
            box @ placement.rotation.T + placement.translation
            for box, placement in zip(local, geometry_data.oMg, strict=True)
            if box is not None
        ]
        for item in carried:
            if (box := shape_corners(item.geometry)) is not None:
                frame = model.frames[model.getFrameId(item.frame)]
                place = (data.oMi[frame.parentJoint] * frame.placement).homogeneous @ item.place
                points.append(box @ place[:3, :3].T + place[:3, 3])
        # A robot of shapes without bounds is as large as its skeleton.
        everything = np.vstack(points or [data.oMi[i].translation for i in range(model.njoints)])
        boxes[k] = everything.min(axis=0), everything.max(axis=0)
    return boxes


def extent_of(robot: Robot, q: Array) -> float:
    box = robot_boxes(robot, q[np.newaxis], Rolling(robot).settled(q)[np.newaxis])[0]
    return float(np.linalg.norm(np.ptp(box, axis=0)))


def shape_corners(shape: Any) -> Array | None:
    """Corners of the box around a Coal shape, in its axes, (8, 3) m; None for planes and half-spaces."""
    shape.computeLocalAABB()
    box = np.array([shape.aabb_local.min_, shape.aabb_local.max_])
    return corners(box) if np.all(np.isfinite(box)) and np.all(np.abs(box) < 1e6) else None


def reached(robot: Robot, q: Array, wheels: Array) -> Array:
    """Boxes around the robot at q (n,) and with its joints anywhere in their limits, (POSES + 1, 2, 3)."""
    lower, upper = np.clip(robot.q_limits, -np.pi, np.pi).T
    poses = np.random.default_rng(0).uniform(lower, upper, (POSES, robot.n))
    moving = np.arange(robot.n) >= min(3, robot.platform.n_p)
    poses[:, ~moving] = q[~moving]
    poses = np.vstack([q, robot.following.placed(poses)])
    return robot_boxes(robot, poses, np.tile(wheels, (len(poses), 1)))


def wall(motions: Sequence[Motion]) -> list[float] | None:
    """The normal (2,), towards the robots, of the upright plane nearest to the paths; None without one."""
    paths = [line for motion in motions for line in (motion.desired, motion.driven) if line is not None]
    points = np.vstack(paths)[:, :2] if paths else np.zeros((0, 2))
    if len(points) < 3:
        return None
    middle = points.mean(axis=0)
    spread, axes = np.linalg.eigh(np.cov(points.T))
    if spread[1] < 1e-12:
        return None
    normal = axes[:, 0]
    bases = np.vstack([base_position(motion.robot, motion.q) for motion in motions])
    side = float((bases.mean(axis=0) - middle) @ normal)
    return (-normal if side < 0.0 else normal).tolist()


def middle(motions: Sequence[Motion], frames: Sequence[Keyframes], times: Array) -> Array:
    """Midpoint of the platforms at the times, (times, 2)."""
    places = [
        interpolated(times, frame.t, base_position(motion.robot, frame.q))
        for motion, frame in zip(motions, frames, strict=True)
    ]
    return np.asarray(np.mean(places, axis=0))


def view_points(boxes: Array, motions: Sequence[Motion]) -> Array:
    points = [corners(boxes).reshape(-1, 3)]
    for motion in motions:
        points += [
            line[:: max(1, len(line) // 200)] for line in (motion.driven, motion.desired) if line is not None
        ]
        if motion.believed is not None:
            points.append(np.pad(base_position(motion.robot, motion.believed), ((0, 0), (0, 1)))[::20])
        if motion.target is not None:
            points.append(np.atleast_2d(motion.target))
    return np.vstack(points)


def tag_places(boxes: Array) -> Array:
    """Where names of robots in boxes (…, 2, 3) are, (P, 3): above their middle, as the page writes them."""
    return np.concatenate([boxes.mean(axis=-2)[..., :2], boxes[..., 1, 2:]], axis=-1).reshape(-1, 3)


def held(boxes: Array, middle: Array) -> dict[str, float]:
    """The upright cylinder, m, to keep in view around the middle (K, 2); robot boxes (motions, K, 2, 3)."""
    offsets = corners(boxes)[..., :2] - middle[:, np.newaxis]
    return {
        "radius": float(np.linalg.norm(offsets, axis=-1).max()),
        "low": float(boxes[..., 2].min()),
        "high": float(boxes[..., 2].max()),
    }
