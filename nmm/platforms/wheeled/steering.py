"""Which wheels steer a platform's main body, and the axle that they turn."""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence

from nmm.platforms.steering import SteeredAxle, SteeringPivot
from nmm.platforms.wheeled.descriptions import MAIN, FixedWheel, SteeredWheel, WheelDescription


def steered_axle(wheels: Sequence[WheelDescription], inputs: Sequence[str]) -> SteeredAxle | None:
    """The point of the fixed axle that is beside the reference point, and the pivots whose rates are inputs.

    Without fixed wheels all wheels steer, and the reference point follows the body's x axis.
    """
    own = [wheel for wheel in wheels if wheel.body == MAIN]
    middle, heading = 0j, 0.0
    for wheel in own:
        if isinstance(wheel, FixedWheel):
            heading = wheel.heading
            forward = cmath.rect(1.0, heading)
            middle = forward * (complex(wheel.x, wheel.y) * forward.conjugate()).real
            break
    pivots: dict[str, SteeringPivot] = {}
    for wheel in own:
        if isinstance(wheel, SteeredWheel) and wheel.centered and f"{wheel.joint}_rate" in inputs:
            at = (complex(wheel.x, wheel.y) - middle) * cmath.rect(1.0, -heading)
            zero = math.remainder(wheel.heading - heading, math.pi)  # a wheel's line has no front
            pivots[wheel.joint] = SteeringPivot(wheel.joint, f"{wheel.joint}_rate", at.real, at.imag, zero)
    return SteeredAxle(tuple(pivots.values()), middle.real, middle.imag, heading) if pivots else None
