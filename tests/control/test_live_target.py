"""A target that is set from outside: by whom it is followed, from when on, and what does not move it."""

from __future__ import annotations

import copy
import gc
import pickle
import threading
import weakref
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from findings import refused
from numpy.typing import NDArray

from nmm.control.controller import Controller
from nmm.control.functions.function import Function
from nmm.control.functions.program import Program, evaluate
from nmm.control.functions.references import Bearing, Circle, Constant, Line, LiveTarget, PoseReference
from nmm.control.functions.tasks import (
    Distance,
    Heading,
    Orientation,
    Pointing,
    Pose,
    Position,
    Posture,
    Task,
)
from nmm.control.resolvers import ProjectedGradient
from nmm.model.robots.configuration import Configuration
from nmm.model.robots.loading import mount
from nmm.model.robots.robot import Robot

Array = NDArray[np.float64]


@pytest.fixture(scope="module")
def robot() -> Robot:
    """It moves its hand in space, every way."""
    return mount("omni_base", "small_arm")


@pytest.fixture
def q(robot: Robot, rng: np.random.Generator) -> Array:
    return rng.uniform(0.2, 0.9, robot.n)


def control(robot: Robot, task: Task) -> Controller:
    return Controller(robot, task, ProjectedGradient())


#: Tasks of three or six rows about a target, which is a signal in one controller and not in another.
TASKS: dict[str, tuple[int, Callable[[str, Function], Task]]] = {
    "position": (3, lambda hand, g: Task(Position(hand), g)),
    "orientation": (3, lambda hand, g: Task(Orientation(hand), g)),
    "pose": (6, lambda hand, g: Task(Pose(hand), g)),
    "pose of a point": (3, lambda hand, g: Task(Pose(hand), PoseReference(g, [0.1, 0.2, 0.3]))),
    "pointing": (3, lambda hand, g: Task(Pointing(hand, g), [0, 0])),
    "distance": (3, lambda hand, g: Task(Distance(hand, g), 0.4)),
    "bearing": (3, lambda hand, g: Task(Heading(hand), Bearing(g, [6, 2]))),
}


@pytest.mark.parametrize("kind", TASKS)
def test_a_controller_that_is_built_follows(
    kind: str, robot: Robot, q: Array, rng: np.random.Generator
) -> None:
    """At rest as a constant does, moving as a line does, held with a rate as the line there and then."""
    s, task = TASKS[kind]
    target = LiveTarget(rng.normal(size=s))
    followed = control(robot, task("ee", target))

    def expect(reference: Function, t: float) -> None:
        expected = control(robot, task("ee", reference)).evaluate(t, q)
        found = followed.evaluate(t, q)
        for name in ("error", "rate", "J", "u"):
            scale = np.abs(getattr(expected, name)).max(initial=1.0)
            np.testing.assert_allclose(
                getattr(found, name), getattr(expected, name), rtol=0, atol=1e-13 * scale
            )

    expect(Constant(target.value), 0.0)
    for _ in range(3):
        value, rate = rng.normal(size=s), rng.normal(size=s)
        target.set(value)
        expect(Constant(value), 1.3)
        target.set(value, rate, t=0.5)
        line = Line(value - 0.5 * rate, value + 9.5 * rate, 10.0)
        for t in (0.5, 1.3, 4.0):
            expect(line, t)
        target.set(value, rate)
        np.testing.assert_array_equal(target.rate, rate)
        at_rest = Line(value - 7.0 * rate, value + 3.0 * rate, 10.0)
        expect(at_rest, 7.0)
        there = followed(7.0, q)
        np.testing.assert_array_equal(followed(1e6, q), there)


def test_what_a_camera_sees_is_followed_as_what_is_known(robot: Robot) -> None:
    """A loop in which value and rate are set before each step, against the same loop with the path known."""
    q = robot.q()
    q[3:] = 0.5
    here = Configuration(robot, q)
    circle = Circle(here.placement("ee").translation, 0.1, 2.0)
    seen = LiveTarget(evaluate(circle, 0.0, here).value)
    known, live = (
        control(robot, Task(Position("ee"), circle, 3.0)),
        control(robot, Task(Position("ee"), seen, 3.0)),
    )
    dt = 0.01
    initial = np.linalg.norm(known.evaluate(0.0, q).error)
    for k in range(150):
        now = evaluate(circle, k * dt, here)
        seen.set(now.value, rate=now.value_t)
        u = live(k * dt, q)
        np.testing.assert_allclose(u, known(k * dt, q), rtol=0, atol=1e-13)
        q = q + dt * live.velocity(k * dt, q)
    error = np.linalg.norm(known.evaluate(150 * dt, q).error)
    assert error < 0.1 * initial


def test_controllers_share_it_and_are_not_kept_by_it(robot: Robot, q: Array) -> None:
    target = LiveTarget([0.4, 0.2, 0.5])
    first, second = (control(robot, Task(Position("ee"), target, gain)) for gain in (1.0, 2.0))
    target.set([0.5, 0.1, 0.3])
    for controller in (first, second):
        np.testing.assert_array_equal(controller.evaluate(0.0, q).r_d, [0.5, 0.1, 0.3])
    gone = weakref.ref(first)
    del first, controller
    gc.collect()
    assert gone() is None
    target.set([0.6, 0.1, 0.3])
    np.testing.assert_array_equal(second.evaluate(0.0, q).r_d, [0.6, 0.1, 0.3])
    third = control(robot, Task(Position("ee"), target))
    np.testing.assert_array_equal(third.evaluate(0.0, q).r_d, [0.6, 0.1, 0.3])


