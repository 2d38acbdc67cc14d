"""A robot's numbers and robots with others: whatever is changed, the laws of their motion hold."""

from __future__ import annotations

import math
import re
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from ackermann_car import car
from helpers.bundled_bases import BASES
from places import ROOT
from rolling_law import base as on_base
from rolling_law import wheel
from rosbags.typesys import Stores, get_typestore
from scipy.integrate import solve_ivp
from urdf_parts import vehicle, write

import nmm
from nmm.base.arrays import Array
from nmm.base.errors import InputError
from nmm.model.robots.numbers import without_changes
from nmm.model.robots.robot import Robot
from nmm.model.robots.wheel_rates import wheel_rates, wheel_shares
from nmm.plugins.robot.odometry import Counters, counted_wheels
from nmm.views.playback.placements import rolling_joints

CASES: dict[str, dict[str, str]] = {
    **BASES,
    "car_base by its wheels": {"platform": "wheeled"},
    "unicycle_2r": {},
    "kiwi": {},
    "kiwi by its wheels": {"platform": "kiwi by its wheels"},
    "ackermann": {},
    "axes down": {},
}
#: The lengths of each, beside radii, offsets and ratios.
LENGTHS = {
    "differential_base": ["track"],
    "differential_base as a unicycle": ["track"],
    "differential_base by its wheels": ["track"],
    "car_base": ["wheelbase", "track"],
    "car_base with front drive": ["wheelbase", "track"],
    "car_base by its wheels": ["track", "wheelbase"],
    "trailer_base": ["track", "H1", "L1", "H2", "L2"],
    "trailer_base by its wheels": ["track", "hitch.hitch1", "length.hitch1", "hitch.hitch2", "length.hitch2"],
    "omni_base": ["half_length_plus_width"],
    "omni_base with skid steering": ["left", "right", "ahead"],
    "unicycle_2r": ["track"],
    "kiwi": ["wheel_distance"],
    "kiwi by its wheels": ["wheel_distance"],
    "ackermann": ["wheelbase", "track"],
    "axes down": ["wheelbase", "track"],
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("numbers")


@cache
def _loaded(case: str, folder: Path) -> Robot:
    if case.startswith("kiwi"):
        angles = 2.0 * math.pi * np.arange(3) / 3.0
        spokes = [(math.cos(a), math.sin(a)) for a in angles]
        wheels = [
            wheel(f"omni_wheel_{k}", "base_link", f"{0.2 * x!r} {0.2 * y!r} 0.1", f"{-x!r} {-y!r} 0")
            for k, (x, y) in enumerate(spokes)
        ]
        parts = [
            nmm.OmniWheel(f"omni_wheel_{k}", 0.2 * x, 0.2 * y, 0.1, math.atan2(x, -y))
            for k, (x, y) in enumerate(spokes)
        ]
        platform = nmm.WheeledPlatform(parts) if "its" in case else "omnidirectional"
        return nmm.load(write(folder / "kiwi.urdf", on_base(*wheels, name="kiwi")), platform=platform)
    if case == "ackermann":
        return nmm.load(write(folder / "car.urdf", car()))
    if case == "axes down":
        return nmm.load(write(folder / "down.urdf", vehicle("steering", 0.7, up=False)))
    return nmm.load(case.split()[0], **CASES[case])  # type: ignore[arg-type]  # of the keyword platform


def other_values(robot: Robot) -> dict[str, float]:
    """Each number changed by some percent, another for each."""
    values = {}
    for k, (name, number) in enumerate(nmm.robot_numbers(robot).items()):
        values[name] = number.value * (1.03 + 0.01 * k) + (0.02 if number.value == 0.0 else 0.0)
    return values


def some_inputs(robot: Robot) -> Array:
    p = robot.platform
    fast = [8.0 if unit == "rad/s" and name != "omega" and not name.endswith("_rate") else 1.0
            for name, unit in zip(p.inputs, p.input_units, strict=True)]  # fmt: skip
    return np.array(fast) * np.array([0.6, 0.45, -0.3])[: p.p]


@pytest.mark.parametrize("case", CASES)
def test_numbers_by_name_in_order(case: str, folder: Path) -> None:
    robot = _loaded(case, folder)
    arm = {*robot.q_names[robot.platform.n_p :]}
    numbers = {name: one for name, one in nmm.robot_numbers(robot).items() if one.of not in arm}
    kinds = [number.kind for number in numbers.values()]
    wheels = wheel_rates(robot)[0]
    assert [*numbers][: len(wheels)] == [f"radius.{joint}" for joint in wheels]
    middle = [n for n in numbers if not n.startswith(("radius.", "offset.", "ratio."))]
    assert middle == LENGTHS[case]
    assert kinds.count("offset") == kinds.count("ratio")
    assert all(n.value == n.nominal for n in numbers.values())
    for number in numbers.values():
        assert number.unit == {"offset": "rad", "ratio": "1"}.get(number.kind, "m")
    steered = {"car_base by its wheels": 2, "car_base": 1, "car_base with front drive": 1}
    steered |= {"ackermann": 1, "axes down": 1}
    assert kinds.count("offset") == steered.get(case, 0)


@pytest.mark.parametrize("case", CASES)
def test_unchanged_numbers_change_nothing(case: str, folder: Path) -> None:
    robot = _loaded(case, folder)
    numbers = nmm.robot_numbers(robot)
    assert nmm.with_numbers(robot, {}) is robot
    assert nmm.with_numbers(robot, {name: number.value for name, number in numbers.items()}) is robot
    changed = nmm.with_numbers(robot, other_values(robot))
    assert changed.nominal == {name: number.value for name, number in numbers.items()}
    back = without_changes(changed)
    assert (back.nominal, back.corrections) == ({}, {})
    wheels = counted_wheels(robot)
    for ours, theirs in zip(
        Counters(back, dict.fromkeys(wheels, 0.0), "back").record,
        Counters(robot, dict.fromkeys(wheels, 0.0), "robot").record,
        strict=True,
    ):
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-14)
    np.testing.assert_allclose(back.q_limits, robot.q_limits, rtol=0, atol=1e-14)
    for own, other in zip(back.model.jointPlacements, robot.model.jointPlacements, strict=True):
        np.testing.assert_allclose(own.homogeneous, other.homogeneous, rtol=0, atol=1e-14)


