"""Runs in compiled code are those that Python takes from sample to sample."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import fields

import numpy as np
import pytest
from findings import codes

import nmm
from nmm.control.step.step_size import StepSize
from nmm.motion import closed_loop
from nmm.motion.compiled_loop import CompiledLoop

#: What a run promises to the last digits; a run of other quantities would not be the same run.
QUANTITIES = ("t", "q", "u", "q_dot", "r", "r_d", "error", "objective", "residual", "scale", "partition")


@pytest.fixture
def flights(monkeypatch: pytest.MonkeyPatch) -> list[tuple[int, int, bool]]:
    """What compiled code was asked for and did: first sample, sample reached, whether to the end."""
    seen: list[tuple[int, int, bool]] = []
    fly = CompiledLoop.__call__

    def watched(
        self: CompiledLoop, times: np.ndarray, first: int, last: int, found: object
    ) -> tuple[int, bool]:
        reached, whole = fly(self, times, first, last, found)
        seen.append((first, reached, whole))
        return reached, whole

    monkeypatch.setattr(CompiledLoop, "__call__", watched)
    return seen


def both(run: Callable[[], nmm.Trajectory]) -> tuple[nmm.Trajectory, nmm.Trajectory]:
    """The run in compiled code, and from sample to sample."""
    flown = run()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(closed_loop, "compiled_loop", lambda *_: None)
        stepped = run()
    return flown, stepped


def same(flown: nmm.Trajectory, stepped: nmm.Trajectory, tolerance: float = 1e-12) -> None:
    assert len(flown) == len(stepped)
    for name in QUANTITIES:
        one, other = getattr(flown, name), getattr(stepped, name)
        np.testing.assert_allclose(one, other, rtol=tolerance, atol=tolerance, err_msg=name)
    assert (flown.outcome, flown.message) == (stepped.outcome, stepped.message)
    assert flown.warnings == stepped.warnings


@pytest.mark.parametrize(
    ("name", "method"),
    [
        *(("unicycle_2r_position", name) for name in ("midpoint", "euler", "zoh_midpoint")),
        *(("unicycle_2r_switching", name) for name in ("rk4", "zoh")),
        ("tiago_tray", "zoh"),
        ("kinova_car", "rk4"),
        ("kinova_car", "zoh_midpoint"),
        ("panda_mecanum_pose", "rk4"),
    ],
)
def test_a_scenario_runs_as_it_does_from_sample_to_sample(
    name: str, method: str, flights: list[tuple[int, int, bool]]
) -> None:
    """Position, a partition that changes and steps taken again, levels and limits, a car, a pose."""
    scenario = nmm.Scenario.load(name, {"method": method, "duration": 3.0, "dt": 0.02})
    flown, stepped = both(scenario.run)
    assert sum(reached - first for first, reached, _ in flights) > 100
    same(flown, stepped)
    assert flown.kinematics_off < 1e-13
    assert flown.summary()["kinematics"] == "compiled"
    assert np.isnan(stepped.kinematics_off)
    assert stepped.summary()["kinematics"] == "pinocchio"


@pytest.mark.parametrize("method", ["rk4", "zoh"])
@pytest.mark.parametrize("resolver", ["pg", "rg", "dls"])
def test_legs_of_tasks_that_come_and_go_end_at_the_same_samples(
    resolver: str, method: str, flights: list[tuple[int, int, bool]]
) -> None:
    """To the last digit, with the same kinematics: rounding grows a thousandfold where a task begins."""
    scenario = nmm.Scenario.load("unicycle_3r_sequence", {"method": method, "dt": 0.02})
    run = scenario.with_resolver(resolver).run
    flown, make = run(), closed_loop.compiled_loop
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            closed_loop,
            "compiled_loop",
            lambda *given: make(*given) and (lambda t, k, last, found: (k, False)),
        )
        stepped = run()
    assert sum(reached - first for first, reached, _ in flights) > 0.5 * len(flown)
    same(flown, stepped, tolerance=0.0)
    assert flown.events == stepped.events
    assert len(flown.events) > 1


def test_steps_that_may_not_stand_are_taken_in_python(flights: list[tuple[int, int, bool]]) -> None:
    scenario = nmm.Scenario.load("unicycle_2r_switching")
    flown, stepped = both(scenario.run)
    assert flown.switches > 0
    assert any(not whole for _, _, whole in flights)
    same(flown, stepped)


def planar(**more: object) -> nmm.Controller:
    robot = nmm.load("unicycle_2r")
    task = nmm.Task(nmm.Position("ee", "xy"), [2.0, 0.5], gain=1.0)
    return nmm.Controller(robot, task, nmm.ProjectedGradient(), **more)


def test_a_goal_ends_the_run_at_the_same_sample() -> None:
    controller = planar()
    flown, stepped = both(
        lambda: nmm.simulate(controller, {"q1": 0.5, "q2": 0.5}, 20.0, 0.01, until=nmm.Goal(m=0.01))
    )
    assert len(flown) < 1500
    same(flown, stepped)


def test_a_shorter_last_sample_counts_accelerations_from_the_one_before() -> None:
    limits = nmm.Limits(acceleration={"v": 0.3, "omega": 0.5, "q1": 1.0, "q2": 1.0})
    controller = planar(limits=limits, dt=0.01)
    flown, stepped = both(lambda: nmm.simulate(controller, {"q1": 0.5, "q2": 0.5}, 0.995, 0.01, "zoh"))
    assert flown.t[-1] - flown.t[-2] == pytest.approx(0.005)
    same(flown, stepped)
    assert np.abs(np.diff(flown.u[:, 0]))[-1] <= 0.3 * 0.005 + 1e-12


def test_a_singular_end_is_told_in_the_same_words() -> None:
    """Where the wall of a partition that may not change is met: a step is taken again, and again."""
    scenario = nmm.Scenario.load("unicycle_2r_switching", {"resolver.partitions": [["q1", "q2"]]})
    flown, stepped = both(scenario.run)
    same(flown, stepped)
    task = nmm.Task(nmm.Position("ee", "xyz"), [2.0, 0.5, 0.0], gain=1.0)
    controller = nmm.Controller(nmm.load("unicycle_2r"), task, nmm.ProjectedGradient())
    flown, stepped = both(lambda: nmm.simulate(controller, {"q1": 0.5, "q2": 0.5}, 1.0))
    assert flown.outcome is nmm.Outcome.SINGULAR
    assert flown.message == stepped.message


def test_a_motion_without_bound_is_told_in_the_same_words() -> None:
    controller = planar()
    flown, stepped = both(lambda: nmm.simulate(controller, {"q1": 0.5, "q2": 0.5}, 400.0, 4.0, "euler"))
    same(flown, stepped, 1e-9)


def test_limits_that_contradict_each_other_are_told_in_the_same_words() -> None:
    robot = nmm.load("unicycle_2r")
    height = nmm.Bound(nmm.Position("ee", "x"), upper=1.0, name="a wall")
    other = nmm.Bound(nmm.Position("ee", "x"), lower=1.4, name="another")
    task = nmm.Task(nmm.Position("ee", "xy"), [2.0, 0.5], gain=1.0)
    controller = nmm.Controller(
        robot, task, nmm.ProjectedGradient(), limits=nmm.Limits(bounds=[height, other]), dt=0.01
    )
    flown, stepped = both(lambda: nmm.simulate(controller, {"q1": 0.5, "q2": 0.5}, 1.0, 0.01, "zoh"))
    assert "limit_contradicted" in codes(flown)
    same(flown, stepped)


def test_what_needs_python_is_not_compiled() -> None:
    robot = nmm.load("unicycle_2r")
    told = nmm.CallableFunction(lambda at: at.q[:2], ["a", "b"])
    controller = nmm.Controller(robot, nmm.Task(told, [1.0, 0.0], gain=1.0), nmm.ProjectedGradient())
    assert not controller.solver.compiles_steps
    run = nmm.simulate(controller, {"q1": 0.5}, 1.0, 0.02)
    assert run.summary()["kinematics"] == "pinocchio"
    assert run.summary()["kinematics_off"] is None


def test_a_run_leaves_the_controller_to_pinocchio() -> None:
    """A call after a run is the call of a new controller, to the bit."""
    used, new = planar(), planar()
    q = np.array([0.1, 0.2, 0.3, 0.4, 0.5])
    nmm.simulate(used, q, 1.0, 0.01)
    used.reset()
    assert np.array_equal(used(0.0, q), new(0.0, q))
    assert used.given.kinematics == "pinocchio"


def test_another_thread_is_refused_while_compiled_code_runs() -> None:
    """The GIL is free then, and the memory is not."""
    controller, seen = planar(), []
    q = np.array([0.0, 0.0, 0.0, 0.5, 0.5])

    def meddle() -> None:
        try:
            controller(0.0, q)
        except nmm.RunError as error:
            seen.append(str(error))

    thread = threading.Thread(target=meddle, name="other")
    with controller.solver.compiled():
        thread.start()
        thread.join()
    assert "called in thread other while a call is under way" in seen[0]
    assert np.all(np.isfinite(controller(0.0, q)))


def test_a_run_answers_ctrl_c_between_compiled_calls(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each is short, however long the run."""
    spans: list[int] = []
    fly = CompiledLoop.__call__

    def interrupted(self: CompiledLoop, *given: object) -> tuple[int, bool]:
        if len(spans) == 3:
            raise KeyboardInterrupt
        found = fly(self, *given)
        spans.append(found[0])
        return found

    monkeypatch.setattr(CompiledLoop, "__call__", interrupted)
    run = nmm.simulate(planar(), {"q1": 0.5, "q2": 0.5}, 1000.0, 0.001)
    assert run.outcome is nmm.Outcome.INTERRUPTED
    assert len(run) == spans[-1] + 1 < 100_000


