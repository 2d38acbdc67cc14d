"""Obstacles: shapes in the world that stand, move along a path, or are set from outside; and in a record."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import fields
from itertools import pairwise
from typing import Any, Self, TypeAlias

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from nmm.base.arrays import Array, array, vector
from nmm.base.errors import InputError, NmmError, RunError, expect, expect_kind, expect_known
from nmm.base.text_format import one_line
from nmm.model.collisions.elements.boxes import Elements
from nmm.model.collisions.shapes import Box, Capsule, ConvexMesh, Cylinder, HalfSpace, Hull, Shape, Sphere

#: Where a shape is: (3,) its origin, (6,) origin and rotation vector, or (4, 4); m, rad, world axes.
Placement: TypeAlias = ArrayLike
KINDS: Mapping[str, type[Shape]] = {
    kind.__name__.lower(): kind for kind in (Box, Sphere, Cylinder, Capsule, HalfSpace, Hull)
}
#: Step of the differences that give a path's velocity, s.
STEP = 1e-6


class Obstacle:
    """A shape that the robot keeps away from.

    Parameters
    ----------
    shape : `Box`, `Sphere`, `Cylinder`, `Capsule`, `HalfSpace`, `Hull` or `ConvexMesh`
    placement : where it is: (3,) its origin, (6,) origin and rotation vector, or a (4, 4) matrix; the world's
        origin when not given
    motion : in its place, where it is at t, s: a function that returns such a placement
    name : for messages; the shape's kind when not given
    velocity : that of its origin along `motion` at t: a function that returns (3,), m/s, world axes, or (6,)
        with the angular velocity, rad/s; differences of `motion` when not given

    Raises
    ------
    InputError : no shape, a placement or a motion that gives no such numbers, both of them

    Examples
    --------
    >>> pillar = nmm.Obstacle(nmm.Box([0.3, 0.6, 1.0]), [1.6, 0.0, 0.5], name="pillar")
    >>> ball = nmm.Obstacle(nmm.Sphere(0.1), motion=lambda t: [2.0 - 0.1 * t, 1.5, 0.3], name="ball")
    >>> pillar.moves, ball.moves, ball.at(10.0).translation
    (False, True, array([1. , 1.5, 0.3]))
    """

    def __init__(
        self,
        shape: Shape,
        placement: Placement | None = None,
        motion: Callable[[float], Placement] | None = None,
        name: str = "",
        velocity: Callable[[float], ArrayLike] | None = None,
    ) -> None:
        expect_kind(shape, Shape, "obstacle", "a shape (Box, Sphere, ...)")
        self.shape = shape
        self.name = name or type(shape).__name__.lower()
        self.motion = motion
        where = f"obstacle {self.name}"
        if motion is not None and not callable(motion):
            expected = "a Python function of t that returns a placement, as in lambda t: [0.1 * t, 0, 0.3]"
            raise InputError(where=f"{where}: motion", expected=expected, got=motion)
        if motion is not None and placement is not None:
            raise InputError("both", where=where, expected="a placement or a motion")
        if velocity is not None and (motion is None or not callable(velocity)):
            expected = "a function of t, with motion"
            raise InputError(where=f"{where}: velocity", expected=expected, got=velocity)
        self._velocity = velocity
        standing = (0.0, 0.0, 0.0) if placement is None else placement
        self._placement = self._checked(standing if motion is None else self._moved(motion, 0.0, InputError))
        self._twist = np.zeros(6)

    def __repr__(self) -> str:
        return f"Obstacle({self.name}, {self.shape})"

    @property
    def moves(self) -> bool:
        """Whether it moves along a path."""
        return self.motion is not None

    def placement(self, t: float) -> Array:
        """Where it is at t, s: (4, 4), world axes, m."""
        pose: Array = self.at(t).homogeneous
        return pose

    def move_to(self, placement: Placement, velocity: ArrayLike | None = None) -> None:
        """Set where it is from now on.

        Parameters
        ----------
        placement : as in the constructor
        velocity : (3,) of its origin, or (6,) with its angular velocity, m/s and rad/s, world axes; 0 when
            not given

        Raises
        ------
        InputError : it moves along a path; no such numbers
        """
        if self.motion is not None:
            raise InputError("it moves along a path and cannot be set", where=f"obstacle {self.name}")
        pose = self._checked(placement)
        self._twist = np.zeros(6) if velocity is None else self._six(velocity)
        self._placement = pose

    def standing(self, placement: Placement) -> Self:
        """A copy that stands there; this one stays where it is.

        Parameters
        ----------
        placement : as in the constructor

        Raises
        ------
        InputError : no such numbers
        """
        other = copy(self)
        other.motion = other._velocity = None
        other.move_to(placement)
        return other

    def going_on(self, t: float) -> Obstacle:
        """One that moves on from where this one is at t, s, with the velocity that `move_to` set."""
        pose, twist = self.at(t), self.twist(t)

        def motion(time: float) -> Array:
            turned = pin.exp3((time - t) * twist[3:]) @ pose.rotation
            place: Array = pin.SE3(turned, pose.translation + (time - t) * twist[:3]).homogeneous
            return place

        return Obstacle(self.shape, motion=motion, name=self.name)

    def at(self, t: float) -> Any:
        """As `placement`, Pinocchio's; the same object as long as nothing sets it."""
        return self._placement if self.motion is None else self._checked(self._moved(self.motion, t))

    def _moved(
        self, motion: Callable[[float], Placement], t: float, kind: type[NmmError] = RunError
    ) -> Placement:
        """What the motion says at t, s; an error of that kind where it raises one of its own."""
        try:
            return motion(t)
        except NmmError:
            raise
        except Exception as error:  # a user's function may raise anything
            what = f"motion({t:g}) raised {type(error).__name__}: {one_line(str(error))}"
            raise kind(f"obstacle {self.name}: {what}") from error

    def twist(self, t: float) -> Array:
        """Velocity of its origin over its angular velocity at t, (6,), m/s and rad/s, world axes."""
        if self.motion is None:
            return self._twist
        if self._velocity is not None:
            return self._six(self._velocity(t))
        behind, ahead = self.at(t - STEP), self.at(t + STEP)
        turned = pin.log3(ahead.rotation @ behind.rotation.T)
        return np.concatenate([ahead.translation - behind.translation, turned]) / (2.0 * STEP)

    def _six(self, velocity: ArrayLike) -> Array:
        components = vector(velocity, (3, 6), f"obstacle {self.name}: velocity")
        return np.concatenate([components, np.zeros(6 - components.size)])

    def _checked(self, placement: Placement) -> Any:
        # What a motion usually returns: the look-ahead calls it many times per sample.
        if isinstance(placement, np.ndarray) and placement.dtype == np.float64 and placement.shape == (6,):
            six: Array = placement
            if six.dot(six) < np.inf:
                return pin.SE3(pin.exp3(six[3:]), six[:3])
        name = f"obstacle {self.name}: {'placement' if self.motion is None else 'motion'}"
        values = array(placement, name)
        if values.shape == (4, 4):
            rotation = values[:3, :3]
            off = np.inf if np.linalg.det(rotation) < 0.0 else np.abs(rotation @ rotation.T - np.eye(3)).max()
            expect(off <= 1e-6, name, "a rotation in the upper left of the matrix")
            far = np.abs(values[3] - (0.0, 0.0, 0.0, 1.0)).max()
            expect(far <= 1e-6, name, "0, 0, 0, 1 in the last row", values[3])
            return pin.SE3(rotation, values[:3, 3])
        if values.shape == (3,):
            return pin.SE3(np.eye(3), values)
        if values.shape == (6,):
            return pin.SE3(pin.exp3(values[3:]), values[:3])
        raise InputError(where=name, expected="3 or 6 numbers or a (4, 4) matrix", got=values)


