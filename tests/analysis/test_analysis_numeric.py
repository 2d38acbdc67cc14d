"""Singularity analysis in numbers: laws, the paper's minors, and configurations known to be singular."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import twin
from analysed import HELD, LINK_POINTING, POINTING, TIP, TIP_3D, extended
from numpy import cos, pi, sin
from numpy.typing import NDArray

from nmm.analysis import SingularityReport, analyse
from nmm.base.errors import InputError, SingularError
from nmm.control.controller import Controller
from nmm.control.directions import direction_text, readable_basis
from nmm.control.functions.tasks import LinearCoordinates, Pose, Position, Task
from nmm.control.resolvers import ReducedGradient
from nmm.model.robots.loading import load, mount
from nmm.model.robots.robot import Robot

Array = NDArray[np.float64]

MANY = 40


@pytest.fixture(scope="module")
def no_offset() -> Robot:
    """unicycle_2r with its arm on the axle, d = 0."""
    return load("unicycle_2r", arguments={"d": 0.0})


@pytest.fixture(scope="module")
def spatial() -> Robot:
    """A robot for tasks of six rows."""
    return mount("omni_base", "small_arm")


def draw(robot: Robot, rng: np.random.Generator) -> Array:
    """A configuration inside the limits."""
    lower, upper = robot.q_limits.T
    return rng.uniform(np.maximum(lower, -2.0), np.minimum(upper, 2.0))


def moved(robot: Robot, q: Array, motion: Array, step: float) -> Array:
    """q after a short time with constant inputs, by the midpoint rule."""
    return q + step * robot.S(q + step / 2 * robot.S(q) @ motion) @ motion


def link_pointing_minors(q: Array) -> twin.Minors:
    """Those of case 3's J_bar, by hand; 123 is the erratum's."""
    d, l1, l2 = 0.3, 0.5, 0.3
    elbow = q[:2] + d * np.array([cos(q[2]), sin(q[2])]) + l1 * np.array([cos(q[2] + q[3]), sin(q[2] + q[3])])
    ex, ey = twin.TARGET - elbow
    rho, k = np.hypot(ex, ey), cos(q[2] + q[3] + q[4] - np.arctan2(ey, ex))
    c1, s1, c12, s12 = cos(q[3]), sin(q[3]), cos(q[3] + q[4]), sin(q[3] + q[4])
    return {
        (1, 2, 3): d * (rho - l2 * k) / rho,
        (1, 2, 4): -l2 * ((d + l1 * c1) * k + rho * c12) / rho,
        (1, 3, 4): -l2 * (l1 * c1 * k + rho * c12) / rho,
        (2, 3, 4): -d * l2 * (l1 * s1 * k + rho * s12) / rho,
    }


@pytest.mark.parametrize(
    ("name", "task", "minors"),
    [
        ("unicycle_2r", TIP, twin.Planar().minors),
        ("unicycle_2r", POINTING, twin.Planar().minors_pointing),
        ("unicycle_2r", LINK_POINTING, link_pointing_minors),
        ("unicycle_3r", TIP_3D, twin.Elbow().minors),
    ],
    ids=["position", "pointing", "link pointing", "3R"],
)
def test_the_papers_minors(
    name: str,
    task: Any,
    minors: Callable[[Array], twin.Minors],
    robots: dict[str, Robot],
    rng: np.random.Generator,
) -> None:
    robot = robots[name]
    for _ in range(MANY):
        q = rng.uniform(-3, 3, robot.n)
        found, expected = analyse((robot, task), q).minors, minors(q)
        assert len(found) == len(expected)
        for columns, value in expected.items():
            assert found[[robot.u_names[j - 1] for j in columns]] == pytest.approx(value, abs=1e-12)


def tasks_of(robots: dict[str, Robot], spatial: Robot) -> list[tuple[Robot, Any]]:
    return [
        (robots["unicycle_2r"], TIP),
        (robots["unicycle_2r"], LINK_POINTING),
        (robots["unicycle_3r"], TIP_3D),
        (spatial, Task(Pose(spatial.frames[-1]), np.zeros(6))),
    ]


def test_cauchy_binet_and_the_parts(
    robots: dict[str, Robot], spatial: Robot, rng: np.random.Generator
) -> None:
    for robot, task in tasks_of(robots, spatial):
        for _ in range(5):
            report = analyse((robot, task), draw(robot, rng))
            J, whole = report.J, report.whole
            squares = sum(value**2 for value in report.minors.values())
            assert squares == pytest.approx(np.linalg.det(J @ J.T), rel=1e-9)
            assert np.sum(report.partitions.ratios**2) == pytest.approx(1.0, rel=1e-9)
            np.testing.assert_allclose(report.singular_values, np.linalg.svd(J)[1], rtol=1e-9)
            assert report.condition == pytest.approx(np.linalg.cond(J), rel=1e-9)
            # More inputs cannot make anything smaller (interlacing of J Jᵀ's eigenvalues).
            for one in report.parts.values():
                assert np.all(one.singular_values <= report.singular_values + 1e-12)
                assert one.rank <= whole.rank
                assert one.rank + len(one.lost) == len(report.rows)
                own = J[:, [robot.input(name) for name in one.inputs]]
                np.testing.assert_allclose(one.lost @ own, 0.0, atol=1e-10)
            for count in range(1, robot.n_u):
                some = rng.choice(robot.n_u, count, replace=False)
                smallest = np.linalg.svd(J[:, some] @ J[:, some].T)[1][-1] ** 0.5
                assert smallest <= report.sigma_min + 1e-7


def test_motions_of_J_and_of_its_minors(robots: dict[str, Robot], rng: np.random.Generator) -> None:
    """σ_min's and the minors' rates against what a small motion does, taken by differences of the results."""
    for robot, task in ((robots["unicycle_2r"], LINK_POINTING), (robots["unicycle_3r"], TIP_3D)):
        for _ in range(5):
            q = draw(robot, rng)
            report = analyse((robot, task), q, length=0.8)
            for j, name in enumerate(robot.u_names):
                ahead, behind = (
                    analyse((robot, task), moved(robot, q, np.eye(robot.n_u)[j], step), length=0.8)
                    for step in (1e-5, -1e-5)
                )
                growth = (ahead.sigma_min - behind.sigma_min) / 2e-5
                assert report.by_input.rates[j] == pytest.approx(growth, abs=1e-7), name
                changes = (ahead.minors.array - behind.minors.array) / 2e-5
                np.testing.assert_allclose(report.minor_rates.array[j], changes, atol=1e-7)
            # A turn of everything about the vertical changes nothing, if the task does not look elsewhere.
            if task is TIP_3D:
                assert not {"x", "y", "theta"} & set(report.by_coordinate.effective)


# --- known singular configurations


def expect_restored(robot: Robot, task: Any, report: SingularityReport) -> None:
    """A little along a restorer σ_min grows as its rate says, and along the others it does not."""
    q, J = report.q, report.J
    np.testing.assert_allclose(report.lost @ J, 0.0, atol=1e-12)
    np.testing.assert_allclose(report.lost @ report.lost.T, np.eye(len(report.lost)), atol=1e-12)
    step = 1e-5
    motions = [*np.eye(robot.n_u), report.by_input.best]
    rates = [*report.by_input.rates, report.by_input.best_rate]
    for motion, rate in zip(motions, rates, strict=True):
        for sign in (1.0, -1.0):
            there = analyse((robot, task), moved(robot, q, motion, sign * step))
            assert there.sigma_min == pytest.approx(rate * step, abs=20 * step**2)
    for name, regained in zip(robot.u_names, report.by_input.regained, strict=True):
        there = analyse((robot, task), moved(robot, q, np.eye(robot.n_u)[robot.input(name)], step))
        # To first order: what comes back is of the size of the step, what does not is of its square.
        assert np.sum(there.singular_values > 1e-2 * step) == report.rank + regained
    assert report.by_input.best_rate >= report.by_input.rates.max() - 1e-9 or len(report.lost) > 1


@pytest.mark.parametrize("q1", [pi / 2, -pi / 2])
@pytest.mark.parametrize("q2", [0.0, pi])
def test_the_arm_across_the_axle_without_offset(q1: float, q2: float, no_offset: Robot) -> None:
    """d = 0: with c1 = c12 = 0 every input moves the tip along the heading, 45 degrees here."""
    q = [0.3, -0.4, pi / 4, q1, q2]
    report = analyse((no_offset, TIP), q)
    assert report.rank == 1
    assert report.singular
    assert report.sigma_min < 1e-15
    assert report.condition == np.inf
    assert report.lost_text == ("0.71 ee.x - 0.71 ee.y",)
    assert all(abs(value) < 1e-15 for value in report.minors.values())
    assert report.by_input.effective == ("q1", "q2")
    assert report.by_coordinate.effective == ("q1", "q2")
    assert report.partitions.algorithmic == ()
    assert report.partitions.best is None
    assert report.given_back_text == ()
    expect_restored(no_offset, TIP, report)
    for j in range(4):  # one rank lost: it comes back exactly where some minor changes
        changes = np.abs(report.minor_rates.array[j]).max() > 1e-6
        assert changes == bool(report.by_input.regained[j])


@pytest.mark.parametrize("q2", [0.0, pi])
def test_the_platform_removes_the_stretched_arms_singularity(q2: float, robot_2r: Robot) -> None:
    report = analyse((robot_2r, TIP), [0.3, -0.4, -pi / 6, pi / 6, q2])
    assert not report.singular
    arm, platform = report.parts["arm"], report.parts["platform"]
    assert (arm.rank, platform.rank, report.whole.rank) == (1, 2, 2)
    assert arm.singular
    assert not arm.too_few
    assert not arm.does_task
    assert platform.does_task
    assert arm.lost_text == ("ee.x",)
    assert report.given_back_text == ("ee.x",)
    assert report.partitions.algorithmic == (("q1", "q2"),)


@pytest.mark.parametrize("q1", [0.0, 0.7])
@pytest.mark.parametrize("q3", [0.0, pi])
def test_the_vertical_elbow_arm(q1: float, q3: float, robot_3r: Robot) -> None:
    """Rank 3 unless s2 = s3 = 0: then the height is lost. q1 and the platform cannot bring it back."""
    q = [0.1, 0.2, 0.3, q1, 0.0, q3]
    report = analyse((robot_3r, TIP_3D), q)
    assert report.rank == 2
    assert report.lost_text == ("ee.z",)
    assert report.by_input.effective == ("q2", "q3")
    # The arm alone loses the direction across q1's plane too: there the platform steps in.
    assert report.parts["arm"].rank == 1
    assert report.given_back.shape == (1, 3)
    np.testing.assert_allclose(report.given_back @ report.lost.T, 0.0, atol=1e-12)
    across = np.array([-sin(0.3 + q1), cos(0.3 + q1), 0.0])
    assert abs(report.given_back[0] @ across) == pytest.approx(1.0)
    expect_restored(robot_3r, TIP_3D, report)


def test_more_rows_and_more_directions_lost() -> None:
    """A task of three rows that loses one, and one of four that says everything twice."""
    robot = load("unicycle_2r", arguments={"d": 0.0, "l1": 0.4, "l2": 0.4})
    task = (TIP, Task(LinearCoordinates({"q1": 1.0, "q2": 2.0}), 0.0))
    report = analyse((robot, task), [0.0, 0.0, 0.0, pi / 2, 0.0])
    assert report.rank == 2
    assert report.lost_text == ("ee.y",)
    expect_restored(robot, task, report)
    double = (TIP, Task(Position("ee", "xy"), [0.0, 0.0]))
    twice = analyse((robot, double), [0.0, 0.0, 0.0, pi / 2, 0.0])
    assert twice.rank == 1
    assert len(twice.lost) == 3
    # Only one of the three can come back: two rows say the same as two others.
    assert twice.by_input.regained.tolist() == [0, 0, 1, 1]
    assert twice.by_input.rates.max() < 1e-9
    assert twice.by_input.effective == ("q1", "q2")


def test_a_fixed_base_is_the_arm_alone() -> None:
    robot = load("unicycle_2r", platform="fixed")
    report = analyse((robot, TIP), {"q1": 0.4, "q2": 0.0})
    assert report.rank == 1
    assert report.parts["platform"].rank == 0
    assert report.parts["platform"].inputs == ()
    assert report.by_input.effective == ("q2",)
    assert report.sigma_min == report.parts["arm"].sigma_min


# --- sizes


def test_with_a_length_the_unit_of_length_does_not_matter(rng: np.random.Generator) -> None:
    """The robot a thousand times as large (its file in mm, so to speak): the same numbers with L as large."""
    small = load("unicycle_2r", arguments={"d": 0.3, "l1": 0.5, "l2": 0.3})
    large = load("unicycle_2r", arguments={"d": 30, "l1": 50, "l2": 30})
    for _ in range(10):
        q = rng.uniform(-2, 2, 5)
        one, other = (
            analyse((robot, POINTING), q * [factor, factor, 1, 1, 1], length=0.8 * factor)
            for robot, factor in ((small, 1.0), (large, 100.0))
        )
        np.testing.assert_allclose(one.singular_values, other.singular_values, rtol=1e-9)
        assert one.condition == pytest.approx(other.condition)
        np.testing.assert_allclose(np.abs(one.weakest), np.abs(other.weakest), atol=1e-9)
        # Without, they are not.
        assert analyse((small, POINTING), q).sigma_min != pytest.approx(
            analyse((large, POINTING), q * [100, 100, 1, 1, 1]).sigma_min
        )


def test_sizes_by_name(robot_2r: Robot, rng: np.random.Generator) -> None:
    q = rng.uniform(-2, 2, 5)
    report = analyse((robot_2r, POINTING), q, length=2.0, sizes={"v": 0.5, "ee.y": 4.0})
    scaled = np.diag([1 / 2, 1 / 4, 1]) @ report.J @ np.diag([0.5, 1, 1, 1])
    np.testing.assert_allclose(report.scaled_J, scaled)
    np.testing.assert_allclose(report.singular_values, np.linalg.svd(scaled)[1])
    np.testing.assert_array_equal(report.J, analyse((robot_2r, POINTING), q).J)


# --- the resolvers' own singularities


def test_ej_is_singular_where_the_added_task_asks_for_what_the_task_fixes(robot_2r: Robot) -> None:
    """With q1 and the heading of link 2 held, |det J_e| is case 2's minor without q1's column, d + l1 c1."""
    for q1, singular in ((2.0, False), (float(np.arccos(-0.3 / 0.5)), True)):  # d + l1 c1 = 0
        q = np.array([0.1, 0.2, 0.3, q1, 0.4])
        controller = extended(HELD, robot_2r)
        found = analyse(controller, q).extended
        assert found is not None
        assert not found.kinematic
        assert not found.added_singular
        assert found.algorithmic == singular
        # Laplace along q1's row (0 0 1 0), the third: the sign is (-1)^(3 + 3).
        assert found.determinant == pytest.approx(0.3 + 0.5 * cos(q1), abs=1e-12)
        assert (controller.evaluate(0.0, q).status.name == "SINGULAR_JE") == singular
        if singular:
            assert found.rank == 3
            assert found.angle_measure < 1e-12
            rows = np.vstack([analyse((robot_2r, TIP), q).J, [0, 0, 1, 0], [0, 1, 1, 1]])
            np.testing.assert_allclose(found.lost @ rows, 0.0, atol=1e-12)
            assert "ee." in found.lost_text[0]
        else:
            assert 0.01 < found.angle_measure < 1.0


def test_ej_where_J_or_the_added_task_itself_is_singular(no_offset: Robot, robot_2r: Robot) -> None:
    kinematic = analyse(extended(HELD, no_offset), [0.0, 0.0, 0.0, pi / 2, 0.0]).extended
    assert kinematic is not None
    assert kinematic.kinematic
    assert not kinematic.algorithmic
    assert np.isnan(kinematic.angle_measure)
    twice = (Task(LinearCoordinates("q1"), 0.0), Task(LinearCoordinates({"q1": 2.0}), 0.0))
    found = analyse((robot_2r, TIP), [0.0, 0.0, 0.0, 0.4, 0.5], added_task=twice).extended
    assert found is not None
    assert found.added_singular
    assert found.algorithmic
    assert found.lost_text == ("0.89 q1 - 0.45 2 q1",)


def test_the_measure_of_ej_with_the_arm_held(robot_2r: Robot, rng: np.random.Generator) -> None:
    """J_e is block triangular then: what is left of the measure is RG's, of (v, omega)."""
    q = rng.uniform(-1, 1, 5)
    J = analyse((robot_2r, TIP), q).J
    held = (Task(LinearCoordinates("q1"), 0.0), Task(LinearCoordinates("q2"), 0.0))
    found = analyse((robot_2r, TIP), q, added_task=held).extended
    assert found is not None
    expected = abs(np.linalg.det(J[:, :2])) / np.sqrt(np.linalg.det(J @ J.T))
    assert found.angle_measure == pytest.approx(expected)


