"""Filters of poses for the tests, of differential_base, and a drive with late fixes."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np

import nmm
from nmm.model.robots.robot import Robot

Array = np.ndarray
RADIUS, TRACK = 0.1, 0.5
STILL = {"left_wheel_joint": 0.0, "right_wheel_joint": 0.0}
KNOWN = np.diag([0.04, 0.09, 0.25])


@cache
def robot_of(name: str = "differential_base", platform: str = "") -> Robot:
    return nmm.load(name, platform=platform) if platform else nmm.load(name)


def make(pose: Array | None = None, covariance: Array = KNOWN, **options: Any) -> nmm.PoseFilter:
    robot = robot_of()
    q = robot.rest
    q[:3] = np.zeros(3) if pose is None else pose
    return nmm.PoseFilter(robot, q, STILL, 0.0, covariance=covariance, **{"spread": 0.0, **options})


def twist_of(turned: Array) -> Array:
    """Of the two wheels of differential_base."""
    left, right = turned
    return np.array([RADIUS * (left + right) / 2, 0.0, RADIUS * (right - left) / TRACK])


def drive(fixes: list[tuple[float, float, Array]], **options: Any) -> tuple[nmm.PoseFilter, list[str], Array]:
    """A drive of 2 s at 50 Hz with a gyro; fixes (came, was, pose) are given when they come; odom (N, 3)."""
    pose_filter = make(
        covariance=np.diag([0.1, 0.1, 0.3]), spread=1e-3, slip_noise=(0.01, 0.01, 0.02), gyro_noise=0.01,
        bias_deviation=0.05, bias_walk=1e-3, scale_deviation=0.02, delay=1.0, rate=60.0, **options,
    )  # fmt: skip
    waiting, outcomes, odom = sorted(fixes, key=lambda fix: fix[0]), [], [pose_filter.odom]
    for k in range(1, 101):
        t = 0.02 * k
        pose_filter.step(t, np.array([0.1 + 0.05 * math.sin(t), 0.14]), yaw_rate=0.3 + 0.1 * math.sin(3 * t))
        while waiting and waiting[0][0] <= t:
            _, was, pose = waiting.pop(0)
            outcomes.append(pose_filter.fix(pose, 0.01 * np.eye(len(pose)), was))
        odom.append(pose_filter.odom)
    return pose_filter, outcomes, np.array(odom)


def fixes_of(late: list[float]) -> list[tuple[float, float, Array]]:
    times = [0.13, 0.31, 0.52, 0.777, 1.1, 1.3, 1.31, 1.6]
    rng = np.random.default_rng(5)
    places = [
        np.array([0.6 * t, 0.02, 0.1])[: 2 + k % 2] + 0.05 * rng.standard_normal(2 + k % 2)
        for k, t in enumerate(times)
    ]
    return [(t + by, t, place) for t, by, place in zip(times, late, places, strict=True)]
