"""Where a robot's joints and fixed frames are otherwise than in its file, and the robot with them there."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from nmm.base.arrays import Array
from nmm.base.errors import InputError, no_such
from nmm.model.robots.joint_table import twist
from nmm.model.robots.robot import Robot, frame_index

#: What a placement has, in this order: m, and rad about fixed axes, as in a URDF's origin.
PARTS = ("x", "y", "z", "roll", "pitch", "yaw")
#: The number before the joint's or frame's name.
ORIGIN = "origin."
#: An axis is one of the joint's frame where it is nearer to it than this.
_ALONG = 1e-9
_SINGLE = ("JointModelR", "JointModelP")


class Unmoved(NamedTuple):
    """The models as they were before any origin was changed: where the file has joints, frames and shapes."""

    model: pin.Model
    display_model: pin.Model
    visual_model: pin.GeometryModel
    collision_model: pin.GeometryModel
    solid: pin.GeometryModel | None


def arm_joints(robot: Robot) -> tuple[str, ...]:
    """The coordinates of the arm that have encoders of their own: joints that turn or slide and follow no
    other."""
    following = {mimic.joint for mimic in robot.mimic_joints}
    model = robot.model
    return tuple(
        name
        for name in robot.q_names[robot.platform.n_p :]
        if name not in following and model.joints[model.getJointId(name)].shortname().startswith(_SINGLE)
    )


def joint_parts(robot: Robot, joint: str) -> tuple[str, ...]:
    """The parts of a joint's placement that its offset does not say: all but that about its axis (or along
    it, where it slides), where this is an axis of its frame."""
    model = robot.model
    moving = np.concatenate(twist(model.joints[model.getJointId(joint)], pin.neutral(model)))
    return tuple(part for part, by in zip(PARTS, np.abs(moving), strict=True) if by < 1.0 - _ALONG)


def placement(parts: Sequence[float]) -> pin.SE3:
    """Of x, y, z, m, and roll, pitch, yaw, rad (6,)."""
    return pin.SE3(pin.rpy.rpyToMatrix(*map(float, parts[3:])), np.array(parts[:3], dtype=np.float64))


def placed_by(name: object) -> str:
    """The joint or frame of an origin's number, by the number's name; "" of other numbers. Names of joints
    may hold dots."""
    if not isinstance(name, str) or not name.startswith(ORIGIN):
        return ""
    of, _, part = name.removeprefix(ORIGIN).rpartition(".")
    return of if part in PARTS else ""


def origin_parts(robot: Robot, name: str, parts: Sequence[str]) -> dict[str, tuple[float, str, str, str]]:
    """Value, unit, kind and joint or frame of some parts of an origin, by the numbers' names."""
    values = dict(zip(PARTS, robot.origins.get(name, (0.0,) * len(PARTS)), strict=True))
    return {
        f"{ORIGIN}{name}.{part}": (values[part], "m" if part in PARTS[:3] else "rad", "origin", name)
        for part in parts
    }


def listed_frames(robot: Robot, joints: Collection[str], frames: Sequence[str]) -> list[str]:
    """Frames whose origins are listed: those that are changed, and those asked for; no `joints`."""
    changed = (placed_by(name) for name in robot.nominal)
    known = [*dict.fromkeys(name for name in changed if name and name not in joints)]
    for frame in frames:
        if frame not in known and frame not in joints:
            check_frame(robot, frame, f"frames: {robot.name}")
            known.append(frame)
    return known


def file_places(robot: Robot, names: Collection[str]) -> dict[str, tuple[float, ...]]:
    """See `Robot.file_places`."""
    joints = arm_joints(robot)
    model = robot.model if robot.unmoved is None else robot.unmoved.model
    return {
        name: _file_place(model, name, name in joints)
        for name in names
        if name in joints or (name in robot.frames and name not in robot.q_names)
    }


def apart_in_file(robot: Robot, places: Mapping[str, Sequence[float]]) -> dict[str, float]:
    """See `Robot.apart_in_file`."""
    return {
        name: float(np.abs(_matrix(place) - _matrix(places[name])).max())
        for name, place in file_places(robot, places).items()
    }