def test_rg_partitions_singular_though_J_is_not(robot_2r: Robot) -> None:
    """c12 = 0 makes (v, q2) singular, and nothing else."""
    q = [0.1, 0.2, 0.3, 0.4, pi / 2 - 0.4]
    report = analyse((robot_2r, TIP), q)
    assert not report.singular
    assert report.partitions.algorithmic == (("v", "q2"),)
    best = max(report.minors, key=lambda name: abs(report.minors[name]))
    assert report.partitions.best == best

    given = ReducedGradient(partitions=[("v", "q2")])
    controller = Controller(robot_2r, TIP, given)
    found = analyse(controller, q).partitions
    assert found.names == (("v", "q2"),)
    assert found.algorithmic == found.names
    assert found.exhausted
    assert controller.evaluate(0.0, q).status.name == "SINGULAR_JA"
    assert analyse((robot_2r, TIP), q, partitions=[("v", "q2"), ("q1", "omega")]).partitions.best == (
        "q1",
        "omega",
    )
    assert analyse((robot_2r, TIP), q, minors=["v, q1"]).partitions.names == (("v", "q1"),)


def test_the_ratio_is_rgs_own_measure(robot_2r: Robot, rng: np.random.Generator) -> None:
    controller = Controller(robot_2r, TIP, ReducedGradient())
    for _ in range(10):
        q = rng.uniform(-2, 2, 5)
        controller.reset()
        step = controller.evaluate(0.0, q)
        partition = controller.solver.state.memory.copy()
        found = analyse(controller, q).partitions
        np.testing.assert_array_equal(controller.solver.state.memory, partition)
        names = tuple(robot_2r.u_names[j] for j in step.partition)
        assert found.best == names
        assert found.ratios[found.names.index(names)] == pytest.approx(step.measure)


