"""The text that Pinocchio gets: a checked description, only its checked parts, and no meshes.

Pinocchio reads meshes with the text, which takes most of the time that it needs. So it gets a ball in the
place of each, and the mesh's file goes beside the text.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from xml.etree import ElementTree

from nmm.robots.loading.check import CheckedUrdf
from nmm.robots.loading.findings import child, children
from nmm.robots.loading.xml_tree import Element

# Kinematics, inertia and shapes. What is left out (calibration, safety_controller, mimic of locked joints,
# transmissions, Gazebo's elements) says nothing to nmm, and Pinocchio's reader would still stumble over it.
_SHAPES = ("visual", "collision")
_JOINT_PARTS = ("origin", "parent", "child")
_MOVING_PARTS = ("axis", "limit", "dynamics")


@dataclass(frozen=True)
class MeshFile:
    """A mesh's file, and how its axes are stretched, (3,)."""

    path: Path
    scale: tuple[float, ...]


@dataclass(frozen=True)
class UrdfText:
    """A description for Pinocchio.

    Attributes
    ----------
    xml : URDF text, with a ball for every mesh
    meshes : what the balls stand for: by "visual" or "collision", and the name that Pinocchio gives the shape
    """

    xml: str
    meshes: dict[str, dict[str, MeshFile]] = field(default_factory=lambda: {kind: {} for kind in _SHAPES})


def urdf_text(checked: CheckedUrdf, name: str) -> UrdfText:
    """URDF text of a checked description, with the robot's name replaced by `name`."""
    root = ElementTree.Element("robot", name=name)
    meshes: dict[str, dict[str, MeshFile]] = {kind: {} for kind in _SHAPES}
    for material in children(checked.root, "material"):
        # One without colour or texture defines nothing, and Pinocchio's reader prints an error for it.
        if child(material, "color") is not None or child(material, "texture") is not None:
            root.append(material)
    for link in children(checked.root, "link"):
        copied = ElementTree.SubElement(root, "link", name=link.get("name", ""))
        copied.extend(children(link, "inertial"))
        for kind in _SHAPES:
            count = 0
            for part in children(link, kind):
                mesh = _mesh(part)
                if mesh is not None:
                    file = checked.meshes.get(mesh.get("filename", ""))
                    if file is None:
                        continue  # it is to be left out
                    scale = tuple(map(float, mesh.get("scale", "1 1 1").split()))
                    meshes[kind][f"{link.get('name', '')}_{count}"] = MeshFile(file, scale)
                copied.append(part if mesh is None else _with_ball(part))
                count += 1
    for joint in children(checked.root, "joint"):
        kind = joint.get("type", "")
        copied = ElementTree.SubElement(root, "joint", name=joint.get("name", ""), type=kind)
        for tag in _JOINT_PARTS if kind == "fixed" else _JOINT_PARTS + _MOVING_PARTS:
            if (found := child(joint, tag)) is not None:
                copied.append(found)
    return UrdfText(ElementTree.tostring(root, encoding="unicode"), meshes)


def _mesh(part: Element) -> Element | None:
    """The mesh, if that is the shape of a link's part."""
    geometry = child(part, "geometry")
    shape = next(iter(geometry), None) if geometry is not None else None
    return shape if isinstance(shape, Element) and shape.tag == "mesh" else None


def _with_ball(part: Element) -> ElementTree.Element:
    """The part of a link with a ball in the place of its mesh."""
    copied = ElementTree.Element(part.tag, part.attrib)
    copied.extend(other for other in part if other.tag != "geometry")
    ElementTree.SubElement(ElementTree.SubElement(copied, "geometry"), "sphere", radius="1")
    return copied
