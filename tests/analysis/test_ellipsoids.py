"""Manipulability ellipsoids: the mathematics against the frame's own motion."""

from __future__ import annotations

from itertools import permutations, product

import numpy as np
import pytest
from ellipsoid_examples import columns, directions, jacobian, load, random_q, swing
from thinned import thinned

import nmm
from nmm.analysis.singular.ellipsoids import Ellipsoids, carried_frame, ellipsoids_along, frame_of
from nmm.base.arrays import Array
from nmm.base.errors import InputError
from nmm.model.robots.configuration import Configuration
from nmm.views.playback.ellipsoids import EllipsoidOptions

#: A planar robot, a spatial one, an arm on a fixed base, one on a car, one with more inputs than it needs.
ROBOTS = ("unicycle_2r", "unicycle_3r", "small_arm", "car with arm", "omni with arm")
PARTS = ("robot", "arm", "platform")


# The mathematics


@pytest.mark.parametrize("part", PARTS)
@pytest.mark.parametrize("name", ROBOTS)
def test_the_frames_velocities_fill_the_ellipsoid(name: str, part: str) -> None:
    """Velocities by differences of where the frame is: inside, and on it for u in the rows' space."""
    robot = load(name)
    if part == "platform" and not robot.platform.p:
        return
    q, chosen, step = random_q(robot, 6), columns(robot, part), 1e-6
    found = ellipsoids_along(robot, None, q, part)
    assert found.inputs == tuple(robot.u_names[j] for j in chosen)
    for k in range(len(q)):
        A = jacobian(robot, found.frame, q[k], part)
        np.testing.assert_allclose(found.matrices[k], A @ A.T, atol=1e-13)
        in_rows = np.linalg.pinv(A, rcond=1e-9) @ A
        for i, direction in enumerate(directions(20, len(chosen))):
            u = direction if i % 2 else in_rows @ direction
            u = np.zeros(robot.n_u) + np.bincount(chosen, u / np.linalg.norm(u), robot.n_u)
            ends = [
                np.array(
                    Configuration(robot, q[k] + s * robot.S(q[k]) @ u).placement(found.frame).translation
                )
                for s in (-step, step)
            ]
            along = found.axes[k].T @ (ends[1] - ends[0]) / (2.0 * step)
            moved = found.radii[k] > 1e-9
            assert np.all(np.abs(along[~moved]) < 1e-8)
            size = float(np.sum((along[moved] / found.radii[k][moved]) ** 2))
            assert size == pytest.approx(1.0, abs=1e-6) if i % 2 == 0 else size < 1.0 + 1e-6


@pytest.mark.parametrize("name", ROBOTS)
def test_the_parts_add_up(name: str) -> None:
    """Squared supports of arm and platform add up to the whole robot's: the arm's lies inside."""
    robot = load(name)
    q, d = random_q(robot, 20), directions(60, 3)
    whole, arm, platform = (ellipsoids_along(robot, None, q, part).support(d) for part in PARTS)
    np.testing.assert_allclose(arm**2 + platform**2, whole**2, atol=1e-13)
    assert np.all(arm <= whole + 1e-13)
    if robot.platform.p:
        assert np.any(arm < 0.9 * whole)


@pytest.mark.parametrize("name", ROBOTS)
def test_projections_reach_as_far_as_velocities_seen_from_there(name: str) -> None:
    robot = load(name)
    q, d = random_q(robot, 5), directions(40, 2)
    found = ellipsoids_along(robot, None, q)
    turned = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 2)))[0].T
    for view in (np.eye(3)[[0, 1]], np.eye(3)[[0, 2]], turned):
        shadow = found.projected(view)
        outlines = shadow.outline(0.3, 2000) - shadow.center[:, None]
        for k in range(len(q)):
            # The largest of d J u with ‖u‖ <= 1 is the length of the row d J.
            expected = np.linalg.norm(d @ view @ jacobian(robot, found.frame, q[k]), axis=1)
            reach = np.linalg.norm((d @ shadow.axes[k]) * shadow.radii[k], axis=1)
            np.testing.assert_allclose(reach, expected, atol=1e-13)
            np.testing.assert_allclose((outlines[k] @ d.T).max(axis=0), 0.3 * expected, atol=1e-5)
            np.testing.assert_allclose(shadow.center[k], view @ found.center[k])


