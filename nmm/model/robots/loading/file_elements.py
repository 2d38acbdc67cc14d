"""What nmm does with each element and attribute of URDF and SRDF, and notes on what it leaves unread.

`URDF` and `SRDF` are the tables, by path from the root; docs/file_elements.md prints them."""

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from nmm.base.findings import Finding
from nmm.model.robots.loading.xml_tree import Element, children

#: How much alike a name is that was probably meant, of 1.
_ALIKE = 0.65

READ, NOTED, WITHOUT_EFFECT = "read", "noted", "without effect"


class How(NamedTuple):
    """What becomes of an attribute from version 1.`since` on, and why."""

    how: str
    why: str = ""
    since: int = 0


@dataclass(frozen=True)
class ElementRule:
    """What becomes of an element: `how`, why, and of its attributes. Of one that is read, what is not in the
    table is noted as unknown; of others nothing is looked at.

    once : whether only the first of its kind in one element counts
    when : which of the elements are noted; all by default
    has_finding : whether a finding of its own says more of it than its name"""

    how: str
    why: str = ""
    attributes: Mapping[str, How] = field(default_factory=dict)
    once: bool = False
    when: Callable[[Element], bool] | None = None
    has_finding: bool = False


Table = Mapping[str, ElementRule]


def _read(attributes: str = "", more: Mapping[str, How] | None = None, once: bool = False) -> ElementRule:
    return ElementRule(READ, "", {**dict.fromkeys(attributes.split(), How(READ)), **(more or {})}, once)


def _once(attributes: str = "", more: Mapping[str, How] | None = None) -> ElementRule:
    return _read(attributes, more, once=True)


def _idle(words: str) -> dict[str, How]:
    return dict.fromkeys(words.split(), How(WITHOUT_EFFECT))


def _has_bounds(element: Element) -> bool:
    """Whether a <ros2_control> limits what it commands."""
    params = element.iterfind("joint/command_interface/param")
    return any(param.get("name") in ("min", "max") for param in params)


_LINKS = "a link is where its joint puts it"
_MASSES = "masses are those of <inertial>"
_ORIGIN = _once("xyz rpy", {"quat_xyzw": How(READ, since=1)})
_COLOURS = {
    "color": _once("rgba"),
    "texture": ElementRule(WITHOUT_EFFECT, "pictures draw its colour"),
    **dict.fromkeys(("ambient", "diffuse", "specular", "emissive"), ElementRule(WITHOUT_EFFECT, "shading")),
}
_SHAPES = {
    "box": _read("size"),
    "cylinder": _read("radius length"),
    "sphere": _read("radius"),
    "capsule": _read("radius length"),
    "mesh": _read("filename scale"),
}
_CONTACT = ElementRule(WITHOUT_EFFECT, "contacts of simulators")
_MUJOCO = ElementRule(NOTED, "of <mujoco> in a URDF only the folder of the meshes is read")
_OF_MUJOCO = ("default", "asset", "equality", "tendon", "actuator", "sensor", "keyframe", "worldbody")


def _below(path: str, parts: Table) -> dict[str, ElementRule]:
    return {f"{path}/{tag}": part for tag, part in parts.items()}


