"""Tasks that come and go: when, without a jump of the inputs, and what a run says of it."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from findings import every, refused, the, why

import nmm
from nmm.control.sequencing.sequence import Moment, Sequence

ROBOT = nmm.load("unicycle_3r")
START = ROBOT.q({"q1": 0.4, "q2": 0.6, "q3": 0.9})
#: Largest change of an input a second.
A = 2.0
DT = 0.01
RESOLVERS = {"pg": nmm.ProjectedGradient(alpha=1.0), "rg": nmm.ReducedGradient(alpha=1.0)}


def reach(name: str = "reach", target: tuple[float, ...] = (1.4, 0.3, 0.8), **more: object) -> nmm.Task:
    return nmm.Task(nmm.Position("ee", "xyz"), target, 2.0, name=name, **more)  # type: ignore[arg-type]


def aim(when: object, **more: object) -> nmm.Task:
    task = {"gain": 1.0, "priority": 2, "name": "aim"} | more
    return nmm.Task(nmm.LinearCoordinates("q1"), [0.0], when=when, **task)  # type: ignore[arg-type]


def controlled(*tasks: nmm.Task, resolver: str = "pg", **more: object) -> nmm.SequencedController:
    return nmm.SequencedController(ROBOT, tasks, RESOLVERS[resolver], **more)  # type: ignore[arg-type]


def list_events(run: nmm.Trajectory) -> list[tuple[float, str, str]]:
    return [(round(event.t, 9), event.task, event.what) for event in run.events]


@pytest.mark.parametrize("method", ["rk4", "zoh"])
@pytest.mark.parametrize("resolver", RESOLVERS)
def test_inputs_change_by_no_more_than_accelerations_allow(resolver: str, method: str) -> None:
    tasks = reach(), aim(nmm.Between(0.5, 1.2)), reach("later", (1.2, 0.5, 0.9), when=nmm.Between(1.0))
    tasks = (
        tasks[0],
        tasks[1],
        nmm.Task(nmm.LinearCoordinates("q3"), [0.2], name="bend", priority=3, when=nmm.Between(0.8)),
    )
    free = nmm.simulate(controlled(*tasks, resolver=resolver), START, 1.6, DT, method)
    run = nmm.simulate(
        controlled(*tasks, resolver=resolver, limits=nmm.Limits(acceleration=A)), START, 1.6, DT, method
    )
    expected = [(0.5, "aim", "begins"), (0.8, "bend", "begins"), (1.2, "aim", "ends")]
    assert list_events(run) == list_events(free) == expected
    assert np.abs(np.diff(free.u, axis=0)).max() > 3 * A * DT  # there is something to be bounded
    assert np.abs(np.diff(run.u, axis=0)).max() <= A * DT + 1e-12


def test_stages_keep_the_bounds_of_their_sample() -> None:
    controller = controlled(reach(), aim(nmm.Between(0.5)), limits=nmm.Limits(acceleration=A), dt=DT)
    q, before = START, np.zeros(ROBOT.n_u)
    for k in range(60):
        u = controller(k * DT, q)
        assert np.abs(u - before).max() <= A * DT + 1e-12
        for share in (0.5, 1.0):
            q_dot = controller.velocity((k + share) * DT, q + share * DT * controller.velocity(k * DT, q))
            S = nmm.Configuration(ROBOT, q + share * DT * controller.velocity(k * DT, q)).S
            stage = np.linalg.lstsq(S, q_dot, rcond=None)[0]
            assert np.abs(stage - before).max() <= A * DT + 1e-9
        q, before = q + DT * controller.velocity(k * DT, q), u
    assert [event.task for event in controller.events] == ["aim"]


@pytest.mark.parametrize("resolver", RESOLVERS)
def test_a_lower_task_that_comes_and_goes_changes_nothing_above(resolver: str) -> None:
    """At every sample, the same robot at the same q with the same inputs before, without the lower task."""
    run = nmm.simulate(controlled(reach(), aim(nmm.Between(0.3, 0.8)), resolver=resolver), START, 1.2, DT)
    alone = nmm.Controller(ROBOT, reach(), RESOLVERS[resolver])
    differ = 0.0
    for k in range(len(run)):
        alone.reset()
        step = alone.evaluate(float(run.t[k]), run.q[k])
        np.testing.assert_allclose(step.J @ run.u[k], step.J @ step.u, rtol=0, atol=1e-9)
        differ = max(differ, float(np.abs(step.u - run.u[k]).max()))
    assert differ > 1e-2


def test_a_run_is_its_parts_glued_by_hand() -> None:
    run = nmm.simulate(controlled(reach(), aim(nmm.Between(0.5))), START, 1.0, DT)
    first = nmm.simulate(nmm.Controller(ROBOT, reach(), RESOLVERS["pg"]), START, 0.5, DT)
    both = nmm.Controller(ROBOT, [reach(), aim(())], RESOLVERS["pg"])
    second = nmm.simulate(both, first.q[-1], 0.5, DT)
    np.testing.assert_allclose(run.q, np.vstack([first.q[:-1], second.q]), rtol=0, atol=1e-12)
    np.testing.assert_allclose(run.u, np.vstack([first.u[:-1], second.u]), rtol=0, atol=1e-11)
    assert np.isnan(run.error[:50, 3]).all()
    np.testing.assert_allclose(run.error[50:], second.error, rtol=0, atol=1e-12)


def test_after_a_task_in_its_place() -> None:
    then = reach("then", (1.0, 0.4, 1.0), when=nmm.After("reach", within=0.02, hold=0.1, instead=True))
    run = nmm.simulate(controlled(reach(), then), START, 4.0, DT)
    size = np.linalg.norm(run.error[:, :3], axis=1)
    k = int(np.flatnonzero(size <= 0.02)[0])
    assert list_events(run) == [
        (round((k + 10) * DT, 9), "reach", "ends"),
        (round((k + 10) * DT, 9), "then", "begins"),
    ]
    assert np.isnan(run.error[k + 10 :, :3]).all()
    assert np.isfinite(run.error[k + 10 :, 3:]).all()
    assert run.r_names[0] == "reach: ee.x"
    assert run.r_names[3] == "then: ee.x"
    assert run.complete
    assert np.linalg.norm(run.error[-1, 3:]) < 0.01


def test_while_a_function_is_within_bounds_with_hysteresis() -> None:
    """The arm swings through the bound: events where the coordinate says, and at no other time."""
    turns = nmm.CallableReference(
        lambda t: [0.5 * np.cos(3.0 * t)], 1, rate=lambda t: [-1.5 * np.sin(3.0 * t)], unit="rad"
    )
    swing = nmm.Task(nmm.LinearCoordinates("q1"), turns, 5.0, name="swing")
    bend = nmm.Task(
        nmm.LinearCoordinates("q3"),
        [0.5],
        name="bend",
        when=nmm.While(nmm.LinearCoordinates("q1"), 0.1, margin=0.2),
    )
    run = nmm.simulate(controlled(swing, bend), START, 3.5, DT)
    q1, inside, expected = run.q[:, 3], False, []
    for k, value in enumerate(q1):
        now = value >= (-0.1 if inside else 0.1)
        if now != inside:
            expected.append((round(k * DT, 9), "bend", "begins" if now else "ends"))
        inside = now
    assert list_events(run) == expected
    assert len(expected) >= 3


def test_where_no_task_is_active_the_objective_is_left_and_rest_where_there_is_none() -> None:
    between = aim(nmm.Between(0.5, 1.0), priority=1)
    rest = nmm.simulate(controlled(between), START, 2.0, DT)
    np.testing.assert_array_equal(rest.u[:50], 0.0)
    np.testing.assert_array_equal(rest.u[100:], 0.0)
    moved = nmm.simulate(
        controlled(between, objective=nmm.Quadratic(nmm.QuadraticTerm("q3", 0.0))), START, 0.4, DT
    )
    step = nmm.Controller(
        ROBOT, reach(), RESOLVERS["pg"], nmm.Quadratic(nmm.QuadraticTerm("q3", 0.0))
    ).evaluate(0.0, START)
    np.testing.assert_allclose(moved.u[0], -step.h, rtol=0, atol=1e-14)  # α = 1
    rate = step.h[ROBOT.input("q3")] / START[5]  # h is linear in q3
    np.testing.assert_allclose(moved.q[:, 5], START[5] * np.exp(-rate * moved.t), rtol=0, atol=1e-8)


def test_a_condition_that_never_held_is_told() -> None:
    later = aim(nmm.After("reach", within=1e-9)), aim(nmm.While(nmm.LinearCoordinates("q2"), 5.0), name="far")
    run = nmm.simulate(controlled(reach(), *later), START, 0.5, DT)
    assert run.events == ()
    missing = {one.values["task"]: one.values["missing"] for one in every(run, "task_never_began")}
    assert missing == {"aim": ["reach did not stay within 1e-09 for 0.1 s"], "far": ["q2 is not at least 5"]}
    goal = nmm.simulate(controlled(reach(), *later), START, 0.5, DT, until=nmm.Goal())
    assert goal.outcome is nmm.Outcome.MISSED
    assert why(goal) == ["nothing_to_reach", "task_never_began", "task_never_began"]


def test_events_are_kept_shown_and_read_back(tmp_path: Path) -> None:
    run = nmm.simulate(controlled(reach(), aim(nmm.Between(0.2, 0.4))), START, 0.6, DT)
    folder = run.save(tmp_path / "run")
    again = nmm.Trajectory.load(folder)
    assert again.events == run.events
    np.testing.assert_array_equal(again.error, run.error)
    summary = run.summary()
    assert [event["what"] for event in summary["events"]] == ["begins", "ends"]
    assert np.isfinite(summary["error_max"])
    assert summary["redundancy"]["kinematic"] == ROBOT.n_u - 4
    drawn = {line.get_xdata()[0] for axes in nmm.figures.errors(run).axes for line in axes.lines}
    assert {0.2, 0.4} <= drawn


def test_what_does_not_fit_is_said() -> None:
    def together(*tasks: nmm.Task, resolver: nmm.extending.Resolver = RESOLVERS["pg"]) -> None:
        nmm.SequencedController(ROBOT, tasks, resolver)

    with refused("task aim: when: after", got="reech", available=["reach"]):
        together(reach(), aim(nmm.After("reech")))
    with refused("task reach: when: after", got=["reach", "aim", "reach"]):
        together(reach(when=nmm.After("aim")), aim(nmm.After("reach")))
    with refused("task aim: when: after", got=["aim", "aim"]):
        together(reach(), aim(nmm.After("aim")))
    with refused("name", got="reach"):
        together(reach(), reach())
    with refused("task aim: when: after: within", got="rad"):
        together(reach(), aim(nmm.After("reach", within={"rad": 0.1})))
    with refused("task aim: when: while: upper", got=2):
        together(reach(), aim(nmm.While(nmm.LinearCoordinates("q1"), upper=[1.0, 2.0])))
    with refused("resolver ej"):
        together(reach(), aim(nmm.Between(1.0)), resolver=nmm.ExtendedJacobian())
    with refused("task aim: when"):
        nmm.Controller(ROBOT, [reach(), aim(nmm.Between(1.0))], RESOLVERS["pg"])


@pytest.mark.parametrize(
    ("made", "fields"),
    [
        (lambda: nmm.Between(2.0, 1.0), {"where": "end", "got": 1.0}),
        (lambda: nmm.While(nmm.LinearCoordinates("q1")), {"where": "lower"}),
        (lambda: nmm.While(nmm.LinearCoordinates("q1"), 1.0, 0.0), {"where": "lower"}),
        (lambda: nmm.While("q1", 0.0), {"where": "while", "got": "q1"}),
        (lambda: nmm.While(nmm.LinearCoordinates("q1"), 0.0, margin=-1.0), {"where": "margin", "got": -1.0}),
        (lambda: nmm.After(""), {"where": "after", "got": ""}),
        (lambda: nmm.After("reach", within=0.0), {"where": "within", "got": 0.0}),
        (lambda: nmm.After("reach", hold=-1.0), {"where": "hold", "got": -1.0}),
        (lambda: aim("soon"), {"where": "when", "got": "soon"}),
    ],
)
def test_conditions_that_are_none_are_refused(made: object, fields: dict[str, Any]) -> None:
    with refused(**fields):
        made()  # type: ignore[operator]


def test_more_rows_than_inputs_at_an_event_end_the_run() -> None:
    crowded = nmm.Task(nmm.Posture(), [0.0, 0.5, 0.5], name="posture", when=nmm.Between(0.2))
    run = nmm.simulate(controlled(reach(), crowded), START, 0.5, DT)
    assert run.outcome is nmm.Outcome.FAILED
    assert (
        "at t = 0.2 s: with reach and posture: task: expected at most 5 rows"
        in the(run, "failed").values["text"]
    )
    assert run.t[-1] == pytest.approx(0.19)


def test_a_scenario_names_the_key() -> None:
    scenario = nmm.Scenario.load("unicycle_3r_sequence")
    with refused("unicycle_3r_sequence.yaml: set task.1.when.task", got="firts", kind=nmm.ScenarioError):
        scenario.override("task.1.when.task", "firts").controller()
    with refused("unicycle_3r_sequence.yaml: set task.2.when.upper", got="high", kind=nmm.ScenarioError):
        scenario.override("task.2.when.upper", "[1, 2, 3, high]").controller()
    with refused("unicycle_3r_sequence.yaml: set task.2.when.margin", got=-1.0, kind=nmm.ScenarioError):
        scenario.override("task.2.when.margin", "-1").controller()
    run = scenario.run()
    assert [(event.task, event.what) for event in run.events] == [
        ("first", "ends"),
        ("second", "begins"),
        ("turn", "begins"),
    ]
    assert run.complete
    assert np.abs(np.diff(run.u, axis=0)).max() <= 2.0 * run.dt + 1e-12


def test_points_held_one_after_another_are_marks_not_a_path() -> None:
    """A desired path between them was drawn, which no task asked for; what moves stays a path."""
    run = nmm.Scenario.load("unicycle_3r_sequence").override("dt", "0.02").override("duration", "5").run()
    assert len(run.events) == 2
    assert run.marks == pytest.approx(np.array([[-2.0, 1.0, 0.6], [-3.0, 3.0, 0.8]]))
    assert run.moving is None
    motion = run.motion()
    assert motion.desired is None
    assert np.array_equal(motion.target, run.marks)
    still = run.desired.copy()
    still[: len(run) // 3, 0] = np.linspace(0.0, 1.0, len(run) // 3)
    moved = replace(run, desired=still)
    event = int(np.searchsorted(run.t, run.events[0].t))
    assert np.array_equal(moved.moving, still[:event])
    assert moved.marks == pytest.approx(np.array([[-3.0, 3.0, 0.8]]))


@pytest.mark.parametrize("method", ["rk4", "zoh"])
def test_a_retreat_goes_on_over_events_and_is_told_once(method: str) -> None:
    """A robot that backs off does no task: a lower one that begins meanwhile changes nothing of it."""
    far = reach("far", (1.4, 0.3, 3.0))
    given = {"limits": nmm.Limits(acceleration=A), "retreat": nmm.Retreat()}
    damped = nmm.DampedLeastSquares(alpha=1.0)
    plain = nmm.simulate(nmm.Controller(ROBOT, far, damped, **given), START, 4.0, 0.02, method)
    lower = aim(nmm.Between(1.8, 2.4))
    run = nmm.simulate(
        nmm.SequencedController(ROBOT, [far, lower], damped, **given), START, 4.0, 0.02, method
    )
    assert list_events(run) == [(1.8, "aim", "begins"), (2.4, "aim", "ends")]
    assert the(plain, "backed_off").values["times"][0] == pytest.approx(1.62)
    while_off = plain.t < 2.62  # from 1.62 s for a second
    np.testing.assert_allclose(run.u[while_off], plain.u[while_off], rtol=0, atol=1e-9)
    found = the(run, "backed_off")
    assert found.values["times"] == pytest.approx([1.62])
    leg = {"tasks": ["far"], "start": 0.0, "end": 1.8, "also": [2.4]}
    assert found.where["leg"] == {
        key: pytest.approx(value) if key != "tasks" else value for key, value in leg.items()
    }


@pytest.mark.parametrize("then", ["by time", "converged"])
def test_an_adaptive_method_sees_the_events_of_one_with_fixed_steps(then: str) -> None:
    """Steps end at samples, where conditions are looked at: no step goes over an event."""
    tasks = {
        "by time": [reach(), aim(nmm.Between(0.5, 1.1))],
        "converged": [reach(), reach("then", (1.0, 0.4, 1.0), when=nmm.After("reach", 0.02, instead=True))],
    }[then]
    adaptive = nmm.simulate(controlled(*tasks), START, 2.5, 0.05, "adaptive")
    fixed = nmm.simulate(controlled(*tasks), START, 2.5, 0.005)
    assert adaptive.complete
    assert adaptive.warnings == ()
    if then == "by time":
        assert list_events(adaptive) == list_events(fixed)
        np.testing.assert_allclose(adaptive.q, fixed.q[::10], rtol=0, atol=1e-8)
    else:  # a coarser grid of samples sees it later, by less than two of them
        assert [one[1:] for one in list_events(adaptive)] == [one[1:] for one in list_events(fixed)]
        assert 0.0 <= list_events(adaptive)[0][0] - list_events(fixed)[0][0] < 0.1
        same = nmm.simulate(controlled(*tasks), START, 2.5, 0.05)
        assert list_events(adaptive) == list_events(same)
        np.testing.assert_allclose(adaptive.q, same.q, rtol=0, atol=1e-5)
    with refused("method", got="adaptive"):
        nmm.simulate(controlled(*tasks, limits=nmm.Limits(acceleration=A)), START, 1.0, DT, "adaptive")


def test_what_legs_have_in_common_is_told_once() -> None:
    """Three targets too far for a slow robot: one warning a kind, with when the legs began."""
    slow = nmm.Limits(velocity={"platform": 0.3, "arm": 0.3})
    goals = [(2.0, 0.3, 0.8), (2.5, 0.3, 0.8), (3.0, 0.3, 0.8)]
    tasks = [reach("a", goals[0], when=nmm.Between(0, 1)), reach("b", goals[1], when=nmm.Between(1, 2))]
    tasks.append(reach("c", goals[2], when=nmm.Between(2)))
    run = nmm.simulate(controlled(*tasks, limits=slow), START, 12.0, 0.02)
    assert run.complete
    kinds = [one[0].code for one in run.verdict.warnings]
    assert len(set(kinds)) == len(kinds)
    leg = the(run, "inputs_unmet").where["leg"]
    assert leg == {"tasks": ["a"], "start": 0.0, "end": 1.0, "also": [1.0, 2.0]}
    first = next(one for one in run.warnings if "did not do all" in one)
    assert first.startswith("with a from t = 0 to 1 s: the inputs did not do all")
    assert first.endswith("likewise with the tasks from t = 1 and 2 s on")


@pytest.mark.parametrize("lazy", [0, 4, 3], ids=["none", "first leg", "last leg"])
def test_a_leg_is_judged_from_its_beginning_and_the_one_that_did_too_little_is_named(lazy: int) -> None:
    """A target that goes away once its task has ended is nobody's fault; rates not given are told."""

    def resolved(problem: nmm.Problem) -> np.ndarray:
        share = 0.3 if len(problem.rate) == lazy else 1.0
        return share * np.linalg.pinv(problem.J) @ problem.rate

    away = nmm.CallableReference(
        lambda t: [0.5 + 4.0 * max(t - 1.0, 0.0)], 1, rate=lambda t: [4.0 * (t > 1.0)], unit="rad"
    )
    swing = nmm.Task(nmm.LinearCoordinates("q3"), away, 5.0, name="swing", when=nmm.Between(0.0, 1.0))
    run = nmm.simulate(
        nmm.SequencedController(ROBOT, [reach(), swing], nmm.CallableResolver(resolved)), START, 4.0, DT
    )
    assert run.error_norm[-1] == pytest.approx(np.linalg.norm(run.error[-1, :3]))  # of what is then active
    assert run.summary()["error_final"] == run.error_norm[-1]
    called = {0: "", 4: "with reach and swing from t = 0 to 1 s", 3: "with reach from t = 1 to 4 s"}[lazy]
    if lazy == 3:
        assert run.outcome is nmm.Outcome.MISSED
        assert run.message.startswith(f"{called}: the error left its expected decay at t = 1")
    else:  # an event ended the leg before it had to be where it was promised
        assert (run.outcome, run.message) == (nmm.Outcome.COMPLETED, "")
    assert {one.split(": ")[0] for one in run.warnings} == ({called} if lazy else set())


