"""The resolvers on random problems: against the twin's formulas, and the laws that their answers obey."""

from __future__ import annotations

import itertools
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
import twin
from conditioned import with_condition
from findings import refused
from numpy.typing import NDArray
from resolver_grid import every_resolver

from nmm.base.errors import InputError
from nmm.base.kinds import RESOLVERS
from nmm.control.resolvers import (
    Answer,
    CallableResolver,
    DampedLeastSquares,
    Dimensions,
    ExtendedJacobian,
    Problem,
    ProjectedGradient,
    ReducedGradient,
    Resolver,
    State,
    Status,
)

Array = NDArray[np.float64]

SHAPES = [(1, 1), (1, 4), (2, 2), (2, 4), (3, 3), (3, 4), (3, 5), (4, 7), (5, 6), (6, 6), (6, 8), (6, 12)]
each_shape = pytest.mark.parametrize("shape", SHAPES, ids=str)
redundant = pytest.mark.parametrize("shape", [(s, m) for s, m in SHAPES if s < m], ids=str)


class Example:
    """J, rate, h of a shape, and the added rows that make J_e square."""

    def __init__(self, shape: tuple[int, int], rng: np.random.Generator) -> None:
        self.s, self.m = shape
        self.J, self.rate, self.h = rng.normal(size=shape), rng.normal(size=self.s), rng.normal(size=self.m)
        self.added_J = rng.normal(size=(self.m - self.s, self.m))
        self.added_rate = rng.normal(size=self.m - self.s)

    def given(self, resolver: Resolver, state: State | None = None, **changed: Any) -> Answer:
        numbers = {"J": self.J, "rate": self.rate, "h": self.h}
        if resolver.takes_added_task:
            numbers |= {"added_J": self.added_J, "added_rate": self.added_rate}
        return resolver.resolve(Problem(**(numbers | changed)), state)

    def with_partition(self, resolver: ReducedGradient, **changed: Any) -> tuple[Answer, Array]:
        """The answer, and the columns of Ja."""
        state = resolver.start(Dimensions(self.s, 0, tuple(f"u{i}" for i in range(self.m))))
        return self.given(resolver, state, **changed), state.partition(self.s)


def every() -> tuple[Resolver, ...]:
    return tuple(every_resolver(alpha=3.0).values())


def exact() -> tuple[Resolver, ...]:
    """Those that declare that they do the task wherever J is regular, or say that they cannot."""
    return tuple(resolver for resolver in every() if resolver.exact)


def undamped() -> tuple[Resolver, ...]:
    """Those, and the one that does the task above its threshold; what it does below is in test_damping.py."""
    return *exact(), DampedLeastSquares(3.0)


#: Of nmm itself: their formulas obey more laws than a resolver has to.
OWN = (
    ReducedGradient(3.0),
    ProjectedGradient(3.0),
    ExtendedJacobian(),
    DampedLeastSquares(3.0),
)


def close(found: Array, expected: Array, tolerance: float = 1e-10) -> None:
    scale = np.abs(expected).max(initial=1.0)
    np.testing.assert_allclose(found, expected, rtol=0, atol=tolerance * scale)


@each_shape
def test_every_resolver_does_the_task(shape: tuple[int, int], rng: np.random.Generator) -> None:
    for _ in range(10):
        problem = Example(shape, rng)
        weighted = ProjectedGradient(3.0, weights=rng.uniform(0.1, 10, problem.m))
        for resolver in (*undamped(), weighted):
            found = problem.given(resolver)
            if isinstance(resolver, DampedLeastSquares) and found.measure < resolver.threshold:
                assert found.status is Status.RELAXED
                U, sigma, _ = np.linalg.svd(problem.J)
                missed = np.abs(U.T @ (problem.J @ found.u - problem.rate))
                assert np.all(missed[sigma >= resolver.threshold] < 1e-10)  # all but its weak directions
                continue
            assert found.status is Status.SOLVED
            assert not found.singular
            # How far J u can be from rate at all: the rounding of a product with a u of that size.
            tolerance = 1e-10 * max(1.0, float(np.abs(found.u).max()))
            np.testing.assert_allclose(problem.J @ found.u, problem.rate, rtol=0, atol=tolerance)
            true = np.linalg.norm(problem.J @ found.u - problem.rate)
            assert found.residual == pytest.approx(true, abs=tolerance * 1e-3)


