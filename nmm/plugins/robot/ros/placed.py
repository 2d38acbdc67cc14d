"""Where all frames of a robot are, as logs and streams tell it: the world, odometry, the base, every link."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from nmm.base.arrays import Array
from nmm.model.robots.robot import Robot
from nmm.plugins.robot.ros.links import Links, Transform
from nmm.views.playback.placements import position_and_quaternion

#: The frames of REP-105 in which a robot stands.
MAP, ODOM = "map", "odom"


class PlacedFrames:
    """The tree odom → base → every link, below map in a run with odometry of its own (`believed`).

    world : the frame in which the robot is where it is
    ground : what points of the world are multiplied by: x and y count from the ground's frame, which the
        tree calls odom, or map, and a root may stand elsewhere
    links : every link, from the base on
    still : the transforms that do not change
    """

    def __init__(self, robot: Robot, base: str, odom: str = ODOM, *, believed: bool = False) -> None:
        self.robot, self.base, self.odom, self.believed = robot, base, odom, believed
        self.world = MAP if believed else odom
        self.links = Links(robot, base)
        self.ground = robot.model.jointPlacements[1].inverse() if robot.platform.n_p else pin.SE3.Identity()
        self.still: list[Transform] = [
            *self.links.fixed,
            *((self.world, name, *position_and_quaternion((self.ground * place).homogeneous))
              for name, place in self.links.ground),
        ]  # fmt: skip

    def stand(self, q: Array) -> Array:
        """The platform's pose (4, 4) at q (n,); that of a fixed base is none."""
        return planar_matrix(q if self.robot.platform.n_p else np.zeros(3))

    def at(self, q: Array, seen: Array, wheels: Array) -> list[Transform]:
        """The transforms that change, at q (n,) with odometry at `seen` (n,) and the wheels' angles (D,)."""
        stand = self.stand(seen)
        frames: list[Transform] = [(self.odom, self.base, *position_and_quaternion(stand))]
        if self.believed:
            off = self.stand(q) @ np.linalg.inv(stand)
            frames.append((self.world, self.odom, *position_and_quaternion(off)))
        return [*frames, *self.links.moving(q, wheels)]


def planar_matrix(q: Array) -> Array:
    """The platform's pose (4, 4) at q."""
    x, y, theta = q[:3]
    c, s = np.cos(theta), np.sin(theta)
    return np.array([[c, -s, 0, x], [s, c, 0, y], [0, 0, 1, 0], [0, 0, 0, 1]], dtype=np.float64)
