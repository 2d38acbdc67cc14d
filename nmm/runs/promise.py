"""What a gain promises of the task error along a run, and what an integrator of finite step may add to it.

The closed loop has e_dot = -K e whatever the robot, so that e(t) = exp(-K (t - t0)) e(t0): an angle's error
and a pose's logarithm too. A step h of a method of order p adds its local error. What that is made of is
known at the samples: along a step the task's rate changes by ΔJ u (the robot's own curvature) and by Δ(∂e/∂t)
(the reference's acceleration), and feedback by K² e h, so that the local error of a method of first order is

    c = h/2 (‖ΔJ u‖ + ‖Δ ∂e/∂t‖ + h ‖K² e‖),

to leading order, and that of a method of order p is c ρ^(p-1), where ρ is h over the time in which the motion
changes: the share by which u, J or ∂e/∂t changed along the step. Errors made earlier decay as the error
itself does. Where a task bounds its feedback by a speed or a braking, K e is that bounded vector throughout
(`Feedback`), the promise is its flow, and along a step on which a bound binds nothing is taken to decay. A
step along which u or J changed by more than their own size is not resolved by the method and explains
nothing: no allowance is made for it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import types

from nmm.arrays import Array, Integers
from nmm.kernels.compiled import compiled, kernel, view
from nmm.runs.feedback import Feedback
from nmm.runs.residuals import differs

#: The local error is estimated, not bounded: this many times the estimate is allowed.
SAFETY = 3.0
#: What integration may come to at most, as a share of 1 + ‖e(t0)‖ (m, rad): what errs more does not follow.
MOST = 0.1
#: The error has left its promise where it exceeds it by more than this share of 1 + ‖e(t0)‖.
LEFT = 0.01
#: At its end it is where it was promised: up to this many times the promise, and up to a share as above.
RETURNED, ENDS = 2.0, 1e-3


class Samples(NamedTuple):
    """What a run recorded of its task: N samples, s rows, m inputs.

    Attributes
    ----------
    t (N,) s; error (N, s); rate (N, s): ∂e/∂t + K e, asked of J u; J (N, s, m); u (N, m)
    residual (N,) : ‖J u - rate‖
    partition (N, s) : columns of Ja, -1 where there is none
    feedback : K e, as the tasks bound it
    """

    t: Array
    error: Array
    rate: Array
    J: Array
    u: Array
    residual: Array
    partition: Integers
    feedback: Feedback


class Departure(NamedTuple):
    """The error left its promise.

    Attributes
    ----------
    first, worst : the samples at which it left and at which it was farthest from it
    promise (N,) : ‖exp(-K (t - t0)) e(t0)‖, or what bounded feedback leaves
    bound (N,) : the largest ‖e‖ that the promise, integration and the target explain
    unmet (N,) : what the residual adds to it, where the inputs did not do what the task asked
    missed : whether the run did not keep its promise; else the error left it by little, or because of the
        residual, and came back
    """

    first: int
    worst: int
    promise: Array
    bound: Array
    unmet: Array
    missed: bool


def departure(
    samples: Samples, step: Array, target: Array | None = None, *, goes_on: bool = False
) -> Departure | None:
    """Where and how far ‖e‖ left what was promised; None where it did not.

    Parameters
    ----------
    samples : the run
    step (N - 1,) : the error that each integration step may add (`step_errors`)
    target (N - 1,) : by how much the target moved along each step otherwise than its rate says: a target that
        jumps restarts the promise
    goes_on : whether the task goes on after the last sample, so that the error need not have returned there
    """
    t, error = samples.t, samples.error
    if len(t) < 2:
        return None
    decays = decay(t, error, samples.feedback)
    norm = _sizes(error)
    size = 1.0 + norm[0]
    promise = promised(t, error, samples.feedback)
    bound = promise + np.minimum(accumulated(step, decays), MOST * size)
    if target is not None:
        bound = bound + accumulated(target, decays)
    short = np.where(differs(samples.residual, samples.rate), samples.residual, 0.0)
    unmet = accumulated(np.diff(t) * np.maximum(short[1:], short[:-1]), decays)
    excess = norm - bound
    ends_off = not goes_on and norm[-1] > RETURNED * bound[-1] + ENDS * size
    missed = bool(np.any(excess - unmet > LEFT * size) or ends_off)
    (beyond,) = np.nonzero(excess > ENDS * size)
    if not beyond.size:
        return None
    return Departure(int(beyond[0]), int(np.argmax(excess)), promise, bound, unmet, missed)


def _exponential(A: Array) -> Array:
    """e^A of a square matrix; most feedback is a diagonal."""
    diagonal = np.diagonal(A)
    if np.array_equal(A, np.diag(diagonal)):
        return np.diag(np.exp(diagonal))
    from scipy.linalg import expm  # here: a fifth of a second that most runs need not pay

    return expm(A)


def decay(t: Array, error: Array, feedback: Feedback) -> Array:
    """‖exp(-K h)‖ of each step h, (N - 1,); 1 where feedback is bounded at either end of it."""
    steps, which = _steps(t)
    norms = np.array([np.linalg.norm(_exponential(-feedback.K * h), 2) for h in steps])
    bound = feedback.bound(error)
    return np.where(bound[1:] | bound[:-1], 1.0, norms[which])


def promised(t: Array, error: Array, feedback: Feedback) -> Array:
    """‖e‖ at the times (N,) of e_dot = -K e from error[0], in the mixed units of the rows."""
    if feedback.has_bounds:
        from scipy.integrate import solve_ivp  # here: a quarter of a second that most runs need not pay

        span, first = (t[0], t[-1]), error[0]
        flow = solve_ivp(lambda _, e: -feedback.rates(e[np.newaxis])[0], span, first, "LSODA", t, rtol=1e-6)
        return _sizes(flow.y.T)
    steps, which = _steps(t)
    factors = np.array([_exponential(-feedback.K * h) for h in steps])
    errors = np.empty((len(t), error.shape[1]))
    errors[0] = error[0]
    carry_on(factors, which, errors)
    return _sizes(errors)


@compiled
def carry_on(factors: Array, which: Integers, errors: Array) -> None:
    """errors (N, s) from the first: errors[k + 1] = factors[which[k]] errors[k]."""
    for k in range(which.shape[0]):
        for i in range(errors.shape[1]):
            errors[k + 1, i] = 0.0
            for j in range(errors.shape[1]):
                errors[k + 1, i] += factors[which[k], i, j] * errors[k, j]


def _steps(t: Array) -> tuple[Array, Integers]:
    """The steps that there are between the times (N,), and which of them each is, (N - 1,)."""
    steps = np.round(np.diff(t), 12)
    if np.all(steps == steps[0]):
        return steps[:1], np.zeros(len(steps), dtype=np.int64)
    return np.unique(steps, return_inverse=True)


def step_errors(samples: Samples, order: int) -> Array:
    """The error that a method of that order may make along each step, (N - 1,); 0 where it cannot follow."""
    t, error, rate, J, u, _, partition, feedback = samples
    fed, K, found = feedback.rates(error), feedback.K, np.empty(len(t) - 1)
    again = np.ascontiguousarray(fed @ K.T)  # K² e
    size = float(np.linalg.norm(K, 2))
    write_step_errors(t, rate - fed, again, J, u, partition, size, order, found)
    return found


@kernel(
    types.void(
        *(types.float64[::1], types.float64[:, ::1], types.float64[:, ::1], types.float64[:, :, ::1]),
        *(types.float64[:, ::1], types.int64[:, ::1], types.float64, types.int64, types.float64[::1]),
    )
)
def write_step_errors(
    t: Array,
    moved: Array,
    again: Array,
    J: Array,
    u: Array,
    partition: Integers,
    gain: float,
    order: int,
    found: Array,
) -> None:
    """found (N - 1,): `step_errors`, of moved (N, s): ∂e/∂t, again (N, s): K² e, and gain: ‖K‖."""
    s, m = J.shape[1], J.shape[2]
    jumped = 0.0
    for k in range(t.shape[0] - 1):
        h = t[k + 1] - t[k]
        turned, fed, switched = 0.0, 0.0, False
        for i in range(s):
            along = 0.0
            for j in range(m):
                along += (J[k + 1, i, j] - J[k, i, j]) * u[k, j]
            turned += along * along
            fed += again[k, i] * again[k, i]
            switched = switched or partition[k + 1, i] != partition[k, i]
        drifted, share = changed(moved, k, s)
        first = 0.5 * h * (math.sqrt(turned) + drifted + h * math.sqrt(fed))
        if not switched:  # else u jumps between two steps, not along one
            _, jumped = changed(u, k, m)
        change = max(jumped, changed(J, k, s * m)[1])
        share = max(max(change, share), h * gain)
        found[k] = SAFETY * first * min(share, 1.0) ** (order - 1) if change <= 1.0 else 0.0


@compiled
def changed(values: Array, k: int, size: int) -> tuple[float, float]:
    """‖v[k+1] - v[k]‖ of v (N, ...) with so many numbers a sample, and that beside the larger of both."""
    flat = view(values, k * size, (2 * size,))
    one, other, both = 0.0, 0.0, 0.0
    for i in range(size):
        one += flat[i] * flat[i]
        other += flat[size + i] * flat[size + i]
        both += (flat[size + i] - flat[i]) ** 2
    larger, apart = math.sqrt(max(one, other)), math.sqrt(both)
    return apart, apart / larger if larger > 0.0 else apart


def adaptive_errors(samples: Samples, q: Array, tolerance: float) -> Array:
    """What steps of adaptive size add between samples at q (N, n) with a tolerance in m and rad, (N - 1,)."""
    moved = np.linalg.norm(samples.J[:-1], axis=(1, 2)) * (1.0 + np.abs(q[:-1]).max(axis=1))
    return np.asarray(SAFETY * tolerance * moved)


def accumulated(added: Array, decays: Array) -> Array:
    """What errors added along each step (N - 1,) come to at the samples (N,), each decaying from there on."""
    total = np.zeros(len(added) + 1)
    add_up(np.ascontiguousarray(added), np.ascontiguousarray(decays), total)
    return total


@compiled
def add_up(added: Array, decays: Array, total: Array) -> None:
    """total[k + 1] = decays[k] total[k] + added[k]."""
    for k in range(added.shape[0]):
        total[k + 1] = decays[k] * total[k] + added[k]


def _sizes(rows: Array) -> Array:
    return np.sqrt(np.einsum("ki,ki->k", rows, rows))
