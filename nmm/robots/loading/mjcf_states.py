"""What an MJCF file says of its robot besides bodies: keyframes as postures, limits that actuators set."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from nmm.findings import Finding
from nmm.robots.loading.mjcf_reading import Mjcf
from nmm.robots.loading.mjcf_tree import Joint
from nmm.robots.loading.srdf import Srdf
from nmm.robots.loading.xml_tree import Attributes, Element

#: The root of the states' free body, whose place is x, y, z and a quaternion.
_ROOT = "root_joint"
#: Actuators whose control is a force, or a place of the joint.
_MOTORS, _PLACES = ("motor",), ("position", "intvelocity", "pid")


@dataclass
class Drives:
    """Limits by joint, rad/s or m/s and Nm or N, that actuators on one joint set; `notes` say so."""

    velocity: dict[str, float] = field(default_factory=dict)
    effort: dict[str, float] = field(default_factory=dict)
    notes: list[Finding] = field(default_factory=list)


def drives_of(mjcf: Mjcf, faults: Attributes) -> Drives:
    """A velocity actuator's range of control bounds its joint's velocity, that of a motor, and any range of
    force, the effort; what a position actuator may ask for is told where it is less than the joint's range."""
    drives = Drives()
    ranges = {joint.name: joint.limits for body in mjcf.world.all() for joint in body.joints if joint.name}
    automatic = mjcf.settings["autolimits"] == "true"
    on: dict[str, list[Element]] = {}
    for one in mjcf.references:
        if one.get("joint", "") in ranges and one.tag not in ("joint", "jointpos", "exclude"):
            on.setdefault(one.get("joint", ""), []).append(one)

    def ends(element: Element, kind: str, gear: float) -> tuple[float, float] | None:
        """The range of control or of force, at the joint; None without one."""
        read = faults.vector(element, f"{kind}range", 2, {"joint": element.get("joint")})
        lower, upper = read or (0.0, 0.0)
        holds = element.get(f"{kind}limited", "auto")
        if holds == "false" or (holds == "auto" and not automatic) or lower >= upper or not gear:
            return None
        return (lower, upper) if gear == 1.0 else (lower * gear, upper * gear)

    taken: dict[str, dict[str, float]] = {"velocity": {}, "effort": {}}
    narrow: dict[str, list[float]] = {}
    for joint, elements in on.items():
        if len(elements) != 1:
            continue
        element = elements[0]
        gears = (element.get("gear", "1").split() or ["1"])[0]
        gear = Attributes().number(Element("gear", {"gear": gears}), "gear") or 0.0
        control = ends(element, "ctrl", 1.0 / gear if gear and element.tag not in _MOTORS else gear)
        force = ends(element, "force", gear)
        if element.tag == "velocity" and control is not None and (bound := _both_ways(control)):
            taken["velocity"][joint] = bound
        efforts = [_both_ways(one) for one in (force, control if element.tag in _MOTORS else None) if one]
        if any(efforts):
            taken["effort"][joint] = min(one for one in efforts if one)
        whole = ranges[joint] or (-math.inf, math.inf)
        if element.tag in _PLACES and control is not None and (control[0] > whole[0] or control[1] < whole[1]):
            narrow[joint] = [*control]
    drives.velocity, drives.effort = taken["velocity"], taken["effort"]
    for kind, code in (("velocity", "mjcf_speeds"), ("effort", "mjcf_efforts")):
        if taken[kind]:
            drives.notes.append(Finding(code, {"limits": taken[kind]}, on[next(iter(taken[kind]))][0].place))
    if narrow:
        drives.notes.append(Finding("mjcf_controls", {"ranges": narrow}, on[next(iter(narrow))][0].place))
    return drives


def _both_ways(ends: tuple[float, float]) -> float | None:
    """What is reached both ways; None for a range on one side of zero."""
    least = min(-min(ends), max(ends))
    return least if least > 0.0 else None


def states_of(
    mjcf: Mjcf, file: Path, qpos: Sequence[tuple[str, Joint]]
) -> tuple[Srdf | None, list[Finding]]:
    """Keyframes as an SRDF's states, and the pairs of bodies that are not to collide."""
    states: dict[str, dict[str, tuple[float, ...]]] = {}
    notes: list[Finding] = []
    size = sum(7 if joint.kind == "free" else 1 for _, joint in qpos)
    for index, key in enumerate(mjcf.keys):
        name = key.get("name") or f"key_{index}"
        if key.get("qpos") is None:
            continue
        values = Attributes().vector(key, "qpos", size, {})
        if values is None:
            got = len(key.get("qpos", "").split())
            notes.append(Finding("mjcf_keyframe", {"name": name, "size": size, "got": got}, key.place))
            continue
        states[name] = _state(values, qpos)
    excluded = [one for one in mjcf.references if one.tag == "exclude"]
    pairs = tuple((one.get("body1", ""), one.get("body2", "")) for one in excluded)
    return (Srdf(file, states, {}, pairs, (_ROOT,)) if states or pairs else None), notes


def _state(values: Sequence[float], qpos: Sequence[tuple[str, Joint]]) -> dict[str, tuple[float, ...]]:
    left, state = [*values], dict[str, tuple[float, ...]]()
    for name, joint in qpos:
        if joint.kind == "free":
            x, y, z, qw, qx, qy, qz = left[:7]
            state[_ROOT] = (x, y, z, qx, qy, qz, qw)
            del left[:7]
        else:
            state[name] = (left.pop(0),)
    return state
