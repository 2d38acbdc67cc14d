"""`nmm.Loop`: what goes wrong in a robot's loop, and that limits hold meanwhile."""

from __future__ import annotations

import math
import tracemalloc
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from loop_faults import BEGINS, FAULTS, PERIOD, drive, make_loop, old, to_its_limit, try_fault
from wandering import beyond

import nmm
from nmm.base.findings import Finding
from nmm.model.robots.zero_order_hold import HeldInputs
from nmm.plugins.robot.findings import WORDS
from nmm.plugins.robot.measured_state import Refused

Array = np.ndarray
START = {"q1": 0.3, "q2": 0.9}


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_found_and_limits_are_kept(name: str) -> None:
    _, state, codes, refused = FAULTS[name]
    tried = try_fault(name)
    loop = tried.loop
    late = [one.values["samples"] for one in loop.findings if one.code == "call_late"]
    assert late == ([loop.late_calls] if loop.late_calls and loop.state == "running" else [])
    assert (str(loop.state), [*dict.fromkeys(tried.codes)]) == (state, codes)
    assert tried.broken <= 1e-12
    most = max(loop.refused, key=loop.refused.__getitem__, default=None)
    assert most == refused
    assert math.isnan(tried.to_rest) == (state != "stopped")
    if state == "running":  # and the task is done, where the loop believes that the robot is
        assert np.linalg.norm(loop.trajectory().error[-1]) < 0.15
    else:
        assert not loop.u.any()


def test_the_oracle_of_these_tests_sees_zeros_that_are_sent() -> None:
    loop = make_loop()
    stops = loop.controller.solver.take_stop
    loop.controller.solver.take_stop = lambda t, q: (  # type: ignore[method-assign]
        stops(t, q),
        loop.controller.solver.step_memory.answer.u.fill(0.0),
    )
    assert drive(loop, measure=lambda t, q: (q if t < BEGINS else None, t)).broken > 0.05


def test_the_way_to_rest_is_as_short_as_the_controllers_stop() -> None:
    tried = try_fault("none any more")
    run = tried.loop.trajectory()
    k = int(np.searchsorted(run.t, BEGINS + tried.loop.watchdog - PERIOD / 2))
    kept = tried.loop.controller.solver.limits_on
    least = np.ceil(np.abs(run.u[k]) / (kept.accelerations * PERIOD)).max() * PERIOD
    assert tried.to_rest - tried.loop.watchdog == pytest.approx(least, abs=1.5 * PERIOD)


def test_between_measurements_the_robot_is_where_its_inputs_bring_it() -> None:
    """One measurement in five, 30 ms late: what the loop believes is where the robot is."""
    past: list[tuple[Array, float]] = []

    def measure(t: float, q: Array) -> tuple[Array | None, float]:
        past.append((q, t))
        return past[-4] if len(past) % 5 == 4 else (None, t)

    loop = make_loop()
    tried = drive(loop, 3.0, measure)
    run, true = loop.trajectory(), np.array([q for q, _ in past])
    assert len(run) > 250
    np.testing.assert_allclose(run.q, true[-len(run) :], atol=1e-9)
    assert (str(loop.state), tried.codes) == ("running", ())


def test_the_start_is_soft_and_within_limits() -> None:
    hard, soft = (drive(make_loop(soft_start=seconds), 0.4).loop.trajectory() for seconds in (0.0, 0.5))
    shares = np.abs(soft.u[:, 0]) / np.maximum(np.abs(hard.u[:, 0]), 1e-9)
    assert not soft.u[0].any()
    assert np.all(shares[1:10] <= (np.arange(1, 10) * PERIOD / 0.5 * 1.5))
    assert hard.u[10, 0] > soft.u[10, 0] > 0.0


@pytest.mark.parametrize(("beyond", "given", "state"), [
    (0.19, {}, "running"), (0.21, {}, "waiting"), (0.21, {"outside": None}, "running")
])  # fmt: skip
def test_a_joint_a_little_outside_its_limits_is_brought_back(
    beyond: float, given: dict[str, Any], state: str
) -> None:
    """5 % of q1's 4 rad are 0.2 rad."""
    loop = make_loop(**given)
    held, q = HeldInputs(loop.controller.robot), loop.controller.robot.q({"q1": 2.0 + beyond, "q2": 0.9})
    for k in range(200):
        q = held(q, loop.step(k * PERIOD, q), PERIOD)
    assert str(loop.state) == state
    assert (q[3] <= 2.0 + 1e-9) == (state == "running")
    assert [(one.code, one.values["upper"]) for one in loop.findings] == (
        [] if state == "running" else [("outside_limits", 2.0)]
    )


