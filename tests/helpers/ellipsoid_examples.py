"""Robots, motions and Jacobians for the tests of manipulability ellipsoids."""

from __future__ import annotations

from functools import cache

import numpy as np

import nmm
from nmm.base.arrays import Array
from nmm.model.robots.configuration import Configuration
from nmm.model.robots.robot import Robot


@cache
def load(name: str) -> Robot:
    bases = {"car with arm": "car_base", "omni with arm": "omni_base"}
    if name in bases:
        return nmm.mount(bases[name], "small_arm", at="arm_mount")
    return nmm.load(name, platform="fixed" if name == "small_arm" else None)


def random_q(robot: Robot, count: int, seed: int = 0) -> Array:
    q = np.random.default_rng(seed).uniform(-1.2, 1.2, (count, robot.n))
    return np.asarray(np.clip(q, *np.clip(robot.q_limits, -1.2, 1.2).T))


def swing(robot: Robot, t: Array) -> Array:
    """A smooth motion (N, n) of all coordinates."""
    k = np.arange(robot.n)
    return 0.2 * k + 0.9 * np.sin(np.outer(t, 0.5 + 0.23 * k) + k)


def directions(count: int, size: int, seed: int = 1) -> Array:
    found = np.random.default_rng(seed).normal(size=(count, size))
    return np.asarray(found / np.linalg.norm(found, axis=1, keepdims=True))


def columns(robot: Robot, part: str) -> list[int]:
    p = robot.platform.p
    return {"robot": [*range(robot.n_u)], "arm": [*range(p, robot.n_u)], "platform": [*range(p)]}[part]


def jacobian(robot: Robot, frame: str, q: Array, part: str = "robot") -> Array:
    return np.asarray((Configuration(robot, q).jacobian(frame)[:3] @ robot.S(q))[:, columns(robot, part)])
