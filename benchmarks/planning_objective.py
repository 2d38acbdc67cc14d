"""Smooth plans of the scenes of `planning.py` with an objective and without:

    python benchmarks/planning_objective.py [INSTANCES] [SEED] [WEIGHT] [KIND …] [--clearance]

H is minus the manipulability of the arm (rows xyz, m³), or `nmm.Clearance` with a reach of 0.3 m, and counts
WEIGHT times. Its mean over a plan's time is by Pinocchio's kinematics and Coal at 200 times; `less` counts
plans whose mean is smaller. Plans with it are checked as in `planning.py`.
"""

from __future__ import annotations

import argparse
import time

import numpy as np
from planning import DISTANCE, KINDS, LIMITS, SIX, Checked, at_goal, checked

import nmm

FRAMES = {"shelf": "arm_tool_link"}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("instances", type=int, nargs="?", default=20)
    parser.add_argument("seed", type=int, nargs="?", default=7)
    parser.add_argument("weight", type=float, nargs="?", default=10.0)
    parser.add_argument("kinds", nargs="*", choices=[[], *SIX], default=[])
    parser.add_argument("--clearance", action="store_true")
    given = parser.parse_args()
    print(f"{given.instances} instances of each, seed {given.seed}, weight {given.weight:g}")
    print(
        f"{'':14} smooth  less  same time   end  free  H: mean, with  s: median, worst, with, worst", end=""
    )
    print("  spare mm  |q_dot - S u|  limits")
    for kind in given.kinds or SIX:
        measure(kind, given.instances, given.seed, given.weight, given.clearance)


def measure(kind: str, instances: int, seed: int, weight: float, clearance: bool) -> None:
    """Print a line of the plans of a kind."""
    plain, seconds, found, same, arrived = [], [], [], 0, 0
    for k in range(-1, instances):
        scene = KINDS[kind](np.random.default_rng([seed, max(k, 0)]))
        given = scene.robot, scene.start, scene.goal, scene.obstacles, nmm.Collisions(DISTANCE), LIMITS
        H = -nmm.Manipulability(FRAMES.get(kind, "ur5_ee_link"), "xyz", of="arm")
        if clearance:
            H = nmm.Clearance(nmm.Collisions(DISTANCE, obstacles=scene.obstacles), reach=0.3)
        plans, times = [], []
        for objective in (None, weight * H):
            begin = time.process_time()
            plans.append(nmm.plan(*given, seed=max(k, 0), smooth=True, objective=objective))
            times.append(time.process_time() - begin)
        if k < 0 or not plans[0].smooth:  # what is compiled once is no part of a plan
            continue
        plain.append([mean_of(H, plan) for plan in plans])
        seconds.append(times)
        same += plans[0].duration == plans[1].duration
        arrived += at_goal(scene, plans[1])
        found.append(checked(scene, plans[1]))
    means, took = np.array(plain), np.array(seconds)
    least = Checked(*(f(x) for f, x in zip((min, max, max), zip(*found, strict=True), strict=True)))
    print(
        f"{kind:14} {len(found):6} {(means[:, 1] < means[:, 0]).sum():5} {same:10} {arrived:5} "
        f"{sum(one.free > 0.0 for one in found):5} {means[:, 0].mean():8.4f} {means[:, 1].mean():6.4f} "
        f"{np.median(took[:, 0]):9.2f} {took[:, 0].max():6.2f} {np.median(took[:, 1]):6.2f} "
        f"{took[:, 1].max():6.2f} {1e3 * least.free:9.2f} {least.motion:14.1e} {least.limits:7.1e}",
        flush=True,
    )


def mean_of(objective: nmm.extending.Objective, plan: nmm.Plan) -> float:
    """Its mean over a plan's time."""
    q, _ = plan(np.linspace(0.0, plan.duration, 200))
    return float(np.mean([objective.value(nmm.Configuration(plan.robot, one)) for one in q]))


if __name__ == "__main__":
    main()
