"""Meshes that are read when something draws or collides, not when a robot is loaded.

A shape whose mesh is unread is an ordinary `pin.GeometryObject` around a mesh without vertices, so models are
reduced, joined, copied and pickled as ever. A robot asked for its shapes reads their meshes first."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple
from weakref import WeakValueDictionary

import numpy as np
import pinocchio as pin

from nmm.base.findings import Finding
from nmm.base.findings.robot_file import refusal
from nmm.base.text_format import one_line
from nmm.model.robots.mesh_files import mesh_arrays

# Read by now and in use: a mesh that several shapes or robots have is read once, and goes with the last.
_IN_USE: WeakValueDictionary[tuple[object, ...], Any] = WeakValueDictionary()
_LOCK = threading.RLock()


class Shapes(NamedTuple):
    """A robot's shapes, some of whose meshes may not be read yet.

    Examples
    --------
    >>> shapes = nmm.load("unicycle_2r").shapes
    >>> isinstance(shapes, nmm.extending.Shapes), len(shapes.visual_model.geometryObjects) > 0
    (True, True)
    """

    visual_model: pin.GeometryModel
    collision_model: pin.GeometryModel


def leave_unread(shape: pin.GeometryObject, file: str, scale: Sequence[float]) -> None:
    """Gives a shape a mesh file that is yet to be read; `scale` (3,) stretches its axes."""
    shape.geometry, shape.meshPath, shape.meshScale = pin.hppfcl.BVHModelOBBRSS(), file, np.array(scale)


def is_unread(shape: pin.GeometryObject) -> bool:
    mesh = shape.geometry
    return isinstance(mesh, pin.hppfcl.BVHModelBase) and not mesh.num_vertices and bool(shape.meshPath)


def read_meshes(shapes: Iterable[pin.GeometryObject], where: str) -> None:
    """Give shapes their unread meshes, in place; threads may call it at the same time. `RobotError` names
    file and link of each mesh that cannot be read; the others are read."""
    problems = []
    with _LOCK:
        for shape in shapes:
            if is_unread(shape):
                try:
                    shape.geometry = _mesh(shape.meshPath, shape.meshScale)
                except (OSError, ValueError) as error:
                    cause = (isinstance(error, OSError) and error.strerror) or one_line(str(error))
                    link = shape.name.rpartition("_")[0]
                    values = {"mesh": shape.meshPath, "reason": cause}
                    problems.append(Finding("mesh_unreadable", values, {"link": link}))
    if problems:
        raise refusal(where, *problems)


def _mesh(file: str, scale: np.ndarray) -> Any:
    """A mesh as Pinocchio's own reader of URDFs takes it."""
    state = os.stat(file)
    key = (file, *map(float, scale), state.st_mtime_ns, state.st_size)
    mesh = _IN_USE.get(key)
    if mesh is None:
        _IN_USE[key] = mesh = mesh_of(file, scale)
    return mesh


def mesh_of(file: str, scale: np.ndarray) -> Any:
    """The mesh of a file (coal's, with its tree of boxes), its axes stretched by `scale` (3,)."""
    vertices, faces = mesh_arrays(file, scale)
    mesh = pin.hppfcl.BVHModelOBBRSS()
    mesh.beginModel(len(faces), len(vertices))
    mesh.addVertices(vertices)
    mesh.addTriangles(faces)
    mesh.endModel()
    return mesh


class MeshesWhenAsked:
    """A dataclass field that reads a geometry model's meshes when it is asked for; `vars(owner)` holds the
    model as it is, its meshes perhaps unread."""

    def __init__(self, name: str) -> None:
        self._name, self._done = name, f"_{name}_has_meshes"

    def __get__(self, owner: Any, kind: type | None = None) -> Any:
        if owner is None:
            return self
        held = vars(owner)
        if self._done not in held:
            read_meshes(held[self._name].geometryObjects, owner.name)
            held[self._done] = True
        return held[self._name]

    def __set__(self, owner: Any, shapes: pin.GeometryModel) -> None:
        vars(owner)[self._name] = shapes
