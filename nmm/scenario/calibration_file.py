"""calibration.yaml: the numbers of one robot as they were learned, which `nmm.load(calibration=)` takes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import date as calendar
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import yaml
from pydantic import BeforeValidator, Field, ValidationError

from nmm.base.arrays import scalar, vector
from nmm.base.errors import InputError, expect_kind, expect_known
from nmm.base.files import replaceable, whole_file, written_at
from nmm.model.robots.numbers import RobotNumber, with_numbers
from nmm.model.robots.robot import Robot
from nmm.scenario.document import Document, document_in
from nmm.scenario.keys import KeyedError, KeyedPart, as_written, first_error
from nmm.scenario.numbers import Number
from nmm.scenario.plain_data import plain

#: What the file calls itself.
FORMAT = "nmm calibration 1"
LONGEST = 1_000_000  # bytes
#: By so small a share a file's nominal may be off the robot's.
CLOSE = 1e-6


@dataclass(frozen=True)
class Calibrated:
    """A number of a robot that was learned.

    Attributes
    ----------
    nominal : what the robot's file says; value : what it is, m, rad or 1
    deviation : standard deviation of the value, in its unit; NaN where it is not known

    Examples
    --------
    >>> nmm.Calibrated(nominal=0.5, value=0.56, deviation=0.004).value
    0.56
    """

    nominal: float
    value: float
    deviation: float = math.nan


@dataclass(frozen=True)
class CalibrationFile:
    """What calibration.yaml holds: a robot's numbers, and what was measured beside them.

    Attributes
    ----------
    robot : its name; platform : the kind
    numbers : by name (`nmm.robot_numbers`)
    measured : what else was learned, plain data: where a reference is mounted, delays, noise, residuals
    date : of the calibration, YYYY-MM-DD; logs : names of the files, without folders
    places : where the robot's file has the arm's joints and the frames whose numbers these are
        (`Robot.file_places`): their nominal numbers are those of every robot

    Raises
    ------
    InputError : numbers that are not finite, a deviation below zero

    Examples
    --------
    >>> robot = nmm.load("differential_base")
    >>> learned = nmm.CalibrationFile.of(robot, {"track": 0.56}, {"track": 0.004}, date="2026-03-01")
    >>> learned.numbers["track"]
    Calibrated(nominal=0.5, value=0.56, deviation=0.004)
    >>> learned.applied(robot).platform.track
    0.56
    """

    robot: str
    platform: str
    numbers: Mapping[str, Calibrated]
    measured: Mapping[str, Any] = field(default_factory=dict)
    date: str = ""
    logs: tuple[str, ...] = ()
    places: Mapping[str, tuple[float, ...]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name, number in self.numbers.items():
            where = f"calibration of {self.robot}: {name}"
            expect_kind(number, Calibrated, where, "a nmm.Calibrated")
            scalar(number.nominal, f"{where}: nominal")
            scalar(number.value, f"{where}: value")
            if not math.isnan(number.deviation):
                scalar(number.deviation, f"{where}: deviation", least=0.0)
        for name, place in self.places.items():
            vector(place, 9, f"calibration of {self.robot}: places: {name}")

    @classmethod
    def of(
        cls,
        robot: Robot,
        values: Mapping[str, float],
        deviations: Mapping[str, float] | None = None,
        *,
        measured: Mapping[str, Any] | None = None,
        date: str | None = None,
        logs: Sequence[str | Path] = (),
    ) -> Self:
        """That of a robot's numbers.

        Parameters
        ----------
        robot : whose; numbers that it has changed already count from its file's
        values, deviations : by name; those that are not named stay, or have none
        measured : plain data (numbers, arrays, texts, lists and mappings by name)
        date : today when not given
        logs : files; their names are kept

        Raises
        ------
        InputError : as `nmm.with_numbers`; the deviation of a number without a value; measured data that is
            not plain
        """
        numbers = with_numbers(robot, values).numbers_named(values)
        spread = {} if deviations is None else deviations
        for name in spread:
            expect_known("number", name, values, "deviations")
        learned = {
            name: Calibrated(
                numbers[name].nominal,
                scalar(values[name], name),
                scalar(spread[name], f"deviation of {name}", least=0.0) if name in spread else math.nan,
            )
            for name in numbers
            if name in values
        }
        return cls(
            robot.name,
            robot.platform.name,
            learned,
            plain(measured or {}, "measured"),
            calendar.today().isoformat() if date is None else date,
            tuple(Path(log).name for log in logs),
            robot.file_places(dict.fromkeys(numbers[name].of for name in learned if _placed(numbers[name]))),
        )

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read one.

        Raises
        ------
        InputError : no such file, no YAML, a missing or unknown key, what is no number: with file and line
        """
        document = document_in(path, LONGEST)
        try:
            part = _FilePart.model_validate(document.data)
        except ValidationError as error:
            raise _located(document, first_error(error, document.data)) from None
        numbers = {name: item.made() for name, item in part.numbers.items()}
        try:
            measured = plain(part.measured, "measured")
        except InputError as error:
            raise _located(document, KeyedError.of(("measured",), error)) from None
        places = {name: tuple(place) for name, place in part.places.items()}
        try:
            return cls(part.robot, part.platform, numbers, measured, part.date, tuple(part.logs), places)
        except InputError as error:
            raise error.at(path) from None

    def save(self, path: str | Path) -> Path:
        """Write it, whole or not at all.

        Raises
        ------
        InputError : a folder that is not there, or that may not be written
        """
        file = Path(path)
        data: dict[str, Any] = {"format": FORMAT, "robot": self.robot, "platform": self.platform}
        data |= {"date": self.date} if self.date else {}
        data |= {"logs": [*self.logs]} if self.logs else {}
        data["numbers"] = {name: _told(number) for name, number in self.numbers.items()}
        if self.places:
            data["places"] = {name: [float(part) for part in place] for name, place in self.places.items()}
        if self.measured:
            data["measured"] = plain(self.measured, "measured")
        text = yaml.safe_dump(data, sort_keys=False, allow_unicode=True, default_flow_style=None, width=110)
        with written_at(file), whole_file(replaceable(file)) as temporary:
            temporary.write_text(text, encoding="utf-8")
        return file

    def applied(self, robot: Robot, where: str = "calibration") -> Robot:
        """The robot with these numbers.

        Raises
        ------
        InputError : it is another robot's: of another kind of platform, without one of the numbers, or with
            another nominal value (by more than a share of 1e-6), which is named with both
        """
        expect_kind(robot, Robot, "robot", "a Robot, as nmm.load gives it")
        own = robot.numbers_named(self.numbers)
        whose = f"it is that of another robot, {self.robot}"
        if self.robot == robot.name:
            whose = f"it is that of another {self.robot}"
        if robot.platform.name != self.platform:
            expected = f"a platform of kind {robot.platform.name}, as {robot.name} has"
            raise InputError(whose, where=f"{where}: platform", expected=expected, got=self.platform)
        for name, number in self.numbers.items():
            if name not in own:
                what = f"{whose}: {robot.name} has no {name}"
                raise InputError(what, where=where, got=name, available=[*own])
            nominal = own[name].nominal
            if abs(number.nominal - nominal) > CLOSE * max(abs(number.nominal), abs(nominal)):
                expected = f"a nominal {name} of {_of_unit(nominal, own[name])}, as {robot.name} has"
                got = _of_unit(number.nominal, own[name])
                raise InputError(f"{whose}, or its file has changed", where=where, expected=expected, got=got)
        for name, apart in robot.apart_in_file(self.places).items():
            if apart > CLOSE:
                raise InputError(f"{whose}, or its file has changed: {name} is elsewhere in it", where=where)
        try:
            return with_numbers(robot, {name: number.value for name, number in self.numbers.items()})
        except InputError as error:
            raise error.at(where) from None


