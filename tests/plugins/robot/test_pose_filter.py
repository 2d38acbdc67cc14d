"""`nmm.PoseFilter` against differences, Gaussians and a search."""

from __future__ import annotations

import math

import numpy as np
import pytest
from planar_poses import conditioned, difference, exp, log, matrix_of
from pose_filters import KNOWN, RADIUS, STILL, TRACK, make, robot_of, twist_of
from scipy.optimize import least_squares
from scipy.stats import chi2

import nmm

Array = np.ndarray


def test_the_robot_of_these_tests_is_that_of_the_file() -> None:
    wheels = {wheel.joint: wheel for wheel in robot_of().wheels if wheel.joint in STILL}
    assert [wheel.radius for wheel in wheels.values()] == [RADIUS, RADIUS]
    assert [wheels[name].rolls_at[1] for name in STILL] == [TRACK / 2, -TRACK / 2]
    assert make().counters == tuple(STILL)


def test_what_is_not_known_of_the_pose_goes_on_by_differences() -> None:
    """F: one unknown at a time, and its image is what differences of the motion say; far from straight."""
    pose, turned, size = np.array([1.0, -2.0, 2.5]), np.array([3.0, 8.0]), 1e-3
    T, step = matrix_of(pose), exp(twist_of(turned))
    F = difference(lambda eps: log(np.linalg.inv(T @ step) @ T @ exp(eps) @ step), np.zeros(3))
    turn = np.eye(3)
    turn[:2, :2] = T[:2, :2]
    for axis in np.eye(3):
        pose_filter = make(pose, size**2 * turn @ np.outer(axis, axis) @ turn.T)
        pose_filter.step(0.1, turned)
        np.testing.assert_allclose(
            pose_filter.state_covariance[:3, :3],
            size**2 * np.outer(F @ axis, F @ axis),
            rtol=0,
            atol=1e-8 * size**2,
        )
    np.testing.assert_allclose(matrix_of(pose_filter.pose), T @ step, atol=1e-12)


CASES = [
    ("differential_base", ""), ("differential_base", "unicycle"), ("differential_base", "wheeled"),
    ("car_base", ""), ("car_base", "front_drive_car"), ("trailer_base", ""),
    ("omni_base", ""), ("omni_base", "skid_steer"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "platform"), CASES)
def test_every_platform_moves_as_its_odometry_and_its_noise_as_differences_of_it(
    name: str, platform: str
) -> None:
    """Also where a joint steers meanwhile, whose angle is measured."""
    robot, spread = robot_of(name, platform), 1e-4
    p = robot.platform
    names = [*robot.wheel_speeds(np.zeros(p.p))]
    own = list(robot.q_names[3 : p.n_p])
    rng = np.random.default_rng(3)
    steps = rng.uniform(0.5, 1.5, (4, 1)) + 0.3 * rng.standard_normal((4, len(names)))
    angles = np.vstack([np.zeros(len(own)), np.cumsum(0.05 * rng.standard_normal((4, len(own))), axis=0)])

    def readings(k: int, turned: Array) -> dict[str, float]:
        counts = np.vstack([np.zeros(len(names)), np.cumsum(turned.reshape(4, -1), axis=0)])
        return dict(zip(names, counts[k], strict=True)) | dict(zip(own, angles[k], strict=True))

    rest = robot.rest

    def end(turned: Array) -> Array:
        odometry = robot.odometry(rest, readings(0, turned))
        return np.array([odometry.update(readings(k, turned)) for k in range(1, 5)])[-1]

    first = readings(0, steps.ravel())
    pose_filter = nmm.PoseFilter(robot, rest, first, 0.0, covariance=np.zeros((3, 3)), spread=spread)
    for k in range(1, 5):
        q = pose_filter.update(readings(k, steps.ravel()), 0.1 * k)
    expected = end(steps.ravel())
    np.testing.assert_allclose(q, expected, rtol=0, atol=1e-12)
    np.testing.assert_allclose(pose_filter.odom, expected[:3], rtol=0, atol=1e-12)
    D = difference(end, steps.ravel(), 1e-3)[:3]
    wanted = D * (spread * np.abs(steps.ravel())) @ D.T
    np.testing.assert_allclose(pose_filter.covariance, wanted, rtol=0, atol=1e-7 * np.abs(wanted).max())


