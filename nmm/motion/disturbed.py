"""A sampled controller that sees a robot with noise, or by its odometry, and acts on it late, while its
wheels slip and creep."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from nmm.base.arrays import Array, Integers
from nmm.base.errors import InputError
from nmm.base.findings import Finding
from nmm.base.kernels.compiled import checked_by_caller, compiled, compiled_without_gil, scratch, view
from nmm.base.kernels.record_layout import record_type, views
from nmm.base.kernels.signatures import float64, int64
from nmm.control.controller import Controller
from nmm.control.functions.program import BESIDE, LaidOut, run_program
from nmm.control.goal import Goal
from nmm.control.integrators import Around, integrator
from nmm.control.resolvers.answer import SINGULAR_J
from nmm.control.resolvers.partitions import PartitionState
from nmm.control.step.equations import ControlStep, write_equation
from nmm.control.step.recorded import Recorded, note_sample
from nmm.control.step.stepping import hold_inputs
from nmm.motion.closed_loop import drive_loop, finding_in
from nmm.motion.compiled_loop import DIVERGED_BEYOND, compiled_sample, within_bound
from nmm.motion.disturbances import Disturbed, Plant
from nmm.motion.recording import Recorder
from nmm.motion.verdict import FindingLine, Outcome


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


_DRIFT = int64(
    *(int64[::1], float64[::1], float64[::1], int64, int64),
    *(record_type(Disturbed), int64, record_type(Recorded)),
)
#: Samples in one compiled call, which cannot be interrupted.
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


def drive_disturbed(
    controller: Controller,
    method: str,
    recorder: Recorder,
    times: Array,
    q: Array,
    disturbed: Disturbed,
    progress: Callable[[float], None] | None = None,
    until: Goal | None = None,
) -> tuple[Outcome, FindingLine]:
    """Record a run over the times (N,) from q, as `closed_loop.drive_loop` does."""
    recorder.disturbed = True
    recorder.believed = disturbed.believed if len(disturbed.believed) else None
    if not wholly_compiled(controller, until):
        acting = Acting(integrator(method, controller.robot, 1e-9), disturbed)
        return drive_loop(controller, acting, recorder, times, q, progress, until)
    try:
        return _driven(controller, recorder, times, q, disturbed, progress)
    except KeyboardInterrupt:
        found = Finding("interrupted", {"end": float(times[-1])}, {"t": recorder.reached})
        return Outcome.INTERRUPTED, (found,)


def wholly_compiled(controller: Controller, until: Goal | None) -> bool:
    return until is None and controller.solver.compiles_steps


def check_disturbed(plant: Plant, controllers: Sequence[Controller], method: str, until: Goal | None) -> None:
    """`InputError` for disturbances that runs of these controllers cannot have."""
    if method != "zoh":
        raise InputError(
            "disturbances are a sampled controller's, whose inputs are held",
            where="method",
            expected="zoh",
            got=method,
        )
    if any(one.schedule is not None or one.order == 2 for one in controllers):
        raise InputError(
            "disturbances are not known with tasks that come and go, nor at order 2",
            where="disturbances",
            expected="none",
        )
    if plant.misleads and until is not None:
        raise InputError(
            "noise and odometry are not known with a goal at which a run ends",
            where="until",
            expected="none; of a scenario, set until=false",
        )
    if plant.misleads and not all(wholly_compiled(one, until) for one in controllers):
        raise InputError(
            "noise and odometry are known of controllers that run compiled as a whole",
            where="disturbances",
            expected="no distances, retreats, Armijo's rule or Python functions beside them",
        )


def _driven(
    controller: Controller,
    recorder: Recorder,
    times: Array,
    q: Array,
    disturbed: Disturbed,
    progress: Callable[[float], None] | None,
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
            if progress is not None:
                progress(count / len(times))
            first, last = count, min(count + AT_ONCE, len(times))
            for one in renewals:
                one.renew(float(times[first]), as_seen(slice(first, first + 1))[0], found.q[first])
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
            if count:
                recorder.passed_over(count - 1)
    if progress is not None:
        progress(1.0)
    if count == len(times):
        return Outcome.COMPLETED, ()
    (seen,) = as_seen(slice(count, count + 1))
    if controller.solver.failed and np.linalg.norm(seen) < DIVERGED_BEYOND:
        return Outcome.SINGULAR, (finding_in(controller.solver.failure(times[count], seen)),)
    beyond = {"what": "coordinates or inputs", "bound": DIVERGED_BEYOND}
    return Outcome.DIVERGED, (Finding("diverged", beyond, {"t": float(times[count])}),)
