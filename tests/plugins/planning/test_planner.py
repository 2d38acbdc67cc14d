"""Plans that are prepared once: they are those of nmm.plan, also after their obstacles have moved."""

import numpy as np
import pytest

import nmm

WALL = nmm.Obstacle(nmm.Box([0.2, 4.0, 2.0]), [3.0, 0.0, 0.5], name="wall")
POST = nmm.Obstacle(nmm.Cylinder(0.2, 2.0), [1.5, 0.5, 1.0], name="post")
LIMITS = nmm.Limits(velocity={"v": 1.0, "omega": 1.5, "arm": 1.5}, acceleration=2.0)
START, BEHIND = {"q1": 0.5}, {"x": 6.0, "y": 0.0, "theta": 0.0}
REACHED = nmm.Task(nmm.Position("ee", "xy"), [5.0, 0.4])


def same(one, other):
    return np.array_equal(one.stops, other.stops) and np.array_equal(one.corners, other.corners)


@pytest.fixture(scope="module")
def robot():
    return nmm.load("unicycle_3r")


@pytest.mark.parametrize("goal", [BEHIND, REACHED, [REACHED, BEHIND]])
def test_a_planners_plans_are_those_of_plan_in_any_order(robot, goal):
    planner = nmm.Planner(robot, [WALL, POST], limits=LIMITS)
    seeds = (3, 0, 3)
    made = [planner.plan(START, goal, seed=seed) for seed in seeds]
    for seed, one in zip(seeds, made, strict=True):
        assert same(one, nmm.plan(robot, START, goal, [WALL, POST], limits=LIMITS, seed=seed))
    assert not same(made[0], made[1])


@pytest.mark.parametrize(
    ("smooth", "margin", "through"), [(True, 0.0, ()), (False, 0.1, ()), (False, 0.0, [{"x": 1.0, "y": 3.0}])]
)
def test_options_are_those_of_plan(robot, smooth, margin, through):
    options = {"limits": LIMITS, "smooth": smooth, "margin": margin}
    planner = nmm.Planner(robot, [WALL], **options)
    planner.plan(START, REACHED)
    one = planner.plan(START, BEHIND, through=through)
    assert same(one, nmm.plan(robot, START, BEHIND, [WALL], through=through, **options))
    assert one.smooth == smooth


def test_after_an_update_plans_are_those_of_a_new_planner(robot):
    planner = nmm.Planner(robot, [WALL, POST], limits=LIMITS)
    before = planner.plan(START, BEHIND)
    kept = before.corners.copy()
    moved = nmm.Obstacle(WALL.shape, [3.5, 1.0, 0.5], name="wall")
    for update, obstacles in (
        ({"wall": [3.5, 1.0, 0.5]}, [moved, POST]),
        ([POST], [POST]),
        ([], []),
        ([WALL, POST, nmm.Obstacle(nmm.HalfSpace(), name="floor")], None),
    ):
        planner.update(update)
        now = planner.obstacles if obstacles is None else obstacles
        other = nmm.Planner(robot, now, limits=LIMITS)
        assert same(planner.plan(START, BEHIND), other.plan(START, BEHIND))
    assert np.array_equal(before.corners, kept)


def test_what_is_left_out_beside_an_obstacle_is_what_is_left_out_where_it_stands():
    """A plate slid under the foot of an arm and out again: there it is nearer than asked whatever the arm
    does, which is no reason for the plans before and after to leave it out."""
    arm = nmm.load("package://example-robot-data/robots/ur_description/urdf/ur5_robot.urdf", platform="fixed")
    plate = nmm.Obstacle(nmm.Box([0.1, 0.1, 0.02]), [0.8, 0.0, 0.3], name="plate")
    ball = nmm.Obstacle(nmm.Sphere(0.05), [0.6, 0.3, 0.6], name="ball")
    planner = nmm.Planner(arm, [plate, ball])
    start = {"shoulder_lift_joint": -1.5, "elbow_joint": 1.2}
    left_out = []
    for at in ([0.8, 0.1, 0.3], [0.0, 0.0, -0.03], [0.0, 0.0, -0.02], [0.7, 0.0, 0.3, 0.3, 0.2, 0.1]):
        planner.update({"plate": at})
        moved = nmm.Obstacle(plate.shape, at, name="plate")
        one = planner.plan(start, {"shoulder_pan_joint": 0.8})
        other = nmm.plan(arm, start, {"shoulder_pan_joint": 0.8}, [moved, ball])
        assert same(one, other)
        assert one.found.scene.names == other.found.scene.names
        assert one.found.scene.notes == other.found.scene.notes
        left_out.append(sum("plate" in pair for pair in one.found.scene.names))
    assert left_out[0] == left_out[3] > left_out[1] == left_out[2]


