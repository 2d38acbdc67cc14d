"""What of an episode this robot cannot have done: another unit, another zero, or another robot."""

from __future__ import annotations

import numpy as np

from nmm.base.arrays import Array
from nmm.base.findings import Finding
from nmm.model.robots.robot import Robot

#: A joint so far outside its limits, as a share of its range, is doubted.
OUTSIDE = 0.25
#: Wheels so many times faster than they can turn are doubted.
FASTER = 2.0
#: A velocity of which the platform cannot have so much, as a share of it, is doubted.
SIDEWAYS = 0.2


def of_joints(robot: Robot, q: Array) -> list[Finding]:
    """Joints far outside their limits at q (N, n): degrees taken for radians, or another zero."""
    found = dict[str, float]()
    for i in range(min(3, robot.platform.n_p), robot.n):
        lower, upper = robot.q_limits[i]
        if robot.limited[i].all():
            most = float(max(lower - q[:, i].min(), q[:, i].max() - upper))
            if most > OUTSIDE * (upper - lower):
                found[robot.q_names[i]] = most
    if not found:
        return []
    return [Finding("joints_outside", {"names": [*found], "most": max(found.values())})]


def of_velocities(robot: Robot, q: Array, twist: Array) -> list[Finding]:
    """Velocities (N, 3) along the platform's axes, m/s and rad/s, that its wheels cannot make at q (N, n),
    where each of the three is largest."""
    platform, limits = robot.platform, {wheel.joint: wheel.velocity for wheel in robot.wheels}
    fastest, sideways = 1.0, 0.0
    for k in {*np.argmax(np.abs(twist), axis=0).tolist()}:
        at = q[k].copy()
        at[:3] = 0.0
        G = platform.G(at[: platform.n_p])[:3]
        u = np.linalg.pinv(G) @ twist[k]
        size = float(np.linalg.norm(twist[k]))
        if size > 0.0:
            sideways = max(sideways, float(np.linalg.norm(twist[k] - G @ u)) / size)
        for name, speed in robot.wheel_speeds(u, at).items():
            fastest = max(fastest, abs(speed) / limits[name])
    found = []
    if fastest > FASTER:
        found.append(Finding("wheels_too_fast", {"times": fastest}))
    if sideways > SIDEWAYS:
        found.append(Finding("velocity_impossible", {"share": sideways, "platform": platform.name}))
    return found
