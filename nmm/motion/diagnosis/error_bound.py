"""How the gain lets the task error decay along a run, and what an integrator of finite step may add to it.

The closed loop has e_dot = -K e for any robot, so e(t) = exp(-K (t - t0)) e(t0), also for angles and a pose's
logarithm. A step h of a method of order p adds its local error. Along a step the task's rate changes by ΔJ u
(the robot's curvature) and Δ(∂e/∂t) (the reference's acceleration), and feedback by K² e h, so that the local
error is c for order 1 and c ρ^(p-1) for order p, to leading order, with

    c = h/2 (‖ΔJ u‖ + ‖Δ ∂e/∂t‖ + h ‖K² e‖)

and ρ the share by which u, J or ∂e/∂t changed along the step. Earlier errors decay as the error does. Where a
task bounds its feedback by a speed or braking (`Feedback`), the decay follows the bounded K e, and nothing
is taken to decay where a bound binds. A step along which u or J changed by more than its own size is not
resolved by the method: no allowance is made for it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from nmm.base.arrays import Array, Flags, Integers
from nmm.base.kernels.compiled import compiled, kernel, view
from nmm.base.kernels.signatures import float64, int64, void
from nmm.motion.recording import Recorder
from nmm.motion.residuals import differs

#: Factor on the local error, which is estimated, not bounded.
SAFETY = 3.0
#: Largest integration error of a run that follows its target, as a share of 1 + ‖e(t0)‖ (m, rad).
MOST = 0.1
#: The error counts as above its expected decay from more than this share of 1 + ‖e(t0)‖.
LEFT = 0.01
#: The final error is as expected up to this factor, or up to a share as above.
RETURNED, ENDS = 2.0, 1e-3


class Feedback(NamedTuple):
    """K e of s rows, K (s, s) in 1/s, with ‖K e‖ <= speed and ‖K e‖² <= 2 braking ‖e‖ over the rows of a
    group; speed and braking are infinite for none."""

    K: Array
    speed: Array
    braking: Array
    group: Integers

    @property
    def has_bounds(self) -> bool:
        return bool(np.isfinite([self.speed, self.braking]).any())

    def rates(self, error: Array) -> Array:
        """The rate for errors (N, s), per second, (N, s)."""
        fed = error @ self.K.T
        return fed * self._shares(error, fed)

    def bound(self, error: Array) -> Flags:
        """Whether a bound binds at errors (N, s), (N,)."""
        return np.asarray(np.any(self._shares(error, error @ self.K.T) < 1.0, axis=1))

    def _shares(self, error: Array, fed: Array) -> Array:
        same = (self.group[:, np.newaxis] == self.group).astype(np.float64)
        size, far = np.sqrt(fed**2 @ same), np.sqrt(error**2 @ same)
        with np.errstate(invalid="ignore"):  # ∞ times 0 at the target: no bound there
            most = np.fmin(self.speed, np.sqrt(2.0 * self.braking * far))
        return np.where(size > most, most / np.where(size > 0.0, size, 1.0), 1.0)


class TaskSamples(NamedTuple):
    """A task at N samples: t, s; error and rate (N, s), ∂e/∂t + K e, asked of J u; J (N, s, m); u (N, m);
    residual ‖J u - rate‖; Ja's columns, -1 for none; feedback K e, as bounded."""

    t: Array
    error: Array
    rate: Array
    J: Array
    u: Array
    residual: Array
    partition: Integers
    feedback: Feedback
    servo: float = 0.0

    @classmethod
    def of(cls, recorder: Recorder) -> TaskSamples:
        """The samples recorded so far, with the rate of bounded feedback."""
        controller, recorded = recorder.controller, recorder.so_far
        task = controller.solver.step_memory.task
        feedback = Feedback(task.gain, task.speed, task.braking, task.group)
        error, rate, residual, J, u = recorded.error, recorded.rate, recorded.residual, recorded.J, recorded.u
        if feedback.has_bounds:
            full = rate
            rate = rate - error @ feedback.K.T + feedback.rates(error)
            if recorder.at_middle:  # u is not of the samples at which J and the rate are
                residual = np.maximum(residual - _sizes(full - rate), 0.0)
            else:
                residual = np.linalg.norm(np.einsum("kij,kj->ki", J, u) - rate, axis=1)
        servo = float(controller.given.servo) if controller.given.order == 2 else 0.0
        return cls(recorder.t, error, rate, J, u, residual, recorded.partition, feedback, servo)

    def lag(self) -> tuple[Array, Array]:
        """At order 2, what J u may lack of the rate at the samples, as y_dot = -k y has it, and what it
        lacks more, (N,) each; zeros at order 1."""
        if not self.servo:
            return np.zeros(len(self.t)), np.zeros(len(self.t))
        lacks = np.linalg.norm(np.einsum("kij,kj->ki", self.J, self.u) - self.rate, axis=1)
        expected = lacks[0] * np.exp(-self.servo * (self.t - self.t[0]))
        return expected, np.maximum(lacks - expected, 0.0)


class Departure(NamedTuple):
    """Where the error exceeds its expected decay.

    first, worst : the samples at which it left and was farthest away
    bound (N,) : the largest ‖e‖ that decay, integration and target explain
    unmet (N,) : what the residual adds, where inputs fell short of the task
    missed : the error stayed above; else it exceeded that by little, or by the residual, and came back
    """

    first: int
    worst: int
    bound: Array
    unmet: Array
    missed: bool


