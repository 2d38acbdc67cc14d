"""A robot's file with other numbers: a URDF's corrected text and its diff, or a xacro file's arguments."""

from __future__ import annotations

import math
import statistics
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from nmm.base.errors import InputError, expect_kind
from nmm.base.files import replaceable, whole_file, written_at
from nmm.model.platforms.wheel_layout import NEAR
from nmm.model.robots.loading import load
from nmm.model.robots.loading.description import describe
from nmm.model.robots.loading.source import source_path
from nmm.model.robots.loading.xml_tree import trying
from nmm.model.robots.numbers import OF_SPEEDS, main_wheels, robot_numbers, with_numbers
from nmm.model.robots.robot import Robot
from nmm.plugins.robot.calibration.text_edits import unified_diff
from nmm.plugins.robot.calibration.urdf_patch import UrdfPatch
from nmm.plugins.robot.calibration.xacro_patch import held_by, solved_arguments
from nmm.scenario.calibration_file import Calibrated, CalibrationFile

#: A number is another's where they differ by a smaller share.
CLOSE = 1e-6
#: Why numbers stay in calibration.yaml, by their kinds.
_UNSAID = {
    "offset": "URDF has no word for a joint's offset",
    "ratio": "URDF has no word for a joint's ratio",
    "centre": "URDF has no word for where wheels slide: the ground makes these centres",
}


@dataclass(frozen=True)
class DescriptionPatch:
    """What a robot's file has to say for its robot to have other numbers. Made by `description_patch`.

    Attributes
    ----------
    file : the robot's file
    text : the corrected text; "" of a xacro file, and where nothing is to change
    diff : both texts beside each other, as `patch -p1` takes it
    arguments : of a xacro file, those to give, by name
    places : where a xacro file holds numbers that no argument gives, by number
    numbers : what the robot of the corrected file has, by name, m, rad and 1
    left : the numbers that the file cannot say, each with the reason: they stay in calibration.yaml
    wanted : what was asked for, and what the file's other numbers were where they cannot stay

    Examples
    --------
    >>> patch = nmm.description_patch(nmm.load("differential_base"), {"track": 0.56})
    >>> patch.file.name, dict(patch.arguments), dict(patch.left)
    ('differential_base.urdf.xacro', {'track': '0.56'}, {})
    """

    file: Path
    text: str
    diff: str
    arguments: Mapping[str, str] = field(default_factory=dict)
    places: Mapping[str, str] = field(default_factory=dict)
    numbers: Mapping[str, float] = field(default_factory=dict)
    left: Mapping[str, str] = field(default_factory=dict)
    wanted: Mapping[str, float] = field(default_factory=dict)

    def __str__(self) -> str:
        """What is to be done, a line each."""
        lines = [f"{self.file.name}: {len(self.diff.splitlines())} lines of a diff"] if self.diff else []
        if self.arguments:
            texts = " ".join(f"{name}:={text}" for name, text in self.arguments.items())
            lines.append(f"{self.file.name}: arguments {texts}")
        lines += [f"{name}: {place}" for name, place in self.places.items()]
        for name, why in self.left.items():
            lines.append(f"{name} = {self.wanted[name]:.6g} stays in calibration.yaml: {why}")
        return "\n".join(lines or [f"{self.file.name}: nothing is to change"])

    def save(self, folder: str | Path) -> list[Path]:
        """Write the corrected file, under its name, and its diff into a folder; returns them: none where
        there is no text.

        Raises
        ------
        InputError : a folder that is not there or may not be written, or that of the robot's file
        """
        if not self.text:
            return []
        place = Path(folder)
        if place.resolve() == self.file.resolve().parent:
            raise InputError("the robot's own file is there", where=place, expected="another folder")
        contents = {place / self.file.name: self.text, place / f"{self.file.name}.diff": self.diff}
        for path, text in contents.items():
            with written_at(path), whole_file(replaceable(path)) as temporary:
                temporary.write_bytes(text.encode())
        return [*contents]

    def calibration(self, learned: CalibrationFile) -> CalibrationFile:
        """The calibration of the robot of the corrected file: what that does not say, by its nominal
        numbers."""
        values = {**self.wanted, **{name: number.value for name, number in learned.numbers.items()}}
        spread = {name: number.deviation for name, number in learned.numbers.items()}
        numbers = {
            name: Calibrated(self.numbers[name], value, spread.get(name, math.nan))
            for name, value in values.items()
            if name in self.numbers and not _same(self.numbers[name], value)
        }
        return replace(learned, numbers=numbers)


