"""Points as a camera measures them: what is believed of them, and what a loop with them bears."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest
from findings import refused, the
from scipy.linalg import expm, solve_discrete_are

import nmm
from nmm.control.functions.tasks.depth_estimate import MotionEstimate
from nmm.plugins.symbolic import symbolic

ROBOT = nmm.load("unicycle_pan_tilt")
CAMERA = "camera_optical_frame"
PIXELS = [525.0, 525.0, 319.5, 239.5]
BALL = np.array([2.0, 0.5, 0.6])
BOARD = [[2.0, 0.5 + y, 0.6 + z] for y, z in ((0.15, 0.15), (-0.15, 0.15), (-0.15, -0.15), (0.15, -0.15))]
#: The board in the middle of the picture, 1 m ahead.
GOAL = np.array([319.5, 239.5, np.log(525.0 * np.sqrt(2.0) * 0.15)])
STRAIGHT = nmm.Quadratic(nmm.QuadraticTerm("pan", 0.0))


def true(function: nmm.extending.Function, q: np.ndarray) -> np.ndarray:
    return nmm.evaluate(function, 0.0, nmm.Configuration(ROBOT, q)).value


def docking(measured: nmm.MeasuredPoints, gain: float = 0.7) -> nmm.Controller:
    task = nmm.Task(nmm.ImageMoments(measured, intrinsics=PIXELS), GOAL, gain=gain)
    return nmm.Controller(ROBOT, task, nmm.ReducedGradient(alpha=1.0), STRAIGHT)


def test_a_picture_is_believed_and_foretold_as_the_camera_moves(rng: np.random.Generator) -> None:
    seen = nmm.ImagePoints([BALL])
    ball = nmm.MeasuredPoints([BALL])
    controller = nmm.Controller(ROBOT, nmm.Task(nmm.ImagePoints(ball), [0.0, 0.0]), nmm.ProjectedGradient())
    with pytest.raises(nmm.SingularError, match="no picture has shown the point yet"):
        controller(0.0, ROBOT.rest)
    with refused("symbolic"):
        symbolic(ROBOT, nmm.ImagePoints(ball))
    taken = rng.uniform(-0.2, 0.2, 5)
    depth = np.exp(true(nmm.LogDepth(BALL), taken))
    ball.set(true(seen, taken), 0.0, taken, depth)
    for q in (taken, taken + rng.uniform(-0.2, 0.2, 5)):  # the depth is right: so is what is foretold
        here, expected = controller.evaluate(0.3, q), nmm.Configuration(ROBOT, q)
        np.testing.assert_allclose(here.r, true(seen, q), atol=1e-12)
        np.testing.assert_allclose(here.J, nmm.evaluate(seen, 0.0, expected).value_q @ expected.S, atol=1e-12)
    ball.set([0.11, -0.07], 0.3, taken, 0.5)  # whatever the depth, what was seen there was seen there
    np.testing.assert_allclose(controller.evaluate(0.3, taken).r, [0.11, -0.07], atol=1e-12)
    anew = nmm.Configuration(ROBOT, taken)  # what is laid out after a picture knows it, too
    np.testing.assert_allclose(
        nmm.evaluate(nmm.ImagePoints(ball), 0.3, anew).value, [0.11, -0.07], atol=1e-12
    )
    ball.set([np.nan, np.nan], 0.4, taken)
    np.testing.assert_allclose(controller.evaluate(0.4, taken).r, [0.11, -0.07], atol=1e-12)


def estimated(moves: np.ndarray, guess: float, noise: float, rng: np.random.Generator) -> np.ndarray:
    """The believed depth over the true one, in pictures taken from places (N, 3)."""
    from nmm.control.functions.tasks.depth_estimate import DepthEstimate

    estimate, point, found = DepthEstimate(guess, noise), np.array([0.2, 0.1, 2.0]), []
    for k, c in enumerate(moves):
        x, y, Z = point - c
        seen = np.array([x, y]) / Z + noise * rng.standard_normal(2)
        found.append((estimate.update(0.03 * k, *seen, np.eye(3), c) - c)[2] / Z)
    depth, deviation = estimate.depth
    assert noise == 0.0 or abs(depth - 2.0) < 4.0 * deviation  # it knows how much it knows
    return np.array(found)


@pytest.mark.parametrize("guess", [1.0, 1.4, 3.0])
def test_a_depth_is_observed_where_the_camera_moves_across_the_ray(
    guess: float, rng: np.random.Generator
) -> None:
    s = np.linspace(0.0, 1.0, 300)
    across, ahead = np.outer(s, [0.5, 0.2, 0.0]), np.outer(s, [0.0, 0.0, 1.0])
    assert abs(estimated(across, guess, 0.0, rng)[-1] - 1.0) < 1e-3
    for moves in (across, ahead):  # ahead the point wanders to the side in the picture
        assert abs(estimated(moves, guess, 1e-3, rng)[-1] - 1.0) < 0.1
    still = estimated(np.zeros((300, 3)), guess, 1e-3, rng)  # nothing to be learnt
    np.testing.assert_allclose(still, guess / 2.0, rtol=1e-2)


def decay(controller: nmm.Controller, q: np.ndarray) -> np.ndarray:
    """K J Ĵ⁺ (3, 3) about q, of errors in the true picture over the focal length: Ĵ is the J believed in."""
    configuration, scales = nmm.Configuration(ROBOT, q), np.array([525.0, 525.0, 1.0])
    here = nmm.evaluate(nmm.ImageMoments(BOARD, intrinsics=PIXELS), 0.0, configuration)
    J, believed = here.value_q @ configuration.S, controller.evaluate(0.0, q).J
    return 0.7 * (J @ np.linalg.pinv(believed)) / scales[:, np.newaxis] * scales


@pytest.mark.parametrize("share", [0.7, 1.3])
def test_a_depth_that_is_a_third_wrong_converges_as_linear_theory_says(share: float) -> None:
    """ė = -K J Ĵ⁺ e, with Ĵ of the depth that is believed."""
    measured = nmm.MeasuredPoints(BOARD, intrinsics=PIXELS, depth=share, faults=nmm.CameraFaults(rate=100.0))
    task = nmm.Task(nmm.ImageMoments(measured, intrinsics=PIXELS), GOAL, gain=0.7)
    controller = nmm.Controller(ROBOT, task, nmm.ProjectedGradient())
    run = nmm.simulate(controller, ROBOT.rest, 9.0, 0.01, "zoh")
    seen = nmm.ImageMoments(BOARD, intrinsics=PIXELS)
    error = np.array([true(seen, q) - GOAL for q in run.q[[0, 600, 900]]]) / [525.0, 525.0, 1.0]
    assert np.linalg.norm(error[2]) < 3e-2 * np.linalg.norm(error[0])
    A = decay(controller, run.q[900])
    assert np.linalg.eigvals(A).real.min() > 0.0
    np.testing.assert_allclose(error[2], expm(-3.0 * A) @ error[1], atol=0.01 * np.linalg.norm(error[1]))
    asked = expm(-3.0 * 0.7 * np.eye(3)) @ error[1]  # with the right depth
    assert np.linalg.norm(error[2] - asked) > 0.03 * np.linalg.norm(error[1])


def delayed(gain: float, delay: int, compensated: bool) -> float:
    """The last error over the first of a head that turns to the ball, `delay` samples of 20 ms late."""
    robot = nmm.load("unicycle_pan_tilt", platform="fixed")
    ball, seen = nmm.MeasuredPoints([BALL]), nmm.ImagePoints([BALL])
    controller = nmm.Controller(
        robot, nmm.Task(nmm.ImagePoints(ball), [0.0, 0.0], gain=gain), nmm.ProjectedGradient()
    )
    q, places, error = np.array([0.1, 0.0]), [], []
    for k in range(400):
        error.append(nmm.evaluate(seen, 0.0, nmm.Configuration(robot, q)).value)
        places.append(q)
        then = max(k - delay, 0)
        ball.set(error[then], 0.02 * then, places[then] if compensated else q)
        q, _ = controller.step(0.02 * k, q, 0.02, "zoh")
    return float(np.abs(error[-50:]).max() / np.abs(error[0]).max())


@pytest.mark.thorough
def test_a_delay_is_borne_that_would_make_a_loop_without_foresight_unstable() -> None:
    """ė = -K e(t - τ) is unstable from K τ = π / 2 on, less half a sample that inputs are held."""
    assert delayed(2.0, 32, compensated=False) < 0.5  # K τ = 1.30
    assert delayed(2.0, 48, compensated=False) > 2.0  # K τ = 1.94
    assert delayed(2.0, 48, compensated=True) < 1e-3
    assert delayed(4.0, 60, compensated=True) < 1e-3


FAULTY = nmm.CameraFaults(
    rate=30.0, latency=0.1, noise=0.5, whole=True, dropped=0.2, size=[640, 480], focal=1.05,
    hand_eye=[0.01, 0.01, 0.0, 0.0, 0.02, 0.01], seed=3,
)  # fmt: skip


@pytest.mark.parametrize("observed", [False, True])
def test_a_loop_bears_what_cameras_do(observed: bool) -> None:
    """With a wrong camera the robot stands elsewhere, but what that camera shows is what was asked for."""
    measured = nmm.MeasuredPoints(BOARD, intrinsics=PIXELS, depth=1.3, observed=observed, faults=FAULTY)
    controller = docking(measured)
    run = nmm.simulate(controller, ROBOT.rest, 12.0, 0.02, "zoh")
    assert run.complete
    lost = the(run, "pictures_lost").values
    assert 0.1 < lost["lost"] / lost["taken"] < 0.3
    assert np.abs(run.error[-100:, :2]).max() < 3.0
    assert np.abs(run.error[-100:, 2]).max() < 0.03
    rolled = nmm.rollout(controller, ROBOT.rest, 12.0, 0.02, "zoh", keep=["q"])
    np.testing.assert_array_equal(rolled["q"][0], run.q)
    again = pickle.loads(pickle.dumps(controller))
    np.testing.assert_array_equal(nmm.simulate(again, ROBOT.rest, 2.0, 0.02, "zoh").q, run.q[:101])


def test_where_no_pictures_come_the_task_ends_and_the_robot_stops_within_accelerations() -> None:
    """The last picture is taken at 1 s; the robot holds on for 0.31 s."""
    measured, seen = nmm.MeasuredPoints(BOARD, intrinsics=PIXELS), nmm.ImagePoints(BOARD, intrinsics=PIXELS)
    fresh = nmm.While(measured.age(), upper=0.31, margin=0.0)
    dock = nmm.Task(nmm.ImageMoments(measured, intrinsics=PIXELS), GOAL, when=fresh)
    limits = nmm.Limits(acceleration=2.0)
    controller = nmm.SequencedController(ROBOT, dock, nmm.ProjectedGradient(), limits=limits, dt=0.02)
    q, inputs, docks = ROBOT.rest, [], []
    for k in range(150):
        t = 0.02 * k
        if t <= 1.0:
            measured.set(true(seen, q), t, q, 1.3)
        q, u = controller.step(t, q, 0.02, "zoh")
        inputs.append(u)
        docks.append(controller.moment.active[0])
    assert docks.index(False) == 66  # the first sample after 1.31 s
    moving = np.abs(inputs)
    assert moving[65].max() > 0.1
    assert moving[-1].max() < 1e-9
    assert np.abs(np.diff(inputs, axis=0)).max() <= 2.0 * 0.02 + 1e-12


def test_a_camera_sees_from_where_the_robot_is_not_from_where_odometry_has_it() -> None:
    """Wheels of which one is 3 % smaller lead odometry astray, but not what the camera shows."""
    measured = nmm.MeasuredPoints(BOARD, intrinsics=PIXELS, depth=1.3, faults=nmm.CameraFaults(rate=50.0))
    run = nmm.rollout(
        docking(measured),
        ROBOT.rest,
        12.0,
        0.02,
        "zoh",
        slip=[1.0, 0.9, 1.0, 1.0],
        odometry=True,
        keep=["q", "believed"],
    )
    q, believed = run["q"][0, -1], run["believed"][0, -1]
    assert np.abs(q[:3] - believed[:3]).max() > 0.01
    off = np.abs(true(nmm.ImageMoments(BOARD, intrinsics=PIXELS), q) - GOAL)
    assert off[:2].max() < 1.0
    assert off[2] < 1e-2


def test_copies_are_measured_by_themselves() -> None:
    ball = nmm.MeasuredPoints([BALL])
    controller = nmm.Controller(ROBOT, nmm.Task(nmm.ImagePoints(ball), [0.0, 0.0]), nmm.ProjectedGradient())
    ball.set([0.1, 0.0], 0.0, ROBOT.rest)
    other = copy.deepcopy(controller)
    ball.set([0.2, 0.0], 0.0, ROBOT.rest)
    assert controller.evaluate(0.0, ROBOT.rest).r[0] == pytest.approx(0.2)
    with pytest.raises(nmm.SingularError):
        other(0.0, ROBOT.rest)


def unplaced() -> None:
    nmm.MeasuredPoints([BALL]).set([0.0, 0.0], 0.0, ROBOT.rest)


def placed() -> nmm.MeasuredPoints:
    ball = nmm.MeasuredPoints([BALL])
    nmm.Controller(ROBOT, nmm.Task(nmm.ImagePoints(ball), [0.0, 0.0]), nmm.ProjectedGradient())
    return ball


def test_lost_pictures_of_two_tasks_of_one_camera_are_told_once() -> None:
    ball = nmm.MeasuredPoints([BALL], depth=1.7, faults=nmm.CameraFaults(dropped=0.3))
    tasks = [
        nmm.Task(nmm.ImagePoints(ball), [0.0, 0.0]),
        nmm.Task(nmm.LogDepth(ball.point(0)), [0.5], gain=0.1),
    ]
    controller = nmm.Controller(ROBOT, tasks, nmm.DampedLeastSquares())
    run = nmm.simulate(controller, ROBOT.rest, 1.0, 0.02, "zoh")
    assert [one.code for one in run.findings].count("pictures_lost") == 1
    (message,) = nmm.rollout(controller, ROBOT.rest, 1.0, 0.02, "zoh").message
    assert message.count("pictures") == 1


@pytest.mark.parametrize(
    ("made", "where"),
    [
        (unplaced, "set"),
        (lambda: placed().set("ab", 0.0, ROBOT.rest), "values"),
        (lambda: placed().set([0.0, 0.0], 0.0, ROBOT.rest, depth=-1.0), "depth"),
        (lambda: placed().set([0.0, 0.0], 0.0, ROBOT.rest, depth=[1.0, 2.0]), "depth"),
        (lambda: nmm.MeasuredPoints([BALL], depth="far"), "depth"),
        (lambda: placed().set([0.0, 0.0, 0.0], 0.0, ROBOT.rest), "values"),
        (lambda: nmm.MeasuredPoints([]), "points"),
        (lambda: nmm.MeasuredPoints([BALL], depth=-1.0), "depth"),
        (lambda: nmm.MeasuredPoints([BALL], depth=[1.0, 2.0]), "depth"),
        (lambda: nmm.MeasuredPoints([BALL]).point(1), "point"),
        (lambda: nmm.CameraFaults(rate=0.0), "rate"),
        (lambda: nmm.CameraFaults(dropped=1.0), "dropped"),
        (lambda: nmm.CameraFaults(hand_eye=[0.0, 1.0]), "hand_eye"),
    ],
)
def test_what_is_no_measurement_is_refused(made: object, where: str) -> None:
    with refused(where):
        made()  # type: ignore[operator]


def test_the_velocity_of_a_point_that_moves_is_estimated_as_the_steady_kalman_filter_does(
    rng: np.random.Generator,
) -> None:
    h, noise, acceleration = 0.05, 0.01, 0.7
    v, found = np.array([0.3, -0.2, 0.1]), MotionEstimate(acceleration)
    for k in range(200):
        p, rate = found.update(k * h, v * k * h, noise)
    np.testing.assert_allclose(np.concatenate([p, rate]), np.concatenate([v * k * h, v]), atol=1e-9)
    F, w = np.array([[1.0, h], [0.0, 1.0]]), np.array([[0.5 * h * h], [h]])
    spread = solve_discrete_are(F.T, np.array([[1.0], [0.0]]), acceleration**2 * w @ w.T, [[noise**2]])
    gain = spread[:, 0] / (spread[0, 0] + noise**2)
    off = rng.normal(size=3)
    before = np.array([p + rate * h, rate])
    p, rate = found.update(200 * h, before[0] + off, noise)
    np.testing.assert_allclose([p, rate], before + np.outer(gain, off), rtol=1e-6)
    again = found.update(200 * h, before[0] + 9.0, noise)  # the same picture twice, or an older one
    np.testing.assert_array_equal(again, [p, rate])


@pytest.mark.parametrize(("late", "noise", "most"), [(0.0, 0.0, 0.003), (0.2, 0.002, 0.04)])
def test_a_ball_that_moves_is_followed_with_its_motion_estimated(
    late: float, noise: float, most: float
) -> None:
    ball = nmm.Circle([2.0, 0.0, 0.4], 0.5, 0.6)
    faults = nmm.CameraFaults(latency=late, noise=noise, dropped=0.3 if noise else 0.0)
    worst = []
    for moving in (0.0, 1.0):
        seen = nmm.MeasuredPoints([ball], depth=1.8, moving=moving, faults=faults)
        task = nmm.Task(nmm.ImagePoints(seen), [0.0, 0.0], gain=2.0)
        controller = nmm.Controller(
            ROBOT, task, nmm.ReducedGradient(), STRAIGHT, limits=nmm.Limits(), dt=0.02
        )
        run = nmm.simulate(controller, {"x": 0.2, "y": -0.6, "pan": 0.5}, 6.0, 0.02, method="zoh")
        there = nmm.ImagePoints([ball])
        worst.append(
            max(
                np.abs(nmm.evaluate(there, t, nmm.Configuration(ROBOT, q)).value).max()
                for t, q in zip(run.t[150:], run.q[150:], strict=True)
            )
        )
    assert worst[1] < most < 0.08 < worst[0]


def test_what_is_lost_of_points_that_move_goes_on_as_it_did() -> None:
    points = nmm.MeasuredPoints([[2.0, 0.5, 0.6], [2.0, 0.7, 0.6]], moving=1.0)
    task = nmm.Task(nmm.ImagePoints(points), [0.0] * 4)
    controller = nmm.Controller(ROBOT, task, nmm.ProjectedGradient())
    seen = np.array([0.1, 0.0, -0.1, 0.0])
    for k in range(30):
        points.set(seen + 0.01 * k, 0.1 * k, ROBOT.rest, depth=2.0)
    for t in (3.0, 3.1):
        points.set([*(seen[:2] + 0.1 * t), np.nan, np.nan], t, ROBOT.rest, depth=2.0)
    found = controller.evaluate(3.1, ROBOT.rest)
    np.testing.assert_allclose(found.r, seen + 0.31, atol=2e-3)
    with refused("moving"):
        nmm.MeasuredPoints([BALL], observed=True, moving=0.1)
