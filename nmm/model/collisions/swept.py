"""The motion that inputs cause, compiled: where the robot will be, and which pairs are surely apart there.
After it the robot stands, and what moves along a path goes on (`later`).

The gap between parallel planes that separate two convex shapes bounds their distance from below. The last
direction between nearest points, carried along with either shape, often suffices; else Coal measures."""

import math
from typing import NamedTuple

from nmm.base.arrays import Array
from nmm.base.kernels.compiled import clear, compiled, scratch
from nmm.base.kernels.kinematics import Joints, compose, place_joints
from nmm.base.kernels.linear_algebra import copied
from nmm.base.kernels.record_layout import (
    Blocks,
    Cell,
    IntegerCell,
    IntegerVector,
    Matrices,
    Matrix,
    Vector,
    views,
)
from nmm.model.collisions.broad_phase import PairArrays
from nmm.model.collisions.elements.nearest import into_axes, placed_sensed
from nmm.model.robots.zero_order_hold import Inputs, hold

#: Two looks are no farther apart than this, in m and rad of the coordinates together.
APART = 0.01
#: At most this many looks within the sample, and samples of giving way and of braking.
LOOKS, DRIVEN, BRAKING = 20, 400, 400
#: A joint's lever changes while others move: it is taken this much longer than it is now.
LEVERS = 1.1


class SweptMotion(NamedTuple):
    """L looks ahead.

    joints, inputs : the robot's
    falling, rising (m,) : by how much inputs can fall and rise per second; infinite where unknown
    driven (m,), lasts () : inputs to which those of the sample then change, for so long, s, before braking
    carrier (G,), place (G, 12) : a shape's joint, and its place there; an obstacle's is in the world, now
    path (G,), paths (..., L, 12) : the path of an obstacle, -1 without, and -2 for the robot's shapes; places
    disc (G,) : radius of a cylinder, 0 of others
    later (K,) : times at which obstacles with a path are looked at while the robot stands, s from now
    grid (..., K, 12) : where they are then
    planes (P, 2, 4) : in each shape's axes, direction to the other and extent along it, m; infinite if
    unknown
    looks () : how many; stands () : the first at which the robot stands
    after (L,) : s from now; q (L, n) : where the robot is then
    weight (L,) : how long the inputs would have taken to get as far, s"""

    joints: Joints
    inputs: Inputs
    falling: Vector
    rising: Vector
    driven: Vector
    lasts: Cell
    carrier: IntegerVector
    place: Matrix
    path: IntegerVector
    paths: Matrices
    disc: Vector
    later: Vector
    grid: Matrices
    planes: Matrices
    looks: IntegerCell
    stands: IntegerCell
    after: Vector
    weight: Vector
    q: Matrix


@compiled
def braking_share(falling: Array, rising: Array, u: Array, dt: float) -> float:
    """The share of the inputs that one sample of braking removes, equal for all: directions are kept."""
    share = 1.0
    for j in range(u.shape[0]):
        braking = falling[j] if u[j] > 0.0 else rising[j]
        share = min(share, braking * dt / max(abs(u[j]), 1e-12))
    return share


@compiled
def lay(way_blocks: Blocks, q: Array, u: Array, dt: float) -> int:
    """Write the looks along dt with u, the braking after it, and the standing; returns how many."""
    way = views(SweptMotion, way_blocks.integers, way_blocks.floats, 0)
    size = 0.0
    brakes = False
    for j in range(u.shape[0]):
        size += abs(u[j])
        brakes = brakes or math.isfinite(way.falling[j]) or math.isfinite(way.rising[j])
    count = max(2, math.ceil(min(dt * size / APART, float(LOOKS))))
    for i in range(count):
        way.after[i] = way.weight[i] = dt * (i + 1) / count
        hold(way.inputs, q, u, dt * (i + 1) / count, way.q[i])
    share, gone = 1.0, 0.0
    weight = after = dt
    current, ahead = scratch(q.shape[0]), scratch(q.shape[0])
    now, slower = scratch(u.shape[0]), scratch(u.shape[0])
    copied(way.q[count - 1], current)
    copied(u, now)
    for _ in range(min(DRIVEN, round(float(way.lasts[()]) / dt))):
        size = 0.0
        for j in range(u.shape[0]):
            now[j] += min(max(way.driven[j] - now[j], -way.falling[j] * dt), way.rising[j] * dt)
            size += abs(now[j])
        hold(way.inputs, current, now, dt, ahead)
        copied(ahead, current)
        after += dt
        weight += dt
        gone += dt * size
        if gone > APART:
            way.after[count], way.weight[count] = after, weight
            copied(current, way.q[count])
            count += 1
            gone = 0.0
    step = braking_share(way.falling, way.rising, now, dt)
    for _ in range(BRAKING if brakes else 0):
        share -= step
        last = share <= 0.0
        if not last:
            for j in range(u.shape[0]):
                slower[j] = share * now[j]
            hold(way.inputs, current, slower, dt, ahead)
            copied(ahead, current)
            after += dt
            weight += share * dt
            gone += dt * share * size
        if gone > (0.0 if last else APART):
            way.after[count], way.weight[count] = after, weight
            copied(current, way.q[count])
            count += 1
            gone = 0.0
        if last:
            break
    way.stands[()] = count
    for k in range(way.later.shape[0]):
        if way.later[k] > after:
            way.after[count], way.weight[count] = way.later[k], way.weight[way.stands[()] - 1]
            copied(way.q[way.stands[()] - 1], way.q[count])
            count += 1
    way.looks[()] = count
    return count


