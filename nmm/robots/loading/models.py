"""From what was read to a `Robot`: joints locked, reference point, platform, wheels, in this order."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import pinocchio as pin
from numpy.typing import ArrayLike

from nmm.errors import InputError, RobotError, expect_known
from nmm.platforms import Fixed, Layout, Platform, platform_by_name, usual_platform
from nmm.robots.loading.added_joint import with_joint
from nmm.robots.loading.axle import axle_note, axle_placement
from nmm.robots.loading.chain import CHAIN, Rebuilt, rebuild
from nmm.robots.loading.collision_pairs import add_pairs
from nmm.robots.loading.following import among_coordinates, limit_notes
from nmm.robots.loading.layout import measure_layout
from nmm.robots.loading.locking import Locked, with_locked
from nmm.robots.loading.provenance import Parts
from nmm.robots.loading.reduction import at_zero
from nmm.robots.loading.source import Source
from nmm.robots.loading.virtual_base import VirtualBase, find_virtual_base
from nmm.robots.loading.wheels import find_wheels, held_joints
from nmm.robots.robot import Robot
from nmm.robots.slip import slip_warnings
from nmm.robots.wheel import Wheel

#: Adds its pairs to the collision shapes on a model.
AddPairs = Callable[[pin.Model, pin.GeometryModel], None]


@dataclass(frozen=True)
class Options:
    """What `load` was asked for, of any source."""

    platform: Platform | str | None = None
    wheels: Sequence[str] | Mapping[str, float] | None = None
    lock: Mapping[str, float] = field(default_factory=dict)
    axle: str | ArrayLike | None = None
    name: str | None = None
    limits: Mapping[str, float] = field(default_factory=dict)
    add_pairs: AddPairs | None = None


def robot_from(source: Source, options: Options) -> Robot:
    """The robot that a source makes.

    Raises
    ------
    RobotError : a joint that we cannot take, a name that is no joint or frame, a platform that does not fit
    """
    where = source.where
    rebuilt = rebuild(source.model, (source.visual_model, source.collision_model), where)
    rebuilt.model.name = options.name or source.name
    stated = options.platform.coordinates[len(CHAIN) :] if isinstance(options.platform, Platform) else ()
    locked = with_locked(rebuilt, options.lock, source.followers, where, stated)
    rebuilt = locked.rebuilt
    base = find_virtual_base(rebuilt.model, where)
    if base is not None and not _is_fixed(source, options):
        locked = _standing(locked, base.joints, where)
        rebuilt = locked.rebuilt
    if options.axle is not None:
        placement = axle_placement(rebuilt.model, options.axle, where)
        moved = rebuild(rebuilt.model, rebuilt.geometries, where, root=placement.inverse())
        rebuilt = replace(moved, notes=(*rebuilt.notes, axle_note(placement)))
    platform, origin, layout, contradictions = _platform(rebuilt, source, options, base)
    if options.limits:
        try:
            platform = platform.with_limits(options.limits)
        except InputError as error:
            raise RobotError(f"{where}: {error}") from None
    remarks = [*contradictions]
    if base is not None:
        platform = base.limited(platform)
        remarks.append(base.note(platform))
    added = None if layout is None else platform.added_joint(layout)
    if added is not None:
        rebuilt = with_joint(rebuilt, added, where)
    own = _own_joints(platform, rebuilt.model, locked.values, where)
    made = replace(locked, rebuilt=_on_platform(rebuilt, platform, own, where))
    if not platform.coordinates:
        made = _with_held_wheels(made, options.wheels, where)
    display = made.rebuilt
    notes = (*source.notes, *display.notes, *remarks)
    provenance = replace(
        source.provenance,
        locked=made.values,
        mimicked=made.mimicked,
        platform=origin,
        contradictions=contradictions,
    )
    parts = Parts(display.geometries[1], notes, provenance)
    return _without_wheels(made, platform, own, source, options, parts)


def _platform(
    rebuilt: Rebuilt, source: Source, options: Options, base: VirtualBase | None
) -> tuple[Platform, str, Layout | None, tuple[str, ...]]:
    """The platform, who chose its kind, what the file's wheels and joints are, and where that differs."""
    given = options.platform
    name, origin = (source.platform, "file") if given is None else (given, "given")
    if name is None and base is not None and base.kind is not None:
        name, origin = base.kind, "base"
    if _is_fixed(source, options):
        return Fixed(), origin, None, ()  # there is nothing to measure
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
        else:
            platform = platform_by_name(name).fit(layout)
        return platform, origin, layout, () if layout is None else platform.compared(layout)
    except InputError as error:
        raise RobotError(f"{source.where}: {error}") from None


