"""Joints, geoms, sites and inertias of MJCF, from elements that have their classes' values."""

from collections.abc import Mapping
from pathlib import PurePosixPath

import numpy as np
import pinocchio as pin

from nmm.model.robots.loading.mjcf_numbers import ORIGIN, Numbers, onto, unit
from nmm.model.robots.loading.mjcf_tree import Geom, Inertial, Joint, Mesh, Site
from nmm.model.robots.loading.xml_tree import Element

_JOINTS = ("hinge", "slide", "free")


class ElementReader:
    """Reads a file's elements with its units, meshes and colours by name, its folder from the robot's."""

    def __init__(
        self,
        numbers: Numbers,
        settings: Mapping[str, str],
        meshes: Mapping[str, Element],
        colours: Mapping[str, str | None],
        folder: PurePosixPath,
    ) -> None:
        self.numbers, self._settings, self._folder = numbers, settings, folder
        self._meshes, self._colours = meshes, colours

    def joint(self, joint: Element) -> Joint:
        kind = "free" if joint.tag == "freejoint" else joint.get("type", "hinge")
        name = joint.get("name", "")
        self.numbers.faults.choice(joint, kind, _JOINTS, "joint type", {"joint": name or None})
        read, scale = self.numbers, self.numbers.degree if kind == "hinge" else 1.0
        lower, upper = map(float, scale * read.vector(joint, "range", (0.0, 0.0)))
        limits = (lower, upper) if self._holds(joint, "limited", lower, upper) else None
        least, most = map(float, read.vector(joint, "actuatorfrcrange", (0.0, 0.0)))
        bounded = self._holds(joint, "actuatorfrclimited", least, most)
        return Joint(
            joint,
            name,
            kind,
            read.vector(joint, "pos", ORIGIN),
            unit(read.vector(joint, "axis", (0.0, 0.0, 1.0))),
            scale * read.number(joint, "ref"),
            limits,
            min(abs(least), abs(most)) if bounded else None,
            read.number(joint, "armature"),
        )

    def _holds(self, element: Element, attribute: str, lower: float, upper: float) -> bool:
        """Whether a range holds: by that attribute or, as MuJoCo has it, because it is there."""
        word = element.get(attribute, "auto")
        return (
            (self._settings["autolimits"] == "true" and lower < upper) if word == "auto" else word == "true"
        )

    def geom(self, geom: Element) -> Geom:
        read, name = self.numbers, geom.get("mesh", "")
        kind = geom.get("type", "sphere")
        mesh = self._mesh(name) if name in self._meshes else None
        if name and mesh is None:
            self.numbers.faults.choice(geom, name, [*self._meshes], "mesh", {"part": "<geom>"})
        geom.set("size", " ".join([*geom.get("size", "").split(), "0", "0", "0"][:3]))
        size, place = read.vector(geom, "size", ORIGIN), read.place(geom)
        if geom.get("fromto"):
            start, end = read.vector(geom, "fromto", (*ORIGIN, *ORIGIN)).reshape(2, 3)
            size[1:] = size[0], 0.0
            size[2 if kind in ("box", "ellipsoid") else 1] = 0.5 * np.linalg.norm(end - start)
            place = pin.SE3(onto(end - start), 0.5 * (start + end))
        return Geom(
            geom,
            geom.get("name", ""),
            kind,
            place,
            size,
            mesh,
            read.number(geom, "mass") if geom.get("mass") is not None else None,
            read.number(geom, "density", 1000.0),
            geom.get("shellinertia") == "true",
            int(read.number(geom, "group")),
            geom.get("contype", "1") != "0" or geom.get("conaffinity", "1") != "0",
            geom.get("rgba") or self._colours.get(geom.get("material", "")),
        )

    def _mesh(self, name: str) -> Mesh:
        mesh = self._meshes[name]
        file = mesh.get("file", "")
        if file:
            folder = self._settings.get("meshdir", self._settings.get("assetdir", ""))
            bare = PurePosixPath(file).name if self._settings.get("strippath") == "true" else file
            file = str(self._folder / folder / bare)
        reference = pin.SE3(
            self.numbers.rotation(mesh, "refquat"), self.numbers.vector(mesh, "refpos", ORIGIN)
        )
        scale = self.numbers.vector(mesh, "scale", (1.0, 1.0, 1.0))
        return Mesh(mesh, name, file, scale, reference, mesh.get("inertia", "legacy"))

    def site(self, site: Element) -> Site:
        place = self.numbers.place(site)
        if site.get("fromto"):
            start, end = self.numbers.vector(site, "fromto", (*ORIGIN, *ORIGIN)).reshape(2, 3)
            place = pin.SE3(onto(end - start), 0.5 * (start + end))
        return Site(site, site.get("name", ""), place)

    def inertial(self, inertial: Element) -> Inertial:
        read = self.numbers
        principal = read.vector(inertial, "diaginertia", ORIGIN)
        xx, yy, zz, xy, xz, yz = read.vector(inertial, "fullinertia", (*principal, *ORIGIN))
        moments = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        return Inertial(inertial, read.place(inertial), read.number(inertial, "mass"), moments)
