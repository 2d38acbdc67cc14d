"""Plans: every motion found is checked by Coal on the exact shapes, differences against S(q) u, and the
limits."""

import time

import numpy as np
import pytest
from places import PANDA, UR5
from sliding_arm import sliding

import nmm
from nmm.plugins.planning import words

LIMITS = nmm.Limits(velocity={"platform": 1.0, "arm": 1.5}, acceleration={"platform": 1.0, "arm": 3.0})
WALL = nmm.Obstacle(nmm.Box([0.2, 4.0, 2.0]), [3.0, 0.0, 0.5], name="wall")
BEHIND = {"x": 6.0, "y": 0.0, "theta": 0.5}


def check(plan, distance=0.03, limits=LIMITS, samples=150):
    """The plan keeps its distances (a start that is nearer keeps that, less 2 mm), S(q) u, and its limits."""
    robot, t = plan.robot, np.linspace(0.0, plan.duration, samples)
    q, u = plan(t)
    if plan.found.scene is not None:
        queries, pairs = plan.found.scene.queries, range(len(plan.found.scene.names))
        asked = np.minimum(distance, queries.distances(0.0, q[0], pairs) - 0.002)
        for one in q:
            assert np.all(queries.distances(0.0, one, pairs) >= asked)
    h = 1e-6
    inner = t[np.abs(t[:, np.newaxis] - plan.stops).min(axis=1) > 2.0 * h]
    here, u_here = plan(inner)
    (after, u_after), (before, u_before) = plan(inner + h), plan(inner - h)
    for rate, one, inputs in zip((after - before) / (2.0 * h), here, u_here, strict=True):
        assert np.allclose(rate, robot.S(one) @ inputs, rtol=0.0, atol=1e-8)
    on = limits.on(robot)
    assert np.all(u >= on.inputs[:, 0] - 1e-11)
    assert np.all(u <= on.inputs[:, 1] + 1e-11)
    assert np.all(np.abs(u_after - u_before) / (2.0 * h) <= on.accelerations + 1e-6)
    assert not any(robot.outside(one) for one in q)
    if plan.duration and np.isfinite(on.accelerations).all():
        assert np.allclose(u[[0, -1]], 0.0, atol=1e-12)  # at rest at both ends
        assert np.allclose(plan(plan.stops)[1], 0.0, atol=1e-6)  # and between legs


@pytest.fixture(scope="module")
def ur5_car():
    return nmm.mount(nmm.load("car_base"), nmm.load(UR5), prefix="ur5_")


# Words


def ahead(word):
    """Where a word of arcs and lines leads, by their geometry."""
    x = y = theta = 0.0
    for turn, length in word:
        if turn == 0.0:
            x, y = x + length * np.cos(theta), y + length * np.sin(theta)
        else:
            then = theta + turn * length
            x, y = x + turn * (np.sin(then) - np.sin(theta)), y - turn * (np.cos(then) - np.cos(theta))
            theta = then
    return x, y, theta


@pytest.mark.parametrize("words_of", [words.reeds_shepp, words.dubins])
def test_words_lead_where_they_should(words_of):
    rng, word = np.random.default_rng(0), np.zeros((words.PARTS, 2))
    for x, y, phi in rng.uniform([-4, -4, -np.pi], [4, 4, np.pi], (1000, 3)):
        length = words_of(x, y, phi, word)
        found = ahead(word)
        assert np.allclose(found[:2], (x, y), atol=1e-9)
        assert abs(np.sin(0.5 * (found[2] - phi))) < 1e-9
        assert np.isclose(np.abs(word[:, 1]).sum(), length)
        if words_of is words.dubins:
            assert np.all(word[:, 1] >= 0.0)


