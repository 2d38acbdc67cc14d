"""A quantity that samples change is declared once, by its field's kind, and kept by all that keeps a sample.

The resolver here counts its calls three times: among its numbers and in its state, which are declared as
sampled, and among its options, which are not. Its inputs depend on one of the counts.
"""

from __future__ import annotations

import copy
from collections.abc import Callable
from typing import ClassVar, NamedTuple

import numpy as np
import pytest

import nmm
from nmm.base.arrays import Array, Integers
from nmm.base.kernels.compiled import Kernel, kernel
from nmm.base.kernels.record_layout import (
    Cell,
    Memory,
    SampledCell,
    SampledIntegerVector,
    Vector,
    keep,
    put_back,
    views,
)
from nmm.control.resolvers.answer import AnswerArrays, certify
from nmm.control.resolvers.base import RESOLVER, Resolver, Setup, State
from nmm.control.resolvers.problem import Dimensions
from nmm.control.resolvers.problem_arrays import ProblemArrays
from nmm.control.step.idle_inputs import idle_inputs
from nmm.motion import closed_loop
from nmm.motion.compiled_loop import CompiledLoop
from nmm.motion.recording import Recorder

ROBOT = nmm.load("unicycle_2r")
Q0 = ROBOT.q({"q1": 0.5, "q2": 0.7})
DT = 0.01


@kernel(RESOLVER)
def counting(
    problem: ProblemArrays, numbers: Array, options: Integers, state: Integers, answer: AnswerArrays
) -> None:
    """One row: u = J' (rate + 0.1 c) / |J|^2, c = 1 / calls; counts its calls."""
    J = problem.J
    numbers[0] += 1.0
    options[0] += 1
    state[0] += 1
    calls = numbers[0] if options[1] == 1 else float(options[0])
    square = 0.0
    for j in range(J.shape[1]):
        square += J[0, j] * J[0, j]
    for j in range(J.shape[1]):
        answer.u[j] = J[0, j] * (problem.rate[0] + 0.1 / calls) / square
    answer.measure[()] = square
    certify(problem, answer)


class Doubtful(State):
    """What was decided may not stand at every seventh question."""

    asked = 0

    def may_stand(self, before: Integers) -> bool:
        self.asked += 1
        return self.asked % 7 != 0


class Counting(Resolver):
    """Parameters: whether the inputs depend on a count that is kept, and what remembers the other one."""

    name: ClassVar[str] = "counting"
    exact: ClassVar[bool] = False

    def __init__(self, kept: bool = True, state: Callable[[list[int]], State] = State) -> None:
        self.kept, self._state = kept, state

    @property
    def kernel(self) -> Kernel:
        return counting

    def setup(self, dimensions: Dimensions) -> Setup:
        return Setup(np.zeros(1), np.array([0, int(self.kept)]))

    def start(self, dimensions: Dimensions) -> State:
        return self._state([0])


def controlled(kept: bool = True, **more: object) -> nmm.Controller:
    state = more.pop("state", State)
    task = nmm.Task(nmm.Distance("ee", to=[2.0, 1.0, 0.5]), [0.5], gain=1.0)
    limits = nmm.Limits({"platform": 5.0, "arm": 5.0}, acceleration=100.0)
    given = {"limits": limits, "dt": DT} | more
    return nmm.Controller(ROBOT, task, Counting(kept, state), **given)  # type: ignore[arg-type]


def counts(controller: nmm.Controller) -> tuple[int, int, int]:
    """Calls: among the numbers, in the state, among the options."""
    step = controller.solver.step_memory
    return int(step.numbers[0]), int(controller.solver.state.memory[0]), int(step.options[0])


def test_a_look_leaves_no_trace() -> None:
    controller = controlled()
    u = [controller(0.0, Q0), controller(DT, Q0)]
    assert counts(controller) == (2, 2, 2)
    controller.evaluate(3.0, Q0 + 0.1)
    assert counts(controller) == (2, 2, 3)
    with controller.without_limits():
        controller.reset()
        controller(4.0, Q0 + 0.2)
        assert counts(controller)[:2] == (1, 1)
    assert counts(controller) == (2, 2, 4)
    controller.solver.errors(np.zeros(2), np.array([Q0, Q0 + 0.1]))
    idle_inputs(controller.solver, Q0)
    assert counts(controller)[:2] == (2, 2)
    assert counts(controller)[2] > 4
    other = controlled()
    np.testing.assert_array_equal(
        [other(0.0, Q0), other(DT, Q0), other(2 * DT, Q0)], [*u, controller(2 * DT, Q0)]
    )


@pytest.mark.parametrize("kinematics", ["pinocchio", "compiled"])
@pytest.mark.parametrize("method", ["rk4", "midpoint", "zoh"])
def test_stages_of_a_step_leave_no_trace(method: str, kinematics: str) -> None:
    """The step is one compiled call, or four of Python's."""
    controller, q = controlled(kinematics=kinematics), Q0
    for k in range(5):
        q, _ = controller.step(k * DT, q, DT, method)
    assert counts(controller) == (5, 5, 5 * {"rk4": 4, "midpoint": 2, "zoh": 1}[method])


