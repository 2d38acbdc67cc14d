"""Figures of runs, drawn with matplotlib's objects alone: no display, no pyplot, no global state."""

from nmm.figures.clearance import clearance
from nmm.figures.composed import comparison, overview, write_run_figures
from nmm.figures.curves import coordinates, errors, inputs, singular_values, tracking
from nmm.figures.files import save
from nmm.figures.limits import limits
from nmm.figures.motion import stroboscopic
from nmm.figures.objective import objective_comparison
from nmm.runs.figure_options import FigureOptions

__all__ = [
    "FigureOptions",
    "clearance",
    "comparison",
    "coordinates",
    "errors",
    "inputs",
    "limits",
    "objective_comparison",
    "overview",
    "save",
    "singular_values",
    "stroboscopic",
    "tracking",
    "write_run_figures",
]
