"""Curves over time of one run: errors, tracked components, inputs, coordinates, singular values."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from nmm.base import resolver_style
from nmm.base.arrays import Array
from nmm.control.step.quantities import QUANTITIES
from nmm.motion.components import components
from nmm.motion.trajectory import Trajectory
from nmm.views.figures import style

#: Errors below this fraction of the largest are rounding, and are left out of the fit.
_FLOOR = 1e-9
#: Two panels stand beside each other in a figure that is at least this wide, in.
_ROOM_FOR_TWO = 4.5
_SIGMA = "smallest singular value of J_bar"
#: As wide as the legend of the error's norm is, with its guide.
_NORM_AND_GUIDE = ("‖e‖", "‖e(0)‖ exp(−K t), K = 0.0000 1/s (fitted)")


def errors(trajectory: Trajectory, gain: float | None = None, *, width: float = style.PAGE) -> Figure:
    """The task error's components over time, a panel a unit, and ‖e‖ on a logarithmic scale.

    Parameters
    ----------
    trajectory : the run
    gain : K of the guide ‖e(0)‖ exp(-K t), 1/s; when not given, the one that all tasks of the run's
        scenario share, or else the rate fitted to the run
    width : of the figure, in

    Examples
    --------
    >>> run = nmm.Scenario.load("unicycle_2r_position").run()
    >>> figure = nmm.figures.errors(run, gain=1.0)
    >>> figure.axes[-1].get_yscale()
    'log'
    """
    kinds = style.groups(trajectory.r_units)
    names = [component.text for component in components(trajectory, QUANTITIES["error"])]
    legends = [[names[row] for row in rows] for rows in kinds.values()]
    made, panels = style.stack([1.15] * len(kinds) + [1.5], [*legends, _NORM_AND_GUIDE], width)
    for axes, (unit, rows), texts in zip(panels, kinds.items(), legends, strict=False):
        style.columns(axes, trajectory.t, trajectory.error[:, rows], texts, zero=True)
        draw_events(axes, trajectory, named=False)
        style.finish(axes, trajectory.t, f"error [{unit}]", named=False)
    draw_error_norm(panels[-1], trajectory, gain)
    return style.aligned(made)


def draw_events(axes: Axes, trajectory: Trajectory, *, named: bool) -> None:
    """A line where a task begins (dashed) or ends (dotted) after the run's beginning, with its name."""
    at: dict[float, list[str]] = {}
    for event in trajectory.events:
        if event.t > trajectory.t[0]:
            at.setdefault(event.t, []).append(f"{event.task} {event.what}")
    for t, texts in at.items():
        dashes = "--" if any(text.endswith("begins") for text in texts) else ":"
        axes.axvline(t, color=style.GREY, linestyle=dashes, linewidth=1.0, zorder=1)
        if named:
            axes.annotate(
                f"{', '.join(texts)} ", (t, 0.02), xycoords=("data", "axes fraction"), rotation=90,
                ha="right", va="bottom", fontsize=style.SMALL, color=style.GREY, parse_math=False,
            )  # fmt: skip


def draw_error_norm(axes: Axes, trajectory: Trajectory, gain: float | None = None) -> None:
    """‖e‖ on a logarithmic scale, with exp(-K t) for the gain given, or the rate fitted."""
    t, norm = trajectory.t, trajectory.error_norm
    style.label(axes, y=f"‖e‖ {style.units(trajectory.r_units)}")
    style.time_axis(axes, t)
    positive = style.positive([norm])
    if not positive.size:
        style.note(axes, "the error is zero throughout")
        return
    style.curve(axes, t, np.where(norm > 0.0, norm, np.nan), "‖e‖", resolver_style.BLUE)
    lowest, highest = max(float(positive.min()), 1e-16), float(positive.max())
    gain = _stated_gain(trajectory) if gain is None else gain
    rate = fitted_rate(t, norm) if gain is None else gain
    draw_events(axes, trajectory, named=True)
    # What begins later decays from there on; a planned motion is no feedback.
    decays = not trajectory.events and trajectory.resolver != "plan"
    if rate is not None and rate > 0.0 and decays:
        guide = norm[0] * np.exp(-rate * (t - t[0]))
        seen = guide >= lowest * 0.5
        name = f"‖e(0)‖ exp(−K t), K = {rate:.4g} 1/s{' (fitted)' if gain is None else ''}"
        axes.plot(t[seen], guide[seen], ":", color=resolver_style.BLACK, linewidth=1.8, label=name)
    style.log_axis(axes, lowest, highest)
    style.legend(axes)


def _stated_gain(trajectory: Trajectory) -> float | None:
    """The gain K with which the run's scenario follows a plan, or that all its tasks share, 1/s; None where
    there is no such number."""
    scenario = trajectory.scenario or {}
    tasks = (scenario.get("plan") or {}).get("track") or scenario.get("task", [])
    gains = [task.get("gain") for task in (tasks if isinstance(tasks, list) else [tasks])]
    stated = bool(gains) and isinstance(gains[0], int | float) and gains.count(gains[0]) == len(gains)
    return float(gains[0]) if stated else None


