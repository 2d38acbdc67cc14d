"""Plans that are driven: what one input cannot do does not hold the others, and a run that does not end where
its plan does is missed."""

from functools import cache

import coal
import numpy as np
import pinocchio as pin
import pytest
from findings import codes, the

import nmm

UR5 = "package://example-robot-data/robots/ur_description/urdf/ur5_robot.urdf"
LIMITS = nmm.Limits(velocity={"v": 1.0}, acceleration={"platform": 4.0, "arm": 6.0})
POST = nmm.Obstacle(nmm.Cylinder(0.1, 2.0), [2.0, 0.0, 1.0], name="post")


@cache
def car(platform="car"):
    return nmm.load("car_base", platform=platform)


def driven(plan, replan=None, pace=0.8, seconds=3.0, limits=LIMITS, collisions=None, start=None):
    task = plan.reference(pace=pace, replan=replan)
    controller = nmm.Controller(
        plan.robot, task, nmm.ProjectedGradient(), limits=limits, collisions=collisions, dt=0.02
    )
    q0 = plan.corners[0] if start is None else start
    return nmm.simulate(controller, q0, plan.duration / pace + seconds, 0.02, "zoh")


def apart(q, pose):
    """m and rad from a pose of the platform, in closed form."""
    return float(np.hypot(*(q[:2] - pose[:2]))), float(abs(np.angle(np.exp(1j * (q[2] - pose[2])))))


@pytest.mark.parametrize("platform", ["car", "front_drive_car"])
@pytest.mark.parametrize("pose", [(0.0, 0.5, 0.0), (0.0, -1.5, 0.0), (1.2, 2.4, 2.0), (-2.0, 0.3, -2.5)])
def test_a_car_steers_at_its_stop_and_arrives(platform, pose):
    """Its plan turns at the least radius, where feedback may not ask for more: v goes on."""
    robot = car(platform)
    plan = nmm.plan(robot, robot.rest, dict(zip(["x", "y", "theta"], pose, strict=True)), limits=LIMITS)
    run = driven(plan)
    stop, steering = robot.q_limits[3], run.q[:, 3]
    assert np.abs(plan(np.linspace(0.0, plan.duration, 500))[0][:, 3]).max() > 0.99 * stop[1]
    m, rad = apart(run.q[-1], pose)
    assert m < 0.005
    assert rad < 0.02
    assert run.outcome is nmm.Outcome.COMPLETED
    assert steering.min() >= stop[0] - 1e-9
    assert steering.max() <= stop[1] + 1e-9
    changes = np.abs(np.diff(run.u, axis=0)) / 0.02
    assert changes.max(axis=0)[0] <= 4.0 + 1e-6
    assert np.abs(run.u[:, 0]).max() <= 1.0 + 1e-9


@pytest.fixture(scope="module")
def beside_its_mount():
    """A UR5 whose upper arm is 30 to 31 mm from its mount, with 30 mm kept, and a pillar in its way."""
    robot = nmm.mount(nmm.load("differential_base", platform="unicycle"), nmm.load(UR5), prefix="ur5_")
    posture = {"shoulder_lift": -2.0, "elbow": 2.0, "wrist_1": -1.5, "wrist_2": -1.57}
    start = {f"ur5_{name}_joint": value for name, value in posture.items()}
    pillar = nmm.Obstacle(nmm.Cylinder(0.15, 1.6), [1.6, 0.0, 0.8], name="pillar")
    limits = nmm.Limits(velocity={"v": 0.8, "omega": 1.5}, acceleration={"platform": 1.5, "arm": 6.0})
    task = nmm.Task(nmm.Position("ur5_tool0"), [3.0, 0.0, 0.8])
    kept = nmm.Collisions(0.03, obstacles=[pillar])
    plan = nmm.plan(robot, robot.q(start), task, (), kept, limits, margin=0.05)
    return plan, driven(plan, seconds=4.0, limits=limits, collisions=kept), kept