@compiled
def reach(scene: PairArrays, way: SweptMotion, shape: int, x: float, y: float, z: float) -> float:
    """Extent of a shape along a direction in its axes, m; infinite where unknown."""
    if way.disc[shape] > 0.0:
        return way.disc[shape] * math.hypot(x, y) + scene.boxes[shape, 5] * abs(z)
    extent = -math.inf
    for c in range(scene.first_corner[shape], scene.first_corner[shape + 1]):
        extent = max(extent, x * scene.corners[c, 0] + y * scene.corners[c, 1] + z * scene.corners[c, 2])
    return extent + scene.rounding[shape] if extent > -math.inf else math.inf


@compiled
def renew(blocks: Blocks, way_blocks: Blocks, results: Array, places: Array, pair: int) -> None:
    """Take a pair's planes from Coal's result where the shapes are."""
    scene = views(PairArrays, blocks.integers, blocks.floats, 0)
    way = views(SweptMotion, way_blocks.integers, way_blocks.floats, 0)
    square = results[pair, 1] ** 2 + results[pair, 2] ** 2 + results[pair, 3] ** 2
    if not abs(square - 1.0) < 1e-9:  # no direction: crossing axes, centres that coincide
        return
    for side in range(2):
        shape = scene.pairs[pair, side]
        if shape >= scene.planes[()]:  # a half-space has one direction for good
            copied(scene.boxes[shape], way.planes[pair, side])
            continue
        for k in range(3):
            along = 0.0
            for i in range(3):
                along += places[shape, 3 * k + i] * results[pair, 1 + i]
            way.planes[pair, side, k] = along if side == 0 else -along
        x = way.planes[pair, side]
        way.planes[pair, side, 3] = reach(scene, way, shape, x[0], x[1], x[2])


@compiled
def gap(scene: PairArrays, way: SweptMotion, pair: int, ends: Array, enough: float = math.inf) -> float:
    """A lower bound of a pair's distance, m, rough above `enough`; ends (2, 12): where its shapes are. Of
    what was sensed and is nearer than `enough`, any number that is less."""
    best = -math.inf
    row = scene.sensed.row[scene.pairs[pair, 1]]
    if row >= 0:
        pose, nearest = scratch(12), scratch(6)
        into_axes(ends, 1, 0, pose)
        least, stop, shape = 0.0, -math.inf, scene.pairs[pair, 0]
        if math.isfinite(enough):
            least = stop = enough
        return float(placed_sensed(scene.sensed, row, pose, shape, enough, least, stop, nearest))
    for side in range(2):
        other = scene.pairs[pair, 1 - side]
        x = way.planes[pair, side]
        if math.isinf(x[3]) or other >= scene.planes[()]:
            continue
        n = scratch(3)
        apart = -x[3]
        for i in range(3):
            n[i] = ends[side, i] * x[0] + ends[side, 3 + i] * x[1] + ends[side, 6 + i] * x[2]
            apart += n[i] * (ends[1 - side, 9 + i] - ends[side, 9 + i])
        back = scratch(3)
        for k in range(3):
            back[k] = 0.0
            for i in range(3):
                back[k] -= ends[1 - side, 3 * k + i] * n[i]
        box = scene.boxes[other]  # often the box is enough, without its corners
        far = 0.0
        for k in range(3):
            far += back[k] * box[k] + abs(back[k]) * box[3 + k]
        if apart - far >= enough:
            return apart - far
        best = max(best, apart - reach(scene, way, other, back[0], back[1], back[2]))
    return best


@compiled
def unsure(blocks: Blocks, way_blocks: Blocks, listed: int, look: int, first: int) -> int:
    """The first listed pair, from a look and a place in `scene.risky` on, that may be too near: look times
    number of pairs, plus place; -1 where all are clear."""
    scene = views(PairArrays, blocks.integers, blocks.floats, 0)
    way = views(SweptMotion, way_blocks.integers, way_blocks.floats, 0)
    joints, ends = scratch((way.joints.parent.shape[0], 12)), scratch((2, 12))
    for i in range(look, way.looks[()]):
        stands = i >= way.stands[()]
        if i == look or not stands:
            place_joints(way.joints, way.q[i], joints)
        for k in range(first if i == look else 0, listed):
            pair = scene.risky[k]
            if stands and way.path[scene.pairs[pair, 1]] < 0:
                continue
            for side in range(2):
                shape = scene.pairs[pair, side]
                if way.path[shape] >= 0:
                    copied(way.paths[way.path[shape], i], ends[side])
                else:
                    compose(joints, way.carrier[shape], way.place, shape, ends, side)
            if gap(scene, way, pair, ends, scene.kept[pair]) < scene.kept[pair]:
                return i * scene.kept.shape[0] + k
    return -1


