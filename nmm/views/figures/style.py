"""The house style: colours, sizes, axes; set on every artist, because rcParams are global to a process. And
figures as files: PNG, and PDF and SVG, whose text is text."""

from __future__ import annotations

import threading
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, MaxNLocator, NullFormatter, NullLocator

from nmm.base.arrays import Array
from nmm.base.errors import expect
from nmm.base.figure_options import FORMATS, FigureOptions
from nmm.base.files import written_at
from nmm.base.resolver_style import BLACK, CYCLE, DASHES, GREEN, ORANGE, PINK, RunStyle
from nmm.base.text_format import listed, printable, superscript
from nmm.motion.trajectory import Trajectory

GREY, LIGHT = "#6B7280", "#E5E7EB"
DPI = 180
TEXT, SMALL = 9.0, 8.0
WIDTH, WIDER = 1.4, 0.7
#: Size of a target's mark, pt.
TARGET = 12.0
#: Figure width, and the strip that axes need for their labels at the left and below, in.
PAGE, LEFT, RIGHT, BOTTOM = 5.2, 0.8, 0.2, 0.46
#: Room beside the ticks' numbers, of a character of them at most, and of them where there are many, in.
TICK, CHARACTER, NUMBERS = 0.16, 0.64 * SMALL / 72.0, 0.46
#: Height above a panel for a legend of one row, and for each row more, in.
GAP, ROW = 0.34, 0.16


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
    axes.spines[["top", "right"]].set_visible(False)
    return axes


def dress(axes: Axes, size: float = SMALL) -> None:
    """Grid, ticks and frame of the house style; `size` of the ticks' numbers, pt."""
    axes.set_axisbelow(True)
    axes.grid(True, color=LIGHT, linewidth=0.7)
    ticks(axes, size)
    axes.spines[:].set(color=GREY, linewidth=0.7)


def ticks(axes: Axes, size: float = SMALL) -> None:
    axes.tick_params(labelsize=size, color=GREY, labelcolor=BLACK, width=0.7, length=3)


def inches(axes: Axes) -> tuple[float, float]:
    room = axes.get_window_extent()
    dpi = axes.figure.dpi
    return float(room.width) / dpi, float(room.height) / dpi


def column(
    made: Figure, heights: Sequence[float], legends: Sequence[int], left: float, right: float, top: float
) -> list[Axes]:
    """Panels of these heights above each other, with one x axis and rows of legend above each; left, right,
    top from the figure's left and lower edges; all in inches."""
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


def label(axes: Axes, *, x: str = "", y: str = "", typeset: bool = False) -> None:
    """What the axes are; the text as it stands, or `typeset`, with formulas between dollar signs."""
    if x:
        axes.set_xlabel(x, fontsize=TEXT, color=BLACK, labelpad=3, parse_math=typeset)
    if y:
        axes.set_ylabel(y, fontsize=TEXT, color=BLACK, labelpad=4, parse_math=typeset)


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
    if len(t) > 1:
        axes.set_xlim(float(t[0]), float(t[-1]))
    axes.xaxis.set_major_locator(MaxNLocator(nbins=10, steps=[1, 2, 5, 10]))
    axes.xaxis.set_major_formatter(plain())
    if named:
        label(axes, x="time t [s]")


def value_axis(axes: Axes, bins: int = 5) -> None:
    axes.yaxis.set_major_locator(MaxNLocator(nbins=bins, steps=[1, 2, 2.5, 5, 10]))
    axes.yaxis.set_major_formatter(plain())


def decades(lowest: float, highest: float) -> tuple[int, int]:
    """The powers of ten, at least two, around [lowest, highest], both above 0."""
    low, high = int(np.floor(np.log10(lowest))), int(np.ceil(np.log10(highest)))
    return low, max(high, low + 1)


def log_axis(axes: Axes, lowest: float, highest: float, *, below: bool = False) -> None:
    """A logarithmic y axis over whole decades that hold [lowest, highest], both above 0; with `below`, its
    lowest tick also stands for smaller values and 0."""
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
    """Plain numbers at the ticks; each axis needs a formatter of its own."""
    return FuncFormatter(lambda value, _: number(value))


def number(value: float) -> str:
    """A tick's number: 0.25, −3, 2·10⁻⁴."""
    if value == 0.0 or 1e-3 <= abs(value) < 1e4:
        return f"{value:.6g}".replace("-", "−")
    mantissa, exponent = f"{value:.2e}".split("e")
    short = mantissa.rstrip("0").rstrip(".").replace("-", "−")
    decade = f"10{superscript(int(exponent))}"
    return decade if short == "1" else f"{short}·{decade}"


def power(value: float) -> str:
    """A decade: 10⁻³."""
    return f"10{superscript(round(np.log10(value)))}" if value > 0.0 else ""


def legend(axes: Axes, width: float | None = None, *, lift: float = 0.0, only: str = "") -> None:
    """A legend `lift` in above the axes, where no curve can be, in as few rows as fit into a width, in; of
    all that has a name, or of the one of that name."""
    handles, names = axes.get_legend_handles_labels()
    if only:
        handles, names = handles[names.index(only) :][:1] if only in names else [], [only]
    if not handles:
        return
    across, height = inches(axes)
    width = across if width is None else width
    made = axes.legend(
        handles, names, loc="lower left", bbox_to_anchor=(0.0, 1.0 + lift / height), frameon=False,
        ncols=legend_columns(names, width), fontsize=SMALL, labelcolor=BLACK, borderaxespad=0.25,
        borderpad=0.0, handlelength=1.9, handletextpad=0.5, columnspacing=1.4, labelspacing=0.25,
    )  # fmt: skip
    for text in made.get_texts():
        text.set_parse_math(False)  # a name may have dollar signs


