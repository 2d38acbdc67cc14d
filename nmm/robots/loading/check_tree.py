"""What is wrong with the tree of links and joints: names, parents, roots, cycles."""

from __future__ import annotations

from collections import defaultdict

from nmm.errors import unknown
from nmm.robots.loading.findings import Findings, child
from nmm.robots.loading.xml_tree import Element

# Names of frames that the model gets anyway.
RESERVED = {
    "x": "a coordinate",
    "y": "a coordinate",
    "theta": "a coordinate",
    "universe": "Pinocchio's world",
}


def check_names(elements: list[Element], kind: str, findings: Findings) -> None:
    """Add missing, reserved and repeated names of the links or joints."""
    seen: set[str] = set()
    for element in elements:
        name = element.get("name")
        if not name:
            findings.add(element, f"a {kind} without a name")
        elif name in RESERVED:
            findings.add(element, f"{kind} {name!r}: the name is taken by {RESERVED[name]}")
        elif name in seen:
            findings.add(element, f"two {kind}s named {name!r}")
        else:
            seen.add(name)


def check_tree(links: list[Element], joints: list[Element], findings: Findings) -> None:
    """Add what keeps the links and joints from being one tree."""
    names = list(dict.fromkeys(name for link in links if (name := link.get("name"))))
    if not names:
        findings.add(None, "no links")
        return
    parents: dict[str, list[str]] = defaultdict(list)
    for joint in joints:
        ends = {tag: _end(joint, tag, names, findings) for tag in ("parent", "child")}
        if ends["parent"] and ends["child"]:
            parents[ends["child"]].append(ends["parent"])
            if len(parents[ends["child"]]) == 2:
                findings.add(
                    joint,
                    f"link {ends['child']!r} has two parents: {', '.join(map(repr, parents[ends['child']]))}",
                )
        elif ends["child"]:
            # Its parent is wrong, which was said: it is not a second root as well.
            parents[ends["child"]].append("")
    _check_cycles(names, parents, findings)
    roots = [name for name in names if not parents[name]]
    if len(roots) > 1:
        found = {2: "two", 3: "three"}.get(len(roots), str(len(roots)))
        findings.add(None, f"expected one root link, found {found}: {', '.join(roots)}")


def movable_on_root(joints: list[Element]) -> list[Element]:
    """The movable joints on the root link's body: on the root link, and on what is fixed to it."""
    ends = {tag: [_link(joint, tag) for joint in joints] for tag in ("parent", "child")}
    body = {name for name in ends["parent"] if name not in ends["child"]}
    fixed = [joint.get("type") == "fixed" for joint in joints]
    for _ in joints:
        pairs = zip(ends["parent"], ends["child"], fixed, strict=True)
        grown = body | {child for parent, child, still in pairs if still and parent in body}
        if grown == body:
            break
        body = grown
    return [
        joint
        for joint, parent, still in zip(joints, ends["parent"], fixed, strict=True)
        if not still and parent in body
    ]


def _link(joint: Element, tag: str) -> str:
    element = child(joint, tag)
    return "" if element is None else element.get("link", "")


def _end(joint: Element, tag: str, names: list[str], findings: Findings) -> str | None:
    """The parent or child link of a joint, or None with a problem."""
    owner = f"joint {joint.get('name')!r}"
    element = child(joint, tag)
    if element is None:
        findings.add(joint, f"{owner}: no <{tag}>")
        return None
    link = findings.text(element, "link", owner)
    if link is not None and link not in names:
        findings.add(element, unknown(f"{tag} link", link, names, owner))
        return None
    return link


def _check_cycles(names: list[str], parents: dict[str, list[str]], findings: Findings) -> None:
    done: set[str] = set()
    for name in names:
        path: list[str] = []
        link = name
        while link and link not in done and link not in path:
            path.append(link)
            link = next(iter(parents[link]), "")
        if link in path:
            cycle = path[path.index(link) :]
            findings.add(None, f"the links form a cycle: {' -> '.join(reversed([*cycle, link]))}")
        done.update(path)
