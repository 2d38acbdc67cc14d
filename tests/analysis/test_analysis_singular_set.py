"""Singular sets in a plane, of matrices made for it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nmm.analysis.maps.singular_set import SingularSet, singular_set

Array = NDArray[np.float64]


def set_of(J_of: Callable[[Array, Array], Any], n: int = 41) -> SingularSet:
    axis = np.linspace(-1.9, 2.0, n)

    def stacked(points: Array) -> Array:
        return np.array([np.atleast_2d(J_of(x, y)) for x, y in points], dtype=np.float64)

    J = stacked(np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2))
    values = np.linalg.svd(J, compute_uv=False)
    rank = np.sum(values > 1e-10 * values[:, :1], axis=1).reshape(n, n)
    smallness = [values[:, -1].reshape(n, n), np.prod(values, axis=1).reshape(n, n)]
    return singular_set(stacked, smallness, rank, J.shape[1], (axis, axis))


def test_a_curve_is_found_where_the_determinant_does_not_change_its_sign() -> None:
    (line,) = set_of(lambda x, y: np.diag([(x - 0.33 * y) ** 2, 1.0])).lines
    np.testing.assert_allclose(line[:, 0], 0.33 * line[:, 1], atol=1e-4)  # the root of the tolerance
    assert np.ptp(line[:, 1]) > 3.7


def test_a_loop_is_closed() -> None:
    (line,) = set_of(lambda x, y: np.diag([x * x + y * y - 1.0, 2.0])).lines
    np.testing.assert_allclose(np.hypot(*line.T), 1.0, atol=1e-9)
    np.testing.assert_array_equal(line[0], line[-1])


def test_two_curves_that_cross_are_two() -> None:
    found = set_of(lambda x, y: np.diag([x - 0.05 * y, 30.0 * (y + 0.2 * x)]))
    assert len(found.lines) == 2
    assert all(np.ptp(line, axis=0).max() > 3.7 for line in found.lines)


def test_points_are_told_from_small_values() -> None:
    found = set_of(lambda x, y: [[x - 0.4, 3.0 * (y + 0.7), 0.0], [0.0, 0.2, 5.0]])
    assert not found.lines
    assert len(found.points) == 1
    # x = 0.4 and u = (1, c): 3 (y + 0.7) + 0.2 c = 0 and 5 c = 0.
    np.testing.assert_allclose(found.points[0], [0.4, -0.7], atol=1e-8)
    assert set_of(lambda x, y: [[x - 0.4, 3.0 * (y + 0.7), 1e-3]]).empty


def test_a_matrix_that_is_singular_everywhere_says_so() -> None:
    found = set_of(lambda x, y: [[x, y], [2.0 * x, 2.0 * y]])
    assert found.everywhere
    assert found.text() == "everywhere"


def test_nodes_on_curves_do_not_make_it_everywhere() -> None:
    """Of sin(π x) sin(π y) with a node at each whole number, so that each is on two curves."""
    axes = np.arange(3.0), np.arange(4.0)

    def stacked(points: Array) -> Array:
        return np.array([np.diag([np.sin(np.pi * x) * np.sin(np.pi * y), 1.0]) for x, y in points])

    smallness, rank = [np.zeros((4, 3))] * 2, np.ones((4, 3), dtype=np.int64)
    found = singular_set(stacked, smallness, rank, 2, axes)
    assert not found.everywhere
    assert len(found.lines) == 7
    for line in found.lines:
        off = np.abs(line - np.round(line)).max(axis=0)
        assert off.min() < 1e-8
