"""Levels of priority: each gets all that the levels above leave, and takes nothing from them."""

from __future__ import annotations

import numpy as np
import pytest
from findings import refused
from level_problems import Off, compared, problems

import nmm
from nmm.control.resolvers.answer import Status, unanswered
from nmm.control.resolvers.base import State
from nmm.control.resolvers.problem import Problem

RESOLVERS = {
    "pg": nmm.ProjectedGradient(alpha=0.5),
    "rg": nmm.ReducedGradient(alpha=0.5),
    "dls": nmm.DampedLeastSquares(alpha=0.5),
}


@pytest.mark.parametrize("if_possible", [False, True])
def test_no_program_finds_more_for_any_level(if_possible: bool) -> None:
    """Linear ones for the rates and for limits that are kept if possible, a quadratic one for the rest."""
    offs = [compared(problem) for problem in problems(30, 2, if_possible=if_possible)]
    worst = Off(*np.array(offs).max(axis=0).tolist())
    assert worst.rate <= 1e-8
    assert worst.kept <= 1e-8
    assert worst.nearer <= 1e-9
    assert worst.broken <= 1e-11


@pytest.mark.parametrize("name", RESOLVERS)
def test_a_level_below_changes_nothing_above(name: str) -> None:
    scaled = 0
    for problem in problems(60, 3, if_possible=False):
        levels = tuple(problem.levels or ())
        rates = []
        for kept in (1, 2, 3):
            s = sum(levels[:kept])
            J, rate = np.asarray(problem.J)[:s], np.asarray(problem.rate)[:s]
            limits = {
                name: getattr(problem, name)
                for name in ("u_lower", "u_upper", "limit_rows", "lower", "upper")
            }
            answer = RESOLVERS[name].resolve(Problem(J, rate, problem.h, levels=levels[:kept], **limits))
            rates.append(J @ answer.u)
            scaled += answer.nu[0] < 1.0
        first, second = levels[0], levels[0] + levels[1]
        np.testing.assert_allclose(rates[1][:first], rates[0], rtol=0, atol=1e-9)
        np.testing.assert_allclose(rates[2][:second], rates[1], rtol=0, atol=1e-9)
    assert scaled > 30


@pytest.mark.parametrize("if_possible", [False, True])
def test_where_the_step_before_ended_changes_no_answer(if_possible: bool) -> None:
    resolver = nmm.ProjectedGradient(alpha=0.5)
    for problem in problems(40, 4, if_possible=if_possible):
        cold = resolver.resolve(problem)
        arrays, setup = problem.arrays, resolver.setup(problem.dimensions)
        for _ in range(2):  # the second time from the limits that held the first back
            answer = unanswered(len(cold.u), len(arrays.ends))
            resolver.kernel(arrays, setup.numbers, setup.options, State().memory, answer)
        assert arrays.active.any() or cold.status is Status.SOLVED
        np.testing.assert_allclose(answer.u, cold.u, rtol=0, atol=1e-9)


def test_each_level_starts_with_the_limits_that_held_it_back_before() -> None:
    resolver, differ = nmm.ProjectedGradient(alpha=0.5), 0
    for problem in problems(40, 4, if_possible=False):
        arrays, setup = problem.arrays, resolver.setup(problem.dimensions)
        sets = arrays.active.reshape(len(arrays.ends) + 1, -1)  # a view
        for _ in range(3):
            before, answer = sets.copy(), unanswered(len(arrays.h), len(arrays.ends))
            resolver.kernel(arrays, setup.numbers, setup.options, State().memory, answer)
        for one, other in zip(sets, before, strict=True):
            assert {*one[1 : 1 + one[0]]} == {*other[1 : 1 + other[0]]}
        differ += sets[0, 0] > 0 < sets[1, 0] and {*sets[0, 1 : 1 + sets[0, 0]]} != {
            *sets[1, 1 : 1 + sets[1, 0]]
        }
    assert differ > 5


def in_turn(problem: Problem, u0: np.ndarray) -> np.ndarray:
    """Each level by its pseudoinverse in the null space of those above; the objective in that of all."""
    J, rate, first = np.asarray(problem.J), np.asarray(problem.rate), 0
    u, P = np.zeros(J.shape[1]), np.eye(J.shape[1])
    for rows in problem.levels or ():
        A = J[first : first + rows]
        inverse = np.linalg.pinv(A @ P, rcond=1e-9)
        u = u + inverse @ (rate[first : first + rows] - A @ u)
        P = P - inverse @ (A @ P)
        first += rows
    return u + P @ u0


@pytest.mark.parametrize("name", ["pg", "rg", "dls"])
def test_levels_that_contradict_each_other_get_what_is_left(name: str) -> None:
    rng = np.random.default_rng(5)
    for _ in range(20):
        J, rate, h = rng.standard_normal((6, 8)), rng.standard_normal(6), rng.standard_normal(8)
        J[3], J[5] = J[0] + J[1], 2.0 * J[4]
        problem = Problem(J, rate, h, levels=(2, 2, 2))
        answer = RESOLVERS[name].resolve(problem)
        np.testing.assert_allclose(answer.u, in_turn(problem, -0.5 * h), rtol=0, atol=1e-9)
        assert answer.status is Status.RELAXED
        assert answer.nu[0] == 1.0
        assert np.all(answer.nu[1:] < 1.0)


