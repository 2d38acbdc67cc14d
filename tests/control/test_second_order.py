"""Controllers of second order: u_dot = controller(t, q, u)."""

import pickle

import numpy as np
import pytest
from findings import refused
from wandering import ROBOTS, wander, wanderer

import nmm

ROBOT = nmm.load("unicycle_2r")
Q0 = ROBOT.q({"q1": 0.5, "q2": 0.8})
CIRCLE = nmm.Circle([2, 2], 3, rate=0.25)
GAIN, SERVO, ALPHA = 2.0, 5.0, 10.0
QUADRATIC = nmm.Quadratic(nmm.QuadraticTerm("q1", 0.5))


def circling(resolver: nmm.extending.Resolver | None = None, **given: object) -> nmm.Controller:
    task = nmm.Task(nmm.Position("ee", "xy"), given.pop("target", CIRCLE), gain=GAIN)
    objective = given.pop("objective", QUADRATIC)
    resolver = nmm.ProjectedGradient(alpha=ALPHA) if resolver is None else resolver
    return nmm.Controller(ROBOT, task, resolver, objective, order=2, **given)


def links() -> tuple[float, float, float]:
    """Where the arm stands on the platform, and the links' lengths, from three placements."""
    x = [
        nmm.Configuration(ROBOT, ROBOT.q(q)).placement("ee").translation[0]
        for q in ({}, {"q1": np.pi}, {"q2": np.pi})
    ]
    mount = 0.5 * (x[0] + x[1])
    last = 0.5 * (x[0] - x[2])
    return mount, x[0] - mount - last, last


def closed_form(t: float, q: np.ndarray, u: np.ndarray) -> np.ndarray:
    """u_dot of the projected gradient, from the derivatives of unicycle + 2R by hand."""
    a, l1, l2 = links()
    v, w, w1, w2 = u
    angles = q[2] + np.array([0.0, q[3], q[3] + q[4]])
    rates = w + np.array([0.0, w1, w1 + w2])
    c, s = np.cos(angles), np.sin(angles)
    size = np.array([a, l1, l2])
    normal = size * np.array([-s, c])  # the columns of the three angles
    J = np.column_stack(
        [[c[0], s[0]], normal.sum(axis=1), normal[:, 1:].sum(axis=1), normal[:, 2:].sum(axis=1)]
    )
    bias = v * w * np.array([-s[0], c[0]]) - (size * rates**2 * np.array([c, s])).sum(axis=1)
    p = q[:2] + (size * np.array([c, s])).sum(axis=1)
    turn = 0.25 * t
    g = np.array([2.0, 2.0]) + 3.0 * np.array([np.cos(turn), np.sin(turn)])
    g_t = 0.75 * np.array([-np.sin(turn), np.cos(turn)])
    g_tt = -0.1875 * np.array([np.cos(turn), np.sin(turn)])
    rate = g_t + GAIN * (g - p)
    b = g_tt + GAIN * (g_t - J @ u) - bias + SERVO * (rate - J @ u)
    h = np.array([0.0, 0.0, q[3] - 0.5, 0.0])
    u0 = SERVO * (-ALPHA * h - u)
    pinv = np.linalg.pinv(J)
    return pinv @ b + (np.eye(4) - pinv @ J) @ u0


def test_it_equals_the_closed_form_of_unicycle_and_2r() -> None:
    controller, rng = circling(), np.random.default_rng(0)
    for _ in range(50):
        t, q, u = rng.uniform(0.0, 10.0), rng.normal(size=5), rng.normal(size=4)
        expected = closed_form(t, q, u)
        assert np.abs(controller(t, q, u) - expected).max() < 1e-8 * (1.0 + np.abs(expected).max())


