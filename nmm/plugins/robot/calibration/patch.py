"""A robot's file with other numbers: a URDF's corrected text and its diff, or a xacro file's arguments."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from nmm.base.errors import InputError, expect_kind, few
from nmm.base.files import replaceable, whole_file, written_at
from nmm.model.robots.loading import load
from nmm.model.robots.loading.description import describe
from nmm.model.robots.loading.source import source_path
from nmm.model.robots.loading.xml_tree import trying
from nmm.model.robots.numbers import numbers_for, robot_numbers, with_numbers
from nmm.model.robots.origins import placed_by
from nmm.model.robots.robot import Robot
from nmm.plugins.robot.calibration.arm_patch import arm_numbers, misplaced
from nmm.plugins.robot.calibration.expressible import UNSAID, expressible, missed, same
from nmm.plugins.robot.calibration.text_edits import unified_diff
from nmm.plugins.robot.calibration.urdf_patch import UrdfPatch
from nmm.plugins.robot.calibration.xacro_patch import Load, held_by, solved_arguments
from nmm.scenario.calibration_file import Calibrated, CalibrationFile

#: So many numbers that stay for one reason are told one by one.
EACH = 4


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
    written : numbers of arms and frames that the corrected file has in origins and axes: by it they are 0 (a
        ratio 1), and coordinates are what encoders read
    wanted : what was asked for, and what the file's other numbers were where they cannot stay
    at : where the corrected file has the arm's joints and frames (`Robot.file_places`)

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
    written: tuple[str, ...] = ()
    wanted: Mapping[str, float] = field(default_factory=dict)
    at: Mapping[str, tuple[float, ...]] = field(default_factory=dict)

    def __str__(self) -> str:
        """What is to be done, a line each."""
        lines = [f"{self.file.name}: {len(self.diff.splitlines())} lines of a diff"] if self.diff else []
        if self.arguments:
            texts = " ".join(f"{name}:={text}" for name, text in self.arguments.items())
            lines.append(f"{self.file.name}: arguments {texts}")
        lines += [f"{name}: {place}" for name, place in self.places.items()]
        reasons = dict.fromkeys(self.left.values())
        for why in reasons:
            names = [name for name, own in self.left.items() if own == why]
            if len(names) > EACH:
                lines.append(f"{len(names)} numbers stay in calibration.yaml: {why}: {few(names, shown=3)}")
                continue
            lines += [f"{name} = {self.wanted[name]:.6g} stays in calibration.yaml: {why}" for name in names]
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
            if name in self.numbers and name not in self.written and not same(self.numbers[name], value)
        }
        return replace(
            learned, numbers=numbers, places={n: at for n, at in self.at.items() if _of(n, numbers)}
        )


def description_patch(
    robot: Robot, values: Mapping[str, float] | None = None, **loading: Any
) -> DescriptionPatch:
    """What a robot's file has to say for the robot to have other numbers.

    A URDF is edited at its attributes: radii of wheels' shapes, and the height of their centres where that is
    the radius; places of wheels, steering joints and hitches; origins of an arm's joints and of frames, which
    offsets turn, too, and axes, which a ratio of -1 turns. Of a xacro file the arguments are found that give
    the numbers, by loading it with each a little changed, or where it holds one. What was found is loaded.

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
    goal = {name: number.nominal for name, number in numbers_for(robot, asked).items()}
    goal |= {
        name: number.value
        for name, number in numbers_for(with_numbers(base, asked), asked).items()
        if name in asked
    }
    writable, left = expressible(base, goal, described.expanded)
    if described.expanded:
        return _of_xacro(file, base, goal, writable, left, made, robot.arguments, asked)
    content = file.read_bytes()
    edited, reached = _edited(base, writable, content, file, made)
    left |= edited.left
    numbers = {name: number.value for name, number in numbers_for(reached, goal).items()}
    left |= missed(goal, numbers, {*left, *edited.written}, "file gives")
    text = edited.text.edited()
    changed = text != content
    return DescriptionPatch(
        file,
        text.decode("utf-8") if changed else "",
        unified_diff(file.name, content, text),
        numbers=numbers,
        left=left,
        written=edited.written,
        wanted={name: goal[name] for name in (*asked, *left)},
        at=_places(reached, goal),
    )


def _places(robot: Robot, names: Collection[str]) -> dict[str, tuple[float, ...]]:
    """Where its file has the joints and frames of numbers."""
    known = numbers_for(robot, names)
    return robot.file_places(dict.fromkeys(arm_numbers(robot, known).values()))


def _of(place: str, numbers: Collection[str]) -> bool:
    """Whether a joint or frame has one of these numbers."""
    return any(name in (f"offset.{place}", f"ratio.{place}") or placed_by(name) == place for name in numbers)


def _edited(
    base: Robot, writable: Mapping[str, float], content: bytes, file: Path, made: Load
) -> tuple[UrdfPatch, Robot]:
    """The edits, and the robot of the corrected file; the arm's numbers are left where that does not have its
    joints as they have them."""
    edited = UrdfPatch(base, writable, content)
    with trying({file: edited.text.edited()}):
        reached = made({})
    wrong = misplaced(edited.nodes, edited.changed, reached) if edited.written else ""
    if not wrong:
        return edited, reached
    lost = dict.fromkeys(edited.written, f"the corrected file does not have {wrong} where it is to be")
    plain = {name: value for name, value in writable.items() if name not in lost}
    rest, reached = _edited(base, plain, content, file, made)
    rest.left |= {**edited.left, **lost}
    return rest, reached


def _check_same(robot: Robot, base: Robot) -> None:
    """`InputError` where the file, as it is loaded here, is that of a robot with other numbers."""
    own = robot_numbers(robot)
    other = numbers_for(base, own)
    apart = [n for n, number in own.items() if n not in other or not same(number.nominal, other[n].value)]
    if apart or own.keys() != other.keys():
        name = (apart or [*(other.keys() - own.keys())])[0]
        expected = "the arguments that nmm.load was given: platform=, wheels=, axle=, steer=, lock="
        raise InputError(f"its file gives another {name}", where=robot.name, expected=expected)


def _of_xacro(
    file: Path,
    base: Robot,
    goal: Mapping[str, float],
    writable: dict[str, float],
    left: Mapping[str, str],
    made: Load,
    arguments: Mapping[str, str],
    asked: Mapping[str, float],
) -> DescriptionPatch:
    own = robot_numbers(base)
    before = {name: number.value for name, number in own.items() if number.kind not in (*UNSAID, "origin")}
    wanted = {name: goal[name] for name in before if name in asked} | writable
    solved, moved = solved_arguments(made, arguments, before, wanted)
    corrected = made({**arguments, **solved})
    found = numbers_for(corrected, goal)
    reached = {name: number.value for name, number in found.items()}
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
    why |= missed(goal, reached, why, "arguments give")
    wanted = {name: goal[name] for name in (*asked, *why)}
    return DescriptionPatch(
        file,
        "",
        "",
        arguments=solved,
        places=places,
        numbers=reached,
        left=why,
        wanted=wanted,
        at=_places(corrected, goal),
    )
