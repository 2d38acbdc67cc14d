"""Maps of measures over two coordinates or a plane, with the singular sets drawn over them."""

import re
import textwrap
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.patheffects import withStroke
from matplotlib.ticker import FuncFormatter, MaxNLocator, MultipleLocator

from nmm.analysis.maps.measures import MEASURES
from nmm.analysis.maps.result import EVERYWHERE, Map
from nmm.analysis.maps.singular_set import SingularSet
from nmm.base import resolver_style
from nmm.base.arrays import Array
from nmm.base.errors import expect_known
from nmm.base.text_format import fraction_of_pi
from nmm.views.figures import style
from nmm.views.figures.silhouette import Silhouette, hull
from nmm.views.figures.style import save
from nmm.views.figures.views import View

#: Even steps of the value are even steps to the eye, also to colour-blind ones.
COLORS = "viridis"
#: Longest side of a map, in, and what stands beside it.
SIDE, BAR, BAR_GAP, BAR_ROOM, BETWEEN = 3.5, 0.14, 0.12, 0.75, 0.55
LINE = 0.155
#: Most coordinates that the title names one by one.
MOST_NAMED = 6
WORST = "worst posture"
#: More points than this fill a region and are drawn as small dots, with the map visible between them.
MANY = 60


def map_figure(
    drawn: Map, measure: str | None = None, path: str | Path | None = None, *, width: float | None = None
) -> Figure:
    """One map over two coordinates, or a workspace's best and worst; `measure`: the first by default; `path`:
    a file to write, too; `width`, in: by default for a longest side of 3.5. InputError for an unknown
    measure."""
    measure = next(iter(drawn.values)) if measure is None else measure
    expect_known("measure", measure, drawn.values, "map")
    layers = {"": drawn.values[measure]}
    if drawn.kind == "workspace":
        layers = {"best posture": drawn.values[measure], WORST: drawn.worst[measure]}
    layers = {name: _even(drawn, measure, name, values) for name, values in layers.items()}
    across, height = _size(drawn)
    between, beside = BETWEEN + 0.3, style.LEFT + BAR_GAP + BAR + BAR_ROOM
    if width is not None:
        asked = (width - beside - between * (len(layers) - 1)) / len(layers)
        across, height = asked, height * asked / across
    step = across + between
    total = beside + step * (len(layers) - 1) + across
    lines = _title(drawn, measure, total)
    legend = 0 if drawn.kind == "workspace" and drawn.singular.empty and drawn.arm_singular is None else 1
    above = 0.12 + LINE * len(lines) + (style.GAP if legend else 0.1) + (0.2 if len(layers) > 1 else 0.0)
    made = style.figure(total, style.BOTTOM + height + above)
    bounds = _bounds(layers.values())
    for k, (name, values) in enumerate(layers.items()):
        axes = style.place(made, style.LEFT + k * step, style.BOTTOM, across, height)
        image = _draw_values(axes, drawn, values, bounds)
        if name:
            axes.set_title(name, fontsize=style.SMALL, color=resolver_style.BLACK, pad=3, parse_math=False)
        # The arm's singular set below, dashed; what is left of it above, solid.
        if drawn.arm_singular is not None:
            _draw_set(axes, drawn, drawn.arm_singular, "arm alone", "white")
        own = "robot" if drawn.arm_singular is not None else drawn.about.part
        _draw_set(axes, drawn, drawn.singular, own, resolver_style.VERMILLION)
        if drawn.kind == "workspace":
            _draw_robot(axes, drawn, _posture(drawn, measure, worst=name == WORST))
        _dress(axes, drawn, named=k == 0)
    place = (total - BAR_ROOM - BAR, style.BOTTOM, BAR, height)
    size = made.get_size_inches()
    bar = made.colorbar(image, cax=made.add_axes((np.array(place) / np.tile(size, 2)).tolist()))
    unit = drawn.about.units[measure]
    symbol = subscripted(MEASURES[measure].symbol)
    style.label(bar.ax, y=symbol + (f" [{unit}]" if unit else ""), typeset=True)
    style.ticks(bar.ax)
    style.value_axis(bar.ax, bins=6)
    bar.ax.spines[:].set_visible(False)
    _write_title(made, lines)
    if legend:
        style.legend(made.axes[0], np.inf, lift=0.2 if len(layers) > 1 else 0.0)
    if path is not None:
        save(made, path)
    return made


def _even(drawn: Map, measure: str, layer: str, values: Array) -> Array:
    """The values; a constant map's single value, as a colour scale would enlarge its rounding."""
    smallest = drawn.extremes(measure, worst=layer == WORST)["smallest"]
    return np.where(np.isnan(values), np.nan, smallest.value) if smallest.on == EVERYWHERE else values


