"""What every worker of `run.py` does: it makes its followers, then takes its turns, a line of JSON each.

A worker runs in the environment of its library, so this file needs NumPy alone. A follower is one library on
one workload, limits off or on: `reset()`, `step(k)` over sample k of the path, `q()` where the robot is.
"""

from __future__ import annotations

import gc
import json
import math
import os
import sys
import time
import traceback
from abc import ABC, abstractmethod
from collections.abc import Callable
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

#: What the arm's posture weighs against the end-effector's pose; its gain, 1/s.
POSTURE_COST, POSTURE_GAIN = 1e-3, 1.0
#: Weight of the least motion, which keeps the problem regular.
REGULAR = 1e-9

Told = dict[str, Any]


class Rolling:
    """A base with joints `forward` and `turn`, at 0 before each step: where it is, targets in its frame."""

    joints = ("forward", "turn")
    speeds = ("v", "omega")

    def __init__(self, told: Told, rotations: np.ndarray | None) -> None:
        """rotations (N, 3, 3) in the world; None for a position alone."""
        self.start: list[float] = told["q0"][:3]
        self.positions = told["positions"]
        # Transposed, so that the other way round they lie as Eigen has them, and are not copied.
        self.rotations = None if rotations is None else [one.T.copy() for one in rotations]
        self._transposed, self._turned = np.eye(4), np.eye(3)
        self._axes = self._transposed[:3, :3]
        self.T = self._transposed.T
        self.reset()

    def reset(self) -> None:
        self.x, self.y, self.theta = self.start

    def target(self, k: int) -> np.ndarray:
        """T (4, 4), in column order: what the end-effector's placement in the base's frame is to be."""
        x, y, z = self.positions[k]
        x, y = x - self.x, y - self.y
        c, s = math.cos(self.theta), math.sin(self.theta)
        T = self._transposed
        T[3, 0], T[3, 1], T[3, 2] = c * x + s * y, c * y - s * x, z
        if self.rotations is not None:
            turned = self._turned
            turned[0, 0] = turned[1, 1] = c
            turned[0, 1], turned[1, 0] = -s, s
            np.matmul(self.rotations[k], turned, self._axes)
        return self.T

    def move(self, forward: float, turn: float) -> None:
        """Euler's rule: forward (m) along the heading, and turn (rad)."""
        self.x += forward * math.cos(self.theta)
        self.y += forward * math.sin(self.theta)
        self.theta += turn


class Sliding:
    """A base with the joints x, y and theta: targets in the world, made before they are needed."""

    joints = ("x", "y", "theta")
    speeds = ("v", "v", "omega")

    def __init__(self, told: Told, rotations: np.ndarray | None) -> None:
        T = np.tile(np.eye(4), (len(told["positions"]), 1, 1))
        T[:, :3, 3] = told["positions"]
        if rotations is not None:
            T[:, :3, :3] = rotations
        targets = [np.asfortranarray(one) for one in T]
        self.target = targets.__getitem__

    def reset(self) -> None:
        pass


BASES = {"rolls": Rolling, "slides": Sliding}


