"""Controllers that keep distances: kept at samples and between them, recovered, or said."""

import pickle

import coal
import numpy as np
import pinocchio as pin
import pytest
from findings import refused, the

import nmm

DISTANCE = 0.03


def pillar(**given):
    return nmm.Obstacle(nmm.Box([0.3, 0.6, 1.0]), [1.6, 0.0, 0.5], name="pillar", **given)


def controller(robot, obstacles, *, limits=None, resolver=None, goal=(3.0, 0.2), dt=0.02, **given):
    task = nmm.Task(nmm.Position("ee", "xy"), goal, gain=1.0, speed=0.5)
    return nmm.Controller(
        robot,
        task,
        resolver or nmm.ProjectedGradient(),
        limits=limits,
        dt=dt,
        collisions=nmm.Collisions(DISTANCE, obstacles=obstacles, **given),
    )


def limited():
    return nmm.Limits({"platform": 0.8, "arm": 1.0}, acceleration={"platform": 1.0, "arm": 4.0})


@pytest.fixture(scope="module")
def robot():
    return nmm.load("unicycle_3r")


START = {"q1": 0.3, "q2": 0.6}


def least_between(run, obstacles, robot):
    """An own look at every tenth of a step, along the arcs of held inputs, at all pairs."""
    from nmm.model.robots.zero_order_hold import HeldInputs

    setting, held = nmm.Collisions(DISTANCE, obstacles=obstacles).on(robot), HeldInputs(robot)
    found = []
    every = range(len(setting.names))
    for k in range(len(run) - 1):
        h = run.t[k + 1] - run.t[k]
        astray = run.q[k + 1] - held(run.q[k], run.u[k], h)
        for share in np.linspace(0.0, 1.0, 11):
            q = held(run.q[k], run.u[k], share * h) + share * astray
            found.append(setting.queries.distances(run.t[k] + share * h, q, every).min())
    return min(found)


@pytest.mark.parametrize(
    ("method", "limits", "resolver"),
    [  # each two of their values together
        ("zoh", None, nmm.ProjectedGradient()),
        ("rk4", limited(), nmm.ProjectedGradient()),
        ("rk4", None, nmm.ReducedGradient(alpha=0.5)),
        ("zoh", limited(), nmm.ReducedGradient(alpha=0.5)),
    ],
    ids=["zoh-free-pg", "rk4-limited-pg", "rk4-free-rg", "zoh-limited-rg"],
)
def test_a_pillar_in_the_way_is_not_touched(robot, method, limits, resolver):
    one = controller(robot, [pillar()], limits=limits, resolver=resolver)
    run = nmm.simulate(one, START, 4.0, 0.02, method, until=nmm.Goal())
    assert run.clearance_between.min() >= DISTANCE - 1e-6
    assert least_between(run, [pillar()], robot) >= DISTANCE - 1e-6
    free = nmm.Controller(robot, one.task, resolver, limits=limits, dt=0.02)
    through = nmm.simulate(free, START, 4.0, 0.02, method, until=nmm.Goal())
    assert least_between(through, [pillar()], robot) < 0.0


def test_a_run_that_is_blocked_says_by_what(robot):
    run = nmm.simulate(controller(robot, [pillar()]), START, 4.0, 0.02, until=nmm.Goal())
    assert run.outcome is nmm.Outcome.MISSED
    (pair,) = the(run, "blocked").values["pairs"]
    assert "pillar" in pair
    numbers = run.summary()
    assert numbers["clearance_min"] == run.clearance_between.min()
    assert "pillar" in numbers["clearance_min_pair"]


def test_inputs_change_no_faster_than_accelerations_allow(robot):
    """Edges and parallel faces included: rows that come and go cause no chatter beyond the accelerations."""
    wall = nmm.Obstacle(nmm.Box([6.0, 0.1, 2.0]), [0.0, 0.9, 0.5], name="wall")
    one = controller(robot, [wall, pillar()], limits=limited(), goal=(1.0, 1.5))
    run = nmm.simulate(one, START, 4.0, 0.02, "zoh")
    change = np.abs(np.diff(run.u, axis=0)) / 0.02
    assert np.all(change <= np.array([1.0, 1.0, 4.0, 4.0, 4.0]) + 1e-8)
    assert run.clearance_between.min() >= DISTANCE - 1e-6


def test_an_obstacle_that_comes_is_got_out_of_its_way(robot):
    """A ball at 0.2 m/s towards the gripper of a robot whose task holds it there."""
    ball = nmm.Obstacle(nmm.Sphere(0.1), motion=lambda t: [2.0 - 0.2 * t, 0.3, 0.3], name="ball")
    one = controller(robot, [ball], goal=(0.9, 0.3), limits=nmm.Limits({"platform": 0.8, "arm": 1.0}))
    run = nmm.simulate(one, START, 5.0, 0.02, "zoh")
    assert run.clearance_between.min() >= DISTANCE - 1e-6