# --- directions and input that is wrong


def test_directions_people_can_read(rng: np.random.Generator) -> None:
    turn = np.linalg.qr(rng.normal(size=(2, 2)))[0]
    np.testing.assert_allclose(readable_basis(turn @ np.eye(4)[[1, 3]]), np.eye(4)[[1, 3]], atol=1e-12)
    for k, s in itertools.product(range(4), (4, 6)):
        basis = np.linalg.qr(rng.normal(size=(s, s)))[0][:k]
        found = readable_basis(basis)
        np.testing.assert_allclose(found @ found.T, np.eye(k), atol=1e-12)
        np.testing.assert_allclose(found.T @ found, basis.T @ basis, atol=1e-12)
    assert direction_text(np.array([0.0, -1.0]), ("a", "b")) == "-b"
    assert direction_text(np.array([0.6, 0.0, 0.8]), ("a", "b", "c")) == "0.6 a + 0.8 c"
    assert direction_text(np.zeros(2), ("a", "b")) == "0"


def test_keys_of_the_minors(robot_2r: Robot) -> None:
    minors = analyse((robot_2r, POINTING), [0.1, 0.2, 0.3, 0.4, 0.5]).minors
    assert minors["v, omega, q2"] == minors["v", "omega", "q2"] == -minors[("omega", "v", "q2")]
    assert minors["q2", "v", "omega"] == minors["v, omega, q2"]
    assert next(iter(minors)) == ("v", "omega", "q1")
    assert "v, q1, q2" in minors
    assert "v, q1" not in minors
    assert 3 not in minors
    with pytest.raises(InputError, match="did you mean 'omega'"):
        minors["v, omeg, q2"]
    with pytest.raises(InputError, match="expected 3 different inputs"):
        minors["v, v, q2"]


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"q": [0.0] * 4}, "expected 5 numbers"),
        ({"q": None}, "expected 5 numbers"),
        ({"q": [0, 0, 0, 0, np.nan]}, "finite"),
        ({"q": {"q7": 1.0}}, "unknown coordinate 'q7'"),
        ({"t": np.inf}, "t: expected finite"),
        ({"subject": TIP}, "expected a Controller or"),
        ({"task": (*POINTING, TIP)}, "task: expected at most 4 rows.*, got 5$"),
        ({"task": Task(Position("hand", "xy"), [0, 0])}, "unknown frame 'hand'"),
        ({"minors": ["v, q7"]}, "unknown input 'q7'"),
        ({"minors": "v, q1"}, "expected a list"),
        ({"minors": ["v, q1, q2"]}, "expected 2 different inputs"),
        ({"most_minors": 5}, "has 6, expected at most 5"),
        ({"partitions": [("v", "q7")]}, "unknown input 'q7'"),
        ({"partitions": [("v",)]}, "expected 2 different inputs"),
        ({"partitions": "some"}, "expected 'automatic'"),
        ({"added_task": Task(LinearCoordinates("q1"), 0.0)}, "expected 2 rows"),
        ({"length": 0.0}, "length: expected a number above 0"),
        ({"sizes": {"vv": 1.0}}, "unknown row or input 'vv'"),
        ({"sizes": {"v": -1.0}}, "size of v"),
        ({"tolerance": 0.0}, "tolerance"),
    ],
    ids=lambda given: given if isinstance(given, str) else "",
)
def test_wrong_input(wrong: dict[str, Any], message: str, robot_2r: Robot) -> None:
    wrong = dict(wrong)
    task, q = wrong.pop("task", TIP), wrong.pop("q", np.zeros(5))
    subject = wrong.pop("subject", (robot_2r, task))
    with pytest.raises(InputError, match=message):
        analyse(subject, q, **wrong)


def test_where_the_wheels_cannot_roll() -> None:
    car = mount("car_base", "small_arm")
    frame = car.frames[-1]
    steering = next(name for name in car.platform.coordinates[3:])
    with pytest.raises(SingularError, match="t = 2 s"):
        analyse((car, Task(Position(frame, "xy"), [0, 0])), {steering: pi / 2}, 2.0)
