"""Random scenes of robots, obstacles and goals, and how near an own look along the runs finds them.

`python -m tests.scene_problems COUNT [FIRST]` runs that many with and without avoidance, and counts.
"""

from __future__ import annotations

import sys
import time
from collections import Counter
from collections.abc import Callable
from functools import lru_cache
from typing import Any, NamedTuple

import coal
import numpy as np
import pinocchio as pin

import nmm
from nmm.base.arrays import Array

#: A scenario that has the robot and where it starts, and the frame that moves.
ROBOTS = {
    "unicycle_3r_position": "ee",
    "tiago_pose": "arm_tool_link",
    "ur5_unicycle_pose": "ur5_tool0",
    "kinova_car": "j2s6s200_end_effector",
    "omni_small_arm_door": "ee",
    "small_arm_second_trailer": "ee",
}
LIMITS = ("none", "velocity", "acceleration")
#: Obstacles' speeds, m/s: fast ones come faster than the robots can leave.
MOTIONS = {"standing": (0.0, 0.0), "slow": (0.05, 0.25), "fast": (0.8, 2.0)}
RESOLVERS = {"pg": nmm.ProjectedGradient(), "rg": nmm.ReducedGradient(alpha=0.5)}
STEPS, METHODS = (0.01, 0.02, 0.05), ("zoh", "rk4")
#: The share of scenes that begin nearer than the distance; the others begin this far away at least, m.
NEAR, FAR = 0.04, 0.05
DISTANCE, DURATION = 0.025, 3.0
#: As long as the farthest goal takes without obstacles, s: for `main`.
WHOLE = 8.0
#: What is kept to, m, and looks a sample.
ROUNDING, LOOKS = 1e-6, 5


class Scene(NamedTuple):
    """What is drawn; `kinds` names a kind of each thing that is drawn."""

    kinds: dict[str, str]
    robot: nmm.Robot
    q: Array
    task: nmm.Task
    obstacles: tuple[nmm.Obstacle, ...]
    limits: nmm.Limits | None
    dt: float

    def controller(self, *, avoids: bool) -> nmm.Controller:
        """That of the scene, with and without avoidance."""
        collisions = nmm.Collisions(DISTANCE, obstacles=self.obstacles) if avoids else None
        resolver = RESOLVERS[self.kinds["resolver"]]
        return nmm.Controller(self.robot, self.task, resolver, limits=self.limits, collisions=collisions)

    def run(self, controller: nmm.Controller, duration: float) -> nmm.Trajectory:
        """What comes of it."""
        return nmm.simulate(controller, self.q, duration, self.dt, self.kinds["method"], until=nmm.Goal())


@lru_cache
def robot_of(name: str) -> tuple[nmm.Robot, Array]:
    """The robot of a scenario, and where it starts."""
    scenario = nmm.Scenario.load(name)
    robot = scenario.robot()
    return robot, robot.q(scenario.parts.q0)


@lru_cache
def scene(seed: int) -> Scene:
    """The scene of a seed: robots in turn, the rest drawn."""
    rng = np.random.default_rng(seed)
    name = list(ROBOTS)[seed % len(ROBOTS)]
    robot, q = robot_of(name)
    kinds = {
        "robot": name,
        "limits": LIMITS[rng.choice(3, p=[0.25, 0.25, 0.5])],
        "motion": [*MOTIONS][rng.choice(3, p=[0.6, 0.25, 0.15])],
        "start": "near" if rng.random() < NEAR else "far",
        "resolver": [*RESOLVERS][rng.integers(2)],
        "dt": str(STEPS[rng.integers(3)]),
        "method": METHODS[rng.integers(2)],
    }
    tip = nmm.Configuration(robot, q).placement(ROBOTS[name]).translation
    way, angle = rng.uniform(1.0, 2.5), rng.uniform(-np.pi, np.pi)
    goal = tip + np.array([way * np.cos(angle), way * np.sin(angle), rng.uniform(-0.2, 0.2)])
    apart = Distances(robot, ())
    obstacles: list[nmm.Obstacle] = []
    for k in range(rng.integers(1, 4)):
        for _ in range(200):
            near = kinds["start"] == "near" and k == 0
            found = obstacle(rng, k, tip, goal, *MOTIONS[kinds["motion"]])
            d = apart.with_obstacles([found]).least(0.0, q)[0]
            if (0.003 < d < DISTANCE) if near else (d > FAR):
                obstacles.append(found)
                break
    planar = robot.name == "unicycle_3r"
    aim = nmm.Position(ROBOTS[name], "xy") if planar else nmm.Position(ROBOTS[name])
    task = nmm.Task(aim, goal[:2] if planar else goal, gain=1.5, speed=rng.uniform(0.4, 1.2))
    limits = None
    if kinds["limits"] != "none":
        acceleration = {"platform": 2.0, "arm": 4.0} if kinds["limits"] == "acceleration" else None
        limits = nmm.Limits({"platform": 1.0, "arm": 1.5}, acceleration=acceleration)
    return Scene(kinds, robot, q, task, tuple(obstacles), limits, float(kinds["dt"]))


