"""Figures of a calibration: both ways beside the reference, residuals, correlations."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes
from simulated_drives import Inputs, drive

import nmm
from nmm.plugins.robot.calibration import figures
from nmm.views.figures import style

TRUTH = {"radius.left_wheel_joint": 0.098, "track": 0.54}
LONG = "a very long name of a drive (through the house), on the first of March 2026.csv"


def curves(t: np.ndarray) -> np.ndarray:
    v, w = 3.0 + 2.0 * np.sin(0.5 * t), 2.0 * np.sin(0.7 * t)
    return np.stack([v - w, v + w], axis=1)


def later(seconds: float) -> Inputs:
    return lambda t: curves(t + seconds)


@pytest.fixture(scope="module")
def found() -> nmm.Calibration:
    """Of two drives; in the second one look is off, and then the reference jumps."""
    robot = nmm.load("differential_base")
    first, second = (
        drive(robot, TRUTH, inputs=later(seed), seconds=30.0, rate=25.0, looks=5.0, seed=seed)
        for seed in (1, 2)
    )
    seen = second.reference.copy()
    seen[40] += [0.5, 0.4, 0.0]
    seen[100:, :2] += [1.5, 0.3]
    off = nmm.DriveLog(LONG, second.t, second.readings, second.reference_t, seen, "poses")
    return nmm.calibrate(robot, [first, off])


def lines(axes: Axes, color: str) -> list[np.ndarray]:
    return [np.array(line.get_data()).T for line in axes.lines if line.get_color() == color]


def test_ways_before_and_after_lie_beside_the_reference(found: nmm.Calibration) -> None:
    made = figures.path(found)
    first, second = made.axes
    for axes, pieces in ((first, 1), (second, 2)):
        seen = [way for way in lines(axes, style.BLACK) if len(way) > 1]
        before, after = lines(axes, style_color("before")), lines(axes, style_color("after"))
        assert len(seen) == len(before) == len(after) == pieces
        for reference, old, new in zip(seen, before, after, strict=True):
            assert np.hypot(*(new[0] - reference[0])) < 0.03
            assert np.hypot(*(new[-1] - reference[-1])) < np.hypot(*(old[-1] - reference[-1]))
        assert axes.get_aspect() == 1.0
        assert axes.get_xlabel() == "x [m]"


def style_color(which: str) -> str:
    return {"before": figures.VERMILLION, "after": figures.BLUE}[which]


def test_residuals_show_what_was_left_out_and_where_the_reference_jumped(found: nmm.Calibration) -> None:
    made = figures.residuals(found)
    assert len(made.axes) == 6
    lost, jumps = [], []
    for axes in made.axes:
        crosses = [line for line in axes.lines if line.get_marker() == "x" and len(line.get_xdata())]
        lost.append(sum(len(line.get_xdata()) for line in crosses if line.get_label().startswith("_")))
        jumps.append(sum(line.get_linestyle() == ":" and len(line.get_xdata()) == 2 for line in axes.lines))
        low, high = axes.get_ylim()
        for line in axes.lines:
            assert all(
                low <= y <= high for y in np.asarray(line.get_ydata(), float) if line.get_marker() != "None"
            )
    assert lost[:3] == [0, 0, 0]
    assert min(lost[3:]) >= 1
    assert jumps == [0, 0, 0, 1, 1, 1]
    drives = found.model.drives
    dots = made.axes[0].lines
    assert max(len(line.get_xdata()) for line in dots) == np.count_nonzero(drives[0].taken == 1)
    legend = made.axes[0].get_legend()
    assert legend is not None
    assert [text.get_text() for text in legend.get_texts()] == ["a look", "left out", "the reference jumped"]


def test_correlation_has_a_cell_for_each_two(found: nmm.Calibration) -> None:
    (axes,) = figures.correlation(found).axes
    n = len(found.learned)
    assert len(axes.texts) == n * n
    matrix = axes.images[0].get_array()
    assert matrix is not None
    np.testing.assert_allclose(np.diag(matrix), 1.0)
    names = [label.get_text() for label in axes.get_yticklabels()]
    assert names[0] == "radius.left_wheel_joint  1"
    assert [axes.texts[k * n + k].get_text() for k in range(n)] == ["1"] * n


@pytest.mark.parametrize("width", [3.0, 7.16])
@pytest.mark.parametrize("name", [*figures.FIGURES])
def test_texts_lie_within_the_figure(found: nmm.Calibration, name: str, width: float, tmp_path: Path) -> None:
    made = figures.FIGURES[name](found, width=width)
    style.save(made, tmp_path / "it.png")
    renderer = made.canvas.get_renderer()  # type: ignore[attr-defined]
    across, high = made.bbox.width, made.bbox.height
    for axes in made.axes:
        low, high_y = sorted(axes.get_ylim())
        ticks = [one for one in axes.get_yticklabels() if low <= one.get_position()[1] <= high_y]
        shown = [axes.xaxis.label, axes.yaxis.label, axes.title, *ticks, *axes.texts]
        for text in [one for one in shown if one.get_text()]:
            box = text.get_window_extent(renderer)
            assert box.x0 > -1.0, text
            assert box.y0 > -1.0, text
            assert box.x1 < across + 1.0, text
            assert box.y1 < high + 1.0, text


def test_nothing_learned_and_many_drives(found: nmm.Calibration, tmp_path: Path) -> None:
    none = {name: replace(number, why="held") for name, number in found.numbers.items()}
    bare = replace(found, numbers=none, covariance=np.zeros((0, 0)))
    style.save(figures.correlation(bare), tmp_path / "none.png")
    robot = nmm.load("differential_base")
    logs = [
        drive(robot, TRUTH, inputs=later(n), seconds=8.0, rate=25.0, looks=5.0, seed=n, name=f"drive {n}")
        for n in range(6)
    ]
    many = nmm.calibrate(robot, logs)
    titles = [axes.get_title(loc="left") for axes in figures.path(many).axes]
    assert titles == ["drive 0", "drive 1", "drive 2", "drive 3, and 2 drives more"]


def test_closed_drives_have_figures(tmp_path: Path) -> None:
    """Squares both ways, of which only the ends are known."""
    robot = nmm.load("differential_base")
    logs = []
    for way in (1.0, -1.0):
        log = drive(
            robot, TRUTH, inputs=lambda t, way=way: square(t, way), seconds=32.0, rate=25.0, looks=25.0,
            slip=0.001, mount=(0.0, 0.0, 0.0), delay=0.0, place=0.0, heading=0.0,
        )  # fmt: skip
        ends = log.reference[[0, -1]]
        logs.append(nmm.DriveLog(f"way {way:g}", log.t, log.readings, log.t[[0, -1]], ends, "ends"))
    found = nmm.calibrate(robot, logs)
    for name, draw in figures.FIGURES.items():
        style.save(draw(found), tmp_path / f"{name}.png")
    axes = figures.path(found).axes[0]
    (seen,) = lines(axes, style.BLACK)
    assert len(seen) == 2
    (after,) = lines(axes, figures.BLUE)
    assert np.ptp(after, axis=0).min() > 1.0, "the whole way, not its end alone"
    ends = figures.residuals(found).axes
    assert [axes.get_ylabel() for axes in ends] == ["x [σ]", "y [σ]", "heading [σ]"]
    assert ends[-1].get_xlabel() == "drive"
    assert max(len(line.get_xdata()) for line in ends[0].lines) == 2


def square(t: np.ndarray, way: float) -> np.ndarray:
    turning = (t % 8.0) > 4.0
    rate = way * 0.5 * np.pi / 4.0 * 0.25 / 0.1
    return np.where(turning[:, np.newaxis], [[-rate, rate]], [[5.0, 5.0]])
