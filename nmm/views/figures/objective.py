"""H(q) over time, resolver against resolver (the paper's Figs. 4, 6, 8 and 10)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from nmm.base import resolver_style
from nmm.base.arrays import Array
from nmm.motion.trajectory import Trajectory
from nmm.views.figures import style

#: A logarithmic axis shows H down to this fraction of its largest value.
_FLOOR = 1e-8
#: The inset, in fractions of its axes: left, lower edge, width, height.
_INSET = (0.42, 0.28, 0.56, 0.66)


def objective_comparison(
    trajectories: Sequence[Trajectory],
    zoom: tuple[float, float] | None = None,
    symbol: str = "H(q)",
    *,
    width: float = style.PAGE,
) -> Figure:
    """H of several runs over time: above, with an inset on the initial transient; below, logarithmic.

    The logarithmic panel is there where H stays above zero, the inset where it hides no curve.

    Parameters
    ----------
    trajectories : runs of the same scenario
    zoom : the inset's limits in time, s; when not given, until the slowest run has come close
    symbol : what the axes call H
    width : of the figure, in

    Raises
    ------
    InputError : no run with a sample

    Examples
    --------
    >>> runs = [nmm.Scenario.load("unicycle_2r_position").with_resolver(name).run() for name in ("rg", "pg")]
    >>> figure = nmm.figures.objective_comparison(runs, zoom=(0.0, 1.0))
    >>> figure.axes[0].get_ylabel()
    'H(q)'
    """
    runs = style.sampled(trajectories, "the objective")
    logarithmic = _can_be_logarithmic(runs)
    heights = [1.9, 1.4] if logarithmic else [2.1]
    made, panels = style.stack(heights, [[run.called for run in runs], []][: len(heights)], width)
    draw_objective(panels[0], runs, symbol, named=not logarithmic)
    style.legend(panels[0])
    first, last = _transient(runs) if zoom is None else zoom
    if _inset_is_free(panels[0], runs, last):
        _draw_inset(panels[0], runs, first, last)
    if logarithmic:
        draw_objective(panels[1], runs, symbol, logarithmic=True)
    return style.aligned(made)


def has_objective(trajectories: Sequence[Trajectory]) -> bool:
    return any(len(run) and bool(np.any(run.objective != 0.0)) for run in trajectories)


def draw_objective(
    axes: Axes,
    runs: Sequence[Trajectory],
    symbol: str = "H(q)",
    *,
    logarithmic: bool = False,
    named: bool = True,
) -> None:
    """H of each run over time, in its resolver's colour; on a logarithmic axis it ends where that does."""
    H = _finite(runs)
    positive = H[H > 0.0]
    lowest = max(float(positive.min()), _FLOOR * float(positive.max())) if logarithmic else 0.0
    end = 10.0 ** style.decades(lowest, float(positive.max()))[0] if logarithmic else -np.inf
    worn = resolver_style.looks_of_labels([run.called for run in runs])
    style.compared(axes, worn, [run.t for run in runs], [np.maximum(run.objective, end) for run in runs])
    style.label(axes, y=symbol)
    style.time_axis(axes, longest(runs), named=named)
    if logarithmic:
        style.log_axis(axes, lowest, float(positive.max()), below=bool(H.min() < end))
    else:
        style.value_axis(axes)


def draw_best_objective(axes: Axes, runs: Sequence[Trajectory]) -> None:
    """H in one panel: logarithmic where it stays above zero."""
    if has_objective(runs):
        draw_objective(axes, runs, logarithmic=_can_be_logarithmic(runs))
    else:
        style.time_axis(axes, longest(runs))
        style.note(axes, "no objective")


def _finite(runs: Sequence[Trajectory]) -> Array:
    H = np.concatenate([run.objective for run in runs])
    return H[np.isfinite(H)]


def _can_be_logarithmic(runs: Sequence[Trajectory]) -> bool:
    """Whether H stays above zero and falls by more than a linear axis shows."""
    H = _finite(runs)
    return bool(H.size and H.min() >= 0.0 and H.max() > 10.0 * float(np.median(H)))


def longest(runs: Sequence[Trajectory]) -> Array:
    """The times of the run that ends last."""
    return max((run.t for run in runs), key=lambda t: float(t[-1]))


def _transient(runs: Sequence[Trajectory]) -> tuple[float, float]:
    """From the start until a while after the slowest run has done 98 % of its way."""
    start, end = float(runs[0].t[0]), float(longest(runs)[-1])
    settled = start
    for run in runs:
        fallen = run.objective - np.min(run.objective)
        away = np.flatnonzero(fallen > 0.02 * fallen[0])
        if away.size:
            settled = max(settled, float(run.t[away[-1]]))
    length = 1.2 * (settled - start)
    return start, start + min(max(length, 0.02 * (end - start)), 0.2 * (end - start))


def _inset_is_free(axes: Axes, runs: Sequence[Trajectory], last: float) -> bool:
    """Whether an inset is of use, and lies over no curve."""
    t = longest(runs)
    low, high = axes.get_ylim()
    edge = low + (_INSET[1] - 0.12) * (high - low)
    begins = float(t[0]) + (_INSET[0] - 0.08) * float(t[-1] - t[0])
    below = all(bool(np.all(run.objective[run.t >= begins] < edge)) for run in runs)
    return below and last < float(t[-1]) and len(t) > 2


def _draw_inset(axes: Axes, runs: Sequence[Trajectory], first: float, last: float) -> None:
    inset = axes.inset_axes(_INSET)
    worn = resolver_style.looks_of_labels([run.called for run in runs])
    seen = [(run.t >= first - 1e-9) & (run.t <= last + 1e-9) for run in runs]
    times = [run.t[mask] for run, mask in zip(runs, seen, strict=True)]
    style.compared(inset, worn, times, [run.objective[mask] for run, mask in zip(runs, seen, strict=True)])
    style.dress(inset, size=style.SMALL - 1.0)
    inset.set_xlim(first, last)
    style.value_axis(inset)
    inset.xaxis.set_major_locator(MaxNLocator(nbins=6))
    inset.xaxis.set_major_formatter(style.plain())
    inset.set_title("initial transient, t [s]", fontsize=style.SMALL - 1.0, pad=3, color=resolver_style.BLACK)
