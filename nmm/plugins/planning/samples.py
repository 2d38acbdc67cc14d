"""Motions of samples in which each input's rate is constant, compiled: where they lead, and how that changes.

Within a sample the inputs are linear in time, u + τ a. Joints move along parabolas, exactly; the platform's
part of q̇ = S(q) u is integrated by a Runge-Kutta method of order 6 (J. C. Butcher, On Runge-Kutta processes
of high order, 1964) from the sample's beginning, so that S(q) u is kept far below 1e-9.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from nmm.base.arrays import Array, Integers
from nmm.base.kernels.compiled import call_platform, checked_by_caller, clear, compiled, scratch, view
from nmm.base.kernels.linear_algebra import copied
from nmm.base.kernels.record_layout import BLOCKS, IntegerCell, Matrix, Memory, Vector, views
from nmm.base.kernels.signatures import float64, void
from nmm.base.kernels.velocity_map import place_mimic_joints, to_coordinates
from nmm.model.robots.zero_order_hold import Inputs

#: The method's times, slopes' shares of each stage, and of the step.
TIMES = np.array([0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0 / 3.0, 0.5, 0.5, 1.0])
STAGES = np.array(
    [
        [0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [1.0 / 3.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [0.0, 2.0 / 3.0, 0.0, 0.0, 0.0, 0.0],
        [1.0 / 12.0, 1.0 / 3.0, -1.0 / 12.0, 0.0, 0.0, 0.0],
        [-1.0 / 16.0, 9.0 / 8.0, -3.0 / 16.0, -3.0 / 8.0, 0.0, 0.0],
        [0.0, 9.0 / 8.0, -3.0 / 8.0, -3.0 / 4.0, 0.5, 0.0],
        [9.0 / 44.0, -9.0 / 11.0, 63.0 / 44.0, 18.0 / 11.0, 0.0, -16.0 / 11.0],
    ]
)
WEIGHTS = np.array([11.0 / 120.0, 0.0, 27.0 / 40.0, 27.0 / 40.0, -4.0 / 15.0, -4.0 / 15.0, 11.0 / 120.0])

#: How often the platform's twist is looked at in a sample.
LOOKS = 4


@compiled
def flow(
    inputs: Inputs, q: Array, u: Array, a: Array, time: float, substeps: int, ahead: Array, D: Array
) -> None:
    """ahead (n,): q after a time within a sample; D (n, n + 2 m), not written without columns: its derivative
    by q, u and a."""
    n, m, n_p = q.shape[0], u.shape[0], inputs.coordinates
    p = m - inputs.moved.shape[0]
    wanted = n_p + 2 * p if D.shape[1] > 0 else 0
    G, G_q = scratch((n_p, p)), scratch((n_p, p, n_p))
    at, E = scratch(n_p), scratch((n_p, wanted))
    stage, stage_E = scratch(n_p), scratch((n_p, wanted))
    slopes, slopes_E = scratch((7, n_p)), scratch((7, n_p, wanted))
    copied(q, at)
    clear(E)
    if wanted > 0:
        for i in range(n_p):
            E[i, i] = 1.0
    step = time / substeps
    for part in range(substeps if n_p > 0 else 0):
        for k in range(7):
            after = (part + TIMES[k]) * step
            for i in range(n_p):
                stage[i] = at[i]
                for j in range(k):
                    stage[i] += step * STAGES[k, j] * slopes[j, i]
                for c in range(wanted):
                    stage_E[i, c] = E[i, c]
                    for j in range(k):
                        stage_E[i, c] += step * STAGES[k, j] * slopes_E[j, i, c]
            clear(G)
            clear(G_q)
            call_platform(inputs.platform, stage, inputs.parameters, G, G_q)
            for i in range(n_p):
                slopes[k, i] = 0.0
                for c in range(wanted):
                    slopes_E[k, i, c] = 0.0
                for j in range(p):
                    up = u[j] + after * a[j]
                    slopes[k, i] += G[i, j] * up
                    if wanted > 0:
                        slopes_E[k, i, n_p + j] += G[i, j]
                        slopes_E[k, i, n_p + p + j] += after * G[i, j]
                        for b in range(n_p):
                            by_q = G_q[i, j, b] * up
                            if by_q != 0.0:
                                for c in range(wanted):
                                    slopes_E[k, i, c] += by_q * stage_E[b, c]
        for k in range(7):
            if WEIGHTS[k] != 0.0:
                for i in range(n_p):
                    at[i] += step * WEIGHTS[k] * slopes[k, i]
                    for c in range(wanted):
                        E[i, c] += step * WEIGHTS[k] * slopes_E[k, i, c]
    copied(q, ahead)
    for i in range(n_p):
        ahead[i] = at[i]
    for j in range(p, m):
        i = inputs.moved[j - p]
        ahead[i] += time * (u[j] + 0.5 * time * a[j])
    place_mimic_joints(ahead, inputs.mimic_joints)
    if wanted == 0:
        return
    clear(D)
    for i in range(n_p):
        for b in range(n_p):
            D[i, b] = E[i, b]
        for j in range(p):
            D[i, n + j] = E[i, n_p + j]
            D[i, n + m + j] = E[i, n_p + p + j]
    for j in range(p, m):
        i = inputs.moved[j - p]
        D[i, i], D[i, n + j], D[i, n + m + j] = 1.0, time, 0.5 * time * time
    for k in range(0, inputs.mimic_joints.shape[0], 4):
        joint, leader = int(inputs.mimic_joints[k]), int(inputs.mimic_joints[k + 1])
        for c in range(D.shape[1]):
            D[joint, c] = inputs.mimic_joints[k + 2] * D[leader, c]


@compiled
def write_rates(inputs: Inputs, q: Array, u: Array, q_dot: Array) -> None:
    """q_dot (n,) = S(q) u."""
    n_p = inputs.coordinates
    p = u.shape[0] - inputs.moved.shape[0]
    G, G_q = scratch((n_p, p)), scratch((n_p, p, n_p))
    clear(G)
    clear(G_q)
    if n_p > 0:
        call_platform(inputs.platform, view(q, 0, (n_p,)), inputs.parameters, G, G_q)
    to_coordinates(u, G, p, inputs.moved, inputs.mimic_joints, q_dot)


@compiled
def write_fastest(
    inputs: Inputs, q: Array, u: Array, a: Array, time: float, substeps: int, leg: Array
) -> None:
    """leg (3 + n,): how much of each of its numbers a sample can change, at most, when it kept its largest
    rate. Joints' rates are largest at an end. The platform's twist is looked at `LOOKS` times, and the
    largest change between two looks is added: linear in time on most platforms, it is nowhere larger."""
    n, m, n_p = q.shape[0], u.shape[0], inputs.coordinates
    current, none, held, rates = scratch(n), scratch((n, 0)), scratch(m), scratch(n)
    now, before, change = scratch(3 + n), scratch(3 + n), scratch(3 + n)
    clear(rates)
    clear(leg)
    clear(change)
    clear(now)
    for k in range(LOOKS + 1):
        after = time * k / LOOKS
        flow(inputs, q, u, a, after, substeps, current, none)
        for j in range(m):
            held[j] = u[j] + after * a[j]
        write_rates(inputs, current, held, rates)
        copied(now, before)
        for i in range(n):
            now[3 + i] = rates[i]
        if n_p >= 3:
            c, s = math.cos(current[2]), math.sin(current[2])
            now[0], now[1], now[2] = c * rates[0] + s * rates[1], c * rates[1] - s * rates[0], rates[2]
            now[3] = now[4] = now[5] = 0.0
        for i in range(3 + n):
            leg[i] = max(leg[i], time * abs(now[i]))
            if k > 0 and i < 3 + n_p:
                change[i] = max(change[i], time * abs(now[i] - before[i]))
    for i in range(3 + n):
        leg[i] += change[i]


class MotionSamples(NamedTuple):
    """N samples, one after the other.

    inputs : what they move; begin (N + 1,) : when each begins and the last ends, s; substeps () : of each
    q (N + 1, n), u (N + 1, m) : then; a (N, m) : du/dt within
    """

    inputs: Inputs
    begin: Vector
    substeps: IntegerCell
    q: Matrix
    u: Matrix
    a: Matrix


@compiled
def _follow(integers: Integers, floats: Array, times: Array, q: Array, u: Array, q_dot: Array) -> None:
    """q (K, n), u (K, m) and q_dot (K, n) at times (K,)."""
    samples, none = views(MotionSamples, integers, floats, 0), scratch((q.shape[1], 0))
    inputs, N, k = samples.inputs, samples.a.shape[0], 0
    for i in range(times.shape[0]):
        while k > 0 and samples.begin[k] > times[i]:
            k -= 1
        while k < N and samples.begin[k + 1] <= times[i]:
            k += 1
        if k == N:
            copied(samples.q[N], q[i])
            copied(samples.u[N], u[i])
        else:
            after, a = times[i] - samples.begin[k], samples.a[k]
            flow(inputs, samples.q[k], samples.u[k], a, after, samples.substeps[()], q[i], none)
            for j in range(u.shape[1]):
                u[i, j] = samples.u[k, j] + after * a[j]
        write_rates(inputs, q[i], u[i], q_dot[i])


_ROWS = float64[:, ::1]
_FOLLOW = void(*BLOCKS.types, float64[::1], _ROWS, _ROWS, _ROWS)


class SampledMotion:
    """A motion of samples, at rest where it begins and ends and at the samples `rests`.

    stops (K,) : when it rests, s; corners (K, n) : where it is then; samples : its numbers
    """

    def __init__(self, samples: MotionSamples, rests: Sequence[int]) -> None:
        memory = Memory()
        memory.add(samples)
        self._blocks = memory.blocks()
        self.samples = views(MotionSamples, *self._blocks, 0)
        self._follow = checked_by_caller(_follow, _FOLLOW)
        places = [0, *rests, len(samples.a)]
        self.stops, self.corners = self.samples.begin[places], self.samples.q[places]

    @property
    def duration(self) -> float:
        return float(self.stops[-1])

    def at(self, t: Array) -> tuple[Array, Array]:
        """q (N, n) and u (N, n_u) at times t (N,), s."""
        return self.moving(t)[:2]

    def moving(self, t: Array) -> tuple[Array, Array, Array]:
        """q (N, n), u (N, n_u) and q_dot (N, n) at times t (N,), s."""
        q, u = (np.zeros((len(t), rows.shape[1])) for rows in (self.samples.q, self.samples.u))
        q_dot = np.zeros_like(q)
        self._follow(*self._blocks, np.ascontiguousarray(t), q, u, q_dot)
        return q, u, q_dot


def joined(motions: Sequence[SampledMotion]) -> SampledMotion:
    """Motions one after the other, each from where the one before ended."""
    parts = [motion.samples for motion in motions]
    begin = np.cumsum([0.0, *(step for part in parts for step in np.diff(part.begin))])
    q, u = (
        np.vstack([*(getattr(part, name)[:-1] for part in parts), getattr(parts[-1], name)[-1:]])
        for name in ("q", "u")
    )
    substeps = np.array(max(int(part.substeps) for part in parts))
    rests = np.cumsum([len(part.a) for part in parts[:-1]], dtype=np.int64).tolist()
    whole = MotionSamples(parts[0].inputs, begin, substeps, q, u, np.vstack([part.a for part in parts]))
    return SampledMotion(whole, rests)
