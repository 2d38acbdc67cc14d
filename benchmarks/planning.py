"""Plans for random scenes of six kinds, with rests and smooth:

    python benchmarks/planning.py [INSTANCES] [SEED] [KIND …] [--only rests|smooth] [--ways N]

to random poses of the platform without obstacles (1000 5 poses_differential poses_car --only rests), past a
gap that closes for good before the robot is through (20 7 closing_gap --only rests), with so many ways, and
with a hand's pose held among posts (100 7 hold hold_car --only rests). `--prepared` measures the second
plan of an `nmm.Planner`, and `nmm.replan` from a tenth of it with every obstacle moved by up to 20 mm.

Each plan is checked by what shares no code with the planner: Coal on the exact shapes of the robot at 2,000
times along it, differences of its coordinates against S(q) u, and the limits. `free` is the least distance
found less the one to keep, or the start's where that is less.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np
import pinocchio as pin

import nmm
from nmm.plugins.planning import planned

DISTANCE = 0.03
#: Among what moves, how long it is looked at after the end of its motion, s.
STAYS = 5.0
#: The same with a hand that is held: some links of a UR5 are always nearer to each other than 30 mm.
NEAR = 0.01
#: No point of a robot here is farther from a joint that moves it, m.
SIZE = 2.0
UR5 = "package://example-robot-data/robots/ur_description/urdf/ur5_robot.urdf"
TIAGO = "package://example-robot-data/robots/tiago_description/robots/tiago_no_hand.urdf"
UP = {"ur5_shoulder_lift_joint": -1.5, "ur5_elbow_joint": 1.5, "ur5_wrist_1_joint": -1.5}
LIMITS = nmm.Limits(velocity={"platform": 1.0, "arm": 1.5}, acceleration={"platform": 1.0, "arm": 3.0})


class Scene(NamedTuple):
    """What is planned: robot, start, goal, obstacles, and a frame that is held."""

    robot: nmm.Robot
    start: dict[str, float]
    goal: object
    obstacles: list[nmm.Obstacle]
    hold: str | None = None
    distance: float = DISTANCE


def box(name: str, low: tuple[float, ...], high: tuple[float, ...]) -> nmm.Obstacle:
    ends = np.array([low, high])
    return nmm.Obstacle(nmm.Box(ends[1] - ends[0]), ends.mean(axis=0), name=name)


@cache
def ur5_on(base: str) -> nmm.Robot:
    platform = "unicycle" if base == "differential_base" else None
    return nmm.mount(nmm.load(base, platform=platform), nmm.load(UR5), prefix="ur5_")


@cache
def tiago() -> nmm.Robot:
    return nmm.Scenario.load("tiago_shelf").robot()


def u_shaped_wall(rng: np.random.Generator) -> Scene:
    """The robot stands in a U and is to go to a pose behind its closed end."""
    deep, wide = rng.uniform(1.2, 2.0), rng.uniform(0.9, 1.3)
    walls = [
        box("end", (deep, -wide, 0.0), (deep + 0.1, wide, 1.5)),
        box("left", (0.0, wide, 0.0), (deep + 0.1, wide + 0.1, 1.5)),
        box("right", (0.0, -wide - 0.1, 0.0), (deep + 0.1, -wide, 1.5)),
    ]
    goal = {"x": deep + rng.uniform(1.2, 2.5), "y": rng.uniform(-1, 1), "theta": rng.uniform(-np.pi, np.pi)}
    return Scene(
        ur5_on("differential_base"),
        {"x": rng.uniform(0.2, 0.5), "theta": rng.uniform(-1, 1), **UP},
        goal,
        walls,
    )


def door(rng: np.random.Generator) -> Scene:
    """A door of 0.9 m, and the end-effector's position behind it."""
    y = rng.uniform(-1.0, 1.0)
    walls = [
        box("left", (2.0, y + 0.45, 0.0), (2.1, y + 4.0, 2.0)),
        box("right", (2.0, y - 4.0, 0.0), (2.1, y - 0.45, 2.0)),
    ]
    target = [rng.uniform(3.2, 5.0), y + rng.uniform(-1.5, 1.5), rng.uniform(0.5, 1.1)]
    task = nmm.Task(nmm.Position("ur5_ee_link"), target)
    return Scene(ur5_on("differential_base"), {"theta": rng.uniform(-np.pi, np.pi), **UP}, task, walls)


