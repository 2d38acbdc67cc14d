"""Encoders to configurations: absolute ones by name, and odometry against the platforms' own G."""

from __future__ import annotations

import math
import re
import runpy
import warnings
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest
from gripping import folding, hitched
from helpers.bundled_bases import BASES
from places import PANDA, ROOT
from scipy.integrate import solve_ivp

import nmm
from nmm.base.arrays import Array
from nmm.base.errors import InputError
from nmm.model.robots.robot import Robot
from nmm.model.robots.wheel_rates import wheel_rates, wheel_shares

CASES: dict[str, dict[str, str]] = {
    **BASES,
    "unicycle_2r": {},
}
Readings = dict[str, float]


@cache
def base(case: str) -> Robot:
    return nmm.load(case.split()[0], **CASES[case])  # type: ignore[arg-type]  # of the keyword platform


def inputs_of(robot: Robot, size: float = 1.0) -> Callable[[float], Array]:
    """Inputs that change; wheels turn faster than joints."""
    p = robot.platform
    fast = np.array([8.0 if unit == "rad/s" and name not in ("omega", "steering_rate") else 1.0
                     for name, unit in zip(p.inputs, p.input_units, strict=True)])  # fmt: skip
    scale = np.concatenate([fast, np.ones(robot.n_u - p.p)]) * size

    def at(t: float) -> Array:
        return scale * np.array([0.6 + 0.1 * math.sin(2 * t), 0.5 * math.cos(3 * t), -0.3, 0.2])[: robot.n_u]

    return at


def driven(robot: Robot, u: Callable[[float], Array], t: Array) -> tuple[Array, list[Readings]]:
    """q (N, n) by q_dot = S(q) u, and what encoders of wheels and joints read, integrated with it."""
    names, rows = wheel_rates(robot)

    def rate(now: float, state: Array) -> Array:
        q = state[: robot.n]
        q_dot = robot.S(q) @ u(now)
        return np.concatenate([q_dot, wheel_shares(rows, q[np.newaxis])[0] @ q_dot])

    first = np.concatenate([robot.rest, np.zeros(len(names))])
    solved = solve_ivp(rate, (t[0], t[-1]), first, "DOP853", t, rtol=1e-12, atol=1e-12)
    joints = solved.y[3 : robot.n].T
    wheels = solved.y[robot.n :].T
    return solved.y[: robot.n].T, [
        {**dict(zip(robot.q_names[3:], q, strict=True)), **dict(zip(names, w, strict=True))}
        for q, w in zip(joints, wheels, strict=True)
    ]


def held(robot: Robot, dt: float, count: int) -> tuple[Array, list[Readings]]:
    """Driven with inputs that are held for dt, s, each."""
    u = inputs_of(robot)
    q, readings = [robot.rest], [dict.fromkeys((*robot.q_names[3:], *wheel_rates(robot)[0]), 0.0)]
    readings[0] |= dict(zip(robot.q_names[3:], robot.rest[3:], strict=True))
    for k in range(count):
        names, rows = wheel_rates(robot)

        def rate(_: float, state: Array, k: int = k, rows: Array = rows) -> Array:
            q_dot = robot.S(state[: robot.n]) @ u(k * dt)
            return np.concatenate([q_dot, wheel_shares(rows, state[np.newaxis, : robot.n])[0] @ q_dot])

        first = np.concatenate([q[-1], [readings[-1][name] for name in names]])
        end = solve_ivp(rate, (0.0, dt), first, "DOP853", rtol=1e-13, atol=1e-13).y[:, -1]
        q.append(end[: robot.n])
        readings.append(dict(zip((*robot.q_names[3:], *names), end[3:], strict=True)))
    return np.array(q), readings


