"""How a tractor with trailers gets from one configuration to another, compiled: two trees of driven words.

No words are known for trailers. The tractor's words of arcs and lines (Dubins) are driven, and the hitches'
angles are integrated along. Driven forwards they settle; backwards they run away. A way backwards to a goal
is therefore one that is driven forwards from it, reversed in time, as q̇ = S(q) u may be. The trees join where
a word leads from a node of one to the tractor's pose of a node of the other and the hitches' angles differ
little. What differs there, and rests at cusps, `nmm.plugins.planning.smoothing` takes away.
"""

import math
from typing import NamedTuple

from nmm.base.arrays import Array, Integers
from nmm.base.kernels.compiled import clear, compiled, compiled_without_gil, scratch
from nmm.base.kernels.linear_algebra import copied
from nmm.base.kernels.record_layout import (
    BLOCKS,
    Cell,
    IntegerCell,
    IntegerMatrix,
    IntegerVector,
    Matrices,
    Matrix,
    Tensors,
    Vector,
    views,
)
from nmm.base.kernels.signatures import float64, int64
from nmm.model.robots.zero_order_hold import Inputs
from nmm.plugins.planning.collisions.legs_check import MovedShapes, too_near
from nmm.plugins.planning.samples import flow
from nmm.plugins.planning.tree import draw
from nmm.plugins.planning.words import PARTS, STRAIGHT, dubins, wrapped

#: A motion has the three parts of a word of Dubins, and a straight line after them.
DRIVEN = 4
#: Configurations are looked at so far apart along a motion, m.
SPACING = 0.1
#: Of the motions that a tree grows by, the share driven the other way, and the share of straight lines.
AGAINST, LINES = 0.25, 0.2
#: Words to the other tree that are tried for each new node, the shortest first.
JOINED = 6
#: Hitches' angles may differ by so much where trees join, rad.
APART = 0.3


class Trains(NamedTuple):
    """The tree from the start (0) and that from the goals (1), each with room for K configurations of n.

    inputs : what they move; radius () : of arcs, m; folds (trailers, 2) : limits of hitches, rad
    low, high (3,) : where poses are drawn, m and rad; far (), line () : the longest words and the straight
        lines by which a tree grows, m
    reverses () : 1 for a tractor that may; loose () : 1 where the goals' hitches may have any angle
    nodes (2, K, n), parents (2, K), counts (2,) : configurations; the one before, -1 of a root; how many
    driven (2, K, DRIVEN, 2) : turn and length, m, of what is driven from the parent, reversed in time in the
        goals' tree; lengths (2, K) : of all that from the root, m
    random (1,) : the last random number; joint (DRIVEN, 2) : what joins the trees, driven from a node of the
        tree `met[2]`; met (3,) : its nodes; shortest () : length of the whole way, m, infinite before there
        is one; tried (W,) : lengths of ways that are not to be found again, m
    """

    inputs: Inputs
    radius: Cell
    folds: Matrix
    low: Vector
    high: Vector
    far: Cell
    line: Cell
    reverses: IntegerCell
    loose: IntegerCell
    nodes: Matrices
    parents: IntegerMatrix
    counts: IntegerVector
    driven: Tensors
    lengths: Matrix
    random: IntegerVector
    joint: Matrix
    met: IntegerVector
    shortest: Cell
    tried: Vector


@compiled
def copy_motion(source: Array, target: Array) -> None:
    for part in range(DRIVEN):
        copied(source[part], target[part])


@compiled
def roll_on(trains: Trains, q: Array, turn: float, length: float, ahead: Array) -> None:
    """ahead (n,): q after a piece of an arc or line."""
    m = 2 + trains.inputs.moved.shape[0]
    u, a, none = scratch(m), scratch(m), scratch((q.shape[0], 0))
    clear(u)
    clear(a)
    u[0] = 1.0 if length >= 0.0 else -1.0
    u[1] = u[0] * turn / trains.radius[()]
    flow(trains.inputs, q, u, a, abs(length), 1, ahead, none)


