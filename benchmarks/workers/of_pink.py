"""Pink (a QP by DAQP): a frame task, a posture task, limits of configuration and velocity.

The error of its frame task is the logarithm of a placement, in which a turn bends the way to a position. So
a position alone is asked for with the orientation that the frame has.
"""

from __future__ import annotations

import numpy as np
import pink
import pinocchio as pin
from loop import POSTURE_GAIN, REGULAR, Peer, Told, serve
from pink.limits import ConfigurationLimit, VelocityLimit
from pink.tasks import FrameTask, PostureTask


class Pink(Peer):
    def __init__(self, told: Told, base: str, limits: bool) -> None:
        super().__init__(told, base, limits)
        model = pin.buildModelFromUrdf(self.urdf)
        if [*model.names][1:] != self.joints:
            raise ValueError(f"expected its joints in the order of the file, got {[*model.names]}")
        self._configuration = pink.Configuration(model, model.createData(), self.q_all)
        self._task = FrameTask(self.frame, position_cost=1.0, orientation_cost=float(self.pose))
        self._target = pin.SE3.Identity()
        posture = PostureTask(cost=self.posture_cost, gain=POSTURE_GAIN * self.dt)
        posture.set_target(self.posture)
        self._tasks = [self._task, posture]
        self._limits = [ConfigurationLimit(model), VelocityLimit(model)] if limits else []

    def displacement(self, T: np.ndarray) -> np.ndarray:
        configuration, dt, target = self._configuration, self.dt, self._target
        configuration.update(self.q_all)
        target.rotation = (
            T[:3, :3] if self.pose else configuration.get_transform_frame_to_world(self.frame).rotation
        )
        target.translation = T[:3, 3]
        self._task.set_target(target)
        return dt * pink.solve_ik(
            configuration, self._tasks, dt, "daqp", REGULAR, limits=self._limits, safety_break=False
        )


if __name__ == "__main__":
    serve(Pink, ("pin-pink", "pin", "daqp", "qpsolvers", "numpy"))
