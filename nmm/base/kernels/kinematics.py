"""A robot's compiled kinematics: joints, frames, their Jacobians and Hessians, the centre of mass.

The same results as Pinocchio's (`nmm.model.robots.configuration`), for loops without calls from
Python, in world axes (LOCAL_WORLD_ALIGNED). Each joint's axes are oriented so that it turns about its own z.
"""

import math
from typing import NamedTuple

from nmm.base.arrays import Array
from nmm.base.kernels.compiled import clear, compiled, scratch
from nmm.base.kernels.record_layout import IntegerVector, Matrix, Vector


class Joints(NamedTuple):
    """J joints of one coordinate each, parents before children; joint 0 is the world.

    parent (J,), coordinate (J,) : the preceding joint, and the index in q
    placement (J, 12) : in its parent's axes at coordinate 0: R column by column, then p, m
    turns (J,) : 1 where it turns about its z, rad, else 0
    slide (J, 3) : displacement per unit of the coordinate, in its own axes, 1 or m/rad
    """

    parent: IntegerVector
    coordinate: IntegerVector
    placement: Matrix
    turns: Vector
    slide: Matrix


class FrameTable(NamedTuple):
    """K frames of a program.

    carrier (K,), placement (K, 12) : the joint that carries a frame (-1: centre of mass), and its place there
    first (K + 1,), chain (...) : chain[first[k]:first[k + 1]] are the joints that move a frame, root first
    masses (J, 4) : mass carried by each joint, kg, its centre in the joint's axes, m; world: the fixed parts
    """

    carrier: IntegerVector
    placement: Matrix
    first: IntegerVector
    chain: IntegerVector
    masses: Matrix


class Kinematics(NamedTuple):
    """A robot's joints and a program's frames."""

    joints: Joints
    frames: FrameTable


@compiled
def compose(A: Array, a: int, B: Array, b: int, out: Array, row: int) -> None:
    """out[row] = A[a] B[b], placements as rows of 12: R column by column, then p."""
    for k in range(3):
        for i in range(3):
            out[row, 3 * k + i] = (
                A[a, i] * B[b, 3 * k] + A[a, 3 + i] * B[b, 3 * k + 1] + A[a, 6 + i] * B[b, 3 * k + 2]
            )
    for i in range(3):
        out[row, 9 + i] = A[a, i] * B[b, 9] + A[a, 3 + i] * B[b, 10] + A[a, 6 + i] * B[b, 11] + A[a, 9 + i]


@compiled
def place_joints(joints: Joints, q: Array, out: Array) -> None:
    """out (J, 12): the joints' placements in the world at q (n,)."""
    for k in range(12):
        out[0, k] = 1.0 if k in (0, 4, 8) else 0.0
    for i in range(1, joints.parent.shape[0]):
        value = q[joints.coordinate[i]]
        compose(out, joints.parent[i], joints.placement, i, out, i)
        x, y, z = value * joints.slide[i, 0], value * joints.slide[i, 1], value * joints.slide[i, 2]
        if x != 0.0 or y != 0.0 or z != 0.0:
            for a in range(3):
                out[i, 9 + a] += out[i, a] * x + out[i, 3 + a] * y + out[i, 6 + a] * z
        if joints.turns[i] != 0.0:
            c, s = math.cos(value), math.sin(value)
            for a in range(3):
                first, second = out[i, a], out[i, 3 + a]
                out[i, a], out[i, 3 + a] = c * first + s * second, c * second - s * first


@compiled
def axes(joints: Joints, places: Array, out: Array) -> None:
    """out (J, 6): each joint's linear velocity at its origin and angular velocity, at rate 1."""
    for i in range(1, joints.parent.shape[0]):
        x, y, z = joints.slide[i, 0], joints.slide[i, 1], joints.slide[i, 2]
        for a in range(3):
            out[i, a] = places[i, a] * x + places[i, 3 + a] * y + places[i, 6 + a] * z
            out[i, 3 + a] = joints.turns[i] * places[i, 6 + a]


