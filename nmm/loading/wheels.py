"""Wheels that only roll: found in the model, and measured where they touch the ground."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np
import pinocchio as pin

from nmm.arrays import positive
from nmm.errors import InputError, RobotError, unknown
from nmm.loading.chain import CHAIN
from nmm.loading.joint_kinds import axis, is_revolute
from nmm.robot import Wheel

# How far from level an axis may be: files write pi/2 with a few digits.
_LEVEL = 1e-3
_SHAPES = ("Cylinder", "Sphere", "Capsule")


def find_wheels(
    model: pin.Model,
    geometries: Sequence[pin.GeometryModel],
    asked: Sequence[str] | Mapping[str, float] | None,
    where: str,
    own: Sequence[str] = (),
) -> tuple[tuple[Wheel, ...], tuple[str, ...]]:
    """The robot's wheels, and notes on joints that are named wheels and are none.

    A wheel is a revolute joint on the root link's body, with a level axis and no joint below it. By default
    those are taken whose name, or child link's name, holds "wheel".

    Parameters
    ----------
    model : begins with the platform's chain
    geometries : its collision and visual shapes, in the order in which to ask them for a radius
    asked : joint names, or a radius (m) for each; None finds them
    where : what messages call the model
    own : the platform's own joints, which are coordinates, not wheels

    Raises
    ------
    RobotError : a name that is no joint, or no wheel, or a wheel whose radius cannot be found
    """
    joints = [str(name) for name in model.names][len(CHAIN) + 1 :]
    if asked is None:
        ids = [model.getJointId(name) for name in joints if name not in own]
        reasons = {i: _why_no_wheel(model, i) for i in ids if _is_named_wheel(model, i)}
        found = tuple(_wheel(model, geometries, i, None, where) for i in reasons if reasons[i] is None)
        notes = (
            f"{model.names[i]} stays a coordinate in spite of its name: {reason}"
            for i, reason in reasons.items()
            if reason is not None
        )
        return found, tuple(notes)
    if isinstance(asked, str) or not isinstance(asked, Iterable):
        raise RobotError(f"{where}: wheels: expected a list of joint names, got {asked!r}")
    wheels = []
    for name in dict.fromkeys(asked):
        if name not in joints:
            raise RobotError(unknown("wheel joint", name, joints, where))
        reason = "it is the platform's own" if name in own else _why_no_wheel(model, model.getJointId(name))
        if reason is not None:
            raise RobotError(f"{where}: joint {name!r} is no wheel: {reason}")
        radius = asked[name] if isinstance(asked, Mapping) else None
        wheels.append(_wheel(model, geometries, model.getJointId(name), radius, where))
    return tuple(wheels), ()


def _is_named_wheel(model: pin.Model, joint: int) -> bool:
    names = [str(model.names[joint])]
    for frame in model.frames:
        # Links that are fixed to the child link do not count: a camera over the wheel is no wheel.
        of_joint = model.frames[frame.parentFrame].name == names[0]
        if frame.parentJoint == joint and frame.type == pin.FrameType.BODY and of_joint:
            names.append(frame.name)
    return any("wheel" in name.lower() for name in names)


def _why_no_wheel(model: pin.Model, joint: int) -> str | None:
    if not is_revolute(model.joints[joint]):
        return "it does not turn"
    if model.parents[joint] != len(CHAIN):
        return "another joint is between it and the root link"
    if joint in list(model.parents):
        return "another joint is below it"
    if abs(_axis(model, joint)[2]) > _LEVEL:
        return "its axis is not level"
    return None


def _axis(model: pin.Model, joint: int) -> np.ndarray:
    return model.jointPlacements[joint].rotation @ axis(model.joints[joint], np.zeros(model.nq))


def _wheel(
    model: pin.Model, geometries: Sequence[pin.GeometryModel], joint: int, radius: float | None, where: str
) -> Wheel:
    name = str(model.names[joint])
    center = np.array(model.jointPlacements[joint].translation)
    if radius is not None:
        try:
            radius = positive(radius, f"wheels: radius of {name}")
        except InputError as error:
            raise RobotError(f"{where}: {error}") from None
    elif center[2] > 0.0:
        # The root link stands on the ground (REP-103's base_footprint).
        radius = float(center[2])
    else:
        radius = _shape_radius(geometries, joint)
    if radius is None:
        raise RobotError(
            f"{where}: radius of wheel {name!r} not found: its centre is not above the root link's xy plane "
            f"and it has no cylinder or sphere; give it, wheels={{{name!r}: ...}}, or no wheels, wheels=()"
        )
    return Wheel(name, center, _axis(model, joint), radius)


def _shape_radius(geometries: Sequence[pin.GeometryModel], joint: int) -> float | None:
    """The largest radius among the joint's round shapes, of the first geometry model that has any."""
    for geometry in geometries:
        shapes = [shape.geometry for shape in geometry.geometryObjects if shape.parentJoint == joint]
        radii = [float(shape.radius) for shape in shapes if type(shape).__name__ in _SHAPES]
        if radii and math.isfinite(max(radii)) and max(radii) > 0.0:
            return max(radii)
    return None
