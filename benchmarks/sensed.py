"""Obstacles as they are sensed, beside the true boxes that were scanned:

    python benchmarks/sensed.py [PLANS] [ROOMS] [SEED] [--short] [--only making|doors|rooms|memory …]

making   what clouds and maps take until distances are known, s of the processor
doors    plans of a UR5 on a differential drive through scanned doors beside those of the same seeds on the
         true boxes, in turn; the cloud's own cells are made before
rooms    plans in scanned rooms; along each the true distance by Coal, between the hulls of the robot's shapes
         and the true boxes, against what was asked less noise and gap, and how much less than the true one
         the distances are that the planner knows
memory   the peak of a process that plans, among boxes and in a cloud of 300,000 points

A scan has points all over the boxes' faces in the room, and normal noise. The gap is the farthest
that a point of a face is from the nearest point of the scan without noise.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import coal
import numpy as np
import pinocchio as pin
from planning import DISTANCE, LIMITS, UP, Scene, box, ur5_on
from scipy.spatial import cKDTree

import nmm
from nmm.model.collisions.pairs import query_shapes

#: Standard deviation of a scan's points, m; how many there are in a room.
NOISE, POINTS = 0.003, 100_000
#: Corners of the room, m; from outside nobody sees it.
ROOM = np.array([[-1.5, -4.0, 0.0], [5.4, 4.0, 2.5]])
#: Times along a plan at which true distances are looked at.
TIMES = 1_000
PARTS = ("making", "doors", "rooms", "memory")


class Scan(NamedTuple):
    """noise : the largest there is; gap, m"""

    cloud: nmm.PointCloud
    noise: float
    gap: float


def faces(boxes: list[nmm.Obstacle], rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    """So many points all over the faces that are seen, and the faces' normals."""
    corners, edges, normals = [], [], []
    for obstacle in boxes:
        half, middle = 0.5 * np.array(obstacle.shape.size), obstacle.placement(0.0)[:3, 3]
        for axis in range(3):
            for side in (-1.0, 1.0):
                normal = side * np.eye(3)[axis]
                seen_from = middle + (half + 1e-3) * normal
                if np.any(seen_from < ROOM[0]) or np.any(seen_from > ROOM[1]):
                    continue
                corners.append(middle - half * np.where(np.arange(3) == axis, -side, 1.0))
                edges.append(2.0 * half * (np.arange(3) != axis))
                normals.append(normal)
    areas = np.array([np.prod(edge[edge > 0.0]) for edge in edges])
    of = rng.choice(len(areas), count, p=areas / areas.sum())
    points = np.array(corners)[of] + rng.uniform(size=(count, 3)) * np.array(edges)[of]
    return points, np.array(normals)[of]


def scanned(boxes: list[nmm.Obstacle], rng: np.random.Generator, count: int) -> Scan:
    points, normals = faces(boxes, rng, count)
    noise = rng.normal(0.0, NOISE, count)
    everywhere, _ = faces(boxes, rng, 100_000)
    gap = float(cKDTree(points).query(everywhere)[0].max())
    seen = points + noise[:, np.newaxis] * normals
    spacing = nmm.PointCloud(seen).spacing
    return Scan(
        nmm.PointCloud(seen, radius=0.5 * spacing + 2.0 * NOISE, name="scan"), float(np.abs(noise).max()), gap
    )


def walled_door(rng: np.random.Generator, width: float, furniture: bool = True) -> Scene:
    """A room of 7 m x 8 m with a wall across and a door in it, a table and a shelf, to a pose behind it."""
    y, half = rng.uniform(-1.0, 1.0), 0.5 * width
    boxes = [
        box("left", (2.0, y + half, 0.0), (2.1, 4.0, 2.4)),
        box("right", (2.0, -4.0, 0.0), (2.1, y - half, 2.4)),
        *(box(f"end {x}", (x, -4.0, 0.0), (x + 0.1, 4.0, 2.4)) for x in (-1.6, 5.4)),
        *(box(f"side {k}", (-1.6, k, 0.0), (5.5, k + 0.1, 2.4)) for k in (-4.1, 4.0)),
    ]
    if furniture:
        boxes += [
            box("table", (3.5, 2.4, 0.72), (4.5, 3.8, 0.75)),
            box("shelf", (4.8, -3.8, 0.0), (5.2, -2.2, 1.8)),
        ]
    goal = {"x": rng.uniform(3.2, 4.2), "y": y + rng.uniform(-0.7, 0.7), "theta": rng.uniform(-np.pi, np.pi)}
    start = {"theta": rng.uniform(-np.pi, np.pi), **UP}
    return Scene(ur5_on("differential_base"), start, goal | UP, boxes)


