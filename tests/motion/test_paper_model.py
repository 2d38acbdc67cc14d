"""The paper's closed forms (the twin's) against what comes out of the robots' files through Pinocchio."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import twin
from function_grid import random_configuration
from numpy import pi
from numpy.typing import NDArray
from paper_cases import CASES, Case

from nmm.control.functions.program import evaluate
from nmm.control.functions.tasks import Heading, Position
from nmm.model.robots.configuration import Configuration
from nmm.model.robots.loading import load
from nmm.model.robots.robot import Robot

Array = NDArray[np.float64]

COUNT = 100
PLANAR = [
    {},
    {"d": 1.0},
    {"d": -0.4, "l1": 0.8, "l2": 0.25},
    {"d": 0.05, "l1": 0.2, "l2": 1.3},
]
ELBOW = [
    {},
    {"d": 0.9, "h": 0.6, "l1": 0.1},
    {"d": -0.25, "l1": 0.7, "l2": 0.3, "l3": 0.9},
]


def label(arguments: dict[str, float]) -> str:
    return " ".join(f"{name}={value}" for name, value in arguments.items()) or "default"


@pytest.fixture(scope="module", params=PLANAR, ids=label)
def planar(request: pytest.FixtureRequest) -> tuple[Robot, twin.Planar]:
    return load("unicycle_2r", arguments=request.param), twin.Planar(**request.param)


@pytest.fixture(scope="module", params=ELBOW, ids=label)
def elbow(request: pytest.FixtureRequest) -> tuple[Robot, twin.Elbow]:
    return load("unicycle_3r", arguments=request.param), twin.Elbow(**request.param)


def configurations(robot: Robot, rng: np.random.Generator) -> list[Configuration]:
    return [Configuration(robot, random_configuration(robot, rng)) for _ in range(COUNT)]


def jacobian(configuration: Configuration, *functions: Position | Heading) -> Array:
    """J = (df/dq) S of functions stacked."""
    rows = [evaluate(function, 0.0, configuration).value_q for function in functions]
    return np.vstack(rows) @ configuration.S


def assert_minors(J: Array, expected: twin.Minors) -> None:
    columns = list(itertools.combinations(range(1, J.shape[1] + 1), len(J)))
    assert columns == sorted(expected)
    for picked in columns:
        found = np.linalg.det(J[:, np.array(picked) - 1])
        assert found == pytest.approx(expected[picked], rel=0, abs=1e-13), picked


def close(found: Array, expected: Array, tolerance: float = 1e-13) -> None:
    np.testing.assert_allclose(found, expected, rtol=0, atol=tolerance)


@pytest.mark.parametrize("name", ["unicycle_2r", "unicycle_3r"])
def test_names_and_S(name: str, robots: dict[str, Robot], rng: np.random.Generator) -> None:
    robot = robots[name]
    arm = ("q1", "q2", "q3")[: robot.n - 3]
    assert robot.q_names == ("x", "y", "theta", *arm)
    assert robot.u_names == ("v", "omega", *arm)
    for configuration in configurations(robot, rng):
        np.testing.assert_array_equal(configuration.S, robot.S(configuration.q))
        close(configuration.S, twin.S(configuration.q), 1e-15)


def check_position(
    robot: Robot, paper: twin.Planar | twin.Elbow, tip: Position, rng: np.random.Generator
) -> None:
    """f, J and every minor."""
    for configuration in configurations(robot, rng):
        q = configuration.q
        close(evaluate(tip, 0.0, configuration).value, paper.f(q))
        J = jacobian(configuration, tip)
        close(J, paper.J(q))
        assert_minors(J, paper.minors(q))


def test_planar_position(planar: tuple[Robot, twin.Planar], rng: np.random.Generator) -> None:
    check_position(*planar, Position("ee", "xy"), rng)


def test_planar_with_orientation(planar: tuple[Robot, twin.Planar], rng: np.random.Generator) -> None:
    robot, paper = planar
    for configuration in configurations(robot, rng):
        q = configuration.q
        for frame, angle in (("link1", q[2] + q[3]), ("link2", q[2:].sum()), ("ee", q[2:].sum())):
            found = evaluate(Heading(frame), 0.0, configuration).value[0]
            assert -pi < found <= pi
            assert twin.wrapped(found - angle) == pytest.approx(0.0, abs=1e-13)
        J = jacobian(configuration, Position("ee", "xy"), Heading("link2"))
        close(J, paper.J_pointing(q))
        assert_minors(J, paper.minors_pointing(q))
        J = jacobian(configuration, Position("ee", "xy"), Heading("link1"))
        close(J, paper.J_link_pointing(q))
        assert np.linalg.det(J[:, :3]) == pytest.approx(paper.d, abs=1e-13)


def test_planar_configuration_dependent(planar: tuple[Robot, twin.Planar], rng: np.random.Generator) -> None:
    """J_bar of case 3, and the minor of it that RG inverts, near the target too."""
    robot, paper = planar
    controller = CASES[2].controller(robot)
    for configuration in configurations(robot, rng):
        q = configuration.q
        J = controller.evaluate(1.0, q).J
        # dg/dq goes like 1 / distance, and so does its rounding
        scale = 1.0 + np.abs(J[2]).max()
        close(J, paper.J_bar(q), 1e-13 * scale)
        assert np.linalg.det(J[:, :3]) == pytest.approx(paper.minor_bar_123(q), abs=1e-13 * scale)


def test_elbow_position(elbow: tuple[Robot, twin.Elbow], rng: np.random.Generator) -> None:
    check_position(*elbow, Position("ee", "xyz"), rng)


@pytest.mark.parametrize("case", CASES, ids=[case.name for case in CASES])
def test_the_cases_equations(case: Case, robots: dict[str, Robot], rng: np.random.Generator) -> None:
    """J_bar, rate, h of each case at random instants, and the start's error."""
    robot = robots[case.robot]
    controller = case.controller(robot)
    for t in rng.uniform(0.0, 25.0, COUNT):
        q = random_configuration(robot, rng)
        found = controller.evaluate(t, q)
        J, rate, gradient = case.twin(t, q)
        scale = 1.0 + np.abs(J).max()
        close(found.J, J, 1e-12 * scale)
        close(found.rate, rate, 1e-12)
        close(found.h, twin.S(q).T @ gradient, 1e-12)


