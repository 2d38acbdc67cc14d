"""Checks a URDF before Pinocchio sees it.

Pinocchio answers most faults with one and the same sentence and the cause on the C library's standard
error, and takes others (a cycle beside the tree, a link with two parents, a zero axis) without a word.
"""

from __future__ import annotations

import re
from collections.abc import Container
from dataclasses import dataclass
from pathlib import Path

from nmm.errors import RobotError, unknown
from nmm.platforms import PLATFORMS
from nmm.robots.followers import Follower
from nmm.robots.loading.check_joints import check_joint
from nmm.robots.loading.check_links import FindMesh, check_link, check_material
from nmm.robots.loading.check_mimics import check_mimics
from nmm.robots.loading.check_tree import check_names, check_tree, movable_on_root
from nmm.robots.loading.findings import Findings, Problem, children
from nmm.robots.loading.xml_tree import Element, XmlError, parse

_SHOWN = 12
_VERSION = re.compile(r"1\.[012]")

__all__ = ["CheckedUrdf", "Problem", "check", "find_problems"]


@dataclass(frozen=True)
class CheckedUrdf:
    """A description without problems.

    Attributes
    ----------
    root : its <robot> element
    name : the robot's name
    meshes : files of its meshes, by the name in the description
    followers : joints that follow others, each after the one that it follows
    platform : the kind of platform that it declares, if it does
    """

    root: Element
    name: str
    meshes: dict[str, Path]
    followers: tuple[Follower, ...]
    platform: str | None


def find_problems(
    xml_text: str, find_mesh: FindMesh | None = None, lock: Container[str] = ()
) -> list[Problem]:
    """All that is wrong with a URDF.

    Parameters
    ----------
    xml_text : the expanded description
    find_mesh : the path of a mesh by its name in the file, a sentence that says why there is none, or None
        to leave its shape out; without it, mesh files are taken to exist
    lock : names of joints that will not move, so that they follow nobody
    """
    return _inspect(xml_text, find_mesh or Path, lock)[1]


def check(
    xml_text: str,
    where: str,
    find_mesh: FindMesh | None = None,
    lock: Container[str] = (),
    lines: bool = True,
) -> CheckedUrdf:
    """The description, if nothing is wrong with it.

    Parameters
    ----------
    xml_text, find_mesh, lock : as for `find_problems`
    where : the file, for the message
    lines : whether the text's lines are those of the file

    Raises
    ------
    RobotError : names the file and every problem in one line
    """
    checked, problems = _inspect(xml_text, find_mesh or Path, lock)
    if checked is not None and not problems:
        return checked
    shown = [str(problem) if lines else problem.message for problem in problems[:_SHOWN]]
    more = [f"and {len(problems) - _SHOWN} more"] if len(problems) > _SHOWN else []
    raise RobotError(f"{where}: {'; '.join(shown + more)}")


def _inspect(
    text: str, find_mesh: FindMesh, lock: Container[str]
) -> tuple[CheckedUrdf | None, list[Problem]]:
    try:
        root = parse(text)
    except XmlError as error:
        return None, [Problem(str(error), error.line)]
    if root.tag != "robot":
        return None, [Problem(f"expected <robot> as the root element, got <{root.tag}>", root.line)]
    # A xacro file is no URDF: whatever else is wrong follows from that.
    for element in root.iter():
        if element.tag.startswith("xacro:") and isinstance(element, Element):
            message = f"holds xacro (<{element.tag}>): name the file .xacro, so that it is expanded"
            return None, [Problem(message, element.line)]
    findings = Findings()
    checked = _check_robot(root, findings, find_mesh, lock)
    return checked, findings.problems


def _check_robot(root: Element, findings: Findings, find_mesh: FindMesh, lock: Container[str]) -> CheckedUrdf:
    if not root.get("name"):
        findings.add(root, "<robot> has no name")
    version = root.get("version", "1.0")
    if not _VERSION.fullmatch(version):
        findings.add(root, f"<robot> version: expected 1.0, 1.1 or 1.2, got {version!r}")
    links, joints = children(root, "link"), children(root, "joint")
    check_names(links, "link", findings)
    check_names(joints, "joint", findings)
    check_tree(links, joints, findings)
    materials: set[str] = set()
    for material in children(root, "material"):
        check_material(material, "robot", findings)
        name = material.get("name", "")
        if name in materials:
            findings.add(material, f"two materials named {name!r}")
        materials.add(name)
    meshes: dict[str, Path] = {}
    for link in links:
        meshes |= check_link(link, findings, find_mesh)
    first = movable_on_root(joints)
    for joint in joints:
        check_joint(joint, findings, carries_all=first == [joint])
    followers = check_mimics(joints, findings, lock)
    return CheckedUrdf(root, root.get("name") or "", meshes, followers, _declared_platform(root, findings))


def _declared_platform(root: Element, findings: Findings) -> str | None:
    """The platform of `<nmm platform="car"/>` below <robot>: other tools do not look at it."""
    platform: str | None = None
    for element in children(root, "nmm"):
        for attribute in sorted(set(element.keys()) - {"platform"}):
            findings.add(element, unknown("attribute", attribute, ["platform"], "<nmm>"))
        name = findings.text(element, "platform", "robot")
        if name is not None and platform is not None:
            findings.add(element, "robot: a second <nmm>, expected one")
        elif name is not None and findings.choice(element, name, tuple(PLATFORMS), "platform", "<nmm>"):
            platform = name
    return platform
