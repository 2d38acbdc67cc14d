"""Numbers that a calibration keeps: those that it is asked to hold, and those of earlier calibrations."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from typing import Any

from nmm.base.arrays import scalar
from nmm.base.errors import InputError
from nmm.model.robots.robot import Robot
from nmm.plugins.robot.calibration.parameters import LearnedNumber
from nmm.scenario.calibration_file import CalibrationFile

Hold = Mapping[str, float | None] | Collection[str]


def holding(hold: Hold, where: str) -> dict[str, float | None]:
    """What is to be held, by name its value, None for what it is; `InputError` for anything else."""
    named = names(hold, f"{where}: hold", 'names of numbers, or values by name: {"track": 0.5}')
    asked = {**hold} if isinstance(hold, Mapping) else dict.fromkeys(named)
    for name, value in asked.items():
        if value is not None:
            asked[name] = scalar(value, f"{where}: hold {name}")
    return asked


def names(asked: Collection[str], where: str, expected: str = "a name, or several") -> tuple[str, ...]:
    """A name or several as a tuple; `InputError` for anything else."""
    several = (asked,) if isinstance(asked, str) else asked
    if not isinstance(several, Collection) or not all(isinstance(name, str) for name in several):
        raise InputError(where=where, expected=expected, got=asked)
    return tuple(several)


def known(of: Any) -> dict[str, Any]:
    """A named tuple as a mapping, without what is not known."""
    return {name: x for name, x in of._asdict().items() if not (isinstance(x, float) and math.isnan(x))}


def file_of(
    robot: Robot,
    own: Mapping[str, float],
    numbers: Mapping[str, LearnedNumber],
    measured: dict[str, Any],
    calibration: Any,
) -> CalibrationFile:
    """The file of what was learned of a robot, with the numbers that it had from an earlier calibration.

    calibration : whose `held_out`, `whiteness` and `findings` go beside what was `measured`
    """
    if calibration.held_out is not None:
        measured["held_out"] = known(calibration.held_out) | {"verdict": calibration.held_out.verdict}
    if not math.isnan(calibration.whiteness):
        measured["whiteness"] = calibration.whiteness
    measured["findings"] = [str(finding) for finding in calibration.findings]
    kept = {name: value for name, value in robot.changed_numbers.items() if name not in own}
    deviations = {name: numbers[name].deviation for name in own}
    return CalibrationFile.of(robot, {**kept, **own}, deviations, measured=measured, logs=calibration.logs)
