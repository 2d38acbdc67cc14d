"""Two trees of configurations that grow towards each other, compiled.

J. J. Kuffner, S. M. LaValle, RRT-Connect: an efficient approach to single-query path planning, ICRA 2000. The
tree from the start and the one from the goals take turns: one grows a step towards a random configuration,
the other then as far as it can towards the new one. Motions between configurations are the platform's ways
(`nmm.plugins.planning.ways`).

OMPL has this search, too. Its Python interface (2.0.1) hides the parts of its words, so that compiled code
cannot look at a motion. Reading a state and the length of a word takes 14 µs from Python; a compiled look at
all 157 pairs of a UR5 on a car takes 6, one at the pairs that are due along a motion 3.
"""

import math
from typing import NamedTuple

from nmm.base.arrays import Array, Integers
from nmm.base.kernels.compiled import compiled, compiled_without_gil, scratch
from nmm.base.kernels.linear_algebra import copied
from nmm.base.kernels.record_layout import (
    BLOCKS,
    Cell,
    IntegerMatrix,
    IntegerVector,
    Matrices,
    Vector,
    header_length,
    views,
)
from nmm.base.kernels.signatures import float64, int64
from nmm.base.kernels.velocity_map import place_mimic_joints
from nmm.plugins.planning.collisions.legs_check import MovedShapes, along, first_blocked, too_near
from nmm.plugins.planning.ways import Ways, find_way, least_time, leg_time, way_time

#: Of random configurations, the share whose arm is between those of a start and a goal.
BETWEEN = 0.5
#: A round of a search adds fewer configurations than this.
SPARE = 200
#: The multiplier and the modulus of the random numbers (S. K. Park, K. W. Miller, 1988).
MULTIPLIER, MODULUS = 48271, 2**31 - 1


class Trees(NamedTuple):
    """The tree from the start (0) and that from the goals (1), each with room for K configurations.

    ways : the platform's
    low, high (n,) : where random configurations are drawn, m and rad
    step () : the longest motion by which a tree grows, s
    nodes (2, K, n), parents (2, K), counts (2,) : configurations; the one before, -1 of a root; how many
        there are
    roots (2,) : how many of them are roots
    random (1,) : the last random number; met (2,) : the two that are connected; looked (2,) : motions and
    configurations looked at
    rounds (1,) : of the search that goes on
    """

    ways: Ways
    low: Vector
    high: Vector
    step: Cell
    nodes: Matrices
    parents: IntegerMatrix
    counts: IntegerVector
    roots: IntegerVector
    random: IntegerVector
    met: IntegerVector
    looked: IntegerVector
    rounds: IntegerVector


#: Where the record lies: after the shapes'.
PLACE = header_length(MovedShapes)


@compiled
def draw(state: Integers) -> float:
    """A random number in (0, 1)."""
    state[0] = (MULTIPLIER * state[0]) % MODULUS
    return float(state[0]) / MODULUS


@compiled
def draw_configuration(trees: Trees, planar: int, mimic_joints: Array, q: Array) -> None:
    for i in range(q.shape[0]):
        q[i] = trees.low[i] + draw(trees.random) * (trees.high[i] - trees.low[i])
    if draw(trees.random) < BETWEEN:
        a = int(draw(trees.random) * trees.roots[0])
        b = int(draw(trees.random) * trees.roots[1])
        share = draw(trees.random)
        for i in range(3 * planar, q.shape[0]):
            q[i] = (1.0 - share) * trees.nodes[0, a, i] + share * trees.nodes[1, b, i]
    if trees.ways.steering[()] >= 0:
        q[trees.ways.steering[()]] = 0.0
    place_mimic_joints(q, mimic_joints)


@compiled
def way_between(ways: Ways, tree: int, node: Array, q: Array, legs: Array) -> int:
    """From a node to q, or from q to a node of the goals' tree: motions go from the start to the goals."""
    return find_way(ways, node, q, legs) if tree == 0 else find_way(ways, q, node, legs)


@compiled
def nearest_node(trees: Trees, tree: int, q: Array, legs: Array) -> int:
    """The node of a tree with the shortest way to q, or from q; few of these are computed."""
    best, nearest = math.inf, -1
    for i in range(trees.counts[tree]):
        node = trees.nodes[tree, i]
        if least_time(trees.ways, node, q) >= best:
            continue
        time = way_time(trees.ways, legs, way_between(trees.ways, tree, node, q, legs))
        if time < best:
            best, nearest = time, i
    return nearest


@compiled
def grow(
    scene: MovedShapes, integers: Integers, floats: Array, trees: Trees, tree: int, q: Array, legs: Array
) -> int:
    """Add a node that is one step nearer to q (n,), written there. 1 where it is q, 0 before, -1 where
    blocked."""
    ways, planar, mimic_joints = trees.ways, scene.planar[()], scene.mimic_joints
    near = nearest_node(trees, tree, q, legs)
    node = trees.nodes[tree, near]
    count = way_between(ways, tree, node, q, legs)
    total = 0.0
    for k in range(count):
        total += leg_time(ways, legs[k])
    arrived, current, ahead = total <= trees.step[()], scratch(q.shape[0]), scratch(q.shape[0])
    if not arrived:
        left = trees.step[()] if tree == 0 else total - trees.step[()]
        copied(node if tree == 0 else q, current)
        for k in range(count):
            time = leg_time(ways, legs[k])
            share = min(1.0, left / time) if time > 0.0 else 1.0
            along(planar, current, legs[k], share, mimic_joints, ahead)
            copied(ahead, current)
            left -= time
            if left <= 0.0:
                break
        copied(current, q)
        if ways.steering[()] >= 0:
            q[ways.steering[()]] = 0.0
        count = way_between(ways, tree, node, q, legs)
    trees.looked[1] += 1
    if too_near(scene, q) >= 0:
        return -1
    trees.looked[0] += 1
    if first_blocked(integers, floats, node if tree == 0 else q, legs, count, ahead) >= 0:
        return -1
    new = trees.counts[tree]
    copied(q, trees.nodes[tree, new])
    trees.parents[tree, new] = near
    trees.counts[tree] = new + 1
    return 1 if arrived else 0


@compiled_without_gil
def search(integers: Integers, floats: Array, rounds: int, legs: Array) -> int:
    """Grow the trees until they meet (1), or their rounds are a multiple of these (0); -1 where there is no
    room. What comes of more calls does not depend on the room that there was in each."""
    scene = views(MovedShapes, integers, floats, 0)
    trees = views(Trees, integers, floats, PLACE)
    n = trees.low.shape[0]
    q = scratch(n)
    target = scratch(n)
    while max(trees.counts[0], trees.counts[1]) + SPARE < trees.parents.shape[1]:
        tree = trees.rounds[0] % 2
        trees.rounds[0] += 1
        draw_configuration(trees, scene.planar[()], scene.mimic_joints, q)
        status = grow(scene, integers, floats, trees, tree, q, legs)
        new = trees.counts[tree] - 1
        if status >= 0:
            for _ in range(100):
                copied(trees.nodes[tree, new], target)
                status = grow(scene, integers, floats, trees, 1 - tree, target, legs)
                if status != 0:
                    break
            if status == 1:
                trees.met[tree] = new
                trees.met[1 - tree] = trees.counts[1 - tree] - 1
                return 1
        if trees.rounds[0] % rounds == 0:
            return 0
    return -1


SEARCH = int64(*BLOCKS.types, int64, float64[:, ::1])
