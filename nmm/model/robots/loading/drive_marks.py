"""What a file's text says of its drive beside its wheels: rollers, and how a simulator drives the base."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from nmm.model.platforms.wheel_layout import Rollers
from nmm.model.robots.loading.xml_tree import Element, children

#: How a base is driven, by a part of the name of a simulator's plugin or of a controller, in lower case.
_DRIVES = {
    "mecanum": "mecanum",
    "planar_move": "omnidirectional",
    "planarmove": "omnidirectional",
    "force_based_move": "omnidirectional",
    "omni": "omnidirectional",
}
#: Fewer wheels than this with such friction are casters, or a slip of the pen.
_FOUR = 4
#: A wheel that grips in one direction, and in the other with less than this share, has rollers.
_FREE = 0.05


@dataclass(frozen=True)
class DriveMarks:
    """drive : "mecanum" or "omnidirectional" where a plugin or the robot's name says so, else ""
    rollers : by link, what its meshes' names or the friction that a simulator gives it say of its rim"""

    drive: str = ""
    rollers: Mapping[str, Rollers] = field(default_factory=dict)


def drive_marks(root: Element) -> DriveMarks:
    """The marks of a URDF's <robot> element."""
    aside: list[str] = []
    names = [root.get("name", "")]
    for gazebo in children(root, "gazebo"):
        link = gazebo.get("reference", "")
        if link and _slides_aside(gazebo):
            aside.append(link)
        for plugin in gazebo.iter("plugin"):
            names += [plugin.get("filename", ""), plugin.get("name", "")]
    rollers: dict[str, Rollers] = dict.fromkeys(aside if len(aside) >= _FOUR else (), "mecanum")
    for part in children(root, "link"):
        meshes = [mesh.get("filename", "").rpartition("/")[2] for mesh in part.iter("mesh")]
        drawn = rollers_named(" ".join(meshes))
        if drawn:
            rollers.setdefault(part.get("name", ""), drawn)
    return DriveMarks(next((drive for name in names if (drive := _drive(name))), ""), rollers)


def rollers_named(names: str) -> Rollers:
    """What names say of a wheel's rim."""
    names = names.lower()
    return "mecanum" if "mecanum" in names else "omni" if "omni" in names else ""


def _drive(name: str) -> str:
    return next((drive for part, drive in _DRIVES.items() if part in name.lower()), "")


def _slides_aside(gazebo: Element) -> bool:
    """Whether friction is that of rollers: some along one direction, next to none along the other."""
    along, aside = (max(_numbers(gazebo, tags), default=None) for tags in (("mu1", "mu"), ("mu2",)))
    return along is not None and aside is not None and along > 0.1 and aside <= _FREE * along


def _numbers(element: Element, tags: tuple[str, ...]) -> Iterator[float]:
    for part in element.iter():
        if part.tag in tags:
            try:
                yield float(part.text or "")
            except ValueError:
                continue
