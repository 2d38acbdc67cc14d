"""Stroboscopic views: the robot drawn at instants of a run, from above and from the side."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from nmm.base import resolver_style
from nmm.base.arrays import Array
from nmm.base.errors import expect
from nmm.model.robots.frame_path import FramePath
from nmm.motion.trajectory import Trajectory
from nmm.views.figures import style
from nmm.views.figures.seen_points import DrawnPoints
from nmm.views.figures.silhouette import DrawnPose, Ink, Silhouette, hull, outline_points
from nmm.views.figures.time_labels import SIZE, LabelSubject, OccupiedCells, Place, places
from nmm.views.figures.views import ABOVE, BELIEVED, View, Viewed, page, upright
from nmm.views.playback.placements import base_position

#: Size of the marks at the path's ends, pt.
_END = 6.0
#: A platform so long, pt, is drawn with full lines, a shorter one with thinner ones, at least this share.
_LARGE, _FINEST = 42.0, 0.3
#: When no instants are given: at most and at least this many, a platform's length apart.
MOST, LEAST = 11, 4
#: A run whose arm rises or falls by more than this is drawn from the side too, m.
_RISES = 0.01
_PATH_COLOR, _BODY, _EDGE, _ARM = resolver_style.BLUE, "#B9C0CA", "#3F4652", resolver_style.VERMILLION

OBSTACLE, OBSTACLE_TEXT = resolver_style.ORANGE, "#7A5200"
#: Strength of the earliest drawing; the last has 1.
FAINTEST = 0.4
#: Obstacles that move by less between two drawings are at rest, m.
RESTS = 1e-3


class Outline(NamedTuple):
    """An obstacle, or scenery: the hull of points (k, 3), a strength, first and last time, s (None if it
    rests), what the legend calls it, and in the hull's place faces (F, 4, 3) of what was sensed."""

    points: Array
    strength: float
    times: tuple[float, float] | None
    name: str = "obstacle"
    faces: Array | None = None