def test_what_blocks_it_is_told_and_an_error_stops_it() -> None:
    """A pillar stands in its way for good; in the first second it is on its way."""

    def run(duration: float, x: float, error: tuple[float, float] | None = None) -> nmm.Loop:
        pillar = nmm.Obstacle(nmm.Sphere(0.3), [x, 0.0, 0.3], name="pillar")
        task = nmm.Task(nmm.Position("ee", "xy"), [4.0, 0.0], gain=2.0, speed=0.5)
        limits = nmm.Limits({"platform": 0.8, "arm": 1.5}, acceleration={"platform": 2.0, "arm": 4.0})
        distances = nmm.Collisions(0.05, obstacles=[pillar])
        given = {"limits": limits, "collisions": distances}
        controller = nmm.Controller(nmm.load("unicycle_2r"), task, nmm.DampedLeastSquares(), **given)
        return drive(nmm.Loop(controller, PERIOD, error=error), duration).loop

    loop = run(8.0, 2.0)
    blocked = [one for one in loop.findings if one.code == "blocked"]
    assert {pair.split(" and ")[1] for one in blocked for pair in one.values["pairs"]} == {"pillar"}
    assert len(blocked) == len({*blocked[0].values["pairs"]} | {*blocked[-1].values["pairs"]})
    assert blocked[0].values["end"] == pytest.approx(loop.t)
    assert not any(one.code == "blocked" for one in run(8.0, 9.0).findings)
    size = float(loop.trajectory().error_norm[50:].max())  # after its soft start
    assert [one.code for one in run(1.0, 2.0, (0.99 * size, 9.0)).findings] == ["off_task", "stopped"]
    assert not run(1.0, 2.0, (1.01 * size, 1e-9)).findings


@pytest.mark.parametrize("by", [0.1, 0.2, 0.5])
def test_old_positions_with_new_times_take_no_joint_far_beyond_its_limits(by: float) -> None:
    """What a measurement may be off by is the most; without the monitor it is the way in that time."""
    tried = drive(to_its_limit(), 6.0, old(by))
    assert tried.broken <= 0.1 * 0.5
    if by > 0.1:
        assert tried.codes[-2:] == ("not_following", "stopped")
        (found,) = (one for one in tried.loop.findings if one.code == "not_following")
        assert found.values["name"] == "q1"
        assert found.values["apart"] > 0.0
        assert "q1 is measured" in str(found)
    trusting = to_its_limit()
    loop = nmm.Loop(trusting.controller, PERIOD, slip=None, outside=None)
    assert drive(loop, 6.0, old(0.5)).broken > 0.3


def test_a_robot_that_slips_lags_and_is_seen_roughly_is_no_fault() -> None:
    """40 % of the platform's way are lost; inputs come 50 ms late; localisation is set right each second."""
    random, loop = np.random.default_rng(3), make_loop(nmm.Circle([1.5, 0], 0.8, rate=0.6))
    held = HeldInputs(loop.controller.robot)
    q, asked = loop.controller.robot.q(START), [np.zeros(loop.controller.robot.n_u)] * 5
    drift = np.zeros(5)
    for k in range(1500):
        if k % 100 == 50:
            drift[:2] = random.uniform(-0.02, 0.02, 2)
        asked.append(loop.step(k * PERIOD, q + drift + random.normal(0.0, 0.004, 5)))
        q = held(q, asked[-6] * [0.6, 0.6, 1.0, 1.0], PERIOD)
    assert (loop.state, [*dict.fromkeys(one.code for one in loop.findings)]) == (nmm.LoopState.RUNNING, [])


def test_after_a_stop_it_goes_on_when_it_is_told() -> None:
    loop = make_loop()
    with pytest.raises(nmm.InputError, match="at rest"):
        loop.resume()
    held, q = HeldInputs(loop.controller.robot), loop.controller.robot.q(START)
    for k in range(300):
        if k == 100:
            loop.stop("door open")
        if k == 200:
            assert loop.state is nmm.LoopState.STOPPED
            loop.resume()
            q[:2] += 2.0  # carried away meanwhile
        q = held(q, loop.step(k * PERIOD, q), PERIOD)
    assert loop.state is nmm.LoopState.RUNNING
    assert [(one.code, one.values.get("why")) for one in loop.findings] == [
        ("stop_asked", "door open"),
        ("stopped", "stop_asked"),
    ]
    assert "door open" in str(loop.findings[0])


