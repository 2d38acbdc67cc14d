"""Joints that follow others: honoured where the joint that they follow does not move, refused elsewhere.

A follower that moves would be no coordinate, and Pinocchio's derivatives raise for models with such joints.
"""

from __future__ import annotations

from collections.abc import Container, Mapping
from dataclasses import dataclass

from nmm.errors import unknown
from nmm.robots.loading.findings import Findings, child
from nmm.robots.loading.xml_tree import Element


@dataclass(frozen=True)
class Mimic:
    """A joint that follows another, at `multiplier` times the leader's value plus `offset` (rad or m)."""

    joint: str
    leader: str
    multiplier: float
    offset: float


@dataclass(frozen=True)
class ToLock:
    """Followers of joints that move.

    Attributes
    ----------
    followers : the joint that moves each, at the end of whatever follows what
    values : those joints, and the value nearest to zero at which each can be locked, rad or m
    """

    followers: Mapping[str, str]
    values: Mapping[str, float]


def leaders_to_lock(joints: list[Element]) -> ToLock:
    """What there is to lock, so that no joint follows one that moves."""
    return _sorted_out(joints, Findings(), ())[1]


def check_mimics(joints: list[Element], findings: Findings, lock: Container[str] = ()) -> tuple[Mimic, ...]:
    """The followers that stand still with their leaders, each after the one that it follows.

    Added to the findings: followers of joints that move, and whatever is wrong with a <mimic>. A joint in
    `lock` follows nobody.
    """
    still, moving = _sorted_out(joints, findings, lock)
    if moving.followers:
        # One entry for all of them, with all that there is to lock.
        values = ", ".join(f"{leader!r}: {value}" for leader, value in moving.values.items())
        names = ", ".join(f"{name!r} (follows {leader!r})" for name, leader in moving.followers.items())
        first = next(iter(moving.followers))
        findings.add(
            next(joint for joint in joints if joint.get("name") == first),
            "mimic joints are refused unless the joint that they follow is locked, "
            f"lock={{{values}}}: {names}",
        )
    return still


def _sorted_out(
    joints: list[Element], findings: Findings, lock: Container[str]
) -> tuple[tuple[Mimic, ...], ToLock]:
    """The followers that stand still, leaders first, and those that move."""
    named = {joint.get("name", ""): joint for joint in joints}
    mimics: dict[str, Mimic] = {}
    for name, joint in named.items():
        element = child(joint, "mimic")
        if element is not None and joint.get("type") != "fixed" and name not in lock:
            mimic = _mimic(element, name, named, findings)
            if mimic is not None:
                mimics[name] = mimic
    moving: dict[str, str] = {}
    still: list[tuple[int, Mimic]] = []
    for name, mimic in mimics.items():
        chain = _chain(name, mimics)
        if chain[-1] in mimics:
            findings.add(named[name], f"joint {name!r}: <mimic> follows itself: {' -> '.join(chain)}")
        elif chain[-1] in lock or named[chain[-1]].get("type") == "fixed":
            still.append((len(chain), mimic))
        else:
            moving[name] = chain[-1]
    still.sort(key=lambda item: item[0])
    leaders = {leader: _rest(named[leader]) for leader in moving.values()}
    return tuple(mimic for _, mimic in still), ToLock(moving, leaders)


def _mimic(element: Element, name: str, named: dict[str, Element], findings: Findings) -> Mimic | None:
    owner = f"joint {name!r}"
    leader = findings.text(element, "joint", owner)
    multiplier, offset = (findings.number(element, key, owner) for key in ("multiplier", "offset"))
    if leader is None:
        return None
    if leader not in named:
        findings.add(element, unknown("joint to follow", leader, named, owner))
        return None
    return Mimic(name, leader, 1.0 if multiplier is None else multiplier, offset or 0.0)


def _chain(name: str, mimics: dict[str, Mimic]) -> list[str]:
    """The joint, the one that it follows, and so on; ends with one that follows nobody, or one met before."""
    chain = [name]
    while chain[-1] in mimics:
        leader = mimics[chain[-1]].leader
        chain.append(leader)
        if leader in chain[:-1]:
            break
    return chain


def _rest(joint: Element) -> float:
    """The value nearest to zero that the joint's limits allow, to suggest where it can be locked."""
    limit = child(joint, "limit")
    if limit is None or joint.get("type") == "continuous":
        return 0.0
    quiet = Findings()
    lower, upper = (quiet.number(limit, key, "") or 0.0 for key in ("lower", "upper"))
    return min(max(0.0, lower), max(lower, upper)) + 0.0