def test_a_planar_robot_has_no_third_radius() -> None:
    robot = load("unicycle_2r")
    found = ellipsoids_along(robot, "ee", random_q(robot, 50))
    assert found.radii[:, 2].max() <= 1e-15
    assert found.radii[:, :2].min() > 1e-3
    np.testing.assert_allclose(np.abs(found.axes[:, 2, 2]), 1.0)


def test_sizes_of_inputs_are_lengths_of_columns() -> None:
    robot = load("unicycle_3r")
    q = random_q(robot, 4)
    sizes = {"v": 0.5, "q2": 3.0}
    found = ellipsoids_along(robot, "ee", q, sizes=sizes)
    weights = np.array([sizes.get(name, 1.0) for name in robot.u_names])
    np.testing.assert_array_equal(found.input_sizes, weights)
    for k in range(len(q)):
        A = jacobian(robot, "ee", q[k]) * weights
        np.testing.assert_allclose(found.matrices[k], A @ A.T, atol=1e-13)
    arm = ellipsoids_along(robot, "ee", q, "arm", sizes=sizes)
    np.testing.assert_array_equal(arm.input_sizes, weights[robot.platform.p :])
    limited = load("small_arm")
    assert np.all(np.isfinite(limited.u_limits))
    found = ellipsoids_along(limited, None, limited.rest, sizes="limits")
    np.testing.assert_array_equal(found.input_sizes, limited.u_limits)


def test_one_configuration_and_names() -> None:
    robot = load("unicycle_2r")
    alone = ellipsoids_along(robot, "ee", {"q1": 0.4, "q2": 0.3})
    assert len(alone) == 1
    np.testing.assert_array_equal(alone.radii, ellipsoids_along(robot, None, [0, 0, 0, 0.4, 0.3]).radii)
    base = nmm.load("car_base")
    assert frame_of(base, None) == "base_footprint"
    # A task of the platform shows nothing of the arm.
    assert carried_frame(robot, "base_footprint") == carried_frame(robot, None) == "ee"
    assert carried_frame(robot, "link1") == "link1"


def test_bad_input_names_what_there_is() -> None:
    robot = load("unicycle_2r")
    q = random_q(robot, 3)
    for arguments, message in (
        (("eee", q), "unknown frame 'eee'.*did you mean 'ee'"),
        (("ee", q, "arms"), "unknown part 'arms'.*available: platform, arm, robot"),
        (("ee", q[:, :4]), r"q: expected rows of 5 numbers \(x, y, theta, q1, q2\), got shape \(3, 4\)"),
        (("ee", [[np.nan] * 5]), "q: expected finite numbers"),
        (("ee", q, "robot", {"w": 1.0}), "unknown input 'w'"),
        (("ee", q, "robot", {"v": 0.0}), "size of v: expected a number above 0"),
        (("ee", q, "robot", "large"), "expected sizes by the inputs' names, or 'limits', got 'large'"),
    ):
        with pytest.raises(InputError, match=message):
            ellipsoids_along(robot, *arguments)
    assert not np.all(np.isfinite(robot.u_limits))
    with pytest.raises(InputError, match="has no limits of v"):
        ellipsoids_along(robot, "ee", q, sizes="limits")
    with pytest.raises(InputError, match="scale of the ellipsoids: expected a number above 0, got -1"):
        EllipsoidOptions(scale=-1.0)


# Along a motion


def turns(found: Ellipsoids) -> Array:
    """By how much the axes turn from sample to sample, (N - 1,) rad."""
    traces = np.einsum("kij,kij->k", found.axes[1:], found.axes[:-1])
    return np.asarray(np.arccos(np.clip(0.5 * (traces - 1.0), -1.0, 1.0)))


