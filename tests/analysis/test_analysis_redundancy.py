"""Redundancy: the paper's degrees, null spaces that are null, self-motions that the wheels withhold."""

from __future__ import annotations

import numpy as np
import pytest
from numpy import pi
from numpy.typing import NDArray
from platform_grid import EXAMPLES, random_qp
from robot_grid import built, frame_of, start

from nmm.analysis.null_space.null_fields import readable_null_space
from nmm.analysis.null_space.report import RedundancyReport, redundancy
from nmm.analysis.singular.parts import null_space
from nmm.base.errors import InputError, SingularError
from nmm.control.controller import Controller
from nmm.control.functions.function import Function
from nmm.control.functions.references import Bearing
from nmm.control.functions.tasks import Heading, Pose, Position, Task
from nmm.control.resolvers import ProjectedGradient
from nmm.model.robots.configuration import Configuration
from nmm.model.robots.loading import load, mount
from nmm.model.robots.robot import Robot

Array = NDArray[np.float64]

TIP = Task(Position("ee", "xy"), [0.0, 0.0])
TIP_3D = Task(Position("ee", "xyz"), [0.0, 0.0, 0.0])
POINTING = (TIP, Task(Heading("link2"), 0.0))
LINK_POINTING = (TIP, Task(Heading("link1"), Bearing(Position("link2", "xy"), [6.0, 2.0])))

#: Every base with the small arm, and the other arms on one that rolls and on none.
ROBOTS = [
    *((base, "small arm") for base in ("unicycle", "differential", "car", "front-driven car", "tractor")),
    *((base, "small arm") for base in ("second trailer", "mecanum", "described by its wheels", "fixed")),
    *(("unicycle", arm) for arm in ("UR5", "Panda", "Kinova")),
    *(("fixed", arm) for arm in ("UR5", "Panda")),
]


def draw(robot: Robot, rng: np.random.Generator) -> Array:
    """A configuration inside the limits."""
    lower, upper = robot.q_limits.T
    return rng.uniform(np.maximum(lower, -2.0), np.minimum(upper, 2.0))


def assert_null_space(J: Array, rank: int, null: Array, readable: Array) -> None:
    s, m = J.shape
    size = max(1.0, float(np.linalg.norm(J, 2)))
    assert null.shape == readable.shape == (m - rank, m)
    np.testing.assert_allclose(null @ null.T, np.eye(m - rank), atol=1e-12)
    assert np.abs(J @ null.T).max(initial=0.0) < 1e-12 * size
    assert np.abs(J @ readable.T).max(initial=0.0) < 1e-12 * size
    assert np.all(np.count_nonzero(readable, axis=1) <= min(rank, s) + 1)
    np.testing.assert_allclose(np.abs(readable).max(axis=1, initial=0.0), 1.0)
    assert np.linalg.matrix_rank(readable, tol=1e-4) == m - rank


def assert_report(report: RedundancyReport) -> None:
    """What every report must fulfil."""
    robot, F, S = report.robot, report.F, report.S
    size = max(1.0, float(np.linalg.norm(F, 2)))
    np.testing.assert_allclose(F @ S, report.J, atol=1e-12 * size)
    assert_null_space(report.J, report.rank_J, report.null, report.readable)
    assert len(report.texts) == len(report.readable) == report.free
    # The self-motions of the inputs and those withheld are together all those of the coordinates.
    assert np.abs(F @ report.withheld.T).max(initial=0.0) < 1e-11 * size
    both = np.vstack([report.readable @ S.T, report.withheld])
    assert len(both) == report.manifold
    assert np.linalg.matrix_rank(both, tol=1e-6) == report.manifold
    for one in report.withheld:
        n_p = robot.platform.n_p
        assert np.linalg.norm(robot.platform.A(report.q[:n_p]) @ one[:n_p]) > 1e-6
    text = report.text()
    for part in (*report.texts, *report.withheld_texts, *report.withheld_coordinates):
        assert part in text


@pytest.mark.parametrize(("base", "arm"), ROBOTS)
def test_null_spaces_of_many_robots(base: str, arm: str, rng: np.random.Generator) -> None:
    robot, frame = built(base, arm), frame_of(base, arm)
    q0 = robot.q(start(base, arm))
    tasks: list[Function] = [Position(frame, "xyz")]
    tasks += [Pose(frame)] if robot.n_u >= 6 else []
    lower, upper = robot.q_limits.T
    for task in tasks:
        for size in (0.0, 0.3):
            q = np.clip(q0 + rng.uniform(-size, size, robot.n), lower, upper)
            report = redundancy((robot, task), q)
            assert_report(report)
            assert report.static == robot.n - len(report.rows)
            assert report.kinematic == robot.n_u - len(report.rows)


