"""From what was read to a `Robot`: `PASSES` change one draft, in their order."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
import pinocchio as pin

from nmm.base.errors import InputError, RobotError, expect_known
from nmm.base.findings import Finding
from nmm.model.platforms import AddedJoint, FixedBase
from nmm.model.platforms.recognition import AT_ROOT
from nmm.model.platforms.wheel_layout import MAIN_BODY, standing_wheels, wheels_on
from nmm.model.robots.loading.chain import CHAIN, joint_notes, yaw_of
from nmm.model.robots.loading.check import RESERVED
from nmm.model.robots.loading.draft import LoadOptions, RobotDraft
from nmm.model.robots.loading.ground import slip_warnings
from nmm.model.robots.loading.locking import add_pairs, among_coordinates, at_zero, limit_notes, locked_values
from nmm.model.robots.loading.measured_joints import speed_limit
from nmm.model.robots.loading.names_apart import frames_among, joints_among, renamed_findings, with_names
from nmm.model.robots.loading.passive_wheels import find_wheels, held_joints, without_radius
from nmm.model.robots.loading.platform_choice import axle_placement, choose_platform
from nmm.model.robots.loading.provenance import Parts, acceleration_notes
from nmm.model.robots.loading.source import Source
from nmm.model.robots.loading.virtual_base import find_virtual_base, gantry
from nmm.model.robots.loading.wheel_search import find_undercarriage
from nmm.model.robots.robot import Robot


def robot_from(source: Source, options: LoadOptions) -> Robot:
    """`RobotError` for an unusable joint, an unknown joint or frame, a platform that does not fit, wheels
    that leave open how they drive."""
    draft = RobotDraft(source, options)
    for change in PASSES:
        change(draft)
    return _finished(draft)


def _free_names(draft: RobotDraft) -> None:
    """Joints and links give way where they have the names of a platform's coordinates."""
    if draft.source.on_chain:
        return
    model, kinds = draft.model, pin.FrameType
    draft.names = frames_among(model, kinds.BODY, RESERVED, "link")
    draft.names |= frames_among(model, kinds.FIXED_JOINT, RESERVED, "joint") | joints_among(model, RESERVED)
    if draft.names:
        draft.model = model.copy()
        draft.rename(draft.names)
    draft.rename_options(draft.names)


def _put_on_chain(draft: RobotDraft) -> None:
    """x, y and theta come first, and every joint has one number."""
    draft.notes += joint_notes(draft.model)
    draft.rebuild()
    draft.model.name = draft.options.name or draft.source.name


def _lock(draft: RobotDraft) -> None:
    """The joints of `lock` stand still."""
    own = draft.stated_joints
    draft.locked = locked_values(draft.model, draft.options.lock, draft.mimic_joints, own, draft.where)
    followers = draft.hold(draft.locked)
    if draft.locked:
        draft.notes.append(Finding("joints_locked", {"values": draft.locked}))
    draft.notes += followers


def _find_base(draft: RobotDraft) -> None:
    """Joints that move the whole robot give way to x, y and theta, which count from where these have it; of a
    gantry they are coordinates, on a fixed base."""
    base, slides = find_virtual_base(draft.model, draft.where), gantry(draft.model, draft.where)
    if slides and draft.asked_platform is None:
        draft.gantry, draft.options = slides, replace(draft.options, platform=FixedBase())
        return
    draft.base = base
    if base is not None and not draft.is_fixed_base:
        draft.notes += draft.hold(dict.fromkeys(base.joints, 0.0))
        draft.model = draft.model.copy()
        draft.model.jointPlacements[1] = draft.model.jointPlacements[1] * base.place
        draft.rebuild(root=base.place.inverse())


def _hold_undercarriage(draft: RobotDraft) -> None:
    """What is between the base and its wheels stands still."""
    draft.undercarriage = find_undercarriage(draft.measured(), draft.options.wheels, draft.stated_joints)
    draft.notes += draft.hold(draft.undercarriage.held)
    draft.remarks += draft.undercarriage.notes()


def _choose_platform(draft: RobotDraft) -> None:
    """The platform is chosen and measured; x, y and theta are those of its reference point."""
    if draft.options.axle is not None:
        _move_reference(draft, axle_placement(draft.model, draft.options.axle, draft.where))
    x, y, yaw = reference = choose_platform(draft)
    if draft.options.axle is None and reference != AT_ROOT:
        _move_reference(draft, pin.SE3(pin.utils.rotate("z", yaw), np.array([x, y, 0.0])))
    if draft.options.limits:
        try:
            draft.platform = draft.platform.with_limits(draft.options.limits)
        except InputError as error:
            raise error.at(draft.where, RobotError) from None


