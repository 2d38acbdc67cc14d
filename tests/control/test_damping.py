"""Damped least squares on random problems, near and at singularities: against numpy, and its laws."""

from __future__ import annotations

import itertools
import math
from typing import Any, get_args

import numpy as np
import pytest
from conditioned import Array, each_shape, with_condition, with_singular_values
from findings import refused

from nmm.base.kernels.linear_algebra import singular_rows
from nmm.control.resolvers import (
    DampedLeastSquares,
    ExtendedJacobian,
    Problem,
    ProjectedGradient,
    ReducedGradient,
    Status,
)
from nmm.control.resolvers.damped_least_squares import Damping

LAWS = get_args(Damping)
each_law = pytest.mark.parametrize("law", LAWS)


def random_values(s: int, rng: np.random.Generator) -> Array:
    """Some large, some small, some 0, now and then equal ones."""
    values = 10.0 ** rng.uniform(-4, 0.5, s)
    values[rng.random(s) < 0.2] = 0.0
    return np.full(s, values[0]) if rng.random() < 0.2 else values


def damping_squared(law: str, sigma: Array, damping: float, threshold: float) -> Array:
    if law == "constant":
        return np.full_like(sigma, damping**2)
    seen = np.full_like(sigma, sigma.min()) if law == "variable" else sigma
    return damping**2 * np.maximum(0.0, 1.0 - (seen / threshold) ** 2)


@each_shape
def test_singular_rows_are_a_singular_value_decomposition(
    shape: tuple[int, int], rng: np.random.Generator
) -> None:
    s, m = shape
    for _ in range(30):
        J = with_singular_values(random_values(s, rng), m, rng)
        A, R = J.copy(), np.zeros((s, s))
        least, largest = singular_rows(A, R)
        expected = np.linalg.svd(J, compute_uv=False)
        size = max(1.0, expected[0])
        np.testing.assert_allclose(R @ R.T, np.eye(s), rtol=0, atol=1e-14)
        np.testing.assert_allclose(R @ J, A, rtol=0, atol=1e-14 * size)
        np.testing.assert_allclose(A @ A.T, np.diag(np.diag(A @ A.T)), rtol=0, atol=1e-14 * size**2)
        sigma = np.sort(np.linalg.norm(A, axis=1))[::-1]
        np.testing.assert_allclose(sigma, expected, rtol=0, atol=1e-14 * size)
        assert (least, largest) == (pytest.approx(sigma[-1]), pytest.approx(sigma[0]))


@each_law
@each_shape
def test_the_answer_is_the_least_squares_one(
    shape: tuple[int, int], law: Any, rng: np.random.Generator
) -> None:
    """‖A u - b‖² + Σ λ_i² (v_iᵀ u)², stacked and given to numpy; rows in scales, inputs in weights.

    And u0 in the null space, of which a direction is a part as far as its σ is below the threshold.
    """
    s, m = shape
    damping, threshold = 0.4, 0.6
    for weighted in (False, True):
        for _ in range(10):
            scales, root = rng.uniform(0.5, 2.0, s), rng.normal(size=(m, m))
            W = root @ root.T + 0.1 * np.eye(m) if weighted else np.eye(m)
            W = (W + W.T) / 2
            C = np.linalg.inv(np.linalg.cholesky(W)).T
            J = np.diag(scales) @ with_singular_values(random_values(s, rng), m, rng) @ np.linalg.inv(C)
            rate, h = rng.normal(size=s), rng.normal(size=m)
            resolver = DampedLeastSquares(3.0, law, damping, threshold, W if weighted else None)
            found = resolver.resolve(Problem(J, rate, h, row_scales=scales))
            A, b, u0 = J / scales[:, np.newaxis] @ C, rate / scales, -3.0 * C.T @ h
            U, sigma, Vt = np.linalg.svd(A, full_matrices=False)
            squared = damping_squared(law, sigma, damping, threshold)
            stacked = np.vstack([A, np.diag(np.sqrt(squared)) @ Vt])
            task = np.linalg.lstsq(stacked, np.concatenate([b, np.zeros(s)]), rcond=None)[0]
            lost = np.maximum(0.0, 1.0 - (sigma / threshold) ** 2) ** 2
            u = C @ (task + u0 - Vt.T @ ((1.0 - lost) * (Vt @ u0)))
            np.testing.assert_allclose(found.u, u, rtol=0, atol=1e-9 * max(1.0, np.abs(u).max()))
            assert found.measure == pytest.approx(sigma[-1], abs=1e-13 * max(1.0, sigma[0]))
            assert found.residual == pytest.approx(np.linalg.norm(J @ found.u - rate), abs=1e-12)
            if found.status is Status.RELAXED:
                share = sigma**2 / (sigma**2 + squared)
                assert found.nu[0] == pytest.approx(share @ (U.T @ b) ** 2 / (b @ b), abs=1e-12)
            else:
                assert found.status is Status.SOLVED
                assert found.nu[0] == 1.0


