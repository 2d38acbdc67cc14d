"""Logarithms, exponentials and their Jacobians against Pinocchio, power series and differences."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from findings import refused
from numpy import pi
from numpy.typing import NDArray

from nmm import rotation_vector
from nmm.base.kernels.rotations import (
    between3,
    compose3,
    exp3,
    left_jacobian3,
    left_jacobian_inverse3,
    log3,
    log6,
    log6_jacobian,
    times3,
    transposed_times3,
)

Array = NDArray[np.float64]

COUNT = 1000
#: Where the angles lie: anywhere, down to 0, and up to π. Pinocchio switches formulas near both ends.
ANGLES = {
    "any": lambda rng: rng.uniform(0.0, pi),
    "small": lambda rng: 10.0 ** rng.uniform(-16, -1),
    "nearly half a turn": lambda rng: pi - 10.0 ** rng.uniform(-14, -1),
}
each_range = pytest.mark.parametrize("angles", ANGLES)


def matrix(function, *given: Array) -> Array:  # type: ignore[no-untyped-def]
    out = np.full((3, 3), np.nan)
    function(*given, out)
    return out


def vector(function, *given: Array, size: int = 3) -> Array:  # type: ignore[no-untyped-def]
    out = np.full(size, np.nan)
    function(*given, out)
    return out


def random_vectors(angles: str, rng: np.random.Generator) -> list[Array]:
    directions = rng.normal(size=(COUNT, 3))
    directions[::10] = np.eye(3)[rng.integers(3, size=COUNT // 10)] * rng.choice([-1, 1], (COUNT // 10, 1))
    return [d / np.linalg.norm(d) * ANGLES[angles](rng) for d in directions]


def right_jacobian6(e: Array) -> Array:
    """The series Σ (-ad e)^k / (k+1)!, which needs no angle and no threshold."""
    v, w = pin.skew(e[:3]), pin.skew(e[3:])
    ad = np.block([[w, v], [np.zeros((3, 3)), w]])
    term, total = np.eye(6), np.eye(6)
    for k in range(1, 60):
        term = term @ -ad / (k + 1)
        total = total + term
    return total


@each_range
def test_exponential_and_logarithm_of_rotations(angles: str, rng: np.random.Generator) -> None:
    for phi in random_vectors(angles, rng):
        R = matrix(exp3, phi)
        np.testing.assert_allclose(R, pin.exp3(phi), rtol=0, atol=3e-15)
        np.testing.assert_allclose(R.T @ R, np.eye(3), rtol=0, atol=2e-15)
        np.testing.assert_allclose(vector(log3, R), phi, rtol=0, atol=1e-14 * min(1.0, np.linalg.norm(phi)))


@each_range
def test_jacobians_of_rotations(angles: str, rng: np.random.Generator) -> None:
    for phi in random_vectors(angles, rng):
        left = matrix(left_jacobian3, phi)
        right = right_jacobian6(np.r_[np.zeros(3), phi])[3:, 3:]
        np.testing.assert_allclose(left.T, right, rtol=0, atol=3e-15)
        np.testing.assert_allclose(matrix(left_jacobian_inverse3, phi) @ left, np.eye(3), rtol=0, atol=3e-15)
        np.testing.assert_allclose(left, matrix(exp3, phi) @ left.T, rtol=0, atol=5e-15)  # of the same turn


@each_range
def test_logarithm_of_motions(angles: str, rng: np.random.Generator) -> None:
    for phi in random_vectors(angles, rng):
        R, p = matrix(exp3, phi), rng.normal(scale=3.0, size=3)
        e = vector(log6, R, p, size=6)
        # Pinocchio's own logarithm and exponential are good to 1e-10 and 1e-11 near their thresholds.
        np.testing.assert_allclose(e, pin.log6(pin.SE3(R, p)).vector, rtol=0, atol=1e-9)
        np.testing.assert_allclose(pin.exp6(e).homogeneous, pin.SE3(R, p).homogeneous, rtol=0, atol=1e-10)
        A, B = np.empty((3, 3)), np.empty((3, 3))
        log6_jacobian(e, p, A, B)
        J = np.block([[A, B], [np.zeros((3, 3)), A]])
        np.testing.assert_allclose(J @ right_jacobian6(e), np.eye(6), rtol=0, atol=3e-14)


def test_jacobian_of_motions_is_pinocchios(rng: np.random.Generator) -> None:
    """Away from 0, where Pinocchio's is off by up to 1e-4 (at angles of 1e-4)."""
    for phi in random_vectors("any", rng):
        if np.linalg.norm(phi) > 0.3:
            R, p = matrix(exp3, phi), rng.normal(scale=3.0, size=3)
            A, B = np.empty((3, 3)), np.empty((3, 3))
            log6_jacobian(vector(log6, R, p, size=6), p, A, B)
            J = np.block([[A, B], [np.zeros((3, 3)), A]])
            np.testing.assert_allclose(J, pin.Jlog6(pin.SE3(R, p)), rtol=0, atol=1e-10)


