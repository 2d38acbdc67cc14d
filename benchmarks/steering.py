"""Robots whose task does not feel their steering follow paths from random starts, with and without pursuit:

    python benchmarks/steering.py [starts] [spring ...]

A position task with gain 1, the projected gradient with its default α, no objective; 40 s by the midpoint
rule, dt 0.02 s; the last line of a robot with its own limits of velocity and position, the others without.
The starts: heading in ±180°, the arm's first joint in ±1 rad and its others in ±0.2 rad about a posture,
the hand within 0.2 m of the path. A run ends on the path when its error is below 1 mm over the last 5 s; it
counts when the steering angle was within its stop all along. `peak` is the largest input of the successes,
95 % of them below, m/s and rad/s.
"""

from __future__ import annotations

import sys
from collections.abc import Callable

import numpy as np

import nmm

UR5 = "package://example-robot-data/robots/ur_description/urdf/ur5_robot.urdf"
KINOVA = "package://example-robot-data/robots/kinova_description/robots/kinova.urdf"
DURATION, DT = 40.0, 0.02


def robots() -> dict[str, tuple[nmm.Robot, str, dict[str, float]]]:
    """Robot, hand and posture (the first joint of the arm first) by what it is called."""
    train = nmm.load("trailer_base", arguments={"hitch_offset": "0"})
    j = "j2s6s200_joint_"
    return {
        "UR5 on a car": (
            nmm.mount("car_base", UR5, at="arm_mount", prefix="ur5_"),
            "ur5_tool0",
            {
                "ur5_shoulder_pan_joint": 0.0,
                "ur5_shoulder_lift_joint": -1.6,
                "ur5_elbow_joint": 1.9,
                "ur5_wrist_1_joint": -1.9,
                "ur5_wrist_2_joint": -1.57,
            },
        ),
        "Kinova on a car": (
            nmm.mount("car_base", KINOVA, at="arm_mount"),
            "j2s6s200_end_effector",
            {f"{j}1": 4.7, f"{j}2": 3.9, f"{j}3": 1.9, f"{j}4": 0.8, f"{j}5": 1.1},
        ),
        "small arm on a trailer": (
            nmm.mount(train, "small_arm", at="trailer1_mount"),
            "ee",
            {"q1": 0.0, "q2": 0.2, "q3": 1.7, "q4": 0.6},
        ),
    }


def paths(height: float) -> dict[str, nmm.extending.Function]:
    """About 0.4 m/s: a circle of 2.5 m, an eight of 6 m by 3 m, a spline with a tight bend."""
    angle = np.linspace(0.0, 2.0 * np.pi, 33)
    eight = np.column_stack([3.0 * np.sin(angle), 1.5 * np.sin(2.0 * angle), np.full(33, height)])
    bend = np.array(
        [[0, 0], [2, 0.3], [4, 0], [5.0, 1.2], [4.2, 3], [4.5, 5], [6, 6.5], [8.5, 7.0], [11, 6.5]]
    )
    return {
        "circle": nmm.Circle([0, 0, height], 2.5, 0.16),
        "figure-eight": nmm.Spline(np.linspace(0.0, 40.0, 33), eight, ends="periodic"),
        "spline": nmm.Spline(
            np.linspace(0.0, 40.0, len(bend)), np.column_stack([bend, np.full(len(bend), height)])
        ),
    }


def start(
    robot: nmm.Robot, hand: str, posture: dict[str, float], at: np.ndarray, rng: np.random.Generator
) -> np.ndarray:
    """A random configuration with the hand within 0.2 m of a point."""
    spread = dict(zip(posture, (1.0, 0.2, 0.2, 0.2, 0.2), strict=False))
    q = robot.q({name: value + rng.uniform(-1, 1) * spread[name] for name, value in posture.items()})
    q[2] = rng.uniform(-np.pi, np.pi)
    there = nmm.Configuration(robot, q).placement(hand).translation[:2]
    q[:2] += at[:2] + rng.uniform(-0.2, 0.2, 2) / np.sqrt(2.0) - there
    return q


def follows(controller: nmm.Controller, q: np.ndarray) -> tuple[bool, bool, float]:
    """Whether it ends on the path with its steering angle within its stop, whether the error never grew by
    1 mm beyond the first, and the largest input."""
    robot = controller.robot
    own = slice(3, 4)  # the steering angle, or the hitch that steers
    lower, upper = robot.q_limits[own].T
    peak = 0.0
    on_path = kept = True
    first = np.inf
    for k in range(int(DURATION / DT)):
        t = k * DT
        try:
            controller(t, q)
            step = controller.last(t, q)
            middle = q + 0.5 * DT * step.q_dot
            q = q + DT * controller.velocity(t + 0.5 * DT, middle)
        except (nmm.SingularError, nmm.InputError):
            return False, False, np.inf
        peak = max(peak, float(np.abs(step.u).max()))
        error = float(np.linalg.norm(step.error))
        first = error if k == 0 else first
        kept = kept and error < first + 1e-3
        on_path = t < DURATION - 5.0 or error < 1e-3
        within = np.all(q[own] <= upper + 1e-6) and np.all(q[own] >= lower - 1e-6)
        if not on_path or not within or peak > 100.0:
            return False, False, peak
    return on_path, kept, peak


def measure(
    name: str,
    steering: nmm.Steering | bool,
    starts: int,
    limits: nmm.Limits | None = None,
    tell: Callable[[str], None] = print,
) -> None:
    """A line for each path."""
    robot, hand, posture = robots()[name]
    height = float(nmm.Configuration(robot, robot.q(posture)).placement(hand).translation[2])
    law = "none" if steering is False else f"k {steering.gain:g}, k1 {steering.spring:g}"
    law += "" if limits is None else ", limits"
    cells = []
    for path, reference in paths(height).items():
        rng = np.random.default_rng(7)
        task = nmm.Task(nmm.Position(hand), reference, gain=1.0)
        controller = nmm.Controller(
            robot, task, nmm.ProjectedGradient(), limits=limits, dt=DT, steering=steering
        )
        first = nmm.evaluate(reference, 0.0, nmm.Configuration(robot, robot.q())).value
        found = []
        for _ in range(starts):
            controller.reset()
            found.append(follows(controller, start(robot, hand, posture, first, rng)))
        good = [peak for ok, _, peak in found if ok]
        never = 100 * sum(kept for _, kept, _ in found) / starts
        peak = f"{np.percentile(good, 95):.1f}" if good else "-"
        cells.append(f"{path} {100 * len(good) / starts:.0f} % ({never:.0f} % never off; peak {peak})")
    tell(f"{name:24} {law:19} " + "  ".join(cells))


if __name__ == "__main__":
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 50
    springs = [float(text) for text in sys.argv[2:]] or [2.0, 5.0]
    for name in robots():
        for law in [False, *(nmm.Steering(spring=spring) for spring in springs)]:
            measure(name, law, count)
        measure(name, nmm.Steering(spring=springs[0]), count, nmm.Limits())
