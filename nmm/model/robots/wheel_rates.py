"""How fast wheels turn for given inputs, as numbers that compiled code reads."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection
from functools import partial
from typing import Any

import numpy as np
import pinocchio as pin

from nmm.base.arrays import Array
from nmm.base.kernels.compiled import inlined
from nmm.model.platforms import Car, FrontDriveCar
from nmm.model.robots.joint_table import twist
from nmm.model.robots.robot import Robot
from nmm.model.robots.wheel import Wheel

#: How far from level a carrier may lie: files write pi/2 with a few digits.
_LEVEL = 1e-3
#: A wheel on a swivel that is so far before or behind its axis, as a part of its radius, is a caster.
_TRAIL = 1e-4


def wheel_rates(robot: Robot) -> tuple[tuple[str, ...], Array]:
    """Names of the wheels whose rates q and u determine, and rows (w, 9), m and rad:
    [x, y, angle, r, steer, pivot x, pivot y, a, b].

    A wheel moves with (x, y), grips along `angle`, and is turned about its pivot by φ: its rate is the speed
    there along the grip over r; with rollers r is the radius times cos γ. With δ the coordinate `steer` (-1
    on the main body), tan φ = a sin δ / (cos δ - b sin δ): φ = δ (a = 1, b = 0) on a steering joint or a
    first trailer; a car's other steered wheels follow δ (Ackermann). No casters or further trailers."""
    rows = {wheel.joint: row for wheel in robot.wheels if (row := _row(robot, wheel)) is not None}
    return tuple(rows), np.array(list(rows.values())).reshape(-1, 9)


@inlined
def following(wheel: Any, delta: Any) -> tuple[Any, Any, Any]:
    """Cosine and sine of φ at δ, numbers or arrays, of a wheel's row (see `wheel_rates`), and dφ/dδ."""
    sine = wheel[7] * np.sin(delta)
    cosine = np.cos(delta) - wheel[8] * np.sin(delta)
    length = np.sqrt(cosine * cosine + sine * sine)
    return cosine / length, sine / length, wheel[7] / (length * length)


@inlined
def rolling(wheel: Any, theta: Any, delta: Any) -> tuple[Any, Any, Any, Any]:
    """A row of `wheel_rates` at θ and δ (0 without steering), numbers or arrays: what the rates of x, y, θ
    and δ add to the wheel's, 1/m and 1."""
    cosine, sine, slope = following(wheel, delta)
    ahead, beside = cosine * wheel[0] - sine * wheel[1], sine * wheel[0] + cosine * wheel[1]
    angle = wheel[2] + np.arctan2(sine, cosine)
    grips, slides = np.cos(angle) / wheel[3], np.sin(angle) / wheel[3]
    return (
        np.cos(theta + angle) / wheel[3],
        np.sin(theta + angle) / wheel[3],
        (ahead + wheel[5]) * slides - (beside + wheel[6]) * grips,
        slope * (ahead * slides - beside * grips),
    )


def moved_by(wheel: Array) -> tuple[int, ...]:
    """The coordinates whose rates a wheel's row adds up: x, y, θ and, where there is one, δ."""
    return (0, 1, 2) if wheel[4] < 0.0 else (0, 1, 2, int(wheel[4]))


def steered_by(wheel: Array, x: Array) -> Array:
    """δ of a wheel's row at q, or its rate at q_dot, of x (N, n): (N,), 0 without steering."""
    return np.zeros(len(x)) if wheel[4] < 0.0 else x[:, int(wheel[4])]


def wheel_shares(rows: Array, q: Array) -> Array:
    """What the coordinates' rates add to the wheels', (N, w, n), at q (N, n): see `rolling`."""
    shares = np.zeros((len(q), len(rows), q.shape[1]))
    for k, wheel in enumerate(rows):
        terms = rolling(wheel, q[:, 2], steered_by(wheel, q))
        for i, share in zip(moved_by(wheel), terms, strict=False):
            shares[:, k, i] = share
    return shares


def following_dot(wheel: Array, delta: Array, delta_dot: Array) -> Array:
    """The rate of dφ/dδ (N,) as δ moves."""
    a, b, sine, cosine = wheel[7], wheel[8], np.sin(delta), np.cos(delta)
    square = (a * sine) ** 2 + (cosine - b * sine) ** 2
    change = a * a * sine * cosine - (cosine - b * sine) * (sine + b * cosine)
    return np.asarray(-2.0 * a * change / square**2 * delta_dot)


def rolling_dot(
    wheel: Array, theta: Array, delta: Array, theta_dot: Array, delta_dot: Array
) -> tuple[Array, Array, Array, Array]:
    """The rates (N,) of what `rolling` gives, as θ and δ move."""
    cosine, sine, slope = following(wheel, delta)
    angle = wheel[2] + np.arctan2(sine, cosine)
    grips, slides = np.cos(angle) / wheel[3], np.sin(angle) / wheel[3]
    ahead, beside = cosine * wheel[0] - sine * wheel[1], sine * wheel[0] + cosine * wheel[1]
    turning = theta_dot + slope * delta_dot
    return (
        -np.sin(theta + angle) / wheel[3] * turning,
        np.cos(theta + angle) / wheel[3] * turning,
        (wheel[5] * grips + wheel[6] * slides) * slope * delta_dot,
        following_dot(wheel, delta, delta_dot) * (ahead * slides - beside * grips),
    )


