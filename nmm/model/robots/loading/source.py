"""Reads Pinocchio's models of a file, or takes those given.

Reading meshes takes Pinocchio most of its time: each is replaced by a ball, its file kept beside the text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Literal
from xml.etree import ElementTree

import pinocchio as pin

from nmm.base.bundled import bundled_robots
from nmm.base.errors import RobotError, expect_known, no_such
from nmm.base.findings import Finding
from nmm.base.findings.robot_file import refusal
from nmm.base.text_format import one_line
from nmm.model.robots.loading import mending
from nmm.model.robots.loading.chain import CHAIN, mimic_joints_of, replaced_joints
from nmm.model.robots.loading.check import CheckedUrdf, inspect
from nmm.model.robots.loading.check_parts import mesh_scale, shape_of
from nmm.model.robots.loading.description import SUFFIXES, describe
from nmm.model.robots.loading.drive_marks import DriveMarks, drive_marks
from nmm.model.robots.loading.mjcf import Converted
from nmm.model.robots.loading.packages import PACKAGE, package_file
from nmm.model.robots.loading.provenance import Provenance
from nmm.model.robots.loading.xml_tree import Element, child, children
from nmm.model.robots.meshes import leave_unread
from nmm.model.robots.mimic_joints import MimicJoint

# What Pinocchio gets of a checked description: kinematics, inertia and shapes. The rest (calibration,
# safety_controller, mimic of locked joints, transmissions, Gazebo's elements) says nothing to nmm, and
# Pinocchio's reader would still stumble over it.
_SHAPES = ("visual", "collision")
_JOINT_PARTS = ("origin", "parent", "child")
_MOVING_PARTS = ("axis", "limit", "dynamics")


@dataclass(frozen=True, eq=False)
class Source:
    """A robot's models, which are not to be changed, and what goes with them.

    where, label : its name in messages; its file, bundled name, or "pin.Model"
    all_pairs : whether we choose the collision pairs
    on_chain : whether its first joints x, y, theta are a platform's, not the file's
    mimic_joints : each after its leader
    platform : the kind that the file declares; mjcf : what a file of MuJoCo's says besides
    marks : what the file's text says of its drive"""

    name: str
    where: str
    label: str
    model: pin.Model
    visual_model: pin.GeometryModel
    collision_model: pin.GeometryModel
    all_pairs: bool
    on_chain: bool = False
    arguments: Mapping[str, str] = field(default_factory=dict)
    mimic_joints: tuple[MimicJoint, ...] = ()
    platform: str | None = None
    notes: tuple[Finding, ...] = ()
    provenance: Provenance = field(default_factory=Provenance)
    marks: DriveMarks = field(default_factory=DriveMarks)
    mjcf: Converted | None = None


def read_file(
    source: str | Path,
    arguments: Mapping[str, object] | None,
    package_dirs: Sequence[str | Path],
    lock: Mapping[str, float],
    missing_meshes: Literal["error", "skip"],
) -> Source:
    expect_known("missing_meshes", missing_meshes, ("error", "skip"), error=RobotError)
    description = describe(source_path(source, package_dirs), arguments, package_dirs)
    where, packages = str(source), description.packages
    meshes: dict[str, Path | None] = {}

    def find_mesh(name: str) -> Path | Finding | None:
        answer = packages.mesh(name)
        if isinstance(answer, Finding) and missing_meshes == "error":
            return answer
        return meshes.setdefault(name, None if isinstance(answer, Finding) else answer)

    checked, problems = inspect(description.urdf, find_mesh, lock)
    if checked is None or problems:
        raise refusal(where, *problems, lines=not description.expanded)
    model, visual, collision = _pinocchio_models(checked, where)
    for joint, armature in ({} if description.mjcf is None else description.mjcf.armature).items():
        model.armature[model.joints[model.getJointId(joint)].idx_v] = armature
    missing = [name for name, file in meshes.items() if file is None]
    left_out = [Finding("shapes_left_out", {"names": missing})] if missing else []
    return Source(
        name=checked.name,
        where=where,
        label=where,
        model=model,
        visual_model=visual,
        collision_model=collision,
        all_pairs=True,
        arguments=description.arguments,
        mimic_joints=checked.mimic_joints,
        platform=checked.platform,
        notes=(
            *(*description.notes, *left_out, *packages.notes, *_spared(checked.spared)),
            *description.placed(checked.unread),
        ),
        provenance=Provenance(
            dict(packages.found), packages.searched, meshes, accelerations=checked.accelerations
        ),
        marks=drive_marks(checked.root),
        mjcf=description.mjcf,
    )


def _spared(faults: Sequence[Finding]) -> list[Finding]:
    """Notes on faults that were spared: each joint that follows none, and how many others there are."""
    notes = [fault for fault in faults if fault.code == "leader_unknown"]
    others = [fault for fault in faults if fault.code != "leader_unknown"]
    if others:
        notes.append(Finding("faults_spared", {"count": len(others), "first": str(others[0])}))
    return notes


