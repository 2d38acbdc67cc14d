"""Stroboscopic views: the robot drawn at instants of a run, from above and from the side."""

from __future__ import annotations

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
from nmm.figures.hulls import hull
from nmm.figures.obstacles import FAINTEST, OBSTACLE, OBSTACLE_TEXT, outlines, with_the_nearest
from nmm.figures.silhouette import Pose, Silhouette
from nmm.figures.time_labels import SIZE, Ground, Place, Subject, places
from nmm.figures.views import ABOVE, View, Viewed, page, upright
from nmm.playback.placements import base_position
from nmm.runs.trajectory import Trajectory

#: Sizes of the marks at the path's ends and of a target, pt.
_END, _TARGET = 6.0, 12.0
#: When no instants are given: at most so many, at least so many, a platform's length apart.
MOST, LEAST = 11, 4
#: A run whose arm rises or falls by more than this is drawn from the side too, m.
_RISES = 0.01
_PATH_COLOR, _BODY, _EDGE, _ARM = looks.BLUE, "#B9C0CA", "#3F4652", looks.VERMILLION


def stroboscopic(
    trajectory: Trajectory, instants: ArrayLike | int | None = None, *, width: float = style.PAGE
) -> Figure:
    """The robot seen from above at instants of the run (the paper's Figs. 3, 5 and 7).

    Platform with wheels and heading, arm, end-effector's path, desired path, start, end and the
    target, looked at or held; drawings fade towards the start. A second view from the side, of the upright
    plane in which the motion mostly lies, where the arm leaves the ground's.

    Parameters
    ----------
    trajectory : the run, of at least one sample
    instants : times to draw at, s, or how many, evenly spaced; when not given 11, or fewer where
        they would cover each other
    width : of the figure, in

    Raises
    ------
    InputError : no sample; an instant outside the run

    Examples
    --------
    >>> run = nmm.Scenario.load("unicycle_2r_position").run()
    >>> figure = nmm.figures.stroboscopic(run, [0.0, 5.0, 25.0])
    >>> figure.axes[0].get_xlabel()
    'x [m]'
    """
    return page(Scene(trajectory, instants), width)


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
        self._labels: dict[float, list[Place]] = {}
        heights = np.array([[*pose.joints[:, 2], *pose.tip[:, 2]] for pose in self.poses])
        rises = heights.size > 0 and float(np.ptp(heights, axis=0).max()) > _RISES
        self.side = upright(self.lines.get("desired", self.lines["path"]))
        self.views = (ABOVE, self.side) if rises else (ABOVE,)

    @property
    def names(self) -> list[str]:
        """The entries of its legend."""
        names = ["desired path"] if "desired" in self.lines else []
        names += [self._path_name, "start", "end", *["obstacle"] * bool(self.outlines)]
        return names if not len(self.trajectory.marks) else [*names, "target"]

    @property
    def _path_name(self) -> str:
        return f"path of {self.trajectory.frame}" if self.trajectory.frame else "path of the platform"

    def points(self, view: View, width: float) -> list[Array]:
        """Robots, paths, targets, and the times beside them."""
        return [*self._drawn(view), *(place.corners for place in self.times_at(view, width))]

    def _drawn(self, view: View) -> list[Array]:
        points = [*(pose.points() for pose in self.poses), *self.lines.values()]
        points += [outline.points for outline in self.outlines]
        return [view.of(part) for part in [*points, self.trajectory.marks]]

    def times_at(self, view: View, width: float) -> list[Place]:
        """Where the times stand in a drawing `width` in wide: the robots', then the obstacles'."""
        if view != ABOVE:
            return []
        if width not in self._labels:
            drawn = np.vstack(self._drawn(view))
            drawn = drawn[np.isfinite(drawn).all(axis=1)]
            extent = float(np.ptp(drawn[:, 0]))
            # The farther out they stand, the smaller is all else drawn, and the larger are they beside it.
            scale = 1.1 * extent / width
            subjects, ground = self._shown(view, scale)
            for _ in range(4):
                scale = 1.1 * extent / width
                found = places(subjects, ground, scale)
                every = np.vstack([drawn[:, :1], *[place.corners[:, :1] for place in found]])
                extent = float(np.ptp(every))
                if 1.08 * extent / width <= scale:  # what stands around is a margin of 8 %
                    break
            self._labels[width] = found
        return self._labels[width]

    def _shown(self, view: View, scale: float) -> tuple[list[Subject], Ground]:
        """What times belong to, and all that is drawn, at about so many m for each inch."""
        robots = [edge for pose in self.poses for edge in [*pose.bodies(view), *pose.tyres(view)]]
        links = [view.of(ends) for pose in self.poses for ends in pose.links]
        solid = [hull(view.of(outline.points)) for outline in self.outlines]
        paths = [view.of(line) for line in self.lines.values()]
        mains = [hull(view.of(pose.main)) for pose in self.poses]
        subjects = [Subject(_seconds(float(t)), edge) for t, edge in zip(self.times, mains, strict=True)]
        subjects += [
            Subject(_span(*outline.times), edge)
            for outline, edge in zip(self.outlines, solid, strict=True)
            if outline.times is not None
        ]
        ends, targets = view.of(self.lines["path"][[0, -1]]), view.of(self.trajectory.marks)
        marks = [*_around(ends, _END, scale), *_around(targets, _TARGET, scale)]
        return subjects, Ground([*paths, *links, *marks], [*robots, *solid], scale)

    def draw(self, axes: Axes, view: View) -> None:
        """Draw the scene as it is seen in a view."""
        trajectory = self.trajectory
        self.dress(axes, view)
        strengths = np.linspace(FAINTEST, 1.0, len(self.poses)) if len(self.poses) > 1 else [1.0]
        for k, (pose, strength) in enumerate(zip(self.poses, strengths, strict=True)):
            # From the side the robots of a round path stand behind each other: every second one is enough.
            if view != ABOVE and len(self.poses) > 6 and (len(self.poses) - 1 - k) % 2:
                continue
            _draw_pose(axes, pose, view, float(strength), k / len(self.poses))
        for k, outline in enumerate(self.outlines):
            shade, edge = _faded(OBSTACLE, outline.strength), hull(view.of(outline.points))
            axes.fill(
                *edge.T, facecolor=(*shade, 0.25), edgecolor=shade, linewidth=1.0,
                zorder=2.5, label=None if k else "obstacle",
            )  # fmt: skip
        self._draw_times(axes, view)
        if "desired" in self.lines:
            axes.plot(
                *view.of(self.lines["desired"]).T, "--", color=looks.BLACK, linewidth=1.1,
                dashes=(4, 2.5), label="desired path", zorder=5.2,
            )  # fmt: skip
        path = view.of(self.lines["path"])
        axes.plot(*path.T, color=_PATH_COLOR, linewidth=1.5, label=self._path_name, zorder=5.1)
        for point, marker, text in ((path[0], "o", "start"), (path[-1], "s", "end")):
            axes.plot(
                *point, marker, color=looks.GREEN if text == "start" else looks.PINK,
                markersize=_END, markeredgecolor="white", markeredgewidth=0.8, label=text,
                linestyle="none", zorder=6,
            )  # fmt: skip
        if len(trajectory.marks):
            axes.plot(
                *view.of(trajectory.marks).T, "*", color=looks.ORANGE, markersize=_TARGET,
                markeredgecolor=looks.BLACK, markeredgewidth=0.7, label="target", linestyle="none", zorder=6,
            )  # fmt: skip

    def _draw_times(self, axes: Axes, view: View) -> None:
        width, _ = style.inches(axes)
        of_obstacles = [_span(*outline.times) for outline in self.outlines if outline.times is not None]
        texts = [*map(_seconds, self.times.tolist()), *of_obstacles]
        for k, (place, text) in enumerate(zip(self.times_at(view, width), texts, strict=False)):
            color = style.GREY if k < len(self.times) else OBSTACLE_TEXT
            axes.text(
                float(place.middle[0]),
                float(place.middle[1]),
                text,
                color=color,
                fontsize=SIZE,
                ha="center",
                va="center",
                zorder=7,
            )
            if place.foot is not None:
                axes.plot(*np.array([place.foot, place.end]).T, color=color, linewidth=0.5, zorder=6.5)


