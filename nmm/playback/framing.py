"""What a camera has to hold: the room that robots take, their paths, their names; and where to look from."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from nmm.arrays import Array, interpolated
from nmm.playback.extent import corners, robot_boxes
from nmm.playback.keyframes import Keyframes
from nmm.playback.placements import base_position
from nmm.robots.motion import Motion
from nmm.robots.robot import Robot

#: A robot's name tag is so much higher than the robot.
TAG = 1.1
#: Poses for the room that a robot can take.
POSES = 100


def reached(robot: Robot, q: Array, wheels: Array) -> Array:
    """Boxes around the robot at q (n,) and with its joints anywhere in their limits, (POSES + 1, 2, 3)."""
    lower, upper = np.clip(robot.q_limits, -np.pi, np.pi).T
    poses = np.random.default_rng(0).uniform(lower, upper, (POSES, robot.n))
    moving = np.arange(robot.n) >= min(3, robot.platform.n_p)
    poses[:, ~moving] = q[~moving]
    poses = np.vstack([q, robot.following.placed(poses)])
    return robot_boxes(robot, poses, np.tile(wheels, (len(poses), 1)))


def wall(motions: Sequence[Motion]) -> list[float] | None:
    """The normal (2,) of the upright plane that the paths lie nearest to, towards the robots; None without
    one."""
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


def boxes_around(motions: Sequence[Motion], frames: Sequence[Keyframes], times: Array) -> Array:
    """Boxes around the robots at the times, (motions, times, 2, 3)."""
    return np.array(
        [
            robot_boxes(
                motion.robot,
                interpolated(times, frame.t, frame.q),
                interpolated(times, frame.t, frame.wheels),
            )
            for motion, frame in zip(motions, frames, strict=True)
        ]
    )


def middle(motions: Sequence[Motion], frames: Sequence[Keyframes], times: Array) -> Array:
    """Midpoint of the platforms at the times, (times, 2)."""
    places = [
        interpolated(times, frame.t, base_position(motion.robot, frame.q))
        for motion, frame in zip(motions, frames, strict=True)
    ]
    return np.asarray(np.mean(places, axis=0))


def view_points(boxes: Array, motions: Sequence[Motion]) -> Array:
    """Points that the camera has to hold, (P, 3)."""
    points = [corners(boxes).reshape(-1, 3)]
    for motion in motions:
        points += [
            line[:: max(1, len(line) // 200)] for line in (motion.driven, motion.desired) if line is not None
        ]
        if motion.target is not None:
            points.append(np.atleast_2d(motion.target))
    return np.vstack(points)


def tag_places(motions: Sequence[Motion], boxes: Array, times: Array) -> Array:
    """Where the motions' name tags are at the times, (P, 3); the page writes them so high above the roots."""
    found = []
    for i, motion in enumerate(motions):
        at = interpolated(times, motion.t, base_position(motion.robot, motion.q))
        found.append(np.column_stack([at, np.full(len(at), TAG * boxes[i, 0, 1, 2])]))
    return np.vstack(found)


def held(boxes: Array, middle: Array) -> dict[str, float]:
    """What a camera holds that follows the robots' middle: an upright cylinder, m.

    Parameters
    ----------
    boxes : (motions, K, 2, 3) around the robots at K instants
    middle : (K, 2) the robots' middle then
    """
    offsets = corners(boxes)[..., :2] - middle[:, np.newaxis]
    return {
        "radius": float(np.linalg.norm(offsets, axis=-1).max()),
        "low": float(boxes[..., 2].min()),
        "high": float(boxes[..., 2].max()),
    }
