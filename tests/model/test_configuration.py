"""A configuration holds its own kinematics for as long as somebody holds it."""

from __future__ import annotations

import copy
import gc
import pickle
import threading

import numpy as np
import pytest

import nmm
from nmm.base.arrays import Array
from nmm.model.robots.configuration import Configuration
from nmm.model.robots.robot import Robot


@pytest.fixture(scope="module")
def robot() -> Robot:
    return nmm.Scenario.load("tiago_pose").controller().robot


def numbers(here: Configuration, frame: str) -> Array:
    com, com_jacobian = here.center_of_mass()
    parts = [here.placement(frame).homogeneous, here.jacobian(frame), here.hessian(frame), com, com_jacobian]
    return np.concatenate([np.ravel(part) for part in [*parts, here.S]])


def test_what_is_held_stays_while_others_come_and_go(robot: Robot) -> None:
    rng, frame = np.random.default_rng(0), robot.frames[-1]
    held = [Configuration(robot, rng.normal(size=robot.n)) for _ in range(5)]
    first = [numbers(here, frame) for here in held]
    for _ in range(20):
        numbers(Configuration(robot, rng.normal(size=robot.n)), frame)
    del held[2], first[2]
    gc.collect()
    for _ in range(20):
        numbers(Configuration(robot, rng.normal(size=robot.n)), frame)
    for here, expected in zip(held, first, strict=True):
        np.testing.assert_array_equal(numbers(here, frame), expected)


def test_one_that_follows_another_is_as_the_first_was(robot: Robot) -> None:
    rng, frame = np.random.default_rng(1), robot.frames[-1]
    q = rng.normal(size=robot.n)
    expected = numbers(Configuration(robot, q), frame)
    numbers(Configuration(robot, rng.normal(size=robot.n)), frame)
    np.testing.assert_array_equal(numbers(Configuration(robot, q), frame), expected)


def test_copies_share_nothing_that_is_given_back(robot: Robot) -> None:
    rng, frame = np.random.default_rng(2), robot.frames[-1]
    here = Configuration(robot, rng.normal(size=robot.n))
    expected = numbers(here, frame)
    for copied in (copy.copy(here), copy.deepcopy(here), pickle.loads(pickle.dumps(here))):
        np.testing.assert_allclose(numbers(copied, frame), expected, rtol=0, atol=1e-12)
        del copied
        numbers(Configuration(robot, rng.normal(size=robot.n)), frame)
        np.testing.assert_array_equal(numbers(here, frame), expected)


def test_one_that_is_refused_gives_nothing_back(robot: Robot) -> None:
    with pytest.raises(nmm.InputError):
        Configuration(robot, np.zeros(robot.n + 1))
    numbers(Configuration(robot, np.zeros(robot.n)), robot.frames[-1])


def test_threads_never_have_the_same_data(robot: Robot) -> None:
    frame, wrong = robot.frames[-1], []

    def work(seed: int) -> None:
        q = np.random.default_rng(seed).normal(size=robot.n)
        expected = numbers(Configuration(robot, q), frame)
        for _ in range(100):
            if not np.array_equal(numbers(Configuration(robot, q), frame), expected):
                wrong.append(seed)

    threads = [threading.Thread(target=work, args=(seed,)) for seed in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert wrong == []