@each_shape
def test_no_resolver_calls_solved_what_is_not(shape: tuple[int, int], rng: np.random.Generator) -> None:
    """The residual is ‖J u - rate‖, whatever a resolver guarantees, and decides the status."""
    for _ in range(10):
        problem = Example(shape, rng)
        lost = np.vstack([problem.J[:-1], np.zeros((1, problem.m))])
        for resolver, J in itertools.product(every(), (problem.J, 1e-3 * problem.J, lost)):
            found = problem.given(resolver, J=J)
            if not found.status.usable:
                assert np.all(np.isnan(found.u)), resolver.name
                continue
            true = np.linalg.norm(J @ found.u - problem.rate)
            assert found.residual == pytest.approx(true, rel=1e-9, abs=1e-12 * (1 + np.abs(found.u).max()))
            assert found.status is not Status.SOLVED or true <= 1e-9 * (1.0 + np.linalg.norm(problem.rate))
            assert np.all(found.nu <= 1.0)
            assert found.status is Status.RELAXED or np.all(found.nu == 1.0), resolver.name


def test_a_resolver_declares_its_guarantee() -> None:
    assert {name: kind.exact for name, kind in RESOLVERS.items() if kind in map(type, OWN)} == {
        "rg": True, "pg": True, "ej": True, "dls": False,
    }  # fmt: skip
    assert not CallableResolver.exact  # it cannot know

    class Renamed(ProjectedGradient):  # the same inputs
        name = "renamed"

    assert Renamed.exact
    kernel, damped = ProjectedGradient.kernel, {"kernel": DampedLeastSquares.kernel}
    for bases, own in (
        ((Resolver,), {"kernel": kernel, "setup": ProjectedGradient.setup}),
        ((Resolver,), {}),
        ((Resolver,), {"kernel": kernel, "exact": "yes"}),
        ((ProjectedGradient,), damped),  # what its base guarantees says nothing of it
        ((ProjectedGradient,), {"finish": CallableResolver.finish}),
    ):
        with refused("resolver class Mine") as error:
            type("Mine", bases, own)
        assert "exact: ClassVar[bool] = True, or = False" in str(error.value)
    assert not type("Mine", (ProjectedGradient,), damped | {"exact": False}).exact


@each_shape
def test_projected_gradient_is_the_papers(shape: tuple[int, int], rng: np.random.Generator) -> None:
    for _ in range(20):
        problem = Example(shape, rng)
        J, rate, h = problem.J, problem.rate, problem.h
        scale = np.linalg.cond(J)
        u = problem.given(ProjectedGradient(7.0)).u
        close(u, twin.projected_gradient(J, rate, h, np.eye(problem.m), 7.0), 1e-13 * scale)
        # What the task asks for is in J's row space; the rest does not move the task and descends H.
        task = problem.given(ProjectedGradient(7.0), h=np.zeros(problem.m)).u
        free = u - task
        close(J @ free, np.zeros(problem.s), 1e-13 * scale)
        close(np.linalg.lstsq(J.T, task, rcond=None)[0] @ J, task, 1e-13 * scale)
        assert h @ free <= 1e-12
        assert np.linalg.norm(task) <= np.linalg.norm(problem.given(ReducedGradient(7.0)).u) * (1 + 1e-12)


