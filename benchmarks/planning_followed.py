"""Plans followed in the closed loop, in random scenes where control that reacts is stuck:

    python benchmarks/planning_followed.py [SCENES] [SEED] [--smooth]

A UR5 and a Panda on a differential base by turns; a U-shaped trap, a wall with a way round, a low box, a
table to go under; the goal is a position of the end-effector. The plan keeps 50 mm more than the
controller's 30 mm where it can (as `plan.track` in a scenario does), and is tracked at 0.8 of its speed by a
controller with limits and distances, inputs held for 20 ms. `reached` is within 5 mm at the end; `least` the
least distance between any two samples, by Coal.
"""

from __future__ import annotations

import argparse
import time
from functools import cache

import numpy as np
from planning import DISTANCE, LIMITS, UP, Scene, box, error_of, ur5_on

import nmm

PANDA = "package://example-robot-data/robots/panda_description/urdf/panda.urdf"
#: More than the controller keeps, m; of the plan's speed; the controller's period, s.
MARGIN, PACE, DT = 0.05, 0.8, 0.02


@cache
def panda() -> nmm.Robot:
    base = nmm.load("differential_base", platform="unicycle")
    return nmm.mount(base, nmm.load(PANDA), prefix="p_")


def robot_of(k: int) -> tuple[nmm.Robot, dict[str, float], str]:
    """With a start and the end-effector's frame."""
    if k % 2 == 0:
        return ur5_on("differential_base"), UP, "ur5_ee_link"
    posture = {"p_panda_joint2": -0.8, "p_panda_joint4": -2.4, "p_panda_joint6": 1.9, "p_panda_joint7": 0.8}
    return panda(), posture, "p_panda_link8"


def trap(rng: np.random.Generator) -> tuple[list[nmm.Obstacle], list[float]]:
    deep, wide = rng.uniform(1.0, 2.0), rng.uniform(0.9, 1.4)
    walls = [
        box("end", (deep, -wide, 0.0), (deep + 0.1, wide, 1.6)),
        box("left", (0.0, wide, 0.0), (deep + 0.1, wide + 0.1, 1.6)),
        box("right", (0.0, -wide - 0.1, 0.0), (deep + 0.1, -wide, 1.6)),
    ]
    return walls, [deep + rng.uniform(0.8, 2.0), rng.uniform(-0.8, 0.8), rng.uniform(0.5, 1.0)]


def wall(rng: np.random.Generator) -> tuple[list[nmm.Obstacle], list[float]]:
    x, left, right = rng.uniform(1.5, 2.5), rng.uniform(0.8, 3.0), rng.uniform(0.8, 3.0)
    walls = [box("wall", (x, -right, 0.0), (x + rng.uniform(0.1, 0.4), left, 1.6))]
    return walls, [x + rng.uniform(1.0, 2.0), rng.uniform(-0.5, 0.5), rng.uniform(0.5, 1.0)]


def low_box(rng: np.random.Generator) -> tuple[list[nmm.Obstacle], list[float]]:
    x, wide, deep = rng.uniform(1.2, 2.2), rng.uniform(0.6, 2.5), rng.uniform(0.4, 1.0)
    walls = [box("box", (x, -wide, 0.0), (x + deep, wide, rng.uniform(0.2, 0.5)))]
    return walls, [x + deep + rng.uniform(0.3, 1.5), rng.uniform(-0.5, 0.5), rng.uniform(0.3, 0.8)]


def table(rng: np.random.Generator) -> tuple[list[nmm.Obstacle], list[float]]:
    x, y, wide, height = (
        rng.uniform(1.5, 3.0),
        rng.uniform(-0.5, 0.5),
        rng.uniform(0.5, 0.9),
        rng.uniform(0.65, 0.8),
    )
    walls = [box("top", (x, y - wide, height), (x + 1.0, y + wide, height + 0.04))]
    for k, (a, b) in enumerate([(0.0, -wide), (0.95, -wide), (0.0, wide - 0.05), (0.95, wide - 0.05)]):
        walls.append(box(f"leg {k}", (x + a, y + b, 0.0), (x + a + 0.05, y + b + 0.05, height)))
    return walls, [x + rng.uniform(0.1, 0.5), y + rng.uniform(-0.3, 0.3), height - rng.uniform(0.15, 0.4)]


KINDS = (trap, wall, low_box, table)


def scene_of(k: int, seed: int) -> Scene:
    rng = np.random.default_rng([seed, k])
    robot, posture, frame = robot_of(k // len(KINDS))
    obstacles, target = KINDS[k % len(KINDS)](rng)
    start = posture | {"x": rng.uniform(0.3, 0.5), "theta": rng.uniform(-np.pi, np.pi)}
    return Scene(robot, start, nmm.Task(nmm.Position(frame), target), obstacles)


def keeps(scene: Scene) -> nmm.Collisions:
    """Without a Panda's fingers, which touch where they are closed, and without a UR5's upper arm beside its
    mount, which is 31 mm away at most: what is nearer than 30.5 holds a controller back."""
    near = ("p_panda_leftfinger", "p_panda_rightfinger")
    if scene.robot is not panda():
        near = ("arm_mount", "ur5_upper_arm_link")
    return nmm.Collisions(DISTANCE, obstacles=scene.obstacles, ignore=[near])


def planned(scene: Scene, seed: int, smooth: bool) -> nmm.Plan:
    return nmm.plan(*scene[:3], (), keeps(scene), LIMITS, seed=seed, smooth=smooth, margin=MARGIN)


def followed(scene: Scene, plan: nmm.Plan) -> nmm.Trajectory:
    controller = nmm.Controller(
        scene.robot,
        plan.reference(pace=PACE),
        nmm.ProjectedGradient(),
        limits=LIMITS,
        collisions=keeps(scene),
        dt=DT,
    )
    return nmm.simulate(controller, scene.start, plan.duration / PACE + 3.0, DT, "zoh")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenes", type=int, nargs="?", default=30)
    parser.add_argument("seed", type=int, nargs="?", default=0)
    parser.add_argument("--smooth", action="store_true")
    given = parser.parse_args()
    reached, kept = [], []
    for k in range(given.scenes):
        scene, begin = scene_of(k, given.seed), time.process_time()
        name = f"{k:3} {KINDS[k % len(KINDS)].__name__:8} {scene.robot.name:28}"
        try:
            plan = planned(scene, k, given.smooth)
        except nmm.NmmError as error:
            print(f"{name} {error}")
            continue
        took, run = time.process_time() - begin, followed(scene, plan)
        off, least = error_of(scene, run.q[-1]), float(run.clearance_between.min())
        reached.append(off <= 0.005)
        kept.append(least >= DISTANCE - 1e-4)
        why = [f"{one.code} {one.where}" for one in run.findings if one.code in ("left_plan", "blocked")]
        print(
            f"{name} {took:6.2f} {plan.duration:5.1f} s; {1e3 * off:8.2f} mm off, least {1e3 * least:6.2f}",
            "" if reached[-1] and kept[-1] else why,
            flush=True,
        )
    print(f"planned {len(reached)}, reached {sum(reached)}, distance kept {sum(kept)}, of {given.scenes}")


if __name__ == "__main__":
    main()