def ranks(singular_values: Array) -> int:
    return int((singular_values > 1e-9).sum())


#: All combinations of the angles at which sines and cosines vanish or agree.
SPECIAL = np.arange(-4, 5) * pi / 4


def test_planar_position_has_no_singularity(planar: tuple[Robot, twin.Planar]) -> None:
    """Δ12 - Δ13 = d, so that they cannot both vanish: det J Jᵀ, the sum of all squares, is at least d²/2."""
    robot, paper = planar
    for q1, q2 in itertools.product(SPECIAL, SPECIAL):
        J = jacobian(Configuration(robot, [0, 0, 0.3, q1, q2]), Position("ee", "xy"))
        minors = np.linalg.det(J[:, [0, 1]]), np.linalg.det(J[:, [0, 2]])
        assert minors[0] - minors[1] == pytest.approx(paper.d, abs=1e-13)
        assert np.linalg.det(J @ J.T) >= paper.d**2 / 2 - 1e-12


def test_planar_with_orientation_has_no_singularity(planar: tuple[Robot, twin.Planar]) -> None:
    robot, paper = planar
    for q1, q2, link in itertools.product(SPECIAL, SPECIAL, ("link1", "link2")):
        J = jacobian(Configuration(robot, [0, 0, 0.3, q1, q2]), Position("ee", "xy"), Heading(link))
        assert np.linalg.det(J[:, :3]) == pytest.approx(paper.d, abs=1e-13)
        assert ranks(np.linalg.svd(J, compute_uv=False)) == 3


def test_planar_arm_over_the_axle_is_singular() -> None:
    """What d != 0 is for: with d = 0 and the arm stretched sideways, all columns are along one line."""
    robot = load("unicycle_2r", arguments={"d": 0})
    J = jacobian(Configuration(robot, [0.4, 0.1, 0.7, pi / 2, 0.0]), Position("ee", "xy"))
    assert ranks(np.linalg.svd(J, compute_uv=False)) == 1


@pytest.mark.parametrize(("d", "vanishes"), [(0.9, False), (0.81, False), (0.79, True), (0.3, True)])
def test_platform_block_is_always_regular_if_d_exceeds_the_arm(d: float, vanishes: bool) -> None:
    """|Δ12| >= d - l1 - l2 with equality for the arm folded back; if d < l1 + l2, Δ12 changes its sign."""
    robot = load("unicycle_2r", arguments={"d": d})
    angles = np.linspace(-pi, pi, 13)
    minors = [
        np.linalg.det(jacobian(Configuration(robot, [0, 0, -1.0, q1, q2]), Position("ee", "xy"))[:, :2])
        for q1, q2 in itertools.product(angles, angles)
    ]
    assert min(minors) == pytest.approx(d - 0.5 - 0.3, abs=1e-12)
    assert (min(minors) < 0.0 < max(minors)) == vanishes


def test_elbow_loses_rank_only_along_the_vertical(elbow: tuple[Robot, twin.Elbow]) -> None:
    robot, _ = elbow
    for q1, q2, q3 in itertools.product(SPECIAL, SPECIAL, SPECIAL):
        J = jacobian(Configuration(robot, [0, 0, 0.3, q1, q2, q3]), Position("ee", "xyz"))
        vertical = abs(np.sin(q2)) < 1e-9 and abs(np.sin(q3)) < 1e-9
        assert ranks(np.linalg.svd(J, compute_uv=False)) == (2 if vertical else 3), (q1, q2, q3)


def test_elbow_above_the_shoulder_is_regular(elbow: tuple[Robot, twin.Elbow]) -> None:
    """Λ = 0 with a bent elbow: singular for the arm alone, not for the robot."""
    robot, paper = elbow
    q3 = 2.2
    q2 = np.arctan2(-paper.l3 * np.sin(q3), paper.l2 + paper.l3 * np.cos(q3))
    for q1 in np.linspace(-pi, pi, 9):
        J = jacobian(Configuration(robot, [0, 0, 0.3, q1, q2, q3]), Position("ee", "xyz"))
        assert ranks(np.linalg.svd(J[:, 2:], compute_uv=False)) == 2
        assert ranks(np.linalg.svd(J, compute_uv=False)) == 3
