"""Fixes for `nmm.PoseFilter`: late, early, out of order, outliers; frames, speed, bad input."""

from __future__ import annotations

import math
import time
import tracemalloc
from typing import Any

import numpy as np
import pytest
from planar_poses import matrix_of
from pose_filters import RADIUS, STILL, drive, fixes_of, make
from scipy.stats import chi2

import nmm
from nmm.base.errors import InputError
from nmm.plugins.robot.filter_checks import gates_of


def test_fixes_that_come_late_and_out_of_order_do_what_they_do_in_time() -> None:
    in_time, outcomes, _ = drive(fixes_of([0.0] * 8))
    late, after, _ = drive(fixes_of([0.3, 0.0, 0.4, 0.2, 0.05, 0.6, 0.0, 0.39]))
    assert (outcomes, after) == (["used"] * 8, ["used"] * 8)
    np.testing.assert_allclose(late.pose, in_time.pose, rtol=0, atol=1e-12)
    np.testing.assert_allclose(late.state_covariance, in_time.state_covariance, rtol=0, atol=1e-12)
    assert late.bias == pytest.approx(in_time.bias, abs=1e-12)
    without = drive(fixes_of([0.0] * 8)[:-1])[0]
    assert np.abs(without.pose - in_time.pose).max() > 1e-3  # and they matter


def test_a_fix_that_is_ahead_of_the_encoders_waits() -> None:
    ahead, outcomes, _ = drive([(came - 0.1, was, pose) for came, was, pose in fixes_of([0.0] * 8)])
    assert {*outcomes} == {"waiting"}
    np.testing.assert_allclose(ahead.pose, drive(fixes_of([0.0] * 8))[0].pose, rtol=0, atol=1e-12)


def test_a_fix_within_a_step_is_taken_at_its_time() -> None:
    """As if the step had been two, before it and after it; also with a gyro's mean rate over both."""
    noise: dict[str, Any] = {"spread": 1e-3, "gyro_noise": 0.01, "bias_deviation": 0.1}
    whole, parts = make(**noise), make(**noise)
    whole.step(0.1, [1.0, 2.0], yaw_rate=0.4)
    assert whole.fix([0.2, 0.1], 0.01 * np.eye(2), 0.03) == "used"
    parts.step(0.03, [0.3, 0.6], yaw_rate=0.4)
    assert parts.fix([0.2, 0.1], 0.01 * np.eye(2), 0.03) == "used"
    parts.step(0.1, [0.7, 1.4], yaw_rate=0.4)
    np.testing.assert_allclose(whole.pose, parts.pose, rtol=0, atol=1e-12)
    np.testing.assert_allclose(whole.state_covariance, parts.state_covariance, rtol=0, atol=1e-12)


def test_fixes_beyond_the_delay_change_nothing() -> None:
    pose_filter, _, _ = drive([])
    before = pose_filter.pose
    assert pose_filter.fix([5.0, 5.0], np.eye(2), 0.9) == "late"
    assert pose_filter.fix([5.0, 5.0], np.eye(2), 3.1) == "early"
    np.testing.assert_array_equal(pose_filter.pose, before)
    crowd = [pose_filter.fix([1.2, 0.0], np.eye(2), 1.5 + 0.001 * k) for k in range(65)]
    assert crowd[-2:] == ["used", "crowded"]


def test_only_fixes_within_the_delay_crowd() -> None:
    """Encoders at 10 Hz, for which the steps that are stored last 10 s; 4 fixes a step, up to 0.49 s late.
    In each `delay` of 0.5 s there are 20: 30 places do what 1000 do."""
    ample, short = (make(spread=1e-3, fixes=places) for places in (1000, 30))
    for k in range(1, 121):
        for pose_filter in (ample, short):
            pose_filter.step(0.1 * k, [0.1, 0.1])
            for late in (0.0, 0.05, 0.31, 0.49):
                place = [0.1 * RADIUS * (k - 10.0 * late), 0.01 * math.sin(k)]
                outcome = pose_filter.fix(place, 0.01 * np.eye(2), 0.1 * k - min(late, 0.1 * k))
                assert outcome == "used", (k, late)
    np.testing.assert_array_equal(short.pose, ample.pose)
    np.testing.assert_array_equal(short.state_covariance, ample.state_covariance)