def obstacle(
    rng: np.random.Generator, k: int, tip: Array, goal: Array, slowest: float, fastest: float
) -> nmm.Obstacle:
    """One on the way to the goal, which crosses it where it moves."""
    shapes: list[Callable[[], nmm.extending.Shape]] = [
        lambda: nmm.Box(rng.uniform(0.1, 0.6, 3)),
        lambda: nmm.Sphere(rng.uniform(0.05, 0.3)),
        lambda: nmm.Cylinder(rng.uniform(0.05, 0.2), rng.uniform(0.2, 1.0)),
        lambda: nmm.Capsule(rng.uniform(0.05, 0.2), rng.uniform(0.2, 1.0)),
    ]
    shape = shapes[rng.integers(4)]()
    middle = tip + (goal - tip) * rng.uniform(0.3, 1.1) + rng.uniform(-0.3, 0.3, 3)
    turn = rng.uniform(-1.5, 1.5, 3)
    if not fastest:
        return nmm.Obstacle(shape, [*middle, *turn], name=f"thing{k}")
    angle, speed, meets = rng.uniform(-np.pi, np.pi), rng.uniform(slowest, fastest), rng.uniform(0.5, 2.5)
    velocity = speed * np.array([np.cos(angle), np.sin(angle), 0.0])
    spin = np.array([0.0, 0.0, rng.uniform(-0.5, 0.5)])

    def motion(t: float) -> Array:
        turned = pin.log3(pin.exp3(spin * t) @ pin.exp3(turn))
        return np.concatenate([middle + velocity * (t - meets), turned])

    return nmm.Obstacle(shape, motion=motion, name=f"thing{k}")


class Distances:
    """Least distances by Pinocchio's loop over all pairs, each shape's hull made by Coal's own Qhull."""

    def __init__(self, robot: nmm.Robot, pairs: tuple[tuple[int, int], ...] | None = None) -> None:
        self.robot, self.own = robot, hulls_of(robot)
        self.pairs, self.obstacles = pairs, ()

    def with_obstacles(self, obstacles: Any) -> Distances:
        """The same among obstacles; all pairs with them where none were said."""
        made = Distances(self.robot, self.pairs)
        made.obstacles = tuple(obstacles)
        shapes = made.shapes = self.own.copy()
        count = len(self.own.geometryObjects)
        for one in obstacles:
            shapes.addGeometryObject(pin.GeometryObject(one.name, 0, 0, pin.SE3(), one.shape.geometry()))
        pairs = self.pairs or [(i, count + k) for i in range(count) for k in range(len(obstacles))]
        for pair in pairs:
            shapes.addCollisionPair(pin.CollisionPair(*pair))
        made.found, made.data = pin.GeometryData(shapes), self.robot.model.createData()
        for request in made.found.distanceRequests:
            request.gjk_tolerance = 1e-8
        return made

    def least(self, t: float, q: Array) -> tuple[float, str]:
        """The least distance, m, and between what."""
        first = len(self.own.geometryObjects)
        for k, one in enumerate(self.obstacles):
            self.shapes.geometryObjects[first + k].placement = pin.SE3(one.placement(t))
        k = pin.computeDistances(self.robot.model, self.data, self.shapes, self.found, q)
        pair = self.shapes.collisionPairs[k]
        names = [self.shapes.geometryObjects[i].name for i in (pair.first, pair.second)]
        return self.found.distanceResults[k].min_distance, " and ".join(names)


@lru_cache
def hulls_of(robot: nmm.Robot) -> pin.GeometryModel:
    """The robot's shapes, each mesh's convex hull in its place, without pairs."""
    found = pin.GeometryModel()
    for shape in robot.collision_model.geometryObjects:
        copied = pin.GeometryObject(shape)
        if isinstance(shape.geometry, coal.BVHModelBase):
            shape.geometry.buildConvexHull(True, "Qt")
            copied.geometry = shape.geometry.convex
        found.addGeometryObject(copied)
    return found


