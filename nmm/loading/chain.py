"""Any Pinocchio model made into one of ours: x, y, theta first, and one number for every joint.

The model is built again joint by joint, because Pinocchio cannot change a joint's type. Frames keep their
names, and the model given stays as it is.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from nmm.errors import RobotError
from nmm.loading.joint_kinds import is_continuous, is_simple, kind, one_number

CHAIN = ("x", "y", "theta")
# The kinds of the chain's joints, in a model that has them already.
_CHAIN_KINDS = (("PX",), ("PY",), ("RZ", "RUBZ"))
# Pinocchio's "no limit" is the largest number there is.
_HUGE = 1e300


@dataclass(frozen=True)
class Rebuilt:
    """A model with the platform's chain, the geometry on it, and what was done.

    Attributes
    ----------
    model : joints x, y, theta, then the others, one number each
    geometries : copies of the geometry models given, on `model`
    notes : what was done, a sentence each
    """

    model: pin.Model
    geometries: tuple[pin.GeometryModel, ...]
    notes: tuple[str, ...]


def with_chain(
    source: pin.Model, geometries: Sequence[pin.GeometryModel], where: str, first: Sequence[str] = ()
) -> Rebuilt:
    """The same robot on the chain x, y (prismatic, m) and theta (revolute, rad), at zero where it was.

    Parameters
    ----------
    source : a fixed-base model (all of it will hang on the chain), one whose first joint is planar or a free
        flyer (the chain replaces it, with z, roll and pitch at zero), or one that begins with the chain
    geometries : its geometry models
    where : what messages call the model
    first : joints that come before their siblings (the platform's own)

    Raises
    ------
    RobotError : a joint with more than one degree of freedom, or a name that clashes with the chain's
    """
    head = _head(source)
    _check(source, head, where)
    model = pin.Model()
    model.name, model.gravity = source.name, source.gravity
    joints = _add_joints(model, source, head, first)
    for joint, image in joints.items():
        model.appendBodyToJoint(image, source.inertias[joint], pin.SE3.Identity())
    frames = _add_frames(model, source, head, joints)
    copies = tuple(_geometry(model, geometry, joints, frames) for geometry in geometries)
    return Rebuilt(model, copies, tuple(_notes(source, head)))


def _head(source: pin.Model) -> int:
    """How many of the source's first joints the chain stands for: 3 (the chain itself), 1 (a root), or 0."""
    kinds = [kind(joint) for joint in source.joints]
    if (
        tuple(source.names)[1:4] == CHAIN
        and all(found in allowed for found, allowed in zip(kinds[1:4], _CHAIN_KINDS, strict=True))
        and list(source.parents)[1:4] == [0, 1, 2]
        and all(source.jointPlacements[joint].isIdentity(0.0) for joint in (2, 3))
    ):
        return 3
    return 1 if source.njoints > 1 and kinds[1] in ("FreeFlyer", "Planar") else 0


def _check(source: pin.Model, head: int, where: str) -> None:
    bad = [
        f"{source.names[i]} ({kind(source.joints[i])})"
        for i in range(head + 1, source.njoints)
        if not is_simple(source.joints[i])
    ]
    if bad:
        raise RobotError(
            f"{where}: expected joints with one degree of freedom (revolute, continuous, prismatic or "
            f"helical), got {', '.join(bad)}"
        )
    names = {*source.names, *(frame.name for frame in source.frames)}
    clashes = [name for name in CHAIN if name in names]
    if clashes and head != 3:
        raise RobotError(f"{where}: joints or frames have the coordinates' names {', '.join(clashes)}")


def _add_joints(model: pin.Model, source: pin.Model, head: int, first: Sequence[str]) -> dict[int, int]:
    """Add the chain and the source's joints; returns the new index of each of the source's joints."""
    # A root joint that is not at the world's origin keeps its place: x and y count from there.
    placement = source.jointPlacements[1] if head else pin.SE3.Identity()
    nothing, infinite = np.zeros(1), np.full(1, np.inf)
    parent = 0
    for name, joint in zip(CHAIN, (pin.JointModelPX(), pin.JointModelPY(), pin.JointModelRZ()), strict=True):
        limits = (-infinite, infinite) * 3
        parent = model.addJoint(parent, joint, placement, name, *limits, nothing, nothing, nothing)
        placement = pin.SE3.Identity()
    # What hung on the universe of a fixed base moves with theta.
    joints = {0: 0 if head else parent}
    joints |= {joint: joint if head == 3 else parent for joint in range(1, head + 1)}
    neutral = pin.neutral(source)
    for joint in _order(source, head, first):
        joints[joint] = model.addJoint(
            joints[source.parents[joint]],
            one_number(source.joints[joint], neutral),
            source.jointPlacements[joint],
            source.names[joint],
            *_limits(source, joint),
        )
    # Of a replaced root there is nothing to copy, of a kept chain there is.
    for joint in range(head + 1 if head == 1 else 1, source.njoints):
        new, old = model.joints[joints[joint]].idx_v, source.joints[joint].idx_v
        model.armature[new] = source.armature[old]
        model.rotorInertia[new] = source.rotorInertia[old]
        model.rotorGearRatio[new] = source.rotorGearRatio[old]
    return joints


def _order(source: pin.Model, head: int, first: Sequence[str]) -> list[int]:
    """The joints after the chain, depth first (Pinocchio's algorithms rely on it), `first` before others."""
    children: dict[int, list[int]] = {joint: [] for joint in range(source.njoints)}
    for joint in range(head + 1, source.njoints):
        children[source.parents[joint]].append(joint)
    order: list[int] = []
    stack = list(range(head + 1))
    while stack:
        joint = stack.pop()
        if joint > head:
            order.append(joint)
        stack.extend(sorted(children[joint], key=lambda i: (source.names[i] not in first, i), reverse=True))
    return order


def _limits(source: pin.Model, joint: int) -> tuple[np.ndarray, ...]:
    """Limits of effort, velocity, position and friction (lower, upper), and damping; infinite where none."""
    v, q = source.joints[joint].idx_v, source.joints[joint].idx_q
    velocity = source.velocityLimit[v : v + 1]  # `lowerVelocityLimit` comes back with the wrong sign
    lower, upper = source.lowerPositionLimit[q : q + 1], source.upperPositionLimit[q : q + 1]
    if is_continuous(source.joints[joint]):
        lower, upper = np.full(1, -np.inf), np.full(1, np.inf)
    limits = (
        *(source.lowerEffortLimit[v : v + 1], source.upperEffortLimit[v : v + 1], -velocity, velocity),
        *(lower, upper),
    )
    return (
        *(np.where(np.abs(limit) > _HUGE, np.copysign(np.inf, limit), limit) for limit in limits),
        *(source.lowerDryFrictionLimit[v : v + 1], source.upperDryFrictionLimit[v : v + 1]),
        source.damping[v : v + 1],
    )


def _add_frames(model: pin.Model, source: pin.Model, head: int, joints: Mapping[int, int]) -> dict[int, int]:
    """Add the chain's and the source's frames; returns the new index of each of the source's frames."""
    if head != 3:
        for joint, name in enumerate(CHAIN, start=1):
            model.addFrame(pin.Frame(name, joint, joint - 1, pin.SE3.Identity(), pin.FrameType.JOINT))
    theta = 0 if head == 3 else model.getFrameId("theta")
    frames = {0: 0 if head else theta}
    for index, frame in enumerate(source.frames):
        if index == 0:
            continue
        of_root = head == 1 and frame.parentJoint == 1 and frame.type == pin.FrameType.JOINT
        frames[index] = model.addFrame(
            pin.Frame(
                frame.name,
                joints[frame.parentJoint],
                theta if of_root else frames[frame.parentFrame],
                frame.placement,
                # The root's joint is gone; its frame stays, as Pinocchio keeps those of locked joints.
                pin.FrameType.FIXED_JOINT if of_root else frame.type,
                frame.inertia,
            ),
            False,
        )
    # A model made by hand may lack its joints' frames, which reducing it needs.
    for joint in range(1, model.njoints):
        name = model.names[joint]
        if not model.existFrame(name, pin.FrameType.JOINT):
            above = model.parents[joint]
            parent = model.getFrameId(model.names[above], pin.FrameType.JOINT) if above else 0
            model.addFrame(pin.Frame(name, joint, parent, pin.SE3.Identity(), pin.FrameType.JOINT))
    return frames


def _geometry(
    model: pin.Model, source: pin.GeometryModel, joints: Mapping[int, int], frames: Mapping[int, int]
) -> pin.GeometryModel:
    geometry = pin.GeometryModel()
    for shape in source.geometryObjects:
        copied = pin.GeometryObject(shape)
        joint = copied.parentJoint = joints[shape.parentJoint]
        # A shape made by hand may name no frame: its joint's will do.
        own = model.getFrameId(model.names[joint], pin.FrameType.JOINT) if joint else 0
        copied.parentFrame = frames.get(shape.parentFrame, own)
        geometry.addGeometryObject(copied)
    for pair in source.collisionPairs:
        geometry.addCollisionPair(pair)
    return geometry


def _notes(source: pin.Model, head: int) -> list[str]:
    notes = []
    if head == 1:
        notes.append(f"root joint {source.names[1]} ({kind(source.joints[1])}) replaced by x, y, theta")
    continuous = [source.names[i] for i in range(head + 1, source.njoints) if is_continuous(source.joints[i])]
    if continuous:
        notes.append(f"continuous joints as one unbounded angle each: {', '.join(continuous)}")
    return notes
