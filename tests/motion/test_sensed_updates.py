"""A cloud that is updated while a controller runs and a planner plans."""

from __future__ import annotations

import pickle
import threading
from collections.abc import Callable
from time import perf_counter

import numpy as np
import pytest
from scanned import door

import nmm
from nmm.base.arrays import Array
from nmm.base.errors import InputError
from nmm.base.kernels.pointers import address_of
from nmm.model.collisions.elements import Elements
from nmm.model.collisions.elements.field import transform

#: Three standard deviations of the noise of scans.
NOISE = 3 * 0.003


def scan(seed: int, x: float = 2.0) -> Array:
    """A wall without a door, as a scanner sees it."""
    rng = np.random.default_rng(seed)
    points = rng.uniform([x, -2.0, 0.0], [x, 2.0, 1.5], (30_000, 3))
    return points + rng.normal(0.0, 0.003, points.shape)


def driven(cloud: nmm.PointCloud) -> nmm.Controller:
    """A controller whose target is behind the wall."""
    return nmm.Controller(
        nmm.load("unicycle_3r"),
        nmm.Task(nmm.Position("ee", "xy"), [4.0, 0.0], speed=0.5),
        nmm.DampedLeastSquares(),
        collisions=nmm.Collisions(0.03, obstacles=[cloud]),
        limits=nmm.Limits(acceleration={"platform": 2.0, "arm": 8.0}),
        dt=0.02,
    )


