"""Disturbances: what a robot does otherwise than it is told, in runs, scenarios and files."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
import yaml

import nmm
from nmm.plugins.sweeps.rows import rows_of
from nmm.views.playback.channels import channels

#: The paper's first case on worn wheels (its shares were measured in a physics engine, docs/sweeps.md).
CASE = "unicycle_2r_position"
WORN = {"odometry": True, "slip": {"v": 0.9988, "omega": 0.9985}}


@cache
def run(correct: float | None = None, creep: float = 0.0) -> nmm.Trajectory:
    return scenario({**WORN, "correct": correct, "creep": creep}).run()


def scenario(disturbances: dict[str, object], **more: object) -> nmm.Scenario:
    return nmm.Scenario.load(CASE, {"method": "zoh", "disturbances": disturbances, **more})


def test_a_run_is_its_rollout_to_the_last_bit(tmp_path: Path) -> None:
    given = {**WORN, "creep": -0.01, "noise": 1e-3, "delay": 2, "correct": 0.4, "seed": 3}
    of_file = scenario(given, duration=1.5)
    found = of_file.run()
    rolled = nmm.rollout(of_file, keep=("q", "u", "error", "believed"))
    for name in ("q", "u", "error", "believed"):
        assert np.array_equal(found[name], rolled[name][0]), name
    assert found["drift"][-1] == rolled["drift"][0] > 0.0
    parts = of_file.parts
    by_hand = nmm.Disturbances(**{**given, "slip": [0.9988, 0.9985, 1.0, 1.0]})
    same = nmm.simulate(of_file.controller(), parts.q0, 1.5, parts.dt, "zoh", disturbances=by_hand)
    assert np.array_equal(found.q, same.q)
    path = tmp_path / "resolved.yaml"
    path.write_text(yaml.safe_dump(of_file.resolved()), "utf-8")
    again = nmm.Scenario.load(path).run()
    assert np.array_equal(found.q, again.q)


def test_odometry_that_is_right_is_the_run_without_it() -> None:
    """To the last bit."""
    plain = nmm.Scenario.load(CASE, {"method": "zoh", "duration": 2.0}).run()
    known = scenario({"odometry": True}, duration=2.0).run()
    for name in ("q", "u", "q_dot", "error", "sigma_min", "residual", "objective", "path"):
        assert np.array_equal(plain[name], known[name]), name
    assert np.array_equal(known.believed, plain.q)
    assert plain.believed is None
    assert "drift" not in plain.summary()
    assert known.summary()["drift"] == 0.0


def test_worn_wheels_lead_a_robot_astray_and_a_localisation_puts_it_right() -> None:
    assert 0.030 < run().summary()["drift"] < 0.032
    assert run().outcome == "completed"
    right = run(correct=1.0)
    assert right.summary()["drift"] == 0.0  # it ends when it was put right
    assert 0.0 < right.summary()["drift_max"] < 0.005
    half = len(right) // 2
    assert right.error_norm[half:].max() < 0.2 * run().error_norm[half:].max()


def test_what_is_believed_is_in_the_folder_of_a_run(tmp_path: Path) -> None:
    folder = run(1.0).save(tmp_path / "run", figures=False, html=False)
    read = nmm.Trajectory.load(folder)
    assert np.array_equal(read.believed, run(1.0).believed)
    assert np.array_equal(read["drift"], run(1.0)["drift"])


def test_page_and_figure_show_where_odometry_has_it() -> None:
    found = run(1.0)
    assert np.array_equal(found.motion().believed, found.believed)
    drift = {one.panel: one.values for one in channels(found).channels}["drift"]
    assert drift.max() == found["drift"].max()
    line = {one.get_label(): one for one in nmm.figures.stroboscopic(found).axes[0].get_lines()}
    believed = line["where it is believed to be"].get_xydata()
    tip = nmm.Configuration(found.robot, found.believed[-1]).placement("ee").translation[:2]
    np.testing.assert_allclose(believed[-1], tip, atol=1e-12)


def test_rows_of_a_sweep_have_the_drift_of_their_runs() -> None:
    varied = {"disturbances.slip.v": (0.9, 1.0, 2), "disturbances.creep": [0.0, -0.05]}
    few = scenario({"odometry": True}, duration=1.0)
    rows = rows_of(nmm.Sweep(few, varied).definition, range(4))
    for row in rows:
        keys = {key: row[key] for key in varied}
        assert row["drift"] == few.with_settings(keys).run().summary()["drift"], keys
    assert [row["drift"] > 0.0 for row in rows].count(False) == 1  # with its wheels whole, and no creep


@pytest.mark.parametrize(
    ("keys", "where"),
    [
        ({"disturbances.slip": {"w": 0.9}}, "disturbances.slip"),
        ({"disturbances.noise": -1.0}, "disturbances.noise"),
        ({"disturbances.delay": 1.5}, "disturbances.delay"),
        ({"disturbances.correct": 0}, "disturbances.correct"),
        ({"disturbances.odometry": False, "disturbances.correct": 1.0}, "disturbances.correct"),
        ({"method": "rk4"}, "method"),
    ],
)
def test_what_cannot_be_is_refused_at_its_key(keys: dict[str, object], where: str) -> None:
    with pytest.raises(nmm.InputError) as found:
        scenario(WORN, duration=0.1).with_settings(keys).run()
    assert where in found.value.where


@pytest.mark.parametrize(
    "given", [{"noise": np.nan}, {"slip": "a"}, {"creep": np.inf}, {"seed": -1}, {"slip": {"v": np.nan}}]
)
def test_what_is_no_disturbance_is_named(given: dict[str, object]) -> None:
    with pytest.raises(nmm.InputError) as found:
        nmm.Disturbances(**given)
    assert found.value.where.split(": ")[0] == next(iter(given))


def test_an_arm_that_stands_has_no_odometry() -> None:
    with pytest.raises(nmm.InputError) as found:
        nmm.Disturbances(odometry=True).on(nmm.load("small_arm", platform="fixed"), 0.01)
    assert "odometry" in found.value.where


def test_tasks_that_begin_and_end_are_told_by_what_odometry_believes() -> None:
    robot = nmm.load("unicycle_2r")
    reach = nmm.Task(nmm.Position("ee", "xy"), [1.4, 0.5], name="reach")
    inside = nmm.While(nmm.LinearCoordinates("x"), lower=0.1)
    aim = nmm.Task(nmm.Posture("q1"), [0.5], name="aim", priority=2, when=inside)
    controller = nmm.SequencedController(robot, [reach, aim], nmm.ProjectedGradient())
    worn = nmm.Disturbances(slip={"v": 0.8}, odometry=True)
    run = nmm.simulate(controller, {"q2": 0.5}, 2.0, 0.01, "zoh", disturbances=worn)
    begins = int(np.searchsorted(run.t, run.events[0].t))
    assert run.believed.shape == run.q.shape
    assert run.believed[begins - 1, 0] < 0.1 <= run.believed[begins, 0]
    assert run.q[begins, 0] < 0.095
    kept = nmm.rollout(
        *(controller, {"q2": 0.5}, 2.0, 0.01, "zoh"), disturbances=worn, keep=("q", "believed", "error")
    )
    for name in ("q", "believed", "error"):
        np.testing.assert_array_equal(kept[name][0], run[name])
