"""calibrate: a robot's numbers by logs of its drives, with what these do not show."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from nmm.base.errors import InputError, expect
from nmm.base.text_format import counted
from nmm.cli.groups import Figures, Loading, command
from nmm.cli.interrupts import shielded
from nmm.cli.options import ARGUMENT, ROBOT_HELP, arguments_of, flag, names_of, option, out_option
from nmm.cli.output import FAILED, OK, progress, show_table, show_text, warn
from nmm.plugins.robot.calibration.arm.cli import SightingOptions, one_each, telling
from nmm.plugins.robot.cli import LogOptions, is_bag

if TYPE_CHECKING:
    from nmm.model.robots.robot import Robot
    from nmm.plugins.robot.calibration.arm.calibration import ArmCalibration
    from nmm.plugins.robot.calibration.calibration import Calibration
    from nmm.plugins.robot.calibration.drive_log import DriveLog
    from nmm.plugins.robot.calibration.patch import DescriptionPatch

#: The reference of a drive that ends where it began.
CLOSED = "closed"


@dataclass(frozen=True)
class TableOptions:
    """How tables of counters and of the reference are read."""

    units: str | None = option(
        "GROUP=UNIT,...|SI",
        "Units of a table, which are never guessed: wheels=ticks:2048 (rad, deg, rev, m:RADIUS, rpm, rad/s), "
        "steering=deg, position=mm, heading=deg, time=ms, reference_time=s, of an arm joints=deg, "
        "slides=m, or of one column by its name; "
        "SI is s, m and rad throughout.",
        show="asked for",
    )
    columns: str | None = option(
        "NAME=COLUMN,...",
        "Columns of a table that are called otherwise than the joint, the input, x, y or theta.",
        show="those called so",
    )
    time: str | None = option("COLUMN", "The column of stamps of a table.", show="t")
    reference_time: str | None = option("COLUMN", "That of the reference's table.", show="that of --time")
    shift: float | None = option("S", "Added to the stamps of a reference's table, s.", show="0")
    delimiter: str | None = option("CHARACTER", "Between the columns of a table.", show="found")

    def keywords(self) -> dict[str, Any]:
        """As `DriveLog.from_csv` takes them, without those not given."""
        told = {
            "units": "SI"
            if self.units == "SI"
            else _texts(self.units, "--units", "GROUP=UNIT, as in wheels=rad"),
            "columns": _texts(self.columns, "--columns", "NAME=COLUMN, as in x=pos_x"),
            "time": self.time,
            "reference_time": self.reference_time,
            "shift": self.shift,
            "delimiter": self.delimiter,
        }
        return {name: value for name, value in told.items() if value is not None}


@command
def calibrate(
    robot: Annotated[str, typer.Argument(metavar="ROBOT", help=ROBOT_HELP, show_default=False)],
    logs: Annotated[
        list[str],
        typer.Argument(
            metavar="LOG...",
            help="Tables (CSV), rosbag2 folders, .mcap, .db3 or .bag files: drives, or sightings.",
            show_default=False,
        ),
    ],
    arguments: list[str] | None = ARGUMENT,
    *,
    reference: list[str] | None = option(
        "FILE|TOPIC|closed",
        "What saw the robot: of a table, another with stamps, x, y and theta, or closed, for a drive that "
        "ends where it began; of a bag, tf or a topic of poses or points, of sightings a topic or "
        "FRAME:CHILD of TF. One for all logs, or one for each.",
        show="columns of the table; tf of a drive's bag",
    ),
    hold: list[str] | None = option(
        "NAME[=VALUE]", "A number to keep as it is, or at a value, m, rad or s. May be repeated."
    ),
    wrapped: str | None = option(
        "NAME[=COUNT|=no],...|all|none",
        "Counters that begin anew, after a turn or after COUNT of the column's unit, or do not.",
        show="found, with a warning",
    ),
    of_arm: SightingOptions,
    of_tables: TableOptions,
    of_bags: LogOptions,
    loading: Loading,
    out: Annotated[Path | None, out_option("runs/<name>-calibration")] = None,
    drawn: Figures,
    as_json: bool = flag("--json", "What was found as JSON on standard output, for scripts."),
) -> int:
    """Learn a robot's own numbers: wheels, track and steering from drives, an arm's from sightings.

    Encoders beside a reference (a localisation, motion capture, a tracker, marks on the floor) say how large
    wheels are, how far apart, how steering stands, where the reference sits and how late it is; what the
    drives do not show stays, and is named with the motion that would show it: docs/calibration.md. With
    --seen-on, points of a tracker, poses of motion capture or corners in a camera say how an arm's joints are
    read and placed, and where the camera is.

    \b
    nmm calibrate my_robot.urdf drive.csv --units wheels=rad,time=s,position=m,heading=rad
    nmm calibrate my_robot.urdf a.csv b.csv --reference a_mocap.csv --reference b_mocap.csv --units SI
    nmm calibrate my_robot.urdf drive.mcap --reference /mocap/pose --hold track
    nmm calibrate my_robot.urdf left.csv right.csv --reference closed --units wheels=ticks:2048,time=ms
    nmm calibrate my_robot.urdf touched.csv --seen-on tool0 --units joints=deg,position=mm
    nmm calibrate my_robot.urdf touched.mcap --seen-on tool0 --reference /tracker/ball

    Writes calibration.yaml, which nmm.load(..., calibration=) and --calibration take, a summary, figures and,
    of a URDF, the corrected file. Exit status 1 where a part of the logs that was not learned from is
    followed worse than before.
    """
    from nmm.model.robots.loading import load
    from nmm.plugins.robot.calibration import report
    from nmm.plugins.robot.calibration.calibration import calibrate as learn
    from nmm.views.folders.whole import check_folder

    texts, keywords, figures = arguments_of(arguments), loading.keywords(), drawn.options()
    whole = {"missing_meshes": "skip", **keywords}
    loaded = load(robot, arguments=texts, **whole)
    folder = out or Path("runs") / f"{loaded.name}-calibration"
    check_folder(folder, report.is_calibration)
    held = _held(hold)
    result: Calibration | ArmCalibration
    if of_arm.asked:
        if wrapped is not None:
            raise InputError("it is of drives, and --seen-on of an arm", where="--wrapped")
        _expect_used(logs, of_tables, of_bags)
        try:
            postures = of_arm.read(logs, loaded, reference, of_tables.keywords(), of_bags.keywords())
        except InputError as error:
            where = re.sub(r": (on|by)\b", r": --seen-\1", error.where)
            where = re.sub(r": (reference|odometry|tf|map|odom|base)\b", r": --\1", where)
            raise error.placed(where, expected=_as_options(error.expected)) from None
        with progress(f"{loaded.name}, {counted(sum(map(len, postures)), 'posture')}") as tell:
            result, read = of_arm.learn(loaded, postures, held, tell), []
    else:
        read = [
            _log(file, seen, loaded, of_tables, of_bags, _wrapped(wrapped))
            for file, seen in zip(logs, one_each(reference, logs, "--reference"), strict=True)
        ]
        _expect_used(logs, of_tables, of_bags)
        with progress(f"{loaded.name}, {counted(len(read), 'drive')}") as tell:
            result = learn(loaded, read, held, tell)
    whole.pop("calibration", None)
    patch, why = report.patch_of(result, **whole)
    with shielded():
        report.save(result, folder, patch=patch, figures=figures)
    if as_json:
        print(json.dumps(report.summary(result, patch) | {"folder": str(folder)}, indent=1), flush=True)
    else:
        _show(result, folder, patch, why, report.umbmark_rows(loaded, read))
    return FAILED if result.held_out is not None and result.held_out.verdict == "worse" else OK


def _show(
    result: Calibration | ArmCalibration,
    folder: Path,
    patch: DescriptionPatch | None,
    why: str,
    more: list[list[str]],
) -> None:
    from nmm.plugins.robot.calibration import report

    for finding in result.findings:
        warn(str(finding))
    columns = ["number", "before", "after", "±", "unit", ""]
    title = f"{result.robot.name} by {', '.join(result.logs)}"
    show_table(columns, report.number_rows(result), title=title, numeric=columns[1:4])
    show_text()
    rows = [*report.rest_rows(result), *more, ["files in", str(folder)]]
    said = str(patch).splitlines() if patch is not None else [why]
    rows += [["in the robot's file" if not i else "", line] for i, line in enumerate(said)]
    show_table(["", ""], rows)


def _log(
    file: str,
    reference: str | None,
    robot: Robot,
    of_tables: TableOptions,
    of_bags: LogOptions,
    wrapped: dict[str, Any],
) -> DriveLog:
    """The log of a file; what reading it found is told."""
    from nmm.plugins.robot.calibration.drive_log import DriveLog

    read: Callable[[], DriveLog]
    if is_bag(file):
        if reference == CLOSED:
            raise InputError("of a bag", where="--reference closed", expected="a topic, or tf")
        seen = {} if reference is None else {"reference": reference}

        def read() -> DriveLog:
            return DriveLog.from_bag(file, robot, **seen, **of_bags.keywords(), **wrapped)
    else:
        ends = CLOSED if reference == CLOSED else None
        table = None if reference == CLOSED else reference

        def read() -> DriveLog:
            return DriveLog.from_csv(file, robot, table, ends=ends, **of_tables.keywords(), **wrapped)

    with telling(Path(file).name):
        try:
            return read()
        except InputError as error:
            raise error.placed(error.where, expected=_as_options(error.expected)) from None


def _as_options(expected: str) -> str:
    """What a function's parameter should have been, as options: "--units wheels=rad"."""

    def as_option(result: re.Match[str]) -> str:
        pairs = result["pairs"].replace("'", "").replace(": ", "=").replace(", ", ",")
        return f"--{result['name']} {pairs}".replace("=True", "").replace("=False", "=no")

    text = re.sub(r"\b(?P<name>units|columns|wrapped)=\{(?P<pairs>[^}]*)\}", as_option, expected)
    text = text.replace("ends='closed'", "--reference closed")
    return re.sub(r"\b(reference|map|odom|odometry|wrapped|prefix)=(?=[ ,;]|$)", r"--\1", text)