def test_functions_share_it_in_one_program(robot: Robot, q: Array) -> None:
    target = LiveTarget([0.4, 0.2, 0.5])
    program = Program(robot, [target, Distance("ee", target), target])
    program.lay_out()
    target.set([1.0, 2.0, 3.0])
    found = program.evaluate(0.0, q)
    for own in (found[0], found[2]):
        np.testing.assert_array_equal(own.value, [1.0, 2.0, 3.0])
    np.testing.assert_array_equal(
        found[1].value, evaluate(Distance("ee", [1, 2, 3]), 0.0, Configuration(robot, q)).value
    )


def test_copies(robot: Robot, q: Array) -> None:
    target = LiveTarget([0.4, 0.2, 0.5])
    controller = control(robot, Task(Position("ee"), target))
    target.set([0.5, 0.1, 0.3], rate=[1.0, 0.0, 0.0])
    shallow, deep = copy.copy(controller), copy.deepcopy(controller)
    pickled = pickle.loads(pickle.dumps(controller))
    before = controller(0.0, q)
    for one in (shallow, deep, pickled):
        np.testing.assert_array_equal(one(0.0, q), before)
    target.set([0.0, 0.0, 0.9])
    np.testing.assert_array_equal(shallow(0.0, q), controller(0.0, q))
    for one in (deep, pickled):
        np.testing.assert_array_equal(one(0.0, q), before)
        own = one.task.tasks[0].reference
        np.testing.assert_array_equal(own.value, [0.5, 0.1, 0.3])
        own.set([0.0, 0.0, 0.9])
        np.testing.assert_array_equal(one(0.0, q), controller(0.0, q))
    np.testing.assert_array_equal(target.value, [0.0, 0.0, 0.9])


@pytest.mark.parametrize(
    ("given", "fields"),
    [
        ({"value": [1.0, 2.0]}, {"where": "signal value", "got": [1.0, 2.0]}),
        ({"value": 1.0}, {"where": "signal value", "got": [1.0]}),
        ({"value": np.ones((3, 1))}, {"where": "signal value", "got": [[1.0], [1.0], [1.0]]}),
        ({"value": [1.0, np.nan, 0.0]}, {"where": "signal value", "got": [1.0, np.nan, 0.0]}),
        ({"value": "there"}, {"where": "signal value", "got": "there"}),
        ({"value": None}, {"where": "signal value", "got": np.nan}),
        ({"value": [7, 7, 7], "rate": [1.0]}, {"where": "signal rate", "got": [1.0]}),
        ({"value": [7, 7, 7], "rate": [0, 0, np.inf]}, {"where": "signal rate", "got": [0.0, 0.0, np.inf]}),
        ({"value": [7, 7, 7], "rate": [0, 0, 1], "t": np.nan}, {"where": "signal t", "got": np.nan}),
        ({"value": [7, 7, 7], "t": [1.0, 2.0]}, {"where": "signal t", "got": [1.0, 2.0]}),
    ],
)
def test_what_cannot_be_a_target_changes_nothing(
    given: dict[str, object], fields: dict[str, Any], robot: Robot, q: Array
) -> None:
    target = LiveTarget([0.4, 0.2, 0.5])
    target.set([0.5, 0.2, 0.5], [0.1, 0.0, 0.0], t=0.3)
    controller = control(robot, Task(Position("ee"), target))
    before = controller(1.0, q)
    with refused(**fields):
        target.set(**given)  # type: ignore[arg-type]  # wrong on purpose
    np.testing.assert_array_equal(controller(1.0, q), before)
    np.testing.assert_array_equal(target.value, [0.5, 0.2, 0.5])
    np.testing.assert_array_equal(target.rate, [0.1, 0.0, 0.0])


def test_bad_beginnings(robot: Robot) -> None:
    with refused("signal value", got=[0.0, np.nan]):
        LiveTarget([0.0, np.nan])
    with refused("task ee.x, ee.y, ee.z, ee.rx, ee.ry, ee.rz", got=3):
        control(robot, Task(Pose("ee"), LiveTarget([0.0, 0.0, 0.0])))
    with refused("at"):
        control(robot, Task(Pointing("ee", LiveTarget([0.0, 0.0, 0.0], "rad")), [0, 0]))
    alone = LiveTarget(0.7, "rad")
    alone.set(0.9)
    np.testing.assert_array_equal(alone.value, [0.9])
    alone.value[0] = 5.0  # a copy
    np.testing.assert_array_equal(alone.value, [0.9])


def test_a_step_sees_a_value_with_its_own_rate(robot: Robot, q: Array) -> None:
    """Set from another thread as fast as it can, while this one steps."""
    target = LiveTarget(np.zeros(5), "rad")
    controller = control(robot, Task(Posture(), target, None))
    done = threading.Event()
    sets = 0

    def drag() -> None:
        nonlocal sets
        while not done.is_set():
            sets += 1
            target.set(np.full(5, float(sets)), np.full(5, float(sets)))

    thread = threading.Thread(target=drag)
    thread.start()
    seen = set()
    try:
        for _ in range(5_000):
            step = controller.evaluate(0.0, q)
            assert np.all(step.r_d == step.r_d[0])
            assert np.all(step.rate == step.r_d)
            seen.add(float(step.r_d[0]))
    finally:
        done.set()
        thread.join()
    assert len(seen) > 1
