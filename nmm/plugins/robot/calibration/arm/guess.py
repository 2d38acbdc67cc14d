"""A first guess of where what sees and what is seen are mounted, by closed forms.

With F the placement of one frame in the other by the robot's file, M what was seen, S and T the mounts of
what sees and of what is seen, S M = F T in each sample: the hand-eye, or robot-world problem A X = Z B.
Rotations come first, by a singular value decomposition (M. Shah, Solving the robot-world/hand-eye
calibration problem using the Kronecker product, J. Mechanisms Robotics 5, 2013), then what is linear. Of
points, which have no rotation, all twelve numbers of S⁻¹ and the point are linear; or one and the other are
fitted in turn (S. Umeyama, IEEE Trans. PAMI 13, 1991).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from nmm.base.arrays import Array
from nmm.base.extras import needed
from nmm.plugins.robot.calibration.arm.placements import inverse, nearest_turn
from nmm.plugins.robot.calibration.arm.sightings import Sightings

#: Fewer corners tell no pose of a board.
CORNERS = 4
#: So many subsets of samples are tried, since some samples may be outliers; of so many samples each.
TRIES, FEW = 20, 6
#: Turns of fitting mounts of points by turns.
ROUNDS = 30


class Mounts(NamedTuple):
    """S and T (4, 4), and the median of how far samples are off by them, m."""

    sensor: Array
    target: Array
    off: float


def board_poses(log: Sightings) -> Array:
    """Poses (N, 4, 4) of the board in the camera; NaN where too few corners were seen."""
    cv2: Any = needed("cv2", "a log of corners")
    camera, board = log.camera, log.board
    assert camera is not None
    assert board is not None
    poses = np.full((len(log), 4, 4), np.nan)
    for k, (row, visible) in enumerate(zip(log.seen, log.visible, strict=True)):
        if np.count_nonzero(visible) < CORNERS:
            continue
        points, pixels = board[visible], row[visible].reshape(-1, 1, 2)
        if camera.model == "equidistant":
            K, D = camera.matrix, np.zeros(4) if not len(camera.distortion) else camera.distortion
            pixels = cv2.fisheye.undistortPoints(pixels, K, D, P=K)
            given = camera.matrix, np.zeros(4)
        else:
            given = camera.matrix, camera.distortion if len(camera.distortion) else np.zeros(4)
        try:
            result, turn, place = cv2.solvePnP(points, pixels, *given)
        except cv2.error:
            continue
        if result and np.isfinite(turn).all() and np.isfinite(place).all():
            poses[k] = np.eye(4)
            poses[k, :3, :3] = cv2.Rodrigues(turn)[0]
            poses[k, :3, 3] = place[:, 0]
    return poses


def first_mounts(
    log: Sightings, F: Array, poses: Array | None, S: Array | None, T: Array | None, tries: int = TRIES
) -> Mounts | None:
    """Mounts by `on` as `by` sees it, F (N, 4, 4), and by what was seen: points, or poses where these are
    given; one of them may be known; of all samples and of so many subsets. None where samples are too few."""
    if poses is None:
        known = np.ones(len(F), dtype=bool)
        M = np.tile(np.eye(4), (len(F), 1, 1))
        M[:, :3, 3] = log.seen
    else:
        known = np.isfinite(poses[:, 0, 0])
        M = poses
    usable = np.flatnonzero(known)
    if len(usable) < 3:
        return None
    rng, best = np.random.default_rng(0), None
    for turn in range(tries + 1):
        some = usable
        if turn:
            if len(usable) <= FEW + 2:
                break
            some = rng.choice(usable, max(FEW, len(usable) // 4), replace=False)
        made = _of_points(M[some], F[some], S, T) if poses is None else _of_poses(M[some], F[some], S, T)
        off = np.linalg.norm((inverse(made[0]) @ F[usable] @ made[1] - M[usable])[:, :3, 3], axis=1)
        if best is None or float(np.median(off)) < best.off:
            best = Mounts(*made, float(np.median(off)))
    return best


def _of_poses(M: Array, F: Array, S: Array | None, T: Array | None) -> tuple[Array, Array]:
    if S is not None and T is not None:
        return S, T
    if S is not None:
        return S, _mean(inverse(F) @ S @ M)
    if T is not None:
        return _mean(F @ T @ inverse(M)), T
    S, T = np.eye(4), np.eye(4)
    S[:3, :3], T[:3, :3] = _rotations(M[:, :3, :3], F[:, :3, :3])
    A = np.concatenate([np.tile(np.eye(3), (len(M), 1, 1)), -F[:, :3, :3]], axis=2).reshape(-1, 6)
    b = F[:, :3, 3] - np.einsum("ij,kj->ki", S[:3, :3], M[:, :3, 3])
    result = np.linalg.lstsq(A, b.ravel(), rcond=1e-6)[0]
    S[:3, 3], T[:3, 3] = result[:3], result[3:]
    return S, T


def _rotations(M: Array, F: Array) -> tuple[Array, Array]:
    """Rotations of S and T: S M = F T."""
    # vec(S) of rows is n times a singular vector of the sum of F ⊗ M, vec(T) the other.
    K = np.einsum("kab,kcd->acbd", F, M).reshape(9, 9)
    left, _, right = np.linalg.svd(K)
    S, T = left[:, 0].reshape(3, 3), right[0].reshape(3, 3)
    if np.linalg.det(S) < 0.0:
        S, T = -S, -T
    return nearest_turn(S), nearest_turn(T)


def _mean(M: Array) -> Array:
    made = np.eye(4)
    made[:3, :3] = nearest_turn(M[:, :3, :3].sum(axis=0))
    made[:3, 3] = M[:, :3, 3].mean(axis=0)
    return made


def _of_points(M: Array, F: Array, S: Array | None, T: Array | None) -> tuple[Array, Array]:
    seen, R, p = M[:, :3, 3], F[:, :3, :3], F[:, :3, 3]
    if S is not None:
        at = np.eye(4) if T is None else T
        if T is None:
            in_by = seen @ S[:3, :3].T + S[:3, 3]
            at[:3, 3] = np.einsum("kji,kj->ki", R, in_by - p).mean(axis=0)
        return S, at
    if T is not None:
        return _laid(seen, p + R @ T[:3, 3]), T
    candidates = [_by_turns(seen, R, p, np.zeros(3))]
    if len(seen) >= 6:
        candidates.append(_by_turns(seen, R, p, _linear(seen, R, p)))
    return min(candidates, key=lambda one: float(np.median(_far(one[0], one[1], seen, R, p))))


def _linear(seen: Array, R: Array, p: Array) -> Array:
    """The point on the hand (3,), of S's rotation as any matrix: R_S seen + t = R b + p."""
    rows = np.zeros((len(seen), 3, 15))
    for i in range(3):
        rows[:, i, 3 * i : 3 * i + 3] = seen
        rows[:, i, 9 + i] = 1.0
    rows[:, :, 12:] = -R
    return np.asarray(np.linalg.lstsq(rows.reshape(-1, 15), p.ravel(), rcond=1e-6)[0][12:], dtype=np.float64)


