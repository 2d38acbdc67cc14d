"""The scenario's key `plan`: a motion that is searched, which the run is or which the controller follows."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, cast

from pydantic import BeforeValidator, Field

from nmm.base.errors import InputError, expect
from nmm.control.functions.tasks.task import Task
from nmm.scenario.keys import KeyedPart, at
from nmm.scenario.limits import GoalPart, part_or_none
from nmm.scenario.numbers import Number, Positive, Whole
from nmm.scenario.objectives import ObjectiveList, build_objective
from nmm.scenario.schema import start_of
from nmm.scenario.sections import Making, Section
from nmm.scenario.tasks import build_tasks

if TYPE_CHECKING:
    from nmm.plugins.planning.plan import Plan


def _goal(value: object) -> dict[str, Any]:
    if not isinstance(value, Mapping):
        raise InputError(expected="numbers by coordinate, as {x: 2, y: 1, theta: 0}", got=value)
    return cast("dict[str, Any]", start_of(value))


Coordinates = Annotated[dict[str, Any], BeforeValidator(_goal)]


class TrackPart(KeyedPart):
    """The plan is the controller's task, with limits and distances as they are; `track: true` is this with
    its defaults."""

    gain: Positive = Field(2.0, description="feedback gain on the deviation in each input, 1/s")
    length: Positive = Field(
        0.4, description="about how far, m, a platform drives until it is back on its path"
    )
    pace: Positive = Field(
        0.8,
        description="share of the plan's speed, which leaves room for feedback",
    )
    margin: Annotated[Number, Field(ge=0.0)] = Field(
        0.05,
        description="m, how much farther than collisions.distance the plan stays, where it can",
    )
    tube: GoalPart = Field(
        GoalPart.model_validate({"m": 0.1, "rad": 0.2}),
        description="m and rad, how far from the plan the run warns, or plans again",
    )
    replan: bool = Field(
        False,
        description="whether it plans again beyond the tube",
    )


class PlanSection(Section):
    """A motion to a goal that is searched, in place of the controller's; `plan: true` is this with its
    defaults."""

    summary: ClassVar[str] = (
        "true or a mapping for a planned motion to the goal; resolver and duration then matter with "
        "plan.track alone"
    )
    after: ClassVar[str] = "collisions"
    listed: ClassVar[Mapping[str, type[KeyedPart]]] = {"plan.track": TrackPart}
    needs: ClassVar[tuple[str, ...]] = ("q0",)
    takes_until: ClassVar[bool] = True
    searches: ClassVar[bool] = True

    to: Coordinates | None = Field(
        None,
        description="coordinates to be reached by name, m and rad (others are free), or posture: home of the "
        "SRDF; by default the task's target",
    )
    through: list[Coordinates] = Field(default_factory=list, description="such goals on the way, in order")
    seconds: Positive = Field(10.0, description="limit of the search, s")
    seed: Annotated[Whole, Field(ge=0)] = Field(1, description="seed of the random numbers")
    shorten: Whole = Field(200, description="how many shorter motions between two of its points are tried")
    smooth: bool = Field(
        False,
        description="whether it goes on without rests, where such a motion is found",
    )
    objective: ObjectiveList = Field(
        default_factory=list,
        description="what a smooth plan minimises in its time, as the scenario's objective",
    )
    effort: bool | dict[str, Positive] = Field(
        False,
        description="whether motors keep the torque limits of the robot's file; or loads, kg by frame",
    )
    hold: str | None = Field(
        None,
        description="a frame that keeps its pose while the platform goes to x, y and theta of the goal",
    )
    track: Annotated[TrackPart | None, BeforeValidator(part_or_none)] = Field(
        None,
        description="true or a mapping for a controller that follows the plan; else the run is the "
        "plan itself",
    )

    @property
    def moves(self) -> bool:
        return self.track is None

    def tasks(self, making: Making, tasks: list[Task]) -> list[Task]:
        """The plan that is followed, in place of the file's tasks."""
        from nmm.plugins.planning.replan import replan

        if self.track is None:
            return tasks
        track, duration = self.track, making.parts.duration
        plan = self.motion(making)
        anew = partial(replan, **self.given("seconds", "seed")) if track.replan else None
        options = track.given("gain", "length", "pace")
        reference = plan.reference(**options, tube=track.tube.make(), replan=anew)
        with at("duration"):
            least = plan.duration / track.pace
            expect(duration >= least, "", f"at least {least:.4g} s, which the plan takes", duration)
        return [reference]

    def motion(self, making: Making) -> Plan:
        """The planned motion; `RunError` where none is found."""
        from nmm.plugins.planning.planner import plan

        robot, parts = making.robot, making.parts
        for k, coordinates in enumerate([self.to, *self.through]):
            with at("plan"), at(*(("to",) if k == 0 else ("through", k - 1))):
                robot.q(coordinates)
        goal: Any = self.to
        if goal is None:
            with at("task"):
                tasks = build_tasks(parts.task, robot)
                if len(tasks) > 1 or any(task.when for task in tasks):
                    raise InputError(expected="one task, as its target is the plan's goal; or plan.to")
                goal = tasks[0]
        collisions = parts.build_collisions(robot)
        with at("plan"), at("objective"):
            objective = build_objective(self.objective, robot, collisions)
        limits = None if parts.limits is None else parts.limits.build(robot)
        tolerance = None if parts.until is None else parts.until.make()
        options = self.given("through", "seconds", "seed", "shorten", "smooth", "effort", "hold")
        options |= {"limits": limits, "tolerance": tolerance, "objective": objective}
        options["progress"] = making.progress
        if self.track is not None:
            options["margin"] = self.track.margin
        with at("plan"):
            try:
                return plan(robot, robot.q(parts.q0), goal, collisions=collisions, **options)
            except InputError as error:
                raise error.placed(error.where.removeprefix("plan: ")) from None
