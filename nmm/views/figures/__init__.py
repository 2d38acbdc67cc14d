"""Figures of runs, drawn with matplotlib's objects alone: no display, no pyplot, no global state."""

import os
from contextlib import chdir

if os.environ.get("MATPLOTLIBRC") == os.devnull:  # then it would take those that lie in this folder
    with chdir(os.sep):
        import matplotlib  # noqa: F401  # reads its settings now, where none of the user's lie

from nmm.base.figure_options import FigureOptions
from nmm.views.figures.composed import comparison, overview, write_run_figures
from nmm.views.figures.curves import coordinates, errors, inputs, singular_values, tracking
from nmm.views.figures.limits import clearance, limits
from nmm.views.figures.motion import stroboscopic
from nmm.views.figures.objective import objective_comparison
from nmm.views.figures.style import save
from nmm.views.figures.torques import torques

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
    "torques",
    "tracking",
    "write_run_figures",
]
