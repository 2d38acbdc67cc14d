"""The step size α by Armijo's rule along the motion of one sample, and runs that begin and end at rest."""

from __future__ import annotations

import copy
import itertools

import numpy as np
import pytest
import yaml
from findings import refused

import nmm
from nmm.control.integrators import integrator
from nmm.control.step.step_size import DECREASE

ROBOT = nmm.load("unicycle_3r")
Q0 = ROBOT.q({"q1": 0.3, "q2": 0.6, "q3": 0.9})
DT = 0.01
RESOLVERS = {"pg": nmm.ProjectedGradient, "rg": nmm.ReducedGradient, "dls": nmm.DampedLeastSquares}
FAR_TOO_LARGE = (
    1e4  # α dt = 100; H's curvature is 1, and with a factor that the arm adds, at least 1 seen by u
)
TIP = nmm.Position("ee", "xyz")
CALM = nmm.Quadratic(*(nmm.QuadraticTerm(name) for name in ("q1", "q2", "q3", "theta")))


def holding(kind: str, alpha: float, step: str, limits: nmm.Limits | None = None) -> nmm.Controller:
    """The end-effector stays where it is, the rest descends H."""
    held = nmm.evaluate(TIP, 0.0, nmm.Configuration(ROBOT, Q0)).value
    resolver = RESOLVERS[kind](alpha=alpha, step=step)
    return nmm.Controller(ROBOT, nmm.Task(TIP, held, gain=2.0), resolver, CALM, limits=limits, dt=DT)


def circling(kind: str, alpha: float, step: str, limits: nmm.Limits | None = None) -> nmm.Controller:
    task = nmm.Task(nmm.Position("ee", "xy"), nmm.Circle([2, 0], 1.0, rate=0.5), gain=2.0)
    return nmm.Controller(ROBOT, task, RESOLVERS[kind](alpha=alpha, step=step), CALM, limits=limits, dt=DT)


def sampled(controller: nmm.Controller, steps: int, method: str = "euler") -> list[nmm.extending.Step]:
    """The samples of a motion from Q0, without the judgement that a run ends with."""
    advance, q, found = integrator(method, ROBOT, 1e-9), Q0, []
    for k in range(steps):
        u = controller(k * DT, q)
        found.append(controller.last(k * DT, q))
        q = advance.advance(controller.velocity, k * DT, q, found[-1].q_dot, u, DT)
    return found


@pytest.mark.parametrize("kind", RESOLVERS)
def test_without_it_an_alpha_too_large_makes_the_objective_grow(kind: str) -> None:
    H = [step.objective for step in sampled(holding(kind, FAR_TOO_LARGE, "constant"), 4)]
    assert max(H) > 100.0 * H[0]


@pytest.mark.parametrize("kind", RESOLVERS)
@pytest.mark.parametrize("method", ["zoh", "euler", "rk4"])
def test_with_it_the_objective_falls_at_every_sample(kind: str, method: str) -> None:
    steps = sampled(holding(kind, FAR_TOO_LARGE, "armijo"), 200, method)
    H = np.array([step.objective for step in steps])
    assert np.diff(H).max() <= 1e-12
    least = sampled(holding(kind, 10.0, "constant"), 200, method)[-1].objective
    assert H[-1] == pytest.approx(least, rel=0.01)
    assert 0.0 < min(step.step_size for step in steps) < 0.1


