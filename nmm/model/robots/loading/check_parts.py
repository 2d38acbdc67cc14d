"""What is wrong, or odd, inside links (inertia, shapes, meshes, materials) and joints (type, axis, limits).

Pinocchio drops a faulty inertial or shape and says so only on standard error."""

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from nmm.base.findings import Finding
from nmm.model.robots.loading.check_limits import check_limit
from nmm.model.robots.loading.xml_tree import (
    NOBODY,
    Attributes,
    Element,
    Owner,
    body_of,
    child,
    children,
    link_at,
)

#: The file of a mesh by its name, why there is none ("mesh_missing"), or None to leave the shape out.
FindMesh = Callable[[str], Path | Finding | None]

#: Formats that both coal (shapes) and trimesh (playback) read.
MESH_SUFFIXES = (".3mf", ".dae", ".glb", ".gltf", ".obj", ".off", ".ply", ".stl")
#: Shape: its attributes and how many numbers each holds.
_SHAPES = {
    "box": {"size": 3},
    "cylinder": {"radius": 1, "length": 1},
    "sphere": {"radius": 1},
    "capsule": {"radius": 1, "length": 1},
    "mesh": {},
}
MOMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
TYPES = ("revolute", "continuous", "prismatic", "fixed")
#: Joints of several degrees of freedom, which are taken where they carry the whole robot.
BASES = ("planar", "floating")
#: How far from upright the normal of a base's plane may be.
_UPRIGHT = 1e-6
#: A body heavier than this, kg, was probably not written in kg.
HEAVY = 1000.0
#: Revolute limits between these, rad, were probably written in degrees: robots' own end at 10, and what is
#: beyond the last stands for no limit.
IN_DEGREES = 4.0 * math.pi, 1000.0
#: Angles of an <origin> beyond a full turn, rad, and rounding, were probably written in degrees.
FULL_TURN = 2.0 * math.pi * (1.0 + 1e-4)
#: How far a principal moment may be above the sum of the others, as a fraction: files round.
ROUNDED = 1e-3


def check_link(
    link: Element, reader: Attributes, spared: Attributes, find_mesh: FindMesh, meshes: dict[str, Path]
) -> None:
    """Adds to `meshes` the files that were found, by the name in the URDF; `spared` gets faults that
    kinematics does not feel."""
    owner = {"link": link.get("name")}
    if (inertial := child(link, "inertial")) is not None:
        check_inertial(inertial, owner, spared)
    for tag in ("visual", "collision"):
        for part in children(link, tag):
            place = {**owner, "part": tag}
            reader.origin(part, place)
            _check_geometry(part, place, reader, spared, find_mesh, meshes)
            for material in children(part, "material"):
                check_material(material, place, spared)


def check_material(material: Element, owner: Owner, reader: Attributes) -> None:
    if material.get("name") is None:
        reader.add(material, "attribute_missing", owner, element="material", attribute="name")
    color = child(material, "color")
    if color is not None:
        rgba = reader.vector(color, "rgba", 4, owner, required=True)
        if rgba is not None and not all(0.0 <= value <= 1.0 for value in rgba):
            reader.add(color, "colour_beyond", owner, got=color.get("rgba"))


def check_inertial(inertial: Element, owner: Owner, reader: Attributes) -> None:
    reader.origin(inertial, {**owner, "part": "inertial"})
    for tag, attributes, minimum in (("mass", ("value",), 0.0), ("inertia", MOMENTS, -math.inf)):
        part = child(inertial, tag)
        if part is None:
            reader.add(inertial, "element_missing", owner, element="inertial", missing=tag)
            continue
        for attribute in attributes:
            reader.number(part, attribute, owner, required=True, minimum=minimum)


def _check_geometry(
    part: Element,
    owner: Owner,
    reader: Attributes,
    spared: Attributes,
    find_mesh: FindMesh,
    meshes: dict[str, Path],
) -> None:
    shape = shape_of(part)
    if shape is None:
        reader.add(part, "shape_missing", owner, available=[*_SHAPES])
    elif reader.choice(shape, shape.tag, tuple(_SHAPES), "shape", owner):
        for attribute, size in _SHAPES[shape.tag].items():
            lengths = reader.vector(shape, attribute, size, owner, required=True)
            if lengths is not None and min(lengths) < 0.0:
                about = {"element": shape.tag, "attribute": attribute, "got": shape.get(attribute)}
                reader.add(shape, "negative_length", owner, **about)
        if shape.tag == "mesh":
            (reader if mesh_scale(shape) is None else spared).vector(shape, "scale", 3, owner)
            _check_mesh(shape, owner, reader, find_mesh, meshes)


