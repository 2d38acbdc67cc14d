"""A run that keeps distances: the least one over time, and between what."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from nmm import looks
from nmm.figures import style
from nmm.runs.trajectory import Trajectory

#: So many pairs have a colour and a name of their own, those that were nearest the longest.
NAMED = 6


def has_clearance(trajectory: Trajectory) -> bool:
    """Whether a run kept distances and has the figure."""
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
            t, np.where(shown, d, np.nan), color=looks.CYCLE[k % 7], linewidth=style.WIDTH, label=name,
            solid_joinstyle="round",
        )  # fmt: skip
    asked = trajectory.clearance_asked
    axes.axhline(asked, color=looks.BLACK, linewidth=1.0, linestyle="--", label="distance to keep")
    axes.set_ylim(min(0.0, float(d.min())), None)
    style.label(axes, y="least distance [m]")
    style.time_axis(axes, t)
    style.legend(axes)
    return style.aligned(made)