def along(robot: nmm.Robot, q: Array, u: Array, dt: float) -> list[Array]:
    """Where inputs that are held take a robot, from look to look: RK4."""
    h, found = dt / LOOKS, []
    for _ in range(LOOKS):
        a = robot.S(q) @ u
        b = robot.S(q + 0.5 * h * a) @ u
        c = robot.S(q + 0.5 * h * b) @ u
        q = q + h / 6 * (a + 2 * b + 2 * c + robot.S(q + h * c) @ u)
        found.append(q)
    return found


def least_along(run: nmm.Trajectory, apart: Distances) -> tuple[float, str]:
    """The least distance at samples and at several looks between them, and between what."""
    found = [apart.least(float(run.t[0]), run.q[0])]
    for k in range(len(run) - 1):
        dt = float(run.t[k + 1] - run.t[k])
        looks = along(run.robot, run.q[k], run.u[k], dt)
        astray = run.q[k + 1] - looks[-1]  # of what did not hold its inputs: by and by
        for i, q in enumerate(looks, start=1):
            share = i / LOOKS
            found.append(apart.least(float(run.t[k] + share * dt), q + share * astray))
    return min(found)


class Found(NamedTuple):
    """What came of a scene: how near by our look and by what the run says, m; the words of its warnings; how
    it ended; how near without avoidance; and the largest input."""

    least: float
    pair: str
    told: float
    said: tuple[str, ...]
    outcome: str
    why: list[str]
    without: float
    fastest: float
    seconds: float

    @property
    def kept(self) -> bool:
        return self.least >= DISTANCE - ROUNDING

    @property
    def untold(self) -> bool:
        """Too near, and the run does not say so, with the pair and by how much."""
        return not self.kept and not (self.said and abs(self.told - self.least) < 2e-3)

    @property
    def classes(self) -> list[str]:
        """What it counts as."""
        blocked = "blocked" in self.why
        return [
            "kept" if self.kept else ("UNTOLD" if self.untold else "said"),
            "reached" if self.outcome == "completed" else ("blocked" if blocked else self.outcome),
            *(["hit without"] if self.without < 0.0 else []),
            *(["hit"] if self.least < 0.0 else []),
            *(["thrown"] if self.fastest > 50.0 else []),
        ]


def outcome_of(one: Scene, duration: float = DURATION, *, without: bool = True) -> Found:
    """Run a scene, and look along it; the same without avoidance where that is asked for."""
    began = time.perf_counter()
    controller = one.controller(avoids=True)
    setting = controller.solver.scene
    assert setting is not None
    pairs = tuple((pair.first, pair.second) for pair in setting.queries.shapes.collisionPairs)
    run = one.run(controller, duration)
    seconds = time.perf_counter() - began
    apart = Distances(one.robot, pairs).with_obstacles(setting.obstacles)
    least, pair = least_along(run, apart)
    free = one.run(one.controller(avoids=False), duration) if without else None
    return Found(
        least,
        pair,
        float(run.clearance_between.min()),
        tuple(str(one) for one in run.findings if one.code in ("distance_not_kept", "start_too_near")),
        run.outcome.value,
        [one.code for one in run.verdict.reasons],
        np.inf if free is None else least_along(free, apart)[0],
        float(np.abs(run.u).max()),
        seconds,
    )


def main(count: int, first: int = 0) -> None:
    """Run, a line each that is not kept, and the counts."""
    counts: dict[str, Counter[str]] = {}
    for seed in range(first, first + count):
        one = scene(seed)
        found = outcome_of(one, WHOLE)
        for group in ("all", *(f"{key} {one.kinds[key]}" for key in ("robot", "limits", "motion", "start"))):
            counts.setdefault(group, Counter()).update(["scenes", *found.classes])
        if not found.kept or found.fastest > 50.0 or found.seconds > 20.0:
            kinds = " ".join(one.kinds.values())
            print(
                f"{seed} {kinds}: {' '.join(found.classes)}; {found.least - DISTANCE:.2g} m of {found.pair}, "
                f"told {found.told - DISTANCE:.2g}; inputs to {found.fastest:.3g}; {found.seconds:.1f} s; "
                f"{found.said}",
                flush=True,
            )
        if seed % 25 == 24 or seed == first + count - 1:
            print(f"after {seed - first + 1}: {dict(counts['all'])}", flush=True)
    for group, of in counts.items():
        print(f"{group:34} {dict(of)}")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
