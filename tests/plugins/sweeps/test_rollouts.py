"""Rollouts: many runs at once are the runs one by one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from findings import refused
from scipy.integrate import solve_ivp

import nmm
from nmm.base import machine
from nmm.model.robots.zero_order_hold import HeldInputs
from nmm.plugins.sweeps import kept
from nmm.plugins.sweeps.kept import least_singular_value

START = np.array([0.0, 0.0, 0.0, 0.5, 0.5])


def controller(gain: float = 1.0, **more: object) -> nmm.Controller:
    robot = nmm.load("unicycle_2r")
    task = nmm.Task(nmm.Position("ee", "xy"), nmm.Circle([2.0, 0.0], 0.5, 10.0), gain=gain)
    return nmm.Controller(robot, task, nmm.ProjectedGradient(), **more)


def starts(count: int) -> np.ndarray:
    return START + 0.1 * np.random.default_rng(3).standard_normal((count, 5))


@pytest.mark.parametrize(("name", "method"), [("unicycle_2r_switching", "rk4"), ("tiago_tray", "zoh")])
def test_each_run_is_simulates_to_the_bit(name: str, method: str) -> None:
    scenario = nmm.Scenario.load(name, {"method": method, "duration": 2.0, "dt": 0.02})
    robot, parts = scenario.robot(), scenario.parts
    q0 = robot.q(parts.q0) + 0.01 * np.random.default_rng(0).standard_normal((5, robot.n))
    found = nmm.rollout(scenario, q0, keep=("q", "u", "error", "scale", "partition"), threads=2)
    for k, q in enumerate(q0):
        run = nmm.simulate(scenario.controller(), q, parts.duration, parts.dt, method)
        for quantity in ("q", "u", "error", "scale", "partition"):
            assert np.array_equal(found[quantity][k], getattr(run, quantity)), quantity
        summary = run.summary()
        for measure in ("t_end", "error_initial", "error_final", "error_rms", "error_max", "sigma_min"):
            assert found[measure][k] == pytest.approx(summary[measure], rel=1e-9, abs=1e-12), measure
        for measure in ("objective_final", "objective_integral", "residual_max", "scale_min"):
            assert found[measure][k] == pytest.approx(summary[measure], rel=1e-9, abs=1e-12), measure
        for measure in ("partition_switches", "input_rms", "input_peak"):
            assert found[measure][k] == pytest.approx(summary[measure], rel=1e-9, abs=1e-12), measure


@pytest.mark.parametrize("shape", [(2, 4), (6, 10), (3, 2), (1, 3)])
def test_the_least_singular_value_is_that_of_all_samples(shape: tuple[int, int]) -> None:
    """Of matrices that wander, stand still, and jump; LAPACK decomposes each."""
    rng = np.random.default_rng(5)
    walk = np.cumsum(0.02 * rng.standard_normal((700, *shape)), axis=0) + rng.standard_normal(shape)
    jumps = np.where(np.arange(700)[:, None, None] % 101 == 50, 0.3 * walk, walk)
    for J in (walk, np.repeat(walk[:1], 300, axis=0), jumps):
        expected = np.linalg.svd(J, compute_uv=False)[:, -1]
        for count in (1, 2, 65, len(J)):
            found = least_singular_value(np.ascontiguousarray(J), count)
            assert found == pytest.approx(expected[:count].min(), rel=1e-12, abs=1e-14)


def test_threads_change_no_bit() -> None:
    q0 = starts(24)
    one, several = (nmm.rollout(controller(), q0, 3.0, 0.01, keep=("q",), threads=n) for n in (1, 5))
    assert np.array_equal(one["q"], several["q"])
    assert all(np.array_equal(one[name], several[name]) for name in one.measures)


def test_a_rollout_is_the_flow_of_the_closed_loop() -> None:
    """DOP853 on u = controller(t, q), q_dot = S u: an integrator and a loop that are not ours."""
    found = nmm.rollout(controller(), START, 3.0, 0.005, keep=("q",))
    ours = controller()
    flow = solve_ivp(ours.velocity, (0.0, 3.0), START, "DOP853", [3.0], rtol=1e-11, atol=1e-11)
    np.testing.assert_allclose(found["q"][0, -1], flow.y[:, -1], atol=1e-8)


def test_each_controller_has_its_own_gain() -> None:
    gains = [0.5, 1.0, 2.0]
    found = nmm.rollout([controller(gain) for gain in gains], START, 2.0, 0.002, keep=("error",))
    for k, gain in enumerate(gains):
        norm = np.linalg.norm(found["error"][k], axis=1)
        np.testing.assert_allclose(norm, norm[0] * np.exp(-gain * found.t), rtol=1e-6)


def test_noise_delay_and_slip_are_what_they_say() -> None:
    """The same loop, written in Python."""
    noise, delay, slip = np.array([0.01, 0.01, 0.02, 0.005, 0.0]), 3, np.array([0.9, 1.0, 1.0, 0.8])
    found = nmm.rollout(
        controller(),
        starts(3),
        1.0,
        0.02,
        "zoh",
        disturbances=nmm.Disturbances(noise=noise, delay=delay, slip=slip, seed=7),
        keep=("q", "u"),
    )
    for k, start in enumerate(starts(3)):
        ours = controller()
        drawn = noise * np.random.default_rng([7, k]).standard_normal((51, 5))
        held, q, u = HeldInputs(ours.robot), start, []
        for i in range(51):
            np.testing.assert_allclose(found["q"][k, i], q, atol=1e-12)
            u.append(ours(0.02 * i, q + drawn[i]))
            q = held(q, slip * u[i - delay] if i >= delay else np.zeros(4), 0.02)
        np.testing.assert_allclose(found["u"][k], u, atol=1e-9)


def test_odometry_is_what_wheels_say() -> None:
    """Sample by sample: the controller sees what its inputs would have done, the robot has other wheels and
    slides; every 0.3 s both are the same."""
    slip, creep, every = np.array([0.98, 0.97, 1.0, 0.9]), -0.05, 15
    disturbed = nmm.Disturbances(slip=slip, creep=creep, odometry=True, correct=0.3, delay=2)
    keep = ("q", "u", "believed", "error")
    found = nmm.rollout(controller(), starts(2), 1.0, 0.02, "zoh", disturbances=disturbed, keep=keep)
    ours = controller()
    held = HeldInputs(ours.robot)
    for q, believed, u in zip(found["q"], found["believed"], found["u"], strict=True):
        assert np.array_equal(q[0], believed[0])
        for i in range(50):
            np.testing.assert_allclose(u[i], ours(0.02 * i, believed[i]), rtol=0.0, atol=1e-12)
            turned = u[i - 2] if i >= 2 else np.zeros(4)
            ahead = held(q[i], slip * turned, 0.02)
            v, omega = slip[:2] * turned[:2]
            middle = q[i, 2] + 0.01 * omega
            forwards = np.array([np.cos(middle), np.sin(middle)])
            along = forwards @ (ahead - q[i])[:2]  # the arc's chord
            assert along == pytest.approx(0.02 * v * np.sinc(0.01 * omega / np.pi), rel=1e-6, abs=1e-12)
            ahead[:2] += creep * along * omega * np.array([-forwards[1], forwards[0]])
            np.testing.assert_allclose(q[i + 1], ahead, rtol=0.0, atol=1e-13)
            right = (i + 1) % every == 0
            seen = q[i + 1] if right else np.append(held(believed[i], turned, 0.02)[:3], ahead[3:])
            np.testing.assert_allclose(believed[i + 1], seen, rtol=0.0, atol=1e-13)
    away = found["believed"][:, -1] - found["q"][:, -1]
    assert np.array_equal(found["drift"], np.hypot(*away[:, :2].T))
    assert found["drift"].min() > 1e-4
    robot = nmm.load("unicycle_2r")
    tip = nmm.Configuration(robot, found["q"][1, -1]).placement("ee").translation[:2]
    target = nmm.rollout(controller(), starts(2), 1.0, 0.02, "zoh", keep=("r_d",))["r_d"][1, -1]
    np.testing.assert_allclose(found["error"][1, -1], target - tip, atol=1e-12)


def test_odometry_of_wheels_that_do_not_slip_is_the_robots_own_place() -> None:
    """To the last bit, and the run is the one without it."""
    still = nmm.rollout(controller(), starts(2), 1.0, 0.02, "zoh", keep=("q", "u", "believed"))
    known = nmm.Disturbances(odometry=True)
    same = nmm.rollout(
        controller(), starts(2), 1.0, 0.02, "zoh", disturbances=known, keep=("q", "u", "believed")
    )
    for name in ("q", "u", "believed"):
        assert np.array_equal(still[name], same[name])
    assert np.array_equal(same["believed"], same["q"])
    assert np.array_equal(same["drift"], [0.0, 0.0])
    assert np.array_equal(still["drift"], [0.0, 0.0])


def test_errors_under_noise_are_the_robots_not_what_was_measured() -> None:
    found = nmm.rollout(
        controller(), START, 1.0, 0.02, "zoh", disturbances=nmm.Disturbances(0.05), keep=("q", "error", "r_d")
    )
    robot = nmm.load("unicycle_2r")
    for q, error, target in zip(found["q"][0], found["error"][0], found["r_d"][0], strict=True):
        position = nmm.Configuration(robot, q).placement("ee").translation[:2]
        np.testing.assert_allclose(error, target - position, atol=1e-12)


def test_no_disturbance_is_no_other_run() -> None:
    none, least = nmm.Disturbances(), nmm.Disturbances(slip=1.0 - 1e-15)
    given = controller(), starts(2), 1.0, 0.02, "zoh"
    still = nmm.rollout(*given, keep=("q",))
    same = nmm.rollout(*given, disturbances=none, keep=("q",))
    assert np.array_equal(still["q"], same["q"])
    slow = nmm.rollout(*given, disturbances=least, keep=("q",))
    np.testing.assert_allclose(still["q"], slow["q"], atol=1e-12)


def test_every_other_sample_and_files_hold_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = nmm.rollout(controller(), starts(7), 1.0, 0.02, keep=("q", "partition"))
    some = nmm.rollout(controller(), starts(7), 1.0, 0.02, keep=("q",), every=5)
    assert np.array_equal(some["q"], whole["q"][:, ::5])
    assert np.array_equal(some.t, whole.t[::5])
    monkeypatch.setattr(kept, "PART", 3 * whole["q"][0].nbytes)
    filed = nmm.rollout(controller(), starts(7), 1.0, 0.02, keep=("q",), folder=tmp_path / "runs")
    assert filed.kept == {}
    parts = [np.load(file) for file in filed.files]
    assert [int(part["first"]) for part in parts] == [0, 3, 6]
    assert np.array_equal(np.concatenate([part["q"] for part in parts]), whole["q"])
    assert all(np.array_equal(filed[name], whole[name]) for name in whole.measures)


def test_how_runs_end_is_told_run_by_run() -> None:
    """By Euler's rule an error is multiplied by 1 - 4 a step; nothing of a planar robot moves the height."""
    found = nmm.rollout(controller(), starts(2), 400.0, 4.0, "euler", keep=("q",))
    assert found.outcome == ("diverged", "diverged")
    for k, count in enumerate(found.samples):
        assert "diverged" in found.message[k]
        assert 5 < count < 40
        assert np.all(np.isnan(found["q"][k, count:]))
        assert np.all(np.isfinite(found["q"][k, :count]))
        assert found["t_end"][k] == found.t[count - 1]
    task = nmm.Task(nmm.Position("ee", "xyz"), [2.0, 0.5, 0.0], gain=1.0)
    stuck = nmm.Controller(nmm.load("unicycle_2r"), task, nmm.ProjectedGradient())
    for method, more in (("rk4", {}), ("zoh", {"disturbances": nmm.Disturbances(delay=1)})):
        found = nmm.rollout(stuck, starts(2), 1.0, 0.01, method, keep=("q",), **more)
        assert found.outcome == ("singular", "singular")
        assert "lost rank" in found.message[1]
        assert found.samples.tolist() == [0, 0]
        assert np.all(np.isnan(found["error_rms"]))