def _matrix(place: Sequence[float]) -> Array:
    """Of a place as `file_places` has it, without angles (15,)."""
    return np.concatenate([placement(place[:6]).homogeneous[:3].ravel(), place[6:]])


def _file_place(model: pin.Model, name: str, joint: bool) -> tuple[float, ...]:
    carried, moves = _Carried(model), np.zeros(6)
    index = model.getFrameId(name, pin.FrameType.JOINT) if joint else frame_index(model, name)
    parent = int(carried.frames[index].parentFrame)
    place = carried.frames[index].placement
    if joint:
        number = model.getJointId(name)
        place, moves = (
            model.jointPlacements[number],
            np.concatenate(twist(model.joints[number], pin.neutral(model))),
        )
        above = parent if carried.frames[parent].parentJoint == model.parents[number] else 0
    else:
        above = carried.above(index)
        if above and carried.frames[above].placement == place:  # a link, where its fixed joint is
            above = carried.above(above)
    if above:
        place = carried.frames[above].placement.inverse() * place
    axis = moves[:3] + moves[3:]
    return tuple(float(part) for part in (*place.translation, *pin.rpy.matrixToRpy(place.rotation), *axis))


def movable_frames(robot: Robot) -> tuple[str, ...]:
    """The frames that `origin.<frame>.*` can move."""
    shown, driven = _Carried(robot.display_model), _driven(robot)
    return tuple(name for name in robot.frames if not _obstacle(robot, name, shown, driven))


def check_frame(robot: Robot, name: str, where: str) -> None:
    """`InputError` for a frame that is none, or that no fixed joint of its own places."""
    if name not in robot.frames:
        available = [*arm_joints(robot), *movable_frames(robot)]
        raise no_such("joint or frame", name, available, where)
    if why := _obstacle(robot, name, _Carried(robot.display_model), _driven(robot)):
        raise InputError(f"{name} has no place of its own: {why}", where=where)


def with_origins(robot: Robot, origins: Mapping[str, tuple[float, ...]]) -> Robot:
    """The robot whose joints and frames are elsewhere than in its file: by name x, y, z, roll, pitch, yaw, m
    and rad, in the axes that they have there. Those not named are where the file has them, bit for bit."""
    parts = robot.parts
    solid = getattr(parts, "collision_model", None)
    unmoved = robot.unmoved or Unmoved(robot.model, robot.display_model, *robot.shapes, solid)
    joints = {*arm_joints(robot)}
    own = {name: placement(values) for name, values in origins.items()}
    of_frames = {name: at for name, at in own.items() if name not in joints}
    frames = bool(of_frames) or any(name not in joints for name in robot.origins)
    carried = {key: _Carried(getattr(unmoved, key), of_frames) for key in ("model", "display_model")}
    models = {
        key: _placed(robot, getattr(robot, key), getattr(unmoved, key), own, carried[key], frames)
        for key in carried
    }
    shapes = robot.shapes._asdict()
    if frames:
        shapes = {
            "visual_model": _shapes(unmoved.visual_model, carried["display_model"]),
            "collision_model": _shapes(unmoved.collision_model, carried["model"]),
        }
        if solid is not None:
            parts = replace(parts, collision_model=_shapes(unmoved.solid, carried["display_model"]))
    return replace(
        robot, **shapes, **models, origins=dict(origins), parts=parts, unmoved=unmoved if origins else None
    )