@pytest.mark.parametrize(("of_turns", "off"), [(0.0, 1e-10), (0.05, 1e-5)])
def test_a_gyro_is_what_joint_gaussians_make_of_it(of_turns: float, off: float) -> None:
    """Unknowns: the pose before, bias, scales, the scale of turns, what the wheels and the slip of this step
    were. They are conditioned on the gyro, and carried on by differences of the motion. That is linear in the
    scales; of the scales of turns and of counters the filter leaves out the product of their corrections."""
    pose, turned, dt, rate = np.array([0.5, 1.0, 0.7]), np.array([1.0, 1.4]), 0.2, 0.5
    spread, slip, noise, bias, scale = np.array([1e-3, 2e-3]), np.array([0.02, 0.01, 0.03]), 0.05, 0.1, 0.02
    pose_filter = make(
        pose, KNOWN, spread=dict(zip(STILL, spread, strict=True)), slip_noise=slip, gyro_noise=noise,
        bias_deviation=bias, bias_walk=0.01, scale_deviation=scale, scale_walk=0.002,
        turn_deviation=of_turns, turn_walk=0.1 * of_turns,
    )  # fmt: skip
    pose_filter.step(dt, [2.0, 1.0])
    off_by = np.array([0.2, -0.2, 0.3])
    pose_filter.fix(pose_filter.pose + off_by, np.diag([0.02, 0.02, 0.1]), dt)  # all is correlated
    first, P, b = pose_filter.pose, pose_filter.state_covariance, pose_filter.bias
    T, d, scales = matrix_of(first), len(P), np.array([*pose_filter.scales.values()])
    of_turn = pose_filter.turn_scale
    assert d == (7 if of_turns else 6)

    def motion(v: Array) -> Array:
        """The twist with corrections of scales v[4:6], of turns v[6:d], counts v[d : d + 2] and slip."""
        twist = twist_of(turned * (scales + v[4:6]) + v[d : d + 2])
        twist[2] *= of_turn + sum(v[6:d])
        return twist + v[d + 2 :]

    still = np.zeros(d + 5)
    way, turn = motion(still)[0], abs(motion(still)[2])
    prior = np.zeros((d + 5, d + 5))
    prior[:d, :d], prior[d : d + 2, d : d + 2] = P, np.diag(spread * turned)
    prior[d + 2 :, d + 2 :] = np.diag(slip**2 * [way, way, turn])
    H = difference(lambda v: motion(v)[2:] + v[3] * dt, still)
    seen = (rate - b) * dt - motion(still)[2:]
    mean, spread_after = conditioned(prior, seen, H, np.array([[noise**2 * dt]]))

    def end(v: Array) -> Array:
        return T @ exp(v[:3]) @ exp(motion(v))

    believed = end(mean)
    J = np.vstack(
        [difference(lambda v: log(np.linalg.inv(believed) @ end(v)), mean), np.eye(d - 3, d + 5, 3)]
    )
    walks = np.array([0, 0, 0, 0.01, 0.002, 0.002, *[0.1 * of_turns] * (d - 6)]) ** 2
    pose_filter.step(2 * dt, turned, yaw_rate=rate)
    np.testing.assert_allclose(matrix_of(pose_filter.pose), believed, rtol=0, atol=off)
    np.testing.assert_allclose(pose_filter.bias, b + mean[3], rtol=0, atol=1e-12)
    np.testing.assert_allclose([*pose_filter.scales.values()], scales + mean[4:6], rtol=0, atol=1e-12)
    assert pose_filter.turn_scale == pytest.approx(of_turn + sum(mean[6:d]), abs=1e-12)
    expected = J @ spread_after @ J.T + np.diag(walks) * dt
    np.testing.assert_allclose(pose_filter.state_covariance, expected, rtol=0, atol=max(off, 1e-9))
    for name, value in zip(STILL, scales, strict=True):
        assert abs(value - 1.0) > 1e-5, name
    assert (abs(of_turn - 1.0) > 1e-5) == (of_turns > 0.0)


