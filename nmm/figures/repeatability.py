"""Laps round a closed path: how far the posture drifts in each, and where the platform drives."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from nmm import looks
from nmm.analysis.redundancy.laps import Laps, Repeatability
from nmm.arrays import Array
from nmm.errors import InputError
from nmm.figures import style

#: Drifts below this are drawn here: rounding, and exact zeros, which a logarithmic axis has not.
LOWEST = 1e-16
#: Height of the drifts' panel, and the most of that with the paths, in.
DRIFT, PATHS = 1.9, 4.6
#: Drifts that differ by less than this factor are drawn on a linear scale.
MUCH = 30.0
#: Most points of a lap's path.
POINTS = 1500


def laps(found: Repeatability, *, width: float = style.PAGE) -> Figure:
    """Drift of the posture in each lap, logarithmic; below it the platforms' paths from above.

    Full turns of joints without limits are no drift. Without a platform that moves there is one panel.

    Parameters
    ----------
    found : laps of one resolver or several
    width : of the figure, in

    Raises
    ------
    InputError : no lap was finished
    """
    runs = [one for one in found.laps if len(one.distance)]
    if not runs:
        raise InputError("figure of laps: expected at least one lap, got none")
    worn = looks.looks([one.name for one in runs])
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


def _draw_drift(axes: Axes, runs: list[Laps], worn: list[looks.Look]) -> None:
    every = np.concatenate([np.maximum(one.distance, LOWEST) for one in runs])
    longest = max(len(one.distance) for one in runs)
    for k, (one, look) in enumerate(zip(runs, worn, strict=True)):
        numbers = np.arange(1, len(one.distance) + 1)
        axes.plot(
            numbers, np.maximum(one.distance, LOWEST), look.dashes, color=look.color, linewidth=style.WIDTH,
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


def _draw_paths(axes: Axes, runs: list[Laps], worn: list[looks.Look], width: float) -> None:
    """All laps thin, the last one thick, the laps' ends as dots; a legend `width` in wide."""
    axes.set_aspect("equal", adjustable="box")
    names = iter(_path_names(runs, worn))
    desired = _desired(runs[0])
    if desired is not None:
        axes.plot(desired[:, 0], desired[:, 1], ":", color=looks.BLACK, linewidth=1.1, label=next(names))
    for one, look in zip(runs, worn, strict=True):
        path, samples = _path(one), _samples(one)
        every = max(1, samples // POINTS)
        axes.plot(path[::every, 0], path[::every, 1], look.dashes, color=look.color, linewidth=0.7, alpha=0.6)
        last = path[len(path) - 1 - samples :][::every]
        axes.plot(
            last[:, 0], last[:, 1], look.dashes, color=look.color, linewidth=1.9, label=next(names)
        )  # fmt: skip
        axes.plot(one.q[:, 0], one.q[:, 1], "o", color=look.color, markersize=3.5, linestyle="none")
    low, high = _limits(runs)
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MaxNLocator(nbins=8, steps=[1, 2, 5, 10]))
    style.label(axes, x="x [m]", y="y [m]")
    style.legend(axes, width)


def _path_names(runs: list[Laps], worn: list[looks.Look]) -> list[str]:
    """The legend of the paths."""
    desired = [f"desired path of {runs[0].trajectory.frame}"] if _desired(runs[0]) is not None else []
    return [*desired, *(f"platform, {look.name}, last lap thick" for look in worn)]


def _samples(one: Laps) -> int:
    """How many samples a lap has."""
    return round(one.period / one.trajectory.dt)


def _path(one: Laps) -> Array:
    """The platform's reference point, (N, 2) m, to the end of the last whole lap."""
    return np.asarray(one.trajectory.q[: len(one.distance) * _samples(one) + 1, :2])


def _desired(one: Laps) -> Array | None:
    """The desired path of a lap, (N, 2) m, if the task has one."""
    desired = one.trajectory.desired
    return None if desired is None else desired[: _samples(one) + 1, :2]


def _limits(runs: list[Laps]) -> tuple[Array, Array]:
    """Lower and upper limits of x and y that hold all paths, m."""
    desired = _desired(runs[0])
    points = np.vstack([*(_path(one) for one in runs), *([] if desired is None else [desired])])
    low, high = points.min(axis=0), points.max(axis=0)
    size = max(float((high - low).max()), 0.1)
    # No view gets narrower than half the other side.
    middle, half = 0.5 * (low + high), 0.5 * np.maximum(high - low, 0.5 * size) + 0.05 * size
    return middle - half, middle + half