@compiled
def stray(scene: PairArrays, way: SweptMotion, places: Array, shape: int) -> float:
    """The farthest that a point of an obstacle is from where it is now, at any time of `later`, m."""
    farthest = 0.0
    box = scene.boxes[shape]
    for k in range(way.later.shape[0] if way.path[shape] >= 0 else 0):
        pose = way.grid[way.path[shape], k]
        moved = 0.0
        turned = 0.0
        for i in range(3):
            shift = pose[9 + i] - places[shape, 9 + i]
            for a in range(3):
                change = pose[3 * a + i] - places[shape, 3 * a + i]
                shift += change * box[a]
                turned += change * change
            moved += shift * shift
        farthest = max(farthest, math.sqrt(moved) + math.sqrt(turned) * box[6])
    return farthest


@compiled
def allow(scene: PairArrays, asked: float, target: float) -> None:
    """Set each pair's least distance: the target, or its present distance where that is less."""
    for k in range(scene.kept.shape[0]):
        d, aim, least = scene.bounds[k], target - scene.nearer[k], asked - scene.nearer[k]
        scene.kept[k] = aim if d >= aim else (d - 1e-9 if d < least else max(least, d - 1e-7))


@compiled
def list_risky(
    blocks: Blocks,
    way_blocks: Blocks,
    results: Array,
    places: Array,
    J: Array,
    q_dot: Array,
    u: Array,
    dt: float,
    asked: float,
    target: float,
    listed: int,
) -> int:
    """Add to the `listed` pairs of `scene.risky` those that could come too near; return the count.
    J (n, 6) : twists about the world's origin; q_dot (n,) and u, which last for dt and then brake"""
    scene = views(PairArrays, blocks.integers, blocks.floats, 0)
    way = views(SweptMotion, way_blocks.integers, way_blocks.floats, 0)
    if listed == 0:
        allow(scene, asked, target)
        clear(scene.watched)
        for i in range(way.carrier.shape[0]):
            if way.path[i] == -1:
                copied(places[i], way.place[i])
    time = dt + 0.5 * dt / braking_share(way.falling, way.rising, u, dt)
    count, n = scene.supports.shape
    moved, total = scratch((count, n)), scratch(count)
    for i in range(count):
        total[i] = 0.0
        if i >= scene.planes[()]:
            continue
        radius, centre = scene.boxes[i, 6], scratch(3)
        for k in range(3):
            centre[k] = places[i, 9 + k]
            for a in range(3):
                centre[k] += places[i, 3 * a + k] * scene.boxes[i, a]
        x, y, z = centre[0], centre[1], centre[2]
        for c in range(n):
            moved[i, c] = 0.0
            if scene.supports[i, c] == 0.0 or q_dot[c] == 0.0:
                continue
            a, b, w = J[c, 3], J[c, 4], J[c, 5]
            u = J[c, 0] + b * z - w * y
            v = J[c, 1] + w * x - a * z
            r = J[c, 2] + a * y - b * x
            turn = math.sqrt(a * a + b * b + w * w)
            lever = math.sqrt(u * u + v * v + r * r) + turn * radius
            moved[i, c] = LEVERS * abs(q_dot[c]) * time * lever
            total[i] += moved[i, c]
    strays = scratch(count)
    for i in range(count):
        strays[i] = stray(scene, way, places, i)
    for k in range(scene.pairs.shape[0]):
        if scene.watched[k] == 1:
            continue
        i, j = scene.pairs[k, 0], scene.pairs[k, 1]
        room = scene.bounds[k] - scene.kept[k]
        by_first = 0.0
        by_second = 0.0
        few = room >= total[i] + (total[j] if j < scene.planes[()] else 0.0)
        for c in range(0 if few else n):
            if scene.apart[k, c] > 0.0:
                by_first += moved[i, c]
                by_second += (
                    moved[j, c] if j < scene.planes[()] and scene.supports[j, c] > 0.0 else moved[i, c]
                )
        t = scene.twists[j]
        speed = math.sqrt(t[0] * t[0] + t[1] * t[1] + t[2] * t[2])
        turn = math.sqrt(t[3] * t[3] + t[4] * t[4] + t[5] * t[5])
        if turn > 0.0:
            square = 0.0
            for a in range(3):
                square += (places[i, 9 + a] - places[j, 9 + a]) ** 2
            speed += turn * (math.sqrt(square) + 2.0 * scene.boxes[i, 6])
        if room < max(by_first, by_second) + max(time * speed, strays[j]):
            scene.watched[k] = 1
            scene.risky[listed] = k
            listed += 1
            if scene.active[k] == 1:
                renew(blocks, way_blocks, results, places, k)
    return listed