def test_a_localisation_that_is_set_anew_is_announced() -> None:
    loop = make_loop()
    held, q, before = HeldInputs(loop.controller.robot), loop.controller.robot.q(START), np.zeros(4)
    change = loop.controller.solver.limits_on.accelerations * PERIOD
    for k in range(300):
        if k == 150:
            q[0] += 1.0
            loop.expect_jump()
        u = loop.step(k * PERIOD, q)
        assert beyond(u - before, np.column_stack([-change, change])) <= 1e-12
        q, before = held(q, u, PERIOD), u
        assert k != 150 or loop.state is nmm.LoopState.STARTING
    assert (loop.state, loop.findings) == (nmm.LoopState.RUNNING, ())


def test_where_users_functions_raise_inputs_still_fall_along_accelerations() -> None:
    robot = nmm.load("unicycle_2r")
    broken: list[int] = []

    def far(configuration: nmm.Configuration) -> Array:
        if broken:
            raise ZeroDivisionError
        return configuration.q[:1] + configuration.q[3:4]

    task = nmm.Task(nmm.CallableFunction(far, ["far"], units=["m"]), [3.0], speed=0.5)
    limits = nmm.Limits(acceleration={"platform": 2.0, "arm": 4.0})
    loop = nmm.Loop(nmm.Controller(robot, task, nmm.ProjectedGradient(), limits=limits), PERIOD)
    tried = drive(loop, each=lambda t: broken.append(1) if t >= BEGINS else None)
    assert str(loop.state) == "stopped"
    assert [one.code for one in loop.findings] == ["resolver_silent", "stopped"]
    assert loop.findings[0].values["why"] == "ZeroDivisionError"
    assert tried.broken <= 1e-12


def test_what_it_recorded_is_a_run_like_any(tmp_path: Path) -> None:
    loop = make_loop(keep=100)
    with pytest.raises(nmm.RunError):
        loop.trajectory()
    drive(loop, 3.0, lambda t, q: (q if t < 2.5 else None, t))
    run = loop.trajectory()
    assert len(run) == 100
    np.testing.assert_allclose(np.diff(run.t), PERIOD, atol=1e-9)
    assert run.t[-1] == pytest.approx(3.0 - PERIOD)
    assert [one.code for one in run.findings] == ["measurements_ended", "stopped"]
    assert len(run.motion().q) == 100
    loaded = nmm.Trajectory.load(run.save(tmp_path / "run", figures=False))
    np.testing.assert_array_equal(loaded.u, run.u)
    assert [one.code for one in loaded.findings] == ["measurements_ended", "stopped"]


def test_memory_does_not_grow() -> None:
    loop = make_loop(keep=50)
    q = loop.controller.robot.q(START)

    def call(k: int) -> None:
        loop.step(k * PERIOD, q * np.nan if k % 9 == 0 else q + 1e-7 * (k % 3), k * PERIOD)

    for k in range(2500):  # more findings than are kept
        call(k)
    tracemalloc.start()
    before, _ = tracemalloc.get_traced_memory()
    for k in range(2500, 4000):
        call(k)
    after, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert len(loop.findings) == 200
    assert after - before < 60_000  # as much as the findings that took the place of others


class Clock:
    """A clock that runs while one sleeps, and a robot that is read and written."""

    def __init__(self, loop: nmm.Loop) -> None:
        self.t, self.loop, self.written = 100.0, loop, [np.zeros(loop.controller.robot.n_u)]
        self._held, self._q, self._since = HeldInputs(loop.controller.robot), loop.q, 100.0
        self._q = loop.controller.robot.q(START)
        self.starts: list[float] = []

    def read(self) -> tuple[Array, float]:
        self.starts.append(self.t)
        self._q = self._held(self._q, self.written[-1], self.t - self._since)
        self._since = self.t
        return self._q.copy(), self.t

    def write(self, u: Array) -> None:
        self.written.append(u)
        self.t += 0.001  # what a period costs

    def sleep(self, seconds: float) -> None:
        self.t += seconds

    def run(self, **given: object) -> None:
        more = {"clock": lambda: self.t, "sleep": self.sleep} | given
        self.loop.run(self.read, self.write, **more)  # type: ignore[arg-type]

    def broken(self) -> float:
        change = self.loop.controller.solver.limits_on.accelerations * PERIOD
        box = np.column_stack([-change, change])
        return max(beyond(one, box) for one in np.diff(self.written, axis=0))


