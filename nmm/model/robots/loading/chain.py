"""Rebuilds any Pinocchio model joint by joint, with x, y, theta first and one number for every joint.

Pinocchio cannot change a joint's type. Frames keep their names; the given model is not changed."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from nmm.base.errors import RobotError, few
from nmm.base.findings import Finding
from nmm.model.platforms.base import PLANAR as CHAIN
from nmm.model.robots.loading.joint_kinds import (
    is_continuous,
    is_mimic,
    is_simple,
    joint_limits,
    kind,
    no_limits,
    one_number,
    reversed_joint,
    reversed_limits,
    value_at,
)
from nmm.model.robots.mimic_joints import MimicJoint

Head = Sequence[tuple[str, Any]]

#: The platform's chain: names and joints.
CHAIN_JOINTS: Head = tuple(
    zip(CHAIN, (pin.JointModelPX(), pin.JointModelPY(), pin.JointModelRZ()), strict=True)
)
# The kinds of the chain's joints, in a model that has them already.
_CHAIN_KINDS = (("PX",), ("PY",), ("RZ", "RUBZ"))


class Rebuilt(NamedTuple):
    """A model of joints x, y, theta, then the others, one number each; and its geometry."""

    model: pin.Model
    geometries: tuple[pin.GeometryModel, ...]


def rebuild(
    source: pin.Model,
    geometries: Sequence[pin.GeometryModel],
    where: str,
    first: Sequence[str] = (),
    root: pin.SE3 | None = None,
    head: Head = CHAIN_JOINTS,
    reversed_joints: Sequence[str] = (),
    replaced: int | None = None,
) -> Rebuilt:
    """The robot on the chain x, y (prismatic, m), theta (revolute, rad), or on `head`, at zero where it was.

    The chain carries all of a fixed base, replaces a planar or free root (z, roll, pitch zero) or is there.
    Joints in `first` precede their siblings; `root` places the root link in the chain's last joint (or in the
    world); `reversed_joints`, which only turn, get the opposite axis and sign; `replaced` joints, if
    x, y, theta are no chain (see `replaced_joints`). `RobotError` for a joint with several degrees of freedom
    or a name of the chain's."""
    placement = pin.SE3.Identity() if root is None else root
    count = replaced_joints(source) if replaced is None else replaced
    plan = _Plan(source, count, tuple(head), placement, frozenset(reversed_joints))
    _check(plan, where)
    model = pin.Model()
    model.name, model.gravity = source.name, source.gravity
    joints = _add_joints(model, plan, first)
    for joint, image in joints.items():
        model.appendBodyToJoint(image, source.inertias[joint], plan.moved(joint, pin.SE3.Identity()))
    frames = _add_frames(model, plan, joints)
    copies = tuple(_geometry(model, plan, geometry, joints, frames) for geometry in geometries)
    _add_references(model, plan, joints)
    return Rebuilt(model, copies)


@dataclass(frozen=True)
class _Plan:
    """What is built from what: `count` of the source's first joints give way to those of `head`."""

    source: pin.Model
    count: int
    head: tuple[tuple[str, Any], ...]
    root: pin.SE3
    reversed_joints: frozenset[str]

    @property
    def keeps_chain(self) -> bool:
        return self.count == len(CHAIN) and tuple(name for name, _ in self.head) == CHAIN

    def moved(self, joint: int, placement: pin.SE3) -> pin.SE3:
        """The placement of something on a joint's body: what is on the root's body moves with the root."""
        return self.root * placement if joint == self.count else placement


def yaw_of(placement: pin.SE3) -> float:
    return float(np.arctan2(placement.rotation[1, 0], placement.rotation[0, 0]))


def mimic_joints_of(source: pin.Model) -> tuple[MimicJoint, ...]:
    """The joints that a model built with `mimic=True` has follow others."""
    mimic_joints = []
    for joint, leader in zip(source.mimicking_joints, source.mimicked_joints, strict=True):
        mimic = source.joints[joint].extract()
        names = str(source.names[joint]), str(source.names[leader])
        mimic_joints.append(MimicJoint(*names, float(mimic.scaling), float(mimic.offset)))
    return tuple(mimic_joints)