def test_no_word_is_longer_than_what_goes_another_way():
    """Shortest ways obey the triangle inequality, are as long when reversed, and reversing does not make them
    longer."""
    rng = np.random.default_rng(1)
    word = np.zeros((words.PARTS, 2))

    def length(a, b, words_of=words.reeds_shepp):
        c, s = np.cos(a[2]), np.sin(a[2])
        d = b - a
        return words_of(c * d[0] + s * d[1], c * d[1] - s * d[0], d[2], word)

    for _ in range(2000):
        a, b, c = rng.uniform([-3, -3, -np.pi], [3, 3, np.pi], (3, 3))
        whole = length(a, c)
        assert whole <= length(a, b) + length(b, c) + 1e-9
        assert np.isclose(whole, length(c, a), atol=1e-9)
        assert whole <= length(a, c, words.dubins) + 1e-9
        assert whole >= np.hypot(*(c - a)[:2]) - 1e-9


@pytest.mark.parametrize("words_of", [words.reeds_shepp, words.dubins])
def test_no_other_motion_is_shorter(words_of):
    """Random motions of up to six arcs and lines end somewhere: the word to there is no longer than they
    are."""
    rng, word = np.random.default_rng(2), np.zeros((words.PARTS, 2))
    least = -1.0 if words_of is words.reeds_shepp else 0.0
    close = 0
    for _ in range(8_000):
        parts = int(rng.integers(1, 7))
        turns, lengths = rng.integers(-1, 2, parts), rng.uniform(least, 1.0, parts) * rng.choice([0.3, 2.0])
        x, y, phi = ahead(zip(turns, lengths, strict=True))
        found = words_of(x, y, np.remainder(phi, 2.0 * np.pi), word)
        own = np.abs(lengths).sum()
        assert found <= own + 1e-6
        close += found > own - 1e-6
    assert close > 200  # and many of them are words themselves


# Plans on every platform whose ways are known


@pytest.mark.parametrize(
    ("name", "platform"),
    [
        ("unicycle_3r", None),
        ("unicycle_3r", "omnidirectional"),
        ("differential_base", None),
        ("differential_base", nmm.SkidSteer(0.1, 0.3, 0.4, ahead=0.05)),
        ("car_base", "car"),
        ("car_base", "front_drive_car"),
        ("omni_base", None),
    ],
)
def test_a_platform_goes_round_a_wall_to_a_pose(name, platform):
    robot = nmm.load(name, platform=platform)
    plan = nmm.plan(robot, robot.rest, BEHIND, [WALL], limits=LIMITS)
    assert np.allclose(plan.end[:2], (6.0, 0.0), atol=1e-9)
    assert np.isclose(np.cos(plan.end[2] - 0.5), 1.0)
    check(plan)
    assert not np.allclose(plan(plan.duration / 2)[0][0, :2], (3.0, 0.0), atol=0.5)


def test_an_arm_that_stands_reaches_round_a_post():
    robot = nmm.load("unicycle_3r", platform="fixed")
    post = nmm.Obstacle(nmm.Cylinder(0.08, 2.0), [0.6, 0.0, 0.8], name="post")
    start = {"q1": -1.2, "q2": 0.6, "q3": 1.0}
    plan = nmm.plan(robot, start, {"q1": 1.2, "q2": 0.6, "q3": 1.0}, [post], limits=LIMITS)
    check(plan)
    assert np.allclose(plan.end, robot.q({"q1": 1.2, "q2": 0.6, "q3": 1.0}))


def test_a_car_that_may_not_reverse_goes_forwards():
    robot = nmm.load("car_base")
    limits = nmm.Limits(velocity={"v": [0.0, 1.0], "steering_rate": 1.0}, acceleration=1.0)
    plan = nmm.plan(robot, robot.rest, {"x": -2.0, "y": 0.0, "theta": 0.0}, [WALL], limits=limits)
    check(plan, limits=limits)
    assert plan(np.linspace(0.0, plan.duration, 300))[1][:, 0].min() >= 0.0
    to_and_fro = nmm.plan(robot, robot.rest, {"x": -2.0, "y": 0.0, "theta": 0.0}, [WALL], limits=LIMITS)
    assert to_and_fro.duration < plan.duration


