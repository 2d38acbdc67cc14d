"""Placements in bulk, and their slopes: 4 x 4 matrices (N, 4, 4), twists (N, 6), linear m, then angular rad.

A twist is right of a placement, in the axes of what is placed: dM = M ξ^. Angles are roll, pitch and yaw
about fixed axes, R = Rz(yaw) Ry(pitch) Rx(roll), as in a URDF's origin.
"""

from __future__ import annotations

import math

import numpy as np

from nmm.base.arrays import Array


def turned(angles: Array) -> Array:
    """R (3, 3) of roll, pitch and yaw."""
    (sr, sp, sy), (cr, cp, cy) = np.sin(angles), np.cos(angles)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def angles_of(R: Array) -> Array:
    """Roll, pitch and yaw (3,) of R; yaw is 0 where pitch is a quarter turn."""
    across = math.hypot(R[0, 0], R[1, 0])
    pitch = math.atan2(-R[2, 0], across)
    if across < 1e-9:
        return np.array([math.atan2(-R[1, 2], R[1, 1]), pitch, 0.0])
    return np.array([math.atan2(R[2, 1], R[2, 2]), pitch, math.atan2(R[1, 0], R[0, 0])])


def body_rates(angles: Array) -> Array:
    """(3, 3): the angular twist for rates of roll, pitch and yaw."""
    (sr, sp, _), (cr, cp, _) = np.sin(angles), np.cos(angles)
    return np.array([[1.0, 0.0, -sp], [0.0, cr, sr * cp], [0.0, -sr, cr * cp]])


def placed(parts: Array, turn: Array | None = None) -> Array:
    """M (4, 4) of x, y, z, roll, pitch, yaw (6,); the angles behind a turn (3, 3) where there is one."""
    M = np.eye(4)
    M[:3, :3] = turned(parts[3:]) if turn is None else turn @ turned(parts[3:])
    M[:3, 3] = parts[:3]
    return M


def parts_of(M: Array, turn: Array | None = None) -> Array:
    """x, y, z, roll, pitch, yaw (6,) of M: what `placed` takes."""
    R = M[:3, :3] if turn is None else turn.T @ M[:3, :3]
    return np.concatenate([M[:3, 3], angles_of(R)])


def slopes(parts: Array, turn: Array | None = None) -> Array:
    """(6, 6): a column for each part, the twist of `placed` for a unit of it."""
    made = np.zeros((6, 6))
    made[:3, :3] = placed(parts, turn)[:3, :3].T
    made[3:, 3:] = body_rates(parts[3:])
    return made


def inverse(M: Array) -> Array:
    """Of placements (..., 4, 4)."""
    made = np.zeros_like(M)
    made[..., :3, :3] = np.swapaxes(M[..., :3, :3], -1, -2)
    made[..., :3, 3] = -np.einsum("...ij,...j->...i", made[..., :3, :3], M[..., :3, 3])
    made[..., 3, 3] = 1.0
    return made


def carried(M: Array, twists: Array) -> Array:
    """Twists (6, k), of what stands at M (N, 4, 4) in some axes, in these axes: (N, 6, k)."""
    R, p = M[:, :3, :3], M[:, :3, 3]
    angular = R @ twists[3:]
    linear = R @ twists[:3] + np.cross(p[:, :, np.newaxis], angular, axis=1)
    return np.concatenate([linear, angular], axis=1)


def rotation_vectors(R: Array) -> Array:
    """Rotation vectors (N, 3), rad, of R (N, 3, 3)."""
    from scipy.spatial.transform import Rotation

    vectors: Array = Rotation.from_matrix(R).as_rotvec().reshape(-1, 3)
    return vectors


def nearest_turn(A: Array) -> Array:
    """The rotation nearest to A (3, 3)."""
    U, _, V = np.linalg.svd(A)
    made: Array = U @ np.diag([1.0, 1.0, np.sign(np.linalg.det(U @ V))]) @ V
    return made
