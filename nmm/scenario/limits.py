"""The limits of a scenario, its goal, its retreat and its steering."""

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import BeforeValidator, Field

from nmm.base.errors import InputError
from nmm.base.kinds import LIMITS
from nmm.control.goal import Goal
from nmm.control.limits.limit import Limit
from nmm.control.limits.limited_function import Bound
from nmm.control.limits.limits import Limits
from nmm.control.retreat import Retreat
from nmm.control.steering import Steering
from nmm.model.robots.robot import Robot
from nmm.scenario.constructors import FunctionPart, MadePart, keys_of, part_of
from nmm.scenario.functions import with_functions
from nmm.scenario.keys import KeyedPart, OneOf, each
from nmm.scenario.numbers import Nested, Number, Numbers, Positive, Speeds, Whole, nested


class BoundPart(FunctionPart):
    """A function of the robot whose values are kept within limits."""

    lower: Numbers | None = Field(None, description="least value, or one a row: m, rad")
    upper: Numbers | None = Field(
        None, description="largest value, or one a row; none when not given; m, rad"
    )
    braking: Positive | None = Field(
        None,
        description="deceleration to count on, m/s² or rad/s²; by default a quarter of what the "
        "inputs' accelerations give",
    )
    name: str = Field("", description="for messages; the function's rows when not given")
    priority: Whole | None = Field(
        None,
        description="1, 2, ...: a soft limit, kept as far as tasks of a lower number leave it; "
        "before any task when not given",
    )

    def build_bound(self, robot: Robot) -> Bound:
        function = self.build(robot)
        with self.own_keys():
            bound = Bound(function, **self.given("lower", "upper", "braking", "name", "priority"))
            bound.rows(robot)
        return bound


class LimitPart(MadePart):
    """A limit of another kind than a function's."""

    def build_bound(self, robot: Robot) -> Limit:
        with self.own_keys():
            limit: Limit = self.make()
            Limits(False, False, bounds=limit).on(robot)
        return limit


#: By kind: limits that are a class of their own.
LIMIT_PARTS = LIMITS.made(lambda kind, made: part_of(kind, made, LimitPart))
#: By kind: the function's part, with limits, and those.
BOUND_PARTS: dict[str, type[BoundPart] | type[LimitPart]] = {**with_functions(BoundPart), **LIMIT_PARTS}


def _ranges(value: object) -> object:
    if isinstance(value, bool):
        return value
    if isinstance(value, Mapping):
        return {str(name): nested(item) for name, item in value.items()}
    raise InputError(expected="true, false, or numbers by name", got=value)


def _changes(value: object) -> object:
    if isinstance(value, Mapping):
        return {str(name): nested(item) for name, item in value.items()}
    if isinstance(value, bool):
        raise InputError(expected="a number, or numbers by name", got=value)
    return None if value is None else nested(value)


#: A number or [lower, upper], for all or by name.
Changes = Annotated[Nested | dict[str, Nested] | None, BeforeValidator(_changes)]

Ranges = Annotated[bool | dict[str, Any], BeforeValidator(_ranges)]


class LimitsPart(
    keys_of(Limits, MadePart, "bounds", velocity=Ranges, position=Ranges, acceleration=Changes, wheels=Speeds)  # type: ignore[misc]  # made
):
    """What the inputs are kept within; `limits: true` is this with its defaults, as the robot's file says."""

    makes = Limits
    beside = ("bounds",)

    bounds: list[Annotated[BoundPart | LimitPart, OneOf(BOUND_PARTS)]] = Field(
        default_factory=list, description="functions whose values are kept within limits, and further limits"
    )

    def build(self, robot: Robot) -> Limits:
        limits: Limits = self.made_with(
            bounds=each(self.bounds, lambda part: part.build_bound(robot), "bounds")
        )
        with self.own_keys():
            limits.on(robot)
        return limits


def part_or_none(value: object) -> object:
    if isinstance(value, bool) or value is None:
        return {} if value else None
    if not isinstance(value, Mapping | KeyedPart):
        raise InputError(expected="true, false or a mapping (key: value)", got=value)
    return value


class GoalPart(keys_of(Goal, MadePart)):  # type: ignore[misc]  # made
    """The run ends where the task's error is within these; `until: {}` is this with its defaults."""

    makes = Goal


_POSTURE = (
    dict[str, Number] | None,
    "the posture that joints move to meanwhile, by name; the middle of their limits when not given",
)


class RetreatPart(keys_of(Retreat, MadePart, "goal", durations=list[Positive] | None, posture=_POSTURE)):  # type: ignore[misc]  # made
    """Backing off when the error stalls, and starting again; `retreat: true` is this with its defaults."""

    makes = Retreat
    beside = ("goal",)

    def build(self, robot: Robot, goal: Goal | None) -> Retreat:
        if self.posture is not None:
            robot.q(self.posture)
        retreat: Retreat = self.made_with(goal=goal)
        return retreat


class SteeringPart(keys_of(Steering, MadePart)):  # type: ignore[misc]  # made
    """What steers where neither task nor objective does: pursuit of the end-effector; `true` is this."""

    makes = Steering