@pytest.mark.parametrize("case", CASES)
def test_what_is_changed_is_read_back(case: str, folder: Path) -> None:
    robot = _loaded(case, folder)
    values = other_values(robot)
    changed = nmm.with_numbers(robot, values)
    read = nmm.robot_numbers(changed)
    assert [*read] == [*values]
    for name, value in values.items():
        assert read[name].value == pytest.approx(value, rel=1e-13), name
        assert read[name].nominal == nmm.robot_numbers(robot)[name].value
    one_by_one = robot
    for name, value in reversed(values.items()):
        if name == "left":  # on its way it would cross the other
            continue
        one_by_one = nmm.with_numbers(one_by_one, {name: value})
    one_by_one = nmm.with_numbers(one_by_one, values)
    np.testing.assert_allclose(wheel_rates(one_by_one)[1], wheel_rates(changed)[1], rtol=0, atol=1e-13)
    np.testing.assert_allclose(one_by_one.platform.parameters, changed.platform.parameters, rtol=1e-13)
    np.testing.assert_allclose(one_by_one.q_limits, changed.q_limits, rtol=0, atol=1e-13)
    assert [*robot.platform.parameters] == [*_loaded(case, folder).platform.parameters]  # itself unchanged


@pytest.mark.parametrize("case", CASES)
def test_the_laws_of_the_changed_platform(case: str, folder: Path) -> None:
    """A G = 0; the inputs' wheel speeds give the inputs; a wheel's speed is that of the point at which it
    touches the ground, along its grip, over its radius."""
    robot = _loaded(case, folder)
    changed = nmm.with_numbers(robot, other_values(robot))
    rng, platform = np.random.default_rng(3), changed.platform
    for _ in range(5):
        q = changed.rest.copy()
        q[2] = rng.uniform(-3, 3)
        turned = rng.uniform(-0.3, 0.3, platform.n_p - 3)
        q[3 : platform.n_p] = turned if "by its wheels" not in case or "car" not in case else 0.0
        G = platform.G(q[: platform.n_p])
        np.testing.assert_allclose(platform.A(q[: platform.n_p]) @ G, 0.0, atol=1e-13)
        up = some_inputs(changed)
        speeds = changed.wheel_speeds(up, q)
        steering = {name: float(up[i]) for i, name in enumerate(platform.inputs) if name.endswith("_rate")}
        counted = {name: speeds[name] for name in counted_wheels(changed)} | steering
        if len(counted) >= platform.p:
            np.testing.assert_allclose(changed.platform_inputs(counted, q), up, atol=1e-11)
        for joint, speed in speeds.items():
            assert speed == pytest.approx(_rolled(changed, joint, q, G @ up), abs=1e-11), joint