def _move_reference(draft: RobotDraft, placement: pin.SE3) -> None:
    """The coordinates become those of the point and x axis of `placement`, in the root link."""
    draft.rebuild(root=placement.inverse())
    reached = {"at": (placement.translation + 0.0).tolist(), "yaw": yaw_of(placement)}
    draft.notes.append(Finding("reference_moved", reached))


def _turn_joints_up(draft: RobotDraft) -> None:
    """The platform's own joints whose axes point down get them upwards: their angles count to the left."""
    measured = draft.measured()
    own = [name for name in draft.platform.coordinates[len(CHAIN) :] if name in measured.joints]
    down = [name for name in own if measured.points_down(measured.joints[name])]
    if down:
        draft.rebuild(reversed_joints=down)
        draft.notes.append(Finding("joints_reversed", {"names": down}))
        draft.mimic_joints = tuple(mimic.reversed(down) for mimic in draft.mimic_joints)


def _tell_base(draft: RobotDraft) -> None:
    """The platform takes over limits of joints in whose place it is; these are told by the file's names."""
    if draft.gantry:
        draft.remarks.append(Finding("gantry", {"names": [*draft.gantry]}))
    if draft.base is not None:
        draft.platform = draft.base.limited(draft.platform)
        of_base = {new: old for new, old in _chain_names(draft).items() if new in draft.base.joints}
        draft.notes = renamed_findings(draft.notes, of_base)
        draft.remarks += renamed_findings([draft.base.note(draft.platform)], of_base)


def _chain_names(draft: RobotDraft) -> dict[str, str]:
    """The file's names by the new ones, of what was called x, y or theta."""
    return {new: old for old, new in draft.names.items() if old in CHAIN}


def _add_joint(draft: RobotDraft) -> None:
    """A joint of the platform's that the file lacks is added."""
    added = None if draft.layout is None else draft.platform.added_joint(draft.layout)
    if added is None:
        return
    draft.model = draft.model.copy()
    if draft.model.existJointName(added.joint):
        _narrow(draft.model, added)
        return
    if draft.model.existFrame(added.joint):
        what = (
            f"a frame is named {added.joint}, as the coordinate that this platform adds: give the frame "
            "another name, or the platform another for it, as in Car(wheelbase, steering=NAME)"
        )
        raise RobotError(what, where=draft.where, got=added.joint)
    place = pin.SE3(np.eye(3), np.array([added.x, added.y, 0.0]))
    ends = (-np.inf, np.inf, -added.velocity, added.velocity, added.lower, added.upper, 0.0, 0.0, 0.0)
    limits = (np.full(1, end) for end in ends)
    draft.model.addJoint(len(CHAIN), pin.JointModelRZ(), place, added.joint, *limits)
    draft.notes.append(Finding("joint_added", {"name": added.joint}))


def _narrow(model: pin.Model, added: AddedJoint) -> None:
    """The limits of the file's joint of that name become no wider than those of the one to be added."""
    joint = model.joints[model.getJointId(added.joint)]
    model.lowerPositionLimit[joint.idx_q] = max(model.lowerPositionLimit[joint.idx_q], added.lower)
    model.upperPositionLimit[joint.idx_q] = min(model.upperPositionLimit[joint.idx_q], added.upper)
    model.velocityLimit[joint.idx_v] = min(speed_limit(model, model.getJointId(added.joint)), added.velocity)


def _put_on_platform(draft: RobotDraft) -> None:
    """The platform's own joints come before the arm's; a fixed base stands in the world."""
    own = draft.platform.coordinates[len(CHAIN) :]
    joints = [str(name) for name in draft.model.names][len(CHAIN) + 1 :]
    for name in own:
        if name in draft.locked:
            what = f"{name} is a coordinate of the {draft.platform.name} platform"
            raise RobotError(what, where=f"{draft.where}: lock", got=name)
        expect_known("platform joint", name, joints, draft.where, RobotError)
    if own:
        draft.rebuild(first=own)
    elif not draft.platform.coordinates:
        mjcf = draft.source.mjcf
        x, y, yaw = (0.0 if mjcf is None else mjcf.start.get(name, 0.0) for name in CHAIN)
        stands = pin.SE3(pin.utils.rotate("z", yaw), np.array([x, y, 0.0]))
        draft.rebuild(root=stands * draft.model.jointPlacements[1], head=())


