"""Plans that go on from where the robot is: what is kept, what is searched, and what is saved by it."""

import numpy as np
import pytest
from test_plans import BEHIND, LIMITS, WALL, check

import nmm


@pytest.fixture(scope="module")
def plans():
    robot = nmm.load("unicycle_3r")
    return [nmm.plan(robot, robot.rest, BEHIND, [WALL], limits=LIMITS, seed=seed) for seed in range(3)]


def beside(plan, share=0.4):
    """A little away from the wall, and turned."""
    (q,), _ = plan(share * plan.duration)
    q[:3] += -0.05 if q[0] < 3.0 else 0.05, 0.02 * np.sign(q[1]), 0.05
    return q


def ends_as(one, other):
    """Whether both end at a configuration, but for whole turns of the platform."""
    off = one.end - other.end
    off[2] = np.sin(0.5 * off[2])
    return np.abs(off).max() < 1e-9


def test_a_plan_that_is_free_is_kept_and_joined(plans):
    for plan in plans:
        q = beside(plan)
        on = nmm.replan(plan, q)
        check(on)
        assert np.array_equal(on.corners[0], q)
        assert ends_as(on, plan)
        assert on.motions < 0.5 * plan.motions
        assert on.postures == 0
        assert on.duration < 0.6 * plan.duration + 15.0


def test_a_robot_on_its_plan_has_the_rest_of_it(plans):
    plan = plans[0]
    t = 0.5 * plan.duration
    (q,), _ = plan(t)
    for on in (nmm.replan(plan, q), nmm.replan(plan, q, t=t)):
        assert on.duration < plan.duration - t + 3.0
        check(on)


@pytest.mark.thorough
def test_what_is_free_of_a_plan_spares_looks_at_motions():
    """Between two walls a post stands on the plan: the search begins with the parts that are free."""
    robot, spared, new = nmm.load("unicycle_3r"), list[int](), list[int]()
    places = {"one": (2.0, 1.5), "two": (4.0, -1.5)}
    walls = [nmm.Obstacle(nmm.Box([0.2, 5.0, 2.0]), [*at, 0.5], name=name) for name, at in places.items()]
    sides = {"north": (3.0, 4.1), "south": (3.0, -4.1)}
    walls += [nmm.Obstacle(nmm.Box([9.0, 0.2, 2.0]), [*at, 0.5], name=name) for name, at in sides.items()]
    ends = {"west": (-1.5, 0.0), "east": (7.5, 0.0)}
    walls += [nmm.Obstacle(nmm.Box([0.2, 8.0, 2.0]), [*at, 0.5], name=name) for name, at in ends.items()]
    for seed in range(8):
        plan = nmm.plan(robot, robot.rest, {**BEHIND, "theta": 0.0}, walls, limits=LIMITS, seed=seed)
        q, (x, y, *_) = plan(np.array([0.1, 0.55]) * plan.duration)[0]
        now = [*walls, nmm.Obstacle(nmm.Cylinder(0.15, 2.0), [x, y, 0.5], name="post")]
        on = nmm.replan(plan, q, now, seed=seed)
        check(on)
        assert any("post" in pair for pair in on.found.scene.names)
        assert ends_as(on, plan)
        spared.append(on.motions)
        new.append(nmm.plan(robot, q, plan.end, now, limits=LIMITS, seed=seed, shorten=50).motions)
    assert np.median(spared) < 0.5 * np.median(new)


def test_own_shapes_may_be_as_near_as_the_plan_has_them():
    """A UR5 folded until its upper arm is 30 mm from its mount, by way of a posture where it is farther: from
    there the plan's own end is reached, and however often it is planned anew nothing comes nearer."""
    ur5 = "package://example-robot-data/robots/ur_description/urdf/ur5_robot.urdf"
    robot = nmm.mount(nmm.load("differential_base", platform="unicycle"), nmm.load(ur5), prefix="ur5_")
    start = {"ur5_shoulder_lift_joint": -2.2, "ur5_elbow_joint": 2.0, "ur5_wrist_1_joint": -1.5}
    upright = {"x": 1.0, "y": 0.0, "theta": 0.0, "ur5_shoulder_lift_joint": -1.55, "ur5_elbow_joint": 1.55}
    folded = {"x": 3.0, "y": 0.0, "theta": 0.0, "ur5_shoulder_lift_joint": -2.65, "ur5_elbow_joint": 2.4}
    post = nmm.Obstacle(nmm.Cylinder(0.1, 1.0), [2.0, 1.5, 0.5], name="post")
    limits = nmm.Limits(velocity={"platform": 1.0, "arm": 1.5}, acceleration=2.0)
    on = plan = nmm.plan(robot, start, folded, [post], limits=limits, through=[upright])
    pair = "arm_mount", "ur5_upper_arm_link"
    stood = plan.corners[np.abs(plan.corners[:, 0] - 1.0).argmin()]
    for k in range(4):
        moved = nmm.Obstacle(post.shape, [2.0, 1.5 + 0.02 * k, 0.5], name="post")
        q = stood if k == 0 else on(0.1 * on.duration)[0][0]
        on = nmm.replan(on, q, [moved], seconds=3.0)
        check(on, limits=limits)
        assert ends_as(on, plan)
        assert on.found.nearer[pair] == pytest.approx(plan.found.nearer[pair], abs=1e-12)


