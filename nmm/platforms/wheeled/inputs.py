"""Inputs of a platform that is described by its wheels: linear in qp_dot, with a meaning.

Besides these, `WheeledPlatform` takes the names "v", "vx", "vy", "omega" and "<joint>_rate".
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from nmm.arrays import scalar
from nmm.errors import InputError


@dataclass(frozen=True)
class Speed:
    """Speed of a wheel's centre along its rolling direction, m/s. Named "<wheel>_speed" by default.

    Examples
    --------
    >>> wheels = [nmm.FixedWheel("rear", 0, 0, 0.1), nmm.SteeredWheel("front", 0.8, 0, 0.1)]
    >>> nmm.WheeledPlatform(wheels, inputs=[nmm.Speed("front", name="v")]).inputs
    ('v', 'steering_rate')
    """

    wheel: str
    name: str = ""


@dataclass(frozen=True)
class Spin:
    """Spin rate of a wheel, rad/s. Named "<wheel>_spin" by default.

    Examples
    --------
    >>> axle = [nmm.FixedWheel("left", 0, 0.3, 0.1), nmm.FixedWheel("right", 0, -0.3, 0.1)]
    >>> drive = nmm.WheeledPlatform(axle, inputs=[nmm.Spin("left"), nmm.Spin("right")])
    >>> drive.inputs, drive.input_units
    (('left_spin', 'right_spin'), ('rad/s', 'rad/s'))
    """

    wheel: str
    name: str = ""


@dataclass(frozen=True)
class Spins:
    """A weighted sum of the wheels' spin rates, rad/s: {wheel: weight}.

    Examples
    --------
    >>> axle = [nmm.FixedWheel("left", 0, 0.3, 0.1), nmm.FixedWheel("right", 0, -0.3, 0.1)]
    >>> both = nmm.Spins({"left": 0.5, "right": 0.5})
    >>> apart = nmm.Spins({"left": -0.5, "right": 0.5}, name="turn")
    >>> nmm.WheeledPlatform(axle, inputs=[both, apart]).inputs
    ('drive', 'turn')
    """

    weights: Mapping[str, float] = field(hash=False)
    name: str = "drive"

    def __post_init__(self) -> None:
        if not isinstance(self.weights, Mapping) or not self.weights:
            raise InputError(f"input {self.name}: expected weights by wheel, got {self.weights!r}")
        weights = {
            wheel: scalar(weight, f"input {self.name}: weight of {wheel}")
            for wheel, weight in self.weights.items()
        }
        object.__setattr__(self, "weights", weights)


@dataclass(frozen=True)
class CommonSpeed:
    """Root mean square of the speeds of two steered wheels' pivots on the main body, m/s, with a sign.

    It determines the motion whatever the two steering angles are, as long as the wheels' axes are not one
    line; no single wheel's speed does, because the platform may turn about that wheel. Positive when, with
    both angles at zero, the first rolls forward, and on from there without a jump.

    Examples
    --------
    >>> front = nmm.SteeredWheel("front", 0.4, 0, 0.1, joint="front_steering")
    >>> rear = nmm.SteeredWheel("rear", -0.4, 0, 0.1, joint="rear_steering")
    >>> nmm.WheeledPlatform([front, rear], inputs=[nmm.CommonSpeed("front", "rear")]).inputs
    ('v', 'front_steering_rate', 'rear_steering_rate')
    """

    first: str
    second: str
    name: str = "v"


Input = str | Speed | Spin | Spins | CommonSpeed
