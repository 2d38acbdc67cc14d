"""What is wrong with a recorded run: modes that its dt is too long for (by the eigenvalues of the closed
loop's linearisation), an error that did not decay as expected."""

import math
from contextlib import suppress
from typing import NamedTuple

import numpy as np

from nmm.base.arrays import Array, Integers
from nmm.base.errors import RunError
from nmm.base.kernels.compiled import checked_by_caller, compiled_without_gil, scratch
from nmm.base.kernels.record_layout import views
from nmm.base.kernels.signatures import float64, int64, void
from nmm.control.controller import Controller
from nmm.control.functions.callbacks import DIFFERENCE_STEP
from nmm.control.functions.program import BESIDE
from nmm.control.integrators import Integrator
from nmm.control.resolvers.answer import SINGULAR_J
from nmm.control.resolvers.base import State
from nmm.control.resolvers.partitions import HELD, MODE, PartitionState
from nmm.control.step.equations import ControlStep, call_step
from nmm.motion.diagnosis.error_bound import (
    ENDS,
    Departure,
    TaskSamples,
    adaptive_errors,
    decay,
    departure,
    step_errors,
)
from nmm.motion.recording import Recorder

#: Number of instants at which the integrator's stability is examined.
EXAMINED = 20
#: A target whose motion differs from its rate in more than this share of the steps does more than jump.
OFTEN = 0.05


class Instability(NamedTuple):
    """A mode that decays at t, s, at a rate in 1/s, but grows in integration steps longer than `limit`, s."""

    t: float
    rate: float
    limit: float


LINEARISE = void(
    *(int64[::1], float64[::1], float64[::1], float64[:, ::1]),
    *(int64[::1], int64, float64[:, :, ::1]),
)


@compiled_without_gil
def linearise(
    integers: Integers, floats: Array, times: Array, q: Array, start: Integers, partitioned: int, F: Array
) -> None:
    """F (K, n, n) at times (K,) and q (K, n): `linearisation` from the resolver's state `start`, at a
    constant step size and without limits; NaN where a step failed."""
    e = views(ControlStep, integers, floats, BESIDE)
    n = q.shape[1]
    beside = scratch(n)
    for k in range(q.shape[0]):
        for i in range(e.state.shape[0]):
            e.state[i] = start[i]
        for i in range(n):
            beside[i] = q[k, i]
        status = call_step(e.step, times[k], beside, integers, floats)
        if partitioned == 1:
            e.state[MODE] = HELD
        for j in range(n):
            beside[j] = q[k, j] + DIFFERENCE_STEP
            status = max(status, call_step(e.step, times[k], beside, integers, floats))
            for i in range(n):
                F[k, i, j] = e.q_dot[i]
            beside[j] = q[k, j] - DIFFERENCE_STEP
            status = max(status, call_step(e.step, times[k], beside, integers, floats))
            for i in range(n):
                F[k, i, j] = (F[k, i, j] - e.q_dot[i]) / (2.0 * DIFFERENCE_STEP)
            beside[j] = q[k, j]
        if status >= SINGULAR_J:
            F[k, 0, 0] = math.nan


def linearisations(controller: Controller, times: Array, q: Array) -> Array:
    """F = ∂(S u)/∂q (K, n, n) of the closed loop without limits at times (K,) and q (K, n), each with the
    partition chosen for its (t, q); NaN where a step fails."""
    F = np.full((len(q), q.shape[1], q.shape[1]), np.nan)
    with controller.without_limits():
        controller.reset()
        if controller.solver.compiles_steps and type(controller.solver.state) in (State, PartitionState):
            partitioned = int(isinstance(controller.solver.state, PartitionState))
            start = controller.solver.state.memory.copy()
            with controller.solver.compiled() as blocks:
                at = np.ascontiguousarray(times), np.ascontiguousarray(q)
                checked_by_caller(linearise, LINEARISE)(*blocks, *at, start, partitioned, F)
        else:
            for k, t in enumerate(times):
                controller.reset()
                with suppress(RunError):  # singular just beside: not a matter of dt
                    F[k] = linearisation(controller, float(t), q[k])
        controller.reset()
    return F


def linearisation(controller: Controller, t: float, q: Array) -> Array:
    """F = ∂(S u)/∂q (n, n) of the closed loop at (t, q), with the partition of (t, q) kept."""
    if controller.solver.step_size is None:
        controller.velocity(t, q)
    else:  # α is the sample's
        controller(t, q)
    F = np.empty((q.size, q.size))
    with controller.solver.state.held():
        for j in range(q.size):
            offset = np.zeros(q.size)
            offset[j] = DIFFERENCE_STEP
            difference = controller.velocity(t, q + offset) - controller.velocity(t, q - offset)
            F[:, j] = difference / (2.0 * DIFFERENCE_STEP)
    return F


