"""How far a robot's recorded motion is from a run."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from nmm.base.arrays import Array, interpolated
from nmm.base.errors import InputError
from nmm.model.robots.configuration import Configuration
from nmm.motion.trajectory import Trajectory


def difference(run: Trajectory, bag: Trajectory) -> Mapping[str, Any]:
    """How far a recorded motion is from a run while both last, each from its first sample on: RMS and largest
    of the platform's distance, m, its heading and each joint, rad or m, and the end-effector's distance, m.

    Raises
    ------
    InputError : motions of robots that are not alike
    """
    robot = run.robot
    if bag.robot.fingerprint != robot.fingerprint:
        raise InputError("motions of two robots", where=bag.label, expected=robot.name, got=bag.robot.name)
    since, after = run.t - run.t[0], bag.t - bag.t[0]
    within = since <= after[-1] + 1e-9
    t = since[within]
    planned, moved = run.q[within], interpolated(t, after, bag.q)
    off = robot.short_way(moved - planned)
    values: dict[str, Array] = {}
    n_p = robot.platform.n_p
    if n_p:
        values["platform"] = np.hypot(off[:, 0], off[:, 1])
        values["theta"] = off[:, 2]
    for i, name in enumerate(robot.q_names[min(3, n_p) :], min(3, n_p)):
        values[name] = off[:, i]
    if run.frame is not None:
        offset = _places(run, run.frame, moved) - _places(run, run.frame, planned)
        values[run.frame] = np.asarray(np.linalg.norm(offset, axis=1))
    units = {"platform": "m", run.frame: "m"} | dict(zip(robot.q_names, robot.q_units, strict=True))
    return {
        "duration": float(t[-1]),
        "samples": len(t),
        "differences": {
            name: {
                "unit": units[name],
                "rms": float(np.sqrt(np.mean(x**2))),
                "max": float(np.abs(x).max()),
                "t": float(t[np.abs(x).argmax()]),
            }
            for name, x in values.items()
        },
    }


def _places(run: Trajectory, frame: str, q: Array) -> Array:
    """Where a frame is (N, 3) at q (N, n)."""
    return np.array([Configuration(run.robot, row).placement(frame).translation for row in q])
