"""`nmm.calibrate` by sightings: an arm's zeros, placements of its joints, and mounts of cameras and
markers."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from nmm.base.arrays import Array
from nmm.base.errors import InputError, expect_known
from nmm.base.findings import Finding
from nmm.base.progress import Progress
from nmm.model.robots.numbers import with_numbers
from nmm.model.robots.robot import Robot
from nmm.plugins.robot.calibration.arm.causes import turned_boards
from nmm.plugins.robot.calibration.arm.checks import check_readings
from nmm.plugins.robot.calibration.arm.doubts import doubts
from nmm.plugins.robot.calibration.arm.fit import ArmFit, fit
from nmm.plugins.robot.calibration.arm.judged import ArmHeldOut, held_out, whiteness
from nmm.plugins.robot.calibration.arm.model import RATIO, ArmModel
from nmm.plugins.robot.calibration.arm.own_frames import check_frames
from nmm.plugins.robot.calibration.arm.residuals import PIXEL, PLACE, TURN
from nmm.plugins.robot.calibration.arm.sightings import Sightings, named_apart
from nmm.plugins.robot.calibration.kept import Hold, file_of, holding, known, names
from nmm.plugins.robot.calibration.parameters import LearnedNumber
from nmm.scenario.calibration_file import CalibrationFile


class SightingNoise(NamedTuple):
    """Standard deviations of what was seen, as the sightings show them: of a coordinate of a place, m; of an
    angle, rad; of a corner's u and v, px. NaN for what a log has none of.

    Examples
    --------
    >>> nmm.extending.SightingNoise(2e-4, np.nan, np.nan).place
    0.0002
    """

    place: float
    turn: float
    pixel: float


@dataclass(frozen=True, eq=False)
class ArmCalibration:
    """What sightings say of an arm's numbers. Made by `nmm.calibrate`.

    Attributes
    ----------
    robot : as it was; `calibrated` is the robot with the numbers that were learned
    numbers : by name, see `nmm.robot_numbers`: offset.<joint>, ratio.<joint>, origin.<joint or frame>.x to
        .yaw; besides, where what sees and what is seen are mounted, tracker.x to .yaw, point.x to .z, m and
        rad: in the frame of the robot that carries it, or in the world, of which the base is the origin
    covariance (f, f) : of the numbers that were learned, in their order, in their units
    noise : of each log, `SightingNoise`
    held_out : samples that were not learned from; None where there are too few
    whiteness : the chance that what is left from sample to sample is white noise; NaN with fewer than 40
    findings : what is doubtful
    logs : their names

    Examples
    --------
    >>> robot, rng = nmm.load("small_arm"), np.random.default_rng(0)
    >>> there = nmm.with_numbers(robot, {"offset.q3": 0.03})  # the arm that stands there
    >>> joints, rows = robot.q_names[3:], rng.uniform(-1.0, 1.0, (30, 5))
    >>> seen = []
    >>> for row in rows:
    ...     q = there.q_from(dict(zip(joints, row)), base=[0, 0, 0])
    ...     seen.append(nmm.Configuration(there, q).placement("ee").act(np.array([0.05, 0.02, 0.0])))
    >>> log = nmm.Sightings("tracker", dict(zip(joints, rows.T)), seen, "points", on="ee")
    >>> found = nmm.calibrate(robot, log, hold="origin")
    >>> found.learned[-3:], round(found.numbers["offset.q3"].after, 4)
    (['offset.q2', 'offset.q3', 'offset.q4'], 0.03)
    """

    robot: Robot
    numbers: dict[str, LearnedNumber]
    covariance: Array
    noise: dict[str, SightingNoise]
    held_out: ArmHeldOut | None
    whiteness: float
    findings: tuple[Finding, ...]
    logs: tuple[str, ...]
    model: Any = field(repr=False)  # ArmModel and ArmFit, which are nobody's but these files'
    fit: Any = field(repr=False)

    @property
    def calibrated(self) -> Robot:
        """The robot with the numbers that were learned."""
        return with_numbers(self.robot, self._own())

    def applied(self, robot: Robot) -> Robot:
        """A robot of the same file with the numbers that were learned, as `nmm.load(file, calibration=)`
        makes it."""
        return self.file().applied(robot)

    def file(self) -> CalibrationFile:
        """What a file keeps of it."""
        own = self._own()
        measured: dict[str, Any] = {
            name: {"value": number.after, "deviation": number.deviation, "unit": number.unit}
            for name, number in self.numbers.items()
            if name not in own and number.why in ("learned", "held", "not shown") and self.is_mount(name)
        }
        measured["noise"] = {log: known(noise) for log, noise in self.noise.items()}
        return file_of(self.robot, own, self.numbers, measured, self)

    def save(self, path: str | Path) -> None:
        """Write calibration.yaml, which `nmm.load(file, calibration=path)` takes."""
        self.file().save(path)

    @property
    def learned(self) -> list[str]:
        """The names of the numbers that were learned, as `covariance` has them."""
        return [name for name, number in self.numbers.items() if number.why == "learned"]

    def _own(self) -> dict[str, float]:
        """Those of the robot that are learned, or otherwise than before."""
        return {
            name: number.after
            for name, number in self.numbers.items()
            if not self.is_mount(name) and (number.why == "learned" or number.after != number.before)
        }

    def is_mount(self, name: str) -> bool:
        """Whether a number says where something is mounted, and is none of the robot's."""
        i = self.model.index(name)
        return i >= 0 and self.model.learned[i].role == "mount"