@pytest.mark.parametrize("kind", ["pg", "rg", "ej", "dls"])
def test_the_error_follows_its_law_from_rest(kind: str) -> None:
    """ë + (k + K) ė + k K e = 0, from e(0) and, at rest, ė(0) = ∂g/∂t."""
    resolver = {
        "pg": nmm.ProjectedGradient(),
        "rg": nmm.ReducedGradient(),
        "ej": nmm.ExtendedJacobian(),
        "dls": nmm.DampedLeastSquares(),
    }[kind]
    added = nmm.Task(nmm.Posture("q1", "q2"), [0.5, 0.8], gain=1.0) if kind == "ej" else None
    run = nmm.simulate(circling(resolver, added_task=added), Q0, 3.0, 0.005)
    e0, v0 = run.error[0], np.array([0.0, 0.75])
    k, K, t = SERVO, GAIN, run.t[:, np.newaxis]
    slow = (k * e0 + v0) / (k - K)  # e = slow exp(-K t) + (e0 - slow) exp(-k t)
    expected = slow * np.exp(-K * t) + (e0 - slow) * np.exp(-k * t)
    assert np.abs(run.error - expected).max() < 1e-6
    assert run.complete
    assert not run.findings
    assert np.abs(run.u[0]).max() == 0.0  # from rest
    np.testing.assert_allclose(np.gradient(run.u, run.t, axis=0)[1:-1], run["u_dot"][1:-1], atol=0.05)


def test_a_point_in_a_picture_follows_the_law_from_rest() -> None:
    """A camera that turns while its platform drives; the ball stands, so that ė(0) = 0."""
    robot = nmm.load("unicycle_pan_tilt")
    middle = nmm.Task(nmm.ImagePoints([[2.0, 0.5, 0.6]]), [0.0, 0.0], gain=GAIN)
    near = nmm.Task(nmm.LogDepth([2.0, 0.5, 0.6]), [0.2], gain=GAIN)
    controller = nmm.Controller(robot, [middle, near], nmm.ReducedGradient(), order=2, servo=SERVO)
    run = nmm.simulate(controller, {"pan": 0.1, "tilt": 0.1}, 2.0, 0.005)
    k, K, t = SERVO, GAIN, run.t[:, np.newaxis]
    decay = (k * np.exp(-K * t) - K * np.exp(-k * t)) / (k - K)
    assert np.abs(run.error - run.error[0] * decay).max() < 1e-5
    assert np.abs(run.error[0]).min() > 0.04
    assert not run.findings


def test_a_hundred_seconds_on_a_circle_do_not_build_up_velocity() -> None:
    run = nmm.simulate(circling(objective=None), Q0, 100.0, 0.02)
    half = len(run) // 2
    assert np.linalg.norm(run.u[half:], axis=1).max() < 1.5  # the undamped null space came to 48


def test_compiled_loops_equal_python_ones_and_copies_equal_their_originals() -> None:
    """A user's Python function keeps a run out of compiled code: the same task, by another way."""
    by_hand = nmm.CallableObjective(
        lambda here: 0.5 * float((here.q[3] - 0.5) ** 2),
        lambda here: np.array([0.0, 0.0, 0.0, here.q[3] - 0.5, 0.0]),
    )
    for method in ("rk4", "zoh"):
        compiled, python = (
            nmm.simulate(circling(objective=one), Q0, 1.0, 0.01, method) for one in (QUADRATIC, by_hand)
        )
        # h is 1e-4 with Python functions, so that D differs by h²
        np.testing.assert_allclose(compiled.q, python.q, atol=1e-6)
    controller = circling()
    u, again = np.ones(4), pickle.loads(pickle.dumps(controller))
    assert np.array_equal(controller(0.1, Q0, u), again(0.1, Q0, u))
    users = nmm.CallableResolver(lambda problem: np.linalg.pinv(problem.J) @ problem.rate)
    np.testing.assert_allclose(
        circling(users, objective=None)(0.1, Q0, u), circling(objective=None)(0.1, Q0, u), atol=1e-9
    )


@pytest.mark.parametrize("name", [*ROBOTS][:2])
def test_random_steps_stay_within_all_limits(name: str) -> None:
    controller, q0 = wanderer(name, 2)
    assert max(wander(controller, q0, 1000)) <= 1e-11


