"""What is known beside a reference: how counters that are more than inputs agree."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from nmm.base.arrays import Array
from nmm.plugins.robot.calibration.drives import RobotDrive
from nmm.plugins.robot.calibration.stretches import Stretches

#: Counters are compared with one another over so long, s.
WINDOW = 1.0


class Slopes(NamedTuple):
    """Of a drive's stretches in f numbers: of their ends (M - 1, 3, f), of what is spare (M - 1, k, f) and
    of what is astray (M - 1, n_p - 3, f)."""

    ends: Array
    spare: Array
    astray: Array


class SideRows(NamedTuple):
    """What is known beside the reference, over its deviation: (R,), with slopes (R, f) of it as it is, to be
    multiplied by weights (R,); the sum of the variances' logarithms; how many of the numbers are free."""

    over: Array
    slopes: Array
    weights: Array
    logarithms: float
    free: int


#: Where nothing is known.
NOTHING = SideRows(np.zeros(0), np.zeros((0, 0)), np.zeros(0), 0.0, 0)


def agreement(drive: RobotDrive, made: Stretches, slopes: Slopes, noise: float, inputs: int) -> SideRows:
    """What counters say beyond motions over some stretches at once, over the deviation that their noise
    gives it.

    Slopes are by what counters counted, with their noise: numbers would seem smaller by the noise's share
    in a window, which is the less the longer it is."""
    k = made.spare.shape[1]
    spacing = float(drive.at[-1] - drive.at[0]) / len(made.spare)
    begins = np.arange(0, len(made.spare), max(1, round(WINDOW / spacing)))
    went = np.add.reduceat(made.counted.mean(axis=1), begins)
    moved = went > 0.0
    if k <= inputs or not np.any(moved):
        return NOTHING
    spare, by = (np.add.reduceat(part, begins, axis=0) for part in (made.spare, slopes.spare))
    deviations = noise * np.sqrt(np.where(moved, went, 1.0))
    weights = np.repeat(np.where(moved, 1.0 / deviations, 0.0), k)
    rows = by.reshape(len(weights), by.shape[2])
    logarithms = 2.0 * (k - inputs) * float(np.sum(np.log(deviations[moved])))
    some = (k - inputs) * int(np.count_nonzero(moved))
    return SideRows(spare.ravel() * weights, rows, weights, logarithms, some)
