"""`mount`: an arm put on a platform, each from a file of its own."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from nmm.base.arrays import array, vector
from nmm.base.errors import InputError, RobotError, expect_known, few
from nmm.base.findings import Finding
from nmm.model.platforms import FixedBase
from nmm.model.robots.loading.chain import CHAIN, rebuild
from nmm.model.robots.loading.draft import LoadOptions
from nmm.model.robots.loading.load import load
from nmm.model.robots.loading.locking import add_pairs, told_apart
from nmm.model.robots.loading.passes import robot_from
from nmm.model.robots.loading.provenance import loaded_parts, with_wheels_fixed
from nmm.model.robots.loading.source import Source
from nmm.model.robots.numbers import numbers_for, prefixed, with_numbers, without_changes
from nmm.model.robots.robot import Robot, frame_index

_PLACES = ("mount", "arm_mount", "top")
_GROUPS = ("platform", "arm")
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
        raise RobotError(where="name", expected="a string", got=name)
    base = platform if isinstance(platform, Robot) else load(platform)
    other = arm if isinstance(arm, Robot) else _loaded_arm(arm)
    mounted, before = _mounted(
        without_changes(base), without_changes(other), at, _pose(placement), prefix, name
    )
    numbers = {prefixed(number, before): value for number, value in other.changed_numbers.items()}
    known = numbers_for(mounted, numbers)  # those of the arm's own platform go with it
    numbers = {number: value for number, value in numbers.items() if number in known}
    return with_numbers(mounted, {**numbers, **base.changed_numbers})


@dataclass(frozen=True, eq=False)
class _Body:
    model: pin.Model
    visual: pin.GeometryModel
    collision: pin.GeometryModel

    @property
    def names(self) -> set[str]:
        return {*self.model.names, *(frame.name for frame in self.model.frames)} - {"universe"}

    @property
    def shapes(self) -> list[pin.GeometryObject]:
        """All shapes: visual ones may have the names of collision shapes."""
        return [*self.visual.geometryObjects, *self.collision.geometryObjects]

    def rename(self, prefix: str) -> None:
        for joint in range(1, self.model.njoints):
            self.model.names[joint] = prefix + self.model.names[joint]
        for named in (*list(self.model.frames)[1:], *self.shapes):
            named.name = prefix + named.name


def _mounted(
    base: Robot, arm: Robot, at: str | None, pose: pin.SE3, prefix: str | None, name: str | None
) -> tuple[Robot, str]:
    """The robot, and the prefix that the arm's names got."""
    parts, arm_parts = loaded_parts(base), loaded_parts(arm)
    platform = _Body(base.display_model, base.shapes.visual_model, parts.collision_model)
    # The arm alone: of a fixed base, with its wheels standing still.
    model, shapes = with_wheels_fixed(arm)
    replaced = len(CHAIN) if arm.platform.coordinates else 0
    root = model.jointPlacements[1] if replaced else pin.SE3.Identity()
    rebuilt = rebuild(model, shapes, arm.name, root=root, head=(), replaced=replaced)
    body = _Body(rebuilt.model, *rebuilt.geometries)
    if body.model.nq == 0:
        raise RobotError("has no movable joint, so it is no arm", where=arm.name)
    prefix, key = _prefix(base, arm, platform, body, prefix)
    body.rename(prefix)
    frame = _frame(base, at)
    whole, visual, collision = _appended(platform, body, frame, pose)
    joints = tuple(str(joint) for joint in list(body.model.names)[1:])
    provenance = parts.provenance.with_arm(arm_parts.provenance, key, prefix)
    notes = [replace(note, where={**note.where, "arm": key}) for note in arm_parts.notes]
    mounted = {"name": arm.name, "key": key, "frame": frame, "base": base.name, "prefix": prefix}
    source = Source(
        name=name or f"{base.name} with {key}",
        where=f"{base.name} with {key}",
        label=f"{base.source} + {arm.source}",
        model=whole,
        visual_model=visual,
        collision_model=collision,
        all_pairs=False,
        on_chain=bool(base.platform.coordinates),
        arguments={**base.arguments, **{f"{key}.{k}": value for k, value in arm.arguments.items()}},
        notes=(*parts.notes, *notes, Finding("arm_mounted", mounted)),
        provenance=provenance,
        mimic_joints=(*base.mimic_joints, *(mimic.renamed(prefix) for mimic in arm.mimic_joints)),
    )

    def pairs(model: pin.Model, geometry: pin.GeometryModel) -> None:
        """The pairs of both robots, by the shapes' indices, and those of one's shapes with the other's."""
        geometry.removeAllCollisionPairs()
        count = platform.collision.ngeoms
        for pair in base.shapes.collision_model.collisionPairs:
            geometry.addCollisionPair(pair)
        for pair in arm.shapes.collision_model.collisionPairs:
            geometry.addCollisionPair(pin.CollisionPair(pair.first + count, pair.second + count))
        add_pairs(model, geometry, count)

    wheels = {wheel.joint: wheel.radius for wheel in base.wheels}
    robot = robot_from(source, LoadOptions(base.platform, wheels, add_pairs=pairs))
    own = {key: getattr(provenance, key) for key in ("locked", "mimicked", "platform")}
    new_parts = replace(robot.parts, provenance=replace(robot.parts.provenance, **own))
    semantics = base.semantics.with_arm(arm.semantics, prefix, joints)
    arms = {**base.arms, key: joints}
    made = replace(robot, **robot.shapes._asdict(), arms=arms, semantics=semantics, parts=new_parts)
    return made, prefix


