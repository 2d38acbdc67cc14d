"""Figures of several panels: one run at a glance, several runs side by side, a run folder's files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from nmm.base import resolver_style
from nmm.base.arrays import Array
from nmm.base.ellipsoid_options import Wanted
from nmm.base.figure_options import PLAIN, FigureOptions
from nmm.motion.diagnosis.summary import BAND, settling_time
from nmm.motion.trajectory import Trajectory
from nmm.views.figures import curves, style
from nmm.views.figures.limits import clearance, draw_scale, has_clearance, has_limits, limits
from nmm.views.figures.motion import MotionScene, stroboscopic
from nmm.views.figures.objective import draw_best_objective, has_objective, longest, objective_comparison
from nmm.views.figures.style import save_as
from nmm.views.figures.views import Paths, draw_views

#: Width of a figure of two columns, in.
_WIDTH = 10.4
#: A narrower one has one column, in.
_NARROW = 6.0
#: What a comparison calls the marks on its errors.
_SETTLED = f"down to {100 * BAND:g} %"
#: The tallest drawing of a motion, and of compared paths in one of two views, in.
_TALLEST, _TALL = 6.2, 3.6
#: The panel below the drawings, where it has room, in.
_LOW, _HIGH = 0.8, 1.4


class _Columns:
    """The drawings' width and the panels' left and right ends, in; a narrow figure has one column."""

    def __init__(self, width: float) -> None:
        self.width, self.beside = width, width >= _NARROW
        across = width - style.LEFT - style.RIGHT
        self.view = 0.56 * (across - style.LEFT) if self.beside else across
        self.left = style.LEFT + (self.view + style.LEFT if self.beside else 0.0)
        self.right = width - style.RIGHT

    def rows(self, names: Sequence[str]) -> int:
        return style.legend_rows(names, self.right - self.left)

    def made(
        self, legends: Sequence[int], least: float, drawing: float
    ) -> tuple[Figure, list[float], float, float]:
        """A figure, its panels' heights, in, which at least fill the drawing's beside them, start and top."""
        spare = drawing - style.column_height([], legends) if self.beside else 0.0
        heights = [max(least, spare / len(legends))] * len(legends)
        panels = style.column_height(heights, legends)
        if self.beside:
            total = style.BOTTOM + panels
            return style.figure(self.width, total), heights, total, total
        total = 2.0 * style.BOTTOM + panels + drawing
        return style.figure(self.width, total), heights, total - style.BOTTOM - drawing, total


def overview(trajectory: Trajectory, *, width: float = _WIDTH) -> Figure:
    """One run at a glance: the motion, the error's norm, the objective, the inputs; under limits λ, too.

    Parameters
    ----------
    width : of the figure, in; one narrower than 6 in has one column

    Examples
    --------
    >>> run = nmm.Scenario.load("unicycle_2r_position").run()
    >>> len(nmm.figures.overview(run).axes)
    5
    """
    scene, columns = MotionScene(trajectory), _Columns(width)
    parts = curves.input_parts(trajectory)
    names = [curves.input_names(trajectory, part) for part in parts]
    limited = has_limits(trajectory)
    legends = [1, 1, *(columns.rows(part) for part in names), *([1] * limited)]
    drawn = min(scene.height(scene.views[0], columns.view), _TALLEST)
    above = style.room(style.legend_rows(scene.names, columns.view))
    made, heights, begins, top = columns.made(legends, 1.0, above + drawn)
    bottom = style.BOTTOM if columns.beside else begins
    below = draw_views(made, scene, columns.view, top, bottom=bottom, tallest=_TALLEST)
    if (axes := _lowest(made, columns, below - style.GAP)) is not None:
        curves.draw_singular_value(axes, trajectory)
    panels = style.column(made, heights, legends, columns.left, columns.right, begins)
    curves.draw_error_norm(panels[0], trajectory)
    draw_best_objective(panels[1], [trajectory])
    if not trajectory.complete:
        panels[1].text(
            1.0, 1.04, f"run {trajectory.outcome}", transform=panels[1].transAxes, ha="right", va="bottom",
            fontsize=style.TEXT, color=resolver_style.VERMILLION, fontweight="bold",
        )  # fmt: skip
    for axes, part in zip(panels[2:], parts, strict=False):
        curves.draw_inputs(axes, trajectory, part)
        style.legend(axes)
    if limited:
        draw_scale(panels[-1], trajectory, named=False)
    _name_last(panels)
    return style.aligned(made)


def _lowest(made: Figure, columns: _Columns, top: float) -> Axes | None:
    """Axes below the drawings, from `top` on, in; None where there is no room for them."""
    if not columns.beside or top <= style.BOTTOM + _LOW:
        return None
    height = min(top - style.BOTTOM, _HIGH)
    return style.place(made, style.LEFT, top - height, columns.view, height)


def comparison(trajectories: Sequence[Trajectory], *, width: float = _WIDTH) -> Figure:
    """Several runs side by side: their paths, objective, error and size of the inputs.

    The paths from above, and from the side, too, where they rise; below them, where there is room, or in
    place of an objective that there is not, the smallest singular values of J.

    Parameters
    ----------
    width : of the figure, in; one narrower than 6 in has one column

    Raises
    ------
    InputError : no run with a sample

    Examples
    --------
    >>> runs = [nmm.Scenario.load("unicycle_2r_position").with_resolver(name).run() for name in ("rg", "pg")]
    >>> figure = nmm.figures.comparison(runs)
    >>> figure.axes[-1].get_xlabel()
    'time t [s]'
    """
    runs = style.sampled(trajectories, "a comparison")
    worn, columns = resolver_style.looks_of_labels([run.called for run in runs]), _Columns(width)
    scene = Paths(runs, worn)
    tallest = _TALL if len(scene.views) > 1 else _TALLEST
    drawn = [min(scene.height(view, columns.view), tallest) for view in scene.views]
    rooms = [style.legend_rows(scene.names, columns.view), *[1] * (len(drawn) - 1)]
    drawing = style.column_height(drawn, rooms) + style.BOTTOM * (len(drawn) - 1)
    # The panels share the first one's legend.
    legends = [columns.rows([look.name for look in worn]), 1, 0]
    made, heights, begins, top = columns.made(legends, 1.3, drawing)
    bottom = style.BOTTOM if columns.beside else begins
    below = draw_views(made, scene, columns.view, top, bottom=bottom, tallest=tallest) - style.GAP
    panels = style.column(made, heights, legends, columns.left, columns.right, begins)
    sigma = [run.sigma_min for run in runs]
    if has_objective(runs):
        if (axes := _lowest(made, columns, below)) is not None:
            _draw_norms(axes, runs, worn, sigma, "σ_min")
            style.label(axes, x="time t [s]")
        draw_best_objective(panels[0], runs)
    else:
        _draw_norms(panels[0], runs, worn, sigma, "σ_min")
    units = style.units(runs[0].r_units), style.units(runs[0].robot.u_units)
    _draw_norms(panels[1], runs, worn, [run.error_norm for run in runs], f"‖e‖ {units[0]}")
    _mark_settled(panels[1], runs)
    _draw_norms(panels[2], runs, worn, [np.linalg.norm(run.u, axis=1) for run in runs], f"‖u‖ {units[1]}")
    style.legend(panels[0])
    style.legend(panels[1], only=_SETTLED)
    _name_last(panels)
    return style.aligned(made)


def _name_last(panels: Sequence[Axes]) -> None:
    for axes in panels[:-1]:
        axes.set_xlabel("")
    style.label(panels[-1], x="time t [s]")


def _draw_norms(
    axes: Axes,
    runs: Sequence[Trajectory],
    worn: Sequence[resolver_style.RunStyle],
    norms: Sequence[Array],
    name: str,
) -> None:
    positive = style.positive(norms)
    style.compared(axes, worn, [run.t for run in runs], [np.where(x > 0.0, x, np.nan) for x in norms])
    style.time_axis(axes, longest(runs))
    style.label(axes, y=name)
    if positive.size:
        style.log_axis(axes, max(float(positive.min()), 1e-16), float(positive.max()))
    else:
        style.note(axes, "zero throughout")


def _mark_settled(axes: Axes, runs: Sequence[Trajectory]) -> None:
    """A mark on the curve of each run's error where it has settled, all in the legend's colour."""
    label = _SETTLED
    for run in runs:
        if (after := settling_time(run)) is not None:
            axes.plot(
                run.t[0] + after, BAND * run.error_norm[0], "o", color=style.GREY, markersize=6.0,
                markeredgecolor="white", markeredgewidth=0.8, label=label, zorder=6,
            )  # fmt: skip
            label = "_"


def write_run_figures(
    trajectory: Trajectory, folder: str | Path, *, ellipsoids: Wanted = False, options: FigureOptions = PLAIN
) -> list[Path]:
    """Write motion, errors and inputs; where there are such objective, limits and clearance, too.

    Parameters
    ----------
    trajectory : a run of at least one sample
    folder : an existing folder
    ellipsoids : whether ellipses are drawn too, or how (`nmm.playback.EllipsoidOptions`)
    options : formats and width

    Returns
    -------
    The files written: motion.png and so on, or of the formats asked for.

    Examples
    --------
    >>> run = nmm.Scenario.load("unicycle_2r_position").run()
    >>> sorted(path.name for path in nmm.figures.write_run_figures(run, "."))
    ['errors.png', 'inputs.png', 'motion.png', 'objective.png']
    """
    across = options.across()
    figures = {
        "motion": stroboscopic(trajectory, **across),
        "errors": curves.errors(trajectory, **across),
        "inputs": curves.inputs(trajectory, **across),
    }
    if has_objective([trajectory]):
        figures["objective"] = objective_comparison([trajectory], **across)
    if has_limits(trajectory):
        figures["limits"] = limits(trajectory, **across)
    if has_clearance(trajectory):
        figures["clearance"] = clearance(trajectory, **across)
    if ellipsoids is not False:
        # Not before: with it comes the whole of the analysis.
        from nmm.views.figures.ellipses import ellipses

        figures["ellipses"] = ellipses(trajectory, ellipsoids, **across)
    return [path for name, made in figures.items() for path in save_as(made, Path(folder), name, options)]
