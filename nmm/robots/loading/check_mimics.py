"""Checks of joints that follow others (<mimic>)."""

from __future__ import annotations

from collections.abc import Container

from nmm.errors import unknown
from nmm.robots.followers import Follower
from nmm.robots.loading.findings import Findings, child
from nmm.robots.loading.xml_tree import Element


def check_mimics(
    joints: list[Element], findings: Findings, lock: Container[str] = ()
) -> tuple[Follower, ...]:
    """The joints that follow others, each after the one that it follows.

    Added to the findings: whatever is wrong with a <mimic>. A joint in `lock` follows nobody.
    """
    named = {joint.get("name", ""): joint for joint in joints}
    followers: dict[str, Follower] = {}
    for name, joint in named.items():
        element = child(joint, "mimic")
        if element is not None and joint.get("type") != "fixed" and name not in lock:
            follower = _follower(element, name, named, findings)
            if follower is not None:
                followers[name] = follower
    chains = {name: _chain(name, followers) for name in followers}
    for name, chain in chains.items():
        if chain[-1] in followers:
            findings.add(named[name], f"joint {name!r}: <mimic> follows itself: {' -> '.join(chain)}")
    return tuple(sorted(followers.values(), key=lambda follower: len(chains[follower.joint])))


def _follower(element: Element, name: str, named: dict[str, Element], findings: Findings) -> Follower | None:
    owner = f"joint {name!r}"
    leader = findings.text(element, "joint", owner)
    multiplier, offset = (findings.number(element, key, owner) for key in ("multiplier", "offset"))
    if leader is None:
        return None
    if leader not in named:
        findings.add(element, unknown("joint to follow", leader, named, owner))
        return None
    return Follower(name, leader, 1.0 if multiplier is None else multiplier, offset or 0.0)


def _chain(name: str, followers: dict[str, Follower]) -> list[str]:
    """The joint, the one that it follows, and so on; ends with one that follows nobody, or one met before."""
    chain = [name]
    while chain[-1] in followers:
        leader = followers[chain[-1]].leader
        chain.append(leader)
        if leader in chain[:-1]:
            break
    return chain
