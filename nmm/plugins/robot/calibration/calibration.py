"""`nmm.calibrate`: a robot's numbers by its own logs, with what they do not show."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from nmm.base.arrays import Array, scalar
from nmm.base.errors import InputError, expect_known
from nmm.base.findings import Finding
from nmm.base.progress import Progress
from nmm.model.robots.numbers import with_numbers
from nmm.model.robots.robot import Robot
from nmm.plugins.robot.calibration.doubts import of_drives, of_numbers, of_rest
from nmm.plugins.robot.calibration.drive_log import DriveLog
from nmm.plugins.robot.calibration.drives import (
    RobotDrive,
    counters_of,
    drive_of,
    first_delay,
    path,
    used_looks,
)
from nmm.plugins.robot.calibration.fit import Fit, fit
from nmm.plugins.robot.calibration.judged import (
    HeldOut,
    held_out,
    whiteness,
)
from nmm.plugins.robot.calibration.model import DriveNoise, Model
from nmm.plugins.robot.calibration.parameters import DELAY
from nmm.plugins.robot.odometry import Counters
from nmm.scenario.calibration_file import CalibrationFile

#: The reference goes about as far as the wheels: a share beyond these is another unit.
LEAST_SHARE, MOST_SHARE = 0.3, 3.0
#: Wheels that roll are not so far off, rad for a rad turned.
LOOSEST = 0.3


@dataclass(frozen=True)
class LearnedNumber:
    """A number, before and after.

    Attributes
    ----------
    before : by the robot's file, or 0 for what is none of the robot's
    after : learned, or what it was held at
    deviation : standard deviation of it, 0 where it was held
    unit : "m", "rad", "s" or "1"
    why : "learned"; "held" as was asked; "not shown" by the drives

    Examples
    --------
    >>> track = nmm.LearnedNumber(before=0.5, after=0.56, deviation=0.004, unit="m", why="learned")
    >>> round((track.after - track.before) / track.deviation)
    15
    """

    before: float
    after: float
    deviation: float
    unit: str
    why: str


@dataclass(frozen=True, eq=False)
class Calibration:
    """What drives say of a robot's numbers. Made by `nmm.calibrate`.

    Attributes
    ----------
    robot : as it was; `calibrated` is the robot with the numbers that were learned
    numbers : by name, see `nmm.robot_numbers`; besides, reference.x, .y and .yaw, where the reference is on
        the robot, m and rad, delay, how much later than the encoders' clock it stamps in the middle of a
        drive, s, and clock, by which share it runs faster
    covariance (f, f) : of the numbers that were learned, in their order, in their units
    noise : standard deviations: of the reference's `place`, m, and `heading`, rad; of the wheels' `counters`,
        rad for a rad turned; `across`, m for a m of the way; of `turns`, rad for a rad turned
    held_out : dead reckoning in a part that was not learned from; None where the drives are too short
    whiteness : the chance that what is left comes of white noise
    findings : what is doubtful
    logs : their names

    Examples
    --------
    >>> t = np.linspace(0.0, 20.0, 401)
    >>> turned = {"left_wheel_joint": 60 * np.sin(t / 9), "right_wheel_joint": 60 * np.sin(t / 9)}
    >>> seen = np.stack([6.3 * np.sin(t / 9), 0.0 * t], axis=1)  # straight on, 5 % farther
    >>> log = nmm.DriveLog("straight on", t, turned, t, seen, "positions")
    >>> found = nmm.calibrate(nmm.load("differential_base"), log)
    >>> found.numbers["track"].why, round(found.calibrated.platform.radius, 3)
    ('not shown', 0.105)
    """

    robot: Robot
    numbers: dict[str, LearnedNumber]
    covariance: Array
    noise: DriveNoise
    held_out: HeldOut | None
    whiteness: float
    findings: tuple[Finding, ...]
    logs: tuple[str, ...]
    model: Any = field(repr=False)  # Model and Fit, which are nobody's but these files'
    fit: Any = field(repr=False)

    @property
    def calibrated(self) -> Robot:
        """The robot with the numbers that were learned: odometry, inputs and wheels move by them."""
        return with_numbers(self.robot, self.model.numbers(self.fit.values))

    def applied(self, robot: Robot) -> Robot:
        """A robot of the same file with the numbers that were learned, as `nmm.load(file, calibration=)`
        makes it."""
        return self.file().applied(robot)

    def file(self) -> CalibrationFile:
        """What a file keeps of it."""
        of_robot = self.model.numbers(self.fit.values)
        own = {
            name: value
            for name, value in of_robot.items()
            if self.numbers[name].why == "learned" or value != self.numbers[name].before
        }
        measured: dict[str, Any] = {
            name: {"value": number.after, "deviation": number.deviation, "unit": number.unit}
            for name, number in self.numbers.items()
            if name not in of_robot
        }
        measured["noise"] = self.noise._asdict()
        if self.held_out is not None:
            known = {name: x for name, x in self.held_out._asdict().items() if not math.isnan(x)}
            measured["held_out"] = known | {"verdict": self.held_out.verdict}
        if not math.isnan(self.whiteness):
            measured["whiteness"] = self.whiteness
        measured["findings"] = [str(finding) for finding in self.findings]
        deviations = {name: self.numbers[name].deviation for name in own}
        return CalibrationFile.of(self.robot, own, deviations, measured=measured, logs=self.logs)

    def save(self, path: str | Path) -> None:
        """Write calibration.yaml, which `nmm.load(file, calibration=path)` takes."""
        self.file().save(path)

    @property
    def learned(self) -> list[str]:
        """The names of the numbers that were learned, as `covariance` has them."""
        return [name for name, number in self.numbers.items() if number.why == "learned"]


def calibrate(
    robot: Robot,
    logs: DriveLog | Sequence[DriveLog],
    hold: Mapping[str, float | None] | Collection[str] = (),
    progress: Progress | None = None,
) -> Calibration:
    """Learn wheels' radii, track, wheelbase, steering angles, centres of rotation from drives beside a
    reference.

    A Kalman filter predicts each look of the reference by the robot's own odometry; numbers, noise of the
    wheels and of the reference are those of the greatest likelihood. What the drives do not show is held, and
    said. Looks that no noise explains are left out, and where the reference jumps the filter begins anew.

    Parameters
    ----------
    logs : one or several drives
    hold : names of numbers to keep as they are, or values to keep them at, None for what they are: {"track":
        0.5, "delay": None}
    progress : called with the fraction done

    Raises
    ------
    InputError : no counters of the platform, a drive that stands still, clocks more than a second apart, a
        reference or wheels in other units or with other signs, an unknown name

    Examples
    --------
    >>> t = np.linspace(0.0, 20.0, 401)
    >>> robot = nmm.load("differential_base")
    >>> left, right = 60 * np.sin(t / 9), 50 * np.sin(t / 7)
    >>> odometry = robot.odometry(robot.rest, {"left_wheel_joint": 0.0, "right_wheel_joint": 0.0})
    >>> seen = [odometry.update({"left_wheel_joint": a, "right_wheel_joint": b})
    ...         for a, b in zip(1.03 * left, 1.03 * right)]  # wheels that are 3 % larger
    >>> turned = {"left_wheel_joint": left, "right_wheel_joint": right}
    >>> log = nmm.DriveLog("drive", t, turned, t, [q[:3] for q in seen], "poses")
    >>> round(nmm.calibrate(robot, log).numbers["radius.left_wheel_joint"].after, 4)
    0.103
    """
    where = f"calibrate {robot.name}"
    told = [logs] if isinstance(logs, DriveLog) else [*logs]
    if not told or not all(isinstance(log, DriveLog) for log in told):
        raise InputError(where=f"{where}: logs", expected="one nmm.DriveLog or several", got=logs)
    if robot.platform.n_p < 3:
        raise InputError(where=where, expected="a platform that moves", got=robot.platform.name)
    tell = progress or (lambda _: None)
    counters = counters_of(robot, told)
    drives = [drive_of(robot, log, counters) for log in told]
    delays = _delays(counters, drives, hold)
    delay = float(np.median(delays)) if delays else 0.0
    drives = [used_looks(drive, delay) for drive in drives]
    model = Model(robot, counters, drives, delay)
    for drive in drives:
        _check_alike(model, drive, delay, where)
    held = _held(model, hold, where)
    steps = iter(np.linspace(0.05, 0.75, 12).tolist())
    fitted = fit(model, held, lambda _: tell(next(steps, 0.75)))
    _check_numbers(model, fitted, where)
    tell(0.8)
    predicted = held_out(model, fitted)
    tell(0.95)
    white = whiteness(fitted.filtered)
    findings = [*of_drives(model, delays, held), *of_numbers(model, fitted)]
    findings += of_rest(model, fitted, predicted, white)
    tell(1.0)
    return Calibration(
        robot=robot,
        numbers=_numbers(model, fitted, held),
        covariance=fitted.covariance,
        noise=fitted.noise,
        held_out=predicted,
        whiteness=white,
        findings=tuple(findings),
        logs=tuple(log.name for log in told),
        model=model,
        fit=fitted,
    )


def _held(model: Model, hold: Mapping[str, float | None] | Collection[str], where: str) -> dict[int, float]:
    known = {number.name: i for i, number in enumerate(model.learned)}
    if isinstance(hold, str):
        hold = (hold,)
    held = {}
    for name in hold:
        expect_known("number", name, known, f"{where}: hold")
        i = known[name]
        value = 0.0 if name == DELAY else float(model.first[i])
        if isinstance(hold, Mapping) and (asked := hold[name]) is not None:
            value = scalar(asked, f"{where}: hold {name}")
        held[i] = value
    return held


def _delays(
    counters: Counters, drives: Sequence[RobotDrive], hold: Mapping[str, float | None] | Collection[str]
) -> list[float]:
    """The clock's delay in each drive with looks, s, as it seems at first, or as it is held."""
    looked = [drive for drive in drives if not drive.ends]
    if DELAY in hold:
        held = hold[DELAY] if isinstance(hold, Mapping) else None
        return [0.0 if held is None else scalar(held, f"{counters.where}: hold {DELAY}")] * len(looked)
    return [first_delay(counters, drive) for drive in looked]


