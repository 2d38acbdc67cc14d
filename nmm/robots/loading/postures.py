"""What an SRDF says, in the names of the robot that was loaded: postures, groups, links that may touch."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin

from nmm.errors import RobotError, unknown
from nmm.robots.loading.srdf import Group, Srdf, read_srdf, srdf_beside
from nmm.robots.robot import Robot
from nmm.robots.semantics import Postures, Semantics
from nmm.words import one_line

#: What Pinocchio calls the joint between the world and the robot.
_ROOT = "root_joint"
#: How far a follower, or a locked joint, may be from where a state wants it, m or rad: files have few digits.
_SLACK = 1e-4
#: So many names are told.
_SHOWN = 6


def with_srdf(robot: Robot, given: str | Path | None, file: Path | None, name: str) -> Robot:
    """The robot with what its SRDF says: the one given, or the one beside its file.

    A given one has to be right; of one that was found, what does not fit is left out, with a note.

    Raises
    ------
    RobotError : a given SRDF that is none, or that speaks of joints that the robot's file does not have
    """
    path = given if given is not None else None if file is None else srdf_beside(file, name)
    if path is None:
        return robot
    try:
        semantics = _fitted(read_srdf(path), robot, strict=given is not None)
    except RobotError as error:
        if given is not None:
            raise
        semantics = Semantics(notes=(f"not used: {one_line(str(error))}",))
    notes = (*robot.notes, *semantics.notes)
    return replace(robot, **robot.shapes._asdict(), semantics=semantics, notes=notes)


def _fitted(srdf: Srdf, robot: Robot, *, strict: bool) -> Semantics:
    known = _joints(robot)
    roots = {_ROOT, *srdf.roots} - known
    notes: list[str] = []
    postures = Postures()
    for name, state in srdf.states.items():
        strange = [joint for joint in state if joint not in known | roots]
        if strange and strict:
            where = f"srdf: {srdf.path}: state {name}"
            raise RobotError(unknown("joint", strange[0], sorted(known), where))
        if strange:
            notes.append(f"posture {name} of {srdf.path.name}: no such joints: {_some(strange)}")
        values = _coordinates(state, roots, robot, name, notes)
        if values:
            postures[name] = values
            notes += _beyond(name, values, robot)
    groups = _groups(srdf.groups, robot)
    links = set(robot.frames)
    disabled = tuple(pair for pair in srdf.disabled if links.issuperset(pair))
    return Semantics(postures, groups, disabled, (srdf.path,), tuple(notes))


def _joints(robot: Robot) -> set[str]:
    """Every joint of the robot's file: coordinates, wheels, and what is fixed."""
    kinds = (pin.FrameType.JOINT, pin.FrameType.FIXED_JOINT)
    both = (*robot.model.frames, *robot.display_model.frames)
    return {frame.name for frame in both if frame.type in kinds} - {"universe"}


def _coordinates(
    state: Mapping[str, tuple[float, ...]], roots: set[str], robot: Robot, name: str, notes: list[str]
) -> dict[str, float]:
    """The coordinates that a state sets, m and rad: neither wheels nor what is locked or follows."""
    still = robot.locked
    values: dict[str, float] = {}
    for joint, numbers in state.items():
        if joint in roots:
            values |= _place(numbers, robot)
        elif joint in robot.q_names or joint in still:
            if len(numbers) != 1:
                notes.append(f"posture {name}: {joint}: expected one number, got {len(numbers)}: left out")
            elif joint in robot.q_names:
                values[joint] = numbers[0]
            elif abs(numbers[0] - still[joint]) > _SLACK:
                notes.append(f"posture {name}: {joint} is locked at {still[joint]:g}, not at {numbers[0]:g}")
    for one in robot.followers:
        if one.joint not in values:
            continue
        wanted = values.pop(one.joint)
        if one.leader not in values and one.multiplier:
            values[one.leader] = (wanted - one.offset) / one.multiplier
        elif one.leader in values and abs(one.value(values[one.leader]) - wanted) > _SLACK:
            notes.append(f"posture {name}: {one.joint} follows {one.leader} ({one}), not at {wanted:g}")
    return values


def _beyond(name: str, values: Mapping[str, float], robot: Robot) -> list[str]:
    """A sentence for the coordinates that a state sets beyond their limits."""
    far = []
    for joint, value in values.items():
        lower, upper = robot.q_limits[robot.coordinate(joint)]
        if not lower - _SLACK <= value <= upper + _SLACK:
            far.append(f"{joint} = {value:g} (from {lower:g} to {upper:g})")
    return [f"posture {name} is outside limits: {', '.join(far)}"] if far else []


def _place(numbers: Sequence[float], robot: Robot) -> dict[str, float]:
    """x, y, theta from what an SRDF gives the joint below the world: planar, or free with a quaternion."""
    if not {"x", "y", "theta"} <= {*robot.q_names}:
        return {}
    if len(numbers) == 7:
        qx, qy, qz, qw = numbers[3:]
        turn = np.arctan2(2.0 * (qw * qz + qx * qy), 1.0 - 2.0 * (qy * qy + qz * qz))
    elif len(numbers) == 4:
        turn = np.arctan2(numbers[3], numbers[2])
    elif len(numbers) == 3:
        turn = numbers[2]
    else:
        return {}
    return {"x": numbers[0], "y": numbers[1], "theta": float(turn)}


def _groups(groups: Mapping[str, Group], robot: Robot) -> dict[str, tuple[str, ...]]:
    """The inputs of each group that has some, under a name that is not taken."""
    taken = {*robot.groups, *robot.u_names}
    found: dict[str, tuple[str, ...]] = {}
    for name in groups:
        joints = _members(name, groups, robot, ())
        inputs = tuple(one for one in robot.u_names[robot.platform.p :] if one in joints)
        if inputs:
            key, count = name, 0
            while key in taken:
                count += 1
                key = f"{name}_{count}"
            taken.add(key)
            found[key] = inputs
    return found


def _members(name: str, groups: Mapping[str, Group], robot: Robot, above: tuple[str, ...]) -> set[str]:
    """The joints of a group; of one that holds itself, or that is none, nothing."""
    if name in above or name not in groups:
        return set()
    group = groups[name]
    found = {*group.joints}
    for link in group.links:
        found |= {*_above(robot, link)[-1:]}
    for base, tip in group.chains:
        found |= {*_above(robot, tip)} - {*_above(robot, base)}
    for one in group.groups:
        found |= _members(one, groups, robot, (*above, name))
    return found


def _above(robot: Robot, link: str) -> list[str]:
    """The joints from the root to a link, of the robot's coordinates."""
    if link not in robot.frames:
        return []
    joint = robot.model.frames[robot.frame_id(link)].parentJoint
    return [str(robot.model.names[one]) for one in robot.model.supports[joint] if one > 0]


def _some(names: Sequence[str]) -> str:
    more = [f"and {len(names) - _SHOWN} more"] if len(names) > _SHOWN else []
    return ", ".join([*names[:_SHOWN], *more])
