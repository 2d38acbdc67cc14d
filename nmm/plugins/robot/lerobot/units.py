"""What the numbers of a column mean: its unit is stated by the data set or asked for, never guessed.

Angles that LeRobot normalises are shares of a joint's range, which its calibration knows and the data set
does not: "-100..100", or "0..100" of grippers. 0.4 and 0.5 write an arm of LeKiwi's so, 0.6 in degrees.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict, RootModel

from nmm.base.arrays import Array, vector
from nmm.base.errors import InputError, expect, expect_known, few
from nmm.base.text_format import is_pattern, matching
from nmm.model.robots.robot import Robot
from nmm.plugins.robot.lerobot.layout import PLACE, RATE
from nmm.views.folders.schema import read_json

#: By SI unit, those that are taken for it, with what they are in it.
UNITS: dict[str, dict[str, float]] = {
    "m": {"m": 1.0, "mm": 1e-3},
    "rad": {"rad": 1.0, "deg": math.pi / 180.0},
    "m/s": {"m/s": 1.0, "mm/s": 1e-3},
    "rad/s": {"rad/s": 1.0, "deg/s": math.pi / 180.0},
}
#: Shares of a joint's range: where its lower and its upper end are.
SHARES = {"-100..100": (-100.0, 100.0), "0..100": (0.0, 100.0)}
#: Of a turn of LeRobot's servos (Feetech STS3215), as `MotorsBus._normalize` counts it.
STEPS = 4095

#: Ends of ranges, or "limits", by name; or "limits" for all.
Ranges = Mapping[str, Sequence[float] | str] | str | None


class MotorCalibration(BaseModel):
    """Of a motor in LeRobot's calibration file; the ends of its range in steps."""

    model_config = ConfigDict(strict=True, frozen=True)
    drive_mode: int = 0
    range_min: int
    range_max: int


class MotorCalibrations(RootModel[dict[str, MotorCalibration]]):
    """LeRobot's calibration file, by motor."""


class ColumnUnits:
    """The units of a data set's columns, by what it states and what `units` says.

    stated : by column
    asked : by column or pattern; a name counts before a pattern, later patterns before earlier ones
    ranges, calibration : of normalised columns, see `read_lerobot`
    """

    def __init__(
        self,
        robot: Robot,
        stated: Mapping[str, str],
        asked: Mapping[str, str] | None,
        ranges: Ranges,
        calibration: str | Path | None,
        available: Sequence[str],
    ) -> None:
        asked = {} if asked is None else asked
        expect(isinstance(asked, Mapping), "units", "units by column or pattern", asked)
        self._robot, self._stated, self._asked = robot, stated, dict(asked)
        for name, unit in self._asked.items():
            where = f"units: {name}"
            expect(isinstance(name, str) and isinstance(unit, str), where, "names and units as text", unit)
            if not matching(name, available):
                raise InputError("no column", where=where, available=available)
        self._ranges, self._limits = _ranges(ranges)
        self._calibrated = {} if calibration is None else _calibrated(Path(calibration))

    def of(self, column: str) -> str | None:
        """The unit of a column as it is written, None where nobody says it."""
        if column in self._asked:
            asked: str | None = self._asked[column]
        else:
            patterns = [name for name in self._asked if is_pattern(name) and matching(name, [column])]
            asked = self._asked[patterns[-1]] if patterns else None
        stated = self._stated.get(column)
        if asked and stated and asked != stated:
            raise InputError(
                where=f"units: {column}", expected=f"{stated!r}, as the data set states", got=asked
            )
        return asked or stated

    def check(self, wanted: Mapping[str, str]) -> None:
        """`InputError` where a unit of the columns is not known, by column its SI unit."""
        missing = [column for column in wanted if self.of(column) is None]
        if missing:
            raise InputError(
                f"no unit is stated of {few(missing, shown=1)}, and LeRobot's versions differ",
                expected=f"units={_example(missing, wanted)}",
            )
        for column, unit in wanted.items():
            known = [*UNITS[unit], *(SHARES if not column.endswith(RATE) and unit in ("m", "rad") else ())]
            expect_known("unit", self.of(column), known, f"units: {column}")

    def converted(self, values: Array, column: str, unit: str, coordinate: str) -> Array:
        """Numbers (K,) of a column in an SI unit. A joint's are its coordinate's where the data set states
        units, as nmm's do, or ends are given; a recorder's are what its encoder reads."""
        own = self.of(column)
        assert own is not None
        if own not in SHARES:
            factor, offset = (1.0, 0.0) if column in self._stated else self._robot.gear(coordinate)
            return factor * (values * UNITS[unit][own]) + offset
        low, high = SHARES[own]
        lower, upper = self._range(column, coordinate)
        return lower + (values - low) / (high - low) * (upper - lower)

    def _range(self, column: str, coordinate: str) -> tuple[float, float]:
        """Of a share, by the coordinate."""
        names = (coordinate, column, column.rpartition(".")[0])
        for name in names:
            if name in self._ranges:
                return self._ranges[name]
        factor, offset = self._robot.gear(coordinate)
        for name in names:
            if name in self._calibrated:
                lower, upper = self._calibrated[name]
                return factor * lower + offset, factor * upper + offset
        i = self._robot.q_names.index(coordinate)
        if self._limits & {*names, "*"} and self._robot.limited[i].all():
            lower, upper = self._robot.q_limits[i].tolist()
            return (lower, upper) if factor > 0.0 else (upper, lower)  # as its encoder counts
        what = f"{column} is a share of {coordinate}'s range, and where that ends is not known"
        expected = f"ranges={{{coordinate!r}: (lower, upper)}} or 'limits', or calibration="
        raise InputError(what, expected=expected, available=[*self._ranges, *self._calibrated] or None)