def test_a_car_parks_with_its_arm_up(ur5_car):
    walls = [
        nmm.Obstacle(nmm.Box([2.0, 0.9, 0.8]), [-1.6, 0.0, 0.4], name="behind"),
        nmm.Obstacle(nmm.Box([2.0, 0.9, 0.8]), [2.6, 0.0, 0.4], name="before"),
    ]
    up = {"ur5_shoulder_lift_joint": -1.5, "ur5_elbow_joint": 1.5, "ur5_wrist_1_joint": -1.5}
    start, goal = {"x": 1.0, "y": 2.0, **up}, {"x": 0.0, "y": 0.0, "theta": 0.0, **up}
    plan = nmm.plan(ur5_car, start, goal, walls, limits=LIMITS)
    check(plan)
    assert np.allclose(plan.end, ur5_car.q(goal), atol=1e-9)


def test_wheels_keep_their_limits():
    robot = nmm.load("differential_base", platform="unicycle")
    limits = nmm.Limits(wheels=3.0, acceleration=1.0)
    plan = nmm.plan(robot, robot.rest, {"x": 1.0, "y": 1.0, "theta": 0.0}, limits=limits)
    q, u = plan(np.linspace(0.0, plan.duration, 500))
    from nmm.model.robots.wheel_rates import turning_wheels

    _, rates = turning_wheels(robot, q, np.array([robot.S(a) @ b for a, b in zip(q, u, strict=True)]))
    assert 3.0 - 1e-6 < np.abs(rates).max() <= 3.0 + 1e-11


def test_a_platform_whose_inputs_are_rates_of_wheels_drives_a_metre_a_second():
    metre = nmm.plan(nmm.load("differential_base"), np.zeros(3), {"x": 1.0, "y": 0.0, "theta": 0.0})
    turned = nmm.plan(nmm.load("omni_base"), np.zeros(3), {"x": 0.0, "y": 0.0, "theta": 1.0})
    assert metre.duration == pytest.approx(1.0)
    assert turned.duration == pytest.approx(1.0)


def test_links_that_touch_at_the_start_are_named():
    robot = nmm.load(PANDA)
    with pytest.raises(nmm.InputError) as found:
        nmm.plan(robot, robot.rest, robot.rest)
    assert "panda_link5 and panda_hand" in found.value.what
    assert "ignore" in found.value.expected
    touching = [("panda_link5", "panda_hand"), ("panda_leftfinger", "panda_rightfinger")]
    ignored = nmm.Collisions(ignore=touching)
    assert nmm.plan(robot, robot.rest, robot.rest, collisions=ignored).duration == 0.0


def test_what_has_no_words_is_refused_by_name():
    robot = nmm.load("trailer_base", platform="wheeled")
    with pytest.raises(nmm.InputError) as found:
        nmm.plan(robot, robot.rest, {"x": 1.0, "y": 0.0, "theta": 0.0})
    assert robot.platform.name in found.value.what


# Goals


def test_an_end_effector_gets_under_a_table():
    robot = nmm.mount(nmm.load("differential_base", platform="unicycle"), nmm.load(UR5))
    table = nmm.Obstacle(nmm.Box([0.9, 1.2, 0.03]), [2.5, 0.0, 0.72], name="table")
    names = [name for name in robot.frames if name.endswith("ee_link")]
    target = [2.3, 0.1, 0.5]
    start = dict(zip(robot.q_names[4:7], (-1.5, 1.5, -1.5), strict=True))
    plan = nmm.plan(robot, start, nmm.Task(nmm.Position(names[0]), target), [table], limits=LIMITS)
    check(plan)
    reached = nmm.Configuration(robot, plan.end).placement(names[0]).translation
    assert np.linalg.norm(reached - target) < 0.005


