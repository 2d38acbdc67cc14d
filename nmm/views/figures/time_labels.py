"""Where the times stand in a drawing of a motion: beside what they belong to, on nothing that is drawn."""

from __future__ import annotations

import heapq
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from nmm.base.arrays import Array, Flags
from nmm.views.figures import style

#: Size of the text, pt, and what a character and a line take at most, in.
SIZE = style.SMALL - 1.0
_CHARACTER, _LINE = 0.66 * SIZE / 72.0, 0.95 * SIZE / 72.0
#: Room around a text, which holds half of a joint's mark or of the widest line that is drawn, in.
_PAD = 0.05
#: A text that is farther from its subject than this has a line that leads there, in.
_FAR = 0.16
#: Where another subject is as near but for so much, a text stands rather so much farther from its own, in.
_AS_NEAR, _UNCLEAR = 0.08, 0.3
#: Where a text is tried: so many directions, so many distances, the farthest, in.
_DIRECTIONS, _DISTANCES, _FARTHEST = 40, 24, 2.0


class Subject(NamedTuple):
    text: str
    outline: Array


class Place(NamedTuple):
    """Where a text stands: its middle and half its extents, (2,) m, and where its line ends, or None."""

    middle: Array
    half: Array
    foot: Array | None

    @property
    def corners(self) -> Array:
        """The text box's corners, (4, 2) m."""
        return self.middle + self.half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])

    @property
    def end(self) -> Array:
        """Where its line reaches the box, (2,) m."""
        way = np.zeros(2) if self.foot is None else self.foot - self.middle
        reach = np.max(np.abs(way) / self.half)
        end: Array = self.middle + way / max(float(reach), 1.0)
        return end


def places(subjects: Sequence[Subject], ground: Ground, scale: float) -> list[Place]:
    """Places near the subjects, clear of the drawing (`ground`) and of each other; `scale`: m per page
    inch."""
    pad, cell = _PAD * scale, ground.cell
    leads = np.zeros((0, 2))
    angles = np.linspace(0.0, 2.0 * np.pi, _DIRECTIONS, endpoint=False)
    directions = np.column_stack([np.cos(angles), np.sin(angles)])
    gaps = np.concatenate([[0.0], np.geomspace(0.02, _FARTHEST, _DISTANCES - 1)]) * scale
    centre = 0.5 * (ground.low + ground.high)
    found: list[Place] = []
    edges = [_sampled([np.vstack([outline, outline[:1]])], 4.0 * cell) for _, outline in subjects]
    for number, (text, outline) in enumerate(subjects):
        half = 0.5 * scale * np.array([_CHARACTER * len(text), _LINE]) + pad
        middle = 0.5 * (outline.min(axis=0) + outline.max(axis=0))
        # As far out as the outline and the text's own box reach that way.
        edge = np.max(directions @ (outline - middle).T, axis=1)
        own = np.abs(directions) @ half
        ahead = (edge + own)[:, None] * directions
        candidates = (middle + ahead[None] + gaps[:, None, None] * directions).reshape(-1, 2)
        # Of places as near, the one farther outside.
        outwards = directions @ (middle - centre) / (np.linalg.norm(middle - centre) + scale)
        free = ground.free(candidates, half) & _clear(candidates, half, found, leads)
        candidates, outwards = candidates[free], np.tile(outwards, len(gaps))[free]
        apart, feet = _apart(candidates, half, edges[number])
        others = np.vstack([np.zeros((0, 2)), *edges[:number], *edges[number + 1 :]])
        clear, unclear = apart - 0.02 * outwards * scale, apart + (_UNCLEAR - 0.02 * outwards) * scale
        # The cheapest first; whether another subject is nearer, which costs more, is asked of those reached.
        queue = [(cost, k, False) for k, cost in enumerate(clear.tolist())]
        heapq.heapify(queue)
        place = None
        while queue:
            _, k, is_unclear = heapq.heappop(queue)
            if not is_unclear and _nearest(candidates[k], half, others) < apart[k] + _AS_NEAR * scale:
                heapq.heappush(queue, (float(unclear[k]), k, True))
                continue
            foot = feet[k]
            if apart[k] <= _FAR * scale and not is_unclear:
                place = Place(candidates[k], half, None)
                break
            lead = _sampled([np.array([foot, candidates[k]])], cell)
            if _clear(lead, np.full(2, pad), found, leads).all():
                place = Place(candidates[k], half, foot)
                leads = np.vstack([leads, lead])
                break
        if place is None:  # no place within reach is free: far above everything there is one
            across = np.linspace(ground.low[0] + half[0], ground.high[0] - half[0], 200)
            above = np.column_stack([across, np.full(len(across), ground.high[1] - half[1])])
            above = above[_clear(above, half, found, leads)]
            place = Place(above[np.argmin(np.abs(above[:, 0] - middle[0]))], half, middle)
        found.append(place)
    return found