def _expect_used(logs: Sequence[str], of_tables: TableOptions, of_bags: LogOptions) -> None:
    """`InputError` for an option that no log is of."""
    bags = [is_bag(file) for file in logs]
    for none, options, what in (
        (all(bags), of_tables.keywords(), "is of tables, and all logs are bags"),
        (not any(bags), of_bags.keywords(), "is of bags, and all logs are tables"),
    ):
        if none and options:
            name = next(iter(options)).replace("_", "-")
            raise InputError(f"it {what}", where=f"--{name}")


def _held(texts: Sequence[str] | None) -> dict[str, float | None]:
    """What `--hold` says, as `nmm.calibrate` takes it."""
    from nmm.scenario.numbers import evaluate

    held: dict[str, float | None] = {}
    for text in texts or ():
        name, equals, value = (part.strip() for part in text.partition("="))
        expect(name and (value or not equals), "--hold", "NAME or NAME=VALUE, as in track=0.5", text)
        if name in held:
            raise InputError(f"{name} is given twice", where="--hold")
        try:
            held[name] = evaluate(value) if equals else None
        except InputError as error:
            raise error.at(f"--hold: {name}") from None
    return held


def _wrapped(text: str | None) -> dict[str, Any]:
    """`wrapped` of `DriveLog`; nothing where it is found."""
    if text is None:
        return {}
    if text in ("all", "none"):
        return {"wrapped": text == "all"}
    told: dict[str, Any] = {}
    for part in names_of(text, "--wrapped", "NAME, NAME=COUNT, NAME=no, all or none"):
        name, equals, count = (word.strip() for word in part.partition("="))
        try:
            told[name] = not equals or (False if count == "no" else float(count))
        except ValueError:
            raise InputError(where=f"--wrapped: {name}", expected="a number, or no", got=count) from None
    return {"wrapped": told}


def _texts(text: str | None, where: str, expected: str) -> dict[str, str] | None:
    if text is None:
        return None
    told: dict[str, str] = {}
    for part in names_of(text, where, expected):
        name, equals, value = (word.strip() for word in part.partition("="))
        expect(name and equals and value, where, expected, part)
        if name in told:
            raise InputError(f"{name} is given twice", where=where)
        told[name] = value
    return told