def test_an_obstacle_that_is_moved_is_where_it_stands_now(robot):
    wall = nmm.Obstacle(nmm.Box([0.2, 4.0, 2.0]), [3.0, 0.0, 0.5], name="wall")
    planner = nmm.Planner(robot, [wall], limits=LIMITS)
    round_it = planner.plan(START, BEHIND)
    wall.move_to([3.0, 5.0, 0.5])
    straight = planner.plan(START, BEHIND)
    assert straight.duration < 0.8 * round_it.duration
    assert same(straight, nmm.plan(robot, START, BEHIND, [wall], limits=LIMITS))


def test_an_earlier_plan_is_replanned_among_its_own_obstacles(robot):
    planner = nmm.Planner(robot, [WALL], limits=LIMITS)
    plan = planner.plan(START, BEHIND)
    planner.update([])
    planner.plan(START, BEHIND)
    (half,), _ = plan(0.3 * plan.duration)
    on = nmm.replan(plan, half)
    assert [obstacle.name for obstacle in on.found.asked.collisions.obstacles] == ["wall"]
    q, _ = on(np.linspace(0.0, on.duration, 300))
    queries = on.found.scene.queries
    assert min(queries.nearest(0.0, one)[0] for one in q) > 0.029


def test_a_search_that_fills_its_first_room_goes_on(robot, monkeypatch):
    """As a plan of a search that had more room from the beginning."""
    from nmm.plugins.planning import prepared

    first = nmm.Planner(robot, [WALL, POST], limits=LIMITS)
    monkeypatch.setattr(prepared, "ROOM", 205)
    small = nmm.Planner(robot, [WALL, POST], limits=LIMITS)
    narrow = nmm.Planner(robot, [WALL, POST], limits=LIMITS)
    plans = [planner.plan(START, BEHIND, seed=2) for planner in (first, small, narrow, small)]
    assert all(same(plans[0], plan) for plan in plans[1:])
    assert len({plan.motions for plan in plans}) == 1
    assert np.allclose(plans[0].end[:2], (6.0, 0.0))


@pytest.mark.parametrize(("height", "near"), [(0.02, 0.0175), (0.001, 0.0)])
def test_what_begins_near_may_be_as_near_whatever_margin_and_parts(robot, height, near):
    """A plate beside the arm, nearer than the distance to keep: less what is looked at roughly, 0.5 mm."""
    q = robot.q(START)
    plate = nmm.Obstacle(nmm.Box([0.1, 0.1, 0.1]), [-3.0, 0.0, 0.5], name="plate")
    for _ in range(60):
        scene = nmm.Collisions(obstacles=[plate]).on(robot)
        apart = scene.queries.distances(0.0, q, range(len(scene.names))).min()
        plate.move_to(plate.at(0.0).translation + np.array([apart - height, 0.0, 0.0]))
    for options in ({}, {"margin": 0.1}):
        planner = nmm.Planner(robot, [plate], limits=LIMITS, **options)
        for through in ((), [{"x": 1.0, "y": 1.0}]):
            nearer = planner.plan(START, BEHIND, through=through).found.nearer
            assert min(nearer.values()) == pytest.approx(near, abs=1e-4)
            assert max(nearer.values()) < 0.03


@pytest.mark.parametrize(
    ("update", "words"),
    [
        ({"wal": [0, 0, 0]}, "wall"),
        ({"wall": [0, 0]}, "wall"),
        ([WALL, WALL], "name"),
        ([3.0], "Obstacle"),
    ],
)
def test_an_update_that_cannot_be_says_why_and_changes_nothing(robot, update, words):
    planner = nmm.Planner(robot, [WALL], limits=LIMITS)
    with pytest.raises(nmm.InputError, match=words):
        planner.update(update)
    assert planner.obstacles == (WALL,)


def test_what_a_planner_cannot_do_is_said_when_it_is_made(robot):
    with pytest.raises(nmm.InputError, match="limits"):
        nmm.Planner(robot, limits=3.0)
    with pytest.raises(nmm.InputError, match="smooth"):
        nmm.Planner(robot, objective=nmm.Manipulability("ee", "xy"))
    with pytest.raises(nmm.InputError, match="functions"):
        nmm.Planner(robot, limits=nmm.Limits(bounds=nmm.Bound(nmm.Position("ee", "x"), upper=3.0)))