def _size(drawn: Map) -> tuple[float, float]:
    """The map's size, in: square where the axes have different units or are angles, else to scale."""
    if set(drawn.units) != {"m"}:
        return SIDE, SIDE
    x, y = (float(axis[-1] - axis[0]) for axis in drawn.axes)
    return max(SIDE * x / max(x, y), 1.2), max(SIDE * y / max(x, y), 1.2)


def _bounds(layers: Iterable[Array]) -> tuple[float, float]:
    values = np.concatenate([layer[np.isfinite(layer)] for layer in layers])
    if not values.size:
        return 0.0, 1.0
    low, high = float(values.min()), float(values.max())
    if low == high:  # In the middle of the scale, which starts at zero.
        return (min(0.0, 2.0 * low), max(0.0, 2.0 * high)) if high else (0.0, 1.0)
    # From zero, where it is near: it means singular.
    low = 0.0 if 0.0 <= low < 0.5 * high else low
    return low, high


def _draw_values(axes: Axes, drawn: Map, values: Array, bounds: tuple[float, float]) -> AxesImage:
    half = [0.5 * float(axis[1] - axis[0]) for axis in drawn.axes]
    (left, right), (bottom, top) = (
        (float(axis[0]) - h, float(axis[-1]) + h) for axis, h in zip(drawn.axes, half, strict=True)
    )
    image = axes.imshow(
        np.ma.masked_invalid(values), origin="lower", extent=(left, right, bottom, top), aspect="auto",
        interpolation="nearest", cmap=COLORS, vmin=bounds[0], vmax=bounds[1],
    )  # fmt: skip
    x, y = (0.0, 0.0) if drawn.kind == "workspace" else half
    axes.set(xlim=(left + x, right - x), ylim=(bottom + y, top - y))
    return image


def _dress(axes: Axes, drawn: Map, *, named: bool) -> None:
    axes.grid(False)
    both = (axes.xaxis, axes.yaxis)
    for axis, name, unit, values in zip(both, drawn.names, drawn.units, drawn.axes, strict=True):
        called = f"{drawn.frame} {name}" if drawn.kind == "workspace" else resolver_style.pretty(name)
        if axis is axes.xaxis or named:
            text = f"{called} [{unit}]"
            style.label(axes, x=text) if axis is axes.xaxis else style.label(axes, y=text)
        span = float(values[-1] - values[0])
        if unit == "rad" and span >= np.pi / 2:
            # The coarsest of π/2, π/4, ... with at least three ticks.
            part = next(k for k in (1.0, 0.5, 0.25, 0.125) if span >= 2.0 * k * np.pi / 2 or k == 0.125)
            if span > 4.0 * np.pi:
                part = float(np.ceil(span / (4.0 * np.pi))) * 2.0
            axis.set_major_locator(MultipleLocator(part * np.pi / 2))
            pi = FuncFormatter(lambda x, _: fraction_of_pi(x, (1, 2, 4, 8, 16)).replace("-", "−"))  # 3π/4
            axis.set_major_formatter(pi)
        else:
            axis.set_major_locator(MaxNLocator(nbins=6, steps=[1, 2, 2.5, 5, 10]))
            axis.set_major_formatter(style.plain())


def subscripted(symbol: str) -> str:
    """A symbol as matplotlib sets it, w_b with b below; Unicode has no b to put there."""
    return re.sub(r"(\w)_(\w+)", r"$\\mathregular{\1_{\2}}$", symbol)


def _literal(text: str) -> str:
    """Text whose dollar signs begin no formula."""
    return text.replace("$", r"\$")


def _title(drawn: Map, measure: str, width: float) -> list[tuple[str, bool]]:
    """Lines of the title, and whether each is the headline."""
    about = drawn.about
    whose = "" if about.part == "robot" or MEASURES[measure].parts else f", {about.part} alone"
    notes = [f"{subscripted(MEASURES[measure].about)}{whose}"]
    if measure == "weighted":
        notes.append(f"α = {about.alpha:g}")
    if about.sizes:
        notes.append(about.sizes)
    if about.weights:
        weights = ", ".join(f"{name} {value:g}" for name, value in about.weights.items())
        notes.append(_literal(f"weights {weights}"))
    across = int((width - 0.4) / 0.062)
    parts = "; ".join(notes), _literal(_held(drawn))
    texts = [line for text in parts for line in textwrap.wrap(text, across)]
    return [(f"{about.robot}: {', '.join(about.task)}", True), *((line, False) for line in texts)]


