"""Limits of wheels, of functions, of followers and of hitches, and controllers that are copied."""

from __future__ import annotations

import copy
import math
import pickle
from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest
from findings import every, refused, the
from gripping import FINGERS, panda

import nmm
from nmm.model.robots.robot import Robot
from nmm.motion.margins import margin, shares
from nmm.views.playback.rolling import Rolling

Array = np.ndarray
DT = 0.01
ROBOT = nmm.load("unicycle_3r")
START = ROBOT.q({"q1": 0.3, "q2": 0.5, "q3": 0.4})
PG = nmm.ProjectedGradient(alpha=1.0)


def towards(
    target: tuple[float, ...], limits: nmm.Limits, robot: Robot = ROBOT, frame: str = "ee", axes: str = "xy"
) -> nmm.Controller:
    task = nmm.Task(nmm.Position(frame, axes), nmm.Constant(target))
    return nmm.Controller(robot, task, PG, limits=limits, dt=DT)


def rolling(robot: Robot, q: Array, u: Array) -> dict[str, float]:
    """Rates of the main body's wheels, rad/s, from finite differences of where they are, without slip."""
    h = 1e-6
    there = [nmm.Configuration(robot, q + step * (robot.S(q) @ u)) for step in (-h, h)]
    here = nmm.Configuration(robot, q)
    found = {}
    for wheel in robot.wheels:
        if wheel.swivel or wheel.carrier != "theta":
            continue
        before, after = (at.placement(wheel.joint).translation for at in there)
        velocity = (after - before) / (2.0 * h)
        heading = q[2] + math.atan2(-wheel.axis[0], wheel.axis[1])
        assert here.placement(wheel.joint).translation[2] == pytest.approx(wheel.radius, abs=1e-3)
        found[wheel.joint] = (velocity @ [math.cos(heading), math.sin(heading), 0.0]) / wheel.radius
    return found


@pytest.mark.parametrize(
    ("base", "platform", "count"),
    [
        ("differential_base", None, 2),  # its casters are left out
        ("differential_base", "unicycle", 2),
        ("differential_base", "wheeled", 2),
        ("car_base", None, 4),
        ("car_base", "front_drive_car", 4),
        ("trailer_base", None, 4),  # a second trailer's wheels are left out
        ("omni_base", None, 4),
    ],
)
def test_wheels_turn_as_fast_as_their_rows_say(
    base: str, platform: str | None, count: int, rng: np.random.Generator
) -> None:
    """Against playback's rolling, and on the main body against finite differences."""
    moving = nmm.load(base, platform=platform)
    robot = nmm.mount(moving, "small_arm", at="arm_mount")
    task = nmm.Task(nmm.LinearCoordinates(robot.q_names[-1]), nmm.Constant([0.3]))
    controller = nmm.Controller(robot, task, PG, limits=nmm.Limits(position=False, wheels=5.0), dt=DT)
    rows = controller.solver.step_memory.problem.limit_rows
    names = controller.solver.limits_on.rows
    assert len(rows) == len(names) == count
    drawn = Rolling(robot)
    for _ in range(5):
        q = np.append(rng.uniform(-0.4, 0.4, robot.platform.n_p), np.zeros(len(robot.arm_coordinates)))
        controller(0.0, q)
        u = rng.uniform(-1.0, 1.0, robot.n_u)
        told = dict(zip(names, rows @ u, strict=True))
        turned = dict(zip(drawn.joints, drawn.rates(q, u), strict=True))
        np.testing.assert_allclose([*told.values()], [turned[name] for name in names], rtol=0, atol=1e-10)
        if base == "omni_base":
            np.testing.assert_allclose([*told.values()], moving.platform.wheel_speeds(u[:3]), atol=1e-12)  # type: ignore[attr-defined]
            continue
        for name, rate in rolling(robot, q, u).items():
            assert told[name] == pytest.approx(rate, abs=2e-8)
        if moving.platform.name == "differential":
            np.testing.assert_allclose(rows[:, :2], np.eye(2), rtol=0, atol=1e-12)


