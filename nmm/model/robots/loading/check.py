"""Checks a URDF before Pinocchio sees it: its tree of links and joints, their names, mimic joints.

Pinocchio answers most faults with the same sentence and accepts others (cycles beside the tree, a link with
two parents, zero axes) silently."""

import re
from collections import defaultdict
from collections.abc import Collection, Container, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from nmm.base.findings import Finding
from nmm.model.platforms import PLATFORMS
from nmm.model.robots.loading.budget import MOST_IN_A_ROW, MOST_LINKS, MOST_MOVING
from nmm.model.robots.loading.check_limits import (
    ACCELERATIONS,
    accelerations,
    limits_of_continuous,
    soft_limits,
)
from nmm.model.robots.loading.check_parts import FindMesh, check_joint, check_link, check_material
from nmm.model.robots.loading.file_elements import URDF, unread
from nmm.model.robots.loading.mending import write_rpy
from nmm.model.robots.loading.xml_tree import (
    QUATERNIONS,
    Attributes,
    Element,
    Owner,
    XmlError,
    body_of,
    child,
    children,
    link_at,
    parse,
)
from nmm.model.robots.mimic_joints import MimicJoint

# As the C++ reader takes it.
_VERSION = re.compile(r"\s*0*1\.0*([012])")
#: The parts of a link that have a place.
_PLACED = ("inertial", "visual", "collision")
#: Names of frames that the model gets anyway.
RESERVED = ("x", "y", "theta", "universe")


@dataclass(frozen=True)
class CheckedUrdf:
    """A description without problems: its <robot> element and what is said there. `meshes` are files by the
    name in the description; each mimic joint comes after its leader. `spared` are faults that kinematics does
    not feel, `unread` what of it does not count; `accelerations` are joints' limits, m/s^2, rad/s^2."""

    root: Element
    name: str
    meshes: dict[str, Path]
    mimic_joints: tuple[MimicJoint, ...]
    platform: str | None
    spared: tuple[Finding, ...]
    unread: tuple[Finding, ...]
    accelerations: Mapping[str, float]


def inspect(
    text: str | Element, find_mesh: FindMesh | None = None, lock: Container[str] = ()
) -> tuple[CheckedUrdf | None, list[Finding]]:
    """A URDF's description (None where the text is none) and its faults, of its text or its <robot>. Without
    `find_mesh`, mesh files are taken to exist; joints in `lock` will not move, and so follow none."""
    try:
        root = parse(text) if isinstance(text, str) else text
    except XmlError as error:
        return None, [error.finding]
    reader = Attributes()
    if root.tag != "robot":
        reader.add(root, "not_robot", got=root.tag)
        return None, reader.found
    for what, count, most in _counts(root):
        if count > most:
            reader.add(None, "beyond_bound", what=what, most=most)
            return None, reader.found
    return _check_robot(root, reader, find_mesh or Path, lock), reader.found


def _counts(root: Element) -> list[tuple[str, int, int]]:
    """What has a bound: its name, how many there are, and the bound."""
    joints = children(root, "joint")
    above = {link_at(joint, "child"): link_at(joint, "parent") for joint in joints}
    rows: dict[str, int] = {}
    for link in above:
        row = []
        while link in above and link not in rows:
            rows[link] = 0  # until it is known; in a cycle it stays
            row.append(link)
            link = above[link]
        for k, name in enumerate(reversed(row), rows.get(link, 0) + 1):
            rows[name] = k
    moving = sum(joint.get("type") != "fixed" for joint in joints)
    return [
        ("links", max(len(children(root, "link")), len(joints)), MOST_LINKS),
        ("joints that move", moving, MOST_MOVING),
        ("links in a row", max(rows.values(), default=0), MOST_IN_A_ROW),
    ]


def _check_robot(root: Element, reader: Attributes, find_mesh: FindMesh, lock: Container[str]) -> CheckedUrdf:
    minor = _minor(root, reader)
    reader.minor, spared = minor, Attributes(minor=minor)
    not_read = unread(root, URDF, minor)
    for element in root.iter():
        if element.tag.startswith("xacro:") and isinstance(element, Element):
            spared.add(element, "xacro_left_over", element=element.tag)
    if not root.get("name"):
        reader.add(root, "attribute_missing", element="robot", attribute="name")
    links, joints = children(root, "link"), children(root, "joint")
    _check_names(links, "link", reader)
    _check_names(joints, "joint", reader)
    _check_tree(links, joints, reader)
    materials: set[str] = set()
    for material in children(root, "material"):
        check_material(material, {"part": "robot"}, spared)
        name = material.get("name", "")
        if name in materials:
            reader.add(material, "name_twice", kind="material", name=name)
        materials.add(name)
    meshes: dict[str, Path] = {}
    for link in links:
        check_link(link, reader, spared, find_mesh, meshes)
    first = _movable_on_root(joints)
    for joint in joints:
        check_joint(joint, reader, spared, carries_all=first == [joint])
    mimic_joints = check_mimics(joints, reader, spared, lock)
    platform, name = _declared_platform(root, reader), root.get("name") or ""
    if minor >= QUATERNIONS:
        write_rpy(joints)
        write_rpy(part for link in links for tag in _PLACED for part in children(link, tag))
    not_read += soft_limits(joints) + limits_of_continuous(joints)
    limits = accelerations(joints) if minor >= ACCELERATIONS else {}
    return CheckedUrdf(
        root, name, meshes, mimic_joints, platform, tuple(spared.found), tuple(not_read), limits
    )


