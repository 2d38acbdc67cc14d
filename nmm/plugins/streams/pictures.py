"""What a tool is given of a robot, as plain data that another process can read."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from nmm.base.arrays import Array, Integers

#: Parent, child, position (3,) and quaternion (4,) x y z w.
Transform = tuple[str, str, Array, Array]
#: Position (3,), m, and quaternion (4,) x y z w.
Pose = tuple[Array, Array]
#: Points of a trail that are drawn as one line: each picture sends the last of these lines anew.
TOGETHER = 64
#: Points of a trail that is drawn whole in each picture, at most.
COARSE = 400


@dataclass(frozen=True, eq=False)
class Triangles:
    """Vertices (V, 3), m, and faces (F, 3)."""

    vertices: Array
    faces: Integers


@dataclass(frozen=True, eq=False)
class SensedCells:
    """What was sensed, of which whoever draws it makes a surface: points (N, 3), m, a corner of one of the
    cells around them (3,) and the cells' edges (3,), m."""

    points: Array
    corner: Array
    cell: Array


class Undrawn(NamedTuple):
    """A body that is not drawn any more, and why, where that is news; "" where nothing is seen of it."""

    why: str


Surface = Triangles | SensedCells | Undrawn


@dataclass(frozen=True, eq=False)
class DrawnBody:
    """An obstacle, or scenery: its name, no other's, its surface, and its pose in the world at first."""

    name: str
    surface: Triangles
    pose: Pose


@dataclass(frozen=True, eq=False)
class Still:
    """What does not change.

    title : of the recording
    description : URDF of the whole robot
    world, odom, base : frames
    fixed : transforms of links that do not move
    coordinates, inputs, errors : names and units
    wheeled : whether there is a platform that moves
    believed : whether there is odometry beside the truth
    desired (M, 3), marks (K, 3) : m in the world's frame
    bodies : obstacles and scenery
    notes : what is not drawn, in sentences
    start : the clock's time at the begin, ns since 1970
    """

    title: str
    description: str
    world: str
    odom: str
    base: str
    fixed: list[Transform]
    coordinates: list[tuple[str, str]]
    inputs: list[tuple[str, str]]
    errors: list[tuple[str, str]]
    wheeled: bool
    believed: bool
    desired: Array
    marks: Array
    bodies: list[DrawnBody]
    notes: list[str]
    start: int


class Near(NamedTuple):
    """Two points (2, 3) nearest to each other, m in the world's frame, or None where only a bound of their
    distance is known; the distance, m; what they belong to."""

    points: Array | None
    distance: float
    between: str


@dataclass(frozen=True, eq=False)
class RobotPicture:
    """A robot at t, s.

    stamp : the clock's time, ns since 1970
    transforms : of everything that moves
    stand : the pose of the base in the frame odom
    seen : the same in the world, where odometry has it; None without odometry of its own
    twist (3,) : along the base's x and y, and about z; None of a fixed base
    q, u, error : what the joints' encoders read, inputs, task error, NaN where a task is not active
    reached, wanted (3,) : where the task's frame is, and where it is to be, m in the world; or None
    near : which points are nearest to each other, if any are
    moved : poses of bodies that are elsewhere than before, by number
    changed : of bodies that are others, by number: their surfaces, or what those are made of
    """

    t: float
    stamp: int
    transforms: list[Transform]
    stand: Pose
    seen: Pose | None
    twist: Array | None
    q: Array
    u: Array
    error: Array
    reached: Array | None = None
    wanted: Array | None = None
    near: Near | None = None
    moved: dict[int, Pose] = field(default_factory=dict)
    changed: dict[int, Surface] = field(default_factory=dict)

    def stamped(self, stamp: int) -> RobotPicture:
        """The same with another time of the clock, ns."""
        return replace(self, stamp=stamp)


class Said(NamedTuple):
    """An event or a finding at t, s: by whom, in words; a warning or not."""

    t: float
    stamp: int
    who: str
    text: str
    warns: bool

    def stamped(self, stamp: int) -> Said:
        """The same with another time of the clock, ns."""
        return self._replace(stamp=stamp)


class Trail:
    """A path as it grows, in lines of at most `TOGETHER` points, each beginning where the last ended."""

    def __init__(self) -> None:
        self._points: list[Array] = []
        self._line = 0

    def add(self, point: Array) -> tuple[int, Array]:
        """The number of the line that the point (3,) is on, and its points (P, 3) so far."""
        if len(self._points) == TOGETHER:
            self._points = self._points[-1:]
            self._line += 1
        self._points.append(point)
        return self._line, np.array(self._points)


class CoarseTrail:
    """A path as it grows, whole, of at most `COARSE` points: of a longer one every second, fourth, …"""

    def __init__(self) -> None:
        self._points: list[Array] = []
        self._every, self._count = 1, 0

    def add(self, point: Array) -> Array:
        """The path (P, 3) up to the point (3,)."""
        if self._count % self._every == 0:
            self._points.append(point)
            if len(self._points) == COARSE:
                self._points, self._every = self._points[::2], 2 * self._every
        self._count += 1
        return np.array([*self._points, point])


def finite(names: list[tuple[str, str]], values: Array) -> dict[str, float]:
    """Numbers by name, those that are numbers."""
    pairs = zip(names, values.tolist(), strict=True)
    return {name: value for (name, _), value in pairs if math.isfinite(value)}


def axes(turn: Array) -> Array:
    """The x, y and z axis (3, 3), a row each, of what a quaternion (4,) x y z w turns."""
    x, y, z, w = turn
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)],
            [2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w)],
            [2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
