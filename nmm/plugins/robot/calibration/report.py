"""A calibration as a folder: calibration.yaml, a summary, figures, and what the robot's file has to say."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nmm.base.errors import InputError
from nmm.base.figure_options import PLAIN, FigureOptions
from nmm.base.text_format import counted
from nmm.plugins.robot.calibration.amounts import angle, length
from nmm.views.folders.whole import FolderKind, replaced_folder

if TYPE_CHECKING:
    from nmm.model.robots.robot import Robot
    from nmm.plugins.robot.calibration.arm.calibration import ArmCalibration
    from nmm.plugins.robot.calibration.calibration import Calibration
    from nmm.plugins.robot.calibration.drive_log import DriveLog
    from nmm.plugins.robot.calibration.judged import HeldOut
    from nmm.plugins.robot.calibration.parameters import LearnedNumber
    from nmm.plugins.robot.calibration.patch import DescriptionPatch

is_calibration = FolderKind("nmm calibration folder 1")
FILE = "calibration.yaml"


def save(
    result: Calibration | ArmCalibration,
    folder: str | Path,
    *,
    patch: DescriptionPatch | None = None,
    figures: FigureOptions = PLAIN,
) -> Path:
    """Write the folder, whole or not at all, replacing one that this wrote before.

        calibration.yaml                            what `nmm.load(..., calibration=)` takes
        summary.json                                `summary`
        path.png, residuals.png, correlation.png    `figures.FIGURES`; of an arm without a path
        ROBOT.urdf, ROBOT.urdf.diff                 the corrected file, where there is a `patch` of a URDF

    Raises
    ------
    InputError : a folder of anything else, or one that cannot be written
    """
    with replaced_folder(folder, is_calibration) as temporary:
        result.save(temporary / FILE)
        is_calibration.write(temporary, summary(result, patch))
        if patch is not None:
            patch.save(temporary)
        from nmm.plugins.robot.calibration.figures import figures_of
        from nmm.views.figures.style import save_as

        for name, draw in figures_of(result).items():
            save_as(draw(result, **figures.across()), temporary, name, figures)
    return Path(folder)


def summary(result: Calibration | ArmCalibration, patch: DescriptionPatch | None = None) -> dict[str, Any]:
    """What was found as plain data: m, rad and s; null for what there is none of."""
    told: dict[str, Any] = {
        "robot": result.robot.name,
        "platform": result.robot.platform.name,
        "logs": [*result.logs],
        "numbers": {name: vars(number) for name, number in result.numbers.items()},
        "covariance": {"of": result.learned, "matrix": result.covariance.tolist()},
        "noise": {log: noise._asdict() for log, noise in result.noise.items()}
        if isinstance(result.noise, dict)
        else result.noise._asdict(),
        "held_out": None,
        "whiteness": result.whiteness,
        "findings": [finding.as_json() for finding in result.findings],
    }
    if result.held_out is not None:
        told["held_out"] = {**result.held_out._asdict(), "verdict": result.held_out.verdict}
    if patch is not None:
        told["file"] = {
            "arguments": {**patch.arguments},
            "places": {**patch.places},
            "left": {**patch.left},
        }
    cleaned: dict[str, Any] = _without_nan(told)
    return cleaned


def _without_nan(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _without_nan(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_without_nan(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def patch_of(result: Calibration | ArmCalibration, **loading: Any) -> tuple[DescriptionPatch | None, str]:
    """What the robot's file has to say, or None and why that is not known; loading as of `nmm.load`."""
    from nmm.plugins.robot.calibration.patch import description_patch

    try:
        return description_patch(result.calibrated, **loading), ""
    except InputError as error:
        return None, str(error)


