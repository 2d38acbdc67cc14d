"""SRDF, the file beside a URDF that names groups of joints, postures, and links that may touch."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from nmm.base.errors import RobotError
from nmm.base.findings import Finding
from nmm.base.findings.robot_file import refusal
from nmm.model.robots.loading.description import argument_texts, expand
from nmm.model.robots.loading.file_elements import SRDF, unread
from nmm.model.robots.loading.packages import Packages
from nmm.model.robots.loading.srdf_parts import Group, Srdf, VirtualJoint
from nmm.model.robots.loading.xml_tree import Element, XmlError, parse, read_text

#: Where it is looked for, from the URDF's folder: MoveIt's packages, example-robot-data, and beside it.
_FOLDERS = (".", "../srdf", "../config", "../../{stem}_moveit_config/config")
SUFFIXES = (".srdf", ".srdf.xacro")


def read_srdf(
    file: str | Path, arguments: Mapping[str, object] | None = None, package_dirs: Sequence[str | Path] = ()
) -> Srdf:
    """An SRDF, expanded where it is xacro, of whose arguments those given count that it asks for.

    `RobotError` for a file that is no SRDF, for missing names and for values that are no numbers."""
    path = Path(os.path.expanduser(file))
    is_xacro = False
    try:
        text = read_text(path)
        is_xacro = path.suffix.lower() == ".xacro" or "xmlns:xacro" in text
        if is_xacro:
            text = expand(path.absolute(), argument_texts(arguments), Packages(path, package_dirs))[0]
        root = parse(text)
    except FileNotFoundError:
        raise RobotError(f"there is no file {path}", where="srdf", got=str(path)) from None
    except XmlError as error:
        raise refusal(f"srdf: {path}", error.finding) from None
    except RobotError as error:
        raise error.at("srdf") from None
    if root.tag != "robot" or root.find("link") is not None:
        raise refusal(f"srdf: {path}", Finding("not_srdf", {"got": root.tag}))
    states: dict[str, dict[str, tuple[float, ...]]] = {}
    for state in root.iter("group_state"):
        values = states.setdefault(_attribute(state, "name", path), {})
        for joint in state.iter("joint"):
            values[_attribute(joint, "name", path)] = _numbers(joint, path)
    groups = {_attribute(group, "name", path): _group(group, path) for group in root.findall("group")}
    disabled, enabled = (
        tuple(
            (_attribute(element, "link1", path), _attribute(element, "link2", path))
            for element in root.iter(tag)
        )
        for tag in ("disable_collisions", "enable_collisions")
    )
    untouched, passive = (
        tuple(_attribute(element, name, path) for element in root.findall(tag))
        for tag, name in (("disable_default_collisions", "link"), ("passive_joint", "name"))
    )
    motions = {
        element.get("joint_name", "").strip(): element.get("value", "").strip()
        for element in root.findall("joint_property")
        if element.get("property_name", "").strip() == "motion_model"
    }
    roots = []
    for element in root.iter("virtual_joint"):
        name, kind = _attribute(element, "name", path), element.get("type", "planar").strip().lower()
        roots.append(VirtualJoint(name, kind, element.get("child_link", "").strip(), motions.get(name, "")))
    place = {"srdf": path.name}
    notes = (
        replace(note, where=place if is_xacro else {**note.where, **place}) for note in unread(root, SRDF)
    )
    return Srdf(path, states, groups, disabled, tuple(roots), enabled, untouched, passive, tuple(notes))


def srdf_beside(file: Path, robot: str) -> Path | None:
    """The SRDF in a usual place that has a description file's name, or is about the robot described there."""
    stem = file.name.split(".", 1)[0] if file.suffix.lower() == ".xacro" else file.stem
    folders = [file.absolute().parent / folder.format(stem=stem) for folder in _FOLDERS]
    named = (folder / f"{stem}{suffix}" for suffix in SUFFIXES for folder in folders)
    same = [path for path in named if path.is_file()][:1]
    if not same:
        nearby = (path for folder in folders[:2] for path in sorted(folder.glob(f"*{SUFFIXES[0]}")))
        same = [path for path in nearby if _is_of(path, robot)]
    if len(same) > 1:
        same = [path for path in same if path.stem.lower() == robot.lower()]
    return Path(os.path.normpath(same[0])) if len(same) == 1 else None


def _is_of(path: Path, robot: str) -> bool:
    try:
        return parse(read_text(path)).get("name", "").lower() == robot.lower()
    except (XmlError, RobotError, OSError):
        return False


def _group(group: ElementTree.Element, path: Path) -> Group:
    def all_of(tag: str, *attributes: str) -> list[tuple[str, ...]]:
        return [
            tuple(_attribute(element, name, path) for name in attributes) for element in group.findall(tag)
        ]

    chains = [(base, tip) for base, tip in all_of("chain", "base_link", "tip_link")]
    joints, links, groups = (sum(all_of(tag, "name"), ()) for tag in ("joint", "link", "group"))
    return Group(joints, links, groups, tuple(chains))


def _attribute(element: ElementTree.Element, name: str, path: Path) -> str:
    value = element.get(name, "").strip()
    if not value:
        raise _refused(element, path, "attribute_missing", element=element.tag, attribute=name)
    return value


def _numbers(joint: ElementTree.Element, path: Path) -> tuple[float, ...]:
    text = " ".join(joint.get("value", "").split())
    try:
        values = tuple(float(word) for word in text.split())
    except ValueError:
        values = ()
    if not values or not np.isfinite(values).all():
        raise _refused(joint, path, "state_not_numbers", name=joint.get("name"), got=text)
    return values


def _refused(element: ElementTree.Element, path: Path, code: str, /, **values: object) -> RobotError:
    line = {"line": element.line} if isinstance(element, Element) else {}
    return refusal(f"srdf: {path}", Finding(code, values, line))