def _hold_idle_parts(draft: RobotDraft) -> None:
    """A fixed base's wheels stand still, and its joints may be called x, y and theta; on a platform that
    moves, what steers without a wheel's joint stands still, and wheels whose size nothing tells."""
    if draft.layout is None:
        held, notes = held_joints(draft.measured(), draft.options.wheels)
        draft.notes += notes
        if held:
            followers = draft.hold(dict.fromkeys(held, 0.0))
            draft.notes += [Finding("wheels_held", {"names": [*held]}), *followers]
        draft.rename(_chain_names(draft))
        draft.names = {old: new for old, new in draft.names.items() if old not in CHAIN}
        return
    carrying = {wheel.carrier for wheel in draft.layout.wheels}
    follows = {mimic.joint for mimic in draft.mimic_joints}
    moved = {*draft.platform.coordinates, *carrying, *follows}
    idle = [pivot.joint for pivot in draft.layout.pivots if pivot.steers and pivot.joint not in moved]
    unknown = without_radius(draft.measured(), draft.layout)
    draft.hold(dict.fromkeys((*idle, *unknown), 0.0))
    draft.remarks += [Finding("steering_held", {"names": idle})] if idle else []
    draft.remarks += [Finding("radius_unknown", {"names": [*unknown]})] if unknown else []


def _free_input_names(draft: RobotDraft) -> None:
    """Joints give way where they have the names of the platform's inputs; what is called otherwise than in
    the file is told, but for joints in whose place the platform is."""
    like_inputs = joints_among(draft.model, draft.platform.inputs)
    draft.rename(like_inputs)
    draft.rename_options(like_inputs)
    draft.names |= like_inputs
    base = () if draft.base is None else draft.base.joints
    names = {old: new for old, new in draft.names.items() if new not in base}
    draft.remarks += [Finding("names_taken", {"names": names})] if names else []


def _find_wheels(draft: RobotDraft) -> None:
    """Which joints are wheels, which will be no coordinates."""
    if draft.layout is None:
        return
    asked = draft.options.wheels
    if asked is not None:  # those that stand still are joints no more
        left = [name for name in asked if draft.model.existJointName(name)]
        asked = {name: asked[name] for name in left} if isinstance(asked, Mapping) else left
    standing = {wheel.joint for wheel in standing_wheels(draft.layout)}
    sliding = {wheel.joint for wheel in wheels_on(draft.layout, MAIN_BODY)} - standing  # constrain nothing
    own = draft.platform.coordinates[len(CHAIN) :]
    draft.wheels, notes = find_wheels(draft.measured(), asked, own, draft.platform, sliding)
    turned = [wheel.joint for wheel in draft.wheels]
    notes += [Finding("wheels_left_out", {"names": turned})] if turned else []
    swivels = [name for wheel in draft.wheels for name in wheel.joints if name not in turned]
    notes += [Finding("swivels_left_out", {"names": [*dict.fromkeys(swivels)]})] if swivels else []
    draft.wheel_notes += notes


PASSES: tuple[Callable[[RobotDraft], None], ...] = (
    _free_names,
    _put_on_chain,
    _lock,
    _find_base,
    _hold_undercarriage,
    _choose_platform,
    _turn_joints_up,
    _tell_base,
    _add_joint,
    _put_on_platform,
    _hold_idle_parts,
    _free_input_names,
    _find_wheels,
)


def _finished(draft: RobotDraft) -> Robot:
    """The draft's robot, with its wheels on the display model only."""
    source, platform = draft.source, draft.platform
    shown, solid = draft.geometries
    rolling = tuple(dict.fromkeys(name for wheel in draft.wheels for name in wheel.joints))
    model, (reduced,) = at_zero(draft.model, (solid.copy(),), rolling)
    model.name = draft.model.name
    mimic_joints, notes = among_coordinates(draft.mimic_joints, rolling, draft.where)
    notes = [*draft.wheel_notes, *notes]
    if model.nq == platform.n_p:
        notes.append(Finding("no_arm" if model.nq else "nothing_moves"))
    choose_pairs = draft.options.add_pairs or (add_pairs if source.all_pairs else None)
    if choose_pairs is not None:
        choose_pairs(model, reduced)
        if len(reduced.collisionPairs):
            notes.append(Finding("collision_pairs", {"count": len(reduced.collisionPairs)}))
    accelerations = with_names(source.provenance.accelerations, draft.names)
    provenance = replace(
        source.provenance,
        locked=draft.locked,
        mimicked=draft.mimicked,
        reduced=rolling,
        platform=draft.origin,
        contradictions=draft.contradictions,
        base=() if draft.base is None or draft.is_fixed_base else draft.base.joints,
        accelerations=accelerations,
        renamed={**source.provenance.renamed, **draft.names},
    )
    before = (*source.notes, *draft.notes, *draft.remarks)
    robot = Robot(
        name=model.name,
        model=model,
        collision_model=reduced,
        display_model=draft.model,
        visual_model=shown,
        platform=platform,
        wheels=draft.wheels,
        source=source.label,
        arguments=dict(source.arguments),
        notes=(*before, *notes),
        mimic_joints=mimic_joints,
        parts=Parts(solid, before, provenance),
    )
    remarks = (*limit_notes(robot), *acceleration_notes(robot), *slip_warnings(robot))
    return replace(robot, **robot.shapes._asdict(), notes=(*robot.notes, *remarks))
