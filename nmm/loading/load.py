"""`load`: a robot from a name, a file or a Pinocchio model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import pinocchio as pin

from nmm.bundled import bundled_robots
from nmm.errors import InputError, RobotError, unknown
from nmm.loading.chain import CHAIN
from nmm.loading.check import check
from nmm.loading.description import SUFFIXES, describe
from nmm.loading.models import Models, pinocchio_models, robot_models
from nmm.loading.text import printable
from nmm.loading.urdf_text import urdf_text
from nmm.platforms import Layout, Platform, Unicycle, platform_by_name
from nmm.robot import Robot


def load(
    source: str | Path | pin.Model,
    *,
    arguments: Mapping[str, object] | None = None,
    platform: Platform | str | None = None,
    package_dirs: Sequence[str | Path] = (),
    wheels: Sequence[str] | Mapping[str, float] | None = None,
    locked: Mapping[str, float] | None = None,
    name: str | None = None,
    visual_model: pin.GeometryModel | None = None,
    collision_model: pin.GeometryModel | None = None,
) -> Robot:
    """Load a mobile manipulator, or an arm that is put on a platform.

    The robot gets the coordinates x, y (m) and theta (rad, not wrapped) above its root link, which is the
    platform's reference point (REP-103: x forward, z up; on the ground, midway between the wheels).
    Continuous joints become one unbounded angle. Wheels that only roll are no coordinates.

    Parameters
    ----------
    source : a bundled robot's name, the path of a .urdf or .xacro file, or a Pinocchio model: of a fixed
        base, with a planar or free-flyer root joint (which is replaced), or with joints x, y, theta first
    arguments : values of the xacro file's arguments
    platform : the platform, or its name; a unicycle by default
    package_dirs : folders that are, or hold, the ROS packages that the file speaks of
    wheels : joints that only roll, or the radius (m) of each; `()` for none. By default those with "wheel"
        in the joint's or link's name, on the root link's body, with a level axis and no joint below them
    locked : joints to fix, and their values (rad or m)
    name : the robot's name; by default that of the file or model
    visual_model, collision_model : the shapes, with a Pinocchio model

    Returns
    -------
    Robot : with `notes` on what was done to the file

    Raises
    ------
    RobotError : unknown name, missing or malformed file; one line with the file and every cause
    InputError : the platform is none, or does not have the robot's coordinates

    Examples
    --------
    >>> load("unicycle_2r").q_names
    ('x', 'y', 'theta', 'q1', 'q2')
    """
    stated = _platform(platform)
    folders = [package_dirs] if isinstance(package_dirs, str | Path) else package_dirs
    shapes = {"visual_model": visual_model, "collision_model": collision_model}
    try:
        if locked is not None and not isinstance(locked, Mapping):
            raise RobotError(f"locked: expected a value for each joint's name, got {locked!r}")
        options = _Options(stated, wheels, locked or {}, name)
        if isinstance(source, pin.Model):
            if arguments or folders:
                raise RobotError("arguments and package_dirs are for files, the source is a pin.Model")
            return _from_model(source, shapes, options)
        if visual_model is not None or collision_model is not None:
            raise RobotError(f"{' and '.join(shapes)} are for a pin.Model, a file holds its own shapes")
        return _from_file(source, arguments, folders, options)
    except RobotError as error:
        # Names in files and of files may hold anything, a message is one line.
        raise RobotError(printable(str(error))) from None


@dataclass(frozen=True)
class _Options:
    """What `load` was asked for, of any source."""

    platform: Platform
    wheels: Sequence[str] | Mapping[str, float] | None
    locked: Mapping[str, float]
    name: str | None


def _from_file(
    source: str | Path,
    arguments: Mapping[str, object] | None,
    package_dirs: Sequence[str | Path],
    options: _Options,
) -> Robot:
    description = describe(_path(source), arguments, package_dirs)
    where, lines = str(source), not description.expanded
    checked = check(description.xml, where, description.packages.mesh, options.locked, lines)
    name = options.name or checked.name
    parts = pinocchio_models(urdf_text(checked, name), where)
    models = robot_models(*parts, where, _own(options), options.wheels, options.locked)
    return _robot(models, name, options.platform, where, description.arguments, description.notes)


def _from_model(
    source: pin.Model, shapes: Mapping[str, pin.GeometryModel | None], options: _Options
) -> Robot:
    where = f"pin.Model {source.name!r}" if source.name else "pin.Model"
    visual, collision = (_shapes(given, name, source) for name, given in shapes.items())
    models = robot_models(source, visual, collision, where, _own(options), options.wheels, options.locked)
    return _robot(models, options.name or source.name or "robot", options.platform, "pin.Model")


def _own(options: _Options) -> tuple[str, ...]:
    """The platform's own joints: its coordinates after x, y, theta."""
    return options.platform.coordinates[len(CHAIN) :]


def _robot(
    models: Models,
    name: str,
    platform: Platform,
    source: str,
    arguments: Mapping[str, str] | None = None,
    notes: tuple[str, ...] = (),
) -> Robot:
    models.model.name = models.display_model.name = name
    return Robot(
        name=name,
        model=models.model,
        collision_model=models.collision_model,
        display_model=models.display_model,
        visual_model=models.visual_model,
        platform=platform,
        wheels=models.wheels,
        source=source,
        arguments=dict(arguments or {}),
        notes=notes + models.notes,
    )


def _platform(platform: Platform | str | None) -> Platform:
    if platform is None:
        return Unicycle()
    if isinstance(platform, str):
        return platform_by_name(platform).fit(Layout(""))
    if not isinstance(platform, Platform):
        raise InputError(f"platform: expected a Platform or its name, got {platform!r}")
    return platform


def _path(source: str | Path) -> Path:
    """The file of a bundled name or of a path: a string without folder and suffix is a name."""
    if isinstance(source, Path):
        return source
    if not isinstance(source, str):
        raise RobotError(f"expected a robot's name, a path or a pin.Model, got {type(source).__name__}")
    if "/" in source or "\\" in source or source.lower().endswith(SUFFIXES):
        return Path(source)
    robots = bundled_robots()
    if source not in robots:
        raise RobotError(f"{unknown('robot', source, robots)}; or give the path of a .urdf or .xacro file")
    return robots[source]


def _shapes(shapes: pin.GeometryModel | None, name: str, model: pin.Model) -> pin.GeometryModel:
    if shapes is None:
        return pin.GeometryModel()
    if not isinstance(shapes, pin.GeometryModel):
        raise RobotError(f"{name}: expected a pin.GeometryModel, got {type(shapes).__name__}")
    for shape in shapes.geometryObjects:
        if shape.parentJoint >= model.njoints:
            raise RobotError(f"{name}: shape {shape.name!r} is on a joint that the model does not have")
    return shapes
