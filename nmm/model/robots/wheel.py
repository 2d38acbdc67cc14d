"""A wheel that playback turns: where it is, and what carries it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from nmm.base.arrays import Array


@dataclass(frozen=True, eq=False)
class Wheel:
    """A wheel that only rolls: not a coordinate (its angle follows from the motion), turned in playback.

    A wheel may hang on a swivel, an upright joint that is no coordinate either: a caster's, or that of a
    steered wheel whose angle follows from that of others (Ackermann).

    Attributes
    ----------
    joint : name of its joint in the display model
    center : (3,) wheel centre in the carrier's frame with the swivel at zero, m
    axis : (3,) unit spin axis in the carrier's frame with the swivel at zero, level
    radius : m
    rolls_at : (3,) the point of the carrier whose motion turns it (see `Platform.rolls_at`), m
    carrier : name of the movable joint of `model` that carries it; "theta" for the root link's body
    swivel : name of the swivel's joint in the display model, or "" without
    pivot : (3,) a point of the swivel's axis in the carrier's frame, m
    roller : angle γ of its rollers, rad (see `Platform.roller`)
    velocity : largest rate of its joint, rad/s; infinite without
    slides : whether it may slide sideways: a caster without a swivel, one with rollers beside plain wheels,
        one off the ground

    Examples
    --------
    >>> wheel = nmm.load("unicycle_2r").wheels[0]
    >>> isinstance(wheel, nmm.extending.Wheel), wheel.joint, wheel.carrier, wheel.radius
    (True, 'left_wheel_joint', 'theta', 0.1)
    """

    joint: str
    center: Array
    axis: Array
    radius: float
    rolls_at: Array
    carrier: str = "theta"
    swivel: str = ""
    pivot: Array = field(default_factory=lambda: np.zeros(3))
    roller: float = 0.0
    velocity: float = math.inf
    slides: bool = False

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of its joints in the display model: the swivel's, if there is one, and its own."""
        return (self.swivel, self.joint) if self.swivel else (self.joint,)

    @property
    def is_fixed(self) -> bool:
        """Whether it hangs on the root link's body, without swivel and rollers: it rolls one way only."""
        return self.carrier == "theta" and not self.swivel and self.roller == 0.0 and not self.slides