@compiled
def moved(places: Array, twists: Array, i: int, x: float, y: float, z: float, out: Array) -> None:
    """out[:3]: the velocity of the point (x, y, z) at rate 1 of joint i."""
    x, y, z = x - places[i, 9], y - places[i, 10], z - places[i, 11]
    a, b, c = twists[i, 3], twists[i, 4], twists[i, 5]
    out[0] = twists[i, 0] + b * z - c * y
    out[1] = twists[i, 1] + c * x - a * z
    out[2] = twists[i, 2] + a * y - b * x


@compiled
def place_frames(
    joints: Joints, frames: FrameTable, q: Array, placements: Array, jacobians: Array, hessians: Array
) -> None:
    """placements (K, 3, 4) = [R | p], jacobians (K, 6, n) and, if there are any, hessians (K, 6, n, n).

    Of the last two only entries that can be nonzero are written.
    """
    count = joints.parent.shape[0]
    places, twists, place, v = scratch((count, 12)), scratch((count, 6)), scratch((1, 12)), scratch(3)
    place_joints(joints, q, places)
    axes(joints, places, twists)
    for k in range(frames.carrier.shape[0]):
        if frames.carrier[k] < 0:
            center_of_mass(joints, frames, places, twists, placements[k], jacobians[k])
            continue
        compose(places, frames.carrier[k], frames.placement, k, place, 0)
        for i in range(3):
            for a in range(4):
                placements[k, i, a] = place[0, 3 * a + i]
        J = jacobians[k]
        first, last = frames.first[k], frames.first[k + 1]
        for c in range(first, last):
            i = frames.chain[c]
            j = joints.coordinate[i]
            moved(places, twists, i, place[0, 9], place[0, 10], place[0, 11], v)
            for a in range(3):
                J[a, j] = v[a]
                J[3 + a, j] = twists[i, 3 + a]
        if hessians.shape[0] > 0:
            differentiate(joints, frames.chain, first, last, J, hessians[k])


@compiled
def differentiate(joints: Joints, chain: Array, first: int, last: int, J: Array, H: Array) -> None:
    """H (6, n, n) = dJ[:, j] / dq[k]: joints before a joint turn it, those after it move the point."""
    for c in range(first, last):
        j = joints.coordinate[chain[c]]
        for d in range(first, last):
            k = joints.coordinate[chain[d]]
            # The joint nearer to the world turns the other one's velocity.
            near, far = (j, k) if d > c else (k, j)
            for a in range(3):
                x, y = (a + 1) % 3, (a + 2) % 3
                H[a, j, k] = J[3 + x, near] * J[y, far] - J[3 + y, near] * J[x, far]
                H[3 + a, j, k] = 0.0 if d >= c else J[3 + x, k] * J[3 + y, j] - J[3 + y, k] * J[3 + x, j]


@compiled
def center_of_mass(
    joints: Joints, frames: FrameTable, places: Array, twists: Array, placement: Array, J: Array
) -> None:
    """The centre of mass and the upper rows of its Jacobian, for a frame with the world's axes."""
    count = joints.parent.shape[0]
    sums, v = scratch((count, 4)), scratch(3)  # for each joint with all that it carries: mass * centre, mass
    for i in range(count):
        m = frames.masses[i, 0]
        for a in range(3):
            sums[i, a] = places[i, 9 + a]
            for k in range(3):
                sums[i, a] += places[i, 3 * k + a] * frames.masses[i, 1 + k]
            sums[i, a] *= m
        sums[i, 3] = m
    for i in range(count - 1, 0, -1):
        for a in range(4):
            sums[joints.parent[i], a] += sums[i, a]
    total = sums[0, 3]
    for i in range(1, count):
        m = sums[i, 3]
        clear(v)
        if m > 0.0:
            moved(places, twists, i, sums[i, 0] / m, sums[i, 1] / m, sums[i, 2] / m, v)
        for a in range(3):
            J[a, joints.coordinate[i]] = v[a] * m / total
    for i in range(3):
        for a in range(3):
            placement[i, a] = 1.0 if a == i else 0.0
        placement[i, 3] = sums[0, i] / total