def placed_distance(robot, q, one, other):
    """Of two links, m, by Coal on the robot's shapes, of meshes their hulls, placed by Pinocchio."""
    shapes, data = robot.collision_model, robot.model.createData()
    placed = pin.GeometryData(shapes)
    pin.updateGeometryPlacements(robot.model, data, shapes, placed, q)
    least = np.inf
    links = [robot.model.frames[shape.parentFrame].name for shape in shapes.geometryObjects]
    for i in (i for i, link in enumerate(links) if link == one):
        for j in (j for j, link in enumerate(links) if link == other):
            bodies = []
            for k in (i, j):
                body = shapes.geometryObjects[k].geometry
                if isinstance(body, coal.BVHModelBase):
                    body.buildConvexHull(True, "Qt")
                    body = body.convex
                bodies += [body, coal.Transform3s(placed.oMg[k].rotation, placed.oMg[k].translation)]
            least = min(least, coal.distance(*bodies, coal.DistanceRequest(), coal.DistanceResult()))
    return least


def test_what_begins_near_to_itself_moves_on(beside_its_mount):
    """A plan may bring a pair that begins near 2 mm nearer, and so may the controller that follows it."""
    plan, run, _ = beside_its_mount
    robot = plan.robot
    model, q = robot.model, run.q[-1]
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    tool = data.oMf[model.getFrameId("ur5_tool0")].translation
    assert np.linalg.norm(tool - [3.0, 0.0, 0.8]) < 0.005
    assert run.outcome is nmm.Outcome.COMPLETED
    pair = "arm_mount", "ur5_upper_arm_link"
    begins = placed_distance(robot, run.q[0], *pair)
    assert 0.030 < begins < 0.0305
    assert min(placed_distance(robot, q, *pair) for q in run.q[::10]) > begins - 0.0025
    assert run.clearance_between.min() > begins - 0.0025


def test_a_controller_without_a_plan_keeps_what_is_asked(beside_its_mount):
    plan, _, kept = beside_its_mount
    task = nmm.Task(nmm.Posture("ur5_shoulder_lift_joint"), [-1.3])
    limits = nmm.Limits(acceleration=2.0)
    controller = nmm.Controller(
        plan.robot, task, nmm.ProjectedGradient(), limits=limits, collisions=kept, dt=0.02
    )
    run = nmm.simulate(controller, plan.corners[0], 2.0, 0.02, "zoh")
    assert run.clearance_between.min() > 0.03
    assert np.all(controller.solver.step_memory.clearance.distance == 0.03)


def test_a_run_that_its_obstacles_hold_back_is_missed():
    robot = nmm.load("unicycle_3r")
    limits = nmm.Limits(acceleration=1.0)
    plan = nmm.plan(robot, robot.rest, {"x": 4.0, "y": 0.0, "theta": 0.0}, limits=limits)
    run = driven(plan, limits=limits, collisions=nmm.Collisions(0.03, obstacles=[POST]))
    assert run.outcome is nmm.Outcome.MISSED
    left = the(run, "not_reached").values
    assert np.isclose(left["rad"], np.linalg.norm((run.q[-1] - plan.end)[2:]), atol=1e-9)
    assert left["m"] >= np.hypot(*(run.q[-1] - plan.end)[:2]) - 1e-9


def test_a_run_that_ends_before_its_plan_is_missed():
    robot = car()
    plan = nmm.plan(robot, robot.rest, {"x": 2.0, "y": 0.5, "theta": 0.0}, limits=LIMITS)
    run = driven(plan, seconds=-0.3 * plan.duration)
    assert run.outcome is nmm.Outcome.MISSED
    assert "not_reached" in codes(run)


def test_below_another_task_a_plan_need_not_be_reached():
    robot = nmm.load("unicycle_3r")
    plan = nmm.plan(robot, {"q2": 0.4}, {"x": 1.0, "y": 0.0, "theta": 0.0, "q1": 0.5}, limits=LIMITS)
    held = nmm.Task(nmm.LinearCoordinates("q1"), [0.0], gain=3.0)
    tasks = [held, plan.reference(priority=2)]
    controller = nmm.Controller(robot, tasks, nmm.ProjectedGradient(), kinematics="compiled")
    run = nmm.simulate(controller, plan.corners[0], plan.duration / 0.8 + 3.0, 0.02)
    assert abs(run.q[-1, 3] - 0.5) > 0.4
    assert "not_reached" not in codes(run)