def replaced_joints(source: pin.Model) -> int:
    """How many first joints the chain stands for: 3 (the chain itself), 1 (a planar or free root), or 0."""
    kinds = [kind(joint) for joint in source.joints]
    if (
        tuple(source.names)[1:4] == CHAIN
        and all(joint_kind in allowed for joint_kind, allowed in zip(kinds[1:4], _CHAIN_KINDS, strict=True))
        and list(source.parents)[1:4] == [0, 1, 2]
        and all(source.jointPlacements[joint].isIdentity(0.0) for joint in (2, 3))
    ):
        return 3
    return 1 if source.njoints > 1 and kinds[1] in ("FreeFlyer", "Planar") else 0


def _check(plan: _Plan, where: str) -> None:
    source = plan.source
    others = ((source.names[i], source.joints[i]) for i in range(plan.count + 1, source.njoints))
    bad = [f"{name} ({kind(joint)})" for name, joint in others if not is_simple(joint)]
    if bad:
        expected = "joints with one degree of freedom (revolute, continuous, prismatic or helical)"
        raise RobotError(few(bad), where=where, expected=expected)
    names = {*source.names, *(frame.name for frame in source.frames)}
    clashes = [name for name, _ in plan.head if name in names]
    if clashes and plan.count != 3:
        raise RobotError(f"joints or frames have the coordinates' names {', '.join(clashes)}", where=where)


def _add_joints(model: pin.Model, plan: _Plan, first: Sequence[str]) -> dict[int, int]:
    """Returns the new index of each of the source's joints."""
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
        simple, limits = one_number(source.joints[joint], neutral), joint_limits(source, joint)
        if source.names[joint] in plan.reversed_joints:
            simple, limits = reversed_joint(source.joints[joint], neutral), reversed_limits(limits)
        joints[joint] = model.addJoint(
            joints[source.parents[joint]],
            simple,
            plan.moved(source.parents[joint], source.jointPlacements[joint]),
            source.names[joint],
            *limits,
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
    """Returns the new index of each of the source's frames."""
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
        stays = of_head and plan.keeps_chain
        of_root = of_head and not stays
        frames[index] = model.addFrame(
            pin.Frame(
                frame.name,
                joints[frame.parentJoint],
                top if of_root else frames[frame.parentFrame],
                frame.placement if stays else plan.moved(frame.parentJoint, frame.placement),
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
    geometry = source.copy()
    for shape in geometry.geometryObjects:
        shape.placement = plan.moved(shape.parentJoint, shape.placement)
        joint = shape.parentJoint = joints[shape.parentJoint]
        # A shape made by hand may name no frame: its joint's will do.
        own = model.getFrameId(model.names[joint], pin.FrameType.JOINT) if joint else 0
        shape.parentFrame = frames.get(shape.parentFrame, own)
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
                sign = -1.0 if source.names[joint] in plan.reversed_joints else 1.0
                q[model.joints[joints[joint]].idx_q] = sign * value_at(source.joints[joint], old)
        for mimic in mimic_joints_of(source):
            follower, leader = (model.joints[model.getJointId(name)] for name in (mimic.joint, mimic.leader))
            q[follower.idx_q] = mimic.value(q[leader.idx_q])
        model.referenceConfigurations[entry.key()] = q


def joint_notes(source: pin.Model) -> list[Finding]:
    """What `rebuild` does to the joints of a file."""
    count, notes = replaced_joints(source), []
    if count == 1:
        replaced = {"name": source.names[1], "kind": kind(source.joints[1])}
        notes.append(Finding("root_replaced", replaced))
    others = range(count + 1, source.njoints)
    continuous = [source.names[i] for i in others if is_continuous(source.joints[i])]
    if continuous:
        notes.append(Finding("continuous_joints", {"names": continuous}))
    return notes
