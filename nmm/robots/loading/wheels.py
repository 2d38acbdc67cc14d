"""Wheels that only roll: found in the model, and measured where they touch the ground."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import numpy as np
import pinocchio as pin

from nmm.platforms import Platform
from nmm.robots.loading.layout import Measured, speed_limit
from nmm.robots.wheel import Wheel


def find_wheels(
    model: pin.Model,
    geometries: Sequence[pin.GeometryModel],
    asked: Sequence[str] | Mapping[str, float] | None,
    where: str,
    own: Sequence[str],
    platform: Platform,
) -> tuple[tuple[Wheel, ...], tuple[str, ...]]:
    """The robot's wheels, and notes on joints that are named wheels and are none.

    A wheel is a revolute joint with a level axis and no joint below it, on the root link's body, on one of
    the platform's own joints, or on a swivel: an upright joint that is not the platform's own, hangs on one
    of these, and carries nothing but wheels. By default those are taken whose name, or child link's name,
    holds "wheel" (or "caster").

    Parameters
    ----------
    model : begins with the platform's chain, or has a fixed base
    geometries : its collision and visual shapes, in the order in which to ask them for a radius
    asked : joint names, or a radius (m) for each; None finds them
    where : what messages call the model
    own : the platform's own joints, which are coordinates, not wheels
    platform : says how wheels on the root's body roll

    Raises
    ------
    RobotError : a name that is no joint, or no wheel, or a wheel whose radius cannot be found
    """
    measured = Measured(model, geometries, where)
    radii, notes = _wheels(measured, asked, own)
    return tuple(_wheel(measured, name, radii[name], own, platform) for name in radii), notes


def held_joints(
    model: pin.Model, asked: Sequence[str] | Mapping[str, float] | None, where: str
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The joints of a fixed base that stand still, wheels after the swivels that they are on, and notes.

    They are the wheels that `find_wheels` would take on a platform; their radii do not matter.

    Raises
    ------
    RobotError : a name that is no joint, or no wheel
    """
    measured = Measured(model, (), where)
    names, notes = _wheels(measured, asked)
    held = [joint for name in names for joint in (_swivel(measured, name, ()), name) if joint]
    return tuple(dict.fromkeys(held)), notes


def _wheels(
    measured: Measured, asked: Sequence[str] | Mapping[str, float] | None, own: Sequence[str] = ()
) -> tuple[dict[str, float | None], tuple[str, ...]]:
    return measured.wheels(asked, lambda name, others: _why_no_wheel(measured, name, others, own), own)


def _swivel(measured: Measured, name: str, own: Sequence[str]) -> str:
    """The swivel on which a wheel's joint is; "" without."""
    carrier = int(measured.model.parents[measured.joints[name]])
    carrier_name = str(measured.model.names[carrier])
    return carrier_name if carrier > measured.root and carrier_name not in own else ""


def _why_no_wheel(
    measured: Measured, name: str, candidates: Collection[str], own: Sequence[str]
) -> str | None:
    if name in own:
        return "it is the platform's own"
    joint = measured.joints[name]
    reason = measured.why_not_rolling(joint)
    between = [above for above in measured.above(joint) if str(measured.model.names[above]) not in own]
    if reason is not None or not between:
        return reason
    swivel = between[-1]
    if between != [int(measured.model.parents[joint])] or not measured.is_upright(swivel):
        names = ", ".join(str(measured.model.names[above]) for above in between)
        return f"another joint is between it and the root link ({names}); lock that to make it one"
    for below, parent in enumerate(measured.model.parents):
        other = str(measured.model.names[below])
        if parent == swivel and (other not in candidates or measured.why_not_rolling(below) is not None):
            return f"{measured.model.names[swivel]}, on which it would swivel, carries {other} too"
    return None


def _wheel(
    measured: Measured,
    name: str,
    radius: float | None,
    own: Sequence[str],
    platform: Platform,
) -> Wheel:
    model, joint = measured.model, measured.joints[name]
    carrier, swivel = int(model.parents[joint]), _swivel(measured, name, own)
    if swivel:
        carrier = int(model.parents[carrier])
    carried = measured.placements[carrier].inverse()
    center = carried.act(measured.placements[joint].translation)
    pivot = np.zeros(3)
    if swivel:
        pivot = carried.act(measured.placements[measured.joints[swivel]].translation)
    roller, rolls_at = 0.0, center.copy()
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
