"""A robot's shapes for distance queries, and which of them touch in random configurations."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from nmm.base.arrays import Array, Integers
from nmm.base.errors import InputError, expect_known
from nmm.base.text_format import is_pattern, matching
from nmm.model.collisions.shapes import hull
from nmm.model.robots.joint_table import placement_rows
from nmm.model.robots.robot import Robot

#: Two shapes by their numbers.
Pair = tuple[int, int]
HULLS, CAPSULES = "hulls", "capsules"
#: Half of the thickness that a mesh without volume is given, m.
THIN = 5e-4
_CORNERS = np.array(np.meshgrid([-1.0, 1.0], [-1.0, 1.0], [-1.0, 1.0])).reshape(3, -1).T
#: How many configurations are drawn to see which pairs always touch, and how often links do.
SAMPLES, CONFIGURATIONS = 200, 1000
#: Of more pairs those are left out whose shapes are far apart; whether two just touch depends on the last q.
FEW_PAIRS = 2_000
#: In so many of these boxes are looked at first.
FIRST = 8
#: Coordinates without limits are drawn from ± this, m or rad.
RANGE = 4.0
#: Limits of this size are none.
ENDLESS = 1e3


def query_shapes(robot: Robot, meshes: str = HULLS) -> pin.GeometryModel:
    """The robot's collision shapes, all convex, without pairs: primitives as they are, meshes as "hulls" or
    as "capsules" around their points."""
    shapes = pin.GeometryModel()
    for shape in robot.collision_model.geometryObjects:
        copied, placement = pin.GeometryObject(shape), shape.placement
        if isinstance(shape.geometry, coal.BVHModelBase):
            points = np.array(shape.geometry.vertices()).reshape(-1, 3)
            copied.geometry, own = _capsule(points) if meshes == CAPSULES else (_hull(points), None)
            copied.placement = placement if own is None else placement * own
        shapes.addGeometryObject(copied)
    return shapes


def pairs_of(shapes: pin.GeometryModel) -> list[Pair]:
    return [(pair.first, pair.second) for pair in shapes.collisionPairs]


def link_names(robot: Robot, shapes: pin.GeometryModel) -> tuple[str, ...]:
    return tuple(robot.model.frames[shape.parentFrame].name for shape in shapes.geometryObjects)


def _hull(points: Array) -> Any:
    try:
        return hull(points)
    except InputError:  # a plate: both of its sides
        return hull(np.vstack([points + THIN * corner for corner in _CORNERS]))


def _capsule(points: Array) -> tuple[Any, pin.SE3]:
    middle = points.mean(axis=0)
    axes = np.linalg.svd(points - middle, full_matrices=False)[2]
    axes[2] = np.cross(axes[0], axes[1])
    turn = axes[[1, 2, 0]].T  # the longest along z
    local = (points - middle) @ turn
    center = np.append((local[:, :2].min(axis=0) + local[:, :2].max(axis=0)) / 2.0, 0.0)
    local -= center
    across = np.linalg.norm(local[:, :2], axis=1)
    radius = max(float(across.max()), THIN)
    caps = np.sqrt(np.maximum(radius**2 - across**2, 0.0))
    low, high = float((local[:, 2] + caps).min()), float((local[:, 2] - caps).max())
    if low > high:
        low = high = (low + high) / 2.0
    center[2] = (low + high) / 2.0
    return coal.Capsule(radius, max(high - low, THIN)), pin.SE3(turn, middle + turn @ center)


def random_configurations(robot: Robot, count: int = SAMPLES, seed: int = 0) -> Array:
    return _drawn(robot, count, seed).copy()


@lru_cache(maxsize=8)
def _drawn(robot: Robot, count: int, seed: int) -> Array:
    rng = np.random.default_rng(seed)
    limits = robot.q_limits
    ends = np.where(robot.limited & (np.abs(limits) < ENDLESS), limits, [-RANGE, RANGE])
    return robot.following.placed(rng.uniform(ends[:, 0], ends[:, 1], (count, robot.n)))


def touching(
    robot: Robot, shapes: pin.GeometryModel, pairs: Sequence[Pair], distance: float
) -> dict[Pair, float]:
    """The share of random configurations in which each pair is nearer than `distance`, m."""
    measure = measured_pairs(robot, shapes, pairs)
    drawn = random_configurations(robot)
    near = sum((measure(q, distance) < distance for q in drawn), start=np.zeros(len(pairs)))
    return dict(zip(pairs, (near / SAMPLES).tolist(), strict=True))


@lru_cache(maxsize=8)
def own_shapes(
    robot: Robot, meshes: str, distance: float
) -> tuple[pin.GeometryModel, Array, frozenset[Pair]]:
    """`query_shapes`, which are not to be changed, the boxes around them, and of the model's pairs those
    nearer than `distance`, m, in every random configuration."""
    shapes = query_shapes(robot, meshes)
    pairs, boxes = pairs_of(robot.collision_model), boxes_around(shapes.geometryObjects)
    return shapes, boxes, frozenset(always_near(robot, shapes, boxes, pairs, distance))


def always_near(
    robot: Robot, shapes: pin.GeometryModel, boxes: Array, pairs: Sequence[Pair], distance: float
) -> list[Pair]:
    """The pairs of shapes, which have these boxes, nearer than `distance`, m, in every random
    configuration."""
    left = list(pairs)
    if not left:
        return left
    measure = measured_pairs(robot, shapes, left, boxes)
    for q in random_configurations(robot):
        near = measure(q, distance) < distance
        left[:] = [pair for pair, is_near in zip(left, near, strict=True) if is_near]
        if not left:
            break
    return left


@lru_cache(maxsize=8)
def _own_places(robot: Robot, meshes: str) -> Array:
    """Where the robot's shapes are in the first random configurations, (FIRST, G, 12)."""
    shapes = query_shapes(robot, meshes)
    data, placed = robot.model.createData(), pin.GeometryData(shapes)
    places, rows = placement_rows(placed.oMg), []
    for q in random_configurations(robot)[:FIRST]:
        pin.updateGeometryPlacements(robot.model, data, shapes, placed, q)
        rows.append(places.copy())
    return np.array(rows)


