"""The platform described by its wheels: its laws, and the named platforms derived from it."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest
from numpy import pi
from numpy.typing import NDArray
from paper_cases import CASES
from scipy.linalg import null_space, subspace_angles
from wheeled_examples import (
    AXLE,
    CASTER,
    EXAMPLES,
    FRONT,
    TRIANGLE,
    TWO_STEERED,
    mecanum,
    random_path,
    touching_velocity,
    trailer,
)

from nmm.model.platforms import (
    Car,
    DifferentialDrive,
    FixedBase,
    FrontDriveCar,
    Mecanum,
    Omnidirectional,
    Platform,
    Tractor,
    Trailer,
    Unicycle,
)
from nmm.model.platforms.wheeled.descriptions import CasterWheel, Hitch, OmniWheel, SteeredWheel
from nmm.model.platforms.wheeled.inputs import WeightedSpins, WheelSpeed, WheelSpin
from nmm.model.platforms.wheeled.platform import WheeledPlatform
from nmm.model.robots.robot import Robot

Array = NDArray[np.float64]

each_example = pytest.mark.parametrize("name", EXAMPLES)


def assert_same_span(first: Array, second: Array) -> None:
    assert first.shape == second.shape
    if first.shape[1]:  # NumPy 2.0 knows no rank of a matrix without columns
        assert np.linalg.matrix_rank(first) == np.linalg.matrix_rank(second) == first.shape[1]
        assert subspace_angles(first, second).max() < 1e-9


@each_example
def test_G_spans_the_null_space_of_A(name: str, rng: np.random.Generator) -> None:
    platform = EXAMPLES[name]
    for _ in range(20):
        qp = random_path(name, rng)(0.0)
        A, G = platform.A(qp), platform.G(qp)
        assert A.shape == (platform.n_p - platform.p, platform.n_p)
        np.testing.assert_allclose(A @ G, 0.0, atol=1e-12 * max(1.0, np.abs(G).max(initial=0.0)))
        assert_same_span(G, null_space(A) if len(A) else np.eye(platform.n_p))


@each_example
def test_every_wheel_touches_the_ground_without_slip(name: str, rng: np.random.Generator) -> None:
    """With the reported rates applied to a model of the whole platform: casters, redundant wheels and all."""
    platform = EXAMPLES[name]
    for _ in range(10):
        qp, up = random_path(name, rng)(0.0), rng.normal(size=platform.p)
        casters = [wheel.name for wheel in platform.wheels if isinstance(wheel, CasterWheel)]
        swivels = dict(zip(casters, rng.uniform(-3, 3, len(casters)), strict=True))
        rates = platform.wheel_rates(qp, up, swivels)
        assert list(rates) == [wheel.name for wheel in platform.wheels]
        qp_dot = platform.G(qp) @ up
        for wheel in platform.wheels:
            spin, turn = rates[wheel.name]
            swivel = (swivels.get(wheel.name, 0.0), turn if wheel.name in casters else 0.0)
            found = touching_velocity(platform, wheel, qp, qp_dot, swivel, spin)
            if isinstance(wheel, OmniWheel):  # its roller takes what is across the grip
                found = found[[0, 2]] * (math.cos(wheel.roller), 1) + found[[1]] * (math.sin(wheel.roller), 0)
            if isinstance(wheel, SteeredWheel):
                assert turn == qp_dot[platform.coordinates.index(wheel.joint)]
            np.testing.assert_allclose(found, 0.0, atol=1e-10 * max(1.0, float(np.abs(qp_dot).max())))


@each_example
def test_G_dot_along_paths(name: str, rng: np.random.Generator) -> None:
    """In all directions (that leave the axes concurrent), against differences of fourth order."""
    platform, h = EXAMPLES[name], 1e-3
    for _ in range(2 * platform.n_p):
        path = random_path(name, rng)

        def slope(values: Any) -> Array:
            return (8 * (values(h) - values(-h)) - (values(2 * h) - values(-2 * h))) / (12 * h)

        found = platform.G_dot(path(0.0), slope(path))
        expected = slope(lambda s, path=path: platform.G(path(s)))
        scale = max(1.0, float(np.abs(expected).max(initial=0.0)))
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-7 * scale)


@each_example
def test_the_basis_is_smooth(name: str, rng: np.random.Generator) -> None:
    """The integral of G_dot along a path is the change of G: no sign flips, no jumps."""
    platform, s = EXAMPLES[name], np.linspace(0.0, 0.8, 2001)
    path = random_path(name, rng, size=0.5)
    points = np.array([path(value) for value in s])
    slopes = np.gradient(points, s, axis=0, edge_order=2)
    rates = np.array([platform.G_dot(qp, slope) for qp, slope in zip(points, slopes, strict=True)])
    found = np.cumsum((rates[1:] + rates[:-1]) / 2, axis=0) * (s[1] - s[0])
    changes = np.array([platform.G(qp) for qp in points[1:]]) - platform.G(points[0])
    scale = max(1.0, float(np.abs(rates).max(initial=0.0)))
    np.testing.assert_allclose(found, changes, atol=1e-4 * scale)


def test_two_steered_wheels_turn_all_the_way_round_smoothly() -> None:
    """No wheel's own speed would do: there are angles at which the platform turns about that wheel."""
    platform = EXAMPLES["two steered"]
    before = platform.G([0, 0, 0, 0, 0])
    assert before[0, 0] > 0.9  # forward, although one wheel's heading is backward
    for angle in np.linspace(0.0, 2 * pi, 721):
        G = platform.G([0, 0, 0, angle, 0.4 - 2 * angle])
        assert np.abs(G - before).max() < 0.2 or angle == 0.0
        before = G