def test_a_pose_is_reached_within_its_tolerances():
    robot = nmm.Scenario.load("tiago_pose").robot()
    pose = nmm.PoseReference([2.0, 0.4, 0.9], [0.3, -0.2, 0.5])
    task = nmm.Task(nmm.Pose("wrist_ft_link"), pose)
    start = nmm.Scenario.load("tiago_pose").parts.q0
    plan = nmm.plan(robot, start, task, tolerance=nmm.Goal(m=0.002, rad=0.01), limits=LIMITS)
    controller = nmm.Controller(robot, task, nmm.ProjectedGradient())
    error = controller.evaluate(0.0, plan.end).error
    assert np.linalg.norm(error[:3]) <= 0.002
    assert np.linalg.norm(error[3:]) <= 0.01
    check(plan)


def test_one_of_several_goals_is_reached_and_the_arm_is_left_as_it_was():
    robot = nmm.load("unicycle_3r")
    inside = {"x": 3.0, "y": 0.0, "theta": 0.0}  # the wall is there
    plan = nmm.plan(robot, {"q1": 0.4}, [inside, BEHIND], [WALL])
    assert np.allclose(plan.end[:2], (6.0, 0.0))
    assert np.allclose(plan.end[3:], robot.q({"q1": 0.4})[3:])


def test_way_points_are_passed_in_order():
    robot = nmm.load("unicycle_3r")
    first, second = {"x": 1.0, "y": 3.0, "theta": 1.0}, {"x": 1.0, "y": -3.0, "theta": -1.0}
    plan = nmm.plan(robot, robot.rest, BEHIND, [WALL], through=[first, second])
    corners = plan.corners
    k = [
        int(np.linalg.norm(corners[:, :2] - (one["x"], one["y"]), axis=1).argmin()) for one in (first, second)
    ]
    assert k[0] < k[1]
    for i, one in zip(k, (first, second), strict=True):
        assert np.allclose(corners[i, :2], (one["x"], one["y"]), atol=1e-9)
    check(plan, limits=nmm.Limits())


def test_a_start_that_is_the_goal_needs_no_motion():
    robot = nmm.load("unicycle_3r")
    plan = nmm.plan(robot, robot.rest, robot.rest)
    assert plan.duration == 0.0
    assert np.array_equal(plan(1.0)[0][0], robot.rest)
    assert len(plan.trajectory(0.1)) == 1


# Seeds, time, refusals


def test_a_seed_gives_one_plan():
    robot = nmm.load("unicycle_3r")
    a, b, c = (nmm.plan(robot, robot.rest, BEHIND, [WALL], seed=seed) for seed in (4, 4, 5))
    assert np.array_equal(a.corners, b.corners)
    assert not np.array_equal(a.corners[-2], c.corners[-2])


@pytest.mark.thorough
def test_more_shortening_gives_no_longer_plan():
    """Where legs are cut the robot stops once more: that counts, too."""
    robot = nmm.load("unicycle_3r")
    for seed in range(2):
        durations = [
            nmm.plan(robot, robot.rest, BEHIND, [WALL], limits=LIMITS, shorten=count, seed=seed).duration
            for count in (0, 100, 1500)
        ]
        assert durations[2] < durations[1] < durations[0]


def test_the_trees_of_a_plan_grow_from_start_and_goal_until_they_meet():
    robot = nmm.load("unicycle_3r")
    goal = robot.q(BEHIND)
    plan = nmm.plan(robot, robot.rest, goal, [WALL], limits=LIMITS)
    trees = [{tuple(robot.rest)}, {tuple(goal)}]
    for before, new in plan.tree:
        (tree,) = (one for one in trees if tuple(before) in one)
        tree.add(tuple(new))
    met = trees[0] & trees[1]
    assert len(met) == 1
    assert len(plan.tree) == sum(map(len, trees)) - 2
    queries, pairs = plan.found.scene.queries, range(len(plan.found.scene.names))
    for new in plan.tree[:, 1]:
        assert np.all(queries.distances(0.0, new, pairs) >= 0.03)
    assert nmm.plan(robot, robot.rest, {"x": 1.0}, limits=LIMITS).tree.shape == (0, 2, robot.n)


