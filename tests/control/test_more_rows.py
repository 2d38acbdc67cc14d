"""Tasks with more rows than inputs: damped least squares against NumPy's, with limits, levels and orders."""

from __future__ import annotations

import numpy as np
import pytest
from findings import the
from places import UR5

import nmm
from nmm.base.arrays import Array
from nmm.base.errors import InputError
from nmm.control.resolvers.answer import Status
from nmm.model.robots.robot import Robot

TALL = 6, 4
#: Image points of a square 0.4 m ahead of the camera; they shall be turned by 0.5 rad.
SQUARE = np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])


@pytest.fixture(scope="module")
def arm() -> Robot:
    return nmm.load("unicycle_3r", platform="fixed")


@pytest.mark.parametrize("seed", range(8))
def test_the_answer_is_numpys(seed: int) -> None:
    """Undamped, it is the least-squares solution of scaled rows; damped by a constant, that of [A; λ]."""
    rng = np.random.default_rng(seed)
    J, rate, scales = rng.normal(size=TALL), rng.normal(size=6), rng.uniform(0.5, 2.0, 6)
    problem = nmm.Problem(J=J, rate=rate, h=np.zeros(4), row_scales=scales)
    A, b = J / scales[:, np.newaxis], rate / scales
    u, residual, _, sigma = np.linalg.lstsq(A, b)
    answer = nmm.DampedLeastSquares().resolve(problem)
    np.testing.assert_allclose(answer.u, u, rtol=0.0, atol=1e-12)
    assert answer.status is Status.RELAXED
    assert answer.measure == pytest.approx(sigma[-1])
    assert answer.residual == pytest.approx(float(np.linalg.norm(J @ u - rate)))
    assert answer.nu[0] == pytest.approx(1.0 - residual[0] / (b @ b))
    damped = np.linalg.solve(A.T @ A + 0.3**2 * np.eye(4), A.T @ b)
    answer = nmm.DampedLeastSquares(law="constant", damping=0.3).resolve(problem)
    np.testing.assert_allclose(answer.u, damped, rtol=0.0, atol=1e-12)


def test_a_rate_that_can_be_done_is_done_and_lost_rank_stays_bounded() -> None:
    rng = np.random.default_rng(1)
    J = rng.normal(size=TALL)
    u = rng.normal(size=4)
    answer = nmm.DampedLeastSquares().resolve(nmm.Problem(J=J, rate=J @ u, h=np.zeros(4)))
    np.testing.assert_allclose(answer.u, u, rtol=0.0, atol=1e-12)
    assert answer.status is Status.SOLVED
    J[:, 3] = J[:, 0]
    answer = nmm.DampedLeastSquares().resolve(nmm.Problem(J=J, rate=J @ u, h=np.zeros(4)))
    np.testing.assert_allclose(J @ answer.u, J @ u, rtol=0.0, atol=1e-9)
    assert answer.u[0] == pytest.approx(answer.u[3])
    answer = nmm.DampedLeastSquares().resolve(nmm.Problem(J=np.zeros((6, 4)), rate=np.ones(6), h=np.zeros(4)))
    assert np.array_equal(answer.u, np.zeros(4))


def test_limits_scale_all_rows_alike() -> None:
    rng = np.random.default_rng(2)
    J, rate = rng.normal(size=TALL), rng.normal(size=6)
    free = np.linalg.lstsq(J, rate)[0]
    most = 0.5 * np.abs(free).max()
    problem = nmm.Problem(J=J, rate=rate, h=np.zeros(4), u_lower=np.full(4, -most), u_upper=np.full(4, most))
    answer = nmm.DampedLeastSquares().resolve(problem)
    np.testing.assert_allclose(answer.u, 0.5 * free, rtol=0.0, atol=1e-9)


