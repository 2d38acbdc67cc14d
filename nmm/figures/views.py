"""Scenes seen along a direction: from above and, where there is something to see, from the side."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from nmm.arrays import Array
from nmm.figures import style

#: Room for the x axis' label between two views, in, and between two ticks.
_BETWEEN, _TICKS = 0.2, 0.25
#: Around what is drawn, of the view's longer side.
_MARGIN = 0.04
#: A way is along an axis of the world within this angle, rad; one that is wider than this share of its length
#: has no direction.
_ALONG, _WIDE = np.radians(15.0), 0.4


@dataclass(frozen=True)
class View:
    """Which directions of the world a drawing shows.

    Attributes
    ----------
    across, up : of length 1, across the page and up the page, in world axes
    labels : of the axes
    """

    across: tuple[float, float, float]
    up: tuple[float, float, float]
    labels: tuple[str, str]

    @property
    def rows(self) -> Array:
        """Both directions, (2, 3)."""
        return np.array([self.across, self.up])

    def of(self, points: Array) -> Array:
        """Points (..., 3) of the world as they are seen, (..., 2), m."""
        seen: Array = points @ self.rows.T
        return seen


ABOVE = View((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), ("x [m]", "y [m]"))
SIDE = View((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), ("x [m]", "z [m]"))


def upright(path: Array) -> View:
    """The upright plane in which a path (k, 3) lies most nearly; that of x and z where it has no direction.

    Across is x or y where the path is nearly along one of them.
    """
    ground = path[np.isfinite(path).all(axis=1), :2]
    if len(ground) < 2:
        return SIDE
    _, spans, directions = np.linalg.svd(ground - ground.mean(axis=0), full_matrices=False)
    if len(spans) < 2 or not spans[1] <= _WIDE * spans[0] or np.ptp(ground, axis=0).max() < 1e-3:
        return SIDE
    # Of both directions the one towards x, or towards y where the path is along y.
    angle = float(np.arctan2(directions[0, 1], directions[0, 0]))
    angle = (angle + _ALONG) % np.pi - _ALONG
    angle = angle - np.pi if angle > 0.5 * np.pi + _ALONG else angle
    if abs(angle) <= _ALONG:
        return SIDE
    if abs(angle - 0.5 * np.pi) <= _ALONG:
        return View((0.0, 1.0, 0.0), SIDE.up, ("y [m]", "z [m]"))
    degrees = round(np.degrees(angle))
    across = (float(np.cos(np.radians(degrees))), float(np.sin(np.radians(degrees))), 0.0)
    return View(across, SIDE.up, (f"along {style.number(degrees)}° from x [m]", "z [m]"))


class Viewed(ABC):
    """What is drawn in one or two views to the same scale across.

    Attributes
    ----------
    views : those in which there is something to see, the one from above first
    on_the_ground : whether a view from the side reaches down to it
    """

    views: tuple[View, ...]
    on_the_ground = True

    @property
    @abstractmethod
    def names(self) -> list[str]:
        """The entries of its legend."""

    @abstractmethod
    def points(self, view: View, width: float) -> list[Array]:
        """What a view holds that is drawn `width` in wide, (k, 2) each, m."""

    @abstractmethod
    def draw(self, axes: Axes, view: View) -> None:
        """Draw the scene as it is seen in a view."""

    def limits(self, view: View, width: float) -> list[tuple[float, float]]:
        """Limits of both axes that hold everything, with a margin that is the same on all sides, m."""
        found = np.vstack([part[np.all(np.isfinite(part), axis=1)] for part in self.points(view, width)])
        low, high = found.min(axis=0), found.max(axis=0)
        if view != ABOVE and view.across == ABOVE.across and ABOVE in self.views:
            # One above the other: x is where it is.
            above = np.vstack(self.points(ABOVE, width))[:, 0]
            low[0], high[0] = np.nanmin(above), np.nanmax(above)
        if view.up == SIDE.up and self.on_the_ground:
            low[1] = min(low[1], 0.0)
        margin = _MARGIN * float(np.max(high - low))
        return [(float(a) - margin, float(b) + margin) for a, b in zip(low, high, strict=True)]

    def height(self, view: View, width: float) -> float:
        """How high a view is that has this width, in."""
        (left, right), (low, high) = self.limits(view, width)
        return width * (high - low) / (right - left)

    def dress(self, axes: Axes, view: View) -> None:
        """Name the axes, a metre as long up the page as across it, and let them hold everything."""
        style.label(axes, x=view.labels[0], y=view.labels[1])
        axes.set_aspect("equal", adjustable="box")
        width, height = style.inches(axes)
        horizontal, vertical = self.limits(view, width)
        axes.set_xlim(*horizontal)
        axes.set_ylim(*vertical)
        for axis, room in ((axes.xaxis, width), (axes.yaxis, height)):
            most = int(np.clip(room / _TICKS, 3, 9))
            axis.set_major_locator(MaxNLocator(nbins=most, steps=[1, 2, 5, 10]))


def page(scene: Viewed, width: float, above: float = 0.0) -> Figure:
    """A figure of a scene's views one above the other, its legend above the first.

    Parameters
    ----------
    width : of the figure, in
    above : room left free above the legend, in
    """
    across = width - style.LEFT - style.RIGHT
    heights = [scene.height(view, across) for view in scene.views]
    legends = [style.legend_rows(scene.names, across), *[1] * (len(heights) - 1)]
    top = style.BOTTOM + style.column_height(heights, legends) + _BETWEEN * (len(heights) - 1)
    made = style.figure(width, top + above)
    for index, (view, height, rows) in enumerate(zip(scene.views, heights, legends, strict=True)):
        top -= style.room(rows) + height
        axes = style.place(made, style.LEFT, top, across, height)
        scene.draw(axes, view)
        if index == 0:
            style.legend(axes)
        top -= _BETWEEN
    return style.aligned(made)