@pytest.mark.parametrize("kind", RESOLVERS)
@pytest.mark.parametrize("limits", [None, nmm.Limits({"platform": 2.0, "arm": 3.0}, acceleration=500.0)])
def test_the_decrease_is_sufficient_along_the_samples_motion(kind: str, limits: nmm.Limits | None) -> None:
    """Armijo's inequality itself, with d from a second controller whose α is next to nothing."""
    make = circling if limits is None else holding  # limits keep far steps short by themselves
    controller, rest = (make(kind, alpha, "armijo", limits) for alpha in (FAR_TOO_LARGE, 1e-9))
    shortened = 0
    q = Q0.copy()
    for k in range(100):
        rest.solver.before[:] = controller.solver.before
        rest(k * DT, q)
        controller(k * DT, q)
        plain, step = rest.last(k * DT, q), controller.last(k * DT, q)
        ahead = CALM.value(nmm.Configuration(ROBOT, q + DT * (step.q_dot - plain.q_dot)))
        slope = DT * float(step.h @ (step.u - plain.u))
        assert slope <= 1e-9
        assert ahead <= step.objective + DECREASE * slope + 1e-8
        np.testing.assert_allclose(step.J @ step.u, plain.J @ plain.u, rtol=0, atol=1e-8)
        np.testing.assert_allclose(step.scale, plain.scale, rtol=0, atol=1e-7)
        shortened += step.step_size < 1.0
        q = q + DT * step.q_dot
    assert shortened > (50 if limits is None else 10)


@pytest.mark.parametrize("kind", RESOLVERS)
@pytest.mark.parametrize("limits", [None, nmm.Limits({"platform": 0.6, "arm": 0.8}, acceleration=20.0)])
def test_a_small_alpha_gives_the_commands_without_it_to_the_bit(kind: str, limits: nmm.Limits | None) -> None:
    for make, method in itertools.product((holding, circling), ("rk4", "zoh")):
        plain, chosen = (
            sampled(make(kind, 5.0, step, limits), 60, method) for step in ("constant", "armijo")
        )
        for one, other in zip(chosen, plain, strict=True):
            np.testing.assert_array_equal(one.u, other.u)
            np.testing.assert_array_equal(one.q, other.q)
            assert one.step_size == 1.0


@pytest.mark.parametrize("kind", RESOLVERS)
def test_the_task_gets_its_rate_and_limits_are_kept(kind: str) -> None:
    for step in sampled(circling(kind, FAR_TOO_LARGE, "armijo"), 50):
        assert np.linalg.norm(step.J @ step.u - step.rate) <= 1e-12 * (1.0 + np.linalg.norm(step.rate))
    limits = nmm.Limits({"platform": 0.4, "arm": 0.5}, acceleration=20.0)
    u = np.array([step.u for step in sampled(circling(kind, FAR_TOO_LARGE, "armijo", limits), 50)])
    assert np.all(np.abs(u) <= np.array([0.4, 0.4, 0.5, 0.5, 0.5]) + 1e-12)
    assert np.abs(np.diff(u, axis=0, prepend=0.0)).max() <= 20.0 * DT + 1e-12