URDF: Table = {
    "robot": _read("name version"),
    "robot/link": _read("name", _idle("type concave")),
    **_below(
        "robot/link",
        {
            "inertial": _once(),
            "inertial/origin": _ORIGIN,
            "inertial/mass": _once("value"),
            "inertial/inertia": _once("ixx ixy ixz iyy iyz izz", _idle("iyx izx izy")),
            "visual": _read("", _idle("name group cast_shadows")),
            "collision": _read("", _idle("name group concave")),
            "visual/material": _once("name"),
            "collision/material": ElementRule(WITHOUT_EFFECT, "collision shapes have no colour"),
            **dict.fromkeys(("collision/verbose", "collision/surface", "collision/contact"), _CONTACT),
            **dict.fromkeys(("contact", "surface", "max_contacts", "self_collide", "selfCollide"), _CONTACT),
            **dict.fromkeys(
                ("gravity", "kinematic", "audio_source"), ElementRule(WITHOUT_EFFECT, "of simulators")
            ),
            "origin": ElementRule(NOTED, _LINKS),
            "pose": ElementRule(NOTED, _LINKS),
            "self_collision_checking": ElementRule(NOTED, "collision shapes are those of <collision>"),
        },
    ),
    **_below("robot/link/visual/material", _COLOURS),
    **{f"robot/link/{tag}/origin": _ORIGIN for tag in ("visual", "collision")},
    **{f"robot/link/{tag}/geometry": _once("", _idle("name")) for tag in ("visual", "collision")},
    **_below("robot/link/visual/geometry", _SHAPES),
    **_below("robot/link/collision/geometry", _SHAPES),
    "robot/joint": _read("name type", _idle("dont_collapse")),
    **_below(
        "robot/joint",
        {
            "origin": _ORIGIN,
            "parent": _once("link"),
            "child": _once("link"),
            "axis": _once("xyz"),
            "limit": _once(
                "lower upper effort velocity",
                {
                    "acceleration": How(READ, "for nmm init; the smaller of the two", 2),
                    "deceleration": How(READ, "for nmm init; the smaller of the two", 2),
                    "jerk": How(NOTED, "jerk is not limited", 2),
                },
            ),
            "dynamics": _once("damping friction"),
            "mimic": _once("joint multiplier offset"),
            "calibration": ElementRule(WITHOUT_EFFECT, "for finding the joint's zero"),
            "safety_controller": ElementRule(
                NOTED, "soft limits, unless <limit> is as narrow", has_finding=True
            ),
        },
    ),
    "robot/material": _read("name"),
    **_below("robot/material", _COLOURS),
    "robot/nmm": ElementRule(READ, attributes={"platform": How(READ)}, has_finding=True),
    "robot/transmission": ElementRule(WITHOUT_EFFECT, "inputs are rates of joints, not of motors"),
    "robot/gazebo": ElementRule(WITHOUT_EFFECT, "for Gazebo"),
    "robot/ros2_control": ElementRule(NOTED, "limits are those of <limit>", when=_has_bounds),
    "robot/sensor": ElementRule(NOTED, "sensors make no frames; a link on a fixed joint is one"),
    "robot/frame": ElementRule(NOTED, "no frame is made; a link on a fixed joint is one"),
    "robot/loop_joint": ElementRule(NOTED, "the loop stays open"),
    "robot/collision_filter_group": ElementRule(NOTED, "links that may touch are those of an SRDF"),
    "robot/mujoco": _read(),
    "robot/mujoco/compiler": _read(
        "meshdir assetdir",
        {
            **_idle("angle autolimits eulerseq strippath discardvisual fusestatic fitaabb texturedir"),
            **_idle("coordinate usethread convexhull alignfree saveinertial exactmeshinertia"),
            **dict.fromkeys(("balanceinertia", "boundmass", "boundinertia"), How(NOTED, _MASSES)),
            **dict.fromkeys(("inertiafromgeom", "inertiagrouprange", "settotalmass"), How(NOTED, _MASSES)),
        },
    ),
    "robot/mujoco/contact": ElementRule(NOTED, "links that may touch are those of an SRDF"),
    **dict.fromkeys(
        (f"robot/mujoco/{tag}" for tag in ("option", "size", "visual", "statistic")),
        ElementRule(WITHOUT_EFFECT, "for MuJoCo"),
    ),
    **{f"robot/mujoco/{tag}": _MUJOCO for tag in _OF_MUJOCO},
}