@pytest.mark.parametrize("name", EXAMPLES)
def test_null_spaces_on_every_platform(name: str, rng: np.random.Generator) -> None:
    platform = EXAMPLES[name]
    for s in (1, 2, 4):
        F = rng.normal(size=(s, platform.n_p + 4))
        G = platform.G(random_qp(platform, rng, 1.0))
        J = np.hstack([F[:, : platform.n_p] @ G, F[:, platform.n_p :]])
        rank = int(np.linalg.matrix_rank(J))
        readable = readable_null_space(J, rank, [1] * platform.p + [0] * 4)
        assert_null_space(J, rank, null_space(J, rank), readable)


def test_a_basis_is_as_sparse_as_there_is() -> None:
    """Columns that are zero, parallel or dependent in threes say so before the larger sets."""
    J = np.array([[1.0, 0, 2, 0, 1, 0], [0.0, 0, 0, 1, 1, 3]])
    readable = readable_null_space(J, 2, [0] * 6)
    assert sorted(np.count_nonzero(readable, axis=1)) == [1, 2, 2, 3]
    assert_null_space(J, 2, null_space(J, 2), readable)


def test_many_columns_have_a_sparse_basis_too(rng: np.random.Generator) -> None:
    J = rng.normal(size=(6, 40))
    readable = readable_null_space(J, 6, [0] * 40)
    assert_null_space(J, 6, null_space(J, 6), readable)


def test_cheap_columns_come_first(rng: np.random.Generator) -> None:
    J = rng.normal(size=(2, 5))
    readable = readable_null_space(J, 2, [1, 1, 0, 0, 0])
    assert np.count_nonzero(readable[0, :2]) == 0  # three columns at no cost depend on each other
    assert all(np.count_nonzero(one[:2]) == 1 for one in readable[1:])


def test_no_input_moves_anything() -> None:
    np.testing.assert_array_equal(readable_null_space(np.zeros((2, 3)), 0, [0] * 3), np.eye(3))


@pytest.mark.parametrize(
    ("name", "task", "static", "kinematic"),
    [
        ("unicycle_2r", TIP, 3, 2),  # paper, section V-A
        ("unicycle_2r", POINTING, 2, 1),
        ("unicycle_2r", LINK_POINTING, 2, 1),
        ("unicycle_3r", TIP_3D, 3, 2),  # paper, section V-B
    ],
)
def test_degrees_of_the_papers_robots(
    name: str, task: object, static: int, kinematic: int, robots: dict[str, Robot], rng: np.random.Generator
) -> None:
    robot = robots[name]
    for _ in range(5):
        report = redundancy((robot, task), draw(robot, rng))  # type: ignore[arg-type]  # of several kinds
        assert (report.static, report.kinematic) == (static, kinematic)
        assert (report.manifold, report.free) == (static, kinematic)  # regular there
        assert len(report.withheld) == 1
        # Two motions make a manoeuvre; one alone only leads there and back.
        assert report.by_brackets == (1 if kinematic == 2 else 0)
        assert ("nor does a manoeuvre" in report.text()) == (kinematic == 1)
        assert_report(report)


def test_the_coordinates_jacobian_is_that_of_the_error(
    robots: dict[str, Robot], rng: np.random.Generator
) -> None:
    """F = -∂e/∂q, by differences of the controller's error."""
    robot = robots["unicycle_2r"]
    for task in (TIP, LINK_POINTING):
        controller = Controller(robot, task, ProjectedGradient())
        q = draw(robot, rng)
        F, h = redundancy((robot, task), q).F, 1e-6
        for j, axis in enumerate(np.eye(robot.n)):
            difference = (
                controller.evaluate(0, q + h * axis).error - controller.evaluate(0, q - h * axis).error
            )
            np.testing.assert_allclose(-difference / (2 * h), F[:, j], atol=1e-8)


def test_a_singular_configuration(robot_2r: Robot) -> None:
    """With d = 0 and the arm across the axle's normal, the wheels alone lose what the coordinates keep."""
    robot = load("unicycle_2r", arguments={"d": 0.0})
    report = redundancy((robot, Position("ee", "xy")), {"q1": pi / 2})
    assert (report.rank_F, report.rank_J) == (2, 1)
    assert (report.manifold, report.free) == (3, 3)
    assert "J is singular" in report.text()
    assert_report(report)


def test_a_fixed_base_withholds_nothing() -> None:
    report = redundancy((built("fixed", "small arm"), Position("ee")), start("fixed", "small arm"))
    assert report.static == report.kinematic == 2
    assert len(report.withheld) == 0
    assert "withhold" not in report.text()


