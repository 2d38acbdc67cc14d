"""Rollouts: the closed loop of many robots, over the cores."""

from __future__ import annotations

import copy
import math
import os
import threading
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from nmm.arrays import Array, Integers, positive
from nmm.control.controller import Controller
from nmm.control.goal import Goal
from nmm.control.integrators import integrator
from nmm.control.sequenced import SequencedController
from nmm.errors import InputError
from nmm.rollouts.disturbed import Disturbed, driven_disturbed
from nmm.rollouts.kept import Kept
from nmm.rollouts.measures import MEASURES, measures
from nmm.runs.closed_loop import driven, sample_times
from nmm.runs.recording import Recorder
from nmm.runs.simulation import MOST_SAMPLES, guarded
from nmm.runs.trajectory import Outcome
from nmm.scenario import Scenario

Start = ArrayLike | Mapping[str, float] | Sequence[Mapping[str, float]]


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
    """
    if isinstance(subject, Scenario):
        parts = subject.parts
        q0 = parts.q0 if q0 is None else q0
        duration, dt = duration or parts.duration, dt or parts.dt
        method = method or parts.method
        until = parts.until.make() if until is None and parts.until is not None else until
        subject = subject.controller()
    controllers = (subject,) if isinstance(subject, Controller) else tuple(subject)
    if not controllers or any(isinstance(one, SequencedController) for one in controllers):
        raise InputError("rollout: expected controllers without tasks that come and go, which simulate runs")
    robot, method = controllers[0].robot, method or "rk4"
    if q0 is None or duration is None:
        raise InputError("rollout: expected q0 and a duration; only a scenario has its own")
    duration, dt = positive(duration, "duration"), positive(0.005 if dt is None else dt, "dt")
    steps = max(1, math.ceil(duration / dt - 1e-9))
    if steps > MOST_SAMPLES:
        raise InputError(
            f"dt: {duration:g} s in steps of {dt:g} s are {steps} samples; at most {MOST_SAMPLES}"
        )
    starts = _starts(controllers, q0)
    count = len(starts)
    plant = _Plant.of(robot.n, robot.n_u, count, noise, delay, slip, seed)
    if plant.disturbs and (method != "zoh" or until is not None or not controllers[0].compilable):
        raise InputError(
            "rollout: noise, delay and slip are for method zoh, without a goal, and for controllers without "
            f"distances, retreats, Armijo's rule and Python functions; got method {method}"
        )
    if any(one.samples for one in controllers) and method == "adaptive":
        raise InputError(
            "method: limits are kept from sample to sample: expected rk4, midpoint, euler or zoh"
        )
    times = sample_times(0.0, dt, steps, duration)
    first = Recorder(controllers[0], times)
    kept = Kept(
        keep, times, _whole(every, "every"), count, first.found, None if folder is None else Path(folder)
    )
    workers = min(_whole(threads or _cores(), "threads"), count)
    result = _Result(count)

    def runs_of(controller: Controller) -> Callable[[int], tuple[Recorder, Outcome, str]]:
        recorder = Recorder(controller, times)
        advance = guarded(integrator(method, robot, 1e-9), controller)
        if controller.samples:
            controller.dt = float(times[1] - times[0])

        def run(i: int) -> tuple[Recorder, Outcome, str]:
            recorder.clear()
            if plant.disturbs:
                found = driven_disturbed(controller, recorder, times, starts[i], plant.at(i, len(times)))
            else:
                found = driven(controller, advance, recorder, times, starts[i].copy(), None, until)
            return recorder, *found

        return run

    local, stop, done = threading.local(), threading.Event(), 0

    def one(i: int, room: dict[str, Array], row: int) -> None:
        nonlocal done
        if stop.is_set():
            return
        if len(controllers) > 1:
            run = runs_of(copy.copy(controllers[i]))  # one may stand there twice
        else:
            if not hasattr(local, "run"):
                local.run = runs_of(copy.copy(controllers[0]))
            run = local.run
        recorder, outcome, message = run(i)
        kept.put(room, row, recorder.found, len(recorder))
        result.put(i, recorder, times, _ended(outcome, recorder, until, controllers[0]), message)
        done += 1
        if progress is not None:
            progress(done / count)

    rooms: dict[str, Array] = {}
    with ThreadPoolExecutor(workers) as pool:
        for begin in range(0, count, kept.part):
            rooms = kept.room(min(kept.part, count - begin))
            try:
                for future in [
                    pool.submit(one, i, rooms, i - begin) for i in range(begin, min(count, begin + kept.part))
                ]:
                    future.result()
            except BaseException:
                stop.set()
                raise
            kept.write(begin, rooms)
    return Rollouts(
        t=kept.t,
        kept={} if folder is not None else rooms,
        measures=dict(zip(MEASURES, result.measures.T.copy(), strict=True)),
        outcome=tuple(result.outcome),
        message=tuple(result.message),
        samples=result.samples,
        files=tuple(kept.files),
    )


class _Result:
    """What is always kept of each run."""

    def __init__(self, count: int) -> None:
        self.measures = np.full((count, len(MEASURES)), np.nan)
        self.samples: Integers = np.zeros(count, dtype=np.int64)
        self.outcome, self.message = [""] * count, [""] * count

    def put(self, i: int, recorder: Recorder, times: Array, outcome: str, message: str) -> None:
        self.measures[i] = measures(times, len(recorder), recorder.found)
        self.samples[i] = len(recorder)
        self.outcome[i], self.message[i] = outcome, message


@dataclass(frozen=True)
class _Plant:
    """What disturbs the runs: noise (n,), delay, slip (B, m), and the seed of the noise."""

    noise: Array
    delay: int
    slip: Array
    seed: int

    @classmethod
    def of(
        cls, n: int, m: int, count: int, noise: ArrayLike, delay: int, slip: ArrayLike, seed: int
    ) -> _Plant:
        """From what a user gives."""
        sizes = _broadcast(noise, (n,), "noise")
        if np.any(sizes < 0.0):
            raise InputError("noise: expected standard deviations, at least 0")
        if isinstance(delay, bool) or not isinstance(delay, (int, np.integer)) or delay < 0:
            raise InputError(f"delay: expected whole samples, at least 0, got {delay!r}")
        return cls(sizes, int(delay), _broadcast(slip, (count, m), "slip"), int(seed))

    @property
    def disturbs(self) -> bool:
        """Whether a run is another one than without it."""
        return bool(np.any(self.noise > 0.0) or self.delay or np.any(self.slip != 1.0))

    def at(self, i: int, samples: int) -> Disturbed:
        """What disturbs the i-th run."""
        noise = np.zeros((0, len(self.noise)))
        if np.any(self.noise > 0.0):
            drawn = np.random.default_rng([self.seed, i]).standard_normal((samples, len(self.noise)))
            noise = drawn * self.noise
        return Disturbed(noise, self.delay, self.slip[i].copy())


def _starts(controllers: Sequence[Controller], q0: Start) -> Array:
    """(B, n), checked as `simulate` does."""
    robot = controllers[0].robot
    if isinstance(q0, Mapping):
        found = robot.q(q0)[np.newaxis]
    elif isinstance(q0, Sequence) and any(isinstance(one, Mapping) for one in q0):
        found = np.array([robot.q(one) for one in q0])
    else:
        found = np.array(q0, dtype=np.float64)
        found = found[np.newaxis] if found.ndim == 1 else found
    if found.ndim != 2 or found.shape[1] != robot.n or not len(found):
        raise InputError(f"q0: expected at least one run, (B, {robot.n}) or ({robot.n},), got {found.shape}")
    if len(controllers) > 1:
        if len(found) not in (1, len(controllers)):
            raise InputError(
                f"q0: expected 1 or {len(controllers)} starts, one a controller, got {len(found)}"
            )
        found = np.broadcast_to(found, (len(controllers), robot.n)).copy()
    for k, q in enumerate(found):
        one = controllers[k if len(controllers) > 1 else 0]
        come_back = one.limits is not None and one.limits.position is not False
        try:
            robot.check_limits(robot.q(q), come_back=come_back)
        except InputError as error:
            raise InputError(f"run {k}: {error}") from None
        if one.setting is not None:
            one.setting.check_start(0.0, q)
    return robot.following.placed(found)


def _ended(outcome: Outcome, recorder: Recorder, until: Goal | None, controller: Controller) -> str:
    if outcome is not Outcome.COMPLETED:
        return str(outcome)
    if until is None:
        return "ended"
    return "reached" if until.reached(recorder.so_far.error[-1], controller.rows) else "missed"


def _broadcast(value: ArrayLike, shape: tuple[int, ...], what: str) -> Array:
    try:
        found = np.broadcast_to(np.asarray(value, dtype=np.float64), shape).copy()
    except (TypeError, ValueError):
        raise InputError(f"{what}: expected a number or shape {shape}, got {value!r}") from None
    if not np.all(np.isfinite(found)):
        raise InputError(f"{what}: expected finite numbers")
    return found


def _whole(value: int, what: str) -> int:
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < 1:
        raise InputError(f"{what}: expected a whole number, at least 1, got {value!r}")
    return int(value)


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