def perhaps_near(
    robot: Robot, meshes: str, places: Array, boxes: Array, pairs: Sequence[Pair], distance: float
) -> list[Pair]:
    """Of pairs of the robot's shapes with obstacles, which are at these places (K, 12), those that boxes do
    not show to be `distance` apart, m, in one of the first random configurations: `always_near` of the others
    is False."""
    if not pairs:
        return []
    own = _own_places(robot, meshes)
    count, (i, j) = own.shape[1], np.array(pairs, dtype=np.int64).T
    each = np.arange(len(own))[:, np.newaxis] * count
    numbers = np.column_stack([(i + each).ravel(), np.tile(j + (len(own) - 1) * count, len(own))])
    all_boxes = np.vstack([np.tile(boxes[:count], (len(own), 1)), boxes[count:]])
    bounds = _box_bounds(np.vstack([own.reshape(-1, 12), places]), all_boxes, numbers)
    near = np.flatnonzero(bounds.reshape(len(own), -1).max(axis=0) < distance)
    return [pairs[k] for k in near.tolist()]


def measured_pairs(
    robot: Robot,
    shapes: pin.GeometryModel,
    pairs: Sequence[Pair] | Integers,
    known_boxes: Array | None = None,
) -> Callable[[Array, float], Array]:
    """The function q (n,), enough -> each pair's distance (pairs,), m; below 0 inside each other. Of pairs
    whose boxes are farther apart than `enough`, m, a lower bound."""
    model, data, placed = robot.model, robot.model.createData(), shapes.copy()
    placed.removeAllCollisionPairs()  # they would each have memory of Coal's
    geometry_data = pin.GeometryData(placed)
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    objects = shapes.geometryObjects
    boxes = boxes_around(objects) if known_boxes is None else known_boxes
    geometries, places = [shape.geometry for shape in objects], placement_rows(geometry_data.oMg)

    def measure(q: Array, enough: float) -> Array:
        pin.updateGeometryPlacements(model, data, placed, geometry_data, q)
        transforms: dict[int, Any] = {}
        numbers = np.asarray(pairs, dtype=np.int64).reshape(-1, 2)
        distances = _box_bounds(places, boxes, numbers)
        for k in np.flatnonzero(distances < enough):
            pair = numbers[k].tolist()
            for i in pair:
                if i not in transforms:
                    placement = geometry_data.oMg[i]
                    transforms[i] = coal.Transform3s(placement.rotation, placement.translation)
            (first, second), (one, other) = (geometries[i] for i in pair), (transforms[i] for i in pair)
            result.clear()
            distances[k] = coal.distance(first, one, second, other, request, result)
        return distances

    return measure


def _box_bounds(places: Array, boxes: Array, pairs: Integers) -> Array:
    """How far the ball around the first of each pair is from the box around the second, (P,), m, where shapes
    are at places (G, 12); -infinity of half-spaces."""
    turns, centres = places[:, :9].reshape(-1, 3, 3), places[:, 9:]  # a column of the rotation in a row
    i, j = pairs.T
    middles = centres + np.einsum("gak,ga->gk", turns, boxes[:, :3])
    off = np.einsum("pak,pk->pa", turns[j], middles[i] - centres[j]) - boxes[j, :3]
    beyond = np.maximum(np.abs(off) - boxes[j, 3:6], 0.0)
    bounds = np.sqrt(np.einsum("pa,pa->p", beyond, beyond)) - boxes[i, 6]
    return np.where(np.isinf(boxes[j, 6]), -np.inf, bounds)


def boxes_around(objects: Any) -> Array:
    """The boxes around shapes, (G, 7)."""
    return np.array([box_around(shape.geometry) for shape in objects]).reshape(-1, 7)