def _sampled(lines: Sequence[Array], spacing: float) -> Array:
    """Points along polylines (k, 2), no farther apart than `spacing`, (P, 2)."""
    starts = np.vstack([line[: max(1, len(line) - 1)] for line in lines])
    ends = np.vstack([line[1:] if len(line) > 1 else line for line in lines])
    known = np.isfinite(starts).all(axis=1) & np.isfinite(ends).all(axis=1)
    starts, ends = starts[known], ends[known]
    counts = 1 + (np.linalg.norm(ends - starts, axis=1) // spacing).astype(int)
    first = np.repeat(np.cumsum(counts) - counts, counts)
    shares = (np.arange(counts.sum()) - first) / np.repeat(counts, counts)
    points = np.repeat(starts, counts, axis=0) + shares[:, None] * np.repeat(ends - starts, counts, axis=0)
    return np.vstack([points, ends])


def _apart(middles: Array, half: Array, points: Array) -> tuple[Array, Array]:
    """How far boxes around `middles` (P, 2) are from the nearest of points, (P,) m, and that, (P, 2)."""
    away = _distances(middles[:, None], half, points)
    nearest = np.argmin(away, axis=1)
    return away[np.arange(len(away)), nearest], points[nearest]


def _nearest(middle: Array, half: Array, points: Array) -> float:
    """How far a box is from the nearest of points, m; inf from none."""
    return float(_distances(middle, half, points).min(initial=np.inf))


def _distances(middles: Array, half: Array, points: Array) -> Array:
    away: Array = np.hypot(*np.moveaxis(np.maximum(np.abs(middles - points) - half, 0.0), -1, 0))
    return away


def _clear(middles: Array, half: Array, texts: Sequence[Place], leads: Array) -> Flags:
    """Which of the boxes around `middles` (P, 2) touch no text and none of the points of lines to texts."""
    taken = np.array([text.middle for text in texts]).reshape(-1, 2)
    room = half + np.array([text.half for text in texts]).reshape(-1, 2)
    touched = np.all(np.abs(middles[:, None] - taken) < room, axis=2).any(axis=1)
    crossed = np.all(np.abs(middles[:, None] - leads) < half, axis=2).any(axis=1)
    return ~(touched | crossed)


class Ground:
    """The occupied cells, of side `cell`, m, of a grid from low to high (2,), m, around lines (k, 2) and
    convex, counter-clockwise outlines (k, 2), m; `scale` is about the m per inch."""

    def __init__(self, lines: Sequence[Array], shapes: Sequence[Array], scale: float) -> None:
        self.cell = 0.25 * _LINE * scale
        edges = [np.vstack([shape, shape[:1]]) for shape in shapes]
        marked = _sampled([*lines, *edges], self.cell)
        room = 1.5 * _FARTHEST * scale
        self.low, self.high = marked.min(axis=0) - room, marked.max(axis=0) + room
        self._taken = np.zeros(np.ceil((self.high - self.low) / self.cell).astype(int) + 2, dtype=np.int32)
        index = ((marked - self.low) // self.cell).astype(int)
        self._taken[index[:, 0], index[:, 1]] = 1
        for shape in shapes:
            self._fill(shape)
        self._sums = np.zeros(np.add(self._taken.shape, 1), dtype=np.int32)
        self._sums[1:, 1:] = self._taken.cumsum(axis=0).cumsum(axis=1)

    def _fill(self, outline: Array) -> None:
        if len(outline) < 3:
            return
        first = ((outline.min(axis=0) - self.low) // self.cell).astype(int)
        last = ((outline.max(axis=0) - self.low) // self.cell).astype(int) + 1
        x, y = (self.low[k] + (np.arange(first[k], last[k]) + 0.5) * self.cell for k in range(2))
        (dx, dy), (a, b) = (np.roll(outline, -1, axis=0) - outline).T, outline.T
        # To the left of every edge: dx (y - b) - dy (x - a) >= 0.
        left = (dx * y[:, None] - dx * b)[None] - (dy * x[:, None] - dy * a)[:, None]
        self._taken[first[0] : last[0], first[1] : last[1]] |= (left >= 0.0).all(axis=2)

    def free(self, middles: Array, half: Array) -> Flags:
        """Which of the boxes around `middles` (P, 2) are empty, (P,)."""
        last = np.array(self._taken.shape)
        a = (((middles - half - self.low) // self.cell).astype(int)).clip(0, last)
        b = (((middles + half - self.low) // self.cell).astype(int) + 1).clip(0, last)
        held = (
            self._sums[b[:, 0], b[:, 1]] - self._sums[a[:, 0], b[:, 1]]
            - self._sums[b[:, 0], a[:, 1]] + self._sums[a[:, 0], a[:, 1]]
        )  # fmt: skip
        empty: Flags = held == 0
        return empty
