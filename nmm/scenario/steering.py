"""The steering of a scenario: what steers a platform where the task does not feel it."""

from __future__ import annotations

from typing import Annotated

from pydantic import BeforeValidator, Field

from nmm.control.steering import Steering
from nmm.scenario.keys import Part
from nmm.scenario.numbers import Positive, number

USUAL = Steering()


class SteeringPart(Part):
    """What steers a platform where neither task nor objective does: pursuit of the hand; `true` is this."""

    gain: Positive = Field(
        USUAL.gain, description="with which a steering angle goes to where it should be, 1/s"
    )
    spring: Annotated[float, BeforeValidator(number), Field(ge=0.0)] = Field(
        USUAL.spring,
        description="with which the null space turns the hand ahead of the axle, 1/s; 0 for none",
    )

    def build(self) -> Steering:
        """The law."""
        return Steering(self.gain, self.spring)
