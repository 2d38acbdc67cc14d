"""Wheels brought to a pose by feedback: from anywhere, after pushes, with slip, above the task of an arm."""

import math

import numpy as np
import pytest

import nmm
from nmm.base.errors import InputError
from nmm.control.functions.program import Program
from nmm.plugins.planning import parking

GOAL = nmm.Goal(0.001, 0.001)
POSE = (0.5, -1.0, 2.0)
ROBOTS = [
    ("unicycle_2r", None),
    ("differential_base", None),
    ("differential_base", nmm.SkidSteer(0.1, 0.3, 0.4, ahead=0.05)),
    ("car_base", "car"),
    ("car_base", "front_drive_car"),
]
#: Units of each input that moves 1 m/s or turns 1 rad/s at most: wheels of 0.05 to 0.1 m.
FAST = {"differential_base": 15.0}


def controller(name, platform=None, pose=POSE, gain=2.0, arm=False, **more):
    robot = nmm.load(name, platform=platform)
    tasks = [nmm.Task(nmm.Parking(*pose, **more), [0, 0], gain)]
    if arm:
        tasks.append(nmm.Task(nmm.Posture(), [1.0, -0.5], priority=2))
    fast = FAST.get(name, 1.0)
    limits = nmm.Limits(velocity={"platform": fast}, acceleration={"platform": 2.0 * fast})
    law = nmm.ProjectedGradient()
    return nmm.Controller(robot, tasks, law, limits=limits, dt=0.02, kinematics="compiled")


def random_starts(robot, count, seed=3):
    rng = np.random.default_rng(seed)
    starts = np.tile(robot.rest, (count, 1))
    starts[:, :3] += rng.uniform([-3, -3, -math.pi], [3, 3, math.pi], (count, 3))
    return starts


def off(q, pose=POSE):
    """How far poses are from the goal, m and rad."""
    turned = np.asarray(q)[..., 2] - pose[2]
    wrapped = np.abs(turned - 2 * math.pi * np.round(turned / (2 * math.pi)))
    return np.hypot(np.asarray(q)[..., 0] - pose[0], np.asarray(q)[..., 1] - pose[1]), wrapped


@pytest.mark.parametrize(("name", "platform"), ROBOTS)
def test_the_pose_is_reached_from_anywhere(name, platform):
    """Forty starts; what the error calls reached is within 1 mm and 1 mrad of the pose itself."""
    law = controller(name, platform)
    starts = random_starts(law.robot, 40)
    starts[0, :3] = (
        POSE[0] + math.cos(POSE[2] + math.pi / 2),
        POSE[1] + math.sin(POSE[2] + math.pi / 2),
        POSE[2],
    )
    found = nmm.rollout(law, starts, 60.0, 0.02, "zoh", until=GOAL, keep=["q"])
    assert set(found.outcome) == {"reached"}
    for q in found["q"]:
        assert max(off(q[~np.isnan(q[:, 0])][-1])) < 0.001


@pytest.mark.parametrize(("name", "slip"), [("unicycle_2r", (0.9, 1.1, 1, 1)), ("car_base", (0.95, 0.9))])
def test_slip_and_noise_do_not_keep_it_away(name, slip):
    law = controller(name, within=0.002)
    starts = random_starts(law.robot, 10)
    worn = nmm.Disturbances(noise=1e-4, slip=slip, seed=2)
    found = nmm.rollout(law, starts, 60.0, 0.02, "zoh", disturbances=worn, keep=["q"])
    assert np.max(off(found["q"][:, -1])) < 0.004


@pytest.mark.parametrize("name", ["unicycle_2r", "car_base"])
def test_it_comes_back_after_pushes(name):
    """On the way, and when it stands at the pose."""
    law = controller(name)
    for seed, q in enumerate(random_starts(law.robot, 3)):
        rng = np.random.default_rng(seed)
        law.reset()
        for push in (0.0, 0.3, 0.02):
            q[:3] += rng.uniform(-push, push, 3)
            for k in range(100 if push == 0.0 else 2500):
                q, u = law.step(0.02 * k, q, 0.02, "zoh")
        assert max(off(q)) < 0.001
        assert np.abs(u[:2]).max() < 1e-3


@pytest.mark.parametrize("name", ["unicycle_2r", "car_base"])
def test_the_arm_does_its_own_below(name):
    base = "unicycle_2r" if name == "unicycle_2r" else nmm.mount("car_base", "small_arm", at="arm_mount")
    robot = nmm.load(base) if isinstance(base, str) else base
    hand = nmm.Task(nmm.Posture(*robot.u_names[2:4]), [1.0, -0.5], priority=2)
    tasks = nmm.Task(nmm.Parking(*POSE), [0, 0]), hand
    limits = nmm.Limits(velocity={"platform": 1.0, "arm": 1.0}, acceleration=2.0)
    law = nmm.Controller(robot, tasks, nmm.ProjectedGradient(), limits=limits)
    run = nmm.simulate(law, robot.rest, 60.0, 0.02, "zoh", until=GOAL)
    assert run.complete
    assert run.margin.min() > -1e-9
    assert np.abs(run.error[-1, 2:]).max() < 1e-3
    assert np.abs(np.diff(run.u, axis=0)).max() <= 2.0 * 0.02 + 1e-9
    assert max(off(run.q[-1])) < 0.001


