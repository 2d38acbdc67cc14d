"""Plans followed in the closed loop, in random scenes where control that reacts is stuck:

    python benchmarks/planning_followed.py [SCENES] [SEED] [--smooth] [--replan] [--horizon] [--poses]

A UR5 and a Panda on a differential base by turns; a U-shaped trap, a wall with a way round, a low box, a
table to go under; the goal is a position of the end-effector. The plan keeps 50 mm more than the
controller's 30 mm where it can (as `plan.track` in a scenario does), and is tracked at 0.8 of its speed by a
controller with limits and distances, inputs held for 20 ms. `reached` is within 5 mm at the end; `least` the
least distance between any two samples, by Coal. With `--replan` a run that leaves its plan goes on by
another. With `--horizon` predictive control follows the plan (`nmm.Horizon`, at 10 Hz). With `--poses` the
goals are random poses of a platform and a car within 3 m; `reached` is then within 10 mm and 0.02 rad.
"""

from __future__ import annotations

import argparse
import time
from functools import cache

import numpy as np
from planning import DISTANCE, LIMITS, UP, Scene, box, error_of, poses_car, poses_differential, ur5_on

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
    """Without a Panda's fingers, which touch where they are closed. A UR5's upper arm is 30 to 31 mm from its
    mount wherever it is: the plan may bring it 2 mm nearer, and the controller that follows, too."""
    fingers = [("p_panda_leftfinger", "p_panda_rightfinger")]
    return nmm.Collisions(
        DISTANCE, obstacles=scene.obstacles, ignore=fingers if scene.robot is panda() else []
    )


def planned(scene: Scene, seed: int, smooth: bool) -> nmm.Plan:
    return nmm.plan(*scene[:3], (), keeps(scene), LIMITS, seed=seed, smooth=smooth, margin=MARGIN)


def pose(k: int, seed: int) -> Scene:
    """To a pose within 3 m, a unicycle and a car by turns."""
    rng = np.random.default_rng([seed, k])
    while True:
        scene = (poses_differential, poses_car)[k % 2](rng)
        if np.hypot(*(scene.goal[name] - scene.start[name] for name in "xy")) <= 3.0:
            return scene


def off_goal(scene: Scene, q: np.ndarray) -> tuple[float, float]:
    """How far q is from the goal, m and rad."""
    if isinstance(scene.goal, nmm.Task):
        return error_of(scene, q), 0.0
    off = {name: q[scene.robot.coordinate(name)] - value for name, value in scene.goal.items()}
    turned = [np.abs(np.angle(np.exp(1j * value))) for name, value in off.items() if name not in ("x", "y")]
    return float(np.hypot(off["x"], off["y"])), float(max(turned))


def predicted(scene: Scene, plan: nmm.Plan) -> nmm.Trajectory:
    within = nmm.Goal(0.005) if scene.obstacles else nmm.Goal(0.01, 0.02)
    return nmm.Horizon(scene.robot, plan, keeps(scene), LIMITS, dt=0.1).run(
        scene.start, 2.0 * plan.duration + 5.0, within
    )


def followed(scene: Scene, plan: nmm.Plan, replan: bool) -> nmm.Trajectory:
    controller = nmm.Controller(
        scene.robot,
        plan.reference(pace=PACE, replan=nmm.replan if replan else None),
        nmm.ProjectedGradient(),
        limits=LIMITS,
        collisions=keeps(scene),
        dt=DT,
    )
    # Another plan may be a longer one.
    duration = 2.0 * plan.duration + 10.0 if replan else plan.duration / PACE + 3.0
    return nmm.simulate(controller, scene.start, duration, DT, "zoh")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenes", type=int, nargs="?", default=30)
    parser.add_argument("seed", type=int, nargs="?", default=0)
    parser.add_argument("--smooth", action="store_true")
    parser.add_argument("--replan", action="store_true")
    parser.add_argument("--horizon", action="store_true")
    parser.add_argument("--poses", action="store_true")
    given = parser.parse_args()
    reached, kept = [], []
    for k in range(given.scenes):
        scene, begin = (pose if given.poses else scene_of)(k, given.seed), time.process_time()
        kind = "pose" if given.poses else KINDS[k % len(KINDS)].__name__
        name = f"{k:3} {kind:8} {scene.robot.name:28}"
        try:
            plan = planned(scene, k, given.smooth)
        except nmm.NmmError as error:
            print(f"{name} {error}")
            continue
        took = time.process_time() - begin
        run = predicted(scene, plan) if given.horizon else followed(scene, plan, given.replan)
        (off, turned), least = off_goal(scene, run.q[-1]), float(run.clearance_between.min())
        reached.append(off <= (0.01 if given.poses else 0.005) and turned <= 0.02)
        kept.append(least >= DISTANCE - 1e-4)
        told = ("left_plan", "blocked", "replanned", "not_replanned", "horizon_unsolved")
        why = [f"{one.code} {one.values} {one.where}" for one in run.findings if one.code in told]
        print(
            f"{name} {took:6.2f} {plan.duration:5.1f} s, run {run.t[-1]:5.1f} s; {1e3 * off:8.2f} mm off, "
            f"least {1e3 * least:6.2f}",
            "" if reached[-1] and kept[-1] else why,
            flush=True,
        )
    print(f"planned {len(reached)}, reached {sum(reached)}, distance kept {sum(kept)}, of {given.scenes}")


if __name__ == "__main__":
    main()
