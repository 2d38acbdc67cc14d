"""Figures as files: PNG, and PDF and SVG, whose text is text."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Any

import matplotlib
from matplotlib.figure import Figure

from nmm.errors import InputError
from nmm.figures.style import DPI
from nmm.runs.figure_options import FORMATS, FigureOptions
from nmm.words import listed

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
    if kind not in FORMATS:
        expected = listed([f".{name}" for name in FORMATS], "or")
        raise InputError(f"{path}: expected a file that ends in {expected}")
    try:
        if kind == "png":
            made.savefig(path, **_OPTIONS[kind])
        else:
            with _WRITING, matplotlib.rc_context(_VECTOR):
                made.savefig(path, **_OPTIONS[kind])
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror}") from None
    return path


def save_as(made: Figure, folder: Path, name: str, options: FigureOptions) -> list[Path]:
    """Write a figure in each of the formats asked for; returns the files."""
    return [save(made, folder / f"{name}.{kind}") for kind in options.formats]