def mesh_scale(mesh: Element) -> tuple[float, ...] | None:
    """How a mesh's axes are stretched, (3,), where that can be read; a fourth number does not count."""
    reader = Attributes()
    for size in (3, 4):
        if (numbers := reader.vector(mesh, "scale", size, NOBODY)) is not None:
            return tuple(numbers[:3])
    return None if reader.found else (1.0, 1.0, 1.0)


def shape_of(part: Element) -> Element | None:
    geometry = child(part, "geometry")
    shape = next(iter(geometry), None) if geometry is not None else None
    return shape if isinstance(shape, Element) else None


def _check_mesh(
    mesh: Element, owner: Owner, reader: Attributes, find_mesh: FindMesh, meshes: dict[str, Path]
) -> None:
    name = reader.text(mesh, "filename", owner)
    answer = None if name is None else find_mesh(name)
    if isinstance(answer, Finding):
        reader.found.append(replace(answer, where={**mesh.place, **owner}))
    elif answer is not None and answer.suffix.lower() not in MESH_SUFFIXES:
        reader.add(mesh, "mesh_format_unknown", owner, mesh=name, available=[*MESH_SUFFIXES])
    elif name is not None and answer is not None:
        meshes[name] = answer


def check_joint(joint: Element, reader: Attributes, spared: Attributes, carries_all: bool = False) -> None:
    """`carries_all`: the only movable joint on the root link's body, which may be a base's; `spared` as in
    `check_link`."""
    owner = {"joint": joint.get("name")}
    reader.origin(joint, owner)
    kind = joint.get("type")
    if kind is None:
        reader.add(joint, "joint_type_missing", owner, available=[*TYPES])
    elif kind in BASES:
        _check_base(joint, kind, owner, reader, carries_all)
    elif kind in ("helical", "screw"):
        reader.add(joint, "joint_helical", owner, kind=kind, available=[*TYPES])
    elif reader.choice(joint, kind, TYPES, "joint type", owner) and kind != "fixed":
        _check_axis(joint, owner, reader)
        check_limit(joint, kind, owner, reader, spared)
        _check_dynamics(joint, owner, reader)


def _check_base(joint: Element, kind: str, owner: Owner, reader: Attributes, carries_all: bool) -> None:
    if not carries_all:
        reader.add(joint, "base_inside_tree", owner, kind=kind)
        return
    axis = child(joint, "axis")
    xyz = None if axis is None else reader.vector(axis, "xyz", 3, owner, required=True)
    if kind == "planar" and xyz is not None and math.hypot(*xyz[:2]) > _UPRIGHT * abs(xyz[2]):
        reader.add(axis, "base_tilted", owner, axis=xyz)


def _check_axis(joint: Element, owner: Owner, reader: Attributes) -> None:
    axis = child(joint, "axis")  # the standard's default is 1 0 0
    xyz = None if axis is None else reader.vector(axis, "xyz", 3, owner, required=True)
    if axis is not None and xyz is not None and math.hypot(*xyz) < 1e-6:
        reader.add(axis, "axis_zero", owner, got=axis.get("xyz"))


def _check_dynamics(joint: Element, owner: Owner, reader: Attributes) -> None:
    dynamics = child(joint, "dynamics")
    if dynamics is None:
        return
    if not {"damping", "friction"} & dynamics.attrib.keys():
        reader.add(dynamics, "dynamics_empty", owner)
    for attribute in ("damping", "friction"):
        reader.number(dynamics, attribute, owner, minimum=0.0)


