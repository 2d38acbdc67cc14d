"""Obstacles in the figures of a motion, and the instants at which a run passes them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from nmm import looks
from nmm.arrays import Array
from nmm.figures.solids import outline_points
from nmm.runs.trajectory import Trajectory

OBSTACLE, OBSTACLE_TEXT = looks.ORANGE, "#7A5200"
#: Strength of the earliest drawing, of 1 for the last.
FAINTEST = 0.4
#: What moves by less between two drawings rests, m.
RESTS = 1e-3


class Outline(NamedTuple):
    """An obstacle as points (k, 3) whose hull it is, and the strength to draw it.

    times : first and last at which it is there, s; None where it never moves
    """

    points: Array
    strength: float
    times: tuple[float, float] | None


def outlines(trajectory: Trajectory, times: Array) -> list[Outline]:
    """The obstacles, those that move at each of the times, once where they rest; half-spaces have none."""
    found: list[Outline] = []
    for obstacle in trajectory.obstacles:
        points = outline_points(obstacle.shape.geometry())
        if points is None:
            continue
        at = times if obstacle.moves else times[-1:]
        strengths = np.linspace(FAINTEST, 1.0, len(at)) if len(at) > 1 else [1.0]
        own: list[Outline] = []
        for t, strength in zip(at.tolist(), strengths, strict=True):
            place = obstacle.placement(t)
            moved = points @ place[:3, :3].T + place[:3, 3]
            before = own[-1] if own else None
            if before and before.times and np.allclose(before.points, moved, rtol=0.0, atol=RESTS):
                own[-1] = Outline(moved, float(strength), (before.times[0], t))
            else:
                own.append(Outline(moved, float(strength), (t, t) if obstacle.moves else None))
        found += own
    return found


def with_the_nearest(trajectory: Trajectory, times: Array) -> Array:
    """The times, with when the robot was nearest to something in the place of the one next to it: even
    instants may show nothing of what was passed."""
    d = trajectory.clearance
    if not trajectory.obstacles or len(d) != len(trajectory) or len(times) < 3 or not np.isfinite(d).any():
        return times
    nearest = float(trajectory.t[int(np.argmin(d))])
    inner = times[1:-1]
    inner[int(np.argmin(np.abs(inner - nearest)))] = nearest
    return np.sort(times)