def test_the_summary_and_the_folder_say_who_computed_the_kinematics(tmp_path) -> None:
    run = nmm.simulate(planar(), {"q1": 0.5, "q2": 0.5}, 0.5, 0.01)
    assert {field.name for field in fields(run)} >= {"kinematics_off"}
    run.save(tmp_path / "run", figures=False, html=False)
    read = nmm.Trajectory.load(tmp_path / "run")
    assert read.kinematics_off == run.kinematics_off < 1e-13


@pytest.mark.parametrize("method", ["rk4", "zoh"])
@pytest.mark.parametrize("resolver", ["pg", "rg", "dls"])
def test_armijos_rule_is_the_same(resolver: str, method: str, flights: list[tuple[int, int, bool]]) -> None:
    """With an α that has to be shortened, and one that has not; by limits, too."""
    for more in ({"resolver.alpha": 300.0}, {"limits": {"acceleration": 4.0}}):
        scenario = nmm.Scenario.load(
            "unicycle_2r_position",
            {"method": method, "duration": 2.0, "dt": 0.01, "resolver.step": "armijo", **more},
        )
        flown, stepped = both(scenario.with_resolver(resolver).run)
        assert sum(reached - first for first, reached, _ in flights) > 100
        flights.clear()
        same(flown, stepped)
        np.testing.assert_allclose(flown.step_size, stepped.step_size, atol=1e-12)
        assert flown.summary()["kinematics"] == "compiled"
        assert ("limits" in more) or flown.step_size.min() < 0.9


