"""A robot's configuration from what its sensors say: absolute encoders of its joints, a localisation."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from nmm.arrays import Array, scalar, vector
from nmm.errors import InputError, few, no_such
from nmm.robots.robot import Robot
from nmm.robots.wheel_rates import steered_wheels

#: A locked joint that is measured farther from where it is locked makes another robot of it, rad or m.
HELD = 0.01


class Encoders:
    """What the encoders of a robot's joints say of q."""

    def __init__(self, robot: Robot) -> None:
        self.robot, self.where = robot, f"q_from: {robot.name}"
        self.own = robot.q_names[min(3, robot.platform.n_p) :]
        self._signs = dict.fromkeys(robot.reversed_joints, -1.0)
        self._steered = steered_wheels(robot)
        self._passive = {joint for wheel in robot.wheels for joint in wheel.joints}
        self._following = {one.joint for one in robot.mimic_joints}
        self._turning = [i for i in robot.following.independent.tolist() if robot.endless[i]]

    def q(self, joints: Mapping[str, float], base: ArrayLike | None, near: ArrayLike | None) -> Array:
        """See `Robot.q_from`."""
        robot, where, own = self.robot, self.where, self.own
        values: dict[str, float] = {}
        steering: dict[str, list[float]] = {}
        for name, given in joints.items():
            value = scalar(given, f"{where}: joint {name}")
            if name in own:
                values[name] = self._signs.get(name, 1.0) * value
            elif name in self._steered:
                coordinate, angle = self._steered[name]
                steering.setdefault(coordinate, []).append(angle(value))
            elif name in robot.locked:
                _check_locked(name, value, robot.locked[name], where)
            elif name not in self._passive:
                raise no_such("joint", name, (*own, *sorted(self._passive)), where)
        for name, angles in steering.items():
            values.setdefault(name, math.atan2(sum(map(math.sin, angles)), sum(map(math.cos, angles))))
        for one in robot.mimic_joints:
            if one.joint in values and one.multiplier:
                values.setdefault(one.leader, (values[one.joint] - one.offset) / one.multiplier)
        if missing := [name for name in own if name not in values and name not in self._following]:
            what = f"no measurement of {few(missing)}"
            raise InputError(what, where=where, expected="each joint's", got=few([*joints]))
        found = np.zeros(robot.n)
        found[robot.n - len(own) :] = [values.get(name, 0.0) for name in own]
        if robot.platform.n_p:
            if base is None:
                raise InputError(where=f"{where}: base", expected="x, y, theta of the platform", got=None)
            found[:3] = vector(base, 3, f"{where}: base")
        elif base is not None:
            raise InputError(where=f"{where}: base", expected="None: it stands on a fixed base", got=base)
        if near is not None:
            by = (robot.q(near) - found)[self._turning]
            found[self._turning] += 2.0 * math.pi * np.round(by / (2.0 * math.pi))
        return robot.following.placed(found)


def _check_locked(name: str, value: float, held: float, where: str) -> None:
    if abs(value - held) > HELD:
        what = f"{name} is locked at {held:g} (by lock, or --lock) and measured elsewhere"
        raise InputError(what, where=where, got=value)