@pytest.mark.parametrize("case", CASES)
def test_odometry_is_what_the_platforms_own_G_says(case: str) -> None:
    """Inputs held for a sample each, as controllers hold them: to 1e-9 m and rad, far along arcs where no
    joint steers (a sample turns by up to 0.5 rad), at 10 ms where one does."""
    robot = base(case)
    dt, count = (0.01, 100) if any("steering" in name for name in robot.u_names) else (0.4, 20)
    q, readings = held(robot, dt, count)
    odometry = robot.odometry(q[0], readings[0])
    for reading, expected in zip(readings[1:], q[1:], strict=True):
        np.testing.assert_allclose(odometry.update(reading), expected, rtol=0, atol=1e-9)


def test_steering_costs_the_fifth_power_of_the_step() -> None:
    robot, errors = base("car_base"), []
    for dt, count in ((0.2, 5), (0.1, 10)):
        t = np.arange(count + 1) * dt

        def u(now: float) -> Array:
            return np.array([0.6, 0.5])

        q, readings = driven(robot, u, t)
        odometry = robot.odometry(q[0], readings[0])
        end = [odometry.update(one) for one in readings[1:]][-1]
        errors.append(float(np.abs(end - q[-1]).max()))
    assert 12.0 < errors[0] / errors[1] < 22.0  # 2⁴ over a whole way
    assert errors[0] < 1e-4


def test_a_hitch_without_encoder_follows_as_it_rolls() -> None:
    robot = base("trailer_base")
    q, readings = held(robot, 0.02, 50)
    odometry = robot.odometry(q[0], readings[0])
    for reading in readings[1:]:
        end = odometry.update({name: value for name, value in reading.items() if "hitch" not in name})
    np.testing.assert_allclose(end, q[-1], rtol=0, atol=1e-7)


def test_odometry_of_the_inputs_is_that_of_simulated_disturbances() -> None:
    """What a simulated controller believes by odometry is what the object here makes of the same counts."""
    robot = nmm.load("unicycle_2r")
    task = nmm.Task(nmm.Position("ee", "xy"), [0.5, 1.0], gain=2.0)
    worn = nmm.Disturbances(slip={"v": 0.9, "omega": 0.8}, odometry=True)
    controller = nmm.Controller(robot, task, nmm.ProjectedGradient())
    run = nmm.simulate(controller, robot.q({"q1": 0.4, "q2": 0.5}), 1.0, 0.01, "zoh", disturbances=worn)
    counts = np.vstack([np.zeros(2), np.cumsum(run.u[:-1, :2] * np.diff(run.t)[:, np.newaxis], axis=0)])
    assert run.believed is not None
    for slip, expected in ((1.0, run.believed), ({"v": 0.9, "omega": 0.8}, run.q)):
        rows = zip(counts, run.q, strict=True)
        read = [{"v": v, "omega": w, "q1": q[3], "q2": q[4]} for (v, w), q in rows]
        odometry = robot.odometry(run.q[0], read[0], slip=slip)
        found = np.array([odometry.update(one) for one in read])
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9)
    assert np.abs(run.believed - run.q).max() > 0.01


@pytest.mark.parametrize("case", ["differential_base", "omni_base"])
def test_the_covariance_is_carried_as_differences_of_the_way_say(case: str) -> None:
    """To first order: the end's derivative in each wheel's turning on each step, by central differences."""
    robot, spread, slip = base(case), 1e-4, 0.95
    names = [*robot.wheel_speeds(np.zeros(robot.platform.p))]
    steps = np.array(
        [robot.wheel_speeds(inputs_of(robot)(t)[: robot.platform.p])[n] for t in range(5) for n in names]
    )

    def end(turned: Array) -> nmm.Odometry:
        odometry = robot.odometry(robot.rest, dict.fromkeys(names, 0.0), slip=slip, spread=spread)
        for read in np.cumsum(turned.reshape(5, -1), axis=0):
            odometry.update(dict(zip(names, read, strict=True)))
        return odometry

    h = 1e-4
    D = np.array(
        [(end(steps + one).q - end(steps - one).q)[:3] / (2 * h) for one in h * np.eye(len(steps))]
    ).T
    expected = D * (spread * np.abs(steps)) @ D.T
    np.testing.assert_allclose(end(steps).covariance, expected, rtol=0, atol=1e-6 * np.abs(expected).max())
    assert np.abs(expected[0, 2]) > 0.05 * np.sqrt(expected[0, 0] * expected[2, 2])  # no diagonal matrix


