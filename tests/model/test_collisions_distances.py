"""Distances and their gradients, against analytic ones, sampled points and differences."""

import numpy as np
import pinocchio as pin
import pytest
from places import UR5

import nmm
from nmm.base.kernels.record_layout import Memory, views
from nmm.model.collisions.pairs import random_configurations
from nmm.model.collisions.rows import DistanceRows, no_rows


def rows_at(setting, t, q, most=60):
    """The rows of near pairs, as copies, and the least distance."""
    memory = Memory()
    memory.add(no_rows(setting.robot.n, most))
    blocks = memory.blocks()
    setting.queries.update(t, q, *blocks, 0)
    return views(DistanceRows, *blocks, 0), setting.queries.least


@pytest.fixture(scope="module")
def tiago():
    return nmm.Scenario.load("tiago_pose").robot()


@pytest.fixture(scope="module")
def planar():
    return nmm.load("unicycle_3r")


def test_a_sphere_and_a_box_are_as_far_apart_as_geometry_says(planar):
    """The caster is a sphere: its distance from a box is that of its centre, less its radius."""
    box = nmm.Obstacle(nmm.Box([0.4, 0.6, 0.8]), [1.0, 0.3, 0.5, 0.1, 0.2, 0.3], name="box")
    setting = nmm.Collisions(0.01, self_collisions=False, obstacles=[box]).on(planar)
    pair = next(k for k, names in enumerate(setting.names) if "caster" in names[0])
    shape = setting.queries.shapes.geometryObjects[int(setting.queries.scene.pairs[pair, 0])]
    data = planar.model.createData()
    for q in random_configurations(planar, 20, seed=3):
        pin.forwardKinematics(planar.model, data, q)
        center = data.oMi[shape.parentJoint].act(shape.placement).translation
        local = pin.SE3(box.placement(0.0)).actInv(center)
        outside = np.linalg.norm(np.maximum(np.abs(local) - [0.2, 0.3, 0.4], 0.0))
        (found,) = setting.queries.distances(0.0, q, [pair])
        if outside > shape.geometry.radius:
            assert found == pytest.approx(outside - shape.geometry.radius, abs=1e-7)


def test_no_pair_is_nearer_than_points_of_its_shapes(tiago):
    """Hulls hold their meshes: the distance is at most that of any two corners, and these are outside."""
    table = nmm.Obstacle(nmm.Box([0.8, 1.2, 0.04]), [0.9, 0.0, 0.6], name="table")
    setting = nmm.Collisions(obstacles=[table]).on(tiago)
    scene, queries = setting.queries.scene, setting.queries
    every = range(len(setting.names))
    for q in random_configurations(tiago, 5, seed=1):
        distances = queries.distances(0.0, q, every)
        for k, (i, j) in enumerate(scene.pairs.tolist()):
            clouds = []
            for shape in (i, j):
                first, last = scene.first_corner[shape : shape + 2]
                place = queries.found.oMg[shape]
                clouds.append(scene.corners[first:last] @ place.rotation.T + place.translation)
            if min(map(len, clouds)) == 0:
                continue
            apart = np.linalg.norm(clouds[0][:, np.newaxis] - clouds[1], axis=2).min()
            assert distances[k] <= apart - scene.rounding[i] - scene.rounding[j] + 1e-6


def test_lower_bounds_are_below_the_distances(tiago):
    plane = nmm.Obstacle(nmm.HalfSpace([0.1, 0.2, 1.0]), [0.0, 0.0, -0.5], name="slope")
    ball = nmm.Obstacle(nmm.Sphere(0.3), [0.5, 0.5, 0.8], name="ball")
    setting = nmm.Collisions(obstacles=[plane, ball]).on(tiago)
    for q in random_configurations(tiago, 20, seed=2):
        least, pair = setting.queries.nearest(0.0, q)
        bounds = setting.queries.scene.bounds.copy()
        distances = setting.queries.distances(0.0, q, range(len(setting.names)))
        assert np.all(bounds <= distances + 1e-7)
        # Depths are Coal's to its tolerance, 1e-6, and depend on where its search begins.
        assert least == pytest.approx(distances.min(), abs=2e-6)
        assert distances[pair] == pytest.approx(least, abs=2e-6)


def test_gradients_are_the_differences_of_the_distances(tiago):
    """Where distances are smooth: at nearly all configurations, by Coal's own tolerance."""
    box = nmm.Obstacle(nmm.Box([0.3, 0.3, 0.3]), [0.8, 0.2, 0.9, 0.3, 0.4, 0.5], name="box")
    setting = nmm.Collisions(obstacles=[box], band=0.3).on(tiago)
    h, errors = 1e-5, []
    for q in random_configurations(tiago, 25, seed=4):
        rows, _ = rows_at(setting, 0.0, q)
        used = int(rows.used)
        pairs, first = np.unique(rows.pair[:used], return_index=True)
        gradients = rows.d_q[first].copy()
        for c in range(tiago.n):
            step = h * np.eye(tiago.n)[c]
            ahead = setting.queries.distances(0.0, q + step, pairs)
            behind = setting.queries.distances(0.0, q - step, pairs)
            errors += [*np.abs((ahead - behind) / (2 * h) - gradients[:, c])]
    assert len(errors) > 1000
    assert np.quantile(errors, 0.95) < 1e-3
    assert np.quantile(errors, 0.5) < 1e-5


