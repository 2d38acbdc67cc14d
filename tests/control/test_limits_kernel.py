"""The scale and the point that limits leave, against linear and quadratic programs and the laws of optima."""

from __future__ import annotations

import math

import numpy as np
import pytest
from conditioned import with_singular_values
from limit_problems import KINDS, Example, examples, largest_scale, nearest, pull, solved, violation

import nmm
from nmm.control.resolvers import Problem, ProjectedGradient, Status

#: In the gate; `python -m tests.limit_problems 20000` tries more.
COUNT = 500
PROBLEMS = [(example, solved(example)) for example in examples(COUNT, seed=1)]


def some(kind: str) -> list[tuple[Example, object]]:
    return [(example, found) for example, found in PROBLEMS if example.kind == kind]


@pytest.mark.parametrize("kind", KINDS[:-1])
def test_the_scale_is_a_linear_programs(kind: str) -> None:
    for example, found in some(kind):
        assert abs(found.scale - largest_scale(example)) <= 1e-8


def test_no_point_is_found_where_a_linear_program_finds_none() -> None:
    for example, found in some("empty"):
        assert math.isnan(found.scale)
        assert math.isnan(largest_scale(example))


@pytest.mark.parametrize("kind", KINDS[:-1])
def test_the_point_is_a_quadratic_programs(kind: str) -> None:
    for example, found in some(kind):
        assert pull(example, found) <= 1e-9
        by = nearest(example, 1.0) if found.scale == 1.0 else None
        assert by is None or np.abs(by - found.u).max() <= 1e-7


@pytest.mark.parametrize("kind", KINDS[:-1])
def test_limits_hold_and_the_task_is_scaled(kind: str) -> None:
    for example, found in some(kind):
        asked = found.scale * (example.J @ example.target)
        assert violation(example.at(found.scale), found.u) <= 1e-11
        assert np.abs(example.J @ found.u - asked).max() <= 1e-10 * (1.0 + np.abs(asked).max())


def test_a_target_within_the_limits_is_kept_whole() -> None:
    for example, _ in PROBLEMS:
        inside = example._replace(target=0.0 * example.target)
        if np.all(inside.lower <= 0.0) and np.all(inside.upper >= 0.0):
            found = solved(inside)
            assert found.scale == 1.0
            assert np.all(found.u == 0.0)


def test_the_active_set_of_a_step_before_changes_nothing_but_the_time() -> None:
    for example, found in PROBLEMS:
        if not math.isnan(found.scale):
            near = example._replace(target=example.target * 1.01 + 0.01)
            cold, warm = solved(near), solved(near, found.active.copy())
            assert abs(cold.scale - warm.scale) <= 1e-9
            assert np.abs(cold.u - warm.u).max() <= 1e-7 * (1.0 + np.abs(cold.u).max())


def test_the_row_that_cut_the_scale_is_kept_and_cuts_it_again() -> None:
    """Where rows hold λ back, J's normals and those of the limits that are kept are dependent."""
    kept = count = 0
    for example, found in some("plain"):
        if 0.0 < found.scale < 1.0:
            again = solved(example, found.active.copy())
            rows = (again.active[1 : 1 + again.active[0]] - 1) % len(example.G)
            normals = np.vstack([example.J, example.G[rows]])
            assert again.scale == pytest.approx(found.scale, rel=0, abs=1e-12)
            kept += np.linalg.matrix_rank(normals, tol=1e-9) < len(normals)
            count += 1
    assert kept > 0.9 * count > 40


@pytest.mark.parametrize("decade", range(3, 9))
def test_beside_a_singularity_limits_hold_and_the_task_is_scaled(
    decade: int, rng: np.random.Generator
) -> None:
    """Also where cond(J) is beyond 1e7: the answer is no worse than its λ is small."""
    for s, m in ((2, 4), (3, 5), (6, 10)) * 10:
        J = with_singular_values(np.array([*np.geomspace(1.0, 0.1, s - 1), 10.0**-decade]), m, rng)
        rate, u_upper = rng.normal(size=s), rng.uniform(0.3, 1.0, m)
        given = {"J": J, "rate": rate, "h": 0.3 * rng.normal(size=m)}
        found = ProjectedGradient(1.0).resolve(Problem(**given, u_lower=-u_upper, u_upper=u_upper))
        assert found.status is Status.RELAXED
        target = np.linalg.lstsq(J, rate, rcond=None)[0]
        example = Example("near singular", J, np.eye(m), -u_upper, u_upper, target, np.zeros(m))
        assert abs(found.nu[0] - largest_scale(example)) <= 1e-7
        assert np.all(np.abs(found.u) <= u_upper)
        assert np.linalg.norm(J @ found.u - found.nu[0] * rate) <= 1e-9 * (1.0 + np.linalg.norm(rate))


