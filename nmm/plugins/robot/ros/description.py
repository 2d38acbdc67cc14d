"""The URDF text of a whole robot, as nmm moves and draws it, whatever it was put together from."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement, tostring

import numpy as np
import pinocchio as pin

from nmm.base.arrays import Array
from nmm.model.robots.loading.provenance import provenance_of
from nmm.model.robots.robot import Robot
from nmm.plugins.robot.ros.links import Link, Links
from nmm.views.playback.placements import joint_screw
from nmm.views.playback.sticks import appearance

fcl = pin.hppfcl
PACKAGE = "package://"


def description(
    robot: Robot, links: Links, address: Callable[[str], str] | None = None
) -> tuple[str, list[str]]:
    """The text: links, joints with limits and mimics, what is drawn; and the names of shapes that URDF has no
    words for. Joints turn as in the robot's files, so that their names and signs are those of JointStates; of
    those that are corrected (`nmm.with_numbers`) URDF has words for the offset and for a ratio of -1, not for
    others: their signs alone count. A mesh's `address` is given its file; by default it is `by_package`."""
    root, left_out = Element("robot", name=robot.name), []
    written = {name: SubElement(root, "link", name=name) for name in links.links}
    address = address or by_package(robot)
    for shape in appearance(robot).shapes.geometryObjects:
        name = links.holder(shape.parentFrame, shape.parentJoint)
        parts = list(_parts(shape, address))
        if not parts:
            left_out.append(str(shape.name))
        for geometry, at in parts:
            visual = SubElement(written[name], "visual")
            placed = shape.placement.homogeneous @ at
            _write_origin(visual, np.linalg.inv(links.links[name].place) @ placed)
            SubElement(visual, "geometry").append(geometry)
            if shape.overrideMaterial or geometry.tag != "mesh":
                color = " ".join(f"{part:.6g}" for part in shape.meshColor)
                SubElement(SubElement(visual, "material", name=color), "color", rgba=color)
    for link in links.links.values():
        if link.parent:
            _write_joint(root, robot, link, links.placement(link))
    return tostring(root, encoding="unicode"), left_out


def packaged(robot: Robot) -> dict[str, tuple[str, str]]:
    """Mesh files under ROS_PACKAGE_PATH, each with its folder there, and its package and path in that."""
    places = {}
    for name, file in provenance_of(robot).meshes.items():
        inside = name.removeprefix(PACKAGE).lstrip("/")
        if name.startswith(PACKAGE) and str(file).endswith(f"/{inside}"):
            places[str(file)] = str(file).removesuffix(f"/{inside}"), inside
    return places


def by_package(robot: Robot) -> Callable[[str], str]:
    """Addresses of meshes: the package:// names of the files, or else file:// names."""
    files = packaged(robot)

    def address(file: str) -> str:
        _, inside = files.get(file, ("", ""))
        return f"{PACKAGE}{inside}" if inside else by_file(file)

    return address


def by_file(file: str) -> str:
    """The file:// name of a mesh, with blanks and letters as they are: Rerun and others unquote nothing."""
    return f"file://{file}"


def _write_joint(root: Element, robot: Robot, link: Link, place: Array) -> None:
    model, (factor, offset) = robot.display_model, robot.gear(link.joint)
    sign = math.copysign(1.0, factor)
    joint = SubElement(root, "joint", name=link.joint, type="fixed")
    if link.moves and offset:  # what an encoder reads there is 0 at the offset
        place = place @ pin.exp6(offset * pin.Motion(*joint_screw(model, link.on))).homogeneous
    _write_origin(joint, place)
    SubElement(joint, "parent", link=link.parent)
    SubElement(joint, "child", link=link.name)
    if not link.moves:
        return
    linear, angular = joint_screw(model, link.on)
    turns = bool(angular.any())
    if turns and linear.any():
        joint.set("type", "floating")  # a screw: URDF has none, and TF moves it
        return
    i, v = model.joints[link.on].idx_q, model.joints[link.on].idx_v
    limits = (model.lowerPositionLimit, model.upperPositionLimit)
    ends = sorted(robot.reading(link.joint, float(end[i])) for end in limits)
    unlimited = turns and np.isinf(ends).all()
    joint.set("type", "continuous" if unlimited else "revolute" if turns else "prismatic")
    SubElement(joint, "axis", xyz=_text(sign * (angular if turns else linear)))
    fastest = float(model.velocityLimit[v]) / abs(factor)
    most = {"effort": _number(model.upperEffortLimit[v]), "velocity": _number(fastest)}
    limit = SubElement(joint, "limit", most)
    if not unlimited:
        limit.attrib |= {"lower": _number(ends[0]), "upper": _number(ends[1])}
    for mimic in robot.mimic_joints:
        if mimic.joint == link.joint:
            multiplier, ahead = robot.gear(mimic.leader)  # the leader's value is what its encoder reads
            multiplier *= mimic.multiplier / factor
            ahead = (mimic.value(ahead) - offset) / factor
            numbers = {"multiplier": _number(multiplier), "offset": _number(ahead)}
            SubElement(joint, "mimic", {"joint": mimic.leader, **numbers})


def _parts(shape: pin.GeometryObject, address: Callable[[str], str]) -> Iterator[tuple[Element, Array]]:
    """A shape in URDF's words, each with its place (4, 4) in it; nothing where there are none."""
    form, middle = shape.geometry, np.eye(4)
    if isinstance(form, fcl.Box):
        yield Element("box", size=_text(2.0 * form.halfSide)), middle
    elif isinstance(form, fcl.Sphere):
        yield Element("sphere", radius=_number(form.radius)), middle
    elif isinstance(form, fcl.Cylinder | fcl.Capsule):
        radius, half = _number(form.radius), float(form.halfLength)
        yield Element("cylinder", radius=radius, length=_number(2.0 * half)), middle
        if isinstance(form, fcl.Capsule):  # URDF 1.0 has none
            for end in (half, -half):
                at = pin.SE3(np.eye(3), np.array([0.0, 0.0, end]))
                yield Element("sphere", radius=radius), at.homogeneous
    elif shape.meshPath and Path(shape.meshPath).is_absolute():
        yield Element("mesh", filename=address(shape.meshPath), scale=_text(shape.meshScale)), middle


def _write_origin(parent: Element, place: Array) -> None:
    rpy = pin.rpy.matrixToRpy(np.ascontiguousarray(place[:3, :3]))
    SubElement(parent, "origin", xyz=_text(place[:3, 3]), rpy=_text(rpy))


def _text(values: Array) -> str:
    return " ".join(_number(value) for value in values)


def _number(value: float) -> str:
    """All digits; what is infinite, or has lost digits, as the nearest number that readers of URDF take."""
    most = sys.float_info.max
    return repr(float(np.clip(value, -most, most)) if abs(value) > 1e-300 else 0.0)