def test_the_runner_keeps_absolute_deadlines_and_stops_at_the_end() -> None:
    clock = Clock(make_loop())

    def each(loop: nmm.Loop) -> None:
        if loop.calls == 50:
            clock.t += 2.3 * PERIOD  # something took long: two deadlines are left out

    clock.run(duration=1.0, each=each)
    due = (np.array(clock.starts) - 100.0) / PERIOD
    np.testing.assert_allclose(due, np.round(due), atol=1e-6)
    assert np.diff(due).max() == pytest.approx(3.0)
    assert clock.loop.late_calls == 1
    assert clock.loop.state is nmm.LoopState.STOPPED
    assert not clock.written[-1].any()
    assert clock.broken() <= 1e-12


@pytest.mark.parametrize("error", [KeyboardInterrupt, OSError])
def test_an_error_first_stops_the_robot(error: type[BaseException]) -> None:
    clock = Clock(make_loop())

    def each(loop: nmm.Loop) -> None:
        if loop.calls == 80:
            assert loop.u.any()
            raise error

    with pytest.raises(error):
        clock.run(each=each)
    assert clock.loop.findings[0].values["why"] == error.__name__
    assert not clock.written[-1].any()
    assert len(clock.written) > 85
    assert clock.broken() <= 1e-12


def test_a_read_that_raises_is_a_measurement_that_did_not_come() -> None:
    clock = Clock(make_loop())
    read = clock.read

    def failing() -> tuple[Array, float]:
        if clock.loop.calls >= 80:
            raise ConnectionError
        return read()

    clock.read = failing  # type: ignore[method-assign]
    with pytest.raises(ConnectionError):
        clock.run()
    assert clock.broken() <= 1e-12
    assert not clock.written[-1].any()


@pytest.mark.parametrize("fails", [1, 30, 10_000])
def test_a_write_that_raises_is_called_until_the_robot_stands(fails: int) -> None:
    """Once; until after the stop's end, where zeros are sent later; for good."""
    clock = Clock(make_loop())
    write, tried = clock.write, []

    def failing(u: Array) -> None:
        clock.t += 0.001
        tried.append(u)
        if 80 <= len(tried) < 80 + fails:
            raise TimeoutError(f"{len(tried)}")
        write(u)

    clock.write = failing  # type: ignore[method-assign]  # a bus that is gone
    with pytest.raises(TimeoutError, match="80"):
        clock.run()
    loop = clock.loop
    assert (loop.state, loop.findings[0].values["why"]) == (nmm.LoopState.STOPPED, "TimeoutError")
    assert not tried[-1].any()
    assert clock.written[-1].any() == (fails == 10_000)
    lasted = loop.findings[-1].values["lasted"] / PERIOD
    assert lasted > 20
    if fails == 10_000:
        assert len(tried) - 80 == pytest.approx(2 * lasted, abs=4)


def test_bad_input_is_told() -> None:
    robot = nmm.load("unicycle_2r")
    task = nmm.Task(nmm.Position("ee", "xy"), [1.0, 0.5])
    controller = nmm.Controller(robot, task, nmm.ProjectedGradient())
    for given in (
        {},
        {"period": 0.0},
        {"period": 0.01, "watchdog": -1.0},
        {"period": 0.01, "jump": (0.0, 1.0)},
    ):
        with pytest.raises(nmm.InputError):
            nmm.Loop(controller, **given)  # type: ignore[arg-type]
    loop = nmm.Loop(controller, 0.01)
    assert not loop.step(0.0, [1.0, 2.0]).any()  # of a wrong length
    assert not loop.step(0.01, "nonsense").any()  # type: ignore[arg-type]
    assert loop.refused["not_finite"] == 2
    loop.stop()
    assert (loop.state, math.isinf(loop.age)) == (nmm.LoopState.STOPPED, True)


