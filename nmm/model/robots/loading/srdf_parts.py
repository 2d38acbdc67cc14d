"""What an SRDF holds, in its own names."""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from nmm.base.findings import Finding


class Group(NamedTuple):
    """A named part of a robot: joints, links (for the joint above each), chains (base, tip), other groups."""

    joints: tuple[str, ...]
    links: tuple[str, ...]
    groups: tuple[str, ...]
    chains: tuple[tuple[str, str], ...]


class VirtualJoint(NamedTuple):
    """A joint that an SRDF adds between the world and a link; `motion` is how it moves there, or ""."""

    name: str
    kind: str
    child: str
    motion: str


class Srdf(NamedTuple):
    """A file in its own names.

    states : each state's joint values; states of one name are merged
    disabled, enabled : pairs of links
    roots : joints that it adds between the world and the robot
    untouched : links that may touch all others but for enabled pairs
    passive : joints without a motor
    notes : what of it does not count"""

    path: Path
    states: Mapping[str, Mapping[str, tuple[float, ...]]]
    groups: Mapping[str, Group]
    disabled: tuple[tuple[str, str], ...]
    roots: tuple[VirtualJoint, ...]
    enabled: tuple[tuple[str, str], ...] = ()
    untouched: tuple[str, ...] = ()
    passive: tuple[str, ...] = ()
    notes: tuple[Finding, ...] = ()