def test_a_plan_of_a_plan_goes_on(plans):
    on = nmm.replan(plans[0], beside(plans[0], 0.3))
    again = nmm.replan(on, on(0.5 * on.duration)[0][0])
    assert ends_as(again, plans[0])
    assert again.duration < on.duration


def test_a_robot_pushed_out_of_its_tube_replans_and_arrives():
    """Pushed by 0.4 m and turned, on the way round a wall: a new plan goes on from there."""
    robot, dt, tube = nmm.load("unicycle_3r"), 0.02, (0.3, 0.5)
    kept = nmm.Collisions(0.03, obstacles=[WALL])
    plan = nmm.plan(robot, robot.rest, BEHIND, [WALL], nmm.Collisions(0.08), LIMITS)
    queries, pairs = plan.found.scene.queries, range(len(plan.found.scene.names))

    def followed(plan):
        task = plan.reference()
        given = {"limits": LIMITS, "collisions": kept, "dt": dt, "kinematics": "compiled"}
        return task, nmm.Controller(robot, task, nmm.ProjectedGradient(), **given)

    (task, controller), q, t, replanned, least = followed(plan), robot.rest, 0.0, 0, np.inf
    for k in range(5000):
        q, _ = controller.step(t, q, dt, "zoh")
        t += dt
        least = min(least, queries.distances(0.0, q, pairs).min())
        if k == 150:
            q[:3] += -0.4, 0.0, 0.8
        if np.any(task.function.apart([t], [q])[0] > tube):
            plan, t, replanned = nmm.replan(plan, q), 0.0, replanned + 1
            task, controller = followed(plan)
        if t > task.function.duration + 2.0:
            break
    assert replanned == 1
    assert least >= 0.03
    assert np.abs(q - plan.end).max() < 5e-3
    assert np.allclose(plan.end[:2], [6.0, 0.0], atol=1e-9)


def test_an_end_that_is_taken_is_another_posture_or_refused(plans):
    robot = plans[0].robot
    hand = nmm.Task(nmm.Position("ee", "xy"), [4.0, 1.0])
    plan = nmm.plan(robot, robot.rest, hand)
    x, y = plan.end[:2]
    post = nmm.Obstacle(nmm.Cylinder(0.1, 0.3), [x, y, 0.1], name="post")
    on = nmm.replan(plan, robot.rest, [post])
    check(on, limits=nmm.Limits())
    reached = nmm.Configuration(robot, on.end).placement("ee").translation[:2]
    assert np.linalg.norm(reached - [4.0, 1.0]) < 0.005
    assert np.abs(on.end - plan.end).max() > 0.05
    there = nmm.Obstacle(nmm.Cylinder(0.1, 0.3), [6.0, 0.0, 0.1], name="there")
    with pytest.raises(nmm.RunError, match="there"):
        nmm.replan(plans[0], robot.rest, [WALL, there])


@pytest.mark.parametrize(
    ("given", "where"),
    [
        ({"plan": 1.0}, "replan"),
        ({"q": {"z": 1.0}}, "robot unicycle_3r"),
        ({"q": {"x": 3.0}}, "replan: q"),
        ({"seconds": 0.0}, "seconds"),
        ({"t": np.nan}, "t"),
    ],
)
def test_bad_input_is_refused(plans, given, where):
    keywords = {"plan": plans[0], "q": plans[0].robot.rest, **given}
    with pytest.raises(nmm.InputError) as found:
        nmm.replan(**keywords)
    assert found.value.where.startswith(where)
