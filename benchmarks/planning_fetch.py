"""nmm beside fetch-planning on its own Fetch, whole body, through a scanned door:

    python benchmarks/planning_fetch.py [INSTANCES] [SEED] [--points N …]

fetch-planning (not one of nmm's dependencies: pip install fetch-planning==0.3.2) plans by OMPL's RRT-Connect,
Reeds and Shepp's curves and VAMP's spheres, with its own defaults: points of 10 mm, simplified, interpolated.
nmm keeps 30 mm, from the points and between the robot's own shapes, or what the start has. Both have the same
points, starts and goals, whole configurations: a random one before the wall, another behind it, the arm in
between two of a few postures. Set-up is what comes before the first plan: nmm's field and what `nmm.Planner`
prepares. Times are processor time, of one thread. `touch` and `least` are of Coal, on the convex hulls of the
robot's own meshes and the true boxes, 1,000 times along each motion; nmm's motion is in time, the other's
straight between its states.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np

import nmm

#: The door, m; what nmm keeps, and the balls about points, m.
WIDTH, DISTANCE, RADIUS = 1.0, 0.03, 0.01
BOXES = {
    "left": ((2.0, 0.5 * WIDTH, 0.0), (2.1, 4.0, 2.0)),
    "right": ((2.0, -4.0, 0.0), (2.1, -0.5 * WIDTH, 2.0)),
    "table": ((3.6, 1.2, 0.65), (4.4, 2.4, 0.7)),
}
#: Torso and arm.
POSTURES = (
    (0.35, 1.32, 1.4, -0.2, 1.72, 0.0, 1.66, 0.0),
    (0.30, 0.4, 0.3, 0.0, 1.2, 0.0, 0.6, 0.0),
    (0.20, -0.6, 0.6, 0.4, 1.5, 0.3, 0.8, 0.0),
)
LIMITS = nmm.Limits(velocity={"platform": 0.6, "arm": 1.2}, acceleration={"platform": 0.5, "arm": 1.5})


def scanned(count: int, rng: np.random.Generator) -> np.ndarray:
    """Points (N, 3), m, on the sides of the boxes, with 2 mm of noise."""
    sides = []
    for low, high in BOXES.values():
        low, high = np.array(low), np.array(high)
        for axis in range(3):
            area = float(np.prod(np.delete(high - low, axis)))
            sides += [(low, high, axis, end[axis], area) for end in (low, high)]
    areas = np.array([side[-1] for side in sides])
    clouds = []
    for (low, high, axis, at, _), number in zip(
        sides, rng.multinomial(count, areas / areas.sum()), strict=True
    ):
        points = rng.uniform(low, high, (number, 3))
        points[:, axis] = at
        clouds.append(points)
    points = np.vstack(clouds)
    return points + rng.normal(0.0, 0.002, points.shape)


def boxes() -> list[nmm.Obstacle]:
    return [
        nmm.Obstacle(nmm.Box(np.subtract(high, low)), np.add(low, high) / 2.0, name=name)
        for name, (low, high) in BOXES.items()
    ]


def ends(robot: nmm.Robot, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """A free start before the wall and a free goal behind it, 50 mm from everything, 35 from itself."""
    queries = nmm.Collisions(DISTANCE, self_collisions=False, obstacles=boxes()).on(robot).queries
    own = nmm.Collisions(DISTANCE).on(robot).queries
    found: list[np.ndarray] = []
    for x in ((-1.0, 1.0), (3.0, 4.5)):
        while True:
            pose = [rng.uniform(*x), rng.uniform(-1.5, 1.5), rng.uniform(-np.pi, np.pi)]
            q = np.array([*pose, *POSTURES[rng.integers(len(POSTURES))]])
            if queries.nearest(0.0, q)[0] > 0.05 and own.nearest(0.0, q)[0] > 0.035:
                found.append(q)
                break
    return found[0], found[1]


def least(robot: nmm.Robot, path: np.ndarray) -> float:
    """The least distance of the robot from the true boxes along configurations (K, n), m, by Coal."""
    queries = nmm.Collisions(DISTANCE, self_collisions=False, obstacles=boxes()).on(robot).queries
    return min(float(queries.distances(0.0, q, range(len(queries.scene.pairs))).min()) for q in path)


def row(who: str, setup: list[float], times: list[float], ranges: list[float], count: int) -> None:
    print(
        f"{who:16}{len(times):4}/{count:<4}{1e3 * np.median(setup):12.0f}{1e3 * np.median(times):10.0f}"
        f"{1e3 * max(times):8.0f}{sum(one <= 0.0 for one in ranges):7}{1e3 * min(ranges):10.1f}"
        f"{1e3 * np.median(ranges):8.1f}",
        flush=True,
    )


def measure(robot: nmm.Robot, instances: int, seed: int, count: int) -> None:
    from fetch_planning.planning import create_planner

    results: dict[str, tuple[list[float], list[float], list[float]]] = {
        who: ([], [], []) for who in ("fetch-planning", "nmm", "nmm on boxes")
    }
    points = scanned(count, np.random.default_rng(seed)).astype(np.float32)
    for who, (setup, times, ranges) in results.items():
        begin = time.process_time()
        if who == "fetch-planning":
            other = create_planner("fetch", pointcloud=points)
        else:
            obstacles = [nmm.PointCloud(points, RADIUS, name="scan")] if who == "nmm" else boxes()
            planner = nmm.Planner(robot, obstacles, nmm.Collisions(DISTANCE), LIMITS)
        setup.append(time.process_time() - begin)
        for k in range(instances):
            start, goal = ends(robot, np.random.default_rng([seed, k]))
            begin = time.process_time()
            if who == "fetch-planning":
                result = other.plan(start, goal)
                took, path = time.process_time() - begin, result.path
                if path is None:
                    print(f"  {who} {k}: {result.status}")
                    continue
                shares = np.linspace(0.0, len(path) - 1.0, 1000)
                unwrapped = path.copy()
                unwrapped[:, 2] = np.unwrap(path[:, 2])
                path = np.column_stack(
                    [np.interp(shares, np.arange(len(path)), column) for column in unwrapped.T]
                )
            else:
                try:
                    plan = planner.plan(start, goal, seed=k)
                except nmm.NmmError as error:
                    print(f"  {who} {k}: {error}")
                    continue
                took = time.process_time() - begin
                path, _ = plan(np.linspace(0.0, plan.duration, 1000))
            times.append(took)
            ranges.append(least(robot, path))
        if times:
            row(who, setup, times, ranges, instances)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("instances", type=int, nargs="?", default=20)
    parser.add_argument("seed", type=int, nargs="?", default=0)
    parser.add_argument("--points", type=int, nargs="*", default=[20_000, 100_000])
    asked = parser.parse_args()
    try:
        import fetch_planning
    except ImportError:
        print("fetch-planning is not installed (pip install fetch-planning==0.3.2)")
        return
    folder = Path(fetch_planning.__file__).parent / "resources" / "robot" / "fetch"
    robot = nmm.load(folder / "fetch.urdf", platform="unicycle")
    way, scan = ends(robot, np.random.default_rng(0)), scanned(2_000, np.random.default_rng(0))
    for obstacles in (boxes(), [nmm.PointCloud(scan, RADIUS)]):  # what is compiled once is no part of a plan
        nmm.plan(robot, *way, obstacles, nmm.Collisions(DISTANCE), LIMITS)
    for count in asked.points:
        print(f"{count} points\n{'':16}{'found':9}{'set-up ms':>12}{'plan ms':>10}{'worst':>8}", end="")
        print(f"{'touch':>7}{'least mm':>10}{'median':>8}")
        measure(robot, asked.instances, asked.seed, count)


if __name__ == "__main__":
    main()
