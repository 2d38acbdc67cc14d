"""A singularity of J_e between two samples is told, and a run whose inputs jump there has not completed."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from findings import codes, the
from scipy.optimize import brentq

import nmm
from nmm.motion import closed_loop
from nmm.motion.diagnosis.jumps import crossings
from nmm.motion.recording import crossed
from nmm.views.playback.channels import channels, events

STOPPING = nmm.Scenario.load("unicycle_2r_algorithmic", {"resolver.singular": "stop"})


def when_singular() -> float:
    """When the arm of the scenario, straight and on its reference, has its end beside the axle, s."""

    def ahead(t: float) -> float:
        s = t / 10.0
        return 0.3 + 0.8 * math.cos(math.pi * (10.0 * s**3 - 15.0 * s**4 + 6.0 * s**5))

    return float(brentq(ahead, 1.0, 9.0))


@pytest.mark.parametrize("method", ["rk4", "zoh"])
@pytest.mark.parametrize("dt", [0.01, 0.005, 0.0025, 0.001])
def test_a_singularity_between_two_samples_is_told(dt: float, method: str) -> None:
    """What was `completed`, with 43 m/s here and 5 m/s there, by where the samples fall."""
    run = STOPPING.with_settings({"dt": dt, "method": method}).run()
    (k,) = np.flatnonzero(run.crossed)
    assert run.t[k - 1] < when_singular() < run.t[k]
    assert run.outcome is nmm.Outcome.MISSED
    crossed_at = the(run, "extended_jacobian_crossed").values
    assert crossed_at["steps"] == [run.t[k - 1 : k + 1].tolist()]
    assert crossed_at["name"] in run.robot.u_names
    assert not crossed_at["J_too"]
    assert "shorter_dt" not in codes(run)
    assert run.residual.max() < 1e-8  # the task alone was done at every sample


def test_compiled_and_from_sample_to_sample_alike(monkeypatch: pytest.MonkeyPatch) -> None:
    flown = STOPPING.run()
    monkeypatch.setattr(closed_loop, "compiled_loop", lambda *_: None)
    stepped = STOPPING.run()
    np.testing.assert_array_equal(flown.crossed, stepped.crossed)
    assert flown.crossed.sum() == 1
    assert flown.outcome is stepped.outcome is nmm.Outcome.MISSED


def test_it_is_kept_and_marked_on_the_page(tmp_path: Path) -> None:
    run = STOPPING.run()
    loaded = nmm.Trajectory.load(run.save(tmp_path / "run", figures=False))
    np.testing.assert_array_equal(loaded.crossed, run.crossed)
    marked = [t for t, said in events(loaded, channels(loaded)) if "J_e was singular" in said]
    assert marked == [run.t[np.argmax(run.crossed)], run.t[-1]]  # and why it has not completed


@pytest.mark.parametrize("name", ["unicycle_2r_algorithmic", "unicycle_2r_extended_jacobian"])
def test_no_alarm_where_it_is_damped_or_regular(name: str) -> None:
    run = nmm.Scenario.load(name).run()
    assert run.outcome is nmm.Outcome.COMPLETED
    assert not run.crossed.any()
    assert "extended_jacobian_crossed" not in codes(run)


def test_the_side_is_the_determinants_sign(rng: np.random.Generator) -> None:
    controller = STOPPING.controller()
    sides = []
    for _ in range(50):
        step = controller.evaluate(3.0, rng.uniform(-3.0, 3.0, controller.robot.n))
        J, added, _ = controller.solver.derivatives
        assert step.side == np.sign(np.linalg.det(np.vstack([J, added])))
        sides.append(step.side)
    assert {*sides} == {-1, 1}


def test_what_is_no_crossing() -> None:
    """A sample at which J_e was not inverted says nothing; a crossing without a jump is told as that."""
    np.testing.assert_array_equal(crossed(np.array([1, 1, 0, -1, -1, 1])), [0, 0, 0, 0, 0, 1])
    t, u = np.linspace(0.0, 1.0, 11), np.ones((11, 2))
    side = np.where(t < 0.45, 1, -1)
    J = np.tile([[1.0, 0.0], [0.0, 0.5]], (11, 1, 1))
    found = crossings(t, u, side, J, ["v", "q1"], ["m/s", "rad/s"])
    assert found is not None
    assert found.values == {"steps": [pytest.approx([0.4, 0.5])], "more": 0}
    u[5:, 0] = -1.0
    found = crossings(t, u, side, J, ["v", "q1"], ["m/s", "rad/s"])
    assert found is not None
    assert [found.values[key] for key in ("name", "before", "after", "unit")] == ["v", 1.0, -1.0, "m/s"]
    assert crossings(t, u, np.ones(11, dtype=int), J, ["v", "q1"], ["m/s", "rad/s"]) is None
    assert not found.values["J_too"]
    J[5:, 1, 1] = -0.5  # singular half-way between two samples at which it is far from that
    found = crossings(t, u, side, J, ["v", "q1"], ["m/s", "rad/s"])
    assert found is not None
    assert found.values["J_too"]
