"""Models with joints fixed at given values, and with them the joints that mimic them; collision pairs."""

from collections.abc import Collection, Mapping, Sequence
from itertools import combinations

import numpy as np
import pinocchio as pin

from nmm.base.arrays import Array, scalar
from nmm.base.errors import InputError, RobotError, expect_known
from nmm.base.findings import Finding
from nmm.base.text_format import apart, is_pattern, matching
from nmm.model.robots.loading.chain import CHAIN
from nmm.model.robots.loading.joint_kinds import is_revolute
from nmm.model.robots.mimic_joints import MimicJoint, first_leaders
from nmm.model.robots.robot import Robot

# Limits are decimal fractions of angles that are none.
_SLACK = 1e-9


def told_apart(model: pin.Model, tag: str) -> tuple[pin.Model, dict[str, str]]:
    """A copy in which every frame that is no joint's has a name of its own, and the names by these."""
    # Pinocchio's reduction and composition look frames up by their names alone.
    copied, names = model.copy(), {}
    for index, frame in enumerate(copied.frames):
        if index and frame.type != pin.FrameType.JOINT:
            names[f"{tag}{index}"] = frame.name
            frame.name = f"{tag}{index}"
    return copied, names


def at_zero(
    model: pin.Model, geometries: Sequence[pin.GeometryModel], joints: Collection[str]
) -> tuple[pin.Model, tuple[pin.GeometryModel, ...]]:
    """The models with the named joints fixed at zero; unchanged without any."""
    if not joints:
        return model, tuple(geometries)
    return reduced(model, geometries, [model.getJointId(name) for name in joints], np.zeros(model.nq))


def reduced(
    model: pin.Model, geometries: Sequence[pin.GeometryModel], joints: Sequence[int], q: Array
) -> tuple[pin.Model, tuple[pin.GeometryModel, ...]]:
    """The models with some joints fixed at their values in q; frames and shapes in the same order."""
    lean, shapes = pin.buildReducedModel(told_apart(model, "&")[0], list(geometries), list(joints), q)
    # Pinocchio makes the frame of a fixed joint its own parent (a climb to the root would not end), and
    # does not find it again as the frame of a shape.
    for frame, original in zip(lean.frames, model.frames, strict=True):
        frame.name, frame.parentFrame = original.name, original.parentFrame
    for geometry, before in zip(shapes, geometries, strict=True):
        for shape, original in zip(geometry.geometryObjects, before.geometryObjects, strict=True):
            shape.parentFrame = original.parentFrame
    return lean, tuple(shapes)


def add_pairs(model: pin.Model, geometry: pin.GeometryModel, split: int | None = None) -> None:
    """Adds all pairs of shapes on bodies that no joint connects (neighbours touch by design); with `split`,
    only those of a shape before that index with one after."""
    joints = [shape.parentJoint for shape in geometry.geometryObjects]
    for i, j in combinations(range(len(joints)), 2):
        first, second = joints[i], joints[j]
        apart = first != second and model.parents[first] != second and model.parents[second] != first
        if apart and (split is None or i < split <= j):
            geometry.addCollisionPair(pin.CollisionPair(i, j))


def locked_values(
    model: pin.Model,
    lock: Mapping[str, float],
    mimic_joints: Sequence[MimicJoint],
    own: Collection[str],
    where: str,
) -> dict[str, float]:
    """Values by joint of `lock` (see `load`); `RobotError` for no joint, one of the platform's `own`, and no
    number or one outside the limits."""
    names = [str(name) for name in list(model.names)[1:]]
    free = [name for name in names if name not in CHAIN and name not in own]  # a fixed base has no chain
    values: dict[str, float] = {}
    for name, value in _named(lock, free, mimic_joints, where).items():
        expect_known("joint to lock", name, free, where, RobotError)
        try:
            values[name] = scalar(value, f"lock: {name}")
        except InputError as error:
            raise error.at(where, RobotError) from None
    for name, value in values.items():
        check_limits(model, name, value, where, "")
    return values


def _named(
    lock: Mapping[str, float], free: Sequence[str], mimic_joints: Sequence[MimicJoint], where: str
) -> dict[str, float]:
    """Values by joint: a pattern's for each match that follows no other match and is not named itself."""
    leaders = {mimic.joint: mimic.leader for mimic in first_leaders(mimic_joints)}
    values: dict[str, float] = {}
    for key, value in lock.items():
        if not is_pattern(key):
            continue
        matched = matching(key, free)
        if not matched:
            raise RobotError(f"no joint matches {key!r}", where=f"{where}: lock", got=key, available=free)
        values |= {name: value for name in matched if leaders.get(name) not in matched}
    return values | {key: value for key, value in lock.items() if not is_pattern(key)}


def check_limits(model: pin.Model, name: str, value: float, where: str, more: str) -> None:
    """`RobotError` for a joint to be fixed outside its limits; `more` says why it is fixed."""
    index = model.joints[model.getJointId(name)].idx_q
    lower, upper = float(model.lowerPositionLimit[index]), float(model.upperPositionLimit[index])
    if not lower - _SLACK <= value <= upper + _SLACK:
        what = "{} is outside its limits, from {} to {}".format(*apart(value, lower, upper, digits=6))
        raise RobotError(what, where=f"{where}: lock: {name}{more}", got=value)


def among_coordinates(
    mimic_joints: Sequence[MimicJoint], rolling: Sequence[str], where: str
) -> tuple[tuple[MimicJoint, ...], list[Finding]]:
    """The mimic joints that are coordinates, each by an independent leader, and notes; `RobotError` for one
    that follows a wheel or swivel (`rolling`), which the ground turns."""
    followers = tuple(mimic for mimic in first_leaders(mimic_joints) if mimic.joint not in rolling)
    for mimic in followers:
        if mimic.leader in rolling:
            what = (
                f"{mimic.joint} follows {mimic.leader}, which the ground turns and is no coordinate: lock "
                f"{mimic.joint}, or name the wheels without {mimic.leader} (--wheels, wheels)"
            )
            raise RobotError(what, where=where, got=mimic.joint)
    notes = []
    if followers:
        notes.append(Finding("mimic_joints", {"names": [*map(str, followers)]}))
    if len(followers) < len(mimic_joints):
        turned = [mimic.joint for mimic in mimic_joints if mimic.joint in rolling]
        notes.append(Finding("mimics_of_ground", {"names": turned}))
    return followers, notes


#: A slide with more room than this, m, is longer than arms have.
_LONG = 5.0


def limit_notes(robot: Robot) -> list[Finding]:
    """Notes on the mimic joints whose limits are ignored, and on slides that no arm has."""
    notes = []
    for mimic in robot.unheeded:
        i = robot.coordinate(mimic.joint)
        ends = robot.model.lowerPositionLimit, robot.model.upperPositionLimit
        limits = {name: float(end[i]) for name, end in zip(("lower", "upper"), ends, strict=True)}
        values = {"mimic": str(mimic), "name": mimic.joint, "leader": mimic.leader, **limits}
        notes.append(Finding("mimic_limits_ignored", values))
    rooms = dict(zip(robot.q_names, np.diff(robot.q_limits)[:, 0].tolist(), strict=True))
    slides = {
        name: rooms[name]
        for name in robot.q_names[robot.platform.n_p :]
        if _LONG < rooms[name] < np.inf and not is_revolute(robot.model.joints[robot.model.getJointId(name)])
    }
    if slides:
        notes.append(Finding("slides_long", {"rooms": slides}))
    return notes
