"""Inputs that jump back and forth, from sample to sample or within the steps between them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from nmm.arrays import Array

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


class Chattering(NamedTuple):
    """An input that chatters, the one that jumps the farthest.

    Attributes
    ----------
    jumps : how many of its jumps turn back the one before, in rows of at least `IN_A_ROW`
    start, end : when the first and the last of them are, s
    input : its name
    size : the largest of these jumps, in the input's unit
    """

    jumps: int
    start: float
    end: float
    input: str
    size: float

    @property
    def sentence(self) -> str:
        """For a warning or a reason."""
        return (
            f"the inputs chatter: {self.input} jumps back and forth between samples {self.jumps} times "
            f"from t = {self.start:.4g} s to {self.end:.4g} s, by up to {self.size:.3g}"
        )


def chattering(t: Array, u: Array, names: Sequence[str]) -> Chattering | None:
    """Whether the inputs u (N, m) at times t (N,) chatter, and how."""
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
    found = None
    for i, name in enumerate(names):
        if np.count_nonzero(back[:, i]) < IN_A_ROW:
            continue
        (steps,) = np.nonzero(_in_rows(back[:, i]))
        if steps.size:
            largest = float(size[steps, i].max())
            if found is None or largest > found.size:
                found = Chattering(len(steps), float(t[steps[0] + 1]), float(t[steps[-1] + 1]), name, largest)
    return found


def moving_otherwise(t: Array, q: Array, q_dot: Array, names: Sequence[str], units: Sequence[str]) -> str:
    """Which coordinate q (N, n) moves otherwise than its rates q_dot (N, n) at times t (N,) say, and when;
    `units` are the coordinates'.

    A method of several stages a step asks for the inputs at each and records the first's: where limits or a
    resolver switch between them, the motion is their mean. "" where motion and rates agree.
    """
    if len(t) <= STEPS:
        return ""
    moved = np.diff(q, axis=0) / np.diff(t)[:, np.newaxis]
    mean, size = 0.5 * (q_dot[1:] + q_dot[:-1]), np.maximum(np.abs(q_dot[1:]), np.abs(q_dot[:-1]))
    off = np.minimum(np.abs(moved - mean), np.abs(moved - q_dot[:-1]))
    largest = np.abs(q_dot).max(axis=0, initial=0.0)
    flags = off > np.maximum(OTHERWISE * size, np.maximum(SLOW * largest, NO_RATE * largest.max(initial=0.0)))
    found, most = "", 0
    for i, (name, unit) in enumerate(zip(names, units, strict=True)):
        if np.count_nonzero(flags[:, i]) < STEPS:
            continue
        (steps,) = np.nonzero(_in_rows(flags[:, i], STEPS))
        if len(steps) > most:
            most = len(steps)
            found = (
                f"{name} moves otherwise than its recorded rate says from t = {t[steps[0]]:.4g} s to "
                f"{t[steps[-1] + 1]:.4g} s ({np.abs(moved[steps, i]).mean():.3g} {unit}/s where "
                f"{np.abs(mean[steps, i]).mean():.3g} {unit}/s is recorded): the inputs jump within the "
                "steps; method zoh shows what a sampled controller does"
            )
    return found


def _in_rows(flags: Array, least: int = IN_A_ROW) -> Array:
    """The flags (K,) that stand in rows of at least so many."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(np.int8), [0]])))
    kept = np.zeros(len(flags), dtype=bool)
    for first, last in zip(edges[::2], edges[1::2], strict=True):
        if last - first >= least:
            kept[first:last] = True
    return kept
