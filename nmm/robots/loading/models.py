"""From what was read to a `Robot`: joints locked, reference point, platform, wheels, in this order."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from nmm.arrays import array
from nmm.errors import InputError, RobotError, expect_known
from nmm.findings import Finding
from nmm.platforms import AddedJoint, FixedBase, Layout, Platform, platform_by_name, usual_platform
from nmm.robots.loading.chain import CHAIN, Rebuilt, rebuild
from nmm.robots.loading.ground import slip_warnings, steered_casters
from nmm.robots.loading.locking import Locked, add_pairs, among_coordinates, at_zero, limit_notes, with_locked
from nmm.robots.loading.measured_joints import (
    Asked,
    Measured,
    differing_radii,
    find_wheels,
    held_joints,
    measure_layout,
    speed_limit,
)
from nmm.robots.loading.provenance import Parts
from nmm.robots.loading.source import Source
from nmm.robots.loading.virtual_base import VirtualBase, find_virtual_base, gantry
from nmm.robots.robot import Robot
from nmm.robots.wheel import Wheel

# How far from upright a frame's z axis may be: files write pi/2 with a few digits.
_LEVEL = 1e-3
#: Adds its pairs to the collision shapes on a model.
AddPairs = Callable[[pin.Model, pin.GeometryModel], None]


@dataclass(frozen=True)
class Options:
    platform: Platform | str | None = None
    wheels: Asked = None
    lock: Mapping[str, float] = field(default_factory=dict)
    axle: str | ArrayLike | None = None
    name: str | None = None
    limits: Mapping[str, float] = field(default_factory=dict)
    add_pairs: AddPairs | None = None


def robot_from(source: Source, options: Options) -> Robot:
    """`RobotError` for an unusable joint, an unknown joint or frame, a platform that does not fit."""
    where, is_fixed = source.where, _is_fixed(source, options)
    rebuilt = rebuild(source.model, (source.visual_model, source.collision_model), where)
    rebuilt.model.name = options.name or source.name
    stated = options.platform.coordinates[len(CHAIN) :] if isinstance(options.platform, Platform) else ()
    made = with_locked(rebuilt, options.lock, source.mimic_joints, where, stated)
    base, slides = find_virtual_base(made.rebuilt.model, where), gantry(made.rebuilt.model, where)
    stands = bool(slides) and options.platform is None and source.platform is None
    if stands:
        options, is_fixed, base = replace(options, platform=FixedBase()), True, None
    if base is not None and not is_fixed:
        made = _standing(made, base.joints, where)
        made = replace(made, rebuilt=_about(made.rebuilt, base.place, where))
    rebuilt = made.rebuilt
    if options.axle is not None:
        placement = _axle_placement(rebuilt.model, options.axle, where)
        moved = rebuild(rebuilt.model, rebuilt.geometries, where, root=placement.inverse())
        reached = {"at": placement.translation.tolist(), "yaw": _yaw(placement)}
        rebuilt = replace(moved, notes=(*rebuilt.notes, Finding("reference_moved", reached)))
    platform, origin, layout, contradictions = _platform(rebuilt, source, options, base)
    if options.limits:
        try:
            platform = platform.with_limits(options.limits)
        except InputError as error:
            raise error.at(where, RobotError) from None
    made = _turned_up(replace(made, rebuilt=rebuilt), platform, where)
    rebuilt = made.rebuilt
    remarks = [*contradictions]
    if stands:
        origin = "base"
        remarks.append(Finding("gantry", {"names": [*slides]}))
    if base is not None:
        platform = base.limited(platform)
        remarks.append(base.note(platform))
    added = None if layout is None else platform.added_joint(layout)
    if added is not None:
        rebuilt = _with_joint(rebuilt, added, where)
    own = _own_joints(platform, rebuilt.model, made.values, where)
    made = replace(made, rebuilt=_on_platform(rebuilt, platform, own, source, where))
    if not platform.coordinates:
        made = _with_held_wheels(made, options.wheels, where)
    provenance = replace(
        source.provenance,
        locked=made.values,
        mimicked=made.mimicked,
        platform=origin,
        contradictions=contradictions,
    )
    parts = Parts(made.rebuilt.geometries[1], (*source.notes, *made.rebuilt.notes, *remarks), provenance)
    return _without_wheels(made, platform, own, source, options, parts)


def _axle_placement(model: pin.Model, axle: str | ArrayLike, where: str) -> pin.SE3:
    """Pose of the platform's reference point in the root link (`load`'s `axle`): a position and a yaw."""
    if isinstance(axle, str):
        return _level_frame(model, axle, f"{where}: axle")
    try:
        point = array(axle, "axle")
    except InputError as error:
        raise error.at(where, RobotError) from None
    if point.shape not in ((2,), (3,)):
        expected = "a frame, x and y, or x, y and z (m)"
        raise RobotError(where=f"{where}: axle", expected=expected, got=axle)
    return pin.SE3(np.eye(3), np.append(point, np.zeros(3 - len(point))))


def _level_frame(model: pin.Model, name: str, where: str) -> pin.SE3:
    """Position and yaw of a level frame of the root link's body."""
    known = {frame.name: frame for frame in model.frames}
    fixed = {frame.name: frame for frame in model.frames if frame.parentJoint == len(CHAIN)}
    if name in known and name not in fixed:
        joint = model.names[known[name].parentJoint]
        what = f"frame {name!r} is not on the root link's body: joint {joint} moves it"
        raise RobotError(what, where=where, got=name)
    expect_known("frame", name, fixed, where, RobotError)
    placement = fixed[name].placement
    if placement.rotation[2, 2] < 1.0 - 0.5 * _LEVEL**2:
        raise RobotError(f"frame {name!r} is tilted, expected its z axis upwards", where=where, got=name)
    return pin.SE3(pin.utils.rotate("z", _yaw(placement)), np.array(placement.translation))


