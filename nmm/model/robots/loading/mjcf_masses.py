"""Masses of MJCF's bodies, as MuJoCo's compiler reckons them: from <inertial>, or from their geoms."""

from __future__ import annotations

import math
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from nmm.base.arrays import Array
from nmm.model.robots.loading.mjcf_numbers import Numbers
from nmm.model.robots.loading.mjcf_reading import Dropped, Mjcf
from nmm.model.robots.loading.mjcf_tree import Geom, Inertial, Mesh, MjcfBody
from nmm.model.robots.loading.xml_tree import Attributes, Element
from nmm.model.robots.mesh_files import mesh_arrays

#: A step of a derivative along the imaginary axis, which loses no digits.
_STEP = 1e-30
#: Thomsen's exponent: areas of ellipsoids to 1 %.
_THOMSEN = 1.6075
#: MuJoCo's bodies of less than this, kg, have no mass.
_NO_MASS = 1e-15


class VolumeMoments(NamedTuple):
    """volume : m³, or m² of a shell
    center : (3,), m
    moments : (3, 3), about the centre, for each unit of volume"""

    volume: float
    center: Array
    moments: Array

    @property
    def box(self) -> Array:
        """Half lengths (3,), longest last, of the box with these moments."""
        a, b, c = np.linalg.eigvalsh(self.moments)[::-1]
        return np.sqrt(np.maximum(1.5 * np.array([b + c - a, a + c - b, a + b - c]), 0.0))

    @property
    def axes(self) -> Array:
        """The rotation (3, 3) of the principal axes, that of the largest moment first."""
        axes = np.linalg.eigh(self.moments)[1][:, ::-1]
        return axes if np.linalg.det(axes) > 0.0 else axes * np.array([1.0, 1.0, -1.0])


class Masses:
    """Inertias of a file's bodies; `unknown` are the meshes of bodies that cannot be weighed."""

    def __init__(self, mjcf: Mjcf, file: Path, faults: Attributes) -> None:
        self._settings, self._folder, self.unknown = mjcf.settings, file.parent, list[Dropped]()
        self._numbers = Numbers({"angle": "radian", "eulerseq": "xyz"}, faults)
        compiler = Element("compiler", mjcf.settings)
        self._least = [self._numbers.number(compiler, key) for key in ("boundmass", "boundinertia")]
        lower, upper = self._numbers.vector(compiler, "inertiagrouprange", (0.0, 5.0))
        self._groups = range(int(lower), int(upper) + 1)
        self._scale = 1.0
        total = self._numbers.number(compiler, "settotalmass", -1.0)
        if total > 0.0:
            bodies = [body for top in mjcf.world.of(MjcfBody) for body in top.all()]
            self._scale = total / max(sum(self.of(body).mass for body in bodies), _NO_MASS)

    def of(self, body: MjcfBody) -> pin.Inertia:
        """The body's own inertia, in its axes; of no mass where the file says none."""
        inertial: Inertial | None = next(iter(body.of(Inertial)), None)
        from_geoms = self._settings.get("inertiafromgeom", "auto")
        if from_geoms == "true" or (from_geoms == "auto" and inertial is None):
            inertia = self._of_geoms(body)
        elif inertial is not None:
            place = inertial.place
            inertia = place.act(pin.Inertia(inertial.mass, np.zeros(3), inertial.moments))
        else:
            inertia = pin.Inertia.Zero()
        return self._bounded(inertia)

    def _of_geoms(self, body: MjcfBody) -> pin.Inertia:
        total = pin.Inertia.Zero()
        for geom in body.of(Geom):
            if geom.group not in self._groups or geom.mass == 0.0:
                continue
            solid = self.solid(geom)
            if solid is None:
                self.unknown.append(
                    Dropped(f"mass of mesh {geom.mesh.name if geom.mesh else ''}", geom.element)
                )
                continue
            mass = geom.density * solid.volume if geom.mass is None else geom.mass
            if mass > 0.0:
                total += geom.place.act(pin.Inertia(mass, solid.center, mass * solid.moments))
        return total

    def _bounded(self, inertia: pin.Inertia) -> pin.Inertia:
        """With what <compiler> asks of every body."""
        mass, moment = self._least
        balance = self._settings.get("balanceinertia") == "true"
        moments = np.array(inertia.inertia)
        if moment or balance:
            values, axes = np.linalg.eigh(moments)
            values = np.maximum(values, moment)
            if balance and values[2] > values[0] + values[1]:
                values[:] = values.mean()
            moments = axes @ np.diag(values) @ axes.T
        return pin.Inertia(
            self._scale * max(inertia.mass, mass), np.array(inertia.lever), self._scale * moments
        )

    def solid(self, geom: Geom) -> VolumeMoments | None:
        """A geom's volume, or its surface, in its own axes; None for a mesh that cannot be read."""
        mesh = None if geom.mesh is None else self.of_mesh(geom.mesh)
        if geom.kind in ("plane", "hfield"):
            return VolumeMoments(0.0, np.zeros(3), np.zeros((3, 3)))
        if geom.kind in ("mesh", "sdf"):
            return mesh
        size, center, axes = geom.size, np.zeros(3), np.eye(3)
        if geom.mesh is not None:
            if mesh is None:
                return None
            size, center, axes = fitted(geom, mesh), mesh.center, mesh.axes
        volume, moments = _plain(geom.kind, size, geom.shell)
        return VolumeMoments(volume, center, axes @ np.diag(moments) @ axes.T)

    def of_mesh(self, mesh: Mesh) -> VolumeMoments | None:
        """A mesh as it stands in its geom."""
        file, element = self._folder / mesh.file, mesh.element
        try:
            if mesh.file:
                vertices, faces = _triangles(file, file.stat().st_mtime_ns)
            elif element.get("vertex"):
                vertices, faces = _written(element)
            else:
                return None
        except (OSError, ValueError, TypeError, KeyError, IndexError, AttributeError):
            return None
        placed = mesh.scale * ((vertices - mesh.reference.translation) @ mesh.reference.rotation)
        if float(np.prod(mesh.scale)) < 0.0:
            faces = faces[:, ::-1]
        return _weighed(placed, faces, mesh.inertia)