@pytest.mark.parametrize("resolver", ["pg", "rg", "dls"])
def test_alpha_is_the_one_that_python_finds(resolver: str) -> None:
    """The rule, once compiled and once written for users' objectives, which Python evaluates."""
    scenario = nmm.Scenario.load("unicycle_2r_position", {"resolver.alpha": 300.0, "resolver.step": "armijo"})
    controller = scenario.with_resolver(resolver).controller()
    controller.dt = 0.01
    rng = np.random.default_rng(2)
    for q in controller.robot.q({"q1": 0.5, "q2": 0.5}) + 0.6 * rng.standard_normal((40, 5)):
        controller.reset()
        one = controller.evaluate(0.0, q)
        controller.reset()
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(StepSize, "compiled", property(lambda self: False))
            other = controller.evaluate(0.0, q)
        assert one.step_size == pytest.approx(other.step_size, rel=1e-12)
        np.testing.assert_allclose(one.u, other.u, rtol=1e-12, atol=1e-12)
        np.testing.assert_array_equal(one.partition, other.partition)


def test_a_users_objective_keeps_armijos_rule_in_python(flights: list[tuple[int, int, bool]]) -> None:
    objective = nmm.CallableObjective(lambda c: float(c.q[3] ** 2 + c.q[4] ** 2))
    task = nmm.Task(nmm.Position("ee", "xy"), [2.0, 0.5], gain=1.0)
    resolver = nmm.ProjectedGradient(alpha=300.0, step="armijo")
    controller = nmm.Controller(nmm.load("unicycle_2r"), task, resolver, objective, dt=0.01)
    run = nmm.simulate(controller, {"q1": 0.5, "q2": 0.5}, 0.5, 0.01)
    assert not flights
    assert run.summary()["kinematics"] == "pinocchio"
    assert run.step_size.min() < 0.9


