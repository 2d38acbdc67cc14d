"""From what was read to a `Robot`: joints locked, reference point, platform, wheels, in this order."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np
import pinocchio as pin

from nmm.base.errors import InputError, RobotError, expect_known
from nmm.base.findings import Finding
from nmm.model.platforms import AddedJoint, FixedBase, Layout, Platform
from nmm.model.platforms.recognition import AT_ROOT
from nmm.model.platforms.wheel_layout import MAIN_BODY, standing_wheels, wheels_on
from nmm.model.robots.loading.chain import CHAIN, Rebuilt, rebuild
from nmm.model.robots.loading.ground import slip_warnings
from nmm.model.robots.loading.locking import (
    Locked,
    add_pairs,
    among_coordinates,
    at_zero,
    limit_notes,
    with_locked,
)
from nmm.model.robots.loading.measured_joints import Asked, Measured, speed_limit
from nmm.model.robots.loading.names_apart import (
    Names,
    apart,
    joints_among,
    name_notes,
    notes_with,
    of_file,
    renamed,
    with_names,
)
from nmm.model.robots.loading.passive_wheels import find_wheels, held_joints, without_radius
from nmm.model.robots.loading.platform_choice import (
    Options,
    axle_placement,
    choose_platform,
    is_fixed_base,
    measured_of,
    yaw_of,
)
from nmm.model.robots.loading.provenance import Parts, acceleration_notes
from nmm.model.robots.loading.source import Source
from nmm.model.robots.loading.virtual_base import find_virtual_base, gantry
from nmm.model.robots.loading.wheel_search import find_undercarriage
from nmm.model.robots.robot import Robot
from nmm.model.robots.wheel import Wheel


def robot_from(source: Source, options: Options) -> Robot:
    """`RobotError` for an unusable joint, an unknown joint or frame, a platform that does not fit, wheels
    that leave open how they drive."""
    where, is_fixed = source.where, is_fixed_base(source, options)
    source, names = apart(source)
    options = _naming(options, names)
    rebuilt = rebuild(source.model, (source.visual_model, source.collision_model), where)
    rebuilt.model.name = options.name or source.name
    stated = options.platform.coordinates[len(CHAIN) :] if isinstance(options.platform, Platform) else ()
    made = with_locked(rebuilt, options.lock, source.mimic_joints, where, stated)
    base, slides = find_virtual_base(made.rebuilt.model, where), gantry(made.rebuilt.model, where)
    stands = bool(slides) and options.platform is None and source.platform is None
    if stands:
        options, is_fixed, base = replace(options, platform=FixedBase()), True, None
    if base is not None and not is_fixed:
        made = _standing(made, dict.fromkeys(base.joints, 0.0), where)
        made = replace(made, rebuilt=_about(made.rebuilt, base.place, where))
    undercarriage = find_undercarriage(measured_of(made, source), options.wheels, stated)
    if undercarriage.held:
        made = _standing(made, undercarriage.held, where)
    source = replace(source, undercarriage=undercarriage)
    if options.axle is not None:
        made = _moved(made, axle_placement(made.rebuilt.model, options.axle, where), where)
    chosen = choose_platform(made, source, options, base)
    platform, layout = chosen.platform, chosen.layout
    if options.axle is None and chosen.reference != AT_ROOT:
        x, y, yaw = chosen.reference
        made = _moved(made, pin.SE3(pin.utils.rotate("z", yaw), np.array([x, y, 0.0])), where)
    if options.limits:
        try:
            platform = platform.with_limits(options.limits)
        except InputError as error:
            raise error.at(where, RobotError) from None
    made = _turned_up(made, platform, where)
    remarks = [*undercarriage.notes(), *chosen.remarks]
    if stands:
        remarks.append(Finding("gantry", {"names": [*slides]}))
    if base is not None:
        platform = base.limited(platform)
        of_base = {new: old for new, old in of_file(names).items() if new in base.joints}
        made = replace(made, rebuilt=replace(made.rebuilt, notes=notes_with(made.rebuilt.notes, of_base)))
        remarks += notes_with([base.note(platform)], of_base)
    rebuilt = made.rebuilt
    added = None if layout is None else platform.added_joint(layout)
    if added is not None:
        rebuilt = _with_joint(rebuilt, added, where)
    own = _own_joints(platform, rebuilt.model, made.values, where)
    made = replace(made, rebuilt=_on_platform(rebuilt, platform, own, source, where))
    if not platform.coordinates:
        made = renamed(_with_held_wheels(made, options.wheels, source), of_file(names))
        names = {old: new for old, new in names.items() if old not in CHAIN}
    elif layout is not None:
        made, more = _with_idle_parts_held(made, layout, own, source)
        remarks += more
    like_inputs = joints_among(made.rebuilt.model, platform.inputs)
    made, names, options = renamed(made, like_inputs), {**names, **like_inputs}, _naming(options, like_inputs)
    remarks += name_notes(names, () if base is None else base.joints)
    provenance = replace(
        source.provenance,
        locked=made.values,
        mimicked=made.mimicked,
        platform="base" if stands else chosen.origin,
        contradictions=chosen.contradictions,
        base=() if base is None or is_fixed else base.joints,
        accelerations=with_names(source.provenance.accelerations, names),
        renamed={**source.provenance.renamed, **names},
    )
    parts = Parts(made.rebuilt.geometries[1], (*source.notes, *made.rebuilt.notes, *remarks), provenance)
    sliding = () if layout is None else _sliding(layout)
    return _without_wheels(made, platform, own, source, options, parts, sliding)


def _sliding(layout: Layout) -> frozenset[str]:
    """The main body's wheels that constrain nothing."""
    standing = {wheel.joint for wheel in standing_wheels(layout)}
    return frozenset({wheel.joint for wheel in wheels_on(layout, MAIN_BODY)} - standing)