def _by_turns(seen: Array, R: Array, p: Array, b: Array) -> tuple[Array, Array]:
    T = np.eye(4)
    T[:3, 3] = b
    A = np.concatenate([np.tile(np.eye(3), (len(seen), 1, 1)), -R], axis=2).reshape(-1, 6)
    back = np.linalg.pinv(A, rcond=1e-6)
    for _ in range(ROUNDS):
        S = _laid(seen, p + R @ T[:3, 3])
        result = back @ (p - seen @ S[:3, :3].T).ravel()  # with S's rotation, the rest is linear
        moved = float(np.abs(result[3:] - T[:3, 3]).max())
        S[:3, 3], T[:3, 3] = result[:3], result[3:]
        if moved < 1e-5:
            break
    return S, T


def _laid(seen: Array, visible: Array) -> Array:
    """The placement (4, 4) that lays points on others."""
    a, b = seen - seen.mean(axis=0), visible - visible.mean(axis=0)
    S = np.eye(4)
    S[:3, :3] = nearest_turn(b.T @ a)
    S[:3, 3] = visible.mean(axis=0) - S[:3, :3] @ seen.mean(axis=0)
    return S


def _far(S: Array, T: Array, seen: Array, R: Array, p: Array) -> Array:
    far: Array = np.linalg.norm(seen @ S[:3, :3].T + S[:3, 3] - R @ T[:3, 3] - p, axis=1)
    return far
