"""Where the times stand in a drawing of a motion: beside what they belong to, on nothing that is drawn."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes

from nmm.base.arrays import Array, Flags
from nmm.views.figures import style

#: Size of the text, pt, and what a character and a line take at most, in.
SIZE = style.SMALL - 1.0
_CHARACTER, _LINE = 0.66 * SIZE / 72.0, 0.95 * SIZE / 72.0
#: Room around a text, in.
_PAD = 0.03
#: A text that is farther from its subject than this has a line that leads there, in.
_FAR = 0.16
#: Where another subject is as near but for so much, a text stands rather so much farther from its own, in.
_AS_NEAR, _UNCLEAR = 0.08, 0.3
#: Where a text is tried: so many directions, so many distances, the farthest, in.
_DIRECTIONS, _DISTANCES, _FARTHEST = 40, 24, 2.0


class LabelSubject(NamedTuple):
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


def places(subjects: Sequence[LabelSubject], ground: OccupiedCells, scale: float) -> list[Place]:
    """Places near the subjects, clear of the drawing (`ground`) and of each other; `scale`: m per page
    inch."""
    pad, cell = _PAD * scale, ground.cell
    leads = np.zeros((0, 2))
    angles = np.linspace(0.0, 2.0 * np.pi, _DIRECTIONS, endpoint=False)
    directions = np.column_stack([np.cos(angles), np.sin(angles)])
    gaps = np.concatenate([[0.0], np.geomspace(0.02, _FARTHEST, _DISTANCES - 1)]) * scale
    centre = 0.5 * (ground.low + ground.high)
    placed: list[Place] = []
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
        free = ground.free(candidates, half) & _clear(candidates, half, placed, leads)
        candidates, outwards = candidates[free], np.tile(outwards, len(gaps))[free]
        apart, feet = _apart(candidates, half, edges[number])
        others = np.vstack([np.zeros((0, 2)), *edges[:number], *edges[number + 1 :]])
        unclear = _apart(candidates, half, others)[0] < apart + _AS_NEAR * scale
        place = None
        for k in np.argsort(apart + (_UNCLEAR * unclear - 0.02 * outwards) * scale, kind="stable"):
            if apart[k] <= _FAR * scale and not unclear[k]:
                place = Place(candidates[k], half, None)
                break
            lead = _sampled([np.array([feet[k], candidates[k]])], cell)
            if _clear(lead, np.full(2, pad), placed, leads).all():
                place = Place(candidates[k], half, feet[k])
                leads = np.vstack([leads, lead])
                break
        if place is None:  # no place within reach is free: far above everything there is one
            across = np.linspace(ground.low[0] + half[0], ground.high[0] - half[0], 200)
            above = np.column_stack([across, np.full(len(across), ground.high[1] - half[1])])
            above = above[_clear(above, half, placed, leads)]
            place = Place(above[np.argmin(np.abs(above[:, 0] - middle[0]))], half, middle)
        placed.append(place)
    return placed


def _sampled(lines: Sequence[Array], spacing: float) -> Array:
    """Points along polylines (k, 2), no farther apart than `spacing`, (P, 2)."""
    points = [np.zeros((0, 2))]
    for line in lines:
        way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
        along = np.linspace(0.0, way[-1], 2 + int(way[-1] // spacing))
        points.append(np.column_stack([np.interp(along, way, axis) for axis in line.T]))
    return np.vstack(points)


def _apart(middles: Array, half: Array, points: Array) -> tuple[Array, Array]:
    """How far boxes around `middles` (P, 2) are from the nearest of points, (P,) m, and that, (P, 2); inf
    from none."""
    points = np.vstack([points, np.full((1, 2), np.inf)])
    away = np.hypot(*np.moveaxis(np.maximum(np.abs(middles[:, None] - points) - half, 0.0), -1, 0))
    return away.min(axis=1), points[away.argmin(axis=1)]


def _clear(middles: Array, half: Array, texts: Sequence[Place], leads: Array) -> Flags:
    """Which of the boxes around `middles` (P, 2) touch no text and none of the points of lines to texts."""
    taken = np.array([text.middle for text in texts]).reshape(-1, 2)
    room = half + np.array([text.half for text in texts]).reshape(-1, 2)
    touched = np.all(np.abs(middles[:, None] - taken) < room, axis=2).any(axis=1)
    crossed = np.all(np.abs(middles[:, None] - leads) < half, axis=2).any(axis=1)
    return ~(touched | crossed)


class OccupiedCells:
    """The occupied cells, of side `cell`, m, of a grid around a drawing from low to high (2,), m: the pixels
    of a picture of it, at `scale` m per inch, that are not white."""

    def __init__(self, draw: Callable[[Axes], None], low: Array, high: Array, scale: float) -> None:
        inches = 0.25 * _LINE
        self.cell, room = inches * scale, 1.5 * _FARTHEST * scale
        self.low, self.high = low - room, high + room
        made = style.figure(*((self.high - self.low) / scale))
        made.set_dpi(1.0 / inches)
        axes = made.add_axes((0.0, 0.0, 1.0, 1.0))
        axes.set_axis_off()
        axes.set(xlim=(self.low[0], self.high[0]), ylim=(self.low[1], self.high[1]))
        draw(axes)
        made.canvas.draw()
        pixels = np.asarray(made.canvas.buffer_rgba())  # type: ignore[attr-defined]  # of Agg
        taken = (pixels[::-1, :, :3] < 250).any(axis=2).T
        self._sums = np.pad(taken.cumsum(axis=0).cumsum(axis=1), ((1, 0), (1, 0)))

    def free(self, middles: Array, half: Array) -> Flags:
        """Which of the boxes around `middles` (P, 2) are empty, (P,)."""
        last = np.array(self._sums.shape) - 1
        a = (((middles - half - self.low) // self.cell).astype(int)).clip(0, last)
        b = (((middles + half - self.low) // self.cell).astype(int) + 1).clip(0, last)
        sums = self._sums
        held = (
            sums[b[:, 0], b[:, 1]] - sums[a[:, 0], b[:, 1]] - sums[b[:, 0], a[:, 1]] + sums[a[:, 0], a[:, 1]]
        )
        return np.asarray(held == 0)
