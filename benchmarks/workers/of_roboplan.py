"""roboplan's OInK (a QP by ProxQP), as its examples use it: frame task, configuration task, limits.

Its constraints are made in C++, and none is a rolling base's: the base rolls by the joints `forward` and
`turn`, or slides.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from loop import POSTURE_GAIN, REGULAR, Peer, Told, serve
from roboplan.core import CartesianConfiguration, Scene, loadUrdfSceneDescriptionFromXml
from roboplan.optimal_ik import (
    ConfigurationTask,
    ConfigurationTaskOptions,
    FrameTask,
    FrameTaskOptions,
    Oink,
    PositionLimit,
    VelocityLimit,
)


class Roboplan(Peer):
    def __init__(self, told: Told, base: str, limits: bool) -> None:
        super().__init__(told, base, limits)
        scene = Scene("benchmark", loadUrdfSceneDescriptionFromXml(Path(self.urdf).read_text()))
        scene.addGroup("all", self.joints)
        self._scene = scene
        oink = Oink(scene, "all")
        if oink.q_indices.tolist() != [*range(len(self.joints))]:
            raise ValueError(f"expected its joints in the order of the file, got {scene.getJointNames()}")
        goal = CartesianConfiguration("", self.frame, np.asfortranarray(np.eye(4)))
        options = FrameTaskOptions(position_cost=1.0, orientation_cost=float(self.pose))
        self._frame_task = FrameTask(oink, scene, goal, options)
        posture = ConfigurationTask(
            oink, self.posture, self.posture_cost, ConfigurationTaskOptions(task_gain=POSTURE_GAIN * self.dt)
        )
        self._tasks = [self._frame_task, posture]
        self._constraints = (
            [PositionLimit(oink, gain=1.0), VelocityLimit(oink, self.dt, self.fastest)] if limits else []
        )
        self._solve = oink.solveIk

    def displacement(self, T: np.ndarray) -> np.ndarray:
        self._frame_task.setTargetFrameTransform(T)
        self._solve(self.q_all, self._tasks, self._constraints, self.dq, REGULAR)
        return self.dq


if __name__ == "__main__":
    serve(Roboplan, ("roboplan", "roboplan-oink", "pin", "numpy"))
