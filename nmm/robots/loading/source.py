"""What is read before anything is done to it: Pinocchio's models of a file, or those given."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import pinocchio as pin

from nmm.bundled import bundled_robots
from nmm.errors import RobotError, expect_known, unknown
from nmm.robots.followers import Follower
from nmm.robots.loading.chain import followers_of
from nmm.robots.loading.check import check
from nmm.robots.loading.description import SUFFIXES, describe
from nmm.robots.loading.packages import package_file
from nmm.robots.loading.provenance import Provenance
from nmm.robots.loading.urdf_text import UrdfText, urdf_text
from nmm.robots.meshes import leave_unread
from nmm.words import one_line

PACKAGE = "package://"


@dataclass(frozen=True, eq=False)
class Source:
    """A robot's models and what goes with them.

    Attributes
    ----------
    name : the robot's name
    where : what messages call it
    label : its file, bundled name, or "pin.Model"
    model, visual_model, collision_model : Pinocchio's, not to be changed
    all_pairs : whether the collision pairs are ours to choose
    arguments : the xacro arguments used
    followers : joints that follow others, each after the one that it follows
    platform : the kind of platform that the file declares
    notes : what was done
    provenance : what was found
    """

    name: str
    where: str
    label: str
    model: pin.Model
    visual_model: pin.GeometryModel
    collision_model: pin.GeometryModel
    all_pairs: bool
    arguments: Mapping[str, str] = field(default_factory=dict)
    followers: tuple[Follower, ...] = ()
    platform: str | None = None
    notes: tuple[str, ...] = ()
    provenance: Provenance = field(default_factory=Provenance)


def read_file(
    source: str | Path,
    arguments: Mapping[str, object] | None,
    package_dirs: Sequence[str | Path],
    lock: Mapping[str, float],
    missing_meshes: Literal["error", "skip"],
) -> Source:
    """The models of a bundled robot or of a file; see `load`."""
    expect_known("missing_meshes", missing_meshes, ("error", "skip"), error=RobotError)
    description = describe(path_of(source, package_dirs), arguments, package_dirs)
    where, packages = str(source), description.packages
    meshes: dict[str, Path | None] = {}

    def find_mesh(name: str) -> Path | str | None:
        found = packages.mesh(name)
        if isinstance(found, str) and missing_meshes == "error":
            return found
        meshes[name] = None if isinstance(found, str) else found
        return meshes[name]

    checked = check(description.xml, where, find_mesh, lock, not description.expanded)
    model, visual, collision = _pinocchio_models(urdf_text(checked, checked.name), where)
    missing = [name for name, file in meshes.items() if file is None]
    left_out = [f"shapes left out, their meshes are missing: {', '.join(missing)}"] if missing else []
    return Source(
        name=checked.name,
        where=where,
        label=where,
        model=model,
        visual_model=visual,
        collision_model=collision,
        all_pairs=True,
        arguments=description.arguments,
        followers=checked.followers,
        platform=checked.platform,
        notes=(*description.notes, *left_out),
        provenance=Provenance(dict(packages.found), packages.searched, meshes),
    )


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
        followers=followers_of(model),
    )


def path_of(source: str | Path, package_dirs: Sequence[str | Path]) -> Path:
    """The file of a bundled name, of a package:// name or of a path: a string without folder and suffix is a
    bundled name."""
    if isinstance(source, Path):
        return source
    if not isinstance(source, str):
        raise RobotError(f"expected a robot's name, a path or a pin.Model, got {type(source).__name__}")
    if source.startswith(PACKAGE):
        return package_file(source, package_dirs)
    if "/" in source or "\\" in source or source.lower().endswith(SUFFIXES):
        return Path(source)
    robots = bundled_robots()
    if source not in robots:
        raise RobotError(f"{unknown('robot', source, robots)}; or give the path of a .urdf or .xacro file")
    return robots[source]


def _pinocchio_models(urdf: UrdfText, where: str) -> tuple[pin.Model, pin.GeometryModel, pin.GeometryModel]:
    """Fixed-base model, visual and collision shapes of a checked description; its meshes are not read."""
    try:
        model = pin.buildModelFromXML(urdf.xml)
        visual, collision = (
            pin.buildGeomFromUrdfString(model, urdf.xml, kind)
            for kind in (pin.GeometryType.VISUAL, pin.GeometryType.COLLISION)
        )
    except (ValueError, RuntimeError) as error:
        raise RobotError(f"{where}: Pinocchio cannot read it: {one_line(str(error))}") from None
    for shapes, kind in ((visual, "visual"), (collision, "collision")):
        for shape in shapes.geometryObjects:
            mesh = urdf.meshes[kind].get(shape.name)
            if mesh is not None:
                leave_unread(shape, str(mesh.path), mesh.scale)
    return model, visual, collision


def _shapes(shapes: pin.GeometryModel | None, name: str, model: pin.Model) -> pin.GeometryModel:
    if shapes is None:
        return pin.GeometryModel()
    if not isinstance(shapes, pin.GeometryModel):
        raise RobotError(f"{name}: expected a pin.GeometryModel, got {type(shapes).__name__}")
    for shape in shapes.geometryObjects:
        if shape.parentJoint >= model.njoints:
            raise RobotError(f"{name}: shape {shape.name!r} is on a joint that the model does not have")
    return shapes