def test_distances_are_kept_across_updates_at_10_hz() -> None:
    """Of the true wall, by Coal, at every sample. Nothing waits for the cells, as in a robot's loop, except
    once in 2 s: these samples follow each other faster than a robot's, and cells may take longer than all."""
    cloud = nmm.PointCloud(scan(0), radius=0.025, name="scan")
    controller = driven(cloud)
    robot = controller.robot
    wall = nmm.Obstacle(nmm.Box([0.02, 4.0, 1.5]), [2.01, 0.0, 0.75], name="true")
    true = nmm.Collisions(0.03, self_collisions=False, obstacles=[wall]).on(robot).queries
    scans = [scan(seed) for seed in range(1, 5)]
    q, least = robot.q({"q1": 0.3, "q2": 0.6}), np.inf
    held = [cloud.shape]
    for k in range(700):
        if k % 5 == 0:
            cloud.update(scans[k // 5 % 4], wait=k % 100 == 50)
        q, _ = controller.step(0.02 * k, q, 0.02, "zoh")
        least = min(least, true.nearest(0.0, q)[0])
        if cloud.shape is not held[-1]:
            held.append(cloud.shape)
    assert len(held) > 7
    assert 0.03 - NOISE <= least < 0.1


def test_a_controller_takes_new_points_at_its_next_sample() -> None:
    """The wall comes nearer by 0.3 m: the robot stops before where it is now."""
    cloud = nmm.PointCloud(scan(0), radius=0.025, name="scan")
    controller = driven(cloud)
    robot = controller.robot
    q = robot.q({"q1": 0.3, "q2": 0.6})
    for k in range(700):
        if k == 50:
            cloud.update(scan(1, x=1.7), wait=True)
        q, _ = controller.step(0.02 * k, q, 0.02, "zoh")
    wall = nmm.Obstacle(nmm.Box([0.02, 4.0, 1.5]), [1.71, 0.0, 0.75], name="true")
    true = nmm.Collisions(0.03, self_collisions=False, obstacles=[wall]).on(robot).queries
    assert 0.03 - NOISE <= true.nearest(0.0, q)[0] < 0.1


def test_what_is_no_scan_is_refused_and_the_earlier_points_stay() -> None:
    cloud = nmm.PointCloud(scan(0), radius=0.025, name="scan")
    shape = cloud.shape
    with pytest.raises(InputError, match="shape"):
        cloud.update(np.zeros((3, 2)))
    with pytest.raises(InputError, match="finite"):
        cloud.update(np.full((3, 3), np.nan), wait=True)
    assert cloud.shape is shape
    cloud.update(np.full((3, 3), np.nan))
    worker = cloud._worker
    if worker is not None:
        worker.join()
    with pytest.raises(InputError, match="finite"):
        cloud.update(scan(1), wait=True)
    assert cloud.shape is not shape
    cloud.update(scan(2), wait=True)
    again = pickle.loads(pickle.dumps(cloud))
    assert np.array_equal(again.points, scan(2))
    again.update([[1.0, 0.0, 0.0]], wait=True)
    assert len(again.points) == 1


def test_an_updated_cloud_is_what_a_new_one_would_be() -> None:
    points = scan(3)
    points[::7] = np.nan
    cloud = nmm.PointCloud(scan(0), radius=0.025)
    cloud.update(points, wait=True)
    fresh = nmm.PointCloud(points, radius=0.025)
    assert cloud.left_out == fresh.left_out > 0
    assert np.array_equal(cloud.points, fresh.points)
    ours, theirs = cloud.shape, fresh.shape
    assert isinstance(ours, Elements)
    assert isinstance(theirs, Elements)
    assert np.array_equal(ours.box, theirs.box)
    for array, other in zip(ours.cells, theirs.cells, strict=True):
        assert np.array_equal(array, other)
        assert array.dtype == other.dtype


def rolling(k: int) -> tuple[Array, list[float]]:
    """A costmap of 4 x 4 m about a robot that has gone k cells, and its origin: a wall at x = 2, a post."""
    first = np.array([-1.0 + 0.05 * k, -2.0])
    cells = np.zeros((80, 80), dtype=np.int8)
    column = 60 - k
    cells[:, column] = 100
    cells[10, 20 + k % 7] = 100
    return cells, [*first, 0.0]


@pytest.mark.parametrize("yaw", [0.0, 0.7])
def test_an_updated_map_is_what_a_new_one_would_be(yaw: float) -> None:
    robot = nmm.load("unicycle_3r")
    turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])

    def placed(k: int) -> tuple[Array, list[float]]:
        cells, origin = rolling(k)
        return cells, [*turn @ origin[:2], yaw]

    costmap = nmm.OccupancyMap(*_map(placed(0)), height=1.0, name="costmap")
    collisions = nmm.Collisions(0.03, obstacles=[costmap], self_collisions=False).on(robot)
    for k in (3, 11):
        cells, origin = placed(k)
        costmap.update(cells, origin, wait=True)
        fresh = nmm.OccupancyMap(cells, 0.05, origin, height=1.0, name="costmap")
        new = nmm.Collisions(0.03, obstacles=[fresh], self_collisions=False).on(robot)
        collisions.queries.renew()
        for q in np.random.default_rng(k).uniform(-1.0, 1.5, (40, robot.n)):
            assert collisions.queries.nearest(0.0, q)[0] == pytest.approx(
                new.queries.nearest(0.0, q)[0], abs=1e-9
            )
        assert costmap.cell_of(0.3, 0.4) == fresh.cell_of(0.3, 0.4)
        assert np.array_equal(costmap.origin, fresh.origin)
    with pytest.raises(InputError, match="yaw"):
        costmap.update(cells, [0.0, 0.0, yaw + 0.1])
    with pytest.raises(InputError, match="cells"):
        costmap.update(np.full((3, 3), 101))


def _map(cells_and_origin: tuple[Array, list[float]]) -> tuple[Array, float, list[float]]:
    return cells_and_origin[0], 0.05, cells_and_origin[1]


