"""The loops of nmm.base.kernels.linear_algebra against numpy."""

from __future__ import annotations

import numpy as np
import pytest
from conditioned import with_condition
from numpy.typing import NDArray

from nmm.base.kernels.linear_algebra import (
    closest_solution,
    eliminate,
    orthonormal_rows,
    pseudoinverse_transposed,
    residual_norm,
    singular_rows,
)

Array = NDArray[np.float64]

SHAPES = [(1, 1), (1, 5), (2, 2), (2, 4), (3, 4), (3, 5), (4, 4), (5, 11), (6, 6), (6, 8), (6, 12)]
each_shape = pytest.mark.parametrize("shape", SHAPES, ids=str)


def decomposed(J: Array) -> tuple[float, NDArray[np.int64], Array, Array]:
    s, m = J.shape
    order, L, Q = np.full(s, -1), np.full((s, s), np.nan), np.full((s, m), np.nan)
    return orthonormal_rows(J, np.ones(s), order, L, Q), order, L, Q


@each_shape
@pytest.mark.parametrize("condition", [1.0, 1e3, 1e6, 1e9])
def test_orthonormal_rows(shape: tuple[int, int], condition: float, rng: np.random.Generator) -> None:
    s = shape[0]
    for scale in (1e-3, 1.0, 1e3):
        J = scale * with_condition(shape, condition, rng)
        ratio, order, L, Q = decomposed(J)
        assert sorted(order) == list(range(s))
        np.testing.assert_allclose(L @ Q, J[order], rtol=0, atol=1e-14 * scale)
        np.testing.assert_allclose(Q @ Q.T, np.eye(s), rtol=0, atol=1e-14)
        np.testing.assert_array_equal(L, np.tril(L))
        diagonal = np.diag(L)
        assert np.all(diagonal > 0)
        assert np.all(np.diff(diagonal) <= 1e-14 * scale)
        assert ratio == diagonal[-1] / max(1.0, diagonal[0])
        # Pivoted, its diagonal overestimates the smallest singular value by 2^(s-1) sqrt(s) at most.
        true = (1.0 / condition if s > 1 else 1.0) * min(1.0, scale)
        assert true * (1 - 1e-6) <= ratio <= true * 2.0 ** (s - 1) * np.sqrt(s)
        # det J Jᵀ forgets the small singular values; the product of them all does not.
        volume = np.prod(np.linalg.svd(J, compute_uv=False))
        assert np.prod(diagonal) == pytest.approx(volume, rel=1e-14 * condition + 1e-12)


@each_shape
def test_rows_that_depend_on_each_other_have_ratio_zero(
    shape: tuple[int, int], rng: np.random.Generator
) -> None:
    s, m = shape
    for rank in range(s):
        J = rng.normal(size=(s, rank)) @ rng.normal(size=(rank, m))
        assert decomposed(J)[0] <= 1e-14


@pytest.mark.parametrize(
    "J", [np.zeros((1, 3)), np.zeros((2, 2)), np.ones((3, 4)), np.eye(3)[[0, 1, 0]]], ids=str
)
def test_rows_that_vanish_or_repeat_have_ratio_zero(J: Array) -> None:
    assert decomposed(J)[0] == 0.0


@each_shape
@pytest.mark.parametrize("condition", [1.0, 1e3, 1e6])
def test_closest_solution_and_pseudoinverse(
    shape: tuple[int, int], condition: float, rng: np.random.Generator
) -> None:
    s, m = shape
    J, rate, u0 = with_condition(shape, condition, rng), rng.normal(size=s), rng.normal(size=m)
    _, order, L, Q = decomposed(J)
    inverse = np.linalg.pinv(J)
    # The problem's own sensitivity: numpy's result is no better.
    tolerance = 1e-14 * condition**2 if s > 1 else 1e-14
    for near in (u0, np.zeros(m)):
        u = np.full(m, np.nan)
        closest_solution(rate, near, order, L, Q, u)
        np.testing.assert_allclose(u, near + inverse @ (rate - J @ near), rtol=0, atol=tolerance)
        np.testing.assert_allclose(J @ u, rate, rtol=0, atol=1e-14 * condition)
    X = np.full((s, m), np.nan)
    pseudoinverse_transposed(order, L, Q, X)
    np.testing.assert_allclose(X, inverse.T, rtol=0, atol=tolerance)