def stroboscopic(
    trajectory: Trajectory, instants: ArrayLike | int | None = None, *, width: float = style.PAGE
) -> Figure:
    """The robot seen from above at instants of the run (the paper's Figs. 3, 5 and 7).

    Platform with wheels and heading, arm, end-effector's path, the one that is believed, desired path, start,
    end, the target, looked at or held, and what cameras see; drawings fade towards the start. A second view
    from the side, of the upright plane in which the motion mostly lies, where the arm leaves the ground's.

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
    return page(MotionScene(trajectory, instants), width)


class MotionScene(Viewed):
    def __init__(self, trajectory: Trajectory, instants: ArrayLike | int | None = None) -> None:
        (self.trajectory,) = style.sampled([trajectory], "the motion")
        silhouette = Silhouette(trajectory.robot, trajectory.frame)
        count = _how_many(trajectory, silhouette) if instants is None else instants
        wanted = _instants(trajectory.t, count)
        if instants is None:
            wanted = with_the_nearest(trajectory, wanted)
        samples = np.unique(np.searchsorted(trajectory.t, wanted - 1e-9).clip(0, len(trajectory) - 1))
        self.times = trajectory.t[samples]
        self.poses: list[DrawnPose] = [silhouette.at(trajectory.q[k]) for k in samples]
        self.lines = _lines(trajectory)
        self.outlines = outlines(trajectory, self.times)
        self.seen = DrawnPoints([trajectory], self.times)
        self._labels: dict[float, list[Place]] = {}
        heights = np.array([[*pose.joints[:, 2], *pose.tip[:, 2]] for pose in self.poses])
        rises = heights.size > 0 and float(np.ptp(heights, axis=0).max()) > _RISES
        self.side = upright(self.lines.get("desired", self.lines["path"]))
        self.views = (ABOVE, self.side) if rises else (ABOVE,)

    @property
    def names(self) -> list[str]:
        names = ["desired path"] if "desired" in self.lines else []
        names += [BELIEVED] * ("believed" in self.lines)
        names += [self._path_name, "start", "end"]
        names += [*dict.fromkeys(outline.name for outline in self.outlines), *self.seen.names]
        return names if not len(self.trajectory.marks) else [*names, "target"]

    @property
    def _path_name(self) -> str:
        return f"path of {self.trajectory.frame}" if self.trajectory.frame else "path of the platform"

    def points(self, view: View, width: float) -> list[Array]:
        return [*self._drawn(view), *(place.corners for place in self.times_at(view, width))]

    def _drawn(self, view: View) -> list[Array]:
        robots, bodies = (pose.points() for pose in self.poses), (outline.points for outline in self.outlines)
        paths = *self.lines.values(), *self.seen.parts
        return [view.of(part) for part in (*robots, *paths, *bodies, self.trajectory.marks)]

    def times_at(self, view: View, width: float) -> list[Place]:
        """Where the times stand in a drawing `width` in wide: the robots', then the obstacles'."""
        if view != ABOVE:
            return []
        if width not in self._labels:
            drawn = np.vstack(self._drawn(view))
            drawn = drawn[np.isfinite(drawn).all(axis=1)]
            low, high = drawn.min(axis=0), drawn.max(axis=0)
            extent = float(high[0] - low[0])
            # The farther out they stand, the smaller is all else drawn, and the larger are they beside it.
            scale = 1.1 * extent / width
            mains = [hull(view.of(pose.main)) for pose in self.poses]
            solid = [hull(view.of(outline.points)) for outline in self.outlines if outline.times]
            subjects = [LabelSubject(*pair) for pair in zip(self._times(), [*mains, *solid], strict=True)]
            ground = OccupiedCells(lambda axes: self._draw_scene(axes, view), low, high, scale)
            for _ in range(4):
                scale = 1.1 * extent / width
                labels = places(subjects, ground, scale)
                every = np.vstack([drawn[:, :1], *[place.corners[:, :1] for place in labels]])
                extent = float(np.ptp(every))
                if 1.08 * extent / width <= scale:  # what stands around is a margin of 8 %
                    break
            self._labels[width] = labels
        return self._labels[width]

    def _times(self) -> list[str]:
        """Those of the robots, then those of obstacles that move."""
        of_obstacles = (_span(*outline.times) for outline in self.outlines if outline.times is not None)
        return [*map(_seconds, self.times.tolist()), *of_obstacles]

    def draw(self, axes: Axes, view: View) -> None:
        self.dress(axes, view)
        self._draw_scene(axes, view)
        width, _ = style.inches(axes)
        for k, (place, text) in enumerate(zip(self.times_at(view, width), self._times(), strict=False)):
            color = style.GREY if k < len(self.times) else OBSTACLE_TEXT
            x, y = place.middle.tolist()
            axes.text(
                x, y, text, color=color, fontsize=SIZE, ha="center", va="center", zorder=7, parse_math=False
            )
            if place.foot is not None:
                axes.plot(*np.array([place.foot, place.end]).T, color=color, linewidth=0.5, zorder=6.5)

    def _draw_scene(self, axes: Axes, view: View) -> None:
        """All but the times, in axes that have their limits."""
        for k, (pose, strength) in enumerate(zip(self.poses, _strengths(len(self.poses)), strict=True)):
            # From the side the robots of a round path stand behind each other: every second one is enough.
            if view == ABOVE or len(self.poses) <= 6 or (len(self.poses) - 1 - k) % 2 == 0:
                pose.draw(axes, view, _ink(strength, k / len(self.poses)).times(self._fineness(axes)))
        named = set[str]()
        for outline in self.outlines:
            color = OBSTACLE if outline.name == "obstacle" else style.GREY
            shade, label = _faded(color, outline.strength), None if outline.name in named else outline.name
            if outline.faces is None:
                edge = hull(view.of(outline.points))
                axes.fill(
                    *edge.T, facecolor=(*shade, 0.25), edgecolor=shade, linewidth=1.0, zorder=2.5, label=label
                )
            else:  # one colour, as they cover each other
                seen = view.of(outline.faces.reshape(-1, 3)).reshape(-1, 4, 2)
                faces = PolyCollection(list(np.unique(seen.round(6), axis=0)), rasterized=True)
                faces.set(facecolor=_faded(color, FAINTEST), edgecolor="face", linewidth=0.6)
                faces.set(zorder=2.5, label=label)
                axes.add_collection(faces, autolim=False)
            named.add(outline.name)
        self.seen.draw(axes, view.of)
        if "desired" in self.lines:
            axes.plot(
                *view.of(self.lines["desired"]).T, "--", color=resolver_style.BLACK, linewidth=1.1,
                dashes=(4, 2.5), label="desired path", zorder=5.2,
            )  # fmt: skip
        if "believed" in self.lines:
            axes.plot(
                *view.of(self.lines["believed"]).T, ":", color=style.GREY, linewidth=1.5,
                label=BELIEVED, zorder=5.15,
            )  # fmt: skip
        path = view.of(self.lines["path"])
        axes.plot(*path.T, color=_PATH_COLOR, linewidth=1.5, label=self._path_name, zorder=5.1)
        style.mark_ends(axes, path, _END)
        style.mark_targets(axes, view.of(self.trajectory.marks))

    def _fineness(self, axes: Axes) -> float:
        """How much thinner than usual lines are, so that arms and outlines of small robots stay apart."""
        left, right = axes.get_xlim()
        length = float(np.linalg.norm(np.ptp(self.poses[0].main[:, :2], axis=0)))
        points = 72.0 * length * style.inches(axes)[0] / (right - left)
        return float(np.clip(points / _LARGE, _FINEST, 1.0))


def outlines(trajectory: Trajectory, times: Array) -> list[Outline]:
    """The obstacles, those that move at each of the times, once where they rest, and the scenery;
    half-spaces have none."""
    drawn: list[Outline] = []
    for obstacle in trajectory.obstacles:
        points = outline_points(obstacle.shape.geometry())
        if points is None:
            continue
        at = times if obstacle.moves else times[-1:]
        faces = _faces(obstacle.shape.drawn())
        own: list[Outline] = []
        for t, strength in zip(at.tolist(), _strengths(len(at)), strict=True):
            place = obstacle.placement(t)
            moved = points @ place[:3, :3].T + place[:3, 3]
            before = own[-1] if own else None
            if before and before.times and np.allclose(before.points, moved, rtol=0.0, atol=RESTS):
                own[-1] = before._replace(points=moved, strength=strength, times=(before.times[0], t))
            else:
                lasts = (t, t) if obstacle.moves else None
                turned = None if faces is None else faces @ place[:3, :3].T + place[:3, 3]
                own.append(Outline(moved, strength, lasts, faces=turned))
        drawn += own
    for thing in trajectory.surroundings.scenery:
        if (points := outline_points(thing.geometry)) is not None:
            place = thing.places[0]
            drawn.append(Outline(points @ place[:3, :3].T + place[:3, 3], 1.0, None, "scenery"))
    return drawn


def _faces(drawn: Any) -> Array | None:
    """The rectangles (F, 4, 3), m, that a page draws of what was sensed; None of a convex shape."""
    if not type(drawn).__name__.startswith("BVHModel"):
        return None
    return np.array(drawn.vertices()).reshape(-1, 4, 3)


def _strengths(count: int) -> list[float]:
    return np.linspace(FAINTEST, 1.0, count).tolist() if count > 1 else [1.0]


def with_the_nearest(trajectory: Trajectory, times: Array) -> Array:
    """The times, the closest one moved to the instant of least clearance, which even spacing may miss."""
    d = trajectory.clearance
    if not trajectory.obstacles or len(d) != len(trajectory) or len(times) < 3 or not np.isfinite(d).any():
        return times
    nearest = float(trajectory.t[int(np.argmin(d))])
    inner = times[1:-1]
    inner[int(np.argmin(np.abs(inner - nearest)))] = nearest
    return np.sort(times)


def _seconds(t: float) -> str:
    return f"{style.number(round(t, 2))} s"


def _span(first: float, last: float) -> str:
    return _seconds(last) if first == last else f"{style.number(round(first, 2))} to {_seconds(last)}"


def _how_many(trajectory: Trajectory, silhouette: Silhouette) -> int:
    """So many instants that the platform moves by about its length from one to the next."""
    body = np.vstack(silhouette.at(trajectory.q[0]).body)[:, :2]
    length = float(np.linalg.norm(body.max(axis=0) - body.min(axis=0)))
    steps = np.diff(base_position(trajectory.robot, trajectory.q), axis=0)
    driven = float(np.linalg.norm(steps, axis=1).sum())
    if not np.isfinite(driven):
        return LEAST
    return int(np.clip(1 + driven // (1.1 * length), LEAST, MOST)) if len(trajectory) > 1 else 1


def _instants(t: Array, instants: ArrayLike | int) -> Array:
    if isinstance(instants, int):
        expect(instants >= 1, "instants", "at least 1", instants)
        return np.linspace(t[0], t[-1], instants) if instants > 1 else t[-1:]
    times = np.atleast_1d(np.asarray(instants, dtype=np.float64))
    within = (times >= t[0] - 1e-9) & (times <= t[-1] + 1e-9)
    expect(times.size and np.all(within), "instants", f"times from {t[0]:g} s to {t[-1]:g} s", instants)
    return np.sort(times)


def _lines(trajectory: Trajectory) -> dict[str, Array]:
    """The paths to draw, (k, 3) each."""
    if trajectory.path is None:
        x_y = base_position(trajectory.robot, trajectory.q)
        return {"path": np.column_stack([x_y, np.zeros(len(x_y))])}
    lines = {"path": trajectory.path}
    if trajectory.moving is not None:
        lines["desired"] = trajectory.moving
    if trajectory.believed is not None and trajectory.frame is not None:
        lines["believed"] = FramePath(trajectory.robot, trajectory.frame).positions(trajectory.believed)
    return lines


def _faded(color: str, strength: float) -> tuple[float, float, float]:
    """A colour mixed with white: opaque, so that what lies below does not shine through."""
    red, green, blue = (1.0 - strength * (1.0 - part) for part in to_rgb(color))
    return red, green, blue


def _ink(strength: float, later: float) -> Ink:
    """The ink of a pose drawn over the earlier ones (`later` in [0, 1)), all arms over all platforms."""
    edge, body, arm = (_faded(color, strength) for color in (_EDGE, _BODY, _ARM))
    return Ink(
        edge, body, ((edge, 4.0), (arm, 2.6)), outline=1.6, joint=4.2, rim=1.1, tip=3.0,
        heading=True, zorder=3.0 + later, lift=1.0,
    )  # fmt: skip