@pytest.mark.parametrize("method", ["zoh", "rk4"])
def test_wheels_are_no_faster_than_their_limit(method: str) -> None:
    """As far as the kernel of limits is exact: starts 1e-12 apart (it is chaotic) go up to 3e-10 beyond.

    With bounds for the arm: without, it whips at 100 rad/s, whose rounding reaches the wheels.
    """
    limits = nmm.Limits(velocity={"q1": 2.0, "q2": 2.0, "q3": 2.0}, wheels=3.0)
    run = nmm.simulate(towards((4.0, 3.0), limits), START, 3.0, DT, method)
    v, omega = run.u[:, 0], run.u[:, 1]
    speeds = np.abs(np.column_stack([v - 0.2 * omega, v + 0.2 * omega])) / 0.1
    assert speeds.max() == pytest.approx(3.0, abs=1e-9)
    assert run.scale.min() < 1.0


#: What is limited, its values along a run, and a target beyond the limit.
KINDS: dict[str, tuple[nmm.Bound, Callable[[nmm.Configuration], float], tuple[float, float]]] = {
    "corridor in x": (
        nmm.Bound(nmm.Position("ee", "x"), -1.0, 1.3, braking=0.5),
        lambda at: at.placement("ee").translation[0],
        (2.5, 0.7),
    ),
    "corridor in y": (
        nmm.Bound(nmm.Position("ee", "y"), -1.0, 0.9, braking=0.5),
        lambda at: at.placement("ee").translation[1],
        (0.5, 2.0),
    ),
    "heading": (nmm.Bound(nmm.Heading("base_link"), -0.2, 0.2), lambda at: at.q[2], (0.4, 2.0)),
    "distance of two frames": (
        nmm.Bound(nmm.Distance("ee", "base_link"), 1.35, 1.6, braking=0.5),
        lambda at: float(
            np.linalg.norm(at.placement("ee").translation - at.placement("base_link").translation)
        ),
        (3.5, 0.7),
    ),
}


@pytest.mark.parametrize("kind", KINDS)
def test_functions_stay_between_their_limits(kind: str) -> None:
    bound, value, target = KINDS[kind]
    limits = nmm.Limits({"platform": 0.6, "arm": 1.0}, acceleration=4.0, bounds=bound)
    run = nmm.simulate(towards(target, limits), START, 4.0, DT, "zoh")
    ((_, _, lower, upper),) = bound.rows(ROBOT)
    values = np.array([value(nmm.Configuration(ROBOT, q)) for q in run.q])
    assert lower - 2e-3 <= values.min()  # a sample's curvature: rows turn
    assert values.max() <= upper + 2e-3
    assert max(values.max() - upper, lower - values.min()) > -0.05
    named = run.limit_names.index(bound.rows(ROBOT)[0].name)
    np.testing.assert_allclose(run.shares[:, named], (values - lower) / (upper - lower), rtol=0, atol=1e-9)


def test_the_height_of_a_frame() -> None:
    robot = nmm.Scenario.load("ur5_unicycle_pose").robot()
    q0 = robot.q(nmm.Scenario.load("ur5_unicycle_pose").parts.q0)
    tool = nmm.Configuration(robot, q0).placement("ur5_tool0").translation
    bounds = [
        nmm.Bound(nmm.Position("ur5_tool0", "z"), lower=tool[2] - 0.1, braking=1.0),
    ]
    limits = nmm.Limits({"platform": 0.5, "arm": 1.0}, acceleration=4.0, bounds=bounds)
    controller = towards((*(tool[:2] + 0.3), tool[2] - 0.5), limits, robot, "ur5_tool0", "xyz")
    run = nmm.simulate(controller, q0, 3.0, DT, "zoh")
    heights = [nmm.Configuration(robot, q).placement("ur5_tool0").translation[2] for q in run.q]
    assert tool[2] - 0.1 - 1e-3 <= min(heights) <= tool[2] - 0.09