def _check_alike(model: Model, drive: RobotDrive, delay: float, where: str) -> None:
    """`InputError` where the reference goes much farther, or less, than the wheels. Steps are as long as it
    takes for noise not to lengthen them."""
    if drive.ends:
        return
    noise = float(np.median(np.hypot(*np.diff(drive.z[:, :2], 2, axis=0).T))) if len(drive.z) > 4 else 0.0
    ways = path(model.counters, drive, drive.at - delay)
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


def _check_numbers(model: Model, fitted: Fit, where: str) -> None:
    if fitted.noise.counters > LOOSEST:
        what = f"wheels and reference disagree by {fitted.noise.counters:.2g} rad for a rad that wheels turn"
        expected = "wheels by their names, in rad, with their signs; a reference of this drive"
        raise InputError(what, where=where, expected=expected)
    for i in fitted.free:
        number, value = model.learned[i], float(fitted.values[i])
        if number.kind in ("radius", "scale", "track", "wheelbase", "ratio"):
            share = value / number.value
            if not LEAST_SHARE < share < MOST_SHARE:
                what = (
                    f"{number.name} would be {value:.4g} {number.unit} where the file has {number.value:.4g}"
                )
                expected = "a reading in its unit, with its sign"
                raise InputError(what, where=where, expected=expected)


def _numbers(model: Model, fitted: Fit, held: Mapping[int, float]) -> dict[str, LearnedNumber]:
    deviation = dict(zip(fitted.free, fitted.deviations.tolist(), strict=True))
    numbers = {}
    for i, number in enumerate(model.learned):
        why = "held" if i in held else "not shown" if i in fitted.unseen else "learned"
        before = number.value if number.of_robot else 0.0
        numbers[number.name] = LearnedNumber(
            *(before, float(fitted.values[i]), deviation.get(i, 0.0), number.unit, why)
        )
    return numbers