def test_what_is_between_the_samples_is_within_limits_too() -> None:
    """A coordinate that is stopped at its limit does not swing beyond it within a sample."""
    limits = nmm.Limits({"arm": 2.0, "platform": 2.0}, {"q1": [-0.2, 0.9]}, acceleration=3.0)
    task = nmm.Task(nmm.Posture("q1"), [2.0], gain=5.0)
    controller = nmm.Controller(ROBOT, task, nmm.ProjectedGradient(), limits=limits, dt=0.05, order=2)
    run = nmm.simulate(controller, Q0, 3.0, 0.05, "zoh")
    s = np.linspace(0.0, 0.05, 21)[:, np.newaxis]
    between = run.q[:-1, 3] + s * run.u[:-1, 2] + 0.5 * s**2 * run["u_dot"][:-1, 2]
    assert between.max() <= 0.9 + 1e-11
    assert run.q[-1, 3] > 0.9 - 1e-3  # it got there
    assert np.abs(run["u_dot"]).max() <= 3.0 + 1e-11


def test_out_of_reach_it_comes_to_rest() -> None:
    arm = nmm.load("unicycle_3r", platform="fixed")
    task = nmm.Task(nmm.Position("ee"), [2.0, 0.0, 0.5])
    controller = nmm.Controller(arm, task, nmm.DampedLeastSquares(), order=2)
    run = nmm.simulate(controller, arm.q({"q2": 0.8, "q3": 0.5}), 15.0, 0.01)
    assert np.abs(run.u[-1]).max() < 0.01
    assert run.outcome is not nmm.Outcome.DIVERGED


def test_a_target_that_is_set_elsewhere_is_followed_with_bounded_accelerations_and_told() -> None:
    target = nmm.LiveTarget([2.0, 1.0])
    task = nmm.Task(nmm.Position("ee", "xy"), target, gain=GAIN)
    aim = nmm.Task(nmm.Posture("q1"), [0.2], name="aim", priority=2, when=nmm.Between(1.0, 2.0))
    controller = nmm.SequencedController(ROBOT, [task, aim], nmm.ProjectedGradient(), order=2)
    run = nmm.simulate(controller, Q0, 3.0, 0.01)
    assert "rate_jumps" in [one.code for one in run.findings]
    # u goes on at the events: the largest step is that of the largest acceleration
    assert np.abs(np.diff(run.u, axis=0)).max() <= 0.01 * np.abs(run["u_dot"]).max() * 1.01
    assert np.abs(run["u_dot"]).max() < 1e3  # an impulse over h would be 1e6


def test_a_rate_that_jumps_within_the_difference_is_no_impulse() -> None:
    """The reference begins to move at the sample itself."""

    def value(t: float) -> list[float]:
        return [2.0 + max(t - 1.0, 0.0), 1.0]

    def rate(t: float) -> list[float]:
        return [1.0 if t >= 1.0 else 0.0, 0.0]

    controller = circling(target=nmm.CallableReference(value, 2, rate=rate))
    beside = [np.abs(controller(t, Q0, np.zeros(4))).max() for t in (0.99, 1.0, 1.01)]
    assert beside[1] < 2.0 * max(beside[0], beside[2])


def test_a_sampled_path_within_limits_is_ten_times_as_near_as_with_held_inputs() -> None:
    limits = nmm.Limits({"platform": 5.0, "arm": 5.0}, acceleration=50.0)
    x, y = nmm.Configuration(ROBOT, Q0).placement("ee").translation[:2]
    eight = nmm.CallableReference(
        lambda t: [x + np.sin(0.5 * t), y + 0.5 * np.sin(t)],
        2,
        rate=lambda t: [0.5 * np.cos(0.5 * t), 0.5 * np.cos(t)],
    )
    task = nmm.Task(nmm.Position("ee", "xy"), eight, gain=GAIN)
    far = []
    for order in (1, 2):
        controller = nmm.Controller(
            ROBOT, task, nmm.ProjectedGradient(), limits=limits, dt=0.01, order=order, servo=20.0
        )
        run = nmm.simulate(controller, Q0, 12.0, 0.01, "zoh")
        far.append(run.error_norm[run.t > 8.0].max())
    assert far[1] <= 0.1 * far[0]