def _is_fixed(source: Source, options: Options) -> bool:
    chosen = source.platform if options.platform is None else options.platform
    return isinstance(chosen, Fixed) or chosen == Fixed.name


def _own_joints(
    platform: Platform, model: pin.Model, lock: Mapping[str, float], where: str
) -> tuple[str, ...]:
    """The platform's own joints: its coordinates after x, y, theta."""
    own = platform.coordinates[len(CHAIN) :]
    joints = [str(name) for name in model.names][len(CHAIN) + 1 :]
    for name in own:
        if name in lock:
            raise RobotError(f"{where}: lock: {name} is a coordinate of the {platform.name} platform")
        expect_known("platform joint", name, joints, where, RobotError)
    return own


def _on_platform(rebuilt: Rebuilt, platform: Platform, own: Sequence[str], where: str) -> Rebuilt:
    """The model with the platform's own joints first; without x, y, theta where the base is fixed."""
    model = rebuilt.model
    if not platform.coordinates:
        made = rebuild(model, rebuilt.geometries, where, root=model.jointPlacements[1], head=())
    else:
        made = rebuild(model, rebuilt.geometries, where, first=own) if own else rebuilt
    return replace(made, notes=rebuilt.notes)


def _without_wheels(
    made: Locked, platform: Platform, own: Sequence[str], source: Source, options: Options, parts: Parts
) -> Robot:
    """The robot, with its wheels on the display model only."""
    display = made.rebuilt
    whole, (shown, solid) = display.model, display.geometries
    wheels, notes = _wheels(display, platform, own, source.where, options.wheels)
    names = list(dict.fromkeys(name for wheel in wheels for name in wheel.joints))
    model = whole
    if names:
        turned = [wheel.joint for wheel in wheels]
        notes.append(f"wheels that only roll, left out of q: {', '.join(turned)}")
        if swivels := [name for name in names if name not in turned]:
            notes.append(f"joints that steer them or swivel, left out of q: {', '.join(swivels)}")
        model, (solid,) = at_zero(whole, (solid,), names)
    elif source.all_pairs or options.add_pairs:
        solid = solid.copy()
    followers, more = among_coordinates(made.followers, names, source.where)
    notes += more
    if model.nq == platform.n_p:
        notes.append("no arm: the platform is all that moves" if model.nq else "nothing moves")
    add = options.add_pairs or (add_pairs if source.all_pairs else None)
    if add is not None:
        add(model, solid)
        if len(solid.collisionPairs):
            notes.append(
                f"{len(solid.collisionPairs)} collision pairs: none within a body or across one joint"
            )
    model.name = whole.name = options.name or source.name
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
        followers=followers,
        parts=replace(parts, provenance=replace(parts.provenance, reduced=tuple(names))),
    )
    remarks = (*limit_notes(robot), *slip_warnings(robot))
    return replace(robot, **robot.shapes._asdict(), notes=(*robot.notes, *remarks))


def _standing(made: Locked, names: Sequence[str], where: str) -> Locked:
    """The model with more joints fixed at zero, of which nothing is said, and what follows them."""
    others = [one for one in made.followers if one.joint not in names]
    still = with_locked(made.rebuilt, {}, others, where, standing=dict.fromkeys(names, 0.0))
    return replace(still, values=made.values, mimicked={**made.mimicked, **still.mimicked})


def _with_held_wheels(made: Locked, asked: Sequence[str] | Mapping[str, float] | None, where: str) -> Locked:
    """The model of a base that does not move, with its wheels fixed, and what follows them."""
    display = made.rebuilt
    names, notes = held_joints(display.model, asked, where)
    if not names:
        return replace(made, rebuilt=replace(display, notes=(*display.notes, *notes)))
    still = _standing(made, names, where)
    note = f"wheels of a fixed base, which stand still: {', '.join(names)}"
    notes = (*display.notes, *notes, note, *still.rebuilt.notes[len(display.notes) :])
    return replace(still, rebuilt=replace(still.rebuilt, notes=notes))


def _wheels(
    display: Rebuilt,
    platform: Platform,
    own: Sequence[str],
    where: str,
    asked: Sequence[str] | Mapping[str, float] | None,
) -> tuple[tuple[Wheel, ...], list[str]]:
    if not platform.coordinates:
        return (), []
    shown, solid = display.geometries
    wheels, notes = find_wheels(display.model, (solid, shown), asked, where, own, platform)
    return wheels, list(notes)