def description_patch(
    robot: Robot, values: Mapping[str, float] | None = None, **loading: Any
) -> DescriptionPatch:
    """What a robot's file has to say for the robot to have other numbers.

    A URDF is edited at its attributes: radii of wheels' shapes, and the height of their centres where that is
    the radius; places of wheels, steering joints and hitches. Of a xacro file the arguments are found that
    give the numbers, by loading it with each a little changed, or where it holds a number. What was found is
    loaded, and says which numbers it has.

    Parameters
    ----------
    robot : as `nmm.load` made it from a file
    values : by name (`nmm.robot_numbers`), m, rad and 1; what the robot has changed (`changed_numbers`) when
        not given
    loading : as `nmm.load` was given it besides the file and its arguments: platform, axle, wheels, ...

    Raises
    ------
    InputError : a robot that is of no URDF or xacro file, or is loaded otherwise; values as of
        `nmm.with_numbers`

    Examples
    --------
    >>> print(nmm.description_patch(nmm.load("car_base"), {"wheelbase": 0.72, "offset.steering": 0.01}))
    car_base.urdf.xacro: arguments wheelbase:=0.72
    offset.steering = 0.01 stays in calibration.yaml: URDF has no word for a joint's offset
    """
    expect_kind(robot, Robot, "robot", "a Robot, as nmm.load gives it")
    asked = robot.changed_numbers if values is None else values
    settings = {"platform": robot.platform.name, "missing_meshes": "skip", **loading}
    folders = settings.get("package_dirs", ())
    folders = [folders] if isinstance(folders, str | Path) else folders
    try:
        file = source_path(robot.source, folders)
        described = describe(file, robot.arguments or None, folders)
    except InputError as error:
        raise InputError(f"it is of no file that can be corrected: {error}", where=robot.name) from None
    if described.mjcf is not None:
        raise InputError("MJCF is not corrected", where=robot.name, expected="a URDF or a xacro file")

    def made(arguments: Mapping[str, str]) -> Robot:
        return load(file, arguments=dict(arguments) or None, **settings)

    base = made(robot.arguments)
    _check_same(robot, base)
    goal = {name: number.nominal for name, number in robot_numbers(robot).items()}
    goal |= {
        name: number.value
        for name, number in robot_numbers(with_numbers(base, asked)).items()
        if name in asked
    }
    writable, left = _expressible(base, goal)
    if described.expanded:
        return _of_xacro(file, base, goal, writable, left, made, robot.arguments, asked)
    content = file.read_bytes()
    edited = UrdfPatch(base, writable, content)
    left |= edited.left
    text = edited.text.edited()
    with trying({file: text}):
        reached = {name: number.value for name, number in robot_numbers(made({})).items()}
    left |= _missed(goal, reached, left, "file gives")
    changed = text != content
    return DescriptionPatch(
        file,
        text.decode("utf-8") if changed else "",
        unified_diff(file.name, content, text),
        numbers=reached,
        left=left,
        wanted={name: goal[name] for name in (*asked, *left)},
    )


def _check_same(robot: Robot, base: Robot) -> None:
    """`InputError` where the file, as it is loaded here, is that of a robot with other numbers."""
    own, other = robot_numbers(robot), robot_numbers(base)
    apart = [n for n, number in own.items() if n not in other or not _same(number.nominal, other[n].value)]
    if apart or own.keys() != other.keys():
        name = (apart or [*(other.keys() - own.keys())])[0]
        expected = "the arguments that nmm.load was given: platform=, wheels=, axle=, steer=, lock="
        raise InputError(f"its file gives another {name}", where=robot.name, expected=expected)


def _expressible(base: Robot, goal: Mapping[str, float]) -> tuple[dict[str, float], dict[str, str]]:
    """The numbers that a file could say, and why it cannot say the others; of radii that differ too much for
    the platform, it says their mean."""
    numbers, left = robot_numbers(base), dict[str, str]()
    writable = {name: value for name, value in goal.items() if value != numbers[name].value}
    for name in [*writable]:
        if numbers[name].kind in _UNSAID:
            left[name] = _UNSAID[numbers[name].kind]
            del writable[name]
        elif name == "radius":
            left[name] = "the file shows no wheels"
            del writable[name]
    names = [f"radius.{wheel.joint}" for wheel in main_wheels(base)]
    radii = [goal[name] for name in names]
    if isinstance(base.platform, OF_SPEEDS) and radii and max(radii) - min(radii) > NEAR:
        mean = statistics.mean(radii)
        for name in names:
            writable[name] = mean
            left[name] = (
                f"a {base.platform.name} platform has one radius: the file gets the mean, {mean:.6g} m, and "
                "the difference stays"
            )
    return writable, left


def _missed(
    goal: Mapping[str, float], reached: Mapping[str, float], left: Mapping[str, str], gives: str
) -> dict[str, str]:
    """The numbers that the corrected file does not give, in spite of all."""
    return {
        name: f"the {gives} {reached[name]:.6g}"
        for name, value in goal.items()
        if name in reached and name not in left and not _same(reached[name], value)
    }


def _of_xacro(
    file: Path,
    base: Robot,
    goal: Mapping[str, float],
    writable: dict[str, float],
    left: Mapping[str, str],
    made: Any,
    arguments: Mapping[str, str],
    asked: Mapping[str, float],
) -> DescriptionPatch:
    own = robot_numbers(base)
    before = {name: number.value for name, number in own.items() if number.kind not in _UNSAID}
    wanted = {name: goal[name] for name in before if name in asked} | writable
    solved, moved = solved_arguments(made, arguments, before, wanted)
    reached = {name: number.value for name, number in robot_numbers(made({**arguments, **solved})).items()}
    with trying({}) as tried:
        made(arguments)
    files = list(dict.fromkeys(tried.read))
    places, why = dict[str, str](), dict(left)
    for name, value in writable.items():
        if name in moved:
            continue
        place = held_by(lambda: made(arguments), files, name, before, value - before[name])
        places[name] = place or "it is computed, by no argument and no number of its own"
        why[name] = "no argument gives it"
    why |= _missed(goal, reached, why, "arguments give")
    wanted = {name: goal[name] for name in (*asked, *why)}
    return DescriptionPatch(
        file, "", "", arguments=solved, places=places, numbers=reached, left=why, wanted=wanted
    )


def _same(one: float, other: float) -> bool:
    return abs(one - other) <= CLOSE * max(abs(one), abs(other))
