"""Measures, maps and their singular sets against formulas, analyse(), and geometry."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from planar_arms import link_lengths
from sliding_arm import sliding

from nmm.analysis import analyse
from nmm.analysis.maps.coordinates import singularity_map
from nmm.analysis.maps.measures import MEASURES, spectra_of
from nmm.analysis.maps.singular_set import SingularSet
from nmm.control.functions.tasks import Heading, Pose, Position
from nmm.model.robots.configuration import Configuration
from nmm.model.robots.loading import load
from nmm.model.robots.robot import Robot

Array = NDArray[np.float64]
PLANAR = Position("ee", "xy")
WITH_HEADING = (PLANAR, Heading("link2"))


def all_points(those: SingularSet) -> Array:
    return np.vstack([*those.lines, those.points])


# Measures


def test_measures_are_the_formulas_of_their_names(rng: np.random.Generator) -> None:
    J = rng.normal(size=(60, 3, 5))
    columns = {"platform": [0, 1], "arm": [2, 3, 4], "robot": [0, 1, 2, 3, 4]}
    spectra = spectra_of(J, columns)
    found = {
        name: measure.of(0.3, *(spectra[part] for part in measure.parts or ("robot",)))
        for name, measure in MEASURES.items()
    }
    for k, own in enumerate(J):
        w = np.sqrt(np.linalg.det(own @ own.T))
        w_b = abs(np.linalg.det(own[:, 2:]))
        minors = [np.linalg.det(own[:, list(chosen)]) for chosen in combinations(range(5), 3)]
        assert found["sigma_min"][k] == pytest.approx(np.linalg.norm(own, -2), rel=1e-12)
        assert found["inverse_condition"][k] == pytest.approx(1.0 / np.linalg.cond(own), rel=1e-12)
        assert found["manipulability"][k] == pytest.approx(w, rel=1e-10)
        assert found["manipulability"][k] ** 2 == pytest.approx(np.sum(np.square(minors)), rel=1e-10)
        assert found["arm_manipulability"][k] == pytest.approx(w_b, rel=1e-10)
        assert found["platform_manipulability"][k] == 0.0  # two inputs, three rows
        assert found["weighted"][k] == pytest.approx(0.3 * w_b + 0.7 * w, rel=1e-10)
        assert found["eccentricity"][k] == pytest.approx(np.sqrt(1.0 - np.linalg.cond(own) ** -2), rel=1e-10)


def test_measures_of_a_flat_an_empty_and_an_undefined_J() -> None:
    J = np.zeros((3, 2, 3))
    J[0, 0, 0] = 2.0
    J[2] = np.nan
    spectra = spectra_of(J, {"platform": [], "arm": [1, 2], "robot": [0, 1, 2]})
    for name, measure in MEASURES.items():
        values = measure.of(0.5, *(spectra[part] for part in measure.parts or ("robot",)))
        assert np.isnan(values[2]) or name == "platform_manipulability"
        np.testing.assert_array_equal(values[:2], 1.0 if name == "eccentricity" else 0.0)


# Maps over coordinates


def test_cells_have_what_analyse_finds_there(robot_2r: Robot, rng: np.random.Generator) -> None:
    at = {"x": 0.3, "theta": 0.4}
    measures = ("sigma_min", "inverse_condition", "manipulability", "arm_manipulability")
    made = singularity_map(
        (robot_2r, WITH_HEADING), ("q2", "q1"), samples=(23, 31), measures=measures, at=at, length=0.7
    )
    assert made.values["sigma_min"].shape == (31, 23)
    for _ in range(20):
        row, column = int(rng.integers(31)), int(rng.integers(23))
        q = made.q_at(row, column)
        expected_q = robot_2r.q(at | {"q2": made.axes[0][column], "q1": made.axes[1][row]})
        np.testing.assert_array_equal(q, expected_q)
        report = analyse((robot_2r, WITH_HEADING), q, length=0.7)
        assert made.values["sigma_min"][row, column] == pytest.approx(report.sigma_min, rel=1e-12)
        assert made.values["inverse_condition"][row, column] == pytest.approx(
            1.0 / report.condition, rel=1e-12
        )
        w = np.prod(report.singular_values)
        assert made.values["manipulability"][row, column] == pytest.approx(w, rel=1e-12)
        assert made.values["arm_manipulability"][row, column] == 0.0
        assert made.rank[row, column] == report.rank


@pytest.mark.parametrize("part", ["platform", "arm"])
def test_a_part_has_its_own_map(robot_2r: Robot, part: str) -> None:
    made = singularity_map((robot_2r, PLANAR), samples=7, part=part)
    for row, column in np.ndindex(7, 7):
        expected = analyse((robot_2r, PLANAR), made.q_at(row, column)).parts[part].sigma_min
        assert made.values["sigma_min"][row, column] == pytest.approx(expected, rel=1e-12, abs=1e-15)
    assert made.arm_singular is None


def test_weights_slow_the_inputs_down(robot_2r: Robot) -> None:
    made = singularity_map((robot_2r, PLANAR), samples=5, weights={"platform": 4.0, "q1": 9.0})
    for row, column in np.ndindex(5, 5):
        J = analyse((robot_2r, PLANAR), made.q_at(row, column)).J / [2.0, 2.0, 3.0, 1.0]
        assert made.values["sigma_min"][row, column] == pytest.approx(np.linalg.norm(J, -2), rel=1e-12)
    assert made.about.weights == {"v": 4.0, "omega": 4.0, "q1": 9.0}


def test_alpha_goes_from_the_whole_robot_to_the_arm(robot_2r: Robot) -> None:
    names = ("weighted", "manipulability", "arm_manipulability")
    ends = [singularity_map((robot_2r, PLANAR), samples=9, measures=names, alpha=alpha) for alpha in (0, 1)]
    np.testing.assert_array_equal(ends[0].values["weighted"], ends[0].values["manipulability"])
    np.testing.assert_array_equal(ends[1].values["weighted"], ends[1].values["arm_manipulability"])
    half = singularity_map((robot_2r, PLANAR), samples=9, measures=names)
    mean = 0.5 * (ends[0].values["weighted"] + ends[1].values["weighted"])
    np.testing.assert_allclose(half.values["weighted"], mean, rtol=1e-14)


def test_a_planar_arm_on_a_fixed_base(fixed_2r: Robot) -> None:
    l1, l2 = link_lengths(fixed_2r)
    made = singularity_map((fixed_2r, PLANAR), samples=(60, 81), measures="manipulability")
    expected = l1 * l2 * np.abs(np.sin(made.axes[1]))[:, np.newaxis] * np.ones(60)
    np.testing.assert_allclose(made.values["manipulability"], expected, atol=1e-14)
    # q2 = 0 and both ends of the range; the determinant does not change its sign at an end.
    assert len(made.singular.lines) == 3
    assert not len(made.singular.points)
    for line, q2 in zip(
        sorted(made.singular.lines, key=lambda line: line[0, 1]), (-np.pi, 0.0, np.pi), strict=True
    ):
        np.testing.assert_allclose(line[:, 1], q2, atol=1e-9)
        assert np.ptp(line[:, 0]) == pytest.approx(2.0 * np.pi)
    assert made.arm_singular is None  # the arm is all that there is


def test_without_offset_the_unicycle_loses_rank_where_the_first_link_stands_across() -> None:
    """All minors have the factor l1 cos q1 there (the paper, V-A): curves though J is 3 x 4."""
    robot = load("unicycle_2r", arguments={"d": 0.0})
    made = singularity_map((robot, WITH_HEADING), samples=60)
    assert len(made.singular.lines) == 2
    points = all_points(made.singular)
    np.testing.assert_allclose(np.cos(points[:, 0]), 0.0, atol=1e-9)
    for line in made.singular.lines:
        assert np.ptp(line[:, 1]) == pytest.approx(2.0 * np.pi, abs=0.2)


@pytest.mark.parametrize("task", [PLANAR, WITH_HEADING], ids=["position", "with heading"])
def test_with_an_offset_there_is_no_singularity(robot_2r: Robot, task: Any) -> None:
    made = singularity_map((robot_2r, task), samples=60)
    assert made.singular.empty
    assert np.all(made.rank == len(made.about.task))


def test_the_platform_leaves_points_of_the_arms_curves(robot_3r: Robot) -> None:
    """Rank 3 unless s2 = s3 = 0 (paper, V-B); the arm alone loses it where Λ s3 = 0 (Δ345)."""
    made = singularity_map((robot_3r, Position("ee")), ("q2", "q3"), samples=80, at={"q1": 0.7})
    assert not made.singular.lines
    turns = np.round(made.singular.points / np.pi)
    assert sorted(turns.tolist()) == [[i, j] for i in (-1.0, 0.0, 1.0) for j in (-1.0, 0.0, 1.0)]
    np.testing.assert_allclose(made.singular.points, np.pi * turns, atol=1e-8)
    assert made.arm_singular is not None
    here = Configuration(robot_3r, np.zeros(robot_3r.n))
    z = [here.placement(name).translation[2] for name in ("link2", "link3", "ee")]
    l2, l3 = z[1] - z[0], z[2] - z[1]
    s2, s3 = np.sin(all_points(made.arm_singular).T)
    q2, q3 = all_points(made.arm_singular).T
    np.testing.assert_allclose((l2 * s2 + l3 * np.sin(q2 + q3)) * s3, 0.0, atol=1e-8)
    # Every row of the map crosses both curves Λ = 0.
    curve = all_points(made.arm_singular)[np.abs(s3) > 1e-6]
    cell = made.axes[1][1] - made.axes[1][0]
    rows = np.unique(np.round((curve[:, 1] + np.pi) / cell))
    assert len(rows) >= 77


def test_the_platform_leaves_points_of_the_curves_of_a_ur5(ur5: Robot) -> None:
    at = {"shoulder_lift_joint": -1.0, "wrist_1_joint": 0.4, "shoulder_pan_joint": 0.6}
    subject = (ur5, Pose("tool0"))
    made = singularity_map(subject, ("elbow_joint", "wrist_2_joint"), at=at, samples=60)
    assert made.arm_singular is not None
    assert len(made.singular.points) >= 4
    assert not made.singular.lines
    for those, part in ((made.singular, "robot"), (made.arm_singular, "arm")):
        points = all_points(those)
        for elbow, wrist in points[:: max(1, len(points) // 25)]:
            report = analyse(subject, ur5.q(at | {"elbow_joint": elbow, "wrist_2_joint": wrist}))
            assert report.parts[part].singular

    # The stretched elbow and the aligned wrist, from one end of the map to the other.
    for column in (0, 1):
        along = [line for line in made.arm_singular.lines if np.abs(np.median(line[:, column])) < 1e-6]
        assert any(np.ptp(line[:, 1 - column]) > 5.5 for line in along)
    # Another grid finds the same points: none is an accident of where the nodes are.
    other = singularity_map(subject, ("elbow_joint", "wrist_2_joint"), at=at, samples=47).singular.points
    distances = np.linalg.norm(made.singular.points[:, np.newaxis] - other, axis=2)
    assert len(other) == len(made.singular.points)
    assert distances.min(axis=0).max() < 1e-6
    assert distances.min(axis=1).max() < 1e-6


def test_an_arm_of_too_few_inputs_has_no_set_of_its_own(robot_2r: Robot) -> None:
    assert singularity_map((robot_2r, WITH_HEADING), samples=5).arm_singular is None
    assert singularity_map((robot_2r, WITH_HEADING), samples=5, part="arm").singular.everywhere


@pytest.mark.parametrize("samples", [2, 3])
def test_nodes_that_are_all_singular_are_not_everywhere(robot_2r: Robot, samples: int) -> None:
    """q2 = -π, 0, π at all nodes, where sin q2 = 0: three lines, as on any other grid."""
    made = singularity_map((robot_2r, PLANAR), samples=samples)
    assert made.arm_singular is not None
    assert not made.arm_singular.everywhere
    lines = sorted(made.arm_singular.lines, key=lambda line: line[0, 1])
    assert len(lines) == 3
    assert not len(made.arm_singular.points)
    for line, q2 in zip(lines, (-np.pi, 0.0, np.pi), strict=True):
        np.testing.assert_allclose(line[:, 1], q2, atol=1e-9)
        assert np.ptp(line[:, 0]) == pytest.approx(2.0 * np.pi)


@pytest.mark.parametrize(
    ("lower", "upper", "expected"),
    [
        (-1e9, 1e9, (-1.0, 1.0)),
        (0.5, 1e9, (0.5, 1.5)),
        (-1e9, -0.5, (-1.5, -0.5)),
        (-0.2, 0.7, (-0.2, 0.7)),
        (-2e3, 5e3, (-2e3, 5e3)),
    ],
)
def test_a_slide_is_mapped_over_the_limits_that_it_has(
    lower: float, upper: float, expected: tuple[float, float], tmp_path: Path
) -> None:
    robot = load(sliding(tmp_path, lower, upper), platform="fixed")
    assert robot.limited.tolist() == [[lower > -1e9, upper < 1e9], [True, False]]
    made = singularity_map((robot, Position("tip", "xy")), ("slide", "turn"), samples=5)
    assert (made.axes[0][0], made.axes[0][-1]) == pytest.approx(expected)
    # An angle without an upper limit, but with a lower one of -3: one turn from there.
    assert (made.axes[1][0], made.axes[1][-1]) == pytest.approx((-3.0, -3.0 + 2.0 * np.pi))
