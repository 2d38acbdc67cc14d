"""Whether a reference's clock runs faster than the encoders' by more than clocks do."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import numpy as np

from nmm.base.arrays import Array
from nmm.base.errors import InputError
from nmm.plugins.robot.calibration.drives import FEWEST, RobotDrive, on_grid, path
from nmm.plugins.robot.calibration.held import CLOCKS
from nmm.plugins.robot.calibration.parameters import CLOCK
from nmm.plugins.robot.odometry import Counters

#: By such shares clocks are tried; more than the second is asked about where nothing else is wrong, of drives
#: of so long at least, s.
TRIED, TOLD, LONG = 0.25, 0.05, 20.0
#: Motions are compared at so many times at most, at least so far apart, s, each over so many of these steps;
#: so much of the shorter one is common.
TIMES, LEAST_STEP, OVER, COMMON = 2048, 0.1, 5, 0.6
#: What goes so well together is of one drive, where such a share is left of what clocks leave that run alike.
ALIKE, LEFT = 0.8, 0.5
#: The same where nothing else is wrong, and how well what is of one drive goes together as it is stamped.
ALL_ALIKE, LEFT_OF_ALL, STAMPED = 0.95, 0.3, 0.95
#: What is left by a clock is as little as what is left as stamped.
AS_LITTLE = 1.5
#: Wheels that go, or turn the robot, by amounts that differ by less, m or rad, show no clock.
STILL = 1e-3


@contextmanager
def told_by_clocks(counters: Counters, drives: Sequence[RobotDrive]) -> Iterator[None]:
    """What is refused within is refused for its clocks, where these run apart by more than may be learned:
    they explain the rest."""
    try:
        yield
    except InputError:
        for drive in drives:
            _check_clocks(counters, drive, CLOCKS[CLOCK][0], ALIKE, LEFT, 1.0)
        raise


def check_clocks(counters: Counters, drive: RobotDrive) -> None:
    """`InputError` where wheels and reference speed up and slow down together by clocks that run apart by
    more than a share, and by clocks that run alike do not.

    Wheels that are larger than in the file go farther, but not sooner, and the places that a reference sees
    are the same by any clock: speeds are compared but for their scale. Steady motion shows no clock; nor do
    short drives, or places of a point that may be anywhere on the robot and goes otherwise than its axle."""
    if drive.rows == 3 and drive.at[-1] - drive.at[0] > LONG:
        _check_clocks(counters, drive, TOLD, ALL_ALIKE, LEFT_OF_ALL, STAMPED)


def _check_clocks(
    counters: Counters, drive: RobotDrive, most: float, least: float, left: float, stamped: float
) -> None:
    if drive.ends or len(drive.at) < FEWEST:
        return
    shares, alike = likeness(counters, drive)
    best = int(np.argmax(alike))
    share, found, as_stamped = float(shares[best]), float(alike[best]), stamped_alike(shares, alike)
    told = most < abs(share) < TRIED and found > least and as_stamped < stamped
    if not told or 1.0 - found > left * (1.0 - as_stamped):
        return
    way = "fast" if share > 0.0 else "slow"
    what = (
        f"the reference's clock runs about {100.0 * abs(share):.2g} % {way} beside the encoders': so wheels "
        f"and reference speed up and slow down together ({found:.3f} of 1), as stamped less "
        f"({as_stamped:.3f})"
    )
    raise InputError(what, where=drive.name, expected="stamps of one clock, or of two that run alike to 1 %")


def shows_no_clock(counters: Counters, drive: RobotDrive, share: float) -> bool:
    """Whether wheels and reference go together by a clock that runs faster by a share about as well as they
    do as stamped: of steady motion."""
    shares, alike = likeness(counters, drive)
    by_clock = float(np.interp(share, shares, alike))
    return 1.0 - by_clock < AS_LITTLE * (1.0 - stamped_alike(shares, alike))


def stamped_alike(shares: Array, alike: Array) -> float:
    """How well speeds go together by clocks that run apart by no more than may be learned (`likeness`)."""
    return float(alike[np.abs(shares) <= CLOCKS[CLOCK][0]].max())


def likeness(counters: Counters, drive: RobotDrive) -> tuple[Array, Array]:
    """Shares (S,) by which the reference's clock may run fast, and how well the speeds of wheels and
    reference go together (S,), at the best delay of each: Pearson's r of what they have in common, by the
    share of the wheels' changes of speed that is in it, of those while the reference looked."""
    begin, end = max(drive.t[0], drive.at[0]), min(drive.t[-1], drive.at[-1])
    seconds = max(float(end - begin), 0.0)
    step = max(LEAST_STEP, seconds / TIMES)
    times = begin + step * np.arange(int(seconds / step) + 1)
    grid, made = on_grid(counters, drive)
    by_wheels = np.interp(times, grid, np.concatenate([[0.0], np.cumsum(made.motions[:, 2])]))
    wheels = [_over(path(counters, drive, times)[:, 0])]
    looks = [drive.z[:, 0], drive.z[:, 1]]
    if drive.rows == 3:
        wheels.append(_over(by_wheels))
        looks.append(np.unwrap(drive.z[:, 2]))
    count = min(len(times), 2 * TIMES) // 4
    shares = TRIED * np.arange(-count, count + 1) / max(count, 1)
    alike = np.zeros(len(shares))
    if len(times) <= 2 * OVER:
        return shares, alike
    for k, share in enumerate(shares.tolist()):
        at = np.arange(drive.at[0], drive.at[-1], step * (1.0 + share))
        if len(at) <= 2 * OVER:
            continue
        x, y, *heading = (_over(np.interp(at, drive.at, column)) for column in looks)
        seen = [np.hypot(x, y), *heading]
        together = [_together(*pair) for pair in zip(wheels, seen, strict=True) if np.ptp(pair[0]) > STILL]
        if together:
            alike[k] = float(np.max(np.mean(together, axis=0)))
    return shares, alike


def _over(values: Array) -> Array:
    """Differences over several steps: over one there is more noise than motion."""
    return np.asarray(values[OVER:] - values[:-OVER])


def _together(one: Array, other: Array) -> Array:
    """How well two signals go together (`likeness`), shifted by each number of samples that leaves enough in
    common."""
    n, m = len(one), len(other)
    least = max(FEWEST, round(COMMON * min(n, m)))
    shifts = np.arange(least - m, n - least + 1)
    first, last = np.maximum(shifts, 0), np.minimum(n, m + shifts)
    one, other = one - one.mean(), other - other.mean()
    size = 1 << (n + m - 1).bit_length()
    products = np.fft.irfft(np.fft.rfft(one, size) * np.conj(np.fft.rfft(other, size)), size)[shifts]

    def summed(values: Array, begin: Array, end: Array) -> Array:
        total = np.concatenate([[0.0], np.cumsum(values)])
        return total[end] - total[begin]

    some = last - first
    a, b = summed(one, first, last), summed(other, first - shifts, last - shifts)
    squares = summed(one**2, first, last), summed(other**2, first - shifts, last - shifts)
    own = np.maximum(squares[0] - a * a / some, 0.0)
    over = np.sqrt(np.maximum(own * (squares[1] - b * b / some), 1e-300))
    # Signs are asked about elsewhere. A faster clock would leave out what does not fit at an end.
    return np.minimum(np.abs(products - a * b / some) / over, 1.0) * np.sqrt(
        own / max(float(np.sum(one**2)), 1e-300)
    )
