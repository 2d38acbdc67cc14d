"""A calibration as a folder: calibration.yaml, a summary, figures, and what the robot's file has to say."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nmm.base.errors import InputError
from nmm.base.figure_options import PLAIN, FigureOptions
from nmm.base.text_format import counted
from nmm.views.folders.whole import FolderKind, replaced_folder

if TYPE_CHECKING:
    from nmm.model.robots.robot import Robot
    from nmm.plugins.robot.calibration.calibration import Calibration, LearnedNumber
    from nmm.plugins.robot.calibration.drive_log import DriveLog
    from nmm.plugins.robot.calibration.judged import HeldOut
    from nmm.plugins.robot.calibration.patch import DescriptionPatch

is_calibration = FolderKind("nmm calibration folder 1")
FILE = "calibration.yaml"


def save(
    found: Calibration,
    folder: str | Path,
    *,
    patch: DescriptionPatch | None = None,
    figures: FigureOptions = PLAIN,
) -> Path:
    """Write the folder, whole or not at all, replacing one that this wrote before.

        calibration.yaml                            what `nmm.load(..., calibration=)` takes
        summary.json                                `summary`
        path.png, residuals.png, correlation.png    `figures.FIGURES`
        ROBOT.urdf, ROBOT.urdf.diff                 the corrected file, where there is a `patch` of a URDF

    Raises
    ------
    InputError : a folder of anything else, or one that cannot be written
    """
    with replaced_folder(folder, is_calibration) as temporary:
        found.save(temporary / FILE)
        is_calibration.write(temporary, summary(found, patch))
        if patch is not None:
            patch.save(temporary)
        from nmm.plugins.robot.calibration.figures import FIGURES
        from nmm.views.figures.style import save_as

        for name, draw in FIGURES.items():
            save_as(draw(found, **figures.across()), temporary, name, figures)
    return Path(folder)


def summary(found: Calibration, patch: DescriptionPatch | None = None) -> dict[str, Any]:
    """What was found as plain data: m, rad and s; null for what there is none of."""
    told: dict[str, Any] = {
        "robot": found.robot.name,
        "platform": found.robot.platform.name,
        "logs": [*found.logs],
        "numbers": {name: vars(number) for name, number in found.numbers.items()},
        "covariance": {"of": found.learned, "matrix": found.covariance.tolist()},
        "noise": found.noise._asdict(),
        "held_out": None,
        "whiteness": found.whiteness,
        "findings": [finding.as_json() for finding in found.findings],
    }
    if found.held_out is not None:
        told["held_out"] = {**found.held_out._asdict(), "verdict": found.held_out.verdict}
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


def patch_of(found: Calibration, **loading: Any) -> tuple[DescriptionPatch | None, str]:
    """What the robot's file has to say, or None and why that is not known; loading as of `nmm.load`."""
    from nmm.plugins.robot.calibration.patch import description_patch

    try:
        return description_patch(found.calibrated, **loading), ""
    except InputError as error:
        return None, str(error)


def number_rows(found: Calibration) -> list[list[str]]:
    """Name, before, after, deviation, unit and why, of each number, with as many digits as are known."""
    return [[name, *number_texts(number), number.why] for name, number in found.numbers.items()]


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


def rest_rows(found: Calibration) -> Iterator[list[str]]:
    """Noise, whether what is left is white, and the part that was held out, in words."""
    noise = found.noise
    if not all(drive.ends for drive in found.model.drives):
        seen = f"{_length(noise.place)}"
        if all(drive.rows == 3 for drive in found.model.drives):
            seen += f" and {_angle(noise.heading)}"
        yield ["noise of the reference", f"{seen}; {1e3 * noise.jitter:.2g} ms of its stamps"]
        across = f"{_length(noise.across)} across for a metre, {_angle(noise.turns)} for a radian turned"
        yield ["noise of the platform", across]
    yield ["noise of a counter", f"{_angle(noise.counters)} for a radian"]
    if math.isnan(found.whiteness):
        yield ["residuals", "too few to tell whether they are white"]
    else:
        word = "white" if found.whiteness >= 0.01 else "not white"
        yield ["residuals", f"{word} (p = {found.whiteness:.2g})"]
    if found.held_out is not None:
        yield ["held out", held_out_text(found.held_out)]


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
    return [["UMBmark", f"{unequal}, {corrections}, E_max {_length(squares.largest_error)}"]]


def held_out_text(one: HeldOut) -> str:
    """ "dead reckoning over 15 windows of 2.2 m: 128 mm off before, 9.1 mm after: better"."""
    windows = f"{counted(one.windows, 'window')} of {one.length:.2g} m"
    off = f"{_length(one.before)} off before, {_length(one.after)} after"
    return f"dead reckoning over {windows}: {off}: {one.verdict}"


def _length(value: float) -> str:
    return f"{1e3 * value:.3g} mm" if value < 1.0 else f"{value:.3g} m"


def _angle(value: float) -> str:
    return f"{1e3 * value:.3g} mrad" if value < 1.0 else f"{value:.3g} rad"
