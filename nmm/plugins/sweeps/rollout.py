"""Rollouts: the closed loop of many robots, over the cores."""

from __future__ import annotations

import copy
import math
import threading
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import Array, Integers, counted, positive
from nmm.base.cores import cores
from nmm.base.errors import InputError, expect, no_such
from nmm.base.findings.run import line
from nmm.control.controller import Controller
from nmm.control.goal import Goal
from nmm.control.integrators import Integrator
from nmm.control.plant import method_for
from nmm.control.step.recorded import Recorded
from nmm.motion.closed_loop import drive_loop
from nmm.motion.disturbances import Disturbances, Disturbing, check_disturbed
from nmm.motion.joining import joined_record, room_for
from nmm.motion.leg import Leg
from nmm.motion.recorded_run import run_legs, sample_times
from nmm.motion.recording import Recorder
from nmm.motion.simulation import MOST_SAMPLES
from nmm.motion.verdict import Outcome
from nmm.plugins.sweeps.kept import MEASURES, Kept, measure
from nmm.scenario import Scenario

#: Where runs start: (B, n), (n,), or by name.
Start = ArrayLike | Mapping[str, float] | Sequence[Mapping[str, float]]


@dataclass(frozen=True)
class Rollouts:
    """B runs.

    Attributes
    ----------
    t (K,) : the samples that were kept, s
    kept : the quantities asked for by name, (B, K, ...), in a trajectory's units; not numbers (partition: -1)
        after a run's end; empty where they are in files
    measures : (B,) by name, see `nmm.plugins.sweeps.kept.MEASURES`; not numbers for a run without a sample
    outcome, message : (B,) how each ended: "ended" at its time, "reached" or "missed" where there is a goal,
        "singular", "diverged", "failed"; only `simulate` judges whether errors decay as expected
    samples (B,) : how many samples each has
    files : the files of the parts, in order

    Examples
    --------
    >>> scenario = nmm.Scenario.load("unicycle_2r_position")
    >>> starts = scenario.robot().q(scenario.parts.q0) + np.zeros((3, 1))
    >>> runs = nmm.rollout(scenario, starts, duration=2.0, dt=0.01, keep=["q"], every=10)
    >>> runs["q"].shape, runs.outcome
    ((3, 21, 5), ('ended', 'ended', 'ended'))
    """

    t: Array
    kept: dict[str, Array]
    measures: dict[str, Array]
    outcome: tuple[str, ...]
    message: tuple[str, ...]
    samples: Integers
    files: tuple[Path, ...] = field(default=())

    def __len__(self) -> int:
        return len(self.outcome)

    def __getitem__(self, name: str) -> Array:
        values = self.kept.get(name, self.measures.get(name))
        if values is None:
            raise no_such("quantity", name, [*self.kept, *self.measures], "rollout")
        return values