@each_shape
def test_weighted_projected_gradient_meets_the_kkt_conditions(
    shape: tuple[int, int], rng: np.random.Generator
) -> None:
    """u minimises (u - u0)' W (u - u0) / 2 under J u = rate, u0 = -alpha W^-1 h: a linear system says so."""
    problem = Example(shape, rng)
    J, s, m = problem.J, problem.s, problem.m
    root = rng.normal(size=(m, m))
    full = root @ root.T + 0.1 * np.eye(m)
    diagonal = rng.uniform(0.1, 10, m)
    names = [f"u{i}" for i in range(m)]
    by_name = dict(zip(names[:-1], diagonal, strict=False))  # the last has weight 1
    for weights, W in (
        ((full + full.T) / 2, (full + full.T) / 2),
        (diagonal, np.diag(diagonal)),
        (by_name, np.diag([*diagonal[:-1], 1.0])),
    ):
        resolver = ProjectedGradient(2.0, weights=weights)
        u = problem.given(resolver, inputs=names).u
        system = np.block([[W, J.T], [J, np.zeros((s, s))]])
        solution = np.linalg.solve(system, np.concatenate([-2.0 * problem.h, problem.rate]))
        close(u, solution[:m], 1e-13 * np.linalg.cond(system))
        free = problem.given(resolver, rate=np.zeros(s), inputs=names).u
        assert problem.h @ free <= 1e-12
    close(
        problem.given(ProjectedGradient(2.0, weights=5.0 * np.ones(m))).u,
        problem.given(ProjectedGradient(0.4)).u,
    )


def test_a_large_weight_spares_its_input(rng: np.random.Generator) -> None:
    problem = Example((2, 4), rng)
    names = ["v", "omega", "q1", "q2"]
    u = problem.given(ProjectedGradient(weights={"omega": 1e8}), inputs=names, h=np.zeros(4)).u
    assert abs(u[1]) < 1e-6 * np.linalg.norm(u)


@redundant
def test_reduced_gradient_is_the_papers_for_every_partition(
    shape: tuple[int, int], rng: np.random.Generator
) -> None:
    problem = Example(shape, rng)
    s, m = shape
    for basic in itertools.islice(itertools.combinations(range(m), s), 100):
        expected = twin.reduced_gradient(problem.J, problem.rate, problem.h, np.eye(m), basic, 5.0)
        condition = np.linalg.cond(problem.J[:, list(basic)])
        shuffled = list(rng.permutation(basic))
        for partition in (basic, shuffled, [f"u{i}" for i in basic]):
            found, columns = problem.with_partition(ReducedGradient(5.0, [partition], threshold=1e-300))
            close(found.u, expected, 1e-14 * condition**2)
            assert set(columns) == set(basic)
            determinant = np.linalg.det(problem.J[:, list(basic)])
            assert found.measure == pytest.approx(abs(determinant), rel=1e-12 * condition)


@redundant
def test_the_reduced_gradient_descends(shape: tuple[int, int], rng: np.random.Generator) -> None:
    """With rate = 0, H changes by h' u = -|ub|^2 / alpha (eq. 10)."""
    for _ in range(20):
        problem = Example(shape, rng)
        found, columns = problem.with_partition(ReducedGradient(5.0), rate=np.zeros(problem.s))
        free = np.delete(found.u, columns)
        assert problem.h @ found.u == pytest.approx(-(free @ free) / 5.0, rel=1e-10)


@pytest.mark.parametrize("shape", [(1, 2), (2, 3), (3, 4), (5, 6), (6, 7)], ids=str)
def test_rg_and_pg_are_parallel_with_one_degree_left(
    shape: tuple[int, int], rng: np.random.Generator
) -> None:
    """The self-motions have one direction, and RG's is longer, by the partition's measure squared."""
    for _ in range(20):
        problem = Example(shape, rng)
        rg = problem.given(ReducedGradient(5.0), rate=np.zeros(problem.s))
        pg = problem.given(ProjectedGradient(5.0), rate=np.zeros(problem.s))
        assert 0.0 < rg.measure <= 1.0
        close(rg.u * rg.measure**2, pg.u, 1e-11)


