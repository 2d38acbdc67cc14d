"""A key of scenarios, `patrol`, and a resolver, `least_norm`."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from pydantic import Field

import nmm
from nmm.extending import Making, NumberList, Positive, Section, at


class Patrol(Section):
    """The end of the arm goes from place to place, in place of the file's tasks."""

    summary: ClassVar[str] = "a mapping for rounds from place to place, in place of the tasks"
    after: ClassVar[str] = "objective"

    places: NumberList = Field(description="[x, y] of each, m")
    seconds: Positive = Field(4.0, description="from one to the next, s")
    frame: str = Field("ee", description="what goes there")

    @property
    def times(self) -> list[float]:
        return [self.seconds * k for k in range(1, len(self.places) + 1)]

    def check(self, making: Making) -> None:
        with at("patrol", "frame"):
            making.robot.frame_id(self.frame)

    def tasks(self, making: Making, tasks: list[nmm.Task]) -> list[nmm.Task]:
        robot = making.robot
        start = nmm.Configuration(robot, robot.q(making.parts.q0)).placement(self.frame).translation[:2]
        with at("patrol", "places"):
            round_trip = nmm.Spline([0.0, *self.times], [start, *self.places])
        return [nmm.Task(nmm.Position(self.frame, "xy"), round_trip, gain=2.0)]

    def findings(self, run: nmm.Trajectory) -> list[nmm.Finding]:
        end = float(run.t[-1])
        visited = sum(t <= end for t in self.times)
        if visited == len(self.places):
            return []
        values = {"visited": visited, "places": len(self.places), "needed": self.times[-1]}
        return [nmm.Finding("patrol_unfinished", values, {"t": end})]


def least_norm(problem: nmm.Problem) -> np.ndarray:
    return np.linalg.pinv(problem.J) @ problem.rate


class LeastNorm(nmm.CallableResolver):
    """u = J⁺ rate, the smallest inputs that do the task; the objective is not looked at."""

    name: ClassVar[str] = "least_norm"
    exact: ClassVar[bool] = True

    def __init__(self) -> None:
        super().__init__(least_norm)