def rollout(
    subject: Controller | Scenario | Sequence[Controller],
    q0: Start | None = None,
    duration: float | None = None,
    dt: float | None = None,
    method: str | None = None,
    *,
    disturbances: Disturbances | None = None,
    until: Goal | None = None,
    keep: Sequence[str] = (),
    every: int = 1,
    folder: str | Path | None = None,
    threads: int | None = None,
    progress: Callable[[float], None] | None = None,
    **beside: Any,
) -> Rollouts:
    """Run a robot from B starts, or B controllers of one robot, each as `simulate` would, to the last bit.

    Parameters
    ----------
    subject : a controller; a scenario, whose start, duration, dt, method, disturbances and goal hold where
        none are given; or a controller for each run, of one robot and one task's shape
    q0 : (B, n), (n,) for all, or by name; m and rad
    duration, dt : s
    method : as `simulate`'s
    disturbances : what disturbs the runs; slip may be (B, m), and a run's noise depends on the seed and on
        the run's number; keep "believed" for what the controllers take q for by odometry
    until : a goal, at which a run ends
    keep, every : names of what to keep (`nmm.plugins.sweeps.kept.QUANTITIES`), of each `every`-th sample
    folder : write what is kept there, as npz files of some runs each, instead of holding it
    threads : how many; as many as there are cores for this process when None
    progress : called with the fraction done
    beside : odometry=True, creep=, slip=, noise=, delay=, correct=, seed= in place of `disturbances`

    Raises
    ------
    InputError : no runs, wrong shapes, a q0 outside limits that the controller does not keep; more to keep
        than there is memory for

    Examples
    --------
    >>> scenario = nmm.Scenario.load("unicycle_2r_position")
    >>> starts = scenario.robot().q(scenario.parts.q0) + np.linspace(-0.2, 0.2, 5)[:, None]
    >>> runs = nmm.rollout(scenario, starts, duration=5.0, dt=0.01)
    >>> runs["error_final"].shape, set(runs.outcome)
    ((5,), {'ended'})
    """
    if beside:
        if disturbances is not None:
            raise InputError("are given twice", where="disturbances", got=sorted(beside))
        disturbances = Disturbances(**beside)
    if isinstance(subject, Scenario):
        parts = subject.parts
        if parts.moved_by:
            raise InputError(
                "its run is a planned motion, with one start",
                where=f"rollout: {parts.moved_by}",
                expected="plan.track: true" if parts.moved_by == "plan" else f"{parts.moved_by}: false",
            )
        q0 = parts.q0 if q0 is None else q0
        duration, dt = duration or parts.duration, dt or parts.dt
        method = method or parts.method
        until = parts.goal() if until is None else until
        if disturbances is None and parts.disturbances is not None:
            disturbances = parts.disturbances.make()
        subject = subject.controller()
    controllers = (subject,) if isinstance(subject, Controller) else tuple(subject)
    _check(controllers)
    robot, method = controllers[0].robot, method or "rk4"
    if q0 is None or duration is None:
        raise InputError(where="rollout", expected="q0 and a duration; only a scenario has its own")
    duration, dt = positive(duration, "duration"), positive(0.005 if dt is None else dt, "dt")
    steps = max(1, math.ceil(duration / dt - 1e-9))
    expect(steps <= MOST_SAMPLES, "dt", f"at most {MOST_SAMPLES} samples", dt)
    starts = checked_starts(controllers, q0)
    count = len(starts)
    disturbing = (disturbances or Disturbances()).on(robot, dt, count)
    method_for(controllers, method)
    check_disturbed(disturbing.at(0, 1), method)
    times = sample_times(0.0, dt, steps, duration)
    where = None if folder is None else Path(folder)
    every = counted(every, "every")
    Recorder(controllers[0], times)  # `InputError` where there is no memory for one
    store = Kept(keep, times, every, count, room_for(controllers[0], len(times)), where)
    runs = _Runs(controllers, starts, times, method, until, disturbing, store)
    workers = min(counted(cores() if threads is None else threads, "threads"), count)
    rooms: dict[str, Array] = {}
    with ThreadPoolExecutor(workers) as pool:
        for begin in range(0, count, store.part):
            end = min(count, begin + store.part)
            rooms = store.room(end - begin)
            try:
                waiting = [pool.submit(runs.run, i, rooms, i - begin) for i in range(begin, end)]
                for k, future in enumerate(waiting, start=begin + 1):
                    future.result()
                    if progress is not None:
                        progress(k / count)
            except BaseException:
                runs.stop.set()
                raise
            store.write(begin, rooms)
    return Rollouts(
        t=store.t,
        kept={} if folder is not None else rooms,
        measures=dict(zip(MEASURES, runs.measures.T.copy(), strict=True)),
        outcome=tuple(runs.outcome),
        message=tuple(runs.message),
        samples=runs.samples,
        files=tuple(store.files),
    )


