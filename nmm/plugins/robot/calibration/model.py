"""A robot's numbers beside its drives: innovations of the reference, with their slopes in the numbers."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from nmm.base.arrays import Array
from nmm.base.kernels.compiled import checked_by_caller
from nmm.model.robots.numbers import robot_numbers, with_numbers
from nmm.model.robots.robot import Robot
from nmm.plugins.robot.calibration.drives import RobotDrive, path
from nmm.plugins.robot.calibration.filtered import DriveNoise, Filtered
from nmm.plugins.robot.calibration.hitches import Slipping, ToldMotions, slipping, told_by_hitches
from nmm.plugins.robot.calibration.innovations import BEGINS, INNOVATIONS, TAKEN, innovations
from nmm.plugins.robot.calibration.learnable import learnable
from nmm.plugins.robot.calibration.parameters import CLOCK, DELAY, MOUNT
from nmm.plugins.robot.calibration.planar import alignment, along_body
from nmm.plugins.robot.calibration.sides import NOTHING, Slopes, agreement
from nmm.plugins.robot.calibration.stretches import SIDES, Stretches, steps_between, stretches
from nmm.plugins.robot.counted_motion import Counted
from nmm.plugins.robot.odometry import Counters

#: For differences, as a part of what is plausible.
_STEP = 1e-3
#: Drives that end so near to where they began, as a share of their way, tell no scale.
CLOSED = 0.05
#: A drive's first heading is that of so many m of positions, or of thirty times their noise.
SEEN = 2.0

Made = tuple[Stretches, Slopes]


class Model:
    """What may be learned of a robot by some drives.

    learned : the numbers, in order; `first` (n,) : their values at first
    """

    def __init__(self, robot: Robot, counters: Counters, drives: Sequence[RobotDrive]) -> None:
        self.robot, self.counters, self.drives = robot, counters, [*drives]
        self.learned = learnable(robot, counters, self.drives)
        self.first = np.array([number.value for number in self.learned])
        self._beside, self._slips = self.first, dict[RobotDrive, Slipping]()
        self.scales = np.array([number.plausible for number in self.learned])
        self._own_names = {*robot_numbers(robot)}
        self._records: dict[tuple[float, ...], Counted] = {}
        self._last: tuple[bytes, list[int], list[Made]] | None = None
        self._filter = checked_by_caller(innovations, INNOVATIONS)

    @property
    def closed(self) -> bool:
        """Whether all that is known is that drives end about where they began, beside how far they went: all
        lengths may be larger then."""
        return all(drive.ends and self._apart(drive) < CLOSED for drive in self.drives)

    def _apart(self, drive: RobotDrive) -> float:
        """How far a drive's last look is from the first, as a share of its way."""
        way = float(path(self.counters, drive, drive.t[-1:])[0, 0])
        return float(np.hypot(*(drive.z[-1, :2] - drive.z[0, :2]))) / max(way, 1e-9)

    @property
    def free_inputs(self) -> int:
        """How many inputs counters say; those of steering are measured."""
        return self.robot.platform.p - len(self.counters.steered)

    def index(self, name: str) -> int:
        """The place of a number among all; -1 without it."""
        return next((i for i, number in enumerate(self.learned) if number.name == name), -1)

    def mount(self, values: Array) -> Array:
        """Where the reference is on the robot (3,), m and rad."""
        where = [self.index(name) for name in MOUNT]
        return np.array([values[i] if i >= 0 else 0.0 for i in where])

    def parts(self, first: float, last: float) -> Model:
        """The model of the looks between two shares of each drive; of drives of which only the ends are known
        of all."""
        some = self.drives if all(drive.ends for drive in self.drives) else self.with_looks
        return self.of([drive if drive.ends else drive.within(first, last) for drive in some])

    def of(self, drives: Sequence[RobotDrive]) -> Model:
        """The model of other drives."""
        made = copy.copy(self)
        made.drives, made._last, made._slips = [*drives], None, {}
        return made

    def take(self, drives: Sequence[RobotDrive]) -> None:
        """Go on with other drives."""
        self.drives, self._last, self._slips = [*drives], None, {}

    @property
    def begun(self) -> int:
        """How often the filter begins, at first, after gaps and where the reference jumped."""
        return sum(int(np.count_nonzero(drive.taken == BEGINS)) for drive in self.drives)

    @property
    def with_looks(self) -> list[RobotDrive]:
        """The drives with more than ends."""
        return [drive for drive in self.drives if not drive.ends]

    def numbers(self, values: Array) -> dict[str, float]:
        """Those of the robot, by name."""
        return {
            number.name: value
            for number, value in zip(self.learned, values.tolist(), strict=True)
            if number.name in self._own_names
        }

    def _record(self, values: Array) -> Counted:
        """What the step of odometry reads, for these numbers; steering is read by those that `_moved`
        takes."""
        numbers = {
            name: value
            for name, value in self.numbers(values).items()
            if not name.startswith(("offset.", "ratio."))
        }
        key = tuple(numbers.values())
        if key not in self._records:
            if len(self._records) > 50:
                self._records.clear()
            robot = with_numbers(self.robot, numbers)
            names = dict.fromkeys(self.counters.names, 0.0)
            self._records[key] = Counters(robot, names, self.counters.where).record
        return self._records[key]

    def _moved(self, values: Array, drive: RobotDrive, whole: bool = True, sides: bool = True) -> Stretches:
        """The stretches of a drive by these numbers, with slopes and noise where whole, and with its sides.

        Sides are of the counters alone, and are told between times by the clock of `put_beside`: between two
        readings a counter has less noise than at one, and the delay would seem to be whatever puts the looks
        there."""
        counts, own, at = drive.counts, drive.own, drive.at
        beside = at
        for i, (number, value) in enumerate(zip(self.learned, values.tolist(), strict=True)):
            kind, _, name = number.name.partition(".")
            if kind == "scale":
                counts = _scaled(counts, self.counters.names.index(name), value, 0.0)
            elif kind == "ratio":
                offset = float(values[self.index(f"offset.{name}")])
                own = _scaled(own, self.robot.coordinate(name) - 3, value, offset)
            elif kind == DELAY and name == drive.number and not drive.ends:
                at, beside = at - value, beside - float(self._beside[i])
            elif kind == CLOCK and name == drive.number and not drive.ends:
                since = drive.at - drive.middle
                at, beside = at - value * since, beside - float(self._beside[i]) * since
        given = self._record(values), drive.t, counts, own
        steps = steps_between(drive.at)
        some = counts.shape[1] > self.free_inputs or drive.hitches
        if not sides or not some or np.array_equal(at, beside):
            return stretches(*given, at, steps, whole, sides)
        made = stretches(*given, at, steps, whole, sides=False)
        others = stretches(*given, beside, steps, whole)
        return made._replace(**{name: getattr(others, name) for name in SIDES})

    def stretched(self, values: Array, free: Sequence[int]) -> list[Made]:
        """Of each drive its stretches, and their slopes in the free numbers; kept until the next numbers.
        With hitches they are without noise, which is in `_slipping`."""
        key = values.tobytes()
        if self._last is None or self._last[0] != key:
            self._last = None  # or memory would hold both
            moved = [(drive, self._moved(values, drive, not drive.hitches)) for drive in self.drives]
            self._last = key, [], [(made, self._slopes(values, [], drive, made)) for drive, made in moved]
        _, known, pairs = self._last
        if not {*free} <= {*known}:
            pairs = [
                (made, self._slopes(values, free, drive, made))
                for drive, (made, _) in zip(self.drives, pairs, strict=True)
            ]
            self._last, known = (key, [*free], pairs), [*free]
        if known == [*free]:
            return pairs
        some = [known.index(i) for i in free]
        return [(made, Slopes(*(part[:, :, some] for part in slopes))) for made, slopes in pairs]

    def _slopes(self, values: Array, free: Sequence[int], drive: RobotDrive, made: Stretches) -> Slopes:
        many, k = made.spare.shape
        slopes = Slopes(
            np.zeros((many, 3, len(free))),
            np.zeros((many, k, len(free))),
            np.zeros((many, drive.own.shape[1], len(free))),
        )
        for column, i in enumerate(free):
            number = self.learned[i]
            if number.kind in ("radius", "scale") and not drive.hitches:
                place = self.counters.names.index(number.name.partition(".")[2])
                slopes.ends[:, :, column] = made.slopes[:, :, place] / values[i]
                slopes.spare[:, :, column] = made.spare_slopes[:, :, place] / values[i]
            elif number.kind in (DELAY, CLOCK) and number.name.partition(".")[2] != drive.number:
                continue
            elif number.name not in MOUNT:
                sides = number.kind not in (DELAY, CLOCK)
                step, ahead = _STEP * number.plausible, values.copy()
                ahead[i] += step
                other = self._moved(ahead, drive, whole=False, sides=sides)
                ends = along_body(made.motions[:, 2], other.motions - made.motions)
                slopes.ends[:, :, column] = ends / step
                if sides:
                    slopes.spare[:, :, column] = (other.spare - made.spare) / step
                    slopes.astray[:, :, column] = (other.astray - made.astray) / step
        return slopes

    def put_beside(self, values: Array) -> None:
        """Have sides from now on by the clocks of these numbers: hitches tell of motions at the same times.
        They tell what they would with these numbers."""
        if any(drive.hitches for drive in self.drives):
            self._beside, self._slips, self._last = values.copy(), {}, None

    def _slipping(self, drive: RobotDrive) -> Slipping:
        """What wheels that slip do, by the numbers of `put_beside`; kept until the next."""
        if drive not in self._slips:
            made = self._moved(self._beside, drive)
            turned = np.zeros((len(made.motions), len(drive.hitches), drive.counts.shape[1]))
            for place in range(turned.shape[2]):
                more = replace(drive, counts=_scaled(drive.counts, place, 1.0 + _STEP, 0.0))
                astray = self._moved(self._beside, more, whole=False).astray
                turned[:, :, place] = (made.astray - astray)[:, drive.hitches] / _STEP
            self._slips[drive] = slipping(made, turned)
        return self._slips[drive]

    def _told(self, drive: RobotDrive, made: Stretches, slopes: Slopes, noise: DriveNoise) -> ToldMotions:
        variances, hitches = np.array([noise.counters, noise.across, noise.turns]) ** 2, drive.hitches
        if not hitches:
            return ToldMotions(made.motions, slopes.ends, made.noise, variances, NOTHING)
        astray, by = (np.ascontiguousarray(part[:, hitches]) for part in (made.astray, slopes.astray))
        slips, own = self._slipping(drive), noise.following**2
        return told_by_hitches(made.motions, slopes.ends, astray, by, slips, variances, own)

    def forget(self) -> None:
        """Let go of the stretches that are kept."""
        self._last = None

    def filtered(
        self, values: Array, free: Sequence[int], made: Sequence[Made], noise: DriveNoise
    ) -> list[Filtered]:
        """The innovations of each drive."""
        return [
            self._filtered(values, free, drive, motions, slopes, noise)
            for drive, (motions, slopes) in zip(self.drives, made, strict=True)
        ]

    def _filtered(
        self,
        values: Array,
        free: Sequence[int],
        drive: RobotDrive,
        made: Stretches,
        slopes: Slopes,
        noise: DriveNoise,
    ) -> Filtered:
        where, mount = [self.index(name) for name in MOUNT], self.mount(values)
        if drive.ends:  # these are of the robot itself
            where, mount = [-1, -1, -1], np.zeros(3)
        elif drive.rows == 2:  # the heading where it begins is the body's
            where[2], mount[2] = -1, 0.0
        columns = np.array([free.index(i) if i >= 0 and i in free else -1 for i in where], dtype=np.int64)
        moved = self._told(drive, made, slopes, noise)
        ends = moved.ends if moved.ends.shape[2] else np.zeros((len(moved.ends), 3, 1))
        many, r = len(drive.at), drive.rows
        z = drive.z if r == 3 else _with_headings(drive, made, mount, max(SEEN, 30.0 * noise.place))
        R = np.array([noise.place**2, noise.place**2, noise.heading**2 if r == 3 else 1.0])
        R = R + (noise.jitter * _speeds(drive, made)) ** 2
        result = Filtered(
            np.zeros((many, r)),
            np.zeros((many, r, ends.shape[2])),
            np.zeros((many, r)),
            np.zeros((many, 3)),
            drive.taken == TAKEN,
            agreement(drive, made, slopes, noise.agreement, self.free_inputs),
            moved.beside,
        )
        stretched = moved.motions, np.ascontiguousarray(ends), moved.noise, moved.variances
        looks = np.ascontiguousarray(z), drive.taken, R, mount, columns
        self._filter(*stretched, *looks, result.w, result.S, result.W, result.poses)
        return result


def _speeds(drive: RobotDrive, made: Stretches) -> Array:
    """How fast a robot goes and turns at looks (M, 3), along the body's axes, m/s and rad/s."""
    if drive.ends:
        return np.zeros((len(drive.at), 3))
    speeds = made.motions / np.diff(drive.at)[:, np.newaxis]
    return np.concatenate([speeds[:1], 0.5 * (speeds[1:] + speeds[:-1]), speeds[-1:]])


def _with_headings(drive: RobotDrive, made: Stretches, mount: Array, far: float) -> Array:
    """z with a heading where a drive begins: that which lays the next `far` m by wheels along the places."""
    z = drive.z.copy()
    begins = np.flatnonzero(drive.taken == BEGINS)
    for first, last in zip(begins, [*begins[1:], len(z)], strict=True):
        z[first, 2] = alignment(drive.z[first:last, :2], made.motions[first : last - 1], mount, far)
    return z


def _scaled(table: Array, column: int, by: float, more: float) -> Array:
    made = table.copy()
    made[:, column] = by * made[:, column] + more
    return made
