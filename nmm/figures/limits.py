"""A run under limits: where each limited quantity is in its range, and what was left of the task."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from nmm import looks
from nmm.figures import style
from nmm.robots.wheel_rates import wheel_rates
from nmm.runs.trajectory import Trajectory

#: A limit counts as near within this share of its range.
NEAR = 0.05
#: What the lines and the shading are called.
_LEAST = "least margin"
LIMIT, FREE = "limit", f"farther than {100 * NEAR:g} % of the range from both"


def has_limits(trajectory: Trajectory) -> bool:
    """Whether a run kept limits and has the figure."""
    return trajectory.limited and bool(trajectory.limit_names) and len(trajectory.shares) == len(trajectory)


def limits(trajectory: Trajectory, *, width: float = style.PAGE) -> Figure:
    """Each limited quantity in the band of its range over time, 0 at its lower and 1 at its upper limit.

    Inputs in one panel, coordinates and what else is limited in another; below them λ and the least margin.

    Examples
    --------
    >>> run = nmm.Scenario.load("tiago_tray").run()
    >>> figure = nmm.figures.limits(run)
    >>> run.limited
    True
    """
    count = trajectory.robot.n_u
    inputs = {f"u_{name}" for name in trajectory.robot.u_names[:count]}
    columns = range(len(trajectory.limit_names))
    parts = {
        "inputs": [i for i in columns if trajectory.limit_names[i] in inputs],
        "others": [i for i in columns if trajectory.limit_names[i] not in inputs],
    }
    if all(trajectory.limit_names[i] in trajectory.robot.q_names for i in parts["others"]):
        parts["coordinates"] = parts.pop("others")
    shown = {name: part for name, part in parts.items() if part}
    legends = [[*_names(trajectory, part), LIMIT, FREE] for part in shown.values()]
    legends.append([*_levels(trajectory), _LEAST])
    made, panels = style.stack([1.5] * len(shown) + [1.1], legends, width)
    for axes, (name, part) in zip(panels, shown.items(), strict=False):
        draw_shares(axes, trajectory, part, f"{name}, share of range")
    draw_scale(panels[-1], trajectory)
    return style.aligned(made)


def _levels(trajectory: Trajectory) -> list[str]:
    count = trajectory.scale.shape[1]
    return ["λ"] if count == 1 else [f"λ, level {level + 1}" for level in range(count)]


def _names(trajectory: Trajectory, columns: Sequence[int]) -> list[str]:
    wheels, _ = wheel_rates(trajectory.robot)
    names = [trajectory.limit_names[column] for column in columns]
    return [looks.pretty(name.removeprefix("u_")) + " rate" * (name in wheels) for name in names]


def draw_shares(axes: Axes, trajectory: Trajectory, columns: Sequence[int], y: str) -> None:
    """Where quantities are between their limits, a curve each; what is far from both is shaded."""
    shares = trajectory.shares[:, columns]
    low, high = min(0.0, float(shares.min())), max(1.0, float(shares.max()))
    for k, (column, name) in enumerate(zip(columns, _names(trajectory, columns), strict=True)):
        color, dashes = looks.CYCLE[k % 7], looks.DASHES[k % 4]
        style.curve(axes, trajectory.t, trajectory.shares[:, column], name, color, dashes)
    for end in (0.0, 1.0):
        axes.axhline(end, color=looks.BLACK, linewidth=1.0, zorder=1, label=None if end else LIMIT)
    axes.axhspan(NEAR, 1.0 - NEAR, color=looks.GREEN, alpha=0.07, linewidth=0, label=FREE)
    style.label(axes, y=y)
    axes.set_ylim(low - 0.05 * (high - low), high + 0.05 * (high - low))
    style.time_axis(axes, trajectory.t, named=False)
    style.legend(axes)


def draw_scale(axes: Axes, trajectory: Trajectory, *, named: bool = True) -> None:
    """λ of each level, and the least margin of all limits: 0.5 in the middle of its range, 0 at a limit."""
    for level, name in enumerate(_levels(trajectory)):
        style.curve(axes, trajectory.t, trajectory.scale[:, level], name, looks.CYCLE[level % 7])
    least = trajectory.margin
    lowest = 0.0
    if np.all(np.isfinite(least)):
        style.curve(axes, trajectory.t, least, _LEAST, looks.VERMILLION, "--")
        lowest = min(0.0, float(least.min()))
    axes.set_ylim(lowest - 0.05, 1.05)
    style.label(axes, y="λ, margin")
    style.time_axis(axes, trajectory.t, named=named)
    style.legend(axes)