def test_limits_of_functions_are_kept() -> None:
    corridor = nmm.Bound(nmm.Position("base_footprint", "y"), -0.2, 0.2)
    limits = nmm.Limits(bounds=corridor, acceleration=20.0)
    task = nmm.Task(nmm.Position("ee", "xy"), nmm.Line([1.1, 0], [3, 0.8], duration=5))
    controller = nmm.Controller(
        ROBOT, task, nmm.ProjectedGradient(), limits=limits, dt=0.01, order=2, servo=10
    )
    run = nmm.simulate(controller, Q0, 5.0, 0.01, "zoh")
    assert run.q[:, 1].max() < 0.2 + 1e-4
    assert run.q[:, 1].max() > 0.15


def test_torques_are_those_of_the_recorded_accelerations() -> None:
    run = nmm.simulate(circling(), Q0, 1.0, 0.01)
    found, dynamics = run.torques(), nmm.Dynamics(ROBOT)
    f = np.array([dynamics.inverse(*one) for one in zip(run.q, run.u, run["u_dot"], strict=True)])
    np.testing.assert_allclose(found.torques, dynamics.actuators.torques(run.q, f), atol=1e-12)
    assert not found.jumps.any()


def test_what_is_not_known_at_order_2_is_refused() -> None:
    with refused("order", got=3):
        nmm.Controller(ROBOT, nmm.Task(nmm.Position("ee", "xy"), CIRCLE), nmm.ProjectedGradient(), order=3)
    with refused("collisions"):
        circling(collisions=nmm.Collisions(), dt=0.01)
    with refused("servo"):
        circling(limits=nmm.Limits(acceleration=1.0), dt=0.01, servo=200.0)
    with refused("method"):
        nmm.simulate(circling(limits=nmm.Limits(acceleration=1.0), dt=0.01), Q0, 1.0, 0.01)
    with refused("method"):
        circling(limits=nmm.Limits(acceleration=1.0), dt=0.01).step(0.0, Q0, 0.01)
    first = nmm.Controller(ROBOT, nmm.Task(nmm.Position("ee", "xy"), CIRCLE), nmm.ProjectedGradient())
    with refused("u"):
        first(0.0, Q0, np.zeros(4))


def test_armijos_rule_descends_where_a_constant_step_overshoots() -> None:
    """u is the answer of the sample before: servo = 1 / dt."""

    def left(step: str) -> nmm.Trajectory:
        resolver = nmm.ProjectedGradient(alpha=400.0, step=step)
        controller = circling(resolver, target=[2.0, 1.0], servo=50.0, dt=0.02)
        return nmm.simulate(controller, ROBOT.q({"q1": 1.2, "q2": 0.8}), 2.0, 0.02, "zoh")

    found = left("armijo")
    assert found["step_size"].min() < 0.5
    assert found.objective[-1] < 1e-3 * found.objective[0]
    assert not left("constant").objective[-1] < found.objective[0]


def test_a_retreat_accelerates_within_the_limits() -> None:
    limits = nmm.Limits({"v": 0.5, "omega": 1.0}, acceleration=2.0)
    backs_off = nmm.Retreat(stalled=0.1, progress=0.5, durations=[0.3])
    controller = circling(target=[2.0, 1.0], limits=limits, retreat=backs_off, dt=0.01)
    run = nmm.simulate(controller, Q0, 2.0, 0.01, "zoh")
    assert controller.solver.retreat_state.count > 1
    assert np.abs(run["u_dot"]).max() < 2.0 + 1e-9
    np.testing.assert_allclose(np.diff(run.u, axis=0), 0.01 * run["u_dot"][:-1], atol=1e-12)


def test_a_scenario_says_its_order_and_its_folder_keeps_the_accelerations(tmp_path: object) -> None:
    settings = {"order": 2, "servo": 4, "duration": 1, "dt": 0.01}
    run = nmm.Scenario.load("unicycle_2r_position", settings).run()
    folder = run.save(f"{tmp_path}/run", figures=False)
    again = nmm.Trajectory.load(folder)
    assert np.array_equal(again["u_dot"], run["u_dot"])
    assert again.order == again.scenario["order"] == 2