def turning_wheels(robot: Robot, q: Array, q_dot: Array) -> tuple[tuple[str, ...], Array]:
    """The wheels of `wheel_rates`, and how fast they turn, (N, w) rad/s, at q and q_dot, (N, n)."""
    names, rows = wheel_rates(robot)
    return names, np.einsum("kwi,ki->kw", wheel_shares(rows, q), q_dot)


def steered_wheels(robot: Robot) -> dict[str, tuple[str, Callable[[float], float]]]:
    """Swivels that follow a car's steering angle δ: by joint, this, and δ at the swivel's angle."""
    rows = dict(zip(*wheel_rates(robot), strict=True))
    swivels: dict[str, tuple[str, Callable[[float], float]]] = {}
    for wheel in robot.wheels:
        if wheel.swivel and wheel.joint in rows:
            row = rows[wheel.joint]
            swivels[wheel.swivel] = (
                robot.q_names[int(row[4])],
                partial(_steering, *_swivel(robot, wheel), row),
            )
    return swivels


def swivel_readings(robot: Robot, q: Array, q_dot: Array) -> dict[str, tuple[float, float]]:
    """What encoders of the swivels of `steered_wheels` read at q (n,) and q_dot (n,): angle and rate by
    joint, rad and rad/s, without the robot's corrections of the steering angle."""
    rows, read = dict(zip(*wheel_rates(robot), strict=True)), {}
    for wheel in robot.wheels:
        if wheel.swivel and wheel.joint in rows:
            row, (upright, straight) = rows[wheel.joint], _swivel(robot, wheel)
            steer = int(row[4])
            ratio, offset = robot.corrections.get(robot.q_names[steer], (1.0, 0.0))
            cosine, sine, slope = following(row, (q[steer] - offset) / ratio)
            angle = math.remainder(math.atan2(sine, cosine) - straight, 2.0 * math.pi)
            read[wheel.swivel] = upright * angle, float(upright * slope * q_dot[steer] / ratio)
    return read


def _swivel(robot: Robot, wheel: Wheel) -> tuple[float, float]:
    """Whether a wheel's swivel turns about what points up, 1 or -1, and its angle where δ is none, rad."""
    model = robot.display_model
    joint = model.getJointId(wheel.swivel)
    upright = (model.jointPlacements[joint].rotation @ twist(model.joints[joint], pin.neutral(model))[1])[2]
    return math.copysign(1.0, upright), math.remainder(math.atan2(-wheel.axis[0], wheel.axis[1]), math.pi)


def _steering(upright: float, straight: float, row: Array, angle: float) -> float:
    """δ of tan φ = a sin δ / (cos δ - b sin δ) at the swivel's angle."""
    phi = upright * angle + straight
    return math.atan2(math.sin(phi), row[7] * math.cos(phi) + row[8] * math.sin(phi))


def inputs_held_by(robot: Robot, wheels: Collection[str]) -> list[str]:
    """The platform's inputs that rate limits of these wheels bound; judged by the wheels on the main body,
    with the platform's own joints straight."""
    names, rows = wheel_rates(robot)
    held = [row for name, row in zip(names, rows, strict=True) if name in wheels and row[4] < 0.0]
    if not held:
        return []
    spins = np.array([rolling(row, 0.0, 0.0)[:3] for row in held])
    spins = spins @ robot.platform.G(np.zeros(robot.platform.n_p))[:3]
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
    x, y = (placement.rotation[:2, :2] @ np.array([x, y])).tolist()
    steer = float(robot.q_names.index(wheel.carrier))
    return [x, y, angle + turned, radius, steer, *placement.translation[:2].tolist(), 1.0, 0.0]


def _following(robot: Robot, wheel: Wheel, angle: float) -> list[float] | None:
    """The row of a wheel on a swivel: its axis passes the point about which a car turns, (0, L / tan δ)."""
    car = robot.platform
    if not isinstance(car, Car | FrontDriveCar) or wheel.carrier != "theta":
        return None
    straight = math.remainder(angle, math.pi)  # with the swivel at zero, from straight ahead
    turn = complex(math.cos(straight), -math.sin(straight))
    offset = complex(*(wheel.center - wheel.pivot)[:2]) * turn
    if abs(offset.real) > _TRAIL * wheel.radius:
        return None
    pivot = wheel.pivot[:2].tolist()
    ratios = [pivot[0] / car.wheelbase, pivot[1] / car.wheelbase]
    steer = float(robot.q_names.index(car.steering))
    return [offset.real, offset.imag, angle - straight, wheel.radius, steer, *pivot, *ratios]
