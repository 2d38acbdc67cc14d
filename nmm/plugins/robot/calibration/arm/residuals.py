"""How far what was seen is from where a placement has it, with slopes in a twist of the placement."""

from __future__ import annotations

import numpy as np

from nmm.base.arrays import Array
from nmm.plugins.robot.calibration.arm.placements import rotation_vectors
from nmm.plugins.robot.calibration.arm.sightings import Sightings

#: What rows of each kind are, by which noise is told apart.
PLACE, TURN, PIXEL = "place", "turn", "pixel"
#: The parts of what an item of a kind leaves: its rows in order.
ROWS = {"points": (PLACE,) * 3, "poses": (PLACE,) * 3 + (TURN,) * 3, "corners": (PIXEL,) * 2}
#: A point is seen from no nearer than this, m: one behind a camera is taken to be there.
NEAREST = 1e-3


def left(log: Sightings, T: Array, some: slice = slice(None)) -> tuple[Array, Array]:
    """Residuals (N, k) or, of corners, (N, m, 2), m, rad or px, and their slopes in the twist (..., 6), with
    the target at T (N, 4, 4) of the sensor; of some samples."""
    seen = log.seen[some]
    R, p = T[:, :3, :3], T[:, :3, 3]
    if log.kind == "corners":
        return _corners(log, R, p, seen)
    slopes = np.zeros((len(T), 3, 6))
    slopes[:, :, :3] = R
    if log.kind == "points":
        return p - seen, slopes
    off = rotation_vectors(np.swapaxes(seen[:, :3, :3], 1, 2) @ R)
    turns = np.zeros((len(T), 3, 6))
    turns[:, :, 3:] = _right_inverse(off)
    return np.concatenate([p - seen[:, :3, 3], off], axis=1), np.concatenate([slopes, turns], axis=1)


def _corners(log: Sightings, R: Array, p: Array, seen: Array) -> tuple[Array, Array]:
    assert log.board is not None
    assert log.camera is not None
    points = np.einsum("kij,mj->kmi", R, log.board) + p[:, np.newaxis]
    points[..., 2] = np.maximum(points[..., 2], NEAREST)
    pixels, slopes = log.camera.seen(points)
    by_linear = np.einsum("kmai,kij->kmaj", slopes, R)
    by_angular = -np.einsum("kmai,mij->kmaj", by_linear, _crosses(log.board))
    return pixels - seen, np.concatenate([by_linear, by_angular], axis=-1)


def _crosses(vectors: Array) -> Array:
    """The cross product with each (m, 3), as matrices (m, 3, 3)."""
    x, y, z = vectors.T
    o = np.zeros_like(x)
    rows: Array = np.array([[o, -z, y], [z, o, -x], [-y, x, o]])
    return np.moveaxis(rows, -1, 0)


def _right_inverse(vectors: Array) -> Array:
    """Inverses (N, 3, 3) of the right Jacobian of rotation vectors (N, 3)."""
    crosses = _crosses(vectors)
    angle = np.linalg.norm(vectors, axis=1)
    safe = np.clip(angle, 1e-4, np.pi - 1e-6)
    share = 1.0 / safe**2 - (1.0 + np.cos(safe)) / (2.0 * safe * np.sin(safe))
    share = np.where(angle < 1e-4, 1.0 / 12.0, share)
    made: Array = np.eye(3) + 0.5 * crosses + share[:, np.newaxis, np.newaxis] * (crosses @ crosses)
    return made
