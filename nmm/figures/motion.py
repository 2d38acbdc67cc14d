"""Stroboscopic views: the robot drawn at instants of a run, from above and from the side."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from nmm import looks
from nmm.arrays import Array
from nmm.errors import InputError
from nmm.figures import style
from nmm.figures.hulls import Covered, along, hull
from nmm.figures.obstacles import FAINTEST, OBSTACLE, OBSTACLE_TEXT, outlines, with_the_nearest
from nmm.figures.silhouette import Pose, Silhouette
from nmm.figures.views import ABOVE, SIDE, View, Viewed, page
from nmm.playback.placements import base_position
from nmm.runs.trajectory import Trajectory

#: Distance of a time's label from what it belongs to, as a share of the figure's larger side.
_LABEL = 0.03
#: Such a label is wider than high: distances across count less.
_FLAT = (0.35, 1.0)
#: When no instants are given: at most so many, at least so many, a platform's length apart.
MOST, LEAST = 11, 4
#: A run whose arm rises or falls by more than this is drawn from the side too, m.
_RISES = 0.01
_PATH_COLOR, _BODY, _EDGE, _ARM = looks.BLUE, "#B9C0CA", "#3F4652", looks.VERMILLION


def stroboscopic(trajectory: Trajectory, instants: ArrayLike | int | None = None) -> Figure:
    """The robot seen from above at instants of the run (the paper's Figs. 3, 5 and 7).

    Platform with wheels and heading, arm, end-effector's path, desired path, start, end and the
    target, looked at or held; drawings fade towards the start. A second view from the side, with the
    same x axis, where the arm leaves the plane.

    Parameters
    ----------
    trajectory : the run, of at least one sample
    instants : times to draw at, s, or how many, evenly spaced; when not given 11, or fewer where
        they would cover each other

    Raises
    ------
    InputError : no sample; an instant outside the run
    """
    return page(Scene(trajectory, instants))


class Scene(Viewed):
    """What is drawn of a run: the robot's poses, its paths, its marks."""

    def __init__(self, trajectory: Trajectory, instants: ArrayLike | int | None = None) -> None:
        if not len(trajectory):
            raise InputError("figure of the motion: expected a run with at least one sample, got none")
        self.trajectory = trajectory
        silhouette = Silhouette(trajectory.robot, trajectory.frame)
        if instants is None:
            wanted = _instants(trajectory.t, _how_many(trajectory, silhouette))
            wanted = with_the_nearest(trajectory, wanted)
        else:
            wanted = _instants(trajectory.t, instants)
        samples = np.unique(np.searchsorted(trajectory.t, wanted - 1e-9).clip(0, len(trajectory) - 1))
        self.times = trajectory.t[samples]
        self.poses: list[Pose] = [silhouette.at(trajectory.q[k]) for k in samples]
        self.lines = _lines(trajectory)
        self.outlines = outlines(trajectory, self.times)
        solid = [hull(outline.points[:, :2]) for outline in self.outlines]
        self.labels = _label_places(self.poses, list(self.lines.values()), solid)
        heights = np.array([[*pose.joints[:, 2], *pose.tip[:, 2]] for pose in self.poses])
        rises = heights.size > 0 and float(np.ptp(heights, axis=0).max()) > _RISES
        self.views = (ABOVE, SIDE) if rises else (ABOVE,)

    @property
    def names(self) -> list[str]:
        """The entries of its legend."""
        names = ["desired path"] if "desired" in self.lines else []
        names += [self._path_name, "start", "end", *["obstacle"] * bool(self.outlines)]
        return names if not len(self.trajectory.marks) else [*names, "target"]

    @property
    def _path_name(self) -> str:
        return f"path of {self.trajectory.frame}" if self.trajectory.frame else "path of the platform"

    def points(self, view: View) -> list[Array]:
        """Robots, paths, labels and target."""
        points = [*(pose.points() for pose in self.poses), *self.lines.values()]
        if view == ABOVE:
            points.append(np.column_stack([self.labels, np.zeros(len(self.labels))]))
        points += [outline.points for outline in self.outlines]
        points.append(self.trajectory.marks)
        return [part[:, view] for part in points]

    def draw(self, axes: Axes, view: View) -> None:
        """Draw the scene seen along the world axis that `view` leaves out."""
        across, up = view
        trajectory = self.trajectory
        self.dress(axes, view)
        strengths = np.linspace(FAINTEST, 1.0, len(self.poses)) if len(self.poses) > 1 else [1.0]
        for k, (pose, strength) in enumerate(zip(self.poses, strengths, strict=True)):
            # From the side the robots of a round path stand behind each other: every second one is enough.
            if view == SIDE and len(self.poses) > 6 and (len(self.poses) - 1 - k) % 2:
                continue
            _draw_pose(axes, pose, view, float(strength), k / len(self.poses))
            if view == ABOVE:
                axes.text(
                    float(self.labels[k, 0]), float(self.labels[k, 1]),
                    _seconds(float(self.times[k])), color=style.GREY,
                    fontsize=style.SMALL - 1.0, ha="center", va="center", zorder=7,
                )  # fmt: skip
        for k, outline in enumerate(self.outlines):
            shade, edge = _faded(OBSTACLE, outline.strength), hull(outline.points[:, view])
            axes.fill(
                *edge.T, facecolor=(*shade, 0.25), edgecolor=shade, linewidth=1.0,
                zorder=2.5, label=None if k else "obstacle",
            )  # fmt: skip
            if view == ABOVE and outline.times is not None:
                x, y = 0.5 * (edge.min(axis=0) + edge.max(axis=0))
                axes.text(
                    float(x), float(y), _span(*outline.times), color=OBSTACLE_TEXT,
                    fontsize=style.SMALL - 1.0, ha="center", va="center", zorder=7,
                )  # fmt: skip
        desired, path = self.lines.get("desired"), self.lines.get("path")
        if desired is not None:
            axes.plot(
                desired[:, across], desired[:, up], "--", color=looks.BLACK, linewidth=1.1,
                dashes=(4, 2.5), label="desired path", zorder=5.2,
            )  # fmt: skip
        if path is not None:
            axes.plot(
                path[:, across], path[:, up], color=_PATH_COLOR, linewidth=1.5, label=self._path_name,
                zorder=5.1,
            )  # fmt: skip
            for point, marker, text in ((path[0], "o", "start"), (path[-1], "s", "end")):
                axes.plot(
                    point[across], point[up], marker, color=looks.GREEN if text == "start" else looks.PINK,
                    markersize=6, markeredgecolor="white", markeredgewidth=0.8, label=text,
                    linestyle="none", zorder=6,
                )  # fmt: skip
        marks = trajectory.marks
        if len(marks):
            axes.plot(
                marks[:, across], marks[:, up], "*", color=looks.ORANGE, markersize=12,
                markeredgecolor=looks.BLACK, markeredgewidth=0.7, label="target", linestyle="none", zorder=6,
            )  # fmt: skip


def _seconds(t: float) -> str:
    return f"{style.number(round(t, 2))} s"


def _span(first: float, last: float) -> str:
    return _seconds(last) if first == last else f"{style.number(round(first, 2))} to {_seconds(last)}"


def _label_places(poses: Sequence[Pose], lines: Sequence[Array], solid: Sequence[Array]) -> Array:
    """Where the times are written, (k, 2): near each platform, clear of drawings if there is room; not within
    the outlines `solid`, (k, 2) each."""
    drawn = np.vstack(
        [_outline(pose) for pose in poses] + [line[:: max(1, len(line) // 300), :2] for line in lines]
    )
    robots = [edge for pose in poses for edge in [*pose.bodies(ABOVE), *pose.tyres(ABOVE)]]
    covered = Covered([*robots, *solid])
    angles = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    directions = np.column_stack([np.cos(angles), np.sin(angles)])
    away = _LABEL * float(np.ptp(drawn, axis=0).max())
    flat = _thinned(drawn * _FLAT, away / 20.0)
    width = 2.0 * away * np.array([[-1.0, 0.0], [0.0, 0.0], [1.0, 0.0]])
    places: list[Array] = []
    for pose in poses:
        body = pose.main[:, :2]
        centre = 0.5 * (body.min(axis=0) + body.max(axis=0))
        edge = np.max(directions @ (body - centre).T, axis=1)
        farther = np.repeat(np.linspace(0.0, edge.max(), 9), len(angles))
        candidates = centre + (np.tile(edge + away, 9) + farther)[:, None] * np.tile(directions, (9, 1))
        others = np.vstack([np.full((1, 2), np.inf), *[place + width for place in places]])
        beside = np.linalg.norm((candidates[:, None] - others) * _FLAT, axis=2).min(axis=1)
        clear = np.minimum(_distances(candidates * _FLAT, flat, away), beside)
        clearance = np.minimum(clear, away) - 0.1 * farther
        clearance[covered.holds(candidates)] -= edge.max()
        places.append(candidates[int(np.argmax(clearance))])
    return np.array(places)


def _thinned(points: Array, width: float) -> Array:
    """One of points (N, 2) for each square of that width with some in it."""
    squares = np.floor((points - points.min(axis=0)) / width)
    _, kept = np.unique(squares @ [squares[:, 1].max() + 1.0, 1.0], return_index=True)
    return points[kept]


def _distances(points: Array, others: Array, most: float) -> Array:
    """How far each of points (P, 2) is from the nearest of others (O, 2), of those no farther than `most`."""
    lower, upper = points.min(axis=0) - most, points.max(axis=0) + most
    near = others[np.all((others > lower) & (others < upper), axis=1)]
    if not len(near):
        return np.full(len(points), most)
    x, y = (np.subtract.outer(points[:, k], near[:, k]) for k in range(2))
    return np.sqrt((x * x + y * y).min(axis=1))


def _outline(pose: Pose) -> Array:
    """Points along a robot's drawing from above."""
    fractions = np.linspace(0.0, 1.0, 8)[:, None]
    edges = [along(edge, len(fractions)) for edge in [*pose.bodies(ABOVE), *pose.tyres(ABOVE)]]
    lines = [ends[0, :2] + fractions * (ends[1, :2] - ends[0, :2]) for ends in pose.links]
    return np.vstack(edges + lines)


def _how_many(trajectory: Trajectory, silhouette: Silhouette) -> int:
    """So many instants that the platform moves by about its length from one to the next."""
    body = np.vstack(silhouette.at(trajectory.q[0]).body)[:, :2]
    length = float(np.linalg.norm(body.max(axis=0) - body.min(axis=0)))
    driven = float(
        np.linalg.norm(np.diff(base_position(trajectory.robot, trajectory.q), axis=0), axis=1).sum()
    )
    if not np.isfinite(driven):
        return LEAST
    return int(np.clip(1 + driven // (1.1 * length), LEAST, MOST)) if len(trajectory) > 1 else 1


def _instants(t: Array, instants: ArrayLike | int) -> Array:
    if isinstance(instants, int):
        if instants < 1:
            raise InputError(f"instants: expected at least 1, got {instants}")
        return np.linspace(t[0], t[-1], instants) if instants > 1 else t[-1:]
    times = np.atleast_1d(np.asarray(instants, dtype=np.float64))
    if times.size == 0 or not np.all((times >= t[0] - 1e-9) & (times <= t[-1] + 1e-9)):
        raise InputError(f"instants: expected times from {t[0]:g} s to {t[-1]:g} s, got {instants}")
    return np.sort(times)


def _lines(trajectory: Trajectory) -> dict[str, Array]:
    """The paths to draw, (k, 3) each, with few enough points."""
    every = max(1, len(trajectory) // 1500)
    kept = np.unique([*range(0, len(trajectory), every), len(trajectory) - 1])
    if trajectory.path is None:
        x_y = base_position(trajectory.robot, trajectory.q[kept])
        return {"path": np.column_stack([x_y, np.zeros(len(kept))])}
    lines = {"path": trajectory.path[kept]}
    desired = trajectory.moving
    if desired is not None:
        thinned = np.unique([*range(0, len(desired), max(1, len(desired) // 1500)), len(desired) - 1])
        lines["desired"] = desired[thinned]
    return lines


def _faded(color: str, strength: float) -> tuple[float, float, float]:
    """A colour mixed with white: opaque, so that what lies below does not shine through."""
    red, green, blue = (1.0 - strength * (1.0 - part) for part in to_rgb(color))
    return red, green, blue


def _draw_pose(axes: Axes, pose: Pose, view: View, strength: float, later: float) -> None:
    """One drawing of the robot: above the earlier ones (`later` in [0, 1)), all arms above all platforms."""
    edge, body = _faded(_EDGE, strength), _faded(_BODY, strength)
    zorder = 3.0 + later
    shapes = pose.bodies(view)
    # Edges of all shapes first, faces above them: what stays visible is the edge of their union.
    axes.add_collection(
        PolyCollection(shapes, facecolors="none", edgecolors=[edge], linewidths=1.6, zorder=zorder),
        autolim=False,
    )
    axes.add_collection(PolyCollection(shapes, facecolors=[body], linewidths=0, zorder=zorder), autolim=False)
    marks = [*pose.tyres(view)]
    if view == ABOVE and len(pose.heading):
        marks.append(pose.heading[:, view])
    axes.add_collection(PolyCollection(marks, facecolors=[edge], linewidths=0, zorder=zorder), autolim=False)
    zorder = 4.0 + later
    lines = [ends[:, view] for ends in pose.links]
    for color, width in ((edge, 4.0), (_faded(_ARM, strength), 2.6)):
        drawn = LineCollection(lines, colors=[color], linewidths=width, capstyle="round", zorder=zorder)
        axes.add_collection(drawn, autolim=False)
    joints, tips = pose.joints[:, view], pose.tip[:, view]
    axes.plot(
        joints[:, 0], joints[:, 1], "o", markersize=4.2, color="white", markeredgecolor=edge,
        markeredgewidth=1.1, zorder=zorder, linestyle="none",
    )  # fmt: skip
    axes.plot(tips[:, 0], tips[:, 1], "o", markersize=3.0, color=edge, zorder=zorder, linestyle="none")
