"""The wheels that a robot has besides its coordinates, and what its file says of them in vain."""

import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from nmm.base.findings import Finding
from nmm.model.platforms import Platform
from nmm.model.platforms.wheel_layout import NEAR, Layout
from nmm.model.robots.loading.measured_joints import ROUNDED, Asked, Measured, speed_limit
from nmm.model.robots.wheel import Wheel


def find_wheels(
    measured: Measured, asked: Asked, own: Sequence[str], platform: Platform, sliding: Collection[str] = ()
) -> tuple[tuple[Wheel, ...], list[Finding]]:
    """The robot's passive wheels, those in `sliding` as such, and notes on joints that are only named wheels.

    A wheel is a revolute joint with a level axis and no joint below it, on the root link's body, one of the
    platform's own joints or a swivel: an upright joint, not the platform's own, that hangs on one of these
    and carries only wheels. Without `asked`, the joint's or child link's name must hold "wheel" (or "tire",
    "caster", lw, rw), or its shape be one. `RobotError` for no joint, or no wheel."""
    radii, notes = measured.wheels(asked, own)
    wheels = tuple(
        replace(_wheel(measured, name, radii[name], own, platform), slides=name in sliding) for name in radii
    )
    swivels = {wheel.swivel for wheel in wheels}  # named as wheels, and left out of q as these are
    return wheels, [note for note in notes if note.values.get("name") not in swivels]


def differing_radii(measured: Measured, asked: Asked) -> Iterator[Finding]:
    """Where a wheel's given radius, m, is not that of any of its shapes (1 mm or 1 % may differ)."""
    for name, radius in asked.items() if isinstance(asked, Mapping) else ():
        radii = [] if radius is None else [tyre.radius for tyre in measured.tyres(measured.joints[name])]
        if radii and all(abs(radius - other) > max(1e-3, ROUNDED * other) for other in radii):
            yield Finding(
                "wheel_radius_differs", {"name": name, "given": float(radius), "measured": radii[0]}
            )


def differing_tyres(measured: Measured, names: Iterable[str]) -> Iterator[Finding]:
    """Where a wheel's shapes do not agree on where the middle of its tyre is, m along its axis."""
    for name in names:
        middles = [tyre.middle for tyre in measured.tyres(measured.joints[name])]
        if middles and max(middles) - min(middles) > NEAR:
            yield Finding("tyre_unclear", {"name": name, "middles": middles})


def without_radius(measured: Measured, layout: Layout) -> tuple[str, ...]:
    """Wheels of which nothing tells the radius, and the swivels that carry these alone."""
    names = {wheel.joint for wheel in layout.wheels if math.isnan(wheel.radius)}
    swivels = {swivel for name in names if (swivel := measured.swivel(name, ()))}
    others = {wheel.carrier for wheel in layout.wheels if wheel.joint not in names}
    return (*sorted(swivels - others), *sorted(names))


def held_joints(measured: Measured, asked: Asked) -> tuple[tuple[str, ...], list[Finding]]:
    """A fixed base's wheels (as `find_wheels` takes them, radii aside), after their swivels, and notes."""
    names, notes = measured.wheels(asked)
    held = [joint for name in names for joint in (measured.swivel(name, ()), name) if joint]
    return tuple(dict.fromkeys(held)), notes


def _wheel(
    measured: Measured, name: str, radius: float | None, own: Sequence[str], platform: Platform
) -> Wheel:
    model, joint = measured.model, measured.joints[name]
    carrier, swivel = int(model.parents[joint]), measured.swivel(name, own)
    if swivel:
        carrier = int(model.parents[carrier])
    carried = measured.placements[carrier].inverse()
    center = carried.act(measured.contact(joint))
    pivot, roller, rolls_at = np.zeros(3), 0.0, center.copy()
    if swivel:
        pivot = carried.act(measured.placements[measured.joints[swivel]].translation)
    if carrier == measured.root and not swivel:
        x, y = (float(value) for value in center[:2])
        roller, rolls_at[:2] = platform.roller(x, y), platform.rolls_at(x, y)
    return Wheel(
        name,
        center,
        carried.rotation @ measured.axis(joint),
        measured.radius(joint, radius),
        rolls_at,
        carrier=str(model.names[carrier]),
        swivel=swivel,
        pivot=pivot,
        roller=roller,
        velocity=speed_limit(model, joint),
    )