class Passed:
    """Recorded placements (K, 4, 4), m, at t (K,), s, interpolated by the shortest motion between two."""

    def __init__(self, t: Array, obstacle_places: Array) -> None:
        self._t, self._places = t, obstacle_places

    def __call__(self, t: float) -> Array:
        """The placement (4, 4) at t, s; before the first and after the last time that one."""
        k = int(np.searchsorted(self._t, t))
        if k < len(self._t) and self._t[k] == t:
            return self._places[k]
        if k in (0, len(self._t)):
            return self._places[min(k, len(self._t) - 1)]
        share = (t - self._t[k - 1]) / (self._t[k] - self._t[k - 1])
        before, after = (pin.SE3(place) for place in self._places[k - 1 : k + 1])
        turned = before.rotation @ pin.exp3(share * pin.log3(before.rotation.T @ after.rotation))
        moved = (1.0 - share) * before.translation + share * after.translation
        place: Array = pin.SE3(turned, moved).homogeneous
        return place


def as_passed(obstacle: Obstacle, t: Array, obstacle_places: Sequence[Any]) -> Obstacle:
    """An obstacle as recorded, which nothing sets any more; its placements (`Obstacle.at`) at t (N,), s."""
    if obstacle.moves or not len(t):
        return obstacle
    first = obstacle_places[0]
    stands = all(place is first or place == first for place in obstacle_places)
    seen = np.array([place.homogeneous for place in ([first] if stands else obstacle_places)])
    return obstacle_from_json(obstacle.shape, obstacle.name, t, seen)


