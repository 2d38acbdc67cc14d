"""Whether a motion keeps its distances, by conservative advancement, compiled.

At clearance d no point of the robot may be nearer than d before it has moved that far. So a pair of shapes
that is d apart needs no look before the motion could have brought the two d nearer to each other, and
touching between two looks is impossible (B. Mirtich, Impulse-based dynamic simulation of rigid body systems,
1996, chapter 2). Along a leg, how fast the two come nearer now and how much that can change say more.

A *leg* is a motion along which the platform's twist in its own axes and the rates of all joints are constant:
an arc or a straight line of the base while the arm moves straight in its coordinates. A row of numbers:
[twist (3), dq (n)], what it goes in all, of which dq has no numbers for x, y and theta.
"""

import math
from typing import NamedTuple

from nmm.base.arrays import Array, Integers
from nmm.base.kernels.compiled import clear, compiled, scratch
from nmm.base.kernels.kinematics import Joints, axes, compose, moved, place_joints
from nmm.base.kernels.linear_algebra import copied, dot, norm
from nmm.base.kernels.record_layout import IntegerCell, IntegerVector, Matrix, Vector, views
from nmm.base.kernels.velocity_map import place_mimic_joints
from nmm.model.collisions.elements.nearest import sensed_bound
from nmm.model.collisions.elements.shapes_record import SensedShapes
from nmm.model.collisions.separation import ConvexShapes, extreme, separation

#: Pairs within this beyond their distance count as too near, m: else motions along a wall take looks without
#: end.
MARGIN = 5e-4
#: A turn this small along a leg is none, rad.
STRAIGHT = 1e-9
#: A platform is beyond where it stays by more than this, m and rad.
STAYS = 1e-9


class MovedShapes(NamedTuple):
    """A robot's shapes among obstacles.

    shapes : the robot's, then the obstacles'; joints, mimic_joints : the robot's
    planar () : 1 where q begins with x, y, theta
    carrier (G,), place (G, 12) : a shape's joint, and its place there; an obstacle's is in the world
    levers (P, 3 + n) : how far a unit of each number of a leg can move the two of a pair to each other, m
    stems (P, 3 + n) : of a joint between two of the robot's shapes, how far from it the shape that it does
        not move can reach, m; else infinite
    kept (P,) : distances to keep, m; stays (3, 2) : where a platform's x, y and theta stay, m and rad
    drift (P,) : how far the obstacle of a pair moves at most during the motion that is looked at, m
    sensed : obstacles that were sensed
    until (P,), fastest (P,), bends (P,) : while a leg is looked at, how much of it is surely free; `approach`
        and, once it was asked for, `bend`
    places (G, 12), centres (G, 3) : where shapes are, and the centres of their boxes, in the world
    """

    shapes: ConvexShapes
    joints: Joints
    mimic_joints: Vector
    planar: IntegerCell
    carrier: IntegerVector
    place: Matrix
    levers: Matrix
    stems: Matrix
    kept: Vector
    stays: Matrix
    drift: Vector
    until: Vector
    fastest: Vector
    bends: Vector
    places: Matrix
    centres: Matrix
    sensed: SensedShapes


@compiled
def along(planar: int, q: Array, leg: Array, share: float, mimic_joints: Array, out: Array) -> None:
    """out (n,): where a share of a leg leads from q."""
    for i in range(q.shape[0]):
        out[i] = q[i] + share * leg[3 + i]
    if planar == 1:
        turn, c, s = share * leg[2], math.cos(q[2]), math.sin(q[2])
        x, y = share * leg[0], share * leg[1]
        if abs(leg[2]) > STRAIGHT:
            a, b = math.sin(turn) / leg[2], (1.0 - math.cos(turn)) / leg[2]
            x, y = a * leg[0] - b * leg[1], b * leg[0] + a * leg[1]
        out[0] = q[0] + c * x - s * y
        out[1] = q[1] + s * x + c * y
        out[2] = q[2] + turn
    place_mimic_joints(out, mimic_joints)