@dataclass(eq=False)
class _Runs:
    """The runs, one at a time in each thread, and what is always kept of them; none begins after `stop`."""

    controllers: Sequence[Controller]
    starts: Array
    times: Array
    method: str
    until: Goal | None
    disturbing: Disturbing
    store: Kept

    def __post_init__(self) -> None:
        self._local, self.stop = threading.local(), threading.Event()
        count = len(self.starts)
        self.measures = np.full((count, len(MEASURES)), np.nan)
        self.samples: Integers = np.zeros(count, dtype=np.int64)
        self.outcome, self.message = [""] * count, [""] * count

    def run(self, i: int, rooms: dict[str, Array], row: int) -> None:
        if self.stop.is_set():
            return
        controller, recorder, advance = self._controller(i)
        plant = self.disturbing.plant(advance, i, len(self.times))
        start, schedule = self.starts[i].copy(), controller.schedule
        legs: list[Leg] = []
        if schedule is None:
            outcome, why = drive_loop(controller, plant, recorder, self.times, start, until=self.until)
            recorded, count, reached = recorder.found, len(recorder), _at_goal(recorder, self.until)
            why = (*why, *recorder.noticed())
        else:
            legs = run_legs(controller, schedule, plant, self.times, start, None, self.until)
            recorder = legs[-1].recorder
            outcome, why, *_ = legs[-1].ended
            why = (*why, *(finding for leg in legs for finding in leg.recorder.noticed()))
            recorded = joined_record(controller, schedule, legs)
            waits = schedule.sequence.waiting(schedule.settle()) or not any(legs[-1].active)
            count, reached = len(recorded.q), not waits and _at_goal(recorder, self.until)
        self.store.put(rooms, row, recorded, plant.believed, count)
        self._measure(i, recorded, plant.believed, count, [leg.recorder for leg in legs])
        self.samples[i] = count
        ended = "ended" if self.until is None else "reached" if reached else "missed"
        self.outcome[i] = ended if outcome is Outcome.COMPLETED else str(outcome)
        self.message[i] = line(why)

    def _measure(
        self, i: int, recorded: Recorded, believed: Array | None, count: int, legs: Sequence[Recorder]
    ) -> None:
        """The measures of run i; `legs` where tasks come and go, whose rows count while they are active."""
        if legs:
            known = {"error": 0.0, "scale": 1.0, "J": 0.0, "residual": 0.0}
            filled = {name: np.nan_to_num(getattr(recorded, name), nan=x) for name, x in known.items()}
            recorded = recorded._replace(**filled)
        measure(self.times, count, recorded, self.measures[i])
        if legs:
            each, sigma_min = np.zeros((len(legs), len(MEASURES))), MEASURES.index("sigma_min")
            for own, leg in zip(each, legs, strict=True):
                measure(leg.t, len(leg), leg.found, own)
            self.measures[i, sigma_min] = np.nanmin(each[:, sigma_min], initial=np.inf)
        if count:
            away = np.zeros(2) if believed is None else (believed[count - 1] - recorded.q[count - 1])[:2]
            self.measures[i, MEASURES.index("drift")] = np.hypot(*away)

    def _controller(self, i: int) -> tuple[Controller, Recorder, Integrator]:
        """This thread's own controller, with room for its samples, and the integrator."""
        if len(self.controllers) == 1 and hasattr(self._local, "ready"):
            ready: tuple[Controller, Recorder, Integrator] = self._local.ready
            ready[1].clear()
            return ready
        controller = copy.copy(self.controllers[i if len(self.controllers) > 1 else 0])
        if controller.solver.samples:
            controller.dt = float(self.times[1] - self.times[0])
        advance = method_for((controller,), self.method)
        self._local.ready = controller, Recorder(controller, self.times), advance
        return self._local.ready


def _check(controllers: Sequence[Controller]) -> None:
    """`InputError` for controllers whose runs cannot stand beside each other."""
    made = controllers and all(isinstance(controller, Controller) for controller in controllers)
    expect(made, "rollout", "a controller, a scenario or a list of controllers")
    first = controllers[0]
    for k, controller in enumerate(controllers):
        same = (
            controller.robot.q_names == first.robot.q_names
            and controller.robot.u_names == first.robot.u_names
        )
        rows = len(controller.given.task.rows(controller.robot)) == len(first.given.task.rows(first.robot))
        if not (same and rows):
            raise InputError("another robot or other rows than the first", where=f"rollout: controller {k}")


def _at_goal(recorder: Recorder, until: Goal | None) -> bool:
    """Whether a run's last sample is at its goal."""
    if until is None or not len(recorder):
        return False
    return until.reached(recorder.so_far.error[-1], recorder.controller.rows)


def checked_starts(controllers: Sequence[Controller], q0: Start) -> Array:
    """Starts (B, n), for one controller or for each of several; `InputError` names the run."""
    robot = controllers[0].robot
    if isinstance(q0, Mapping):
        starts = robot.q(q0)[np.newaxis]
    elif isinstance(q0, Sequence) and any(isinstance(start, Mapping) for start in q0):
        starts = np.array([robot.q(start) for start in q0])
    else:
        starts = np.array(q0, dtype=np.float64)
        starts = starts[np.newaxis] if starts.ndim == 1 else starts
    fits = starts.ndim == 2 and starts.shape[1] == robot.n and len(starts)
    expect(fits, "q0", f"at least one run, (B, {robot.n}) or ({robot.n},)", starts)
    if len(controllers) > 1:
        fits = len(starts) in (1, len(controllers))
        expect(fits, "q0", f"1 or {len(controllers)} starts, one a controller", len(starts))
        starts = np.broadcast_to(starts, (len(controllers), robot.n)).copy()
    for k, q in enumerate(starts):
        controller = controllers[k if len(controllers) > 1 else 0]
        come_back = controller.limits is not None and controller.limits.position is not False
        try:
            robot.check_limits(robot.q(q), come_back=come_back)
        except InputError as error:
            raise error.at(f"run {k}") from None
        if controller.solver.scene is not None:
            controller.solver.scene.check_start(0.0, q)
    return robot.following.placed(starts)