@each_shape
def test_extended_jacobian_is_numpys(shape: tuple[int, int], rng: np.random.Generator) -> None:
    for _ in range(20):
        problem = Example(shape, rng)
        found = problem.given(ExtendedJacobian())
        expected = twin.extended_jacobian(problem.J, problem.rate, problem.added_J, problem.added_rate)
        close(found.u, expected, 1e-13 * np.linalg.cond(np.vstack([problem.J, problem.added_J])))
        close(problem.added_J @ found.u, problem.added_rate)


@pytest.mark.parametrize("s", [1, 2, 4, 6])
def test_no_redundancy_left(s: int, rng: np.random.Generator) -> None:
    problem = Example((s, s), rng)
    for resolver in undamped():
        close(
            problem.given(resolver).u,
            np.linalg.solve(problem.J, problem.rate),
            1e-13 * np.linalg.cond(problem.J),
        )


@redundant
def test_near_a_singularity_the_answer_is_as_good_as_numpys(
    shape: tuple[int, int], rng: np.random.Generator
) -> None:
    """With cond J = 1e6, a solution through J J' would keep four digits; a stable one keeps ten."""
    for _ in range(10):
        problem = Example(shape, rng)
        problem.J = with_condition(shape, 1e6, rng)
        size = np.linalg.norm(problem.J, 2)
        for resolver in exact():
            found = problem.given(resolver)
            exactly = found.residual <= 1e-9 * (1.0 + np.linalg.norm(problem.rate))
            large = np.linalg.norm(found.u) > 1e5  # more than rounding lets certify
            assert found.status is Status.SOLVED if exactly and not large else found.status.usable
            assert found.residual <= 1e-13 * size * np.linalg.norm(found.u)
        expected = twin.projected_gradient(problem.J, problem.rate, problem.h, np.eye(problem.m), 3.0)
        close(problem.given(ProjectedGradient(3.0)).u, expected, 1e-9)


@pytest.mark.parametrize("shape", [(2, 2), (2, 4), (3, 5), (6, 8)], ids=str)
def test_what_is_singular_is_told_apart(shape: tuple[int, int], rng: np.random.Generator) -> None:
    s, m = shape
    problem = Example(shape, rng)
    first = list(range(s))
    more = ReducedGradient(partitions=[first]), ProjectedGradient(weights=np.ones(m))
    for J in (
        np.vstack([problem.J[:-1], problem.J[:1]]),
        np.vstack([problem.J[:-1], rng.normal(size=(1, s - 1)) @ problem.J[:-1]]),
        np.vstack([problem.J[:-1], np.zeros((1, m))]),
        np.zeros(shape),
    ):
        for resolver in every():
            assert problem.given(resolver, J=J).status is not Status.SOLVED, resolver.name
        for resolver in (*OWN[:3], *more):
            found = problem.given(resolver, J=J)
            assert found.status is Status.SINGULAR_J, resolver.name
            assert found.singular
            assert np.all(np.isnan(found.u))
            assert np.isnan(found.residual)
    if s == m:
        return
    J = problem.J.copy()
    J[:, 1] = 2.0 * J[:, 0]
    assert problem.given(ReducedGradient(partitions=[first]), J=J).status is Status.SINGULAR_JA
    assert problem.given(ReducedGradient(), J=J).status is Status.SOLVED
    assert problem.given(ProjectedGradient(), J=J).status is Status.SOLVED
    Jc = problem.added_J.copy()
    Jc[0] = problem.J[0] - problem.J[-1]
    assert problem.given(ExtendedJacobian(), added_J=Jc).status is Status.SINGULAR_JE
    assert problem.given(ExtendedJacobian(), added_J=0.0 * Jc).status is Status.SINGULAR_JE
    assert len({status.meaning for status in Status}) == len(Status)