def test_a_localisation_puts_it_right_without_turning_it_back() -> None:
    robot = base("differential_base")
    zero = {"left_wheel_joint": 0.0, "right_wheel_joint": 0.0}
    odometry = robot.odometry(robot.rest, zero, spread=1e-4)
    odometry.update({"left_wheel_joint": -20.0, "right_wheel_joint": 20.0})
    turned = odometry.q[2]
    assert turned > math.pi
    odometry.correct([1.0, 2.0, math.remainder(turned + 0.01, 2 * math.pi)], np.diag([1e-4, 1e-4, 1e-6]))
    np.testing.assert_allclose(odometry.q[:3], [1.0, 2.0, turned + 0.01], atol=1e-12)
    assert odometry.covariance[0, 0] == 1e-4


@pytest.mark.parametrize("case", CASES)
def test_wheel_speeds_and_back(case: str) -> None:
    robot = base(case)
    q, up = robot.rest, inputs_of(robot)(0.3)[: robot.platform.p]
    speeds = robot.wheel_speeds(up, q)
    steering = {"steering_rate": up[1]} if "steering_rate" in robot.u_names else {}
    np.testing.assert_allclose(robot.platform_inputs({**speeds, **steering}, q), up, atol=1e-12)


def test_counters_that_say_too_little_are_named() -> None:
    car, omni = base("car_base"), nmm.load("omni_base", platform="omnidirectional")
    with pytest.raises(InputError) as error:
        car.platform_inputs({"rear_left_wheel_joint": 1.0, "rear_right_wheel_joint": 1.0})
    assert "steering_rate" in error.value.what
    readings = dict.fromkeys(omni.wheel_speeds([0, 0, 0]), 0.0)
    with pytest.raises(InputError) as error:
        omni.odometry(omni.rest, readings)
    assert "vy" in error.value.what
    with pytest.raises(InputError):
        nmm.load("unicycle_3r", platform="fixed").odometry([0, 0, 0], {})
    odometry = base("differential_base").odometry(
        np.zeros(3), {"left_wheel_joint": 0.0, "right_wheel_joint": 0.0}
    )
    for wrong in ({"left_wheel_joint": 1.0}, {"left_wheel_joint": 1.0, "right_wheel_joint": math.nan}):
        with pytest.raises(InputError, match="right_wheel_joint"):
            odometry.update(wrong)
    np.testing.assert_array_equal(odometry.q, np.zeros(3))


def test_a_counter_that_no_robot_reaches_is_refused_without_times_too() -> None:
    robot = nmm.load("differential_base")
    still = {"left_wheel_joint": 0.0, "right_wheel_joint": 0.0}
    odometry = robot.odometry(robot.rest, still)
    with pytest.raises(InputError, match="jumped: it cannot turn so far between two readings"):
        odometry.update(dict.fromkeys(still, 1e308))
    assert odometry.update(dict.fromkeys(still, 10.0))[0] == pytest.approx(1.0)


