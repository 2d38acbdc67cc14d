"""SRDF, the file beside a URDF that names groups of joints, postures, and links that may touch."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from nmm.errors import RobotError
from nmm.robots.loading.text import read_text
from nmm.robots.loading.xml_tree import XmlError, parse

#: Where it is looked for, from the URDF's folder: MoveIt's packages, example-robot-data, and beside it.
_FOLDERS = (".", "../srdf", "../config", "../../{stem}_moveit_config/config")
SUFFIX = ".srdf"


@dataclass(frozen=True)
class Group:
    """A named part of a robot: joints, links (for the joint above each), chains (base, tip), other groups."""

    joints: tuple[str, ...]
    links: tuple[str, ...]
    chains: tuple[tuple[str, str], ...]
    groups: tuple[str, ...]


@dataclass(frozen=True)
class Srdf:
    """What a file says, in its own names.

    Attributes
    ----------
    path : the file
    states : the values of each joint that a state names; states of one name for several groups are one
    groups : by name
    disabled : pairs of links
    roots : the joints that it invents between the world and the robot
    """

    path: Path
    states: Mapping[str, Mapping[str, tuple[float, ...]]]
    groups: Mapping[str, Group]
    disabled: tuple[tuple[str, str], ...]
    roots: tuple[str, ...]


def read_srdf(file: str | Path) -> Srdf:
    """Read an SRDF.

    Raises
    ------
    RobotError : no such file, no SRDF (a URDF among them), a state without a name, values that are no numbers
    """
    path = Path(os.path.expanduser(file))
    try:
        root = parse(read_text(path))
    except FileNotFoundError:
        raise RobotError(f"srdf: there is no file {path}") from None
    except XmlError as error:
        line = "" if error.line is None else f":{error.line}"
        raise RobotError(f"srdf: {path}{line}: {error}") from None
    except RobotError as error:
        raise RobotError(f"srdf: {error}") from None
    if root.tag != "robot" or root.find("link") is not None:
        what = "a URDF" if root.tag == "robot" else f"<{root.tag}>"
        raise RobotError(f"srdf: {path}: expected an SRDF (groups, states, pairs of links), this is {what}")
    states: dict[str, dict[str, tuple[float, ...]]] = {}
    for state in root.iter("group_state"):
        found = states.setdefault(_attribute(state, "name", path), {})
        for joint in state.iter("joint"):
            found[_attribute(joint, "name", path)] = _numbers(joint, path)
    groups = {_attribute(group, "name", path): _group(group, path) for group in root.findall("group")}
    pairs = [(one.get("link1", ""), one.get("link2", "")) for one in root.iter("disable_collisions")]
    roots = tuple(_attribute(one, "name", path) for one in root.iter("virtual_joint"))
    return Srdf(path, states, groups, tuple(pairs), roots)


def srdf_beside(file: Path, robot: str) -> Path | None:
    """The SRDF that goes with a description file, in a usual place: of the file's name, or the robot's.

    Parameters
    ----------
    file : the .urdf or .xacro file
    robot : what it calls the robot
    """
    stem = file.name.split(".", 1)[0] if file.suffix.lower() == ".xacro" else file.stem
    folders = [file.absolute().parent / folder.format(stem=stem) for folder in _FOLDERS]
    named = (folder / f"{stem}{SUFFIX}" for folder in folders)
    found = next((path for path in named if path.is_file()), None)
    if found is not None:
        return Path(os.path.normpath(found))
    there = [path for folder in folders[:2] for path in sorted(folder.glob(f"*{SUFFIX}"))]
    same = [path for path in there if _is_of(path, robot)]
    if len(same) > 1:
        same = [path for path in same if path.stem.lower() == robot.lower()]
    return Path(os.path.normpath(same[0])) if len(same) == 1 else None


def _is_of(path: Path, robot: str) -> bool:
    """Whether an SRDF is about a robot of that name; upper and lower case are one."""
    try:
        return parse(read_text(path)).get("name", "").lower() == robot.lower()
    except (XmlError, RobotError, OSError):
        return False


def _group(group: Element, path: Path) -> Group:
    def names(tag: str) -> Iterator[str]:
        return (_attribute(one, "name", path) for one in group.findall(tag))

    chains = [
        (_attribute(one, "base_link", path), _attribute(one, "tip_link", path))
        for one in group.findall("chain")
    ]
    return Group(tuple(names("joint")), tuple(names("link")), tuple(chains), tuple(names("group")))


def _attribute(element: Element, name: str, path: Path) -> str:
    value = element.get(name, "").strip()
    if not value:
        raise RobotError(f"srdf: {_place(element, path)}: <{element.tag}> without {name}")
    return value


def _numbers(joint: Element, path: Path) -> tuple[float, ...]:
    text = " ".join(joint.get("value", "").split())
    try:
        values = tuple(float(word) for word in text.split())
    except ValueError:
        values = ()
    if not values or not np.isfinite(values).all():
        raise RobotError(
            f"srdf: {_place(joint, path)}: joint {joint.get('name')}: expected numbers, got {text[:60]!r}"
        )
    return values


def _place(element: Element, path: Path) -> str:
    return f"{path}:{getattr(element, 'line', 0)}"