def test_an_impossible_plan_says_what_it_tried():
    robot = nmm.load("unicycle_3r")
    ring = [
        nmm.Obstacle(nmm.Box([0.2, 4.0, 3.0]), [2.0, 0.0, 0.5], name="east"),
        nmm.Obstacle(nmm.Box([0.2, 4.0, 3.0]), [-2.0, 0.0, 0.5], name="west"),
        nmm.Obstacle(nmm.Box([4.0, 0.2, 3.0]), [0.0, 2.0, 0.5], name="north"),
        nmm.Obstacle(nmm.Box([4.0, 0.2, 3.0]), [0.0, -2.0, 0.5], name="south"),
    ]
    begin = time.monotonic()
    with pytest.raises(nmm.RunError, match=r"\d+ configurations"):
        nmm.plan(robot, robot.rest, BEHIND, ring, seconds=0.5)
    assert time.monotonic() - begin < 30.0
    with pytest.raises(nmm.RunError, match="wall"):
        nmm.plan(robot, robot.rest, {"x": 3.0, "y": 0.0, "theta": 0.0}, [WALL])


@pytest.mark.parametrize(
    ("change", "where"),
    [
        ({"start": {"x": 3.0}}, "plan: start"),
        ({"limits": nmm.Limits(bounds=nmm.Bound(nmm.Position("ee", "z"), 0.2, 2.0))}, "plan: limits"),
        ({"goal": {"z": 1.0}}, "robot unicycle_3r"),
        ({"seconds": 0.0}, "seconds"),
        ({"seed": -1}, "seed"),
        ({"seed": 1.5}, "seed"),
    ],
)
def test_bad_input_is_refused(change, where):
    robot = nmm.load("unicycle_3r")
    given = {"start": robot.rest, "goal": BEHIND, "obstacles": [WALL], **change}
    with pytest.raises(nmm.InputError) as found:
        nmm.plan(robot, **given)
    assert found.value.where.startswith(where)


@pytest.mark.parametrize("platform", ["fixed", "unicycle"])
def test_a_slide_without_limits_is_refused_by_name(tmp_path, platform):
    robot = nmm.load(sliding(tmp_path, -1e9, 1e9), platform=platform)
    with pytest.raises(nmm.InputError) as found:
        nmm.plan(robot, robot.rest, {"slide": 1.0})
    assert "slide" in found.value.what
    bounded = nmm.load(sliding(tmp_path, -2.0, 2.0), platform=platform)
    assert nmm.plan(bounded, bounded.rest, {"slide": 1.0}).end[-2] == 1.0


# The trajectory


def test_a_plan_is_a_run_that_is_saved_and_read(tmp_path):
    robot = nmm.load("unicycle_3r")
    plan = nmm.plan(robot, robot.rest, BEHIND, [WALL], limits=LIMITS)
    run = plan.trajectory(0.05)
    assert run.complete
    assert np.allclose(run.t[-1], plan.duration)
    assert np.array_equal(run.q[-1], plan(plan.duration)[0][0])
    assert run.clearance.min() >= 0.03
    assert run["lateral_slip"].max() < 1e-12
    read = nmm.Trajectory.load(run.save(tmp_path / "run", figures=False), robot)
    assert np.array_equal(read.q, run.q)
    assert read.resolver == "plan"


# Scenarios


def test_a_scenario_with_a_plan_reaches_what_a_controller_alone_does_not():
    scenario = nmm.Scenario.load("behind_the_wall")
    run = scenario.run()
    assert (run.resolver, run.complete) == ("plan", True)
    assert run.error_norm[-1] < 0.005
    assert run.clearance_between.min() >= 0.03
    assert np.allclose(run.error, run.r_d - run.r)
    assert np.array_equal(run.q, nmm.Scenario.load("behind_the_wall").run().q)
    alone = scenario.override("plan", False).run()
    assert alone.outcome is nmm.Outcome.MISSED
    assert alone.error_norm[-1] > 1.0


