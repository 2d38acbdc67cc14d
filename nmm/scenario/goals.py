"""A target to reach, as a scenario says it: when it is reached, and what to do when the error stalls."""

from __future__ import annotations

from pydantic import Field

from nmm.control.goal import Goal
from nmm.control.retreat import Retreat
from nmm.robots.robot import Robot
from nmm.scenario.keys import Part
from nmm.scenario.numbers import Number, Positive


class GoalPart(Part):
    """The run ends where the task's error is within these; `until: {}` is this with its defaults."""

    m: Positive = Field(0.005, description="norm of the rows in metres")
    rad: Positive = Field(0.02, description="norm of the rows in radians")

    def make(self) -> Goal:
        """The goal."""
        return Goal(self.m, self.rad)


class RetreatPart(Part):
    """Backing off when the error stalls, and starting again; `retreat: true` is this with its defaults."""

    stalled: Positive = Field(0.5, description="s without progress after which the robot backs off")
    progress: Positive = Field(0.03, description="share by which the error has to fall in that time", lt=1.0)
    durations: list[Positive] = Field(
        default_factory=lambda: [1.0, 1.5, 2.0],
        description="s, how long it backs off the first time, the second, ...",
        min_length=1,
    )
    posture: dict[str, Number] | None = Field(
        None, description="where joints go meanwhile, by name; the middle of their limits when not given"
    )
    speed: Positive = Field(0.5, description="of the platform, backwards, m/s")
    turn: Positive = Field(1.0, description="of the platform, to one side and the other by turns, rad/s")
    gain: Positive = Field(2.0, description="of the joints on their way, 1/s")

    def build(self, robot: Robot, goal: Goal | None) -> Retreat:
        """The retreat; `InputError` for a joint that the robot does not have."""
        if self.posture is not None:
            robot.q(self.posture)
        given = self.model_dump()
        return Retreat(**given, goal=goal)