@pytest.mark.parametrize(
    ("name", "part"),
    thinned(
        product(ROBOTS, PARTS),
        lambda case: case[0] == "unicycle_3r" or case[1] == "platform" or case == ("small_arm", "arm"),
    ),
)
def test_axes_keep_their_names(name: str, part: str) -> None:
    """Axes turn no faster than the matrix changes, beside how unlike their radii are; no other right-handed
    naming of them is nearer to the one before."""
    found = ellipsoids_along(load(name), None, swing(load(name), np.linspace(0.0, 4.0, 3001)), part)
    identity = np.swapaxes(found.axes, 1, 2) @ found.axes
    np.testing.assert_allclose(identity, np.tile(np.eye(3), (len(found), 1, 1)), atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(found.axes), 1.0, atol=1e-12)
    seen = np.swapaxes(found.axes[:-1], 1, 2) @ found.axes[1:]
    squares = found.radii[:-1] ** 2
    gaps = np.abs(squares[:, :, None] - squares[:, None])
    change = np.linalg.norm(np.diff(found.matrices, axis=0), axis=(1, 2))
    for i, j in permutations(range(3), 2):
        apart = gaps[:, i, j] > 20.0 * change + 1e-12
        assert np.all(np.abs(seen[apart, i, j]) < 0.06)
    for order in permutations(range(3)):
        for signs in product((1.0, -1.0), repeat=3):
            other = np.eye(3)[:, order] * signs
            if np.linalg.det(other) > 0.0:
                nearer = np.einsum("kij,ji->k", seen, other) - np.einsum("kii->k", seen)
                assert nearer.max() < 1e-9


def test_radii_cross_where_axes_would_swap() -> None:
    """Upwards and sideways are two worlds for an arm in its plane: their radii meet, and their axes stay."""
    robot = load("unicycle_3r")
    q = np.zeros((400, robot.n))
    q[:, robot.coordinate("q2")] = np.linspace(-1.2, 1.4, 400)
    q[:, robot.coordinate("q3")] = 0.8
    found = ellipsoids_along(robot, "ee", q, "arm")
    order = np.argsort(-found.radii, axis=1)
    assert np.any(order != order[0])
    assert turns(found).max() < 0.05


def test_equal_radii_turn_nothing() -> None:
    """What is round looks the same from all sides, and is drawn as it was."""
    robot = nmm.load("omni_base")
    q = np.zeros((100, robot.n))
    q[:, 2] = np.linspace(0.0, 3.0, 100)
    found = ellipsoids_along(robot, "base_footprint", q)
    np.testing.assert_allclose(found.radii[:, 0], found.radii[:, 1])
    assert turns(found).max() < 1e-6
    nothing = ellipsoids_along(load("small_arm"), None, random_q(load("small_arm"), 3), "platform")
    np.testing.assert_array_equal(nothing.radii, 0.0)
    np.testing.assert_array_equal(nothing.axes, np.tile(np.eye(3), (3, 1, 1)))


def test_a_line_goes_with_its_robot() -> None:
    robot = load("unicycle_2r")
    q = np.zeros((60, robot.n))
    q[:, 2] = np.linspace(0.3, 7.0, 60)
    found = ellipsoids_along(robot, "base_footprint", q)
    np.testing.assert_allclose(found.radii, np.tile([1.0, 0.0, 0.0], (60, 1)), atol=1e-15)
    way = found.axes[:, :, 0] * np.sign(found.axes[0, 0, 0])
    np.testing.assert_allclose(way[:, :2], np.column_stack([np.cos(q[:, 2]), np.sin(q[:, 2])]), atol=1e-12)
    assert turns(found).max() < 1.5 * (q[1, 2] - q[0, 2])


def test_where_wheels_cannot_roll_there_is_none() -> None:
    robot = load("car with arm")
    q = np.tile(robot.rest, (9, 1))
    q[:, 3] = np.linspace(0.0, np.pi / 2, 9)
    assert robot.platform.problem(q[-1, : robot.platform.n_p]) is not None
    back = np.vstack([q, q[-2::-1]])
    found = ellipsoids_along(robot, None, back)
    assert list(np.flatnonzero(np.isnan(found.radii).any(axis=1))) == [8]
    np.testing.assert_array_equal(found.axes[8], found.axes[7])
    assert np.all(np.isfinite(found.center))
    assert np.isnan(found.projected().radii[8]).all()
    assert np.isfinite(found.projected().outline()[:8]).all()
