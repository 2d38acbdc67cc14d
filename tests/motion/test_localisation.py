"""`nmm.Localisation`: a pose filter in a simulation, with what it believes beside what is true."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import nmm
from nmm.base.errors import InputError
from nmm.cli.app import app
from nmm.plugins.sweeps.rows import rows_of

CASE = "unicycle_2r_position"
WORN: dict[str, Any] = {"slip": {"v": 0.95, "omega": 0.97}, "creep": -0.02, "seed": 3}
SEEN: dict[str, Any] = {"every": 0.3, "late": 0.1, "deviation": [0.01, 0.01, 0.01]}


def scenario(localisation: dict[str, Any], **more: Any) -> nmm.Scenario:
    disturbances = {**WORN, "localisation": {**SEEN, **localisation}}
    return nmm.Scenario.load(CASE, {"method": "zoh", "duration": 6.0, "disturbances": disturbances, **more})


@cache
def run(**localisation: Any) -> nmm.Trajectory:
    return scenario(localisation).run()


def test_fixes_keep_a_robot_where_odometry_alone_is_lost() -> None:
    lost = {"method": "zoh", "duration": 6.0, "disturbances": {**WORN, "odometry": True}}
    by_odometry = nmm.Scenario.load(CASE, lost).run()
    drift = {name: motion["drift"] for name, motion in (("odometry", by_odometry), ("filter", run()))}
    assert drift["odometry"][-1] > 0.2
    assert drift["filter"][300:].max() < 0.06
    assert run().summary()["drift"] == drift["filter"][-1]


@pytest.mark.parametrize(("order", "off"), [(1, 1e-7), (2, 1e-5)])
def test_without_noise_and_slip_the_run_is_that_of_odometry(order: int, off: float) -> None:
    """Nothing is left to learn: fixes say what is believed already. At order 2 inputs change within a sample,
    which takes them for constant: off by dt³/12 (v ω' - ω v'), 1e-7 m, in each of 60 until a fix."""
    exact = {"every": 0.3, "deviation": [1e-9, 1e-9, 1e-9], "spread": 0.0}
    keys = {"method": "zoh", "duration": 1.0, "order": order}
    simulated = nmm.Scenario.load(CASE, {**keys, "disturbances": {"localisation": exact}}).run()
    plain = nmm.Scenario.load(CASE, keys).run()
    np.testing.assert_allclose(simulated.q, plain.q, rtol=0, atol=off)
    np.testing.assert_allclose(simulated.believed, plain.q, rtol=0, atol=off)


def test_what_is_believed_is_what_a_filter_says_of_the_same_sensors() -> None:
    """Written anew: counts of the inputs as they were recorded, fixes of where the robot was, as they came;
    noise from the same generator."""
    simulated = run(gyro_noise=0.01, bias=0.02)
    dt, every, late = simulated.dt, round(0.3 / simulated.dt), round(0.1 / simulated.dt)
    robot, rng = simulated.robot, np.random.default_rng((3, 0, 1))
    rng.standard_normal(3)
    q1, q2 = simulated.q[0, 3:]
    pose_filter = nmm.PoseFilter(
        robot, simulated.q[0], {"v": 0.0, "omega": 0.0, "q1": q1, "q2": q2}, 0.0,
        covariance=1e-12 * np.eye(3), spread=1e-4, slip_noise=(0.02, 0.02, 0.02), gyro_noise=0.01,
        bias_deviation=0.02, delay=1.0,
    )  # fmt: skip
    fixes = {}
    for k in range(1, len(simulated)):
        by = dt * simulated.u[k - 1, :2]
        counts = by + np.sqrt(1e-4 * np.abs(by)) * rng.standard_normal(2)
        turned = simulated.q[k, 2] - simulated.q[k - 1, 2]
        rate = turned / dt + 0.02 + 0.01 / np.sqrt(dt) * rng.standard_normal()
        pose_filter.step(dt * k, counts, yaw_rate=rate)
        if k % every == 0:
            fixes[k + late] = dt * k, simulated.q[k, :3] + 0.01 * rng.standard_normal(3)
        if k in fixes:
            t, pose = fixes.pop(k)
            assert pose_filter.fix(pose, 1e-4 * np.eye(3), t) == "used"
        np.testing.assert_allclose(simulated.believed[k, :3], pose_filter.pose, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(simulated.believed[:, 3:], simulated.q[:, 3:])
    assert np.abs(simulated.believed - simulated.q).max() > 0.01


def test_a_run_is_its_rollout_its_row_and_its_file(tmp_path: Path) -> None:
    of_file = scenario({"start": [0.05, 0.05, 0.05]}, duration=1.5)
    simulated = of_file.run()
    assert np.linalg.norm(simulated.believed[0] - simulated.q[0]) > 0.01
    rolled = nmm.rollout(of_file, keep=("q", "believed"))
    for name in ("q", "believed"):
        assert np.array_equal(simulated[name], rolled[name][0]), name
    assert simulated["drift"][-1] == rolled["drift"][0]
    path = tmp_path / "resolved.yaml"
    path.write_text(yaml.safe_dump(of_file.resolved()), "utf-8")
    assert np.array_equal(nmm.Scenario.load(path).run().q, simulated.q)
    varied = {"disturbances.localisation.every": [0.3, 1.0]}
    rows = [*rows_of(nmm.Sweep(of_file, varied).definition, range(2))]
    assert rows[0]["drift"] == simulated["drift"][-1]
    assert rows[1]["drift"] != rows[0]["drift"]


def test_a_run_of_tasks_that_come_and_go_and_steps_of_a_plant_are_the_same() -> None:
    """Legs hand the filter on; `Controller.step` drives it from sample to sample."""
    of_file = scenario({}, duration=1.5)
    parts, controller, q = of_file.parts, of_file.controller(), of_file.parts.q0
    q = controller.robot.q(q)
    plant = parts.disturbances.make().plant(controller.robot, parts.dt)
    simulated = of_file.run()
    for k in range(100):
        np.testing.assert_allclose(q, simulated.q[k], rtol=0, atol=1e-9)
        q, _ = controller.step(parts.dt * k, q, parts.dt, "zoh", plant=plant)
    hand = {"kind": "position", "frame": "ee", "axes": "xy", "reference": [2, 1], "gain": 3}
    joint = {
        "kind": "coordinates", "of": "q1", "reference": [0.8], "priority": 2, "name": "joint",
        "when": {"kind": "between", "start": 0.45, "end": 0.85},
    }  # fmt: skip
    legs = scenario({}, duration=1.5, task=[hand, joint], resolver={"kind": "pg"}).run()
    assert len(legs.events) == 2
    assert legs["drift"][-1] < 0.03
    steps = np.diff(legs.believed[:, :2] - legs.q[:, :2], axis=0)
    for event in legs.events:  # what is believed goes on
        k = int(np.searchsorted(legs.t, event.t))
        assert np.linalg.norm(steps[k - 1 : k + 1], axis=1).max() < 0.01


@pytest.mark.parametrize("name", ["car_base", "trailer_base", "omni_base", "unicycle_2r"])
def test_every_platform_knows_where_it_is(name: str) -> None:
    """Its own joints are measured; 4 m of way with wheels that slip by 5 %."""
    robot = nmm.load(name, platform="differential") if name == "unicycle_2r" else nmm.load(name)
    arm = name == "unicycle_2r"
    start = robot.q({"q1": 0.3, "q2": 0.9}) if arm else robot.rest
    task = nmm.Task(nmm.Position("ee" if arm else robot.frames[-1], "xy"), [4.0, 0.5], gain=1.0, speed=1.0)
    controller = nmm.Controller(robot, task, nmm.DampedLeastSquares(alpha=1), dt=0.01)
    seen = nmm.Localisation(every=0.2, late=0.05, deviation=[0.01, 0.01], gyro_noise=0.001)
    worn = nmm.Disturbances(slip=0.95, localisation=seen)
    simulated = nmm.simulate(controller, start, 8.0, 0.01, "zoh", disturbances=worn)
    lost = nmm.Disturbances(slip=0.95, odometry=True)
    by_odometry = nmm.simulate(controller, start, 8.0, 0.01, "zoh", disturbances=lost)
    assert simulated["drift"][100:].max() < 0.05 < by_odometry["drift"][-1]


def test_figures_and_a_comparison_show_what_is_believed_and_what_is_true(tmp_path: Path) -> None:
    simulated = run()
    line = {line.get_label(): line for line in nmm.figures.stroboscopic(simulated).axes[0].get_lines()}
    believed = line["where it is believed to be"].get_xydata()
    true = line["path of ee"].get_xydata()
    assert believed.shape == true.shape
    assert 0.01 < np.linalg.norm(believed - true, axis=1).max() < 0.2
    figure = nmm.figures.comparison([simulated, run(every=1.0)])
    named = {line.get_label(): line for axes in figure.axes for line in axes.get_lines()}
    believed = [line for name, line in named.items() if str(name).endswith(": where it is believed to be")]
    assert len(believed) == 2
    np.testing.assert_allclose(believed[0].get_xydata(), simulated.believed[:, :2])
    file = tmp_path / "seen.yaml"
    file.write_text(yaml.safe_dump(scenario({}, duration=1.5).resolved()), "utf-8")
    out = tmp_path / "both"
    with pytest.raises(SystemExit) as ended:
        app(["compare", str(file), "--resolvers", "rg,pg", "--out", str(out)])
    assert not ended.value.code
    summary = json.loads((out / "summary.json").read_text("utf-8"))
    for name, numbers in summary["runs"].items():
        again = nmm.Trajectory.load(out / name)
        assert numbers["drift_max"] == pytest.approx(again["drift"].max())
    table = nmm.comparison_table([simulated, run(every=1.0)])
    rows = {quantity.key: quantity.values for quantity in table.quantities}
    assert rows["drift_max"] == (simulated["drift"].max(), run(every=1.0)["drift"].max())


def test_bad_input_is_named() -> None:
    arm, still = nmm.load("unicycle_2r", platform="fixed"), nmm.Disturbances(localisation=nmm.Localisation())
    cases: list[tuple[Any, str]] = [
        (lambda: nmm.Localisation(every=0.0), "every"),
        (lambda: nmm.Localisation(late=-0.1), "late"),
        (lambda: nmm.Localisation(deviation=[0.1]), "deviation"),
        (lambda: nmm.Localisation(deviation=[0.1, 0.0]), "deviation"),
        (lambda: nmm.Localisation(slip_noise=[0.1, 0.0]), "slip_noise"),
        (lambda: nmm.Localisation(bias=0.1), "bias"),
        (lambda: nmm.Disturbances(odometry=True, correct=1.0, localisation=nmm.Localisation()), "correct"),
        (lambda: scenario({"evry": 1.0}), "evry"),
        (lambda: scenario({"every": -1.0}), "every"),
        (lambda: still.on(arm, 0.01), "localisation: unicycle_2r"),
    ]
    for call, name in cases:
        with pytest.raises(InputError) as caught:
            call()
        assert name in str(caught.value)
        assert len(str(caught.value)) <= 300
