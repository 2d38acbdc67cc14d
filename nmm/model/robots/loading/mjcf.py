"""MJCF, MuJoCo's language, as URDF: the one tree that moves, with its shapes. What is not understood is
refused, so that nothing moves otherwise than in MuJoCo."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath

import numpy as np
import pinocchio as pin

from nmm.base.arrays import Array
from nmm.base.findings import Finding
from nmm.base.findings.robot_file import refusal
from nmm.model.robots.loading.chain import yaw_of
from nmm.model.robots.loading.check import RESERVED
from nmm.model.robots.loading.check_parts import MESH_SUFFIXES, MOMENTS
from nmm.model.robots.loading.mending import NO_LIMIT
from nmm.model.robots.loading.mjcf_masses import Masses, fitted
from nmm.model.robots.loading.mjcf_numbers import at, turn
from nmm.model.robots.loading.mjcf_parts import line_in, unused
from nmm.model.robots.loading.mjcf_reading import Dropped, Mjcf, read_mjcf
from nmm.model.robots.loading.mjcf_states import Drives, drives_of, states_of
from nmm.model.robots.loading.mjcf_tree import Geom, Inertial, Joint, Mesh, MjcfBody, Site
from nmm.model.robots.loading.srdf_parts import Srdf
from nmm.model.robots.loading.xml_tree import Attributes, Element

#: Geoms of this group and above are not shown.
_HIDDEN = 3
#: How far from upright and from the ground a free body may stand to be the platform's reference itself.
_FLAT = 1e-12
#: A link on the ground below a body that stands above it (REP-120).
_FOOTPRINT = "base_footprint"


@dataclass(frozen=True)
class Converted:
    """urdf : <robot>, whose elements know their lines in the MJCF file
    notes : what was left out; states : its keyframes and the pairs that it lets touch, as an SRDF has them
    start : where MuJoCo has it at first (qpos0), by coordinate: x, y (m) and theta of a free body, `ref`s
    armature : inertia of the joints' rotors, kg m² or kg, by joint"""

    urdf: Element
    notes: tuple[Finding, ...] = ()
    states: Srdf | None = None
    start: Mapping[str, float] = field(default_factory=dict)
    armature: Mapping[str, float] = field(default_factory=dict)


def urdf_of(root: Element, file: Path) -> Converted:
    """An MJCF file as a URDF; `RobotError` for what is not understood, and for several trees that move."""
    faults = Attributes()
    mjcf = read_mjcf(root, file, faults)
    writer = _Writer(mjcf, file, faults)
    if not faults.found:
        writer.write()
    if faults.found:
        raise refusal(file, *faults.found)
    states, notes = states_of(mjcf, file, writer.qpos)
    notes += _left_out([*mjcf.left_out, *writer.left_out, *writer.masses.unknown])
    notes += [*writer.drives.notes, *unused(root)]
    armature = {name: joint.armature for name, joint in writer.qpos if joint.armature}
    return Converted(writer.robot, tuple(notes), states, writer.start, armature)


def _left_out(dropped: Iterable[Dropped]) -> list[Finding]:
    """What is left out, in a note with lines; each name once."""
    first: dict[str, Element] = {}
    for part in dropped:
        first.setdefault(part.name, part.element)
    if not first:
        return []
    lines = {name: line_in(element) for name, element in first.items()}
    return [Finding("mjcf_left_out", {"names": [*first], "lines": lines}, next(iter(first.values())).place)]