def shelf(rng: np.random.Generator) -> Scene:
    """TIAGo's end-effector between two boards of a shelf."""
    x, height = rng.uniform(1.5, 2.5), rng.uniform(0.7, 0.9)
    walls = [
        box(f"board {k}", (x, -0.6, z), (x + 0.4, 0.6, z + 0.03))
        for k, z in enumerate((height - 0.2, height + 0.2))
    ]
    walls += [
        box("side", (x, 0.6, 0.0), (x + 0.4, 0.63, 1.6)),
        box("other", (x, -0.63, 0.0), (x + 0.4, -0.6, 1.6)),
    ]
    target = [x + rng.uniform(0.05, 0.2), rng.uniform(-0.4, 0.4), height + rng.uniform(-0.05, 0.05)]
    start = {
        "torso_lift_joint": 0.15,
        "arm_1_joint": 0.3,
        "arm_2_joint": -1.0,
        "arm_3_joint": -0.3,
        "arm_4_joint": 2.0,
    }
    return Scene(
        tiago(), start | {"y": rng.uniform(-1, 1)}, nmm.Task(nmm.Position("arm_tool_link"), target), walls
    )


def park(rng: np.random.Generator) -> Scene:
    """A car with an arm parks sideways in a gap."""
    gap = rng.uniform(1.9, 2.3)
    walls = [
        box("behind", (-2.5, -0.45, 0.0), (-0.55, 0.45, 0.8)),
        box("before", (gap - 0.55, -0.45, 0.0), (gap + 1.5, 0.45, 0.8)),
        box("kerb", (-3.0, -0.75, 0.0), (5.0, -0.6, 0.8)),
    ]
    start = {"x": rng.uniform(-1.0, 3.0), "y": rng.uniform(1.5, 2.5), "theta": rng.uniform(-0.5, 0.5), **UP}
    goal = {"x": 0.5 * (gap - 1.1) - 0.3, "y": 0.0, "theta": 0.0}
    return Scene(ur5_on("car_base"), start, goal, walls)


def table(rng: np.random.Generator) -> Scene:
    """The end-effector's position under a table."""
    x, y = rng.uniform(1.8, 3.0), rng.uniform(-0.5, 0.5)
    top = box("top", (x, y - 0.6, 0.72), (x + 0.9, y + 0.6, 0.75))
    legs = [
        box(f"leg {k}", (x + a, y + b, 0.0), (x + a + 0.05, y + b + 0.05, 0.72))
        for k, (a, b) in enumerate([(0.0, -0.6), (0.85, -0.6), (0.0, 0.55), (0.85, 0.55)])
    ]
    target = [x + rng.uniform(0.1, 0.4), y + rng.uniform(-0.3, 0.3), rng.uniform(0.35, 0.55)]
    task = nmm.Task(nmm.Position("ur5_ee_link"), target)
    return Scene(ur5_on("differential_base"), {"theta": rng.uniform(-np.pi, np.pi), **UP}, task, [top, *legs])


def low_gate(rng: np.random.Generator) -> Scene:
    """A gate through which the robot fits with its arm folded only."""
    height = rng.uniform(0.95, 1.1)
    walls = [
        box("left", (2.0, 0.5, 0.0), (2.2, 4.0, 2.0)),
        box("right", (2.0, -4.0, 0.0), (2.2, -0.5, 2.0)),
        box("above", (2.0, -0.5, height), (2.2, 0.5, 2.0)),
    ]
    goal = {"x": rng.uniform(3.5, 5.0), "y": rng.uniform(-1, 1), "theta": rng.uniform(-1, 1), **UP}
    return Scene(ur5_on("differential_base"), {"theta": rng.uniform(-np.pi, np.pi), **UP}, goal, walls)


