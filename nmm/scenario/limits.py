"""The limits of a scenario, its goal, its retreat and its steering."""

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import BeforeValidator, Field

from nmm.control.goal import Goal
from nmm.control.limited_function import Bound
from nmm.control.limits import RECOVERY, Limits
from nmm.control.retreat import Retreat
from nmm.control.steering import Steering
from nmm.errors import InputError
from nmm.robots.robot import Robot
from nmm.scenario.constructors import FunctionPart
from nmm.scenario.functions import with_functions
from nmm.scenario.keys import OneOf, Part, each
from nmm.scenario.numbers import Number, Numbers, Positive, Speeds, Whole, nested, number


class BoundPart(FunctionPart):
    """A function of the robot whose values are kept within limits."""

    lower: Numbers | None = Field(None, description="least value, or one a row: m, rad")
    upper: Numbers | None = Field(
        None, description="largest value, or one a row; none when not given; m, rad"
    )
    braking: Positive | None = Field(
        None,
        description="deceleration to count on, m/s² or rad/s²; when not given, a quarter of what the inputs' "
        "accelerations give where the robot is",
    )
    name: str = Field("", description="for messages; the function's rows when not given")
    priority: Whole | None = Field(
        None,
        description="1, 2, ... where it is kept if possible, as far as tasks of a lower number leave it; "
        "before any task when not given",
    )

    def build_bound(self, robot: Robot) -> Bound:
        function = self.build(robot)
        with self.own_keys():
            bound = Bound(function, **self.given("lower", "upper", "braking", "name", "priority"))
            bound.rows(robot)
        return bound


#: By kind: the function's part, with limits.
BOUND_PARTS = with_functions(BoundPart)


def _ranges(value: object) -> object:
    if isinstance(value, bool):
        return value
    if isinstance(value, Mapping):
        return {str(name): nested(item) for name, item in value.items()}
    raise InputError(expected="true, false, or numbers by name", got=value)


Ranges = Annotated[bool | dict[str, Any], BeforeValidator(_ranges)]


class LimitsPart(Part):
    """What the inputs are kept within; `limits: true` is this with its defaults, as the robot's file says."""

    velocity: Ranges = Field(
        True,
        description="of inputs: true for the robot's own, false for none, or numbers by input, group "
        "(platform, arm) or joint in their place: one for both signs, or [lower, upper]; m/s, rad/s",
    )
    position: Ranges = Field(
        True,
        description="of coordinates: true, false, or [lower, upper] by name in place of the robot's; m, rad",
    )
    acceleration: Speeds = Field(
        None, description="of inputs: a number for all, or numbers by input or group; m/s², rad/s²"
    )
    wheels: Speeds = Field(
        None,
        description="largest rolling rates of wheels: a number for all, or by joint in place of the robot's "
        "own; rad/s",
    )
    bounds: list[Annotated[BoundPart, OneOf(BOUND_PARTS)]] = Field(
        default_factory=list, description="functions whose values are kept within limits"
    )
    recovery: Positive = Field(
        RECOVERY, description="speed at which a coordinate beyond its limit comes back, m/s or rad/s"
    )

    def build(self, robot: Robot) -> Limits:
        bounds = each(self.bounds, lambda part: part.build_bound(robot), "bounds")
        with self.own_keys():
            limits = Limits(**self.given() | {"bounds": bounds})
            limits.on(robot)
        return limits


def part_or_none(value: object) -> object:
    if isinstance(value, bool) or value is None:
        return {} if value else None
    if not isinstance(value, Mapping | Part):
        raise InputError(expected="true, false or a mapping (key: value)", got=value)
    return value


class GoalPart(Part):
    """The run ends where the task's error is within these; `until: {}` is this with its defaults."""

    m: Positive = Field(0.005, description="norm of the rows in metres")
    rad: Positive = Field(0.02, description="norm of the rows in radians")

    def make(self) -> Goal:
        return Goal(**self.given())


class RetreatPart(Part):
    """Backing off when the error stalls, and starting again; `retreat: true` is this with its defaults."""

    stalled: Positive = Field(
        0.5,
        description="s without progress after which the robot backs off; none passes while the platform "
        "gathers speed as fast as its limits of acceleration allow",
    )
    progress: Positive = Field(0.03, description="share by which the error has to fall in that time", lt=1.0)
    durations: list[Positive] | None = Field(
        None,
        description="s, how long it backs off the first time, the second, ...; the last holds for all later "
        "ones; 1 to 3.5, no two alike, when not given",
        min_length=1,
    )
    posture: dict[str, Number] | None = Field(
        None, description="where joints go meanwhile, by name; the middle of their limits when not given"
    )
    speed: Positive = Field(0.5, description="of the platform, where it drives backwards, m/s")
    turn: Positive = Field(1.0, description="of the platform then, to one side and the other by turns, rad/s")
    gain: Positive = Field(2.0, description="of the joints on their way, 1/s")

    def build(self, robot: Robot, goal: Goal | None) -> Retreat:
        if self.posture is not None:
            robot.q(self.posture)
        return Retreat(**self.given(), goal=goal)


USUAL = Steering()


class SteeringPart(Part):
    """What steers where neither task nor objective does: pursuit of the end-effector; `true` is this."""

    gain: Positive = Field(
        USUAL.gain, description="with which a steering angle goes to where it should be, 1/s"
    )
    spring: Annotated[float, BeforeValidator(number), Field(ge=0.0)] = Field(
        USUAL.spring,
        description="with which the null space turns the end-effector ahead of the axle, 1/s; 0 for none",
    )

    def build(self) -> Steering:
        return Steering(**self.given())