def test_a_start_that_is_too_near_is_left_at_the_stated_speed(robot):
    free = nmm.Collisions(DISTANCE, self_collisions=False, obstacles=[pillar()]).on(robot)
    start = robot.q({"x": 1.0})
    low, high = 0.0, 1.2
    for _ in range(40):  # 1 cm from the pillar
        middle = 0.5 * (low + high)
        start[0] = middle
        low, high = (middle, high) if free.queries.nearest(0.0, start)[0] > 0.01 else (low, middle)
    one = controller(robot, [pillar()], recovery=0.05, self_collisions=False)
    run = nmm.simulate(one, start, 2.0, 0.02, "zoh")
    assert run.clearance[0] == pytest.approx(0.01, abs=1e-6)
    assert np.all(np.diff(run.clearance[:10]) > 0.0)
    assert run.clearance[-1] >= DISTANCE - 1e-6
    found = the(run, "start_too_near").values
    assert found["back"] == run.t[np.argmax(run.clearance >= DISTANCE - 1e-6)]
    assert not found["own"]


def test_an_obstacle_set_live_counts_from_then_on(robot):
    block = nmm.Obstacle(nmm.Sphere(0.2), [9.0, 9.0, 0.3], name="block")
    one = controller(robot, [block])
    q = robot.q(START)
    before = one(0.0, q)
    one.reset()
    assert not one.report.blocking()
    block.move_to([0.75, 0.0, 0.2])
    after = one(0.0, q)
    assert one.solver.scene.queries.least < 0.2
    assert not np.array_equal(after, before)


def test_without_collisions_nothing_changes(robot):
    """To the bit: far obstacles neither."""
    task = nmm.Task(nmm.Position("ee", "xy"), [3.0, 0.2], gain=1.0)
    far = nmm.Collisions(self_collisions=False, obstacles=[nmm.Obstacle(nmm.Sphere(0.1), [50.0, 0.0, 0.0])])
    plain = nmm.Controller(robot, task, nmm.ProjectedGradient(), dt=0.02)
    kept = nmm.Controller(robot, task, nmm.ProjectedGradient(), dt=0.02, collisions=far)
    q = robot.q(START)
    np.testing.assert_array_equal(plain(0.0, q), kept(0.0, q))


def test_copies_keep_the_same_distances(robot):
    one = controller(robot, [pillar()])
    again = pickle.loads(pickle.dumps(one))
    q = robot.q({"x": 0.5, **START})
    np.testing.assert_array_equal(one(0.0, q), again(0.0, q))


def test_a_run_is_read_back_with_its_distances(robot, tmp_path):
    run = nmm.simulate(controller(robot, [pillar()]), START, 0.2, 0.02)
    read = nmm.Trajectory.load(run.save(tmp_path / "run", figures=False), robot)
    np.testing.assert_array_equal(read.clearance_between, run.clearance_between)
    assert read.clearance_names == run.clearance_names


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: nmm.Collisions(-0.01), {"where": "collisions: distance", "got": -0.01}),
        (lambda: nmm.Collisions(0.1, band=0.05), {"where": "collisions: band", "got": 0.05}),
        (lambda: nmm.Collisions(shapes="balls"), {"where": "collisions", "got": "balls"}),
        (lambda: nmm.Collisions(obstacles=[3]), {"where": "collisions: obstacles", "got": 3}),
        (lambda: nmm.Collisions(obstacles=[pillar(), pillar()]), {"where": "collisions: obstacles"}),
        (lambda: nmm.Box([1.0, 0.0, 1.0]), {"where": "box: size", "got": [1.0, 0.0, 1.0]}),
        (lambda: nmm.Sphere(-1.0), {"where": "sphere: radius", "got": -1.0}),
        (lambda: nmm.HalfSpace([0.0, 0.0, 0.0]), {"where": "plane: normal", "got": [0.0, 0.0, 0.0]}),
        (lambda: nmm.ConvexMesh("nothing.stl"), {"where": "mesh", "got": "nothing.stl"}),
        (lambda: nmm.Obstacle("box"), {"where": "obstacle", "got": "box"}),
        (
            lambda: nmm.Obstacle(nmm.Sphere(0.1), [1.0, 2.0]),
            {"where": "obstacle sphere: placement", "got": [1.0, 2.0]},
        ),
        (
            lambda: nmm.Obstacle(nmm.Sphere(0.1), motion=lambda t: [t]),
            {"where": "obstacle sphere: motion", "got": [0.0]},
        ),
        (
            lambda: nmm.Obstacle(nmm.Sphere(0.1), motion=nmm.Line([0, 0, 0], [1, 0, 0], 1)),
            {"where": "obstacle sphere: motion"},
        ),
        (
            lambda: nmm.Obstacle(nmm.Sphere(0.1), np.diag([1.0, 1.0, 1.0, 2.0])),
            {"where": "obstacle sphere: placement", "got": [0.0, 0.0, 0.0, 2.0]},
        ),
        (lambda: pillar(motion=lambda t: [t, 0, 0]), {"where": "obstacle pillar"}),
        (
            lambda: nmm.Obstacle(nmm.Sphere(0.1), motion=lambda t: [t, 0, 0]).move_to([0, 0, 0]),
            {"where": "obstacle sphere"},
        ),
        (
            lambda: nmm.Collisions(0.03, [pillar()]),
            {"where": "collisions: self_collisions"},
        ),
    ],
)
def test_bad_input_is_refused_in_words(make, said):
    with refused(**said):
        make()


