"""Levels whose rows limits cut one by one: the nearest inputs, by the conditions of Karush, Kuhn, Tucker."""

import numpy as np
import pytest
from scipy.optimize import nnls

import nmm


def expect_nearest(u, wanted, A, lower, upper):
    """u is the point nearest to `wanted` with lower <= A u <= upper: it is one, and what is left is
    a sum of normals of bounds that are met, pointing outwards, by non-negative least squares."""
    values = A @ u
    assert np.all(values >= lower - 1e-9)
    assert np.all(values <= upper + 1e-9)
    outwards = np.vstack([A[values > upper - 1e-9], -A[values < lower + 1e-9], np.zeros((1, len(u)))])
    _, left = nnls(outwards.T, wanted - u)
    assert left < 1e-8


@pytest.mark.parametrize("seed", range(20))
def test_each_row_does_what_it_can(seed):
    rng = np.random.default_rng(seed)
    m = 5
    J = np.eye(m) + 0.1 * rng.standard_normal((m, m))
    rate, rows = 2.0 * rng.standard_normal(m), rng.standard_normal((2, m))
    limits = {"u_lower": -rng.uniform(0.2, 1.0, m), "u_upper": rng.uniform(0.2, 1.0, m)}
    lower, upper = -rng.uniform(0.1, 0.5, 2), rng.uniform(0.1, 0.5, 2)
    problem = nmm.Problem(
        J, rate, np.zeros(m), limit_rows=rows, lower=lower, upper=upper, separate=[True], **limits
    )
    answer = nmm.ProjectedGradient().resolve(problem)
    wanted = np.linalg.solve(J, rate)
    ends = np.append(limits["u_lower"], lower), np.append(limits["u_upper"], upper)
    expect_nearest(answer.u, wanted, np.vstack([np.eye(m), rows]), *ends)
    assert 0.0 <= answer.nu[0] < 1.0


def test_one_row_that_is_held_does_not_hold_the_others():
    problem = {"J": np.eye(3), "rate": [1.0, 0.5, -0.4], "h": np.zeros(3), "u_upper": [1.0, 0.0, 1.0]}
    solved = nmm.ProjectedGradient().resolve
    np.testing.assert_allclose(solved(nmm.Problem(**problem)).u, 0.0, atol=1e-12)
    np.testing.assert_allclose(
        solved(nmm.Problem(**problem, separate=[True])).u, [1.0, 0.0, -0.4], atol=1e-12
    )


@pytest.mark.parametrize("seed", range(5))
def test_a_level_above_keeps_its_rate(seed):
    rng = np.random.default_rng(seed)
    m = 5
    above, rate = rng.standard_normal((1, m)), [0.2]
    J, rates = np.vstack([above, np.eye(m)[:4]]), np.append(rate, rng.standard_normal(4))
    bounds = {"u_lower": np.full(m, -0.5), "u_upper": np.full(m, 0.5)}
    problem = nmm.Problem(J, rates, np.zeros(m), levels=[1, 4], separate=[False, True], **bounds)
    answer = nmm.ProjectedGradient().resolve(problem)
    np.testing.assert_allclose(above @ answer.u, rate, atol=1e-9)
    free = nmm.ProjectedGradient().resolve(nmm.Problem(J, rates, np.zeros(m), levels=[1, 4]))
    expect_nearest(
        answer.u,
        free.u,
        np.vstack([np.eye(m), above]),
        np.append(bounds["u_lower"], rate),
        np.append(bounds["u_upper"], rate),
    )


def test_within_the_limits_nothing_changes():
    rng = np.random.default_rng(3)
    J, rate, h = rng.standard_normal((3, 5)), rng.standard_normal(3), rng.standard_normal(5)
    limits = {"u_lower": np.full(5, -100.0), "u_upper": np.full(5, 100.0)}
    one, other = (
        nmm.ProjectedGradient().resolve(nmm.Problem(J, rate, h, separate=separate, **limits))
        for separate in ([False], [True])
    )
    np.testing.assert_array_equal(one.u, other.u)


def test_a_level_says_whether_its_rows_are_separate():
    with pytest.raises(nmm.InputError, match="separate"):
        nmm.Problem(np.eye(2), [1.0, 1.0], [0.0, 0.0], separate=[True, False])