class _Writer:
    """Writes `robot`, a URDF's, from an MJCF's bodies. `qpos` are its joints in MuJoCo's order."""

    def __init__(self, mjcf: Mjcf, file: Path, faults: Attributes) -> None:
        self.mjcf, self.faults = mjcf, faults
        self.robot = Element("robot", name=mjcf.name)
        self.left_out, self.qpos = list[Dropped](), list[tuple[str, Joint]]()
        self.start: dict[str, float] = {}
        self.masses = Masses(mjcf, file, faults)
        self.drives: Drives = drives_of(mjcf, faults)
        # Names that are made up give way to the file's.
        bodies = [*mjcf.world.all()][1:]
        self._links = {body.name for body in bodies}.union(RESERVED)
        self._joints = {joint.name for body in bodies for joint in body.joints}.union(RESERVED)
        self._written: dict[str, tuple[Element, float]] = {}

    def write(self) -> None:
        """The body of the world that has joints or, where none has, all."""
        bodies = self.mjcf.world.of(MjcfBody)
        moving = [body for body in bodies if any(below.joints for below in body.all())]
        if len(moving) > 1:
            names = [body.name or "(unnamed)" for body in moving]
            # MuJoCo's way to save a URDF leaves of its root link only the shapes, in the world.
            of_urdf = all(body.joints and not _is_free(body) and body.of(Inertial) for body in moving)
            fused = of_urdf and any(geom.kind != "plane" for geom in self.mjcf.world.of(Geom))
            self.faults.add(moving[1].element, "mjcf_several_trees", names=names, fused=fused)
            return
        if moving:
            still = [body for body in bodies if body is not moving[0]]
            self._drop(still, "body")
        self._drop(self.mjcf.world.of(Geom), "shape")
        self._drop(self.mjcf.world.of(Site), "site")
        if moving and _is_free(moving[0]):
            self._free(moving[0])
        elif bodies:
            world = self._link("world")
            for body in moving or bodies:
                self._body(body, body.place, world)
        for reference in self.mjcf.references:
            self._couple(reference)

    def _drop(self, parts: Sequence[MjcfBody | Geom | Site], kind: str) -> None:
        """Things of the world that are not the robot's."""
        for part in parts:
            name = part.name or (part.kind if isinstance(part, Geom) else "(unnamed)")
            self.left_out.append(Dropped(f"{kind} {name}", part.element))

    def _free(self, body: MjcfBody) -> None:
        """A body that moves freely, above the point on the ground that x, y and theta place."""
        free, *others = body.joints
        self.qpos.append((free.name, free))
        if others:
            self.faults.add(others[0].element, "mjcf_unread", what="a joint beside a free joint")
        place = body.place
        yaw = yaw_of(place)
        x, y, z = map(float, place.translation)
        self.start |= {"x": x, "y": y, "theta": yaw}
        ground = pin.SE3(pin.utils.rotate("z", yaw), np.array([x, y, 0.0]))
        above = ground.inverse() * place
        if abs(z) < _FLAT and above.isIdentity(_FLAT):
            self._rest(body, self._link("body", body))
            return
        footprint = self._link(_FOOTPRINT)
        link = self._link("body", body)
        self._connect("fixed", f"{link.get('name')}_fixed", footprint, link, above, body.element)
        self._rest(body, link)

    def _body(self, body: MjcfBody, place: pin.SE3, parent: Element) -> None:
        """A link below a body's joints, each of which turns or slides about a point of the body."""
        joints = body.joints
        for joint in joints:
            is_last = joint is joints[-1] and not joint.point.any()
            moved = f"{joint.name or body.name or 'body'}_moved"
            link = self._link("body", body) if is_last else self._link(moved)
            self._joint(joint, place * at(joint.point), parent, link)
            parent, place = link, at(-joint.point)
        if not joints or place.translation.any():
            link = self._link("body", body)
            self._connect("fixed", f"{link.get('name')}_fixed", parent, link, place, body.element)
        self._rest(body, link)

    def _rest(self, body: MjcfBody, link: Element) -> None:
        """A body's mass, its shapes and sites, and the bodies on it."""
        _write_inertia(link, self.masses.of(body), body.element)
        geoms = body.of(Geom)
        plain = [geom for geom in geoms if not geom.collides]
        for geom in geoms:
            self._shape(geom, link, is_drawn=not geom.collides or not plain)
        for site in body.of(Site):
            if site.name:
                frame = self._link(site.name)
                self._connect("fixed", f"{frame.get('name')}_site", link, frame, site.place, site.element)
        for below in body.of(MjcfBody):
            self._body(below, below.place, link)

    def _link(self, wanted: str, body: MjcfBody | None = None) -> Element:
        """A new link with a body's name or, without, with one like `wanted` that no other has."""
        name = (body.name if body else "") or _new_name(wanted, self._links)
        return _add(self.robot, "link", body.element if body else None, name=name)

    def _connect(
        self, kind: str, name: str, parent: Element, link: Element, place: pin.SE3, of: Element
    ) -> Element:
        """A new joint, with a joint's name or one like `name` that no other has."""
        if kind == "fixed":
            name = _new_name(name, self._joints)
        joint = _add(self.robot, "joint", of, name=name, type=kind)
        for tag, end in (("parent", parent), ("child", link)):
            _add(joint, tag, of, link=end.get("name", ""))
        _write_origin(joint, place, of)
        return joint

    def _joint(self, joint: Joint, place: pin.SE3, parent: Element, link: Element) -> None:
        name = joint.name or _new_name(f"{link.get('name')}_joint", self._joints)
        self.qpos.append((name, joint))
        if joint.kind == "free":
            self._connect("floating", name, parent, link, place, joint.element)
            return
        turns, axis, ref = joint.kind == "hinge", joint.axis, joint.ref
        # MuJoCo's value where the file draws the joint is `ref`, URDF's is 0.
        drawn = pin.SE3(turn(-ref, axis), np.zeros(3)) if turns else at(-ref * axis)
        endless = turns and joint.limits is None
        kind = "continuous" if endless else "revolute" if turns else "prismatic"
        made = self._connect(kind, name, parent, link, place * drawn, joint.element)
        _add(made, "axis", joint.element, xyz=_text(axis))
        ends = (f"-{NO_LIMIT}", NO_LIMIT) if joint.limits is None else map(repr, joint.limits)
        limits = {} if endless else dict(zip(("lower", "upper"), ends, strict=True))
        effort = [value for value in (joint.effort, self.drives.effort.get(name)) if value is not None]
        velocity = self.drives.velocity.get(name)
        limits["effort"] = repr(min(effort)) if effort else NO_LIMIT
        limits["velocity"] = NO_LIMIT if velocity is None else repr(velocity)
        _add(made, "limit", joint.element, **limits)
        self._written[name] = made, ref
        if ref:
            self.start[name] = ref

    def _couple(self, equality: Element) -> None:
        """A joint that follows another in a straight line; one held otherwise, or still, is left out."""
        if equality.tag != "joint":
            return
        reader = Attributes()
        bends = reader.vector(equality, "polycoef", 5, {}) or [0.0, 1.0, 0.0, 0.0, 0.0]
        self.faults.found += reader.found
        names = [equality.get("joint1", ""), equality.get("joint2", "")]
        if equality.get("active") == "false" or names[0] not in self._written:
            return
        if names[1] not in self._written or any(bends[2:]):
            name = f"<equality> of joint {names[0]}"
            self.left_out.append(Dropped(name, equality))
            return
        (follower, ref), (_, of_leader) = (self._written[name] for name in names)
        offset, factor = bends[:2]
        line = {"multiplier": repr(factor), "offset": repr(offset + ref - factor * of_leader)}
        _add(follower, "mimic", equality, joint=names[1], **line)

    def _shape(self, geom: Geom, link: Element, is_drawn: bool) -> None:
        """A geom, where it collides and where it is drawn; others than URDF's shapes are left out."""
        kind, size, place = geom.kind, geom.size, geom.place
        if geom.mesh is not None and kind != "mesh":
            solid = self.masses.of_mesh(geom.mesh)
            if solid is not None:
                size, place = fitted(geom, solid), place * pin.SE3(solid.axes, solid.center)
            else:
                kind = f"{kind} of mesh {geom.mesh.name}"
        written = {
            "sphere": {"radius": _text(size[:1])},
            "box": {"size": _text(2.0 * size)},
            "cylinder": {"radius": _text(size[:1]), "length": _text(2.0 * size[1:2])},
        }
        written["capsule"] = written["cylinder"]
        moved = geom.mesh and _reference(geom.mesh)
        if kind == "mesh" and geom.mesh is not None and moved is not None:
            place = place * moved
            if PurePosixPath(geom.mesh.file).suffix.lower() in MESH_SUFFIXES:
                written["mesh"] = {"filename": geom.mesh.file, "scale": _text(geom.mesh.scale)}
        if kind not in written:
            what = geom.mesh.name if kind == "mesh" and geom.mesh is not None else kind
            self.left_out.append(Dropped(f"shape {what}", geom.element))
            return
        hidden = geom.group >= _HIDDEN or not is_drawn
        for tag in ["collision"] * geom.collides + ["visual"] * (not hidden):
            part = _add(link, tag, geom.element)
            _write_origin(part, place, geom.element)
            _add(_add(part, "geometry", geom.element), kind, geom.element, **written[kind])
            if geom.rgba is not None and tag == "visual":
                material = _add(part, "material", geom.element, name=geom.rgba)
                _add(material, "color", geom.element, rgba=geom.rgba)