@redundant
def test_invariances(shape: tuple[int, int], rng: np.random.Generator) -> None:
    problem = Example(shape, rng)
    s, m = shape
    J, rate, h = problem.J, problem.rate, problem.h
    mix = np.linalg.qr(rng.normal(size=(s, s)))[0] * rng.uniform(0.3, 3.0, s)
    order = rng.permutation(m)
    turn = np.linalg.qr(rng.normal(size=(m, m)))[0]
    D = np.diag(rng.uniform(0.3, 3.0, m))
    for resolver in OWN:
        u = problem.given(resolver).u
        # The task may be written in other variables, and the inputs be listed in another order.
        close(problem.given(resolver, J=mix @ J, rate=mix @ rate).u, u)
        changed = {"added_J": problem.added_J[:, order]} if resolver.takes_added_task else {}
        close(problem.given(resolver, J=J[:, order], h=h[order], **changed).u, u[order])
        # The answer is linear in what is asked.
        parts = problem.given(resolver, h=0.0 * h).u + problem.given(resolver, rate=0.0 * rate).u
        if not resolver.takes_added_task:
            close(parts, u)
    u = problem.given(ProjectedGradient(3.0)).u
    close(turn @ problem.given(ProjectedGradient(3.0), J=J @ turn, h=turn.T @ h).u, u)
    # Weights that follow the units take the units out.
    close(D @ problem.given(ProjectedGradient(3.0, weights=D @ D), J=J @ D, h=D @ h).u, u)
    close(problem.given(ReducedGradient(6.0), h=h / 2).u, problem.given(ReducedGradient(3.0)).u)


def test_resolvers_by_name() -> None:
    assert [*RESOLVERS][:4] == ["rg", "pg", "ej", "dls"]
    assert all(kind in RESOLVERS.values() for kind in map(type, OWN))
    assert all(kind.name == name for name, kind in RESOLVERS.items())
    assert RESOLVERS.words("ej") == "extended Jacobian"
    with refused(got="eg"):
        RESOLVERS.named("eg")


def test_callable_resolver(rng: np.random.Generator) -> None:
    problem = Example((2, 4), rng)

    def least(asked: Problem) -> Array:
        J, rate = np.asarray(asked.J), np.asarray(asked.rate)
        u: Array = J.T @ np.linalg.solve(J @ J.T, rate)
        for own in asked.arrays[:2]:  # its own copies
            own[:] = 0.0
        return u

    found = problem.given(CallableResolver(least))
    close(found.u, np.linalg.pinv(problem.J) @ problem.rate)
    assert found.status is Status.SOLVED
    assert found.residual < 1e-12
    assert problem.given(CallableResolver(least), J=np.zeros((2, 4))).status is Status.SINGULAR_J
    nowhere = CallableResolver(lambda problem: np.full(4, np.nan))
    assert problem.given(nowhere).status is Status.NOT_FINITE
    with refused("callable resolver", got=[0.0, 0.0, 0.0]):
        problem.given(CallableResolver(lambda problem: np.zeros(3)))


@redundant
def test_weighted_reduced_gradient_is_the_method_in_scaled_inputs(
    shape: tuple[int, int], rng: np.random.Generator
) -> None:
    """ũ = sqrt(w) u: the paper's reduced gradient on J diag(1/sqrt w), for every way to give the weights."""
    problem = Example(shape, rng)
    s, m = shape
    w = rng.uniform(0.1, 10, m)
    C = np.diag(1 / np.sqrt(w))
    names = [f"u{i}" for i in range(m)]
    for choice in ({}, {"partitions": [tuple(range(s))]}):
        changed = {"J": problem.J @ C, "h": C @ problem.h}
        plain, columns = problem.with_partition(ReducedGradient(2.0, **choice), **changed)
        for weights in (w, np.diag(w), dict(zip(names, w, strict=True))):
            weighted = ReducedGradient(2.0, weights=weights, **choice)
            found, chosen = problem.with_partition(weighted, inputs=names)
            close(found.u, C @ plain.u)
            np.testing.assert_array_equal(chosen, columns)
            close(problem.J @ found.u, problem.rate)
        # Without a rate, weights or not, the objective does not grow.
        free = problem.given(ReducedGradient(2.0, weights=w, **choice), rate=np.zeros(s)).u
        assert problem.h @ free <= 1e-12
    ones = problem.given(ReducedGradient(3.0, weights=np.ones(m)))
    close(ones.u, problem.given(ReducedGradient(3.0)).u)


