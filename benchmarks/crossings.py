"""A cylinder of 0.3 m crosses the way of a robot that drives to a goal; its motion is known:

    python benchmarks/crossings.py [INSTANCES] [SEED] [HORIZON …]

Only crossings in which the robot, standing still, would be safe, and is hit without a guard. `hit` counts
runs that touch (Coal's distance, at samples and between), `short` those that come nearer than the distance to
keep, `reached` those that end at their goal, `time` what that took (median, s), `step` the processor time of
a step, as a ratio to that with the first horizon. The last row is `nmm.Horizon`, predictive control, with
what its calls take (median, 99 of 100, worst; ms) and the share of them that found a motion; the one before
it `nmm.plan`, with what a plan takes (median, worst; s).
"""

from __future__ import annotations

import sys
import time
from functools import cache
from typing import NamedTuple

import numpy as np

import nmm

DISTANCE, RADIUS, DT, DURATION = 0.03, 0.3, 0.02, 30.0
UR5 = "package://example-robot-data/robots/ur_description/urdf/ur5_robot.urdf"
UP = {"ur5_shoulder_lift_joint": -1.5, "ur5_elbow_joint": 1.5, "ur5_wrist_1_joint": -1.5}
LIMITS = nmm.Limits(velocity={"platform": 1.0, "arm": 1.5}, acceleration={"platform": 1.0, "arm": 3.0})


class Crossing(NamedTuple):
    """A robot with its start and the goal of a frame, and what crosses its way."""

    robot: nmm.Robot
    start: dict[str, float]
    frame: str
    goal: np.ndarray
    obstacle: nmm.Obstacle


@cache
def robots() -> list[tuple[nmm.Robot, dict[str, float], str]]:
    """A UR5 on a unicycle, a small arm on two driven wheels, a planar arm on a unicycle."""
    ur5 = nmm.mount(nmm.load("differential_base", platform="unicycle"), nmm.load(UR5), prefix="ur5_")
    small = nmm.mount("differential_base", "small_arm", at="arm_mount")
    return [
        (ur5, UP, "ur5_ee_link"),
        (small, {"q2": 0.4, "q3": 1.2, "q4": 0.6}, "ee"),
        (nmm.load("unicycle_3r"), {"q2": 0.5, "q3": 0.9}, "ee"),
    ]


def crossing(rng: np.random.Generator) -> Crossing:
    """One whose cylinder meets the line from the robot to its goal about when the robot would be there."""
    robot, posture, frame = robots()[rng.integers(3)]
    start = posture | {"theta": rng.uniform(-0.5, 0.5)}
    tip = nmm.Configuration(robot, robot.q(start)).placement(frame).translation
    far, speed = rng.uniform(2.5, 5.0), rng.uniform(0.3, 1.0)
    goal = np.array([far, rng.uniform(-1.0, 1.0), tip[2]])
    share = rng.uniform(0.3, 0.7)
    where, when = share * goal[:2], 1.0 + share * far / 0.5 + rng.uniform(-1.5, 1.5)
    turn = np.arctan2(goal[1], goal[0]) + rng.choice([-1, 1]) * rng.uniform(np.pi / 3, 2 * np.pi / 3)
    velocity = speed * np.array([np.cos(turn), np.sin(turn), 0.0])
    middle = np.array([*where, 0.9])

    def motion(t: float) -> np.ndarray:
        return middle + (t - when) * velocity

    body = nmm.Obstacle(
        nmm.Cylinder(RADIUS, 1.8), motion=motion, velocity=lambda t: velocity, name="cylinder"
    )
    return Crossing(robot, start, frame, goal, body)


def controller(one: Crossing, horizon: float) -> nmm.Controller:
    """What drives the robot to its goal."""
    keeps = nmm.Collisions(DISTANCE, False, [one.obstacle], horizon=horizon)
    task = nmm.Task(nmm.Position(one.frame), one.goal, gain=1.0, speed=0.5)
    at_rest = nmm.PreferredPosture({name: value for name, value in one.start.items() if name != "theta"})
    given = one.robot, task, nmm.ProjectedGradient(), at_rest
    return nmm.Controller(*given, limits=LIMITS, collisions=keeps, dt=DT)


def meets(one: Crossing) -> bool:
    """Whether the robot is hit without a guard, and safe where it stands."""
    guarded = controller(one, 0.0)
    scene = guarded.solver.scene
    assert scene is not None

    def least(t: np.ndarray, q: np.ndarray) -> float:
        return min(scene.queries.nearest(float(one), where)[0] for one, where in zip(t, q, strict=True))

    times = np.arange(0.0, DURATION, 0.05)
    q = one.robot.q(one.start)
    if least(times, np.broadcast_to(q, (len(times), len(q)))) < 2.0 * DISTANCE:
        return False
    plain = nmm.Controller(*guarded.given[:4], limits=LIMITS, dt=DT)
    run = nmm.simulate(plain, q, DURATION, DT, "zoh", until=nmm.Goal(0.01))
    return least(run.t[::2], run.q[::2]) < 0.0


