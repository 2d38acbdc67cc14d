"""Figures at which a test does not look are neither put together nor drawn: most of what a command takes."""

from __future__ import annotations

from collections.abc import Callable, Collection
from pathlib import Path
from typing import Any

import pytest
from matplotlib.figure import Figure
from PIL import Image

import nmm.views.figures
from nmm.base.figure_options import PLAIN, FigureOptions
from nmm.views.figures import composed, curves

_drawn = Figure.savefig

#: The files of a run's folder, and where the functions are that put them together.
_OF_A_RUN: dict[str, tuple[Any, str]] = {
    "motion": (composed, "stroboscopic"),
    "errors": (curves, "errors"),
    "inputs": (curves, "inputs"),
    "objective": (composed, "objective_comparison"),
    "limits": (composed, "limits"),
    "clearance": (composed, "clearance"),
}


def draw_only(names: Collection[str], patch: pytest.MonkeyPatch) -> None:
    """As PNG, figures of other file names are written as an empty picture, and those of a run or of a
    comparison are empty figures, too."""

    def save(figure: Figure, path: Path, **options: Any) -> None:
        if path.suffix != ".png" or path.name in names:
            _drawn(figure, path, **options)
        else:
            Image.new("L", (8, 8)).save(path)

    def without_figures(write: Callable[..., list[Path]]) -> Callable[..., list[Path]]:
        def write_run_figures(*given: Any, options: FigureOptions = PLAIN, **more: Any) -> list[Path]:
            with pytest.MonkeyPatch.context() as within:
                for name, place in _OF_A_RUN.items():
                    if options.formats == PLAIN.formats and f"{name}.png" not in names:
                        within.setattr(*place, _empty)
                return write(*given, options=options, **more)

        return write_run_figures

    patch.setattr(Figure, "savefig", save)
    patch.setattr(nmm.views.figures, "write_run_figures", without_figures(composed.write_run_figures))
    if "comparison.png" not in names:
        patch.setattr(nmm.views.figures, "comparison", _empty)


def _empty(*_: Any, **__: Any) -> Figure:
    return Figure()
