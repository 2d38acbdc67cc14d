"""Every element and attribute of MJCF, and what becomes of it: read, noted, or without effect here.

*Noted* is what MuJoCo moves, weighs or holds otherwise than this robot will: loading says so, with its line,
or refuses the file by name. *Without effect* is what says nothing of motion, shape, mass or limits."""

from collections.abc import Iterable, Iterator, Mapping
from typing import Literal, NamedTuple, cast

from nmm.base.findings import Finding
from nmm.model.robots.loading.xml_tree import Element

How = Literal["read", "noted", "without effect"]


class MjcfElementRule(NamedTuple):
    """How an element is taken, and why. All attributes of one that is not read go with it; of one that is,
    each is in `attributes`, or means the same in all elements (`EVERYWHERE`)."""

    how: How
    why: str
    attributes: Mapping[str, How] = {}


def _table(read: str = "", noted: str = "", unused: str = "") -> dict[str, How]:
    return {
        **dict.fromkeys(read.split(), "read"),
        **dict.fromkeys(noted.split(), "noted"),
        **dict.fromkeys(unused.split(), "without effect"),
    }


def _read(why: str, read: str = "", noted: str = "", unused: str = "") -> MjcfElementRule:
    return MjcfElementRule("read", why, _table(read, noted, unused))


_PICTURES = MjcfElementRule("without effect", "pictures of a simulation")
_SOLVER = MjcfElementRule("without effect", "how a simulation solves and steps")
_OWN = MjcfElementRule("without effect", "data of the file's own")
_ABOVE = MjcfElementRule("without effect", "goes with the element around it")
_SOFT = MjcfElementRule("noted", "soft bodies are no links")
_HOLDS = MjcfElementRule("noted", "only a joint that follows another is held to anything beside the tree")
_TENDON = MjcfElementRule("noted", "tendons couple no joints")
_PLUGIN = MjcfElementRule("noted", "what a plugin does is not known")
_OTHER_ACTUATOR = MjcfElementRule(
    "noted", "limits are those of motors, position and velocity actuators on one joint"
)
_ON_JOINT = (
    "joint gear ctrlrange ctrllimited forcerange forcelimited",
    "tendon site body jointinparent slidersite",
    "group kp kv dampratio timeconst inheritrange lengthrange cranksite cranklength refsite armature",
)

#: Attributes that mean the same in every element: those with a name, a class and a place, and what is of
#: springs, friction and contact alone, which kinematics does not feel.
EVERYWHERE: Mapping[str, How] = _table(
    read="name class childclass pos quat axisangle euler xyaxes zaxis",
    unused="user margin gap solref solimp solreflimit solimplimit solreffriction solimpfriction solmix "
    "friction condim priority damping frictionloss stiffness springdamper springref springyield delay interp "
    "nsample",
)

#: By the path below <mujoco>. `body` also stands for <worldbody>, <frame> and <replicate>, whose contents are
#: a body's, and `*` for all elements that are not named before it.
ELEMENTS: Mapping[str, MjcfElementRule] = {
    "": _read("the robot's name", "model"),
    "include": _read("a file beside the main one, else beside the one that includes it", "file"),
    "compiler": _read(
        "units, folders, masses",
        "angle eulerseq autolimits coordinate meshdir assetdir strippath inertiafromgeom inertiagrouprange "
        "boundmass boundinertia balanceinertia settotalmass",
        "conflict fitaabb",
        "alignfree discardvisual fusestatic savecanonical savecompiled saveinertial passthrough texturedir "
        "usethread",
    ),
    "compiler/*": _SOLVER,
    "option": _read(
        "how a simulation solves and steps, but for gravity, which is 9.81 m/s² down here",
        "",
        "gravity",
        "actuatorgroupdisable ccd_iterations ccd_tolerance cone density impratio integrator iterations "
        "jacobian ls_iterations ls_tolerance magnetic noslip_iterations noslip_tolerance o_friction o_margin "
        "o_solimp o_solref sdf_initpoints sdf_iterations sleep_tolerance solver timestep tolerance viscosity "
        "wind",
    ),
    "option/*": _SOLVER,
    "size": _SOLVER,
    "statistic": _PICTURES,
    "visual": _PICTURES,
    "visual/*": _PICTURES,
    "default": _read("a class: what its elements have is taken as in the elements themselves"),
    "extension": _ABOVE,
    "extension/*": _PLUGIN,
    "custom": _OWN,
    "custom/*": _OWN,
    "asset": _read("meshes, colours, models"),
    "asset/mesh": _read(
        "a file, or corners, for shapes and masses",
        "file scale refpos refquat inertia vertex face",
        "builtin",
        "params normal texcoord smoothnormal maxhullvert content_type material",
    ),
    "asset/mesh/*": _PLUGIN,
    "asset/material": _read(
        "the colour",
        "rgba",
        "",
        "emission metallic reflectance roughness shininess specular texrepeat texture texuniform",
    ),
    "asset/model": _read("what <attach> speaks of", "file", "", "content_type"),
    "asset/*": _PICTURES,
    "body": _read("a link", "", "mocap gravcomp", "sleep simple fuse"),
    "body/frame": _read("what is in it, where it puts that", "", "scale scaling massscale"),
    "body/replicate": _read("what is in it, as often as it says", "count offset sep"),
    "body/attach": _read("another model's bodies and what speaks of them", "model body frame prefix"),
    "body/inertial": _read("the link's mass", "mass diaginertia fullinertia"),
    "body/joint": _read(
        "a joint; below the root a free joint is refused, and a ball joint everywhere",
        "type axis ref range limited armature actuatorfrcrange actuatorfrclimited",
        "",
        "actuatorgravcomp group",
    ),
    "body/freejoint": _read("x, y and theta on the ground below the body", "", "", "align group"),
    "body/geom": _read(
        "a shape, and its mass",
        "type size fromto mesh fitscale mass density shellinertia group contype conaffinity rgba material",
        "",
        "adhesion castshadow fluidcoef fluidshape hfield surfacevel",
    ),
    "body/geom/*": _PLUGIN,
    "body/site": _read("a frame, where it has a name", "fromto", "", "group material mesh rgba size type"),
    "body/camera": _PICTURES,
    "body/light": _PICTURES,
    "body/plugin": _PLUGIN,
    "body/flexcomp": _SOFT,
    "body/composite": MjcfElementRule("noted", "refused, as by MuJoCo 4"),
    "deformable": _ABOVE,
    "deformable/flex": _SOFT,
    "deformable/skin": _PICTURES,
    "contact": _read("which links may touch"),
    "contact/exclude": _read("two links that may touch", "body1 body2"),
    "contact/pair": MjcfElementRule("noted", "which shapes collide is taken from the shapes alone"),
    "tendon": _ABOVE,
    "tendon/*": _TENDON,
    "equality": _read("joints that follow others", "active"),
    "equality/joint": _read(
        "a joint that follows another in a straight line", "joint1 joint2 polycoef active"
    ),
    "equality/*": _HOLDS,
    "actuator": _read("limits of joints"),
    "actuator/velocity": _read("the joint's velocity and effort", *_ON_JOINT),
    "actuator/motor": _read("the joint's effort", *_ON_JOINT),
    "actuator/position": _read("the joint's effort; controls that reach less than the joint", *_ON_JOINT),
    "actuator/*": _OTHER_ACTUATOR,
    "sensor": _SOLVER,
    "sensor/*": _SOLVER,
    "keyframe": _read("postures"),
    "keyframe/key": _read("a posture", "qpos", "mpos mquat", "qvel act ctrl time plastic"),
}
#: Values with which a noted attribute says nothing.
_USUAL = {
    "gravity": "0 0 -9.81",
    "gravcomp": "0",
    **dict.fromkeys(("mocap", "fitaabb"), "false"),
}
_BODIES = ("worldbody", "body", "frame", "replicate")
#: Attributes of elements that are read: why one is noted.
_ATTRIBUTE = "is not taken"