def fitted_rate(t: Array, values: Array) -> float | None:
    """K of exp(-K t) fitted to positive values before they reach rounding; None where nothing decays."""
    if len(t) < 3 or not values[0] > 0.0:
        return None
    below = np.flatnonzero(~(values > _FLOOR * values[0]))
    end = int(below[0]) if below.size else len(t)
    if end < 3 or not values[end - 1] < 0.5 * values[0]:
        return None
    return float(-np.polyfit(t[:end], np.log(values[:end]), 1)[0])


def tracking(trajectory: Trajectory, *, width: float = style.PAGE) -> Figure:
    """Each component of the task over time, its reference dashed (the paper's Fig. 9); `width` in wide.

    Examples
    --------
    >>> run = nmm.Scenario.load("unicycle_3r_position").run()
    >>> [axes.get_ylabel() for axes in nmm.figures.tracking(run).axes]
    ['ee.x [m]', 'ee.y [m]', 'ee.z [m]']
    """
    t, names = trajectory.t, trajectory.r_names
    made, panels = style.stack([1.1] * len(names), [["reference"], *[[]] * (len(names) - 1)], width)
    for row, (axes, name, unit) in enumerate(zip(panels, names, trajectory.r_units, strict=True)):
        target: Array = trajectory.r_d[:, row]
        if unit == "rad":  # without the jumps of 2π that an angle's display would make
            known = ~np.isnan(target)  # the reference of a task that comes and goes has gaps
            target = target.copy()
            target[known] = np.unwrap(target[known])
        style.curve(axes, t, target - trajectory.error[:, row], None, resolver_style.CYCLE[row % 7])
        style.curve(axes, t, target, None if row else "reference", resolver_style.BLACK, "--")
        axes.lines[-1].set_linewidth(1.0)
        style.finish(axes, t, f"{name} [{unit}]", named=row == len(names) - 1)
    return style.aligned(made)


def inputs(trajectory: Trajectory, *, width: float = style.PAGE) -> Figure:
    """The inputs over time: the platform's in one panel, the arm's in another.

    Where the initial transient dwarfs the rest, it has panels of its own at the left, and those at
    the right are scaled to what comes after it; not in figures that have no room for both.

    Parameters
    ----------
    width : of the figure, in

    Examples
    --------
    >>> run = nmm.Scenario.load("unicycle_2r_position").run()
    >>> len(nmm.figures.inputs(run).axes)
    4
    """
    parts = input_parts(trajectory)
    across = width - style.LEFT - style.RIGHT
    legends = [style.legend_rows(input_names(trajectory, columns), across) for columns in parts]
    heights = [1.45] * len(parts)
    total = style.BOTTOM + style.column_height(heights, legends)
    made = style.figure(width, total)
    transient = _transient(trajectory) if width >= _ROOM_FOR_TWO else None
    start, end = float(trajectory.t[0]), float(trajectory.t[-1])
    split, since = (style.LEFT, start) if transient is None else (0.5 * width, transient)
    panels = style.column(made, heights, legends, split, width - style.RIGHT, total)
    for axes, columns in zip(panels, parts, strict=True):
        draw_inputs(axes, trajectory, columns, named=columns is parts[-1], since=since)
    if transient is None:
        for axes in panels:
            style.legend(axes)
        return style.aligned(made)
    lefts = style.column(made, heights, legends, style.LEFT, split - 0.55, total)
    for left, right, columns in zip(lefts, panels, parts, strict=True):
        draw_inputs(left, trajectory, columns, named=columns is parts[-1], until=transient)
        left.set_xlim(start, transient)
        left.xaxis.set_major_locator(MaxNLocator(nbins=4))
        style.legend(left, across)
        right.set(xlim=(transient, end), ylabel="")
    return style.aligned(made)


def _transient(trajectory: Trajectory) -> float | None:
    """When the large inputs of the start are over, s; None where they are no larger than the rest."""
    t, size = trajectory.t, np.abs(trajectory.u).max(axis=1)
    if len(t) < 50 or not np.all(np.isfinite(size)):
        return None
    later = float(size[t > t[0] + 0.2 * (t[-1] - t[0])].max(initial=0.0))
    if not size.max() > 4.0 * later:
        return None
    above = np.flatnonzero(size > 1.5 * later)
    return float(np.ceil(2.0 * t[above[-1]]) / 2.0) if above.size else None


def input_parts(trajectory: Trajectory) -> list[list[int]]:
    """Columns of u of the platform and of the arm, where there are any."""
    p = trajectory.robot.platform.p
    return [part for part in (list(range(p)), list(range(p, trajectory.robot.n_u))) if part]


