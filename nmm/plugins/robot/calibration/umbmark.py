"""UMBmark: unequal wheels and a wrong track of a differential drive, by where square drives end."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import Array, array, positive, unwritable
from nmm.base.errors import InputError, expect, expect_known, few, one_or_several
from nmm.model.robots.robot import Robot
from nmm.plugins.robot.calibration.drive_log import DriveLog
from nmm.plugins.robot.calibration.log_checks import reading_at
from nmm.plugins.robot.odometry import Counters, counted_wheels

By = Literal["x", "y", "both"]
#: A square drive's headings are so near to its four directions, rad, on so much of its way; each of its sides
#: is so much of the longest; and it turns by a whole turn, or by three quarters, within so much, rad.
STRAIGHT, MOSTLY, EQUAL, TURNED = 0.5, 0.9, 0.8, 0.6
#: The sides of drives that are taken together differ by no more than this part.
ALIKE = 0.05


@dataclass(frozen=True, eq=False)
class UMBmark:
    """What the ends of square drives, clockwise and counter-clockwise, say of a differential drive.

    Each error is where the robot truly ended less where its odometry had it end, in the axes of its start, x
    along the first side. The formulas are of first order in α and β, the angles by which a corner and a
    side are off: of wheels that differ by 0.2 % and a track that is off by 1 % (sides of 8 b) they are wrong
    by 5 % of these by x, 7 % by y, and 1.5 % by both, whose errors are of opposite sign; of 1 % and 2 % by
    40, 55 and 8 %. The paper's angles are in degrees, these in rad.

    Parameters
    ----------
    side : L, m
    clockwise, counterclockwise (n, 2) : errors of x and y, m, a drive a row
    track : b, by which the odometry was made, m
    by : from which errors α and β are: "x", "y", or the mean of "both"

    Raises
    ------
    InputError : no drive of either direction, numbers that are not finite, errors as large as the square

    References
    ----------
    J. Borenstein, L. Feng, Measurement and correction of systematic odometry errors in mobile robots, IEEE
    Transactions on Robotics and Automation 12(6), 1996.

    Examples
    --------
    >>> mark = nmm.UMBmark(4.0, clockwise=[[-0.21, -0.20], [-0.19, -0.20]], counterclockwise=[[0.04, 0.0]],
    ...                    track=0.5)
    >>> round(mark.E_d, 5), round(mark.E_b, 5), round(mark.largest_error, 3)
    (1.00188, 1.00641, 0.283)
    """

    side: float
    clockwise: Array
    counterclockwise: Array
    track: float
    by: By = "x"

    def __post_init__(self) -> None:
        expect_known("axis", self.by, get_args(By), "UMBmark: by")
        for name in ("side", "track"):
            object.__setattr__(self, name, positive(getattr(self, name), f"UMBmark: {name}"))
        for name in ("clockwise", "counterclockwise"):
            where = f"UMBmark: {name}"
            rows = array(getattr(self, name), where)
            if rows.ndim != 2 or rows.shape[1:] != (2,) or not len(rows):
                raise InputError(
                    where=where, expected="errors of x and y, (n, 2), of a drive at least", got=rows
                )
            far = float(np.hypot(*rows.T).max())
            expect(far < self.side, where, f"errors of less than the side, {self.side:g} m", far)
            object.__setattr__(self, name, unwritable(rows))

    @classmethod
    def from_logs(cls, robot: Robot, logs: DriveLog | Sequence[DriveLog], by: By = "x") -> UMBmark:
        """Of logs of square drives, whose sides and directions are found by dead reckoning.

        Parameters
        ----------
        robot : a differential drive, with the radii and the track that are to be corrected
        logs : of kind "ends", as of `DriveLog.closed`, or "poses", of the platform's reference point; with
            corners turned on the spot

        Raises
        ------
        InputError : by the log's name: a drive that is no square, that says no heading at its start and does
            not end there; sides that differ by more than 5 %; one direction alone; another platform
        """
        several = one_or_several(logs, DriveLog, "UMBmark: logs", "logs of drives")
        track = track_of(robot)
        found = [_square(robot, log) for log in several]
        sides = [side for side, _, _ in found]
        if found and max(sides) > (1.0 + ALIKE) * min(sides):
            names = [several[sides.index(some)].name for some in (min(sides), max(sides))]
            what = f"sides differ: {min(sides):.4g} m in {names[0]}, {max(sides):.4g} m in {names[1]}"
            raise InputError(what, where="UMBmark: logs", expected="drives of the same square")
        ways = [[error for _, left, error in found if left == asked] for asked in (False, True)]
        for name, way in zip(("clockwise", "counterclockwise"), ways, strict=True):
            if not way:
                got = few([log.name for log in several])
                raise InputError(where="UMBmark: logs", expected=f"a {name} drive at least", got=got)
        return cls(float(np.mean(sides)), np.array(ways[0]), np.array(ways[1]), track, by)

    @property
    def center_clockwise(self) -> Array:
        """The centre of gravity of the clockwise drives' ends (2,), m."""
        return np.asarray(self.clockwise.mean(axis=0))

    @property
    def center_counterclockwise(self) -> Array:
        """That of the counter-clockwise drives' ends (2,), m."""
        return np.asarray(self.counterclockwise.mean(axis=0))

    @property
    def largest_error(self) -> float:
        """E_max,syst: how far the farther of the two centres is from the start, m."""
        centers = self.center_clockwise, self.center_counterclockwise
        return max(float(np.hypot(x, y)) for x, y in centers)

    @property
    def alpha(self) -> float:
        """α, of the wrong track (type A): by how much each corner turns too little, rad."""
        return self._mean(self.center_clockwise + [1.0, -1.0] * self.center_counterclockwise)

    @property
    def beta(self) -> float:
        """β, of unequal wheels (type B): by how much the robot turns to the left on each side, rad."""
        return self._mean(self.center_clockwise + [-1.0, 1.0] * self.center_counterclockwise)

    def _mean(self, both: Array) -> float:
        angles = both / (-4.0 * self.side)
        return float(angles.mean() if self.by == "both" else angles["xy".index(self.by)])

    @property
    def radius(self) -> float:
        """R, of the arc that is driven in the place of a side, m, positive to the left; infinite for none."""
        bend = math.sin(0.5 * self.beta)
        return 0.5 * self.side / bend if bend else math.inf

    @property
    def E_d(self) -> float:
        """D_R / D_L, the quotient of the wheels' diameters, right and left: (R + b/2) / (R - b/2)."""
        return (1.0 + self._bend) / (1.0 - self._bend)

    @property
    def _bend(self) -> float:
        """b / (2 R), which is 0 where R is infinite."""
        return self.track * math.sin(0.5 * self.beta) / self.side

    @property
    def E_b(self) -> float:
        """The true track over that of the odometry: 90° / (90° - α)."""
        return 0.5 * math.pi / (0.5 * math.pi - self.alpha)

    @property
    def true_track(self) -> float:
        """b_actual, m."""
        return self.E_b * self.track

    @property
    def c_left(self) -> float:
        """c_l, by which the left wheel's radius is multiplied; the mean of both stays."""
        return 2.0 / (self.E_d + 1.0)

    @property
    def c_right(self) -> float:
        """c_r, by which the right wheel's radius is multiplied."""
        return 2.0 / (1.0 / self.E_d + 1.0)


