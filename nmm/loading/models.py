"""The four Pinocchio objects of a robot, from a checked description or from a model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from nmm.arrays import scalar
from nmm.errors import InputError, RobotError, unknown
from nmm.loading.chain import CHAIN, Rebuilt, with_chain
from nmm.loading.text import one_line
from nmm.loading.wheels import find_wheels
from nmm.robot import Wheel


@dataclass(frozen=True)
class Models:
    """What Robot is made of; see there."""

    model: pin.Model
    collision_model: pin.GeometryModel
    display_model: pin.Model
    visual_model: pin.GeometryModel
    wheels: tuple[Wheel, ...]
    notes: tuple[str, ...]


def pinocchio_models(urdf: str, where: str) -> tuple[pin.Model, pin.GeometryModel, pin.GeometryModel]:
    """Fixed-base model, visual and collision shapes of a checked URDF text.

    Raises
    ------
    RobotError : Pinocchio refuses it (a mesh file that cannot be read, for one)
    """
    try:
        model = pin.buildModelFromXML(urdf)
        return (
            model,
            pin.buildGeomFromUrdfString(model, urdf, pin.GeometryType.VISUAL),
            pin.buildGeomFromUrdfString(model, urdf, pin.GeometryType.COLLISION),
        )
    except (ValueError, RuntimeError) as error:
        # coal puts the place in its own source before the message.
        cause = one_line(str(error).split("message:", 1)[-1])
        raise RobotError(f"{where}: Pinocchio cannot read it: {cause}") from None


def robot_models(
    source: pin.Model,
    visual: pin.GeometryModel,
    collision: pin.GeometryModel,
    where: str,
    own: Sequence[str],
    wheels: Sequence[str] | Mapping[str, float] | None,
    locked: Mapping[str, float],
) -> Models:
    """The models with the platform's chain, the locked joints fixed, the wheels on the display model only.

    Parameters
    ----------
    source, visual, collision : Pinocchio's, left as they are
    where : what messages call the robot
    own : the platform's own joints, which come right after theta
    wheels : as for `find_wheels`
    locked : joints to fix, and at which value (rad or m)

    Raises
    ------
    RobotError : a joint that we cannot take, or a name that is no joint
    """
    rebuilt = with_chain(source, (visual, collision), where, own)
    joints = [str(name) for name in rebuilt.model.names][len(CHAIN) + 1 :]
    for name in own:
        if name not in joints:
            raise RobotError(unknown("platform joint", name, joints, where))
    if locked:
        rebuilt = _lock(rebuilt, locked, joints, where, own)
    display, (shown, solid) = rebuilt.model, rebuilt.geometries
    found, wheel_notes = find_wheels(display, (solid, shown), wheels, where, own)
    notes = [*rebuilt.notes, *wheel_notes]
    model = display
    if found:
        names = [wheel.joint for wheel in found]
        notes.append(f"wheels that only roll, left out of q: {', '.join(names)}")
        ids = [display.getJointId(name) for name in names]
        model, (solid,) = _reduced(display, [solid], ids, np.zeros(display.nq))
    if model.njoints == 1 + len(CHAIN) + len(own):
        notes.append("no arm: the platform is all that moves")
    return Models(model, solid, display, shown, found, tuple(notes))


def _lock(
    rebuilt: Rebuilt, locked: Mapping[str, float], joints: Sequence[str], where: str, own: Sequence[str]
) -> Rebuilt:
    model = rebuilt.model
    q = np.zeros(model.nq)
    free = [name for name in joints if name not in own]
    for name, value in locked.items():
        if name not in free:
            raise RobotError(unknown("joint to lock", name, free, where))
        try:
            q[model.joints[model.getJointId(name)].idx_q] = scalar(value, f"locked: {name}")
        except InputError as error:
            raise RobotError(f"{where}: {error}") from None
    ids = [model.getJointId(name) for name in locked]
    model, geometries = _reduced(model, list(rebuilt.geometries), ids, q)
    values = ", ".join(f"{name} at {value:g}" for name, value in locked.items())
    return Rebuilt(model, tuple(geometries), (*rebuilt.notes, f"locked joints: {values}"))


def _reduced(
    model: pin.Model, geometries: list[pin.GeometryModel], joints: list[int], q: NDArray[np.float64]
) -> tuple[pin.Model, list[pin.GeometryModel]]:
    """The models with some joints fixed at their values in q; frames in the same order."""
    reduced, shapes = pin.buildReducedModel(model, geometries, joints, q)
    # Pinocchio makes the frame of a fixed joint its own parent (whoever climbs up from it never arrives), and
    # does not find it again as the frame of a shape.
    for frame, original in zip(reduced.frames, model.frames, strict=True):
        frame.parentFrame = original.parentFrame
    for geometry, before in zip(shapes, geometries, strict=True):
        for shape, original in zip(geometry.geometryObjects, before.geometryObjects, strict=True):
            shape.parentFrame = original.parentFrame
    return reduced, list(shapes)