def advice(root: Element) -> list[Finding]:
    """What a <robot> without problems leaves open or states oddly."""
    links, joints = children(root, "link"), children(root, "joint")
    reader = Attributes()
    _on_inertias(links, reader)
    _on_bodies(links, joints, reader)
    _on_joints(joints, reader)
    _on_turns(links, joints, reader)
    named = {link.get("name") for link in links}
    for joint in joints:  # two frames, of which tasks can only speak of the link's
        if joint.get("name") in named:
            reader.add(joint, "name_shared", {"joint": joint.get("name")})
    return reader.found


def _on_inertias(links: list[Element], reader: Attributes) -> None:
    for link in links:
        owner = {"link": link.get("name")}
        inertial = child(link, "inertial")
        if inertial is None:
            continue
        mass, moments = _inertia(inertial)
        principal = np.linalg.eigvalsh(moments)
        if mass > HEAVY:
            reader.add(inertial, "mass_large", owner, mass=mass)
        if mass == 0.0 and np.any(moments):
            reader.add(inertial, "mass_missing", owner)
        if mass > 0.0 and not np.any(moments):
            reader.add(inertial, "inertia_missing", owner, mass=mass)
        elif mass > 0.0 and principal[0] <= 0.0:
            reader.add(inertial, "inertia_indefinite", owner, moments=principal.tolist())
        elif mass > 0.0 and principal[2] > (1.0 + ROUNDED) * (principal[0] + principal[1]):
            reader.add(inertial, "inertia_impossible", owner, moments=principal.tolist())


def _inertia(inertial: Element) -> tuple[float, np.ndarray]:
    """Mass, kg, and the matrix of moments (3, 3), kg m^2; zeros where a number is missing."""
    mass, inertia = child(inertial, "mass"), child(inertial, "inertia")
    xx, xy, xz, yy, yz, zz = (0.0 if inertia is None else _number(inertia, key) for key in MOMENTS)
    moments = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return 0.0 if mass is None else _number(mass, "value"), moments


def _on_bodies(links: list[Element], joints: list[Element], reader: Attributes) -> None:
    """Bodies that move and have no mass: a body is a link with all that is fixed to it."""
    above = {link_at(joint, "child"): joint for joint in joints}
    inertials = {link.get("name", ""): child(link, "inertial") for link in links}
    heavy = {
        body_of(name, above)
        for name, inertial in inertials.items()
        if inertial is not None and _inertia(inertial)[0] > 0.0
    }
    for link, (name, inertial) in zip(links, inertials.items(), strict=True):
        if link.line and name in above and body_of(name, above) == name and name not in heavy:
            about = {"moved_by": above[name].get("name"), "inertial": inertial is not None}
            reader.add(link, "body_without_mass", {"link": name}, **about)


def _on_joints(joints: list[Element], reader: Attributes) -> None:
    for joint in joints:
        kind, owner = joint.get("type", ""), {"joint": joint.get("name")}
        if kind == "fixed":
            continue
        limit = child(joint, "limit")
        if limit is None:
            reader.add(joint, "velocity_unlimited", owner)
            continue
        if limit.get("velocity") is not None and _number(limit, "velocity") == 0.0:
            reader.add(limit, "velocity_zero", owner)
        lower, upper = _number(limit, "lower"), _number(limit, "upper")
        if kind != "continuous" and lower == upper:
            reader.add(limit, "joint_held", owner, value=lower)
        if kind == "revolute" and IN_DEGREES[0] < max(abs(lower), abs(upper)) < IN_DEGREES[1]:
            reader.add(limit, "limits_large", owner, lower=lower, upper=upper)


def _on_turns(links: list[Element], joints: list[Element], reader: Attributes) -> None:
    """Places turned by more than a full turn."""
    parts = [(joint, {"joint": joint.get("name")}) for joint in joints]
    for link in links:
        for tag in ("inertial", "visual", "collision"):
            parts += [(part, {"link": link.get("name"), "part": tag}) for part in children(link, tag)]
    for part, owner in parts:
        origin = child(part, "origin")
        rpy = None if origin is None else Attributes().vector(origin, "rpy", 3, owner)
        if origin is not None and rpy is not None and max(map(abs, rpy)) > FULL_TURN:
            reader.add(origin, "rpy_large", owner, rpy=[*rpy])


def _number(element: Element, attribute: str) -> float:
    """A checked number; 0 where it is missing."""
    return Attributes().number(element, attribute) or 0.0