@pytest.mark.parametrize("law", ["variable", "directions"])
@each_shape
def test_undamped_it_is_the_projected_gradient(
    shape: tuple[int, int], law: Any, rng: np.random.Generator
) -> None:
    s, m = shape
    for _ in range(10):
        J = with_singular_values(rng.uniform(0.051, 2.0, s), m, rng)
        problem = Problem(J, rng.normal(size=s), rng.normal(size=m))
        for weights in (None, rng.uniform(1.0, 3.0, m)):
            if weights is not None:
                problem = Problem(J @ np.diag(np.sqrt(weights)), problem.rate, problem.h)
            found = DampedLeastSquares(3.0, law, weights=weights).resolve(problem)
            expected = ProjectedGradient(3.0, weights=weights).resolve(problem)
            assert (found.status, found.nu[0]) == (Status.SOLVED, 1.0)
            size = max(1.0, np.abs(expected.u).max())
            np.testing.assert_allclose(found.u, expected.u, rtol=0, atol=1e-12 * size)


@each_law
@each_shape
def test_inputs_stay_bounded(shape: tuple[int, int], law: Any, rng: np.random.Generator) -> None:
    """Without an objective ‖u‖ <= ‖b‖ / (2 λ) for constant damping, and ‖b‖ / ε for λ = ε / √2.

    What is given of the rate is its scale: b · A u = scale ‖b‖², between 0 and 1.
    """
    s, m = shape
    threshold = 0.3
    damping = threshold / math.sqrt(2.0)
    most = 1.0 / (2.0 * damping) if law == "constant" else 1.0 / threshold
    tightest = 0.0
    for _ in range(50):
        scales = rng.uniform(0.5, 2.0, s)
        J = np.diag(scales) @ with_singular_values(random_values(s, rng), m, rng)
        rate = rng.normal(size=s)
        found = DampedLeastSquares(3.0, law, damping, threshold).resolve(
            Problem(J, rate, np.zeros(m), row_scales=scales)
        )
        b = rate / scales
        tightest = max(tightest, np.linalg.norm(found.u) / np.linalg.norm(b))
        given = b @ (J @ found.u / scales) / (b @ b)
        assert 0.0 <= given <= 1.0 + 1e-12
        assert found.nu[0] == pytest.approx(given, abs=1e-9)
    assert tightest <= most * (1.0 + 1e-12)
    assert tightest > 0.2 * most  # the bound is not far off


def test_only_singular_directions_are_damped(rng: np.random.Generator) -> None:
    """The rest of the rate is done to rounding, which neither of the other laws does."""
    for _ in range(20):
        values = np.array([1.0, 0.5, 0.2, 1e-3])
        J = with_singular_values(values, 6, rng)
        problem = Problem(J, rng.normal(size=4), rng.normal(size=6))
        U = np.linalg.svd(J)[0]
        for law in LAWS:
            found = DampedLeastSquares(3.0, law).resolve(problem)
            assert found.status is Status.RELAXED
            left = np.abs(U.T @ (J @ found.u - problem.rate))
            assert left[3] > 1e-6
            assert (left[:3].max() < 1e-12) == (law == "directions")