def calibrate_arm(
    robot: Robot,
    logs: Sequence[Sightings],
    hold: Hold = (),
    ratios: Collection[str] | bool = (),
    progress: Progress | None = None,
) -> ArmCalibration:
    """See `nmm.calibrate`."""
    where = f"calibrate {robot.name}"
    tell = progress or (lambda _: None)
    joints = robot.u_names[robot.platform.p :]
    if isinstance(ratios, bool):
        of_ratios = (*joints,) if ratios else ()
    else:
        of_ratios = names(ratios, f"{where}: ratios")
    for name in of_ratios:
        expect_known("joint", name, joints, f"{where}: ratios")
    asked, logs = holding(hold, where), named_apart(logs)
    model = ArmModel(robot, logs, of_ratios, where, asked)
    check_readings(model)
    held = _held(model, asked, where)
    fitted = fit(model, held, progress=lambda share: tell(0.8 * share))
    check_frames(model, fitted, held)
    tell(0.8)
    predicted = held_out(model, fitted)
    tell(0.95)
    white = whiteness(model, fitted)
    findings = (*doubts(model, fitted, predicted, white), *turned_boards(model, fitted.values))
    tell(1.0)
    noise = {}
    for k, log in enumerate(logs):
        of = {kind: float(fitted.noise[g]) for g, (i, kind) in enumerate(model.groups) if i == k}
        noise[log.name] = SightingNoise(*(of.get(kind, math.nan) for kind in (PLACE, TURN, PIXEL)))
    return ArmCalibration(
        robot=robot,
        numbers=_numbers(model, fitted, held),
        covariance=fitted.covariance,
        noise=noise,
        held_out=predicted,
        whiteness=white,
        findings=findings,
        logs=tuple(log.name for log in logs),
        model=model,
        fit=fitted,
    )


def _held(model: ArmModel, hold: Mapping[str, float | None], where: str) -> dict[int, float]:
    """The numbers that are held, at their values: by name, or all of a group ("origin", "origin.q2")."""
    held: dict[int, float] = {}
    for name, asked in hold.items():
        some = model.in_group(name)
        if not some:
            groups = dict.fromkeys(number.name.split(".")[0] for number in model.learned)
            known = [*groups, *(number.name for number in model.learned)]
            expect_known("number or group", name, known, f"{where}: hold")
        if asked is not None and model.learned[some[0]].name != name:
            expected = "a value for one number, not for a group"
            raise InputError(where=f"{where}: hold {name}", expected=expected)
        held |= {i: float(model.first[i]) if asked is None else asked for i in some}
    return held


def _numbers(model: ArmModel, fitted: ArmFit, held: Mapping[int, float]) -> dict[str, LearnedNumber]:
    deviation = dict(zip(fitted.free, fitted.deviations.tolist(), strict=True))
    stated, numbers = model.stated(fitted.values), {}
    for i, number in enumerate(model.learned):
        why = "learned"
        if i not in deviation:
            why = "held" if i in held else "not shown" if i in fitted.unseen else "as others"
        after, before = float(stated[i]), number.value
        if number.name.removeprefix(RATIO) in fitted.signs and number.name.startswith(RATIO):
            after = -after
        numbers[number.name] = LearnedNumber(before, after, deviation.get(i, 0.0), number.unit, why)
    for joint in fitted.signs:
        if RATIO + joint not in numbers:
            before = model.robot.gear(joint)[0]
            numbers[RATIO + joint] = LearnedNumber(before, -before, 0.0, "1", "sign")
    return numbers
