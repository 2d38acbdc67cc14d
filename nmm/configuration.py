"""A robot at a configuration: holding one proves that its kinematics were computed there."""

from __future__ import annotations

from functools import cached_property

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from nmm.robot import Robot

Array = NDArray[np.float64]

#: Velocity of the frame's origin, in world axes.
JACOBIAN_FRAME = pin.LOCAL_WORLD_ALIGNED


class Configuration:
    """Kinematics of `robot` at `q`, in world axes (Pinocchio's LOCAL_WORLD_ALIGNED).

    Parameters
    ----------
    robot : the robot
    q : (n,) coordinates in m and rad, or a mapping from their names

    Raises
    ------
    InputError : wrong length, a number that is not finite, an unknown name
    """

    def __init__(self, robot: Robot, q: ArrayLike) -> None:
        self.robot = robot
        self.q = robot.q(q)
        self.q.flags.writeable = False
        self._data = robot.model.createData()
        pin.computeJointJacobians(robot.model, self._data, self.q)
        self._hessians_computed = False

    @cached_property
    def S(self) -> Array:
        """S(q), shape (n, n_u): q_dot = S(q) u."""
        return self.robot.S(self.q)

    def placement(self, frame: str) -> pin.SE3:
        """Pose of a frame in the world."""
        return pin.SE3(pin.updateFramePlacement(self.robot.model, self._data, self.robot.frame_id(frame)))

    def jacobian(self, frame: str) -> Array:
        """dv/dq_dot of a frame, shape (6, n): linear (m) over angular (rad) rows, in world axes."""
        frame_id = self.robot.frame_id(frame)
        pin.updateFramePlacement(self.robot.model, self._data, frame_id)
        return np.array(
            pin.getFrameJacobian(self.robot.model, self._data, frame_id, JACOBIAN_FRAME), order="C"
        )

    def hessian(self, frame: str) -> Array:
        """H[i, j, k] = d jacobian[i, j] / dq[k], shape (6, n, n).

        Pinocchio returns the array with the wrong memory order; it is put right here.
        """
        if not self._hessians_computed:
            pin.computeJointKinematicHessians(self.robot.model, self._data)
            self._hessians_computed = True
        frame_id = self.robot.frame_id(frame)
        pin.updateFramePlacement(self.robot.model, self._data, frame_id)
        hessian = pin.getFrameKinematicHessian(self.robot.model, self._data, frame_id, JACOBIAN_FRAME)
        return frame_hessian(hessian)


def frame_hessian(raw: Array) -> Array:
    """Pinocchio's kinematic Hessian with its memory order put right (see `Configuration.hessian`)."""
    return np.ascontiguousarray(raw.ravel().reshape(raw.shape, order="F"))


class Kinematics:
    """The kinematics of a few frames, computed over and over in arrays that stay where they are.

    What a control loop uses where a `Configuration` would allocate: `update_at(t, q)` overwrites
    `placements` (k, 3, 4) = [R | p], `jacobians` (k, 6, n) and, if asked for, `hessians`
    (k, 6, n, n) of the k frames, all in world axes.
    """

    def __init__(
        self, robot: Robot, frames: tuple[str, ...], placements: Array, jacobians: Array, hessians: Array
    ) -> None:
        self._model = robot.model
        self._data = robot.model.createData()
        self._frames = []
        for slot, name in enumerate(frames):
            frame_id = robot.frame_id(name)
            placement = self._data.oMf[frame_id]
            # Views of Pinocchio's own memory: they follow updateFramePlacement at no cost.
            self._frames.append(
                (
                    frame_id,
                    placements[slot, :, :3],
                    placement.rotation,
                    placements[slot, :, 3],
                    placement.translation,
                    jacobians[slot],
                )
            )
        self._hessians = hessians

    def update_at(self, t: float, q: Array) -> None:
        """Compute everything at q, shape (n,), float64; the time t is not read."""
        model, data = self._model, self._data
        _compute_jacobians(model, data, q)
        for frame_id, rotation, R, translation, p, jacobian in self._frames:
            _update_placement(model, data, frame_id)
            rotation[...] = R
            translation[...] = p
            jacobian[...] = _frame_jacobian(model, data, frame_id, JACOBIAN_FRAME)
        if self._hessians.size:
            pin.computeJointKinematicHessians(model, data)
            for hessian, frame in zip(self._hessians, self._frames, strict=True):
                hessian[...] = frame_hessian(
                    pin.getFrameKinematicHessian(model, data, frame[0], JACOBIAN_FRAME)
                )


# Looked up once: a control step spends half its time in calls such as these.
_compute_jacobians = pin.computeJointJacobians
_update_placement = pin.updateFramePlacement
_frame_jacobian = pin.getFrameJacobian