@compiled
def place_shape(scene: MovedShapes, joints: Array, shape: int) -> None:
    """Where a shape is while the joints (J, 12) are there."""
    places, boxes = scene.places, scene.shapes.boxes
    compose(joints, scene.carrier[shape], scene.place, shape, places, shape)
    for k in range(3):
        scene.centres[shape, k] = places[shape, 9 + k]
        for i in range(3):
            scene.centres[shape, k] += places[shape, 3 * i + k] * boxes[shape, i]


@compiled
def placed_bound(scene: MovedShapes, pair: int, enough: float, least: float) -> float:
    """A lower bound of the distance of a pair where its shapes were placed; rough above `enough`, and above
    `least` as `separation` is; of what was sensed, any number below the sum of `least` and MARGIN where the
    distance is. Where `least` is nan, the direction is asked for: it follows a pair from farther away."""
    shapes, places, centres = scene.shapes, scene.places, scene.centres
    i, j = shapes.pairs[pair, 0], shapes.pairs[pair, 1]
    if j < shapes.planes[()]:
        square = beyond = 0.0
        for axis in range(3):
            d = centres[i, axis] - centres[j, axis]
            square += d * d
            off = 0.0
            for k in range(3):
                off += places[j, 3 * axis + k] * (centres[i, k] - centres[j, k])
            outside = max(abs(off) - shapes.boxes[j, 3 + axis], 0.0)
            beyond += outside * outside
        # Between the balls around both, and between the first one's and the second one's box.
        apart = math.sqrt(square) - shapes.boxes[j, 6] - shapes.boxes[i, 6]
        if not math.isnan(least):
            apart = max(apart, math.sqrt(beyond) - shapes.boxes[i, 6])
        if apart >= enough:
            return apart
    if scene.sensed.row[j] >= 0:
        exact, stop = enough, -math.inf
        if not math.isnan(least):
            exact = stop = least + MARGIN
        return sensed_bound(scene.sensed, places, i, j, enough, exact, stop, shapes.between[pair])
    return separation(shapes, places, pair, enough, least)


@compiled
def pair_bound(scene: MovedShapes, joints: Array, pair: int, enough: float, least: float) -> float:
    """`placed_bound` where the joints (J, 12) are."""
    place_shape(scene, joints, scene.shapes.pairs[pair, 0])
    place_shape(scene, joints, scene.shapes.pairs[pair, 1])
    return placed_bound(scene, pair, enough, least)


@compiled
def write_direction(scene: MovedShapes, pair: int, d: Array) -> None:
    """d (3,): the direction from the second to the first that separates a pair, just looked at."""
    j = scene.shapes.pairs[pair, 1]
    for k in range(3):
        d[k] = scene.shapes.between[pair, k]
    if j >= scene.shapes.planes[()]:
        for k in range(3):
            d[k] = 0.0
            for i in range(3):
                d[k] += scene.places[j, 3 * i + k] * scene.shapes.boxes[j, i]


@compiled
def write_approach(scene: MovedShapes, joints: Array, twists: Array, pair: int, out: Array) -> None:
    """Add the derivative of `placed_bound`, just computed, by q to out (n, ...): along the direction that
    separates the two, of the points farthest along it."""
    shapes, places, table = scene.shapes, scene.places, scene.joints
    d, point, v = scratch(3), scratch(3), scratch(3)
    write_direction(scene, pair, d)
    for side in range(2):
        shape = shapes.pairs[pair, side]
        joint, sign = scene.carrier[shape], 1.0 if side == 0 else -1.0
        if joint == 0:
            continue
        extreme(shapes, places, shape, d, -sign, 2 * pair + side, point)
        while joint > 0:
            moved(joints, twists, joint, point[0], point[1], point[2], v)
            out[table.coordinate[joint]] += sign * (d[0] * v[0] + d[1] * v[1] + d[2] * v[2])
            joint = table.parent[joint]


@compiled
def too_near(scene: MovedShapes, q: Array) -> int:
    """The first pair that is too near at q, or -1."""
    joints = scratch((scene.joints.parent.shape[0], 12))
    place_joints(scene.joints, q, joints)
    for shape in range(scene.carrier.shape[0]):
        place_shape(scene, joints, shape)
    for pair in range(scene.kept.shape[0]):
        least = scene.kept[pair]
        if placed_bound(scene, pair, least + MARGIN, least) < least + MARGIN:
            return pair
    return -1