def fitted(geom: Geom, mesh: VolumeMoments) -> Array:
    """MuJoCo's size (3,) of a plain shape that stands for a mesh: that of the box with the mesh's moments."""
    a, b, c = mesh.box
    radius = 0.5 * (a + b)
    sizes = {
        "sphere": ((a + b + c) / 3.0, 0.0, 0.0),
        "capsule": (radius, max(c - 0.5 * radius, 0.0), 0.0),
        "cylinder": (radius, c, 0.0),
    }
    scale = float(geom.element.get("fitscale", "1"))
    return scale * np.array(sizes.get(geom.kind, (a, b, c)))


def _plain(kind: str, size: Array, shell: bool) -> tuple[float, Array]:
    """Volume and moments about the centre, (3,), for each unit of it; of a shell, which is what grows where
    the shape does, its area."""
    grown = size + 1j * _STEP
    if kind in ("sphere", "capsule", "cylinder"):  # what else is there is a length, or nothing
        grown = np.array([grown[0], grown[1] if kind == "cylinder" else size[1], size[2]])
    volume, moments = _volume(kind, grown)
    if not shell:
        return volume.real, moments.real / (volume.real or 1.0)
    area = volume.imag / _STEP
    per_area = moments.imag / _STEP / (area or 1.0)
    if kind == "ellipsoid":
        a, b, c = size**_THOMSEN
        area = 4.0 * math.pi * ((a * b + a * c + b * c) / 3.0) ** (1.0 / _THOMSEN)
    return area, per_area


def _volume(kind: str, size: np.ndarray) -> tuple[complex, np.ndarray]:
    """Volume and moments about the centre (3,), of complex lengths too."""
    a, b, c = size
    if kind == "box":
        volume = 8.0 * a * b * c
        return volume, volume / 3.0 * np.array([b**2 + c**2, a**2 + c**2, a**2 + b**2])
    if kind == "ellipsoid":
        volume = 4.0 / 3.0 * math.pi * a * b * c
        return volume, volume / 5.0 * np.array([b**2 + c**2, a**2 + c**2, a**2 + b**2])
    balls = 0.0 if kind == "cylinder" else 4.0 / 3.0 * math.pi * a**3
    tube = 0.0 if kind == "sphere" else 2.0 * math.pi * a**2 * b
    half = 0.0 if kind == "sphere" else b  # between the middles of the two half balls
    along = 0.5 * tube * a**2 + 0.4 * balls * a**2
    across = tube * (a**2 / 4.0 + b**2 / 3.0) + balls * (0.4 * a**2 + half**2 + 0.75 * half * a)
    return balls + tube, np.array([across, across, along])