def _is_free(body: MjcfBody) -> bool:
    return any(joint.kind == "free" for joint in body.joints)


def _reference(mesh: Mesh) -> pin.SE3 | None:
    """Where the mesh's own axes are in its geom, once it is scaled; None where that is no rotation: MuJoCo
    scales along the axes of the reference, URDF along the mesh's."""
    turned, scale = mesh.reference.rotation.T, mesh.scale
    if not np.allclose(scale[:, np.newaxis] * turned, turned * scale, atol=1e-12 * np.abs(scale).max()):
        return None
    return pin.SE3(turned, -scale * (turned @ mesh.reference.translation))


def _new_name(wanted: str, taken: set[str]) -> str:
    name = wanted
    while name in taken:
        name = f"{wanted}_{len(taken)}"
        wanted = name
    taken.add(name)
    return name


def _add(parent: Element, tag: str, of: Element | None, /, **attributes: str) -> Element:
    """A new element inside another, at the place of the one `of` the file that it comes from."""
    made = Element(tag, attributes)
    if of is not None:
        made.line, made.file = of.line, of.file
    parent.append(made)
    return made


def _write_inertia(link: Element, inertia: pin.Inertia, of: Element) -> None:
    if inertia.mass <= 0.0:
        return
    made = _add(link, "inertial", of)
    _write_origin(made, at(inertia.lever), of)
    _add(made, "mass", of, value=repr(float(inertia.mass)))
    matrix = inertia.inertia
    rows = zip(MOMENTS, ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)), strict=True)
    _add(made, "inertia", of, **{name: _text([matrix[row]]) for name, row in rows})


def _write_origin(parent: Element, pose: pin.SE3, of: Element) -> None:
    rpy = pin.rpy.matrixToRpy(pose.rotation)
    _add(parent, "origin", of, xyz=_text(pose.translation), rpy=_text(rpy))


def _text(values: Sequence[float] | Array) -> str:
    # What is smaller has lost digits, which Pinocchio's reader refuses.
    return " ".join(repr(float(value) if abs(value) > 1e-300 else 0.0) for value in values)