@pytest.mark.parametrize("method", ["rk4", "zoh"])
def test_retreats_are_python_s_and_what_is_between_them_is_compiled(
    method: str, flights: list[tuple[int, int, bool]]
) -> None:
    """A target that joints at their stops cannot reach: the robot backs off again and again."""
    robot = nmm.load("unicycle_2r")
    limits = nmm.Limits(position={"q1": [-0.1, 0.1], "q2": [-0.1, 0.1]}, velocity={"v": 1.0, "omega": 1e-3})
    task = nmm.Task(nmm.Position("ee", "xy"), [0.5, 0.6], gain=1.0)
    retreat = nmm.Retreat(stalled=0.4, durations=(0.2, 0.3))
    controller = nmm.Controller(robot, task, nmm.ProjectedGradient(), limits=limits, retreat=retreat)
    flown, stepped = both(lambda: nmm.simulate(controller, robot.rest, 8.0, 0.01, method))
    assert "backed_off" in codes(flown)
    assert len({first for first, reached, _ in flights if reached > first}) > 3
    assert sum(reached - first for first, reached, _ in flights) > 200
    same(flown, stepped)


@pytest.mark.parametrize("given", ["nothing", "armijo", "retreat", "distances"])
def test_errors_looked_at_are_those_of_a_step(given: str) -> None:
    """What decides about inputs has no part in them, so that they are found in compiled code."""
    robot = nmm.load("unicycle_2r")
    task = nmm.Task(nmm.Position("ee", "xy"), nmm.Circle([2, 0], 1.0, rate=0.5), gain=2.0)
    resolver = nmm.ProjectedGradient(step="armijo" if given == "armijo" else "constant")
    objective = nmm.Quadratic(nmm.QuadraticTerm("q1"), nmm.QuadraticTerm("q2"))
    more: dict[str, object] = {"dt": 0.01}
    if given == "retreat":
        more["retreat"] = nmm.Retreat()
    if given == "distances":
        more["collisions"] = nmm.Collisions(0.05, obstacles=[nmm.Obstacle(nmm.Sphere(0.3), [9.0, 0.0, 0.0])])
    controller = nmm.Controller(robot, task, resolver, objective, **more)
    times = np.linspace(0.0, 1.0, 7)
    q = robot.q({"q1": 0.5, "q2": 0.5}) + 0.3 * np.random.default_rng(3).standard_normal((7, robot.n))
    error, rate = controller.solver.errors(times, q)
    for k, t in enumerate(times.tolist()):
        step = controller.evaluate(t, q[k])
        np.testing.assert_allclose(error[k], step.error, atol=1e-12)
        np.testing.assert_allclose(rate[k], step.rate, atol=1e-12)