def _moved(made: Locked, placement: pin.SE3, where: str) -> Locked:
    """The model whose coordinates are of the point and x axis of `placement`, in the root link."""
    rebuilt = made.rebuilt
    moved = rebuild(rebuilt.model, rebuilt.geometries, where, root=placement.inverse())
    reached = {"at": (placement.translation + 0.0).tolist(), "yaw": yaw_of(placement)}
    notes = (*rebuilt.notes, Finding("reference_moved", reached))
    return replace(made, rebuilt=replace(moved, notes=notes))


def _naming(options: Options, names: Names) -> Options:
    """The options with other names of joints and frames."""
    given = {key: with_names(getattr(options, key), names) for key in ("lock", "wheels", "axle", "steer")}
    return replace(options, **given)


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
    made: Locked,
    platform: Platform,
    own: Sequence[str],
    source: Source,
    options: Options,
    parts: Parts,
    sliding: Collection[str],
) -> Robot:
    """The robot, with its wheels on the display model only."""
    whole, (shown, solid) = made.rebuilt.model, made.rebuilt.geometries
    wheels: tuple[Wheel, ...] = ()
    notes: list[Finding] = []
    if platform.coordinates:
        asked = options.wheels
        if asked is not None:  # those that stand still are joints no more
            left = {str(name) for name in whole.names}
            kept = [name for name in asked if name in left]
            asked = {name: asked[name] for name in kept} if isinstance(asked, Mapping) else kept
        wheels, notes = find_wheels(measured_of(made, source), asked, own, platform, sliding)
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
    remarks = (*limit_notes(robot), *acceleration_notes(robot), *slip_warnings(robot))
    return replace(robot, **robot.shapes._asdict(), notes=(*robot.notes, *remarks))


def _standing(made: Locked, values: Mapping[str, float], where: str) -> Locked:
    """The model with more joints, and their mimic joints, fixed at these values, rad or m; no note."""
    others = [one for one in made.mimic_joints if one.joint not in values]
    still = with_locked(made.rebuilt, {}, others, where, standing=dict(values))
    return replace(still, values=made.values, mimicked={**made.mimicked, **still.mimicked})


def _with_held_wheels(made: Locked, asked: Asked, source: Source) -> Locked:
    """The model of a base that does not move, with its wheels and their mimic joints fixed."""
    display = made.rebuilt
    names, notes = held_joints(measured_of(made, source), asked)
    if not names:
        return replace(made, rebuilt=replace(display, notes=(*display.notes, *notes)))
    still = _standing(made, dict.fromkeys(names, 0.0), source.where)
    notes += [Finding("wheels_held", {"names": [*names]}), *still.rebuilt.notes[len(display.notes) :]]
    return replace(still, rebuilt=replace(still.rebuilt, notes=(*display.notes, *notes)))


def _with_idle_parts_held(
    made: Locked, layout: Layout, own: Sequence[str], source: Source
) -> tuple[Locked, list[Finding]]:
    """The model in which what steers without a wheel's joint, and is not the platform's own, stands still;
    so do wheels whose size nothing tells."""
    carrying = {wheel.carrier for wheel in layout.wheels}
    follows = {one.joint for one in made.mimic_joints}
    idle = [
        pivot.joint
        for pivot in layout.pivots
        if pivot.steers and pivot.joint not in (*own, *carrying, *follows)
    ]
    unknown = without_radius(measured_of(made, source), layout)
    notes = [Finding("steering_held", {"names": idle})] if idle else []
    notes += [Finding("radius_unknown", {"names": [*unknown]})] if unknown else []
    if not idle and not unknown:
        return made, []
    before = made.rebuilt.notes
    still = _standing(made, dict.fromkeys((*idle, *unknown), 0.0), source.where)
    return replace(still, rebuilt=replace(still.rebuilt, notes=before)), notes