def _held(drawn: Map) -> str:
    held = drawn.held
    units = dict(zip(drawn.about.q_names, drawn.about.q_units, strict=True))
    moved = {name: value for name, value in held.items() if abs(value) > 1e-12}
    named = moved if len(held) > MOST_NAMED else held
    texts = [
        f"{resolver_style.pretty(name)} = {style.number(round(value, 4))} {units[name]}"
        for name, value in named.items()
    ]
    if len(named) < len(held):
        texts.append("all others 0" if texts else "all other coordinates 0")
    if drawn.height is not None:
        (axis,) = {"x", "y", "z"} - set(drawn.names)
        texts.append(f"{drawn.frame} {axis} from {drawn.height[0]:g} to {drawn.height[1]:g} m")
    parts = [f"held: {', '.join(texts)}"] * bool(texts)
    parts += ["outline: the robot in the best and in the worst posture of all"] * (drawn.kind == "workspace")
    return "; ".join(parts)


def _posture(drawn: Map, measure: str, *, worst: bool) -> Array:
    """The best of a workspace's best postures, or the worst of the worst, q (n,)."""
    values, q = (
        arrays[measure]
        for arrays in ((drawn.worst, drawn.worst_q) if worst else (drawn.values, drawn.best_q))
    )
    if not np.isfinite(values).any():
        return drawn.q
    largest = (MEASURES[measure].better > 0.0) != worst
    return np.array(q.reshape(values.size, -1)[np.nanargmax(values) if largest else np.nanargmin(values)])


def _draw_robot(axes: Axes, drawn: Map, q: Array) -> None:
    """The outlines of platform, trailers and wheels and the arm's links in the map's plane, on any colour."""
    directions = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
    across, up = drawn.names
    view = View(directions[across], directions[up], drawn.names)
    pose = Silhouette(drawn.robot, drawn.frame).at(q)
    main = hull(view.of(pose.main))
    bodies, wheels = pose.outlines(view)
    low, high = main.min(axis=0) - 1e-9, main.max(axis=0) + 1e-9
    others = [edge for edge in bodies if np.any((edge < low) | (edge > high))]
    edges = [np.vstack([edge, edge[:1]]) for edge in (main, *others, *wheels)]
    halo = [withStroke(linewidth=2.2, foreground=resolver_style.BLACK)]
    for line, width in (*((edge, 0.8) for edge in edges), *((view.of(link), 1.4) for link in pose.links)):
        axes.plot(*line.T, color="white", linewidth=width, path_effects=halo, zorder=3)
    axes.plot(
        *view.of(pose.joints).T,
        "o",
        color="white",
        markeredgecolor=resolver_style.BLACK,
        markersize=3.5,
        zorder=3,
    )


def _write_title(made: Figure, lines: list[tuple[str, bool]]) -> None:
    width, height = made.get_size_inches().tolist()
    head: dict[str, Any] = {"fontsize": style.TEXT, "fontweight": "bold", "color": resolver_style.BLACK}
    plain: dict[str, Any] = {"fontsize": style.SMALL, "fontweight": "normal", "color": style.GREY}
    for k, (text, headline) in enumerate(lines):
        y = 1.0 - (0.1 + LINE * k) / height
        made.text(0.2 / width, y, text, va="top", **(head if headline else plain), parse_math=not headline)


def _draw_set(axes: Axes, drawn: Map, singular: SingularSet, name: str, color: str) -> None:
    """Lines and points with an edge that shows them on any colour; one legend entry, which says if none."""
    white = color == "white"
    edge = resolver_style.BLACK if white else "white"
    width = 1.1 if white else 1.8
    halo = [withStroke(linewidth=width + 1.2, foreground=edge)]
    label = f"{name} singular" + (f": {singular.text()}" if singular.empty or singular.everywhere else "")
    for line in singular.lines:
        # Unsnapped: line and halo would go to different pixels.
        axes.plot(
            *line.T, "--" if white else "-", color=color, linewidth=width, label=label, path_effects=halo,
            clip_on=False, snap=False,
        )  # fmt: skip
        label = "_"
    if len(singular.points):
        many = len(singular.points) > MANY
        size = 2.3 if many else 2.5 if white else 6.5
        axes.plot(
            *singular.points.T, "o" if white or many else "X", linestyle="none", color=color, markersize=size,
            markeredgecolor=resolver_style.BLACK if white or many else "white",
            markeredgewidth=0.5 if many else 0.7, label=label, clip_on=False,
        )  # fmt: skip
    elif not singular.lines:
        axes.plot([], [], " ", label=label)
