"""The rows that inputs stand for."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from nmm.arrays import Array
from nmm.errors import InputError, expect_known, unknown
from nmm.platforms.wheeled.descriptions import MAIN, FixedWheel, SteeredWheel, WheelDescription
from nmm.platforms.wheeled.geometry import Bodies, Term, rolling_term
from nmm.platforms.wheeled.inputs import CommonSpeed, Input, Speed, Spin, Spins
from nmm.platforms.wheeled.rows import Axis, Common, Rate, Row, Velocity, axis_of

#: An input's name, its unit and its row.
Named = tuple[str, str, Row]


def read(given: Input, bodies: Bodies, wheels: Mapping[str, WheelDescription]) -> Named:
    """Name, unit and row of an input that a user asks for.

    Raises
    ------
    InputError : no such input, no such wheel, a caster, two pivots in one place
    """
    if isinstance(given, str):
        return _by_name(given, bodies, wheels)
    if isinstance(given, Speed):
        wheel = _wheel(given.wheel, wheels, given.name or "Speed")
        rolling_term(bodies, wheel)  # refuses casters
        return given.name or f"{wheel.name}_speed", "m/s", Velocity((bodies.contact(wheel),))
    if isinstance(given, Spin):
        wheel = _wheel(given.wheel, wheels, given.name or "Spin")
        return given.name or f"{wheel.name}_spin", "rad/s", Velocity((rolling_term(bodies, wheel),))
    if isinstance(given, Spins):
        terms = []
        for name, weight in given.weights.items():
            term = rolling_term(bodies, _wheel(name, wheels, given.name))
            terms.append(Term(term.body, term.point, term.direction, weight * term.weight))
        return given.name, "rad/s", Velocity(tuple(terms))
    if isinstance(given, CommonSpeed):
        pair = [_wheel(name, wheels, given.name) for name in (given.first, given.second)]
        return given.name, "m/s", _common(bodies, pair)
    raise InputError(f"inputs: expected names, Speed, Spin, Spins or CommonSpeed, got {given!r}")


def _by_name(name: str, bodies: Bodies, wheels: Mapping[str, WheelDescription]) -> Named:
    rates = {f"{body}_rate": 2 + number for number, body in enumerate(bodies.names) if number > 0}
    if name == "v":
        return forward(bodies, list(wheels.values()))
    if name in ("vx", "vy"):
        return name, "m/s", Velocity((Term(0, 0j, 0.0 if name == "vx" else math.pi / 2),))
    if name == "omega":
        return name, "rad/s", Rate(2)
    if name in rates:
        return name, "rad/s", Rate(rates[name])
    raise InputError(unknown("input", name, ("v", "vx", "vy", "omega", *rates), "inputs"))


def forward(bodies: Bodies, wheels: Sequence[WheelDescription]) -> Named:
    """What "v" is (m/s): of the main body's wheels, the first of these that there are:

    1. fixed wheels: the speed of the middle of the axle of the first, along its heading
    2. two steered wheels without trail: their common speed, of the first two that are not on one pivot
    3. one steered wheel without trail: its speed
    4. none: the reference point's, along the x axis
    """
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
    lines = [_line(wheel) for wheel in (first, *others)]
    for wheel, line in zip(others, lines[1:], strict=True):
        if np.linalg.norm(np.cross(lines[0], line)) > 1e-4:
            return wheel
    return others[0]


def _line(wheel: SteeredWheel) -> Array:
    return Axis(-1, wheel.x, wheel.y, wheel.heading).line(np.zeros(0))


def _common(bodies: Bodies, pair: Sequence[WheelDescription]) -> Common:
    for wheel in pair:
        grips = isinstance(wheel, FixedWheel) or (isinstance(wheel, SteeredWheel) and wheel.centered)
        if not grips or wheel.body != MAIN:
            raise InputError(
                f"CommonSpeed: expected steered wheels without trail on the main body, {wheel.name} is none"
            )
    row = Common((axis_of(bodies, pair[0]), axis_of(bodies, pair[1])))
    if row.length < 1e-6:
        raise InputError(f"CommonSpeed: {pair[0].name} and {pair[1].name} are in the same place")
    return row


def _wheel(name: str, wheels: Mapping[str, WheelDescription], where: str) -> WheelDescription:
    expect_known("wheel", name, wheels, f"input {where}")
    return wheels[name]
