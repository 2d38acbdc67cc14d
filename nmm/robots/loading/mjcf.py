"""MJCF, MuJoCo's language, as URDF: the one tree that moves, with its shapes. What is not understood is
refused, so that nothing moves otherwise than in MuJoCo."""

import math
import re
from collections.abc import Iterator, Sequence
from pathlib import Path, PurePosixPath
from typing import cast
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

from nmm.arrays import Array
from nmm.findings import Finding
from nmm.findings.robot_file import refusal
from nmm.robots.loading.check import RESERVED
from nmm.robots.loading.check_parts import MESH_SUFFIXES, MOMENTS
from nmm.robots.loading.mending import NO_LIMIT
from nmm.robots.loading.xml_tree import DEEPEST, Attributes, Element, XmlError, children, parse, read_text

#: What is asked of <compiler>: what stands without it, and what is understood.
_SETTINGS = {
    "angle": ("degree", "degree|radian"),
    "eulerseq": ("xyz", "[xyzXYZ]{3}"),
    "autolimits": ("true", "true|false"),
    "coordinate": ("local", "local"),
}
_JOINTS = {"hinge": "revolute", "slide": "prismatic", "free": "floating"}
#: What a body may hold; of cameras, lights and plugins nothing is taken.
_PARTS = ("body", "joint", "freejoint", "frame", "geom", "inertial", "site", "camera", "light", "plugin")
#: Geoms of this group and above are not shown.
_HIDDEN = 3
_ORIGIN = (0.0, 0.0, 0.0)

#: A part of a body with its class's defaults, where the frames around it are in the body, and its childclass.
_Part = tuple[Element, pin.SE3, str]
#: By tag, the attributes that a class gives.
_Class = dict[str, dict[str, str]]


def urdf_of(root: Element, file: Path) -> tuple[str, tuple[Finding, ...]]:
    """URDF text of an MJCF file, and what was left out; `RobotError` for what is not understood, and for
    several trees that move."""
    _include(root, file, {file.absolute()})
    reader = _Reader(root, file.stem)
    if reader.faults.found:
        raise refusal(file, *reader.faults.found)
    notes = [Finding("mjcf_left_out", {"names": reader.left_out})] if reader.left_out else []
    return ElementTree.tostring(reader.robot, encoding="unicode"), tuple(notes)


def _include(parent: Element, main: Path, read: set[Path], depth: int = 0) -> None:
    """Puts what other files hold, each read once as in MuJoCo, in the place of <include>."""
    if depth > DEEPEST:
        raise refusal(main, Finding("nested_too_deep", {"most": DEEPEST}))
    parts: list[Element] = []
    for part in _inside(parent):
        if part.tag != "include":
            parts.append(part)
            continue
        name = part.get("file", "")
        file, place = (main.parent / name).absolute(), {"file": name}
        try:
            if file in read:
                raise XmlError("mjcf_included_twice")
            read.add(file)
            included = parse(read_text(file))
            for one in cast("Iterator[Element]", included.iter()):
                one.line = 0  # it is not the main file's
            parts += _inside(included)
        except FileNotFoundError:
            raise refusal(main, Finding("file_unreadable", {"reason": "no such file"}, place)) from None
        except XmlError as error:
            raise refusal(main, Finding(error.finding.code, error.finding.values, place)) from None
    parent[:] = parts
    for part in parts:
        _include(part, main, read, depth + 1)