def units(names: Iterable[str]) -> str:
    """The units of an axis of several quantities: "[m/s, rad/s]"."""
    return f"[{', '.join(dict.fromkeys(names))}]"


def groups(kinds: Sequence[str]) -> dict[str, list[int]]:
    """Indices by unit, in order of appearance."""
    return {kind: [i for i, other in enumerate(kinds) if other == kind] for kind in dict.fromkeys(kinds)}


def curve(
    axes: Axes, t: Array, y: Array, name: str | None, color: str, dashes: str = "-", below: int = 0
) -> None:
    """A curve over time, wider if others are drawn over it (`below`), to stay visible."""
    width = WIDTH + WIDER * below
    axes.plot(t, y, dashes, color=color, linewidth=width, label=name, solid_joinstyle="round")


def compared(axes: Axes, worn: Sequence[RunStyle], times: Sequence[Array], values: Sequence[Array]) -> None:
    """A curve for each run in its look, the later ones over the earlier."""
    for k, (look, t, y) in enumerate(zip(worn, times, values, strict=True)):
        curve(axes, t, y, *look, below=len(worn) - 1 - k)


def columns(axes: Axes, t: Array, values: Array, names: Sequence[str], *, zero: bool = False) -> None:
    """The columns of values (N, k), each with its own colour and dashes, and a line at zero if asked."""
    for k, (values_k, name) in enumerate(zip(values.T, names, strict=True)):
        curve(axes, t, values_k, name, CYCLE[k % 7], DASHES[k % 4])
    if zero:
        axes.axhline(0.0, color=GREY, linewidth=0.7, zorder=1)


def finish(axes: Axes, t: Array, y: str, *, named: bool = True, ticks: bool = True) -> None:
    label(axes, y=y)
    if ticks:
        value_axis(axes)
    time_axis(axes, t, named=named)
    legend(axes)


def sampled(trajectories: Sequence[Trajectory], what: str) -> list[Trajectory]:
    """The runs that have samples; InputError if none has."""
    runs = [run for run in trajectories if len(run)]
    expect(runs, f"figure of {what}", "a run with at least one sample")
    return runs


def positive(curves: Sequence[Array]) -> Array:
    return np.concatenate([values[np.isfinite(values) & (values > 0.0)] for values in curves])


def mark_ends(axes: Axes, path: Array, size: float) -> None:
    """Marks of that size, pt, at the start and the end of a path (k, 2)."""
    for point, marker, color, name in ((path[0], "o", GREEN, "start"), (path[-1], "s", PINK, "end")):
        axes.plot(
            *point, marker, color=color, markersize=size, markeredgecolor="white", markeredgewidth=0.8,
            label=name, linestyle="none", zorder=6,
        )  # fmt: skip


def mark_targets(axes: Axes, points: Array) -> None:
    """Stars at what is to be reached, points (k, 2), which the legend names where there are any."""
    if len(points):
        axes.plot(
            *points.T, "*", color=ORANGE, markersize=TARGET, markeredgecolor=BLACK, markeredgewidth=0.7,
            label="target", linestyle="none", zorder=6,
        )  # fmt: skip


def note(axes: Axes, text: str) -> None:
    axes.yaxis.set_major_locator(NullLocator())
    place: dict[str, Any] = {"transform": axes.transAxes, "ha": "center", "va": "center"}
    axes.text(0.5, 0.5, text, **place, fontsize=TEXT, color=GREY, parse_math=False)


#: What Matplotlib reads of its global state while it writes: whole fonts (Type 3 is refused by publishers),
#: text that can be searched and edited, the same file from the same figure. Nothing else here depends on it.
_VECTOR: Any = {"pdf.fonttype": 42, "svg.fonttype": "none", "svg.hashsalt": "nmm"}
_WRITING = threading.Lock()
_OPTIONS: dict[str, dict[str, Any]] = {
    # Level 3 costs half the time of zlib's default and a few per cent of size.
    "png": {"dpi": DPI, "pil_kwargs": {"compress_level": 3}},
    "pdf": {"metadata": {"CreationDate": None}},
    "svg": {"metadata": {"Date": None}},
}


def save(made: Figure, path: str | Path) -> Path:
    """Write a figure; the file's suffix says as what: .png, .pdf or .svg.

    Raises
    ------
    InputError : another suffix, a file that cannot be written

    Examples
    --------
    >>> run = nmm.Scenario.load("unicycle_2r_position").run()
    >>> nmm.figures.save(nmm.figures.stroboscopic(run), "motion.pdf").name
    'motion.pdf'
    """
    path = Path(path)
    kind = path.suffix.lower().removeprefix(".")
    suffixes = listed([f".{name}" for name in FORMATS], "or")
    expect(kind in FORMATS, str(path), f"a file that ends in {suffixes}")
    for text in made.findobj(Text):  # names in files may hold what no font can draw
        text.set_text("\n".join(map(printable, text.get_text().split("\n"))))
    with written_at(path):
        if kind == "png":
            made.savefig(path, **_OPTIONS[kind])
        else:
            with _WRITING, matplotlib.rc_context(_VECTOR):
                made.savefig(path, **_OPTIONS[kind])
    return path


def save_as(made: Figure, folder: Path, name: str, options: FigureOptions) -> list[Path]:
    """Write a figure in each format; the picture that it was drawn into, some MB, is not kept."""
    paths = [save(made, folder / f"{name}.{kind}") for kind in options.formats]
    FigureCanvasAgg(made)
    return paths