def test_no_redundancy_is_said() -> None:
    report = redundancy((built("fixed", "UR5"), Pose(frame_of("fixed", "UR5"))), start("fixed", "UR5"))
    assert report.static == report.kinematic == report.free == 0
    text = report.text()
    assert text.count("motion") == text.count("(motions)") + 1  # it is said once
    assert "no motions of the inputs leave the task at rest" in text
    assert "--self-motion" not in text


def test_inputs_without_effect_anywhere() -> None:
    robot = mount("car_base", "small_arm", at="arm_mount")
    report = redundancy((robot, Position("ee")), {"steering": 0.2, "q2": 0.3, "q3": 1.7, "q4": 0.6})
    assert report.without_effect == ("steering_rate", "q5")
    alone = [text for text in report.texts if text.endswith(" alone")]
    assert alone == ["q5 turns at +1 rad/s alone", "the platform steers left at 1 rad/s alone"]
    assert report.text().count("(without effect on the task)") == 2
    # Sideways and on the spot; only the first is one bracket away, the other two.
    assert len(report.withheld) == 2
    assert report.by_brackets == 1
    assert_report(report)


def test_an_input_without_effect_here() -> None:
    """With the end on the shoulder's axis q1 does not move it; elsewhere it does."""
    robot = load("unicycle_2r", arguments={"l1": 0.3, "l2": 0.3})
    report = redundancy((robot, Position("ee", "xy")), {"q1": 0.4, "q2": pi})
    assert "q1 turns left at 1 rad/s alone (without effect on the task here)" in report.text()
    assert report.without_effect == ()


@pytest.mark.parametrize(("d", "brackets"), [(0.3, 1), (0.0, 0)])
def test_brackets_are_manoeuvres(d: float, brackets: int) -> None:
    """There and back along two self-motions in turn: sideways by ε² c, with c = 0 where no bracket leads."""
    robot = load("unicycle_2r", arguments={"d": d})
    task = Position("ee", "xy")
    q0 = robot.q({"theta": 0.4, "q1": 0.5, "q2": 0.8} if d else {})
    report = redundancy((robot, task), q0)
    assert report.by_brackets == brackets
    along = report.null

    def field(q: Array, k: int) -> Array:
        here = redundancy((robot, task), q)
        return here.S @ (here.null.T @ (here.null @ along[k]))

    def sideways(size: float) -> float:
        q = q0
        for k, sign in ((0, 1), (1, 1), (0, -1), (1, -1)):
            for _ in range(4):
                half = q + sign * size / 8 * field(q, k)
                q = q + sign * size / 4 * field(half, k)
        tip = (
            Configuration(robot, q).placement("ee").translation
            - Configuration(robot, q0).placement("ee").translation
        )
        assert np.abs(tip).max() < 1e-4 * size
        return float(robot.platform.A(q0[:3])[0] @ (q - q0)[:3])

    found = [abs(sideways(size)) / size**2 for size in (0.04, 0.02)]
    if brackets:
        assert found[1] > 1e-2
        np.testing.assert_allclose(found[0], found[1], rtol=0.1)
    else:
        assert found[1] < 0.6 * found[0]  # of third order


def test_bad_input(robot_2r: Robot) -> None:
    tip = Position("ee", "xy")
    with pytest.raises(InputError, match="expected 5 numbers"):
        redundancy((robot_2r, tip), [0, 0])
    with pytest.raises(InputError, match="unknown coordinate 'q9'"):
        redundancy((robot_2r, tip), {"q9": 1})
    with pytest.raises(InputError, match="expected at most 4"):
        redundancy((robot_2r, Pose("ee")), {})
    with pytest.raises(InputError, match="unknown frame"):
        redundancy((robot_2r, Position("hand", "xy")), {})
    with pytest.raises(InputError, match="tolerance"):
        redundancy((robot_2r, tip), {}, tolerance=0)
    with pytest.raises(InputError, match="expected a Controller"):
        redundancy(robot_2r, {})  # type: ignore[arg-type]  # wrong on purpose


def test_where_the_wheels_cannot_roll() -> None:
    robot = mount("car_base", "small_arm", at="arm_mount")
    with pytest.raises(SingularError, match="steering"):
        redundancy((robot, Position("ee")), {"steering": pi / 2})


def test_a_task_with_a_reference_counts_its_bar(robot_2r: Robot) -> None:
    """Case 3's reference depends on q: its J_bar is the one whose null space leaves the error at rest."""
    q = robot_2r.q({"theta": 0.4, "q1": 0.3, "q2": 0.5})
    report = redundancy((robot_2r, LINK_POINTING), q)
    controller = Controller(robot_2r, LINK_POINTING, ProjectedGradient())
    (vector,) = report.readable
    ahead = q + 1e-4 * robot_2r.S(q) @ vector
    errors = [controller.evaluate(0, one).error for one in (q, ahead)]
    np.testing.assert_allclose(errors[1], errors[0], atol=1e-7)
