"""Self-motions: the task rests, the wheels roll, the robot moves there and back, and says why it stops."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from findings import the
from numpy import pi
from numpy.typing import NDArray
from planar_arms import planar_arm
from robot_grid import built, frame_of, start
from spatial_arms import UR5

import nmm
from nmm.analysis.null_space.moving import SelfMotion, self_motion
from nmm.analysis.null_space.report import redundancy
from nmm.base.errors import InputError, SingularError
from nmm.control.functions.tasks import Pose, Position, Task
from nmm.model.robots.configuration import Configuration
from nmm.model.robots.robot import Robot
from nmm.views.playback import write_html

Array = NDArray[np.float64]

TIP = Position("ee", "xy")
BENT = {"theta": 0.3, "q1": 0.4, "q2": 0.7}


@pytest.fixture(scope="module")
def three_links(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    return planar_arm(tmp_path_factory.mktemp("arm"), 1.0, 1.0, 1.0)


def assert_laws(found: SelfMotion, speed: float, duration: float) -> None:
    """What every self-motion must fulfil."""
    trajectory = found.trajectory
    robot, t, q, n_p = trajectory.robot, trajectory.t, trajectory.q, trajectory.robot.platform.n_p
    assert np.abs(trajectory.error).max() < 1e-8
    for k in range(0, len(t), 7):
        np.testing.assert_allclose(robot.S(q[k]) @ trajectory.u[k], trajectory.q_dot[k], atol=1e-12)
        A = robot.platform.A(q[k, :n_p])
        assert np.abs(A @ trajectory.q_dot[k, :n_p]).max(initial=0.0) < 1e-12
    # What is recorded as velocity is how q changes.
    h = float(t[1] - t[0])
    np.testing.assert_allclose((q[2:] - q[:-2]) / (2 * h), trajectory.q_dot[1:-1], atol=20 * h**2)
    # There and back, at rest at both ends and where it turns.
    middle = found.turning
    np.testing.assert_array_equal(q[middle:], q[middle::-1])
    np.testing.assert_allclose(t, t[-1] - t[::-1], atol=1e-12)
    np.testing.assert_allclose(t[-1], 2 * duration, atol=1e-12)
    for k in (0, middle, -1):
        assert np.abs(trajectory.u[k]).max() < 1e-7
    size = np.linalg.norm(trajectory.u, axis=1)
    if not found.ended:
        np.testing.assert_allclose(size.max(), speed, rtol=1e-3)
    way = float(np.sum((size[1 : middle + 1] + size[:middle]) / 2 * h))
    np.testing.assert_allclose(way, found.length, rtol=1e-3)
    lower, upper = robot.q_limits.T
    assert np.all((q >= lower - 1e-9) & (q <= upper + 1e-9))


@pytest.mark.parametrize(
    "direction", [0, 1, "v", "omega", "q1", {"v": -1.0, "q2": 0.5}, [0.0, 1.0, 0.0, 1.0]]
)
def test_a_position_is_held(robot_2r: Robot, direction: Any) -> None:
    found = self_motion((robot_2r, TIP), BENT, direction=direction)
    assert found.ended == ""
    assert_laws(found, 0.5, 4.0)
    tips = [Configuration(robot_2r, q).placement("ee").translation for q in found.trajectory.q[::20]]
    assert np.ptp(tips, axis=0).max() < 1e-8
    assert np.ptp(found.trajectory.q, axis=0).max() > 0.3


@pytest.mark.parametrize("direction", [0, 1, "v", "elbow_joint"])
def test_a_pose_is_held(ur5: Robot, direction: int | str) -> None:
    found = self_motion((ur5, Pose("tool0")), UR5, direction=direction, duration=2.0, dt=0.02)
    assert_laws(found, 0.5, 2.0)
    before = Configuration(ur5, found.trajectory.q[0]).placement("tool0")
    after = Configuration(ur5, found.trajectory.q[found.turning]).placement("tool0")
    assert np.abs(before.homogeneous - after.homogeneous).max() < 1e-8
    assert np.abs(found.trajectory.q[found.turning] - found.trajectory.q[0]).max() > 0.1


def test_a_readable_direction_moves_its_own_inputs_alone(robot_2r: Robot) -> None:
    report = redundancy((robot_2r, TIP), BENT)
    for k, vector in enumerate(report.readable):
        found = self_motion((robot_2r, TIP), BENT, direction=k)
        idle = found.trajectory.u[:, vector == 0.0]
        assert idle.shape[1] == 1
        assert np.abs(idle).max() < 1e-8
        assert found.text == report.texts[k]
        begins = found.trajectory.u[1] / np.abs(found.trajectory.u[1]).max()
        np.testing.assert_allclose(begins, vector, atol=0.01)


def test_a_wish_is_followed_as_far_as_the_task_allows(robot_2r: Robot) -> None:
    """Of all null vectors of its length the one taken is nearest to the wish, at each sample."""
    wish = np.array([0.0, 1.0, 0.0, 1.0])
    trajectory = self_motion((robot_2r, TIP), BENT, direction=wish).trajectory
    for k in (50, 200, 350):
        null = redundancy((robot_2r, TIP), trajectory.q[k]).null
        best = null.T @ (null @ wish)
        np.testing.assert_allclose(
            trajectory.u[k], best * 0.5 * np.sin(pi * k / 400) / np.linalg.norm(best), atol=1e-7
        )


def by_singular_values(found: SelfMotion, task: Task, direction: Any, columns: list[int]) -> Array:
    """q (N, n) of the way there once more: LAPACK's singular vectors, one step of RK4 a sample."""
    robot, times = found.trajectory.robot, found.trajectory.t[: found.turning + 1]
    controller = nmm.Controller(robot, task, nmm.ProjectedGradient(), steering=False)
    e0 = controller.evaluate(0.0, found.trajectory.q[0]).error
    last = np.zeros(robot.n_u)

    def n(J: Array) -> Array:
        """The null vector of some columns, near the last one; or what is left of a wish."""
        if not columns:
            left = direction - np.linalg.pinv(J) @ J @ direction
            return np.asarray(left / np.linalg.norm(left))
        vector = np.zeros(robot.n_u)
        vector[columns] = np.linalg.svd(J[:, columns])[2][-1]
        return np.asarray(vector * np.sign(vector @ (last if last.any() else direction)))

    def velocity(t: float, q: Array) -> tuple[Array, Array]:
        step = controller.evaluate(0.0, q)
        rate = found.length * pi / (2.0 * times[-1]) * np.sin(pi * t / times[-1])
        u = rate * n(step.J) + np.linalg.pinv(step.J) @ (10.0 * (step.error - e0))
        return robot.S(q) @ u, n(step.J)

    every = [found.trajectory.q[0]]
    for t, h in zip(times, np.diff(times), strict=False):
        q = every[-1]
        k1, along = velocity(t, q)
        last = along
        k2, _ = velocity(t + h / 2, q + h / 2 * k1)
        k3, _ = velocity(t + h / 2, q + h / 2 * k2)
        k4, _ = velocity(t + h, q + h * k3)
        every.append(q + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4))
    return np.array(every)