def test_a_turning_platform_is_driven_in_polar_coordinates():
    """Against the law as it is published, with the angles of unit vectors."""
    robot = nmm.load("unicycle_2r")
    law = nmm.Controller(robot, nmm.Task(nmm.Parking(*POSE), [0, 0], 0.7), nmm.ProjectedGradient())
    ahead = complex(math.cos(POSE[2]), math.sin(POSE[2]))
    for q in random_starts(robot, 20):
        way = complex(POSE[0] - q[0], POSE[1] - q[1])
        alpha = np.angle(way / complex(math.cos(q[2]), math.sin(q[2])))
        theta = np.angle(way / ahead)
        turn = 3.0 * alpha + math.cos(alpha) * math.sin(alpha) / alpha * (alpha + theta)
        wanted = 0.7 * np.array([abs(way) * math.cos(alpha), turn, 0.0, 0.0])
        np.testing.assert_allclose(law(0.0, q), wanted, rtol=1e-9, atol=1e-12)


def test_a_cars_steering_row_is_a_derivative_beside_its_word():
    """While its memory stands, the angle that is wanted is a function of q; J has its derivative, scaled."""
    robot = nmm.load("car_base")
    rng = np.random.default_rng(4)
    checked = 0
    for q in random_starts(robot, 12):
        program = Program(robot, [nmm.Parking(*POSE)])
        program.lay_out()
        program.evaluate(0.0, q)  # remembers a word
        program.stands[()] = 1
        q += rng.uniform(-1.0, 1.0, 4) * [0.02, 0.02, 0.02, 0.3]
        here = program.evaluate(0.0, q)[0].value_q
        steps = 1e-6 * np.eye(robot.n)
        slopes = [
            program.evaluate(0.0, q + h)[0].value[1] - program.evaluate(0.0, q - h)[0].value[1] for h in steps
        ]
        if np.abs(here[1, :3]).max() == 0.0:  # at its widest
            continue
        np.testing.assert_allclose(here[1], np.array(slopes) / 2e-6 / parking.STEERS, rtol=1e-5, atol=1e-7)
        checked += 1
    assert checked >= 6


def test_what_it_remembers_is_a_samples():
    """Looking, elsewhere too, changes no later sample; a reset forgets; the stages of rk4 do not decide."""
    law = controller("car_base")
    q, far = random_starts(law.robot, 2)
    new = law.solver.sample.snapshot()
    law.evaluate(0.0, q)
    law.solver.errors(np.zeros(1), far[np.newaxis])
    for before, after in zip(new, law.solver.sample.snapshot(), strict=True):
        np.testing.assert_array_equal(before, after)
    first, on = law(0.0, q), law(0.02, q + 0.01)
    assert not np.array_equal(law.solver.sample.snapshot()[1], new[1], equal_nan=True)
    law.reset()
    np.testing.assert_array_equal(law(0.0, q), first)
    law.velocity(0.01, far)
    np.testing.assert_array_equal(law(0.02, q + 0.01), on)
    law.reset()
    run = nmm.simulate(law, q, 60.0, 0.02, "rk4", until=GOAL)
    again = nmm.simulate(law, q, 60.0, 0.02, "rk4", until=GOAL)
    assert run.complete
    np.testing.assert_array_equal(run.q, again.q)


@pytest.mark.parametrize(
    ("name", "platform"),
    [("omni_base", None), ("omni_base", "mecanum"), ("unicycle_2r", "fixed"), ("trailer_base", None)],
)
def test_other_platforms_are_refused(name, platform):
    robot = nmm.load(name, platform=platform)
    with pytest.raises(InputError) as error:
        nmm.Parking().rows(robot)
    assert error.value.expected


@pytest.mark.parametrize("given", [{"within": 0.0}, {"x": math.nan}, {"theta": "north"}])
def test_numbers_are_checked(given):
    with pytest.raises(InputError, match="parking: "):
        nmm.Parking(**given)


def test_a_scenario_parks():
    task = [
        {"kind": "parking", "x": 1, "y": "2", "theta": "pi/2", "reference": [0, 0], "gain": 2},
        {"kind": "posture", "of": ["q1", "q2"], "reference": [0.5, 1], "priority": 2},
    ]
    given = {"task": task, "resolver": {"kind": "pg"}, "objective": None, "duration": 20, "dt": 0.02}
    limits = {"velocity": {"platform": 1, "arm": 1}}
    until = {"m": 0.001, "rad": 0.001}
    run = nmm.Scenario.load("unicycle_2r_position", {**given, "limits": limits, "until": until}).run()
    assert run.complete
    assert max(off(run.q[-1], (1.0, 2.0, math.pi / 2))) < 0.001