def test_the_centre_of_mass_stays_over_the_wheels() -> None:
    """A heavy arm that leans after a point beside the platform: Pinocchio's centre, seen by the base."""
    robot = nmm.Scenario.load("ur5_unicycle_pose").robot()
    q0 = robot.q(nmm.Scenario.load("ur5_unicycle_pose").parts.q0)
    lower, upper = np.array([-0.2, -0.06]), np.array([0.15, 0.06])
    support = nmm.Bound(nmm.CenterOfMass("xy", "base_link"), lower, upper, name="support")
    limits = nmm.Limits({"platform": 0.1, "arm": 1.0}, acceleration=4.0, bounds=support)
    task = nmm.Task(nmm.Position("ur5_tool0"), [0.2, 1.2, 0.5])

    def seen(limits: nmm.Limits | None) -> Array:
        run = nmm.simulate(nmm.Controller(robot, task, PG, limits=limits, dt=DT), q0, 3.0, DT, "zoh")
        data = robot.model.createData()
        found = []
        for q in run.q:
            centre = pin.centerOfMass(robot.model, data, q)
            found.append(nmm.Configuration(robot, q).placement("base_link").actInv(centre)[:2])
        return np.array(found)

    kept = seen(limits)
    assert np.all((kept >= lower - 1e-3) & (kept <= upper + 1e-3))
    assert max((kept - upper).max(), (lower - kept).max()) > -0.005
    tipped = seen(nmm.Limits({"platform": 0.1, "arm": 1.0}, acceleration=4.0))
    assert np.any((tipped > upper + 0.02) | (tipped < lower - 0.02))


def test_a_wall_that_wheels_cannot_avoid_is_broken_as_little_as_can_be_and_told() -> None:
    """A unicycle that drives along a wall at full speed, turned towards it: it cannot go sideways."""
    robot = nmm.load("differential_base", platform="unicycle")
    task = nmm.Task(nmm.LinearCoordinates("theta"), nmm.Constant([0.8]))
    wall = nmm.Bound(nmm.LinearCoordinates("y"), upper=0.02, braking=5.0, name="wall")
    limits = nmm.Limits({"v": [0.5, 0.5], "omega": 1.0}, acceleration={"omega": 1.0}, bounds=wall)
    controller = nmm.Controller(robot, task, PG, limits=limits, dt=DT)
    run = nmm.simulate(controller, {"theta": 0.1}, 2.0, DT, "zoh")
    contradicted = the(run, "limit_contradicted").values
    assert (contradicted["name"], contradicted["unit"]) == ("wall", "m/s")
    assert contradicted["against"] == ["wall", "v"]
    assert [one["name"] for one in the(run, "functions_beyond_limits").values["functions"]] == ["wall"]
    # A limit on one side alone: the margin is the distance beside the robot's reach.
    over = run.q[:, robot.coordinate("y")] - 0.02
    assert run.margin.min() < 0.0
    assert run.margin.min() == pytest.approx(-over.max() / robot.reach, rel=1e-9)
    # Inputs keep theirs; nothing else than v contradicts, so v stays at 0.5.
    np.testing.assert_allclose(run.u[:, 0], 0.5, rtol=0, atol=1e-12)


@pytest.mark.parametrize("side", ["lower", "upper"])
def test_a_limit_on_one_side_counts_in_the_margin(side: str) -> None:
    """As far as half a reach away, whichever side; two of one function count both, and mirrored alike."""
    robot = nmm.load("unicycle_3r")
    sign = 1.0 if side == "lower" else -1.0
    bounds = [nmm.Bound(nmm.LinearCoordinates("y"), **{side: -sign * room}) for room in (0.3, 0.2)]
    kept = nmm.Limits(False, False, bounds=bounds).on(robot)
    y = sign * np.array([-0.25, -0.2, 0.0, 0.1, 100.0])
    q = np.tile(robot.rest, (len(y), 1))
    q[:, robot.coordinate("y")] = y
    names, found = shares(kept, robot, q, np.zeros((len(y), robot.n_u)), np.column_stack([y, y]))
    assert names == ("y", "y")
    expected = np.minimum((np.array([-0.25, -0.2, 0.0, 0.1, 100.0]) + 0.2) / robot.reach, 0.5)
    np.testing.assert_allclose(margin(found), expected, atol=1e-15)


