"""Scenes seen along the world's axes: from above and, where there is something to see, from the side."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from nmm.arrays import Array
from nmm.figures import style

#: A view's world axes: across the page, up the page.
View = tuple[int, int]
ABOVE, SIDE = (0, 1), (0, 2)
_AXES = "xyz"
#: Room for the x axis' label between two views, in, and between two ticks.
_BETWEEN, _TICKS = 0.2, 0.25
#: Around what is drawn, of the view's longer side.
_MARGIN = 0.04


class Viewed(ABC):
    """What is drawn in one or two views to the same scale across.

    Attributes
    ----------
    views : those in which there is something to see
    """

    views: tuple[View, ...]

    @property
    @abstractmethod
    def names(self) -> list[str]:
        """The entries of its legend."""

    @abstractmethod
    def points(self, view: View) -> list[Array]:
        """What a view holds, (k, 2) each, m."""

    @abstractmethod
    def draw(self, axes: Axes, view: View) -> None:
        """Draw the scene seen along the world axis that `view` leaves out."""

    def limits(self, view: View) -> list[tuple[float, float]]:
        """Limits of both axes that hold everything, with a margin that is the same on all sides, m."""
        found = np.vstack([part[np.all(np.isfinite(part), axis=1)] for part in self.points(view)])
        low, high = found.min(axis=0), found.max(axis=0)
        if view == SIDE:
            low[1] = min(low[1], 0.0)
        margin = _MARGIN * float(np.max(high - low))
        return [(float(a) - margin, float(b) + margin) for a, b in zip(low, high, strict=True)]

    def height(self, view: View, width: float) -> float:
        """How high a view is that has this width, in the same unit."""
        (left, right), (low, high) = self.limits(view)
        return width * (high - low) / (right - left)

    def dress(self, axes: Axes, view: View) -> None:
        """Name the axes, a metre as long up the page as across it, and let them hold everything."""
        across, up = view
        style.label(axes, x=f"{_AXES[across]} [m]", y=f"{_AXES[up]} [m]")
        axes.set_aspect("equal", adjustable="box")
        horizontal, vertical = self.limits(view)
        axes.set_xlim(*horizontal)
        axes.set_ylim(*vertical)
        room = axes.get_window_extent()
        for axis, pixels in ((axes.xaxis, room.width), (axes.yaxis, room.height)):
            most = int(np.clip(pixels / style.DPI / _TICKS, 3, 9))
            axis.set_major_locator(MaxNLocator(nbins=most, steps=[1, 2, 5, 10]))


def page(scene: Viewed, above: float = 0.0) -> Figure:
    """A figure of a scene's views one above the other, a page wide, its legend above the first.

    Parameters
    ----------
    above : room left free above the legend, in
    """
    across = style.PAGE - style.LEFT - style.RIGHT
    heights = [scene.height(view, across) for view in scene.views]
    legends = [style.legend_rows(scene.names, across), *[1] * (len(heights) - 1)]
    top = style.BOTTOM + style.column_height(heights, legends) + _BETWEEN * (len(heights) - 1)
    made = style.figure(style.PAGE, top + above)
    for index, (view, height, rows) in enumerate(zip(scene.views, heights, legends, strict=True)):
        top -= style.room(rows) + height
        axes = style.place(made, style.LEFT, top, across, height)
        scene.draw(axes, view)
        if index == 0:
            style.legend(axes)
        top -= _BETWEEN
    return made