def number_rows(result: Calibration | ArmCalibration) -> list[list[str]]:
    """Name, before, after, deviation, unit and why, of each number, with as many digits as are known."""
    from nmm.plugins.robot.calibration.arm.calibration import ArmCalibration
    from nmm.plugins.robot.calibration.arm.report import shown_held

    numbers = result.numbers
    if isinstance(result, ArmCalibration):
        held = shown_held(result)
        numbers = {
            name: number
            for name, number in numbers.items()
            if number.why != "as others" and (number.why != "held" or name in held)
        }
    return [[name, *number_texts(number), number.why] for name, number in numbers.items()]


def number_texts(number: LearnedNumber) -> tuple[str, str, str, str]:
    """Before, after, deviation and unit: two digits of the deviation, and values to the same decimal."""
    unit = "" if number.unit == "1" else number.unit
    if not (number.deviation > 0.0 and math.isfinite(number.deviation)):
        return f"{number.before:.6g}", f"{number.after:.6g}", "", unit
    decimals = max(0, 1 - math.floor(math.log10(number.deviation)))
    before, after, deviation = (
        f"{value:.{decimals}f}" for value in (number.before, number.after, number.deviation)
    )
    exact = f"{number.before:.6g}"
    return min(before, exact, key=len) if float(before) == number.before else exact, after, deviation, unit


def rest_rows(result: Calibration | ArmCalibration) -> Iterator[list[str]]:
    """Noise, whether what is left is white, and the part that was held out, in words."""
    from nmm.plugins.robot.calibration.arm import report as of_arm
    from nmm.plugins.robot.calibration.arm.calibration import ArmCalibration

    if isinstance(result, ArmCalibration):
        yield from of_arm.noise_rows(result)
    else:
        yield from _noise_rows(result)
    if math.isnan(result.whiteness):
        yield ["residuals", "too few to tell whether they are white"]
    else:
        word = "white" if result.whiteness >= 0.01 else "not white"
        yield ["residuals", f"{word} (p = {result.whiteness:.2g})"]
    if isinstance(result, ArmCalibration):
        yield from of_arm.rest_rows(result)
    elif result.held_out is not None:
        yield ["held out", held_out_text(result.held_out)]


def _noise_rows(result: Calibration) -> Iterator[list[str]]:
    noise = result.noise
    if not all(drive.ends for drive in result.model.drives):
        seen = f"{length(noise.place)}"
        if all(drive.rows == 3 for drive in result.model.drives):
            seen += f" and {angle(noise.heading)}"
        yield ["noise of the reference", f"{seen}; {1e3 * noise.jitter:.2g} ms of its stamps"]
        across = f"{length(noise.across)} across for a metre, {angle(noise.turns)} for a radian turned"
        yield ["noise of the platform", across]
    yield ["noise of a counter", f"{angle(noise.counters)} for a radian"]
    if any(drive.hitches for drive in result.model.drives):
        yield ["noise of a hitch", f"{angle(noise.following)} from look to look"]


def umbmark_rows(robot: Robot, logs: Sequence[DriveLog]) -> list[list[str]]:
    """UMBmark's report of drives of which only the ends are known; nothing where they are no squares, both
    ways."""
    from nmm.plugins.robot.calibration.umbmark import UMBmark

    if not all(log.kind == "ends" for log in logs):
        return []
    try:
        squares = UMBmark.from_logs(robot, logs)
    except InputError:
        return []
    unequal = f"E_d {squares.E_d:.5f}, E_b {squares.E_b:.5f}"
    corrections = f"c_left {squares.c_left:.5f}, c_right {squares.c_right:.5f}"
    return [["UMBmark", f"{unequal}, {corrections}, E_max {length(squares.largest_error)}"]]


def held_out_text(one: HeldOut) -> str:
    """ "dead reckoning over 15 windows of 2.2 m: 128 mm off before, 9.1 mm after: better"."""
    windows = f"{counted(one.windows, 'window')} of {one.length:.2g} m"
    off = f"{length(one.before)} off before, {length(one.after)} after"
    return f"dead reckoning over {windows}: {off}: {one.verdict}"