def test_forward_is_forward_whichever_wheel_comes_first() -> None:
    front, rear = (SteeredWheel(name, x, 0, 0.1, joint=name) for name, x in (("f", 0.5), ("r", -0.3)))
    for wheels in ([front, rear], [rear, front]):
        np.testing.assert_allclose(WheeledPlatform(wheels).G(np.zeros(5))[:, 0], [1, 0, 0, 0, 0], atol=1e-15)
    backward = dataclasses.replace(rear, heading=pi)
    np.testing.assert_allclose(WheeledPlatform([backward, front]).G(np.zeros(5))[0, 0], -1.0, atol=1e-15)


@pytest.mark.parametrize("name", ["four steered", "two front wheels"])
def test_G_dot_beside_concurrent_axes(name: str, rng: np.random.Generator) -> None:
    """Where the stages of an integrator go."""
    platform, h = EXAMPLES[name], 1e-6
    for _ in range(5):
        qp = random_path(name, rng)(0.0) + 2e-4 * rng.choice([-1, 1], platform.n_p)
        for direction in np.eye(platform.n_p):
            expected = (platform.G(qp + h * direction) - platform.G(qp - h * direction)) / (2 * h)
            scale = max(1.0, float(np.abs(expected).max()))
            np.testing.assert_allclose(platform.G_dot(qp, direction), expected, atol=1e-7 * scale)


def test_inputs_mean_what_their_names_say(rng: np.random.Generator) -> None:
    for name, platform in EXAMPLES.items():
        qp, up = random_path(name, rng)(0.0), rng.normal(size=platform.p)
        qp_dot = platform.G(qp) @ up
        cosine, sine = math.cos(qp[2]), math.sin(qp[2])
        known = {"omega": qp_dot[2], "vx": cosine * qp_dot[0] + sine * qp_dot[1]}
        known["vy"] = cosine * qp_dot[1] - sine * qp_dot[0]
        known |= {f"{joint}_rate": rate for joint, rate in zip(platform.coordinates, qp_dot, strict=True)}
        for wheel, rate in platform.wheel_rates(qp, up).items():
            known[f"{wheel}_spin"] = rate.spin
        for given, value in zip(platform.inputs, up, strict=True):
            if given in known:
                assert known[given] == pytest.approx(value, abs=1e-10), (name, given)
    assert EXAMPLES["front drive"].wheel_rates([1, 2, 3, 1.2], [0.6, 0])["front"].spin == pytest.approx(5.0)
    # The axle's middle at (-0.2, 0.3) moves along the wheel's heading, 0.7 rad from the body's.
    G = EXAMPLES["oblique axle"].G([0, 0, 0.4])
    np.testing.assert_allclose(G[:, 0], [math.cos(1.1), math.sin(1.1), 0.0], atol=1e-15)


def test_the_common_speed_is_the_root_mean_square_of_the_pivots(rng: np.random.Generator) -> None:
    for name in ("two steered", "common speed by name"):
        platform = EXAMPLES[name]
        for _ in range(10):
            qp = rng.uniform(-4, 4, 5)
            rates = platform.wheel_rates(qp, [-0.7, *rng.normal(size=2)])
            speeds = [rates[wheel.name].spin * wheel.radius for wheel in TWO_STEERED]
            assert math.sqrt(np.mean(np.square(speeds))) == pytest.approx(0.7, abs=1e-12)


# The named platforms.