def test_a_counter_that_jumps_by_a_turn_is_refused() -> None:
    robot, names = base("differential_base"), ("left_wheel_joint", "right_wheel_joint")
    odometry = robot.odometry(robot.rest, dict.fromkeys(names, 0.0), fastest={names[1]: 15.0, names[0]: 15.0})
    for k in range(1, 51):  # at their fastest, stamps off by half a period
        odometry.update(dict.fromkeys(names, 0.15 * k), 0.01 * k + (0.005 if k % 2 else 0.0))
    believed = odometry.q
    for missed in (1, 5):
        reading = {names[0]: 7.5, names[1]: 7.5 + 2 * math.pi}
        with pytest.raises(InputError, match=names[1]):
            odometry.update(reading, 0.5 + 0.01 * missed)
    np.testing.assert_array_equal(odometry.q, believed)
    odometry.update(dict.fromkeys(names, 8.4), 0.56)
    usual = robot.odometry(robot.rest, dict.fromkeys(names, 0.0))  # the file's limit, 30 rad/s
    usual.update(dict.fromkeys(names, 7.5), 0.0)
    with pytest.raises(InputError, match=names[0]):
        usual.update(dict.fromkeys(names, 0.0), 0.1)
    np.testing.assert_allclose(usual.update(dict.fromkeys(names, 8.4)), odometry.q, atol=1e-12)


WHEELS = ("left_wheel_joint", "right_wheel_joint")


def rolled(steps: Array, turn: str, start: float = 0.0, dt: float | None = None, **options: Any) -> Array:
    """q of wheels that turn by steps (N, 2), rad, read as they are, in (-π, π] or in [0, 2π)."""
    robot = base("differential_base")
    angles = start + np.vstack([np.zeros(2), np.cumsum(steps, axis=0)])
    if turn == "half":
        angles = np.pi - np.remainder(np.pi - angles, 2 * np.pi)
    elif turn == "whole":
        angles = np.remainder(angles, 2 * np.pi)
    readings = [dict(zip(WHEELS, row, strict=True)) for row in angles.tolist()]
    odometry = robot.odometry(robot.rest, readings[0], **options)
    for k, now in enumerate(readings[1:], 1):
        odometry.update(now, None if dt is None else k * dt)
    return np.asarray(odometry.q)


@pytest.mark.parametrize(
    ("turn", "start", "dt", "options"),
    [  # each two of their values together
        ("half", 0.0, None, {}),
        ("half", 3.14, 0.02, {"wrapped": True}),
        ("half", -2.0, None, {"wrapped": [*WHEELS]}),
        ("half", -2.0, 0.02, {}),
        ("whole", 0.0, 0.02, {"wrapped": [*WHEELS]}),
        ("whole", 0.0, None, {"wrapped": True}),
        ("whole", 3.14, None, {}),
        ("whole", 3.14, 0.02, {"wrapped": [*WHEELS]}),
        ("whole", -2.0, None, {"wrapped": True}),
    ],
)
@pytest.mark.filterwarnings("ignore:.*read within one turn:RuntimeWarning")
def test_wheels_that_are_read_within_one_turn(
    turn: str, start: float, dt: float | None, options: dict[str, Any]
) -> None:
    """There and back, steps up to 0.5 rad, ahead and on the spot: the way is that by counters."""
    phase = np.linspace(0.0, 4 * np.pi, 400)
    steps = np.column_stack([0.5 * np.sin(phase) + 0.02, 0.45 * np.cos(phase)])
    counted = rolled(steps, "on", dt=dt)
    np.testing.assert_allclose(rolled(steps, turn, start, dt, **options), counted, atol=1e-9)


def test_who_reads_within_one_turn_is_told_once_a_wheel() -> None:
    steps = np.full((100, 2), 0.2)
    with pytest.warns(RuntimeWarning, match="within one turn") as heard:
        rolled(steps, "half")
    assert len(heard) == 2
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        rolled(steps, "half", wrapped=True)
        rolled(steps, "on")
        rolled(-steps, "on")


@pytest.mark.parametrize(
    ("steps", "options", "named"),
    [
        ([0.3, 2.6], {"wrapped": True}, "half a turn"),  # 0.83 of half a turn
        ([0.3, 0.3], {"wrapped": True, "dt": 0.5}, "half a turn"),  # 30 rad/s may have been
        ([0.1, 0.1, 2.3, 2.3], {}, "wrapped=True"),  # 1.87 → -1.48 or -3.98 the other way
        ([0.3, 8.0, 0.1], {"wrapped": True, "turn": "on"}, "as wrapped= says"),
    ],
)
def test_turns_that_could_be_others_are_refused_by_name(
    steps: list[float], options: dict[str, Any], named: str
) -> None:
    turned = np.column_stack([steps, np.zeros(len(steps))])
    with pytest.raises(InputError, match=named) as error:
        rolled(turned, **{"turn": "half", "start": 1.0, **options})
    assert WHEELS[0] in str(error.value)


