"""Which joints to lock so that the followers (<mimic>) of a description stand still."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from nmm.loading.findings import Findings, child
from nmm.loading.xml_tree import Element


@dataclass(frozen=True)
class Leaders:
    """What there is to lock.

    Attributes
    ----------
    values : joints that others follow, and the value nearest to zero that their limits allow, rad or m
    followers : joints that follow one that moves, and the one at the end of the chain
    """

    values: Mapping[str, float] = field(default_factory=dict)
    followers: Mapping[str, str] = field(default_factory=dict)


def leaders_to_lock(joints: list[Element]) -> Leaders:
    """The leaders that move, of the <mimic> joints; a chain that leads nowhere, or back, has none."""
    named = {joint.get("name", ""): joint for joint in joints}
    leader_of = {
        name: mimic.get("joint", "")
        for name, joint in named.items()
        if joint.get("type") != "fixed" and (mimic := child(joint, "mimic")) is not None
    }
    followers: dict[str, str] = {}
    for name, leader in leader_of.items():
        met = {name}
        while leader in leader_of and leader not in met:
            met.add(leader)
            leader = leader_of[leader]
        if leader in named and leader not in met and named[leader].get("type") != "fixed":
            followers[name] = leader
    return Leaders({leader: _rest(named[leader]) for leader in followers.values()}, followers)


def _rest(joint: Element) -> float:
    """The value nearest to zero that the joint's limits allow."""
    limit = child(joint, "limit")
    if limit is None or joint.get("type") == "continuous":
        return 0.0
    lower, upper = (Findings().number(limit, key, "") or 0.0 for key in ("lower", "upper"))
    return min(max(0.0, lower), max(lower, upper)) + 0.0
