"""What a robot takes of an SRDF: postures, groups of inputs, joints without a motor, links that may touch."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain
from pathlib import Path

import numpy as np
import pinocchio as pin

from nmm.base.errors import RobotError, expect_known
from nmm.base.findings import Finding
from nmm.model.robots.loading.chain import yaw_of
from nmm.model.robots.loading.names_apart import with_names
from nmm.model.robots.loading.provenance import provenance_of, reference_in_root
from nmm.model.robots.loading.srdf_parts import Group, Srdf
from nmm.model.robots.robot import Robot
from nmm.model.robots.semantics import NamedPostures, Semantics

#: What Pinocchio calls the joint between the world and the robot.
_ROOT = "root_joint"
#: How far a follower, or a locked joint, may be from where a state wants it, m or rad: files have few digits.
_SLACK = 1e-4
_JOINTS = (pin.FrameType.JOINT, pin.FrameType.FIXED_JOINT)


def semantics_of(srdf: Srdf, robot: Robot, passive: Mapping[str, float], *, strict: bool) -> Semantics:
    """What fits of an SRDF, and notes on what does not and on `passive` joints, which stand still; `strict`:
    `RobotError` for joints that the robot's file lacks."""
    semantics = _fitted(_in_robots_names(srdf, robot), robot, strict=strict)
    held = [Finding("passive_held", {"values": dict(passive)}, {"srdf": srdf.path.name})] if passive else []
    return replace(semantics, notes=(*srdf.notes, *held, *semantics.notes))


def unused(path: str | Path, error: RobotError) -> Semantics:
    """A note that the SRDF beside a robot's file cannot be used, and why."""
    reasons = error.findings or (Finding("refused", {"text": str(error)}),)
    return Semantics(
        notes=(Finding("srdf_unused", {"reason": reasons[0].as_json()}, {"srdf": Path(path).name}),)
    )


def with_semantics(robot: Robot, semantics: Semantics) -> Robot:
    """The robot with what its SRDF says, besides what its own file says."""
    own = robot.semantics
    both = replace(
        semantics,
        postures=NamedPostures({**own.postures, **semantics.postures}),
        disabled=own.disabled + semantics.disabled,
        start=own.start,
    )
    notes = (*robot.notes, *semantics.notes)
    return replace(robot, **robot.shapes._asdict(), semantics=both, notes=notes)


def passive_joints(srdf: Srdf, robot: Robot) -> dict[str, float]:
    """Where the joints without a motor stand, m and rad: as near to zero as their limits let them."""
    names = [robot.renamed.get(name, name) for name in srdf.passive]
    free = [name for name in robot.u_names[robot.platform.p :] if name in names]
    return {name: float(robot.rest[robot.coordinate(name)]) for name in free}


def with_states(robot: Robot, states: Srdf | None, start: Mapping[str, float]) -> Robot:
    """The robot with the postures and the start that its own file names, as an SRDF would."""
    semantics = (
        Semantics() if states is None else _fitted(_in_robots_names(states, robot), robot, strict=False)
    )
    new = robot.renamed
    named = {new.get(name, name): value for name, value in start.items()}
    start = _at_reference({name: value for name, value in named.items() if name in robot.q_names}, robot)
    postures = {name: _at_reference(values, robot) for name, values in semantics.postures.items()}
    # The file is the robot's own, no SRDF: notes are on it, too.
    notes = tuple(replace(note, where={}) for note in semantics.notes)
    semantics = replace(semantics, postures=NamedPostures(postures), files=(), notes=(), start=start)
    return replace(robot, **robot.shapes._asdict(), semantics=semantics, notes=(*robot.notes, *notes))


def _at_reference(values: Mapping[str, float], robot: Robot) -> dict[str, float]:
    """Coordinates by name, x, y and theta of the root link given: there of the reference point."""
    if "theta" not in values:
        return {**values}
    reference = reference_in_root(robot)
    root = pin.SE3(pin.utils.rotate("z", values["theta"]), np.array([values["x"], values["y"], 0.0]))
    x, y, _ = (root * reference).translation.tolist()
    return {**values, "x": x, "y": y, "theta": values["theta"] + yaw_of(reference)}