def obstacle_from_json(shape: Shape, name: str, t: Array, placements: Array) -> Obstacle:
    """An obstacle that was at `placements` (N, 4, 4) at t (N,), s, or stands at `placements` (1, 4, 4)."""
    if len(placements) == 1:
        return Obstacle(shape, placements[0], name=name)
    return Obstacle(shape, motion=Passed(t, placements), name=name)


def obstacle_places(obstacle: Obstacle, t: Array) -> Array:
    """Where an obstacle is at t (N,), s: (N, 4, 4), or (1, 4, 4) of one that stands."""
    times = t if obstacle.moves and len(t) else [0.0]
    return np.array([obstacle.placement(float(time)) for time in times])


def shifts(obstacles: Sequence[Obstacle], t: Array) -> Array:
    """The most that a point of an obstacle moves between samples t (N,), s: (N - 1,), m."""
    largest = np.zeros(max(len(t) - 1, 0))
    for obstacle in obstacles:
        if not obstacle.moves:
            continue
        geometry = obstacle.shape.geometry()
        geometry.computeLocalAABB()
        size = float(np.linalg.norm(geometry.aabb_center)) + float(geometry.aabb_radius)
        at = [obstacle.at(float(time)) for time in t]
        for k, (before, after) in enumerate(pairwise(at)):
            turned = float(np.linalg.norm(pin.log3(before.rotation.T @ after.rotation)))
            way = float(np.linalg.norm(after.translation - before.translation))
            largest[k] = max(largest[k], way + (turned * size if turned else 0.0))
    return largest


def obstacle_as_json(shape: Shape) -> tuple[dict[str, Any], Array]:
    """A shape in plain data, and the points (N, 3) of a hull, so that a mesh's file is no longer needed."""
    if isinstance(shape, Elements):
        return shape.as_json()
    if isinstance(shape, ConvexMesh | Hull):
        return {"kind": "hull"}, np.array(shape.geometry().points()).reshape(-1, 3)
    parameters = {field.name: getattr(shape, field.name) for field in fields(shape)}  # type: ignore[arg-type]  # all are dataclasses
    return {"kind": type(shape).__name__.lower(), **parameters}, np.zeros((0, 3))


def shape_from_json(data: Mapping[str, Any], points: Array) -> Shape:
    """The shape that `obstacle_as_json` described; `InputError` or `TypeError` for what it cannot have."""
    if data.get("kind") == "elements":
        return Elements.from_json(dict(data), points)
    expect_known("kind", data.get("kind"), KINDS)
    parameters = {key: value for key, value in data.items() if key != "kind"}
    if data["kind"] == "hull":
        parameters["points"] = points
    return KINDS[data["kind"]](**parameters)
