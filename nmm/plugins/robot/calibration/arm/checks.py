"""Whether sightings may be a robot's: what it reads, and that it moved."""

from __future__ import annotations

import math

import numpy as np

from nmm.base.errors import InputError
from nmm.plugins.robot.calibration.arm.model import ArmModel
from nmm.plugins.robot.calibration.arm.view import SightingsView

#: Joints may be read so far outside their limits, rad or m.
OUTSIDE = {"rad": 0.5, "m": 0.1}
#: No joint without limits turns farther, rad: three turns.
FARTHEST = 6.0 * math.pi
#: All postures are one where no joint moved farther, rad or m.
STILL = 0.02


def check_readings(model: ArmModel) -> None:
    """`InputError` for a joint that reads what it cannot, with what would fit; for an arm that stood
    still."""
    for view in model.views:
        where = f"{model.where}: {view.log.name}"
        if float(np.ptp(view.readings, axis=0).max()) < STILL:
            what = "the arm stands still: all samples are of one posture"
            raise InputError(what, where=where, expected="postures that differ, a dozen and more")
        for k, c in enumerate(view.chain.coordinates):
            _check_joint(model, view, k, c, where)


def _check_joint(model: ArmModel, view: SightingsView, k: int, c: int, where: str) -> None:
    robot, values = model.robot, view.readings[:, k]
    unit = robot.q_units[c]
    limits = np.where(robot.limited[c], robot.q_limits[c], [-FARTHEST, FARTHEST])
    factor, offset = robot.gear(robot.q_names[c])
    low, high = limits[0] - OUTSIDE[unit], limits[1] + OUTSIDE[unit]

    def off(read: np.ndarray) -> float:
        """By how much the farthest reading lies outside; signs may be the other way."""
        placed = [np.asarray(sign * factor * read + offset) for sign in (1.0, -1.0)]
        return min(float(np.max(np.maximum(low - at, at - high), initial=0.0)) for at in placed)

    if off(values) <= 0.0:
        return
    name = view.chain.names([c])[0]
    smaller = {"deg": math.pi / 180.0} if unit == "rad" else {"mm": 1e-3, "cm": 1e-2}
    fits = [other for other, share in smaller.items() if off(share * values) <= 0.0]
    hint = f"; {' or '.join(fits)} would fit" if fits else ""
    farthest = values[int(np.argmax(np.abs(values)))]
    what = f"{name} reads {farthest:.4g}, were it in {unit}{hint}"
    expected = f"{limits[0]:.3g} to {limits[1]:.3g} {unit}, by the file"
    raise InputError(what, where=where, expected=expected)