def test_a_goal_is_reached_or_missed() -> None:
    robot = nmm.load("unicycle_2r")
    task = nmm.Task(nmm.Position("ee", "xy"), [2.0, 0.5], gain=1.0)
    ours = nmm.Controller(robot, task, nmm.ProjectedGradient())
    near, far = START, START - np.array([40.0, 0.0, 0.0, 0.0, 0.0])
    found = nmm.rollout(ours, [near, far], 6.0, 0.01, until=nmm.Goal(m=0.01))
    assert found.outcome == ("reached", "missed")
    assert found["t_end"][0] < 6.0
    assert found["error_final"][0] <= 0.01 < found["error_final"][1]


def test_the_same_controller_may_stand_there_twice() -> None:
    ours = controller()
    found = nmm.rollout([ours, ours], starts(2), 0.5, 0.01, keep=("q",), threads=2)
    assert np.array_equal(found["q"], nmm.rollout(ours, starts(2), 0.5, 0.01, keep=("q",))["q"])


@pytest.mark.parametrize(
    ("given", "where"),
    [
        ({"q0": np.zeros((0, 5))}, "q0"),
        ({"q0": np.zeros((3, 4))}, "q0"),
        ({"q0": np.full((2, 5), np.nan)}, "run 0"),
        ({"duration": -1.0}, "duration"),
        ({"dt": 1e-10}, "dt"),
        ({"method": "rk5"}, ""),
        ({"keep": ("speed",)}, "rollout"),
        ({"every": 0}, "every"),
        ({"folder": "nowhere"}, "folder"),
        ({"threads": -1}, "threads"),
        ({"disturbances": nmm.Disturbances(0.1)}, "method"),
        ({"disturbances": nmm.Disturbances(slip=[1.0, 2.0]), "method": "zoh"}, "slip"),
        ({"disturbances": nmm.Disturbances(slip={"w": 0.5}), "method": "zoh"}, "slip"),
        ({"disturbances": nmm.Disturbances(odometry=True)}, "method"),
    ],
)
def test_bad_input_is_named(given: dict[str, object], where: str) -> None:
    with pytest.raises(nmm.InputError) as caught:
        nmm.rollout(controller(), **({"q0": START, "duration": 1.0} | given))
    assert caught.value.where.split(": ")[0] == where


