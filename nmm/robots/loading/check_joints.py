"""What is wrong inside joints: type, links, axis, limits, dynamics."""

from __future__ import annotations

import math

from nmm.robots.loading.findings import Findings, child
from nmm.robots.loading.xml_tree import Element

TYPES = ("revolute", "continuous", "prismatic", "fixed")
#: Joints of several degrees of freedom, which are taken where they carry the whole robot.
BASES = ("planar", "floating")
#: How far from upright the normal of a base's plane may be.
_UPRIGHT = 1e-6


def check_joint(joint: Element, findings: Findings, carries_all: bool = False) -> None:
    """Add the problems inside a joint; carries_all: the only movable one on the root link's body."""
    owner = f"joint {joint.get('name')!r}"
    findings.origin(joint, owner)
    kind = joint.get("type")
    if kind is None:
        findings.add(joint, f"{owner}: no type, expected one of {', '.join(TYPES)}")
    elif kind in BASES:
        _check_base(joint, kind, owner, findings, carries_all)
    elif kind in ("helical", "screw"):
        findings.add(
            joint,
            f"{owner}: a {kind} joint is refused: it turns and slides at once; expected one of "
            f"{', '.join(TYPES)}",
        )
    elif findings.choice(joint, kind, TYPES, "joint type", owner) and kind != "fixed":
        _check_axis(joint, owner, findings)
        _check_limit(joint, kind, owner, findings)
        _check_dynamics(joint, owner, findings)


def _check_base(joint: Element, kind: str, owner: str, findings: Findings, carries_all: bool) -> None:
    if not carries_all:
        findings.add(
            joint,
            f"{owner}: a {kind} joint is refused inside the tree: it stands for the platform's x, y and "
            "theta only where it is the one movable joint on the root link's body",
        )
        return
    axis = child(joint, "axis")
    xyz = None if axis is None else findings.vector(axis, "xyz", 3, owner, required=True)
    if kind == "planar" and xyz is not None and math.hypot(*xyz[:2]) > _UPRIGHT * abs(xyz[2]):
        shown = " ".join(f"{value:g}" for value in xyz)
        findings.add(axis, f"{owner}: <axis> of a planar joint: expected it upright, 0 0 1, got {shown}")


def _check_axis(joint: Element, owner: str, findings: Findings) -> None:
    axis = child(joint, "axis")
    if axis is None:  # the standard's default is 1 0 0
        return
    xyz = findings.vector(axis, "xyz", 3, owner, required=True)
    if xyz is not None and math.hypot(*xyz) < 1e-6:
        findings.add(axis, f"{owner}: <axis> xyz is zero: {axis.get('xyz')!r}")


def _check_limit(joint: Element, kind: str, owner: str, findings: Findings) -> None:
    limit = child(joint, "limit")
    if limit is None:
        if kind != "continuous":
            findings.add(joint, f"{owner}: a {kind} joint needs a <limit>, this one has none")
        return
    # The C++ reader asks for both, of continuous joints too.
    findings.number(limit, "effort", owner, required=True, minimum=0.0)
    findings.number(limit, "velocity", owner, required=True, minimum=0.0)
    lower, upper = findings.number(limit, "lower", owner), findings.number(limit, "upper", owner)
    if kind != "continuous" and (lower or 0.0) > (upper or 0.0):
        findings.add(limit, f"{owner}: <limit> lower {lower or 0.0:g} is above upper {upper or 0.0:g}")


def _check_dynamics(joint: Element, owner: str, findings: Findings) -> None:
    dynamics = child(joint, "dynamics")
    if dynamics is None:
        return
    if dynamics.get("damping") is None and dynamics.get("friction") is None:
        findings.add(dynamics, f"{owner}: <dynamics> has neither damping nor friction")
    for attribute in ("damping", "friction"):
        findings.number(dynamics, attribute, owner, minimum=0.0)
