"""Figures of several panels: one run at a glance, several runs side by side, a run folder's files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from nmm import looks
from nmm.arrays import Array
from nmm.errors import InputError
from nmm.figures import curves, style
from nmm.figures.clearance import clearance, has_clearance
from nmm.figures.files import save_as
from nmm.figures.limits import draw_scale, has_limits, limits
from nmm.figures.motion import Scene, stroboscopic
from nmm.figures.objective import draw_best_objective, has_objective, objective_comparison
from nmm.figures.paths import Paths
from nmm.figures.views import Viewed
from nmm.runs.ellipsoid_options import Wanted
from nmm.runs.figure_options import PLAIN, FigureOptions
from nmm.runs.settling import BAND, settling_time
from nmm.runs.trajectory import Trajectory

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
    """Drawings at the left, panels over time at the right; in a narrow figure the panels below.

    Attributes
    ----------
    view, left, right : width of the drawings, and where the panels begin and end, in
    """

    def __init__(self, width: float) -> None:
        self.width, self.beside = width, width >= _NARROW
        across = width - style.LEFT - style.RIGHT
        self.view = 0.56 * (across - style.LEFT) if self.beside else across
        self.left = style.LEFT + (self.view + style.LEFT if self.beside else 0.0)
        self.right = width - style.RIGHT

    def rows(self, names: Sequence[str]) -> int:
        """Rows of a legend above a panel."""
        return style.legend_rows(names, self.right - self.left)

    def made(self, panels: float, drawing: float) -> tuple[Figure, float, float]:
        """A figure for panels and a drawing so high, and where both begin, from the top, in."""
        if self.beside:
            total = style.BOTTOM + panels
            return style.figure(self.width, total), total, total
        total = 2.0 * style.BOTTOM + panels + drawing
        return style.figure(self.width, total), total - style.BOTTOM - drawing, total


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
    scene, columns = Scene(trajectory), _Columns(width)
    parts = list(curves.input_parts(trajectory).values())
    names = [curves.input_names(trajectory, part) for part in parts]
    limited = has_limits(trajectory)
    legends = [1, 1, *(columns.rows(part) for part in names), *([1] * limited)]
    drawn = min(scene.height(scene.views[0], columns.view), _TALLEST)
    above = style.room(style.legend_rows(scene.names, columns.view))
    each = 1.0
    if columns.beside:
        each = max(each, (above + drawn - style.column_height([], legends)) / len(legends))
    heights = [each] * len(legends)
    made, begins, top = columns.made(style.column_height(heights, legends), above + drawn)
    below = _draw_views(made, scene, columns, top, style.BOTTOM if columns.beside else begins)
    if columns.beside and below > style.BOTTOM + style.GAP + _LOW:
        height = min(below - style.BOTTOM - style.GAP, _HIGH)
        axes = style.place(made, style.LEFT, below - style.GAP - height, columns.view, height)
        curves.draw_singular_value(axes, trajectory)
    panels = style.column(made, heights, legends, columns.left, columns.right, begins)
    curves.draw_error_norm(panels[0], trajectory)
    draw_best_objective(panels[1], [trajectory])
    if not trajectory.complete:
        panels[1].text(
            1.0, 1.04, f"run {trajectory.outcome}", transform=panels[1].transAxes, ha="right", va="bottom",
            fontsize=style.TEXT, color=looks.VERMILLION, fontweight="bold",
        )  # fmt: skip
    for axes, part in zip(panels[2:], parts, strict=False):
        curves.draw_inputs(axes, trajectory, part)
        style.legend(axes)
    if limited:
        draw_scale(panels[-1], trajectory, named=False)
    _name_last(panels)
    return style.aligned(made)


def _draw_views(
    made: Figure, scene: Viewed, columns: _Columns, top: float, bottom: float, tallest: float = _TALLEST
) -> float:
    """Draw the views that fit, from the top down; returns where the room left begins, in."""
    for index, view in enumerate(scene.views):
        tall = scene.height(view, columns.view)
        height = min(tall, tallest)
        if index and top - style.GAP - height < bottom - 1e-6:
            break
        rows = 1 if index else style.legend_rows(scene.names, columns.view)
        top -= style.room(rows) + height
        axes = style.place(made, style.LEFT, top, columns.view * height / tall, height)
        scene.draw(axes, view)
        if index == 0:
            style.legend(axes, columns.view)
        top -= style.BOTTOM
    return top


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
    runs = [run for run in trajectories if len(run)]
    if not runs:
        raise InputError("figure of a comparison: expected a run with at least one sample, got none")
    worn, columns = looks.looks_of_labels([run.called for run in runs]), _Columns(width)
    scene = Paths(runs, worn)
    tallest = _TALL if len(scene.views) > 1 else _TALLEST
    drawn = [min(scene.height(view, columns.view), tallest) for view in scene.views]
    rooms = [style.legend_rows(scene.names, columns.view), *[1] * (len(drawn) - 1)]
    drawing = style.column_height(drawn, rooms) + style.BOTTOM * (len(drawn) - 1)
    names = [look.name for look in worn]
    settle = [_SETTLED] * any(settling_time(run) is not None for run in runs)
    rows = columns.rows(names)
    legends = [rows, columns.rows(names + settle), rows]
    each = 1.3
    if columns.beside:
        each = max(each, (drawing - style.column_height([], legends)) / 3)
    made, begins, top = columns.made(style.column_height([each] * 3, legends), drawing)
    bottom = style.BOTTOM if columns.beside else begins
    below = _draw_views(made, scene, columns, top, bottom, tallest) - style.room(rows)
    panels = style.column(made, [each] * 3, legends, columns.left, columns.right, begins)
    if columns.beside and below > style.BOTTOM + _LOW and has_objective(runs):
        height = min(below - style.BOTTOM, _HIGH)
        axes = style.place(made, style.LEFT, below - height, columns.view, height)
        _draw_singular_values(axes, runs, worn)
        style.label(axes, x="time t [s]")
        style.legend(axes)
    if has_objective(runs):
        draw_best_objective(panels[0], runs)
    else:
        _draw_singular_values(panels[0], runs, worn)
    _draw_norms(panels[1], runs, worn, [run.error_norm for run in runs])
    _mark_settled(panels[1], runs, worn)
    style.label(panels[1], y=f"‖e‖ {style.units(runs[0].r_units)}")
    _draw_norms(panels[2], runs, worn, [np.linalg.norm(run.u, axis=1) for run in runs])
    style.label(panels[2], y=f"‖u‖ {style.units(runs[0].robot.u_units)}")
    for axes in panels:
        style.legend(axes)
    _name_last(panels)
    return style.aligned(made)


def _name_last(panels: Sequence[Axes]) -> None:
    """Only the lowest of panels that share an x axis says what it is."""
    for axes in panels[:-1]:
        axes.set_xlabel("")
    style.label(panels[-1], x="time t [s]")


def _draw_singular_values(axes: Axes, runs: Sequence[Trajectory], worn: Sequence[looks.Look]) -> None:
    _draw_norms(axes, runs, worn, [run.sigma_min for run in runs])
    style.label(axes, y="σ_min")


def _draw_norms(
    axes: Axes, runs: Sequence[Trajectory], worn: Sequence[looks.Look], norms: Sequence[Array]
) -> None:
    positive = np.concatenate([norm[np.isfinite(norm) & (norm > 0.0)] for norm in norms])
    for k, (run, look, norm) in enumerate(zip(runs, worn, norms, strict=True)):
        style.curve(axes, run.t, np.where(norm > 0.0, norm, np.nan), *look, below=len(runs) - 1 - k)
    style.time_axis(axes, max((run.t for run in runs), key=lambda t: t[-1]))
    if positive.size:
        style.log_axis(axes, max(float(positive.min()), 1e-16), float(positive.max()))
    else:
        style.note(axes, "zero throughout")


def _mark_settled(axes: Axes, runs: Sequence[Trajectory], worn: Sequence[looks.Look]) -> None:
    """Where each run's error has come down for good; all runs begin alike, so the legend has one mark."""
    label = _SETTLED
    for run, look in zip(runs, worn, strict=True):
        if (after := settling_time(run)) is not None:
            band = BAND * run.error_norm[0]
            axes.plot(
                run.t[0] + after, band, "o", color=look.color, markersize=5.0, label=label, linestyle="none"
            )
            label = "_"


def write_run_figures(
    trajectory: Trajectory,
    folder: str | Path,
    *,
    ellipsoids: Wanted = False,
    options: FigureOptions = PLAIN,
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
        from nmm.figures.ellipses import ellipses

        figures["ellipses"] = ellipses(trajectory, ellipsoids, **across)
    return [path for name, made in figures.items() for path in save_as(made, Path(folder), name, options)]