def pose_of(base: str, rng: np.random.Generator) -> Scene:
    """From anywhere to a pose 5 cm to 10 m away, the arm as it is."""
    start = {"x": rng.uniform(-5, 5), "y": rng.uniform(-5, 5), "theta": rng.uniform(-np.pi, np.pi)}
    far, towards = 10.0 ** rng.uniform(-1.3, 1.0), rng.uniform(-np.pi, np.pi)
    goal = {
        "x": start["x"] + far * np.cos(towards),
        "y": start["y"] + far * np.sin(towards),
        "theta": rng.uniform(-np.pi, np.pi),
    }
    return Scene(ur5_on(base), start | UP, goal | UP, [])


def poses_differential(rng: np.random.Generator) -> Scene:
    return pose_of("differential_base", rng)


def poses_car(rng: np.random.Generator) -> Scene:
    return pose_of("car_base", rng)


def closing_gap(rng: np.random.Generator) -> Scene:
    """A wall with a gap, on the way to a pose; a box moves into it before the robot is there, and stays."""
    x, y, speed = rng.uniform(2.4, 3.6), rng.uniform(-0.5, 0.5), rng.uniform(2.0, 4.0)
    walls = [
        nmm.Obstacle(nmm.Box([0.2, 2.0, 2.0]), [x, y + side, 0.5], name=name)
        for name, side in (("right", -1.6), ("left", 1.6))
    ]

    def moves_in(t: float) -> list[float]:
        return [x, max(y, y + 4.0 - speed * t), 0.9]

    walls.append(nmm.Obstacle(nmm.Box([0.3, 1.4, 1.8]), motion=moves_in, name="stays"))
    goal = {"x": 6.0, "y": 0.0, "theta": 0.0}
    return Scene(nmm.load("unicycle_3r"), {"q1": 0.5, "q2": -0.4}, goal, walls)


def trailers(rng: np.random.Generator) -> Scene:
    """A tractor with two trailers to a pose up to 7 m away, the trailers as they come."""
    start = {"theta": rng.uniform(-np.pi, np.pi), "hitch1": rng.uniform(-0.6, 0.6)}
    goal = {"x": rng.uniform(-5, 5), "y": rng.uniform(-5, 5), "theta": rng.uniform(-np.pi, np.pi)}
    return Scene(nmm.load("trailer_base"), start | {"hitch2": rng.uniform(-0.6, 0.6)}, goal, [])


def trailers_straight(rng: np.random.Generator) -> Scene:
    """The same, with straight trailers there."""
    robot, start, goal, _ = trailers(rng)
    return Scene(robot, start, goal | {"hitch1": 0.0, "hitch2": 0.0}, [])


def trailers_wall(rng: np.random.Generator) -> Scene:
    """Round a wall of 4 m to a pose behind it, with straight trailers."""
    goal = {"x": rng.uniform(5, 7), "y": rng.uniform(-2, 2), "theta": rng.uniform(-np.pi, np.pi)}
    start = {"theta": rng.uniform(-np.pi, np.pi)}
    walls = [box("wall", (2.4, -2.0, 0.0), (2.6, 2.0, 1.5))]
    return Scene(nmm.load("trailer_base"), start, goal | {"hitch1": 0.0, "hitch2": 0.0}, walls)


