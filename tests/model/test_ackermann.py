"""A car of a file with two wheels that steer and no joint between them: rolling, limits, refusals."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from ackermann_car import RADIUS, RATE, SPIN, STOP, TRACK, WHEELBASE, car
from findings import of_code, refused
from urdf_parts import write

import nmm
from nmm.cli.exit_status import status_of
from nmm.model.platforms import Car, FrontDriveCar
from nmm.model.robots.robot import Robot
from nmm.views.playback.placements import Placements
from nmm.views.playback.rolling import Rolling

Array = np.ndarray


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return write(tmp_path / "car.urdf", car())


def drawn(robot: Robot, q: Array) -> dict[str, float]:
    """Angles at which playback draws wheels and swivels, rad."""
    rolling = Rolling(robot)
    return dict(zip(rolling.joints, rolling.settled(q), strict=True))


def contact_speeds(robot: Robot, q: Array, u: Array) -> Array:
    """Velocity (3,) of the point of each wheel that touches the ground, m/s, as playback draws the motion."""
    rolling, model = Rolling(robot), robot.display_model
    angles = rolling.settled(q)
    at = Placements(robot).configuration(q, angles)
    velocity = np.zeros(model.nv)
    rates = dict(zip(rolling.joints, rolling.rates(q, u, angles), strict=True))
    rates |= dict(zip(robot.q_names, robot.S(q) @ u, strict=True))
    for name, rate in rates.items():
        velocity[model.joints[model.getJointId(name)].idx_v] = rate
    data = model.createData()
    pin.forwardKinematics(model, data, at, velocity)
    found = []
    for wheel in robot.wheels:
        joint = model.getJointId(wheel.joint)
        motion = pin.getVelocity(model, data, joint, pin.LOCAL_WORLD_ALIGNED)
        found.append(motion.linear + np.cross(motion.angular, [0.0, 0.0, -RADIUS]))
    return np.array(found)


@pytest.mark.parametrize("platform", [None, "car", "front_drive_car", Car(WHEELBASE, steering="steer")])
def test_every_contact_is_at_rest(path: Path, platform: object, rng: np.random.Generator) -> None:
    robot = nmm.mount(nmm.load(path, platform=platform), "small_arm", at="base")  # type: ignore[arg-type]
    assert robot.q_names[:4] == ("x", "y", "theta", "steer")
    assert robot.u_names[:2] == ("v", "steering_rate")
    assert len(robot.wheels) == 4
    middle = nmm.Configuration(robot, robot.q({"steer": 0.2})).placement("steer")
    expected = pin.SE3(pin.utils.rotate("z", 0.2), np.array([WHEELBASE, 0.0, 0.0]))
    np.testing.assert_allclose(middle.homogeneous, expected.homogeneous, atol=1e-12)
    lower, upper = robot.q_limits[3]
    for _ in range(20):
        q = np.append(rng.uniform(-3, 3, 3), [rng.uniform(lower, upper), *np.zeros(robot.n - 4)])
        u = rng.uniform(-1, 1, robot.n_u)
        np.testing.assert_allclose(contact_speeds(robot, q, u), 0.0, atol=1e-12)
        A, G = robot.platform.A(q[:4]), robot.platform.G(q[:4])
        np.testing.assert_allclose(A @ G, 0.0, atol=1e-15)


@pytest.mark.parametrize("kingpin", [TRACK / 2, 0.2])
def test_both_wheels_follow_exactly(tmp_path: Path, kingpin: float) -> None:
    """cot δ_right - cot δ_left = distance of the steering axes / wheelbase, and both agree with `steer`."""
    robot = nmm.load(write(tmp_path / "car.urdf", car(kingpin=kingpin)))
    for steer in np.linspace(*robot.q_limits[3], 12):
        angles = drawn(robot, robot.q({"steer": steer}))
        left, right = (angles[f"{side}_steering_joint"] for side in ("left", "right"))
        assert 1 / math.tan(right) - 1 / math.tan(left) == pytest.approx(2 * kingpin / WHEELBASE, abs=1e-12)
        assert 0.5 / math.tan(right) + 0.5 / math.tan(left) == pytest.approx(1 / math.tan(steer), abs=1e-12)


@pytest.mark.parametrize(("left", "right"), [(STOP, STOP), (0.5, 0.9), (1.2, 0.3), (1.4, 1.4)])
def test_the_joints_limits_are_those_of_steer(tmp_path: Path, left: float, right: float) -> None:
    robot = nmm.load(write(tmp_path / "car.urdf", car(left=left, right=right)))
    stops = {"left_steering_joint": left, "right_steering_joint": right}
    for end in robot.q_limits[3]:
        shares = [abs(drawn(robot, robot.q({"steer": end}))[name]) / stop for name, stop in stops.items()]
        assert max(shares) == pytest.approx(1.0, abs=1e-12)
    rate = robot.u_limits[robot.input("steering_rate")]
    angles = np.linspace(*robot.q_limits[3], 20001)
    fastest = 0.0
    for y in (0.2, -0.2):
        followed = np.arctan2(WHEELBASE * np.sin(angles), WHEELBASE * np.cos(angles) - y * np.sin(angles))
        fastest = max(fastest, float(np.max(np.diff(followed) / np.diff(angles))))
    assert rate * fastest == pytest.approx(RATE, rel=1e-4)


def test_limits_hold_in_a_run(path: Path) -> None:
    """A run that asks for more than the file's wheels, stops and steering joints give, joint by joint."""
    robot = nmm.mount(nmm.load(path), "small_arm", at="base")
    task = nmm.Task(nmm.Position("ee", "xy"), nmm.Constant([-3.0, 4.0]))
    controller = nmm.Controller(robot, task, nmm.ProjectedGradient(alpha=1.0), limits=nmm.Limits(), dt=0.02)
    run = nmm.simulate(controller, {"q1": 0.3, "q2": 0.6}, 6.0, 0.02)
    rolling = Rolling(robot)
    count = len(robot.wheels)
    rates = np.array([rolling.rates(q, u) for q, u in zip(run.q, run.u, strict=True)])
    assert np.abs(rates[:, :count]).max() == pytest.approx(SPIN, abs=1e-8)
    assert np.abs(rates[:, count:]).max() <= RATE + 1e-8
    angles = np.array([rolling.settled(q) for q in run.q])
    assert np.abs(angles[:, count:]).max() <= STOP + 1e-9
    assert {wheel.joint for wheel in robot.wheels} < set(run.limit_names)


