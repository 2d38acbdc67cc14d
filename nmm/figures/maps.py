"""Maps of measures over two coordinates or a plane, with the singular sets drawn over them."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.ticker import FuncFormatter, MaxNLocator, MultipleLocator

from nmm import looks
from nmm.analysis.maps.extremes import EVERYWHERE
from nmm.analysis.maps.measures import MEASURES
from nmm.analysis.maps.result import Map
from nmm.arrays import Array
from nmm.errors import expect_known
from nmm.figures import style
from nmm.figures.files import save
from nmm.figures.map_sets import draw_sets
from nmm.words import fraction_of_pi

#: Even steps of the value are even steps to the eye, also to colour-blind ones.
COLORS = "viridis"
#: Longest side of a map, in, and what stands beside it.
SIDE, BAR, BAR_GAP, BAR_ROOM, BETWEEN = 3.5, 0.14, 0.12, 0.75, 0.55
LINE = 0.155
#: Most coordinates that the title names one by one.
MOST_NAMED = 6
WORST = "worst posture"


def map_figure(
    drawn: Map, measure: str | None = None, path: str | Path | None = None, *, width: float | None = None
) -> Figure:
    """The figure of a measure: over two coordinates one map; of a workspace the best and the worst beside it.

    Parameters
    ----------
    measure : the map's first one when not given
    path : of a file to write, too (`nmm.figures.save`)
    width : of the figure, in; when not given, so that a map's longest side is 3.5 in

    Raises
    ------
    InputError : the map has no such measure
    """
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
            axes.set_title(name, fontsize=style.SMALL, color=looks.BLACK, pad=3)
        draw_sets(axes, drawn)
        _dress(axes, drawn, named=k == 0)
    place = (total - BAR_ROOM - BAR, style.BOTTOM, BAR, height)
    size = made.get_size_inches()
    bar = made.colorbar(image, cax=made.add_axes((np.array(place) / np.tile(size, 2)).tolist()))
    _dress_bar(bar.ax, drawn, measure)
    _write_title(made, lines)
    if legend:
        style.legend(made.axes[0], np.inf, lift=0.2 if len(layers) > 1 else 0.0)
    if path is not None:
        save(made, path)
    return made


def _even(drawn: Map, measure: str, layer: str, values: Array) -> Array:
    """The values; those of a constant map without the rounding, which a colour scale would blow up."""
    smallest = drawn.extremes(measure, worst=layer == WORST)["smallest"]
    return np.where(np.isnan(values), np.nan, smallest.value) if smallest.on == EVERYWHERE else values


def _size(drawn: Map) -> tuple[float, float]:
    """Of the map, in: square where the axes have different units or are angles; else as it is."""
    spans = [float(axis[-1] - axis[0]) for axis in drawn.axes]
    if set(drawn.units) != {"m"}:
        return SIDE, SIDE
    largest = max(spans)
    return (max(SIDE * spans[0] / largest, 1.2), max(SIDE * spans[1] / largest, 1.2))


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
    """The values as an image, each cell around its sample."""
    half = [0.5 * float(axis[1] - axis[0]) for axis in drawn.axes]
    (left, right), (bottom, top) = (
        (float(axis[0]) - h, float(axis[-1]) + h) for axis, h in zip(drawn.axes, half, strict=True)
    )
    image = axes.imshow(
        np.ma.masked_invalid(values),
        origin="lower",
        extent=(left, right, bottom, top),
        aspect="auto",
        interpolation="nearest",
        cmap=COLORS,
        vmin=bounds[0],
        vmax=bounds[1],
    )
    inset = 0.0 if drawn.kind == "workspace" else 1.0
    axes.set_xlim(left + inset * half[0], right - inset * half[0])
    axes.set_ylim(bottom + inset * half[1], top - inset * half[1])
    return image


def _dress(axes: Axes, drawn: Map, *, named: bool) -> None:
    axes.grid(False)
    for axis, name, unit, values in zip(
        (axes.xaxis, axes.yaxis), drawn.names, drawn.units, drawn.axes, strict=True
    ):
        text = f"{drawn.frame} {name} [m]" if drawn.kind == "workspace" else f"{looks.pretty(name)} [{unit}]"
        if axis is axes.xaxis or named:
            axis.set_label_text(text, fontsize=style.TEXT, color=looks.BLACK)
        span = float(values[-1] - values[0])
        if unit == "rad" and span >= np.pi / 2:
            # The coarsest of π/2, π/4, ... with at least three ticks.
            part = next(k for k in (1.0, 0.5, 0.25, 0.125) if span >= 2.0 * k * np.pi / 2 or k == 0.125)
            if span > 4.0 * np.pi:
                part = float(np.ceil(span / (4.0 * np.pi))) * 2.0
            axis.set_major_locator(MultipleLocator(part * np.pi / 2))
            axis.set_major_formatter(FuncFormatter(lambda value, _: _in_pi(value)))
        else:
            axis.set_major_locator(MaxNLocator(nbins=6, steps=[1, 2, 2.5, 5, 10]))
            axis.set_major_formatter(style.plain())


def _in_pi(value: float) -> str:
    """An angle of a tick as a multiple of π: −π/2, 0, 3π/4."""
    return fraction_of_pi(value, (1, 2, 4, 8, 16)).replace("-", "−")


def _dress_bar(axes: Axes, drawn: Map, measure: str) -> None:
    unit = drawn.about.units[measure]
    text = subscripted(MEASURES[measure].symbol) + (f" [{unit}]" if unit else "")
    axes.set_ylabel(text, fontsize=style.TEXT, color=looks.BLACK, labelpad=4)
    axes.tick_params(labelsize=style.SMALL, color=style.GREY, labelcolor=looks.BLACK, width=0.7, length=3)
    axes.yaxis.set_major_locator(MaxNLocator(nbins=6, steps=[1, 2, 2.5, 5, 10]))
    axes.yaxis.set_major_formatter(style.plain())
    for spine in axes.spines.values():
        spine.set_visible(False)


def subscripted(symbol: str) -> str:
    """A symbol as matplotlib sets it, w_b with b below; Unicode has no b to put there."""
    return re.sub(r"(\w)_(\w+)", r"$\\mathregular{\1_{\2}}$", symbol)


def _title(drawn: Map, measure: str, width: float) -> list[tuple[str, bool]]:
    """Lines of text, each with whether it is the headline."""
    about = drawn.about
    whose = "" if about.part == "robot" or not MEASURES[measure].on_part else f", {about.part} alone"
    notes = [f"{subscripted(MEASURES[measure].about)}{whose}"]
    if measure == "weighted":
        notes.append(f"α = {about.alpha:g}")
    if about.sizes:
        notes.append(about.sizes)
    if about.weights:
        notes.append("weights " + ", ".join(f"{name} {value:g}" for name, value in about.weights.items()))
    lines = [(f"{about.robot}: {', '.join(about.task)}", True)]
    texts = ["; ".join(notes), _held(drawn)]
    for text in texts:
        lines += [(line, False) for line in textwrap.wrap(text, int((width - 0.4) / 0.062))]
    return lines


def _held(drawn: Map) -> str:
    """What the map holds still."""
    held = drawn.held
    units = dict(zip(drawn.about.q_names, drawn.about.q_units, strict=True))
    moved = {name: value for name, value in held.items() if abs(value) > 1e-12}
    named = moved if len(held) > MOST_NAMED else held
    texts = [
        f"{looks.pretty(name)} = {style.number(round(value, 4))} {units[name]}"
        for name, value in named.items()
    ]
    if len(named) < len(held):
        texts.append("all others 0" if texts else "all other coordinates 0")
    if drawn.height is not None:
        (axis,) = {"x", "y", "z"} - set(drawn.names)
        texts.append(f"{drawn.frame} {axis} from {drawn.height[0]:g} to {drawn.height[1]:g} m")
    return f"held: {', '.join(texts)}" if texts else ""


def _write_title(made: Figure, lines: list[tuple[str, bool]]) -> None:
    height = float(made.get_size_inches()[1])
    left = 0.2 / float(made.get_size_inches()[0])
    for k, (text, headline) in enumerate(lines):
        made.text(
            left,
            1.0 - (0.1 + LINE * k) / height,
            text,
            fontsize=style.TEXT if headline else style.SMALL,
            fontweight="bold" if headline else "normal",
            color=looks.BLACK if headline else style.GREY,
            va="top",
        )