def trailers_door(rng: np.random.Generator) -> Scene:
    """Through a gap of 1.0 to 1.4 m in a wall, to any heading with straight trailers."""
    y, half = rng.uniform(-1.5, 1.5), 0.5 * rng.uniform(1.0, 1.4)
    walls = [
        box("left", (3.0, y + half, 0.0), (3.2, y + 8.0, 1.5)),
        box("right", (3.0, y - 8.0, 0.0), (3.2, y - half, 1.5)),
    ]
    goal = {"x": rng.uniform(5.5, 7.5), "y": rng.uniform(-2, 2), "theta": rng.uniform(-np.pi, np.pi)}
    start = {"theta": rng.uniform(-np.pi, np.pi)}
    return Scene(nmm.load("trailer_base"), start, goal | {"hitch1": 0.0, "hitch2": 0.0}, walls)


def trailers_slot(rng: np.random.Generator) -> Scene:
    """Backwards into a slot 0.9 to 1.2 m wide and 2.4 m deep."""
    half = 0.5 * rng.uniform(0.9, 1.2)
    walls = [
        box("left", (-2.5, half, 0.0), (0.0, half + 0.2, 1.0)),
        box("right", (-2.5, -half - 0.2, 0.0), (0.0, -half, 1.0)),
        box("end", (-2.6, -half, 0.0), (-2.4, half, 1.0)),
    ]
    start = {"x": rng.uniform(3, 5), "y": rng.uniform(-2, 2), "theta": rng.uniform(-np.pi, np.pi)}
    goal = {"x": rng.uniform(-0.1, 0.3), "y": 0.0, "theta": 0.0, "hitch1": 0.0, "hitch2": 0.0}
    return Scene(nmm.load("trailer_base"), start, goal, walls)


def held_on(base: str, rng: np.random.Generator) -> Scene:
    """A hand's pose is held while the platform goes to a pose from which the arm reaches it."""
    robot, hand = ur5_on(base), nmm.Position("ur5_ee_link")
    while True:
        bent = {"shoulder_lift": -1.2, "elbow": 1.5, "wrist_1": -1.5, "wrist_2": -1.2}
        start = {f"ur5_{joint}_joint": at + rng.uniform(-0.3, 0.3) for joint, at in bent.items()}
        start |= {"ur5_shoulder_pan_joint": rng.uniform(-2, 2), "theta": rng.uniform(-np.pi, np.pi)}
        goal = dict(zip(("x", "y", "theta"), rng.uniform([-1, -1, -np.pi], [1, 1, np.pi]), strict=True))
        here = robot.q(start)
        there = robot.q(start | goal)
        shoulder = nmm.Position("ur5_shoulder_link")
        tip, held_from, old = (
            nmm.evaluate(function, 0.0, nmm.Configuration(robot, q)).value
            for function, q in ((hand, here), (shoulder, there), (shoulder, here))
        )
        posts = []
        for k in range(3):
            away, towards = rng.uniform(0.8, 1.5), rng.uniform(-np.pi, np.pi)
            at = [away * np.cos(towards), away * np.sin(towards), 0.2]
            posts.append(nmm.Obstacle(nmm.Cylinder(0.05, 0.4), at, name=f"post {k}"))
        scene = nmm.Collisions(NEAR, obstacles=posts).on(robot)
        reach = [float(np.linalg.norm(tip - one)) for one in (held_from, old)]
        base_pairs = [k for k, name in enumerate(scene.names) if "base_link" in name[0] and "post" in name[1]]
        spare = min(float(scene.queries.distances(0.0, q, base_pairs).min()) for q in (here, there))
        if max(reach) < 0.75 and spare > 0.05:
            return Scene(robot, start, goal, posts, "ur5_ee_link", NEAR)


def hold(rng: np.random.Generator) -> Scene:
    return held_on("differential_base", rng)


def hold_car(rng: np.random.Generator) -> Scene:
    return held_on("car_base", rng)


KINDS: dict[str, Callable[[np.random.Generator], Scene]] = {
    one.__name__: one
    for one in (
        *(u_shaped_wall, door, shelf, park, table, low_gate),
        *(poses_differential, poses_car, closing_gap, hold, hold_car),
        *(trailers, trailers_straight, trailers_wall, trailers_door, trailers_slot),
    )
}
#: What is measured where no kind is named.
SIX = list(KINDS)[:6]