def draw_inputs(
    axes: Axes,
    trajectory: Trajectory,
    columns: Sequence[int],
    *,
    named: bool = True,
    since: float = -np.inf,
    until: float = np.inf,
) -> None:
    robot, t = trajectory.robot, trajectory.t
    seen = (t >= since) & (t <= until)
    style.columns(axes, t[seen], trajectory.u[seen][:, columns], input_names(trajectory, columns), zero=True)
    part = "arm" if columns[0] >= robot.platform.p else "platform"
    style.label(axes, y=f"{part} {style.units(robot.u_units[c] for c in columns)}")
    style.value_axis(axes)
    style.time_axis(axes, t, named=named)


def input_names(trajectory: Trajectory, columns: Sequence[int]) -> list[str]:
    """Legend entries, as the paper writes inputs: v, ω, the rate of q1 with a dot; with units that differ."""
    robot, names = trajectory.robot, []
    several = len({robot.u_units[column] for column in columns}) > 1
    for column in columns:
        name = resolver_style.pretty(robot.u_names[column])
        if column >= robot.platform.p and len(name) == 2 and name[0] == "q":
            name = f"{name[0]}\u0307{name[1]}"
        names.append(f"{name} [{robot.u_units[column]}]" if several else name)
    return names


def coordinates(trajectory: Trajectory, *, width: float = style.PAGE) -> Figure:
    """The coordinates over time: the platform's position, its angles, the arm; `width` in wide.

    Examples
    --------
    >>> run = nmm.Scenario.load("unicycle_2r_position").run()
    >>> len(nmm.figures.coordinates(run, width=3.5).axes)
    3
    """
    robot = trajectory.robot
    n_p = robot.platform.n_p
    parts = [
        (part, unit, [first + k for k in columns])
        for part, first, kinds in (("platform", 0, robot.q_units[:n_p]), ("arm", n_p, robot.q_units[n_p:]))
        for unit, columns in style.groups(kinds).items()
    ]
    legends = [[resolver_style.pretty(robot.q_names[k]) for k in columns] for _, _, columns in parts]
    made, panels = style.stack([1.2] * len(parts), legends, width)
    for axes, (part, unit, columns), names in zip(panels, parts, legends, strict=True):
        style.columns(axes, trajectory.t, trajectory.q[:, columns], names)
        style.finish(axes, trajectory.t, f"{part} [{unit}]", named=axes is panels[-1])
    return style.aligned(made)


def singular_values(trajectory: Trajectory, *, width: float = style.PAGE) -> Figure:
    """The smallest singular value of J_bar over time; below it RG's partition, its switches marked; `width`
    in wide.

    Examples
    --------
    >>> run = nmm.Scenario.load("unicycle_2r_switching").run()
    >>> figure = nmm.figures.singular_values(run)
    >>> figure.axes[0].get_ylabel()
    'σ_min'
    """
    partitioned = bool(np.any(trajectory.partition >= 0))
    names = [_SIGMA, *["switch of partition"] * bool(trajectory.switched)]
    heights, legends = ([1.7, 0.28], [names, []]) if partitioned else ([1.7], [names])
    made, panels = style.stack(heights, legends, width)
    draw_singular_value(panels[0], trajectory, named=not partitioned)
    if partitioned:
        _draw_partition(panels[1], trajectory)
    return style.aligned(made)


def draw_singular_value(axes: Axes, trajectory: Trajectory, *, named: bool = True) -> None:
    """σ_min of J_bar over time, with RG's switches of partition."""
    style.curve(axes, trajectory.t, trajectory.sigma_min, _SIGMA, resolver_style.BLUE)
    dashed: Any = {"color": resolver_style.VERMILLION, "linestyle": "--", "linewidth": 1.0}
    for k, sample in enumerate(trajectory.switched):
        axes.axvline(trajectory.t[sample], label=None if k else "switch of partition", **dashed)
    style.finish(axes, trajectory.t, "σ_min", named=named)
    axes.set_ylim(bottom=0.0)


def _draw_partition(axes: Axes, trajectory: Trajectory) -> None:
    """Which inputs are basic (Ja), as a band over time."""
    t = trajectory.t
    colors: dict[tuple[int, ...], str] = {}
    for first, last in pairwise([0, *trajectory.switched, len(t) - 1]):
        columns = tuple(sorted(int(c) for c in trajectory.partition[first]))
        names = ", ".join(resolver_style.pretty(trajectory.robot.u_names[c]) for c in columns if c >= 0)
        color = colors.setdefault(columns, resolver_style.CYCLE[len(colors) % 7])
        axes.axvspan(t[first], t[last], color=color, alpha=0.25, linewidth=0)
        if t[last] - t[first] > 0.15 * (t[-1] - t[0]):
            middle, text = 0.5 * (t[first] + t[last]), names or "none: damped"
            axes.text(middle, 0.5, text, ha="center", va="center", fontsize=style.SMALL, parse_math=False)
    axes.set(ylim=(0.0, 1.0), yticks=[])
    axes.grid(False)
    style.label(axes, y="Ja")
    style.time_axis(axes, t)
