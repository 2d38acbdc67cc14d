"""Runs for the tests of figures, and what holds for every figure."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure

from nmm.motion.trajectory import Trajectory
from nmm.scenario import Scenario

PAPER = ["unicycle_2r_position", "unicycle_2r_pointing", "unicycle_2r_link_pointing", "unicycle_3r_position"]


@cache
def run(name: str, resolver: str = "rg", **settings: object) -> Trajectory:
    given = {key.replace("__", "."): value for key, value in settings.items()}
    return Scenario.load(name, {"dt": 0.02, **given}).with_resolver(resolver).run()


def check_legible(made: Figure) -> None:
    """Nothing is clipped, no legend lies over curves, every axis that has numbers says what they are."""
    made.draw_without_rendering()  # places everything
    renderer = made.canvas.get_renderer()  # type: ignore[attr-defined]  # Agg's, which every canvas here is
    width, height = made.get_size_inches()
    box = made.get_tightbbox(renderer)
    assert box.x0 >= 0.0
    assert box.y0 >= 0.0
    assert box.x1 <= width
    assert box.y1 <= height
    for axes in made.axes:
        numbered = [label for label in axes.get_yticklabels() if label.get_visible() and label.get_text()]
        shares = [other for other in made.axes if other.get_ylabel() and same_row(axes, other)]
        assert not numbered or shares
        if axes.get_ylabel():
            name = axes.yaxis.label.get_window_extent(renderer)
            low, high = sorted(axes.get_ylim())
            drawn = [one for one in numbered if low <= one.get_position()[1] <= high]
            assert all(name.x1 <= one.get_window_extent(renderer).x0 for one in drawn)
        shown = axes.get_legend()
        if shown is not None:
            assert shown.get_window_extent(renderer).y0 >= axes.get_window_extent(renderer).y1 - 1.0
    assert any("[s]" in axes.get_xlabel() or "[m]" in axes.get_xlabel() for axes in made.axes)


def same_row(a: Axes, b: Axes) -> bool:
    return abs(a.get_position().y0 - b.get_position().y0) < 1e-9


def drawn_points(axes: Axes) -> np.ndarray:
    """Every vertex drawn in data coordinates: robots, paths, marks."""
    points = [line.get_xydata() for line in axes.lines]
    for collection in axes.collections:
        assert isinstance(collection, LineCollection | PolyCollection)
        points += [path.vertices for path in collection.get_paths()]
    return np.vstack([np.asarray(part) for part in points])


def cut(trajectory: Trajectory, count: int) -> Trajectory:
    arrays = ("t", "q", "u", "q_dot", "r", "r_d", "error", "objective", "sigma_min", "partition", "residual")
    names = (*arrays, "path", "desired")
    return replace(trajectory, **{name: getattr(trajectory, name)[:count] for name in names})
