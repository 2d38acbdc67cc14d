"""Where a frame is, and how it moves with the coordinates, at many configurations."""

from __future__ import annotations

import numpy as np

from nmm.arrays import Array
from nmm.progress import Progress
from nmm.robots.configuration import kinematics_updater
from nmm.robots.robot import Robot


class FramePath:
    """The kinematics of one frame's origin, some microseconds a configuration.

    Raises
    ------
    InputError : the robot has no frame of that name
    """

    def __init__(self, robot: Robot, frame: str) -> None:
        self.robot, self.frame = robot, frame
        placements, jacobians = np.empty((1, 3, 4)), np.empty((1, 6, robot.n))
        self._origin, self._jacobian = placements[0, :, 3], jacobians[0, :3]
        self._update = kinematics_updater(robot, (frame,), placements, jacobians, np.empty(0))

    def positions(self, q: Array, progress: Progress | None = None) -> Array:
        """Where the origin is (N, 3), m in the world, at q (N, n)."""
        found = np.empty((len(q), 3))
        update, origin = self._update, self._origin
        every = max(1, len(q) // 50)
        for k, point in enumerate(q):
            update(0.0, point)
            found[k] = origin
            if progress is not None and k % every == 0:
                progress(k / len(q))
        return found

    def jacobians(self, q: Array) -> tuple[Array, Array]:
        """Where the origin is (N, 3), and ∂p/∂q (N, 3, n), world axes, at q (N, n)."""
        points, found = np.empty((len(q), 3)), np.empty((len(q), 3, self.robot.n))
        update, origin, jacobian = self._update, self._origin, self._jacobian
        for k, point in enumerate(q):
            update(0.0, point)
            points[k] = origin
            found[k] = jacobian
        return points, found