def _in_robots_names(srdf: Srdf, robot: Robot) -> Srdf:
    """The same, with the robot's names of joints and links that are called otherwise in its file."""
    new = robot.renamed
    states = {name: with_names(state, new) for name, state in srdf.states.items()}
    named = ("joints", "links", "chains")
    groups = {
        name: group._replace(**{key: with_names(getattr(group, key), new) for key in named})
        for name, group in srdf.groups.items()
    }
    others = ("disabled", "enabled", "untouched", "passive")
    renamed = {key: with_names(getattr(srdf, key), new) for key in others}
    return srdf._replace(states=states, groups=groups, **renamed)


def disabled_pairs(srdf: Srdf, robot: Robot) -> tuple[tuple[str, str], ...]:
    """The pairs of the robot's links that may touch: the disabled ones, and, of links that may touch all
    others, the pairs that are not enabled."""
    links = {frame.name for frame in robot.model.frames if frame.type == pin.FrameType.BODY}
    shapes = robot.shapes.collision_model.geometryObjects
    solid = sorted({str(robot.model.frames[shape.parentFrame].name) for shape in shapes})
    enabled = {frozenset(pair) for pair in srdf.enabled}
    pairs = ((link, other) for link in srdf.untouched for other in solid)
    free = (pair for pair in pairs if len({*pair}) == 2 and frozenset(pair) not in enabled)
    disabled = dict.fromkeys(pair for pair in (*srdf.disabled, *free) if links.issuperset(pair))
    return tuple(disabled)


def _fitted(srdf: Srdf, robot: Robot, *, strict: bool) -> Semantics:
    known = _joints(robot)
    base = _base(srdf, robot)
    roots = {_ROOT, *(root.name for root in srdf.roots)} - known
    notes: list[Finding] = []
    postures = NamedPostures()
    for name, state in srdf.states.items():
        strange = [joint for joint in state if joint not in known | roots]
        if strange and strict:
            where = f"srdf: {srdf.path}: state {name}"
            expect_known("joint", strange[0], sorted(known), where, RobotError)
        if strange:
            notes.append(_note("posture_joints_unknown", posture=name, names=strange))
        if replaced := [joint for joint in state if joint in base and joint in known]:
            notes.append(_note("posture_of_base", posture=name, names=replaced))
        named = _coordinates(state, roots, robot, name, notes)
        if named:
            postures[name] = named
        if beyond := _beyond(named, robot):
            notes.append(_note("posture_beyond", posture=name, beyond=beyond))
    groups = _groups(srdf.groups, robot, base)
    if still := [name for name in srdf.groups if name not in groups]:
        notes.append(_note("groups_without_inputs", names=still))
    parts = {*robot.frames, *known, *roots}
    if strange := [*dict.fromkeys(name for name in _members_named(srdf) if name not in parts)]:
        notes.append(_note("srdf_names_unknown", names=strange))
    notes += _root_notes(srdf, robot)
    of_file = tuple(replace(note, where={"srdf": srdf.path.name}) for note in notes)
    groups = _free_names(groups, robot)
    return Semantics(postures, groups, disabled_pairs(srdf, robot), (srdf.path,), of_file)


def _members_named(srdf: Srdf) -> Iterator[str]:
    """Every link, joint and group that the file speaks of outside its states."""
    for group in srdf.groups.values():
        yield from (*group.joints, *group.links, *chain(*group.chains))
        yield from (name for name in group.groups if name not in srdf.groups)
    yield from chain(*srdf.disabled, *srdf.enabled, srdf.untouched, srdf.passive)


def _root_notes(srdf: Srdf, robot: Robot) -> Iterator[Finding]:
    """On virtual joints that the robot does not have: elsewhere than at its root, or on another platform."""
    for root in srdf.roots:
        if root.child and not _is_of_root(root.child, robot):
            yield _note("virtual_joint_unused", name=root.name, child=root.child)
        elif root.kind == "planar" and root.motion and robot.platform.coordinates:
            slides = bool(np.any(robot.platform.G(np.zeros(robot.platform.n_p))[1]))
            if slides != (root.motion == "holonomic"):
                about = {"name": root.name, "model": root.motion, "platform": robot.platform.name}
                yield _note("motion_model_differs", **about)


def _is_of_root(link: str, robot: Robot) -> bool:
    model = robot.model
    root = model.getJointId("theta") if robot.platform.coordinates else 0
    return link in robot.frames and int(model.frames[robot.frame_id(link)].parentJoint) == root