def test_a_first_level_of_more_rows_leaves_the_next_what_it_does_not_use() -> None:
    rng = np.random.default_rng(3)
    first = rng.normal(size=(6, 3)) @ rng.normal(size=(3, 5))  # of rank 3
    J, rate = np.vstack([first, rng.normal(size=(2, 5))]), rng.normal(size=8)
    answer = nmm.DampedLeastSquares().resolve(nmm.Problem(J=J, rate=rate, h=np.zeros(5), levels=[6, 2]))
    np.testing.assert_allclose(
        first @ answer.u, first @ np.linalg.lstsq(first, rate[:6])[0], rtol=0.0, atol=1e-9
    )
    np.testing.assert_allclose(J[6:] @ answer.u, rate[6:], rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("resolver", [nmm.ProjectedGradient(), nmm.ReducedGradient(), nmm.ExtendedJacobian()])
def test_other_resolvers_name_priorities_and_dls(arm: Robot, resolver: nmm.extending.Resolver) -> None:
    task = nmm.Task(nmm.Pose("ee"), [0.5, 0.1, 0.4, 0.0, 0.0, 0.0])
    with pytest.raises(InputError, match=r"at most 3 rows.*priorities.*dls alone.*least-squares") as caught:
        nmm.Controller(arm, task, resolver)
    assert caught.value.got == 6


def test_priorities_that_the_message_names_work(arm: Robot) -> None:
    tasks = [
        nmm.Task(nmm.Position("ee"), [0.5, 0.1, 0.6], priority=1),
        nmm.Task(nmm.Orientation("ee"), [0.0, 0.0, 0.0], priority=2),
    ]
    for resolver in (nmm.ProjectedGradient(), nmm.DampedLeastSquares()):
        run = nmm.simulate(nmm.Controller(arm, tasks, resolver), {"q2": 0.5, "q3": 0.9}, 15.0, 0.01)
        assert np.abs(run.error[-1, :3]).max() < 1e-4


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("limits", [None, nmm.Limits(velocity=False, acceleration=3.0)])
def test_a_pose_on_three_joints_ends_where_the_squares_are_least(
    arm: Robot, order: int, limits: nmm.Limits | None
) -> None:
    task = nmm.Task(nmm.Pose("ee"), [0.5, 0.1, 0.6, 0.0, 0.0, 0.3], gain=1.0)
    given = {} if limits is None else {"limits": limits, "dt": 0.01}
    controller = nmm.Controller(arm, task, nmm.DampedLeastSquares(), order=order, **given)
    run = nmm.simulate(controller, {"q2": 0.5, "q3": 0.9}, 45.0, 0.01, "zoh")
    assert np.abs(run.u[-100:]).max() < 1e-4
    step = controller.evaluate(45.0, run.q[-1])
    scales = np.array([arm.reach] * 3 + [1.0] * 3)
    # No joint brings it nearer: Jᵀ e is 0, rows in their scales.
    assert np.abs((step.J / scales[:, np.newaxis]).T @ (step.error / scales)).max() < 1e-4
    assert run.scale[-1, 0] < 0.01
    assert run.residual[-1] == pytest.approx(float(np.linalg.norm(step.error)), rel=1e-3)
    found = the(run, "inputs_unmet")
    assert (found.values["rows"], found.values["inputs"]) == (6, 3)
    assert "6 rows on 3 inputs are done in the least-squares sense" in str(found)


def test_four_image_points_are_brought_where_they_shall_be() -> None:
    """Eight rows on six joints: the error goes to 0 as the points can be there, turned by 0.5 rad."""
    source = UR5
    robot = nmm.load(source, platform="fixed")
    start = robot.q([0.3, -1.2, 1.6, -0.9, -1.4, 0.0])
    camera = nmm.Configuration(robot, start).placement("tool0")
    points = [camera.act(np.array([0.05 * a, 0.05 * b, 0.4])) for a, b in SQUARE]
    turned: Array = 0.125 * SQUARE @ np.array([[np.cos(0.5), np.sin(0.5)], [-np.sin(0.5), np.cos(0.5)]])
    task = nmm.Task(nmm.ImagePoints(points, camera="tool0"), turned.ravel())
    run = nmm.simulate(nmm.Controller(robot, task, nmm.DampedLeastSquares(), dt=0.01), start, 15.0, 0.01)
    assert np.abs(run.error[-1]).max() < 1e-5
    assert run.complete
    where = nmm.Configuration(robot, run.q[-1]).placement("tool0")
    turn = camera.rotation.T @ where.rotation
    assert np.arctan2(turn[1, 0], turn[0, 0]) == pytest.approx(-0.5, abs=1e-3)