@compiled
def pieces(length: float) -> int:
    return math.ceil(abs(length) / SPACING)


@compiled
def drive(scene: MovedShapes, trains: Trains, q: Array, motion: Array, ahead: Array) -> int:
    """ahead (n,): where a motion (DRIVEN, 2) leads from q; 0 where it folds or comes too near."""
    current = scratch(q.shape[0])
    copied(q, ahead)
    for part in range(DRIVEN):
        count = pieces(motion[part, 1])
        for _ in range(count):
            copied(ahead, current)
            roll_on(trains, current, motion[part, 0], motion[part, 1] / count, ahead)
            for i in range(trains.folds.shape[0]):
                if not trains.folds[i, 0] <= ahead[3 + i] <= trains.folds[i, 1]:
                    return 0
            if too_near(scene, ahead) >= 0:
                return 0
    return 1


@compiled
def find_word(trains: Trains, a: Array, b: Array, way: float, motion: Array) -> float:
    """Write the word from a to b, forwards (way 1) or backwards (-1); returns its length, m."""
    radius, word = trains.radius[()], scratch((PARTS, 2))
    c, s = math.cos(a[2]), math.sin(a[2])
    x, y = (c * (b[0] - a[0]) + s * (b[1] - a[1])) / radius, (c * (b[1] - a[1]) - s * (b[0] - a[0])) / radius
    length = dubins(way * x, y, wrapped(way * (b[2] - a[2])), word)
    clear(motion)
    for part in range(3):
        motion[part, 0], motion[part, 1] = word[part, 0], way * radius * word[part, 1]
    return radius * length


@compiled
def cut(motion: Array, most: float) -> float:
    """Leave what of a motion is within a length; returns its length."""
    total = 0.0
    for part in range(DRIVEN):
        length = min(abs(motion[part, 1]), most - total)
        motion[part, 1] = math.copysign(length, motion[part, 1])
        total += length
    return total


@compiled
def draw_way(trains: Trains, tree: int) -> float:
    """1 or -1: forwards from a node or backwards. In the goals' tree that is driven the other way."""
    if trains.reverses[()] == 0:
        return 1.0 if tree == 0 else -1.0
    return -1.0 if draw(trains.random) < AGAINST else 1.0


@compiled
def grow(scene: MovedShapes, trains: Trains, tree: int) -> int:
    """Add a node; 0 where the way there is blocked or folds."""
    way, count = draw_way(trains, tree), trains.counts[tree]
    pose, word, motion = scratch(3), scratch((DRIVEN, 2)), scratch((DRIVEN, 2))
    clear(motion)
    for i in range(3):
        pose[i] = trains.low[i] + draw(trains.random) * (trains.high[i] - trains.low[i])
    near, lines = 0, int(3.0 * draw(trains.random))
    if draw(trains.random) < LINES:
        near, lines = int(draw(trains.random) * count), lines + 1
    else:
        shortest = math.inf
        for i in range(count):
            node = trains.nodes[tree, i]
            if math.hypot(pose[0] - node[0], pose[1] - node[1]) < shortest:
                length = find_word(trains, node, pose, way, word)
                if length < shortest:
                    shortest, near = length, i
                    copy_motion(word, motion)
        cut(motion, draw(trains.random) * trains.far[()])
    motion[3, 0], motion[3, 1] = STRAIGHT, way * trains.line[()] * lines
    if drive(scene, trains, trains.nodes[tree, near], motion, trains.nodes[tree, count]) == 0:
        return 0
    copy_motion(motion, trains.driven[tree, count])
    trains.parents[tree, count] = near
    trains.lengths[tree, count] = trains.lengths[tree, near] + cut(motion, math.inf)
    trains.counts[tree] = count + 1
    return 1


