"""Why an arm and what was seen of it do not fit: what the sightings would have to be for them to fit."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from nmm.base.arrays import Array, Flags
from nmm.base.findings import Finding
from nmm.plugins.robot.calibration.arm.guess import board_poses, first_mounts
from nmm.plugins.robot.calibration.arm.placements import inverse, placed
from nmm.plugins.robot.calibration.arm.residuals import left
from nmm.plugins.robot.calibration.arm.sightings import Sightings
from nmm.plugins.robot.calibration.arm.view import some_of

if TYPE_CHECKING:
    from nmm.plugins.robot.calibration.arm.model import ArmModel

#: Sightings that are told otherwise fit where half are so near, m, and nearer than such a share of before.
FITS, MUCH = 0.025, 1.0 / 3.0
#: Single pictures do not fit to a board where half of the corners are farther off, in focal lengths.
UNLIKE = 0.003
#: A board is told from its other end where half of its corners are so near then, by an arm that is a bit off.
TURNED = 0.02
#: Lengths may be told in so many m.
LENGTHS = (1e-3, 1e-2, 0.0254, 10.0, 100.0, 1000.0)
#: Which end of the board is told first is agreed on in so many rounds.
ROUNDS = 10
_READ = "each joint's readings in its column and unit, in the rows of what was seen; frames that are so"
_EXPECTED = {
    "points": f"{_READ}; a base that stands still",
    "poses": f"{_READ}; poses in the axes of what sees, x, y, z, w",
    "corners": f"the board's columns, rows and size, the camera's intrinsics and optical frame; {_READ}",
}


def expected_instead(log: Sightings, F: Array, seen: Array | None) -> str:
    """What was expected of sightings that do not fit to an arm, where `on` is at F (N, 4, 4) as `by` sees it;
    by what would fit, where something does. seen : poses of the target (N, 4, 4), None of points."""
    if seen is not None and log.kind == "corners" and (board := _unlike(log, seen)):
        return board
    before = _off(log, F, seen)
    for other, poses, expected in _told_otherwise(log, F, seen):
        if _off(other, F, poses) < min(FITS, MUCH * before):
            return expected
    return _EXPECTED[log.kind]


def turned_boards(model: ArmModel, values: Array) -> list[Finding]:
    """Of logs with pictures that were left out, and of which the board was told from its other end."""
    findings = []
    for view in model.views:
        log = view.log
        if log.camera is None:
            continue
        off = model.residuals(view, values)
        lost = np.flatnonzero(some_of(log.visible) & ~view.samples_taken)
        turned = []
        for k in lost.tolist():
            other = np.abs(off[k] + log.seen[k] - log.seen[k, ::-1])
            near = float(np.nanmedian(other)) if np.isfinite(other).any() else np.inf
            if near < min(TURNED * log.camera.fx, MUCH * float(np.nanmedian(np.abs(off[k])))):
                turned.append(k)
        if turned:
            values_of = {"log": log.name, "count": len(turned), "all": len(lost), "sample": turned[0]}
            findings.append(Finding("board_turned", values_of))
    return findings


def _off(log: Sightings, F: Array, seen: Array | None) -> float:
    mounts = first_mounts(log, F, seen, None, None, tries=0)
    return np.inf if mounts is None else mounts.off


def _told_otherwise(
    log: Sightings, F: Array, seen: Array | None
) -> Iterator[tuple[Sightings, Array | None, str]]:
    """The sightings, as they might have been meant, with their poses, and what this is told to be."""
    if log.kind == "poses" and seen is not None:
        yield log, inverse(seen), "poses of what is seen as what sees has it: their inverse would fit"
        yield log, _w_first(seen), "quaternions x, y, z, w: w, x, y, z would fit"
    if log.kind == "corners" and seen is not None:
        turned = _turned(log, F, seen)
        some = f"{np.count_nonzero(turned)} of {len(turned)}"
        expected = f"corners from the same end of the board: from the other in {some} pictures would fit"
        yield log, np.where(turned[:, np.newaxis, np.newaxis], seen @ _half_turn(log), seen), expected
    for length in LENGTHS:
        what = "the board's points" if log.kind == "corners" else "what was seen"
        expected = f"{what} in m: {length:g} times as large would fit"
        if seen is None:
            yield _with(log, seen=length * log.seen), None, expected
        else:
            scaled = seen.copy()
            scaled[:, :3, 3] *= length
            yield log, scaled, expected


def _w_first(M: Array) -> Array:
    from scipy.spatial.transform import Rotation

    made, known = M.copy(), np.isfinite(M[:, 0, 0])
    quaternions = Rotation.from_matrix(M[known, :3, :3]).as_quat()
    made[known, :3, :3] = Rotation.from_quat(quaternions[:, [1, 2, 3, 0]]).as_matrix()
    return made


def _half_turn(log: Sightings) -> Array:
    """Where a board (4, 4) is in its own axes whose corners are told from the last to the first."""
    assert log.board is not None  # it has corners: `Sightings` asks for it
    return placed(np.array([*(log.board[0] + log.board[-1])[:2], 0.0, 0.0, 0.0, np.pi]))


def _turned(log: Sightings, F: Array, seen: Array) -> Flags:
    """The pictures (N,) of which the board seems to be told from the other end: the fewer ones. Between two
    postures, what is seen turns as much as what carries it."""
    both = np.stack([seen[:, :3, :3], (seen @ _half_turn(log))[:, :3, :3]])
    by_arm = _angles(F[:, :3, :3], F[:, :3, :3])
    known = np.isfinite(seen[:, 0, 0])
    by_board = np.stack([_angles(both[0], other) for other in both])  # alike, and one of two turned
    off = np.where(known & known[:, np.newaxis], np.abs(by_board - by_arm), 0.0)
    turned = off[0, int(np.argmax(known))] > off[1, int(np.argmax(known))]
    for _ in range(ROUNDS):
        unlike = turned[np.newaxis] != np.array([False, True])[:, np.newaxis]
        wrong = [np.where(apart, off[1], off[0]).sum(axis=1) for apart in unlike]
        now = wrong[1] < wrong[0]
        if np.array_equal(now, turned):
            break
        turned = now
    turned = turned & known
    return ~turned & known if 2 * np.count_nonzero(turned) > np.count_nonzero(known) else turned


def _angles(R: Array, others: Array) -> Array:
    """Angles (N, N), rad, from each R (N, 3, 3) to each of the others."""
    traces = np.einsum("nij,mij->nm", np.nan_to_num(R), np.nan_to_num(others))
    angles: Array = np.arccos(np.clip(0.5 * (traces - 1.0), -1.0, 1.0))
    return angles


def _unlike(log: Sightings, seen: Array) -> str:
    """What board was expected, where this one does not fit to single pictures; "" where it does."""
    assert log.camera is not None  # likewise
    off = _pixels(log, seen)
    if off < UNLIKE * log.camera.fx:
        return ""
    other = _other_way(log)
    if other is not None and _pixels(other, board_poses(other)) < min(UNLIKE * log.camera.fx, MUCH * off):
        return "the board that was seen: with columns and rows the other way round it would fit"
    return (
        f"the board that was seen, its columns, rows and their order, and the camera's intrinsics: single "
        f"pictures are {off:.2g} px off"
    )


def _pixels(log: Sightings, seen: Array) -> float:
    """How far half of the corners are off in single pictures, px, with the board at poses (N, 4, 4)."""
    known = np.flatnonzero(np.isfinite(seen[:, 0, 0]))
    if not len(known):
        return np.inf
    some = _with(log, seen=log.seen[known])
    return float(np.nanmedian(np.abs(left(some, seen[known])[0])))


def _other_way(log: Sightings) -> Sightings | None:
    """Of a board with columns and rows the one with these the other way round; None of any other."""
    assert log.board is not None  # it has corners: `Sightings` asks for it
    x, y = (np.unique(log.board[:, axis].round(9)) for axis in (0, 1))
    if len(x) * len(y) != len(log.board) or len(x) == len(y) or log.board[:, 2].any():
        return None
    j, i = np.divmod(np.arange(len(log.board)), len(y))
    return _with(log, board=np.column_stack([y[i], x[j], np.zeros(len(i))]))


def _with(log: Sightings, **parts: Array) -> Sightings:
    made = copy.copy(log)
    for name, value in parts.items():
        object.__setattr__(made, name, value)
    return made