def with_front(drive: str | WheelSpeed = "v") -> WheeledPlatform:
    return WheeledPlatform([*AXLE, FRONT], inputs=[drive, "steering_rate"])


SAME: dict[str, tuple[WheeledPlatform, Platform]] = {
    "unicycle": (WheeledPlatform([*AXLE, CASTER]), Unicycle()),
    "differential drive": (
        WheeledPlatform(
            AXLE, inputs=[WheelSpin("rear_left", "omega_left"), WheelSpin("rear_right", "omega_right")]
        ),
        DifferentialDrive(0.1, 0.6),
    ),
    "car": (WheeledPlatform([*AXLE, FRONT]), Car(0.8)),
    "front drive": (with_front(WheelSpeed("front", "v")), FrontDriveCar(0.8)),
    "on-axle trailer": (
        WheeledPlatform([*AXLE, *trailer("t", "hitch1", 0.6)], [Hitch("hitch1", 0)]),
        Tractor([Trailer(0.6)]),
    ),
    "off-axle trailers": (
        WheeledPlatform(
            [*AXLE, *trailer("t1", "a", 0.6), *trailer("t2", "b", 0.5), *trailer("t3", "c", 0.3)],
            [Hitch("a", -0.2), Hitch("b", -0.6 - 0.3, 0, "a"), Hitch("c", -0.5 + 0.1, 0, "b")],
        ),
        Tractor([Trailer(0.6, 0.2, "a"), Trailer(0.5, 0.3, "b"), Trailer(0.3, -0.1, "c")]),
    ),
    "omnidirectional": (WheeledPlatform(TRIANGLE), Omnidirectional()),
    "mecanum": (mecanum(0.05, 0.5, 0.4), Mecanum(0.05, 0.5, 0.4)),
}


@pytest.mark.parametrize("name", SAME)
def test_the_named_platform_is_derived_from_its_wheels(name: str, rng: np.random.Generator) -> None:
    derived, named = SAME[name]
    assert (derived.coordinates, derived.inputs) == (named.coordinates, named.inputs)
    assert derived.input_units == named.input_units
    for _ in range(30):
        qp, qp_dot = rng.uniform(-1.5, 1.5, named.n_p), rng.normal(size=named.n_p)
        G, G_dot = named.G(qp), named.G_dot(qp, qp_dot)
        np.testing.assert_allclose(derived.G(qp), G, rtol=0, atol=1e-12 * np.abs(G).max())
        np.testing.assert_allclose(
            derived.G_dot(qp, qp_dot), G_dot, rtol=0, atol=1e-12 * np.abs(G_dot).max() * 100
        )
        if len(named.A(qp)):
            assert_same_span(derived.A(qp).T, named.A(qp).T)


def test_the_controller_takes_it_like_the_named_one(robot_2r: Robot, rng: np.random.Generator) -> None:
    derived = dataclasses.replace(robot_2r, platform=SAME["unicycle"][0])
    case = CASES[0]
    for t in (0.0, 5.0):
        q = case.q0 + rng.normal(scale=0.3, size=5)
        u = case.controller(robot_2r)(t, q)
        np.testing.assert_allclose(case.controller(derived)(t, q), u, rtol=0, atol=1e-11 * np.abs(u).max())


def test_fixed_wheels_that_do_not_agree_hold_the_platform_still(rng: np.random.Generator) -> None:
    stuck = EXAMPLES["stuck"]
    assert (stuck.p, stuck.mobility, FixedBase().p) == (0, 0, 0)
    assert stuck.G(rng.normal(size=3)).shape == (3, 0)
    assert all(rate == (0.0, 0.0) for rate in stuck.wheel_rates([1, 2, 3], []).values())


def test_other_inputs_of_one_platform_span_the_same_space(rng: np.random.Generator) -> None:
    qp = rng.uniform(-1, 1, 4)
    for drive in (
        WheelSpeed("front"),
        WheelSpin("rear_left"),
        WeightedSpins({"rear_left": 0.5, "rear_right": 0.5}, "w"),
        "omega",
    ):
        platform = WheeledPlatform([*AXLE, FRONT], inputs=[drive])
        assert platform.inputs[1] == "steering_rate"
        assert_same_span(platform.G(qp), Car(0.8).G(qp))
    by_joint = WheeledPlatform(
        [*AXLE, *trailer("t", "hitch1", 0.6)], [Hitch("hitch1", -0.2)], ["v", "hitch1_rate"]
    )
    assert_same_span(by_joint.G(qp), Tractor([Trailer(0.6, 0.2)]).G(qp))