def _example(missing: Sequence[str], wanted: Mapping[str, str]) -> str:
    """What to say, for one column of each kind."""
    samples: dict[str, str] = {}
    for column in missing:
        words = {"m": "m", "rad": "deg|rad|-100..100", "m/s": "m/s", "rad/s": "deg/s|rad/s"}[wanted[column]]
        samples.setdefault(words, f"*{PLACE}" if column.endswith(PLACE) else column)
    return "{" + ", ".join(f"{column!r}: {words!r}" for words, column in samples.items()) + "}"


def _ranges(ranges: Ranges) -> tuple[dict[str, tuple[float, float]], set[str]]:
    """Lower and upper ends, rad or m, by name; and the names of those at the robot's limits, "*" for all."""
    if ranges is None or isinstance(ranges, str):
        expect(ranges in (None, "limits"), "ranges", "ends by name, or 'limits'", ranges)
        return {}, {"*"} if ranges else set()
    expect(isinstance(ranges, Mapping), "ranges", "ends by name, or 'limits'", ranges)
    found, limits = dict[str, tuple[float, float]](), set[str]()
    for name, ends in ranges.items():
        if isinstance(ends, str):
            expect(ends == "limits", f"ranges: {name}", "two ends, or 'limits'", ends)
            limits.add(name)
            continue
        lower, upper = vector(ends, 2, f"ranges: {name}").tolist()
        expect(lower != upper, f"ranges: {name}", "two ends that differ", ends)
        found[name] = (lower, upper)
    return found, limits


def _calibrated(file: Path) -> dict[str, tuple[float, float]]:
    motors = read_json(file, MotorCalibrations).root
    return {name: _ends(motor, f"{file}: {name}") for name, motor in motors.items()}


def _ends(motor: MotorCalibration, where: str) -> tuple[float, float]:
    """Of a motor, rad from the middle of its range, where LeRobot's degrees are 0; the other way around where
    `drive_mode` turns the shares around."""
    span = motor.range_max - motor.range_min
    expect(0 < span <= 64 * STEPS, f"{where}: range_max", "more than range_min, by some turns at most", span)
    half = span / 2 * (2 * np.pi / STEPS)
    return (half, -half) if motor.drive_mode else (-half, half)


def stated_units(features: Mapping[str, Any], where: object) -> dict[str, str]:
    """By column, the units that features state."""
    stated: dict[str, str] = {}
    for name, feature in features.items():
        units, names = feature.units, feature.columns
        if units is None:
            continue
        expect(len(units) == len(names), f"{where}: features.{name}.units", f"{len(names)} units", len(units))
        stated |= dict(zip(names, units, strict=True))
    return stated
