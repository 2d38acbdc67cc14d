"""Any Pinocchio model made into one of ours: x, y, theta first, and one number for every joint.

The model is built again joint by joint, because Pinocchio cannot change a joint's type. Frames keep their
names, and the model given stays as it is.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from nmm.errors import RobotError
from nmm.platforms.own_joints import PLANAR as CHAIN
from nmm.robots.followers import Follower
from nmm.robots.loading.joint_kinds import is_continuous, is_mimic, is_simple, kind, one_number, value_at
from nmm.robots.loading.joint_limits import joint_limits, no_limits

Head = Sequence[tuple[str, Any]]

#: The platform's chain: names and joints.
CHAIN_JOINTS: Head = tuple(
    zip(CHAIN, (pin.JointModelPX(), pin.JointModelPY(), pin.JointModelRZ()), strict=True)
)
# The kinds of the chain's joints, in a model that has them already.
_CHAIN_KINDS = (("PX",), ("PY",), ("RZ", "RUBZ"))


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


def rebuild(
    source: pin.Model,
    geometries: Sequence[pin.GeometryModel],
    where: str,
    first: Sequence[str] = (),
    root: pin.SE3 | None = None,
    head: Head = CHAIN_JOINTS,
) -> Rebuilt:
    """The same robot on the chain x, y (prismatic, m) and theta (revolute, rad), at zero where it was.

    Parameters
    ----------
    source : a fixed-base model (all of it will hang on the chain), one whose first joint is planar or a free
        flyer (the chain replaces it, with z, roll and pitch at zero), or one that begins with the chain
    geometries : its geometry models
    where : what messages call the model
    first : joints that come before their siblings (the platform's own), in this order
    root : placement of the root link in the last joint of the chain (in the world without a chain)
    head : names and joints in the chain's place: another root joint, or none for a fixed base

    Raises
    ------
    RobotError : a joint with more than one degree of freedom, or a name that clashes with the chain's
    """
    plan = _Plan(source, replaced_joints(source), tuple(head), pin.SE3.Identity() if root is None else root)
    _check(plan, where)
    model = pin.Model()
    model.name, model.gravity = source.name, source.gravity
    joints = _add_joints(model, plan, first)
    for joint, image in joints.items():
        model.appendBodyToJoint(image, source.inertias[joint], plan.moved(joint, pin.SE3.Identity()))
    frames = _add_frames(model, plan, joints)
    copies = tuple(_geometry(model, plan, geometry, joints, frames) for geometry in geometries)
    _add_references(model, plan, joints)
    return Rebuilt(model, copies, tuple(_notes(plan)))


@dataclass(frozen=True)
class _Plan:
    """What is built from what: `count` of the source's first joints give way to those of `head`."""

    source: pin.Model
    count: int
    head: tuple[tuple[str, Any], ...]
    root: pin.SE3

    @property
    def is_chain(self) -> bool:
        """Whether the head is the platform's chain."""
        return tuple(name for name, _ in self.head) == CHAIN

    @property
    def keeps_chain(self) -> bool:
        """Whether the source has the very joints that are asked for."""
        return self.count == 3 and self.is_chain

    def moved(self, joint: int, placement: pin.SE3) -> pin.SE3:
        """The placement of something on a joint's body: what is on the root's body moves with the root."""
        return self.root * placement if joint == self.count else placement


def followers_of(source: pin.Model) -> tuple[Follower, ...]:
    """The joints that a model built with `mimic=True` has follow others."""
    pairs = zip(source.mimicking_joints, source.mimicked_joints, strict=True)
    found = [(joint, leader, source.joints[joint].extract()) for joint, leader in pairs]
    return tuple(
        Follower(str(source.names[joint]), str(source.names[leader]), float(one.scaling), float(one.offset))
        for joint, leader, one in found
    )


def replaced_joints(source: pin.Model) -> int:
    """How many first joints the chain stands for: 3 (the chain itself), 1 (a planar or free root), or 0."""
    kinds = [kind(joint) for joint in source.joints]
    if (
        tuple(source.names)[1:4] == CHAIN
        and all(found in allowed for found, allowed in zip(kinds[1:4], _CHAIN_KINDS, strict=True))
        and list(source.parents)[1:4] == [0, 1, 2]
        and all(source.jointPlacements[joint].isIdentity(0.0) for joint in (2, 3))
    ):
        return 3
    return 1 if source.njoints > 1 and kinds[1] in ("FreeFlyer", "Planar") else 0


def _check(plan: _Plan, where: str) -> None:
    source = plan.source
    bad = [
        f"{source.names[i]} ({kind(source.joints[i])})"
        for i in range(plan.count + 1, source.njoints)
        if not is_simple(source.joints[i])
    ]
    if bad:
        raise RobotError(
            f"{where}: expected joints with one degree of freedom (revolute, continuous, prismatic or "
            f"helical), got {', '.join(bad)}"
        )
    names = {*source.names, *(frame.name for frame in source.frames)}
    clashes = [name for name in CHAIN if name in names]
    if clashes and plan.count != 3:
        raise RobotError(f"{where}: joints or frames have the coordinates' names {', '.join(clashes)}")


def _add_joints(model: pin.Model, plan: _Plan, first: Sequence[str]) -> dict[int, int]:
    """Add the chain and the source's joints; returns the new index of each of the source's joints."""
    source, count = plan.source, plan.count
    # A root joint that is not at the world's origin keeps its place: x and y count from there.
    placement = source.jointPlacements[1] if count and plan.head else pin.SE3.Identity()
    parent = 0
    for name, joint in plan.head:
        limits = joint_limits(source, parent + 1) if plan.keeps_chain else no_limits(joint)
        parent = model.addJoint(parent, joint, placement, name, *limits)
        placement = pin.SE3.Identity()
    # What hung on the universe of a fixed base moves with the root.
    joints = {0: 0 if count else parent}
    joints |= {joint: joint if plan.keeps_chain else parent for joint in range(1, count + 1)}
    neutral = pin.neutral(source)
    for joint in _order(source, count, first):
        joints[joint] = model.addJoint(
            joints[source.parents[joint]],
            one_number(source.joints[joint], neutral),
            plan.moved(source.parents[joint], source.jointPlacements[joint]),
            source.names[joint],
            *joint_limits(source, joint),
        )
    # Of a replaced root there is nothing to copy, of a kept chain there is.
    for joint in range(1 if plan.keeps_chain else count + 1, source.njoints):
        if is_mimic(source.joints[joint]):
            continue  # it has none of its own
        new, old = model.joints[joints[joint]].idx_v, source.joints[joint].idx_v
        model.armature[new] = source.armature[old]
        model.rotorInertia[new] = source.rotorInertia[old]
        model.rotorGearRatio[new] = source.rotorGearRatio[old]
    return joints


def _order(source: pin.Model, count: int, first: Sequence[str]) -> list[int]:
    """The joints after the chain, depth first (Pinocchio's algorithms rely on it), `first` before others."""
    children: dict[int, list[int]] = {joint: [] for joint in range(source.njoints)}
    for joint in range(count + 1, source.njoints):
        children[source.parents[joint]].append(joint)
    rank = {name: i for i, name in enumerate(first)}
    order: list[int] = []
    stack = list(range(count + 1))
    while stack:
        joint = stack.pop()
        if joint > count:
            order.append(joint)
        key = [(rank.get(source.names[i], len(rank)), i) for i in children[joint]]
        stack.extend(i for _, i in sorted(key, reverse=True))
    return order


def _add_frames(model: pin.Model, plan: _Plan, joints: Mapping[int, int]) -> dict[int, int]:
    """Add the head's and the source's frames; returns the new index of each of the source's frames."""
    source, count = plan.source, plan.count
    if not plan.keeps_chain:
        for joint, (name, _) in enumerate(plan.head, start=1):
            model.addFrame(pin.Frame(name, joint, joint - 1, pin.SE3.Identity(), pin.FrameType.JOINT))
    top = len(plan.head) if not plan.keeps_chain else 0
    names = {name for name, _ in plan.head}
    frames = {0: 0 if count else top}
    # In the joints' new order: Pinocchio's reduction adds a joint's frame when it comes to the joint, and
    # loses its place (an error, or a crash) where one that it has not seen comes before.
    for index in sorted(range(1, source.nframes), key=lambda i: joints[source.frames[i].parentJoint]):
        frame = source.frames[index]
        of_head = 1 <= frame.parentJoint <= count and frame.type == pin.FrameType.JOINT
        of_chain = of_head and count == 3 and not plan.keeps_chain
        if of_chain or (frame.name in names and frame.type == pin.FrameType.FIXED_JOINT):
            frames[index] = top  # the chain's own frames go with the chain, a former root's give way
            continue
        kept = of_head and plan.keeps_chain
        of_root = of_head and not kept
        frames[index] = model.addFrame(
            pin.Frame(
                frame.name,
                joints[frame.parentJoint],
                top if of_root else frames[frame.parentFrame],
                frame.placement if kept else plan.moved(frame.parentJoint, frame.placement),
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
    model: pin.Model,
    plan: _Plan,
    source: pin.GeometryModel,
    joints: Mapping[int, int],
    frames: Mapping[int, int],
) -> pin.GeometryModel:
    geometry = pin.GeometryModel()
    for shape in source.geometryObjects:
        copied = pin.GeometryObject(shape)
        copied.placement = plan.moved(shape.parentJoint, shape.placement)
        joint = copied.parentJoint = joints[shape.parentJoint]
        # A shape made by hand may name no frame: its joint's will do.
        own = model.getFrameId(model.names[joint], pin.FrameType.JOINT) if joint else 0
        copied.parentFrame = frames.get(shape.parentFrame, own)
        geometry.addGeometryObject(copied)
    for pair in source.collisionPairs:
        geometry.addCollisionPair(pair)
    return geometry


def _add_references(model: pin.Model, plan: _Plan, joints: Mapping[int, int]) -> None:
    """The source's named configurations (of an SRDF); a replaced root stands at zero in them."""
    source = plan.source
    for entry in source.referenceConfigurations:
        old, q = np.asarray(entry.data()), pin.neutral(model)
        if old.shape != (source.nq,):
            continue
        for joint in range(1 if plan.keeps_chain else plan.count + 1, source.njoints):
            if not is_mimic(source.joints[joint]):
                q[model.joints[joints[joint]].idx_q] = value_at(source.joints[joint], old)
        for one in followers_of(source):
            follower, leader = (model.joints[model.getJointId(name)] for name in (one.joint, one.leader))
            q[follower.idx_q] = one.value(q[leader.idx_q])
        model.referenceConfigurations[entry.key()] = q


def _notes(plan: _Plan) -> list[str]:
    source, count, notes = plan.source, plan.count, []
    if count == 1 and plan.is_chain:
        notes.append(f"root joint {source.names[1]} ({kind(source.joints[1])}) replaced by x, y, theta")
    continuous = [
        source.names[i] for i in range(count + 1, source.njoints) if is_continuous(source.joints[i])
    ]
    if continuous:
        notes.append(f"continuous joints as one unbounded angle each: {', '.join(continuous)}")
    return notes
