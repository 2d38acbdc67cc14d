"""The limits of a scenario: what the inputs are kept within."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, cast

from pydantic import BeforeValidator, Field, create_model

from nmm.control.limited_function import Bound
from nmm.control.limits import RECOVERY, Limits
from nmm.robots.robot import Robot
from nmm.scenario.function_part import FunctionPart
from nmm.scenario.functions import FUNCTION_PARTS
from nmm.scenario.keys import Part, at, one_of
from nmm.scenario.numbers import Numbers, Positive, Speeds, Whole, nested, shown


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
        """The bound; errors know their key."""
        function = self.build(robot)
        none = float("inf")
        with self.own_keys():
            bound = Bound(
                function,
                -none if self.lower is None else self.lower,
                none if self.upper is None else self.upper,
                self.braking,
                self.name,
                self.priority,
            )
            bound.rows(robot)
        return bound


#: By kind: the function's part, with limits.
BOUND_PARTS: dict[str, type[BoundPart]] = {
    kind: cast(
        type[BoundPart],
        create_model(
            f"{part.makes.__name__}Bound",
            __base__=(BoundPart, part),
            __module__=__name__,
            __doc__=part.__doc__,
        ),
    )
    for kind, part in FUNCTION_PARTS.items()
}
if TYPE_CHECKING:
    BoundList = list[BoundPart]
else:
    BoundList = list[one_of(BOUND_PARTS)]


def _ranges(value: object) -> object:
    """true, false, or a number or two by name."""
    if isinstance(value, bool):
        return value
    if isinstance(value, Mapping):
        return {str(name): nested(item) for name, item in value.items()}
    raise ValueError(f"expected true, false, or numbers by name, got {shown(value)}")


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
    bounds: BoundList = Field(
        default_factory=list, description="functions whose values are kept within limits"
    )
    recovery: Positive = Field(
        RECOVERY, description="speed at which a coordinate beyond its limit comes back, m/s or rad/s"
    )

    def _with(self, bounds: list[Bound]) -> Limits:
        with self.own_keys():
            return Limits(self.velocity, self.position, self.acceleration, self.wheels, bounds, self.recovery)

    def build(self, robot: Robot) -> Limits:
        """The limits, with the robot's word on them: errors know their key."""
        bounds = []
        for i, part in enumerate(self.bounds):
            with at("bounds", i):
                bounds.append(part.build_bound(robot))
        limits = self._with(bounds)
        with self.own_keys():
            limits.on(robot)
        return limits


def part_or_none(value: object) -> object:
    """true for a part with its defaults, false or nothing for none."""
    if isinstance(value, bool) or value is None:
        return {} if value else None
    if not isinstance(value, Mapping | Part):
        raise ValueError(f"expected true, false or a mapping (key: value), got {shown(value)}")
    return value