class Checked(NamedTuple):
    """Of a plan: metres to spare, |q_dot - S u|, limits broken at most."""

    free: float
    motion: float
    limits: float


def checked(scene: Scene, plan: nmm.Plan, samples: int = 2000) -> Checked:
    robot, T = scene.robot, plan.duration
    moving = any(one.moves for one in scene.obstacles)
    t = np.linspace(0.0, T + STAYS * moving, samples)
    q, _ = plan(t)
    queries = nmm.Collisions(scene.distance, obstacles=scene.obstacles).on(robot).queries
    pairs = range(len(queries.scene.kept))
    asked = np.minimum(scene.distance, queries.distances(0.0, q[0], pairs) - 0.002)
    moved = np.abs(np.diff(q, axis=0, prepend=q[:1])) @ np.where(
        np.array(robot.q_units) == "m", 2.0, 2.0 * SIZE
    )
    if moving:
        moved[:] = np.inf
    least, near = np.full(len(pairs), -np.inf), np.inf
    for when, one, step in zip(t, q, moved, strict=True):
        least -= step  # two shapes come nearer by so much at most: far ones need no look
        due = np.flatnonzero(least < near)
        least[due] = queries.distances(float(when), one, due) - asked[due]
        near = min(near, float(least.min()))
    h = 1e-6
    inner = t[(t > h) & (t < T - h)]
    kinks = plan.found.motion.samples.begin if plan.smooth else plan.stops
    inner = inner[np.abs(inner[:, np.newaxis] - kinks).min(axis=1) > 2.0 * h]
    here, u = plan(inner)
    rate = (plan(inner + h)[0] - plan(inner - h)[0]) / (2.0 * h)
    u_dot = (plan(inner + h)[1] - plan(inner - h)[1]) / (2.0 * h)
    off = max(float(np.abs(v - robot.S(one) @ w).max()) for v, one, w in zip(rate, here, u, strict=True))
    on = LIMITS.on(robot)
    over = [on.inputs[:, 0] - u, u - on.inputs[:, 1], np.abs(u_dot) - on.accelerations - 1e-5]
    over += [robot.q_limits[:, 0] - q, q - robot.q_limits[:, 1]]
    return Checked(near, off, max(float(one.max()) for one in over))


def error_of(scene: Scene, q: np.ndarray) -> float:
    """How far from a task's target q is, m."""
    parts = scene.goal.function, scene.goal.reference
    value, target = (nmm.evaluate(one, 0.0, nmm.Configuration(scene.robot, q)).value for one in parts)
    return float(np.linalg.norm(value - target))


def at_goal(scene: Scene, plan: nmm.Plan) -> bool:
    """Whether its end is the goal, coordinates to 1e-6 and a task's error within the tolerances."""
    if isinstance(scene.goal, nmm.Task):
        return error_of(scene, plan.end) <= 0.005
    names = list(scene.goal)
    off = plan.end[[scene.robot.coordinate(name) for name in names]] - [scene.goal[name] for name in names]
    off = [2.0 * np.sin(0.5 * one) if name == "theta" else one for one, name in zip(off, names, strict=True)]
    return bool(np.abs(off).max() <= 1e-6)


