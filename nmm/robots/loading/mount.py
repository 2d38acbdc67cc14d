"""`mount`: an arm put on a platform, each from a file of its own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from nmm.arrays import array, vector
from nmm.errors import InputError, RobotError, unknown
from nmm.platforms import Fixed
from nmm.robots.loading.chain import rebuild, replaced_joints
from nmm.robots.loading.collision_pairs import add_pairs
from nmm.robots.loading.load import load
from nmm.robots.loading.models import Options, robot_from
from nmm.robots.loading.provenance import Parts, parts_of
from nmm.robots.loading.reduction import at_zero, told_apart
from nmm.robots.loading.source import Source
from nmm.robots.robot import Robot
from nmm.words import printable, short_words

# Frames on which something is meant to be mounted.
_PLACES = ("mount", "arm_mount", "top")
# Names of groups that every robot has (`Robot.groups`).
_GROUPS = ("platform", "arm")
# How many clashing names a message lists.
_SHOWN = 8
# How far a matrix may be from a rotation: numbers in files have a few digits.
_ROTATION = 1e-6


def mount(
    platform: Robot | str | Path | pin.Model,
    arm: Robot | str | Path | pin.Model,
    *,
    at: str | None = None,
    placement: pin.SE3 | ArrayLike | tuple[ArrayLike, ArrayLike] | None = None,
    prefix: str | None = None,
    name: str | None = None,
) -> Robot:
    """Put an arm on a platform: its links, shapes and limits as its own file has them.

    Parameters
    ----------
    platform : a robot from `load` or `mount`, or what `load` takes. It keeps its platform, wheels and arms
    arm : another; of a mobile robot all but its x, y and theta is mounted, with its wheels standing still
    at : frame of the platform that carries the arm; by default the one that is named mount, arm_mount or top
    placement : of the arm's root link (of its reference point, if it was loaded with `axle`) in that frame:
        a pin.SE3, a matrix (4, 4), or position and roll, pitch, yaw (about fixed axes, as in a URDF),
        (xyz, rpy), m and rad. None: on the frame itself
    prefix : put before the names of the arm's joints, frames and shapes; by default none, or the arm's name
        and _ where names clash. The arm is called by it (without the _) in `Robot.arms` and `Robot.groups`
    name : the robot's name; by default "PLATFORM with ARM"

    Returns
    -------
    Robot : its collision pairs are those of both and, of the shapes of one with those of the other, all but
        those within one body or of two that a joint connects

    Raises
    ------
    RobotError : an arm without a movable joint, no such frame, a placement that is none, names that clash

    Examples
    --------
    >>> robot = nmm.mount("unicycle_2r", "unicycle_2r", at="arm_base", prefix="second_")
    >>> robot.q_names
    ('x', 'y', 'theta', 'q1', 'q2', 'second_q1', 'second_q2')
    """
    if name is not None and not isinstance(name, str):
        raise RobotError(f"name: expected a string, got {name!r}")
    base = platform if isinstance(platform, Robot) else load(platform)
    other = arm if isinstance(arm, Robot) else _loaded_arm(arm)
    try:
        return _mounted(base, other, at, _pose(placement), prefix, name)
    except RobotError as error:
        raise RobotError(short_words(printable(str(error)))) from None


@dataclass(frozen=True, eq=False)
class _Body:
    """A robot's models with its shapes on one of them."""

    model: pin.Model
    visual: pin.GeometryModel
    collision: pin.GeometryModel

    @property
    def names(self) -> set[str]:
        """Names of joints and frames."""
        return {*self.model.names, *(frame.name for frame in self.model.frames)} - {"universe"}

    @property
    def shapes(self) -> set[str]:
        """Names of shapes: visual ones may be called as collision shapes are."""
        both = (*self.visual.geometryObjects, *self.collision.geometryObjects)
        return {shape.name for shape in both}