def test_it_is_what_singular_vectors_make_of_it(robot_2r: Robot) -> None:
    """The same motions, the same to rounding: of a few inputs, of a wish, of a user's function in Python."""
    q0 = robot_2r.q(BENT)
    report = redundancy((robot_2r, TIP), q0)
    held = Task(TIP, Configuration(robot_2r, q0).placement("ee").translation[:2], 10.0)
    for k, vector in enumerate(report.readable):
        found = self_motion((robot_2r, TIP), q0, direction=k, duration=1.0)
        again = by_singular_values(found, held, vector, [*np.flatnonzero(vector)])
        np.testing.assert_allclose(found.trajectory.q[: found.turning + 1], again, atol=1e-12)
    wish = np.array([0.3, 1.0, 0.0, 1.0])
    found = self_motion((robot_2r, TIP), q0, direction=wish, duration=1.0)
    again = by_singular_values(found, held, wish, [])
    np.testing.assert_allclose(found.trajectory.q[: found.turning + 1], again, atol=1e-12)
    assert found.trajectory.kinematics_off < 1e-13

    point = nmm.CallableFunction(
        lambda c: c.placement("ee").translation[:2],
        ["x", "y"],
        units=["m", "m"],
        jacobian=lambda c: c.jacobian("ee")[:2],
    )
    same = self_motion((robot_2r, point), q0, direction=wish, duration=1.0)
    np.testing.assert_allclose(same.trajectory.q, found.trajectory.q, atol=1e-12)