def test_names_that_nothing_has_are_refused(robot):
    with refused("collisions: ignore", got="elbow"):
        nmm.Collisions(ignore=[("elbow", "link1")]).on(robot)
    with refused("collisions: obstacles"):
        nmm.Collisions(obstacles=[nmm.Obstacle(nmm.Sphere(0.1), name="link1")]).on(robot)
    with pytest.raises(nmm.InputError, match="there is no file"):
        nmm.Collisions(srdf="none.srdf").on(robot)
    with refused("collisions"):
        nmm.Collisions(self_collisions=False).on(robot)
    with pytest.raises(nmm.InputError) as caught:
        nmm.Collisions(self=False)  # type: ignore[call-arg]  # its name in earlier versions
    assert caught.value.where == "collisions: self"
    assert "self_collisions" in caught.value.what


def test_a_flat_mesh_has_no_volume(tmp_path):
    file = tmp_path / "flat.obj"
    file.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nf 2 4 3\n")
    with refused("flat.obj"):
        nmm.ConvexMesh(file)


def test_a_mesh_is_its_hull(tmp_path, robot):
    """A pyramid as a mesh: as far from the robot as its highest corner."""
    file = tmp_path / "pyramid.obj"
    file.write_text(
        "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nv 0 0 1\n"
        "f 1 2 5\nf 2 3 5\nf 3 4 5\nf 4 1 5\nf 1 3 2\nf 1 4 3\n"
    )
    mesh = nmm.Obstacle(nmm.ConvexMesh(file, [0.1, 0.1, 0.1]), [5.0, 0.0, 0.0], name="pyramid")
    ball = nmm.Obstacle(nmm.Sphere(0.1), [5.0, 0.0, 0.0], name="ball")
    setting = nmm.Collisions(self_collisions=False, obstacles=[mesh, ball]).on(robot)
    every = range(len(setting.names))
    found = dict(zip(setting.names, setting.queries.distances(0.0, robot.rest, every), strict=True))
    for link, name in setting.names:
        if name == "pyramid":
            assert found[link, name] >= found[link, "ball"] - 0.1


def test_a_round_mesh_with_many_corners_has_a_hull():
    """A disc of 400 corners: the fan that Qhull makes of a side has more neighbours than Coal can count."""
    turns = np.linspace(0.0, 2.0 * np.pi, 400, endpoint=False)
    rim = np.column_stack([np.cos(turns), np.sin(turns)])
    points = np.vstack([np.column_stack([rim, np.full(400, z)]) for z in (0.0, 0.1)])
    hull = nmm.Hull(points).geometry()
    assert hull.num_points == 800
    ball = pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.6]))
    result = coal.DistanceResult()
    distance = coal.distance(
        hull, coal.Transform3s(), coal.Sphere(0.2), coal.Transform3s(ball.rotation, ball.translation),
        coal.DistanceRequest(), result,
    )  # fmt: skip
    assert distance == pytest.approx(0.3, abs=1e-6)


def test_an_obstacle_that_contains_the_robot_is_refused(robot):
    house = nmm.Obstacle(nmm.Box([4.0, 4.0, 4.0]), name="house")
    with refused("obstacle house"):
        nmm.simulate(controller(robot, [house]), START, 1.0, 0.02)


@pytest.mark.parametrize("shape", [nmm.Box([50.0, 50.0, 50.0]), nmm.HalfSpace()], ids=["box", "plane"])
def test_an_obstacle_that_contains_the_robot_everywhere_is_no_pair_to_leave_out(robot, shape):
    with refused("obstacle world"):
        nmm.Collisions(obstacles=[nmm.Obstacle(shape, [0.0, 0.0, 9.0], name="world")]).on(robot)


