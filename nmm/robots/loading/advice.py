"""What a description leaves open or says oddly: no reason to refuse it, but worth a line of a report."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from nmm.robots.loading.findings import Findings, Problem, child, children
from nmm.robots.loading.xml_tree import Element

#: A body heavier than this, kg, was probably not written in kg.
HEAVY = 1000.0
#: How far a principal moment may be above the sum of the others, as a fraction: files round.
ROUNDED = 1e-3
_MOMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


def advice(root: Element) -> list[Problem]:
    """Warnings about a <robot> without problems, each with its line."""
    links, joints = children(root, "link"), children(root, "joint")
    return [
        *_on_inertias(links),
        *_on_bodies(links, joints),
        *_on_joints(joints),
        *_on_names(links, joints),
    ]


def _on_inertias(links: list[Element]) -> Iterator[Problem]:
    """Masses and moments of inertia that no body has."""
    for link in links:
        owner = f"link {link.get('name')!r}"
        inertial = child(link, "inertial")
        if inertial is None:
            continue
        mass, moments = _inertia(inertial)
        if mass > HEAVY:
            yield Problem(f"{owner}: a mass of {mass:g} kg: is that meant?", inertial.line)
        if mass == 0.0 and np.any(moments):
            yield Problem(f"{owner}: no mass, but moments of inertia", inertial.line)
        principal = np.linalg.eigvalsh(moments)
        if mass > 0.0 and not np.any(moments):
            yield Problem(f"{owner}: a mass of {mass:g} kg, but no moments of inertia", inertial.line)
        elif mass > 0.0 and principal[0] <= 0.0:
            shown = ", ".join(f"{value:.3g}" for value in principal)
            yield Problem(
                f"{owner}: inertia is not positive definite: principal moments {shown} kg m^2", inertial.line
            )
        elif mass > 0.0 and principal[2] > (1.0 + ROUNDED) * (principal[0] + principal[1]):
            shown = ", ".join(f"{value:.3g}" for value in principal)
            yield Problem(
                f"{owner}: no body has this inertia: of the principal moments {shown} kg m^2 the largest "
                "is above the sum of the others",
                inertial.line,
            )


def _inertia(inertial: Element) -> tuple[float, np.ndarray]:
    """Mass, kg, and the matrix of moments (3, 3), kg m^2; zeros where a number is missing."""
    mass, inertia = child(inertial, "mass"), child(inertial, "inertia")
    moment = {} if inertia is None else {key: _number(inertia, key) for key in _MOMENTS}
    xx, xy, xz, yy, yz, zz = (moment.get(key, 0.0) for key in _MOMENTS)
    moments = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return 0.0 if mass is None else _number(mass, "value"), moments


def _on_bodies(links: list[Element], joints: list[Element]) -> Iterator[Problem]:
    """Bodies that move and have no mass: a body is a link with all that is fixed to it."""
    above = {_end(joint, "child"): joint for joint in joints}

    def body(name: str) -> str:
        """The link at the top of the body that a link is part of."""
        met: set[str] = set()
        while name in above and above[name].get("type") == "fixed" and name not in met:
            met.add(name)
            name = _end(above[name], "parent")
        return name

    heavy = {body(link.get("name", "")) for link in links if (_mass(link) or 0.0) > 0.0}
    for link in links:
        name = link.get("name", "")
        if name in above and body(name) == name and name not in heavy:
            what = "has no <inertial>" if _mass(link) is None else "has no mass"
            yield Problem(
                f"link {name!r}: moves with joint {above[name].get('name')!r} and {what}, nor has any link "
                "fixed to it: dynamics and centre of mass leave it out",
                link.line,
            )


def _mass(link: Element) -> float | None:
    inertial = child(link, "inertial")
    return None if inertial is None else _inertia(inertial)[0]


def _on_joints(joints: list[Element]) -> Iterator[Problem]:
    """Speeds without a limit, and joints that cannot move."""
    for joint in joints:
        kind, owner = joint.get("type", ""), f"joint {joint.get('name')!r}"
        if kind == "fixed":
            continue
        limit = child(joint, "limit")
        if limit is None:
            yield Problem(f"{owner}: no <limit>, so no limit of its velocity", joint.line)
        elif _number(limit, "velocity") == 0.0:
            yield Problem(f"{owner}: <limit> velocity is 0, which is taken as no limit", limit.line)
        if limit is not None and kind != "continuous":
            lower, upper = _number(limit, "lower"), _number(limit, "upper")
            if lower == upper:
                yield Problem(
                    f"{owner}: <limit> lets it stand at {lower:g} only (both ends are 0 unless given)",
                    limit.line,
                )


def _on_names(links: list[Element], joints: list[Element]) -> Iterator[Problem]:
    """Names that stand for a link and a joint: two frames, of which tasks can only speak of the link's."""
    named = {link.get("name"): link for link in links}
    for joint in joints:
        if joint.get("name") in named:
            yield Problem(
                f"joint {joint.get('name')!r}: a link has that name, too: as a frame, it means the link",
                joint.line,
            )


def _end(joint: Element, tag: str) -> str:
    element = child(joint, tag)
    return "" if element is None else element.get("link", "")


def _number(element: Element, attribute: str) -> float:
    """A number that was checked; 0 where it is missing."""
    return Findings().number(element, attribute, "") or 0.0


def joints_by_type(root: Element) -> Mapping[str, int]:
    """How many joints there are of each type."""
    kinds = [joint.get("type", "") for joint in children(root, "joint")]
    return {kind: kinds.count(kind) for kind in dict.fromkeys(sorted(kinds))}