def _around(points: Array, size: float, scale: float) -> list[Array]:
    """The edges of marks of that size, pt, at points (k, 2) of a drawing of `scale` m for each inch."""
    angles = np.linspace(0.0, 2.0 * np.pi, 13)
    circle = np.column_stack([np.cos(angles), np.sin(angles)]) * 0.5 * size / 72.0 * scale
    return [point + circle for point in points]


def _seconds(t: float) -> str:
    return f"{style.number(round(t, 2))} s"


def _span(first: float, last: float) -> str:
    return _seconds(last) if first == last else f"{style.number(round(first, 2))} to {_seconds(last)}"


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
        marks.append(view.of(pose.heading))
    axes.add_collection(PolyCollection(marks, facecolors=[edge], linewidths=0, zorder=zorder), autolim=False)
    zorder = 4.0 + later
    lines = [view.of(ends) for ends in pose.links]
    for color, width in ((edge, 4.0), (_faded(_ARM, strength), 2.6)):
        drawn = LineCollection(lines, colors=[color], linewidths=width, capstyle="round", zorder=zorder)
        axes.add_collection(drawn, autolim=False)
    joints, tips = view.of(pose.joints), view.of(pose.tip)
    axes.plot(
        joints[:, 0], joints[:, 1], "o", markersize=4.2, color="white", markeredgecolor=edge,
        markeredgewidth=1.1, zorder=zorder, linestyle="none",
    )  # fmt: skip
    axes.plot(tips[:, 0], tips[:, 1], "o", markersize=3.0, color=edge, zorder=zorder, linestyle="none")
