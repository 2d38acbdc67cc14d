"""What something saw of an arm: points, poses or corners, checked."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import Array, Flags, array
from nmm.base.errors import InputError, expect, expect_kind
from nmm.plugins.robot.calibration.arm.intrinsics import CameraIntrinsics

#: Board points are in a line where they lie so near to one, as a share of its length.
LINE = 1e-3
#: Corners a picture may show outside its edges, px: corners are found between pixels.
EDGE = 1.0


def checked_seen(
    seen: ArrayLike, kind: str, camera: CameraIntrinsics | None, board: ArrayLike | None, where: str
) -> tuple[Array, Array | None]:
    """Points (N, 3), poses (N, 4, 4) or corners (N, m, 2), and of corners the board's points (m, 3);
    `InputError` as of `Sightings`."""
    at = f"{where}: seen"
    if kind == "corners":
        return _checked_corners(seen, camera, board, where)
    for name, value in (("camera", camera), ("board", board)):
        expect(value is None, f"{where}: {name}", "none: it is of corners")
    rows = array(seen, at)
    if kind == "points":
        expect(rows.ndim == 2 and rows.shape[1] == 3, at, "points of shape (N, 3)", rows.shape)
        return rows, None
    if rows.ndim == 2 and rows.shape[1] == 7:
        from scipy.spatial.transform import Rotation

        lengths = np.linalg.norm(rows[:, 3:], axis=1)
        k = int(np.argmax(np.abs(lengths - 1.0)))
        expect(abs(lengths[k] - 1.0) < 0.01, f"{at}: sample {k}", "a quaternion of length 1", rows[k, 3:])
        made = np.tile(np.eye(4), (len(rows), 1, 1))
        made[:, :3, :3] = Rotation.from_quat(rows[:, 3:]).as_matrix()
        made[:, :3, 3] = rows[:, :3]
        return made, None
    fits = rows.ndim == 3 and rows.shape[1:] == (4, 4)
    expect(fits, at, "poses of shape (N, 7) or (N, 4, 4)", rows.shape)
    R = rows[:, :3, :3]
    off = np.abs(np.swapaxes(R, 1, 2) @ R - np.eye(3)).max(axis=(1, 2)) + (np.linalg.det(R) < 0.0)
    off += np.abs(rows[:, 3] - [0.0, 0.0, 0.0, 1.0]).max(axis=1)
    k = int(np.argmax(off))
    expect(off[k] < 0.01, f"{at}: sample {k}", "a placement [R p; 0 0 0 1], R a rotation", rows[k])
    return rows, None


def _checked_corners(
    seen: ArrayLike, camera: CameraIntrinsics | None, board: ArrayLike | None, where: str
) -> tuple[Array, Array]:
    expect_kind(camera, CameraIntrinsics, f"{where}: camera", "a nmm.CameraIntrinsics, of corners")
    assert camera is not None
    if board is None:
        raise InputError(where=f"{where}: board", expected="its points (m, 3), m")
    board = array(board, f"{where}: board")
    expect(board.ndim == 2 and board.shape[1] == 3, f"{where}: board", "points (m, 3), m", board.shape)
    sizes = np.linalg.svd(board - board.mean(axis=0), compute_uv=False)
    in_line = len(board) < 3 or sizes[1] < LINE * max(sizes[0], 1e-300)
    expect(not in_line, f"{where}: board", "points that are not in one line", board)
    try:
        rows = np.array(seen, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(where=f"{where}: seen", expected="pixels", got=seen) from None
    expected = f"pixels of shape (N, {len(board)}, 2), as the board's points"
    expect(rows.ndim == 3 and rows.shape[1:] == (len(board), 2), f"{where}: seen", expected, rows.shape)
    half = np.isfinite(rows).sum(axis=2)
    for bad, expected in (
        ((half == 1) | np.isinf(rows).any(axis=2), "both of u and v, or NaN for both"),
        (_outside(rows, camera), "pixels in the picture"),
    ):
        if bad.any():
            k, j = np.argwhere(bad)[0].tolist()
            at = f"{where}: sample {k}, corner {j}"
            raise InputError(where=at, expected=expected, got=rows[k, j].tolist())
    empty = np.flatnonzero(~(half == 2).any(axis=1))
    expect(not len(empty), f"{where}: sample {empty[:1]}", "at least one corner seen")
    return rows, board


def _outside(rows: Array, camera: CameraIntrinsics) -> Flags:
    bad = np.zeros(rows.shape[:2], dtype=bool)
    for axis, size in enumerate((camera.width, camera.height)):
        if size is not None:
            bad |= (rows[:, :, axis] < -EDGE) | (rows[:, :, axis] > size - 1.0 + EDGE)
    return bad
