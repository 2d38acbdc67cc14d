"""SRDF, the file beside a URDF that names groups of joints, postures, and links that may touch."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

from nmm.errors import RobotError, expect_known
from nmm.findings import Finding
from nmm.findings.robot_file import refusal
from nmm.robots.loading.xml_tree import Element, XmlError, parse, read_text
from nmm.robots.robot import Robot
from nmm.robots.semantics import NamedPostures, Semantics

#: Where it is looked for, from the URDF's folder: MoveIt's packages, example-robot-data, and beside it.
_FOLDERS = (".", "../srdf", "../config", "../../{stem}_moveit_config/config")
SUFFIX = ".srdf"
#: What Pinocchio calls the joint between the world and the robot.
_ROOT = "root_joint"
#: How far a follower, or a locked joint, may be from where a state wants it, m or rad: files have few digits.
_SLACK = 1e-4


class Group(NamedTuple):
    """A named part of a robot: joints, links (for the joint above each), chains (base, tip), other groups."""

    joints: tuple[str, ...]
    links: tuple[str, ...]
    groups: tuple[str, ...]
    chains: tuple[tuple[str, str], ...]


class Srdf(NamedTuple):
    """A file in its own names: groups; each state's joint values (states of one name are merged); disabled
    pairs of links; and the roots, joints that it adds between the world and the robot."""

    path: Path
    states: Mapping[str, Mapping[str, tuple[float, ...]]]
    groups: Mapping[str, Group]
    disabled: tuple[tuple[str, str], ...]
    roots: tuple[str, ...]


def read_srdf(file: str | Path) -> Srdf:
    """`RobotError` for a file that is no SRDF, for missing names and for values that are no numbers."""
    path = Path(os.path.expanduser(file))
    try:
        root = parse(read_text(path))
    except FileNotFoundError:
        raise RobotError(f"there is no file {path}", where="srdf", got=str(path)) from None
    except XmlError as error:
        raise refusal(f"srdf: {path}", error.finding) from None
    except RobotError as error:
        raise error.at("srdf") from None
    if root.tag != "robot" or root.find("link") is not None:
        raise refusal(f"srdf: {path}", Finding("not_srdf", {"got": root.tag}))
    states: dict[str, dict[str, tuple[float, ...]]] = {}
    for state in root.iter("group_state"):
        found = states.setdefault(_attribute(state, "name", path), {})
        for joint in state.iter("joint"):
            found[_attribute(joint, "name", path)] = _numbers(joint, path)
    groups = {_attribute(group, "name", path): _group(group, path) for group in root.findall("group")}
    pairs = [(one.get("link1", ""), one.get("link2", "")) for one in root.iter("disable_collisions")]
    roots = tuple(_attribute(one, "name", path) for one in root.iter("virtual_joint"))
    return Srdf(path, states, groups, tuple(pairs), roots)


def srdf_beside(file: Path, robot: str) -> Path | None:
    """The SRDF in a usual place that has a description file's name, or is about the robot described there."""
    stem = file.name.split(".", 1)[0] if file.suffix.lower() == ".xacro" else file.stem
    folders = [file.absolute().parent / folder.format(stem=stem) for folder in _FOLDERS]
    named = (folder / f"{stem}{SUFFIX}" for folder in folders)
    same = [path for path in named if path.is_file()][:1]
    if not same:
        there = (path for folder in folders[:2] for path in sorted(folder.glob(f"*{SUFFIX}")))
        same = [path for path in there if _is_of(path, robot)]
    if len(same) > 1:
        same = [path for path in same if path.stem.lower() == robot.lower()]
    return Path(os.path.normpath(same[0])) if len(same) == 1 else None


def _is_of(path: Path, robot: str) -> bool:
    try:
        return parse(read_text(path)).get("name", "").lower() == robot.lower()
    except (XmlError, RobotError, OSError):
        return False


def _group(group: ElementTree.Element, path: Path) -> Group:
    def all_of(tag: str, *attributes: str) -> list[tuple[str, ...]]:
        return [tuple(_attribute(one, name, path) for name in attributes) for one in group.findall(tag)]

    chains = [(base, tip) for base, tip in all_of("chain", "base_link", "tip_link")]
    joints, links, groups = (sum(all_of(tag, "name"), ()) for tag in ("joint", "link", "group"))
    return Group(joints, links, groups, tuple(chains))


