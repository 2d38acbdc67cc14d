"""Motions in the plane, SE(2), as plain loops: exponential, its derivatives, composition.

A pose (3,) is x, y, theta, m and rad; theta is not wrapped. A twist (3,) is along the body's x and y and
about z, m and rad, for a unit of time. (J. Solà, J. Deray, D. Atchuthan, A micro Lie theory for state
estimation in robotics, 2018, eqs. 156 to 164.)
"""

import math

from nmm.base.arrays import Array
from nmm.base.kernels.compiled import compiled

#: A turn with a smaller square root of rounding is straight, rad.
STRAIGHT = 1e-5


@compiled
def exp_planar(twist: Array, pose: Array, slope: Array) -> None:
    """pose (3,) = exp(twist), reached from the origin; slope (3, 3) = its derivative in the twist."""
    x, y, w = twist[0], twist[1], twist[2]
    half = 0.5 * w
    a = math.sin(w) / w if w != 0.0 else 1.0
    b = math.sin(half) * (math.sin(half) / half if half != 0.0 else 1.0)
    a_w, b_w = -w / 3.0, 0.5
    if abs(w) >= STRAIGHT:
        a_w, b_w = (math.cos(w) - a) / w, (math.sin(w) - b) / w
    pose[0], pose[1], pose[2] = a * x - b * y, b * x + a * y, w
    slope[0, 0], slope[0, 1], slope[0, 2] = a, -b, a_w * x - b_w * y
    slope[1, 0], slope[1, 1], slope[1, 2] = b, a, b_w * x + a_w * y
    slope[2, 0], slope[2, 1], slope[2, 2] = 0.0, 0.0, 1.0


@compiled
def to_body_axes(angle: float, rows: Array) -> None:
    """The first two of rows (3, k), in axes turned by an angle, rad; in place."""
    c, s = math.cos(angle), math.sin(angle)
    for j in range(rows.shape[1]):
        along, across = rows[0, j], rows[1, j]
        rows[0, j] = c * along + s * across
        rows[1, j] = c * across - s * along


@compiled
def right_jacobian_planar(twist: Array, pose: Array, J: Array) -> None:
    """pose (3,) = exp(twist), and J (3, 3) with exp(twist + d) = exp(twist) exp(J d) to first order in d."""
    exp_planar(twist, pose, J)
    to_body_axes(twist[2], J)


@compiled
def inverse_adjoint_planar(pose: Array, A: Array) -> None:
    """A (3, 3) with exp(d) T = T exp(A d), T of the pose (3,)."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    A[0, 0], A[0, 1], A[0, 2] = c, s, s * pose[0] - c * pose[1]
    A[1, 0], A[1, 1], A[1, 2] = -s, c, c * pose[0] + s * pose[1]
    A[2, 0], A[2, 1], A[2, 2] = 0.0, 0.0, 1.0


@compiled
def compose_planar(pose: Array, step: Array) -> None:
    """pose (3,) goes on by a step (3,) that its own axes see; in place, other numbers of it stay."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    pose[0] += c * step[0] - s * step[1]
    pose[1] += s * step[0] + c * step[1]
    pose[2] += step[2]
