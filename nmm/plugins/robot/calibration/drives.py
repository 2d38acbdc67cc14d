"""Logs as a calibration reads them: counters, the platform's own joints, looks of a reference."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from nmm.base.arrays import Array, Integers
from nmm.base.errors import InputError, few
from nmm.model.robots.numbers import steered_joints, with_numbers
from nmm.model.robots.robot import Robot
from nmm.plugins.robot.calibration.drive_log import DriveLog
from nmm.plugins.robot.calibration.innovations import BEGINS, LEFT_OUT, TAKEN
from nmm.plugins.robot.calibration.stretches import LONGEST, Stretches, stretches
from nmm.plugins.robot.encoders import Encoders, JointReadings
from nmm.plugins.robot.odometry import DETERMINED, Counters, counted_wheels

#: So many looks of a reference are enough, and so far apart, s: more of them cost time and say little.
ENOUGH, APART = 6000, 0.05
#: A clock may be so late or early, s, in steps of which it is sought at first.
LATEST, STEP = 1.0, 0.02
#: The reference is left out so near the encoders' first and last reading, s, for its clock to be moved.
MARGIN = 0.2
#: A drive goes at least so far, m, or turns so far, rad.
FAR, TURNED = 0.1, 0.2
#: Readings so many times as far apart as usual, and at least so far, s, leave a gap.
GAP, LEAST_GAP = 5.0, 0.5
#: Fewer looks tell nothing.
FEWEST = 5


@dataclass(eq=False)
class RobotDrive:
    """A log for one robot.

    t (N,), counts (N, k), own (N, n_p - 3) : times, s, counters, rad or m, and own joints as they were read
    at (M,), z (M, 3) : times, s, by the reference's clock, and places of the reference; z's heading is zero
        without one
    rows : how many numbers of z were seen, 2 or 3
    taken (M,) : of each look, LEFT_OUT, TAKEN or BEGINS
    hitches : the columns of `own` that are measured, and follow
    ends : whether the looks are of where the robot itself began and ended
    middle : the time by the reference's clock, s, from which a clock that runs otherwise is counted
    every : of how many looks of the log about one is taken
    gaps : how many times encoders said nothing for long
    twist : by how much a reference is turned whose headings are not used for that, rad
    number : of several drives with looks, which, from 1 on, as its clock's numbers are named; else ""
    delay : how late its reference's clock is at first, s
    """

    name: str
    t: Array
    counts: Array
    own: Array
    at: Array
    z: Array
    rows: int
    taken: Integers
    hitches: list[int]
    ends: bool
    middle: float = 0.0
    every: int = 1
    gaps: int = 0
    twist: float = 0.0
    number: str = ""
    delay: float = 0.0

    def within(self, first: float, last: float) -> RobotDrive:
        """The looks between two shares of all, from one that is taken on."""
        a, b = round(first * len(self.at)), round(last * len(self.at))
        while a < b - 1 and self.taken[a] == LEFT_OUT:
            a += 1
        taken = self.taken[a:b].copy()
        taken[:1] = BEGINS
        return replace(self, at=self.at[a:b], z=self.z[a:b], taken=taken)


def counters_of(robot: Robot, logs: Sequence[DriveLog]) -> Counters:
    """The counters that all logs have: wheels or, where there are none, inputs."""
    where = f"calibrate {robot.name}"
    steering = {robot.platform.inputs[i] for i in Counters(robot, {}, where).steered.values()}
    wheels, inputs = counted_wheels(robot), [*robot.platform.inputs]
    for kind in (wheels, inputs):
        names = [name for name in kind if name not in steering and all(name in log.readings for log in logs)]
        if names:
            counters = Counters(robot, dict.fromkeys(names, 0.0), where)
            M = counters.matrix(np.zeros(robot.platform.n_p - 3))[0]
            counters.solved(M, np.zeros(len(names)), dict.fromkeys(counters.steered, 0.0))
            return counters
    what = f"no counter of the platform is in {'every log' if len(logs) > 1 else logs[0].name}"
    raise InputError(what, where=where, expected=few([*wheels, *inputs]), got=few([*logs[0].readings]))


def drive_of(robot: Robot, log: DriveLog, counters: Counters) -> RobotDrive:
    """`InputError` for a log that stands still, or whose counters do not always tell how it moves."""
    counts = np.stack([log.readings[name] for name in counters.names], axis=1)
    own = own_joints(robot, log, counters)
    if np.median(np.diff(log.t)) <= LONGEST:
        counts, own = smoothed(log.t, counts), smoothed(log.t, own)
    at, z, every = log.reference_t, log.reference, 1
    if log.kind != "ends":
        some = spread_out(at)
        every, at, z = round(len(at) / len(some)), at[some], z[some]
    rows = z.shape[1]
    whole = np.zeros((len(z), 3))
    whole[:, :rows] = z
    taken = np.full(len(at), TAKEN, dtype=np.int64)
    taken[0] = BEGINS
    hitches = [
        robot.coordinate(name) - 3
        for name in robot.q_names[3 : robot.platform.n_p]
        if name in log.readings and robot.coordinate(name) not in counters.steered
    ]
    drive = RobotDrive(
        *(log.name, log.t, counts, own, at, whole, rows, taken, hitches, log.kind == "ends"),
        *(0.5 * float(at[0] + at[-1]), every),
    )
    _check_moved(counters, drive)
    return drive


def spread_out(at: Array) -> list[int]:
    """Which looks of times (M,), s, are taken: as far apart as it takes to be enough."""
    least = max(0.9 * APART, 0.99 * float(at[-1] - at[0]) / ENOUGH)
    some, last = [], -np.inf
    for i, t in enumerate(at.tolist()):
        if t - last >= least:
            some.append(i)
            last = t
    return some


def own_joints(robot: Robot, log: DriveLog, counters: Counters) -> Array:
    """The platform's own joints (N, n_p - 3) as they were read, by ratios of one and no offsets; zeros where
    they steer nothing and have no encoder."""
    n_p = robot.platform.n_p
    own = np.zeros((len(log.t), n_p - 3))
    if n_p == 3:
        return own
    plain: dict[str, float] = {}
    for joint in steered_joints(robot):
        plain |= {f"ratio.{joint}": 1.0, f"offset.{joint}": 0.0}
    encoders = Encoders(with_numbers(robot, plain))
    free = [name for name in robot.q_names[3:] if robot.coordinate(name) not in counters.steered]
    known = {*robot.q_names, *encoders.steered, *encoders.renamed}
    names = tuple(name for name in log.readings if name in known)
    if not names and not counters.steered:
        return own
    readings = JointReadings(encoders, names, (), free)
    columns = np.stack([log.readings[name] for name in names], axis=1).tolist() if names else []
    q = robot.rest.copy()
    for i, values in enumerate(columns):
        readings.write(values, q, q)
        own[i] = q[3:n_p]
    return own


def smoothed(t: Array, values: Array) -> Array:
    """Readings (N, k), each with the line through its neighbours, half and half: else what lies midway
    between two has half of their noise, and a clock's delay would seem to be whatever puts the looks
    there."""
    made = values.copy()
    share = ((t[1:-1] - t[:-2]) / (t[2:] - t[:-2]))[:, np.newaxis]
    made[1:-1] = 0.5 * (values[1:-1] + values[:-2] + share * (values[2:] - values[:-2]))
    return made


def _check_moved(counters: Counters, drive: RobotDrive) -> None:
    grid, made = on_grid(counters, drive)
    lost = np.flatnonzero(~np.isfinite(made.motions).all(axis=1) | (made.regular < DETERMINED))
    if len(lost):
        what = f"at {grid[lost[0]]:.6g} s its counters do not tell how it moves"
        raise InputError(what, where=drive.name, expected="more wheels", got=few([*counters.names]))
    went, turned = path(counters, drive, drive.t[-1:])[0]
    if not (went > FAR or turned > TURNED):
        what = f"it stands still: its wheels went {went:.3g} m, and turned it by {turned:.3g} rad"
        raise InputError(what, where=drive.name, expected=f"a drive of more than {FAR:g} m or {TURNED:g} rad")


def on_grid(counters: Counters, drive: RobotDrive) -> tuple[Array, Stretches]:
    """Times over a whole drive, evenly apart, and the stretches between them."""
    grid = np.linspace(drive.t[0], drive.t[-1], min(len(drive.t), 4 * ENOUGH))
    return grid, stretches(counters.record, drive.t, drive.counts, drive.own, grid, whole=False, sides=False)


def path(counters: Counters, drive: RobotDrive, at: Array) -> Array:
    """How far wheels went, m, and turned the platform, rad, whatever the direction, until times (M,): (M,
    2)."""
    grid, made = on_grid(counters, drive)
    steps = np.stack([np.hypot(*made.motions[:, :2].T), np.abs(made.motions[:, 2])], axis=1)
    ways = np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])
    return np.stack([np.interp(at, grid, ways[:, i]) for i in range(2)], axis=1)


def first_delay(counters: Counters, drive: RobotDrive) -> float:
    """How far the reference's clock is behind, s: where its steps are most like the wheels'; zero where
    steady motion shows none. `InputError` where it is more than `LATEST`."""
    if drive.ends or len(drive.at) < FEWEST:
        return 0.0
    lags = np.arange(-LATEST, LATEST + 0.5 * STEP, STEP)
    costs = np.zeros(len(lags))
    grid = np.linspace(drive.t[0], drive.t[-1], min(len(drive.t), 4 * ENOUGH))
    ways = path(counters, drive, grid)
    steps = np.abs(np.diff(drive.z, axis=0))
    seen = np.stack([np.hypot(steps[:, 0], steps[:, 1]), steps[:, 2]], axis=1)
    for i in range(2 if drive.rows == 3 else 1):
        if np.ptp(ways[:, i]) < 1e-9:
            continue
        for k, lag in enumerate(lags):
            times = drive.at - lag
            inside = (times[1:] <= drive.t[-1]) & (times[:-1] >= drive.t[0])
            if np.count_nonzero(inside) < FEWEST:
                costs[k] += np.inf
                continue
            went = np.diff(np.interp(times, grid, ways[:, i]))[inside]
            off = np.abs(seen[inside, i] - went)
            usual = np.median(went) + np.median(seen[inside, i]) + 1e-9  # on the spot wheels go nowhere
            costs[k] += np.minimum(off, 3.0 * np.median(off) + 1e-12).mean() / usual
    known = np.isfinite(costs)
    if not np.any(known):
        what = "the reference and the encoders have less than five looks in common"
        raise InputError(what, where=drive.name)
    best = int(np.argmin(costs))
    if np.ptp(costs[known]) <= 0.05 * costs[known].max():
        return 0.0
    if best in (0, len(lags) - 1):
        what = "the reference and the wheels move most alike with clocks a second apart or more"
        raise InputError(what, where=drive.name, expected=f"clocks less than {LATEST:g} s apart")
    return float(lags[best])


def used_looks(drive: RobotDrive, delay: float) -> RobotDrive:
    """The drive with the looks at which encoders were read, but for a margin, by clocks that differ by the
    delay, s, or not at all; begun anew after gaps. `InputError` with too few of them."""
    if drive.ends:
        return drive
    inside = np.full(len(drive.at), True)
    for late in (0.0, delay):
        times = drive.at - late
        inside &= (times >= drive.t[0] + MARGIN) & (times <= drive.t[-1] - MARGIN)
    spacing, times = np.diff(drive.t), drive.at - delay
    gaps = np.flatnonzero(spacing > max(LEAST_GAP, GAP * float(np.median(spacing))))
    taken = drive.taken.copy()
    for gap in gaps:
        inside &= (times <= drive.t[gap]) | (times >= drive.t[gap + 1])
        after = int(np.searchsorted(times, drive.t[gap + 1]))
        if after < len(taken):
            taken[after] = BEGINS
    if np.count_nonzero(inside) < FEWEST:
        what = "the reference and the encoders have less than five looks in common"
        raise InputError(what, where=drive.name, got=f"{np.count_nonzero(inside)} of {len(drive.at)}")
    taken = taken[inside]
    taken[0] = BEGINS
    return replace(drive, at=drive.at[inside], z=drive.z[inside], taken=taken, gaps=len(gaps), delay=delay)
