"""Checks the limits of a URDF's joints, and reads those that Pinocchio does not."""

from collections.abc import Iterable, Iterator
from math import inf

from nmm.base.findings import Finding
from nmm.model.robots.coordinates import UNLIMITED
from nmm.model.robots.loading.xml_tree import Attributes, Element, Owner, child

#: URDF 1.2 has limits of acceleration, and lets those of effort and velocity be left out.
ACCELERATIONS = 2
_RATES = ("acceleration", "deceleration", "jerk")


def check_limit(joint: Element, kind: str, owner: Owner, reader: Attributes, spared: Attributes) -> None:
    """Adds faults to `reader`, and those that kinematics does not feel to `spared`."""
    limit = child(joint, "limit")
    if limit is None:
        if kind != "continuous":
            reader.add(joint, "limit_missing", owner, kind=kind)
        return
    is_new = reader.minor >= ACCELERATIONS
    for attribute in ("effort", "velocity"):
        spared.number(limit, attribute, owner, required=not is_new, minimum=0.0)
    for attribute in _RATES if is_new else ():
        spared.number(limit, attribute, owner, minimum=0.0)
    both = is_new and kind != "continuous"
    lower, upper = (reader.number(limit, end, owner, required=both) or 0.0 for end in ("lower", "upper"))
    if kind != "continuous" and lower > upper:
        reader.add(limit, "limits_crossed", owner, lower=lower, upper=upper)


def accelerations(joints: Iterable[Element]) -> dict[str, float]:
    """By joint, how fast its speed may change, m/s^2 or rad/s^2: the smaller of acceleration and
    deceleration; 0 is no limit, as of velocities."""
    bounds = {}
    for joint, limit in _limited(joints):
        numbers = (Attributes().number(limit, rate, minimum=0.0) or inf for rate in _RATES[:2])
        if (least := min(numbers)) < inf:
            bounds[joint.get("name", "")] = least
    return bounds


def soft_limits(joints: Iterable[Element]) -> list[Finding]:
    """A note on the limits of <safety_controller> that are narrower than those of <limit>."""
    ranges: dict[str, list[float]] = {}
    lines = []
    for joint, limit in _limited(joints):
        safety, is_turning = child(joint, "safety_controller"), joint.get("type") == "continuous"
        ends = _ends(safety, "soft_lower_limit", "soft_upper_limit")
        hard = (-inf, inf) if is_turning else _ends(limit, "lower", "upper") or (-inf, inf)
        if safety is not None and ends is not None and (hard[0] < ends[0] or ends[1] < hard[1]):
            ranges[joint.get("name", "")] = [*ends]
            lines.append(safety.line)
    return [_note("soft_limits", lines, limits=ranges)] if ranges else []


def limits_of_continuous(joints: Iterable[Element]) -> list[Finding]:
    """A note on joints that have limits of position and turn without end."""
    lines = {}
    for joint, limit in _limited(joints):
        ends = _ends(limit, "lower", "upper")
        if joint.get("type") == "continuous" and ends is not None and max(map(abs, ends)) < UNLIMITED:
            lines[joint.get("name", "")] = limit.line
    return [_note("limits_of_continuous", [*lines.values()], names=[*lines])] if lines else []


def _limited(joints: Iterable[Element]) -> Iterator[tuple[Element, Element]]:
    """The joints that move and have limits, and these."""
    for joint in joints:
        limit = child(joint, "limit")
        if limit is not None and joint.get("type") != "fixed":
            yield joint, limit


def _ends(limit: Element | None, *attributes: str) -> tuple[float, float] | None:
    """Both ends; None where they say nothing."""
    if limit is None:
        return None
    lower, upper = (Attributes().number(limit, attribute) or 0.0 for attribute in attributes)
    return (lower, upper) if lower < upper else None


def _note(code: str, lines: list[int], **values: object) -> Finding:
    return Finding(code, {**values, "count": len(lines)}, {"line": lines[0]})
