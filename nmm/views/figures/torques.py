"""Motor torques as shares of their limits, and how near a robot is to tipping."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from nmm.base import resolver_style
from nmm.model.dynamics.torques import Torques
from nmm.views.figures import style


def torques(found: Torques, *, width: float = style.PAGE) -> Figure:
    """Torques of wheels and joints over time, as shares of the file's effort limits where it has them, else
    in N m and N; below them the margin against tipping where it is known. What jumps is left open.

    Examples
    --------
    >>> run = nmm.Scenario.load("ur5_differential_line").run()
    >>> figure = nmm.figures.torques(run.torques())
    >>> [axes.get_ylabel() for axes in figure.axes]
    ['torque, share of limit', 'tip margin [m]']
    """
    limited = np.isfinite(found.efforts)
    shares = found.torques / np.where(limited, found.efforts, 1.0)
    parts: Mapping[str, list[int]] = style.groups(["limited" if limit else "free" for limit in limited])
    free = (unit for unit, limit in zip(found.dynamics.actuators.units, limited, strict=True) if not limit)
    heads = {"limited": "torque, share of limit", "free": f"torque {style.units(free)}"}
    shown = {name: parts[name] for name in heads if name in parts}
    tips = bool(np.isfinite(found.margins).all())
    legends = [[resolver_style.pretty(found.names[j]) for j in columns] for columns in shown.values()]
    made, panels = style.stack([1.8] * len(shown) + [1.2] * tips, [*legends, *([[]] if tips else [])], width)
    broken = found.jumps[:, np.newaxis]
    for axes, (name, columns), names in zip(panels, shown.items(), legends, strict=False):
        last = axes is panels[-1]
        style.columns(axes, found.t, np.where(broken, np.nan, shares[:, columns]), names, zero=True)
        if name == "limited":
            most = float(np.abs(shares[:, columns]).max())
            for end in (-1.0, 1.0) if most > 0.5 else ():
                axes.axhline(end, color=resolver_style.BLACK, linewidth=1.0, zorder=1)
        style.finish(axes, found.t, heads[name], named=last, ticks=False)
    if tips:
        style.curve(panels[-1], found.t, found.margins, None, resolver_style.VERMILLION)
        panels[-1].set_ylim(min(0.0, 1.1 * float(found.margins.min())), None)
        style.finish(panels[-1], found.t, "tip margin [m]", ticks=False)
    return style.aligned(made)
