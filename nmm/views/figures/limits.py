"""A run under limits: where each limited quantity is in its range, what was left of the task; distances."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from nmm.base import resolver_style
from nmm.model.robots.wheel_rates import wheel_rates
from nmm.motion.trajectory import Trajectory
from nmm.views.figures import style

#: A limit counts as near within this share of its range.
NEAR = 0.05
_LEAST = "least margin"
LIMIT, FREE = "limit", f"farther than {100 * NEAR:g} % of the range from both"
#: How many pairs have a colour and a name of their own: those that were nearest the longest.
NAMED = 6


def has_limits(trajectory: Trajectory) -> bool:
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
    inputs = {f"u_{name}" for name in trajectory.robot.u_names}
    names = trajectory.limit_names
    rest = "coordinates" if all(name in trajectory.robot.q_names for name in {*names} - inputs) else "others"
    parts = style.groups(["inputs" if name in inputs else rest for name in names])
    shown = {name: parts[name] for name in ("inputs", rest) if name in parts}
    legends = [_names(trajectory, part) for part in shown.values()]
    legends[0] += [LIMIT, FREE]
    legends.append([*_levels(trajectory), _LEAST])
    made, panels = style.stack([1.5] * len(shown) + [1.1], legends, width)
    for axes, (name, part) in zip(panels, shown.items(), strict=False):
        draw_shares(axes, trajectory, part, f"{name}, share of range", explained=axes is panels[0])
    draw_scale(panels[-1], trajectory)
    return style.aligned(made)


def _levels(trajectory: Trajectory) -> list[str]:
    count = trajectory.scale.shape[1]
    return ["λ"] if count == 1 else [f"λ, level {level + 1}" for level in range(count)]


def _names(trajectory: Trajectory, columns: Sequence[int]) -> list[str]:
    wheels, _ = wheel_rates(trajectory.robot)
    names = [trajectory.limit_names[column] for column in columns]
    return [resolver_style.pretty(name.removeprefix("u_")) + " rate" * (name in wheels) for name in names]


def draw_shares(
    axes: Axes, trajectory: Trajectory, columns: Sequence[int], y: str, *, explained: bool
) -> None:
    """Where quantities are between their limits, a curve each; what is far from both is shaded; the legend
    says so if asked."""
    shares = trajectory.shares[:, columns]
    low, high = min(0.0, float(shares.min())), max(1.0, float(shares.max()))
    style.columns(axes, trajectory.t, shares, _names(trajectory, columns))
    for end in (0.0, 1.0):
        label = LIMIT if explained and not end else None
        axes.axhline(end, color=resolver_style.BLACK, linewidth=1.0, zorder=1, label=label)
    label = FREE if explained else None
    axes.axhspan(NEAR, 1.0 - NEAR, color=resolver_style.GREEN, alpha=0.07, linewidth=0, label=label)
    axes.set_ylim(low - 0.05 * (high - low), high + 0.05 * (high - low))
    style.finish(axes, trajectory.t, y, named=False, ticks=False)


def draw_scale(axes: Axes, trajectory: Trajectory, *, named: bool = True) -> None:
    """λ of each level, and the least margin of all limits: 0.5 in the middle of its range, 0 at a limit."""
    for level, name in enumerate(_levels(trajectory)):
        style.curve(axes, trajectory.t, trajectory.scale[:, level], name, resolver_style.CYCLE[level % 7])
    least = trajectory.margin
    lowest = 0.0
    if np.all(np.isfinite(least)):
        style.curve(axes, trajectory.t, least, _LEAST, resolver_style.VERMILLION, "--")
        lowest = min(0.0, float(least.min()))
    axes.set_ylim(lowest - 0.05, 1.05)
    style.finish(axes, trajectory.t, "λ, margin", named=named, ticks=False)


def has_clearance(trajectory: Trajectory) -> bool:
    return (
        len(trajectory.clearance_between) == len(trajectory) > 0
        and bool(trajectory.clearance_names)
        and bool(np.isfinite(trajectory.clearance_between).any())
    )


def clearance(trajectory: Trajectory, *, width: float = style.PAGE) -> Figure:
    """The least distance over time, on the way to the next sample included, coloured by the nearest pair;
    the distance asked for as a line; `width` in wide.

    Examples
    --------
    >>> run = nmm.Scenario.load("unicycle_3r_door").run()
    >>> figure = nmm.figures.clearance(run)
    >>> figure.axes[0].get_ylabel()
    'least distance [m]'
    """
    t, d, pairs = trajectory.t, trajectory.clearance_between, trajectory.clearance_pairs
    kinds, counts = np.unique(pairs[(pairs >= 0) & np.isfinite(d)], return_counts=True)
    named = [int(pair) for pair in kinds[np.argsort(-counts, kind="stable")][:NAMED]]
    names = [trajectory.clearance_names[pair] for pair in named]
    entries = [*names, *["other pairs"] * (len(kinds) > NAMED), "distance to keep"]
    made, (axes,) = style.stack([2.2], [entries], width)
    style.curve(axes, t, d, "other pairs" if len(kinds) > NAMED else None, style.LIGHT)
    for k, (pair, name) in enumerate(zip(named, names, strict=True)):
        # Each stretch goes on to the sample at which another pair takes over.
        nearest = pairs == pair
        shown = nearest | np.append(False, nearest[:-1])
        axes.plot(
            t, np.where(shown, d, np.nan), color=resolver_style.CYCLE[k % 7], linewidth=style.WIDTH,
            label=name, solid_joinstyle="round",
        )  # fmt: skip
    asked = trajectory.clearance_asked
    axes.axhline(asked, color=resolver_style.BLACK, linewidth=1.0, linestyle="--", label="distance to keep")
    axes.set_ylim(min(0.0, float(d.min())), None)
    style.finish(axes, t, "least distance [m]", ticks=False)
    return style.aligned(made)
