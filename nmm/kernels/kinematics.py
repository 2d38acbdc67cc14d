"""Where a robot's joints are, compiled: for loops that look at many configurations."""

from __future__ import annotations

import math
from typing import NamedTuple

from nmm.arrays import Array
from nmm.kernels.compiled import compiled, scratch
from nmm.kernels.memory import IntegerVector, Matrix


class Joints(NamedTuple):
    """J joints of one number each, parents before children; joint 0 is the world, which stands.

    parent (J,), coordinate (J,) : the joint before it, and which of q moves it
    placement (J, 12) : in its parent's axes where its number is 0: R column by column, then p, m
    twist (J, 6) : how its number moves it, in its own axes: linear (1 or m/rad) over angular; a unit axis
        where it turns, along which it slides where it does that, too
    """

    parent: IntegerVector
    coordinate: IntegerVector
    placement: Matrix
    twist: Matrix


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
    moved, between = scratch((1, 12)), scratch((1, 12))
    for k in range(12):
        out[0, k] = 1.0 if k in (0, 4, 8) else 0.0
    for i in range(1, joints.parent.shape[0]):
        value = q[joints.coordinate[i]]
        x, y, z = joints.twist[i, 3], joints.twist[i, 4], joints.twist[i, 5]
        c, s = (1.0, 0.0) if x == 0.0 and y == 0.0 and z == 0.0 else (math.cos(value), math.sin(value))
        v = 1.0 - c
        moved[0, 0], moved[0, 1], moved[0, 2] = c + v * x * x, v * x * y + s * z, v * x * z - s * y
        moved[0, 3], moved[0, 4], moved[0, 5] = v * x * y - s * z, c + v * y * y, v * y * z + s * x
        moved[0, 6], moved[0, 7], moved[0, 8] = v * x * z + s * y, v * y * z - s * x, c + v * z * z
        for k in range(3):
            moved[0, 9 + k] = value * joints.twist[i, k]
        compose(out, joints.parent[i], joints.placement, i, between, 0)
        compose(between, 0, moved, 0, out, i)