def test_a_distance_is_kept_across_events() -> None:
    """A post stands on the way; the least distance is swept over the events, too."""
    post = nmm.Obstacle(nmm.Cylinder(0.1, 3.0), [1.5, 0.0, 0.5])
    tasks = [reach(target=(2.6, 0.3, 0.8)), aim(nmm.Between(0.5, 1.0))]
    kept = nmm.Collisions(0.03, self_collisions=False, obstacles=[post])
    run = nmm.simulate(
        controlled(*tasks, collisions=kept, limits=nmm.Limits(acceleration=A)), START, 1.5, 0.02
    )
    assert [event.what for event in run.events] == ["begins", "ends"]
    assert len(run.clearance) == len(run.clearance_between) == len(run)
    assert run.clearance_between.min() >= 0.03 - 1e-6
    assert run.clearance.min() < 0.5


def remembered(stack: nmm.Stack, robot: nmm.Robot, before: Moment, t: float, q: np.ndarray) -> list[float]:
    """What a sequence remembers of its conditions, once more: `Moment.memory`."""
    named = {task.name: i for i, task in enumerate(stack)}
    here = nmm.Configuration(robot, q)
    found = []
    conditions = [one for task in stack for one in task.when]
    for one, was in zip(conditions, before.memory, strict=True):
        if isinstance(one, nmm.Between):
            found.append(float(one.start - 1e-9 <= t < one.end - 1e-9))
        elif isinstance(one, nmm.While):
            value, wider = nmm.evaluate(one.function, t, here).value, one.margin if was else 0.0
            found.append(float(np.all((one.lower - wider <= value) & (value <= one.upper + wider))))
        else:
            task = stack.tasks[named[one.task]]
            error = nmm.evaluate(task.reference, t, here).value - nmm.evaluate(task.function, t, here).value
            rows = task.rows(robot)
            error = [
                math.remainder(e, math.tau) if row.angular else e for e, row in zip(error, rows, strict=True)
            ]
            sizes: dict[str, list[float]] = {}
            for e, row in zip(error, rows, strict=True):
                sizes.setdefault(row.unit, []).append(e)
            within = all(
                math.hypot(*part) <= one.within.get(unit, one.within.get("", math.inf))
                for unit, part in sizes.items()
            )
            if was == -math.inf:
                found.append(was)
            elif not (before.active[named[one.task]] and within):
                found.append(math.nan)
            else:
                since = t if math.isnan(was) else was
                found.append(-math.inf if t - since >= one.hold - 1e-9 else since)
    return found