class _Carried:
    """How the frames of a model go with those that are moved: a frame's placement in its joint is D P, D by
    its index; None where it stays."""

    def __init__(self, model: pin.Model, moved: Mapping[str, pin.SE3] | None = None) -> None:
        self.frames = list(model.frames)
        self.places = [frame.placement for frame in self.frames] if moved else []
        self._model = model
        self._own = {frame_index(model, name): at for name, at in (moved or {}).items()}
        self._by: dict[int, pin.SE3 | None] = {}

    def above(self, index: int) -> int:
        """The frame that carries a frame on the same joint; 0 without."""
        frame = self.frames[index]
        parent = int(frame.parentFrame)
        if frame.type == pin.FrameType.JOINT or parent == index:
            return 0
        return parent if self.frames[parent].parentJoint == frame.parentJoint else 0

    def by(self, index: int) -> pin.SE3 | None:
        """D of a frame."""
        if not self._own or index == 0:
            return None
        if index not in self._by:
            by = self.by(self.above(index))
            if index in self._own:
                at = self.places[index]
                moved = at * self._own[index] * at.inverse()
                by = moved if by is None else by * moved
            self._by[index] = by
        return self._by[index]

    def at(self, index: int) -> pin.SE3:
        """A frame's placement in its joint."""
        by = self.by(index)
        return self.frames[index].placement if by is None else by * self.frames[index].placement

    def joint_by(self, joint: int) -> pin.SE3 | None:
        """D of the frame that carries a joint."""
        if not self._own:
            return None
        index = self._model.getFrameId(str(self._model.names[joint]), pin.FrameType.JOINT)
        parent = int(self.frames[index].parentFrame)
        return self.by(parent) if self.frames[parent].parentJoint == self._model.parents[joint] else None

    def joints_behind(self, index: int) -> set[str]:
        """The movable joints that a frame carries."""

        def behind(i: int) -> bool:
            return i == index or (i > 0 and behind(self.above(i)))

        return {
            frame.name
            for frame in self.frames
            if frame.type == pin.FrameType.JOINT and behind(int(frame.parentFrame))
        }


def _driven(robot: Robot) -> set[str]:
    """The joints of the platform, its wheels and swivels."""
    return {*robot.q_names[: robot.platform.n_p], *(name for wheel in robot.wheels for name in wheel.joints)}


def _obstacle(robot: Robot, name: str, shown: _Carried, driven: set[str]) -> str:
    """Why a frame cannot be moved; "" where it can."""
    index = frame_index(robot.model, name)
    frame = shown.frames[index]  # in the same order in both models
    above = shown.frames[frame.parentFrame]
    if frame.type == pin.FrameType.JOINT:
        return "a joint that moves has it"
    if frame.type == pin.FrameType.BODY and (not frame.parentFrame or above.type == pin.FrameType.JOINT):
        return f"{above.name} carries it without a fixed joint"
    if behind := shown.joints_behind(index) & driven:
        return f"it carries {min(behind)}, by which the robot drives"
    return ""


def _placed(
    robot: Robot,
    model: pin.Model,
    unmoved: pin.Model,
    own: Mapping[str, pin.SE3],
    carried: _Carried,
    frames: bool,
) -> pin.Model:
    made = model.copy()
    for name in robot.q_names[robot.platform.n_p :]:
        joint = unmoved.getJointId(name)
        at, by = unmoved.jointPlacements[joint], carried.joint_by(joint)
        at = at if by is None else by * at
        made.jointPlacements[joint] = at * own[name] if name in own else at
    if not frames:
        return made
    masses: dict[int, Array] = {}
    for index, frame in enumerate(carried.frames):
        made.frames[index].placement = at = carried.at(index)
        if carried.by(index) is not None and frame.inertia.mass:
            before, after = (
                where.act(frame.inertia).toDynamicParameters() for where in (frame.placement, at)
            )
            masses[frame.parentJoint] = masses.get(frame.parentJoint, np.zeros(10)) + after - before
    for joint in range(made.njoints):
        inertia = unmoved.inertias[joint]
        if joint in masses:
            inertia = pin.Inertia.FromDynamicParameters(inertia.toDynamicParameters() + masses[joint])
        made.inertias[joint] = inertia
    return made


def _shapes(unmoved: pin.GeometryModel, carried: _Carried) -> pin.GeometryModel:
    made = unmoved.copy()
    for shape in made.geometryObjects:
        index = shape.parentFrame
        if index < len(carried.frames) and carried.frames[index].parentJoint == shape.parentJoint:
            by = carried.by(index)
            if by is not None:
                shape.placement = by * shape.placement
    return made