class _Reader:
    """Goes through an MJCF's bodies and writes `robot`, a URDF's; `faults` is what is not understood."""

    def __init__(self, root: Element, name: str) -> None:
        self.robot = ElementTree.Element("robot", name=root.get("model") or name)
        self.faults, self.left_out = Attributes(), list[str]()
        self._settings = {key: usual for key, (usual, _) in _SETTINGS.items()}
        for one in children(root, "compiler"):
            self._settings |= one.attrib
        for key, (usual, pattern) in _SETTINGS.items():
            if not re.fullmatch(pattern, self._settings[key]):
                self.faults.add(None, "mjcf_unread", what=f"<compiler {key}={self._settings[key]!r}>")
                self._settings[key] = usual
        self._degree = 1.0 if self._settings["angle"] == "radian" else math.pi / 180.0
        self._classes: dict[str, _Class] = {"main": {}}
        for one in children(root, "default"):
            self._read_class(one, "main", {})
            self._classes[one.get("class", "main")] = self._classes["main"]
        assets = [part for one in children(root, "asset") for part in _inside(one)]
        self._meshes = {one.get("name", _stem(one)): one for one in assets if one.tag == "mesh"}
        self._colours = {one.get("name"): one.get("rgba") for one in assets if one.tag == "material"}
        world = Element("body")
        world.extend(part for one in children(root, "worldbody") for part in one)
        # Names that are made up give way to the file's.
        self._links, self._joints = (
            {one.get("name", "") for one in world.iter(tag)}.union(RESERVED) for tag in _PARTS[:2]
        )
        self._written: dict[str, tuple[ElementTree.Element, float]] = {}
        self._tree(world)
        for one in children(root, "equality"):
            for part in _inside(one):
                self._couple(self._with_defaults(part, "main"))

    def _read_class(self, element: Element, name: str, above: _Class) -> None:
        """A <default>: what the one around it says, and what the elements in it change."""
        made = {tag: {**values} for tag, values in self._classes.get(name, above).items()}
        for part in element:
            if part.tag != "default":
                made.setdefault(part.tag, {}).update(part.attrib)
        self._classes[name] = made
        for nested in children(element, "default"):
            self._read_class(nested, nested.get("class", name), made)

    def _with_defaults(self, element: Element, childclass: str) -> Element:
        name = element.get("class", childclass)
        self.faults.choice(element, name, [*self._classes], "default class", {})
        values = {**self._classes.get(name, {}).get(element.tag, {}), **element.attrib}
        made = Element(element.tag, {key: value.strip() for key, value in values.items()})
        made.extend(element)
        made.line = element.line
        return made

    def _parts(self, body: Element, around: pin.SE3, childclass: str) -> Iterator[_Part]:
        """What a body holds, also in its frames."""
        childclass = body.get("childclass", childclass)
        for part in _inside(body):
            if part.tag not in _PARTS:
                self.faults.add(part, "mjcf_unread", what=f"<{part.tag}>")
            elif part.tag == "frame":
                yield from self._parts(part, around * self._pose(part), childclass)
            else:
                yield self._with_defaults(part, childclass), around, childclass

    def _tree(self, world: Element) -> None:
        """The body of the world that has joints or, where none has, all."""
        bodies = [part for part in self._parts(world, _at(_ORIGIN), "main") if part[0].tag == "body"]
        moving = [part for part in bodies if any(_is_joint(one) for one in part[0].iter())]
        names = [part[0].get("name", "(unnamed)") for part in moving]
        if len(moving) > 1:
            self.faults.add(None, "mjcf_several_trees", names=names)
            return
        if moving:
            still = [one for one, *_ in bodies if one is not moving[0][0]]
            self.left_out += [f"body {one.get('name', '(unnamed)')}" for one in still]
        if bodies:
            world_link = self._link("world")
            for part in moving or bodies:
                self._body(*part, world_link)

    def _body(self, body: Element, around: pin.SE3, childclass: str, parent: ElementTree.Element) -> None:
        """A link below a body's joints, each of which turns or slides about a point of the body."""
        parts = [*self._parts(body, _at(_ORIGIN), childclass)]
        place, name = around * self._pose(body), body.get("name")
        joints = [part for part in parts if _is_joint(part[0])]
        for joint, within, _ in joints:
            point = within.act(self._vector(joint, "pos", _ORIGIN))
            is_last = joint is joints[-1][0] and not point.any()
            moved = f"{joint.get('name') or name or 'body'}_moved"
            link = self._link("body", name) if is_last else self._link(moved)
            self._joint(joint, within.rotation, place * _at(point), parent, link)
            parent, place = link, _at(-point)
        if not joints or place.translation.any():
            link = self._link("body", name)
            self._connect("fixed", f"{link.get('name')}_fixed", parent, link, place)
        plain = [one for one, *_ in parts if one.tag == "geom" and not _collides(one)]
        for one, within, kind in parts:
            if one.tag == "geom":
                self._shape(one, within, link, is_drawn=one in plain or not plain)
            elif one.tag == "inertial":
                self._inertial(one, within, link)
            elif one.tag == "site" and one.get("name"):
                frame = self._link(one.get("name", ""))
                self._connect("fixed", f"{frame.get('name')}_site", link, frame, within * self._pose(one))
            elif one.tag == "body":
                self._body(one, within, kind, link)

    def _link(self, wanted: str, name: str | None = None) -> ElementTree.Element:
        """A new link with a body's name or, without, with one like `wanted` that no other has."""
        return ElementTree.SubElement(self.robot, "link", name=name or _new_name(wanted, self._links))

    def _connect(
        self, kind: str, name: str, parent: ElementTree.Element, link: ElementTree.Element, place: pin.SE3
    ) -> ElementTree.Element:
        """A new joint, with a joint's name or one like `name` that no other has."""
        if kind == "fixed":
            name = _new_name(name, self._joints)
        joint = ElementTree.SubElement(self.robot, "joint", name=name, type=kind)
        for tag, end in (("parent", parent), ("child", link)):
            ElementTree.SubElement(joint, tag, link=end.get("name", ""))
        _write_origin(joint, place)
        return joint

    def _joint(
        self,
        joint: Element,
        turned: Array,
        place: pin.SE3,
        parent: ElementTree.Element,
        link: ElementTree.Element,
    ) -> None:
        name = joint.get("name") or _new_name(f"{link.get('name')}_joint", self._joints)
        kind = "free" if joint.tag == "freejoint" else joint.get("type", "hinge")
        self.faults.choice(joint, kind, [*_JOINTS], "joint type", {"joint": name})
        if kind == "free":
            self._connect("floating", name, parent, link, place)
            return
        axis = _unit(turned @ self._vector(joint, "axis", (0.0, 0.0, 1.0)))
        unit = self._degree if kind == "hinge" else 1.0
        ref = unit * self._number(joint, "ref")
        lower, upper = unit * self._vector(joint, "range", (0.0, 0.0))
        limited = joint.get("limited", "auto")
        if limited == "auto":
            limited = self._settings["autolimits"] if lower < upper else "false"
        written = "continuous" if kind == "hinge" and limited != "true" else _JOINTS.get(kind, "")
        # MuJoCo's value where the file draws the joint is `ref`, URDF's is 0.
        drawn = pin.SE3(_turn(-ref, axis), np.zeros(3)) if kind == "hinge" else _at(-ref * axis)
        made = self._connect(written, name, parent, link, place * drawn)
        ElementTree.SubElement(made, "axis", xyz=_text(axis))
        ends = (repr(float(lower)), repr(float(upper))) if limited == "true" else (f"-{NO_LIMIT}", NO_LIMIT)
        if written != "continuous":
            limits = {"lower": ends[0], "upper": ends[1], "effort": NO_LIMIT, "velocity": NO_LIMIT}
            ElementTree.SubElement(made, "limit", limits)
        self._written[name] = made, ref

    def _couple(self, equality: Element) -> None:
        """A joint that follows another in a straight line; other constraints are left out."""
        offset, factor, *bends = map(float, self._vector(equality, "polycoef", (0.0, 1.0, 0.0, 0.0, 0.0)))
        names = [equality.get("joint1", ""), equality.get("joint2", "")]
        if equality.get("active") == "false" or (equality.tag == "joint" and names[0] not in self._written):
            return
        if equality.tag != "joint" or names[1] not in self._written or any(bends):
            self.left_out.append(f"<{equality.tag}> {equality.get('name') or names[0]}".strip())
            return
        (follower, ref), (_, of_leader) = (self._written[name] for name in names)
        line = {"multiplier": repr(factor), "offset": repr(offset + ref - factor * of_leader)}
        ElementTree.SubElement(follower, "mimic", line, joint=names[1])

    def _inertial(self, inertial: Element, within: pin.SE3, link: ElementTree.Element) -> None:
        made = ElementTree.SubElement(link, "inertial")
        _write_origin(made, within * self._pose(inertial))
        ElementTree.SubElement(made, "mass", value=inertial.get("mass", "0"))
        principal = self._vector(inertial, "diaginertia", _ORIGIN)
        xx, yy, zz, xy, xz, yz = self._vector(inertial, "fullinertia", (*principal, *_ORIGIN))
        moments = map(_text, ([xx], [xy], [xz], [yy], [yz], [zz]))
        ElementTree.SubElement(made, "inertia", dict(zip(MOMENTS, moments, strict=True)))

    def _shape(self, geom: Element, within: pin.SE3, link: ElementTree.Element, is_drawn: bool) -> None:
        """A geom, where it collides and where it is drawn; others than URDF's shapes are left out."""
        kind = "mesh" if geom.get("mesh") else geom.get("type", "sphere")
        geom.set("size", " ".join([*geom.get("size", "").split(), "0", "0", "0"][:3]))
        size, pose = self._vector(geom, "size", _ORIGIN), within * self._pose(geom)
        if geom.get("fromto"):
            start, end = self._vector(geom, "fromto", (*_ORIGIN, *_ORIGIN)).reshape(2, 3)
            size[1:] = size[0], 0.0
            size[2 if kind in ("box", "ellipsoid") else 1] = 0.5 * np.linalg.norm(end - start)
            pose = within * pin.SE3(_onto(end - start), 0.5 * (start + end))
        written = {
            "sphere": {"radius": _text(size[:1])},
            "box": {"size": _text(2.0 * size)},
            "cylinder": {"radius": _text(size[:1]), "length": _text(2.0 * size[1:2])},
        }
        written["capsule"] = written["cylinder"]
        if kind == "mesh" and (mesh := self._meshes.get(geom.get("mesh", ""))) is not None:
            mesh = self._with_defaults(mesh, "main")
            file = PurePosixPath(mesh.get("file", ""))
            moved = pin.SE3(self._rotation(mesh, "ref"), self._vector(mesh, "refpos", _ORIGIN))
            pose *= moved.inverse()
            if file.suffix.lower() in MESH_SUFFIXES:
                folder = self._settings.get("meshdir", self._settings.get("assetdir", ""))
                written["mesh"] = {"filename": str(folder / file), "scale": mesh.get("scale", "1 1 1")}
        if kind not in written:
            self.left_out.append(f"shape {geom.get('mesh') or kind}")
            return
        hidden = self._number(geom, "group") >= _HIDDEN or not is_drawn
        for tag in ["collision"] * _collides(geom) + ["visual"] * (not hidden):
            part = ElementTree.SubElement(link, tag)
            _write_origin(part, pose)
            ElementTree.SubElement(ElementTree.SubElement(part, "geometry"), kind, written[kind])
            rgba = geom.get("rgba") or self._colours.get(geom.get("material"))
            if rgba is not None and tag == "visual":
                material = ElementTree.SubElement(part, "material", name=rgba)
                ElementTree.SubElement(material, "color", rgba=rgba)

    def _pose(self, element: Element) -> pin.SE3:
        return pin.SE3(self._rotation(element), self._vector(element, "pos", _ORIGIN))

    def _rotation(self, element: Element, prefix: str = "") -> Array:
        """The matrix of the first attribute, of those that MuJoCo knows, that the element has."""
        if element.get("axisangle"):
            *axis, angle = self._vector(element, "axisangle", (*_ORIGIN, 0.0))
            return _turn(self._degree * angle, _unit(np.array(axis)))
        if element.get("euler"):
            made = np.eye(3)
            angles = self._vector(element, "euler", _ORIGIN)
            for letter, angle in zip(self._settings["eulerseq"], angles, strict=True):
                turn = pin.utils.rotate(letter.lower(), float(self._degree * angle))
                made = made @ turn if letter.islower() else turn @ made
            return made
        if element.get("xyaxes"):
            x, y = self._vector(element, "xyaxes", (*_ORIGIN, *_ORIGIN)).reshape(2, 3)
            x = _unit(x)
            y = _unit(y - (x @ y) * x)
            return np.column_stack([x, y, np.cross(x, y)])
        if element.get("zaxis"):
            return _onto(self._vector(element, "zaxis", _ORIGIN))
        w, x, y, z = self._vector(element, f"{prefix}quat", (1.0, *_ORIGIN))
        return np.array(pin.Quaternion(w, x, y, z).normalized().matrix())

    def _vector(self, element: Element, attribute: str, usual: Sequence[float]) -> Array:
        found = self.faults.vector(element, attribute, len(usual), {"part": f"<{element.tag}>"})
        return np.array(usual if found is None else found, dtype=float)

    def _number(self, element: Element, attribute: str) -> float:
        return float(self._vector(element, attribute, (0.0,))[0])