@each_shape
def test_rows_are_judged_in_their_scales(shape: tuple[int, int], rng: np.random.Generator) -> None:
    """Rows in other units, with their scales in these units: the same pivots, the same judgement."""
    s, m = shape
    J, scales = rng.normal(size=shape), rng.uniform(0.5, 2.0, s)
    units = 2.0 ** rng.integers(-20, 20, s)  # which round nothing
    answers = []
    for rows, sizes in ((J, scales), (units[:, None] * J, units * scales)):
        order, L, Q = np.zeros(s, dtype=np.int64), np.zeros((s, s)), np.zeros((s, m))
        regular = orthonormal_rows(np.ascontiguousarray(rows), sizes, order, L, Q)
        M = np.hstack([rows[:, :s], np.eye(s) * (rows / J)[:, :1]])
        answers.append([order, Q, regular, *eliminate(M, sizes.copy())[1:], M[:, s:]])
        scaled = L[range(s), range(s)] / sizes[order]
        assert np.all(np.diff(scaled) <= 1e-14)
        assert regular == pytest.approx(scaled[-1] / max(1.0, scaled[0]))
    for one, other in zip(*answers, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("s", [1, 2, 3, 5, 8, 12])
@pytest.mark.parametrize("k", [0, 1, 4])
def test_eliminate(s: int, k: int, rng: np.random.Generator) -> None:
    for _ in range(20):
        A, B = rng.normal(size=(s, s)), rng.normal(size=(s, k))
        M = np.hstack([A, B])
        determinant, ratio = eliminate(M, np.ones(len(M)))
        assert determinant == pytest.approx(np.linalg.det(A), rel=1e-12 * np.linalg.cond(A))
        assert 0.0 < ratio <= 1.0
        np.testing.assert_allclose(
            M[:, s:], np.linalg.solve(A, B), rtol=0, atol=1e-14 * np.linalg.cond(A) ** 2
        )


def test_eliminate_needs_its_pivots() -> None:
    """A zero in the first place, and an odd permutation: the determinant's sign."""
    M = np.array([[0.0, 2.0, 0.0, 2.0], [3.0, 0.0, 0.0, 3.0], [0.0, 0.0, 5.0, 5.0]])
    assert eliminate(M, np.ones(len(M))) == (-30.0, 2.0 / 5.0)
    np.testing.assert_array_equal(M[:, 3], np.ones(3))
    # Without pivoting the tiny first entry swamps the solution.
    M = np.array([[1e-20, 1.0, 1.0], [1.0, 1.0, 2.0]])
    eliminate(M, np.ones(len(M)))
    np.testing.assert_allclose(M[:, 2], [1.0, 1.0], rtol=1e-15)


@pytest.mark.parametrize("A", [np.zeros((1, 1)), np.zeros((3, 3)), np.ones((2, 2)), np.diag([1.0, 0.0, 2.0])])
def test_eliminate_tells_a_singular_matrix(A: Array) -> None:
    assert eliminate(np.hstack([A, np.ones((len(A), 1))]), np.ones(len(A))) == (0.0, 0.0)


@pytest.mark.parametrize("A", [[[1.0, np.nan], [2.0, 1.0]], np.full((2, 2), np.nan)], ids=["one", "all"])
def test_eliminate_with_nan_is_not_a_number(A: Array) -> None:
    M = np.hstack([A, np.ones((2, 1))])
    determinant, _ = eliminate(M, np.ones(len(M)))
    assert np.isnan(determinant)
    assert np.all(np.isnan(M[:, 2]))


@each_shape
def test_residual_norm(shape: tuple[int, int], rng: np.random.Generator) -> None:
    s, m = shape
    J, u, rate = rng.normal(size=shape), rng.normal(size=m), rng.normal(size=s)
    residual, rounding = residual_norm(J, u, rate)
    assert residual == pytest.approx(np.linalg.norm(J @ u - rate), rel=1e-13)
    expected = np.finfo(float).eps * np.linalg.norm(np.abs(J) @ np.abs(u) + np.abs(rate))
    assert rounding == pytest.approx(expected, rel=1e-13)


@each_shape
@pytest.mark.parametrize("condition", [1.0, 1e3, 1e9])
def test_singular_rows(shape: tuple[int, int], condition: float, rng: np.random.Generator) -> None:
    """Rows in either order of their lengths: the larger of the two rotations would go back and forth."""
    s = shape[0]
    for _ in range(5):
        A = with_condition(shape, condition, rng)
        rows, R = A.copy(), np.full((s, s), np.nan)
        extremes = singular_rows(rows, R)
        singular = np.linalg.svd(A, compute_uv=False)
        np.testing.assert_allclose(
            np.sort(np.linalg.norm(rows, axis=1))[::-1], singular, rtol=1e-13, atol=1e-15
        )
        np.testing.assert_allclose(extremes, (singular[-1], singular[0]), rtol=1e-13, atol=1e-15)
        np.testing.assert_allclose(R @ R.T, np.eye(s), rtol=0, atol=1e-14)
        np.testing.assert_allclose(R.T @ rows, A, rtol=0, atol=1e-14)
        np.testing.assert_allclose(rows @ rows.T, np.diag(np.diag(rows @ rows.T)), rtol=0, atol=1e-14)