@each_law
@each_shape
def test_a_lost_rank_stops_nothing(shape: tuple[int, int], law: Any, rng: np.random.Generator) -> None:
    s, m = shape
    J = rng.normal(size=shape)
    for singular in (0.0 * J, np.vstack([J[:-1], 0.0 * J[:1]]), np.vstack([J[:-1], J[:1]])):
        if s == 1 and np.any(singular):
            continue
        rate = rng.normal(size=s)
        found = DampedLeastSquares(3.0, law).resolve(Problem(singular, rate, np.zeros(m)))
        assert found.status is Status.RELAXED
        assert np.all(np.isfinite(found.u))
        rest = DampedLeastSquares(3.0, law).resolve(Problem(singular, np.zeros(s), np.zeros(m)))
        assert (rest.status, np.abs(rest.u).max()) == (Status.SOLVED, 0.0)
    nothing = DampedLeastSquares(3.0, law).resolve(Problem(0.0 * J, rate, np.ones(m)))
    np.testing.assert_allclose(nothing.u, -3.0, rtol=1e-15)  # all of the inputs are the objective's
    assert nothing.nu[0] == 0.0


def through(J: Array, other: Array, count: int) -> list[Array]:
    return [(1.0 - a) * J + a * other for a in np.linspace(0.0, 1.0, count)]


RESOLVERS: dict[str, Any] = {
    **{law: DampedLeastSquares(3.0, law) for law in LAWS},
    "rg": ReducedGradient(3.0, [("u0", "u1")], singular="damped", threshold=1e-300),
}


@pytest.mark.parametrize("name", RESOLVERS)
def test_u_is_continuous_through_singularities(name: str, rng: np.random.Generator) -> None:
    """On the way from J to a J whose least singular direction is turned round, through rank s - 1.

    With half the step the largest jump halves: nothing is discontinuous. The reduced gradient has one
    partition here, so that no switch of its own is among the jumps.
    """
    # Beside its singular block the reduced gradient's inputs change over shorter ways.
    counts = (2001, 4001) if name == "rg" else (501, 1001)
    for _ in range(1 if name == "rg" else 2):
        U = np.linalg.qr(rng.normal(size=(2, 2)))[0]
        V = np.linalg.qr(rng.normal(size=(2, 2)))[0] if name == "rg" else np.eye(4)[:, :2]
        first, last = (U * [1.0, value] @ V.T for value in (0.3, -0.3))
        if name == "rg":  # two inputs more, which the partition never takes
            more = rng.normal(size=(1, 2))
            first, last = (np.hstack([J, U[:, :1] @ more]) for J in (first, last))
        rate, h = rng.normal(size=2), rng.normal(size=4)
        jumps, largest = [], 0.0
        for count in counts:
            state = RESOLVERS[name].start(Problem(first, rate, h).dimensions)
            u = [RESOLVERS[name].resolve(Problem(J, rate, h), state).u for J in through(first, last, count)]
            jumps.append(np.linalg.norm(np.diff(u, axis=0), axis=1).max())
            largest = np.linalg.norm(u, axis=1).max()
        assert np.all(np.isfinite(jumps))
        for longer, shorter in itertools.pairwise(jumps):
            assert shorter < 0.55 * longer
        if name == "rg":
            undamped = ReducedGradient(3.0, [("u0", "u1")], threshold=1e-300)
            apart = [undamped.resolve(Problem(J, rate, h)).u for J in through(first, last, 500)]
            assert largest < 0.2 * np.linalg.norm(apart, axis=1).max()


@each_law
@each_shape
def test_the_objective_stays_out_of_a_regular_task(
    shape: tuple[int, int], law: Any, rng: np.random.Generator
) -> None:
    """However the rate is damped, J u is the same with every gradient; what is left of it descends H."""
    s, m = shape
    for dt in (math.nan, 0.1):
        for weights in (None, rng.uniform(1.0, 3.0, m)):
            J = with_singular_values(rng.uniform(0.05, 1.0, s), m, rng)
            root = np.ones(m) if weights is None else np.sqrt(weights)
            resolver = DampedLeastSquares(3.0, law, weights=weights)
            given = {"J": J * root, "rate": 3.0 * rng.normal(size=s), "dt": dt}
            h = rng.normal(size=m)
            without, found = (resolver.resolve(Problem(h=gradient, **given)) for gradient in (0.0 * h, h))
            moved = found.u - without.u
            np.testing.assert_allclose(given["J"] @ moved, 0.0, atol=1e-12)
            assert found.residual == pytest.approx(without.residual, abs=1e-12)
            assert h @ moved <= 1e-12
            assert without.status is Status.RELAXED or (law != "constant" and found.residual < 1e-12)


