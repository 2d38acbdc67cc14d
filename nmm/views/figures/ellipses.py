"""Manipulability ellipses along a motion: how fast the end-effector can move, by the robot and by its arm."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure

from nmm.analysis.singular.ellipsoids import (
    NAMES,
    SHARE,
    drawn_ellipsoids,
    drawn_frame,
    drawn_scale,
    largest_radius,
    scale_text,
)
from nmm.analysis.singular.parts import WHOLE
from nmm.base import resolver_style
from nmm.base.arrays import Array
from nmm.base.ellipsoid_options import EllipsoidOptions, Wanted, options_of
from nmm.model.robots.motion import Motion
from nmm.motion.trajectory import Trajectory
from nmm.views.figures import style
from nmm.views.figures.silhouette import Ink, Silhouette
from nmm.views.figures.style import save
from nmm.views.figures.views import ABOVE, View, Viewed, page, upright
from nmm.views.playback.extent import extent_of
from nmm.views.playback.keyframes import ghost_samples

#: At most and at least so many instants with ellipses, and at how many of them the robot is drawn.
MOST, LEAST, ROBOTS = 12, 6, 5
#: Between two instants the frame moves by so many of the largest radius as drawn, if they are not too few.
_APART = 1.5
#: No way is so short that ellipses are drawn smaller than this, beside those of a long one.
_SMALLEST = 0.3
_POINTS = 1500
#: A radius below this part of the largest is rounding: what has none upwards needs no view from the side.
_FLAT = 1e-6
#: Room for the line above the legend, in.
_LINE = 0.2
_FILL, _RIM, _ARM = resolver_style.SKY, resolver_style.BLUE, resolver_style.VERMILLION
#: Of the robots, in the background.
_FAINT = Ink("#BFC5CE", "#EEF0F3", (("#BFC5CE", 2.2),), outline=1.2, joint=2.6)


def ellipses(
    trajectory: Trajectory,
    options: Wanted = True,
    path: str | Path | None = None,
    *,
    width: float = style.PAGE,
) -> Figure:
    """The end-effector's path with the ellipses of its velocities, evenly spaced along the path.

    An ellipse holds the velocities, projected into the view, that inputs of size 1 give the frame: the shadow
    of the ellipsoid of J_v J_vᵀ, not its section. Filled: the whole robot; outlined: its arm alone. A view
    from the side is added if it shows anything. `options` True: the task's frame, sizes 1 and a readable
    scale; `path`: a file to write, too. InputError without a sample, or for a frame or an input that the
    robot does not have.
    """
    scene = _Ellipses(trajectory, options_of(options) or EllipsoidOptions())
    made = page(scene, width, above=_LINE)
    made.text(
        style.LEFT / width, 1.0 - 0.5 * _LINE / float(made.get_size_inches()[1]), scene.text,
        fontsize=style.SMALL, color=style.GREY, va="top", parse_math=False,
    )  # fmt: skip
    if path is not None:
        save(made, path)
    return made


class _Ellipses(Viewed):
    def __init__(self, trajectory: Trajectory, options: EllipsoidOptions) -> None:
        style.sampled([trajectory], "the ellipses")
        robot = trajectory.robot
        self.frame = drawn_frame(options, robot, trajectory.frame)
        sampled = np.unique(np.linspace(0, len(trajectory) - 1, min(len(trajectory), _POINTS)).astype(int))
        q = trajectory.q[sampled]
        along = drawn_ellipsoids(options, robot, self.frame, q)
        self.path = along[WHOLE].center
        motion = Motion(robot, trajectory.t[sampled], q, trajectory.u[sampled], path=self.path)
        silhouette = Silhouette(robot, self.frame)
        largest = largest_radius([along])
        # A way that is driven several times counts as a circle of its extent at most.
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
                part: ellipsoids.projected(view.rows).outline(self.scale)[samples]
                for part, ellipsoids in along.items()
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
        return [*(NAMES[part] for part in self.outlines[ABOVE]), f"path of {self.frame}", "start", "end"]

    @property
    def text(self) -> str:
        # Inputs of many sizes are not listed: it is one line.
        sizes = ", ".join(self.sizes) if len(self.sizes) <= 2 else "the sizes given"
        return f"velocities for ‖u‖ ≤ 1 ({sizes}); {scale_text(self.scale)}"

    def points(self, view: View, width: float) -> list[Array]:
        points = [view.of(self.path), *(view.of(pose.points()) for pose in self.poses)]
        return points + [outlines.reshape(-1, 2) for outlines in self.outlines[view].values()]

    def draw(self, axes: Axes, view: View) -> None:
        self.dress(axes, view)
        for pose in self.poses:
            pose.draw(axes, view, _FAINT)
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
        axes.plot(
            *path.T, color=resolver_style.BLACK, linewidth=1.2, label=f"path of {self.frame}", zorder=5.0
        )
        style.mark_ends(axes, path, 5.0)