@compiled
def approach(scene: MovedShapes, pair: int, leg: Array, apart: float) -> float:
    """The most by which a pair, so far apart, can come nearer per share of a leg, m.

    A point that a joint turns moves by its distance from the joint. One that is to come near the other shape
    is not farther from the joint than that shape reaches, and than the two are apart, together."""
    rate = (
        scene.drift[pair]
        + scene.levers[pair, 0] * math.hypot(leg[0], leg[1])
        + scene.levers[pair, 2] * abs(leg[2])
    )
    for c in range(3, leg.shape[0]):
        rate += abs(leg[c]) * min(scene.levers[pair, c], scene.stems[pair, c] + max(apart, 0.0))
    return rate


@compiled
def bend(scene: MovedShapes, pair: int, leg: Array) -> float:
    """The most by which the speed of a point of a pair's shapes changes along a leg, m: a joint turns what
    those before it turn, too."""
    turned, most = abs(leg[2]) if scene.levers[pair, 2] > 0.0 else 0.0, 0.0
    most += turned * (scene.levers[pair, 0] * math.hypot(leg[0], leg[1]) + scene.levers[pair, 2] * turned)
    for c in range(3, leg.shape[0]):
        if scene.levers[pair, c] > 0.0:
            rate = abs(leg[c])
            most += scene.levers[pair, c] * rate * (rate + 2.0 * turned)
            turned += rate
    return most


@compiled
def speed_towards(scene: MovedShapes, q: Array, leg: Array, joints: Array, twists: Array, pair: int) -> float:
    """How fast a pair's points come nearer, at most, along the direction that separates them, at q on a leg:
    m per share of it. A point's speed along a direction is linear in its place, so one of a shape's
    extreme points has the largest."""
    shapes, table = scene.shapes, scene.joints
    d, turn, point = scratch(3), scratch(3), scratch(3)
    write_direction(scene, pair, d)
    fastest = 0.0
    for side in range(2):
        shape, sign = shapes.pairs[pair, side], -1.0 if side == 0 else 1.0
        joint, speed = scene.carrier[shape], 0.0
        clear(turn)
        while joint > 0:
            k = table.coordinate[joint]
            own = scene.planar[()] == 1 and k < 3
            rate = leg[k if own else 3 + k]
            if own and k < 2:  # of the platform's twist in its own axes
                c, s = math.cos(q[2]), math.sin(q[2])
                rate = c * leg[0] - s * leg[1] if k == 0 else s * leg[0] + c * leg[1]
            if scene.levers[pair, k if own else 3 + k] > 0.0:
                for i in range(3):
                    # d · (ω × (p - o)) = (p - o) · (d × ω)
                    a, b = (i + 1) % 3, (i + 2) % 3
                    across = rate * (d[a] * twists[joint, 3 + b] - d[b] * twists[joint, 3 + a])
                    turn[i] += across
                    speed += rate * d[i] * twists[joint, i] - across * joints[joint, 9 + i]
            joint = table.parent[joint]
        if scene.carrier[shape] > 0:
            slot = 2 * (shapes.pairs.shape[0] + pair) + side
            extreme(shapes, scene.places, shape, turn, sign, slot, point)
            fastest += sign * (speed + dot(turn, point)) + shapes.rounding[shape] * norm(turn)
    return fastest


@compiled
def begin_motion(scene: MovedShapes, leg: Array) -> None:
    """Forget what was known of a motion before; no number changes faster on this one than along the leg."""
    for pair in range(scene.kept.shape[0]):
        scene.fastest[pair], scene.bends[pair] = approach(scene, pair, leg, math.inf), -1.0
        scene.until[pair] = 0.0 if scene.fastest[pair] > 0.0 else math.inf


