"""Which columns the reduced gradient inverts, and when it changes them; what resolvers refuse."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import twin
from conditioned import Array, each_shape
from findings import refused

from nmm.control.resolvers import (
    Answer,
    Dimensions,
    ExtendedJacobian,
    Problem,
    ProjectedGradient,
    ReducedGradient,
    Status,
)
from nmm.control.resolvers.partitions import COLUMNS, HELD, MODE, OVERDUE, PartitionState, search_partition


def measures(J: Array) -> dict[tuple[int, ...], float]:
    """|det Ja| / sqrt(det J Jᵀ) of all partitions, by numpy."""
    s, m = J.shape
    volume = np.prod(np.linalg.svd(J, compute_uv=False))
    every = itertools.combinations(range(m), s)
    return {basic: abs(np.linalg.det(J[:, list(basic)])) / volume for basic in every}


@each_shape
def test_measures_lie_between_0_and_1_and_their_squares_add_up_to_1(
    shape: tuple[int, int], rng: np.random.Generator
) -> None:
    s = shape[0]
    J, rg = rng.normal(size=shape), ReducedGradient()
    total = 0.0
    for basic, expected in measures(J).items():
        state = PartitionState(s)
        state.memory[COLUMNS:] = basic
        with state.held():
            found, _ = resolved_with(rg, J, state)
            below = found.measure < rg.threshold
            assert state.memory[MODE] == (OVERDUE if below else HELD)
        assert state.may_stand(state.memory.copy()) == (not below)
        assert basic_columns(state) == basic
        assert 0.0 <= found.measure <= 1.0 + 1e-12
        assert found.measure == pytest.approx(expected, rel=1e-9, abs=1e-12)
        total += found.measure**2
    assert total == pytest.approx(1.0, rel=1e-12)


def test_many_candidates_are_searched(rng: np.random.Generator) -> None:
    """18 inputs and 6 rows, 20 and 10: no exchange of one column makes |det Ja| larger, and J u = rate."""
    shares = []
    for s, m in [(6, 18), (6, 20), (10, 20)]:
        for _ in range(20):
            J = rng.normal(size=(s, m))
            state = PartitionState(s, automatic=True)
            answer, _ = resolved_with(ReducedGradient(), J, state)
            basic = basic_columns(state)
            Ja = J[:, list(basic)]
            assert np.abs(np.linalg.solve(Ja, J)).max() <= 1.0 + 1e-8
            assert answer.measure == pytest.approx(
                abs(np.linalg.det(Ja)) / np.prod(np.linalg.svd(J, compute_uv=False)), rel=1e-9
            )
            assert answer.residual < 1e-9
            if (s, m) == (6, 18):
                shares.append(answer.measure / max(measures(J).values()) if len(shares) < 3 else 1.0)
    assert min(shares) > 0.5


def test_a_search_finds_the_columns_of_a_rank_that_is_lost(rng: np.random.Generator) -> None:
    """Where J has lost rank, or a column is 0, columns differ and are within J."""
    for rank in range(6):
        J = rng.normal(size=(6, rank)) @ rng.normal(size=(rank, 18))
        J[:, 3] = 0.0
        columns = np.full(6, -1)
        search_partition(J, columns)
        assert len(set(columns.tolist())) == 6
        assert columns.min() >= 0
        assert np.linalg.matrix_rank(J[:, columns]) == np.linalg.matrix_rank(J) == rank


def test_few_candidates_are_tried_as_before() -> None:
    """13 inputs and 6 rows: 1,716 candidates, all in the options."""
    names = tuple(map(str, range(13)))
    setup = ReducedGradient().setup(Dimensions(6, 0, names))
    assert len(setup.options) == 2 + 6 * 1716
    assert len(ReducedGradient().setup(Dimensions(6, 0, (*names, "13"))).options) == 2


@each_shape
def test_the_first_partition_is_the_best(shape: tuple[int, int], rng: np.random.Generator) -> None:
    s = shape[0]
    for _ in range(20):
        J = rng.normal(size=shape)
        every = measures(J)
        best = max(every, key=lambda basic: every[basic])
        found, state = resolved_with(ReducedGradient(), J)
        assert basic_columns(state) == best
        # The largest of C(m, s) numbers whose squares add up to 1.
        assert found.measure >= len(every) ** -0.5 - 1e-12
        # Neither the task's units nor its variables decide.
        mixed, state = resolved_with(ReducedGradient(), rng.normal(size=(s, s)) @ J)
        assert basic_columns(state) == best
        assert mixed.measure == pytest.approx(found.measure, rel=1e-8)


def resolved_with(
    rg: ReducedGradient, J: Array, state: PartitionState | None = None, **given: Any
) -> tuple[Answer, PartitionState]:
    """The answer for a rate and a gradient of zeros, and the state after it."""
    s, m = np.shape(J)
    problem = Problem(**({"J": J, "rate": np.zeros(s), "h": np.zeros(m)} | given))
    state = rg.start(problem.dimensions) if state is None else state
    return rg.resolve(problem, state), state


def basic_columns(state: PartitionState) -> tuple[int, ...]:
    return tuple(state.memory[COLUMNS:].tolist())


def walk(rng: np.random.Generator, count: int, shape: tuple[int, int]) -> list[Array]:
    """Jacobians that change slowly and come far."""
    a, b, c = (rng.normal(size=shape) for _ in range(3))
    return [a * np.cos(k / 40) + b * np.sin(k / 29) + c * np.sin(k / 17) for k in range(count)]


@pytest.mark.parametrize(
    ("shape", "threshold"), [((1, 3), 0.2), ((2, 4), 0.02), ((2, 4), 0.5), ((3, 5), 0.2)], ids=str
)
def test_automatic_partitions_are_kept_until_below_the_threshold(
    shape: tuple[int, int], threshold: float, rng: np.random.Generator
) -> None:
    s, m = shape
    rg = ReducedGradient(threshold=threshold)
    state, kept, switches = None, None, 0
    for J in walk(rng, 600, shape):
        every = measures(J)
        best = max(every, key=lambda basic: every[basic])
        if kept is None:
            kept = best
        elif every[kept] < threshold:
            switches += kept != best
            kept = best
        found, state = resolved_with(rg, J, state, rate=np.ones(s), h=np.ones(m))
        assert basic_columns(state) == kept
        assert found.status is Status.SOLVED
        assert found.residual < 1e-9
    assert switches >= 3


def test_what_is_remembered_can_be_restored(rng: np.random.Generator) -> None:
    rg = ReducedGradient()
    _, state = resolved_with(rg, rng.normal(size=(2, 4)))
    before = state.memory.copy()
    resolved_with(rg, np.eye(4)[[3, 2]], state)
    assert not np.array_equal(state.memory, before)
    state.memory[:] = before
    np.testing.assert_array_equal(state.memory, before)
    state.reset()
    assert basic_columns(state) == (-1, -1)


PAPER = [("v", "q1"), ("v", "omega")]
NAMES = ("v", "omega", "q1", "q2")


def planar(d13: float, d12: float) -> Array:
    """A 2 x 4 Jacobian with these two minors."""
    return np.array([[1.0, 0.3, -0.2, 0.1], [0.0, d12, d13, 0.4]])


def chosen(
    J: Array, before: PartitionState | None = None, **options: Any
) -> tuple[tuple[int, ...], PartitionState]:
    """The columns of Ja, and the state, which `before` is left as it was for."""
    rg = ReducedGradient(partitions=PAPER, **options)
    state = PartitionState(2)
    if before is not None:
        state.memory[:] = before.memory
    resolved_with(rg, J, state, rate=[0.3, 0.1], inputs=NAMES)
    return basic_columns(state), state


def test_the_papers_rule() -> None:
    """1) start with [j1 j3] if |Δ13| >= |Δ12|; 2) below Θ = 0.01 go to the other."""
    first, second = (0, 2), (0, 1)
    assert chosen(planar(0.5, 0.4))[0] == first
    assert chosen(planar(-0.5, 0.4))[0] == first
    assert chosen(planar(0.4, 0.4))[0] == first
    assert chosen(planar(0.4, -0.4))[0] == first
    assert chosen(planar(0.4, np.nextafter(0.4, 1)))[0] == first  # what rounding makes of equals
    assert chosen(planar(0.3999, -0.4))[0] == second
    _, state = chosen(planar(0.5, 0.4))
    basic, state = chosen(planar(0.0101, 0.3), state)
    assert basic == first
    basic, state = chosen(planar(-0.0099, 0.3), state)
    assert basic == second
    basic, state = chosen(planar(0.5, 0.0101), state)
    assert basic == second
    basic, state = chosen(planar(0.5, 0.0), state)
    assert basic == first
    # Both below: the larger, which no rule of the paper covers.
    assert chosen(planar(0.001, 0.002), state)[0] == second
    assert chosen(planar(0.02, 0.5), chosen(planar(0.5, 0.4))[1], threshold=0.03)[0] == second


def test_the_papers_rule_on_the_paper_robot(rng: np.random.Generator) -> None:
    paper = twin.Planar()
    for q in rng.uniform(-4, 4, (200, 5)):
        minors = paper.minors(q)
        expected = (0, 2) if abs(minors[1, 3]) >= abs(minors[1, 2]) else (0, 1)
        assert chosen(paper.J(q))[0] == expected


def test_a_held_partition_stays() -> None:
    """So an integrator keeps one right-hand side through a step."""
    rg = ReducedGradient(partitions=PAPER)
    _, state = chosen(planar(0.5, 0.4))
    before = state.memory.copy()
    with state.held():
        resolved_with(rg, planar(0.5, 0.4), state, inputs=NAMES)
        assert basic_columns(state) == (0, 2)
    assert state.may_stand(before)
    with state.held():
        resolved_with(rg, planar(0.001, 0.4), state, inputs=NAMES)
        assert basic_columns(state) == (0, 2)
    assert not state.may_stand(before)
    resolved_with(rg, planar(0.001, 0.4), state, inputs=NAMES)
    assert basic_columns(state) == (0, 1)
    # One that is held may become singular; that is reported, not evaded.
    state.memory[COLUMNS:] = 2, 3
    with state.held():
        found, _ = resolved_with(ReducedGradient(), np.eye(4)[:2], state, rate=[1, 1])
    assert found.status is Status.SINGULAR_JA


def test_a_step_over_a_singular_block_may_not_stand() -> None:
    """det Ja has another sign after it."""
    _, state = chosen(planar(0.5, 0.4))
    before = state.memory.copy()
    resolved_with(ReducedGradient(partitions=PAPER), planar(-0.5, 0.4), state, inputs=NAMES)
    assert not state.may_stand(before)
    found = state.reservation(before, NAMES, 0.5)
    assert (found.code, found.values["inputs"], found.where) == (
        "partition_singular",
        ["v", "q1"],
        {"t": 0.5},
    )
    assert state.may_stand(state.memory.copy())
    assert state.reservation(state.memory.copy(), NAMES, 0.5) is None
    resolved_with(ReducedGradient(partitions=PAPER), planar(0.001, 0.4), state, inputs=NAMES)
    assert basic_columns(state) == (0, 1)
    assert state.may_stand(before)  # another block


def test_the_arm_alone_as_basis_is_the_papers_special_case(rng: np.random.Generator) -> None:
    """n_m = s, Ja = Jm (with the up whose dimensions match)."""
    rg = ReducedGradient(10.0, [("q1", "q2")])
    paper = twin.Planar()
    for q in rng.uniform(-4, 4, (50, 5)):
        J, gradient, rate = paper.J(q), rng.normal(size=5), rng.normal(size=2)
        # The platform's Jacobian: x and y carry the arm along, theta turns it as omega does.
        Jp = np.column_stack([np.eye(2), J[:, 1]])
        expected = twin.reduced_gradient_on_arm(Jp, J[:, 2:], twin.G(q), rate, gradient[:3], gradient[3:])
        found, _ = resolved_with(rg, J, rate=rate, h=twin.S(q).T @ gradient, inputs=NAMES)
        tolerance = 1e-14 * np.linalg.cond(J[:, 2:]) ** 2
        scale = np.abs(expected).max(initial=1.0)
        np.testing.assert_allclose(found.u, expected, rtol=0, atol=tolerance * scale)


def resolved(resolver: Any, shape: tuple[int, int] = (2, 4), **changed: Any) -> Callable[[], Any]:
    s, m = shape
    J = np.random.default_rng(0).normal(size=shape)
    given = {"J": J, "rate": np.ones(s), "h": np.zeros(m)}
    return lambda: resolver.resolve(Problem(**(given | changed)))


RG, PG, EJ = ReducedGradient(), ProjectedGradient(), ExtendedJacobian()
REFUSED: list[tuple[Callable[[], Any], str]] = [
    (resolved(PG, (5, 4)), {"where": "task", "got": 5}),
    (resolved(RG, (3, 2)), {"where": "task", "got": 3}),
    (resolved(PG, J=np.ones(4)), {"where": "J", "got": [1.0, 1.0, 1.0, 1.0]}),
    (resolved(PG, J=np.zeros((0, 4)), rate=[]), {"where": "task"}),
    (resolved(PG, J=[[1, np.nan, 0, 0], [0, 1, 0, 0]]), {"where": "J"}),
    (resolved(PG, rate=[1.0, np.inf]), {"where": "rate", "got": [1.0, np.inf]}),
    (resolved(PG, rate=[1.0]), {"where": "rate", "got": [1.0]}),
    (resolved(PG, h=np.zeros(3)), {"where": "h", "got": [0.0, 0.0, 0.0]}),
    (resolved(PG, h="steep"), {"where": "h", "got": "steep"}),
    (resolved(PG, inputs=("a", "b")), {"where": "inputs", "got": 2}),
    (resolved(PG, row_scales=[1.0, 0.0]), {"where": "row_scales", "got": 0.0}),
    (resolved(PG, row_scales=[1.0]), {"where": "row_scales", "got": [1.0]}),
    (resolved(PG, levels=[1, 2]), {"where": "levels", "got": [1, 2]}),
    (resolved(PG, limit_rows=np.eye(3)), {"where": "limit_rows"}),
    (resolved(PG, limit_rows=np.eye(4), upper=[1, 2]), {"where": "upper", "got": [1.0, 2.0]}),
    (resolved(PG, before=np.ones(3)), {"where": "before", "got": [1.0, 1.0, 1.0]}),
    (resolved(EJ), {"where": "added_task", "got": 0}),
    (resolved(EJ, added_J=np.ones((2, 3)), added_rate=[0, 0]), {"where": "added_J"}),
    (resolved(EJ, added_J=np.ones((2, 4)), added_rate=[0]), {"where": "added_rate", "got": [0.0]}),
    (resolved(EJ, added_J=np.ones((2, 4))), {"where": "added_rate", "got": []}),
    (resolved(ProjectedGradient(weights=[1, 2, 3])), {"where": "weights"}),
    (resolved(ProjectedGradient(weights=2.0)), {"where": "weights", "got": 2.0}),
    (resolved(ProjectedGradient(weights=[1, 2, 0, 3])), {"where": "weights"}),
    (resolved(ProjectedGradient(weights=[1, 2, -1, 3])), {"where": "weights"}),
    (resolved(ProjectedGradient(weights=np.tri(4))), {"where": "weights"}),
    (resolved(ProjectedGradient(weights=np.ones((4, 4)))), {"where": "weights"}),
    (resolved(ProjectedGradient(weights={"w": 2.0}), inputs=NAMES), {"where": "weights", "got": "w"}),
    (
        resolved(ProjectedGradient(weights={"v": np.nan}), inputs=NAMES),
        {"where": "weight of v", "got": np.nan},
    ),
    (resolved(ReducedGradient(partitions=[("v", "q7")]), inputs=NAMES), {"where": "partitions", "got": "q7"}),
    (resolved(ReducedGradient(partitions=[(0, 4)])), {"where": "partitions", "got": 4}),
    (resolved(ReducedGradient(partitions=[(0, -1)])), {"where": "partitions", "got": -1}),
    (resolved(ReducedGradient(partitions=[(0, 1.5)])), {"where": "partitions", "got": 1.5}),
    (resolved(ReducedGradient(partitions=[(0, 0)])), {"where": "partitions", "got": [0, 0]}),
    (resolved(ReducedGradient(partitions=[(0, 1), (0,)])), {"where": "partitions", "got": [0]}),
    (lambda: ReducedGradient(partitions="best"), {"where": "partitions", "got": "best"}),
    (lambda: ReducedGradient(partitions=[]), {"where": "partitions"}),
    (lambda: ReducedGradient(partitions=["v", "q1"]), {"where": "partitions", "got": "v"}),
    (lambda: ReducedGradient(partitions=[0, 2]), {"where": "partitions", "got": 0}),
    (lambda: ReducedGradient(threshold=1.0), {"where": "threshold", "got": 1.0}),
    (lambda: ReducedGradient(threshold=0.0), {"where": "threshold", "got": 0.0}),
    (lambda: ReducedGradient(alpha=-1.0), {"where": "alpha", "got": -1.0}),
    (lambda: ProjectedGradient(alpha=0.0), {"where": "alpha", "got": 0.0}),
    (lambda: ProjectedGradient(tolerance=np.nan), {"where": "tolerance", "got": np.nan}),
    (lambda: ExtendedJacobian(tolerance=-1e-9), {"where": "tolerance", "got": -1e-09}),
]


@pytest.mark.parametrize(("call", "fields"), REFUSED)
def test_bad_input_is_refused_in_one_line(call: Callable[[], Any], fields: dict[str, Any]) -> None:
    with refused(**fields) as caught:
        call()
    assert "\n" not in str(caught.value)