def _base(srdf: Srdf, robot: Robot) -> set[str]:
    """The joints that mean the platform: those of the file that x, y, theta stand for, virtual ones, and then
    the joint of the root link."""
    if not robot.platform.coordinates:
        return set()
    replaced = {note.values["name"] for note in robot.notes if note.code == "root_replaced"}
    base = {*provenance_of(robot).base, *replaced}
    base |= {root.name for root in srdf.roots if root.kind != "fixed" and _is_of_root(root.child, robot)}
    return {*base, "theta"} if base else base


def _joints(robot: Robot) -> set[str]:
    """Every joint of the robot's file: coordinates, wheels, and fixed ones."""
    both = (*robot.model.frames, *robot.display_model.frames)
    return {frame.name for frame in both if frame.type in _JOINTS} - {"universe"}


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
    for mimic in robot.mimic_joints:
        if mimic.joint not in values:
            continue
        wanted = values.pop(mimic.joint)
        if mimic.leader not in values and mimic.multiplier:
            values[mimic.leader] = (wanted - mimic.offset) / mimic.multiplier
        elif mimic.leader in values and abs(mimic.value(values[mimic.leader]) - wanted) > _SLACK:
            about = {"posture": name, "name": mimic.joint, "leader": mimic.leader, "mimic": str(mimic)}
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


def _groups(groups: Mapping[str, Group], robot: Robot, base: set[str]) -> dict[str, tuple[str, ...]]:
    """The inputs of each group that has some: of the platform all for a joint of its base."""
    usable = {}
    for name, joints in _members(groups, robot, {*robot.q_names, *base}).items():
        inputs = tuple(
            u_name
            for k, (u_name, i) in enumerate(zip(robot.u_names, robot.rate_coordinates, strict=True))
            if (i >= 0 and robot.q_names[i] in joints) or (k < robot.platform.p and base & joints)
        )
        if inputs:
            usable[name] = inputs
    return usable


def _free_names(groups: Mapping[str, tuple[str, ...]], robot: Robot) -> dict[str, tuple[str, ...]]:
    """The groups under names that are not taken."""
    taken = {*robot.groups, *robot.u_names}
    renamed = {}
    for name, inputs in groups.items():
        key, count = name, 0
        while key in taken:
            count += 1
            key = f"{name}_{count}"
        taken.add(key)
        renamed[key] = inputs
    return renamed


def _members(groups: Mapping[str, Group], robot: Robot, known: set[str]) -> dict[str, set[str]]:
    """Of the known joints, those of each group and of the groups in it; these may form a circle.
    A link stands for the joint that carries it, a chain for the joints between its links."""
    frames = {*robot.frames}
    members = {
        name: known.intersection(
            set(group.joints).union(
                *(_above(robot, link)[:1] for link in group.links),
                *(
                    {*_above(robot, tip)} ^ {*_above(robot, base)}
                    for base, tip in group.chains
                    if {base, tip} <= frames
                ),
            )
        )
        for name, group in groups.items()
    }
    order, grown = _inner_first(groups), True
    while grown:  # twice, and more often only in circles
        before = sum(map(len, members.values()))
        for name in order:
            members[name].update(*(members.get(inner, ()) for inner in groups[name].groups))
        grown = sum(map(len, members.values())) > before
    return members


def _inner_first(groups: Mapping[str, Group]) -> list[str]:
    """The groups' names, each behind those that it holds, but for circles."""
    order, seen = [], set[str]()
    for start in groups:
        path = [start] if start not in seen else []
        inside = [iter(groups[start].groups)]
        seen.add(start)
        while path:
            following = next((name for name in inside[-1] if name in groups and name not in seen), None)
            if following is None:
                order.append(path.pop())
                inside.pop()
            else:
                seen.add(following)
                path.append(following)
                inside.append(iter(groups[following].groups))
    return order


def _above(robot: Robot, link: str) -> list[str]:
    """The joints from a link to the root, fixed ones too."""
    joints: list[str] = []
    frames = robot.model.frames
    index = robot.frame_id(link) if link in robot.frames else 0
    while index:
        if frames[index].type in _JOINTS:
            joints.append(frames[index].name)
        index = int(frames[index].parentFrame)
    return joints
