"""Why a platform's wheels cannot roll at a configuration, in a sentence that names them."""

from __future__ import annotations

import math

import numpy as np

from nmm.arrays import Array
from nmm.platforms.wheeled.descriptions import SteeredWheel, WheelDescription
from nmm.platforms.wheeled.geometry import Bodies
from nmm.platforms.wheeled.kernel import CONTRADICTION
from nmm.platforms.wheeled.structure import Constraint, Structure
from nmm.words import listed

#: Beyond its limit a hitch is folded by more than this, rad.
_SLACK = 1e-9


def contradiction(structure: Structure, bodies: Bodies, qp: Array) -> str | None:
    """The first wheel that would have to slip, with those whose axes do not meet on its own."""
    for followed in structure.followed:
        share = followed.row.share(qp)
        if share > CONTRADICTION:
            wheels = [wheel for other in followed.others for wheel in other.wheels]
            return (
                f"the axes of wheels {_listed([*wheels, followed.wheel])} do not meet in one point: "
                f"{followed.wheel.name} would slip sideways at {share:.3g} of the platform's speed"
                f"{_angles([*wheels, followed.wheel], bodies, qp)}"
            )
    return None


def folded(bodies: Bodies, qp: Array) -> str | None:
    """The first hitch beyond its limits."""
    for number, body in enumerate(bodies.all[1:], start=1):
        if not body.steers and not body.lower - _SLACK <= qp[2 + number] <= body.upper + _SLACK:
            angle, lower, upper = (math.degrees(value) for value in (qp[2 + number], body.lower, body.upper))
            return f"{body.name} is folded to {angle:.4g} deg, beyond its limits {lower:.4g} and {upper:.4g}"
    return None


def singularity(structure: Structure, bodies: Bodies, qp: Array) -> str:
    """Which wheels and inputs depend on each other where M(qp) is singular."""
    constraints = structure.constraints
    wheels_only = _dependent([c.row.at(bodies, qp) for c in constraints])
    if wheels_only:
        named = [constraints[k] for k in wheels_only]
        return (
            f"the no-slip conditions of wheels {_listed(_wheels(named))} are not independent here (their "
            f"axes coincide or meet): the platform gains a motion{_angles(_wheels(named), bodies, qp)}"
        )
    rows = [row.at(bodies, qp) for row in structure.pfaffian]
    inputs = [row.at(bodies, qp) for _, _, row in structure.inputs]
    found = _dependent([*rows, *inputs])
    named = [constraints[k] for k in found if k < len(constraints)]
    wheels = _wheels(named)
    wheels += [
        structure.followed[k - len(constraints)].wheel for k in found if len(constraints) <= k < len(rows)
    ]
    chosen = [structure.inputs[k - len(rows)][0] for k in found if k >= len(rows)]
    names = " and ".join(chosen) or "the inputs"
    verb = "do" if len(chosen) != 1 else "does"
    where = f", because of {_listed(wheels)}{_angles(wheels, bodies, qp)}" if wheels else ""
    return f"here {names} {verb} not determine the motion{where}"


def _dependent(rows: list[Array]) -> list[int]:
    """The rows in the combination that is closest to zero, when it is zero."""
    if not rows:
        return []
    M = np.array([row / (np.linalg.norm(row) or 1.0) for row in rows])
    left, sizes, _ = np.linalg.svd(M)
    if len(sizes) == len(rows) and sizes[-1] > 1e-7:
        return []
    return [k for k, share in enumerate(left[:, -1]) if abs(share) > 1e-4]


def _wheels(constraints: list[Constraint]) -> list[WheelDescription]:
    return [wheel for constraint in constraints for wheel in constraint.wheels]


def _listed(wheels: list[WheelDescription]) -> str:
    return listed([wheel.name for wheel in wheels])


def _angles(wheels: list[WheelDescription], bodies: Bodies, qp: Array) -> str:
    """The steering angles of these wheels, in degrees."""
    joints = dict.fromkeys(wheel.joint for wheel in wheels if isinstance(wheel, SteeredWheel))
    degrees = [f"{joint} = {math.degrees(qp[2 + bodies.number(joint)]):.6g} deg" for joint in joints]
    return f" ({', '.join(degrees)})" if degrees else ""
