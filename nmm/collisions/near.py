"""Which pairs are near, compiled: a lower bound of every pair's distance from boxes around its shapes."""

from __future__ import annotations

import math
from typing import NamedTuple

from nmm.arrays import Array
from nmm.kernels.compiled import compiled, scratch
from nmm.kernels.memory import Cell, IntegerCell, IntegerMatrix, IntegerVector, Matrix, Vector


class Scene(NamedTuple):
    """G shapes and P pairs of them, in memory.

    band () : pairs nearer than this are measured and have rows, m
    faces () : more than one where they are nearer than this, m
    pairs (P, 2); apart (P, n) : 1 where a coordinate moves one shape of a pair and not the other
    supports (G, n) : 1 where a coordinate moves a shape
    twists (G, 6) : of obstacles, their origin's velocity over the angular one, world axes
    boxes (G, 7) : centre and half extents of the box around a shape, its radius; of a half-space its
        normal and offset
    planes () : half-spaces are the shapes from this one on, and second in their pairs
    first_corner (G + 1,), corners (..., 3), rounding (G,) : corners in a shape's axes, and the radius
        about them
    active (P,) : whether a pair is near; changed (P,) : those that came near or went in the last step
    bounds (P,) : the distances, m, of pairs that are not near lower bounds; risky (P,) : see `at_risk`
    kept (P,) : what a pair's distance may not fall below, m
    """

    band: Cell
    faces: Cell
    pairs: IntegerMatrix
    apart: Matrix
    supports: Matrix
    twists: Matrix
    boxes: Matrix
    planes: IntegerCell
    first_corner: IntegerVector
    corners: Matrix
    rounding: Vector
    active: IntegerVector
    changed: IntegerVector
    bounds: Vector
    risky: IntegerVector
    kept: Vector


@compiled
def to_world(places: Array, shape: int, x: float, y: float, z: float, out: Array, row: int) -> None:
    """out[row] = R (x, y, z) + p; places (G, 12): R column by column, then p."""
    for k in range(3):
        out[row, k] = (
            places[shape, k] * x + places[shape, 3 + k] * y + places[shape, 6 + k] * z + places[shape, 9 + k]
        )


@compiled
def outside_box(places: Array, boxes: Array, box: int, centers: Array, point: int) -> float:
    """Distance of a centre from the box around another shape; -infinite within: it says nothing of depth."""
    square = 0.0
    for k in range(3):
        along = 0.0
        for i in range(3):
            along += places[box, 3 * k + i] * (centers[point, i] - centers[box, i])
        beyond = abs(along) - boxes[box, 3 + k]
        if beyond > 0.0:
            square += beyond * beyond
    return math.sqrt(square) if square > 0.0 else -math.inf


@compiled
def above_plane(places: Array, boxes: Array, plane: int, centers: Array, box: int) -> float:
    """How far the box around a shape is above a half-space."""
    height = -boxes[plane, 3]
    across = 0.0
    n = scratch(3)
    for k in range(3):
        n[k] = 0.0
        for i in range(3):
            n[k] += places[plane, 3 * i + k] * boxes[plane, i]
        height += n[k] * (centers[box, k] - places[plane, 9 + k])
    for k in range(3):
        across += boxes[box, 3 + k] * abs(
            n[0] * places[box, 3 * k] + n[1] * places[box, 3 * k + 1] + n[2] * places[box, 3 * k + 2]
        )
    return height - across


@compiled
def find_near(scene: Scene, places: Array) -> int:
    """Write the lower bounds, and which pairs came near or went; returns how many did."""
    count = min(scene.boxes.shape[0], scene.planes[()])
    boxes, band = scene.boxes, float(scene.band[()])
    centers = scratch((count + 1, 3))
    for i in range(count):
        to_world(places, i, boxes[i, 0], boxes[i, 1], boxes[i, 2], centers, i)
    found = 0
    for k in range(scene.pairs.shape[0]):
        i, j = scene.pairs[k, 0], scene.pairs[k, 1]
        if j >= scene.planes[()]:
            bound = above_plane(places, boxes, j, centers, i)
        else:
            x = centers[i, 0] - centers[j, 0]
            y = centers[i, 1] - centers[j, 1]
            z = centers[i, 2] - centers[j, 2]
            bound = math.sqrt(x * x + y * y + z * z) - boxes[i, 6] - boxes[j, 6]
            if bound < band:
                bound = max(bound, outside_box(places, boxes, j, centers, i) - boxes[i, 6])
                bound = max(bound, outside_box(places, boxes, i, centers, j) - boxes[j, 6])
        scene.bounds[k] = bound
        near = 1 if bound < band else 0
        if near != scene.active[k]:
            scene.active[k] = near
            scene.changed[found] = k
            found += 1
    return found


@compiled
def at_risk(scene: Scene, places: Array, J: Array, q_dot: Array, times: Array) -> int:
    """Which pairs could come nearer than they may while the coordinates go on; returns how many.

    J (n, 6) : the joints' twists about the world's origin; q_dot (n,)
    times (n,) : for how long each coordinate goes on like this, s
    """
    count, n = scene.supports.shape
    centers, moved, total = scratch((1, 3)), scratch((count, n)), scratch(count)
    for i in range(count):
        total[i] = 0.0
        if i >= scene.planes[()]:
            continue
        radius = scene.boxes[i, 6]
        to_world(places, i, scene.boxes[i, 0], scene.boxes[i, 1], scene.boxes[i, 2], centers, 0)
        x, y, z = centers[0, 0], centers[0, 1], centers[0, 2]
        for c in range(n):
            moved[i, c] = 0.0
            if scene.supports[i, c] == 0.0 or q_dot[c] == 0.0:
                continue
            a, b, w = J[c, 3], J[c, 4], J[c, 5]
            u = J[c, 0] + b * z - w * y
            v = J[c, 1] + w * x - a * z
            r = J[c, 2] + a * y - b * x
            turn = math.sqrt(a * a + b * b + w * w)
            # The lever changes while other joints move: a tenth more.
            moved[i, c] = 1.1 * abs(q_dot[c]) * times[c] * (math.sqrt(u * u + v * v + r * r) + turn * radius)
            total[i] += moved[i, c]
    found = 0
    longest = 0.0
    for c in range(n):
        longest = max(longest, times[c])
    for k in range(scene.pairs.shape[0]):
        i, j = scene.pairs[k, 0], scene.pairs[k, 1]
        room = scene.bounds[k] - scene.kept[k]
        one = 0.0
        two = 0.0
        few = room >= total[i] + (total[j] if j < scene.planes[()] else 0.0)
        for c in range(0 if few else n):
            if scene.apart[k, c] > 0.0:
                one += moved[i, c]
                two += moved[j, c] if j < scene.planes[()] and scene.supports[j, c] > 0.0 else moved[i, c]
        t = scene.twists[j]
        speed = math.sqrt(t[0] * t[0] + t[1] * t[1] + t[2] * t[2])
        turn = math.sqrt(t[3] * t[3] + t[4] * t[4] + t[5] * t[5])
        if turn > 0.0:
            square = 0.0
            for a in range(3):
                square += (places[i, 9 + a] - places[j, 9 + a]) ** 2
            speed += turn * (math.sqrt(square) + 2.0 * scene.boxes[i, 6])
        if room < max(one, two) + longest * speed:
            scene.risky[found] = k
            found += 1
    return found
