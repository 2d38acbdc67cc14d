"""How good a calibration is: what is left white or not, a part that it has not seen, clocks that run
apart."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy import stats

from nmm.base.arrays import Array
from nmm.plugins.robot.calibration.drives import path
from nmm.plugins.robot.calibration.filtered import Filtered
from nmm.plugins.robot.calibration.fit import Fit, fit
from nmm.plugins.robot.calibration.innovations import BEGINS, TAKEN
from nmm.plugins.robot.calibration.model import Model
from nmm.plugins.robot.calibration.planar import along_body, composed, placed

#: Which part of a drive is learned from, for the other to be predicted.
LEARNED_FROM = 0.7
#: By the side of chance: a test that fails so seldom with what is right.
CHANCE = 0.01
#: Windows of dead reckoning in the part that is predicted: at most so long, m, and at least so many.
LONGEST, WINDOWS = 5.0, 8
#: With fewer windows nothing is said.
SIDE = 4
#: A turn of a rad counts as so many m in the length of a window.
TURN = 0.5


#: Numbers are better that leave less of the middle window's error, and less of its length.
MOST_LEFT, NEAR = 0.9, 0.2


class HeldOut(NamedTuple):
    """Dead reckoning over windows of a part that was not learned from.

    windows : how many, and their length, m
    before, after : root of the mean square error at their ends, m, by the file's numbers and by those learned
    heading_before, heading_after : rad; NaN without headings
    share : the middle window's error after, of the window's length; left : of the error before, both with
        headings, a rad for half a metre
    p : the chance that such a difference comes of noise alone (Wilcoxon's signed ranks, of the squares of
        places and headings, a rad for half a metre); closer : whether these ranks are for the numbers learned

    Examples
    --------
    >>> nmm.extending.HeldOut(15, 2.2, 0.128, 0.009, 0.39, 0.013, 0.005, 0.07, p=6e-5, closer=True).verdict
    'better'
    """

    windows: int
    length: float
    before: float
    after: float
    heading_before: float
    heading_after: float
    share: float
    left: float
    p: float
    closer: bool

    @property
    def verdict(self) -> str:
        """ "better", "worse", "no difference", or "far off" where it is nearer and yet not near."""
        if not self.p < 0.05 or (self.closer and self.left > MOST_LEFT):
            return "no difference"
        if not self.closer:
            return "worse"
        return "better" if self.share < NEAR else "far off"


def whiteness(filtered: Sequence[Filtered]) -> float:
    """The chance that innovations as these come of white noise, 0 to 1: Ljung and Box's test of the
    innovations and of their means over 4, 16, ... looks, since what is wrong with a robot's numbers is
    slow; the least, times the number of tests."""
    least, tests = 1.0, 0
    for drive_fit in filtered:
        for column in drive_fit.w.T:
            values = column[drive_fit.taken]
            while len(values) >= 40:
                least = min(least, ljung_box(values))
                tests += 1
                whole = len(values) // 4 * 4
                values = values[:whole].reshape(-1, 4).mean(axis=1)
    return min(1.0, least * max(tests, 1)) if tests else math.nan


def ljung_box(values: Array) -> float:
    """The chance of such correlations at lags up to ten. (G. M. Ljung, G. E. P. Box, Biometrika 65, 1978.)"""
    n, lags = len(values), min(10, len(values) // 5)
    power = float(values @ values)  # of a mean of zero: another one is not white, either
    if power == 0.0:
        return 1.0
    shares = [float(values[k:] @ values[:-k]) / power for k in range(1, lags + 1)]
    Q = n * (n + 2.0) * sum(share**2 / (n - k) for k, share in enumerate(shares, 1))
    return float(stats.chi2.sf(Q, lags))


def held_out(model: Model, fitted: Fit) -> HeldOut | None:
    """What the numbers of the first part of each drive predict of the rest, beside the file's numbers, each
    with the mounting and the delay that go with them; None where the drives are too short for it."""
    robots = [i for i, number in enumerate(model.learned) if number.of_robot]
    held = {i: float(fitted.values[i]) for i in range(len(model.first)) if i not in fitted.free}
    robots = [i for i in robots if i in fitted.free]
    halves = [[drive for i, drive in enumerate(model.drives) if i % 4 // 2 == half] for half in range(2)]
    parts = [(model.parts(0.0, LEARNED_FROM), model.parts(LEARNED_FROM, 1.0))]
    if all(drive.ends for drive in model.drives):
        if len(model.drives) < WINDOWS:
            return None
        parts = [(model.of(half), model.of(other)) for half, other in (halves, halves[::-1])]
    ends: tuple[list[Array], list[Array]] = [], []
    lengths = []
    for part, rest in parts:
        learned = fit(part, held, like=fitted)
        by_file = fit(part, held | {i: float(model.first[i]) for i in robots}, like=fitted)
        windows, length = windows_of(rest, learned)
        lengths.append(length)
        for errors, which in zip(ends, (by_file, learned), strict=True):
            errors.append(window_ends(rest, which, windows))
    before, after = (np.concatenate(errors) for errors in ends)
    if len(before) < WINDOWS:
        return None
    far = [off_by(errors) for errors in (before, after)]
    score, middle = [one**2 for one in far], [float(np.median(one)) for one in far]
    same = bool(np.all(score[0] == score[1]))
    p = 1.0 if same else float(stats.wilcoxon(score[0], score[1]).pvalue)
    gained = score[0] - score[1]
    closer = float(np.sum(np.sign(gained) * stats.rankdata(np.abs(gained)))) > 0.0
    first, last = (math.sqrt(_squares(errors, 2).mean()) for errors in (before, after))
    turned, turns = (math.sqrt(_squares(errors, 3, 2).mean()) for errors in (before, after))
    if before.shape[1] == 2:
        turned = turns = math.nan
    length = float(np.mean(lengths))
    left = middle[1] / max(middle[0], 1e-12)
    return HeldOut(len(before), length, first, last, turned, turns, middle[1] / length, left, p, closer)


def off_by(errors: Array) -> Array:
    """How far off errors (W, 2) or (W, 3) are (W,), m, a turn counted as a length."""
    return np.sqrt(_squares(errors, 2) + TURN**2 * _squares(errors, 3, 2))


def _squares(errors: Array, last: int, first: int = 0) -> Array:
    """Sums of squares of some columns of errors (W, 2) or (W, 3)."""
    return np.sum(errors[:, first:last] ** 2, axis=1)


#: Of each drive, the looks at which a window begins and ends.
Windows = list[list[tuple[int, int]]]


def windows_of(model: Model, fitted: Fit) -> tuple[Windows, float]:
    """Windows of dead reckoning, one after another, without looks that were left out, and their length, m."""
    if all(drive.ends for drive in model.drives):
        ways = [path(model.counters, drive, drive.t[-1:])[0, 0] for drive in model.drives]
        return [[(0, 1)] for _ in model.drives], float(np.mean(ways))
    ways = []
    for made, _ in model.stretched(fitted.values, []):
        steps = np.hypot(made.motions[:, 0], made.motions[:, 1]) + TURN * np.abs(made.motions[:, 2])
        ways.append(np.concatenate([[0.0], np.cumsum(steps)]))
    length = min(LONGEST, sum(float(way[-1]) for way in ways) / (2.0 * WINDOWS))
    if not length > 0.0:  # it stands still
        return [[] for _ in model.drives], length
    windows: Windows = []
    for drive, way in zip(model.drives, ways, strict=True):
        windows.append([])
        begin = 1
        while not drive.ends and begin < len(way):
            end = int(np.searchsorted(way, way[begin] + length))
            if end >= len(way):
                break
            some = drive.taken[begin : end + 1]
            if some[0] == some[-1] == TAKEN and BEGINS not in some:
                windows[-1].append((begin, end))
                begin = end
            else:
                begin += 1
    return windows, length


def window_ends(model: Model, fitted: Fit, windows: Windows) -> Array:
    """Errors (W, 3) or (W, 2) of the reference's place, along the body, at the ends of windows that begin
    where the filter believes the robot to be."""
    stretched = model.stretched(fitted.values, [])
    filtered = model.filtered(fitted.values, [], stretched, fitted.noise)
    rows, errors = min(drive.rows for drive in model.drives), []
    for drive, drive_fit, (made, _), some in zip(model.drives, filtered, stretched, windows, strict=True):
        mount = np.zeros(3) if drive.ends else model.mount(fitted.values)
        for begin, end in some:
            errors.append(_error(drive_fit.poses[begin], made.motions[begin:end], drive.z[end], mount)[:rows])
    return np.array(errors).reshape(-1, rows)


def _error(pose: Array, motions: Array, z: Array, mount: Array) -> Array:
    """How far the reference is from where wheels alone would have it, along the body's axes (3,)."""
    end = placed(pose[np.newaxis], composed(motions)[-1])
    off = along_body(end[:, 2], z - placed(end, mount))[0]
    return np.array([*off[:2], math.remainder(off[2], 2.0 * math.pi)])
