"""How fast wheels turn for given inputs, as numbers that compiled code reads."""

from __future__ import annotations

import math
from collections.abc import Collection

import numpy as np

from nmm.arrays import Array
from nmm.platforms import Car, FrontDriveCar
from nmm.robots.robot import Robot
from nmm.robots.wheel import Wheel

#: How far from level a carrier may lie: files write pi/2 with a few digits.
_LEVEL = 1e-3
#: A wheel on a swivel that is so far before or behind its axis, as a part of its radius, is a caster.
_TRAIL = 1e-4


def wheel_rates(robot: Robot) -> tuple[tuple[str, ...], Array]:
    """Names of the wheels whose rates q and u determine, and rows (w, 9), m and rad:
    [x, y, angle, r, steer, pivot x, pivot y, a, b].

    A wheel that rolls as (x, y) moves and grips along `angle`, turned and moved about its pivot by an angle
    φ, turns at (grip . velocity there) / r; of a wheel with rollers r is the radius times cos γ. With δ the
    coordinate `steer`, tan φ = a sin δ / (cos δ - b sin δ): φ = δ for a = 1 and b = 0, of a wheel on a
    steering joint or on a first trailer; a car's other steered wheels follow δ (Ackermann). steer is -1 where
    the wheel hangs on the main body. Casters and wheels on further trailers are left out.
    """
    rows = {wheel.joint: row for wheel in robot.wheels if (row := _row(robot, wheel)) is not None}
    return tuple(rows), np.array(list(rows.values())).reshape(-1, 9)


def inputs_held_by(robot: Robot, wheels: Collection[str]) -> list[str]:
    """The platform's inputs that limits of these wheels' rates bound.

    Looked at are the wheels on the main body, where the platform's own joints stand straight.
    """
    names, rows = wheel_rates(robot)
    held = [row[:4] for name, row in zip(names, rows, strict=True) if name in wheels and row[4] < 0.0]
    if not held:
        return []
    x, y, angle, radius = np.array(held).T
    rolling = np.array([np.cos(angle), np.sin(angle), x * np.sin(angle) - y * np.cos(angle)]) / radius
    spins = rolling.T @ robot.platform.G(np.zeros(robot.platform.n_p))[:3]
    bounded = np.diag(np.linalg.pinv(spins) @ spins)  # 1 where nothing moves the input without the wheels
    return [name for name, share in zip(robot.platform.inputs, bounded, strict=True) if share > 1.0 - 1e-9]


def _row(robot: Robot, wheel: Wheel) -> list[float] | None:
    if robot.platform.n_p < 3:
        return None
    angle = math.atan2(-wheel.axis[0], wheel.axis[1]) + wheel.roller
    radius = wheel.radius * math.cos(wheel.roller)
    x, y = (float(value) for value in wheel.rolls_at[:2])
    if wheel.swivel:
        return _following(robot, wheel, angle)
    if wheel.carrier == "theta":
        return [x, y, angle, radius, -1.0, 0.0, 0.0, 1.0, 0.0]
    if wheel.carrier not in robot.q_names[3 : robot.platform.n_p]:
        return None
    joint = robot.model.getJointId(wheel.carrier)
    placement = robot.model.jointPlacements[joint]
    if robot.model.names[robot.model.parents[joint]] != "theta" or placement.rotation[2, 2] < 1.0 - _LEVEL:
        return None
    turned = math.atan2(placement.rotation[1, 0], placement.rotation[0, 0])
    x, y = (float(value) for value in (placement.rotation[:2, :2] @ np.array([x, y])))
    pivot = [float(value) for value in placement.translation[:2]]
    steer = float(robot.q_names.index(wheel.carrier))
    return [x, y, angle + turned, radius, steer, *pivot, 1.0, 0.0]


def _following(robot: Robot, wheel: Wheel, angle: float) -> list[float] | None:
    """The row of a wheel on a swivel that a car's steering angle turns: its axis passes the point about which
    the car turns, (0, L / tan δ)."""
    car = robot.platform
    if not isinstance(car, Car | FrontDriveCar) or wheel.carrier != "theta":
        return None
    straight = math.remainder(angle, math.pi)  # with the swivel at zero, from straight ahead
    turn = complex(math.cos(straight), -math.sin(straight))
    offset = complex(*(wheel.center - wheel.pivot)[:2]) * turn
    if abs(offset.real) > _TRAIL * wheel.radius:
        return None
    pivot = [float(value) for value in wheel.pivot[:2]]
    ratios = [pivot[0] / car.wheelbase, pivot[1] / car.wheelbase]
    steer = float(robot.q_names.index(car.steering))
    return [offset.real, offset.imag, angle - straight, wheel.radius, steer, *pivot, *ratios]
