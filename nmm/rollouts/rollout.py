"""Rollouts: the closed loop of many robots, over the cores."""

from __future__ import annotations

import copy
import math
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from nmm.arrays import Array, Integers, positive
from nmm.control.controller import Controller
from nmm.control.goal import Goal
from nmm.control.integrators import Integrator, integrator
from nmm.control.sequenced import SequencedController
from nmm.cores import cores
from nmm.errors import InputError
from nmm.rollouts.disturbed import driven_disturbed
from nmm.rollouts.kept import Kept
from nmm.rollouts.measures import MEASURES, measures
from nmm.rollouts.plant import Plant
from nmm.rollouts.starts import Start, checked_starts
from nmm.runs.closed_loop import driven, sample_times
from nmm.runs.recording import Recorder
from nmm.runs.simulation import MOST_SAMPLES, guarded
from nmm.runs.trajectory import Outcome
from nmm.scenario import Scenario


@dataclass(frozen=True)
class Rollouts:
    """B runs.

    Attributes
    ----------
    t (K,) : the samples that were kept, s
    kept : the quantities asked for by name, (B, K, ...), in a trajectory's units; not numbers (partition: -1)
        after a run's end; empty where they are in files
    measures : (B,) by name, see `nmm.rollouts.measures.MEASURES`; not numbers for a run without a sample
    outcome, message : (B,) how each ended: "ended" at its time, "reached" or "missed" where there is a goal,
        "singular", "diverged", "failed". Whether the error went as its gain promises is not judged:
        `simulate` does that
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
        """A quantity kept, or a measure."""
        found = self.kept.get(name, self.measures.get(name))
        if found is None:
            available = ", ".join([*self.kept, *self.measures])
            raise InputError(f"{name!r} was not kept; there are {available}")
        return found


def rollout(
    subject: Controller | Scenario | Sequence[Controller],
    q0: Start | None = None,
    duration: float | None = None,
    dt: float | None = None,
    method: str | None = None,
    *,
    noise: ArrayLike = 0.0,
    delay: int = 0,
    slip: ArrayLike = 1.0,
    seed: int = 0,
    until: Goal | None = None,
    keep: Sequence[str] = (),
    every: int = 1,
    folder: str | Path | None = None,
    threads: int | None = None,
    progress: Callable[[float], None] | None = None,
) -> Rollouts:
    """Run a robot from B starts, or B controllers of one robot, each as `simulate` would, to the last bit.

    Parameters
    ----------
    subject : a controller; a scenario, whose start, duration, dt, method and goal hold where none are given;
        or a controller for each run, of one robot and one task's shape
    q0 : (B, n), (n,) for all, or by name; m and rad
    duration, dt : s
    method : as `simulate`'s; "zoh" with noise, delay or slip, which are a sampled controller's
    noise : standard deviation of what the controller sees of each coordinate, m and rad: a number or (n,)
    delay : samples until inputs act
    slip : the share of each input that acts, 1 for all of it: a number, (m,) or (B, m)
    seed : of the noise; that of a run depends on the seed and on the run's number
    until : a goal, at which a run ends
    keep : names of what to keep of each sample (`nmm.rollouts.kept.QUANTITIES`)
    every : keep every so many samples
    folder : write what is kept there, as npz files of some runs each, instead of holding it
    threads : how many; as many as there are cores for this process when None
    progress : called with the fraction done

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
    if isinstance(subject, Scenario):
        parts = subject.parts
        q0 = parts.q0 if q0 is None else q0
        duration, dt = duration or parts.duration, dt or parts.dt
        method = method or parts.method
        until = parts.until.make() if until is None and parts.until is not None else until
        subject = subject.controller()
    controllers = (subject,) if isinstance(subject, Controller) else tuple(subject)
    _check(controllers)
    robot, method = controllers[0].robot, method or "rk4"
    if q0 is None or duration is None:
        raise InputError("rollout: expected q0 and a duration; only a scenario has its own")
    duration, dt = positive(duration, "duration"), positive(0.005 if dt is None else dt, "dt")
    steps = max(1, math.ceil(duration / dt - 1e-9))
    if steps > MOST_SAMPLES:
        raise InputError(
            f"dt: {duration:g} s in steps of {dt:g} s are {steps} samples; at most {MOST_SAMPLES}"
        )
    starts = checked_starts(controllers, q0)
    count = len(starts)
    plant = Plant.of(robot.n, robot.n_u, count, noise, delay, slip, seed)
    if plant.disturbs and (method != "zoh" or until is not None or not controllers[0].compilable):
        raise InputError(
            "rollout: noise, delay and slip are for method zoh, without a goal (of a scenario that has one, "
            "hand over scenario.controller()), and for controllers without distances, retreats, Armijo's "
            f"rule and Python functions; got method {method}{'' if until is None else ' and a goal'}"
        )
    if any(one.samples for one in controllers) and method == "adaptive":
        raise InputError(
            "method: limits are kept from sample to sample: expected rk4, midpoint, euler or zoh"
        )
    times = sample_times(0.0, dt, steps, duration)
    where = None if folder is None else Path(folder)
    every = _whole(every, "every")
    kept = Kept(keep, times, every, count, Recorder(controllers[0], times).found, where)
    runs = _Runs(controllers, starts, times, method, until, plant, kept)
    workers = min(_whole(cores() if threads is None else threads, "threads"), count)
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