@pytest.mark.parametrize("kind", [ProjectedGradient, ReducedGradient])
def test_weights_spare_a_group(kind: type[Resolver], rng: np.random.Generator) -> None:
    """The heavier the platform, the less of the motion it does; a name within the group has the last word."""
    groups = {"platform": ("v", "omega"), "arm": ("q1", "q2", "q3")}
    problem = Example((2, 5), rng)
    named = {"inputs": ("v", "omega", "q1", "q2", "q3"), "groups": groups, "h": np.zeros(5)}

    def u(**weights: float) -> Array:
        found = problem.given(kind(1.0, weights=weights), **named).u
        close(problem.J @ found, problem.rate)
        return found

    assert np.linalg.norm(u(platform=1e8)[:2]) < 1e-6
    assert np.linalg.norm(u(arm=1e8)[2:]) < 1e-6
    spared = u(arm=1e8, q1=1e-8)
    assert np.linalg.norm(spared[3:]) < 1e-6 * abs(spared[2])
    with pytest.raises(InputError, match=r"unknown input or group 'base'.*q3, platform, arm"):
        u(base=2.0)


def test_weights_that_couple_inputs_are_for_pg(rng: np.random.Generator) -> None:
    problem = Example((2, 4), rng)
    with refused("weights"):
        problem.given(ReducedGradient(weights=np.eye(4) + 0.1))


def exact_miss(problem: Problem, u: Array) -> Fraction:
    """The largest |J u - rate| without rounding, and without overflow."""
    rows = zip(np.asarray(problem.J).tolist(), np.asarray(problem.rate).tolist(), strict=True)
    return max(
        abs(sum(map(Fraction.__mul__, map(Fraction, row), map(Fraction, u.tolist()))) - Fraction(asked))
        for row, asked in rows
    )


@pytest.mark.parametrize("limited", ["not", "inputs", "rows"])
@pytest.mark.parametrize("size", [1e-300, 1e-160, 1e150, 1e160, 1e307])
def test_numbers_whose_squares_overflow_are_not_called_solved(limited: str, size: float) -> None:
    """Nor where squares underflow: then more normals than inputs seemed independent, and memory was lost."""
    rng, s, m = np.random.default_rng(3), 2, 4
    bounds: dict[str, Any] = {"inputs": {"u_lower": -np.ones(m), "u_upper": np.ones(m)}}.get(limited, {})
    if limited == "rows":
        bounds = {"limit_rows": rng.normal(size=(2, m)), "lower": -np.ones(2), "upper": np.ones(2)}
    given = [["u0", "u1"], ["u1", "u2"], ["u2", "u3"]]
    damped = ReducedGradient(singular="damped")
    for _ in range(20):
        J = rng.normal(size=(s, m))
        J[rng.random((s, m)) < rng.choice([0.3, 1.0])] *= size
        rate = 3.6 * rng.normal(size=s) * rng.choice([1.0, 1e-160, 1e160])
        levels = [[s], [1, s - 1]][rng.integers(2)]
        for resolver in (*every(), ReducedGradient(partitions=given), damped):
            added = {"added_J": rng.normal(size=(m - s, m)), "added_rate": rng.normal(size=m - s)}
            also = added if resolver.takes_added_task else {}
            problem = Problem(J=J, rate=rate, h=rng.normal(size=m), levels=levels, **bounds, **also)
            answer = resolver.resolve(problem)
            if answer.status is Status.SOLVED:
                assert exact_miss(problem, answer.u) < 1e-7 * (1.0 + np.abs(rate).max())