def furnished(rng: np.random.Generator) -> Scene:
    """A door of 0.8 to 1.1 m and four to eight boxes, posts and boards; start, door and goal are free."""
    scene = walled_door(rng, rng.uniform(0.8, 1.1), furniture=False)
    boxes = [*scene.obstacles]
    low_y, high_y = boxes[1].placement(0.0)[1, 3], boxes[0].placement(0.0)[1, 3]
    door_y = 0.5 * (low_y + 0.5 * boxes[1].shape.size[1] + high_y - 0.5 * boxes[0].shape.size[1])
    free = np.array([[0.0, 0.0], [2.05, door_y], [scene.goal["x"], scene.goal["y"]]])
    wanted = len(boxes) + rng.integers(4, 9)
    while len(boxes) < wanted:
        size = rng.uniform([0.08, 0.08, 0.03], [0.8, 0.8, 1.2])
        low = rng.uniform([-1.4, -3.9, 0.2], [4.6, 3.1, 1.0]) * [1.0, 1.0, rng.integers(0, 2)]
        away = np.linalg.norm(free - low[:2] - 0.5 * size[:2], axis=1)
        if away.min() > 0.9 + 0.5 * np.linalg.norm(size[:2]):
            boxes.append(box(f"box {len(boxes)}", tuple(low), tuple(low + size)))
    return scene._replace(obstacles=boxes)


class Truth:
    """Distances by Coal between the hulls of a robot's shapes and boxes."""

    def __init__(self, robot: nmm.Robot, boxes: list[nmm.Obstacle]) -> None:
        self.model, self.data, self.shapes = robot.model, robot.model.createData(), query_shapes(robot)
        self.placed = pin.GeometryData(self.shapes)
        self.boxes = [
            (coal.Box(*one.shape.size), coal.Transform3s(*_rotation_and_translation(one))) for one in boxes
        ]
        self.request, self.result = coal.DistanceRequest(), coal.DistanceResult()

    def __call__(self, q: np.ndarray) -> np.ndarray:
        """Of each shape to the nearest box, (G,), m."""
        pin.updateGeometryPlacements(self.model, self.data, self.shapes, self.placed, q)
        distances = np.full(len(self.shapes.geometryObjects), np.inf)
        for i, shape in enumerate(self.shapes.geometryObjects):
            pose = coal.Transform3s(self.placed.oMg[i].rotation, self.placed.oMg[i].translation)
            for geometry, at in self.boxes:
                self.result.clear()
                d = coal.distance(shape.geometry, pose, geometry, at, self.request, self.result)
                distances[i] = min(distances[i], d)
        return distances


def _rotation_and_translation(obstacle: nmm.Obstacle) -> tuple[np.ndarray, np.ndarray]:
    pose = obstacle.placement(0.0)
    return pose[:3, :3], pose[:3, 3]


def processor_ms(call: Callable[[], object], times: int = 7) -> float:
    taken = []
    for _ in range(times):
        begin = time.process_time()
        call()
        taken.append(time.process_time() - begin)
    return 1e3 * float(np.median(taken))


def making(times: int) -> None:
    boxes = walled_door(np.random.default_rng(0), 0.9).obstacles

    def made(points: np.ndarray) -> object:
        return nmm.PointCloud(points, radius=0.02).shape.cells

    for count in (100_000, 300_000):
        points = scanned(boxes, np.random.default_rng(1), count).cloud.points
        window = points[np.abs(points[:, :2] - [2.0, 0.0]).max(axis=1) <= 2.0]
        single = points.astype(np.float32)
        for what, some in ((f"{count} points", points), ("as f32", single), ("in a 4 m window", window)):
            print(
                f"cloud, {what:18} {len(some):8} points {processor_ms(lambda p=some: made(p), times):8.1f} ms"
            )
    rng = np.random.default_rng(2)
    for edge in (400, 2_000):
        cells = np.where(rng.uniform(size=(edge, edge)) < 0.05, 100, 0)

        def mapped(cells: np.ndarray = cells) -> object:
            return nmm.OccupancyMap(cells, 0.05).shape.cells

        print(f"map, {edge} x {edge} cells {processor_ms(mapped, times):31.1f} ms")


def planned(scene: Scene, obstacles: list[nmm.Obstacle], seed: int) -> tuple[nmm.Plan | None, float]:
    """A plan, and the processor's time for it, s."""
    begin = time.process_time()
    try:
        plan = nmm.plan(
            *(scene.robot, scene.start, scene.goal, obstacles, nmm.Collisions(DISTANCE), LIMITS), seed=seed
        )
    except nmm.NmmError as error:
        print(f"  {seed}: {error}")
        return None, np.nan
    return plan, time.process_time() - begin


def doors(plans: int, seed: int) -> None:
    print(
        "door    points   found  of  on boxes   ms in the cloud   on boxes   ratio, its median   motions, s"
    )
    for width in (0.9, 0.7):
        for count in (100_000, 300_000):
            times, durations = [], []
            for k in range(plans):
                scene = walled_door(np.random.default_rng([seed, k]), width)
                cloud = scanned(scene.obstacles, np.random.default_rng([seed, k]), count).cloud
                cloud.shape.cells  # noqa: B018  # made now, not while plans are timed
                both = [planned(scene, among, k) for among in ([cloud], scene.obstacles)]
                times.append([s if plan else np.nan for plan, s in both])
                durations.append([plan.duration if plan else np.nan for plan, _ in both])
            t, found = np.array(times), np.isfinite(times).sum(axis=0)
            sensed, true = 1e3 * np.nanmedian(t, axis=0)
            print(
                f"{width:.1f} m {count:8} {found[0]:7} {plans:3} {found[1]:9} {sensed:17.0f} {true:10.0f} "
                f"{sensed / true:7.2f} {np.nanmedian(t[:, 0] / t[:, 1]):12.2f}   "
                + "{:.1f} {:.1f}".format(*np.nanmedian(durations, axis=0)),
                flush=True,
            )