@pytest.mark.parametrize("method", ["rk4", "zoh"])
def test_a_run_that_is_resumed_is_the_run(method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """In compiled code as a whole; stopped there every few samples; and from sample to sample."""

    fly, most = CompiledLoop.__call__, 0

    def stopped(loop: CompiledLoop, times: Array, first: int, last: int, found: object) -> tuple[int, bool]:
        return (fly(loop, times, first, min(last, first + most), found)[0] if most else first), False

    monkeypatch.setattr(CompiledLoop, "__call__", stopped)

    def ran(kept: bool) -> list[np.ndarray]:
        nonlocal most
        found = []
        for most in (1000, 7, 0):
            controller = controlled(kept, kinematics="compiled")
            run = nmm.simulate(controller, Q0, 1.0, DT, method)
            assert run.complete
            found.append(run.u)
            assert counts(controller)[:2] == (len(run), len(run))
            assert counts(controller)[2] > len(run) or (method == "zoh" and most == 0)
        return found

    whole, resumed, stepped = ran(True)
    np.testing.assert_array_equal(resumed, whole)
    np.testing.assert_array_equal(stepped, whole)
    whole, resumed, stepped = ran(False)  # what is not declared as sampled is not kept
    assert np.abs(resumed - whole).max() > 1e-6


@pytest.mark.parametrize("method", ["rk4", "zoh"])
def test_a_step_that_is_taken_again_counts_once(method: str) -> None:
    """Its sample begins with what it found the first time; the state is asked to forget, and does."""
    runs, once, all_calls = [], [], []
    for state in (State, Doubtful):
        controller = controlled(kinematics="compiled", state=state)
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(closed_loop, "compiled_loop", lambda *_: None)
            runs.append(nmm.simulate(controller, Q0, 0.5, DT, method))
        once.append(counts(controller)[0])
        all_calls.append(counts(controller)[2])
    assert isinstance(controller.solver.state, Doubtful)
    assert controller.solver.state.asked > 50
    assert once == [len(runs[0])] * 2
    assert all_calls[1] > all_calls[0]
    np.testing.assert_array_equal(runs[1].q, runs[0].q)


def test_rollouts_are_the_runs_one_by_one() -> None:
    """Each begins with what a new controller has."""
    starts = Q0 + np.linspace(-0.2, 0.2, 5)[:, None]

    def apart(kept: bool) -> float:
        found = nmm.rollout(controlled(kept), starts, 0.3, DT, keep=["u"], threads=2)
        alone = [nmm.simulate(controlled(kept), start, 0.3, DT).u for start in starts]
        return float(np.abs(found["u"] - alone).max())

    assert apart(True) == 0.0
    assert apart(False) > 1e-6  # what is not declared as sampled is not reset


def test_a_copy_and_a_reset_begin_anew() -> None:
    controller = controlled()
    first = controller(0.0, Q0)
    controller(DT, Q0)
    assert counts(copy.copy(controller)) == (0, 0, 0)
    controller.reset()
    assert counts(controller) == (0, 0, 2)
    np.testing.assert_array_equal(controller(0.0, Q0), first)


def test_counters_are_those_of_the_run_after_it() -> None:
    """Judging a run makes others: shorter ones with another dt, and samples without limits."""
    obstacles = [nmm.Obstacle(nmm.Sphere(0.3), [1.2, 0.15, 0.6])]
    collisions = nmm.Collisions(0.05, obstacles=obstacles)
    task = nmm.Task(nmm.Position("ee", "xy"), [9.0, 0.3], gain=3.0)
    limits = nmm.Limits({"platform": 1.0, "arm": 1.5}, acceleration=4.0)
    retreat = nmm.Retreat(stalled=0.1, durations=[0.1])
    resolver = nmm.ProjectedGradient()
    controller = nmm.Controller(
        ROBOT, task, resolver, limits=limits, dt=DT, retreat=retreat, collisions=collisions
    )
    recorders: list[Recorder] = []
    run = nmm.simulate(controller, Q0, 3.0, 2.0 * DT, "zoh", watch=recorders.append)
    (recorder,) = recorders
    assert controller.safety_filter is not None
    assert controller.solver.retreat_state is not None
    assert controller.dt == 2.0 * DT
    np.testing.assert_array_equal(controller.last(3.0, run.q[-1]).u, run.u[-1])
    assert controller.safety_filter.counts == recorder.counts
    assert controller.safety_filter.counts.looked > 0
    assert controller.solver.retreat_state.count == recorder.retreats[-1] > 0


class Inner(NamedTuple):
    x: SampledCell
    y: Cell


class Outer(NamedTuple):
    a: Vector
    b: SampledIntegerVector
    inner: Inner


def test_sampled_fields_of_any_record_are_one_range_of_each_block() -> None:
    memory = Memory()
    places = [
        memory.add(Outer(np.ones(2), np.arange(3), Inner(np.array(k), np.array(5.0)))) for k in (7.0, 8.0)
    ]
    blocks = memory.blocks()
    integers, floats = nmm.base.kernels.record_layout.sampled(*blocks)
    np.testing.assert_array_equal(integers, [0, 1, 2] * 2)
    np.testing.assert_array_equal(floats, [7.0, 8.0])
    one, other = (views(Outer, *blocks, place) for place in places)
    own = integers.copy(), floats.copy()
    keep(*blocks, *own)
    one.b[1], other.inner.x[()], other.inner.y[()], one.a[0] = 9, 9.0, 9.0, 9.0
    put_back(*blocks, *own)
    assert (one.b[1], other.inner.x[()]) == (1, 8.0)
    assert (other.inner.y[()], one.a[0]) == (9.0, 9.0)
