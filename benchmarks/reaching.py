"""Reaching random poses under limits, a Panda on a differential-drive base:

    python benchmarks/reaching.py [POSES] [SEED]

After Haviland, Sünderhauf and Corke, "A holistic approach to reactive mobile manipulation" (RA-L 2022): each
pose is the end-effector's in a random configuration within the joints' limits, 0.5 to 5 m from where it is
at the start. Reached is 5 mm and 0.02 rad within 60 s; the base goes at most 4 m/s and 4 rad/s, its wheels
turn at 30 rad/s at most, the joints keep their positions and velocities, and all inputs their accelerations.
A retreat when the error stalls. The first table is of two levels, position before orientation, the second of
the pose as one. The third leaves accelerations out: `reversed` are runs in which an input goes from more than
half its limit to more than half the opposite one within a sample, which no robot does. Inputs are held over a
sample, as on a robot.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pinocchio as pin

import nmm
import nmm.control.goal
import nmm.control.integrators

PANDA = "package://example-robot-data/robots/panda_description/urdf/panda.urdf"
FRAME = "panda_hand"
HOME = {"panda_joint2": -0.3, "panda_joint4": -2.2, "panda_joint6": 2.0, "panda_joint7": np.pi / 4}
DT, LONGEST = 0.05, 60.0
BASE = {"v": 4.0, "omega": 4.0}
ACCELERATIONS = {"platform": 4.0, "arm": 15.0}


class Attempt(NamedTuple):
    """A pose tried: when it was reached (s; nan if not), limits broken at most, whether an input was reversed
    within a sample, retreats, µs, why not."""

    t: float
    broken: float
    reversed: bool
    retreats: int
    step: float
    reason: str


def the_robot() -> nmm.Robot:
    """A Panda on a platform whose inputs are v and ω."""
    base = nmm.load("differential_base", platform="unicycle")
    return nmm.mount(base, nmm.load(PANDA, lock={"panda_finger_joint1": 0.02}))


def the_controller(
    robot: nmm.Robot, acceleration: dict[str, float] | None, levels: int
) -> tuple[nmm.Controller, Callable[[np.ndarray, np.ndarray], None]]:
    """The controller, and what sets its target: a position (m) and a rotation vector (rad)."""
    position, orientation = nmm.LiveTarget(np.zeros(3)), nmm.LiveTarget(np.zeros(3))
    whole = nmm.LiveTarget(np.zeros(6))
    speed, braking = {"m": 4.0, "rad": 2.5}, {"m": 1.5, "rad": 3.0}

    def approach(*units: str) -> dict[str, dict[str, float]]:
        found = {"speed": {unit: speed[unit] for unit in units}}
        return found if acceleration is None else found | {"braking": {unit: braking[unit] for unit in units}}

    tasks = [
        nmm.Task(nmm.Position(FRAME), position, gain=3.5, **approach("m")),
        nmm.Task(nmm.Orientation(FRAME), orientation, gain=3.5, priority=2, **approach("rad")),
    ]
    if levels == 1:
        tasks = [nmm.Task(nmm.Pose(FRAME), whole, gain=2.0, **approach("m", "rad"))]
    limits = nmm.Limits(velocity=BASE, acceleration=acceleration)
    resolver = nmm.ProjectedGradient(alpha=1.0)

    def aim(place: np.ndarray, turn: np.ndarray) -> None:
        position.set(place)
        orientation.set(turn)
        whole.set(np.concatenate([place, turn]))

    return nmm.Controller(robot, tasks, resolver, limits=limits, dt=DT, retreat=nmm.Retreat()), aim


def pose(robot: nmm.Robot, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The end-effector's position (m) and rotation vector (rad) at q."""
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, q)
    placement = data.oMf[robot.frame_id(FRAME)]
    return placement.translation.copy(), pin.log3(placement.rotation)


def configuration(robot: nmm.Robot, rng: np.random.Generator) -> np.ndarray:
    """A random one: the base within 5 m, joints within their limits."""
    q = np.zeros(robot.n)
    q[:2] = rng.uniform(-5.0, 5.0, 2)
    q[2] = rng.uniform(-np.pi, np.pi)
    q[3:] = rng.uniform(*robot.q_limits[3:].T)
    return q


