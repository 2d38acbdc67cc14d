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

SEEDS = (1, 15, 16, 17, 18, 44, 80)


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


def test_distances_are_kept_or_the_run_says_by_how_much(found: dict[int, Found]) -> None:
    for seed, one in found.items():
        assert not one.untold, (seed, one)
        kinds = scene(seed).kinds
        if kinds["motion"] == "standing" and kinds["start"] == "far":
            assert one.kept, (seed, one)


def test_without_avoidance_some_of_them_hit(found: dict[int, Found]) -> None:
    assert sum(one.without < 0.0 for one in found.values()) >= len(SEEDS) // 3