def test_an_arm_that_is_all_but_straight_comes_away() -> None:
    """cond(J) = 1e9: called singular, as prototypes had it at 1e7, the arm would rest for ever."""
    robot = nmm.load("unicycle_2r", platform="fixed")
    task = nmm.Task(nmm.Position("ee", "xy"), nmm.Constant([0.55, 0.3]), gain=2.0)
    errors = []
    for tolerance in (1e-10, 1e-7):
        limits = nmm.Limits(velocity={"q1": 1.0, "q2": 1.0})
        controller = nmm.Controller(robot, task, nmm.ProjectedGradient(tolerance=tolerance), limits=limits)
        run = nmm.simulate(controller, {"q1": 0.4, "q2": 1e-8}, 6.0, 0.01, method="zoh")
        assert np.abs(run.u).max() <= 1.0
        errors.append(run.error_norm[-1])
    assert errors[0] < 1e-4
    assert errors[1] > 0.4


def test_rows_hold_where_a_last_digit_of_the_scale_moves_them(rng: np.random.Generator) -> None:
    """An arm that hardly moves one way, and wheels at their limits: inputs change by 1e8 per λ."""
    J = np.array(
        [
            [-0.99167679, 0.525244, 0.55099446, -0.18479449, -0.0926881],
            [0.12875226, -0.71098163, -0.51264628, -0.19861792, -0.09962158],
            [0.0, 0.0, 0.0, -0.75259624, -0.3761442],
        ]
    )
    rate, h = (
        np.array([-1.19504361, -0.84905016, 0.00621034]),
        np.array([0, 0, 0.95054692, 0.82595795, -1.40226949]),
    )
    wheels = np.array([[25.0, -7.0, 0.0, 0.0, 0.0], [25.0, 7.0, 0.0, 0.0, 0.0]]) / 3.0
    limits = {"u_lower": [-np.inf, -np.inf, *[-1.5] * 3], "u_upper": [np.inf, np.inf, *[1.5] * 3]}
    rows = {"limit_rows": wheels, "lower": [-2.0, -2.0], "upper": [2.0, 2.0]}
    worst = 0.0
    for _ in range(200):
        near = [part * (1.0 + 1e-6 * rng.normal(size=part.shape)) for part in (J, rate, h)]
        found = ProjectedGradient(1.0).resolve(Problem(*near, **limits, **rows))
        assert found.status is Status.RELAXED
        worst = max(worst, float((np.abs(wheels @ found.u) - 2.0).max()))
    assert worst <= 1e-11


@pytest.mark.parametrize(("levels", "excess"), [([0, 0, 1], 0.3), ([0, 0, 0], 0.4)])
def test_limits_that_contradict_give_way_by_what_those_that_are_always_kept_ask(
    levels: list[int], excess: float
) -> None:
    """u0 is 0.5, beyond 0.2 and 0.1: the least excess of the limits of level 0 is that of u1, too."""
    bounds = {"u_lower": [0.5, -2.0, -2.0], "u_upper": [0.5, 2.0, 2.0]}
    rows = {
        "limit_rows": [[1.0, 0, 0], [0, 1.0, 0], [1.0, 0, 0]],
        "lower": [-9.0] * 3,
        "upper": [0.2, 0.2, 0.1],
    }
    problem = Problem([[0.0, 1.0, 0.0]], [1.0], np.zeros(3), **bounds, **rows, limit_levels=levels)
    np.testing.assert_allclose(ProjectedGradient().resolve(problem).u, [0.5, 0.2 + excess, 0.0], atol=1e-12)