def departure(
    samples: TaskSamples, step: Array, target: Array | None = None, *, goes_on: bool = False
) -> Departure | None:
    """Where and how far ‖e‖ exceeds its expected decay, if it does.

    step (N - 1,) : the error that each integration step may add (`step_errors`)
    target (N - 1,) : the target's motion along each step beyond its rate; one that jumps restarts the decay
    goes_on : the task goes on after the last sample, so that the error need not have returned there
    """
    t, error = samples.t, samples.error
    if len(t) < 2:
        return None
    decays = decay(t, error, samples.feedback)
    norm = _sizes(error)
    size = 1.0 + norm[0]
    bound = expected_decay(t, error, samples.feedback) + np.minimum(accumulated(step, decays), MOST * size)
    if target is not None:
        bound = bound + accumulated(target, decays)
    short = np.where(differs(samples.residual, samples.rate), samples.residual, 0.0)
    if samples.servo:
        lags, more = samples.lag()
        bound = bound + accumulated(np.diff(t) * lags[:-1], decays)
        short = np.where(np.cumsum(short) > 0.0, more, 0.0)
    unmet = accumulated(np.diff(t) * np.maximum(short[1:], short[:-1]), decays)
    excess = norm - bound
    ends_off = not goes_on and norm[-1] > RETURNED * bound[-1] + ENDS * size
    missed = bool(np.any(excess - unmet > LEFT * size) or ends_off)
    (beyond,) = np.nonzero(excess > ENDS * size)
    if not beyond.size:
        return None
    return Departure(int(beyond[0]), int(np.argmax(excess)), bound, unmet, missed)


def _exponential(A: Array) -> Array:
    """e^A of a square matrix, usually a diagonal one."""
    diagonal = np.diagonal(A)
    if np.array_equal(A, np.diag(diagonal)):
        return np.diag(np.exp(diagonal))
    from scipy.linalg import expm  # here: a fifth of a second that most runs need not pay

    return expm(A)


def decay(t: Array, error: Array, feedback: Feedback) -> Array:
    """‖exp(-K h)‖ of each step h, (N - 1,); 1 where feedback is bounded at either end."""
    steps, which = _steps(t)
    norms = np.array([np.linalg.norm(_exponential(-feedback.K * h), 2) for h in steps])
    bound = feedback.bound(error)
    return np.where(bound[1:] | bound[:-1], 1.0, norms[which])


def expected_decay(t: Array, error: Array, feedback: Feedback) -> Array:
    """‖e‖ at t (N,) of e_dot = -K e from error[0], in the rows' mixed units."""
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
    """errors (N, s): errors[k + 1] = factors[which[k]] errors[k]."""
    for k in range(which.shape[0]):
        for i in range(errors.shape[1]):
            errors[k + 1, i] = 0.0
            for j in range(errors.shape[1]):
                errors[k + 1, i] += factors[which[k], i, j] * errors[k, j]


def _steps(t: Array) -> tuple[Array, Integers]:
    """The distinct steps between times (N,), and the index of each step, (N - 1,)."""
    steps = np.round(np.diff(t), 12)
    if np.all(steps == steps[0]):
        return steps[:1], np.zeros(len(steps), dtype=np.int64)
    return np.unique(steps, return_inverse=True)


def step_errors(samples: TaskSamples, order: int) -> Array:
    """The error that a method of that order may make along each step, (N - 1,); 0 for unresolved steps."""
    t, error, rate, J, u, _, partition, feedback, _ = samples
    fed, K, errors = feedback.rates(error), feedback.K, np.empty(len(t) - 1)
    again = np.ascontiguousarray(fed @ K.T)  # K² e
    size = float(np.linalg.norm(K, 2))
    write_step_errors(t, rate - fed, again, J, u, partition, size, order, errors)
    return errors


@kernel(
    void(
        *(float64[::1], float64[:, ::1], float64[:, ::1], float64[:, :, ::1]),
        *(float64[:, ::1], int64[:, ::1], float64, int64, float64[::1]),
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
    """`step_errors` into found (N - 1,), of moved (N, s): ∂e/∂t, again (N, s): K² e, gain: ‖K‖."""
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
    before, after, both = 0.0, 0.0, 0.0
    for i in range(size):
        before += flat[i] * flat[i]
        after += flat[size + i] * flat[size + i]
        both += (flat[size + i] - flat[i]) ** 2
    larger, apart = math.sqrt(max(before, after)), math.sqrt(both)
    return apart, apart / larger if larger > 0.0 else apart


def adaptive_errors(samples: TaskSamples, q: Array, tolerance: float) -> Array:
    """Errors (N - 1,) of adaptive steps between samples at q (N, n), with a tolerance in m and rad."""
    moved = np.linalg.norm(samples.J[:-1], axis=(1, 2)) * (1.0 + np.abs(q[:-1]).max(axis=1))
    return np.asarray(SAFETY * tolerance * moved)


def accumulated(added: Array, decays: Array) -> Array:
    """Errors (N,) at the samples from those added along each step (N - 1,), each decaying afterwards."""
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
