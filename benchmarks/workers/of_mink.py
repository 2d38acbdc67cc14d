"""mink (a QP by DAQP, kinematics by MuJoCo): frame task, posture task, limits of configuration and velocity.

MuJoCo reads the URDF itself. As with Pink, a position alone is asked for with the frame's own orientation.
"""

from __future__ import annotations

from pathlib import Path

import mink
import mujoco
import numpy as np
from loop import POSTURE_GAIN, REGULAR, Peer, Told, serve


class Mink(Peer):
    def __init__(self, told: Told, base: str, limits: bool) -> None:
        super().__init__(told, base, limits)
        model = mujoco.MjModel.from_xml_string(Path(self.urdf).read_text())
        names = [mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_JOINT, k) for k in range(model.njnt)]
        if names != self.joints:
            raise ValueError(f"expected its joints in the order of the file, got {names}")
        self._configuration = mink.Configuration(model, self.q_all)
        self._task = mink.FrameTask(self.frame, "body", position_cost=1.0, orientation_cost=float(self.pose))
        posture = mink.PostureTask(model, cost=self.posture_cost, gain=POSTURE_GAIN * self.dt)
        posture.set_target(self.posture)
        self._tasks = [self._task, posture]
        fastest = dict(zip(self.joints, self.fastest.tolist(), strict=True))
        self._limits = [mink.ConfigurationLimit(model), mink.VelocityLimit(model, fastest)] if limits else []

    def displacement(self, T: np.ndarray) -> np.ndarray:
        configuration, dt = self._configuration, self.dt
        configuration.update(self.q_all)
        if self.pose:
            target = mink.SE3.from_matrix(T)
        else:
            held = configuration.get_transform_frame_to_world(self.frame, "body").rotation()
            target = mink.SE3.from_rotation_and_translation(held, T[:3, 3])
        self._task.set_target(target)
        return dt * mink.solve_ik(configuration, self._tasks, dt, "daqp", REGULAR, limits=self._limits)


if __name__ == "__main__":
    serve(Mink, ("mink", "mujoco", "daqp", "qpsolvers", "numpy"))
