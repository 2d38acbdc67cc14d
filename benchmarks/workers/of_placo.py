"""placo's kinematics solver (a QP), its floating base masked: position or frame, joints' task, limits."""

from __future__ import annotations

import numpy as np
import placo
from loop import POSTURE_COST, REGULAR, Peer, Told, serve


class Placo(Peer):
    def __init__(self, told: Told, base: str, limits: bool) -> None:
        self._robot = None
        super().__init__(told, base, limits)
        robot = placo.RobotWrapper(self.urdf, placo.Flags.ignore_collisions)
        solver = placo.KinematicsSolver(robot)
        solver.mask_fbase(True)
        solver.dt = self.dt
        solver.enable_joint_limits(limits)
        solver.enable_velocity_limits(limits)
        if [*robot.joint_names()] != self.joints:
            raise ValueError(f"expected its joints in the order of the file, got {[*robot.joint_names()]}")
        if self.pose:
            self._task = solver.add_frame_task(self.frame, np.eye(4))
            self._task.configure("frame", "soft", 1.0, 1.0)
        else:
            self._task = solver.add_position_task(self.frame, np.zeros(3))
            self._task.mask.set_axises("xy")
            self._task.configure("frame", "soft", 1.0)
        # Its tasks have no gain and go to their targets at once: a posture, too, however light.
        self._posture = solver.add_joints_task()
        self._posture.configure("posture", "soft", POSTURE_COST**2)
        self._posture.set_joints(dict(zip(told["arm"], told["posture"], strict=True)))
        solver.add_regularization_task(REGULAR)
        self._robot, self._solver = robot, solver
        self.reset()

    def reset(self) -> None:
        super().reset()
        if self._robot is not None:
            for name, value in zip(self.joints, self.q_all.tolist(), strict=True):
                self._robot.set_joint(name, value)
            self._robot.update_kinematics()

    def displacement(self, T: np.ndarray) -> np.ndarray:
        if self.pose:
            self._task.T_world_frame = T
        else:
            self._task.target_world = T[:3, 3]
        return self._solver.solve(True)[6:]

    def step(self, k: int) -> None:
        """Its robot keeps the joints' positions itself, and integrates them."""
        dq = self.displacement(self.base.target(k))
        if self.rolls:
            self.base.move(dq.item(0), dq.item(1))
            self._robot.set_joint("forward", 0.0)
            self._robot.set_joint("turn", 0.0)
        self._robot.update_kinematics()

    def q(self) -> list[float]:
        self.q_all[:] = [self._robot.get_joint(name) for name in self.joints]
        return super().q()


if __name__ == "__main__":
    serve(Placo, ("placo", "pin", "numpy"))