@pytest.mark.parametrize("seed", range(2))
def test_samples_passed_over_are_judged_as_one_by_one(seed: int) -> None:
    """Every kind of condition, on a walk that goes in and out of them, with errors of two units."""
    robot = nmm.load("unicycle_2r")
    inside = nmm.While(nmm.LinearCoordinates("x", "q1"), [-0.5, -0.4], [0.6, 0.5], 0.1)
    at_rest = {"fold": [inside], "turn": [nmm.Between(0.2, 1.5)]}
    at_rest |= {"then": [nmm.After("reach", 0.9, 0.05), nmm.Between(0.1)]}
    at_rest |= {"last": [nmm.After("posed", {"m": 1.2, "rad": 1.0}, 0.1, instead=True)]}
    tasks = nmm.Stack(
        (
            nmm.Task(nmm.Position("ee", "xy"), [1.0, 0.0], name="reach"),
            nmm.Task(nmm.LinearCoordinates("x", "theta"), [0.5, 3.0], name="posed"),
            *(
                nmm.Task(nmm.LinearCoordinates("q1"), [0.0], name=name, when=when)
                for name, when in at_rest.items()
            ),
        )
    )
    sequence = Sequence(tasks, robot)
    rng = np.random.default_rng(seed)
    times = np.arange(400) * 0.01
    q = 0.05 * np.cumsum(rng.standard_normal((400, robot.n)), axis=0)
    alone, known = [], sequence.start
    for t, here in zip(times, q, strict=True):
        expected = remembered(tasks, robot, known, float(t), here)
        known = sequence.next(known, float(t), here)
        assert repr([*known.memory]) == repr(expected)
        alone.append(known)
    k, known, changed = 0, sequence.start, 0
    while k < len(times):
        count, (*_, known) = sequence.pass_over(known, times[k:], q[k:])
        k += count
        if count:
            assert repr(known) == repr(alone[k - 1])
        if k < len(times):
            known = sequence.next(known, float(times[k]), q[k])
            assert repr(known) == repr(alone[k])
            assert known.active != (alone[k - 1].active if k else sequence.start.active)
            k, changed = k + 1, changed + 1
    assert 3 < changed < 100
