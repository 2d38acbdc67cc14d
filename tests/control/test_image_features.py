"""What a camera sees, as tasks and as limits."""

from __future__ import annotations

import numpy as np
import pytest
from derivatives import check_equation, check_function
from findings import refused, the
from symbolic_checks import check_numbers

import nmm
from nmm.plugins.symbolic import symbolic

ROBOT = nmm.load("unicycle_pan_tilt")
BALL = [2.0, 0.5, 0.6]
PIXELS = [500.0, 520.0, 320.0, 240.0]
CIRCLE = nmm.Circle([3.0, 0.2, 0.7], 0.3, 0.5)
FUNCTIONS = {
    "point": nmm.ImagePoints([BALL]),
    "points": nmm.ImagePoints([BALL, CIRCLE], intrinsics=PIXELS),
    "line": nmm.ImageLine([[1.5, -0.5, 0.0], [5.0, -0.3, 0.2]]),
    "moments": nmm.ImageMoments([BALL, CIRCLE, [2.5, 0.1, 0.9]], intrinsics=PIXELS),
    "depth": nmm.LogDepth(BALL),
}


def seeing(rng: np.random.Generator) -> np.ndarray:
    """A configuration from where all of that is ahead."""
    return rng.uniform([-0.5, -0.5, -0.3, -0.3, -0.3], [0.5, 0.5, 0.3, 0.3, 0.3])


@pytest.mark.parametrize("name", FUNCTIONS)
def test_derivatives_are_those_of_differences(name: str, rng: np.random.Generator) -> None:
    for _ in range(5):
        check_function(FUNCTIONS[name], ROBOT, 0.7, seeing(rng))


def interaction(x: float, y: float, Z: float) -> np.ndarray:
    """L of a point for v and ω of the camera in its own axes (Chaumette and Hutchinson 2006, eq. 11)."""
    return np.array(
        [
            [-1.0 / Z, 0.0, x / Z, x * y, -(1.0 + x * x), y],
            [0.0, -1.0 / Z, y / Z, 1.0 + y * y, -x * y, -x],
        ]
    )


