"""What a calibration refuses: logs given twice, other units, drives that end elsewhere than they are said."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from nmm.base.errors import InputError, few
from nmm.plugins.robot.calibration.doubts import FAR
from nmm.plugins.robot.calibration.drive_log import DriveLog
from nmm.plugins.robot.calibration.drives import RobotDrive, path
from nmm.plugins.robot.calibration.fit import Fit
from nmm.plugins.robot.calibration.held import LEAST_SHARE, MOST_SHARE
from nmm.plugins.robot.calibration.judged import window_ends
from nmm.plugins.robot.calibration.model import CLOSED, Model

#: Wheels that roll are not so far off, rad for a rad turned.
LOOSEST = 0.3
#: Of two logs such a share of the rows is never the same by chance.
SAME = 0.5
#: A drive that ends with the heading that it had is off by less, rad, by numbers that are right.
TURNED = 0.3
#: What drives are of which only the ends are known.
ON_MARKS = "drives that end on the marks, and with the heading, that are said; squares both ways"


def check_logs(logs: Sequence[DriveLog], where: str) -> None:
    """`InputError` for a log that is given twice: the same counts at the same stamps, by whatever name."""
    for first, second in combinations(logs, 2):
        names = [name for name in first.readings if name in second.readings]
        t, i, j = np.intersect1d(first.t, second.t, assume_unique=True, return_indices=True)
        if not names or len(t) < SAME * min(len(first), len(second)):
            continue
        same = np.all([first.readings[name][i] == second.readings[name][j] for name in names], axis=0)
        if np.count_nonzero(same) > SAME * min(len(first), len(second)):
            what = f"{first.name} and {second.name} have the same counts at the same stamps"
            raise InputError(what, where=where, expected="drives that differ: one counts once")


def check_alike(model: Model, drive: RobotDrive, where: str) -> None:
    """`InputError` where the reference goes much farther, or less, than the wheels. Steps are as long as it
    takes for noise not to lengthen them."""
    if drive.ends:
        return
    noise = float(np.median(np.hypot(*np.diff(drive.z[:, :2], 2, axis=0).T))) if len(drive.z) > 4 else 0.0
    ways = path(model.counters, drive, drive.at - drive.delay)
    every = 1
    while every < len(drive.z) // 4:
        steps = np.hypot(*(drive.z[every:, :2] - drive.z[:-every, :2]).T)
        if np.median(steps) > 5.0 * noise:
            break
        every *= 2
    else:
        return
    went, turned = (ways[every:] - ways[:-every]).T
    moving = (went > 0.2 * went.max()) & (turned < 1.0) & (went > turned)  # a point beside goes farther
    if not np.any(moving):
        return
    share = float(np.median(steps[moving] / went[moving]))
    if not LEAST_SHARE < share < MOST_SHARE:
        what = f"the reference goes {share:.3g} m for each m by the wheels"
        expected = "about one: wheels in rad, with radii in m; the reference in m, of this drive"
        raise InputError(what, where=f"{where}: {drive.name}", expected=expected)


def check_numbers(model: Model, fitted: Fit, where: str) -> None:
    """`InputError` for numbers that no robot has whose file this is."""
    names = few([drive.name for drive in model.drives])
    if fitted.noise.counters > LOOSEST:
        what = f"wheels and reference disagree by {fitted.noise.counters:.2g} rad for a rad that wheels turn"
        expected = "a reference of this drive, by a clock that runs alike; readings in rad"
        if all(drive.ends for drive in model.drives):
            expected = ON_MARKS
        raise InputError(what, where=f"{where}: {names}", expected=expected)
    for i in fitted.free:
        number, value = model.learned[i], float(fitted.values[i])
        if number.kind in ("radius", "scale", "track", "wheelbase", "ratio"):
            share = value / number.value
            if not LEAST_SHARE < share < MOST_SHARE:
                what = (
                    f"{number.name} would be {value:.4g} {number.unit} where the file has {number.value:.4g}"
                )
                raise InputError(what, where=f"{where}: {names}", expected="a reading in its unit")


def check_ends(model: Model, fitted: Fit, where: str) -> None:
    """`InputError` for drives that do not end where they are said to: by numbers far from the file's, or that
    leave them far from there."""
    ending = [drive for drive in model.drives if drive.ends]
    own = [i for i in fitted.free if model.learned[i].of_robot]
    if not ending or not own:
        return
    if len(ending) == len(model.drives):
        for i in own:
            number, value = model.learned[i], float(fitted.values[i])
            if abs(value - number.value) > FAR * number.plausible:
                what = f"{number.name} would be {value:.3g} {number.unit}, by the file {number.value:.3g}"
                raise InputError(what, where=f"{where}: {few([d.name for d in ending])}", expected=ON_MARKS)
    for drive in ending:
        errors = window_ends(model.of([drive]), fitted, [[(0, 1)]])[0]
        way = float(path(model.counters, drive, drive.t[-1:])[0, 0])
        far, turned = float(np.hypot(*errors[:2])), float(np.abs(errors[2:]).max(initial=0.0))
        if far > CLOSED * way + 0.1 or turned > TURNED:
            turn = f", turned by {turned:.2g} rad," if turned > TURNED else ""
            what = f"by any likely numbers it ends {far:.3g} m{turn} from where it is said to"
            raise InputError(what, where=f"{where}: {drive.name}", expected=ON_MARKS)