def _prefix(base: Robot, arm: Robot, platform: _Body, body: _Body, prefix: str | None) -> tuple[str, str]:
    """The prefix of the arm's names, and what the arm is called."""
    if prefix is not None and not isinstance(prefix, str):
        raise RobotError(where="prefix", expected="text", got=prefix)
    taken = {*_GROUPS, *base.arms, *base.u_names}
    clashes = _clashes(base, platform, body, prefix or "")
    if prefix is not None and clashes:
        what = f"with it {base.name} and {arm.name} would both have {few(clashes)}"
        raise RobotError(what, where="prefix", expected="one that keeps names apart", got=prefix)
    stem = (prefix or "").rstrip("_/.-: ") or arm.name
    key, count = stem, 0 if stem in _GROUPS else 1
    while key in taken or (clashes and _clashes(base, platform, body, f"{key}_")):
        count += 1
        key = f"{stem}_{count}"
    return f"{key}_" if clashes else prefix or "", key


def _clashes(base: Robot, platform: _Body, body: _Body, prefix: str) -> list[str]:
    """Names that both would have, sorted; joints count, as they give inputs their names."""
    names = {prefix + name for name in body.names} & (platform.names | set(base.platform.inputs))
    shapes = {shape.name for shape in platform.shapes} & {prefix + shape.name for shape in body.shapes}
    return sorted(names | shapes)


def _frame(base: Robot, at: str | None) -> str:
    if at is None:
        places = [name for name in _PLACES if name in base.frames]
        if len(places) != 1:
            what = f"found {', '.join(places)}" if places else f"none is named {', '.join(_PLACES)}"
            what = f"which frame of {base.name} carries the arm? {what}"
            raise RobotError(what, where="at", available=base.frames)
        return places[0]
    expect_known("frame", at, base.frames, f"at: {base.name}", RobotError)
    return at


def _appended(
    platform: _Body, body: _Body, frame: str, pose: pin.SE3
) -> tuple[pin.Model, pin.GeometryModel, pin.GeometryModel]:
    index = frame_index(platform.model, frame)
    below, names = told_apart(platform.model, "&below")
    above, more = told_apart(body.model, "&above")
    names |= more
    whole, visual = pin.appendModel(below, above, platform.visual, body.visual, index, pose)
    _, collision = pin.appendModel(below, above, platform.collision, body.collision, index, pose)
    for joined in whole.frames:
        joined.name = names.get(joined.name, joined.name)
    for part in (platform.model, body.model):
        for joint in range(1, part.njoints):
            image = whole.joints[whole.getJointId(part.names[joint])]
            whole.armature[image.idx_v] = part.armature[part.joints[joint].idx_v]
    return whole, visual, collision


def _loaded_arm(source: str | Path | pin.Model) -> Robot:
    """The robot of a file whose arm is wanted: its platform matters only for which wheels stand still."""
    with suppress(InputError):  # on no platform then: a declared one need not fit
        robot = load(source)
        if not robot.renamed:  # nor need a joint be called otherwise than v
            return robot
    return load(source, platform=FixedBase())


def _pose(placement: pin.SE3 | ArrayLike | Sequence[ArrayLike] | None) -> pin.SE3:
    if placement is None:
        return pin.SE3.Identity()
    try:
        if isinstance(placement, Sequence) and len(placement) == 2:
            xyz, rpy = (
                vector(part, 3, f"placement: {name}")
                for part, name in zip(placement, ("xyz", "rpy"), strict=True)
            )
            return pin.SE3(pin.rpy.rpyToMatrix(rpy), xyz)
        values: Any = placement.homogeneous if isinstance(placement, pin.SE3) else placement
        matrix = array(values, "placement")
    except InputError as error:
        raise error.placed(error.where, RobotError) from None
    if matrix.shape != (4, 4):
        raise RobotError(where="placement", expected="a pin.SE3, a matrix (4, 4) or (xyz, rpy)", got=matrix)
    rotation = matrix[:3, :3]
    off = max(np.abs(rotation @ rotation.T - np.eye(3)).max(), np.abs(matrix[3] - [0, 0, 0, 1]).max())
    if off > _ROTATION or np.linalg.det(rotation) < 0.0:
        expected = "a rotation and a position over the row 0 0 0 1"
        raise RobotError(where="placement", expected=expected, got=matrix)
    return pin.SE3(rotation, matrix[:3, 3])
