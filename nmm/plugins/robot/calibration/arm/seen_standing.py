"""What is seen of an arm where its joints stand: of each posture one mean, or why there is none."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from nmm.base.arrays import Array
from nmm.base.errors import InputError
from nmm.base.findings import Finding
from nmm.plugins.robot.calibration.arm.standing import WINDOW

#: What is seen stands where its first, middle and last third lie no farther apart, m and a turn's chord, than
#: so far, and so many times as it scatters within them; of fewer messages one cannot tell.
SEEN_STANDS, SCATTERS, FEW = (1e-3, 3e-3), 4.0, 6
#: Few messages of which half are farther, m and a turn's chord, from their median are of what moves.
WIDE = (0.02, 0.06)
#: Farther from the median than so many times as half of the messages are, it is an outlier.
OUTLIES = 4.0
#: It is in two places where it goes from the one to the other and back, so large a share at least is in each,
#: and they are so far apart, m and a turn's chord, and so many times as far as messages are from their own.
SHARE, APART, TIMES = 0.3, (5e-3, 0.02), 6.0
#: In so large a share of the postures what is seen may move, or be in two places.
SOME = 0.5
MOVES, TWO = "what is seen moves", "what is seen is in two places"


def seen_in(
    spans: Array, looks: Array, rows: Array, where: str
) -> tuple[list[int], Array, dict[str, int], list[Finding]]:
    """In which spans, s, something stands and is seen, and what (N, 3) or (N, 4, 4), of rows at `looks`, s;
    in how many it is not, by reason, and what was found.

    Raises
    ------
    InputError : it moves, or is in two places, in most of them
    """
    chosen, seen, few = list[int](), list[Array](), 0
    why = dict.fromkeys(("nothing is seen", MOVES, TWO), 0)
    for k, (begin, end) in enumerate(np.searchsorted(looks, spans).tolist()):
        if begin == end:
            why["nothing is seen"] += 1
        elif isinstance(mean := averaged(rows[begin:end]), str):
            why[mean] += 1
        else:
            chosen.append(k)
            seen.append(mean)
            few += end - begin < FEW
    of = len(chosen) + why[MOVES] + why[TWO]
    if why[TWO] > SOME * of:
        what = f"{TWO} by turns in {why[TWO]} of {of} postures"
        expected = "one marker on a topic, or FRAME:CHILD of TF; a pose that is not ambiguous"
        raise InputError(what, where=where, expected=expected)
    if why[MOVES] > SOME * of:
        what = f"what is seen moves in {why[MOVES]} of {of} postures in which the joints stand"
        raise InputError(what, where=where, expected=f"stamps of one clock, to {0.5 * WINDOW:g} s")
    findings = [Finding("looks_few", {"count": few, "of": len(chosen), "few": FEW})] if few else []
    return chosen, np.array(seen), why, findings


def averaged(rows: Array) -> Array | str:
    """The mean of points (k, 3) or poses (k, 4, 4) without outliers; or why there is none."""
    of_poses = rows.ndim == 3
    parts = [rows[:, :3, 3], rows[:, :3, :3].reshape(-1, 9)] if of_poses else [rows]
    good = np.ones(len(rows), dtype=bool)
    for part, least, wide, apart in zip(parts, SEEN_STANDS, WIDE, APART, strict=False):
        off = np.linalg.norm(part - np.median(part, axis=0), axis=1)
        if len(rows) < FEW and np.median(off) > wide:
            return MOVES
        if len(rows) >= FEW and _in_two_places(part, apart):
            return TWO
        if len(rows) >= FEW and _moves(np.array_split(part, 3), least):
            return MOVES
        good &= off <= max(OUTLIES * np.median(off), least)
    rows = rows[good] if good.any() else rows
    if not of_poses:
        return np.asarray(rows.mean(axis=0))
    made = np.eye(4)
    made[:3, 3] = rows[:, :3, 3].mean(axis=0)
    made[:3, :3] = Rotation.from_matrix(rows[:, :3, :3]).mean().as_matrix()
    return made


def _in_two_places(part: Array, least: float) -> bool:
    """Whether rows (k, d), in the order of time, lie by turns about one place and about another."""
    one = part[np.argmin(np.linalg.norm(part - np.median(part, axis=0), axis=1))]
    far = np.argsort(np.linalg.norm(part - one, axis=1))  # the farthest few may be outliers
    places = np.array([one, part[far[int((1.0 - 0.5 * SHARE) * len(part))]]])
    for _ in range(3):
        off = np.linalg.norm(part[:, np.newaxis] - places, axis=2)
        other = off[:, 1] < off[:, 0]
        if not SHARE <= other.mean() <= 1.0 - SHARE:
            return False
        places = np.array([np.median(part[~other], axis=0), np.median(part[other], axis=0)])
    off = np.linalg.norm(part[:, np.newaxis] - places, axis=2).min(axis=1)
    apart = np.linalg.norm(places[1] - places[0])
    by_turns = np.count_nonzero(np.diff(other)) > 2
    return bool(by_turns and apart > max(least, TIMES * np.median(off)))


def _moves(thirds: Sequence[Array], least: float) -> bool:
    middles = [np.median(third, axis=0) for third in thirds]
    within = [np.linalg.norm(third - middle, axis=1) for third, middle in zip(thirds, middles, strict=True)]
    apart = max(np.linalg.norm(a - b) for a in middles for b in middles)
    return bool(apart > least + SCATTERS * np.median(np.concatenate(within)))
