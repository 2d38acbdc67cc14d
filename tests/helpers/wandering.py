"""Long random motions under limits of position, velocity and acceleration, and by how much they broke them.

    python -m tests.wandering 100000
    python -m tests.wandering 100000 2

goes so many steps with each robot, at first or second order, and prints it.
"""

from __future__ import annotations

import sys
from typing import NamedTuple

import numpy as np

import nmm
from nmm.control.integrators import Accelerated, integrator

#: Scenario, frame and resolver.
ROBOTS = {
    "unicycle_3r_position": ("ee", nmm.ProjectedGradient(alpha=1.0)),
    "tiago_pose": ("arm_tool_link", nmm.ReducedGradient(alpha=1.0)),
    "ur5_unicycle_pose": ("ur5_tool0", nmm.ProjectedGradient(alpha=1.0, weights={"platform": 5.0})),
    "panda_mecanum_pose": ("panda_hand", nmm.ReducedGradient(alpha=1.0, weights={"arm": 2.0})),
    "kinova_car": (
        "j2s6s200_end_effector",
        nmm.CallableResolver(lambda problem: np.linalg.pinv(problem.J) @ problem.rate),
    ),
}
DT = 0.01


class Broken(NamedTuple):
    """By how much limits were broken at most, times the limit where that is above 1."""

    position: float
    velocity: float
    acceleration: float


def wanderer(name: str, order: int = 1) -> tuple[nmm.Controller, np.ndarray]:
    """A controller whose target is to be set from outside, and where it begins."""
    frame, resolver = ROBOTS[name]
    scenario = nmm.Scenario.load(name)
    robot = scenario.robot()
    task = nmm.Task(nmm.Position(frame), nmm.LiveTarget([0.0, 0.0, 0.0]), gain=2.0)
    objective = nmm.Quadratic(*(nmm.QuadraticTerm(name) for name in robot.u_names[robot.platform.p :]))
    limits = nmm.Limits({"platform": 1.0, "arm": 1.5}, acceleration={"platform": 2.0, "arm": 4.0})
    controller = nmm.Controller(robot, task, resolver, objective, limits=limits, dt=DT, order=order)
    return controller, robot.q(scenario.parts.q0)


def wander(
    controller: nmm.Controller, q0: np.ndarray, steps: int, seed: int = 0, method: str = "zoh"
) -> Broken:
    """Follow a target that jumps at random: the `Signal` that the controller's task follows."""
    rng = np.random.default_rng(seed)
    robot, kept = controller.robot, controller.solver.limits_on
    (task,) = controller.task
    signal = task.reference
    advance, solver = integrator(method, robot, 1e-9), controller.solver
    if solver.second:
        advance = Accelerated(advance, robot, solver.before, solver.step_memory.second.u_dot)
    controller.dt = DT
    q, before = q0.copy(), np.zeros(robot.n_u)
    controller.reset()
    worst = np.zeros(3)
    own = robot.following.independent
    for k in range(steps):
        if k % 100 == 0:
            signal.set(rng.uniform(-3.0, 3.0, len(controller.rows)))
        answer = controller(k * DT, q)
        if not np.isfinite(answer).all():
            raise SystemExit(f"no answer at step {k}")
        step, left = controller.last(k * DT, q), controller.solver.sample.snapshot()
        u = advance.inputs(controller.solver.inputs_at, k * DT, q, step.q_dot, step.u, DT)
        worst[0] = max(worst[0], beyond(q[own], kept.coordinates[own]))
        worst[1] = max(worst[1], beyond(u, kept.inputs))
        rate = kept.accelerations * DT
        worst[2] = max(worst[2], beyond(u - before, np.column_stack([-rate, rate])))
        q = advance.advance(controller.velocity, k * DT, q, step.q_dot, u, DT)
        if u is not step.u:
            controller.solver.sample.end_stages(left)
            controller.solver.count_from(u)
        before = u
    return Broken(*worst)


def beyond(x: np.ndarray, limits: np.ndarray) -> float:
    """How far x is outside its limits (k, 2)."""
    lower, upper = limits.T
    size = np.maximum(1.0, np.where(np.isfinite(limits), np.abs(limits), 1.0)).T
    return float(max(((lower - x) / size[0]).max(initial=0.0), ((x - upper) / size[1]).max(initial=0.0), 0.0))


def main(steps: int, order: int = 1) -> None:
    for name in ROBOTS:
        controller, q0 = wanderer(name, order)
        print(name, wander(controller, q0, steps), flush=True)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