def test_limits_that_contradict_each_other_from_the_start_are_named() -> None:
    x = nmm.Position("ee", "x")
    here = nmm.Configuration(ROBOT, START).placement("ee").translation[0]
    bounds = [nmm.Bound(x, lower=here + 0.2, name="far"), nmm.Bound(x, upper=here - 0.2, name="near")]
    controller = towards((1.0, 1.0), nmm.Limits(bounds=bounds))
    controller(0.0, START)
    assert set(controller.report.contradiction()) == {"far", "near"}
    assert controller.last(0.0, START).excess == pytest.approx(0.1, abs=1e-9)
    found = every(nmm.simulate(controller, START, 0.1, DT), "limit_contradicted")
    assert {one.values["name"]: one.values["against"] for one in found}["near"] == ["far", "near"]


def test_followers_velocity_limits_bind_their_leaders() -> None:
    robot = panda()
    leader, follower = FINGERS
    j = robot.input(leader)
    kept = nmm.Limits({follower: 0.03, leader: 0.2}).on(robot)
    np.testing.assert_allclose(kept.inputs[j], [-0.03, 0.03])
    kept = nmm.Limits({follower: 0.3, leader: [-0.1, 0.2]}).on(robot)
    np.testing.assert_allclose(kept.inputs[j], [-0.1, 0.2])
    with refused("velocity: panda_finger_joint2"):
        nmm.Limits({follower: [0.5, 0.6], leader: 0.2}).on(robot)


def test_what_is_named_more_precisely_counts() -> None:
    for limits in ({"arm": 1.0, "q2": 0.2}, {"q2": 0.2, "arm": 1.0}):
        kept = nmm.Limits(limits, acceleration=limits).on(ROBOT)
        assert kept.inputs[:, 1].tolist()[2:] == [1.0, 0.2, 1.0]
        assert kept.accelerations.tolist() == [math.inf, math.inf, 1.0, 0.2, 1.0]


def test_trailers_keep_the_limits_of_their_hitches() -> None:
    robot = nmm.mount("trailer_base", "small_arm", at="arm_mount")
    limits = nmm.Limits(
        {"v": 0.5, "omega": 1.5},
        {"hitch1": [-0.3, 0.3], "hitch2": [-0.3, 0.3]},
        acceleration={"v": 1.0, "omega": 3.0},
    )
    task = nmm.Task(nmm.LinearCoordinates("theta"), nmm.Line([0.0], [4.0], 6.0))
    controller = nmm.Controller(
        robot, task, PG, nmm.Quadratic(nmm.QuadraticTerm("x", 6.0)), limits=limits, dt=DT
    )
    run = nmm.simulate(controller, {}, 6.0, DT, "zoh")
    hitches = np.abs(run.q[:, 3:5])
    assert hitches.max() <= 0.3 + 2e-3
    assert run.margin.min() >= -4e-3


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, lambda c: pickle.loads(pickle.dumps(c))])
def test_a_copy_of_a_controller_keeps_the_same_limits(
    copied: Callable[[nmm.Controller], nmm.Controller],
) -> None:
    bound = nmm.Bound(nmm.Position("ee", "xy"), -1.0, [1.2, 0.9], name="corridor")
    limits = nmm.Limits({"arm": 0.5}, {"q1": [-0.5, 0.5]}, {"platform": 2.0}, 4.0, bound, 0.2)
    original = towards((3.0, 2.0), limits)
    other = copied(original)
    assert other.dt == DT
    assert other.solver.limits_on.row_limits == original.solver.limits_on.row_limits
    q = START.copy()
    for k in range(50):
        u = original(k * DT, q)
        np.testing.assert_array_equal(other(k * DT, q), u)
        q = q + DT * original.last(k * DT, q).q_dot
