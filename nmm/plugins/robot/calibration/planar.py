"""Many motions in the plane at once: (M, 3) of x, y, theta, m and rad; one at a time they are kernels
(`nmm.base.kernels.planar_motions`)."""

import numpy as np

from nmm.base.arrays import Array


def placed(poses: Array, on_body: Array) -> Array:
    """Where a pose (3,) of a body is while the body is at poses (M, 3): (M, 3)."""
    c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    x, y, yaw = on_body
    return poses + np.stack([c * x - s * y, s * x + c * y, np.full(len(poses), yaw)], axis=1)


def composed(motions: Array) -> Array:
    """Poses (M + 1, 3) from the origin on, by motions (M, 3) in the axes of where each begins."""
    headings = np.concatenate([[0.0], np.cumsum(motions[:, 2])])
    c, s = np.cos(headings[:-1]), np.sin(headings[:-1])
    steps = np.stack([c * motions[:, 0] - s * motions[:, 1], s * motions[:, 0] + c * motions[:, 1]], axis=1)
    return np.column_stack([np.vstack([[0.0, 0.0], np.cumsum(steps, axis=0)]), headings])


def along_body(turned: Array, steps: Array) -> Array:
    """Small steps (M, 3) in the axes of bodies that are turned (M,)."""
    c, s = np.cos(turned), np.sin(turned)
    x, y = steps[:, 0], steps[:, 1]
    return np.stack([c * x + s * y, c * y - s * x, steps[:, 2]], axis=1)


def alignment(places: Array, motions: Array, mount: Array, far: float) -> float:
    """The heading at the first place that lays the next `far` m by wheels along the places."""
    poses = composed(motions)
    beyond = np.flatnonzero(np.hypot(poses[:, 0], poses[:, 1]) > far)
    many = int(beyond[0]) + 1 if len(beyond) else len(poses)
    went, seen = placed(poses, mount)[:many, :2], places[:many]
    went, seen = went - went.mean(axis=0), seen - seen.mean(axis=0)
    cross = np.sum(went[:, 0] * seen[:, 1] - went[:, 1] * seen[:, 0])
    return float(np.arctan2(cross, np.sum(went * seen)))