def test_an_obstacle_that_moves_changes_distances_at_its_rate(planar):
    turning = nmm.Obstacle(
        nmm.Box([0.2, 0.5, 0.6]),
        motion=lambda t: [1.0 - 0.3 * t, 0.1 * t, 0.3, 0.0, 0.0, 0.7 * t],
        name="door",
    )
    setting = nmm.Collisions(obstacles=[turning], self_collisions=False, band=1.0).on(planar)
    q, t, h = planar.q({"q1": 0.4, "q2": 0.3}), 0.4, 1e-5
    rows, _ = rows_at(setting, t, q)
    pairs, first = np.unique(rows.pair[: int(rows.used)], return_index=True)
    drift = rows.d_t[first].copy()
    ahead = setting.queries.distances(t + h, q, pairs)
    behind = setting.queries.distances(t - h, q, pairs)
    # Coal's gradients err by up to 1e-3, those of cylinders.
    np.testing.assert_allclose(drift, (ahead - behind) / (2 * h), atol=1e-3)
    assert np.abs(drift).max() > 0.1


def test_parallel_faces_have_a_row_at_each_end():
    """A forearm that lies along a wall keeps both of its ends off: nearest points jump, rows stay."""
    robot = nmm.load("unicycle_3r")
    wall = nmm.Obstacle(nmm.Box([6.0, 0.1, 2.0]), [0.0, 0.45, 0.5], name="wall")
    setting = nmm.Collisions(obstacles=[wall], self_collisions=False, distance=0.03, band=0.6).on(robot)
    away = setting.queries.nearest(0.0, robot.rest)[0]
    wall.move_to([0.0, 0.45 - away + 0.04, 0.5])
    for tilt in (-1e-7, 0.0, 1e-7):
        rows, least = rows_at(setting, 0.0, robot.q({"theta": tilt}))
        pair = int(rows.pair[int(np.argmin(rows.d[: int(rows.used)]))])
        own = np.flatnonzero(rows.pair[: int(rows.used)] == pair)
        along = rows.points[own, 0]
        assert len(own) >= 3
        assert np.ptp(along) > 0.05
        assert np.all(rows.d[own] >= least - 1e-9)


def test_rows_at_faces_do_not_depend_on_where_the_scene_is():
    """A normal along an axis of the world has two components, and a ring of corners has distances, that only
    rounding tells apart."""
    robot = nmm.mount("car_base", UR5, at="arm_mount", prefix="ur5_")
    arm = {"shoulder_pan": -0.2, "shoulder_lift": -1.04, "elbow": 1.21, "wrist_1": -1.61, "wrist_2": 1.24}
    posture = robot.q({f"ur5_{name}_joint": value for name, value in arm.items()} | {"x": 0.84, "theta": 0.1})
    rng = np.random.default_rng(0)
    looked_at = 0
    for _ in range(20):
        q = posture + np.concatenate([np.zeros(4), rng.uniform(-0.05, 0.05, 6)])
        scenes = []
        for x in (0.0, 5.0, 1e-13, 0.1, -3.7):
            box = nmm.Obstacle(nmm.Box([0.6, 0.4, 1.0]), [2.2 + x, 0.3, 0.5], name="box")
            setting = nmm.Collisions(0.03, False, [box]).on(robot)
            rows, _ = rows_at(setting, 0.0, q + x * np.eye(robot.n)[0])
            scenes.append(np.array(rows.points[: int(rows.used)]) - x * np.eye(9)[[0, 3]].sum(axis=0))
        looked_at += len(scenes[0]) > 3
        for points in scenes[1:]:
            assert points.shape == scenes[0].shape
            np.testing.assert_allclose(points, scenes[0], rtol=0.0, atol=1e-6)
    assert looked_at > 10


def test_centres_that_coincide_have_a_direction(planar):
    setting = nmm.Collisions(
        self_collisions=False, obstacles=[nmm.Obstacle(nmm.Sphere(0.05), name="ball")]
    ).on(planar)
    for link in ("caster", "link1"):
        pair = next(k for k, names in enumerate(setting.names) if link in names[0])
        q = planar.rest
        setting.queries.place(0.0, q)
        center = setting.queries.found.oMg[int(setting.queries.scene.pairs[pair, 0])].translation.copy()
        setting.obstacles[0].move_to(center)
        rows, _ = rows_at(setting, 0.0, q)
        k = int(np.flatnonzero(rows.pair[: int(rows.used)] == pair)[0])
        assert np.all(np.isfinite(rows.d_q[k]))
        assert np.linalg.norm(rows.points[k, 6:]) == pytest.approx(1.0)


def test_what_is_far_costs_no_query(planar):
    far = nmm.Obstacle(nmm.Box([1.0, 1.0, 1.0]), [9.0, 9.0, 0.5], name="far")
    setting = nmm.Collisions(self_collisions=False, obstacles=[far]).on(planar)
    rows, least = rows_at(setting, 0.0, planar.rest)
    assert int(rows.used) == 0
    assert least == np.inf
    assert not setting.queries.scene.active.any()


def test_a_look_at_the_nearest_pair_leaves_the_rows_right(planar):
    """Asked for the nearest pair in between, rows are those of where the obstacle is by now."""
    ball = nmm.Obstacle(nmm.Sphere(0.1), [0.9, 0.0, 0.3], name="ball")
    setting = nmm.Collisions(self_collisions=False, obstacles=[ball], band=0.5).on(planar)
    setting.queries.nearest(0.0, planar.rest)
    ball.move_to([0.8, 0.0, 0.3])
    rows, least = rows_at(setting, 0.0, planar.rest)
    pairs, first = np.unique(rows.pair[: int(rows.used)], return_index=True)
    np.testing.assert_allclose(rows.d[first], setting.queries.distances(0.0, planar.rest, pairs), atol=1e-6)
    assert least == pytest.approx(setting.queries.nearest(0.0, planar.rest)[0], abs=1e-6)