def instabilities(
    controller: Controller, times: Array, q: Array, dt: float, stability: tuple[float, ...]
) -> list[Instability]:
    """At each of times (K,) and q (K, n) the fastest mode that dt is too long for, if any."""
    if not stability or controller.given.order == 2:  # whose modes are those of (q, u)
        return []
    F = linearisations(controller, times, q)
    known = np.flatnonzero(np.isfinite(F).all(axis=(1, 2)))
    try:
        eigenvalues = np.linalg.eigvals(F[known])
    except np.linalg.LinAlgError:  # they do not converge: it says nothing of dt
        return []
    grows = np.abs(np.polyval(stability[::-1], eigenvalues * dt)) > 1.0 + 1e-6
    # A mode of a few 1/s that the differences show as barely decaying is not what breaks a run.
    decays = -eigenvalues.real
    guilty = grows & (decays * dt > 1e-3) & (decays > 0.1 * np.abs(eigenvalues))
    unstable, fractions = [], np.linspace(0.0, 1.0, 1001)[1:]
    for k in np.flatnonzero(guilty.any(axis=1)):
        modes = eigenvalues[k][guilty[k]]
        fastest = modes[np.argmin(modes.real)]
        stable = np.abs(np.polyval(stability[::-1], fastest * dt * fractions)) <= 1.0
        limit = fractions[np.argmin(stable) - 1] * dt if np.argmin(stable) else fractions[0] * dt
        unstable.append(Instability(float(times[known[k]]), float(-fastest.real), float(limit)))
    return unstable


class Assessment(NamedTuple):
    """What is wrong with a run: instabilities at `examined` instants; an error above its expected decay; the
    number of steps in which the target moved otherwise than its rate says."""

    unstable: list[Instability]
    examined: int
    departure: Departure | None
    target: int

    @property
    def missed(self) -> bool:
        return self.departure is not None and self.departure.missed


def assess(
    controller: Controller, recorder: Recorder, advance: Integrator, dt: float, held: bool = True
) -> Assessment:
    """Assess a recorded run; `held`: also against its expected decay."""
    with controller.without_limits():
        some = np.unique(np.linspace(0, len(recorder) - 1, EXAMINED if advance.stability else 0).astype(int))
        unstable = instabilities(controller, recorder.t[some], recorder.q[some], dt, advance.stability)
        if len(recorder) < 3 or not held:
            return Assessment(unstable, len(some), None, 0)
        samples = TaskSamples.of(recorder)
        if advance.tolerance:
            steps = adaptive_errors(samples, recorder.so_far.q, advance.tolerance)
        else:
            steps = step_errors(samples, advance.order)
        departed, own = departure(samples, steps, goes_on=recorder.goes_on), 0
        if departed is not None:  # then it is worth the time to ask the target
            moved = _target_moves(controller, samples, recorder.so_far.q)
            departed = departure(samples, steps, moved, goes_on=recorder.goes_on)
            own = _own_moves(samples, moved)
        return Assessment(unstable, len(some), departed, own)


def _own_moves(samples: TaskSamples, moved: Array) -> int:
    """The number of steps in which the target moved significantly otherwise than its rate says; 0 if few.
    Smaller motions may be errors of `_target_moves`'s trapezoids, for any target that moves non-uniformly."""
    decays = decay(samples.t, samples.error, samples.feedback)
    counts = ENDS * (1.0 + float(np.linalg.norm(samples.error[0])))
    own = int(np.sum(moved > counts * np.maximum(1.0 - decays, 1.0 / len(moved))))
    return own if own > OFTEN * len(moved) else 0


def _target_moves(controller: Controller, samples: TaskSamples, q: Array) -> Array:
    """Change of the error along each step with q held, beyond what its rate says, (N - 1,)."""
    error, rate = controller.solver.errors(samples.t[1:], q[:-1])
    controller.reset()
    feedback = samples.feedback
    moved = samples.rate - feedback.rates(samples.error)
    rates = moved[:-1] + rate - error @ feedback.K.T  # a step's rate is that of unbounded feedback
    change = error - samples.error[:-1] - 0.5 * np.diff(samples.t)[:, np.newaxis] * rates
    return np.nan_to_num(np.linalg.norm(change, axis=1))
