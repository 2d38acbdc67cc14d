"""Whether an integrator's step can follow the closed loop: eigenvalues of its linearisation."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import types

from nmm.arrays import Array, Integers
from nmm.control.controller import Controller
from nmm.control.equations import ControlStep, call_step
from nmm.errors import RunError
from nmm.functions.callbacks import STEP
from nmm.functions.program import BESIDE
from nmm.kernels.compiled import checked_by_caller, compiled_without_gil, scratch
from nmm.kernels.memory import views
from nmm.resolvers.answer import SINGULAR_J
from nmm.resolvers.partitions import HELD, MODE, PartitionState
from nmm.resolvers.state import State


class Advice(NamedTuple):
    """The dt (s) with which a run behaved when it was tried, and from when to when (s)."""

    dt: float
    start: float
    end: float


@dataclass(frozen=True)
class Instability:
    """A mode that decays in continuous time and grows in the integrator's steps.

    t : when, s; rate : how fast the mode decays, 1/s; limit : the step below which it decays too, s
    """

    t: float
    rate: float
    limit: float

    def describe(self, method: str, dt: float, advice: Advice | None) -> str:
        """One sentence, with advice where a shorter dt was tried and followed the motion."""
        said = (
            f"alpha * dt (or K * dt) is too large: at t = {self.t:.3g} s a mode of the closed loop decays "
            f"with {self.rate:.3g} 1/s, which {method} does not follow with dt = {dt:g} s"
        )
        if advice is None:
            return said
        tried = f"tried from t = {advice.start:g} to {advice.end:g} s"
        return f"{said}; a dt below {advice.dt:.3g} s follows it ({tried})"


LINEARISE = types.void(
    *(types.int64[::1], types.float64[::1], types.float64[::1], types.float64[:, ::1]),
    *(types.int64[::1], types.int64, types.float64[:, :, ::1]),
)


@compiled_without_gil
def linearise(
    integers: Integers,
    floats: Array,
    times: Array,
    q: Array,
    start: Integers,
    partitioned: int,
    F: Array,
) -> None:
    """F (K, n, n) at times (K,) and q (K, n): `linearisation`; NaN where a step failed.

    start : what the resolver's state holds at first; the step size is constant, and nothing limits.
    """
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
            beside[j] = q[k, j] + STEP
            status = max(status, call_step(e.step, times[k], beside, integers, floats))
            for i in range(n):
                F[k, i, j] = e.q_dot[i]
            beside[j] = q[k, j] - STEP
            status = max(status, call_step(e.step, times[k], beside, integers, floats))
            for i in range(n):
                F[k, i, j] = (F[k, i, j] - e.q_dot[i]) / (2.0 * STEP)
            beside[j] = q[k, j]
        if status >= SINGULAR_J:
            F[k, 0, 0] = math.nan


def linearisations(controller: Controller, times: Array, q: Array) -> Array:
    """F = ∂(S u)/∂q of the closed loop without limits at times (K,) and q (K, n), shape (K, n, n).

    Each with the partition of its (t, q) kept, which is decided anew; not a number where there are no inputs.
    """
    F = np.full((len(q), q.shape[1], q.shape[1]), np.nan)
    with controller.without_limits():
        controller.reset()
        if controller.compilable and type(controller.state) in (State, PartitionState):
            partitioned = int(isinstance(controller.state, PartitionState))
            start = controller.state.snapshot()
            with controller.compiled() as blocks:
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
    """F = ∂(S u)/∂q of the closed loop at (t, q), shape (n, n), with the partition of (t, q) kept."""
    if controller.step_size is None:
        controller.velocity(t, q)
    else:  # α is the sample's
        controller(t, q)
    F = np.empty((q.size, q.size))
    with controller.state.held():
        for j in range(q.size):
            offset = np.zeros(q.size)
            offset[j] = STEP
            difference = controller.velocity(t, q + offset) - controller.velocity(t, q - offset)
            F[:, j] = difference / (2.0 * STEP)
    return F


def instabilities(
    controller: Controller, times: Array, q: Array, dt: float, stability: tuple[float, ...]
) -> list[Instability]:
    """At each of times (K,) and q (K, n) the fastest mode that dt is too long for, where there is one."""
    if not stability:
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
    found = []
    for k in np.flatnonzero(guilty.any(axis=1)):
        modes = eigenvalues[k][guilty[k]]
        fastest = modes[np.argmin(modes.real)]
        fractions = np.linspace(0.0, 1.0, 1001)[1:]
        stable = np.abs(np.polyval(stability[::-1], fastest * dt * fractions)) <= 1.0
        limit = fractions[np.argmin(stable) - 1] * dt if np.argmin(stable) else fractions[0] * dt
        found.append(Instability(float(times[known[k]]), float(-fastest.real), float(limit)))
    return found
