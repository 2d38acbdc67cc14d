"""Where the platform's reference point is in the root link."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from nmm.arrays import array
from nmm.errors import InputError, RobotError, unknown
from nmm.robots.loading.chain import CHAIN

# How far from upright a frame's z axis may be: files write pi/2 with a few digits.
_LEVEL = 1e-3


def axle_placement(model: pin.Model, axle: str | ArrayLike, where: str) -> pin.SE3:
    """Pose of the platform's reference point in the root link: a position and a yaw.

    Parameters
    ----------
    model : on the chain
    axle : a frame on the root link's body, or its x, y (and z), m, in the root link's axes
    where : what messages call the model

    Raises
    ------
    RobotError : no such frame, one that moves in the root link or is tilted, or not two or three numbers
    """
    if isinstance(axle, str):
        return _of_frame(model, axle, where)
    try:
        point = array(axle, "axle")
    except InputError as error:
        raise RobotError(f"{where}: {error}") from None
    if point.shape not in ((2,), (3,)):
        raise RobotError(f"{where}: axle: expected a frame, x and y, or x, y and z (m), got {axle!r}")
    return pin.SE3(np.eye(3), np.append(point, np.zeros(3 - len(point))))


def _of_frame(model: pin.Model, name: str, where: str) -> pin.SE3:
    root = len(CHAIN)
    fixed = {frame.name: frame for frame in model.frames if frame.parentJoint == root}
    if name not in fixed:
        known = {frame.name: frame for frame in model.frames}
        if name in known:
            joint = model.names[known[name].parentJoint]
            raise RobotError(
                f"{where}: axle: frame {name!r} is not on the root link's body: joint {joint} moves it"
            )
        raise RobotError(unknown("frame", name, fixed, f"{where}: axle"))
    placement = fixed[name].placement
    if placement.rotation[2, 2] < 1.0 - 0.5 * _LEVEL**2:
        raise RobotError(f"{where}: axle: frame {name!r} is tilted, expected its z axis upwards")
    yaw = np.arctan2(placement.rotation[1, 0], placement.rotation[0, 0])
    return pin.SE3(pin.utils.rotate("z", float(yaw)), np.array(placement.translation))


def axle_note(placement: pin.SE3) -> str:
    """What was done, as a note."""
    x, y, z = placement.translation
    yaw = np.arctan2(placement.rotation[1, 0], placement.rotation[0, 0])
    turned = f", turned by {yaw:g} rad" if abs(yaw) > 1e-9 else ""
    return f"the platform's reference point is at ({x:g}, {y:g}, {z:g}) m in the root link{turned}"
