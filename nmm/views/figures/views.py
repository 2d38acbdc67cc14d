"""Scenes seen from above and, where that shows something, from the side; among them the paths of runs."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from nmm.base import resolver_style
from nmm.base.arrays import Array
from nmm.motion.trajectory import Trajectory
from nmm.views.figures import style
from nmm.views.figures.seen_points import DrawnPoints
from nmm.views.playback.placements import base_position

#: Room for the x axis' label between two views, in, and between two ticks.
_BETWEEN, _TICKS = 0.2, 0.25
#: Around what is drawn, of the view's longer side.
_MARGIN = 0.04
#: A way is along an axis of the world within this angle, rad; one that is wider than this share of its length
#: has no direction.
_ALONG, _WIDE = np.radians(15.0), 0.4
#: Paths that rise or fall by more than this are drawn from the side too, m.
_RISES = 0.01
#: The least height of a drawing is twice this share of its width.
_FLAT = 0.1
_DESIRED = "#C3C8D0"
#: What legends call a path by odometry, or by a filter.
BELIEVED = "where it is believed to be"


@dataclass(frozen=True)
class View:
    """Which directions of the world a drawing shows: across the page and up the page, of length 1."""

    across: tuple[float, float, float]
    up: tuple[float, float, float]
    labels: tuple[str, str]

    @property
    def rows(self) -> Array:
        return np.array([self.across, self.up])

    def of(self, points: Array) -> Array:
        """Points (..., 3) of the world projected into the view, (..., 2), m."""
        seen: Array = points @ self.rows.T
        return seen


ABOVE = View((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), ("x [m]", "y [m]"))
SIDE = View((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), ("x [m]", "z [m]"))


def upright(path: Array) -> View:
    """The vertical plane that fits a path (k, 3) best, x-z or y-z if near; x-z without a direction."""
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
    """A scene in one or two views with a common scale across, the one from above first."""

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
        points = np.vstack([part[np.all(np.isfinite(part), axis=1)] for part in self.points(view, width)])
        low, high = points.min(axis=0), points.max(axis=0)
        if view != ABOVE and view.across == ABOVE.across and ABOVE in self.views:
            # One above the other: x is where it is.
            above = np.vstack(self.points(ABOVE, width))[:, 0]
            low[0], high[0] = np.nanmin(above), np.nanmax(above)
        if view.up == SIDE.up and self.on_the_ground:
            low[1] = min(low[1], 0.0)
        margin = _MARGIN * float(np.max(high - low))
        return [(float(a) - margin, float(b) + margin) for a, b in zip(low, high, strict=True)]

    def height(self, view: View, width: float) -> float:
        (left, right), (low, high) = self.limits(view, width)
        return width * (high - low) / (right - left)

    def dress(self, axes: Axes, view: View) -> None:
        """Name the axes, a metre as long up the page as across it, and let them hold everything."""
        style.label(axes, x=view.labels[0], y=view.labels[1])
        axes.set_aspect("equal", adjustable="box")
        room = style.inches(axes)
        horizontal, vertical = self.limits(view, room[0])
        axes.set(xlim=horizontal, ylim=vertical)
        for axis, inches in zip((axes.xaxis, axes.yaxis), room, strict=True):
            most = int(np.clip(inches / _TICKS, 3, 9))
            axis.set_major_locator(MaxNLocator(nbins=most, steps=[1, 2, 5, 10]))


def page(scene: Viewed, width: float, above: float = 0.0) -> Figure:
    """A figure `width` in wide of the views above each other; `above` in are left free above the legend."""
    across = width - style.LEFT - style.RIGHT
    heights = [scene.height(view, across) for view in scene.views]
    legends = [style.legend_rows(scene.names, across), *[1] * (len(heights) - 1)]
    top = style.BOTTOM + style.column_height(heights, legends) + _BETWEEN * (len(heights) - 1)
    made = style.figure(width, top + above)
    draw_views(made, scene, across, top, between=_BETWEEN)
    return style.aligned(made)


def draw_views(
    made: Figure,
    scene: Viewed,
    width: float,
    top: float,
    *,
    bottom: float = -np.inf,
    tallest: float = np.inf,
    between: float = style.BOTTOM,
) -> float:
    """Draw the views that fit, downwards, the legend above the first; returns the top of the room left. All
    lengths in inches; no view is wider than `width` or taller than `tallest`."""
    heights = [scene.height(view, width) for view in scene.views]
    parts = [min(1.0, tallest / tall) for tall in heights]
    # What one view has above another is at the same x.
    aligned = min(
        part for view, part in zip(scene.views, parts, strict=True) if view.across == scene.views[0].across
    )
    for index, view in enumerate(scene.views):
        tall = heights[index]
        height = tall * (aligned if view.across == scene.views[0].across else parts[index])
        if index and top - style.GAP - height < bottom - 1e-6:
            break
        top -= style.room(1 if index else style.legend_rows(scene.names, width)) + height
        axes = style.place(made, style.LEFT, top, width * height / tall, height)
        scene.draw(axes, view)
        if index == 0:
            style.legend(axes, width)
        top -= between
    return top


class Paths(Viewed):
    """The frames' and the platforms' paths of runs, each with a look, and those of platforms where they are
    believed to be; what is desired, targets, and what cameras see."""

    on_the_ground = False

    def __init__(self, runs: Sequence[Trajectory], worn: Sequence[resolver_style.RunStyle]) -> None:
        self._worn = worn
        self._desired, self._held = runs[0].moving, runs[0].held
        self._frames = [run.frame for run in runs]
        self._seen = DrawnPoints(runs)
        self._paths = [run.path for run in runs]
        self._floors = [_on_the_floor(run, run.q) for run in runs]
        self._believed = [_on_the_floor(run, run.believed) for run in runs]
        risen = [path for path in (*self._paths, self._desired) if path is not None]
        rises = any(float(np.ptp(path[:, 2])) > _RISES for path in risen)
        self.views = (ABOVE, upright(risen[-1])) if rises else (ABOVE,)

    @property
    def names(self) -> list[str]:
        names = ["target"] * bool(len(self._held)) + ["desired path"] * (self._desired is not None)
        names += self._seen.names
        for i, (name, *_) in enumerate(self._worn):
            names += [f"{name}: {self._frames[i]}"] * (self._paths[i] is not None)
            names += [f"{name}: platform"] * (self._floors[i] is not None)
            names += [f"{name}: {BELIEVED}"] * (self._believed[i] is not None)
        return names

    def points(self, view: View, width: float) -> list[Array]:
        floors = [*self._floors, *self._believed] if view == ABOVE else []
        parts = [self._held, self._desired, *self._seen.parts, *self._paths, *floors]
        points = np.vstack([view.of(part) for part in parts if part is not None and len(part)])
        low, high = np.nanmin(points, axis=0), np.nanmax(points, axis=0)
        middle, half = 0.5 * (low + high), max(0.05, _FLAT * float(np.max(high - low)))
        return [points, np.array([middle - half, middle + half])]

    def draw(self, axes: Axes, view: View) -> None:
        self.dress(axes, view)
        style.mark_targets(axes, view.of(self._held))
        self._seen.draw(axes, view.of)
        if self._desired is not None:
            axes.plot(*view.of(self._desired).T, color=_DESIRED, linewidth=5.0, label="desired path")
        for i, (name, color, dashes) in enumerate(self._worn):
            # The later ones are thinner: those below are seen where they run the same way.
            below = len(self._worn) - 1 - i
            for path, whose, thick in (
                (self._paths[i], self._frames[i], 1.5 + style.WIDER * below),
                (self._floors[i], "platform", 0.8 + 0.5 * below),
            ):
                if path is not None and (whose != "platform" or view == ABOVE):
                    axes.plot(
                        *view.of(path).T, dashes, color=color, linewidth=thick, label=f"{name}: {whose}"
                    )
            if (believed := self._believed[i]) is not None and view == ABOVE:
                axes.plot(*view.of(believed).T, ":", color=color, linewidth=1.2, label=f"{name}: {BELIEVED}")


def _on_the_floor(run: Trajectory, q: Array | None) -> Array | None:
    """Where the platform has been (N, 3), with q (N, n); None for an arm on the ground."""
    if q is None or not run.robot.platform.n_p:
        return None
    return np.column_stack([base_position(run.robot, q), np.zeros(len(run))])