def _rolled(robot: Robot, joint: str, q: Array, qp_dot: Array) -> float:
    """The wheel's speed by the velocity of what carries it, from Pinocchio's placements."""
    (own,) = (one for one in robot.wheels if one.joint == joint)
    q_dot = np.zeros(robot.n)
    q_dot[: robot.platform.n_p] = qp_dot
    if own.swivel:  # Ackermann: its axis passes the point about which the car turns
        (row,) = (row for name, row in zip(*wheel_rates(robot), strict=True) if name == joint)
        return float(wheel_shares(row[np.newaxis], q[np.newaxis])[0, 0] @ q_dot)
    data = robot.model.createData()
    pin.computeJointJacobians(robot.model, data, q)
    index = robot.model.getJointId(own.carrier)
    placement = data.oMi[index]
    jacobian = pin.getJointJacobian(robot.model, data, index, pin.LOCAL_WORLD_ALIGNED)
    linear, angular = (jacobian @ q_dot)[:3], (jacobian @ q_dot)[3:]
    velocity = linear + np.cross(angular, placement.rotation @ own.rolls_at)
    axis = placement.rotation @ own.axis
    ahead = np.cross(axis, [0, 0, 1])
    grip = math.cos(own.roller) * ahead + math.sin(own.roller) * np.cross([0, 0, 1], ahead)
    return float(velocity @ grip) / (own.radius * math.cos(own.roller))


# Steered wheels that follow others leave an input that no wheel's count shows.
@pytest.mark.parametrize("case", [case for case in CASES if case != "car_base by its wheels"])
def test_odometry_counts_as_the_changed_robot_moves(case: str, folder: Path) -> None:
    """Inputs held for a second; wheels as playback turns them, joints as their encoders read."""
    robot = _loaded(case, folder)
    changed = nmm.with_numbers(robot, other_values(robot))
    wheels = counted_wheels(changed)
    steered = [name for name in changed.platform.inputs if name.endswith("_rate")]
    u = np.zeros(changed.n_u)
    u[: changed.platform.p] = some_inputs(changed)
    t = np.linspace(0.0, 1.0, 101)
    motion = nmm.playback.Motion(changed, t, *_driven(changed, u, t))
    turned = dict(zip(rolling_joints(changed), nmm.playback.wheel_angles(motion).T, strict=True))
    store = get_typestore(Stores.ROS2_HUMBLE).types
    messages = nmm.ros.Messages(changed, store)
    readings = [
        {**nmm.ros.joints(messages.joint_state(s, q)), **{name: float(turned[name][k]) for name in wheels}}
        for k, (s, q) in enumerate(zip(t, motion.q, strict=True))
    ]
    odometry = changed.odometry(motion.q[0], readings[0], wrapped=False)
    for reading in readings[1:]:
        end = odometry.update(reading)
    n_p = changed.platform.n_p
    tolerance = 2e-5 if steered or "hitch" in str(changed.q_names) else 1e-9
    np.testing.assert_allclose(end[:n_p], motion.q[-1][:n_p], atol=tolerance)
    uncorrected = robot.odometry(motion.q[0], readings[0], wrapped=False)
    for reading in readings[1:]:
        off = uncorrected.update(reading)
    assert np.linalg.norm(off[:3] - motion.q[-1][:3]) > 1e-3  # a changed number is felt