def crossings(count: int, seed: int) -> list[Crossing]:
    """So many in which the robot meets the cylinder."""
    rng = np.random.default_rng(seed)
    found: list[Crossing] = []
    while len(found) < count:
        one = crossing(rng)
        if meets(one):
            found.append(one)
    return found


def main() -> None:
    """Print the table."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 22
    seed = int(sys.argv[2]) if len(sys.argv) > 2 else 7
    horizons = [float(text) for text in sys.argv[3:]] or [0.0, 1.0, 2.0, 4.0, 8.0]
    scenes = crossings(count, seed)
    print(f"{'horizon':>8}{'hit':>5}{'short':>7}{'reached':>9}{'time':>7}{'step':>7}")
    first = 0.0
    for horizon in horizons:
        hits = short = 0
        times, spent, steps = [], 0.0, 0
        for one in scenes:
            driven = controller(one, horizon)
            begun = time.process_time()
            run = nmm.simulate(driven, one.robot.q(one.start), DURATION, DT, "zoh", until=nmm.Goal(0.01))
            spent += time.process_time() - begun
            steps += len(run)
            least = float(run.clearance_between.min())
            hits, short = hits + (least < 0.0), short + (least < DISTANCE - 1e-4)
            if run.complete:
                times.append(float(run.t[-1]))
        first = first or spent / steps
        median = np.median(times) if times else np.nan
        ratio = spent / steps / first
        print(f"{horizon:8g}{hits:5}{short:7}{len(times):9}{median:7.1f}{ratio:7.2f}", flush=True)
    planned(scenes)
    predictive(scenes)


def planned(scenes: list[Crossing]) -> None:
    """The row of plans, which wait on their way; distances by Coal 100 times a second."""
    nmm.plan(robots()[2][0], [0.0] * 6, {"x": 1.0}, limits=LIMITS)  # compiled, once
    hits = short = 0
    times, took = [], []
    for one in scenes:
        begun = time.process_time()
        goal = nmm.Task(nmm.Position(one.frame), one.goal)
        keeps = nmm.Collisions(DISTANCE, obstacles=[one.obstacle])
        try:
            plan = nmm.plan(one.robot, one.start, goal, (), keeps, LIMITS)
        except nmm.RunError:
            continue
        took.append(time.process_time() - begun)
        t = np.arange(0.0, plan.duration + 1.0, 0.01)
        queries = nmm.Collisions(DISTANCE, False, [one.obstacle]).on(one.robot).queries
        least = min(queries.nearest(float(at), q)[0] for at, q in zip(t, plan(t)[0], strict=True))
        hits, short = hits + (least < 0.0), short + (least < DISTANCE - 1e-4)
        times.append(plan.duration)
    print(f"{'plan':>8}{hits:5}{short:7}{len(times):9}{np.median(times):7.1f}", end="")
    print(f"  {np.median(took):.2f} s, {max(took):.2f} s", flush=True)


class Timed(nmm.Horizon):
    """Notes what its calls take, s, and whether they found a motion."""

    def __call__(self, t: float, q: np.ndarray) -> np.ndarray:
        begun = time.process_time()
        u = super().__call__(t, q)
        spent.append((time.process_time() - begun, self.solved))
        return u


spent: list[tuple[float, bool]] = []


def predictive(scenes: list[Crossing]) -> None:
    """The row of predictive control, called at 20 Hz."""
    hits = short = 0
    times = []
    for one in scenes:
        task = nmm.Task(nmm.Position(one.frame), one.goal)
        keeps = nmm.Collisions(DISTANCE, False, [one.obstacle])
        run = Timed(one.robot, task, keeps, LIMITS).run(one.start, DURATION, nmm.Goal(0.01))
        least = float(run.clearance_between.min())
        hits, short = hits + (least < 0.0), short + (least < DISTANCE - 1e-4)
        if run.complete:
            times.append(float(run.t[-1]))
    took, solved = np.array(spent).T
    print(f"{'Horizon':>8}{hits:5}{short:7}{len(times):9}{np.median(times):7.1f}", end="")
    ms = 1e3 * np.array([np.median(took), np.quantile(took, 0.99), took.max()])
    print(f"  {ms.round(1)} ms, {np.mean(solved):.2%} of {len(solved)} solved")


if __name__ == "__main__":
    main()