def test_cells_and_heights_are_updated_as_made_anew() -> None:
    rng = np.random.default_rng(2)
    voxels = nmm.VoxelMap(rng.random((9, 8, 7)) < 0.4, 0.1, name="rack")
    ground = nmm.ElevationMap(rng.random((9, 8)), 0.1, name="ground")
    occupied, heights = rng.random((12, 5, 7)) < 0.4, rng.random((7, 11))
    voxels.update(occupied, [1.0, 2.0, 0.5], wait=True)
    ground.update(heights, [1.0, 2.0], wait=True)
    others = nmm.VoxelMap(occupied, 0.1, [1.0, 2.0, 0.5]), nmm.ElevationMap(heights, 0.1, [1.0, 2.0])
    for updated, fresh in zip((voxels, ground), others, strict=True):
        ours, theirs = updated.shape, fresh.shape
        assert isinstance(ours, Elements)
        assert isinstance(theirs, Elements)
        for array, other in zip(ours.cells, theirs.cells, strict=True):
            assert np.array_equal(array, other)
    with pytest.raises(InputError, match="occupied"):
        voxels.update(np.zeros((2, 2)))
    with pytest.raises(InputError, match="heights"):
        ground.update(np.zeros(3))


def test_where_nothing_is_seen_any_more_nothing_is() -> None:
    """A plan is then the one without obstacles, also where axes are tilted; later it is there again."""
    robot = nmm.load("unicycle_3r")
    start, goal = {"x": 0.3, "y": -0.9, "q1": 0.5}, {"x": 4.0, "y": 0.6, "theta": 0.0}
    wall = np.zeros((120, 60), dtype=int)
    wall[:, 40:42] = 100
    wall[64:86, 40:42] = 0
    seen = [
        (nmm.PointCloud(door(8000, 0), radius=0.03, name="seen"), door(8000, 0), np.zeros((0, 3))),
        (nmm.OccupancyMap(wall, 0.05, [0.0, -3.0, 0.0], name="seen"), wall, np.zeros((5, 5), dtype=int)),
        (
            nmm.VoxelMap(wall.T[:, :, None] > 0, 0.05, [0.0, -3.0, 0.0]),
            wall.T[:, :, None] > 0,
            wall[:, :, None] < 0,
        ),
    ]
    tilted = np.array(
        [[0.0, 0.0, 1.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
    )
    points = door(8000, 0) @ tilted[:3, :3]
    seen.append((nmm.PointCloud(points, 0.03, "seen", tilted), points, np.zeros((0, 3))))
    heights = np.where(wall.T > 0, 1.0, -0.2)
    seen.append((nmm.ElevationMap(heights, 0.05, [0.0, -3.0]), heights, np.full((3, 4), np.nan)))
    free = nmm.plan(robot, start, goal, [])
    for obstacle, full, nothing in seen:
        planner = nmm.Planner(robot, [obstacle])
        through = planner.plan(start, goal)
        assert through.duration > 1.01 * free.duration
        obstacle.update(nothing, wait=True)
        empty = obstacle.shape
        obstacle.update(nothing, wait=True)
        assert obstacle.shape is empty
        assert len(getattr(obstacle, "points", [])) == 0
        assert planner.plan(start, goal).duration == pytest.approx(free.duration, rel=1e-6)
        obstacle.update(full, wait=True)
        assert planner.plan(start, goal).duration == pytest.approx(through.duration, rel=1e-6)


def test_a_map_stays_where_it_was_asked_for_last() -> None:
    """Also where the cells that came with that origin were left out for newer ones."""
    costmap = nmm.OccupancyMap(np.full((40, 40), 100), 0.05)
    for k in range(20):
        costmap.update(np.full((40, 40), 100), [0.1 * k, 0.0, 0.0])
    costmap.update(np.full((2, 2), 100), wait=True)
    assert costmap.origin[0] == pytest.approx(1.9)
    assert costmap.cell_of(1.91, 0.01) == (0, 0)


def test_a_planner_keeps_off_a_cloud_as_it_is_now() -> None:
    robot = nmm.load("unicycle_3r")
    start, goal = {"x": 0.3, "y": -0.9, "q1": 0.5}, {"x": 4.0, "y": 0.6, "theta": 0.0}
    cloud = nmm.PointCloud(door(8000, 0), radius=0.03, name="wall")
    planner = nmm.Planner(robot, [cloud])
    through = planner.plan(start, goal)
    aside = door(8000, 1) + np.array([0.0, 1.5, 0.0])
    cloud.update(aside, wait=True)
    moved = planner.plan(start, goal)
    fresh = nmm.plan(robot, start, goal, [nmm.PointCloud(aside, radius=0.03, name="wall")])
    assert moved.duration == fresh.duration != through.duration
    planner.update({"wall": [0.0, -1.5, 0.0]})
    (kept,) = planner.obstacles
    assert isinstance(kept, nmm.PointCloud)
    assert kept.radius == 0.03
    assert np.allclose(cloud.placement(0.0)[:3, 3], 0.0)
    again = planner.plan(start, goal)
    q, _ = again(np.linspace(0.0, again.duration, 300))
    assert np.abs(q[np.abs(q[:, 0] - 2.0) < 0.05][:, 1]).max() < 0.45


def standing(call: Callable[[], object]) -> float:
    """How long this thread stands at once while another calls something, as a share of the call's time."""
    began, ended, seen = [], [], [perf_counter()]

    def make() -> None:
        began.append(perf_counter())
        call()
        ended.append(perf_counter())

    thread = threading.Thread(target=make)
    thread.start()
    while not ended:
        now = perf_counter()
        if now > seen[-1] + 1e-4:
            seen.append(now)
    thread.join()
    (first,), (last,) = began, ended
    during = [now for now in seen if first < now < last]
    return float(np.diff([first, *during, last]).max() / (last - first))


def test_other_threads_run_while_a_field_is_made() -> None:
    """A call that holds Python's lock, as a sum of integers does, lets this thread stand to its end."""
    shape = (200, 200, 100)
    counts, cell, work = np.array(shape, dtype=np.int64), np.full(3, 0.05), np.empty((4, 201))
    field = np.empty(shape, dtype=np.float32)

    def make() -> None:
        transform(address_of(field), counts, cell, work, 1.0)

    shares = []
    while len(shares) < 6 and min(shares[1:], default=1.0) > 0.5:  # a busy machine may let it stand, too
        field[:] = np.inf
        field[::20, ::20, ::20] = 0.0
        shares.append(standing(make))  # the first may compile or read what is compiled
    assert min(shares[1:]) <= 0.5
    assert max(standing(lambda: sum(range(10_000_000))) for _ in range(2)) > 0.5


def test_a_horizon_looks_at_a_map_that_turns_where_it_will_be() -> None:
    robot = nmm.load("unicycle_3r")
    beam = nmm.OccupancyMap(np.full((2, 60), 100), 0.05, [0.0, 0.0, 0.0], height=0.5, name="beam")
    task = nmm.Task(nmm.Position("ee", "xy"), [-3.0, 0.0])
    collisions = nmm.Collisions(0.03, self_collisions=False, obstacles=[beam])
    horizon = nmm.Horizon(robot, task, collisions, dt=0.1)
    beam.move_to([2.0, 0.0, 0.0], [0.1, 0.0, 0.0, 0.0, 0.0, 0.3])
    horizon._place_movers(0.0)
    for time, track in zip(horizon._times, horizon._x.tracks[:, 0], strict=True):
        placed = beam.going_on(0.0).placement(float(time))
        assert np.allclose(track[:9].reshape(3, 3).T, placed[:3, :3])
        assert np.allclose(track[9:], placed[:3, 3])
        assert np.arctan2(placed[1, 0], placed[0, 0]) == pytest.approx(0.3 * time)
    # Its far end is 3 m from where it turns.
    assert horizon._x.drift.max() >= 0.3 * 3.0 * np.diff(horizon._times).max()


def test_an_obstacle_that_is_set_goes_on_as_it_turns() -> None:
    beam = nmm.Obstacle(nmm.Box([3.0, 0.1, 0.5]), [1.0, 0.0, 0.0], name="beam")
    beam.move_to([1.0, 0.0, 0.0], [0.0, 0.2, 0.0, 0.0, 0.0, 0.3])
    later = beam.going_on(2.0).placement(4.0)
    assert np.allclose(later[:3, 3], [1.0, 0.4, 0.0])
    assert np.arctan2(later[1, 0], later[0, 0]) == pytest.approx(0.6)