def _driven(robot: Robot, u: Array, t: Array) -> tuple[Array, Array]:
    def rate(_: float, q: Array) -> Array:
        return robot.S(q) @ u

    solved = solve_ivp(rate, (t[0], t[-1]), robot.rest, "DOP853", t, rtol=1e-12, atol=1e-12)
    return solved.y.T, np.tile(u, (len(t), 1))


def test_inputs_keep_their_meaning_where_radii_differ() -> None:
    """A differential drive's inputs are wheel speeds of one radius: the mean of both."""
    robot = nmm.with_numbers(
        nmm.load("differential_base"), {"radius.left_wheel_joint": 0.098, "radius.right_wheel_joint": 0.104}
    )
    assert robot.platform.radius == pytest.approx(0.101, rel=1e-15)
    speeds = robot.wheel_speeds([9.0, 10.0])
    assert speeds["left_wheel_joint"] * 0.098 == pytest.approx(9.0 * 0.101)
    assert speeds["right_wheel_joint"] * 0.104 == pytest.approx(10.0 * 0.101)
    np.testing.assert_allclose(robot.platform_inputs(speeds), [9.0, 10.0], rtol=1e-14)


def test_joints_are_read_with_ratio_and_offset_and_written_back(folder: Path) -> None:
    """coordinate = ratio * reading + offset, after the file's sign; limits are those of the readings."""
    store = get_typestore(Stores.ROS2_HUMBLE).types
    for case, sign in (("car_base", 1.0), ("axes down", -1.0)):
        robot = _loaded(case, folder)
        changed = nmm.with_numbers(robot, {"offset.steering": 0.05, "ratio.steering": 0.9})
        assert changed.corrections == {"steering": (0.9, 0.05)}
        rest = dict.fromkeys(changed.q_names[4:], 0.0)
        q = changed.q_from({"steering": 0.2 * sign, **rest}, base=(0, 0, 0))
        assert q[3] == pytest.approx(0.9 * 0.2 + 0.05)
        lower, upper = robot.model.lowerPositionLimit[3], robot.model.upperPositionLimit[3]
        limits = [changed.model.lowerPositionLimit[3], changed.model.upperPositionLimit[3]]
        np.testing.assert_allclose(limits, 0.9 * np.array([lower, upper]) + 0.05, rtol=1e-14)
        assert changed.u_limits[1] == pytest.approx(0.9 * robot.u_limits[1])
        messages = nmm.ros.Messages(changed, store)
        u = np.zeros(changed.n_u)
        u[1] = 0.9 * 0.3
        state = messages.joint_state(0.0, q, changed.S(q) @ u)
        assert nmm.ros.joints(state)["steering"] == pytest.approx(0.2 * sign, abs=1e-15)
        assert nmm.ros.rates(state)["steering"] == pytest.approx(0.3 * sign, abs=1e-15)
        np.testing.assert_allclose(changed.q_from(nmm.ros.joints(state), (0, 0, 0)), q, atol=1e-15)
        found = nmm.ros.inputs(changed, q, [0.0, 0.0, 0.0], nmm.ros.rates(state))
        np.testing.assert_allclose(found, u, atol=1e-14)


def test_an_ackermann_car_s_wheels_make_the_angle_that_is_corrected(folder: Path) -> None:
    robot = _loaded("ackermann", folder)
    changed = nmm.with_numbers(robot, {"offset.steer": -0.04, "ratio.steer": 1.1})
    for delta in (-0.4, 0.0, 0.3):
        q = robot.q({"steer": delta})
        read = {name: angle for name, (angle, _) in robot.swivel_readings(q, np.zeros(robot.n)).items()}
        assert {*read} == {"left_steering_joint", "right_steering_joint"}
        np.testing.assert_allclose(robot.q_from(read, (0, 0, 0)), q, atol=1e-14)
        assert changed.q_from(read, (0, 0, 0))[3] == pytest.approx(1.1 * delta - 0.04)
        at = changed.q_from(read, (0, 0, 0))
        rates = np.zeros(robot.n)
        rates[3] = 0.2
        back = changed.swivel_readings(at, rates)
        later = changed.swivel_readings(at + 1e-6 * rates, rates)
        for name, (angle, rate) in back.items():
            assert angle == pytest.approx(read[name], abs=1e-14)
            assert (later[name][0] - angle) / 1e-6 == pytest.approx(rate, abs=1e-6)


