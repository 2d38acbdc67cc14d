"""Figures of several panels: one run at a glance, several runs side by side, a run folder's files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from nmm import looks
from nmm.arrays import Array
from nmm.errors import InputError
from nmm.figures import curves, style
from nmm.figures.clearance import clearance, has_clearance
from nmm.figures.limits import draw_scale, has_limits, limits
from nmm.figures.motion import Scene, stroboscopic
from nmm.figures.objective import draw_best_objective, has_objective, objective_comparison
from nmm.runs.ellipsoid_options import Wanted
from nmm.runs.trajectory import Trajectory

#: Width of a figure of two columns and of its left column, in.
_WIDTH, _VIEW = 10.4, 4.8


def overview(trajectory: Trajectory) -> Figure:
    """One run at a glance: the motion, the error's norm, the objective, the inputs; under limits λ, too."""
    scene = Scene(trajectory)
    parts = list(curves.input_parts(trajectory).values())
    left = style.LEFT + _VIEW + style.LEFT
    names = [curves.input_names(trajectory, columns) for columns in parts]
    limited = has_limits(trajectory)
    legends = [
        1,
        1,
        *(style.legend_rows(part, _WIDTH - left - style.RIGHT) for part in names),
        *([1] * limited),
    ]
    drawn = min(scene.height(scene.views[0], _VIEW), 6.2)
    each = max(1.0, (style.GAP + drawn - style.column_height([], legends)) / len(legends))
    heights = [each] * len(legends)
    total = style.BOTTOM + style.column_height(heights, legends)
    made = style.figure(_WIDTH, total)
    below = _draw_views(made, scene, total)
    if below > style.BOTTOM + style.GAP + 0.8:
        height = min(below - style.BOTTOM - style.GAP, 1.4)
        axes = style.place(made, style.LEFT, below - style.GAP - height, _VIEW, height)
        curves.draw_singular_value(axes, trajectory)
    panels = style.column(made, heights, legends, left, _WIDTH - style.RIGHT, total)
    curves.draw_error_norm(panels[0], trajectory)
    draw_best_objective(panels[1], [trajectory])
    if not trajectory.complete:
        panels[1].text(
            1.0, 1.04, f"run {trajectory.outcome}", transform=panels[1].transAxes, ha="right", va="bottom",
            fontsize=style.TEXT, color=looks.VERMILLION, fontweight="bold",
        )  # fmt: skip
    for axes, columns in zip(panels[2:], parts, strict=False):
        curves.draw_inputs(axes, trajectory, columns)
        style.legend(axes)
    if limited:
        draw_scale(panels[-1], trajectory, named=False)
    _name_last(panels)
    return made


def _draw_views(made: Figure, scene: Scene, top: float) -> float:
    """Draw the views of the motion that fit, from the top down; returns where the room left begins, in."""
    for index, view in enumerate(scene.views):
        tall = scene.height(view, _VIEW)
        height = min(tall, 6.2)
        if index and top - style.GAP - height < style.BOTTOM:
            break
        rows = 1 if index else style.legend_rows(scene.names, _VIEW)
        top -= style.room(rows) + height
        axes = style.place(made, style.LEFT, top, _VIEW * height / tall, height)
        scene.draw(axes, view)
        if index == 0:
            style.legend(axes, _VIEW)
        top -= style.BOTTOM
    return top