@pytest.mark.parametrize(
    "base", ["car", "second trailer", "mecanum", "differential", "described by its wheels"]
)
def test_on_many_platforms(base: str) -> None:
    robot, frame = built(base, "small arm"), frame_of(base, "small arm")
    q0 = start(base, "small arm")
    report = redundancy((robot, Position(frame)), q0)
    for k in range(len(report.readable)):
        found = self_motion((robot, Position(frame)), q0, direction=k, duration=1.0, speed=0.3)
        assert_laws(found, 0.3, 1.0)
        assert found.trajectory.desired is None  # the task rests: no path is to be followed


def test_a_fixed_base_moves_its_arm() -> None:
    robot, frame = built("fixed", "Panda"), frame_of("fixed", "Panda")
    found = self_motion((robot, Pose(frame)), start("fixed", "Panda"), duration=1.0)
    assert_laws(found, 0.5, 1.0)
    assert np.ptp(found.trajectory.q, axis=0).max() > 0.05


def test_a_scenarios_task_is_held_as_it_stands(robot_2r: Robot) -> None:
    """The moving circle stands; the bearing from the elbow, a function of q, keeps its error."""
    scenario = nmm.Scenario.load("unicycle_2r_link_pointing")
    controller = scenario.controller()
    q0 = controller.robot.q({**BENT, "x": 1.0})
    found = self_motion(controller, q0, duration=2.0)
    assert_laws(found, 0.5, 2.0)
    bare = nmm.Controller(controller.robot, controller.task, nmm.ProjectedGradient())
    errors = np.array([bare.evaluate(0.0, q).error for q in found.trajectory.q[::20]])
    assert np.abs(errors[0]).max() > 0.1
    np.testing.assert_allclose(errors - errors[0], 0.0, atol=1e-8)


def test_an_error_of_half_a_turn_is_held_too(robot_2r: Robot) -> None:
    """The error that stays at π may be read as -π: neither is an error of a turn."""
    towards = nmm.Task(nmm.Heading("link2"), nmm.Bearing(nmm.Position("ee", "xy"), [-5.0, 0.0]))
    robot = robot_2r
    found = self_motion((robot, [Task(TIP, [0.0, 0.0]), towards]), {"q1": 0.5, "q2": -0.5}, duration=1.0)
    assert_laws(found, 0.5, 1.0)


def test_steps_do_not_widen_with_the_samples(robot_2r: Robot) -> None:
    found = self_motion((robot_2r, TIP), BENT, duration=1.0, dt=0.1, speed=2.0)
    assert len(found.trajectory) == 21
    assert np.abs(found.trajectory.error).max() < 1e-8


@pytest.mark.parametrize("direction", [1, "steering_rate"])
def test_it_turns_back_before_a_limit(direction: int | str) -> None:
    robot = nmm.mount("car_base", "small_arm", at="arm_mount")
    q0 = robot.q({"steering": 0.2, "q2": 0.3, "q3": 1.7, "q4": 0.6})
    found = self_motion((robot, Position("ee")), q0, direction=direction, duration=4.0)
    assert found.ended == "steering at the limit"
    assert the(found.trajectory, "turned_back_early").values["text"] == found.ended
    assert_laws(found, 0.5, 4.0)
    top = robot.q_limits[robot.coordinate("steering"), 1]
    reached = found.trajectory.q[found.turning, robot.coordinate("steering")]
    assert 0.9 * (top - 0.2) < reached - 0.2 < top - 0.2


def test_it_cannot_begin_at_a_limit() -> None:
    robot = nmm.mount("car_base", "small_arm", at="arm_mount")
    top = float(robot.q_limits[robot.coordinate("steering"), 1])
    q0 = {"steering": top, "q2": 0.3, "q3": 1.7, "q4": 0.6}
    with pytest.raises(SingularError, match="cannot begin: steering at the limit"):
        self_motion((robot, Position("ee")), q0, direction="steering_rate")
    found = self_motion((robot, Position("ee")), q0, direction={"steering_rate": -1}, duration=0.5)
    assert_laws(found, 0.5, 0.5)


