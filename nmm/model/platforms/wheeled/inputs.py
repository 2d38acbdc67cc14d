"""Inputs of a platform that is described by its wheels: linear in qp_dot, with a meaning.

Besides these, `WheeledPlatform` takes the names "v", "vx", "vy", "omega" and "<joint>_rate".
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from nmm.base.arrays import scalar
from nmm.base.errors import InputError, expect, expect_known
from nmm.model.platforms.wheeled.descriptions import MAIN, FixedWheel, SteeredWheel, WheelDescription
from nmm.model.platforms.wheeled.geometry import (
    Axis,
    Bodies,
    Common,
    Rate,
    Row,
    Term,
    Velocity,
    axis_of,
    rolling_term,
)


@dataclass(frozen=True)
class WheelSpeed:
    """Speed of a wheel's centre along its rolling direction, m/s. Named "<wheel>_speed" by default.

    Examples
    --------
    >>> wheels = [nmm.FixedWheel("rear", 0, 0, 0.1), nmm.SteeredWheel("front", 0.8, 0, 0.1)]
    >>> nmm.WheeledPlatform(wheels, inputs=[nmm.WheelSpeed("front", name="v")]).inputs
    ('v', 'steering_rate')
    """

    wheel: str
    name: str = ""


@dataclass(frozen=True)
class WheelSpin:
    """Spin rate of a wheel, rad/s. Named "<wheel>_spin" by default.

    Examples
    --------
    >>> axle = [nmm.FixedWheel("left", 0, 0.3, 0.1), nmm.FixedWheel("right", 0, -0.3, 0.1)]
    >>> drive = nmm.WheeledPlatform(axle, inputs=[nmm.WheelSpin("left"), nmm.WheelSpin("right")])
    >>> drive.inputs, drive.input_units
    (('left_spin', 'right_spin'), ('rad/s', 'rad/s'))
    """

    wheel: str
    name: str = ""


@dataclass(frozen=True)
class WeightedSpins:
    """A weighted sum of the wheels' spin rates, rad/s: {wheel: weight}.

    Examples
    --------
    >>> axle = [nmm.FixedWheel("left", 0, 0.3, 0.1), nmm.FixedWheel("right", 0, -0.3, 0.1)]
    >>> both = nmm.WeightedSpins({"left": 0.5, "right": 0.5})
    >>> apart = nmm.WeightedSpins({"left": -0.5, "right": 0.5}, name="turn")
    >>> nmm.WheeledPlatform(axle, inputs=[both, apart]).inputs
    ('drive', 'turn')
    """

    weights: Mapping[str, float] = field(hash=False)
    name: str = "drive"

    def __post_init__(self) -> None:
        valid = isinstance(self.weights, Mapping) and self.weights
        expect(valid, f"input {self.name}", "a weight for each wheel's name", self.weights)
        where = f"input {self.name}: weight of"
        weights = {wheel: scalar(weight, f"{where} {wheel}") for wheel, weight in self.weights.items()}
        object.__setattr__(self, "weights", weights)


@dataclass(frozen=True)
class CommonSpeed:
    """Root mean square of the speeds of two steered wheels' pivots on the main body, m/s, with a sign.

    It determines the motion at any steering angles, unless the wheels' axes are one line; a single wheel's
    speed does not: the platform may turn about it. Positive when, from zero angles, the first rolls forward.

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


Input = str | WheelSpeed | WheelSpin | WeightedSpins | CommonSpeed

#: An input's name, its unit and its row.
Named = tuple[str, str, Row]


