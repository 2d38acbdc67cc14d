"""The house style: colours, sizes, axes. Set on every artist, so that no global state is touched.

Matplotlib's rcParams are one per process; a library that changes them changes its user's figures,
and two threads that change them change each other's. Nothing here reads or writes them.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, MaxNLocator, NullFormatter, NullLocator

from nmm.arrays import Array
from nmm.looks import BLACK

GREY, LIGHT = "#6B7280", "#E5E7EB"
DPI = 180
TEXT, SMALL = 9.0, 8.0
WIDTH, WIDER = 1.4, 0.7
#: Figure width, and the strip that axes need for their labels at the left and below, in.
PAGE, LEFT, RIGHT, BOTTOM = 5.2, 0.8, 0.2, 0.46
#: Room beside the ticks' numbers, of a character of them at most, and of them where there are many, in.
TICK, CHARACTER, NUMBERS = 0.16, 0.64 * SMALL / 72.0, 0.46
#: Height above a panel for a legend of one row, and for each row more, in.
GAP, ROW = 0.34, 0.16

_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def figure(width: float, height: float) -> Figure:
    """An empty white figure of this size, in, with a canvas that needs no display."""
    made = Figure(figsize=(width, height), dpi=DPI, facecolor="white")
    FigureCanvasAgg(made)
    return made


def place(
    made: Figure, left: float, bottom: float, width: float, height: float, share: Axes | None = None
) -> Axes:
    """Axes at a place given in inches, in the house style; `share` shares its x axis."""
    total = made.get_size_inches()
    rectangle = (left / total[0], bottom / total[1], width / total[0], height / total[1])
    axes = made.add_axes(rectangle, sharex=share)
    dress(axes)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    return axes


def dress(axes: Axes, size: float = SMALL) -> None:
    """Grid, ticks and frame of the house style; `size` of the ticks' numbers, pt."""
    axes.set_axisbelow(True)
    axes.grid(True, color=LIGHT, linewidth=0.7)
    axes.tick_params(labelsize=size, color=GREY, labelcolor=BLACK, width=0.7, length=3)
    for spine in axes.spines.values():
        spine.set_color(GREY)
        spine.set_linewidth(0.7)


def inches(axes: Axes) -> tuple[float, float]:
    """Width and height of axes, in."""
    room = axes.get_window_extent()
    return float(room.width) / DPI, float(room.height) / DPI


def column(
    made: Figure, heights: Sequence[float], legends: Sequence[int], left: float, right: float, top: float
) -> list[Axes]:
    """Panels one above the other that share their x axis, the first on top.

    Parameters
    ----------
    heights : of the panels, in
    legends : how many rows of legend stand above each panel
    left, right, top : where the column is, in, from the figure's left and lower edges
    """
    panels: list[Axes] = []
    for height, rows in zip(heights, legends, strict=True):
        top -= room(rows) + height
        panels.append(place(made, left, top, right - left, height, panels[0] if panels else None))
    for axes in panels[:-1]:
        axes.tick_params(labelbottom=False)
    return panels


def column_height(heights: Sequence[float], legends: Sequence[int]) -> float:
    """How high a column of panels is, with its legends and without the labels below it, in."""
    return sum(heights) + sum(room(rows) for rows in legends)


def stack(
    heights: Sequence[float], legends: Sequence[Sequence[str]], width: float
) -> tuple[Figure, list[Axes]]:
    """A figure of one column of panels, `width` in wide; `legends` are the names above each."""
    rows = [legend_rows(names, width - LEFT - RIGHT) for names in legends]
    total = BOTTOM + column_height(heights, rows)
    made = figure(width, total)
    return made, column(made, heights, rows, LEFT, width - RIGHT, total)


def room(rows: int) -> float:
    """Height above a panel that holds so many rows of legend, in."""
    return GAP + ROW * max(rows - 1, 0)


def legend_columns(names: Sequence[str], width: float) -> int:
    """How many legend entries fit side by side into a width, in."""
    lengths = [0.42 + 0.058 * len(name) for name in names]
    for columns in range(len(names), 1, -1):
        # A legend is filled column by column, the first ones with one entry more.
        filled = np.array_split(lengths, columns)
        if sum(float(column.max()) for column in filled) <= width:
            return columns
    return 1