@compiled
def look(scene: MovedShapes, q: Array, leg: Array, share: float, joints: Array, steady: int) -> float:
    """Look at the pairs that are due at a share of a motion, which is at q: until where it is surely free, or
    -1 less the number of a pair that is too near. steady: 1 where the motion is along the leg, 0 where its
    rates are no larger."""
    twists = scratch((joints.shape[0], 6))
    place_joints(scene.joints, q, joints)
    following, turning = math.inf, 0
    for pair in range(scene.kept.shape[0]):
        if scene.until[pair] <= share:
            least = scene.kept[pair]
            enough = least + MARGIN + scene.fastest[pair] * (1.0 - share)
            apart = pair_bound(scene, joints, pair, enough, least)
            if apart < least + MARGIN:
                return -1.0 - pair
            free = (apart - least) / approach(scene, pair, leg, apart)
            # The second is of convex shapes: of points that were sensed each has a direction of its own.
            convex = scene.sensed.row[scene.shapes.pairs[pair, 1]] < 0
            if steady == 1 and convex and share + free < 1.0:
                if turning == 0:
                    axes(scene.joints, joints, twists)
                    turning = 1
                speed = speed_towards(scene, q, leg, joints, twists, pair)
                if scene.bends[pair] < 0.0:
                    scene.bends[pair] = bend(scene, pair, leg)
                root = math.sqrt(speed * speed + 2.0 * (apart - least) * scene.bends[pair])
                free = max(free, 2.0 * (apart - least) / max(speed + root, 1e-12))
            scene.until[pair] = share + free
        following = min(following, scene.until[pair])
    return following


@compiled
def leg_blocked(scene: MovedShapes, q: Array, leg: Array) -> int:
    """The pair that comes too near on a leg from q, which is free itself; -1 where none does."""
    current, joints = scratch(q.shape[0]), scratch((scene.joints.parent.shape[0], 12))
    begin_motion(scene, leg)
    share = 0.0
    while 0.0 <= share < 1.0:
        along(scene.planar[()], q, leg, share, scene.mimic_joints, current)
        share = look(scene, current, leg, share, joints, 1)
    return -1 if share >= 0.0 else int(-1.0 - share)


@compiled
def leaves(scene: MovedShapes, q: Array, leg: Array) -> bool:
    """Whether the platform leaves where it stays on a leg from q: at its end, or where an arc's x or y turns
    round."""
    point = scratch(q.shape[0])
    for axis in range(3):
        low, high = scene.stays[axis, 0] - STAYS, scene.stays[axis, 1] + STAYS
        if math.isinf(low) and math.isinf(high):
            continue
        along(1, q, leg, 1.0, scratch(0), point)
        if not low <= point[axis] <= high:
            return True
        if axis == 2 or abs(leg[2]) <= STRAIGHT:
            continue
        # x turns round where the velocity, along q[2] + turn + atan2(leg[1], leg[0]), is across it.
        across = (0.5 * math.pi if axis == 0 else 0.0) - q[2] - math.atan2(leg[1], leg[0])
        begin, end = min(0.0, leg[2]), max(0.0, leg[2])
        turn = across - math.pi * math.floor((across - begin) / math.pi)
        while turn < end:
            along(1, q, leg, turn / leg[2], scratch(0), point)
            if not low <= point[axis] <= high:
                return True
            turn += math.pi
    return False


@compiled
def first_blocked(integers: Integers, floats: Array, q: Array, legs: Array, count: int, end: Array) -> int:
    """The first pair that is too near on the first `count` of legs (L, 3 + n) from q, their number where the
    platform leaves where it stays, or -1; end (n,): where they lead."""
    scene = views(MovedShapes, integers, floats, 0)
    current = scratch(q.shape[0])
    copied(q, end)
    if scene.planar[()] == 1:
        for i in range(count):
            if leaves(scene, end, legs[i]):
                return scene.kept.shape[0]
            along(1, end, legs[i], 1.0, scene.mimic_joints, current)
            copied(current, end)
        copied(q, end)
    for i in range(count):  # most motions that are blocked are so at the middle or the end of a leg, too
        for share in (0.5, 1.0):
            along(scene.planar[()], end, legs[i], share, scene.mimic_joints, current)
            pair = too_near(scene, current)
            if pair >= 0:
                return pair
        copied(current, end)
    copied(q, end)
    for i in range(count):
        pair = leg_blocked(scene, end, legs[i])
        if pair >= 0:
            return pair
        along(scene.planar[()], end, legs[i], 1.0, scene.mimic_joints, current)
        copied(current, end)
    return -1