def row_of(path: str) -> tuple[str, MjcfElementRule] | None:
    """The row of an element by its path, and the path under which it is in the table."""
    if path in ELEMENTS:
        return path, ELEMENTS[path]
    parts = path.split("/")
    for count in range(len(parts) - 1, 0, -1):
        above = "/".join(parts[:count])
        if f"{above}/*" in ELEMENTS:
            return f"{above}/*", ELEMENTS[f"{above}/*"]
        if above in ELEMENTS and ELEMENTS[above].how != "read":
            return above, _ABOVE
    return None


def how_of(row: MjcfElementRule, attribute: str) -> How | None:
    """What becomes of an attribute of an element; None for one that the table does not know."""
    if row.how != "read":
        return "without effect"  # it goes with its element
    return row.attributes.get(attribute, EVERYWHERE.get(attribute))


def unused(root: Element) -> Iterator[Finding]:
    """Notes on what of a <mujoco> is not taken: one for each reason, with the line of the first."""
    by_reason: dict[str, dict[str, Element]] = {}
    for why, name, element in _walk(root, ""):
        by_reason.setdefault(why, {}).setdefault(name, element)
    for why, first in by_reason.items():
        lines = {name: line_in(element) for name, element in first.items()}
        where = next(iter(first.values())).place
        yield Finding("mjcf_noted", {"why": why, "names": [*first], "lines": lines}, where)


def line_in(element: Element) -> int | str:
    """The line in the file itself, or FILE:LINE of one that it includes."""
    return f"{element.file}:{element.line}" if element.file else element.line


def _walk(element: Element, path: str) -> Iterator[tuple[str, str, Element]]:
    """Why, what and where, of an element and all in it."""
    entry = row_of(path)
    of_class = path.startswith("default/")
    if entry is None and of_class:
        entry = _of_class(element.tag)
    tag = f"<{element.tag}>"
    if entry is None:
        yield "not known to this version", tag, element
        return
    row = entry[1]
    if row.how == "noted":
        if not of_class:
            yield row.why, tag, element
        return
    for attribute, value in element.attrib.items():
        how = how_of(row, attribute)
        if how is None:
            yield "not known to this version", f"{tag} {attribute}", element
        elif how == "noted" and value.split() != _USUAL.get(attribute, "").split():
            yield _ATTRIBUTE, f"{tag} {attribute}", element
    for part in cast(Iterable[Element], element):  # as the tree's reader makes them
        yield from _walk(part, _below(path, element.tag, part.tag))


def _of_class(tag: str) -> tuple[str, MjcfElementRule]:
    """The row of an element of a class: that of the elements to which it gives attributes."""
    paths = (*(f"{base}/{tag}" for base in ("body", "asset", "contact", "actuator")), tag)
    path = next((path for path in paths if path in ELEMENTS), "asset/*" if tag == "texture" else "actuator/*")
    return path, ELEMENTS[path]


def _below(path: str, tag: str, part: str) -> str:
    """The path of an element in another."""
    if tag == "mujoco":
        return "body" if part == "worldbody" else part
    if tag in _BODIES and part == "body":
        return "body"
    if tag in ("frame", "replicate"):
        return f"body/{part}"
    if tag == "default":
        return "default" if part == "default" else f"default/{part}"
    return f"{path}/{part}"
