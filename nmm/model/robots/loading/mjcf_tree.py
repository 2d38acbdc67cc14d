"""The bodies of an MJCF file in MuJoCo's terms: no classes, no frames, radians, places in the body around."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import TypeVar

import numpy as np
import pinocchio as pin

from nmm.base.arrays import Array
from nmm.model.robots.loading.xml_tree import Element

#: A new name by "body", "joint", "site" or "geom", and the name.
Rename = Callable[[str, str], str]
_Kind = TypeVar("_Kind")


@dataclass(frozen=True)
class Joint:
    """kind : hinge, slide or free
    point, axis : (3,), in the body; the axis is of unit length
    ref : its value where the file draws it; limits : its ends, if it has some; rad or m
    effort : the largest force or torque that actuators may put on it, N or Nm
    armature : inertia of its rotor, kg m² or kg"""

    element: Element
    name: str
    kind: str
    point: Array
    axis: Array
    ref: float = 0.0
    limits: tuple[float, float] | None = None
    effort: float | None = None
    armature: float = 0.0


@dataclass(frozen=True)
class Mesh:
    """A mesh asset: `file` as the robot's file speaks of it, "" for numbers in the asset itself; `inertia`
    how its mass is reckoned."""

    element: Element
    name: str
    file: str
    scale: Array
    reference: pin.SE3
    inertia: str


@dataclass(frozen=True)
class Geom:
    """size : (3,), MuJoCo's half lengths; mass : None where density (kg/m³) tells it; shell : its mass is in
    its surface; mesh : of a mesh, or what a plain shape is fitted to"""

    element: Element
    name: str
    kind: str
    place: pin.SE3
    size: Array
    mesh: Mesh | None
    mass: float | None
    density: float
    shell: bool
    group: int
    collides: bool
    rgba: str | None


@dataclass(frozen=True)
class Site:
    element: Element
    name: str
    place: pin.SE3


@dataclass(frozen=True)
class Inertial:
    """moments : (3, 3), kg m², about the centre of mass in the axes of `place`"""

    element: Element
    place: pin.SE3
    mass: float
    moments: Array


@dataclass(frozen=True)
class MjcfBody:
    element: Element
    name: str
    place: pin.SE3
    parts: "list[Part]" = field(default_factory=list)

    def of(self, kind: type[_Kind]) -> list[_Kind]:
        """The parts of one kind, in the file's order."""
        return [part for part in self.parts if isinstance(part, kind)]

    def all(self) -> "Iterator[MjcfBody]":
        """The body and all below it, depth first as MuJoCo counts them."""
        yield self
        for below in self.of(MjcfBody):
            yield from below.all()

    @property
    def joints(self) -> list[Joint]:
        return self.of(Joint)


Part = MjcfBody | Joint | Geom | Site | Inertial


def moved(part: Part, by: pin.SE3) -> Part:
    """A part in the axes that `by` stands in."""
    if isinstance(part, Joint):
        return replace(part, point=by.act(part.point), axis=np.asarray(by.rotation @ part.axis))
    return replace(part, place=by * part.place)


def renamed(part: Part, rename: Rename) -> Part:
    """A part, and all in it, under other names; what has none gets none."""
    if isinstance(part, Inertial):
        return part
    name = part.name and rename(type(part).__name__.lower(), part.name)
    if isinstance(part, MjcfBody):
        return replace(part, name=name, parts=[renamed(child, rename) for child in part.parts])
    return replace(part, name=name)


def names_in(parts: list[Part]) -> set[tuple[str, str]]:
    """Kind and name of all parts that have a name, and of all in them."""
    names: set[tuple[str, str]] = set()
    for part in parts:
        if not isinstance(part, Inertial) and part.name:
            names.add((type(part).__name__.lower(), part.name))
        if isinstance(part, MjcfBody):
            names |= names_in(part.parts)
    return names
