"""What is wrong inside links: inertia, shapes, meshes, materials.

Pinocchio drops a faulty inertial or shape with words on the C library's standard error only.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from nmm.robots.loading.findings import Findings, child, children
from nmm.robots.loading.xml_tree import Element

# The file of a mesh by its name, a sentence that says why there is none, or None to leave the shape out.
FindMesh = Callable[[str], Path | str | None]

# Formats that both coal (shapes) and trimesh (playback) read.
MESH_SUFFIXES = (".3mf", ".dae", ".glb", ".gltf", ".obj", ".off", ".ply", ".stl")
# Shape: its attributes and how many numbers each holds.
_SHAPES = {
    "box": {"size": 3},
    "cylinder": {"radius": 1, "length": 1},
    "sphere": {"radius": 1},
    "mesh": {},
}
_MOMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


def check_link(link: Element, findings: Findings, find_mesh: FindMesh) -> dict[str, Path]:
    """Add the problems inside a link; returns the mesh files that were found, by the name in the file."""
    owner = f"link {link.get('name')!r}"
    _check_inertial(link, owner, findings)
    meshes: dict[str, Path] = {}
    for tag in ("visual", "collision"):
        for part in children(link, tag):
            findings.origin(part, f"{owner}, {tag}")
            meshes |= _check_geometry(part, f"{owner}, {tag}", findings, find_mesh)
            for material in children(part, "material"):
                check_material(material, f"{owner}, {tag}", findings)
    return meshes


def check_material(material: Element, owner: str, findings: Findings) -> None:
    """Add what is wrong with a material: its name, its colour's four numbers in [0, 1]."""
    if material.get("name") is None:
        findings.add(material, f"{owner}: <material> has no name")
    color = child(material, "color")
    if color is not None:
        rgba = findings.vector(color, "rgba", 4, owner, required=True)
        if rgba is not None and not all(0.0 <= value <= 1.0 for value in rgba):
            findings.add(
                color, f"{owner}: <color> rgba: expected numbers from 0 to 1, got {color.get('rgba')!r}"
            )


def _check_inertial(link: Element, owner: str, findings: Findings) -> None:
    inertial = child(link, "inertial")
    if inertial is None:
        return
    findings.origin(inertial, f"{owner}, inertial")
    mass, inertia = child(inertial, "mass"), child(inertial, "inertia")
    if mass is None:
        findings.add(inertial, f"{owner}: <inertial> has no <mass>")
    else:
        findings.number(mass, "value", owner, required=True, minimum=0.0)
    if inertia is None:
        findings.add(inertial, f"{owner}: <inertial> has no <inertia>")
    else:
        for moment in _MOMENTS:
            findings.number(inertia, moment, owner, required=True)


def _check_geometry(part: Element, owner: str, findings: Findings, find_mesh: FindMesh) -> dict[str, Path]:
    geometry = child(part, "geometry")
    shape = next(iter(geometry), None) if geometry is not None else None
    if not isinstance(shape, Element):
        findings.add(part, f"{owner}: no shape (expected <geometry> with one of {', '.join(_SHAPES)})")
        return {}
    if not findings.choice(shape, shape.tag, tuple(_SHAPES), "shape", owner):
        return {}
    if shape.tag == "mesh":
        return _check_mesh(shape, owner, findings, find_mesh)
    for attribute, size in _SHAPES[shape.tag].items():
        lengths = findings.vector(shape, attribute, size, owner, required=True)
        if lengths is not None and min(lengths) < 0.0:
            findings.add(
                shape,
                f"{owner}: <{shape.tag}> {attribute}: expected lengths of 0 or more (m), "
                f"got {shape.get(attribute)!r}",
            )
    return {}


def _check_mesh(mesh: Element, owner: str, findings: Findings, find_mesh: FindMesh) -> dict[str, Path]:
    findings.vector(mesh, "scale", 3, owner)
    name = findings.text(mesh, "filename", owner)
    if name is None:
        return {}
    found = find_mesh(name)
    if found is None:
        return {}
    if isinstance(found, str):
        findings.add(mesh, f"{owner}: mesh {name!r}: {found}")
        return {}
    if found.suffix.lower() not in MESH_SUFFIXES:
        findings.add(mesh, f"{owner}: mesh {name!r}: unknown format, expected {', '.join(MESH_SUFFIXES)}")
        return {}
    return {name: found}
