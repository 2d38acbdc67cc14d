"""What there is to say about a robot's wheels: those not found, and whether the root is at their axle."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from nmm.robots.loading.layout import Measured
from nmm.robots.robot import Robot

#: How far the axle's midpoint may be from the reference point, m.
NEAR = 2e-3
#: How far two directions may differ, rad.
PARALLEL = 1e-3

#: In the notes of loading on a joint that is named a wheel and is none.
NO_WHEEL = "in spite of its name"


def wheel_advice(robot: Robot, root: str) -> list[str]:
    """Warnings about a robot's wheels.

    Parameters
    ----------
    robot : loaded without `axle` and `wheels`
    root : name of its root link
    """
    if not robot.platform.coordinates:
        return []
    notes = [note for note in robot.notes if NO_WHEEL in note]
    return [*notes, *_nameless(robot), *_about_axle(robot, root)]


def _nameless(robot: Robot) -> Iterator[str]:
    """Joints that turn as wheels do, but whose names do not say so."""
    measured = Measured(robot.model, (), robot.name)
    for name, joint in measured.joints.items():
        on_root = int(robot.model.parents[joint]) == measured.root
        endless = not np.isfinite(robot.q_limits[robot.coordinate(name)]).any()
        named = measured.is_named_wheel(joint)  # of which the notes speak
        if on_root and endless and not named and measured.why_not_rolling(joint) is None:
            yield (
                f"joint {name!r} turns without end about a level axis, with nothing below it: if it is a "
                f"wheel, say so with the others, --wheels {name},... (wheels=[{name!r}, ...]); its name "
                'holds no "wheel"'
            )


def _about_axle(robot: Robot, root: str) -> Iterator[str]:
    """Where the axle of the wheels is that neither steer nor swivel nor have rollers."""
    fixed = [wheel for wheel in robot.wheels if wheel.is_fixed]
    if not fixed or robot.platform.p > 2 or np.any(robot.platform.sliding(np.eye(robot.platform.p))):
        return
    names = ", ".join(wheel.joint for wheel in fixed)
    axis = fixed[0].axis[:2] / np.linalg.norm(fixed[0].axis[:2])
    if any(abs(axis[0] * wheel.axis[1] - axis[1] * wheel.axis[0]) > PARALLEL for wheel in fixed):
        yield f"wheels that neither steer nor swivel are not parallel: {names}"
        return
    along = np.array([axis[1], -axis[0]])  # the way that they roll
    ahead = np.array([along @ wheel.center[:2] for wheel in fixed])
    if np.ptp(ahead) > NEAR:
        yield (
            f"wheels that neither steer nor swivel are not on one axle ({names}): the robot slips in turns; "
            '--platform skid_steer (platform="skid_steer") takes that as its way of turning, and says how '
            "fast they slide"
        )
        return
    if abs(along[1]) > PARALLEL:
        yield (
            f"the wheels do not roll along the root link's x axis ({names}); --axle FRAME (axle=FRAME) gives "
            "the direction"
        )
    middle = 0.5 * (
        np.min([wheel.center for wheel in fixed], axis=0) + np.max([wheel.center for wheel in fixed], axis=0)
    )
    if np.linalg.norm(middle[:2]) > NEAR:
        yield (
            f"root link {root!r} is not at the wheels' axle, whose midpoint is at ({middle[0]:.4g}, "
            f"{middle[1]:.4g}) m in it ({names}): give --axle {middle[0]:.4g},{middle[1]:.4g} "
            f"(axle=({middle[0]:.4g}, {middle[1]:.4g})), or the robot turns about the wrong point"
        )