def track_of(robot: Robot) -> float:
    """The track of a differential drive, m: how far left and right wheels roll apart for each rad of a turn
    on the spot; `InputError` for other platforms."""
    where, wheels = f"UMBmark: {robot.name}", counted_wheels(robot)
    radii = {wheel.joint: wheel.radius for wheel in robot.wheels}
    counters = Counters(robot, dict.fromkeys(wheels, 0.0), where)
    differential = robot.platform.p == 2 and robot.platform.n_p >= 3 and not counters.steered and wheels
    if differential:
        C, B = counters.matrix(np.zeros(robot.platform.n_p - 3))
        spin = np.linalg.lstsq(B, np.array([0.0, 0.0, 1.0]), rcond=None)[0]
        if np.allclose(B @ spin, [0.0, 0.0, 1.0]):
            ways = C @ spin * [radii[name] for name in wheels]
            return 2.0 * float(np.abs(ways).mean())
    raise InputError(
        where=where, expected="a differential drive, which turns on the spot", got=robot.platform.name
    )


def dead_reckoned(robot: Robot, log: DriveLog) -> Array:
    """x, y, theta (N, 3), m and rad, of the platform by its counters, from zero on."""
    odometry = robot.odometry(robot.rest, reading_at(robot, log.readings, 0), wrapped=False)
    start = odometry.q[:3].copy()
    rows = [odometry.update(reading_at(robot, log.readings, k))[:3] for k in range(1, len(log))]
    return from_pose(start, np.array([start, *rows]))


def from_pose(pose: ArrayLike, poses: Array) -> Array:
    """Poses (N, 3) as they are seen from another (3,)."""
    x, y, theta = np.asarray(pose, dtype=np.float64)
    c, s = math.cos(theta), math.sin(theta)
    away = poses[:, :2] - [x, y]
    return np.column_stack([away @ np.array([[c, -s], [s, c]]), poses[:, 2] - theta])


def _square(robot: Robot, log: DriveLog) -> tuple[float, bool, Array]:
    """The side of a square drive, m, whether it goes counter-clockwise, and its error (2,), m."""
    where, path = f"UMBmark: {log.name}", dead_reckoned(robot, log)
    began, ended = np.clip(np.searchsorted(log.t, log.reference_t[[0, -1]]), 0, len(log) - 1)
    path = from_pose(path[began], path[began : ended + 1])
    ways = np.hypot(*np.diff(path[:, :2], axis=0).T)
    headings = 0.5 * (path[1:, 2] + path[:-1, 2])
    which = np.round(headings / (0.5 * math.pi))
    straight = np.abs(headings - which * 0.5 * math.pi) < STRAIGHT
    legs = np.array([ways[straight & (which % 4 == k)].sum() for k in range(4)])
    turned, total = float(path[-1, 2]), float(ways.sum())
    whole = min(abs(abs(turned) - full) for full in (1.5 * math.pi, 2.0 * math.pi)) < TURNED
    if not whole or legs.sum() < MOSTLY * total or legs.min() < EQUAL * legs.max():
        sides = ", ".join(f"{leg:.3g}" for leg in legs)
        what = f"no square drive: it turns by {turned:.3g} rad, and goes {sides} m ahead, left, back, right"
        raise InputError(f"{what}, of {total:.3g} m", where=where)
    first = which[int(np.argmax(np.cumsum(ways * straight) > 0.1 * total))]
    error = _true_end(log, where) - path[-1, :2]
    c, s = math.cos(0.5 * math.pi * first), math.sin(0.5 * math.pi * first)
    return 0.25 * total, turned > 0.0, np.array([c * error[0] + s * error[1], c * error[1] - s * error[0]])


def _true_end(log: DriveLog, where: str) -> Array:
    """Where the reference saw it end (2,), m, from where it saw it begin."""
    first, last = log.reference[0], log.reference[-1]
    if len(first) == 3:
        return from_pose(first, last[np.newaxis])[0, :2]
    if not np.array_equal(first, last):
        raise InputError("the reference says no heading at the start", where=where, expected="poses (…, 3)")
    return np.zeros(2)