#: Codes of a loop with values, and the sentence; all have t = 1.5 s.
EXAMPLES: dict[str, tuple[dict[str, Any], str]] = {
    "measurement_refused": (
        {"reason": "out_of_order", "samples": 2, "end": 1.6},
        "2 measurements were older than one before, from t = 1.5 to 1.6 s",
    ),
    "measurements_ended": (
        {"silent": 0.11, "samples": 1, "end": 1.5},
        "no measurement that can be used for 0.11 s at t = 1.5 s: stops",
    ),
    "relocated": (
        {"m": 0.3, "rad": 0.2, "samples": 1, "end": 1.5},
        "the localisation has the platform 0.3 m and 0.2 rad from where it was, from t = 1.5 s on",
    ),
    "off_task": (
        {"m": 0.5, "rad": 0.0, "samples": 1, "end": 1.5},
        "the task error is 0.5 m and 0 rad at t = 1.5 s, more than allowed: stops",
    ),
    "outside_limits": (
        {"name": "q2", "value": 90.0, "unit": "rad", "lower": None, "upper": 4.0, "samples": 1, "end": 1.5},
        "q2 is measured at 90 rad, outside its limits (to 4), at t = 1.5 s: another unit, or not homed?",
    ),
    "not_following": (
        {"name": "q1", "apart": 0.32, "way": 0.45, "unit": "rad", "samples": 1, "end": 1.5},
        "in the second before t = 1.5 s q1 is measured 0.32 rad off the way of 0.45 rad that its inputs "
        "asked for (held, old positions with new times, or later than `lag` and `slip` allow): stops",
    ),
    "call_late": (
        {"gap": 0.03, "samples": 1, "end": 1.5},
        "1 call late, from t = 1.5 to 1.5 s; at most 0.03 s after the one before",
    ),
    "clock_jumped": ({"by": -5.0, "samples": 1, "end": 1.5}, "the clock jumped by -5 s at t = 1.5 s"),
    "not_called": (
        {"gap": 0.3, "samples": 1, "end": 1.5},
        "not called for 0.3 s before t = 1.5 s, or the clock jumped: stops",
    ),
    "resolver_silent": (
        {"why": "SingularError", "samples": 5, "end": 1.54},
        "no inputs in 5 calls from t = 1.5 to 1.54 s (SingularError)",
    ),
    "stop_asked": ({"why": "door open", "samples": 1, "end": 1.5}, "asked to stop at t = 1.5 s (door open)"),
    "stopped": (
        {"why": "not_called", "lasted": 0.25, "samples": 1, "end": 1.5},
        "at rest at t = 1.5 s, 0.25 s after it began to stop (not_called)",
    ),
}


def test_each_code_has_its_sentence() -> None:
    assert EXAMPLES.keys() == WORDS.keys()
    for code, (values, sentence) in EXAMPLES.items():
        assert str(Finding(code, values, {"t": 1.5})) == sentence
    for reason in Refused:
        values = {"reason": str(reason), "samples": 1, "end": 1.5}
        assert str(Finding("measurement_refused", values, {"t": 1.5}))


def test_at_order_2_it_gives_the_inputs_that_accelerations_lead_to_and_stops() -> None:
    robot = nmm.load("unicycle_2r")
    task = nmm.Task(nmm.Position("ee", "xy"), [1.4, 0.5])
    limits = nmm.Limits({"v": 0.5, "omega": 1.0}, acceleration=2.0)
    controller = nmm.Controller(robot, task, nmm.ProjectedGradient(), limits=limits, order=2)
    loop, q, hold, given = nmm.Loop(controller, 0.01), robot.q({"q2": 0.5}), HeldInputs(robot), []
    for k in range(500):
        given.append(loop.step(0.01 * k, q))
        q = hold(q, given[-1], 0.01)
    assert loop.state is nmm.LoopState.RUNNING
    assert np.linalg.norm(controller.evaluate(5.0, q).error) < 0.05
    loop.stop()
    while loop.state is not nmm.LoopState.STOPPED:
        k += 1
        given.append(loop.step(0.01 * k, q))
        q = hold(q, given[-1], 0.01)
    assert np.abs(np.diff([np.zeros(robot.n_u), *given], axis=0)).max() < 2.0 * 0.01 + 1e-9
    assert not given[-1].any()


def test_of_tasks_that_begin_and_end_it_has_the_rows_while_they_are_there() -> None:
    robot = nmm.load("unicycle_2r")
    reach = nmm.Task(nmm.Position("ee", "xy"), [1.4, 0.5], name="reach")
    aim = nmm.Task(nmm.Posture("q1"), [0.5], name="aim", priority=2, when=nmm.Between(0.1, 0.2))
    controller = nmm.SequencedController(robot, [reach, aim], nmm.ProjectedGradient())
    loop, q, hold = nmm.Loop(controller, 0.01, keep=25), robot.q({"q2": 0.5}), HeldInputs(robot)
    for k in range(40):
        q = hold(q, loop.step(0.01 * k, q), 0.01)
    run = loop.trajectory()
    assert len(run) == 25
    np.testing.assert_allclose(run.t, 0.01 * np.arange(15, 40))
    np.testing.assert_array_equal(np.isfinite(run.error[:, 2]), run.t < 0.2 - 1e-9)
    assert [event.what for event in run.events] == ["begins", "ends"]