def test_a_car_by_wheels_is_told(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert status_of(["info", str(path)]) == 0
    out = capsys.readouterr().out
    assert "platform: car, by its wheels" in out
    assert "steer is no joint of the file" in out
    assert "15 rad/s" in out


@pytest.mark.parametrize("kind", [Car, FrontDriveCar])
@pytest.mark.parametrize("side", ["left", "right"])
def test_a_steering_joint_beside_the_axis_is_refused(path: Path, kind: type[Car], side: str) -> None:
    with refused(f"platform {kind.name}", kind=nmm.RobotError):
        nmm.load(path, platform=kind(WHEELBASE, steering=f"{side}_steering_joint"))


@pytest.mark.parametrize(
    "text",
    [car(front=-WHEELBASE), car().replace(f"{WHEELBASE} -0.2 ", f"{WHEELBASE} -0.15 ")],
    ids=["behind", "uneven"],
)
def test_what_is_no_car_is_refused_as_one_and_told_without(tmp_path: Path, text: str) -> None:
    path = write(tmp_path / "car.urdf", text)
    with refused("ackermann: platform car", kind=nmm.RobotError):
        nmm.load(path, platform="car")
    assert nmm.load(path).platform.name == "wheeled"
    robot = nmm.load(path, platform="unicycle")
    assert "left_steering_joint" in {
        one.values["name"] for one in of_code(robot.notes, "steering_too_narrow")
    }


def test_a_frame_of_its_name_is_said(tmp_path: Path) -> None:
    from urdf_parts import joint, link

    text = car(joint("mast_joint", "base", "steer", "fixed", "") + link("steer"))
    path = write(tmp_path / "car.urdf", text)
    with pytest.raises(nmm.RobotError, match=r"a frame is named steer.*Car\(wheelbase, steering=NAME\)"):
        nmm.load(path)
    assert nmm.load(path, platform=Car(WHEELBASE, steering="wheel_angle")).q_names[3] == "wheel_angle"