class Peer(ABC):
    """A follower by a library that gives displacements of all joints; it says how in `displacement`.

    q, dq (m,) : the joints' positions and the last displacement, the base's in front
    """

    def __init__(self, told: Told, base: str, limits: bool) -> None:
        self.told, self.limits, self.rolls = told, limits, base == "rolls"
        self.dt, self.frame = told["dt"], told["frame"]
        self.pose = told["rows"] == 6
        self.urdf = told["urdf"][base]
        kind = BASES[base]
        self.base = kind(told, np.array(told["orientations"]) if self.pose else None)
        self.joints = [*kind.joints, *told["arm"]]
        self.fastest = np.array([told["velocity"][n] for n in (*kind.speeds, *told["arm"])])
        first = len(kind.joints)
        self.posture = np.concatenate([np.zeros(first), told["posture"]])
        self.posture_cost = np.concatenate([np.zeros(first), np.full(len(told["arm"]), POSTURE_COST)])
        self._start = np.array(told["q0"])
        self.q_all, self.dq = np.zeros(len(self.joints)), np.zeros(len(self.joints))
        self._arm = self.q_all[2:]
        self.reset()

    def reset(self) -> None:
        self.base.reset()
        self.q_all[:] = [0.0, 0.0, *self._start[3:]] if self.rolls else self._start

    @abstractmethod
    def displacement(self, T: np.ndarray) -> np.ndarray:
        """The displacement of all joints (m,) over dt, with the end-effector's placement to go for."""

    def step(self, k: int) -> None:
        """Sample k, and Euler's rule."""
        if self.rolls:
            dq = self.displacement(self.base.target(k))
            self.base.move(dq.item(0), dq.item(1))
            self._arm += dq[2:]
        else:
            self.q_all += self.displacement(self.base.target(k))

    def q(self) -> list[float]:
        """[x, y, theta, arm...]."""
        if not self.rolls:
            return self.q_all.tolist()
        return [self.base.x, self.base.y, self.base.theta, *self.q_all[2:].tolist()]


def versions(names: tuple[str, ...]) -> dict[str, str]:
    """The installed versions of these distributions; those that are missing are left out."""
    found = {"Python": sys.version.split()[0]}
    for name in names:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found


class Worker:
    """Its followers by job, and where each is on its path."""

    def __init__(self, make: Callable[[Told, bool], Any], told: dict[str, Told]) -> None:
        self.mimic_joints: dict[str, Any] = {}
        self.counts: dict[str, int] = {}
        self.at: dict[str, int] = {}
        self.failed: dict[str, str] = {}
        for name, one in told.items():
            for limits in (False, True):
                job = f"{name}, limits {'on' if limits else 'off'}"
                try:
                    follower = make(one, limits)
                except Exception:  # whatever it is, the table says it
                    self.failed[job] = traceback.format_exc(limit=-1).strip().splitlines()[-1]
                    continue
                if follower is not None:
                    self.mimic_joints[job], self.counts[job], self.at[job] = (
                        follower,
                        len(one["positions"]),
                        0,
                    )

    def answer(self, asked: dict[str, Any]) -> dict[str, Any]:
        """One turn."""
        job = asked["job"]
        follower, count = self.mimic_joints[job], self.counts[job]
        if asked["do"] == "follow":
            follower.reset()
            path = [list(follower.q())]
            for k in range(count):
                follower.step(k)
                path.append(list(follower.q()))
            follower.reset()
            self.at[job] = 0
            return {"q": path}
        first = self.at[job]
        if first == 0:
            follower.reset()
        last = min(first + asked["steps"], count)
        # Processor time, which what else the machine does changes least.
        step, clock = follower.step, time.process_time
        gc.collect()
        gc.disable()
        began = clock()
        for k in range(first, last):
            step(k)
        took = clock() - began
        gc.enable()
        self.at[job] = 0 if last == count else last
        return {"microseconds": 1e6 * took / (last - first), "first": first}


def serve(make: Callable[[Told, str, bool], Any], names: tuple[str, ...]) -> None:
    """Run a worker: `python of_LIBRARY.py WORKLOADS VARIANT`.

    make(told, variant, limits) gives a follower, or None for what the variant does not do. names: the
    distributions whose versions are told.
    """
    # Libraries print; the answers keep the real standard output for themselves.
    out = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)

    def tell(answer: dict[str, Any]) -> None:
        out.write(json.dumps(answer) + "\n")
        out.flush()

    variant = sys.argv[2]
    worker = Worker(
        lambda told, limits: make(told, variant, limits), json.loads(Path(sys.argv[1]).read_text())
    )
    tell({"versions": versions(names), "jobs": [*worker.mimic_joints], "failed": worker.failed})
    for line in sys.stdin:
        try:
            tell(worker.answer(json.loads(line)))
        except Exception as error:
            tell({"error": f"{type(error).__name__}: {error}"})
