"""Maps of the workspace against the geometry of a planar arm, and against plain drawing."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from planar_arms import link_lengths
from sliding_arm import sliding

from nmm.analysis import analyse
from nmm.analysis.maps.reach import ArmReach
from nmm.analysis.maps.result import Map
from nmm.analysis.maps.search import BENT
from nmm.analysis.maps.workspace import in_curves, workspace_map
from nmm.analysis.singular.jacobians import Jacobians
from nmm.base.errors import InputError
from nmm.control.functions.tasks import Position
from nmm.model.robots.configuration import Configuration
from nmm.model.robots.loading import load
from nmm.model.robots.robot import Robot

Array = NDArray[np.float64]
PLANAR = Position("ee", "xy")


@pytest.fixture(scope="module")
def annulus(fixed_2r: Robot) -> Map:
    return workspace_map((fixed_2r, PLANAR), samples=120, configurations=1 << 13, measures="manipulability")


def from_shoulder(made: Map, robot: Robot) -> Array:
    center = Configuration(robot, made.q).placement("link1").translation[:2]
    x, y = np.meshgrid(*made.axes)
    return np.hypot(x - center[0], y - center[1])


def test_the_workspace_of_a_planar_arm_is_its_annulus(annulus: Map, fixed_2r: Robot) -> None:
    l1, l2 = link_lengths(fixed_2r)
    radius = from_shoulder(annulus, fixed_2r)
    cell = annulus.axes[0][1] - annulus.axes[0][0]
    reached = np.isfinite(annulus.values["manipulability"])
    half_diagonal = cell / np.sqrt(2.0)
    assert reached[(radius < l1 + l2 - half_diagonal) & (radius > abs(l1 - l2) + half_diagonal)].all()
    assert not reached[(radius > l1 + l2 + half_diagonal) | (radius < abs(l1 - l2) - half_diagonal)].any()
    np.testing.assert_array_equal(reached, annulus.rank >= 0)


def test_each_value_is_attained_by_the_posture_kept_with_it(annulus: Map, fixed_2r: Robot) -> None:
    l1, l2 = link_lengths(fixed_2r)
    values, worst = annulus.values["manipulability"], annulus.worst["manipulability"]
    reached = np.isfinite(values)
    for kept, layer in ((annulus.best_q, values), (annulus.worst_q, worst)):
        q2 = kept["manipulability"][reached][:, fixed_2r.coordinate("q2")]
        np.testing.assert_allclose(layer[reached], l1 * l2 * np.abs(np.sin(q2)), atol=1e-14)
        assert np.isnan(kept["manipulability"][~reached]).all()
    assert np.all(worst[reached] <= values[reached])
    cell = annulus.axes[0][1] - annulus.axes[0][0]
    for row, column in np.argwhere(reached)[::50]:
        point = Configuration(fixed_2r, annulus.q_at(row, column)).placement("ee").translation
        assert abs(point[0] - annulus.axes[0][column]) <= 0.5 * cell + 1e-12
        assert abs(point[1] - annulus.axes[1][row]) <= 0.5 * cell + 1e-12


def test_the_value_is_that_at_the_middle_of_the_cell(annulus: Map, fixed_2r: Robot) -> None:
    """By the law of cosines; both elbows have the same w, so best and worst do."""
    l1, l2 = link_lengths(fixed_2r)
    radius = from_shoulder(annulus, fixed_2r)
    cosine = (radius**2 - l1**2 - l2**2) / (2.0 * l1 * l2)
    within = np.abs(cosine) < 1.0
    assert within.sum() > 5000
    expected = l1 * l2 * np.sqrt(1.0 - cosine[within] ** 2)
    for layer in (annulus.values, annulus.worst):
        np.testing.assert_allclose(layer["manipulability"][within], expected, rtol=0.0, atol=1e-6)


def test_on_the_rim_it_is_one_within_the_cell(annulus: Map, fixed_2r: Robot) -> None:
    l1, l2 = link_lengths(fixed_2r)
    radius = from_shoulder(annulus, fixed_2r)
    rim = np.isfinite(annulus.values["manipulability"]) & ((radius > l1 + l2) | (radius < abs(l1 - l2)))
    assert rim.sum() > 50
    half = 0.5 * (annulus.axes[0][1] - annulus.axes[0][0]) * np.sqrt(2.0)
    inward = np.where(radius > l1 + l2, radius - half, radius + half)
    cosine = (inward**2 - l1**2 - l2**2) / (2.0 * l1 * l2)
    most = l1 * l2 * np.sqrt(1.0 - cosine[rim] ** 2)
    assert np.all(annulus.values["manipulability"][rim] <= most + 1e-12)


def test_both_branches_are_carried_everywhere(robot_2r: Robot) -> None:
    """The platform makes the elbows different; each cell has the better and the worse of them."""
    made = workspace_map((robot_2r, PLANAR), samples=60, configurations=256, measures="weighted")
    l1, l2 = link_lengths(robot_2r)
    shoulder = Configuration(robot_2r, made.q).placement("link1").translation[:2]
    x, y = np.meshgrid(made.axes[0] - shoulder[0], made.axes[1] - shoulder[1])
    cosine = (x**2 + y**2 - l1**2 - l2**2) / (2.0 * l1 * l2)
    inner = np.argwhere(np.abs(cosine) < 0.95)
    x, y, cosine = (values[inner[:, 0], inner[:, 1]] for values in (x, y, cosine))
    values = []
    for q2 in (np.arccos(cosine), -np.arccos(cosine)):
        q = np.tile(made.q, (len(inner), 1))
        q[:, 3] = np.arctan2(y, x) - np.arctan2(l2 * np.sin(q2), l1 + l2 * np.cos(q2))
        q[:, 4] = q2
        J = Jacobians((robot_2r, PLANAR)).batch(q, 0.0)
        whole = np.sqrt(np.linalg.det(J @ J.transpose(0, 2, 1)))
        values.append(0.5 * np.abs(np.linalg.det(J[:, :, 2:])) + 0.5 * whole)
    for layer, expected, sign in (
        (made.values["weighted"], np.maximum(*values), 1.0),
        (made.worst["weighted"], np.minimum(*values), -1.0),
    ):
        # In the middle up to 1e-7 of a cell: never beyond the better elbow's value.
        short = sign * (expected - layer[inner[:, 0], inner[:, 1]])
        assert short.min() > -1e-6
        # A branch is tried in the next cell where it promises more than is there by BENT of the range, and
        # what it promises is wrong by its bending, which is about as much. Single cells are missed.
        assert np.mean(short <= 2.0 * BENT * np.ptp(layer[np.isfinite(layer)])) > 0.995


def test_the_best_posture_is_the_least_eccentric(robot_2r: Robot) -> None:
    """sqrt(1 - c²) falls with c = σ_min / σ_max: the best of one is the best of the other."""
    made = workspace_map(
        (robot_2r, PLANAR), samples=30, configurations=256, measures=("eccentricity", "inverse_condition")
    )
    reached = made.rank >= 0
    for layer in (made.values, made.worst):
        expected = np.sqrt(1.0 - layer["inverse_condition"][reached] ** 2)
        # Each was searched by itself, up to what a branch promises and what it bends; see above.
        found = layer["eccentricity"][reached]
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=2.0 * BENT * np.ptp(found))
    assert np.all(made.values["eccentricity"][reached] <= made.worst["eccentricity"][reached])


def test_the_singular_places_of_a_planar_arm_are_two_circles(annulus: Map, fixed_2r: Robot) -> None:
    l1, l2 = link_lengths(fixed_2r)
    center = Configuration(fixed_2r, annulus.q).placement("link1").translation[:2]
    assert not len(annulus.singular.points)
    circles = sorted((line - center for line in annulus.singular.lines), key=lambda line: np.hypot(*line[0]))
    assert len(circles) == 2
    for circle, radius in zip(circles, (abs(l1 - l2), l1 + l2), strict=True):
        np.testing.assert_allclose(np.hypot(*circle.T), radius, atol=1e-8)
        # Once around.
        turn = np.unwrap(np.arctan2(*circle.T[::-1]))
        assert abs(turn[-1] - turn[0]) == pytest.approx(2.0 * np.pi, abs=1e-6)


def test_clouds_are_no_curves_and_one_curve_beside_a_cloud_makes_none(rng: np.random.Generator) -> None:
    angle = rng.uniform(0.0, 2.0 * np.pi, 400)
    circle = np.column_stack([np.cos(angle), np.sin(angle)])
    (line,) = in_curves(circle).lines
    np.testing.assert_allclose(np.hypot(*line.T), 1.0, atol=1e-12)
    for count in (70, 200, 500, 2000):
        cloud = rng.uniform(-1.0, 1.0, (count, 2))
        assert len(in_curves(cloud).points) == count
        assert not in_curves(np.vstack([circle, cloud])).lines


def test_singular_places_that_fill_a_region_stay_points(robot_3r: Robot) -> None:
    """Rank is lost where s2 = s3 = 0: the arm upright, four heights."""
    made = workspace_map((robot_3r, Position("ee")), plane="xz", samples=12, configurations=64)
    here = Configuration(robot_3r, np.zeros(robot_3r.n))
    z = [here.placement(name).translation[2] for name in ("link2", "link3", "ee")]
    l2, l3 = z[1] - z[0], z[2] - z[1]
    heights = sorted(z[0] + a * l2 + b * l3 for a in (-1, 1) for b in (-1, 1))
    np.testing.assert_allclose(sorted(made.singular.points[:, 1]), heights, atol=1e-6)
    assert made.arm_singular is not None
    assert not made.arm_singular.lines
    assert len(made.arm_singular.points) > 100


def test_the_slab_holds_the_frame_and_the_platform_stands(robot_3r: Robot) -> None:
    subject, at = (robot_3r, Position("ee")), {"x": 1.0, "y": -0.5, "theta": 0.3}
    made = workspace_map(
        subject, plane="xz", height=(-0.7, -0.4), at=at, samples=40, configurations=1 << 12,
        measures=("sigma_min", "weighted"),
    )  # fmt: skip
    assert made.held == at
    reached = np.argwhere(np.isfinite(made.values["weighted"]))
    assert len(reached) > 200
    cell = made.axes[0][1] - made.axes[0][0]
    for row, column in reached[::40]:
        q = made.q_at(row, column, "sigma_min")
        point = Configuration(robot_3r, q).placement("ee").translation
        assert abs(point[0] - made.axes[0][column]) <= 0.5 * cell + 1e-12
        assert abs(point[2] - made.axes[1][row]) <= 0.5 * cell + 1e-12
        assert -0.7 <= point[1] <= -0.4
        assert made.values["sigma_min"][row, column] == pytest.approx(
            analyse(subject, q).sigma_min, rel=1e-12
        )
        np.testing.assert_array_equal(q[:3], [1.0, -0.5, 0.3])


@pytest.mark.thorough
def test_no_posture_drawn_is_better_than_the_best_or_worse_than_the_worst(ur5: Robot) -> None:
    """Each brought to its cell's middle, by the pseudoinverse, as far as no limit and no leap is met."""
    subject, frame = (ur5, Position("tool0")), "tool0"
    made = workspace_map(subject, samples=24, configurations=256)
    moving = np.arange(3, 8)  # the last joint turns the tool about its own origin
    q = ArmReach(ur5, frame, "xy", None, made.q, moving, None).postures(256)
    best, worst = made.values["sigma_min"], made.worst["sigma_min"]
    drawn = np.full(best.shape, np.nan)
    cell = made.axes[0][1] - made.axes[0][0]
    for posture in q:
        point = Configuration(ur5, posture).placement(frame).translation
        row, column = (round((point[k] - made.axes[k][0]) / cell) for k in (1, 0))
        middle = np.array([made.axes[0][column], made.axes[1][row]])
        leapt = False
        for _ in range(7):
            here = Configuration(ur5, posture)
            step = np.linalg.pinv(here.jacobian(frame)[:2, moving]) @ (
                middle - here.placement(frame).translation[:2]
            )
            leapt |= bool(np.abs(step).max() > 0.4)
            posture[moving] += step
        if leapt or np.abs(posture[moving]).max() > np.pi:
            continue
        value = analyse(subject, posture).sigma_min
        # The search damps its steps a little.
        assert worst[row, column] - 1e-4 <= value <= best[row, column] + 1e-4
        drawn[row, column] = np.nanmax([drawn[row, column], value])
    # Good postures have spread: cells that were drawn are better, those that were not have some.
    had = np.isfinite(drawn)
    assert had.sum() > 80
    assert np.mean(best[had] > 1.01 * drawn[had]) > 0.5
    assert np.isfinite(best).sum() > 1.5 * had.sum()


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"plane": "xx"}, "plane: expected two of x, y, z"),
        ({"frame": "eee"}, "unknown frame 'eee'"),
        ({"frame": "base_footprint"}, "does not move base_footprint in the plane"),
        ({"height": (1.0, 0.0)}, "height: expected lower below upper"),
        ({"height": (5.0, 6.0)}, "height: no posture puts ee at 5 to 6 m"),
        ({"ranges": {"x": (0.0, 1.0)}}, "unknown joint 'x'"),
        ({"samples": 1}, "samples"),
        ({"samples": 2.5}, "samples: expected a whole number from 2, got 2.5"),
        ({"configurations": 1}, "configurations: expected a whole number from 2, got 1"),
        ({"configurations": 100.5}, "configurations: expected a whole number from 2, got 100.5"),
        ({"configurations": "64"}, "configurations: expected a whole number from 2, got '64'"),
        ({"measures": "w"}, "unknown measure 'w'"),
    ],
)
def test_bad_input_of_a_workspace_is_named(robot_2r: Robot, wrong: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        workspace_map((robot_2r, PLANAR), **({"configurations": 64} | wrong))


def test_a_workspace_needs_an_arm() -> None:
    base = load("differential_base")
    with pytest.raises(InputError, match="expected a robot with an arm, differential_base has none"):
        workspace_map((base, Position("base_footprint", "xy")))


@pytest.mark.parametrize("end", [1e9, float(np.finfo(float).max)], ids=["1e9", "largest float"])
def test_a_slide_whose_limits_are_none_needs_a_range(end: float, tmp_path: Path) -> None:
    robot = load(sliding(tmp_path, -end, end), platform="fixed")
    assert robot.limited[robot.coordinate("slide")].tolist() == [False, False]
    with pytest.raises(InputError, match="ranges: expected one for slide, which has no limits"):
        workspace_map((robot, Position("tip", "xy")), configurations=64)
    made = workspace_map(
        (robot, Position("tip", "xy")), configurations=64, samples=10, ranges={"slide": (0.0, 2.0)}
    )
    # Along x by the slide's 2 m and the arm's half metre to both sides, with some room.
    assert 2.5 < np.ptp(made.axes[0]) < 3.2