@pytest.mark.parametrize("name", ["pg", "dls"])
def test_levels_below_may_have_more_rows_than_there_are_inputs(name: str) -> None:
    rng = np.random.default_rng(6)
    J, rate, h = rng.standard_normal((7, 5)), rng.standard_normal(7), rng.standard_normal(5)
    answer = RESOLVERS[name].resolve(Problem(J, rate, h, levels=(3, 4)))
    np.testing.assert_allclose(J[:3] @ answer.u, rate[:3], rtol=0, atol=1e-9)
    np.testing.assert_allclose(answer.u, in_turn(Problem(J, rate, h, levels=(3, 4)), -0.5 * h), atol=1e-8)
    tall = Problem(J, rate, h, levels=(6, 1))
    if name == "dls":  # in the least-squares sense: what is left is normal to what the inputs can do
        left = J[:6] @ RESOLVERS[name].resolve(tall).u - rate[:6]
        np.testing.assert_allclose(J[:6].T @ left, 0.0, atol=1e-6)
        assert np.abs(left).max() > 0.1
    else:
        with refused("task: first level", got=6):
            RESOLVERS[name].resolve(tall)
    with refused("task", got=7):
        RESOLVERS["rg"].resolve(Problem(J, rate, h, levels=(3, 4)))


@pytest.mark.parametrize("priority", [0, -1, 1.5, True])
def test_a_priority_is_a_whole_number_above_0(priority: float) -> None:
    function = nmm.Position("ee", axes="xy")
    with refused("priority"):
        nmm.Task(function, nmm.Constant([1.0, 0.0]), priority=priority)  # type: ignore[arg-type]  # bad input
    with refused("priority"):
        nmm.Bound(function, upper=1.0, priority=priority)  # type: ignore[arg-type]  # bad input


def test_in_a_hurry_the_path_gives_way_and_the_tray_stays_level() -> None:
    """The scenario's path in 5 s instead of 20, faster than the base can follow."""
    times = [0, 1.25, 2.5, 3.75, 5]
    scenario = nmm.Scenario.load("tiago_tray").override("duration", 5).override("dt", 0.02)
    for key in ("task.2.reference.times", "task.3.at.times"):
        scenario = scenario.override(key, times)
    run = scenario.run()
    assert run.scale[:, 0].min() == 1.0
    assert run.scale[:, 1].min() < 0.6
    assert np.abs(run.error[:, :2]).max() < 0.003  # what it begins with
    assert np.abs(run.error[:, 2:5]).max() > 0.2


def test_limits_that_are_kept_if_possible_bind_and_disturb_no_task() -> None:
    scenario = nmm.Scenario.load("two_arms_box").override("dt", 0.02)
    run, free = scenario.run(), scenario.override("limits.bounds", []).run()
    assert run.outcome is nmm.Outcome.COMPLETED
    assert np.abs(run.error - free.error).max() < 1e-6
    hands = [nmm.Heading(f"{side}_tool0", "z", "x") for side in ("left", "right")]

    def highest(motion: nmm.Trajectory) -> float:
        configurations = [nmm.Configuration(scenario.robot(), q) for q in motion.q[::20]]
        return max(nmm.evaluate(hand, 0.0, at).value[0] for hand in hands for at in configurations)

    assert highest(run) <= -1.4 + 1e-3  # its direction turns
    assert highest(free) > -1.35  # without the limits they look elsewhere


def test_the_extended_jacobian_names_the_level_that_contradicts_and_damps_it() -> None:
    """A distance that the hand's position decides: the added task is then one more level, as of `pg`."""
    robot = nmm.load("unicycle_3r")
    hand = nmm.Task(nmm.Position("ee"), [1.2, 0.3, 0.8], 1.0)
    far = nmm.Task(nmm.Distance("ee", [0, 0, 0]), [1.0], priority=2, name="far")
    bend = nmm.Task(nmm.LinearCoordinates("q2"), [0.5])
    q = robot.q({"q1": 0.4, "q2": 0.6, "q3": 0.9})
    stops = nmm.Controller(robot, [hand, far], nmm.ExtendedJacobian(), added_task=bend)
    with pytest.raises(
        nmm.SingularError, match=r"ee\.distance; level 2 \(far\) asks for what the levels above"
    ):
        stops(0.0, q)
    damped = nmm.ExtendedJacobian(singular="damped")
    step = nmm.Controller(robot, [hand, far], damped, added_task=bend).evaluate(0.0, q)
    levels = [hand, far, nmm.Task(bend.function, bend.reference, priority=3)]
    three = nmm.Controller(robot, levels, nmm.ProjectedGradient()).evaluate(0.0, q)
    assert step.status is Status.RELAXED
    assert step.scale[1] < 1.0 == step.scale[0]
    np.testing.assert_allclose(step.u, three.u, rtol=0, atol=1e-12)
    np.testing.assert_allclose(step.J[:3] @ step.u, step.rate[:3], rtol=0, atol=1e-12)
    assert step.u[robot.input("q2")] == pytest.approx(0.5 - 0.6)
    # Where no level contradicts another it is J_e's answer, to the bit.
    look = nmm.Task(nmm.LinearCoordinates("q1"), [0.0], priority=2)
    u = [
        nmm.Controller(robot, [hand, look], one, added_task=bend)(0.0, q) for one in (damped, stops.resolver)
    ]
    assert np.array_equal(u[0], u[1])
