"""A reference whose heading jumps while its place on the robot stays: a marker twisted, a compass off."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import groupby, pairwise

import numpy as np

from nmm.base.arrays import Array
from nmm.plugins.robot.calibration.drives import RobotDrive
from nmm.plugins.robot.calibration.innovations import BEGINS, LEFT_OUT, TAKEN
from nmm.plugins.robot.calibration.planar import alignment, composed

#: A heading is compared with places over a way of so many m, and of so many times their second differences.
FAR, NOISES = 0.5, 10.0
#: Headings are taken of the first part that is about as long as the longest.
MOSTLY = 0.8
#: A heading jumped by more, rad, and by more of its deviations.
TWIST, SURE = 0.03, 5.0


def untwisted(drives: Sequence[RobotDrive], motions: Sequence[Array], mount: Array) -> list[RobotDrive]:
    """The drives, but those whose headings jumped without their places in pieces: where headings are others
    than those of most looks, they are not used.

    motions (M - 1, 3) : of each drive, by its wheels; mount (3,) : where the reference is on the robot
    """
    made = []
    for drive, steps in zip(drives, motions, strict=True):
        made += [drive] if drive.ends or drive.rows == 2 else _pieces(drive, steps, mount)
    return made


def _pieces(drive: RobotDrive, motions: Array, mount: Array) -> list[RobotDrive]:
    begins = [*np.flatnonzero(drive.taken == BEGINS).tolist(), len(drive.at)]
    if len(begins) < 3:
        return [drive]
    parts, noise = [*pairwise(begins)], float(np.median(np.hypot(*np.diff(drive.z[:, :2], 2, axis=0).T)))
    yaws = [_yaw(drive, motions, part, max(FAR, NOISES * noise), mount) for part in parts]
    known = [k for k, (yaw, _) in enumerate(yaws) if not math.isnan(yaw)]
    if not known:
        return [drive]
    longest = max(parts[k][1] - parts[k][0] for k in known)
    most = next(k for k in known if parts[k][1] - parts[k][0] > MOSTLY * longest)
    by = [math.remainder(yaw - yaws[most][0], 2.0 * math.pi) for yaw, _ in yaws]
    twisted = [
        abs(off) > max(TWIST, SURE * math.hypot(deviation, yaws[most][1]))
        for off, (_, deviation) in zip(by, yaws, strict=True)
    ]
    if not any(twisted):
        return [drive]
    made, gaps = list[RobotDrive](), drive.gaps
    for turned, group in groupby(range(len(parts)), key=lambda k: twisted[k]):
        some = [*group]
        first, last = parts[some[0]][0], parts[some[-1]][1]
        taken = drive.taken[first:last].copy()
        if turned:
            taken[taken == LEFT_OUT] = TAKEN
            if not drive.gaps:
                taken[1:] = TAKEN
        z = drive.z[first:last].copy()
        z[:, 2] *= not turned
        name = drive.name if first == 0 else f"{drive.name} from {drive.at[first]:.4g} s"
        kept = min(gaps, len(some) - (not made))
        gaps -= kept
        twist = by[max(some, key=lambda k: parts[k][1] - parts[k][0])] if turned else 0.0
        piece = replace(drive, name=name, at=drive.at[first:last], z=z, taken=taken, gaps=kept, twist=twist)
        made.append(replace(piece, rows=2 if turned else 3))
    return made


def _yaw(
    drive: RobotDrive, motions: Array, part: tuple[int, int], far: float, mount: Array
) -> tuple[float, float]:
    """By how much the reference's heading is turned on the robot in a part of a drive, by its places beside
    the wheels' way, and the deviation of it, rad; NaN where it does not go far enough."""
    way = np.concatenate([[0.0], np.cumsum(np.hypot(*motions[part[0] : part[1] - 1, :2].T))])
    at_axle, found, first = np.array([mount[0], mount[1], 0.0]), [], 0
    while first < len(way) - 3:
        last = int(np.searchsorted(way, way[first] + far))
        if last >= len(way):
            break
        some = slice(part[0] + first, part[0] + last + 1)
        steps = motions[some.start : some.stop - 1]
        if last - first > 2 and np.all(drive.taken[some] != LEFT_OUT):
            heading = alignment(drive.z[some, :2], steps, at_axle, math.inf)
            turned = drive.z[some, 2] - heading - composed(steps)[:, 2]
            found.append(math.atan2(float(np.mean(np.sin(turned))), float(np.mean(np.cos(turned)))))
        first = last
    if len(found) < 2:
        return math.nan, math.inf
    about = found[len(found) // 2]
    off = np.array([math.remainder(one - about, 2.0 * math.pi) for one in found])
    middle = float(np.median(off))
    spread = 1.5 * float(np.median(np.abs(off - middle)))
    return about + middle, max(spread, 1e-3) / math.sqrt(len(found))
