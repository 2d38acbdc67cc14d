"""Figures of a calibration: ways by the wheels before and after, what is left, how numbers go together."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, MaxNLocator, NullLocator

from nmm.base.arrays import Array, Integers
from nmm.base.resolver_style import BLACK, BLUE, GREEN, PINK, VERMILLION
from nmm.base.text_format import counted
from nmm.plugins.robot.calibration.innovations import BEGINS, LEFT_OUT, TAKEN
from nmm.plugins.robot.calibration.ways import bounds_of, ways_beside
from nmm.views.figures import style

if TYPE_CHECKING:
    from nmm.plugins.robot.calibration.arm.calibration import ArmCalibration
    from nmm.plugins.robot.calibration.calibration import Calibration
    from nmm.plugins.robot.calibration.drives import RobotDrive

#: So many drives have a panel of their own.
MOST = 4
#: Longest name of a number or of a log, characters.
LONGEST = 34
#: The residuals' axis ends here, in deviations; what lies beyond stands at its edge.
EDGE = 6.5
#: Heights of panels of residuals and the most of one with paths, and a cell of the matrix at most, in.
RESIDUALS, PATHS, CELL = 1.05, 4.4, 0.52
_ROWS = ("x", "y", "heading")
_COLORS = (BLUE, GREEN, PINK)
#: What a look is called, and how it is drawn, by what was done with it.
_LOOKS = {TAKEN: "a look", LEFT_OUT: "left out", BEGINS: "the reference jumped"}
_LOOK: dict[int, dict[str, Any]] = {
    TAKEN: {"color": style.GREY, "marker": "o", "markersize": 2.5, "linestyle": "none"},
    LEFT_OUT: {"color": VERMILLION, "marker": "x", "markersize": 5.0, "linestyle": "none"},
    BEGINS: {"color": BLACK, "linewidth": 1.0, "linestyle": ":"},
}


def path(result: Calibration, *, width: float = style.PAGE) -> Figure:
    """From above, for each drive (four at most): what the reference saw, and the way of its place on the
    robot by the wheels alone, with the numbers before and after, from where the drive was seen to begin."""
    drives, more = _shown(result)
    names = ["the reference", "wheels, before", "wheels, after", "begin"]
    pieces = [ways_beside(result, k) for k in range(len(drives))]
    bounds = [bounds_of([way for piece in several for way in piece]) for several in pieces]
    across = width - style.LEFT - style.RIGHT
    heights = [min(PATHS, across * (high[1] - low[1]) / (high[0] - low[0])) for low, high in bounds]
    legend = style.room(style.legend_rows(names, across))
    between = style.BOTTOM + style.GAP
    total = sum(heights) + legend + style.GAP + between * (len(drives) - 1) + style.BOTTOM
    made = style.figure(width, total)
    top = total - legend
    for k, (drive, several, height) in enumerate(zip(drives, pieces, heights, strict=True)):
        top -= style.GAP + height
        axes = style.place(made, style.LEFT, top, across, height)
        top -= style.BOTTOM
        axes.set_aspect("equal", adjustable="box", anchor="W")
        for i, (seen, before, after) in enumerate(several):
            marks = "D" if drive.ends else "-"
            axes.plot(
                *seen.T, marks, color=BLACK, linewidth=2.6, alpha=0.35, label=None if i else names[0],
                markersize=6.0,
            )  # fmt: skip
            axes.plot(*before.T, "--", color=VERMILLION, linewidth=1.1, label=None if i else names[1])
            axes.plot(*after.T, "-", color=BLUE, linewidth=1.1, label=None if i else names[2])
            axes.plot(
                *seen[0], "o", color=GREEN, markersize=5.0, markeredgewidth=0.0, zorder=6,
                label=None if i else names[3], linestyle="none",
            )  # fmt: skip
        low, high = bounds[k]
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_locator(MaxNLocator(nbins=8, steps=[1, 2, 5, 10]))
            axis.set_major_formatter(style.plain())
        style.label(axes, x="x [m]", y="y [m]")
        _title(axes, drive.name, more if k == len(drives) - 1 else "")
        if not k:
            style.legend(axes, across, lift=style.GAP - 0.06)
    return style.aligned(made)


def residuals(result: Calibration, *, width: float = style.PAGE) -> Figure:
    """Over time, for each drive (four at most): what the filter did not predict of each look of the
    reference, along the robot's axes, over its standard deviation; what was left out, and jumps."""
    shown = _looks(result)
    panels = [(one, row) for one in shown for row in range(one.w.shape[1])]
    across = width - style.LEFT - style.RIGHT
    legend = style.room(style.legend_rows([*_LOOKS.values()], across))
    above = [legend + style.GAP] + [0.12 if row else style.GAP for _, row in panels[1:]]
    below = [style.BOTTOM if row + 1 == one.w.shape[1] else 0.0 for one, row in panels]
    total = sum(above) + sum(below) + RESIDUALS * len(panels)
    made, top = style.figure(width, total), total
    for i, (one, row) in enumerate(panels):
        top -= above[i] + RESIDUALS
        axes = style.place(made, style.LEFT, top, across, RESIDUALS)
        top -= below[i]
        _residual_panel(axes, one, row)
        style.label(axes, y=f"{_ROWS[row]} [σ]")
        axes.tick_params(labelbottom=bool(below[i]))
        if below[i]:
            style.label(axes, x=one.axis)
        if not row:
            _title(axes, one.name, one.more)
        if not i:
            told = {state for each in shown for state in np.unique(each.taken).tolist()}
            for state in [state for state in _LOOKS if state in told]:
                axes.plot([], [], label=_LOOKS[state], **_LOOK[state])
            style.legend(axes, across, lift=style.GAP - 0.06)
    return style.aligned(made)