def read_model(
    model: pin.Model, visual_model: pin.GeometryModel | None, collision_model: pin.GeometryModel | None
) -> Source:
    """A Pinocchio model with its shapes; their collision pairs are the caller's."""
    return Source(
        name=model.name or "robot",
        where=f"pin.Model {model.name!r}" if model.name else "pin.Model",
        label="pin.Model",
        model=model,
        visual_model=_shapes(visual_model, "visual_model", model),
        collision_model=_shapes(collision_model, "collision_model", model),
        all_pairs=False,
        on_chain=replaced_joints(model) == len(CHAIN),
        mimic_joints=mimic_joints_of(model),
    )


def source_path(source: str | Path, package_dirs: Sequence[str | Path]) -> Path:
    """The file of a path, of a package:// name, or of a bundled name: a string without folder and suffix."""
    if isinstance(source, Path):
        return source
    if not isinstance(source, str):
        raise RobotError(expected="a robot's name, a path or a pin.Model", got=source)
    if source.startswith(PACKAGE):
        return package_file(source, package_dirs)
    if "/" in source or "\\" in source or source.lower().endswith(SUFFIXES):
        return Path(source)
    robots = bundled_robots()
    if source not in robots:
        expected = "a bundled name, or the path of a .urdf, .xacro or .xml file"
        raise no_such("robot", source, robots, error=partial(RobotError, expected=expected))
    return robots[source]


#: By "visual" or "collision", and the name that Pinocchio gives the shape: its <mesh> or <capsule>, a mesh's
#: file.
_StandIns = Mapping[str, dict[str, tuple[Element, Path | None]]]


def _pinocchio_models(
    checked: CheckedUrdf, where: str
) -> tuple[pin.Model, pin.GeometryModel, pin.GeometryModel]:
    """The fixed-base model, visual and collision shapes; meshes are not read."""
    xml, stand_ins = _for_pinocchio(checked)
    try:
        model = pin.buildModelFromXML(xml)
        visual, collision = (
            pin.buildGeomFromUrdfString(model, xml, kind)
            for kind in (pin.GeometryType.VISUAL, pin.GeometryType.COLLISION)
        )
    except (ValueError, RuntimeError) as error:
        reason = {"error": "Pinocchio", "reason": one_line(str(error))}
        raise refusal(where, Finding("library_failed", reason)) from None
    for shapes, stood_for in ((visual, stand_ins["visual"]), (collision, stand_ins["collision"])):
        for shape in shapes.geometryObjects:
            element, file = stood_for.get(shape.name, (None, None))
            if element is not None and file is not None:
                leave_unread(shape, str(file), mesh_scale(element) or (1.0, 1.0, 1.0))
            elif element is not None:
                sizes = (float(element.get(size, "")) for size in ("radius", "length"))
                shape.geometry = pin.hppfcl.Capsule(*sizes)
    return model, visual, collision


def _for_pinocchio(checked: CheckedUrdf) -> tuple[str, _StandIns]:
    """URDF text of a checked description with a ball for every mesh and capsule, and these."""
    root = ElementTree.Element("robot", name=checked.name)
    stand_ins: _StandIns = {kind: {} for kind in _SHAPES}
    for material in mending.materials(checked.root):
        # One without colour or texture defines nothing, and Pinocchio's reader prints an error for it.
        if child(material, "color") is not None or child(material, "texture") is not None:
            root.append(material)
    for link in children(checked.root, "link"):
        copied = ElementTree.SubElement(root, "link", name=link.get("name", ""))
        copied.extend(mending.inertials(link))
        for kind in _SHAPES:
            count = 0
            for part in children(link, kind):
                shape = shape_of(part)
                if shape is None or (shape.tag == "mesh" and shape.get("filename") not in checked.meshes):
                    continue  # it is to be left out
                stand_in: ElementTree.Element = shape
                if shape.tag in ("mesh", "capsule"):
                    file = checked.meshes.get(shape.get("filename", ""))
                    stand_ins[kind][f"{link.get('name', '')}_{count}"] = shape, file
                    stand_in = ElementTree.Element("sphere", radius="1")
                copied.append(mending.with_shape(part, stand_in))
                count += 1
    for joint in children(checked.root, "joint"):
        kind = joint.get("type", "")
        copied = ElementTree.SubElement(root, "joint", name=joint.get("name", ""), type=kind)
        for tag in _JOINT_PARTS if kind == "fixed" else _JOINT_PARTS + _MOVING_PARTS:
            if (element := child(joint, tag)) is not None:
                copied.append(mending.limit(element) if tag == "limit" else element)
    return ElementTree.tostring(root, encoding="unicode"), stand_ins


def _shapes(shapes: pin.GeometryModel | None, name: str, model: pin.Model) -> pin.GeometryModel:
    if shapes is None:
        return pin.GeometryModel()
    if not isinstance(shapes, pin.GeometryModel):
        raise RobotError(where=name, expected="a pin.GeometryModel", got=shapes)
    for shape in shapes.geometryObjects:
        if shape.parentJoint >= model.njoints:
            what = f"shape {shape.name!r} is on a joint that the model does not have"
            raise RobotError(what, where=name, got=shape.name)
    return shapes