def _yaw(placement: pin.SE3) -> float:
    return float(np.arctan2(placement.rotation[1, 0], placement.rotation[0, 0]))


def _platform(
    rebuilt: Rebuilt, source: Source, options: Options, base: VirtualBase | None
) -> tuple[Platform, str, Layout | None, tuple[Finding, ...]]:
    """The platform, who chose its kind, the file's wheels and joints, and where that differs."""
    given = options.platform
    name, origin = (source.platform, "file") if given is None else (given, "given")
    if name is None and base is not None and base.kind is not None:
        name, origin = base.kind, "base"
    if _is_fixed(source, options):
        return FixedBase(), origin, None, ()  # there is nothing to measure
    visual, collision = rebuilt.geometries
    try:
        layout = measure_layout(rebuilt.model, (collision, visual), options.wheels, source.where)
    except RobotError:
        if name is not None and not isinstance(name, Platform):
            raise
        layout = None  # its lengths are not needed
    try:
        if isinstance(name, Platform):
            platform = name
        elif name is None or layout is None:
            platform, origin = usual_platform(layout)
            if base is not None and origin == "default":
                origin = "base"
        else:
            platform = platform_by_name(name).fit(layout)
        contradictions: tuple[Finding, ...] = ()
        if layout is not None:
            shapes = rebuilt.model, (collision, visual), options.wheels, source.where
            contradictions = (*platform.compared(layout), *differing_radii(*shapes))
        return platform, origin, layout, contradictions
    except InputError as error:
        raise error.at(source.where, RobotError) from None


def _is_fixed(source: Source, options: Options) -> bool:
    chosen = source.platform if options.platform is None else options.platform
    return isinstance(chosen, FixedBase) or chosen == FixedBase.name


def _turned_up(made: Locked, platform: Platform, where: str) -> Locked:
    """The model in which the platform's own joints whose axes point down have them upwards: platforms count
    angles to the left."""
    rebuilt = made.rebuilt
    measured = Measured(rebuilt.model, (), where)
    own = [name for name in platform.coordinates[len(CHAIN) :] if name in measured.joints]
    down = [name for name in own if measured.points_down(measured.joints[name])]
    if not down:
        return made
    turned = rebuild(rebuilt.model, rebuilt.geometries, where, reversed_joints=down)
    notes = (*rebuilt.notes, Finding("joints_reversed", {"names": down}))
    mimic_joints = tuple(one.reversed(down) for one in made.mimic_joints)
    return replace(made, rebuilt=replace(turned, notes=notes), mimic_joints=mimic_joints)


def _with_joint(rebuilt: Rebuilt, added: AddedJoint, where: str) -> Rebuilt:
    """The model with the platform's joint on the root's body; an existing one of that name gets its limits.
    `RobotError` where a frame that is no joint has the name."""
    model, name = rebuilt.model.copy(), added.joint
    if model.existJointName(name):
        joint = model.joints[model.getJointId(name)]
        model.lowerPositionLimit[joint.idx_q] = max(model.lowerPositionLimit[joint.idx_q], added.lower)
        model.upperPositionLimit[joint.idx_q] = min(model.upperPositionLimit[joint.idx_q], added.upper)
        model.velocityLimit[joint.idx_v] = min(speed_limit(model, model.getJointId(name)), added.velocity)
        return replace(rebuilt, model=model)
    if model.existFrame(name):
        what = (
            f"a frame is named {name}, as the coordinate that this platform adds: give the frame "
            "another name, or the platform another for it, as in Car(wheelbase, steering=NAME)"
        )
        raise RobotError(what, where=where, got=name)
    place = pin.SE3(np.eye(3), np.array([added.x, added.y, 0.0]))
    ends = (-np.inf, np.inf, -added.velocity, added.velocity, added.lower, added.upper, 0.0, 0.0, 0.0)
    model.addJoint(len(CHAIN), pin.JointModelRZ(), place, name, *(np.full(1, end) for end in ends))
    note = Finding("joint_added", {"name": name})
    return replace(rebuilt, model=model, notes=(*rebuilt.notes, note))


