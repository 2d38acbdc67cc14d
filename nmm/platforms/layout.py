"""What a robot's file says about its wheels and vertical joints: enough to measure a platform from."""

from __future__ import annotations

import math
from dataclasses import dataclass

#: Two lengths (m) or angles (rad) of a robot's file that differ by less are meant to be the same.
NEAR = 1e-3
#: Parts of an upright joint's name, in lower case, that say what it is.
STEERING = ("steer",)
HITCHES = ("hitch", "trailer")
SWIVELS = ("caster", "swivel")


@dataclass(frozen=True)
class Pivot:
    """A joint that turns about an upright axis: a steering column, a hitch, a caster's swivel.

    Attributes
    ----------
    joint : its name
    carrier : name of the movable joint that carries it; "theta" for the root link's body
    x, y : its axis in the carrier's frame, at zero, m
    lower, upper : its limits, rad (infinite without)
    velocity : its largest rate, rad/s (infinite without)
    """

    joint: str
    carrier: str
    x: float
    y: float
    lower: float
    upper: float
    velocity: float = math.inf

    @property
    def steers(self) -> bool:
        """Whether its name says that it steers."""
        return any(word in self.joint.lower() for word in STEERING)

    @property
    def hitches(self) -> bool:
        """Whether its name says that it carries a trailer."""
        return any(word in self.joint.lower() for word in HITCHES)


@dataclass(frozen=True)
class RollingJoint:
    """A wheel's joint: it turns about a level axis, with nothing that moves below it.

    Attributes
    ----------
    joint : its name
    carrier : name of the movable joint that carries it; "theta" for the root link's body
    x, y : the wheel's centre in the carrier's frame, at zero, m
    heading : direction in which it rolls when it turns in the positive sense, from the carrier's x axis, rad
    radius : m
    """

    joint: str
    carrier: str
    x: float
    y: float
    heading: float
    radius: float


@dataclass(frozen=True)
class Layout:
    """The pivots and wheels of a robot. x and y count from the platform's reference point (see `load`'s
    `axle`) on the body that "theta" carries, and from the joint's own frame on any other."""

    robot: str
    pivots: tuple[Pivot, ...] = ()
    wheels: tuple[RollingJoint, ...] = ()


@dataclass(frozen=True)
class AddedJoint:
    """An upright joint on the main body that a platform needs and a robot's file lacks, or its limits.

    Attributes
    ----------
    joint : its name
    x, y : its axis, from the platform's reference point, m
    lower, upper : its limits, rad
    velocity : its largest rate, rad/s
    """

    joint: str
    x: float
    y: float
    lower: float
    upper: float
    velocity: float
