"""The clearance objective: its gradient, where it is zero, what it sees ahead, and that robots turn away."""

import pickle

import numpy as np
import pytest
from findings import refused

import nmm
from nmm import Scenario
from nmm.base.errors import ScenarioError
from nmm.control.functions.program import Program
from nmm.model.collisions.pairs import random_configurations
from nmm.model.robots.configuration import Configuration
from nmm.model.robots.zero_order_hold import HeldInputs, RollingPreview


def obstacles():
    return [
        nmm.Obstacle(nmm.Box([0.3, 0.6, 1.0]), [1.6, 0.0, 0.5], name="box"),
        nmm.Obstacle(nmm.Sphere(0.3), [-1.0, 1.0, 0.3], name="sphere"),
        nmm.Obstacle(nmm.Cylinder(0.3, 1.0), [-1.0, -2.0, 0.5], name="cylinder"),
    ]


@pytest.fixture(scope="module")
def robots():
    return {
        "unicycle": nmm.load("unicycle_3r"),
        "car": nmm.mount("car_base", "small_arm"),
        "omni": nmm.mount("omni_base", "small_arm"),
    }


@pytest.mark.parametrize("name", ["unicycle", "car", "omni"])
def test_the_gradient_is_that_of_differences(robots, name):
    robot = robots[name]
    clearance = nmm.Clearance(nmm.Collisions(obstacles=obstacles()), reach=1.0, ahead=0.8)
    program = Program(robot, [clearance])
    program.lay_out()
    h, off = 1e-5, []
    for q in random_configurations(robot, 40, seed=4):
        q[:2] *= 0.5
        found = program.evaluate(0.0, q)[0]
        behind, ahead = (
            np.array([program.evaluate(0.0, q + side * h * one)[0].value[0] for one in np.eye(robot.n)])
            for side in (-1.0, 1.0)
        )
        if found.value[0] == 0.0:
            assert not found.value_q.any()
            continue
        size = max(1.0, np.abs(found.value_q).max())
        off.append(np.abs((ahead - behind) / (2.0 * h) - found.value_q[0]).max() / size)
    assert len(off) >= 30
    # Where shapes are curved, Coal's normals are right to 1e-4.
    assert np.median(off) < 1e-5
    assert max(off) < 1e-3


def test_a_moving_obstacle_changes_it_in_time(robots):
    moving = nmm.Obstacle(nmm.Sphere(0.2), motion=lambda t: [1.0 - 0.2 * t, 0.3, 0.5], name="ball")
    clearance = nmm.Clearance(nmm.Collisions(obstacles=[moving]))
    program = Program(robots["unicycle"], [clearance])
    program.lay_out()
    q = robots["unicycle"].q({"q2": 0.5, "q3": 0.9})
    found, h = program.evaluate(0.3, q)[0], 1e-5
    rate = (program.evaluate(0.3 + h, q)[0].value - program.evaluate(0.3 - h, q)[0].value) / (2.0 * h)
    assert found.value_t == pytest.approx(rate, rel=1e-4)


def test_it_is_nothing_beyond_reach_and_half_at_the_distance():
    """A ball over the caster, straight above the arm's hand: one pair is near."""
    robot = nmm.load("unicycle_3r")
    ball = nmm.Obstacle(nmm.Sphere(0.1), [-1.0, 0.0, 0.1], name="ball")
    collisions = nmm.Collisions(0.05, self_collisions=False, obstacles=[ball])
    clearance = nmm.Clearance(collisions, reach=0.1, ahead=0.0)
    setting = collisions.on(robot)
    pairs = range(len(setting.names))
    values = []
    for x in np.linspace(-0.7, 0.0, 71):
        q = robot.q({"x": x, "q2": 0.5, "q3": 0.9})
        d = setting.queries.distances(0.0, q, pairs)
        expected = 0.5 * (np.maximum(1.0 - (d - 0.05) / 0.1, 0.0) ** 2).sum()
        values.append(clearance.value(Configuration(robot, q)))
        assert values[-1] == pytest.approx(expected, abs=1e-9)
    assert values[-1] == 0.0
    assert values[0] > 0.1


@pytest.mark.parametrize("name", ["unicycle", "car"])
def test_ahead_is_where_held_inputs_lead_and_its_derivative_is_that_of_differences(robots, name):
    robot = robots[name]
    ahead, held = RollingPreview(robot), HeldInputs(robot)
    assert ahead.rolls is (name == "car")
    n_p, h = robot.platform.n_p, 1e-6
    for q in random_configurations(robot, 10, seed=2):
        u = np.zeros(robot.n_u)
        u[: robot.platform.p] = ahead.up
        there, derivative = ahead(q, 1.0)
        fine = q
        for _ in range(100):
            fine = held(fine, u, 0.01)
        assert there == pytest.approx(fine, abs=1e-4)
        for j in range(n_p):
            one = np.eye(robot.n)[j]
            difference = (ahead(q + h * one, 1.0)[0] - ahead(q - h * one, 1.0)[0])[:n_p] / (2.0 * h)
            assert derivative[:, j] == pytest.approx(difference, abs=1e-8)
    assert not RollingPreview(nmm.mount("omni_base", "small_arm")).rolls