@pytest.mark.parametrize("dt", [0.01, 0.05])
def test_inputs_without_limits_go_no_farther_in_a_sample_than_is_looked_at(dt):
    """The most of the task's rate would throw the stretched arm past the jamb, at 1e4 rad/s."""
    door = nmm.Scenario.load("omni_small_arm_door")
    given, q = door.controller(), door.robot().q(door.parts.q0)
    height = nmm.Configuration(given.robot, q).placement("ee").translation[2]
    task = nmm.Task(nmm.Position("ee"), [1.5, 0.1, height], gain=1.5, speed=0.5)
    one = nmm.Controller(given.robot, task, given.resolver, collisions=given.given.collisions, dt=dt)
    run = nmm.simulate(one, q, 3.0, dt, "zoh")
    assert np.abs(run.u).max() <= 0.1 / dt + 1e-9
    assert run.clearance_between.min() >= DISTANCE - 1e-6


def test_pairs_that_always_touch_are_left_out_and_told(robot):
    floor = nmm.Obstacle(nmm.HalfSpace(), name="floor")
    setting = nmm.Collisions(obstacles=[floor]).on(robot)
    assert any("left out" in note and "floor" in note for note in setting.notes)
    assert not any("wheel" in names[0] and names[1] == "floor" for names in setting.names)


def test_an_srdf_is_taken_and_told(robot, tmp_path):
    file = tmp_path / "robot.srdf"
    file.write_text('<robot><disable_collisions link1="link1" link2="link3"/></robot>')
    every = nmm.Collisions().on(robot)
    some = nmm.Collisions(srdf=file).on(robot)
    assert len(some.names) == len(every.names) - 1
    assert any("left out by the SRDF: 1 pairs" in note for note in some.notes)


@pytest.mark.parametrize("sequenced", [False, True])
def test_a_run_that_is_run_over_is_not_completed(robot, sequenced, monkeypatch):
    """A ball at 4 m/s comes from behind. No other dt is tried: that took up to a hundred times the run."""
    monkeypatch.setattr(
        "nmm.motion.diagnosis.judgement.Trials", lambda *given: pytest.fail("it was tried again")
    )
    ball = nmm.Obstacle(nmm.Sphere(0.15), motion=lambda t: [-2.0 + 4.0 * t, 0.0, 0.15], name="ball")
    q0 = robot.q(START)
    hand = nmm.Configuration(robot, q0).placement("ee").translation[:2]
    when = {"when": nmm.Between(0.0, 9.0)} if sequenced else {}
    make = nmm.SequencedController if sequenced else nmm.Controller
    given = make(
        robot,
        nmm.Task(nmm.Position("ee", "xy"), hand, gain=1.0, **when),
        nmm.ProjectedGradient(),
        limits=nmm.Limits({"platform": 0.2, "arm": 0.2}),
        collisions=nmm.Collisions(obstacles=[ball]),
    )
    run = nmm.simulate(given, q0, 1.2, 0.02, "zoh")
    assert run.clearance.min() < -0.01
    assert run.outcome is nmm.Outcome.MISSED
    assert "ball" in the(run, "collided").values["name"]
    assert 0.0 < the(run, "collided").where["t"] < 1.0


def test_a_placement_is_the_same_however_it_is_given():
    six = [1.0, -2.0, 0.3, 0.4, -0.5, 0.6]
    box = nmm.Box([0.1, 0.2, 0.3])
    listed, packed = (nmm.Obstacle(box, motion=lambda t, made=made: made(six)) for made in (list, np.array))
    np.testing.assert_array_equal(listed.placement(1.0), packed.placement(1.0))
    with refused("obstacle box: motion"):
        nmm.Obstacle(box, motion=lambda t: np.array([np.nan, *six[1:]]))


def test_what_passes_between_two_samples_is_seen(robot):
    """A ball at 20 m/s is in front of the robot at one sample and behind it at the next."""
    ball = nmm.Obstacle(
        nmm.Sphere(0.05), motion=lambda t: np.array([0, 20 * (t - 0.35), 0.15, 0, 0, 0.0]), name="ball"
    )
    hand = nmm.Configuration(robot, robot.q(START)).placement("ee").translation[:2]
    task = nmm.Task(nmm.Position("ee", "xy"), hand, gain=1.0)
    collisions = nmm.Collisions(obstacles=[ball])
    given = nmm.Controller(
        robot, task, nmm.ProjectedGradient(), limits=nmm.Limits({"platform": 0.1}), collisions=collisions
    )
    run = nmm.simulate(given, START, 0.6, 0.1, "zoh")
    assert run.clearance.min() > 0.1
    assert run.clearance_between.min() < 0.0
    assert run.outcome is nmm.Outcome.MISSED
    assert "ball" in the(run, "collided").values["name"]