def test_outliers_change_nothing_and_are_counted() -> None:
    good = fixes_of([0.0] * 8)
    bad = [(t, t, np.array([9.0, 9.0])) for t in (0.02 * 85, 0.02 * 88)]  # at readings: no step is split
    with_bad, outcomes, _ = drive([*good, *bad])
    assert (outcomes[-2:], with_bad.outliers) == (["outlier", "outlier"], 2)
    np.testing.assert_array_equal(with_bad.pose, drive(good)[0].pose)
    assert drive([*good, *bad], gate=None)[1][-1] == "used"
    with_bad.restart([9.0, 9.0, 0.0], np.diag([0.1, 0.1, 0.1]))
    odom = with_bad.odom
    np.testing.assert_allclose(with_bad.pose, [9.0, 9.0, 0.0])
    with_bad.step(2.02, np.array([0.1, 0.1]))
    assert np.linalg.norm(with_bad.odom - odom) == pytest.approx(0.01, abs=1e-3)
    assert with_bad.outliers == 0


def test_outliers_are_counted_in_a_row_however_seldom_they_come() -> None:
    """Fixes at 1 Hz, each long forgotten when the next comes; one that is used ends the row."""
    pose_filter, counts = make(spread=1e-4), []
    for k in range(1, 1501):
        pose_filter.step(0.01 * k, [0.0, 0.0])
        if k % 100 == 0:
            place = np.array([0.0, 0.0] if k == 1100 else [9.0, 9.0])
            assert pose_filter.fix(place, 0.01 * np.eye(2), pose_filter.t) == (
                "used" if k == 1100 else "outlier"
            )
            counts.append(pose_filter.outliers)
    assert counts == [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 0, 1, 2, 3, 4]
    pose_filter.restart([9.0, 9.0, 0.0], np.diag([0.1, 0.1, 0.1]))
    assert pose_filter.outliers == 0


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
    np.testing.assert_allclose(gates_of(share), chi2.ppf(share, [2, 3]), rtol=1e-9)


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


def test_a_step_and_a_fix_allocate_nothing_that_stays() -> None:
    pose_filter = make(spread=1e-4, gyro_noise=0.01, bias_deviation=0.1, scale_deviation=0.01)
    by, place, R, t = np.array([0.1, 0.12]), [0.0, 0.0], np.eye(2), 0.0

    def go(count: int) -> None:
        nonlocal t
        for _ in range(count):
            t += 0.01
            pose_filter.step(t, by, yaw_rate=0.1)
            pose_filter.fix(place, R, t)

    def update(count: int) -> None:
        nonlocal t
        for _ in range(count):
            t += 0.01
            pose_filter.update(dict.fromkeys(STILL, 0.1 * t), t, 0.1)

    go(200)
    update(200)
    tracemalloc.start()
    try:
        before, _ = tracemalloc.get_traced_memory()
        go(500)
        update(500)
        after, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert after - before < 1000
    assert peak - before < 6000  # nothing grows with what a filter remembers, either


def test_names_cost_little_beside_a_step() -> None:
    """4 times a step where it was measured, and 35 with names that are looked up each time; the least of
    rounds."""
    pose_filter = make(spread=1e-4)
    by, times = np.array([0.1, 0.1]), {"step": math.inf, "update": math.inf}
    for _ in range(20):
        for name in times:
            start = time.process_time()
            for _ in range(100):
                t = pose_filter.t + 0.01
                if name == "step":
                    pose_filter.step(t, by)
                else:
                    pose_filter.update(dict.fromkeys(STILL, 0.1 * t), t)
            times[name] = min(times[name], time.process_time() - start)
    assert times["update"] < 10 * times["step"]


def test_a_step_that_is_refused_changes_nothing_where_all_places_are_taken() -> None:
    """At each number of steps: a late fix after it, and a step, do what they do without it."""
    options: dict[str, Any] = {"spread": 1e-3, "delay": 0.5, "rate": 10.0}
    for count in range(1, 20):
        filters = make(**options), make(**options)
        for pose_filter in filters:
            for k in range(1, count + 1):
                pose_filter.step(0.1 * k, [0.1, 0.12])
                pose_filter.fix([0.01 * k, 0.01], 0.01 * np.eye(2), 0.1 * k)
        with pytest.raises(InputError):
            filters[1].step(filters[1].t + 0.1, [1e308, 1e308])
        for pose_filter in filters:
            t = pose_filter.t
            assert pose_filter.fix([0.01 * count, 0.02], 0.01 * np.eye(2), max(t - 0.49, 0.0)) == "used"
            pose_filter.step(t + 0.1, [0.1, 0.1])
        np.testing.assert_array_equal(filters[1].pose, filters[0].pose)
        np.testing.assert_array_equal(filters[1].state_covariance, filters[0].state_covariance)


