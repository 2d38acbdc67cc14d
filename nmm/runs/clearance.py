"""Distances along a run: at its samples and between them, what was nearest, and what that says."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from nmm.arrays import Array, Integers
from nmm.collisions.obstacle import Obstacle
from nmm.collisions.recorded import as_passed, shifts
from nmm.collisions.setting import Setting
from nmm.control.guard import Counts, Guard
from nmm.control.integrators import Around, Velocity
from nmm.robots.held import Held
from nmm.words import counted

#: Between samples distances are looked at after so much motion, m and rad of the coordinates together, and m
#: of the obstacles.
APART = 0.01
#: Looks between two samples at most.
LOOKS = 10
#: A distance is kept where it is short by no more than this, m.
ROUNDING = 1e-6


class Swept(NamedTuple):
    """Distances along N samples.

    clearance (N,) : the least distance at each sample, m; pairs (N,) : between which pair
    between (N,) : the least on the way to the next sample, its ends included; the last sample's own
    between_pairs (N,) : between which pair that is
    points (N, 6) : the two points that are nearest at each sample, of the pair's first shape and of its
        second, m, world axes; not a number where nothing is near
    obstacles : as they were
    """

    clearance: Array
    pairs: Integers
    between: Array
    between_pairs: Integers
    points: Array
    obstacles: tuple[Obstacle, ...]


@dataclass(frozen=True)
class Guarded(Around):
    """An integrator that holds the inputs unless everything is farther than the robot can come: what a guard
    looked along is the way that held inputs make."""

    guard: Guard
    held: Held

    def advance(self, velocity: Velocity, t: float, q: Array, q_dot: Array, u: Array, dt: float) -> Array:
        if not self.guard.held:
            ahead = self.integrator.advance(velocity, t, q, q_dot, u, dt)
            if self.guard.clear(float(np.abs(ahead - q).sum())):
                return ahead
        return self.held(q, u, dt)


def swept(setting: Setting, t: Array, q: Array, u: Array, places: Sequence[Sequence[Any]]) -> Swept:
    """Distances along a motion t (N,), q (N, n), u (N, m): where they could matter, between samples too.

    places : of each sample what `Setting.places` said then
    """
    obstacles = tuple(as_passed(one, t, [at[i] for at in places]) for i, one in enumerate(setting.obstacles))
    with setting.queries.among(obstacles):
        return _swept(setting, t, q, u, obstacles)


def _swept(setting: Setting, t: Array, q: Array, u: Array, obstacles: tuple[Obstacle, ...]) -> Swept:
    queries, held = setting.queries, Held(setting.robot)
    clearance, points = np.full(len(t), np.inf), np.full((len(t), 6), np.nan)
    pairs = np.full(len(t), -1, dtype=np.int64)
    for k, (time, place) in enumerate(zip(t, q, strict=True)):
        clearance[k], pairs[k] = queries.nearest(float(time), place)
        if pairs[k] >= 0:
            points[k] = queries.results[pairs[k], 4:]
    between, between_pairs, shifted = clearance.copy(), pairs.copy(), shifts(obstacles, t)
    for k in range(len(t) - 1):
        dt = float(t[k + 1] - t[k])
        ends = min(clearance[k], clearance[k + 1])
        moved = float(np.abs(u[k]).sum()) * dt
        between[k] = ends
        if clearance[k + 1] < clearance[k]:
            between_pairs[k] = pairs[k + 1]
        if ends - setting.distance > moved * max(1.0, setting.robot.reach) + shifted[k]:
            continue
        # The arc that held inputs make, and what the integrator made otherwise, by and by.
        astray = q[k + 1] - held(q[k], u[k], dt)
        looks = min(LOOKS, max(1, int(np.ceil((moved + shifted[k]) / APART))))
        for i in range(1, looks + 1):
            share = (i - 0.5) / looks
            ahead = held(q[k], u[k], share * dt) + share * astray
            d, pair = queries.nearest(float(t[k]) + share * dt, ahead)
            if d < between[k]:
                between[k], between_pairs[k] = d, pair
    return Swept(clearance, pairs, between, between_pairs, points, obstacles)


def told(setting: Setting, found: Swept, t: Array, counts: Counts) -> list[str]:
    """What a run says of its distances, a sentence each."""
    sentences = list(setting.notes)
    asked = setting.distance
    below = found.between < asked - ROUNDING
    if not len(t):
        return sentences
    first = 0
    if found.clearance[0] < asked - ROUNDING:
        kept = np.flatnonzero(found.clearance >= asked - ROUNDING)
        name = setting.words(int(found.pairs[0]))
        back = f"back at t = {t[kept[0]]:.3g} s" if kept.size else "not back at the end"
        sentences.append(
            f"the start is nearer than the distance to keep, {asked:g} m: {name}, "
            f"{found.clearance[0]:.4g} m; {back}"
        )
        first = int(kept[0]) if kept.size else len(t)
    short = np.flatnonzero(below[first:]) + first
    if short.size:
        k = int(short[np.argmin(found.between[short])])
        name = setting.words(int(found.between_pairs[k]))
        sentences.append(
            f"the distance of {asked:g} m could not be kept in {counted(short.size, 'sample')}: "
            f"{name} came to {found.between[k]:.4g} m at t = {t[k]:.3g} s"
        )
    if counts.braked:
        said = f", {counts.short} of them in vain" if counts.short else ""
        sentences.append(
            f"in {counted(counts.braked, 'sample')} the inputs went towards braking to keep distances{said}"
        )
    return sentences


def ran_into(setting: Setting, found: Swept, t: Array) -> str:
    """What was run into after it had been clear, and when; "" for nothing. Such a run is not completed."""
    clear = np.flatnonzero(found.between >= -ROUNDING)
    if not clear.size:
        return ""
    first = int(clear[0])
    into = np.flatnonzero(found.between[first:] < -ROUNDING) + first
    if not into.size:
        return ""
    begun, worst = int(into[0]), int(into[np.argmin(found.between[into])])
    pair = setting.words(int(found.between_pairs[worst]))
    return f"{pair} ran into each other from t = {t[begun]:.3g} s on, by up to {-found.between[worst]:.3g} m"