@each_law
def test_the_objective_moves_a_lost_direction_and_little_of_the_task(
    law: Any, rng: np.random.Generator
) -> None:
    """What it does to the task is at most 0.8² / √5 ε ‖u0‖, and nothing at σ = 0 and from σ = ε on."""
    most = 0.0
    for sigma in (0.0, *np.linspace(0.001, 0.06, 60)):
        J = np.array([[1.0, 0.0, 0.0], [0.0, sigma, 0.0]])
        found = DampedLeastSquares(1.0, law).resolve(Problem(J, np.zeros(2), -np.ones(3)))
        felt = np.abs(J @ found.u)
        assert felt[0] < 1e-15
        assert found.u[2] == 1.0
        assert (felt[1] > 1e-6) == (0.0 < sigma < 0.05)
        assert found.u[1] == (
            1.0 if sigma == 0.0 else pytest.approx(max(0.0, 1.0 - (sigma / 0.05) ** 2) ** 2)
        )
        most = max(most, felt[1])
    assert most == pytest.approx(0.64 / math.sqrt(5.0) * 0.05, rel=1e-2)


def damping_of_a_step(sigma: Array, asked: Array, dt: float) -> tuple[float, float]:
    """λ and ε for b = Σ u_i asked_i: β counts directions that a step could carry through 0."""
    size = np.linalg.norm(asked)
    for _ in range(2):
        size = (
            math.sqrt(np.maximum(0.0, 1.0 - sigma**2 / (2.0 * size * dt)) @ asked**2) if size > 0.0 else 0.0
        )
    return max(0.05 / math.sqrt(2.0), math.sqrt(size * dt)), max(0.05, math.sqrt(2.0 * size * dt))


def test_a_known_step_raises_the_damping(rng: np.random.Generator) -> None:
    """The answer of the resolver with these numbers; none where only regular directions are asked for."""
    raised = 0
    for _ in range(40):
        J = with_singular_values(np.array([1.0, 10.0 ** rng.uniform(-2.0, -0.5)]), 4, rng)
        rate = rng.normal(size=2)
        U, sigma, _ = np.linalg.svd(J)
        found = DampedLeastSquares().resolve(Problem(J, rate, np.zeros(4), dt=0.02))
        damping, threshold = damping_of_a_step(sigma, U.T @ rate, 0.02)
        expected = DampedLeastSquares(damping=damping, threshold=threshold)
        np.testing.assert_allclose(found.u, expected.resolve(Problem(J, rate, np.zeros(4))).u, rtol=1e-10)
        raised += threshold > 0.05
        regular = Problem(J, 5.0 * U[:, 0], np.zeros(4), dt=0.02)
        unraised = DampedLeastSquares().resolve(Problem(J, 5.0 * U[:, 0], np.zeros(4)))
        np.testing.assert_allclose(DampedLeastSquares().resolve(regular).u, unraised.u, rtol=0, atol=1e-10)
    assert 5 < raised < 40


def test_limits_are_kept_beside_a_singularity(rng: np.random.Generator) -> None:
    for resolver in (*RESOLVERS.values(), ReducedGradient(3.0, singular="damped", weights=[1, 2, 3, 4])):
        for _ in range(30):
            J = with_singular_values(np.array([1.0, 10.0 ** rng.uniform(-6, -0.5)]), 4, rng)
            problem = {"J": J, "rate": 3.0 * rng.normal(size=2), "h": 0.1 * rng.normal(size=4)}
            free = resolver.resolve(Problem(**problem))
            most = 0.5 * np.abs(free.u).max()
            held = resolver.resolve(Problem(**problem, u_lower=np.full(4, -most), u_upper=np.full(4, most)))
            assert np.abs(held.u).max() <= most
            assert held.status is Status.RELAXED or held.residual < 1e-9
            assert held.nu[0] <= free.nu[0] + 1e-12
            # What is left of the task's motion is in the direction of the unlimited answer's.
            wanted, given = J @ free.u, J @ held.u
            np.testing.assert_allclose(given * (wanted @ wanted), wanted * (wanted @ given), atol=1e-8)


