"""`load`: a robot from a name, a file or a Pinocchio model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import pinocchio as pin
from numpy.typing import ArrayLike

from nmm.base.errors import RobotError, expect_kind, one_or_several
from nmm.base.lazy_call import lazy_call
from nmm.base.trust import trusting
from nmm.model.platforms import Platform, platform_by_name
from nmm.model.robots.loading.draft import LoadOptions
from nmm.model.robots.loading.packages import PACKAGE, package_file
from nmm.model.robots.loading.passes import robot_from
from nmm.model.robots.loading.source import Source, read_file, read_model, source_path
from nmm.model.robots.loading.srdf import read_srdf, srdf_beside
from nmm.model.robots.loading.srdf_fitting import (
    passive_joints,
    semantics_of,
    unused,
    with_semantics,
    with_states,
)
from nmm.model.robots.robot import Robot


def load(
    source: str | Path | pin.Model,
    *,
    arguments: Mapping[str, object] | None = None,
    platform: Platform | str | None = None,
    package_dirs: Sequence[str | Path] = (),
    wheels: Sequence[str] | Mapping[str, float] | None = None,
    lock: Mapping[str, float] | None = None,
    axle: str | ArrayLike | None = None,
    steer: Sequence[str] = (),
    name: str | None = None,
    limits: Mapping[str, float] | None = None,
    missing_meshes: Literal["error", "skip"] = "error",
    visual_model: pin.GeometryModel | None = None,
    collision_model: pin.GeometryModel | None = None,
    srdf: str | Path | None = None,
    calibration: Any = None,
    trust: bool = False,
) -> Robot:
    """Load a mobile manipulator, or an arm that is put on a platform.

    The robot gets the coordinates x, y (m) and theta (rad, not wrapped) of the platform's reference point
    (REP-103: x forward, z up): midway between the wheels that neither steer nor swivel, or the root link
    where there are none, unless `axle` says where it is. A platform without coordinates is a fixed base.
    Continuous joints become one unbounded angle. Wheels that only roll are no coordinates; springs, rockers
    and legs between base and wheels stand still at zero (`lock` them elsewhere). A joint that follows another
    (<mimic>) stays a coordinate and has no input of its own; one that follows a locked joint stands still.

    Parameters
    ----------
    source : a bundled robot's name, the path of a .urdf, .xacro or .xml (MJCF) file, or
        package://PACKAGE/PATH; or a Pinocchio model: of a fixed base, with a planar or free-flyer root joint
        (which is replaced), or with joints x, y, theta first
    arguments : values of the xacro file's arguments
    platform : the platform, or its name, by which it is measured in the file; by default what the file
        declares, `<nmm platform="car"/>` below <robot>, or what its wheels allow (docs/platforms.md); a
        unicycle without wheels
    package_dirs : folders that are, or hold, the ROS packages that the file speaks of; "NAME=FOLDER" is that
        of the package NAME
    wheels : joints that only roll, or the radius (m) of each; `()` for none. By default those with a level
        axis and no joint below them (but rollers) that have "wheel" in the joint's or link's name, or turn
        without end on the base, are round and touch the ground; on a fixed base they stand still
    lock : joints to fix, and their values (rad or m), within their limits; joints that follow them are fixed
        with them, and one that is fixed itself follows none. A name with * (any letters) or ? (one) stands
        for all joints that match and that no other key names: {"*finger*": 0}
    axle : the platform's reference point in the root link: a frame, whose yaw counts too, or x, y(, z) in m,
        and its yaw in rad behind them
    steer : upright joints that steer; by default those called so, and those that end on both sides, right
        above their wheels, beside wheels that do not steer
    name : the robot's name; by default that of the file or model
    limits : largest absolute values of the platform's inputs, by name, in their units
    missing_meshes : "error", or "skip" to leave out, with a note, the shapes whose mesh is not there
    visual_model, collision_model : the shapes, with a Pinocchio model
    srdf : a file of postures, groups, joints without a motor and pairs of links that may touch (a xacro file
        gets `arguments`); by default the one beside the file or in ../srdf that has the file's name or the
        robot's
    calibration : what was learned of this very robot: a calibration.yaml, or a `CalibrationFile`; its wheels,
        lengths and steered joints are as measured then (`nmm.with_numbers`)
    trust : whether xacro files may run any Python, and read environment variables and files outside the
        robot's folder and packages; without, they are refused where they would

    Returns
    -------
    Robot : with `notes` on what was done to the file. Its collision pairs are the model's, or for a file all
        but those within one body or of two that a joint connects

    Raises
    ------
    RobotError : unknown name, missing or malformed file; one line with the file and every cause
    InputError : the platform is none, or does not have the robot's coordinates; a calibration of another
        robot, by the number that differs

    Examples
    --------
    >>> nmm.load("unicycle_2r").q_names
    ('x', 'y', 'theta', 'q1', 'q2')
    """
    if isinstance(platform, str):
        platform_by_name(platform)  # before anything is read
    elif platform is not None:
        expect_kind(platform, Platform, "platform", "a Platform or its name")
    folders = [package_dirs] if isinstance(package_dirs, str | Path) else package_dirs
    for value, kind, argument, expected in (
        (lock, Mapping, "lock", "a value for each joint's name"),
        (name, str, "name", "a string"),
        (limits, Mapping, "limits", "a value for each input's name"),
        (srdf, str | Path, "srdf", "a path"),
        (trust, bool, "trust", "True or False"),
    ):
        if value is not None and not isinstance(value, kind):
            raise RobotError(where=argument, expected=expected, got=value)
    if isinstance(srdf, str) and srdf.startswith(PACKAGE):
        srdf = package_file(srdf, folders)
    if isinstance(calibration, str) and calibration.startswith(PACKAGE):
        calibration = package_file(calibration, folders)
    options = LoadOptions(
        platform,
        wheels,
        lock or {},
        axle,
        one_or_several(steer, str, "steer", "names of joints"),
        name,
        limits or {},
    )
    if isinstance(source, pin.Model):
        if arguments or folders:
            raise RobotError("they are for files, not for a pin.Model", where="arguments, package_dirs")
        model = read_model(source, visual_model, collision_model)
        with trusting(trust):
            return _calibrated(_with_srdf(model, options, srdf, None, folders), calibration)
    if visual_model is not None or collision_model is not None:
        what = "they are for a pin.Model: a file holds its own shapes"
        raise RobotError(what, where="visual_model, collision_model")
    with trusting(trust):
        read = read_file(source, arguments, folders, options.lock, missing_meshes)
        robot = _with_srdf(read, options, srdf, source_path(source, folders), folders)
        return _calibrated(robot, calibration)


def _calibrated(robot: Robot, calibration: object) -> Robot:
    if calibration is None:
        return robot
    calibrated: Robot = lazy_call("nmm.scenario.calibration_file:calibrated")(robot, calibration)
    return calibrated


def _with_srdf(
    source: Source,
    options: LoadOptions,
    srdf: str | Path | None,
    file: Path | None,
    folders: Sequence[str | Path],
) -> Robot:
    """The robot with that SRDF (`RobotError` if it is none or has joints that the robot's file lacks), or
    with what fits of the one beside its file, and a note on what does not."""
    robot = _made(source, options)
    path = srdf_beside(file, source.name) if srdf is None and file is not None else srdf
    if path is None:
        return robot
    try:
        read = read_srdf(path, robot.arguments, folders)
        passive = passive_joints(read, robot)
        if passive:
            robot = _made(source, replace(options, lock={**passive, **options.lock}))
        semantics = semantics_of(read, robot, passive, strict=srdf is not None)
    except RobotError as error:
        if srdf is not None:
            raise
        semantics = unused(path, error)  # reading alone is strict
    return with_semantics(robot, semantics)


def _made(source: Source, options: LoadOptions) -> Robot:
    robot = robot_from(source, options)
    return robot if source.mjcf is None else with_states(robot, source.mjcf.states, source.mjcf.start)
