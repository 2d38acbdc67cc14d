"""The text that Pinocchio gets: a checked description, only its checked parts, meshes by absolute path."""

from __future__ import annotations

from xml.etree import ElementTree

from nmm.robots.loading.check import CheckedUrdf
from nmm.robots.loading.findings import child, children
from nmm.robots.loading.xml_tree import Element

# Kinematics, inertia and shapes. What is left out (calibration, safety_controller, mimic of locked joints,
# transmissions, Gazebo's elements) says nothing to nmm, and Pinocchio's reader would still stumble over it.
_LINK_PARTS = ("inertial", "visual", "collision")
_JOINT_PARTS = ("origin", "parent", "child")
_MOVING_PARTS = ("axis", "limit", "dynamics")


def urdf_text(checked: CheckedUrdf, name: str) -> str:
    """URDF text of a checked description, with the robot's name replaced by `name`."""
    root = ElementTree.Element("robot", name=name)
    for material in children(checked.root, "material"):
        # One without colour or texture defines nothing, and Pinocchio's reader prints an error for it.
        if child(material, "color") is not None or child(material, "texture") is not None:
            root.append(material)
    for link in children(checked.root, "link"):
        copied = ElementTree.SubElement(root, "link", name=link.get("name", ""))
        for tag in _LINK_PARTS:
            parts = (_with_paths(part, checked) for part in children(link, tag))
            copied.extend(part for part in parts if part is not None)
    for joint in children(checked.root, "joint"):
        kind = joint.get("type", "")
        copied = ElementTree.SubElement(root, "joint", name=joint.get("name", ""), type=kind)
        for tag in _JOINT_PARTS if kind == "fixed" else _JOINT_PARTS + _MOVING_PARTS:
            part = child(joint, tag)
            if part is not None:
                copied.append(part)
    return ElementTree.tostring(root, encoding="unicode")


def _with_paths(part: Element, checked: CheckedUrdf) -> ElementTree.Element | None:
    """The part of a link; a copy with absolute mesh paths if it has a mesh, None if the mesh is left out."""
    if part.find("geometry/mesh") is None:
        return part
    copied = ElementTree.fromstring(ElementTree.tostring(part))
    for mesh in copied.iterfind("geometry/mesh"):
        file = checked.meshes.get(mesh.get("filename", ""))
        if file is None:
            return None
        mesh.set("filename", str(file))
    return copied