def legend_rows(names: Sequence[str], width: float) -> int:
    """How many rows a legend takes that fits into a width, in."""
    return -(-len(names) // legend_columns(names, width)) if names else 1


def label(axes: Axes, *, x: str = "", y: str = "") -> None:
    """Axis labels, with units."""
    if x:
        axes.set_xlabel(x, fontsize=TEXT, color=BLACK, labelpad=3)
    if y:
        axes.set_ylabel(y, fontsize=TEXT, color=BLACK, labelpad=4)


def aligned(made: Figure) -> Figure:
    """The figure, once all is drawn, with labels of y axes above each other at one distance from them."""
    columns: dict[float, list[Axes]] = {}
    for axes in made.axes:
        if axes.get_ylabel():
            columns.setdefault(round(axes.get_position().x0, 3), []).append(axes)
    for panels in columns.values():
        texts: list[str] = []
        for axes in panels:
            low, high = sorted(axes.get_ylim())
            shown = [value for value in axes.yaxis.get_majorticklocs() if low <= value <= high]
            texts += axes.yaxis.get_major_formatter().format_ticks(shown)
        numbers = CHARACTER * max(map(len, texts), default=0)
        for axes in panels:
            axes.yaxis.set_label_coords(-(TICK + min(numbers, NUMBERS)) / inches(axes)[0], 0.5)
    return made


def time_axis(axes: Axes, t: Array, *, named: bool = True) -> None:
    """Time from the first to the last sample, s."""
    if len(t) > 1:
        axes.set_xlim(float(t[0]), float(t[-1]))
    axes.xaxis.set_major_locator(MaxNLocator(nbins=10, steps=[1, 2, 5, 10]))
    axes.xaxis.set_major_formatter(plain())
    if named:
        label(axes, x="time t [s]")


def value_axis(axes: Axes) -> None:
    """About five plain ticks on the y axis."""
    axes.yaxis.set_major_locator(MaxNLocator(nbins=5, steps=[1, 2, 2.5, 5, 10]))
    axes.yaxis.set_major_formatter(plain())


def decades(lowest: float, highest: float) -> tuple[int, int]:
    """The powers of ten, two at least, between which [lowest, highest] lies, both above 0."""
    low, high = int(np.floor(np.log10(lowest))), int(np.ceil(np.log10(highest)))
    return low, max(high, low + 1)


def log_axis(axes: Axes, lowest: float, highest: float, *, below: bool = False) -> None:
    """A logarithmic y axis over whole decades that hold [lowest, highest], both above 0.

    below : whether its lowest power of ten stands for all that is less, and 0
    """
    low, high = decades(lowest, highest)

    def text(value: float, _: int | None) -> str:
        least = below and value < 1.01 * 10.0**low
        return f"≤ {power(value)}" if least else power(value)

    axes.set_yscale("log")
    axes.set_ylim(10.0 ** (low - 0.04 * (high - low) * below), 10.0**high)
    shown = FixedLocator([10.0**k for k in range(low, high + 1, -(-(high - low) // 6))])
    axes.yaxis.set_major_locator(shown if below else LogLocator(base=10.0, numticks=7))
    axes.yaxis.set_major_formatter(FuncFormatter(text))
    axes.yaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_minor_formatter(NullFormatter())


def plain() -> FuncFormatter:
    """Plain numbers at the ticks. A formatter belongs to one axis."""
    return FuncFormatter(lambda value, _: number(value))


def number(value: float) -> str:
    """A tick's number: 0.25, −3, 2·10⁻⁴."""
    if value == 0.0 or 1e-3 <= abs(value) < 1e4:
        return f"{value:.6g}".replace("-", "−")
    mantissa, exponent = f"{value:.2e}".split("e")
    short = mantissa.rstrip("0").rstrip(".").replace("-", "−")
    decade = f"10{str(int(exponent)).translate(_SUPERSCRIPTS)}"
    return decade if short == "1" else f"{short}·{decade}"


def power(value: float) -> str:
    """A decade: 10⁻³."""
    return f"10{str(round(np.log10(value))).translate(_SUPERSCRIPTS)}" if value > 0.0 else ""


def legend(axes: Axes, width: float | None = None, *, lift: float = 0.0) -> None:
    """A legend `lift` in above the axes, where no curve can be, in as few rows as fit into a width, in."""
    handles, names = axes.get_legend_handles_labels()
    if not handles:
        return
    across, height = inches(axes)
    width = across if width is None else width
    axes.legend(
        handles,
        names,
        loc="lower left",
        bbox_to_anchor=(0.0, 1.0 + lift / height),
        ncols=legend_columns(names, width),
        frameon=False,
        fontsize=SMALL,
        labelcolor=BLACK,
        borderaxespad=0.25,
        borderpad=0.0,
        handlelength=1.9,
        handletextpad=0.5,
        columnspacing=1.4,
        labelspacing=0.25,
    )


def units(names: Iterable[str]) -> str:
    """The units of an axis that several quantities share: "[m/s, rad/s]"."""
    return f"[{', '.join(dict.fromkeys(names))}]"


def groups(kinds: Sequence[str]) -> dict[str, list[int]]:
    """Indices by unit, in order of appearance."""
    found: dict[str, list[int]] = {}
    for index, kind in enumerate(kinds):
        found.setdefault(kind, []).append(index)
    return found


def thin(t: Array, y: Array, most: int = 1200) -> tuple[Array, Array]:
    """Fewer samples with the same picture: the smallest and the largest of each bin, and both ends."""
    width = -(-2 * len(t) // most)
    if width <= 2:
        return t, y
    bins = len(t) // width
    parts = np.nan_to_num(y[: bins * width]).reshape(bins, width)
    first = np.arange(bins) * width
    picked = [[0, len(t) - 1], first + parts.argmin(axis=1), first + parts.argmax(axis=1)]
    rest = np.nan_to_num(y[bins * width :])
    if rest.size:
        picked.append([bins * width + int(rest.argmin()), bins * width + int(rest.argmax())])
    kept = np.unique(np.concatenate(picked))
    return t[kept], y[kept]


def curve(
    axes: Axes, t: Array, y: Array, name: str | None, color: str, dashes: str = "-", below: int = 0
) -> None:
    """One curve over time, drawn with no more points than can be seen.

    `below` counts those that are drawn over it: it is wider, and seen where it runs as they do.
    """
    x, values = thin(t, y)
    width = WIDTH + WIDER * below
    axes.plot(x, values, dashes, color=color, linewidth=width, label=name, solid_joinstyle="round")


def note(axes: Axes, text: str) -> None:
    """A sentence in the middle of axes that have nothing to show."""
    axes.yaxis.set_major_locator(NullLocator())
    axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center", va="center", fontsize=TEXT, color=GREY)
