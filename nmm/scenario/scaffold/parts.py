"""Which robot a first scenario is about: its file as it is, or what its file holds on a base."""

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from nmm.base.bundled import bundled_robots
from nmm.base.errors import InputError, RobotError, expect
from nmm.base.files import named_folder
from nmm.model.robots.loading.provenance import PLATFORM_SOURCES, provenance_of
from nmm.model.robots.robot import Robot
from nmm.scenario.files import PACKAGE, with_files
from nmm.scenario.keys import first_error
from nmm.scenario.robot import MountedPart, RobotPart
from nmm.scenario.yaml_text import dotted

#: The base of an arm that comes without one: two driven wheels, with v and omega for inputs.
BASE = "differential_base"
_BASE_PART = {"source": BASE, "platform": "unicycle"}
#: Of a robot's keys those that are the arm's where there is one.
_ARMS = ("lock", "srdf", "missing_meshes")


@dataclass(frozen=True, eq=False)
class ChosenRobot:
    """A robot, the key `robot` of its scenario, and a line on where its platform comes from."""

    robot: Robot
    data: Mapping[str, Any]
    why: str


def chosen_robot(
    source: str,
    folder: Path,
    *,
    arm: str | None = None,
    at: str | None = None,
    **keys: Any,
) -> ChosenRobot:
    """The robot of a file, with an arm on it where one is named, or on a base where it has no wheels.

    source and arm are bundled names, paths or package://PACKAGE/PATH; paths become relative to the scenario's
    folder where they lie below it; `at` is the frame that carries the arm; keys are a robot's others
    (platform, lock, ...)."""
    options = {key: value for key, value in keys.items() if value not in (None, {}, [], ())}
    expect(at is None or arm is not None, "at", "an arm, whose place on the robot it is")
    if arm is not None:
        own = {key: value for key, value in options.items() if key in (*_ARMS, "package_dirs")}
        base = {key: value for key, value in options.items() if key not in _ARMS}
        data = _mounted(_part(source, folder, base), _part(arm, folder, own), at)
        robot, data = _loaded(data, folder)
        return ChosenRobot(robot, data, f"{robot.platform.name}, {_origin(robot)}")
    robot, data = _loaded(_part(source, folder, options), folder)
    if provenance_of(robot).platform != "default" or not any(
        note.code == "no_wheels" for note in robot.notes
    ):
        return ChosenRobot(robot, data, f"{robot.platform.name}, {_origin(robot)}{_why_kept(robot)}")
    if not robot.q_names[robot.platform.n_p :]:
        what = "has neither wheels nor movable joints: there is nothing to lead"
        raise InputError(what, where=source)
    own = {key: value for key, value in data.items() if key != "axle"}
    robot, data = _loaded(_mounted(_BASE_PART, own, None), folder)
    why = (
        f"{Path(source).name} has no wheels: it stands on the bundled {BASE}. Another base: nmm init BASE "
        "--arm FILE; none: --platform fixed; its root as a unicycle without wheels: --platform unicycle"
    )
    return ChosenRobot(robot, data, why)


def _why_kept(robot: Robot) -> str:
    """What the file has of wheels, where it is not told by them: nothing is put under these."""
    return "".join(f": {note}" for note in robot.notes if note.code in ("wheels_fixed", "radius_unknown"))


def _mounted(base: Mapping[str, Any], arm: Mapping[str, Any], at: str | None) -> dict[str, Any]:
    data = {"platform": dict(base), "arm": dict(arm)}
    return data if at is None else {**data, "at": at}


def _part(source: str, folder: Path, keys: Mapping[str, Any]) -> dict[str, Any]:
    part: dict[str, Any] = {"source": written_path(source, folder), **keys}
    for key in ("srdf", "calibration"):
        if key in part:
            part[key] = written_path(str(part[key]), folder)
    if "package_dirs" in part:
        named = [named_folder(str(entry)) for entry in part["package_dirs"]]
        part["package_dirs"] = [
            (f"{name}=" if name else "") + written_path(path, folder) for name, path in named
        ]
    return part


def written_path(file: str, folder: Path) -> str:
    """A path as the scenario has it: relative where the file lies below its folder, else absolute."""
    if file in bundled_robots() or file.startswith(PACKAGE) or not ("/" in file or "." in file):
        return file
    path = os.path.abspath(os.path.expanduser(file))
    inside = os.path.relpath(path, folder.absolute())
    return path if inside.startswith(os.pardir) else inside if os.sep in inside else f"./{inside}"


def _loaded(data: dict[str, Any], folder: Path) -> tuple[Robot, dict[str, Any]]:
    """The robot of a key `robot`, which gets `missing_meshes: skip` where the file's are missing."""
    try:
        return _built(data, folder), data
    except RobotError as error:
        skipping = {**data.get("arm", data), "missing_meshes": "skip"}
        without = {**data, "arm": skipping} if "arm" in data else skipping
        try:
            return _built(without, folder), without
        except RobotError:
            raise error from None


def _built(data: Mapping[str, Any], folder: Path) -> Robot:
    try:
        part = (MountedPart if "arm" in data else RobotPart).model_validate(data)
    except ValidationError as error:
        wrong = first_error(error, data)
        raise wrong.at(dotted(wrong.place), InputError) from None
    return with_files(part, lambda file, _: folder / file).build()


def _origin(robot: Robot) -> str:
    made = provenance_of(robot).platform
    return PLATFORM_SOURCES.get(made, "as asked for")
