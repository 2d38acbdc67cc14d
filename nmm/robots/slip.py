"""Wheels that a platform does not let roll: its reference point is not on their axle, say."""

from __future__ import annotations

import numpy as np

from nmm.robots.robot import Robot

#: Sideways speeds of a wheel below this, for an input of 1 m/s or 1 rad/s, are the file's rounding.
SLACK = 1e-3


def slipping_wheels(robot: Robot) -> dict[str, float]:
    """Wheels that slide sideways, and how fast at most for an input of 1, m/s.

    Looked at are the wheels of the root link's body that neither steer nor swivel nor have rollers: where
    the platform's x and y are not on their axle, they cannot only roll.
    """
    platform = robot.platform
    plain = [wheel for wheel in robot.wheels if wheel.is_fixed]
    by_design = np.any(platform.sliding(np.eye(platform.p)))
    if not plain or platform.n_p < 3 or platform.p > 2 or by_design:  # three inputs: the wheels have rollers
        return {}
    own = platform.coordinate_limits[3:]
    found: dict[str, float] = {}
    for share in (0.5, 0.6):
        qp = np.zeros(platform.n_p)
        lower, upper = np.clip(own.T, -0.5, 0.5)
        qp[3:] = lower + share * (upper - lower)
        twists = platform.G(qp)[:3]  # at theta = 0 the body's own axes
        if not np.all(np.isfinite(twists)):
            continue
        for wheel in plain:
            x, y = wheel.center[:2]
            velocity = np.array([twists[0] - y * twists[2], twists[1] + x * twists[2]])
            sideways = float(np.abs(wheel.axis[:2] @ velocity).max(initial=0.0))
            if sideways > SLACK:
                found[wheel.joint] = max(sideways, found.get(wheel.joint, 0.0))
    return found


def slip_warnings(robot: Robot) -> list[str]:
    """A sentence about the wheels that slide, if there are any."""
    slipping = slipping_wheels(robot)
    if not slipping:
        return []
    names = ", ".join(f"{name} ({speed:.3g} m/s for an input of 1)" for name, speed in slipping.items())
    what = f"wheels slide sideways under platform {robot.platform.name}: {names}"
    plain = [wheel for wheel in robot.wheels if wheel.is_fixed]
    across = plain[0].axis[:2]
    ahead = [wheel.center[0] * across[1] - wheel.center[1] * across[0] for wheel in plain]
    if np.ptp(ahead) > SLACK:
        return [
            f"{what}; on several axles they cannot all roll in turns: --platform skid_steer "
            '(platform="skid_steer") is made for that'
        ]
    return [f"{what}; is its reference point on their axle? (axle, --axle X,Y)"]
