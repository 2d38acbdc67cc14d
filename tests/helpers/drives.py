"""Drives with exactly known wheels: what counters and a reference say of them, and text files of these."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from nmm.base.arrays import Array
from nmm.model.robots.robot import Robot

#: Steps of the midpoint rule between two samples.
FINE = 4


@dataclass
class Drive:
    """t (N,), q (N, n), and the wheels' angles by joint, (N,) rad."""

    t: Array
    q: Array
    wheels: dict[str, Array]


def drive(robot: Robot, inputs: Callable[[float], object], duration: float = 20.0, dt: float = 0.02) -> Drive:
    """A robot that its platform's inputs drive, from rest on, by midpoint steps."""
    count = round(duration / dt) + 1
    t, q, p = np.arange(count) * dt, robot.rest.copy(), robot.platform.p
    names = [*robot.wheel_speeds(np.zeros(p), q)]
    turned, rows, angles = np.zeros(len(names)), [], []
    step = dt / FINE
    for now in t:
        rows.append(q.copy())
        angles.append(turned.copy())
        for k in range(FINE):
            u = np.zeros(robot.n_u)
            u[:p] = inputs(float(now + (k + 0.5) * step))
            half = q + 0.5 * step * robot.S(q) @ u
            turned = turned + step * np.array([*robot.wheel_speeds(u, half).values()])
            q = q + step * robot.S(half) @ u
    return Drive(t, np.array(rows), dict(zip(names, np.array(angles).T, strict=True)))


def write_table(path: Path, columns: Mapping[str, Array], delimiter: str = ",") -> Path:
    """A text file with a header; NaN is an empty cell."""
    lines = [delimiter.join(columns)]
    for row in zip(*columns.values(), strict=True):
        lines.append(delimiter.join("" if np.isnan(value) else f"{value:.16g}" for value in row))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path