def draw(robot: nmm.Robot, q0: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """A pose 0.5 to 5 m from the end-effector's at q0."""
    start, _ = pose(robot, q0)
    while True:
        found = pose(robot, configuration(robot, rng))
        if 0.5 <= np.linalg.norm(found[0] - start) <= 5.0:
            return found


def attempt(controller: nmm.Controller, q: np.ndarray, goal: nmm.Goal) -> Attempt:
    """Go there by a robot's loop: measure, command, hold."""
    robot, kept = controller.robot, controller.solver.limits_on
    hold = nmm.control.integrators.ZeroOrderHold(robot)
    controller.reset()
    before, broken, spent, turned = np.zeros(robot.n_u), 0.0, 0.0, False
    half = 0.5 * kept.inputs[:, 1]
    steps = round(LONGEST / DT)
    for k in range(steps):
        t = k * DT
        began = time.perf_counter()
        u = controller(t, q)
        spent += time.perf_counter() - began
        last = controller.last(t, q)
        if goal.reached(last.error, controller.rows):
            count = controller.solver.retreat_state.count
            return Attempt(t, broken, turned, count, spent / (k + 1) * 1e6, "")
        ahead = hold.advance(controller.velocity, t, q, last.q_dot, u, DT)
        beyond = [
            kept.inputs[:, 0] - u,
            u - kept.inputs[:, 1],
            robot.q_limits[:, 0] - ahead,
            ahead - robot.q_limits[:, 1],
            np.abs(u - before) - kept.accelerations * DT,
        ]
        broken = max(broken, *(float(part.max()) for part in beyond))
        turned = turned or bool(np.any((u * before < 0.0) & (np.minimum(abs(u), abs(before)) > half)))
        q, before = ahead, u
    stops = np.minimum(q - robot.q_limits[:, 0], robot.q_limits[:, 1] - q)
    at = [name for name, room in zip(robot.q_names, stops, strict=True) if room < 1e-3]
    metres, radians = nmm.control.goal.error_sizes(last.error, [row.unit for row in controller.rows])
    reason = f"{metres:.3f} m and {radians:.3f} rad left, at stops: {', '.join(at) or 'none'}"
    count = controller.solver.retreat_state.count
    return Attempt(np.nan, broken, turned, count, spent / steps * 1e6, reason)


def table(count: int, seed: int, acceleration: dict[str, float] | None, levels: int) -> float:
    """Print a table: from home, and from random postures; returns the least share that was reached."""
    robot = the_robot()
    controller, aim = the_controller(robot, acceleration, levels)
    goal = nmm.Goal()
    shares = []
    print(f"\nseed {seed}, {count} poses, levels: {levels}, limits of acceleration: {acceleration or 'none'}")
    print(
        f"{'start':16s}{'reached':>9s}{'median':>8s}{'p95':>7s}{'max s':>7s}{'broken':>9s}{'reversed':>9s}"
        f"{'retreats':>9s}{'most':>5s}{'µs':>7s}"
    )
    for start in ("home", "random posture"):
        rng = np.random.default_rng(seed)
        attempts = []
        for _ in range(count):
            q0 = robot.q(HOME)
            if start != "home":
                q0[3:] = rng.uniform(*robot.q_limits[3:].T)
            target = draw(robot, q0, rng)
            aim(*target)
            attempts.append(attempt(controller, q0, goal))
        t = np.array([one.t for one in attempts])
        reached = t[np.isfinite(t)]
        shares.append(len(reached) / count)
        print(
            f"{start:16s}{100 * shares[-1]:8.1f}%{np.median(reached):8.2f}{np.percentile(reached, 95):7.2f}"
            f"{reached.max():7.1f}{max(one.broken for one in attempts):9.1e}"
            f"{100 * np.mean([one.reversed for one in attempts]):8.1f}%"
            f"{100 * np.mean([one.retreats > 0 for one in attempts]):8.1f}%"
            f"{max(one.retreats for one in attempts):5d}"
            f"{np.median([one.step for one in attempts]):7.1f}"
        )
        for k, one in enumerate(attempts):
            if one.reason:
                print(f"  pose {k}: {one.reason}")
    return min(shares)


def main() -> int:
    """All tables; exit status 1 when less than all poses are reached with limits of acceleration."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 1000
    seed = int(sys.argv[2]) if len(sys.argv) > 2 else 0
    share = min(table(count, seed, ACCELERATIONS, levels) for levels in (2, 1))
    table(count, seed, None, 2)
    return int(share < 1.0)


if __name__ == "__main__":
    raise SystemExit(main())
