"""The figure of an arm's calibration: how far what was seen is off, before and after."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from nmm.base.arrays import Array
from nmm.base.resolver_style import BLUE, VERMILLION
from nmm.plugins.robot.calibration.arm.judged import by_file
from nmm.views.figures import style

if TYPE_CHECKING:
    from nmm.plugins.robot.calibration.arm.calibration import ArmCalibration
    from nmm.plugins.robot.calibration.arm.view import SightingsView

#: So many logs have a panel of their own, so high, in.
MOST, HEIGHT = 4, 1.7
_NAMES = ("before", "after", "left out")


def sightings(result: ArmCalibration, *, width: float = style.PAGE) -> Figure:
    """For each log (four at most) and posture: how far what was seen is from where the arm by its readings
    has it, with the file's numbers and with those learned, each with the mounts that go with them; of
    corners the root of the mean square. Crosses were left out."""
    model, fitted = result.model, result.fit
    views = model.views[:MOST]
    before = by_file(model, fitted)
    across = width - style.LEFT - style.RIGHT
    legend = style.room(style.legend_rows([*_NAMES], across))
    total = legend + len(views) * (style.GAP + HEIGHT + style.BOTTOM)
    made, top = style.figure(width, total), total - legend
    for k, view in enumerate(views):
        top -= style.GAP + HEIGHT
        axes = style.place(made, style.LEFT, top, across, HEIGHT)
        top -= style.BOTTOM
        factor, unit = (1.0, "px") if view.log.kind == "corners" else (1e3, "mm")
        several = [factor * _off(view, model.residuals(view, one.values)) for one in (before, fitted)]
        _panel(axes, view, several, unit)
        axes.set_title(view.log.name, fontsize=style.TEXT, loc="left", pad=4.0, parse_math=False)
        if not k:
            style.legend(axes, across, lift=style.GAP - 0.06)
    return style.aligned(made)


def _panel(axes: Axes, view: SightingsView, several: list[Array], unit: str) -> None:
    taken = view.samples_taken
    at = np.arange(1, len(taken) + 1)
    for off, color, name in zip(several, (VERMILLION, BLUE), _NAMES, strict=False):
        axes.plot(at[taken], off[taken], "o", color=color, markersize=3.0, label=name)
    axes.plot(at[~taken], several[1][~taken], "x", color=VERMILLION, markersize=5.0, label=_NAMES[2])
    sizes = np.concatenate([off[taken & (off > 0.0)] for off in several])
    if len(sizes):
        axes.set_yscale("log")
        axes.set_ylim(0.5 * float(sizes.min()), 2.0 * float(sizes.max()))
    axes.yaxis.set_major_formatter(style.plain())
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    style.label(axes, x="posture", y=f"off [{unit}]")


def _off(view: SightingsView, left: Array) -> Array:
    """Of each posture (N,) how far: of a place, m; of corners, px."""
    if left.ndim == 3:
        squares = np.where(view.log.visible, np.sum(left * left, axis=2), np.nan)
        root: Array = np.sqrt(np.nanmean(squares, axis=1))
        return root
    size: Array = np.linalg.norm(left[:, :3], axis=1)
    return size