SRDF: Table = {
    "robot": _read("name", _idle("version")),
    "robot/group": _read("name"),
    **_below("robot/group", dict.fromkeys(("joint", "link", "group"), _read("name"))),
    "robot/group/chain": _read("base_link tip_link"),
    "robot/group_state": _read("name", {"group": How(WITHOUT_EFFECT, "the joints are named")}),
    "robot/group_state/joint": _read("name value"),
    "robot/virtual_joint": _read("name type child_link", _idle("parent_frame")),
    "robot/passive_joint": _read("name"),
    "robot/disable_collisions": _read("link1 link2", _idle("reason")),
    "robot/enable_collisions": _read("link1 link2", _idle("reason")),
    "robot/disable_default_collisions": _read("link"),
    "robot/joint_property": ElementRule(NOTED, "where motion_model is not the platform's", has_finding=True),
    "robot/link_sphere_approximation": ElementRule(NOTED, "collision shapes are the robot's own"),
    "robot/end_effector": ElementRule(WITHOUT_EFFECT, "tasks name their frame"),
    "robot/rotor_params": ElementRule(NOTED, "motors' inertia is left out"),
    **dict.fromkeys(
        ("robot/gripper", "robot/specificities"), ElementRule(WITHOUT_EFFECT, "of other planners")
    ),
}


#: A finding without its count: its code and values, which tell one kind from another.
_Seen = tuple[str, tuple[tuple[str, str], ...]]


def unread(root: Element, table: Table, minor: int = 0) -> list[Finding]:
    """A note for each kind of what a file of version 1.`minor` holds and nmm does not read or does not know:
    its first line, and how many there are."""
    lines: dict[_Seen, list[int]] = defaultdict(list)
    for seen, line in _walk(root, root.tag, table, minor):
        lines[seen].append(line)
    return [
        Finding(code, {**dict(values), "count": len(at)}, {"line": at[0]})
        for (code, values), at in lines.items()
    ]


def _seen(code: str, **values: str) -> _Seen:
    return code, tuple(values.items())


def _walk(element: Element, path: str, table: Table, minor: int) -> Iterator[tuple[_Seen, int]]:
    part = table[path]
    for name in element.attrib:
        if not name.startswith(("xmlns", "xml:")):
            how = part.attributes.get(name)
            if (seen := _attribute(element.tag, name, how, part, minor)) is not None:
                yield seen, element.line
    met: set[str] = set()
    for below in children(element, "*"):
        path_below = f"{path}/{below.tag}"
        entry = table.get(path_below)
        about = {"element": below.tag, "inside": element.tag}
        if entry is None and below.tag.startswith("xacro:"):
            continue  # which is told otherwise
        if entry is None:
            near = _near(below.tag, _tags(path, table))
            yield _seen("element_unknown", **about, near=near), below.line
        elif below.tag in met or (met and element.tag == "geometry"):
            yield _seen("element_again", **about), below.line
        elif entry.how == NOTED and not entry.has_finding and (entry.when is None or entry.when(below)):
            yield _seen("element_unread", **about, why=entry.why), below.line
        elif entry.how == READ and not entry.has_finding:
            yield from _walk(below, path_below, table, minor)
        if entry is not None and (entry.once or element.tag == "geometry"):
            met.add(below.tag)


def _attribute(tag: str, name: str, how: How | None, part: ElementRule, minor: int) -> _Seen | None:
    about = {"element": tag, "attribute": name}
    if how is None:
        known = [key for key, other in part.attributes.items() if other.how == READ]
        return _seen("attribute_unknown", **about, near=_near(name, known))
    if how.since > minor:
        why = f"it counts from version 1.{how.since} on, and the file's is 1.{minor}"
        return _seen("attribute_unread", **about, why=why)
    return _seen("attribute_unread", **about, why=how.why) if how.how == NOTED else None


def _tags(path: str, table: Table) -> list[str]:
    """The elements that are read right below one."""
    below = (key.rpartition("/") for key, part in table.items() if part.how == READ)
    return [tag for above, _, tag in below if above == path]


def _near(name: str, known: list[str]) -> str:
    """The known name that was probably meant; "" without."""
    import difflib  # here: most files have no unknown names

    near = difflib.get_close_matches(name.rpartition(":")[2].lower(), known, n=1, cutoff=_ALIKE)
    return next(iter(near), "")
