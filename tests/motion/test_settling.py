"""The settling time against closed forms: an error exp(-K t) is down to 2 % after ln 50 / K."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from numpy.typing import NDArray

import nmm
from nmm.control.sequencing.sequence import Event
from nmm.motion.diagnosis.summary import settling_time
from nmm.views.figures import comparison


@pytest.fixture(scope="module")
def run() -> nmm.Trajectory:
    return nmm.Scenario.load("unicycle_2r_position", {"duration": "1"}).run()


def with_error(run: nmm.Trajectory, t: NDArray[np.float64], error: NDArray[np.float64]) -> nmm.Trajectory:
    return dataclasses.replace(run, t=t, error=error.reshape(len(t), -1))


@pytest.mark.parametrize("K", [0.5, 1.0, 7.0])
@pytest.mark.parametrize("dt", [0.001, 0.05, 0.3])
@pytest.mark.parametrize("start", [0.0, 3.0])
def test_of_a_decaying_error(K: float, dt: float, start: float, run: nmm.Trajectory) -> None:
    t = start + dt * np.arange(math.ceil(10.0 / K / dt))
    error = np.exp(-K * (t - start))[:, np.newaxis] * [0.3, -0.4]
    assert settling_time(with_error(run, t, error)) == pytest.approx(math.log(50.0) / K, rel=1e-12)


@pytest.mark.parametrize("gain", [1.0, 2.5])
def test_of_a_closed_loop(gain: float) -> None:
    """e_dot = -K e holds of the run itself, whatever the resolver."""
    scenario = nmm.Scenario.load("unicycle_2r_position", {"duration": "6", "task.0.gain": gain})
    for kind in ("rg", "pg"):
        run = scenario.with_resolver(kind).run()
        assert run.summary()["settling_time"] == pytest.approx(math.log(50.0) / gain, rel=1e-6)


def test_the_last_time_counts(run: nmm.Trajectory) -> None:
    """An error that comes back has settled when it is down again: exp(-t) beside a bump that ends at 8 s."""
    t = np.linspace(0.0, 12.0, 12001)
    error = np.exp(-t) + np.where((t > 7.0) & (t < 8.0), 0.5, 0.0)
    assert settling_time(with_error(run, t, error)) == pytest.approx(8.0, abs=1e-3)


def test_what_has_none(run: nmm.Trajectory) -> None:
    t = np.linspace(0.0, 5.0, 101)
    assert settling_time(with_error(run, t, np.exp(-0.5 * t))) is None  # not there yet: 8 % are left
    assert settling_time(with_error(run, t, 1e-9 * (1.0 + t))) is None  # nothing to settle from
    assert settling_time(with_error(run, t, np.full(101, np.inf))) is None
    assert settling_time(with_error(run, t[:1], np.ones(1))) is None
    assert settling_time(with_error(run, t, np.where(t < 2.0, 1.0, 0.0))) == pytest.approx(2.0, abs=0.05)
    assert settling_time(run) is None
    decaying = with_error(run, t, np.exp(-5.0 * t))
    assert settling_time(decaying) is not None
    assert settling_time(dataclasses.replace(decaying, events=(Event(1.0, "reach", "ends", ""),))) is None


def test_a_comparison_marks_it() -> None:
    """On each error's curve, where ln 50 / K and 2 % of the start meet; once in the legend. So are the runs'
    names."""
    gains = (1.0, 2.5)
    runs = [
        nmm.Scenario.load("unicycle_2r_position", {"duration": "5", "task.0.gain": gain}).run()
        for gain in gains
    ]
    made = comparison(runs)
    (panel,) = [axes for axes in made.axes if axes.get_ylabel().startswith("‖e‖")]
    marks = [line for line in panel.lines if line.get_marker() == "o" and len(line.get_xdata())]
    for mark, run, gain in zip(marks, runs, gains, strict=True):
        assert mark.get_xdata() == pytest.approx([math.log(50.0) / gain], rel=1e-6)
        assert mark.get_ydata() == pytest.approx([0.02 * run.error_norm[0]])
    assert len(marks) == 2
    assert len({mark.get_color() for mark in (*marks, *panel.get_legend().legend_handles)}) == 1
    legends = [legend for axes in made.axes if (legend := axes.get_legend()) is not None]
    texts = [text.get_text() for legend in legends for text in legend.get_texts()]
    assert [texts.count(name) for name in ("RG", "RG (2)", "down to 2 %")] == [1, 1, 1]