def correlation(result: Calibration | ArmCalibration, *, width: float = style.PAGE) -> Figure:
    """Correlation of the numbers that were learned: near 1 or -1 where the drives tell two hardly apart."""
    names = result.learned
    n = max(len(names), 1)
    labels = [f"{_short(name)}  {i + 1}" for i, name in enumerate(names)]
    left = 0.25 + 0.062 * max((len(text) for text in labels), default=0)
    cell = min(CELL, (width - left - style.RIGHT) / n)
    made = style.figure(width, n * cell + style.GAP + 0.3)
    axes = style.place(made, left, 0.3, n * cell, n * cell)
    if not names:
        style.note(axes, "nothing was learned")
        axes.xaxis.set_major_locator(NullLocator())
        return made
    deviations = np.sqrt(np.diag(result.covariance))
    matrix = result.covariance / np.outer(deviations, deviations)
    colors = LinearSegmentedColormap.from_list("correlation", [VERMILLION, "#FFFFFF", BLUE])
    axes.imshow(matrix, cmap=colors, vmin=-1.0, vmax=1.0, extent=(-0.5, n - 0.5, n - 0.5, -0.5))
    size = min(style.SMALL, 72.0 * cell / 3.1)
    for i in range(n):
        for j in range(n):
            color = "white" if abs(matrix[i, j]) > 0.6 else BLACK
            text = _share(matrix[i, j])
            axes.text(j, i, text, ha="center", va="center", fontsize=size, color=color)
    axes.grid(False)
    axes.spines[:].set_visible(True)
    for axis, texts in ((axes.xaxis, [str(i + 1) for i in range(n)]), (axes.yaxis, labels)):
        axis.set_major_locator(FixedLocator([*range(n)]))
        axis.set_ticklabels(texts, fontsize=style.SMALL, parse_math=False)
    _title(axes, "correlation of what was learned")
    return made


#: Figures by the names of their files.
FIGURES: dict[str, Callable[..., Figure]] = {
    "path": path,
    "residuals": residuals,
    "correlation": correlation,
}


def figures_of(result: Calibration | ArmCalibration) -> dict[str, Callable[..., Figure]]:
    """The figures of a calibration, by the names of their files."""
    from nmm.plugins.robot.calibration.arm.calibration import ArmCalibration

    if not isinstance(result, ArmCalibration):
        return FIGURES
    from nmm.plugins.robot.calibration.arm.figures import sightings

    return {"residuals": sightings, "correlation": correlation}


def _shown(result: Calibration) -> tuple[Sequence[RobotDrive], str]:
    """The drives that have panels, and how many more there are, in words."""
    drives = result.model.drives
    return drives[:MOST], f"and {counted(len(drives) - MOST, 'drive')} more" if len(drives) > MOST else ""


def _short(name: str) -> str:
    half = (LONGEST - 1) // 2
    return name if len(name) <= LONGEST else f"{name[:half]}…{name[-half:]}"


def _share(value: float) -> str:
    """ "1", "−.05", "0": of a correlation."""
    if abs(value) < 0.005:
        return "0"
    text = f"{value:.2f}".replace("-", "−").replace("0.", ".", 1)
    return text.replace("1.00", "1")


def _title(axes: Axes, text: str, more: str = "") -> None:
    whole = f"{_short(text)}, {more}" if more else _short(text)
    axes.set_title(whole, fontsize=style.TEXT, color=BLACK, loc="left", pad=4.0, parse_math=False)


class _Looks(NamedTuple):
    """A panel's looks: name, what more there is, what the x axis is, where they are on it (M,), what was done
    with them (M,), and residuals (M, r)."""

    name: str
    more: str
    axis: str
    at: Array
    taken: Integers
    w: Array


def _looks(result: Calibration) -> list[_Looks]:
    """Those of each drive; of drives of which only the ends are known one for each drive, together."""
    drives, filtered = result.model.drives, result.fit.filtered
    if all(drive.ends for drive in drives):
        rows = min(drive.rows for drive in drives)
        w = np.stack([one.w[-1, :rows] for one in filtered])
        taken = np.array([drive.taken[-1] for drive in drives])
        return [_Looks("where drives end", "", "drive", np.arange(1.0, len(w) + 1.0), taken, w)]
    shown, more = _shown(result)
    last, axis = len(shown) - 1, "time t by the reference's clock [s]"
    return [
        _Looks(drive.name, more if k == last else "", axis, drive.at[1:], drive.taken[1:], filtered[k].w[1:])
        for k, drive in enumerate(shown)
    ]


def _residual_panel(axes: Axes, one: _Looks, row: int) -> None:
    axes.axhspan(-2.0, 2.0, color=style.LIGHT, alpha=0.6, linewidth=0.0, zorder=0)
    held = np.clip(one.w[:, row], 0.4 - EDGE, EDGE - 0.4)
    for state in (TAKEN, LEFT_OUT):
        some = one.taken == state
        axes.plot(one.at[some], held[some], **_LOOK[state] | _own(state, row, len(held)))
    for m in np.flatnonzero(one.taken == BEGINS):
        axes.axvline(one.at[m], **_LOOK[BEGINS])
    axes.set_ylim(-EDGE, EDGE)
    axes.yaxis.set_major_locator(FixedLocator([-5.0, -2.0, 0.0, 2.0, 5.0]))
    axes.yaxis.set_major_formatter(style.plain())
    if len(one.at) < 20:
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        return
    style.time_axis(axes, one.at, named=False)


def _own(state: int, row: int, count: int) -> dict[str, Any]:
    if state != TAKEN:
        return {}
    return {"color": _COLORS[row], "markersize": 4.0 if count < 20 else 2.0 if count < 1000 else 1.0}
