"""Looks of a reference that no noise explains, and where it jumped."""

from __future__ import annotations

import numpy as np

from nmm.base.arrays import Array
from nmm.plugins.robot.calibration.drives import RobotDrive
from nmm.plugins.robot.calibration.filtered import DriveNoise
from nmm.plugins.robot.calibration.innovations import BEGINS, LEFT_OUT, TAKEN
from nmm.plugins.robot.calibration.model import Model
from nmm.plugins.robot.calibration.twists import untwisted

#: Innovations beyond so many standard deviations are outliers, looked for so many times.
OUTLIER, SCREENS = 5.0, 6
#: A plain jump is so many times farther than outliers; there are so many at most, and a share of looks.
PLAIN, FEW, RARE = 2.0, 3, 0.005
#: Looks after a bad one that tell whether the reference jumped.
NEXT = 3


def screened(model: Model, values: Array, noise: DriveNoise) -> int:
    """Leave out looks that no noise explains, and begin anew where the reference jumped; how many are new.

    A look that is far off, and those after it, are left out for a trial: if the last of them are where they
    were predicted, the far ones were outliers; else the reference jumped."""
    changes, made = 0, model.stretched(values, [])

    def far_off(i: int) -> Array:
        drive = model.drives[i]
        drive_fit = model.of([drive]).filtered(values, [], [made[i]], noise)[0]
        return np.max(np.abs(drive_fit.w), axis=1)

    for i, drive in enumerate(model.drives):
        for _ in range(0 if drive.ends else SCREENS):
            bad = np.flatnonzero((drive.taken == TAKEN) & (far_off(i) > OUTLIER)).tolist()
            bad = [m for n, m in enumerate(bad) if n == 0 or m - bad[n - 1] > 1]  # a run's first
            apart: list[int] = []
            for m in bad:
                if not apart or m - apart[-1] > 3 * NEXT:
                    apart.append(m)
            if not apart:
                break
            before = drive.taken.copy()
            for m in apart:
                trial = slice(m, m + 2 * NEXT)
                drive.taken[trial][before[trial] == TAKEN] = LEFT_OUT
            off = far_off(i)
            for m in apart:
                trial = slice(m, m + 2 * NEXT)
                drive.taken[trial] = before[trial]
                later = [n for n in range(m + NEXT, min(m + 2 * NEXT, len(off))) if before[n] == TAKEN]
                if later and all(off[n] > OUTLIER for n in later):
                    drive.taken[m] = BEGINS
                else:
                    some = np.arange(m, min(m + NEXT, len(off)))
                    drive.taken[some[(before[some] == TAKEN) & (off[some] > OUTLIER)]] = LEFT_OUT
            new = int(np.count_nonzero(drive.taken != before))
            changes += new
            if not new:
                break
    return changes


def rejoin(model: Model, values: Array, noise: DriveNoise) -> None:
    """Go on where the filter began anew for no jump, as numbers and noise say now that they are known."""
    made = model.stretched(values, [])
    for i, drive in enumerate(model.drives):
        for m in np.flatnonzero(drive.taken == BEGINS)[1:].tolist() if not drive.gaps else []:
            drive.taken[m] = LEFT_OUT
            one = model.of([drive]).filtered(values, [], [made[i]], noise)[0]
            off = np.max(np.abs(one.w[m : m + 1 + NEXT]), axis=1)
            jumped = bool(np.any(off[1:] > OUTLIER))
            drive.taken[m] = BEGINS if jumped else TAKEN if off[0] <= OUTLIER else LEFT_OUT


def plain_jumps(model: Model, values: Array, first: DriveNoise) -> bool:
    """Begin anew where the reference plainly jumped, before noise is known, which would explain the jumps:
    as few, and far beyond what looks vary by from one to the next. Whether there were any."""
    before = [drive.taken.copy() for drive in model.drives]
    begun, varied = model.begun, [_varied(drive) for drive in model.with_looks]
    if not varied:
        return False
    place, heading = (PLAIN * max(column) for column in zip(*varied, strict=True))
    level = first._replace(place=max(place, first.place), heading=max(heading, 0.2 * first.heading))
    screened(model, values, level._replace(counters=0.05, across=0.03, turns=0.03, jitter=0.01))
    if 0 < model.begun - begun <= FEW + RARE * sum(len(drive.at) for drive in model.drives):
        begin_again(model, values)
        return True
    for drive, taken in zip(model.drives, before, strict=True):
        drive.taken[:] = taken
    return False


def _varied(drive: RobotDrive) -> tuple[float, float]:
    """About the deviations of a reference's place, m, and heading, rad, by its second differences, of which a
    jump changes few."""
    if len(drive.z) < 5:
        return 0.0, 0.0
    by = np.abs(np.diff(drive.z, 2, axis=0))
    x, y, heading = (np.median(by, axis=0) / (0.6745 * np.sqrt(6.0))).tolist()
    return max(x, y), heading


def begin_again(model: Model, values: Array) -> None:
    """Go on where jumps were found: noise that explained them is none, nor are looks outliers by it; headings
    that jumped alone are not used."""
    motions = [made.motions for made, _ in model.stretched(values, [])]
    for drive in model.drives:
        drive.taken[drive.taken == LEFT_OUT] = TAKEN
    model.take(untwisted(model.drives, motions, model.mount(values)))