class _Runs:
    """The runs, one after the other in each thread that asks for some, and what is always kept of them.

    Attributes
    ----------
    stop : set where no more are to begin
    """

    def __init__(
        self,
        controllers: Sequence[Controller],
        starts: Array,
        times: Array,
        method: str,
        until: Goal | None,
        plant: Plant,
        kept: Kept,
    ) -> None:
        self._controllers, self._starts, self._times = controllers, starts, times
        self._method, self._until, self._plant, self._kept = method, until, plant, kept
        self._local, self.stop = threading.local(), threading.Event()
        count = len(starts)
        self.measures = np.full((count, len(MEASURES)), np.nan)
        self.samples: Integers = np.zeros(count, dtype=np.int64)
        self.outcome, self.message = [""] * count, [""] * count

    def one(self, i: int, room: dict[str, Array], row: int) -> None:
        """The i-th run, which is kept in a row of the room."""
        if self.stop.is_set():
            return
        controller, recorder, advance = self._at_hand(i)
        if self._plant.disturbs:
            disturbed = self._plant.at(i, len(self._times))
            outcome, message = driven_disturbed(controller, recorder, self._times, self._starts[i], disturbed)
        else:
            start = self._starts[i].copy()
            outcome, message = driven(controller, advance, recorder, self._times, start, None, self._until)
        count = len(recorder)
        self._kept.put(room, row, recorder.found, count)
        self.measures[i] = measures(self._times, count, recorder.found)
        self.samples[i] = count
        self.outcome[i], self.message[i] = _ended(outcome, recorder, self._until, controller), message

    def _at_hand(self, i: int) -> tuple[Controller, Recorder, Integrator]:
        """A controller that is this thread's alone, with room for its samples, and the integrator."""
        if len(self._controllers) == 1 and hasattr(self._local, "ready"):
            ready: tuple[Controller, Recorder, Integrator] = self._local.ready
            ready[1].clear()
            return ready
        controller = copy.copy(self._controllers[i if len(self._controllers) > 1 else 0])
        if controller.samples:
            controller.dt = float(self._times[1] - self._times[0])
        advance = guarded(integrator(self._method, controller.robot, 1e-9), controller)
        self._local.ready = controller, Recorder(controller, self._times), advance
        return self._local.ready


def _check(controllers: Sequence[Controller]) -> None:
    """`InputError` for controllers whose runs do not fit beside each other."""
    if any(isinstance(one, SequencedController) for one in controllers):
        raise InputError("rollout: tasks that come and go are run by simulate alone")
    if not controllers or not all(isinstance(one, Controller) for one in controllers):
        raise InputError("rollout: expected a controller, a scenario or a list of controllers")
    first = controllers[0]
    for k, one in enumerate(controllers):
        same = one.robot.q_names == first.robot.q_names and one.robot.u_names == first.robot.u_names
        if not same or len(one.rows) != len(first.rows):
            raise InputError(f"rollout: controller {k} has another robot or other rows than the first")


def _ended(outcome: Outcome, recorder: Recorder, until: Goal | None, controller: Controller) -> str:
    if outcome is not Outcome.COMPLETED:
        return str(outcome)
    if until is None:
        return "ended"
    return "reached" if until.reached(recorder.so_far.error[-1], controller.rows) else "missed"


def _whole(value: int, what: str) -> int:
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < 1:
        raise InputError(f"{what}: expected a whole number, at least 1, got {value!r}")
    return int(value)
