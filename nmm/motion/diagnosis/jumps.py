"""Inputs that jump: back and forth between samples, within the steps, or over a singularity of J_e."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from nmm.base.arrays import Array, Flags, Integers
from nmm.base.findings import Finding
from nmm.motion.recording import crossed

#: So many jumps in a row, each back from the last: fewer are a switch of partition, or a swing.
IN_A_ROW = 4
#: A jump smaller than this share of the input's size about it is none,
SMALL = 0.1
#: and neither is one smaller than this share of the largest input of the run.
NEGLIGIBLE = 1e-3
#: A coordinate that moves otherwise than its recorded rate, by this share of that rate
OTHERWISE = 0.5
#: of the run's largest, and of the largest of all coordinates,
SLOW, NO_RATE = 0.05, 1e-6
#: in so many steps in a row, has rates that jump within the steps: fewer are a transient.
STEPS = 10
#: Inputs that change by more than this share of their size have jumped, over such a step,
JUMPED = 0.5
#: in it and in the steps beside it, where a sample is near the singularity.
NEAR = np.array([-1, 0, 1])
#: J whose least singular value is below this share of its largest, between two samples, is nearly singular.
NEARLY_SINGULAR = 0.01
#: Most singularities listed with their times.
TOLD = 3


def chattering(t: Array, u: Array, names: Sequence[str]) -> Finding | None:
    """Whether inputs u (N, m) at t (N,) chatter: the one that jumps farthest, how many jumps turn back (in
    rows of `IN_A_ROW` or more), from when to when, how far."""
    if len(u) < IN_A_ROW + 2:
        return None
    jump = np.diff(u, axis=0)
    turned = jump[1:] * jump[:-1] < 0.0
    if np.count_nonzero(turned) < IN_A_ROW:
        return None
    size, large = np.abs(jump), np.abs(u)
    about = np.maximum(np.maximum(large[:-2], large[1:-1]), large[2:])
    least = np.maximum(SMALL * about, NEGLIGIBLE * large.max())
    back = turned & (np.minimum(size[1:], size[:-1]) > least)
    rows = list(_in_rows(back, IN_A_ROW))
    if not rows:
        return None
    i, steps = max(rows, key=lambda row: size[row[1], row[0]].max())
    largest, end = float(size[steps, i].max()), float(t[steps[-1] + 1])
    values = {"input": names[i], "jumps": len(steps), "end": end, "size": largest}
    return Finding("chattering", values, {"t": float(t[steps[0] + 1])})


def moving_otherwise(
    t: Array, q: Array, q_dot: Array, names: Sequence[str], units: Sequence[str]
) -> Finding | None:
    """Which coordinate q (N, n) moves otherwise than q_dot (N, n) at t (N,) says, if any. Multi-stage methods
    record the first stage's inputs; the motion is the stages' mean where limits or a resolver switch."""
    if len(t) <= STEPS:
        return None
    moved = np.diff(q, axis=0) / np.diff(t)[:, np.newaxis]
    mean, size = 0.5 * (q_dot[1:] + q_dot[:-1]), np.maximum(np.abs(q_dot[1:]), np.abs(q_dot[:-1]))
    off = np.minimum(np.abs(moved - mean), np.abs(moved - q_dot[:-1]))
    largest = np.abs(q_dot).max(axis=0, initial=0.0)
    flags = off > np.maximum(OTHERWISE * size, np.maximum(SLOW * largest, NO_RATE * largest.max(initial=0.0)))
    rows = list(_in_rows(flags, STEPS))
    if not rows:
        return None
    i, steps = max(rows, key=lambda row: len(row[1]))
    values = {
        "name": names[i],
        "end": float(t[steps[-1] + 1]),
        "moved": float(np.abs(moved[steps, i]).mean()),
        "recorded": float(np.abs(mean[steps, i]).mean()),
        "unit": units[i],
    }
    return Finding("moves_otherwise", values, {"t": float(t[steps[0]])})


def _in_rows(flags: Flags, least: int) -> Iterator[tuple[int, Integers]]:
    """The columns of flags (K, columns) with runs of at least `least`, and the rows of these."""
    for i in np.flatnonzero(np.count_nonzero(flags, axis=0) >= least):
        edges = np.flatnonzero(np.diff(flags[:, i], prepend=False, append=False)).reshape(-1, 2)
        long = [np.arange(first, last) for first, last in edges if last - first >= least]
        if long:
            yield int(i), np.concatenate(long)


def crossings(
    t: Array, u: Array, side: Integers, J: Array, names: Sequence[str], units: Sequence[str]
) -> Finding | None:
    """Singularities of J_e between samples, of inputs u (N, m) at t (N,), signs (N,) of det J_e and J (N, s,
    m); `name` is an input that jumps there, `J_too` whether J itself is nearly singular on the way."""
    (after,) = np.nonzero(crossed(side))
    if not after.size:
        return None
    near = np.unique(np.clip(after[:, np.newaxis] + NEAR, 1, len(u) - 1))
    change = np.abs(u[near] - u[near - 1])
    sizes = np.linalg.norm(u, axis=1)
    larger = np.maximum(sizes[near], sizes[near - 1])
    far = np.linalg.norm(change, axis=1) > JUMPED * larger
    values: dict[str, Any] = {
        "steps": [[float(t[k - 1]), float(t[k])] for k in after[:TOLD]],
        "more": max(0, len(after) - TOLD),
    }
    if far.any():
        row, j = divmod(int(np.argmax(np.where(far[:, np.newaxis], change, -1.0))), u.shape[1])
        k = near[row]
        values |= {"name": names[j], "before": float(u[k - 1, j]), "after": float(u[k, j]), "unit": units[j]}
        first = after[np.argmin(np.abs(after - k))] - 1
        way = J[first] + np.linspace(0.0, 1.0, 11)[:, np.newaxis, np.newaxis] * (J[first + 1] - J[first])
        sigma = np.linalg.svd(way, compute_uv=False)
        values["J_too"] = bool(np.any(sigma[:, -1] < NEARLY_SINGULAR * sigma[:, 0]))
    return Finding("extended_jacobian_crossed", values, {"t": float(t[after[0]])})