@lru_cache(maxsize=64)
def _triangles(file: Path, _changed: int) -> tuple[Array, np.ndarray]:
    """Corners (n, 3) and faces (m, 3) of a file."""
    return _msh(file) if file.suffix.lower() == ".msh" else mesh_arrays(str(file))


def _msh(file: Path) -> tuple[Array, np.ndarray]:
    """MuJoCo's own format: four counts, corners, normals, places in a texture, faces."""
    content = file.read_bytes()
    corners, normals, places, faces = np.frombuffer(content, np.int32, 4)
    numbers = np.frombuffer(content, np.float32, 3 * corners, 16)
    start = 16 + 4 * (3 * corners + 3 * normals + 2 * places)
    return (
        numbers.reshape(-1, 3).astype(float),
        np.frombuffer(content, np.int32, 3 * faces, start).reshape(-1, 3),
    )


def _written(mesh: Element) -> tuple[Array, np.ndarray]:
    """Of a mesh whose corners are in the file; without faces it is their hull."""
    vertices = np.array(mesh.get("vertex", "").split(), dtype=float).reshape(-1, 3)
    if mesh.get("face"):
        return vertices, np.array(mesh.get("face", "").split(), dtype=int).reshape(-1, 3)
    return _hull(vertices)


def _hull(vertices: Array) -> tuple[Array, np.ndarray]:
    import trimesh

    hull = trimesh.convex.convex_hull(vertices)
    return np.array(hull.vertices), np.array(hull.faces)


def _weighed(vertices: Array, faces: np.ndarray, how: str) -> VolumeMoments:
    """By the tetrahedra from the surface's centroid to each face: "exact"; "convex", of the hull; "shell", by
    the faces alone; "legacy", where all volumes are positive, once more from the centre of mass."""
    if how == "convex":
        vertices, faces = _hull(vertices)
    corners = vertices[faces]
    crossed = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = 0.5 * np.linalg.norm(crossed, axis=1)
    total = float(areas.sum()) or 1.0
    centroid = areas @ corners.mean(axis=1) / total
    if how == "shell":
        return _summed(areas, corners - centroid, centroid, 12.0)
    solid = _of_tetrahedra(corners, crossed, centroid, how == "legacy")
    if how != "legacy":
        return solid
    again = _of_tetrahedra(corners, crossed, solid.center, True)
    off = again.center - solid.center  # the moments stay those about the first centre
    moments = again.moments + (off @ off * np.eye(3) - np.outer(off, off))
    return VolumeMoments(again.volume, solid.center, moments)


def _of_tetrahedra(corners: Array, crossed: Array, apex: Array, positive: bool) -> VolumeMoments:
    volumes = np.einsum("ij,ij->i", corners[:, 0] - apex, crossed) / 6.0
    tips = np.zeros((len(corners), 1, 3))
    return _summed(
        np.abs(volumes) if positive else volumes,
        np.concatenate([corners - apex, tips], axis=1),
        apex,
        20.0,
    )


def _summed(weights: Array, corners: Array, origin: Array, share: float) -> VolumeMoments:
    """Of simplices with weights (m,) and corners (m, k, 3) about an origin (3,); the second moment of one is
    its corners' and their sum's, each with itself, over `share`."""
    total = float(weights.sum())
    whole = total or 1.0
    center = weights @ corners.mean(axis=1) / whole
    sums = corners.sum(axis=1)
    second = np.einsum("i,ikj,ikl->jl", weights, corners, corners) + np.einsum(
        "i,ij,il->jl", weights, sums, sums
    )
    second = second / share / whole - np.outer(center, center)
    return VolumeMoments(total, origin + center, np.trace(second) * np.eye(3) - second)