def calibrated(robot: Robot, calibration: object) -> Robot:
    """The robot with a calibration: a file, or what has `applied(robot)`; `InputError` as of these."""
    if isinstance(calibration, str | Path):
        return CalibrationFile.load(calibration).applied(robot, str(calibration))
    applied = getattr(calibration, "applied", None)
    if not callable(applied):
        expected = "a file, a CalibrationFile or a Calibration"
        raise InputError(where="calibration", expected=expected, got=calibration)
    made: Robot = applied(robot)
    return made


def _text(value: object) -> str:
    if not isinstance(value, str):
        raise InputError(expected="a text", got=value)
    return value


Text = Annotated[str, BeforeValidator(_text)]


class _NumberPart(KeyedPart):
    """A number."""

    nominal: Number = Field(description="what the robot's file says")
    value: Number = Field(description="what it is")
    deviation: Annotated[Number, Field(ge=0.0)] | None = Field(None, description="of the value")

    def made(self) -> Calibrated:
        return Calibrated(self.nominal, self.value, math.nan if self.deviation is None else self.deviation)


class _FilePart(KeyedPart):
    """The file."""

    format: Literal["nmm calibration 1"]
    robot: Text
    platform: Text
    date: Text = ""
    logs: list[Text] = Field(default_factory=list)
    numbers: dict[str, _NumberPart]
    places: dict[str, list[Number]] = Field(default_factory=dict)
    measured: dict[str, Any] = Field(default_factory=dict)


def _located(document: Document, error: KeyedError) -> InputError:
    return error.at(document.where(as_written(error.place, document.data)), InputError)


def _told(number: Calibrated) -> dict[str, float]:
    told = {"nominal": float(number.nominal), "value": float(number.value)}
    return told if math.isnan(number.deviation) else {**told, "deviation": float(number.deviation)}


def _placed(number: RobotNumber) -> bool:
    """Whether it is that of a joint or frame whose place in the file counts."""
    return number.kind in ("offset", "ratio", "origin")


def _of_unit(value: float, number: RobotNumber) -> str:
    return f"{value:.9g}" + ("" if number.unit == "1" else f" {number.unit}")
