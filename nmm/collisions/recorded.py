"""Obstacles as a record has them: where each was at the samples, in plain data and arrays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from itertools import pairwise
from typing import Any

import numpy as np
import pinocchio as pin

from nmm.arrays import Array
from nmm.collisions.obstacle import Obstacle
from nmm.collisions.shapes import Box, Capsule, Cylinder, Hull, Mesh, Plane, Shape, Sphere
from nmm.errors import expect_known

KINDS: Mapping[str, type[Shape]] = {
    kind.__name__.lower(): kind for kind in (Box, Sphere, Cylinder, Capsule, Plane, Hull)
}


class Passed:
    """Where something was at times: a placement for each, and the shortest way between two.

    Parameters
    ----------
    t (K,) : s, ascending
    places (K, 4, 4) : m, world axes
    """

    def __init__(self, t: Array, places: Array) -> None:
        self._t, self._places = t, places

    def __call__(self, t: float) -> Array:
        """The placement at t, s, (4, 4); before the first and after the last time that one."""
        k = int(np.searchsorted(self._t, t))
        if k < len(self._t) and self._t[k] == t:
            return self._places[k]
        if k in (0, len(self._t)):
            return self._places[min(k, len(self._t) - 1)]
        share = (t - self._t[k - 1]) / (self._t[k] - self._t[k - 1])
        before, after = (pin.SE3(place) for place in self._places[k - 1 : k + 1])
        turned = before.rotation @ pin.exp3(share * pin.log3(before.rotation.T @ after.rotation))
        place: Array = pin.SE3(
            turned, (1.0 - share) * before.translation + share * after.translation
        ).homogeneous
        return place


def as_passed(obstacle: Obstacle, t: Array, places: Sequence[Any]) -> Obstacle:
    """An obstacle that nothing sets any more: it is where it was.

    Parameters
    ----------
    t (N,), places : N times, s, and what `Obstacle.at` said then
    """
    if obstacle.moves or not len(t):
        return obstacle
    if all(place is places[0] or place == places[0] for place in places):
        return Obstacle(obstacle.shape, places[0].homogeneous, name=obstacle.name)
    return made(obstacle.shape, obstacle.name, t, np.array([place.homogeneous for place in places]))


def made(shape: Shape, name: str, t: Array, places: Array) -> Obstacle:
    """An obstacle that was at `places` (N, 4, 4) at t (N,), s, or stands at `places` (1, 4, 4)."""
    if len(places) == 1:
        return Obstacle(shape, places[0], name=name)
    return Obstacle(shape, motion=Passed(t, places), name=name)


def places(obstacle: Obstacle, t: Array) -> Array:
    """Where an obstacle is at t (N,), s: (N, 4, 4), or (1, 4, 4) of one that stands."""
    times = t if obstacle.moves and len(t) else [0.0]
    return np.array([obstacle.placement(float(time)) for time in times])


def shifts(obstacles: Sequence[Obstacle], t: Array) -> Array:
    """How far a point of an obstacle goes from sample to sample of t (N,), s, at most: (N - 1,), m."""
    found = np.zeros(max(len(t) - 1, 0))
    for one in obstacles:
        if not one.moves:
            continue
        geometry = one.shape.geometry()
        geometry.computeLocalAABB()
        size = float(np.linalg.norm(geometry.aabb_center)) + float(geometry.aabb_radius)
        at = [one.at(float(time)) for time in t]
        for k, (before, after) in enumerate(pairwise(at)):
            turned = float(np.linalg.norm(pin.log3(before.rotation.T @ after.rotation)))
            way = float(np.linalg.norm(after.translation - before.translation))
            found[k] = max(found[k], way + (turned * size if turned else 0.0))
    return found


def described(shape: Shape) -> tuple[dict[str, Any], Array]:
    """A shape in plain data, and the points (N, 3) of one that is a hull; that of a file needs it no more."""
    if isinstance(shape, Mesh | Hull):
        return {"kind": "hull"}, np.array(shape.geometry().points()).reshape(-1, 3)
    found = {one.name: getattr(shape, one.name) for one in fields(shape)}  # type: ignore[arg-type]  # all are dataclasses
    return {"kind": type(shape).__name__.lower(), **found}, np.zeros((0, 3))


def shape_of(data: Mapping[str, Any], points: Array) -> Shape:
    """The shape that `described` described; `InputError` or `TypeError` for what it cannot have."""
    expect_known("kind", data.get("kind"), KINDS)
    given = {key: value for key, value in data.items() if key != "kind"}
    if data["kind"] == "hull":
        given["points"] = points
    return KINDS[data["kind"]](**given)
