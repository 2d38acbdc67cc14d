"""Lower bounds of distances and motions that surely keep them, against Coal."""

import numpy as np
import pytest

import nmm
from nmm.base.kernels.kinematics import axes, place_joints
from nmm.base.kernels.record_layout import views
from nmm.model.collisions.pairs import random_configurations
from nmm.model.collisions.separation import CLOSE
from nmm.model.robots.zero_order_hold import HeldInputs
from nmm.plugins.planning.collisions.legs_check import (
    MovedShapes,
    along,
    approach,
    begin_motion,
    bend,
    look,
    pair_bound,
    speed_towards,
)
from nmm.plugins.planning.collisions.motion_check import MotionCheck

SHAPES = {
    "box": (nmm.Box([0.3, 0.8, 1.0]), [1.6, 0.2, 0.5, 0.2, 0.1, 0.4]),
    "sphere": (nmm.Sphere(0.3), [1.2, -0.8, 0.6]),
    "cylinder": (nmm.Cylinder(0.2, 0.9), [-0.9, 0.9, 0.5, 0.4, 0.0, 0.0]),
    "capsule": (nmm.Capsule(0.1, 0.6), [-1.1, -0.5, 0.8, 0.0, 1.2, 0.0]),
    "ground": (nmm.HalfSpace([0.1, 0.0, 1.0]), [0.0, 0.0, -0.5]),
    "hull": (nmm.Hull(np.random.default_rng(5).normal(size=(40, 3)) * 0.2), [0.2, 1.4, 0.9]),
}


@pytest.fixture(
    scope="module", params=["unicycle_3r", pytest.param("tiago_pose", marks=pytest.mark.thorough)]
)
def scene(request):
    robot = (
        nmm.load(request.param)
        if request.param == "unicycle_3r"
        else nmm.Scenario.load(request.param).robot()
    )
    obstacles = [nmm.Obstacle(shape, place, name=name) for name, (shape, place) in SHAPES.items()]
    return nmm.Collisions(0.03, obstacles=obstacles).on(robot)


def test_bounds_are_below_distances_and_near_them(scene):
    check = MotionCheck(scene.robot, scene)
    shapes, pairs = views(MovedShapes, *check.blocks, 0), range(len(scene.names))
    joints = np.zeros((len(shapes.joints.parent), 12))
    for q in random_configurations(scene.robot, 60, seed=1):
        place_joints(shapes.joints, q, joints)
        exact = scene.queries.distances(0.0, q, pairs)
        bound = np.array([pair_bound(shapes, joints, k, np.inf, 0.0) for k in pairs])
        apart = exact > 0.0
        assert np.all(bound[apart] <= exact[apart] + 1e-6)
        # The closeness is of the cores, without the radii about them.
        assert np.all(bound[apart] >= exact[apart] - CLOSE * (exact[apart] + 0.5) - 1e-3)
        assert np.all(bound[exact < -1e-4] <= 0.0)
        for enough in (0.05, 0.5):
            rough = np.array([pair_bound(shapes, joints, k, enough, 0.0) for k in pairs])
            assert np.all(rough[apart] <= exact[apart] + 1e-6)
            assert np.all(rough[exact > enough + CLOSE * (exact + 0.5) + 1e-3] >= enough)


def test_legs_that_are_free_keep_their_distances_everywhere(scene):
    """Coal looks at 100 places along each; some legs are blocked and some free, or the test says nothing."""
    robot, pairs = scene.robot, range(len(scene.names))
    check, rng = MotionCheck(robot, scene), np.random.default_rng(3)
    found = {True: 0, False: 0}
    planar, table = int(robot.platform.n_p >= 3), robot.following.table.ravel()
    for q in random_configurations(robot, 400, seed=2):
        if check.too_near(q) >= 0:
            continue
        leg = np.concatenate([rng.normal(0.0, 0.1, 3), np.zeros(3), rng.normal(0.0, 0.15, robot.n - 3)])
        leg[3:] = robot.following.placed(leg[3:]) - robot.following.placed(np.zeros(robot.n))
        free = check.blocked(q, leg[np.newaxis]) < 0
        found[free] += 1
        if free:
            here = np.empty_like(q)
            for share in np.linspace(0.0, 1.0, 100):
                along(planar, q, leg, share, table, here)
                assert scene.queries.distances(0.0, here, pairs).min() >= 0.03
        if min(found.values()) >= 8:
            break
    assert min(found.values()) >= 5