def _attribute(element: ElementTree.Element, name: str, path: Path) -> str:
    value = element.get(name, "").strip()
    if not value:
        raise _refused(element, path, "attribute_missing", element=element.tag, attribute=name)
    return value


def _numbers(joint: ElementTree.Element, path: Path) -> tuple[float, ...]:
    text = " ".join(joint.get("value", "").split())
    try:
        values = tuple(float(word) for word in text.split())
    except ValueError:
        values = ()
    if not values or not np.isfinite(values).all():
        raise _refused(joint, path, "state_not_numbers", name=joint.get("name"), got=text)
    return values


def _refused(element: ElementTree.Element, path: Path, code: str, /, **values: object) -> RobotError:
    line = {"line": element.line} if isinstance(element, Element) else {}
    return refusal(f"srdf: {path}", Finding(code, values, line))


def with_srdf(robot: Robot, given: str | Path | None, file: Path | None, name: str) -> Robot:
    """The robot with the SRDF given (`RobotError` if it is none or has joints that the robot's file lacks),
    or else with what fits of the one beside its file, and a note on what does not."""
    path = given if given is not None else None if file is None else srdf_beside(file, name)
    if path is None:
        return robot
    try:
        semantics = _fitted(read_srdf(path), robot, strict=given is not None)
    except RobotError as error:
        if given is not None:
            raise
        reason = error.findings[0].as_json()  # reading alone is strict
        semantics = Semantics(notes=(Finding("srdf_unused", {"reason": reason}, {"srdf": Path(path).name}),))
    notes = (*robot.notes, *semantics.notes)
    own = robot.semantics
    semantics = replace(
        semantics,
        postures=NamedPostures({**own.postures, **semantics.postures}),
        disabled=own.disabled + semantics.disabled,
        start=own.start,
    )
    return replace(robot, **robot.shapes._asdict(), semantics=semantics, notes=notes)


def with_states(robot: Robot, states: Srdf | None, start: Mapping[str, float]) -> Robot:
    """The robot with the postures and the start that its own file names, as an SRDF would."""
    semantics = Semantics() if states is None else _fitted(states, robot, strict=False)
    start = _at_reference({name: value for name, value in start.items() if name in robot.q_names}, robot)
    postures = {name: _at_reference(values, robot) for name, values in semantics.postures.items()}
    # The file is the robot's own, no SRDF: notes are on it, too.
    notes = tuple(replace(note, where={}) for note in semantics.notes)
    semantics = replace(semantics, postures=NamedPostures(postures), files=(), notes=(), start=start)
    return replace(robot, **robot.shapes._asdict(), semantics=semantics, notes=(*robot.notes, *notes))


def _at_reference(values: Mapping[str, float], robot: Robot) -> dict[str, float]:
    """Coordinates by name, x, y and theta of the root link given: there of the reference point."""
    moved = next((note.values for note in robot.notes if note.code == "reference_moved"), None)
    if moved is None or "theta" not in values:
        return {**values}
    x, y = moved["at"][:2]
    cosine, sine = float(np.cos(values["theta"])), float(np.sin(values["theta"]))
    place = {
        "x": values["x"] + cosine * x - sine * y,
        "y": values["y"] + sine * x + cosine * y,
        "theta": values["theta"] + moved["yaw"],
    }
    return {**values, **place}


def _fitted(srdf: Srdf, robot: Robot, *, strict: bool) -> Semantics:
    known = _joints(robot)
    roots = {_ROOT, *srdf.roots} - known
    notes: list[Finding] = []
    postures = NamedPostures()
    for name, state in srdf.states.items():
        strange = [joint for joint in state if joint not in known | roots]
        if strange and strict:
            where = f"srdf: {srdf.path}: state {name}"
            expect_known("joint", strange[0], sorted(known), where, RobotError)
        if strange:
            notes.append(_note("posture_joints_unknown", posture=name, names=strange))
        named = _coordinates(state, roots, robot, name, notes)
        if named:
            postures[name] = named
        if beyond := _beyond(named, robot):
            notes.append(_note("posture_beyond", posture=name, beyond=beyond))
    groups = _groups(srdf.groups, robot)
    links = set(robot.frames)
    disabled = tuple(pair for pair in srdf.disabled if links.issuperset(pair))
    of_file = tuple(replace(note, where={"srdf": srdf.path.name}) for note in notes)
    return Semantics(postures, groups, disabled, (srdf.path,), of_file)


