"""`nmm.calibrate`: a robot's numbers by its own logs, with what they do not show."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, overload

import numpy as np

from nmm.base.arrays import Array
from nmm.base.errors import InputError, expect, expect_kind
from nmm.base.findings import Finding
from nmm.base.progress import Progress
from nmm.model.robots.numbers import with_numbers
from nmm.model.robots.robot import Robot
from nmm.plugins.robot.calibration.arm.calibration import ArmCalibration, calibrate_arm
from nmm.plugins.robot.calibration.arm.sightings import Sightings
from nmm.plugins.robot.calibration.checks import check_alike, check_ends, check_logs, check_numbers
from nmm.plugins.robot.calibration.clocks import check_clocks, told_by_clocks
from nmm.plugins.robot.calibration.doubts import of_drives, of_numbers, of_rest
from nmm.plugins.robot.calibration.drive_log import DriveLog
from nmm.plugins.robot.calibration.drives import (
    counters_of,
    drive_of,
    first_delay,
    used_looks,
)
from nmm.plugins.robot.calibration.filtered import DriveNoise
from nmm.plugins.robot.calibration.fit import Fit, fit
from nmm.plugins.robot.calibration.held import asked_to_hold, held_delay, held_numbers
from nmm.plugins.robot.calibration.judged import HeldOut, held_out, whiteness
from nmm.plugins.robot.calibration.kept import Hold, file_of
from nmm.plugins.robot.calibration.mixed_up import check_mixed_up
from nmm.plugins.robot.calibration.model import Model
from nmm.plugins.robot.calibration.mounting import check_mounting
from nmm.plugins.robot.calibration.parameters import CLOCK, LearnedNumber
from nmm.scenario.calibration_file import CalibrationFile


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

    @property
    def filter_noise(self) -> dict[str, Any]:
        """The wheels' noise that the drives showed, as `nmm.PoseFilter` takes it: `spread`, rad²/rad, and
        `slip_noise`, m/√m along and across, rad/√rad."""
        noise = self.noise
        return {"spread": noise.counters**2, "slip_noise": (0.0, noise.across, noise.turns)}

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
        return file_of(self.robot, own, self.numbers, measured, self)

    def save(self, path: str | Path) -> None:
        """Write calibration.yaml, which `nmm.load(file, calibration=path)` takes."""
        self.file().save(path)

    @property
    def learned(self) -> list[str]:
        """The names of the numbers that were learned, as `covariance` has them."""
        return [name for name, number in self.numbers.items() if number.why == "learned"]


@overload
def calibrate(
    robot: Robot,
    logs: DriveLog | Sequence[DriveLog],
    hold: Hold = (),
    progress: Progress | None = None,
    *,
    ratios: Collection[str] | bool = (),
) -> Calibration: ...


@overload
def calibrate(
    robot: Robot,
    logs: Sightings | Sequence[Sightings],
    hold: Hold = (),
    progress: Progress | None = None,
    *,
    ratios: Collection[str] | bool = (),
) -> ArmCalibration: ...


def calibrate(
    robot: Robot,
    logs: DriveLog | Sightings | Sequence[DriveLog] | Sequence[Sightings],
    hold: Hold = (),
    progress: Progress | None = None,
    *,
    ratios: Collection[str] | bool = (),
) -> Calibration | ArmCalibration:
    """Learn a platform's wheels, track, wheelbase and steering from drives beside a reference; or an arm's
    joint zeros, the placements of its joints and of its cameras from sightings.

    Of drives a Kalman filter predicts each look of the reference by the robot's own odometry; numbers, noise
    of the wheels and of the reference are those of the greatest likelihood. Looks that no noise explains are
    left out, and where the reference jumps the filter begins anew. Of sightings, numbers are those of least
    squares, where mounts of what sees and of what is seen are found first, by closed forms. What logs do not
    show is held, and said.

    Parameters
    ----------
    logs : one or several drives; or one or several sightings
    hold : names of numbers to keep as they are, or values to keep them at, None for what they are: {"track":
        0.5, "delay": None}; delay and clock are those of all drives; of an arm also groups of names:
        "origin", "origin.elbow", "tracker"
    progress : called with the fraction done
    ratios : of an arm, joints whose gear ratio is learned, too; True for all. By default only the sign is
        looked for, where nothing fits otherwise

    Raises
    ------
    InputError : no counters of the platform, a drive that stands still, clocks more than a second apart,
        wheels or a reference in other units, with other signs or swapped (with what would fit), a reference
        that was moved on the robot, drives that do not end where they are said to, a log that is given twice,
        an unknown name, a value to hold at that no such robot has; of sightings no readings of a
        joint, readings that cannot be, fewer samples than numbers, an arm that stood still, or that does not
        fit to what was seen at all

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
    expect_kind(robot, Robot, "calibrate", "a Robot, as nmm.load gives it")
    where = f"calibrate {robot.name}"
    several: list[Any] = [*logs] if isinstance(logs, Sequence) else [logs]
    if several and all(isinstance(log, Sightings) for log in several):
        return calibrate_arm(robot, several, hold, ratios, progress)
    told: list[DriveLog] = several
    if not told or not all(isinstance(log, DriveLog) for log in told):
        expected = "one nmm.DriveLog or several, or one nmm.Sightings or several"
        raise InputError(where=f"{where}: logs", expected=expected, got=logs)
    expect(not ratios, f"{where}: ratios", "none: they are of an arm's sightings", ratios)
    if robot.platform.n_p < 3:
        raise InputError(where=where, expected="a platform that moves", got=robot.platform.name)
    asked = asked_to_hold(hold, where)
    check_logs(told, where)
    tell = progress or (lambda _: None)
    counters = counters_of(robot, told)
    drives = [drive_of(robot, log, counters) for log in told]
    if sum(not drive.ends for drive in drives) > 1:
        drives = [replace(drive, number=str(i)) for i, drive in enumerate(drives, 1)]
    held = held_numbers(Model(robot, counters, drives), asked, where)
    for drive in drives:
        check_mixed_up(robot, counters, drive, asked)
    by_clocks = [] if CLOCK in asked else drives  # who holds it knows that they run alike
    for drive in by_clocks:
        check_clocks(counters, drive)
    with told_by_clocks(counters, by_clocks):
        delays = [held_delay(asked, drive) for drive in drives]
        drives = [
            used_looks(drive, first_delay(counters, drive) if delay is None else delay)
            for drive, delay in zip(drives, delays, strict=True)
        ]
        model = Model(robot, counters, drives)
        for drive in drives:
            check_alike(model, drive, where)
        steps = iter(np.linspace(0.05, 0.75, 12).tolist())
        fitted = fit(model, held, lambda _: tell(next(steps, 0.75)))
        for check in (check_ends, check_numbers, check_mounting):
            check(model, fitted, where)
    model.forget()
    tell(0.8)
    predicted = held_out(model, fitted)
    tell(0.95)
    white = whiteness(fitted.filtered)
    findings = [*of_drives(model, held), *of_numbers(model, fitted)]
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