def test_a_mounted_arm_leaves_the_numbers() -> None:
    values = {"radius.left_wheel_joint": 0.09, "track": 0.56}
    base = nmm.with_numbers(nmm.load("differential_base"), values)
    mounted = nmm.mount(base, "small_arm")
    assert mounted.changed_numbers == values
    np.testing.assert_array_equal(wheel_rates(mounted)[1], wheel_rates(base)[1])
    np.testing.assert_allclose(mounted.platform.parameters, base.platform.parameters, rtol=1e-15)
    car = nmm.with_numbers(nmm.load("car_base"), {"wheelbase": 0.72, "offset.steering": 0.1})
    on_car = nmm.mount(car, "small_arm")
    np.testing.assert_allclose(wheel_rates(on_car)[1], wheel_rates(car)[1], rtol=0, atol=1e-15)
    assert on_car.corrections == car.corrections


@pytest.mark.parametrize(
    ("name", "values", "told"),
    [
        ("differential_base", {"trak": 0.5}, "did you mean"),
        ("differential_base", {"track": 0.0}, "above 0"),
        ("differential_base", {"track": math.nan}, "finite"),
        ("differential_base", {"radius.left_wheel_joint": -0.1}, "above 0"),
        ("car_base", {"ratio.steering": 0.0}, "other than 0"),
        ("car_base", {"offset.steering": 4.0}, "3.14"),
        ("car_base", {"track": 0.005}, "more than 0.01 m"),
        ("trailer_base", {"track": 1e-9}, "more than 0.01 m"),
        ("differential_base", [("track", 0.5)], "a value for each number's name"),
    ],
)
def test_bad_values_are_refused_by_name(name: str, values: object, told: str) -> None:
    robot = nmm.load(name)
    with pytest.raises(InputError) as error:
        nmm.with_numbers(robot, values)  # type: ignore[arg-type]
    assert told in str(error.value), error.value


def test_centres_of_rotation_keep_their_order() -> None:
    robot = nmm.load("omni_base", platform="skid_steer")
    with pytest.raises(InputError) as error:
        nmm.with_numbers(robot, {"left": -0.3})
    assert "left above right" in str(error.value)
    assert nmm.robot_numbers(robot)["left"].value == 0.25


def test_without_wheels_a_radius_is_that_of_all() -> None:
    robot = nmm.load("small_arm", platform=nmm.DifferentialDrive(0.1, 0.5))
    assert [*nmm.robot_numbers(robot)][:3] == ["radius", "track", "offset.q1"]
    changed = nmm.with_numbers(robot, {"radius": 0.11, "track": 0.6})
    np.testing.assert_array_equal(changed.platform.parameters, [0.11, 0.6])
    np.testing.assert_array_equal(robot.platform.parameters, [0.1, 0.5])
    fixed = nmm.load("small_arm", platform="fixed")
    assert {number.of for number in nmm.robot_numbers(fixed).values()} == {*fixed.q_names}


def test_the_page_s_numbers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    text = (ROOT / "docs" / "robots.md").read_text(encoding="utf-8")
    section = text.split("## This very robot's numbers")[1].split("\n## ")[0]
    (code,) = re.findall(r"```python\n(.*?)```", section, flags=re.DOTALL)
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {"nmm": nmm}
    exec(code, names)
    assert names["mine"].changed_numbers == {"radius.left_wheel_joint": 0.0985, "track": 0.56}
    told = capsys.readouterr().out
    assert "wheel_radius:=0.0985" in told
    assert "radius.right_wheel_joint = 0.1 stays in calibration.yaml" in told
    listed = eval(re.search(r"# (\{.*\})", code)[1])  # type: ignore[index]
    assert listed == {name: number.value for name, number in nmm.robot_numbers(names["robot"]).items()}
