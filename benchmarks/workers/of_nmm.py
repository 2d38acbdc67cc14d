"""nmm, with Pinocchio's kinematics and with its own, and the floor of `step.py` with Euler's rule."""

from __future__ import annotations

import math
import sys
from abc import ABC, abstractmethod
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from floor import floor_controller
from loop import Told, serve
from workloads import Workload


class Ours(ABC):
    """A robot at the beginning of its path, which steps along it."""

    def __init__(self, workload: Workload) -> None:
        self.workload, self.dt = workload, workload.dt
        self.t = workload.t.tolist()
        self.now = workload.q0.copy()

    def reset(self) -> None:
        self.now = self.workload.q0.copy()

    @abstractmethod
    def step(self, k: int) -> None:
        """Sample k."""

    def q(self) -> list[float]:
        return self.now.tolist()


class Nmm(Ours):
    """A control step and Euler's rule in one call."""

    def __init__(self, workload: Workload, kinematics: str, limits: bool) -> None:
        super().__init__(workload)
        self.controller = workload.controller(kinematics, limits)
        self._step = self.controller.step

    def reset(self) -> None:
        super().reset()
        self.controller.reset()

    def step(self, k: int) -> None:
        self.now, _ = self._step(self.t[k], self.now, self.dt, "euler")


class Floor(Ours):
    """The planar case by hand: Pinocchio's calls, one compiled function with every number in its text, and
    Euler's rule."""

    def __init__(self, workload: Workload) -> None:
        super().__init__(workload)
        self.law = floor_controller(1, "pg", workload.robot.model)
        self._moves = np.zeros(len(self.now))
        self._by_inputs = self._moves[1:]

    def step(self, k: int) -> None:
        q, moves = self.now, self._moves
        np.multiply(self.law(self.t[k], q), self.dt, self._by_inputs)
        forward, theta = moves.item(1), q.item(2)
        moves[0], moves[1] = forward * math.cos(theta), forward * math.sin(theta)
        q += moves


def make(told: Told, variant: str, limits: bool) -> Ours | None:
    workload = Workload(told["name"])
    if variant == "floor":
        return Floor(workload) if workload.name == "planar" and not limits else None
    return Nmm(workload, variant, limits)


if __name__ == "__main__":
    serve(make, ("nmm", "pin", "numba", "numpy"))
