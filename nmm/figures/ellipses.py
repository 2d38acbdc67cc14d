"""Manipulability ellipses along a motion: how fast the end-effector can move, by the robot and by its arm."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure

from nmm import looks
from nmm.analysis.singular.drawn_ellipsoids import (
    NAMES,
    SHARE,
    drawn_ellipsoids,
    drawn_frame,
    drawn_scale,
    largest_radius,
    scale_text,
)
from nmm.analysis.singular.parts import WHOLE
from nmm.arrays import Array
from nmm.errors import InputError
from nmm.figures import style
from nmm.figures.files import save
from nmm.figures.silhouette import Pose, Silhouette
from nmm.figures.views import ABOVE, View, Viewed, page, upright
from nmm.playback.extent import extent_of
from nmm.playback.keyframes import ghost_samples
from nmm.robots.motion import Motion
from nmm.runs.ellipsoid_options import EllipsoidOptions, Wanted, options_of
from nmm.runs.trajectory import Trajectory

#: At most and at least so many instants with ellipses, and at how many of them the robot is drawn.
MOST, LEAST, ROBOTS = 12, 6, 5
#: Between two instants the frame moves by so many of the largest radius as drawn, if they are not too few.
_APART = 1.5
#: No way is so short that ellipses are drawn smaller than this, beside those of a long one.
_SMALLEST = 0.3
#: The path is drawn with at most so many points.
_POINTS = 1500
#: A radius below this part of the largest is rounding: what has none upwards needs no view from the side.
_FLAT = 1e-6
#: Room for the line above the legend, in.
_LINE = 0.2
_BODY, _EDGE, _FILL, _RIM, _ARM = "#EEF0F3", "#BFC5CE", looks.SKY, looks.BLUE, looks.VERMILLION


def ellipses(
    trajectory: Trajectory,
    options: Wanted = True,
    path: str | Path | None = None,
    *,
    width: float = style.PAGE,
) -> Figure:
    """The end-effector's path with the ellipses of its velocities at instants spread evenly along the way.

    An ellipse holds the velocities, seen in that view, that inputs of size 1 give the frame: the shadow of
    the ellipsoid of J_v J_vᵀ, not its section. Filled: the whole robot; outlined: its arm alone. A second
    view from the side where there is anything to see from there.

    Parameters
    ----------
    trajectory : the run, of at least one sample
    options : frame, sizes of the inputs, and scale; True for the task's frame, 1, and a readable one
    path : of a file to write, too (`nmm.figures.save`)
    width : of the figure, in

    Raises
    ------
    InputError : no sample; a frame or an input that the robot does not have
    """
    scene = _Ellipses(trajectory, options_of(options) or EllipsoidOptions())
    made = page(scene, width, above=_LINE)
    made.text(
        style.LEFT / width, 1.0 - 0.5 * _LINE / float(made.get_size_inches()[1]), scene.text,
        fontsize=style.SMALL, color=style.GREY, va="top",
    )  # fmt: skip
    if path is not None:
        save(made, path)
    return made


class _Ellipses(Viewed):
    """What is drawn: ellipsoids and robots at instants, the path, the scale."""

    def __init__(self, trajectory: Trajectory, options: EllipsoidOptions) -> None:
        if not len(trajectory):
            raise InputError("figure of the ellipses: expected a run with at least one sample, got none")
        robot = trajectory.robot
        self.frame = drawn_frame(options, robot, trajectory.frame)
        kept = np.unique(np.linspace(0, len(trajectory) - 1, min(len(trajectory), _POINTS)).astype(int))
        q = trajectory.q[kept]
        along = drawn_ellipsoids(options, robot, self.frame, q)
        self.path = along[WHOLE].center
        motion = Motion(robot, trajectory.t[kept], q, trajectory.u[kept], path=self.path)
        silhouette = Silhouette(robot, self.frame)
        largest = largest_radius([along])
        # What is driven again and again is no longer than a circle of its extent.
        around = np.pi / np.sqrt(2.0) * np.linalg.norm(np.ptp(self.path, axis=0))
        way = float(min(np.linalg.norm(np.diff(self.path, axis=0), axis=1).sum(), around))
        extent = extent_of(robot, q[0])
        # On a short way smaller ones than the page's, that leave each other room.
        room = float(np.clip(way / (LEAST - 1) / SHARE, _SMALLEST * extent, extent))
        self.scale = drawn_scale(options, room, [along])
        apart = _APART * self.scale * largest
        count = int(np.clip(1 + way // apart, LEAST, MOST)) if apart > 0.0 else LEAST
        samples = ghost_samples(motion, count) or [0]
        drawn = np.unique(np.linspace(0, len(samples) - 1, ROBOTS).round().astype(int))
        self.poses = [silhouette.at(q[samples[k]]) for k in drawn]
        side = upright(self.path)
        self.outlines = {
            view: {
                part: found.projected(view.rows).outline(self.scale)[samples] for part, found in along.items()
            }
            for view in (ABOVE, side)
        }
        sizes = zip(along[WHOLE].input_sizes, robot.u_units, strict=True)
        self.sizes = list(dict.fromkeys(f"{size:.3g} {unit}" for size, unit in sizes))
        upwards = float(np.nan_to_num(along[WHOLE].half_extents()[:, 2]).max())
        rises = float(np.ptp(self.path[:, 2])) > _FLAT
        self.views = (ABOVE, side) if rises or upwards > _FLAT * largest else (ABOVE,)

    @property
    def names(self) -> list[str]:
        """The entries of its legend."""
        return [*(NAMES[part] for part in self.outlines[ABOVE]), f"path of {self.frame}", "start", "end"]

    @property
    def text(self) -> str:
        """What the ellipses are, and their scale."""
        # Inputs of many sizes are not listed: it is one line.
        sizes = ", ".join(self.sizes) if len(self.sizes) <= 2 else "the sizes given"
        return f"velocities for ‖u‖ ≤ 1 ({sizes}); {scale_text(self.scale)}"

    def points(self, view: View, width: float) -> list[Array]:
        """Path, robots and ellipses."""
        points = [view.of(self.path), *(view.of(pose.points()) for pose in self.poses)]
        return points + [outlines.reshape(-1, 2) for outlines in self.outlines[view].values()]

    def draw(self, axes: Axes, view: View) -> None:
        """Draw the scene as it is seen in a view."""
        self.dress(axes, view)
        for pose in self.poses:
            _draw_faintly(axes, pose, view)
        for part, outlines in self.outlines[view].items():
            known = list(outlines[np.isfinite(outlines).all(axis=(1, 2))])
            fill = to_rgba(_FILL, 0.22 if part == WHOLE else 0.0)
            color, width = (_RIM, 1.0) if part == WHOLE else (_ARM, 1.3)
            shapes = PolyCollection(
                known, facecolors=[fill], edgecolors=[color], linewidths=width, label=NAMES[part],
                zorder=4.0 if part == WHOLE else 4.5,
            )  # fmt: skip
            axes.add_collection(shapes, autolim=False)
        path = view.of(self.path)
        axes.plot(*path.T, color=looks.BLACK, linewidth=1.2, label=f"path of {self.frame}", zorder=5.0)
        for point, marker, text in ((path[0], "o", "start"), (path[-1], "s", "end")):
            axes.plot(
                *point, marker, color=looks.GREEN if text == "start" else looks.PINK, markersize=5,
                markeredgecolor="white", markeredgewidth=0.8, label=text, linestyle="none", zorder=6.0,
            )  # fmt: skip


def _draw_faintly(axes: Axes, pose: Pose, view: View) -> None:
    """A robot in the background: its platform's outline, its wheels, its arm."""
    bodies = pose.bodies(view)
    # Edges of all shapes first, faces above them: what stays visible is the edge of their union.
    edges = PolyCollection(bodies, facecolors="none", edgecolors=[_EDGE], linewidths=1.2, zorder=2.0)
    faces = PolyCollection(bodies, facecolors=[_BODY], linewidths=0, zorder=2.1)
    wheels = pose.tyres(view)
    marks = PolyCollection(wheels, facecolors=[_EDGE], linewidths=0, zorder=2.2)
    lines = [view.of(ends) for ends in pose.links]
    links = LineCollection(lines, colors=[_EDGE], linewidths=2.2, capstyle="round", zorder=2.3)
    for drawn in (edges, faces, marks, links):
        axes.add_collection(drawn, autolim=False)
    joints: Array = view.of(pose.joints)
    axes.plot(
        *joints.T, "o", markersize=2.6, color="white", markeredgecolor=_EDGE, zorder=2.4, linestyle="none"
    )