def _joints(robot: Robot) -> set[str]:
    """Every joint of the robot's file: coordinates, wheels, and fixed ones."""
    kinds = (pin.FrameType.JOINT, pin.FrameType.FIXED_JOINT)
    both = (*robot.model.frames, *robot.display_model.frames)
    return {frame.name for frame in both if frame.type in kinds} - {"universe"}


def _coordinates(
    state: Mapping[str, tuple[float, ...]], roots: set[str], robot: Robot, name: str, notes: list[Finding]
) -> dict[str, float]:
    """The coordinates that a state sets, m and rad: no wheels, locked or mimic joints."""
    still = robot.locked
    values: dict[str, float] = {}
    for joint, numbers in state.items():
        if joint in roots:
            values |= _place(numbers, robot)
        elif joint in robot.q_names or joint in still:
            if len(numbers) != 1:
                notes.append(_note("posture_not_one_number", posture=name, name=joint, count=len(numbers)))
            elif joint in robot.q_names:
                values[joint] = -numbers[0] if joint in robot.reversed_joints else numbers[0]
            elif abs(numbers[0] - still[joint]) > _SLACK:
                about = {"posture": name, "name": joint, "locked": still[joint], "wanted": numbers[0]}
                notes.append(_note("posture_locked", **about))
    for one in robot.mimic_joints:
        if one.joint not in values:
            continue
        wanted = values.pop(one.joint)
        if one.leader not in values and one.multiplier:
            values[one.leader] = (wanted - one.offset) / one.multiplier
        elif one.leader in values and abs(one.value(values[one.leader]) - wanted) > _SLACK:
            about = {"posture": name, "name": one.joint, "leader": one.leader, "mimic": str(one)}
            notes.append(_note("posture_follows", **about, wanted=wanted))
    return values


def _beyond(values: Mapping[str, float], robot: Robot) -> dict[str, list[float]]:
    """The coordinates that a state sets beyond their limits: value and limits."""
    far = {}
    for joint, value in values.items():
        lower, upper = map(float, robot.q_limits[robot.coordinate(joint)])
        if not lower - _SLACK <= value <= upper + _SLACK:
            far[joint] = [value, lower, upper]
    return far


def _note(code: str, **values: object) -> Finding:
    return Finding(code, values)


def _place(numbers: Sequence[float], robot: Robot) -> dict[str, float]:
    """x, y, theta from what an SRDF gives the joint below the world: planar, or free with a quaternion."""
    if not {"x", "y", "theta"} <= {*robot.q_names}:
        return {}
    match numbers:
        case x, y, _, qx, qy, qz, qw:
            turn = np.arctan2(2.0 * (qw * qz + qx * qy), 1.0 - 2.0 * (qy * qy + qz * qz))
        case x, y, cosine, sine:
            turn = np.arctan2(sine, cosine)
        case x, y, turn:
            pass
        case _:
            return {}
    return {"x": x, "y": y, "theta": float(turn)}


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
    """The joints of a group; none for an unknown or circular one."""
    if name in above or name not in groups:
        return set()
    group = groups[name]
    return {*group.joints}.union(
        *(_above(robot, link)[-1:] for link in group.links),
        *({*_above(robot, tip)} - {*_above(robot, base)} for base, tip in group.chains),
        *(_members(one, groups, robot, (*above, name)) for one in group.groups),
    )


def _above(robot: Robot, link: str) -> list[str]:
    """The robot's coordinates from the root to a link."""
    if link not in robot.frames:
        return []
    joint = robot.model.frames[robot.frame_id(link)].parentJoint
    return [str(robot.model.names[one]) for one in robot.model.supports[joint] if one > 0]