def _minor(root: Element, reader: Attributes) -> int:
    """What is behind the point of the file's version."""
    version = root.get("version", "1.0")
    match = _VERSION.fullmatch(version)
    if match is None:
        reader.add(root, "version_unknown", got=version)
    return 0 if match is None else int(match[1])


def _declared_platform(root: Element, reader: Attributes) -> str | None:
    """The platform of `<nmm platform="car"/>` below <robot>: other tools do not look at it."""
    platform: str | None = None
    owner = {"part": "<nmm>"}
    for element in children(root, "nmm"):
        for attribute in sorted({*element.keys()}):
            reader.choice(element, attribute, ("platform",), "attribute", owner)
        name = reader.text(element, "platform", {"part": "robot"})
        if name is not None and platform is not None:
            reader.add(element, "platform_twice", {"part": "robot"})
        elif name is not None and reader.choice(element, name, tuple(PLATFORMS), "platform", owner):
            platform = name
    return platform


def _check_names(elements: list[Element], kind: str, reader: Attributes) -> None:
    seen: set[str] = set()
    for element in elements:
        name = element.get("name")
        if not name:
            reader.add(element, "name_missing", kind=kind)
        elif name in seen:
            reader.add(element, "name_twice", kind=kind, name=name)
        else:
            seen.add(name)


def _check_tree(links: list[Element], joints: list[Element], reader: Attributes) -> None:
    names = dict.fromkeys(name for link in links if (name := link.get("name")))
    if not names:
        reader.add(None, "no_links")
        return
    parents: dict[str, list[str]] = defaultdict(list)
    for joint in joints:
        ends = {tag: _end(joint, tag, names, reader) for tag in ("parent", "child")}
        if ends["parent"] and ends["child"]:
            parents[ends["child"]].append(ends["parent"])
            if len(parents[ends["child"]]) == 2:
                reader.add(joint, "two_parents", name=ends["child"], parents=[*parents[ends["child"]]])
        elif ends["child"]:
            # Its parent is wrong, which has been found: it is not a second root as well.
            parents[ends["child"]].append("")
    _check_cycles(names, parents, reader)
    roots = [name for name in names if not parents[name]]
    if len(roots) > 1:
        reader.add(None, "several_roots", roots=roots)


def _movable_on_root(joints: list[Element]) -> list[Element]:
    """The movable joints on the root link and on links fixed to it."""
    above = {link_at(joint, "child"): joint for joint in joints}
    movable = [joint for joint in joints if joint.get("type") != "fixed"]
    return [joint for joint in movable if body_of(link_at(joint, "parent"), above) not in above]


def _end(joint: Element, tag: str, names: Collection[str], reader: Attributes) -> str | None:
    """The parent or child link of a joint, or None with a finding."""
    owner = {"joint": joint.get("name")}
    element = child(joint, tag)
    if element is None:
        reader.add(joint, "element_missing", owner, element="joint", missing=tag)
        return None
    link = reader.text(element, "link", owner)
    known = link is not None and reader.choice(element, link, names, f"{tag} link", owner)
    return link if known else None


def _check_cycles(names: Iterable[str], parents: dict[str, list[str]], reader: Attributes) -> None:
    done: set[str] = set()
    for name in names:
        path: list[str] = []
        link = name
        while link and link not in done and link not in path:
            path.append(link)
            link = next(iter(parents[link]), "")
        if link in path:
            cycle = path[path.index(link) :]
            reader.add(None, "cycle", links=[*reversed([*cycle, link])])
        done.update(path)


def check_mimics(
    joints: list[Element], reader: Attributes, spared: Attributes, lock: Container[str] = ()
) -> tuple[MimicJoint, ...]:
    """The mimic joints, each after its leader; a joint in `lock`, or after what is no joint, follows none."""
    named = {joint.get("name", ""): joint for joint in joints}
    mimic_joints: dict[str, MimicJoint] = {}
    for name, joint in named.items():
        element = child(joint, "mimic")
        moves = joint.get("type") != "fixed" and name not in lock
        mimic = _mimic_joint(element, name, reader) if element is not None and moves else None
        if mimic is not None and mimic.leader in named:
            mimic_joints[name] = mimic
        elif mimic is not None:
            spared.add(element, "leader_unknown", {"joint": name}, leader=mimic.leader)
    chains = {name: _chain(name, mimic_joints) for name in mimic_joints}
    for name, chain in chains.items():
        if chain[-1] in mimic_joints:
            reader.add(named[name], "mimic_cycle", {"joint": name}, joints=chain)
    return tuple(sorted(mimic_joints.values(), key=lambda mimic: len(chains[mimic.joint])))


def _mimic_joint(element: Element, name: str, reader: Attributes) -> MimicJoint | None:
    owner: Owner = {"joint": name}
    leader = reader.text(element, "joint", owner)
    multiplier, offset = (reader.number(element, key, owner) for key in ("multiplier", "offset"))
    if leader is None:
        return None
    return MimicJoint(name, leader, 1.0 if multiplier is None else multiplier, offset or 0.0)


def _chain(name: str, mimic_joints: dict[str, MimicJoint]) -> list[str]:
    """The joint, its leader, and so on; ends with one that follows none, or one met before."""
    chain = [name]
    while chain[-1] in mimic_joints:
        leader = mimic_joints[chain[-1]].leader
        chain.append(leader)
        if leader in chain[:-1]:
            break
    return chain