def test_alpha_is_chosen_at_the_sample_and_kept_at_its_stages() -> None:
    controller = holding("pg", FAR_TOO_LARGE, "armijo")
    controller(0.0, Q0)
    sample = controller.last(0.0, Q0)
    assert sample.step_size < 1.0
    np.testing.assert_array_equal(controller.velocity(0.0, Q0), sample.q_dot)
    elsewhere = Q0 + 0.01
    stage = controller.velocity(0.0, elsewhere)
    looked = controller.evaluate(0.0, elsewhere)
    assert looked.step_size != sample.step_size
    np.testing.assert_array_equal(controller.velocity(0.0, elsewhere), stage)
    plain = holding("pg", FAR_TOO_LARGE * sample.step_size, "constant")
    np.testing.assert_allclose(plain.evaluate(0.0, elsewhere).q_dot, stage, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(copy.deepcopy(controller)(0.0, Q0), sample.u)


def test_a_spring_of_steering_is_descended_too() -> None:
    """A spring in the null space holds a car's hand ahead of its axle: H and the spring fall together."""
    car = nmm.mount("car_base", "small_arm", at="arm_mount")
    task = nmm.Task(nmm.Position("ee"), nmm.Circle([0, 0, 0.6], 2.5, 0.16), gain=1.0)
    H = nmm.Quadratic(nmm.QuadraticTerm("q2", weight=0.1))

    def controller(alpha: float, step: str = "armijo") -> nmm.Controller:
        return nmm.Controller(car, task, nmm.ProjectedGradient(alpha, step=step), H, dt=DT)

    strong, plain, weak = controller(FAR_TOO_LARGE), controller(1.0, "constant"), controller(1.0)
    assert strong.steered is not None
    rest = nmm.Controller(car, task, nmm.ProjectedGradient(1e-12), H, steering=nmm.Steering(spring=0.0))
    spring = 2.0 / FAR_TOO_LARGE
    rng, shortened = np.random.default_rng(3), 0
    for q in rng.uniform(*np.clip(car.q_limits.T, -1.5, 1.5), (20, car.n)):
        np.testing.assert_array_equal(weak(0.3, q), plain(0.3, q))
        strong(0.3, q)
        motion = DT * (strong.last(0.3, q).q_dot - rest.evaluate(0.3, q).q_dot)
        values = []
        for where in (nmm.Configuration(car, q), nmm.Configuration(car, q + motion)):
            pursuit = nmm.evaluate(strong.steered.pursuit, 0.3, where)
            values.append(H.value(where) + spring * pursuit.value[-1])
        assert values[1] < values[0]
        shortened += 0.0 < strong.last(0.3, q).step_size < 1.0
    assert shortened > 10


def test_a_gradient_that_is_no_number_beyond_the_step_shortens_it() -> None:
    """An objective that is only defined near: trials where it is not are too long."""

    def near(configuration: nmm.Configuration) -> float:
        angle = float(configuration.q[4])
        return float(np.log(0.7 - angle)) if angle < 0.7 else np.nan

    held = nmm.evaluate(TIP, 0.0, nmm.Configuration(ROBOT, Q0)).value
    resolver = nmm.ProjectedGradient(alpha=100.0, step="armijo")
    objective = nmm.CallableObjective(near)
    controller = nmm.Controller(ROBOT, nmm.Task(TIP, held), resolver, objective, dt=DT)
    controller(0.0, Q0)
    step = controller.last(0.0, Q0)
    assert np.isfinite(near(nmm.Configuration(ROBOT, Q0 + DT * step.q_dot)))
    assert step.step_size < 1.0


EJ = nmm.ExtendedJacobian
ADDED = nmm.Task(nmm.LinearCoordinates("q1", "q2"), [0.0, 0.0])


def bare(
    resolver: nmm.extending.Resolver, objective: nmm.extending.Objective | None = CALM, **more: object
) -> nmm.Controller:
    return nmm.Controller(ROBOT, nmm.Task(TIP, [1.0, 0.0, 0.5]), resolver, objective, **more)  # type: ignore[arg-type]


def stepping(resolver: nmm.extending.Resolver) -> nmm.extending.Resolver:
    resolver.step = "armijo"
    return resolver


@pytest.mark.parametrize(
    ("made", "text"),
    [
        (lambda: nmm.ProjectedGradient(step="wolfe"), "unknown step 'wolfe'"),
        (lambda: nmm.ReducedGradient(step=float("nan")), "unknown step nan"),
        (lambda: nmm.ProjectedGradient(step=None), "unknown step None"),
        (lambda: nmm.ProjectedGradient(alpha=-1.0, step="armijo"), "alpha: expected a number above 0"),
        (
            lambda: nmm.ProjectedGradient(alpha=float("nan"), step="armijo"),
            "alpha: expected finite numbers",
        ),
        (lambda: bare(nmm.ProjectedGradient(step="armijo"), None), "step: armijo chooses α by the objective"),
        (lambda: bare(stepping(EJ()), added_task=ADDED), "step: resolver ej has no α to choose"),
        (lambda: bare(nmm.ProjectedGradient(step="armijo"))(0.0, Q0), "dt: expected a number"),
        (lambda: bare(nmm.ProjectedGradient(step="armijo")).velocity(0.0, Q0), "dt: expected a number"),
        (lambda: bare(nmm.ProjectedGradient(step="armijo")).evaluate(0.0, Q0), "dt: expected a number"),
    ],
)
def test_what_cannot_be_is_said(made: object, text: str) -> None:
    with pytest.raises(nmm.InputError) as error:
        made()  # type: ignore[operator]
    assert text in str(error.value)


def test_a_step_that_holds_for_a_sample_needs_samples() -> None:
    with refused("method", got="adaptive"):
        nmm.simulate(bare(nmm.ProjectedGradient(step="armijo")), Q0, 1.0, DT, "adaptive")


def scenario(tmp_path: object, **resolver: object) -> nmm.Scenario:
    data = {
        "robot": "unicycle_3r",
        "q0": {"q1": 0.3, "q2": 0.6, "q3": 0.9},
        "duration": 0.2,
        "dt": DT,
        "task": {"kind": "position", "frame": "ee", "axes": "xyz", "reference": [1.2, 0.1, 0.5]},
        "objective": {"kind": "quadratic", "terms": [{"of": "q1"}, {"of": "q2"}]},
        "resolver": resolver,
    }
    path = tmp_path / "steps.yaml"  # type: ignore[operator]
    path.write_text(yaml.safe_dump(data), encoding="utf-8")
    return nmm.Scenario.load(path)


def test_a_scenario_says_the_same_and_its_folder_keeps_it(tmp_path: object) -> None:
    found = scenario(tmp_path, kind="pg", alpha=FAR_TOO_LARGE, step="armijo")
    run = found.run()
    assert 0.0 < run.step_size.min() < 1.0
    assert run.summary()["step_size_min"] == run.step_size.min()
    again = nmm.Trajectory.load(run.save(tmp_path / "run", figures=False))  # type: ignore[operator]
    np.testing.assert_array_equal(again.step_size, run.step_size)
    assert found.with_resolver("rg").parts.resolver.step == "armijo"
    assert not hasattr(found.with_resolver("ej").parts.resolver, "step")


@pytest.mark.parametrize(
    ("resolver", "text"),
    [
        ({"kind": "ej", "step": "armijo"}, "step: unknown key 'step'"),
        ({"kind": "pg", "step": "wolfe"}, "resolver.step: "),
    ],
)
def test_a_scenario_is_refused_by_its_key(tmp_path: object, resolver: dict[str, str], text: str) -> None:
    with pytest.raises(nmm.ScenarioError) as error:
        scenario(tmp_path, **resolver).controller()
    assert text in str(error.value)


@pytest.mark.parametrize("method", ["rk4", "zoh"])
def test_with_acceleration_limits_a_run_to_a_far_goal_starts_and_ends_softly(method: str) -> None:
    """No jump from rest, none on the way; at the goal rest is one sample away."""
    A, dt = 2.0, 0.02
    limits = nmm.Limits({"platform": 1.0, "arm": 1.5}, acceleration=A)
    task = nmm.Task(TIP, [5.0, 1.0, 0.6], gain=2.0, speed=0.6, braking=0.5)
    q0 = ROBOT.q({"q1": 0.3, "q2": 0.7, "q3": 0.5})
    controller = nmm.Controller(ROBOT, task, nmm.ProjectedGradient(alpha=1.0), limits=limits)
    run = nmm.simulate(controller, q0, 30.0, dt, method, until=nmm.Goal())
    assert run.verdict.reasons[0].code == "reached"
    change = np.abs(np.diff(run.u, axis=0, prepend=0.0))
    assert change.max() <= A * dt + 1e-12
    assert change[0].max() == pytest.approx(A * dt)  # the limit is what holds it back
    assert np.abs(run.u[-1]).max() <= A * dt
    free = nmm.Controller(ROBOT, task, nmm.ProjectedGradient(alpha=1.0))
    assert np.abs(nmm.simulate(free, q0, dt, dt, method).u[0]).max() > 5.0 * A * dt


def test_the_first_inputs_vanish_with_the_sample() -> None:
    """Accelerations limited, u begins at 0 as dt does: the start is continuous."""
    for dt in (0.02, 0.01, 0.005):
        limits = nmm.Limits(acceleration=2.0)
        task = nmm.Task(TIP, [5.0, 1.0, 0.6], gain=2.0)
        u = nmm.Controller(ROBOT, task, nmm.ProjectedGradient(), CALM, limits=limits, dt=dt)(0.0, Q0)
        assert 0.0 < np.abs(u).max() <= 2.0 * dt + 1e-12