def comparison(trajectories: Sequence[Trajectory]) -> Figure:
    """Several runs side by side: their paths from above, objective, error and size of the inputs."""
    runs = [run for run in trajectories if len(run)]
    if not runs:
        raise InputError("figure of a comparison: expected a run with at least one sample, got none")
    worn = looks.looks([run.resolver for run in runs])
    left = style.LEFT + _VIEW + style.LEFT
    rows = style.legend_rows([look.name for look in worn], _WIDTH - left - style.RIGHT)
    heights, legends = [1.3] * 3, [rows] * 3
    total = style.BOTTOM + style.column_height(heights, legends)
    made = style.figure(_WIDTH, total)
    entries = 1 + (2 if runs[0].path is not None else 1) * len(runs)
    above = style.room(-(-entries // 3))
    view = style.place(made, style.LEFT, style.BOTTOM, _VIEW, total - style.BOTTOM - above)
    _draw_paths(view, runs, worn)
    panels = style.column(made, heights, legends, left, _WIDTH - style.RIGHT, total)
    draw_best_objective(panels[0], runs)
    _draw_norms(panels[1], runs, worn, [run.error_norm for run in runs])
    style.label(panels[1], y=f"‖e‖ {style.units(runs[0].r_units)}")
    _draw_norms(panels[2], runs, worn, [np.linalg.norm(run.u, axis=1) for run in runs])
    style.label(panels[2], y=f"‖u‖ {style.units(runs[0].robot.u_units)}")
    for axes in panels:
        style.legend(axes)
    _name_last(panels)
    return made


def _name_last(panels: Sequence[Axes]) -> None:
    """Only the lowest of panels that share an x axis says what it is."""
    for axes in panels[:-1]:
        axes.set_xlabel("")
    style.label(panels[-1], x="time t [s]")


def _draw_paths(axes: Axes, runs: Sequence[Trajectory], worn: Sequence[looks.Look]) -> None:
    desired, held = runs[0].moving, runs[0].held
    if len(held):
        axes.plot(
            *held[:, :2].T,
            "*",
            color=looks.ORANGE,
            markersize=12,
            markeredgecolor=looks.BLACK,
            label="target",
            linestyle="none",
            zorder=6,
        )
    if desired is not None:
        axes.plot(desired[:, 0], desired[:, 1], color="#C3C8D0", linewidth=5.0, label="desired path")
    for run, (name, color, dashes) in zip(runs, worn, strict=True):
        if run.path is not None:
            axes.plot(*run.path[:, :2].T, dashes, color=color, linewidth=1.5, label=f"{name}: {run.frame}")
        if run.robot.platform.n_p:
            axes.plot(*run.q[:, :2].T, dashes, color=color, linewidth=0.8, label=f"{name}: platform")
    axes.set_aspect("equal", adjustable="datalim")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MaxNLocator(nbins=9, steps=[1, 2, 5, 10]))
    style.label(axes, x="x [m]", y="y [m]")
    style.legend(axes)


def _draw_norms(
    axes: Axes, runs: Sequence[Trajectory], worn: Sequence[looks.Look], norms: Sequence[Array]
) -> None:
    positive = np.concatenate([norm[np.isfinite(norm) & (norm > 0.0)] for norm in norms])
    for run, (name, color, dashes), norm in zip(runs, worn, norms, strict=True):
        style.curve(axes, run.t, np.where(norm > 0.0, norm, np.nan), name, color, dashes)
    style.time_axis(axes, max((run.t for run in runs), key=lambda t: t[-1]))
    if positive.size:
        style.log_axis(axes, max(float(positive.min()), 1e-16), float(positive.max()))
    else:
        style.note(axes, "zero throughout")


def write_run_figures(
    trajectory: Trajectory, folder: str | Path, *, ellipsoids: Wanted = False
) -> list[Path]:
    """Write motion.png, errors.png, inputs.png; where there are such objective, limits and clearance, too.

    Parameters
    ----------
    trajectory : a run of at least one sample
    folder : an existing folder
    ellipsoids : whether ellipses.png is written too, or how (`nmm.playback.EllipsoidOptions`)

    Returns
    -------
    The files written.
    """
    folder = Path(folder)
    figures = {
        "motion": stroboscopic(trajectory),
        "errors": curves.errors(trajectory),
        "inputs": curves.inputs(trajectory),
    }
    if has_objective([trajectory]):
        figures["objective"] = objective_comparison([trajectory])
    if has_limits(trajectory):
        figures["limits"] = limits(trajectory)
    if has_clearance(trajectory):
        figures["clearance"] = clearance(trajectory)
    if ellipsoids is not False:
        # Not before: with it comes the whole of the analysis.
        from nmm.figures.ellipses import ellipses

        figures["ellipses"] = ellipses(trajectory, ellipsoids)
    return [style.save(made, folder / f"{name}.png") for name, made in figures.items()]