def rooms(count: int, seed: int) -> None:
    found = on_boxes = kept = asked = 0
    spare, least, lost, times = [], [], [], []
    for k in range(count):
        rng = np.random.default_rng([seed, k, 1])
        scene = furnished(rng)
        scan = scanned(scene.obstacles, rng, POINTS)
        (plan, in_cloud), (other, among) = (
            planned(scene, obstacles, k) for obstacles in ([scan.cloud], scene.obstacles)
        )
        on_boxes += other is not None
        if plan is None:
            continue
        found += 1
        if other is not None:
            times.append([in_cloud, among])
        truth = Truth(scene.robot, scene.obstacles)
        known = nmm.Collisions(DISTANCE, obstacles=[scan.cloud], self_collisions=False).on(scene.robot)
        nearest = np.inf
        for i, q in enumerate(plan(np.linspace(0.0, plan.duration, TIMES))[0]):
            distances = truth(q)
            nearest = min(nearest, float(distances.min()))
            if i % 20 == 0:
                bounds = known.queries.distances(0.0, q, range(len(known.names)), 0.3)
                pairs = known.queries.scene.pairs[:, 0]
                near = distances[pairs] < 0.2
                lost += (distances[pairs] - bounds)[near].tolist()
        least.append(nearest)
        spare.append(nearest - (DISTANCE - scan.noise - scan.gap))
        kept += spare[-1] >= 0.0
        asked += nearest >= DISTANCE
    print(f"rooms: planned {found} of {count}, on the true boxes {on_boxes}")
    print(f"  true distance at least asked less noise and gap: {kept} of {found}, at least asked: {asked}")
    print("  least {:.1f} mm, median {:.1f}".format(*1e3 * np.percentile(least, [0.0, 50.0])))
    print(f"  to spare beside asked less noise and gap {1e3 * min(spare):.1f} mm at least")
    low, middle, high = 1e3 * np.percentile(lost, [0.1, 50.0, 99.0])
    print(f"  lost: {middle:.1f} mm, 0.1 % {low:.1f}, 99 % {high:.1f}, of {len(lost)} looks within 0.2 m")
    print("  ms in the cloud {:.0f}, on boxes {:.0f}".format(*1e3 * np.median(times, axis=0)))


def peak(file: str) -> None:
    """Plan in the cloud of a file, or among boxes where there is none, and print the process's peak, MB."""
    scene = walled_door(np.random.default_rng(0), 0.9)
    nmm.plan(
        *(scene.robot, scene.start, scene.goal),
        [nmm.PointCloud.load(file, radius=0.02)] if file else scene.obstacles,
        *(nmm.Collisions(DISTANCE), LIMITS),
    )
    # Not ru_maxrss, which begins with what the process had that started this one.
    status = Path("/proc/self/status").read_text()
    print(int(status.split("VmHWM:")[1].split()[0]) / 1024.0)


def memory() -> None:
    scene = walled_door(np.random.default_rng(0), 0.9)
    points = scanned(scene.obstacles, np.random.default_rng(1), 300_000).cloud.points
    with tempfile.TemporaryDirectory() as folder:
        file = f"{folder}/scan.npz"
        np.savez(file, points=points)
        boxes, cloud = (
            float(
                subprocess.run(
                    [sys.executable, __file__, "--peak", name], stdout=subprocess.PIPE, check=True
                ).stdout
            )
            for name in ("", file)
        )
    print(f"memory: {boxes:.0f} MB among boxes, {cloud - boxes:.0f} more in a cloud of 300,000 points")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("plans", type=int, nargs="?", default=20)
    parser.add_argument("rooms", type=int, nargs="?", default=100)
    parser.add_argument("seed", type=int, nargs="?", default=0)
    parser.add_argument("--short", action="store_true", help="four plans a door and five rooms")
    parser.add_argument("--only", nargs="+", choices=PARTS, default=PARTS)
    parser.add_argument("--peak", metavar="FILE", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.peak is not None:
        peak(given.peak)
        return
    few = (4, 5) if given.short else (given.plans, given.rooms)
    if {"doors", "rooms"} & {*given.only}:  # what is compiled once is no part of a plan
        scene = walled_door(np.random.default_rng(0), 0.9)
        for obstacles in (
            scene.obstacles,
            [scanned(scene.obstacles, np.random.default_rng(0), 20_000).cloud],
        ):
            planned(scene, obstacles, 0)
    for part in given.only:
        if part == "making":
            making(3 if given.short else 9)
        elif part == "memory":
            memory()
        elif part == "doors":
            doors(few[0], given.seed)
        else:
            rooms(few[1], given.seed)


if __name__ == "__main__":
    main()
