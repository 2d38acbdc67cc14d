"""A sampled controller that sees a robot with noise, or by its odometry, and acts on it late, while its
wheels slip and creep."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numba import types
from numpy.typing import ArrayLike

from nmm.arrays import Array, Integers, counted, scalar
from nmm.control.controller import Controller
from nmm.control.equations import ControlStep, write_equation
from nmm.control.integrators import Around
from nmm.control.recorded import Recorded, note_sample
from nmm.control.stepping import hold_inputs
from nmm.errors import InputError, expect
from nmm.findings import Finding
from nmm.functions.program import BESIDE, LaidOut, run_program
from nmm.kernels.compiled import checked_by_caller, compiled, compiled_without_gil, scratch, view
from nmm.kernels.record_layout import Matrix, Vector, record_type, views
from nmm.resolvers.answer import SINGULAR_J
from nmm.resolvers.partitions import PartitionState
from nmm.robots.robot import Robot
from nmm.runs.closed_loop import finding_in
from nmm.runs.compiled_loop import DIVERGED_BEYOND, compiled_sample, within_bound
from nmm.runs.recording import Recorder
from nmm.runs.verdict import FindingLine, Outcome


class Disturbed(NamedTuple):
    """A run's disturbances: noise (N or 0, n) added to q at each sample before the controller sees it, m and
    rad; the delay, in samples, until inputs act; slip (m,), the share of each input that acts; creep, s, by
    which a platform slides sideways, at creep v ω; and what the controller believes its q to be by odometry,
    believed (N or 0, n), put right every `correct` samples (0: never)."""

    noise: Matrix
    delay: int
    slip: Vector
    creep: float
    believed: Matrix
    correct: int


@dataclass(frozen=True)
class Acting(Around):
    """Holds the inputs that act: their shares, and those of some samples before."""

    disturbed: Disturbed
    asked: dict[float, Array] = field(default_factory=dict)

    def advance(
        self, velocity: Callable[[float, Array], Array], t: float, q: Array, q_dot: Array, u: Array, dt: float
    ) -> Array:
        self.asked[t] = u  # once a sample, also where its step is taken again
        if len(self.asked) > self.disturbed.delay + 1:
            del self.asked[next(iter(self.asked))]
        known = len(self.asked) > self.disturbed.delay
        acting = self.disturbed.slip * next(iter(self.asked.values())) if known else np.zeros(len(u))
        ahead = self.integrator.advance(velocity, t, q, q_dot, acting, dt)
        if self.disturbed.creep:
            slide(q, self.disturbed.creep / dt, ahead)
        return ahead


class Plant:
    """What disturbs `count` runs with n coordinates and m inputs, as a user gives it."""

    def __init__(
        self,
        robot: Robot,
        count: int,
        *,
        noise: ArrayLike = 0.0,
        delay: int = 0,
        slip: ArrayLike = 1.0,
        creep: float = 0.0,
        odometry: bool = False,
        correct: int = 0,
        seed: int = 0,
    ) -> None:
        n, m = robot.n, robot.n_u
        self.noise = _broadcast(noise, (n,), "noise")
        expect(not np.any(self.noise < 0.0), "noise", "standard deviations, at least 0")
        self.delay, self.seed = counted(delay, "delay", 0), counted(seed, "seed", 0)
        self.slip = _broadcast(slip, (count, m), "slip")
        self.creep, self.odometry, self.correct = scalar(creep, "creep"), odometry, correct
        if robot.platform.n_p < 3 and (odometry or self.creep):
            raise InputError(
                "odometry and creep are a mobile platform's",
                where=f"{robot.name}: {'odometry' if odometry else 'creep'}",
            )

    @property
    def noisy(self) -> bool:
        return bool(np.any(self.noise > 0.0))

    @property
    def misleads(self) -> bool:
        """Whether a controller sees another q than the robot's."""
        return self.noisy or self.odometry

    @property
    def disturbs(self) -> bool:
        return bool(self.misleads or self.delay or self.creep or np.any(self.slip != 1.0))

    def at(self, i: int, samples: int) -> Disturbed:
        noise = np.zeros((0, len(self.noise)))
        if self.noisy:
            drawn = np.random.default_rng([self.seed, i]).standard_normal((samples, len(self.noise)))
            noise = drawn * self.noise
        believed = np.zeros((samples if self.odometry else 0, len(self.noise)))
        return Disturbed(noise, self.delay, self.slip[i].copy(), self.creep, believed, self.correct)


def _broadcast(value: ArrayLike, shape: tuple[int, ...], what: str) -> Array:
    try:
        found = np.broadcast_to(np.asarray(value, dtype=np.float64), shape).copy()
    except (TypeError, ValueError):
        raise InputError(where=what, expected=f"a number or shape {shape}", got=value) from None
    expect(np.all(np.isfinite(found)), what, "finite numbers")
    return found


_DRIFT = types.int64(
    *(types.int64[::1], types.float64[::1], types.float64[::1], types.int64, types.int64),
    *(record_type(Disturbed), types.int64, record_type(Recorded)),
)
#: Samples in one compiled call, where the run may replace numbers of the controller's functions.
AT_ONCE = 200