def test_wrapped_names_wheels() -> None:
    robot, zero = base("differential_base"), dict.fromkeys(WHEELS, 0.0)
    with pytest.raises(InputError, match="wrapped"):
        robot.odometry(robot.rest, zero, wrapped=["wheel"])
    one = robot.odometry(robot.rest, zero, wrapped=WHEELS[0])
    for k in range(1, 60):
        one.update({WHEELS[0]: math.remainder(0.2 * k, 2 * math.pi), WHEELS[1]: 0.2 * k})
    np.testing.assert_allclose(one.q, [0.1 * 0.2 * 59, 0, 0], atol=1e-9)
    far = robot.odometry(robot.rest, zero)  # counters that are read seldom
    for turned in (6.0, 12.0, 5.0):
        far.update(dict.fromkeys(WHEELS, turned))
    np.testing.assert_allclose(far.q, [0.5, 0, 0], atol=1e-9)


def test_encoders_by_name_in_any_order() -> None:
    robot = nmm.load("unicycle_2r")
    q = robot.q_from({"right_wheel_joint": 99.0, "q2": 0.2, "q1": 0.1}, base=[1.0, 2.0, 0.3])
    np.testing.assert_array_equal(q, [1.0, 2.0, 0.3, 0.1, 0.2])
    near = robot.q({"theta": 12.0, "q1": -6.0, "q2": 0.0})
    q = robot.q_from({"q1": 0.1, "q2": 0.2}, [1.0, 2.0, 0.3], near)
    np.testing.assert_allclose(q[2:], [0.3 + 4 * math.pi, 0.1 - 2 * math.pi, 0.2])


@pytest.mark.parametrize(
    ("joints", "pose", "named"),
    [
        ({"q1": 0.1}, [0, 0, 0], "q2"),
        ({"q1": 0.1, "q2": math.nan}, [0, 0, 0], "q2"),
        ({"q1": 0.1, "q2": None}, [0, 0, 0], "q2"),
        ({"q1": 0.1, "q2": 0.2, "q9": 0.0}, [0, 0, 0], "q9"),
        ({"q1": 0.1, "q2": 0.2, "x": 0.0}, [0, 0, 0], "x"),
        ({"q1": 0.1, "q2": 0.2}, None, "base"),
        ({"q1": 0.1, "q2": 0.2}, [0, 0], "base"),
        ({"q1": 0.1, "q2": 0.2}, [0, 0, math.inf], "base"),
    ],
)
def test_what_sensors_do_not_say_is_asked_for(joints: Readings, pose: object, named: str) -> None:
    with pytest.raises(InputError) as error:
        nmm.load("unicycle_2r").q_from(joints, pose)  # type: ignore[arg-type]  # some are wrong
    assert named in str(error.value)


def test_a_joint_that_follows_says_where_its_leader_is() -> None:
    robot, pose = folding(), [0, 0, 0]
    placed = robot.q_from({"q1": 0.3, "q2": 0.5}, pose)
    assert placed[-1] == pytest.approx(-0.7 * 0.3 + 0.2)
    np.testing.assert_array_equal(robot.q_from({"q1": 0.3, "q2": 0.5, "q3": 9.0}, pose), placed)
    np.testing.assert_allclose(robot.q_from({"q3": placed[-1], "q2": 0.5}, pose), placed, atol=1e-15)
    towing = hitched()
    q = towing.q_from({"hitch1": 0.5, "hitch2": 0.0, "q1": 0.2, "q2": 0.0, "q5": 0.0}, pose)
    np.testing.assert_array_equal(q, towing.q({"hitch1": 0.5, "q1": 0.2}))


