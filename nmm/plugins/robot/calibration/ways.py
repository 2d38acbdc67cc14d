"""Ways of a drive from above: what the reference saw, and dead reckoning, with numbers before and after."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from nmm.base.arrays import Array
from nmm.plugins.robot.calibration.innovations import BEGINS, LEFT_OUT

if TYPE_CHECKING:
    from nmm.plugins.robot.calibration.calibration import Calibration
    from nmm.plugins.robot.calibration.drives import RobotDrive

#: Poses for which a path is begun: the first tenth of a drive, at most so many.
BEGINNING = 30
#: Places of a way whose ends alone a reference saw.
DENSE = 400


def ways_beside(found: Calibration, k: int) -> list[tuple[Array, Array, Array]]:
    """Of a drive's pieces, each (M, 2): what the reference saw, and the wheels' way before and after."""
    drive, model = found.model.drives[k], found.model
    values = found.fit.values
    own = [i for i, one in enumerate(model.learned) if one.of_robot]
    told = values.copy()
    told[own] = model.first[own]
    ways = [_ways(found, k, numbers) for numbers in (told, values)]
    begins = [*np.flatnonzero(drive.taken == BEGINS).tolist(), len(drive.at)]
    pieces = []
    for n, (first, last) in enumerate(pairwise(begins)):
        if last - first < 2:
            continue
        kept = drive.taken[first:last] != LEFT_OUT
        pieces.append((drive.z[first:last][kept, :2], ways[0][n], ways[1][n]))
    return pieces


def _ways(found: Calibration, k: int, values: Array) -> list[Array]:
    """The way of the reference's place by wheels alone, (M, 2) of each piece, m, in the reference's frame."""
    model, drive = found.model, found.model.drives[k]
    made = model.stretched(values, [])
    one, motions = model.filtered(values, [], made, found.noise)[k], made[k][0].motions
    begins = [*np.flatnonzero(drive.taken == BEGINS).tolist(), len(drive.at)]
    if drive.ends:  # the whole way, from where it begins
        motions = _dense(found, drive, values)
        begins = [0, len(motions) + 1]
    mount, ways = model.mount(values), []
    for first, last in pairwise(begins):
        m = 0 if drive.ends else min(BEGINNING, (last - first) // 10)
        poses = [_back(one.poses[first + m], motions[first : first + m])]
        for motion in motions[first : last - 1]:
            poses.append(_moved(poses[-1], motion))
        rows = np.array(poses)
        c, s = np.cos(rows[:, 2]), np.sin(rows[:, 2])
        ways.append(
            rows[:, :2] + np.stack([c * mount[0] - s * mount[1], s * mount[0] + c * mount[1]], axis=1)
        )
    return ways


def _dense(found: Calibration, drive: RobotDrive, values: Array) -> Array:
    """Motions (M, 3) of a drive between many times, by these numbers."""
    at = np.linspace(drive.at[0], drive.at[-1], DENSE)
    return found.model.of([replace(drive, at=at)]).stretched(values, [])[0][0].motions


def _moved(pose: Array, motion: Array) -> Array:
    c, s = math.cos(pose[2]), math.sin(pose[2])
    return pose + np.array([c * motion[0] - s * motion[1], s * motion[0] + c * motion[1], motion[2]])


def _back(pose: Array, motions: Array) -> Array:
    """Where a robot was that is at a pose (3,) after motions (M, 3)."""
    for motion in motions[::-1]:
        heading = pose[2] - motion[2]
        c, s = math.cos(heading), math.sin(heading)
        x, y = c * motion[0] - s * motion[1], s * motion[0] + c * motion[1]
        pose = np.array([pose[0] - x, pose[1] - y, heading])
    return pose


def bounds_of(ways: Sequence[Array]) -> tuple[Array, Array]:
    """Lower and upper ends of x and y that hold all of these, no side less than a third of the other."""
    points = np.vstack(ways)
    low, high = points.min(axis=0), points.max(axis=0)
    size = max(float((high - low).max()), 0.1)
    middle, half = 0.5 * (low + high), 0.5 * np.maximum(high - low, size / 3.0) + 0.04 * size
    return middle - half, middle + half