def _mounted(
    base: Robot, arm: Robot, at: str | None, pose: pin.SE3, prefix: str | None, name: str | None
) -> Robot:
    parts, arm_parts = parts_of(base), parts_of(arm)
    platform = _Body(base.display_model, base.shapes.visual_model, parts.collision_model)
    body = _arm_body(arm, arm_parts)
    if body.model.nq == 0:
        raise RobotError(f"{arm.name} has no movable joint, so it is no arm")
    prefix, key = _prefix(base, arm, platform, body, prefix)
    _rename(body, prefix)
    frame = _frame(base, at)
    whole, visual, collision = _appended(platform, body, frame, pose)
    joints = tuple(str(joint) for joint in list(body.model.names)[1:])
    provenance = parts.provenance.with_arm(arm_parts.provenance, key, prefix)
    source = Source(
        name=name or f"{base.name} with {key}",
        where=f"{base.name} with {key}",
        label=f"{base.source} + {arm.source}",
        model=whole,
        visual_model=visual,
        collision_model=collision,
        all_pairs=False,
        arguments={**base.arguments, **{f"{key}.{k}": value for k, value in arm.arguments.items()}},
        notes=(
            *parts.notes,
            *(f"{key}: {note}" for note in arm_parts.notes),
            _mount_note(base, arm, key, frame, prefix),
        ),
        provenance=provenance,
        followers=(*base.followers, *(one.renamed(prefix) for one in arm.followers)),
    )

    def pairs(model: pin.Model, geometry: pin.GeometryModel) -> None:
        """Those of both robots, by the shapes' places, and those of the one's shapes with the other's."""
        geometry.removeAllCollisionPairs()
        count = platform.collision.ngeoms
        for pair in base.shapes.collision_model.collisionPairs:
            geometry.addCollisionPair(pair)
        for pair in arm.shapes.collision_model.collisionPairs:
            geometry.addCollisionPair(pin.CollisionPair(pair.first + count, pair.second + count))
        add_pairs(model, geometry, count)

    wheels = {wheel.joint: wheel.radius for wheel in base.wheels}
    robot = robot_from(source, Options(base.platform, wheels, add_pairs=pairs))
    kept: Parts = robot.parts
    kept = replace(
        kept,
        provenance=replace(
            kept.provenance,
            locked=provenance.locked,
            mimicked=provenance.mimicked,
            platform=provenance.platform,
        ),
    )
    semantics = base.semantics.with_arm(arm.semantics, prefix, joints)
    arms = {**base.arms, key: joints}
    return replace(robot, **robot.shapes._asdict(), arms=arms, semantics=semantics, parts=kept)


def _arm_body(arm: Robot, parts: Parts) -> _Body:
    """A copy of the arm alone: of a fixed base, with its wheels standing still."""
    rolling = dict.fromkeys(name for wheel in arm.wheels for name in wheel.joints)
    shapes = arm.shapes.visual_model, parts.collision_model
    model, shapes = at_zero(arm.display_model, shapes, rolling)
    root = model.jointPlacements[1] if replaced_joints(model) else pin.SE3.Identity()
    rebuilt = rebuild(model, shapes, arm.name, root=root, head=())
    return _Body(rebuilt.model, *rebuilt.geometries)


def _prefix(base: Robot, arm: Robot, platform: _Body, body: _Body, given: str | None) -> tuple[str, str]:
    """The prefix of the arm's names, and what the arm is called."""
    if given is not None and not isinstance(given, str):
        raise RobotError(f"prefix: expected text, got {given!r}")
    taken = {*_GROUPS, *base.arms, *base.u_names}
    if given is not None:
        clashes = _clashes(base, platform, body, given)
        if clashes:
            more = [f"and {len(clashes) - _SHOWN} more"] if len(clashes) > _SHOWN else []
            raise RobotError(
                f"prefix: expected one that keeps names apart, got {given!r}: {base.name} and {arm.name} "
                f"would both have {', '.join([*clashes[:_SHOWN], *more])}"
            )
        stem = given.rstrip("_/.-: ") or arm.name
    else:
        stem = arm.name
    key, count = stem, 0 if stem in _GROUPS else 1
    while key in taken:
        count += 1
        key = f"{stem}_{count}"
    if given is not None:
        return given, key
    if not _clashes(base, platform, body, ""):
        return "", key
    while _clashes(base, platform, body, f"{key}_") or key in taken:
        count += 1
        key = f"{stem}_{count}"
    return f"{key}_", key


def _clashes(base: Robot, platform: _Body, body: _Body, prefix: str) -> list[str]:
    """Names that both would have, sorted. Joints give inputs their names, so those count, too."""
    names = {prefix + name for name in body.names} & (platform.names | set(base.platform.inputs))
    return sorted(names | {prefix + name for name in body.shapes} & platform.shapes)