def drift(scene: Scene, plan: nmm.Plan, samples: int = 1000) -> tuple[float, float]:
    """How far what is held is from where it was, at most: m and rad, by Pinocchio."""
    model = scene.robot.model
    data, number = model.createData(), model.getFrameId(scene.hold)
    placed = []
    for q in plan(np.linspace(0.0, plan.duration, samples))[0]:
        pin.framesForwardKinematics(model, data, q)
        placed.append(pin.SE3(data.oMf[number]))
    turned = max(float(np.linalg.norm(pin.log3(placed[0].rotation.T @ one.rotation))) for one in placed)
    return max(float(np.linalg.norm(one.translation - placed[0].translation)) for one in placed), turned


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("instances", type=int, nargs="?", default=20)
    parser.add_argument("seed", type=int, nargs="?", default=0)
    parser.add_argument("kinds", nargs="*", choices=[[], *KINDS], default=[])
    parser.add_argument("--only", choices=["rests", "smooth"])
    parser.add_argument("--prepared", action="store_true")
    parser.add_argument("--ways", type=int, default=planned.WAYS)
    given = parser.parse_args()
    planned.WAYS = given.ways
    print(f"{given.instances} instances of each, seed {given.seed}")
    for kind in (u_shaped_wall, table, trailers):  # what is compiled once is no part of a plan
        nmm.plan(*kind(np.random.default_rng(0))[:4], smooth=True)
    print(f"{'':18} smooth found   end  free   s median   worst  duration  spare mm  |q_dot - S u|  limits")
    for kind in given.kinds or SIX:
        for smooth in (False, True):
            if given.only in (None, "smooth" if smooth else "rests"):
                measure(kind, given.instances, given.seed, smooth, given.prepared)


def replanned(scene: Scene, plan: nmm.Plan, rng: np.random.Generator) -> float:
    """The processor time of `nmm.replan` among obstacles that were moved, s; nan where none is found."""
    moved = [
        nmm.Obstacle(one.shape, one.placement(0.0)[:3, 3] + rng.uniform(-0.02, 0.02, 3), name=one.name)
        for one in scene.obstacles
    ]
    (q,), _ = plan(0.1 * plan.duration)
    begin = time.process_time()
    try:
        nmm.replan(plan, q, moved)
    except nmm.NmmError:
        return np.nan
    return time.process_time() - begin


def measure(kind: str, instances: int, seed: int, smooth: bool, prepared: bool) -> None:
    """Print a line: processor time and motion of the plans of a kind, with rests or smooth."""
    times, durations, found, drifts, smoothed, arrived = [], [], [], [], 0, 0
    again = []
    for k in range(instances):
        scene = KINDS[kind](np.random.default_rng([seed, k]))
        given = scene.obstacles, nmm.Collisions(scene.distance), LIMITS
        begin = time.process_time()
        try:
            planner = nmm.Planner(scene.robot, *given, smooth=smooth, hold=scene.hold)
            if prepared:
                planner.plan(scene.start, scene.goal, seed=k + 1)
                begin = time.process_time()
            plan = planner.plan(scene.start, scene.goal, seed=k)
        except nmm.NmmError as error:
            print(f"  {kind} {k}: {error} ({time.process_time() - begin:.2f} s)")
            continue
        times.append(time.process_time() - begin)
        durations.append(plan.duration)
        if prepared and scene.hold is None:
            again.append(replanned(scene, plan, np.random.default_rng(k)))
        found.append(checked(scene, plan, 2000 if scene.obstacles else 100))
        arrived += at_goal(scene, plan)
        smoothed += plan.smooth
        if scene.hold is not None:
            drifts.append(drift(scene, plan))
    if found:
        least = Checked(*(f(x) for f, x in zip((min, max, max), zip(*found, strict=True), strict=True)))
        print(
            f"{kind:18} {smoothed:6} {len(found):5} {arrived:5} {sum(one.free > 0.0 for one in found):5} "
            f"{np.median(times):10.2f} {max(times):7.2f} {np.median(durations):9.1f} {1e3 * least.free:9.2f} "
            f"{least.motion:14.1e} {least.limits:7.1e}",
            flush=True,
        )
    if again:
        print(f"  replanned in {1e3 * np.nanmedian(again):.1f} ms, {1e3 * np.nanmax(again):.0f} at most")
    if drifts:
        metres, radians = np.max(drifts, axis=0)
        print(f"  held within {1e3 * metres:.3f} mm and {radians:.1e} rad")


if __name__ == "__main__":
    main()