@compiled
def fits(trains: Trains, q: Array, from_tree: int, node: int) -> bool:
    """Whether the hitches at q have the angles of the node of the other tree, about."""
    if from_tree == 0 and trains.loose[()] == 1 and trains.parents[1, node] < 0:
        return True
    for i in range(trains.folds.shape[0]):
        if abs(q[3 + i] - trains.nodes[1 - from_tree, node, 3 + i]) > APART:
            return False
    return True


@compiled
def known(trains: Trains, total: float) -> bool:
    """Whether a way of this length was tried."""
    tried = False
    for k in range(trains.tried.shape[0]):
        tried = tried or abs(total - trains.tried[k]) < 1e-6
    return tried


@compiled
def join(scene: MovedShapes, trains: Trains, tree: int, new: int) -> None:
    """Try words between a node and nodes of the other tree, driven forwards from one of them, in time or
    reversed."""
    motion, ahead = scratch((DRIVEN, 2)), scratch(trains.nodes.shape[2])
    totals, others = scratch(JOINED), scratch(JOINED)
    for from_tree in range(1 + trains.reverses[()]):
        for k in range(JOINED):
            totals[k] = math.inf
        for i in range(trains.counts[1 - tree]):
            a, b = (new, i) if tree == from_tree else (i, new)
            total = trains.lengths[tree, new] + trains.lengths[1 - tree, i]
            start, end = trains.nodes[from_tree, a], trains.nodes[1 - from_tree, b]
            most = min(trains.shortest[()], totals[JOINED - 1])
            if total + math.hypot(start[0] - end[0], start[1] - end[1]) >= most:
                continue
            total += find_word(trains, start, end, 1.0, motion)
            if total < most and not known(trains, total):
                k = JOINED - 1
                while k > 0 and totals[k - 1] > total:
                    totals[k], others[k] = totals[k - 1], others[k - 1]
                    k -= 1
                totals[k], others[k] = total, float(i)
        for k in range(JOINED):
            if totals[k] == math.inf:
                break
            i = int(others[k])
            a, b = (new, i) if tree == from_tree else (i, new)
            find_word(trains, trains.nodes[from_tree, a], trains.nodes[1 - from_tree, b], 1.0, motion)
            if drive(scene, trains, trains.nodes[from_tree, a], motion, ahead) == 1 and fits(
                trains, ahead, from_tree, b
            ):
                trains.shortest[()] = totals[k]
                trains.met[from_tree], trains.met[1 - from_tree], trains.met[2] = a, b, from_tree
                copy_motion(motion, trains.joint)
                break


@compiled_without_gil
def search_trains(
    integers: Integers, floats: Array, own_integers: Integers, own_floats: Array, rounds: int
) -> int:
    """Grow the trees for so many rounds; how many there were before there is no room."""
    scene = views(MovedShapes, integers, floats, 0)
    trains = views(Trains, own_integers, own_floats, 0)
    if trains.counts[0] == 1:
        join(scene, trains, 0, 0)
    for k in range(rounds):
        tree = k % 2
        if trains.counts[tree] == trains.parents.shape[1]:
            return k
        if grow(scene, trains, tree) == 1:
            join(scene, trains, tree, trains.counts[tree] - 1)
    return rounds


@compiled
def trace(own_integers: Integers, own_floats: Array, q: Array, motion: Array, out: Array) -> int:
    """Where a motion leads from q (n,), piece by piece: rows of out (K, n); returns their number."""
    trains, count = views(Trains, own_integers, own_floats, 0), 0
    for part in range(DRIVEN):
        many = pieces(motion[part, 1])
        for _ in range(many):
            before = q if count == 0 else out[count - 1]
            roll_on(trains, before, motion[part, 0], motion[part, 1] / many, out[count])
            count += 1
    return count


_FLAT, _ROWS = float64[::1], float64[:, ::1]
SEARCH = int64(*BLOCKS.types, *BLOCKS.types, int64)
TRACE = int64(*BLOCKS.types, _FLAT, _ROWS, _ROWS)
