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
from nmm.control.integrators import Integrator, integrator
from nmm.motion.clearance import guarded
from nmm.motion.closed_loop import drive_loop
from nmm.motion.disturbances import Disturbances, Plant
from nmm.motion.disturbed import check_disturbed, drive_disturbed
from nmm.motion.recorded_run import sample_times
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
    >>> found = nmm.rollout(scenario, starts, duration=2.0, dt=0.01, keep=["q"], every=10)
    >>> found["q"].shape, found.outcome
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
        found = self.kept.get(name, self.measures.get(name))
        if found is None:
            raise no_such("quantity", name, [*self.kept, *self.measures], "rollout")
        return found


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
        than there is memory for; tasks that come and go, which only `simulate` runs

    Examples
    --------
    >>> scenario = nmm.Scenario.load("unicycle_2r_position")
    >>> starts = scenario.robot().q(scenario.parts.q0) + np.linspace(-0.2, 0.2, 5)[:, None]
    >>> found = nmm.rollout(scenario, starts, duration=5.0, dt=0.01)
    >>> found["error_final"].shape, set(found.outcome)
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
    plant = (disturbances or Disturbances()).on(robot, dt, count)
    if plant.disturbs:
        check_disturbed(plant, controllers, method, until)
    sampled = any(one.solver.samples for one in controllers)
    expected = "rk4, midpoint, euler, zoh or zoh_midpoint with limits"
    expect(not (sampled and method == "adaptive"), "method", expected, method)
    times = sample_times(0.0, dt, steps, duration)
    where = None if folder is None else Path(folder)
    every = counted(every, "every")
    kept = Kept(keep, times, every, count, Recorder(controllers[0], times).found, where)
    runs = _Runs(controllers, starts, times, method, until, plant, kept)
    workers = min(counted(cores() if threads is None else threads, "threads"), count)
    rooms: dict[str, Array] = {}
    with ThreadPoolExecutor(workers) as pool:
        for begin in range(0, count, kept.part):
            end = min(count, begin + kept.part)
            rooms = kept.room(end - begin)
            try:
                waiting = [pool.submit(runs.one, i, rooms, i - begin) for i in range(begin, end)]
                for k, future in enumerate(waiting, start=begin + 1):
                    future.result()
                    if progress is not None:
                        progress(k / count)
            except BaseException:
                runs.stop.set()
                raise
            kept.write(begin, rooms)
    return Rollouts(
        t=kept.t,
        kept={} if folder is not None else rooms,
        measures=dict(zip(MEASURES, runs.measures.T.copy(), strict=True)),
        outcome=tuple(runs.outcome),
        message=tuple(runs.message),
        samples=runs.samples,
        files=tuple(kept.files),
    )


@dataclass(eq=False)
class _Runs:
    """The runs, one at a time in each thread, and what is always kept of them; none begins after `stop`."""

    controllers: Sequence[Controller]
    starts: Array
    times: Array
    method: str
    until: Goal | None
    plant: Plant
    kept: Kept

    def __post_init__(self) -> None:
        self._local, self.stop = threading.local(), threading.Event()
        count = len(self.starts)
        self.measures = np.full((count, len(MEASURES)), np.nan)
        self.samples: Integers = np.zeros(count, dtype=np.int64)
        self.outcome, self.message = [""] * count, [""] * count

    def one(self, i: int, room: dict[str, Array], row: int) -> None:
        if self.stop.is_set():
            return
        controller, recorder, advance = self._controller(i)
        start = self.starts[i].copy()
        disturbed = self.plant.at(i, len(self.times)) if self.plant.disturbs else None
        if disturbed is not None:
            given = controller, self.method, recorder, self.times, start, disturbed
            outcome, reasons = drive_disturbed(*given, until=self.until)
        else:
            outcome, reasons = drive_loop(controller, advance, recorder, self.times, start, None, self.until)
        count = len(recorder)
        believed = recorder.believed
        self.kept.put(room, row, recorder.found, believed, count)
        measure(self.times, count, recorder.found, self.measures[i])
        if count:
            away = np.zeros(2) if believed is None else (believed - recorder.found.q)[count - 1, :2]
            self.measures[i, MEASURES.index("drift")] = np.hypot(*away)
        self.samples[i] = count
        why = (*reasons, *recorder.noticed())
        self.outcome[i], self.message[i] = _ended(outcome, recorder, self.until, controller), line(why)

    def _controller(self, i: int) -> tuple[Controller, Recorder, Integrator]:
        """This thread's own controller, with room for its samples, and the integrator."""
        if len(self.controllers) == 1 and hasattr(self._local, "ready"):
            ready: tuple[Controller, Recorder, Integrator] = self._local.ready
            ready[1].clear()
            return ready
        controller = copy.copy(self.controllers[i if len(self.controllers) > 1 else 0])
        if controller.solver.samples:
            controller.dt = float(self.times[1] - self.times[0])
        advance = guarded(integrator(self.method, controller.robot, 1e-9), controller)
        self._local.ready = controller, Recorder(controller, self.times), advance
        return self._local.ready


def _check(controllers: Sequence[Controller]) -> None:
    """`InputError` for controllers whose runs cannot stand beside each other."""
    if any(one.schedule is not None for one in controllers):
        raise InputError("tasks that come and go are run by simulate alone", where="rollout")
    made = controllers and all(isinstance(one, Controller) for one in controllers)
    expect(made, "rollout", "a controller, a scenario or a list of controllers")
    if any(one.order == 2 for one in controllers):
        raise InputError("rollouts are not known at order 2", where="order", expected="1, or nmm.simulate")
    first = controllers[0]
    for k, one in enumerate(controllers):
        same = one.robot.q_names == first.robot.q_names and one.robot.u_names == first.robot.u_names
        if not same or len(one.rows) != len(first.rows):
            raise InputError("another robot or other rows than the first", where=f"rollout: controller {k}")


def _ended(outcome: Outcome, recorder: Recorder, until: Goal | None, controller: Controller) -> str:
    if outcome is not Outcome.COMPLETED:
        return str(outcome)
    if until is None:
        return "ended"
    return "reached" if until.reached(recorder.so_far.error[-1], controller.rows) else "missed"


def checked_starts(controllers: Sequence[Controller], q0: Start) -> Array:
    """Starts (B, n), for one controller or for each of several; `InputError` names the run."""
    robot = controllers[0].robot
    if isinstance(q0, Mapping):
        found = robot.q(q0)[np.newaxis]
    elif isinstance(q0, Sequence) and any(isinstance(one, Mapping) for one in q0):
        found = np.array([robot.q(one) for one in q0])
    else:
        found = np.array(q0, dtype=np.float64)
        found = found[np.newaxis] if found.ndim == 1 else found
    fits = found.ndim == 2 and found.shape[1] == robot.n and len(found)
    expect(fits, "q0", f"at least one run, (B, {robot.n}) or ({robot.n},)", found)
    if len(controllers) > 1:
        fits = len(found) in (1, len(controllers))
        expect(fits, "q0", f"1 or {len(controllers)} starts, one a controller", len(found))
        found = np.broadcast_to(found, (len(controllers), robot.n)).copy()
    for k, q in enumerate(found):
        one = controllers[k if len(controllers) > 1 else 0]
        come_back = one.limits is not None and one.limits.position is not False
        try:
            robot.check_limits(robot.q(q), come_back=come_back)
        except InputError as error:
            raise error.at(f"run {k}") from None
        if one.solver.scene is not None:
            one.solver.scene.check_start(0.0, q)
    return robot.following.placed(found)
