"""The singular sets of a map, drawn over it, and their legend."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patheffects import withStroke

from nmm import looks
from nmm.analysis.maps.result import Map
from nmm.analysis.maps.singular_set import SingularSet
from nmm.arrays import Array

#: A line may be drawn so far, of the map's side, beside its points: a tenth of a pixel.
THIN = 1.5e-4
#: More points than this fill a region: dots, so small that the map is seen between them.
MANY = 60


def draw_sets(axes: Axes, drawn: Map) -> None:
    """The singular sets: the arm's below, dashed; what is left of it above, solid."""
    own = "robot" if drawn.arm_singular is not None else drawn.about.part
    if drawn.arm_singular is not None:
        _draw_set(axes, drawn, drawn.arm_singular, "arm alone", "white")
    _draw_set(axes, drawn, drawn.singular, own, looks.VERMILLION)


def _draw_set(axes: Axes, drawn: Map, those: SingularSet, name: str, color: str) -> None:
    """Lines and points with an edge that shows them on any colour; one legend entry, which says if none."""
    white = color == "white"
    edge = looks.BLACK if white else "white"
    width = 1.1 if white else 1.8
    halo = [withStroke(linewidth=width + 1.2, foreground=edge)]
    label = f"{name} singular" + (f": {those.text()}" if those.empty or those.everywhere else "")
    spans = np.array([float(np.ptp(axis)) for axis in drawn.axes])
    for line in those.lines:
        # Unsnapped: line and halo would go to different pixels.
        axes.plot(
            *thinned(line, spans * THIN).T,
            "--" if white else "-",
            color=color,
            linewidth=width,
            label=label,
            path_effects=halo,
            clip_on=False,
            snap=False,
        )
        label = "_"
    if len(those.points):
        many = len(those.points) > MANY
        axes.plot(
            *those.points.T,
            "o" if white or many else "X",
            linestyle="none",
            color=color,
            markersize=2.3 if many else 2.5 if white else 6.5,
            markeredgecolor=looks.BLACK if white or many else "white",
            markeredgewidth=0.5 if many else 0.7,
            label=label,
            clip_on=False,
        )
    elif not those.lines:
        axes.plot([], [], " ", label=label)


def thinned(line: Array, tolerance: Array) -> Array:
    """Those points of a line (k, 2) that its shape needs (D. Douglas and T. Peucker, 1973).

    Parameters
    ----------
    tolerance (2,) : how far along either axis the others may be from what is left
    """
    points = line / tolerance
    kept = np.zeros(len(line), dtype=bool)
    kept[[0, -1]] = True
    pieces = [(0, len(line) - 1)]
    while pieces:
        first, last = pieces.pop()
        if last - first < 2:
            continue
        chord, offsets = points[last] - points[first], points[first + 1 : last] - points[first]
        # To the piece of the straight line: a closed curve's chord is a point.
        share = np.clip(offsets @ chord / max(float(chord @ chord), 1e-300), 0.0, 1.0)
        apart = np.linalg.norm(offsets - share[:, np.newaxis] * chord, axis=1)
        farthest = int(np.argmax(apart))
        if apart[farthest] > 1.0:
            middle = first + 1 + farthest
            kept[middle] = True
            pieces += [(first, middle), (middle, last)]
    return np.asarray(line[kept])
