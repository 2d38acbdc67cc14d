"""Processor's time of `nmm.PoseFilter`, as docs/deploy.md has it:

    python benchmarks/pose_filter.py [ROUNDS]

Each row: µs a call, least and median of the rounds of 300 calls.
"""

from __future__ import annotations

import statistics
import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from machine import described

import nmm

CALLS = 300
NAMES = ("left_wheel_joint", "right_wheel_joint")
WITH_ALL = {"gyro_noise": 0.01, "bias_deviation": 0.1, "scale_deviation": 0.01, "scale_walk": 1e-4}
R = np.diag([1e-4, 1e-4, 1e-4])


def made(**more: Any) -> nmm.PoseFilter:
    robot = nmm.load("differential_base")
    still = dict.fromkeys(NAMES, 0.0)
    options: dict[str, Any] = {"spread": 1e-4, "slip_noise": (0.02, 0.01, 0.02), "gate": None} | more
    return nmm.PoseFilter(robot, robot.rest, still, 0.0, covariance=1e-4 * np.eye(3), **options)


def calls(gyro: bool) -> dict[str, Callable[[nmm.PoseFilter, int], object]]:
    """What is timed: of a filter and how many steps of 5 ms it has made."""
    by, own, rate = np.array([0.01, 0.012]), np.zeros(0), 0.02 if gyro else None

    def step(pose_filter: nmm.PoseFilter, k: int) -> None:
        pose_filter.step(0.005 * k, by, own, rate)

    def in_time(pose_filter: nmm.PoseFilter, k: int) -> None:
        step(pose_filter, k)
        pose_filter.fix(pose_filter.pose, R, 0.005 * k)

    def late(pose_filter: nmm.PoseFilter, k: int) -> None:
        step(pose_filter, k)
        if k > 50:
            pose_filter.fix(pose_filter.pose, R, 0.005 * (k - 50) + 0.001)

    def update(pose_filter: nmm.PoseFilter, k: int) -> None:
        pose_filter.update({NAMES[0]: 0.01 * k, NAMES[1]: 0.012 * k}, 0.005 * k, rate)

    return {
        "`step(t, by, own, yaw_rate)`, counts as arrays": step,
        "`step` and a `fix` in time": in_time,
        "`step` and a `fix` 50 steps late": late,
        "`update`, by names, with all checks of `Odometry.update`": update,
    }


def timed(call: Callable[[nmm.PoseFilter, int], object], rounds: int, **more: Any) -> list[float]:
    """µs a call, of each round."""
    pose_filter, k, times = made(**more), 0, []
    for turn in range(rounds + 1):
        begun = time.process_time()
        for _ in range(CALLS):
            k += 1
            call(pose_filter, k)
        if turn:  # the first fills the history
            times.append(1e6 * (time.process_time() - begun) / CALLS)
    return times


def main() -> None:
    rounds = int(sys.argv[1]) if len(sys.argv) > 1 else 9
    print("\n".join(described()), "", "| | two wheels | with a gyro and scales |", "|---|---|---|", sep="\n")
    both = (calls(gyro=False), {}), (calls(gyro=True), WITH_ALL)
    for name in both[0][0]:
        cells = []
        for rows, more in both:
            times = timed(rows[name], rounds, **more)
            cells.append(f"{min(times):.3g}, {statistics.median(times):.3g}")
        print(f"| {name} | {' | '.join(cells)} |")


if __name__ == "__main__":
    main()
