"""`nmm.PoseFilter` against differences, Gaussians and a search; late fixes, outliers, frames, bad input."""

from __future__ import annotations

import math
import tracemalloc
from functools import cache
from typing import Any

import numpy as np
import pytest
from planar_poses import conditioned, difference, exp, log, matrix_of
from scipy.optimize import least_squares
from scipy.stats import chi2

import nmm
from nmm.base.errors import InputError
from nmm.model.robots.robot import Robot
from nmm.plugins.robot.pose_filter import _gates

Array = np.ndarray
RADIUS, TRACK = 0.1, 0.5
STILL = {"left_wheel_joint": 0.0, "right_wheel_joint": 0.0}
KNOWN = np.diag([0.04, 0.09, 0.25])


@cache
def robot_of(name: str = "differential_base", platform: str = "") -> Robot:
    return nmm.load(name, platform=platform) if platform else nmm.load(name)


def make(pose: Array | None = None, covariance: Array = KNOWN, **options: Any) -> nmm.PoseFilter:
    robot = robot_of()
    q = robot.rest
    q[:3] = np.zeros(3) if pose is None else pose
    return nmm.PoseFilter(robot, q, STILL, 0.0, covariance=covariance, **{"spread": 0.0, **options})


def twist_of(turned: Array) -> Array:
    """Of the two wheels of differential_base."""
    left, right = turned
    return np.array([RADIUS * (left + right) / 2, 0.0, RADIUS * (right - left) / TRACK])


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
    for one in np.eye(3):
        pose_filter = make(pose, size**2 * turn @ np.outer(one, one) @ turn.T)
        pose_filter.step(0.1, turned)
        np.testing.assert_allclose(
            pose_filter.state_covariance[:3, :3],
            size**2 * np.outer(F @ one, F @ one),
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


def test_a_gyro_is_what_joint_gaussians_make_of_it() -> None:
    """Unknowns: the pose before, bias, scales, what the wheels and the slip of this step were. They are
    conditioned on the gyro, and carried on by differences of the motion."""
    pose, turned, dt, rate = np.array([0.5, 1.0, 0.7]), np.array([1.0, 1.4]), 0.2, 0.5
    spread, slip, noise, bias, scale = np.array([1e-3, 2e-3]), np.array([0.02, 0.01, 0.03]), 0.05, 0.1, 0.02
    names = [*STILL]
    pose_filter = make(
        pose, KNOWN, spread=dict(zip(names, spread, strict=True)), slip_noise=slip, gyro_noise=noise,
        bias_deviation=bias, bias_walk=0.01, scale_deviation=scale, scale_walk=0.002,
    )  # fmt: skip
    pose_filter.fix(
        pose + np.array([0.1, -0.1, 0.1]), np.diag([0.02, 0.02, 0.1]), 0.0
    )  # what is known is correlated
    first, P = pose_filter.pose, pose_filter.state_covariance
    T = matrix_of(first)

    def motion(v: Array) -> Array:
        """The twist with scales v[4:6], counts v[6:8] and slip v[8:]."""
        return twist_of(turned * (1 + v[4:6]) + v[6:8]) + v[8:]

    way, turn = twist_of(turned)[0], abs(twist_of(turned)[2])
    counts = spread * turned
    prior = np.zeros((11, 11))
    prior[:6, :6], prior[6:8, 6:8] = P, np.diag(counts)
    prior[8:, 8:] = np.diag(slip**2 * [way, way, turn])
    H = difference(lambda v: motion(v)[2:] + v[3] * dt, np.zeros(11))
    seen = rate * dt - motion(np.zeros(11))[2:]
    mean, spread_after = conditioned(prior, seen, H, np.array([[noise**2 * dt]]))

    def end(v: Array) -> Array:
        return T @ exp(v[:3]) @ exp(motion(v))

    believed = end(mean)
    J = np.vstack([difference(lambda v: log(np.linalg.inv(believed) @ end(v)), mean), np.eye(3, 11, 3)])
    expected = J @ spread_after @ J.T + np.diag([0, 0, 0, 0.01**2, 0.002**2, 0.002**2]) * dt
    pose_filter.step(dt, turned, yaw_rate=rate)
    np.testing.assert_allclose(matrix_of(pose_filter.pose), believed, rtol=0, atol=1e-10)
    np.testing.assert_allclose(pose_filter.bias, mean[3], rtol=0, atol=1e-12)
    np.testing.assert_allclose([*pose_filter.scales.values()], 1 + mean[4:6], rtol=0, atol=1e-12)
    np.testing.assert_allclose(pose_filter.state_covariance, expected, rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("rows", "at"), [(2, (0.0, 0.0)), (2, (0.4, -0.3)), (3, (0.0, 0.0)), (3, (0.2, 0.1))][:]
)
def test_a_fix_is_what_a_search_for_the_likeliest_pose_finds(rows: int, at: tuple[float, float]) -> None:
    """Mean by scipy's least squares, from 40° away; covariance by differences there."""
    pose_filter = make(np.array([1.0, 2.0, 4.0]), gate=None, bias_deviation=0.1)
    pose_filter.step(0.5, np.array([9.0, 12.0]))
    T, P = matrix_of(pose_filter.pose), pose_filter.state_covariance[:3, :3]
    y = pose_filter.pose + np.array([-0.5, 0.6, 0.7 + 4 * math.pi])
    R = np.array([[0.02, 0.004, 0.001], [0.004, 0.01, 0.0], [0.001, 0.0, 0.05]])[:rows, :rows]
    half_P, half_R = (np.linalg.inv(np.linalg.cholesky(one)) for one in (P, R))

    def cost(eps: Array, of: Array, about: Array) -> Array:
        there = of @ exp(eps)
        seen = there @ [*at, 1.0]
        turn = math.remainder(y[2] - math.atan2(there[1, 0], there[0, 0]), 2 * math.pi)
        missing = np.array([*(y[:2] - seen[:2]), turn])[:rows]
        return np.concatenate([half_P @ log(about @ exp(eps)), half_R @ missing])

    found = least_squares(cost, np.zeros(3), xtol=1e-15, ftol=1e-15, gtol=1e-15, args=(T, np.eye(3))).x
    believed = T @ exp(found)
    D = difference(lambda eps: cost(eps, believed, exp(found)), np.zeros(3))
    assert pose_filter.fix(y[:rows], R, 0.5, at) == "used"
    np.testing.assert_allclose(matrix_of(pose_filter.pose), believed, rtol=0, atol=1e-6)
    np.testing.assert_allclose(
        pose_filter.state_covariance[:3, :3], np.linalg.inv(D.T @ D), rtol=1e-5, atol=1e-8
    )
    assert np.linalg.norm(found) > 0.3


def drive(fixes: list[tuple[float, float, Array]], **options: Any) -> tuple[nmm.PoseFilter, list[str], Array]:
    """A drive of 2 s at 50 Hz with a gyro; fixes (came, was, pose) are given when they come; odom (N, 3)."""
    pose_filter = make(
        covariance=np.diag([0.1, 0.1, 0.3]), spread=1e-3, slip_noise=(0.01, 0.01, 0.02), gyro_noise=0.01,
        bias_deviation=0.05, bias_walk=1e-3, scale_deviation=0.02, delay=1.0, rate=60.0, **options,
    )  # fmt: skip
    waiting, outcomes, odom = sorted(fixes, key=lambda one: one[0]), [], [pose_filter.odom]
    for k in range(1, 101):
        t = 0.02 * k
        pose_filter.step(t, np.array([0.1 + 0.05 * math.sin(t), 0.14]), yaw_rate=0.3 + 0.1 * math.sin(3 * t))
        while waiting and waiting[0][0] <= t:
            _, was, pose = waiting.pop(0)
            outcomes.append(pose_filter.fix(pose, 0.01 * np.eye(len(pose)), was))
        odom.append(pose_filter.odom)
    return pose_filter, outcomes, np.array(odom)


def fixes_of(late: list[float]) -> list[tuple[float, float, Array]]:
    times = [0.13, 0.31, 0.52, 0.777, 1.1, 1.3, 1.31, 1.6]
    rng = np.random.default_rng(5)
    places = [
        np.array([0.6 * t, 0.02, 0.1])[: 2 + k % 2] + 0.05 * rng.standard_normal(2 + k % 2)
        for k, t in enumerate(times)
    ]
    return [(t + by, t, place) for t, by, place in zip(times, late, places, strict=True)]


def test_fixes_that_come_late_and_out_of_order_do_what_they_do_in_time() -> None:
    in_time, outcomes, _ = drive(fixes_of([0.0] * 8))
    late, found, _ = drive(fixes_of([0.3, 0.0, 0.4, 0.2, 0.05, 0.6, 0.0, 0.39]))
    assert (outcomes, found) == (["used"] * 8, ["used"] * 8)
    np.testing.assert_allclose(late.pose, in_time.pose, rtol=0, atol=1e-12)
    np.testing.assert_allclose(late.state_covariance, in_time.state_covariance, rtol=0, atol=1e-12)
    assert late.bias == pytest.approx(in_time.bias, abs=1e-12)
    without = drive(fixes_of([0.0] * 8)[:-1])[0]
    assert np.abs(without.pose - in_time.pose).max() > 1e-3  # and they matter


def test_a_fix_that_is_ahead_of_the_encoders_waits() -> None:
    ahead, found, _ = drive([(one[0] - 0.1, *one[1:]) for one in fixes_of([0.0] * 8)])
    assert {*found} == {"waiting"}
    np.testing.assert_allclose(ahead.pose, drive(fixes_of([0.0] * 8))[0].pose, rtol=0, atol=1e-12)


def test_fixes_beyond_the_delay_change_nothing() -> None:
    pose_filter, _, _ = drive([])
    before = pose_filter.pose
    assert pose_filter.fix([5.0, 5.0], np.eye(2), 0.9) == "late"
    assert pose_filter.fix([5.0, 5.0], np.eye(2), 3.1) == "early"
    np.testing.assert_array_equal(pose_filter.pose, before)
    crowd = [pose_filter.fix([1.2, 0.0], np.eye(2), 1.5 + 0.001 * k) for k in range(65)]
    assert crowd[-2:] == ["used", "crowded"]


def test_outliers_change_nothing_and_are_counted() -> None:
    good = fixes_of([0.0] * 8)
    bad = [(t, t, np.array([9.0, 9.0])) for t in (0.02 * 85, 0.02 * 88)]  # at readings: no step is split
    with_bad, found, _ = drive([*good, *bad])
    assert (found[-2:], with_bad.outliers) == (["outlier", "outlier"], 2)
    np.testing.assert_array_equal(with_bad.pose, drive(good)[0].pose)
    assert drive([*good, *bad], gate=None)[1][-1] == "used"
    with_bad.restart([9.0, 9.0, 0.0], np.diag([0.1, 0.1, 0.1]))
    odom = with_bad.odom
    np.testing.assert_allclose(with_bad.pose, [9.0, 9.0, 0.0])
    with_bad.step(2.02, np.array([0.1, 0.1]))
    assert np.linalg.norm(with_bad.odom - odom) == pytest.approx(0.01, abs=1e-3)
    assert with_bad.outliers == 0


def test_the_gate_lets_through_the_share_that_it_says() -> None:
    """Of fixes drawn as they say, 90 %: within 3 standard deviations of a binomial count."""
    rng, passed, count = np.random.default_rng(2), 0, 2000
    pose_filter = make(covariance=np.diag([0.01, 0.01, 0.01]), gate=0.9)
    for _ in range(count):
        pose_filter.restart(np.zeros(3), np.diag([0.01, 0.01, 0.01]))
        y = math.sqrt(0.03) * rng.standard_normal(2)
        passed += pose_filter.fix(y, 0.02 * np.eye(2), pose_filter.t) == "used"
    assert abs(passed - 0.9 * count) < 3 * math.sqrt(0.09 * count)


@pytest.mark.parametrize("share", [0.5, 0.95, 0.999])
def test_the_gates_are_quantiles(share: float) -> None:
    np.testing.assert_allclose(_gates(share), chi2.ppf(share, [2, 3]), rtol=1e-9)


def test_odom_goes_on_where_the_map_jumps() -> None:
    """No step of odom is longer than what the wheels rolled; the pose jumps; the frames make it together."""
    pose_filter, _, odom = drive(fixes_of([0.3, 0.0, 0.4, 0.2, 0.05, 0.6, 0.0, 0.39]))
    steps = np.linalg.norm(np.diff(odom, axis=0)[:, :2], axis=1)
    assert steps.max() < 1.05 * RADIUS * 0.145
    before = pose_filter.odom
    jump = pose_filter.pose
    pose_filter.fix(jump + np.array([0.1, 0.1, 0.05]), 1e-4 * np.eye(3), 2.0)
    assert np.linalg.norm(pose_filter.pose - jump) > 0.05
    np.testing.assert_array_equal(pose_filter.odom, before)
    chained = matrix_of(pose_filter.map_to_odom) @ matrix_of(pose_filter.odom)
    np.testing.assert_allclose(chained, matrix_of(pose_filter.pose), atol=1e-12)


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


def test_a_step_and_a_fix_allocate_nothing_that_stays() -> None:
    pose_filter = make(spread=1e-4, gyro_noise=0.01, bias_deviation=0.1, scale_deviation=0.01)
    by, place, R, t = np.array([0.1, 0.12]), [0.0, 0.0], np.eye(2), 0.0

    def go(count: int) -> None:
        nonlocal t
        for _ in range(count):
            t += 0.01
            pose_filter.step(t, by, yaw_rate=0.1)
            pose_filter.fix(place, R, t)

    go(200)
    tracemalloc.start()
    try:
        before, _ = tracemalloc.get_traced_memory()
        go(500)
        after, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert after - before < 1000
    assert peak - before < 6000  # nothing grows with what a filter remembers, either


def test_bad_input_is_named_and_changes_nothing() -> None:
    pose_filter = make(spread=1e-4)
    pose_filter.step(0.1, [0.1, 0.1])
    before, P, odom = pose_filter.pose, pose_filter.state_covariance, pose_filter.odom
    assert pose_filter.fix([0.0, 0.0], np.eye(2), 0.15) == "waiting"
    definite = "a symmetric matrix, positive definite"
    cases: list[tuple[Any, str]] = [
        (lambda: pose_filter.step(0.1, [0.1, 0.1]), "a time after 0.1 s"),
        (lambda: pose_filter.step(math.nan, [0.1, 0.1]), "a time after 0.1 s"),
        (lambda: pose_filter.step(0.2, [0.1, math.nan]), "finite numbers"),
        (lambda: pose_filter.step(0.2, [1e308, -1e308]), "finite numbers"),
        (lambda: pose_filter.step(0.2, [0.1]), "2 counters and 0 joints"),
        (lambda: pose_filter.step(0.2, [0.1, 0.1], yaw_rate=0.1), "a filter with gyro_noise"),
        (lambda: pose_filter.update({"left_wheel_joint": 0.1}, 0.2), ""),
        (lambda: pose_filter.fix([0.0], np.eye(1), 0.1), "2 or 3 numbers"),
        (lambda: pose_filter.fix([0.0, math.inf], np.eye(2), 0.1), "finite numbers"),
        (lambda: pose_filter.fix([0.0, 0.0], np.eye(3), 0.1), "a matrix of shape (2, 2)"),
        (lambda: pose_filter.fix([0.0, 0.0], -np.eye(2), 0.1), definite),
        (
            lambda: pose_filter.fix([0.0] * 3, np.diag([1, 1, 0]), 0.1),
            "a symmetric matrix, positive definite",
        ),
        (lambda: pose_filter.restart([0.0] * 3, -np.eye(3)), "a covariance: symmetric, no negative variance"),
        (lambda: pose_filter.restart([0.0, math.nan, 0.0], np.eye(3)), "finite numbers"),
        (lambda: make(gate=1.0), "a number above 0 and below 1"),
        (lambda: make(spread=-1.0), "numbers from 0"),
        (lambda: make(delay=0.0), "a number above 0"),
        (lambda: make(spread={"wheel": 1.0}), ""),
    ]
    for call, expected in cases:
        with pytest.raises(InputError) as caught:
            call()
        assert expected in str(caught.value.expected or ""), str(caught.value)
        assert len(str(caught.value)) <= 300
    np.testing.assert_array_equal(pose_filter.pose, before)
    np.testing.assert_array_equal(pose_filter.state_covariance, P)
    np.testing.assert_array_equal(pose_filter.odom, odom)
    assert pose_filter.t == 0.1
    pose_filter.step(0.2, [0.1, 0.1])  # the fix that waited is taken
    assert (np.diag(pose_filter.state_covariance)[:2] < np.diag(P)[:2]).all()