def test_it_turns_back_before_a_singular_configuration(three_links: Robot) -> None:
    """A parallelogram of three links and the ground: all in one line it is singular, and it gets there."""
    a = 0.9
    q0 = three_links.q({"q1": a, "q2": -a, "q3": a + pi})
    (vector,) = redundancy((three_links, TIP), q0).readable
    down = -np.sign(vector[0]) * vector
    found = self_motion((three_links, TIP), q0, direction=down, duration=4.0, speed=1.0)
    assert found.ended == "J comes close to a singular configuration"
    assert_laws(found, 1.0, 4.0)
    last = found.trajectory.q[found.turning]
    np.testing.assert_allclose(last[0] + last[1], 0.0, atol=1e-8)
    assert 0.0 < last[0] < 0.1 * a


def test_a_singular_start_is_refused() -> None:
    robot = nmm.load("unicycle_2r", arguments={"d": 0.0})
    with pytest.raises(SingularError, match="rank 1 at q and 2 nearby"):
        self_motion((robot, TIP), {"q1": pi / 2})
    for wrong, message in ((3, "from 0 to 2, got 3"), ("w", "unknown input 'w'")):
        with pytest.raises(InputError, match=message):
            self_motion((robot, TIP), {"q1": pi / 2}, direction=wrong)


def test_a_row_that_nothing_moves_is_no_singularity(robot_2r: Robot) -> None:
    found = self_motion((robot_2r, Position("ee", "xyz")), BENT, duration=1.0)
    assert_laws(found, 0.5, 1.0)


def test_inputs_that_depend_on_each_other_here_alone(robot_2r: Robot) -> None:
    """Stretched out, q1 and q2 repeat each other; beside it they do not, and others have to help."""
    report = redundancy((robot_2r, TIP), {})
    assert np.count_nonzero(report.readable[0]) == 2
    found = self_motion((robot_2r, TIP), {}, direction=0, duration=2.0)
    assert_laws(found, 0.5, 2.0)


def test_it_plays_and_is_saved(robot_2r: Robot, tmp_path: Any) -> None:
    found = self_motion((robot_2r, TIP), BENT, duration=0.5)
    motion = found.trajectory.motion("self-motion")
    assert motion.label == "self-motion"
    assert motion.frame == "ee"
    assert np.ptp(motion.driven, axis=0).max() < 1e-8
    page = write_html([motion], tmp_path / "page.html")
    assert page.stat().st_size > 100_000
    found.trajectory.save(tmp_path / "run", figures=False)
    back = nmm.Trajectory.load(tmp_path / "run")
    np.testing.assert_array_equal(back.q, found.trajectory.q)
    assert back.resolver == "self-motion"


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"direction": 2}, "from 0 to 1, got 2"),
        ({"direction": -1}, "from 0 to 1, got -1"),
        ({"direction": "q7"}, "unknown input 'q7'"),
        ({"direction": {"w": 1}}, "unknown input 'w'"),
        ({"direction": {"v": 0}}, "not 0"),
        ({"direction": [1, 2]}, "expected 4 numbers"),
        ({"direction": True}, "got True"),
        ({"duration": 0}, "duration"),
        ({"speed": -1}, "speed"),
        ({"dt": 0}, "dt"),
        ({"dt": 2.0}, "a quarter of the duration"),
    ],
)
def test_bad_input(robot_2r: Robot, settings: Mapping[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        self_motion((robot_2r, TIP), BENT, **settings)


def test_a_wish_that_only_moves_the_task(robot_2r: Robot) -> None:
    J = redundancy((robot_2r, TIP), BENT).J
    with pytest.raises(InputError, match="the wished inputs move the task"):
        self_motion((robot_2r, TIP), BENT, direction=J[0])


def test_no_motion_is_free() -> None:
    with pytest.raises(InputError, match="leaves no motion free"):
        self_motion((built("fixed", "UR5"), Pose(frame_of("fixed", "UR5"))), start("fixed", "UR5"))


def test_a_start_outside_the_limits() -> None:
    robot = nmm.mount("car_base", "small_arm", at="arm_mount")
    with pytest.raises(InputError, match="outside its limits"):
        self_motion((robot, Position("ee")), {"steering": 1.2, "q3": 1.7})