def test_slip_and_delay_are_the_same_in_a_loop_in_python() -> None:
    """A goal that is never reached keeps a run there."""
    given = {
        "method": "zoh",
        "disturbances": nmm.Disturbances(slip=[0.9, 1.0, 1.0, 0.8], delay=3),
        "keep": ("q", "u", "error"),
    }
    compiled = nmm.rollout(controller(), starts(2), 1.0, 0.02, **given)
    python = nmm.rollout(controller(), starts(2), 1.0, 0.02, until=nmm.Goal(1e-12, 1e-12), **given)
    assert python.outcome == ("missed", "missed")
    for name in given["keep"]:
        np.testing.assert_allclose(python[name], compiled[name], atol=1e-12)


def test_a_scenario_that_is_a_plan_has_one_start() -> None:
    with pytest.raises(nmm.InputError, match="track"):
        nmm.rollout(nmm.Scenario.load("behind_the_wall"), starts(2))


def test_what_does_not_fit_in_memory_is_asked_before(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(machine, "free_memory", lambda: 1.8e6)
    with pytest.raises(nmm.InputError, match=r"GB are free; keep less, every so many samples"):
        nmm.rollout(controller(), starts(40), 1.0, 0.001, keep=("q",))
    assert len(nmm.rollout(controller(), starts(2), 0.1, 0.01)) == 2  # measures alone need none


def test_tasks_that_come_and_go_are_those_of_simulate_to_the_bit() -> None:
    """Each row while its task is active, not a number else."""
    scenario = nmm.Scenario.load("unicycle_3r_sequence", {"duration": 6.0})
    run = scenario.run()
    kept = ("q", "u", "r", "error", "scale")
    found = nmm.rollout(scenario, [scenario.parts.q0] * 2, keep=kept, threads=2)
    for name in kept:
        for one in range(2):
            np.testing.assert_array_equal(found[name][one, : len(run)], run[name], err_msg=name)
    np.testing.assert_allclose(found["sigma_min"], run.sigma_min.min(), rtol=1e-9)
    np.testing.assert_allclose(found["error_final"], run.error_norm[-1], rtol=1e-12)
    assert found.samples.tolist() == [len(run)] * 2


def test_controllers_that_do_not_fit_together_are_refused() -> None:
    other = nmm.Controller(
        nmm.load("unicycle_3r"),
        nmm.Task(nmm.Position("ee", "xy"), [2.0, 0.0], gain=1.0),
        nmm.ProjectedGradient(),
    )
    for given, where in (([], "rollout"), ([controller(), other], "rollout: controller 1")):
        with refused(where):
            nmm.rollout(given, START, 1.0)