def test_reduced_gradient_stays_itself_where_its_block_is_regular(rng: np.random.Generator) -> None:
    for _ in range(50):
        problem = Problem(with_condition((3, 6), 3.0, rng), rng.normal(size=3), rng.normal(size=6))
        damped = ReducedGradient(3.0, singular="damped").resolve(problem)
        plain = ReducedGradient(3.0).resolve(problem)
        np.testing.assert_array_equal(damped.u, plain.u)
        assert damped.status is plain.status is Status.SOLVED


def test_reduced_gradient_does_the_task_where_only_its_block_is_singular(rng: np.random.Generator) -> None:
    """Ja is singular though J is not: the damped answer damps nothing, it is the projected gradient's."""
    J = with_singular_values(np.array([1.0, 0.8]), 4, rng)
    J[:, 1] = 2.0 * J[:, 0]
    problem = Problem(J, rng.normal(size=2), rng.normal(size=4))
    found = ReducedGradient(3.0, [(0, 1)], singular="damped").resolve(problem)
    assert ReducedGradient(3.0, [(0, 1)]).resolve(problem).status is Status.SINGULAR_JA
    assert found.status is Status.SOLVED
    np.testing.assert_allclose(found.u, ProjectedGradient(3.0).resolve(problem).u, rtol=0, atol=1e-12)


@pytest.mark.parametrize("sigma", [0.2, 0.04, 1e-3, 1e-9, 0.0])
def test_the_extended_jacobian_damps_its_added_task_alone(sigma: float, rng: np.random.Generator) -> None:
    """Rows of J_added that the null space of J moves by σ only; the task is done to rounding all the same."""
    for _ in range(20):
        J = with_singular_values(np.array([1.0, 0.7]), 5, rng)
        free = np.linalg.svd(J)[2][2:]
        inside = with_singular_values(np.array([1.0, 0.5, sigma]), 3, rng)
        added = inside @ free + rng.normal(size=(3, 2)) @ J
        given = {"added_J": added, "added_rate": rng.normal(size=3)}
        problem = Problem(J, rng.normal(size=2), np.zeros(5), **given)
        found = ExtendedJacobian(singular="damped").resolve(problem)
        plain = ExtendedJacobian().resolve(problem)
        assert np.linalg.norm(J @ found.u - problem.rate) < 1e-11
        if sigma > 0.05:
            assert found.status is plain.status is Status.SOLVED
            np.testing.assert_array_equal(found.u, plain.u)
            continue
        assert found.status is Status.RELAXED
        assert plain.status.usable if sigma > 0.0 else plain.status is Status.SINGULAR_JE
        assert np.linalg.norm(found.u) < 60.0 * np.linalg.norm([*problem.rate, *given["added_rate"]])
        left = np.linalg.svd(inside)[0].T @ (added @ found.u - given["added_rate"])
        np.testing.assert_allclose(left[:2], 0.0, atol=1e-10)


def test_kinematic_singularities_of_the_extended_jacobian_are_told_apart(rng: np.random.Generator) -> None:
    """J itself lost rank, with a J_e that lost it too: not the added task's fault, damped or not."""
    J = with_singular_values(np.array([1.0, 0.0]), 4, rng)
    given = {"added_J": rng.normal(size=(2, 4)), "added_rate": rng.normal(size=2)}
    for resolver in (ExtendedJacobian(), ExtendedJacobian(singular="damped")):
        assert resolver.resolve(Problem(J, [1.0, 2.0], np.zeros(4), **given)).status is Status.SINGULAR_J


@pytest.mark.parametrize(
    ("make", "fields"),
    [
        (lambda: DampedLeastSquares(law="chiaverini"), {"got": "chiaverini"}),
        (lambda: DampedLeastSquares(damping=0.0), {"where": "damping", "got": 0.0}),
        (lambda: DampedLeastSquares(threshold=-1.0), {"where": "threshold", "got": -1.0}),
        (lambda: ReducedGradient(singular="ignored"), {"got": "ignored"}),
        (lambda: ExtendedJacobian(singular="ignored"), {"got": "ignored"}),
    ],
)
def test_bad_input(make: Any, fields: dict[str, Any]) -> None:
    with refused(**fields):
        make()