@compiled
def slide(q: Array, share: float, ahead: Array) -> None:
    """Move `ahead` (n,), where the platform comes to from q, sideways by share times the way along it times
    the turn: creep v ω dt, with share = creep / dt."""
    turn = ahead[2] - q[2]
    middle = q[2] + 0.5 * turn
    c, s = math.cos(middle), math.sin(middle)
    aside = share * turn * (c * (ahead[0] - q[0]) + s * (ahead[1] - q[1]))
    ahead[0] -= s * aside
    ahead[1] += c * aside


@compiled_without_gil
def drift(
    integers: Integers,
    floats: Array,
    times: Array,
    first: int,
    last: int,
    disturbed: Disturbed,
    partitioned: int,
    found: Recorded,
) -> int:
    """Sample from the time `first` to before `last`, inputs held in between, from q there, which is recorded;
    returns how many samples were recorded in all. q, r and errors are the robot's, not those that the
    controller sees; u is what it asks for. Odometry counts what the wheels turn, of which slip and creep are
    no part; encoders of the arm's joints see these where they are."""
    e = views(ControlStep, integers, floats, BESIDE)
    b = views(LaidOut, integers, floats, 0).buffers
    n, m = found.q.shape[1], disturbed.slip.shape[0]
    seen, acting, turned = scratch(n), scratch(m), scratch(m)
    believes, n_p = disturbed.believed.shape[0] > 0, b.G.shape[0]
    for k in range(first, last):
        q = view(found.q, k * n, (n,))
        noisy = disturbed.noise.shape[0] > 0
        for i in range(n):
            seen[i] = disturbed.believed[k, i] if believes else q[i]
            seen[i] += disturbed.noise[k, i] if noisy else 0.0
        status = compiled_sample(times[k], times[k - 1] if k > 0 else -math.inf, seen, integers, floats)
        if status >= SINGULAR_J or not within_bound(e.answer.u) or not within_bound(q):
            return k
        if noisy or believes:  # the task as it is
            run_program(times[k], q, integers, floats)
            write_equation(e.task, b, e.arm, e.problem.J, e.problem.rate)
        note_sample(integers, floats, q, partitioned, 1.0, k, found)
        if k + 1 < times.shape[0]:
            for j in range(m):
                turned[j] = found.u[k - disturbed.delay, j] if k >= disturbed.delay else 0.0
                acting[j] = disturbed.slip[j] * turned[j]
            dt = times[k + 1] - times[k]
            ahead = view(found.q, (k + 1) * n, (n,))
            hold_inputs(q, acting, dt, integers, floats, ahead)
            if disturbed.creep != 0.0:
                slide(q, disturbed.creep / dt, ahead)
            if believes:
                now = view(disturbed.believed, k * n, (n,))
                after = view(disturbed.believed, (k + 1) * n, (n,))
                hold_inputs(now, turned, dt, integers, floats, after)
                right = disturbed.correct > 0 and (k + 1) % disturbed.correct == 0
                for i in range(0 if right else n_p, n):
                    after[i] = ahead[i]
    return last


def driven_disturbed(
    controller: Controller, recorder: Recorder, times: Array, q: Array, disturbed: Disturbed
) -> tuple[Outcome, FindingLine]:
    solver, found, renewals = controller.solver, recorder.found, controller.solver.program.renewals
    solver.begin_run()
    given = disturbed, int(isinstance(solver.state, PartitionState)), found
    fly = checked_by_caller(drift, _DRIFT)

    def as_seen(some: slice) -> Array:
        q = disturbed.believed if len(disturbed.believed) else found.q
        return q[some] + (disturbed.noise[some] if len(disturbed.noise) else 0.0)

    found.q[0] = q
    disturbed.believed[:1] = q
    count, last = 0, 0
    with solver.compiled() as blocks:
        while last < len(times) and count == last:
            first, last = count, min(count + AT_ONCE, len(times)) if renewals else len(times)
            for one in renewals:
                one.renew(float(times[first]), as_seen(slice(first, first + 1))[0])
            for one in renewals:
                last = max(first + 1, min(last, int(np.searchsorted(times, one.due))))
            left = solver.sample.snapshot()
            count = fly(*blocks, times, first, last, *given)
            for one in renewals:
                those = slice(first + 1, count)
                stays = first + 1 + one.stays(times[those], as_seen(those))
                if stays < count:  # begin again, up to the sample before the one that needs others
                    solver.sample.restore(left)
                    count = last = fly(*blocks, times, first, stays, *given)
    recorder.passed_over(count - 1)
    if count == len(times):
        return Outcome.COMPLETED, ()
    (seen,) = as_seen(slice(count, count + 1))
    if controller.solver.failed and np.linalg.norm(seen) < DIVERGED_BEYOND:
        return Outcome.SINGULAR, (finding_in(controller.solver.failure(times[count], seen)),)
    beyond = {"what": "coordinates or inputs", "bound": DIVERGED_BEYOND}
    return Outcome.DIVERGED, (Finding("diverged", beyond, {"t": float(times[count])}),)