def by_hand(q: np.ndarray, point: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """x, y; J (2, 4) for v, ω, pan, tilt; Z: of the bundled robot, from its dimensions."""
    d, height, c = 0.2, 0.7, 0.05
    x, y, theta, pan, tilt = q
    a = theta + pan
    ahead = np.array([np.cos(tilt) * np.cos(a), np.cos(tilt) * np.sin(a), -np.sin(tilt)])
    right = np.array([np.sin(a), -np.cos(a), 0.0])
    R = np.column_stack([right, np.cross(ahead, right), ahead])
    platform = np.array([np.cos(theta), np.sin(theta), 0.0])
    to_column = d * platform
    lens = np.array([x, y, height]) + to_column + c * ahead
    up = np.array([0.0, 0.0, 1.0])
    about = [up, up, -right]  # of ω, pan, tilt; tilt turns about the left
    arms = [to_column + c * ahead, c * ahead, c * ahead]
    twists = [np.concatenate([R.T @ platform, np.zeros(3)])]
    twists += [np.concatenate([R.T @ np.cross(w, r), R.T @ w]) for w, r in zip(about, arms, strict=True)]
    X, Y, Z = R.T @ (point - lens)
    return np.array([X / Z, Y / Z]), interaction(X / Z, Y / Z, Z) @ np.column_stack(twists), Z


def test_the_jacobian_is_the_interaction_matrix_of_the_cameras_motion(rng: np.random.Generator) -> None:
    task = nmm.Task(FUNCTIONS["point"], [0.1, 0.0])
    controller = nmm.Controller(ROBOT, task, nmm.ProjectedGradient())
    depth = nmm.LogDepth(BALL)
    for _ in range(20):
        q = seeing(rng)
        (x, y), J, Z = by_hand(q, np.array(BALL))
        here = controller.evaluate(0.0, q)
        np.testing.assert_allclose(here.r, [x, y], atol=1e-12)
        np.testing.assert_allclose(here.J, J, atol=1e-12)
        assert nmm.evaluate(depth, 0.0, nmm.Configuration(ROBOT, q)).value[0] == pytest.approx(np.log(Z))


def test_a_line_in_the_picture_is_that_of_its_points(rng: np.random.Generator) -> None:
    """Whatever points of the line are taken: their pictures are on it."""
    a, b = np.array([1.5, -0.5, 0.0]), np.array([5.0, -0.3, 0.2])
    here = nmm.Configuration(ROBOT, seeing(rng))
    for intrinsics in (None, PIXELS):
        rho, theta = nmm.evaluate(nmm.ImageLine([a, b], intrinsics=intrinsics), 0.0, here).value
        between = [a + s * (b - a) for s in (0.0, 0.3, 1.0, 2.0)]
        x, y = nmm.evaluate(nmm.ImagePoints(between, intrinsics=intrinsics), 0.0, here).value.reshape(-1, 2).T
        np.testing.assert_allclose(x * np.cos(theta) + y * np.sin(theta), rho, atol=1e-9)


@pytest.mark.parametrize("name", ["point", "points", "depth"])  # those of a line are too long to be read
def test_formulas_are_the_numbers(name: str, rng: np.random.Generator) -> None:
    function = FUNCTIONS[name]
    if name == "points":
        function = nmm.ImagePoints([BALL, [3.0, 0.2, 0.7]])
    check_numbers(ROBOT, function, symbolic(ROBOT, function), [seeing(rng) for _ in range(3)], 1e-9)


def test_a_ball_that_moves_is_followed_with_its_motion_ahead() -> None:
    scenario = nmm.Scenario.load("pan_tilt_follow")
    check_equation(scenario.controller(), 0.3, ROBOT.q(scenario.parts.q0))
    rg, pg = (scenario.with_resolver(kind).run() for kind in ("rg", "pg"))
    for run in (rg, pg):
        assert run.complete
        assert not run.findings
        assert np.abs(run.error[-1]).max() < 1e-8
    # The head is turned to straight ahead, and RG leaves it nearer to there.
    assert np.abs(rg.q[-1, 3]) < 1e-3
    weight = np.gradient(rg.t)
    assert rg.objective @ weight < 0.4 * (pg.objective @ weight)


def test_half_as_far_is_twice_as_large() -> None:
    """Seen from the front, a board grows by log 2 where its distance is halved; its mean stays."""
    robot = nmm.load("unicycle_pan_tilt")
    board = nmm.ImageMoments([[2.25, y, z] for y in (-0.2, 0.2) for z in (0.5, 0.9)])
    far, near = (nmm.evaluate(board, 0.0, nmm.Configuration(robot, robot.q({"x": x}))) for x in (0.0, 1.0))
    np.testing.assert_allclose(near.value - far.value, [0.0, 0.0, np.log(2.0)], atol=1e-12)


def test_limits_keep_a_point_in_the_picture() -> None:
    """The head is to look away, and the ball stays within a quarter of the picture's width."""
    seen = FUNCTIONS["point"]
    away = nmm.Task(nmm.Posture("pan"), [0.9])
    limits = nmm.Limits(bounds=nmm.Bound(seen, -0.4, 0.4))
    controller = nmm.Controller(ROBOT, away, nmm.ProjectedGradient(), limits=limits, dt=0.02)
    run = nmm.simulate(controller, ROBOT.rest, 4.0, 0.02)
    x = np.array([nmm.evaluate(seen, 0.0, nmm.Configuration(ROBOT, q)).value for q in run.q])
    assert run.complete
    assert np.abs(x).max() <= 0.4 + 1e-9
    assert run.q[-1, 3] > 0.3  # it went as far as that allows


def test_behind_the_camera_a_run_ends_by_name() -> None:
    behind = {"x": 4.0}
    aim = nmm.Task(FUNCTIONS["point"], [0.0, 0.0])
    hold = nmm.Task(nmm.Posture("pan"), [0.4])
    limits = nmm.Limits(bounds=nmm.Bound(FUNCTIONS["point"], -0.4, 0.4))
    soft = nmm.Limits(bounds=nmm.Bound(FUNCTIONS["point"], -0.4, 0.4, priority=1))
    for task, kept in ((aim, None), (hold, limits), (hold, soft)):
        controller = nmm.Controller(ROBOT, task, nmm.ProjectedGradient(), limits=kept, dt=0.02)
        run = nmm.simulate(controller, behind, 1.0, 0.02)
        assert run.outcome is nmm.Outcome.SINGULAR
        assert "behind camera_optical_frame (Z = -2.25 m)" in the(run, "singular").values["undefined"]
        with pytest.raises(nmm.SingularError):
            controller(0.0, ROBOT.q(behind))


@pytest.mark.parametrize(
    ("made", "where"),
    [
        (lambda: nmm.ImagePoints([]), "points"),
        (lambda: nmm.ImagePoints("ee"), "points"),
        (lambda: nmm.ImagePoints([[1, 2]]), "points"),
        (lambda: nmm.ImagePoints([BALL], intrinsics=[1, 2, 3]), "intrinsics"),
        (lambda: nmm.ImagePoints([BALL], intrinsics=[-500, 500, 320, 240]), "intrinsics"),
        (lambda: nmm.ImageLine([BALL]), "points"),
        (lambda: nmm.ImagePoints([BALL], "lens").rows(ROBOT), "robot unicycle_pan_tilt"),
        (lambda: nmm.ImagePoints(["camera_optical_frame"]).rows(ROBOT), "points"),
        (lambda: nmm.ImagePoints([BALL]).rows(nmm.load("unicycle_2r")), "camera"),
    ],
)
def test_what_no_camera_sees_is_refused(made: object, where: str) -> None:
    with refused(where):
        made()  # type: ignore[operator]