def read(requested: Input, bodies: Bodies, wheels: Mapping[str, WheelDescription]) -> Named:
    """Name, unit and row of an input; `InputError` for unknown names, casters, pivots that coincide."""
    if isinstance(requested, str):
        return _by_name(requested, bodies, wheels)
    if isinstance(requested, WheelSpeed):
        wheel = _wheel(requested.wheel, wheels, requested.name or "WheelSpeed")
        rolling_term(bodies, wheel)  # refuses casters
        return requested.name or f"{wheel.name}_speed", "m/s", Velocity((bodies.contact(wheel),))
    if isinstance(requested, WheelSpin):
        wheel = _wheel(requested.wheel, wheels, requested.name or "WheelSpin")
        return requested.name or f"{wheel.name}_spin", "rad/s", Velocity((rolling_term(bodies, wheel),))
    if isinstance(requested, WeightedSpins):
        terms = []
        for name, weight in requested.weights.items():
            term = rolling_term(bodies, _wheel(name, wheels, requested.name))
            terms.append(Term(term.body, term.point, term.direction, weight * term.weight))
        return requested.name, "rad/s", Velocity(tuple(terms))
    if isinstance(requested, CommonSpeed):
        pair = [_wheel(name, wheels, requested.name) for name in (requested.first, requested.second)]
        return requested.name, "m/s", _common(bodies, pair)
    expected = "names, WheelSpeed, WheelSpin, WeightedSpins or CommonSpeed"
    raise InputError(where="inputs", expected=expected, got=requested)


def _by_name(name: str, bodies: Bodies, wheels: Mapping[str, WheelDescription]) -> Named:
    if name == "v":
        return forward(bodies, list(wheels.values()))
    if name in ("vx", "vy"):
        return name, "m/s", Velocity((Term(0, 0j, 0.0 if name == "vx" else math.pi / 2),))
    turned = ("omega", *(f"{body}_rate" for body in bodies.names[1:]))
    expect_known("input", name, ("v", "vx", "vy", *turned), "inputs")
    return name, "rad/s", Rate(2 + turned.index(name))


def forward(bodies: Bodies, wheels: Sequence[WheelDescription]) -> Named:
    """What "v" is (m/s), for the main body's wheels: of fixed ones, the speed of the first axle's middle
    along its heading; else of the first two steered ones without trail, on different pivots, their common
    speed; else of one such wheel, its own; else the reference point's along the x axis."""
    main = [wheel for wheel in wheels if wheel.body == MAIN]
    fixed = [wheel for wheel in main if isinstance(wheel, FixedWheel)]
    if fixed:
        heading = np.array([math.cos(fixed[0].heading), math.sin(fixed[0].heading)])
        on_axle = [
            complex(wheel.x, wheel.y)
            for wheel in fixed
            if abs((wheel.x - fixed[0].x, wheel.y - fixed[0].y) @ heading) < 1e-4
        ]
        return "v", "m/s", Velocity((Term(0, sum(on_axle) / len(on_axle), fixed[0].heading),))
    steered = [wheel for wheel in main if isinstance(wheel, SteeredWheel) and wheel.centered]
    others = [wheel for wheel in steered if wheel.joint != steered[0].joint]
    if others:
        return "v", "m/s", _common(bodies, [steered[0], _apart(steered[0], others)])
    if steered:
        return "v", "m/s", Velocity((bodies.contact(steered[0]),))
    return "v", "m/s", Velocity((Term(0, 0j, 0.0),))


def _apart(first: SteeredWheel, others: Sequence[SteeredWheel]) -> SteeredWheel:
    """The first of the others whose axis is not the first wheel's at zero, if there is one."""
    line, *lines = (Axis(-1, w.x, w.y, w.heading).line(np.zeros(0)) for w in (first, *others))
    pairs = zip(others, lines, strict=True)
    return next((w for w, other in pairs if np.linalg.norm(np.cross(line, other)) > 1e-4), others[0])


def _common(bodies: Bodies, pair: Sequence[WheelDescription]) -> Common:
    for wheel in pair:
        grips = isinstance(wheel, FixedWheel) or (isinstance(wheel, SteeredWheel) and wheel.centered)
        expected = "steered wheels without trail, on the main body"
        expect(grips and wheel.body == MAIN, "CommonSpeed", expected, wheel.name)
    row = Common((axis_of(bodies, pair[0]), axis_of(bodies, pair[1])))
    names = tuple(wheel.name for wheel in pair)
    expect(row.length >= 1e-6, "CommonSpeed", "wheels in two places", names)
    return row


def _wheel(name: str, wheels: Mapping[str, WheelDescription], where: str) -> WheelDescription:
    expect_known("wheel", name, wheels, f"input {where}")
    return wheels[name]
