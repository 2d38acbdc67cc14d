"""A calibration of an arm in words."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

from nmm.base.text_format import counted
from nmm.plugins.robot.calibration.amounts import angle, length

if TYPE_CHECKING:
    from nmm.plugins.robot.calibration.arm.calibration import ArmCalibration, SightingNoise
    from nmm.plugins.robot.calibration.arm.judged import ArmHeldOut


def noise_rows(result: ArmCalibration) -> Iterator[list[str]]:
    """The noise of each log."""
    for log, noise in result.noise.items():
        yield [f"noise of {log}" if len(result.noise) > 1 else "noise of a sighting", _seen(noise)]


def rest_rows(result: ArmCalibration) -> Iterator[list[str]]:
    """What was held out, and how many numbers stay since others do the same."""
    if result.held_out is not None:
        yield ["held out", held_out_text(result.held_out)]
    same = sum(number.why == "as others" for number in result.numbers.values())
    held = sum(number.why == "held" for number in result.numbers.values()) - len(shown_held(result))
    if same:
        yield ["as in the file", f"{counted(same, 'number')}, since others do the same whatever the arm does"]
    if held:
        yield ["held", f"{counted(held, 'number')}, as in the file"]


def shown_held(result: ArmCalibration) -> list[str]:
    """The held numbers that a table shows: all but those of the robot that stay as they are."""
    return [
        name
        for name, number in result.numbers.items()
        if number.why == "held" and (result.is_mount(name) or number.after != number.before)
    ]


def held_out_text(one: ArmHeldOut) -> str:
    """ "15 postures: 4.85 mm off before, 0.33 mm after: better"."""
    off = f"{_off(one.before, one.unit)} off before, {_off(one.after, one.unit)} after"
    if not math.isnan(one.turn_before):
        off += f", and turned by {1e3 * one.turn_before:.3g} and {1e3 * one.turn_after:.3g} mrad"
    lost = f", {one.lost} left out of these as no noise explains them" if one.lost else ""
    return f"{counted(one.samples, 'posture')}: {off}{lost}: {one.verdict}"


def _off(value: float, unit: str) -> str:
    return length(value) if unit == "m" else f"{value:.3g} {'px' if unit == 'px' else 'σ'}"


def _seen(noise: SightingNoise) -> str:
    parts = ((noise.place, length), (noise.turn, angle), (noise.pixel, "{:.3g} px".format))
    return " and ".join(stated(value) for value, stated in parts if not math.isnan(value))