def _rename(body: _Body, prefix: str) -> None:
    for joint in range(1, body.model.njoints):
        body.model.names[joint] = prefix + body.model.names[joint]
    for frame in list(body.model.frames)[1:]:
        frame.name = prefix + frame.name
    for geometry in (body.visual, body.collision):
        for shape in geometry.geometryObjects:
            shape.name = prefix + shape.name


def _frame(base: Robot, at: str | None) -> str:
    if at is None:
        found = [name for name in _PLACES if name in base.frames]
        if len(found) != 1:
            expected = f"found {', '.join(found)}" if found else f"none is named {', '.join(_PLACES)}"
            names = ", ".join(base.frames)
            raise RobotError(
                f"at: which frame of {base.name} carries the arm? {expected}; available: {names}"
            )
        return found[0]
    if not isinstance(at, str) or at not in base.frames:
        raise RobotError(unknown("frame", at, base.frames, f"at: {base.name}"))
    return at


def _appended(
    platform: _Body, body: _Body, frame: str, pose: pin.SE3
) -> tuple[pin.Model, pin.GeometryModel, pin.GeometryModel]:
    """Both in one model, each shape model with the platform's shapes first."""
    model = platform.model
    kinds = (pin.FrameType.BODY, pin.FrameType.OP_FRAME)
    kind = next((kind for kind in kinds if model.existFrame(frame, kind)), None)
    index = model.getFrameId(frame) if kind is None else model.getFrameId(frame, kind)
    below, names = told_apart(model, "&below")
    above, more = told_apart(body.model, "&above")
    names |= more
    whole, visual = pin.appendModel(below, above, platform.visual, body.visual, index, pose)
    _, collision = pin.appendModel(below, above, platform.collision, body.collision, index, pose)
    for joined in whole.frames:
        joined.name = names.get(joined.name, joined.name)
    # It forgets the armature.
    for part in (model, body.model):
        for joint in range(1, part.njoints):
            image = whole.joints[whole.getJointId(part.names[joint])]
            whole.armature[image.idx_v] = part.armature[part.joints[joint].idx_v]
    return whole, visual, collision


def _mount_note(base: Robot, arm: Robot, key: str, frame: str, prefix: str) -> str:
    named = f", its names with the prefix {prefix}" if prefix else ""
    known = f" as {key}" if key != arm.name else ""
    return f"{arm.name} mounted{known} at {frame} of {base.name}{named}"


def _loaded_arm(source: str | Path | pin.Model) -> Robot:
    """The robot of a file whose arm is wanted: its platform matters only for which wheels stand still."""
    try:
        return load(source)
    except InputError:  # on no platform then: a joint may be called v, and a declared platform need not fit
        return load(source, platform=Fixed())


def _pose(placement: pin.SE3 | ArrayLike | Sequence[ArrayLike] | None) -> pin.SE3:
    """A pose from the forms that `mount` takes."""
    if placement is None:
        return pin.SE3.Identity()
    try:
        if isinstance(placement, pin.SE3):
            return _from_matrix(array(placement.homogeneous, "placement"))
        if isinstance(placement, Sequence) and len(placement) == 2:
            xyz, rpy = (vector(part, 3, name) for part, name in zip(placement, ("xyz", "rpy"), strict=True))
            return pin.SE3(pin.rpy.rpyToMatrix(rpy), xyz)
        matrix: ArrayLike = placement  # type: ignore[assignment]  # a sequence of rows is one, too
        return _from_matrix(array(matrix, "placement"))
    except InputError as error:
        raise RobotError(f"placement: {error}") from None


def _from_matrix(matrix: NDArray[np.float64]) -> pin.SE3:
    if matrix.shape != (4, 4):
        raise InputError(f"expected a pin.SE3, a matrix (4, 4) or (xyz, rpy), got shape {matrix.shape}")
    rotation = matrix[:3, :3]
    off = max(np.abs(rotation @ rotation.T - np.eye(3)).max(), np.abs(matrix[3] - [0, 0, 0, 1]).max())
    if off > _ROTATION or np.linalg.det(rotation) < 0.0:
        raise InputError("expected a rotation and a position over the row 0 0 0 1")
    return pin.SE3(rotation, matrix[:3, 3])