def _own_joints(
    platform: Platform, model: pin.Model, lock: Mapping[str, float], where: str
) -> tuple[str, ...]:
    own = platform.coordinates[len(CHAIN) :]
    joints = [str(name) for name in model.names][len(CHAIN) + 1 :]
    for name in own:
        if name in lock:
            what = f"{name} is a coordinate of the {platform.name} platform"
            raise RobotError(what, where=f"{where}: lock", got=name)
        expect_known("platform joint", name, joints, where, RobotError)
    return own


def _about(rebuilt: Rebuilt, place: pin.SE3, where: str) -> Rebuilt:
    """The model whose x, y and theta count from a place in its root link, and nothing else changes."""
    model = rebuilt.model.copy()
    model.jointPlacements[1] = model.jointPlacements[1] * place
    moved = rebuild(model, rebuilt.geometries, where, root=place.inverse())
    return replace(moved, notes=rebuilt.notes)


def _on_platform(
    rebuilt: Rebuilt, platform: Platform, own: Sequence[str], source: Source, where: str
) -> Rebuilt:
    model = rebuilt.model
    if not platform.coordinates:
        start = {} if source.mjcf is None else source.mjcf.start
        x, y, yaw = (start.get(name, 0.0) for name in CHAIN)
        stands = pin.SE3(pin.utils.rotate("z", yaw), np.array([x, y, 0.0]))
        root = stands * model.jointPlacements[1]
        made = rebuild(model, rebuilt.geometries, where, root=root, head=())
    else:
        made = rebuild(model, rebuilt.geometries, where, first=own) if own else rebuilt
    return replace(made, notes=rebuilt.notes)


def _without_wheels(
    made: Locked, platform: Platform, own: Sequence[str], source: Source, options: Options, parts: Parts
) -> Robot:
    """The robot, with its wheels on the display model only."""
    whole, (shown, solid) = made.rebuilt.model, made.rebuilt.geometries
    wheels: tuple[Wheel, ...] = ()
    notes: list[Finding] = []
    if platform.coordinates:
        wheels, notes = find_wheels(whole, (solid, shown), options.wheels, source.where, own, platform)
    names = list(dict.fromkeys(name for wheel in wheels for name in wheel.joints))
    model = whole
    if names:
        turned = [wheel.joint for wheel in wheels]
        notes.append(Finding("wheels_left_out", {"names": turned}))
        if swivels := [name for name in names if name not in turned]:
            notes.append(Finding("swivels_left_out", {"names": swivels}))
        model, (solid,) = at_zero(whole, (solid,), names)
    elif source.all_pairs or options.add_pairs:
        solid = solid.copy()
    mimic_joints, more = among_coordinates(made.mimic_joints, names, source.where)
    notes += more
    if model.nq == platform.n_p:
        notes.append(Finding("no_arm" if model.nq else "nothing_moves"))
    add = options.add_pairs or (add_pairs if source.all_pairs else None)
    if add is not None:
        add(model, solid)
        if len(solid.collisionPairs):
            notes.append(Finding("collision_pairs", {"count": len(solid.collisionPairs)}))
    model.name = whole.name
    robot = Robot(
        name=model.name,
        model=model,
        collision_model=solid,
        display_model=whole,
        visual_model=shown,
        platform=platform,
        wheels=wheels,
        source=source.label,
        arguments=dict(source.arguments),
        notes=(*parts.notes, *notes),
        mimic_joints=mimic_joints,
        parts=replace(parts, provenance=replace(parts.provenance, reduced=tuple(names))),
    )
    casters = steered_casters(robot) if parts.provenance.platform == "default" else ()
    remarks = (*limit_notes(robot), *slip_warnings(robot), *casters)
    return replace(robot, **robot.shapes._asdict(), notes=(*robot.notes, *remarks))


def _standing(made: Locked, names: Sequence[str], where: str) -> Locked:
    """The model with more joints, and their mimic joints, fixed at zero; no note."""
    others = [one for one in made.mimic_joints if one.joint not in names]
    still = with_locked(made.rebuilt, {}, others, where, standing=dict.fromkeys(names, 0.0))
    return replace(still, values=made.values, mimicked={**made.mimicked, **still.mimicked})


def _with_held_wheels(made: Locked, asked: Asked, where: str) -> Locked:
    """The model of a base that does not move, with its wheels and their mimic joints fixed."""
    display = made.rebuilt
    names, notes = held_joints(display.model, asked, where)
    if not names:
        return replace(made, rebuilt=replace(display, notes=(*display.notes, *notes)))
    still = _standing(made, names, where)
    notes += [Finding("wheels_held", {"names": [*names]}), *still.rebuilt.notes[len(display.notes) :]]
    return replace(still, rebuilt=replace(still.rebuilt, notes=(*display.notes, *notes)))
