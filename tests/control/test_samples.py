"""What belongs to a sample: its length, its bounds, its retreat; and events counted once."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from findings import every
from wandering import beyond

import nmm
from nmm.control.resolvers.partitions import PartitionState

ROBOT = nmm.load("unicycle_3r")
Q0 = ROBOT.q({"q1": -1.0, "q2": 0.7, "q3": 0.5})
DT, A = 0.02, 2.0


def reaching(resolver: nmm.extending.Resolver | None = None, **more: object) -> nmm.Controller:
    limits = nmm.Limits({"platform": 0.5, "arm": 0.8}, {"q2": [0.2, 0.9]}, acceleration=A)
    task = nmm.Task(nmm.Position("ee"), [1.0, 0.0, 9.0], gain=2.0)
    given = {"limits": limits, "dt": DT} | more
    return nmm.Controller(ROBOT, task, resolver or nmm.ProjectedGradient(alpha=1.0), **given)  # type: ignore[arg-type]


@pytest.mark.parametrize("method", ["zoh", "rk4"])
@pytest.mark.parametrize("duration", [0.1 + 0.1 * DT, 0.4 + 0.5 * DT])
def test_accelerations_count_over_the_time_that_passed(method: str, duration: float) -> None:
    """Also where the last sample is shorter; what comes before it stays as it is."""
    controller = reaching()
    run = nmm.simulate(controller, Q0, duration, DT, method)
    steps = np.diff(run.t)
    assert steps[-1] < 0.8 * DT
    change = np.abs(np.diff(run.u, axis=0))
    assert np.all(change <= A * steps[:, np.newaxis] + 1e-12)
    assert change[-1].max() == pytest.approx(A * steps[-1])  # the bound is what holds it
    assert np.abs(run.u[0]).max() <= A * DT + 1e-12
    assert beyond(run.q[:, ROBOT.coordinate("q2")], np.array([0.2, 0.9])) <= 1e-11
    longer = nmm.simulate(reaching(), Q0, duration + DT, DT, method)
    np.testing.assert_array_equal(longer.u[: len(run) - 1], run.u[:-1])
    assert float(controller.solver.sample.elapsed) == controller.dt == DT


def stages(controller: nmm.Controller, between: Callable[[], object]) -> list[np.ndarray]:
    """Inputs of calls and stages after them, with something done in between."""
    found, q = [], Q0.copy()
    for k in range(20):
        found.append(controller(k * DT, q))
        q_dot = controller.last(k * DT, q).q_dot
        between()
        found.append(controller.velocity((k + 0.5) * DT, q + 0.5 * DT * q_dot))
        q = q + DT * q_dot
    return found


@pytest.mark.parametrize("kind", ["evaluate", "without_limits"])
@pytest.mark.parametrize("step", ["constant", "armijo"])
def test_a_look_between_a_call_and_its_stages_changes_neither(kind: str, step: str) -> None:
    def controller() -> nmm.Controller:
        resolver = nmm.ProjectedGradient(alpha=200.0, step=step)
        retreat = nmm.Retreat(stalled=0.1, durations=[0.06])
        return reaching(resolver, objective=nmm.Quadratic(nmm.QuadraticTerm("q3")), retreat=retreat)

    elsewhere = ROBOT.q({"x": 0.4, "theta": 2.0, "q1": 1.0, "q2": 0.3, "q3": -0.5})
    looked = controller()

    def look() -> None:
        if kind == "evaluate":
            looked.evaluate(3.0, elsewhere)
        else:
            with looked.without_limits():
                looked(3.0, elsewhere)

    for one, other in zip(stages(looked, look), stages(controller(), lambda: None), strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("limited", [True, False])
def test_a_retreat_holds_at_its_samples_stages_and_is_counted_by_samples(limited: bool) -> None:
    more = {} if limited else {"limits": None}
    controller = reaching(retreat=nmm.Retreat(stalled=0.2, durations=[0.2]), **more)
    away = 0
    for k in range(30):
        controller(k * DT, Q0)
        sample = controller.last(k * DT, Q0)
        count = sample.retreats
        for _ in range(3):
            # A stage begins with the bounds that its sample found active, and adds them up in their order.
            np.testing.assert_allclose(controller.velocity(k * DT, Q0), sample.q_dot, rtol=0.0, atol=1e-15)
        assert controller.solver.retreat_state is not None
        assert controller.solver.retreat_state.count == count
        away += controller.solver.retreat_state.now
    assert away == pytest.approx(0.2 / DT, abs=1)  # 10 waiting, 10 away, 10 waiting


class Doubtful(PartitionState):
    """A partition whose every third step may not stand the first time."""

    asked = 0

    def may_stand(self, before: np.ndarray) -> bool:
        type(self).asked += 1
        return type(self).asked % 7 != 0


class Doubting(nmm.ReducedGradient):
    def start(self, dimensions: object) -> PartitionState:
        Doubtful.asked = 0
        return Doubtful(dimensions.s, True)  # type: ignore[attr-defined]


@pytest.mark.parametrize("method", ["zoh", "rk4"])
def test_events_of_steps_that_are_taken_again_count_once(method: str) -> None:
    """Retreats begin and end when they do where every step stands, and a warning counts a sample once.

    The one run flies between retreats, the other is Python's: with the same kinematics, to the last digit.
    """
    corridor = nmm.Bound(nmm.Position("base_link", "x"), 0.5, 1.0, name="corridor")
    wall = nmm.Bound(nmm.Position("base_link", "x"), -1.0, -0.5, name="wall")
    limits = nmm.Limits({"platform": 0.5, "arm": 0.8}, acceleration=A, bounds=[corridor, wall], recovery=0.3)
    runs = [
        nmm.simulate(
            reaching(
                kind(alpha=1.0),
                limits=limits,
                retreat=nmm.Retreat(stalled=0.2, durations=[0.1]),
                kinematics="compiled",
            ),
            *(Q0, 1.0, DT, method),
        )
        for kind in (nmm.ReducedGradient, Doubting)
    ]
    assert Doubtful.asked > 50
    np.testing.assert_array_equal(runs[1].u, runs[0].u)
    events = [[every(run, code) for code in ("backed_off", "limit_contradicted")] for run in runs]
    assert events[0] == events[1]
    backed_off, contradicted = events[0]
    assert len(backed_off) == 1
    assert contradicted
    for one in contradicted:
        assert one.values["samples"] <= len(runs[0])
