"""How fast the wheels of a robot's file would slide sideways in a motion: from their places, not from G."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from nmm.base.arrays import Array
from nmm.model.robots.robot import Robot
from nmm.model.robots.wheel import Wheel
from nmm.model.robots.wheel_rates import following, steered_by, wheel_rates

#: Configurations that are looked at, at most.
_MOST = 200
#: Sideways speeds below this, m/s, or below this share of the wheel's own speed, are rounding of the file.
SLOW, ROUNDED = 1e-3, 2e-3


def plain_wheels(robot: Robot) -> list[Wheel]:
    """Wheels without rollers that do not slide by the platform's design. Under a platform that moves sideways
    three or more are taken to have rollers."""
    platform = robot.platform
    if platform.n_p < 3 or np.any(platform.sliding(np.eye(platform.p))):
        return []
    plain = [wheel for wheel in robot.wheels if wheel.roller == 0.0 and not wheel.slides]
    return [] if platform.p > 2 and platform.n_p == 3 and len(plain) > 2 else plain


def sideways_speeds(robot: Robot, q: Array, q_dot: Array) -> dict[str, tuple[int, float]]:
    """The wheels that slide: by joint, the sample at which it is fastest, and the sideways speed there, m/s.

    q, q_dot : (N, n), m and rad, and their rates
    """
    wheels = plain_wheels(robot)
    if not wheels or not len(q):
        return {}
    some = np.unique(np.linspace(0, len(q) - 1, min(_MOST, len(q))).astype(int))
    rows = dict(zip(*wheel_rates(robot), strict=True))
    model, data = robot.model, robot.model.createData()
    carriers = [model.getJointId(wheel.carrier) for wheel in wheels]
    # By sample and wheel: the carrier's velocities, and the wheel's centre and axis in its frame.
    linear, angular, center, axis = np.zeros((4, len(some), len(wheels), 3))
    for k, sample in enumerate(some):
        pin.forwardKinematics(model, data, q[sample], q_dot[sample])
        for i, (wheel, joint) in enumerate(zip(wheels, carriers, strict=True)):
            center[k, i], axis[k, i] = wheel.center, wheel.axis
            if wheel.swivel:
                if wheel.joint not in rows:
                    continue  # a caster, which follows
                row = rows[wheel.joint]
                cosine, sine, _ = following(row, float(steered_by(row, q[sample : sample + 1])[0]))
                turn = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
                center[k, i] = wheel.pivot + turn @ (wheel.center - wheel.pivot)
                axis[k, i] = turn @ wheel.axis
            motion = pin.getVelocity(model, data, joint, pin.ReferenceFrame.LOCAL)
            linear[k, i], angular[k, i] = motion.linear, motion.angular
    velocity = linear + np.cross(angular, center)
    sideways = np.abs(np.einsum("kij,kij->ki", velocity, axis))
    speeds = np.linalg.norm(velocity, axis=2)
    over = sideways - np.maximum(SLOW, ROUNDED * speeds)
    worst = over.argmax(axis=0)
    return {
        wheel.joint: (int(some[worst[i]]), float(sideways[worst[i], i]))
        for i, wheel in enumerate(wheels)
        if over[worst[i], i] > 0.0
    }