def test_a_locked_joint_is_where_it_was_locked() -> None:
    robot = nmm.load(PANDA, platform="fixed", lock={"panda_finger_joint1": 0.02})
    joints = dict.fromkeys(robot.q_names, 0.1)
    np.testing.assert_array_equal(
        robot.q_from({**joints, "panda_finger_joint1": 0.025}), np.full(robot.n, 0.1)
    )
    with pytest.raises(InputError, match="locked"):
        robot.q_from({**joints, "panda_finger_joint1": 0.04})
    with pytest.raises(InputError, match="base"):
        robot.q_from(joints, base=[0, 0, 0])


def test_a_cars_wheels_say_its_steering_angle() -> None:
    """By the angles that playback gives its steered wheels."""
    robot = base("car_base")
    for delta in (-0.5, 0.2):
        q = robot.q({"steering": delta})
        run = nmm.playback.Motion(robot, [0.0, 0.1], np.array([q, q]), np.array([[0.5, 0.0], [0.5, 0.0]]))
        joints = [wheel.joint for wheel in robot.wheels] + [w.swivel for w in robot.wheels if w.swivel]
        angles = dict(zip(joints, nmm.playback.wheel_angles(run)[0], strict=True))
        swivels = {name: angles[name] for name in joints if "steer" in name}
        assert len(swivels) == 2
        assert swivels["front_left_steer_joint"] != swivels["front_right_steer_joint"]
        np.testing.assert_allclose(robot.q_from(swivels, [0, 0, 0]), q, atol=1e-12)
        (first, *_) = swivels.items()
        np.testing.assert_allclose(robot.q_from(dict([first]), [0, 0, 0]), q, atol=1e-12)


def test_odometry_of_mujocos_robot_is_off_by_what_its_wheels_slip() -> None:
    """The physics engine of docs/tutorials/robot_loop.md: hard contacts, 2 s along an arc of 1.2 m."""
    pytest.importorskip("mujoco")
    path = ROOT / "docs" / "tutorials" / "mujoco_robot.py"
    made = runpy.run_path(str(path))["MujocoRobot"]
    robot = nmm.load("unicycle_3r", platform="differential")
    hardware = made(robot, robot.q({"q2": 0.6, "q3": 0.8}), [(0.25, 0.0), (-0.25, 0.0)])
    odometry = robot.odometry(hardware.q, hardware.readings())
    for k in range(200):
        speed = min(1.0, k / 50) * np.array([5.0, 7.0, 0, 0, 0])
        hardware.send(speed, 0.01)
        odometry.update(hardware.readings())
    way = np.hypot(*hardware.q[:2])
    assert 0.9 < way < 1.2
    assert hardware.q[2] > 0.5
    off = hardware.q - odometry.q
    assert np.hypot(*off[:2]) < 0.01 * way
    assert abs(off[2]) < 0.01
    np.testing.assert_allclose(off[3:], 0.0, atol=1e-9)


def test_the_page_s_encoders_and_odometry(capsys: pytest.CaptureFixture[str]) -> None:
    page = (ROOT / "docs" / "robots.md").read_text("utf-8")
    section = page.partition("## Encoders and odometry")[2].partition("\n## ")[0]
    found = {"nmm": nmm}
    for code in re.findall(r"```python\n(.*?)```", section, flags=re.DOTALL):
        exec(code, found)
    pose, speeds = capsys.readouterr().out.splitlines()
    assert pose.startswith("[1.0")
    assert "left_wheel_joint" in speeds
    q = found["odometry"].q  # type: ignore[attr-defined]
    np.testing.assert_allclose(q[:3], [1.1, 2.0, 0.32])
    assert q[3] == pytest.approx(-3.0 + 2 * math.pi)  # nearest to 0.1, where q1 was