def test_pairs_come_nearer_no_faster_than_their_speed_and_its_change_say(scene):
    """distance(s) >= distance(0) - speed s - bend s² / 2, by Coal, and near it: a speed that were too large
    would be no news."""
    robot, rng = scene.robot, np.random.default_rng(4)
    check = MotionCheck(robot, scene)
    shapes, pairs = views(MovedShapes, *check.blocks, 0), range(len(scene.names))
    joints, twists = np.zeros((len(shapes.joints.parent), 12)), np.zeros((len(shapes.joints.parent), 6))
    table, here, gained = robot.following.table.ravel(), np.empty(robot.n), []
    for q in random_configurations(robot, 12, seed=6):
        leg = np.concatenate([rng.normal(0.0, 0.4, 3), np.zeros(3), rng.normal(0.0, 0.6, robot.n - 3)])
        leg[3:] = robot.following.placed(leg[3:]) - robot.following.placed(np.zeros(robot.n))
        place_joints(shapes.joints, q, joints)
        axes(shapes.joints, joints, twists)
        apart = np.array([pair_bound(shapes, joints, k, np.inf, 0.0) for k in pairs])
        speed = np.array([speed_towards(shapes, q, leg, joints, twists, k) for k in pairs])
        change = np.array([bend(shapes, k, leg) for k in pairs])
        for share in (0.01, 0.1, 0.4, 1.0):
            along(1, q, leg, share, table, here)
            left = scene.queries.distances(0.0, here, pairs) - (apart - speed * share)
            assert np.all(left[apart > 0.0] >= -0.5 * change[apart > 0.0] * share**2 - 1e-6)
        gained.append(np.median(speed / [approach(shapes, k, leg, np.inf) for k in pairs]))
    assert np.median(gained) < 0.7


def test_along_a_wall_one_look_is_enough():
    robot = nmm.load("unicycle_3r")
    wall = nmm.Obstacle(nmm.Box([20.0, 0.2, 2.0]), [0.0, 0.6, 0.5], name="wall")
    check = MotionCheck(robot, nmm.Collisions(0.03, self_collisions=False, obstacles=[wall]).on(robot))
    shapes, leg = views(MovedShapes, *check.blocks, 0), np.zeros(3 + robot.n)
    leg[0] = 3.0
    until = []
    for steady in (1, 0):
        begin_motion(shapes, leg)
        joints = np.zeros((len(shapes.joints.parent), 12))
        until.append(look(shapes, robot.rest, leg, 0.0, joints, steady))
    assert until[0] >= 1.0
    assert 0.0 < until[1] < 0.5


def test_a_thin_wall_is_not_jumped_over():
    robot = nmm.load("unicycle_3r")
    thin = nmm.Obstacle(nmm.Box([0.001, 4.0, 2.0]), [1.0, 0.0, 0.5], name="paper")
    check = MotionCheck(robot, nmm.Collisions(0.0, obstacles=[thin]).on(robot))
    leg = np.zeros((1, 3 + robot.n))
    leg[0, 0] = 500.0
    start = robot.rest - [1.5, 0.0, 0.0, 0.0, 0.0, 0.0]
    assert check.blocked(start, leg) >= 0
    assert "paper" in check.scene.words(check.blocked(start, leg))


@pytest.mark.parametrize("turn", [0.0, 1e-12, 0.3, -2.0, 7.0])
def test_a_leg_is_what_held_inputs_make(turn):
    """A constant twist of a base that moves every way: the same as its inputs held, by fine steps."""
    robot = nmm.load("omni_base")
    q, leg = robot.q({"x": 0.3, "y": -0.2, "theta": 0.7}), np.zeros(3 + robot.n)
    leg[:3] = 0.4, -0.3, turn
    held, fine = HeldInputs(robot), q
    inputs = np.linalg.lstsq(robot.S(np.zeros(robot.n)), [*leg[:3], *np.zeros(robot.n - 3)], rcond=None)[0]
    for _ in range(1000):
        fine = held(fine, inputs, 1e-3)
    out = np.empty_like(q)
    along(1, q, leg, 1.0, robot.following.table.ravel(), out)
    assert np.allclose(out, fine, atol=1e-11)


def test_distances_of_the_start_are_kept_where_they_are_less(scene):
    check = MotionCheck(scene.robot, scene)
    near = next(
        q for q in random_configurations(scene.robot, 3000, seed=9) if 0.005 < _least(scene, q) < 0.025
    )
    assert check.too_near(near) >= 0
    check.keep(near[np.newaxis])
    assert check.too_near(near) < 0


def _least(scene, q):
    return float(scene.queries.distances(0.0, q, range(len(scene.names))).min())