def test_readings_come_in_any_order_and_number() -> None:
    """A trailer's hitch is measured at times, in another order; where it is not, it rolls."""
    robot = nmm.load("trailer_base")
    wheels = [*robot.wheel_speeds(np.zeros(robot.platform.p))]
    own = list(robot.q_names[3 : robot.platform.n_p])
    first = dict.fromkeys([*wheels, *own], 0.0)
    pose_filter = nmm.PoseFilter(robot, robot.rest, first, 0.0, covariance=np.zeros((3, 3)), spread=0.0)
    odometry = robot.odometry(robot.rest, first)
    for k in range(1, 7):
        counts = dict.fromkeys(wheels, 0.1 * k) | {own[0]: 0.1}
        measured = dict.fromkeys(own[1:], 0.02 * k) if k % 3 == 0 else {}
        q = pose_filter.update(counts | measured, 0.1 * k)
        expected = odometry.update(dict(reversed([*counts.items(), *measured.items()])))
        np.testing.assert_allclose(q, expected, rtol=0, atol=1e-12)
        for name, angle in measured.items():
            assert q[robot.coordinate(name)] == angle


def test_the_first_readings_are_checked_for_jumps_too() -> None:
    """At 5 rad/s a wheel turns 0.05 rad in 10 ms; with what stamps may be off, at most 0.175 rad."""
    for turned, jumped in ((3.0, True), (0.18, True), (0.17, False)):
        pose_filter = make(fastest=5.0)
        if not jumped:
            pose_filter.update(dict.fromkeys(STILL, turned), 0.01)
            continue
        with pytest.raises(InputError, match="jumped"):
            pose_filter.update(dict.fromkeys(STILL, turned), 0.01)
        assert (pose_filter.t, pose_filter.pose.tolist()) == (0.0, [0.0] * 3)


def test_bad_input_is_named_and_changes_nothing() -> None:
    pose_filter, with_gyro = make(spread=1e-4), make(gyro_noise=0.1)
    pose_filter.step(0.1, [0.1, 0.1])
    before, P, odom = pose_filter.pose, pose_filter.state_covariance, pose_filter.odom
    assert pose_filter.fix([0.0, 0.0], np.eye(2), 0.15) == "waiting"
    definite = "a symmetric matrix, positive definite"
    cases: list[tuple[Any, str]] = [
        (lambda: pose_filter.step(0.1, [0.1, 0.1]), "a time after 0.1 s"),
        (lambda: pose_filter.step(math.nan, [0.1, 0.1]), "a time after 0.1 s"),
        (lambda: pose_filter.step(0.2, [0.1, math.nan]), "finite numbers"),
        (lambda: pose_filter.step(0.2, [1e308, 1e308]), "finite numbers"),
        (lambda: pose_filter.step(0.2, [0.1]), "2 counters and 0 joints"),
        (lambda: pose_filter.step(0.2, [0.1, 0.1], yaw_rate=0.1), "a filter with gyro_noise"),
        (lambda: pose_filter.step(0.2, ["a", "b"]), "2 counters and 0 joints"),
        (lambda: pose_filter.step(0.2, [0.1, 0.1], "a"), "2 counters and 0 joints"),
        (lambda: with_gyro.step(0.2, [0.1, 0.1], yaw_rate="x"), "numbers"),
        (lambda: with_gyro.step(0.2, [0.1, 0.1], yaw_rate=math.nan), "finite numbers"),
        (lambda: with_gyro.step(0.2, [0.1, 0.1], yaw_rate=1e308), "a number from -100 to 100"),
        (lambda: with_gyro.update(None, 0.2), "readings by name"),  # type: ignore[arg-type]  # on purpose
        (lambda: with_gyro.update(STILL, 0.2, "x"), "numbers"),  # type: ignore[arg-type]  # on purpose
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
        (lambda: make(slip_noise=(0.01, -0.01, 0.01)), "numbers from 0"),
        (lambda: make(delay=0.0), "a number above 0"),
        (lambda: make(delay=1e300), "at most 1,000,000"),
        (lambda: make(fixes=10**9), "at most 10,000"),
        (lambda: nmm.PoseFilter("base", [], {}, 0.0, covariance=np.eye(3), spread=0.1), "a Robot"),  # type: ignore[arg-type]
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