def test_what_is_ahead_on_the_left_turns_to_the_right(robots):
    for name, turned in (("unicycle", "theta"), ("car", "steering")):
        robot = robots[name]
        for side in (-1.0, 1.0):
            post = nmm.Obstacle(nmm.Cylinder(0.1, 1.0), [1.3, 0.25 * side, 0.5], name="post")
            here = nmm.Clearance(nmm.Collisions(obstacles=[post]), reach=0.3, ahead=1.0)
            slope = here.gradient(Configuration(robot, np.zeros(robot.n)))
            assert side * slope[robot.q_names.index(turned)] > 0.1


def test_a_car_drives_around_a_post_that_blocks_it_without(robots):
    robot = robots["car"]
    post = nmm.Obstacle(nmm.Cylinder(0.15, 1.6), [2.2, 0.1, 0.8], name="post")
    collisions = nmm.Collisions(self_collisions=False, obstacles=[post])
    posture = nmm.Quadratic(
        nmm.QuadraticTerm({"steering": 1, "q1": -1}),
        nmm.QuadraticTerm("q1", 0.0, 0.3),
        *(nmm.QuadraticTerm(joint, at) for joint, at in (("q2", 0.6), ("q3", 0.9), ("q4", 0.0), ("q5", 0.0))),
    )
    goal, held = np.array([4.6, 0.3]), HeldInputs(robot)
    for objective, reached in ((posture, False), (posture + 3.0 * nmm.Clearance(collisions), True)):
        controller = nmm.Controller(
            robot,
            nmm.Task(nmm.Position("gripper", "xy"), goal, gain=1.0, speed=0.5),
            nmm.ProjectedGradient(),
            objective,
            limits=nmm.Limits(
                {"v": 1.0, "steering_rate": 1.5, "arm": 1.0}, acceleration={"platform": 2.0, "arm": 8.0}
            ),
            dt=0.02,
            collisions=collisions,
        )
        q = robot.q({"q2": 0.6, "q3": 0.9})
        least, left = np.inf, [np.inf]
        while left[-1] > 0.01 and (len(left) < 200 or left[-150] - left[-1] > 0.02):  # until it stalls
            t = 0.02 * len(left)
            q = held(q, controller(t, q), 0.02)
            least = min(least, controller.solver.scene.queries.nearest(t, q)[0])
            hand = Configuration(robot, q).placement("gripper").translation
            left.append(float(np.linalg.norm(hand[:2] - goal)))
        assert (left[-1] < 0.01) is reached
        assert least >= collisions.distance - 1e-6


def test_a_scenario_hands_over_its_obstacles():
    scenario = Scenario.load("unicycle_3r_crossing", {"objective": "[{kind: clearance, weight: 2}]"})
    controller, robot = scenario.controller(), scenario.robot()
    ((weight, found),) = controller.given.objective.terms()
    assert weight == 2.0
    assert [one.name for one in found.collisions.obstacles] == ["cart"]
    assert found.value(Configuration(robot, robot.q({"x": 0.9, "q1": -1.2, "q2": 0.5, "q3": 0.9}))) > 0.0
    with refused("unicycle_3r_crossing.yaml: set objective.0: clearance", got=None, kind=ScenarioError):
        scenario.override("collisions", "null").controller()


def test_bad_input_is_told(robots):
    with refused("clearance: reach", got=0.0):
        nmm.Clearance(reach=0.0)
    with refused("clearance: collisions", got=3):
        nmm.Clearance(3)
    with refused("clearance", got=None):
        nmm.Clearance().stages(robots["unicycle"])


def test_a_copy_makes_its_shapes_anew(robots):
    robot = robots["unicycle"]
    clearance = nmm.Clearance(nmm.Collisions(self_collisions=False, obstacles=obstacles()[1:2]), reach=2.0)
    here = Configuration(robot, robot.q({"q2": 0.5}))
    value = clearance.value(here)
    assert value > 0.0
    objective = clearance.among(clearance.collisions)
    assert objective.value(here) == value
    assert clearance.__getstate__()["_setting"] is None
    assert pickle.loads(pickle.dumps(nmm.Clearance(reach=0.3))).reach == 0.3