def test_nothing_happens_at_zero() -> None:
    zero = np.zeros(3)
    assert np.array_equal(matrix(exp3, zero), np.eye(3))
    assert np.array_equal(vector(log3, np.eye(3)), zero)
    assert np.array_equal(matrix(left_jacobian3, zero), np.eye(3))
    assert np.array_equal(matrix(left_jacobian_inverse3, zero), np.eye(3))
    assert np.array_equal(vector(log6, np.eye(3), np.array([1.0, 2.0, 3.0]), size=6), [1, 2, 3, 0, 0, 0])


def test_half_a_turn_is_half_a_turn(rng: np.random.Generator) -> None:
    for axis in (*np.eye(3), *-np.eye(3), *rng.normal(size=(100, 3))):
        u = axis / np.linalg.norm(axis)
        phi = vector(log3, 2 * np.outer(u, u) - np.eye(3))
        assert np.linalg.norm(phi) == pytest.approx(
            pi, abs=1e-7
        )  # the matrix is rounded: of π - θ, the square
        assert abs(phi @ u) == pytest.approx(pi, abs=1e-7)


def test_more_than_half_a_turn_is_another_vector_of_the_same_rotation(rng: np.random.Generator) -> None:
    for phi in random_vectors("any", rng)[:100]:
        longer = phi * (1 + 2 * pi / np.linalg.norm(phi))
        np.testing.assert_allclose(matrix(exp3, longer), matrix(exp3, phi), rtol=0, atol=1e-14)
        left = matrix(left_jacobian3, longer)
        right = right_jacobian6(np.r_[np.zeros(3), longer])[3:, 3:]
        np.testing.assert_allclose(left.T, right, rtol=0, atol=1e-11)  # the series cancels at 9 rad


def test_products(rng: np.random.Generator) -> None:
    A, B, x = rng.normal(size=(3, 3)), rng.normal(size=(3, 3)), rng.normal(size=3)
    np.testing.assert_allclose(matrix(compose3, A, B), A @ B, atol=1e-15)
    np.testing.assert_allclose(matrix(between3, A, B), A.T @ B, atol=1e-15)
    np.testing.assert_allclose(vector(times3, A, x), A @ x, atol=1e-15)
    np.testing.assert_allclose(vector(transposed_times3, A, x), A.T @ x, atol=1e-15)


def test_other_notations_of_an_orientation(rng: np.random.Generator) -> None:
    for _ in range(100):
        roll, pitch, yaw = rng.uniform(-4, 4, 3)
        R = pin.rpy.rpyToMatrix(roll, pitch, yaw)
        expected = pin.exp3(rotation_vector(rpy=[roll, pitch, yaw]))
        np.testing.assert_allclose(expected, R, atol=1e-14)
        for sign in (1, -1):
            xyzw = sign * pin.Quaternion(R).coeffs()
            np.testing.assert_allclose(pin.exp3(rotation_vector(quaternion=xyzw)), R, atol=1e-14)
        np.testing.assert_allclose(pin.exp3(rotation_vector(matrix=R)), R, atol=1e-14)


@pytest.mark.parametrize(
    ("given", "fields"),
    [
        ({}, {"where": "orientation", "got": []}),
        (
            {"rpy": [0, 0, 0], "quaternion": [0, 0, 0, 1]},
            {"where": "orientation", "got": ["rpy", "quaternion"]},
        ),
        ({"rpy": [0, 0]}, {"where": "rpy", "got": [0.0, 0.0]}),
        ({"quaternion": [0, 0, 0, 0]}, {"where": "quaternion", "got": [0.0, 0.0, 0.0, 0.0]}),
        ({"quaternion": [1, 0, 0]}, {"where": "quaternion", "got": [1.0, 0.0, 0.0]}),
        ({"matrix": np.diag([1, 1, -1])}, {"where": "matrix"}),
        ({"matrix": 2 * np.eye(3)}, {"where": "matrix"}),
        ({"matrix": np.eye(2)}, {"where": "matrix", "got": [[1.0, 0.0], [0.0, 1.0]]}),
    ],
)
def test_what_is_no_orientation(given: dict[str, object], fields: dict[str, Any]) -> None:
    with refused(**fields):
        rotation_vector(**given)