@pytest.mark.parametrize(
    ("rows", "at"), [(2, (0.0, 0.0)), (2, (0.4, -0.3)), (3, (0.0, 0.0)), (3, (0.2, 0.1))]
)
def test_a_fix_is_what_a_search_for_the_likeliest_pose_finds(rows: int, at: tuple[float, float]) -> None:
    """Mean by scipy's least squares, from 40° away; covariance by differences there."""
    pose_filter = make(np.array([1.0, 2.0, 4.0]), gate=None, bias_deviation=0.1)
    pose_filter.step(0.5, np.array([9.0, 12.0]))
    T, P = matrix_of(pose_filter.pose), pose_filter.state_covariance[:3, :3]
    y = pose_filter.pose + np.array([-0.5, 0.6, 0.7 + 4 * math.pi])
    R = np.array([[0.02, 0.004, 0.001], [0.004, 0.01, 0.0], [0.001, 0.0, 0.05]])[:rows, :rows]
    half_P, half_R = (np.linalg.inv(np.linalg.cholesky(C)) for C in (P, R))

    def cost(eps: Array, of: Array, about: Array) -> Array:
        placed = of @ exp(eps)
        seen = placed @ [*at, 1.0]
        turn = math.remainder(y[2] - math.atan2(placed[1, 0], placed[0, 0]), 2 * math.pi)
        missing = np.array([*(y[:2] - seen[:2]), turn])[:rows]
        return np.concatenate([half_P @ log(about @ exp(eps)), half_R @ missing])

    likeliest = least_squares(cost, np.zeros(3), xtol=1e-15, ftol=1e-15, gtol=1e-15, args=(T, np.eye(3))).x
    believed = T @ exp(likeliest)
    D = difference(lambda eps: cost(eps, believed, exp(likeliest)), np.zeros(3))
    assert pose_filter.fix(y[:rows], R, 0.5, at) == "used"
    np.testing.assert_allclose(matrix_of(pose_filter.pose), believed, rtol=0, atol=1e-6)
    np.testing.assert_allclose(
        pose_filter.state_covariance[:3, :3], np.linalg.inv(D.T @ D), rtol=1e-5, atol=1e-8
    )
    assert np.linalg.norm(likeliest) > 0.3


def test_standing_still_shows_the_bias_of_a_gyro() -> None:
    pose_filter = make(gyro_noise=0.01, bias_deviation=0.1, rate=100.0)
    rng = np.random.default_rng(1)
    for k in range(1, 1001):
        pose_filter.step(0.01 * k, np.zeros(2), yaw_rate=0.03 + 0.01 * rng.standard_normal() / 0.1)
    deviation = math.sqrt(pose_filter.state_covariance[3, 3])
    assert deviation == pytest.approx(0.01 / math.sqrt(10.0), rel=0.01)  # the mean of 10 s
    assert abs(pose_filter.bias - 0.03) < 3 * deviation
    np.testing.assert_allclose(pose_filter.pose, 0.0, atol=1e-12)


def test_a_tyre_that_lost_air_is_seen() -> None:
    """The left wheel is 3 % smaller; fixes of position alone on a course that turns both ways."""
    pose_filter = make(covariance=np.diag([1e-4, 1e-4, 1e-4]), spread=1e-5, scale_deviation=0.05)
    rng, T = np.random.default_rng(4), np.eye(3)
    for k in range(1, 2001):
        turned = np.array([0.1, 0.1 + 0.05 * math.sin(0.01 * k)])
        T = T @ exp(twist_of(turned * [0.97, 1.0]))
        pose_filter.step(0.02 * k, turned)
        if k % 25 == 0:
            pose_filter.fix(T[:2, 2] + 0.02 * rng.standard_normal(2), 4e-4 * np.eye(2), 0.02 * k)
    off = np.array([*pose_filter.scales.values()]) - [0.97, 1.0]
    deviations = np.sqrt(np.diag(pose_filter.state_covariance)[4:])
    assert (deviations < 0.005).all()
    assert off @ np.linalg.inv(pose_filter.state_covariance[4:, 4:]) @ off < chi2.ppf(0.999, 2)
