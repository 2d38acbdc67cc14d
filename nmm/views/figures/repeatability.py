"""Laps round a closed path: how far the posture drifts in each, and where the platform drives."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from nmm.analysis.null_space.laps import Laps, Repeatability
from nmm.base import resolver_style
from nmm.base.arrays import Array
from nmm.base.errors import expect
from nmm.views.figures import style

#: Drifts below this are drawn here: rounding, and exact zeros, which a logarithmic axis has not.
LOWEST = 1e-16
#: Height of the drifts' panel, and the most of that with the paths, in.
DRIFT, PATHS = 1.9, 4.6
#: Drifts that differ by less than this factor are drawn on a linear scale.
MUCH = 30.0


def laps(found: Repeatability, *, width: float = style.PAGE) -> Figure:
    """Drift of the posture in each lap, logarithmic; below it the platforms' paths, if any, from above. Full
    turns of joints without limits are no drift. InputError if no lap was finished."""
    runs = [run for run in found.laps if len(run.distance)]
    expect(runs, "figure of laps", "at least one lap")
    worn = resolver_style.looks([run.name for run in runs])
    if len(worn) == 1:
        worn = [worn[0]._replace(dashes="-")]
    across = width - style.LEFT - style.RIGHT
    above = style.room(style.legend_rows([look.name for look in worn], across))
    if not runs[0].robot.platform.p:
        made = style.figure(width, style.BOTTOM + DRIFT + above)
        _draw_drift(style.place(made, style.LEFT, style.BOTTOM, across, DRIFT), runs, worn)
        return style.aligned(made)
    low, high = _limits(runs)
    height = min(PATHS, across * (high[1] - low[1]) / (high[0] - low[0]))
    between = style.BOTTOM + style.room(style.legend_rows(_path_names(runs, worn), across))
    made = style.figure(width, style.BOTTOM + height + between + DRIFT + above)
    upper = style.place(made, style.LEFT, style.BOTTOM + height + between, across, DRIFT)
    _draw_drift(upper, runs, worn)
    _draw_paths(style.place(made, style.LEFT, style.BOTTOM, across, height), runs, worn, across)
    return style.aligned(made)


def _draw_drift(axes: Axes, runs: list[Laps], worn: list[resolver_style.RunStyle]) -> None:
    drifts = [np.maximum(run.distance, LOWEST) for run in runs]
    every, longest = np.concatenate(drifts), max(map(len, drifts))
    for k, (drift, look) in enumerate(zip(drifts, worn, strict=True)):
        axes.plot(
            np.arange(1, len(drift) + 1), drift, look.dashes, color=look.color, linewidth=style.WIDTH,
            marker="osD^v"[k % 5], markersize=4.5, markerfacecolor="white" if k % 2 else look.color,
            label=look.name,
        )  # fmt: skip
    if every.max() > MUCH * every.min():
        style.log_axis(axes, float(every.min()), float(every.max()))
    else:
        style.value_axis(axes)
        axes.set_ylim(bottom=0.0)
    axes.set_xlim(0.8, longest + 0.2)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True, nbins=12))
    style.label(axes, x="lap", y="drift of the posture [m, rad]")
    style.legend(axes)


def _draw_paths(axes: Axes, runs: list[Laps], worn: list[resolver_style.RunStyle], width: float) -> None:
    """All laps thin, the last one thick, the laps' ends as dots; a legend `width` in wide."""
    axes.set_aspect("equal", adjustable="box")
    names = iter(_path_names(runs, worn))
    desired = _desired(runs[0])
    if desired is not None:
        axes.plot(*desired.T, ":", color=resolver_style.BLACK, linewidth=1.1, label=next(names))
    for run, look in zip(runs, worn, strict=True):
        path, samples = _path(run), _samples(run)
        last = path[len(path) - 1 - samples :]
        axes.plot(*path.T, look.dashes, color=look.color, linewidth=0.7, alpha=0.6)
        axes.plot(*last.T, look.dashes, color=look.color, linewidth=1.9, label=next(names))
        axes.plot(*run.q[:, :2].T, "o", color=look.color, markersize=3.5, linestyle="none")
    (left, low), (right, high) = _limits(runs)
    axes.set(xlim=(left, right), ylim=(low, high))
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MaxNLocator(nbins=8, steps=[1, 2, 5, 10]))
    style.label(axes, x="x [m]", y="y [m]")
    style.legend(axes, width)


def _path_names(runs: list[Laps], worn: list[resolver_style.RunStyle]) -> list[str]:
    desired = [f"desired path of {runs[0].trajectory.frame}"] if _desired(runs[0]) is not None else []
    return [*desired, *(f"platform, {look.name}, last lap thick" for look in worn)]


def _samples(run: Laps) -> int:
    return round(run.period / run.trajectory.dt)


def _path(run: Laps) -> Array:
    """The platform's reference point, (N, 2) m, to the end of the last whole lap."""
    return np.asarray(run.trajectory.q[: len(run.distance) * _samples(run) + 1, :2])


def _desired(run: Laps) -> Array | None:
    """The desired path of a lap, (N, 2) m, if the task has one."""
    desired = run.trajectory.desired
    return None if desired is None else desired[: _samples(run) + 1, :2]


def _limits(runs: list[Laps]) -> tuple[Array, Array]:
    """Lower and upper limits of x and y that hold all paths, m."""
    paths = [*map(_path, runs), _desired(runs[0])]
    points = np.vstack([path for path in paths if path is not None])
    low, high = points.min(axis=0), points.max(axis=0)
    size = max(float((high - low).max()), 0.1)
    # No view gets narrower than half the other side.
    middle, half = 0.5 * (low + high), 0.5 * np.maximum(high - low, 0.5 * size) + 0.05 * size
    return middle - half, middle + half