def test_a_plan_in_a_folder_is_read_and_run_again(tmp_path):
    scenario = nmm.Scenario.load("behind_the_wall")
    run = scenario.run()
    folder = run.save(tmp_path / "run", figures=False)
    assert np.array_equal(nmm.Trajectory.load(folder).q, run.q)
    again = nmm.Scenario.load(folder / "scenario.yaml").run()
    assert np.array_equal(again.q, run.q)


@pytest.mark.thorough
def test_compare_runs_the_plan_and_each_resolver_without_it(tmp_path, capfd):
    from nmm.cli.exit_status import status_of

    out = tmp_path / "compared"
    assert status_of(("compare", "behind_the_wall", "--resolvers", "pg", "--out", str(out))) == 1
    assert "PG missed" in capfd.readouterr().err
    runs = [nmm.Trajectory.load(out / name) for name in ("plan", "pg")]
    assert [run.complete for run in runs] == [True, False]


@pytest.mark.parametrize(
    ("plan", "key"),
    [
        ({"to": {"z": 1.0}}, "plan.to"),
        ({"to": [1.0]}, "plan.to"),
        ({"through": [{"x": 1.0}, {"w": 1.0}]}, "plan.through.1"),
        ({"seconds": 0}, "plan.seconds"),
        ({"seed": "one"}, "plan.seed"),
        ({"seed": -1}, "plan.seed"),
        ({"speed": 1}, "plan"),
    ],
)
def test_a_wrong_key_of_a_plan_is_named(plan, key):
    with pytest.raises(nmm.base.errors.ScenarioError) as found:
        nmm.Scenario.load("behind_the_wall", {"plan": plan}).run()
    assert key in found.value.where


def test_a_target_that_moves_is_no_goal_of_a_plan():
    with pytest.raises(nmm.base.errors.ScenarioError) as found:
        nmm.Scenario.load("unicycle_2r_position", {"plan": True}).run()
    assert "moves" in found.value.what


def test_a_margin_is_kept_where_there_is_room_and_less_where_there_is_none():
    """The wall: 80 mm on the way; a goal 45 mm before it is reached all the same, with what it has."""
    robot = nmm.load("unicycle_3r")
    goals = {0.08: {"x": 6.0, "y": 0.0, "theta": 0.0}, 0.043: {"x": 2.4, "y": 0.0, "theta": 0.0, "q1": 3.0}}
    for least, goal in goals.items():
        plan = nmm.plan(robot, robot.rest, goal, [WALL], limits=LIMITS, margin=0.05)
        check(plan, distance=min(least, 0.03))
        scene = plan.found.scene
        pairs = [k for k, names in enumerate(scene.names) if "wall" in names]
        q, _ = plan(np.linspace(0.0, plan.duration, 300))
        near = min(scene.queries.distances(0.0, one, pairs).min() for one in q)
        assert least - 1e-3 <= near <= 0.12
        again = nmm.replan(plan, plan(0.3 * plan.duration)[0][0])
        q, _ = again(np.linspace(0.0, again.duration, 300))
        assert min(scene.queries.distances(0.0, one, pairs).min() for one in q) >= least - 1e-3
    with pytest.raises(nmm.InputError, match="margin"):
        nmm.plan(robot, robot.rest, goals[0.08], [WALL], margin=-0.1)


def test_pairs_that_are_always_near_keep_their_distance_beside_a_margin():
    """A margin does not leave out what is always nearer than distance and margin together."""
    robot = nmm.load("unicycle_3r")
    given = robot, robot.rest, {"x": 2.0, "y": 0.5, "theta": 0.0}, [WALL]
    names = [nmm.plan(*given, margin=margin).found.scene.names for margin in (0.0, 0.5)]
    assert names[0] == names[1]