def _inside(element: ElementTree.Element) -> list[Element]:
    return cast("list[Element]", [*element])


def _stem(mesh: Element) -> str:
    return PurePosixPath(mesh.get("file", "")).stem


def _is_joint(element: ElementTree.Element) -> bool:
    return element.tag in ("joint", "freejoint")


def _collides(geom: Element) -> bool:
    return geom.get("contype", "1") != "0" or geom.get("conaffinity", "1") != "0"


def _new_name(wanted: str, taken: set[str]) -> str:
    name = wanted
    while name in taken:
        name = f"{wanted}_{len(taken)}"
        wanted = name
    taken.add(name)
    return name


def _at(point: Sequence[float] | Array) -> pin.SE3:
    return pin.SE3(np.eye(3), np.array(point))


def _unit(vector: Array) -> Array:
    length = np.linalg.norm(vector)
    return vector / length if length > 0.0 else vector


def _turn(angle: float, axis: Array) -> Array:
    return np.array(pin.AngleAxis(float(angle), axis).matrix())


def _onto(vector: Array) -> Array:
    """The shortest turn of the z axis onto a vector."""
    axis = np.cross((0.0, 0.0, 1.0), vector)
    sine = float(np.linalg.norm(axis))
    return _turn(math.atan2(sine, vector[2]), axis / sine if sine > 1e-10 else np.array([1.0, 0.0, 0.0]))


def _write_origin(parent: ElementTree.Element, pose: pin.SE3) -> None:
    rpy = pin.rpy.matrixToRpy(pose.rotation)
    ElementTree.SubElement(parent, "origin", xyz=_text(pose.translation), rpy=_text(rpy))


def _text(values: Sequence[float] | Array) -> str:
    # What is smaller has lost digits, which Pinocchio's reader refuses.
    return " ".join(repr(float(value) if abs(value) > 1e-300 else 0.0) for value in values)
