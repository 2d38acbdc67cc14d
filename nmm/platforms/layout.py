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

    Examples
    --------
    >>> column = nmm.Pivot("front_steer", "theta", x=0.5, y=0.0, lower=-0.6, upper=0.6)
    >>> column.steers, column.hitches
    (True, False)
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

    Examples
    --------
    >>> wheel = nmm.RollingJoint("left_wheel", "theta", x=0.0, y=0.3, heading=0.0, radius=0.1)
    >>> wheel.joint, wheel.y, wheel.radius
    ('left_wheel', 0.3, 0.1)
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
    `axle`) on the body that "theta" carries, and from the joint's own frame on any other.

    Examples
    --------
    >>> sides = (("left", 0.3), ("right", -0.3))
    >>> wheels = [nmm.RollingJoint(name, "theta", 0.0, y, heading=0.0, radius=0.1) for name, y in sides]
    >>> platform = nmm.DifferentialDrive.fit(nmm.Layout("cart", wheels=tuple(wheels)))
    >>> dict(platform.lengths)
    {'radius': 0.1, 'track': 0.6}
    """

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

    Examples
    --------
    >>> joint = nmm.AddedJoint("steering", x=0.5, y=0.0, lower=-0.6, upper=0.6, velocity=1.0)
    >>> joint.joint, joint.upper
    ('steering', 0.6)
    """

    joint: str
    x: float
    y: float
    lower: float
    upper: float
    velocity: float