def box_around(geometry: Any) -> Array:
    """Centre, half extents and radius of the box around a shape; a half-space's normal, offset and zeros."""
    if isinstance(geometry, coal.Halfspace):
        return np.array([*geometry.n, geometry.d, 0.0, 0.0, np.inf])
    geometry.computeLocalAABB()
    low, high = geometry.aabb_local.min_, geometry.aabb_local.max_
    return np.array([*(low + high) / 2.0, *(high - low) / 2.0, geometry.aabb_radius])


def named_pairs(requested: Sequence[tuple[str, str]], names: Sequence[Sequence[str]], what: str) -> set[Pair]:
    """The pairs that names mean, by the `names` of each shape, with * for any letters and ? for one;
    `InputError` for unknown names, patterns that nothing matches, or not two."""
    known = list(dict.fromkeys(name for of_one in names for name in of_one))
    pairs: set[Pair] = set()
    for pair in requested:
        if isinstance(pair, str) or not isinstance(pair, Sequence) or len(pair) != 2:
            raise InputError(where=what, expected="two names", got=pair)
        meant = [_meant(name, known, what) for name in pair]
        first, second = (
            [i for i, of_one in enumerate(names) if not group.isdisjoint(of_one)] for group in meant
        )
        pairs |= {(min(i, j), max(i, j)) for i in first for j in second}
    return pairs


def _meant(name: str, known: Sequence[str], what: str) -> set[str]:
    """The names that one stands for: itself, or those that a pattern matches."""
    if is_pattern(name) and name not in known and (matched := matching(name, known)):
        return {*matched}
    expect_known("link, shape or obstacle", name, known, what)
    return {name}


@dataclass(frozen=True)
class Touching:
    """Which links touch in random configurations; `shares` by pairs of names, the greatest first."""

    shapes: int
    configurations: int
    shares: dict[tuple[str, str], float]

    @property
    def never(self) -> list[tuple[str, str]]:
        return [pair for pair, share in self.shares.items() if share == 0.0]

    @property
    def always(self) -> list[tuple[str, str]]:
        """The pairs that touched in every configuration: neighbours, by how they are drawn."""
        return [pair for pair, share in self.shares.items() if share == 1.0]

    @property
    def sometimes(self) -> dict[tuple[str, str], float]:
        return {pair: share for pair, share in self.shares.items() if 0.0 < share < 1.0}


class NearPairs:
    """Of pairs of shapes (P, 2) those whose balls touch: of 18,000 pairs of a long chain some hundred."""

    def __init__(self, shapes: pin.GeometryModel, pairs: Integers) -> None:
        bodies = [shape.geometry for shape in shapes.geometryObjects]
        for body in bodies:
            body.computeLocalAABB()
        self._middles = np.array([body.aabb_center for body in bodies])
        radii = np.array([body.aabb_radius for body in bodies])
        self._reach = np.square(np.add.outer(radii, radii))
        self._number = np.full(self._reach.shape, -1)
        self._number[tuple(pairs.T)] = np.arange(len(pairs))

    def at(self, data: pin.GeometryData) -> list[int]:
        """Their numbers where the shapes are now."""
        rows = placement_rows(data.oMg)
        axes = rows[:, :9].reshape(-1, 3, 3)
        middles = rows[:, 9:] + np.einsum("kji,kj->ki", axes, self._middles)
        apart = np.sum([np.square(np.subtract.outer(along, along)) for along in middles.T], axis=0)
        # What is infinite has no middle, and is near everything.
        near = self._number[~(apart > self._reach)]
        return near[near >= 0].tolist()


def touching_links(robot: Robot, count: int = CONFIGURATIONS) -> Touching:
    """How often the links of the model's collision pairs touch, meshes as convex hulls.

    Parameters
    ----------
    count : how many random configurations within limits are looked at

    Raises
    ------
    RobotError : meshes that cannot be read
    """
    shapes = query_shapes(robot)
    links = link_names(robot, shapes)
    pairs = pairs_of(robot.collision_model)
    if not pairs:
        return Touching(len(links), count, {})
    for pair in pairs:
        shapes.addCollisionPair(pin.CollisionPair(*pair))
    geometry_data, data = pin.GeometryData(shapes), robot.model.createData()
    named = [(links[i], links[j]) for i, j in pairs]
    distinct = list(dict.fromkeys(named))
    columns = {pair: k for k, pair in enumerate(distinct)}
    column = np.array([columns[pair] for pair in named])
    touched = np.zeros(len(distinct))
    near = NearPairs(shapes, np.array(pairs)) if len(pairs) > FEW_PAIRS else None
    for q in random_configurations(robot, count):
        pin.updateGeometryPlacements(robot.model, data, shapes, geometry_data, q)
        some = range(len(pairs)) if near is None else near.at(geometry_data)
        hit = [k for k in some if pin.computeCollision(shapes, geometry_data, k)]
        touched[np.unique(column[hit])] += 1.0
    order = np.argsort(-touched, kind="stable")
    return Touching(len(links), count, {distinct[k]: float(touched[k]) / count for k in order})
