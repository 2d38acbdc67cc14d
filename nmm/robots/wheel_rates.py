"""How fast wheels turn for given inputs, as numbers that compiled code reads."""

from __future__ import annotations

import math

import numpy as np

from nmm.arrays import Array
from nmm.robots.robot import Robot
from nmm.robots.wheel import Wheel

#: How far from level a carrier may lie: files write pi/2 with a few digits.
_LEVEL = 1e-3


def wheel_rates(robot: Robot) -> tuple[tuple[str, ...], Array]:
    """Names of the driven wheels, and rows [x, y, angle, r, steer, pivot x, pivot y], (w, 7), m and rad.

    A wheel that rolls as (x, y) moves and grips along `angle`, turned and moved by coordinate `steer` about
    its pivot (-1: it hangs on the main body), turns at (grip . velocity there) / r; of a wheel with rollers
    r is the radius times cos γ. Wheels on swivels and on trailers are left out: their rates follow.
    """
    rows = {wheel.joint: row for wheel in robot.wheels if (row := _row(robot, wheel)) is not None}
    return tuple(rows), np.array(list(rows.values())).reshape(-1, 7)


def _row(robot: Robot, wheel: Wheel) -> list[float] | None:
    if wheel.swivel or robot.platform.n_p < 3:
        return None
    angle = math.atan2(-wheel.axis[0], wheel.axis[1]) + wheel.roller
    radius = wheel.radius * math.cos(wheel.roller)
    x, y = (float(value) for value in wheel.rolls_at[:2])
    if wheel.carrier == "theta":
        return [x, y, angle, radius, -1.0, 0.0, 0.0]
    if wheel.carrier not in robot.q_names[3 : robot.platform.n_p]:
        return None
    if robot.q_names.index(wheel.carrier) not in robot.rate_coordinates:
        return None
    joint = robot.model.getJointId(wheel.carrier)
    placement = robot.model.jointPlacements[joint]
    if robot.model.names[robot.model.parents[joint]] != "theta" or placement.rotation[2, 2] < 1.0 - _LEVEL:
        return None
    turned = math.atan2(placement.rotation[1, 0], placement.rotation[0, 0])
    x, y = (float(value) for value in (placement.rotation[:2, :2] @ np.array([x, y])))
    pivot = [float(value) for value in placement.translation[:2]]
    return [x, y, angle + turned, radius, float(robot.q_names.index(wheel.carrier)), *pivot]
