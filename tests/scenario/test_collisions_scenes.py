"""Random scenes: distances are kept between samples, too, or the run says by how much they are not."""

from __future__ import annotations

import pytest
from scene_problems import (
    LIMITS,
    METHODS,
    MOTIONS,
    RESOLVERS,
    ROBOTS,
    STEPS,
    Found,
    outcome_of,
    scene,
)

SEEDS = (1, 16, 17, 33, 44, 80, 222)
#: Slow obstacles, by functions of Python, in many small steps.
MORE = (15, 18)


@pytest.fixture(scope="module")
def found() -> dict[int, Found]:
    return {seed: outcome_of(scene(seed)) for seed in SEEDS}


def test_a_share_of_the_scenes_has_every_kind() -> None:
    kinds = [scene(seed).kinds for seed in SEEDS]
    every = {
        "robot": {*ROBOTS},
        "limits": {*LIMITS},
        "motion": {*MOTIONS},
        "start": {"far", "near"},
        "resolver": {*RESOLVERS},
        "dt": {*map(str, STEPS)},
        "method": {*METHODS},
    }
    for what, names in every.items():
        assert {one[what] for one in kinds} == names, what


def check_distances(seed: int, one: Found) -> None:
    assert not one.untold, (seed, one)
    kinds = scene(seed).kinds
    if kinds["motion"] == "standing" and kinds["start"] == "far":
        assert one.kept, (seed, one)


def test_distances_are_kept_or_the_run_says_by_how_much(found: dict[int, Found]) -> None:
    for seed, one in found.items():
        check_distances(seed, one)


@pytest.mark.thorough
@pytest.mark.parametrize("seed", MORE)
def test_distances_are_kept_in_small_steps(seed: int) -> None:
    check_distances(seed, outcome_of(scene(seed), without=False))


def test_without_avoidance_some_of_them_hit(found: dict[int, Found]) -> None:
    assert sum(one.without < 0.0 for one in found.values()) >= len(SEEDS) // 3
