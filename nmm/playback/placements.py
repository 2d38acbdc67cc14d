"""Where the display model's joints are for coordinates and wheel angles."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from nmm.arrays import Array
from nmm.errors import RobotError
from nmm.robots.robot import Robot


def rolling_joints(robot: Robot) -> tuple[str, ...]:
    """Names of the D joints of the display model that are no coordinates: the wheels', then their swivels'.

    Playback's arrays of wheel angles, (D,) rad, are in this order.
    """
    swivels = dict.fromkeys(wheel.swivel for wheel in robot.wheels if wheel.swivel)
    return (*(wheel.joint for wheel in robot.wheels), *swivels)


def base_position(robot: Robot, q: Array) -> Array:
    """x and y of the platform, (..., 2) m, for coordinates q (..., n); a fixed base stands at the origin."""
    return q[..., :2] if robot.platform.n_p else np.zeros((*q.shape[:-1], 2))


class Placements:
    """Forward kinematics of `robot.display_model`, joints 1 to njoints - 1 in Pinocchio's order.

    Raises
    ------
    RobotError : the display model lacks a coordinate or a wheel of the robot
    """

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self.model = robot.display_model
        self._data = self.model.createData()
        self._coordinates = [self._index(name) for name in robot.q_names]
        self._wheels = [self._index(name) for name in rolling_joints(robot)]
        self._neutral = pin.neutral(self.model)

    def _index(self, name: str) -> int:
        model = self.model
        if not model.existJointName(name):
            raise RobotError(
                f"{self.robot.name}: expected a joint {name!r} in the display model, there is none"
            )
        joint = model.joints[model.getJointId(name)]
        if joint.nq != 1:
            raise RobotError(f"{self.robot.name}: expected one number for joint {name!r}, it has {joint.nq}")
        return int(joint.idx_q)

    def configuration(self, q: Array, wheels: Array) -> Array:
        """The display model's configuration for coordinates q (n,) and wheel angles (D,) rad."""
        full = self._neutral.copy()
        full[self._coordinates] = q
        full[self._wheels] = wheels
        return full

    def relative(self, q: Array, wheels: Array) -> Array:
        """Placement of each joint in its parent joint's frame, (joints, 4, 4)."""
        pin.forwardKinematics(self.model, self._data, self.configuration(q, wheels))
        return np.array([self._data.liMi[i].homogeneous for i in range(1, self.model.njoints)]).reshape(
            -1, 4, 4
        )

    def world(self, q: Array, wheels: Array) -> Array:
        """Placement of each joint in the world, (joints, 4, 4)."""
        pin.forwardKinematics(self.model, self._data, self.configuration(q, wheels))
        return np.array([self._data.oMi[i].homogeneous for i in range(1, self.model.njoints)]).reshape(
            -1, 4, 4
        )


def position_and_quaternion(matrices: Array) -> tuple[Array, Array]:
    """Positions (…, 3) and quaternions (…, 4) in the order x, y, z, w, of placements (…, 4, 4)."""
    flat = matrices.reshape(-1, 4, 4)
    quaternions = np.array([pin.Quaternion(np.ascontiguousarray(m[:3, :3])).coeffs() for m in flat])
    shape = matrices.shape[:-2]
    return flat[:, :3, 3].reshape(*shape, 3), quaternions.reshape(*shape, 4)
