"""The scale and the point that limits leave, against linear and quadratic programs and the laws of optima."""

from __future__ import annotations

import math

import numpy as np
import pytest
from limit_problems import KINDS, Example, examples, largest_scale, nearest, pull, solved, violation

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
        assert violation(example, found.u) <= 1e-11
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
