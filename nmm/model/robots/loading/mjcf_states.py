"""What an MJCF file says of its robot besides bodies: keyframes as postures, limits that actuators set."""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from nmm.base.findings import Finding
from nmm.model.robots.loading.mjcf_reading import Mjcf
from nmm.model.robots.loading.mjcf_tree import Joint
from nmm.model.robots.loading.srdf_parts import Srdf
from nmm.model.robots.loading.xml_tree import Attributes, Element

#: The root of the states' free body, whose place is x, y, z and a quaternion.
_ROOT = "root_joint"
#: Actuators that may drive a joint; of others, limits are not taken.
_DRIVES = ("motor", "velocity", "position")


@dataclass
class Drives:
    """Limits by joint, rad/s or m/s and Nm or N, that actuators on one joint set; `notes` say so."""

    velocity: dict[str, float] = field(default_factory=dict)
    effort: dict[str, float] = field(default_factory=dict)
    notes: list[Finding] = field(default_factory=list)


def drives_of(mjcf: Mjcf, faults: Attributes) -> Drives:
    """The limits that a joint's only actuator sets: of velocity, a velocity actuator's range of control; of
    effort, a motor's, and any range of force. A note says where a position actuator's range is narrower."""
    drives = Drives()
    limits = {joint.name: joint.limits for body in mjcf.world.all() for joint in body.joints if joint.name}
    automatic = mjcf.settings["autolimits"] == "true"
    places: dict[str, Element] = {}
    narrow: dict[str, list[float]] = {}
    driven = Counter(element.get("joint") for element in mjcf.references)
    for element in mjcf.references:
        joint = element.get("joint", "")
        if element.tag not in _DRIVES or joint not in limits or driven[joint] > 1:
            continue
        places[joint] = element
        first = Element("gear", {"gear": (element.get("gear", "").split() or ["1"])[0]})
        gear = faults.number(first, "gear", {"joint": joint}) or 1.0
        control, force = (_range(element, kind, automatic, faults) for kind in ("ctrl", "force"))
        if element.tag == "velocity" and control is not None and (bound := _both_ways(control)):
            drives.velocity[joint] = bound / abs(gear)
        ranges = [force, control if element.tag == "motor" else None]
        efforts = [bound * abs(gear) for ends in ranges if ends is not None and (bound := _both_ways(ends))]
        if efforts:
            drives.effort[joint] = min(efforts)
        if element.tag == "position" and control is not None:
            lower, upper = sorted(end / gear for end in control)
            least, most = limits[joint] or (-math.inf, math.inf)
            if lower > least or upper < most:
                narrow[joint] = [lower, upper]
    for code, values in (("mjcf_speeds", drives.velocity), ("mjcf_efforts", drives.effort)):
        if values:
            drives.notes.append(Finding(code, {"limits": values}, places[next(iter(values))].place))
    if narrow:
        drives.notes.append(Finding("mjcf_controls", {"ranges": narrow}, places[next(iter(narrow))].place))
    return drives


def _range(element: Element, kind: str, automatic: bool, faults: Attributes) -> tuple[float, float] | None:
    """An actuator's range of control or of force; None without one that holds."""
    ends = faults.vector(element, f"{kind}range", 2, {"joint": element.get("joint")})
    word = element.get(f"{kind}limited", "auto")
    if ends is None or word == "false" or (word == "auto" and not automatic) or ends[0] >= ends[1]:
        return None
    return ends[0], ends[1]


def _both_ways(ends: tuple[float, float]) -> float | None:
    """What is reached both ways; None for a range on one side of zero."""
    least = min(-min(ends), max(ends))
    return least if least > 0.0 else None


def states_of(mjcf: Mjcf, file: Path, qpos: Sequence[tuple[str, Joint]]) -> tuple[Srdf | None, list[Finding]]:
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
    excluded = [element for element in mjcf.references if element.tag == "exclude"]
    pairs = tuple((element.get("body1", ""), element.get("body2", "")) for element in excluded)
    return (Srdf(file, states, {}, pairs, ()) if states or pairs else None), notes


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
