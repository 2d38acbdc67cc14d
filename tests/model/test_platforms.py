"""The named platforms: their wheels roll, and their motions are those that are known in closed form."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable

import numpy as np
import pytest
import twin
from numpy import pi
from numpy.typing import NDArray
from platform_grid import EXAMPLES, random_qp
from platform_wheels import bodies, contacts, slips
from scipy.linalg import expm

from nmm.base.errors import InputError
from nmm.model.platforms import (
    PLATFORMS,
    Car,
    DifferentialDrive,
    FixedBase,
    FrontDriveCar,
    Mecanum,
    Omnidirectional,
    Platform,
    SkidSteer,
    Tractor,
    Trailer,
    Unicycle,
    WheeledPlatform,
    platform_by_name,
)

Array = NDArray[np.float64]

each_example = pytest.mark.parametrize("name", EXAMPLES)
TRACTORS = [name for name, platform in EXAMPLES.items() if isinstance(platform, Tractor)]


def drive(platform: Platform, qp: Array, inputs: Callable[[float], Array], times: Array) -> Array:
    """qp at the times (N, n_p) of qp_dot = G up, with one Runge-Kutta step between two of them."""
    return twin.runge_kutta(lambda t, qp: platform.G(qp) @ inputs(t), qp, times)


def test_every_platform_has_an_example() -> None:
    missing = set(PLATFORMS.values()) - {type(platform) for platform in EXAMPLES.values()}
    assert not missing, f"add entries to platform_grid.py for {sorted(kind.__name__ for kind in missing)}"
    for name, kind in PLATFORMS.items():
        assert kind.name == name
        assert platform_by_name(name) is kind


@each_example
def test_names_units_and_shapes_belong_together(name: str) -> None:
    platform = EXAMPLES[name]
    assert platform.coordinates[:3] == ("x", "y", "theta")[: platform.n_p]
    assert len(platform.input_units) == platform.p == len(set(platform.inputs))
    assert set(platform.input_units) <= {"m/s", "rad/s"}
    qp = np.zeros(platform.n_p)
    assert platform.G(qp).shape == (platform.n_p, platform.p)
    assert platform.A(qp).shape == (platform.n_p - platform.p, platform.n_p)
    assert platform.coordinate_limits.shape == (platform.n_p, 2)
    assert platform.input_limits.shape == (platform.p,)
    assert platform.problem(qp) is None


@each_example
def test_copies_are_the_same_platform(name: str, rng: np.random.Generator) -> None:
    platform = EXAMPLES[name]
    qp = random_qp(platform, rng, 3.0)
    for other in (pickle.loads(pickle.dumps(platform)), copy.deepcopy(platform)):
        assert type(other) is type(platform)
        assert (other.coordinates, other.inputs) == (platform.coordinates, platform.inputs)
        np.testing.assert_array_equal(other.G(qp), platform.G(qp))
        np.testing.assert_array_equal(other.A(qp), platform.A(qp))
        np.testing.assert_array_equal(other.coordinate_limits, platform.coordinate_limits)
        np.testing.assert_array_equal(other.input_limits, platform.input_limits)


#: Those of which `platform_wheels` knows where the wheels are; test_wheeled_platform.py has its own oracle.
ROLLING = [
    name
    for name, platform in EXAMPLES.items()
    if not isinstance(platform, Omnidirectional | FixedBase | WheeledPlatform | SkidSteer)
]
SKIDDING = [name for name, platform in EXAMPLES.items() if isinstance(platform, SkidSteer)]


@pytest.mark.parametrize("name", ROLLING)
def test_no_wheel_slides(name: str, rng: np.random.Generator) -> None:
    platform = EXAMPLES[name]
    for _ in range(100):
        qp, up = random_qp(platform, rng, 10.0), rng.normal(size=platform.p)
        qp_dot = platform.G(qp) @ up
        slip = slips(platform, qp, qp_dot, up)
        assert slip.size >= 4
        np.testing.assert_allclose(slip, 0.0, rtol=0, atol=1e-14 * max(1.0, np.abs(qp_dot).max()))


@pytest.mark.parametrize("name", [name for name in ROLLING if not isinstance(EXAMPLES[name], Mecanum)])
def test_the_wheels_exclude_what_A_excludes(name: str, rng: np.random.Generator) -> None:
    """The velocities at which no wheel slides sideways are those with A qp_dot = 0, no fewer and no more."""
    platform = EXAMPLES[name]
    for _ in range(20):
        qp = random_qp(platform, rng, 3.0)
        A = platform.A(qp)
        sliding = np.column_stack([slips(platform, qp, qp_dot, None) for qp_dot in np.eye(platform.n_p)])
        rank = platform.n_p - platform.p
        assert np.linalg.matrix_rank(A) == rank
        for rows in (sliding, np.vstack([A, sliding])):
            assert np.linalg.matrix_rank(rows, tol=1e-12) == rank


@pytest.mark.parametrize("name", ROLLING)
def test_no_lateral_slip_over_a_run(name: str, rng: np.random.Generator) -> None:
    platform = EXAMPLES[name]
    size = 0.3 if "steering_rate" in platform.inputs else 1.0  # a car's steering is to stay below 90 degrees
    phases = rng.uniform(0, 2 * pi, platform.p)

    def inputs(t: float) -> Array:
        return size * np.sin(0.7 * t + phases)

    times = np.linspace(0.0, 20.0, 401)
    path = drive(platform, np.zeros(platform.n_p), inputs, times)
    assert np.abs(path[:, :3]).max() > 0.1
    for t, qp in zip(times, path, strict=True):
        slip = slips(platform, qp, platform.G(qp) @ inputs(t), inputs(t))
        assert np.abs(slip).max() <= 1e-12


class OneByOne(Unicycle):
    """A platform whose own `pfaffian` knows one configuration."""

    def pfaffian(self, qp: Array) -> Array:
        return np.array([[-np.sin(qp[2]), np.cos(qp[2]), 0.0]])


@pytest.mark.parametrize("name", [*ROLLING, "one_by_one"])
def test_sideways_speeds_of_many_samples_are_those_of_each(name: str, rng: np.random.Generator) -> None:
    platform = EXAMPLES.get(name) or OneByOne()
    qp = rng.uniform(-1.0, 1.0, (7, platform.n_p))
    qp_dot = rng.uniform(-1.0, 1.0, (7, platform.n_p))
    each = [platform.A(place) @ rate for place, rate in zip(qp, qp_dot, strict=True)]
    found = platform.sideways(qp, qp_dot)
    assert found.shape == (7, platform.n_p - platform.p)
    np.testing.assert_allclose(found, np.reshape(each, found.shape), rtol=0.0, atol=1e-14)


# Arcs: (platform, its own joints, inputs, twist in the platform's axes, radius of the circle of x, y).
ARCS = {
    "unicycle": (Unicycle(), [], [0.7, 0.4], [0.7, 0.0, 0.4], 0.7 / 0.4),
    "differential": (
        DifferentialDrive(0.1, 0.5),
        [],
        [3.0, 7.0],
        [0.5, 0.0, 0.8],
        0.25 * (7.0 + 3.0) / (7.0 - 3.0),
    ),
    "skid_steer": (
        SkidSteer(0.1, 0.5, 0.6, left=0.5, right=-0.3, ahead=-0.2),
        [],
        [3.0, 7.0],
        [0.55, 0.1, 0.5],
        np.hypot(0.55, 0.1) / 0.5,
    ),
    "car": (Car(0.4), [0.5], [0.7, 0.0], [0.7, 0.0, 0.7 * np.tan(0.5) / 0.4], 0.4 / np.tan(0.5)),
    "front_drive_car": (
        FrontDriveCar(0.4),
        [1.1],
        [0.7, 0.0],
        [0.7 * np.cos(1.1), 0.0, 0.7 * np.sin(1.1) / 0.4],
        0.4 / np.tan(1.1),
    ),
    "omnidirectional": (
        Omnidirectional(),
        [],
        [0.7, -0.2, 0.4],
        [0.7, -0.2, 0.4],
        np.hypot(0.7, 0.2) / 0.4,
    ),
    "mecanum": (
        Mecanum(0.05, 0.3, 0.2),
        [],
        [9.0, -5.0, 3.0],
        [0.45, -0.25, 0.6],
        np.hypot(0.45, 0.25) / 0.6,
    ),
}


@pytest.mark.parametrize("name", ARCS)
def test_constant_inputs_make_arcs(name: str) -> None:
    platform, joints, up, (vx, vy, omega), radius = ARCS[name]
    start, duration = np.array([0.3, -0.8, 0.5, *joints]), 4.0
    frame = planar(start)
    end = frame @ expm(duration * np.array([[0.0, -omega, vx], [omega, 0.0, vy], [0.0, 0.0, 0.0]]))
    errors = []
    for steps in (40, 80):
        path = drive(platform, start, lambda t: np.array(up), np.linspace(0.0, duration, steps + 1))
        errors.append(np.abs(planar(path[-1]) - end).max())
        assert path[-1, 2] == pytest.approx(0.5 + omega * duration, abs=1e-12)
    assert 15.0 < errors[0] / errors[1] < 17.0  # fourth order
    # At a constant turning rate this is Simpson's rule, wrong by at most dt⁴ T / 2880 of a fourth derivative.
    bound = (omega * duration / steps) ** 4 * duration * np.hypot(vx, vy) / 2880.0
    assert errors[1] <= bound
    center = (frame @ [-vy / omega, vx / omega, 1.0])[:2]
    distances = np.linalg.norm(path[:, :2] - center, axis=1)
    np.testing.assert_allclose(distances, radius, rtol=0, atol=bound)


def planar(qp: Array) -> Array:
    """The platform's frame in the world, (3, 3) homogeneous."""
    c, s = np.cos(qp[2]), np.sin(qp[2])
    return np.array([[c, -s, qp[0]], [s, c, qp[1]], [0.0, 0.0, 1.0]])


def test_front_and_rear_drive_are_one_car(rng: np.random.Generator) -> None:
    """The steered wheel is faster than the rear axle by 1 / cos δ."""
    for _ in range(20):
        qp, v = np.append(rng.normal(size=3), rng.uniform(-1.4, 1.4)), rng.normal()
        rear, front = Car(0.7), FrontDriveCar(0.7)
        np.testing.assert_array_equal(rear.A(qp), front.A(qp))
        found = front.G(qp) @ [v / np.cos(qp[3]), 0.2]
        np.testing.assert_allclose(found, rear.G(qp) @ [v, 0.2], rtol=0, atol=1e-13)


def test_front_drive_turns_about_its_rear_axle() -> None:
    car = FrontDriveCar(0.5, max_steering=2.0)
    qp = np.array([0.0, 0.0, 0.3, pi / 2])
    np.testing.assert_allclose(car.G(qp) @ [1.0, 0.0], [0.0, 0.0, 2.0, 0.0], rtol=0, atol=1e-15)
    assert car.problem(qp) is None


@pytest.mark.parametrize("name", TRACTORS)
def test_trailers_follow_the_velocity_of_their_hitch(name: str, rng: np.random.Generator) -> None:
    """Each hitch's rate from rigid bodies alone: the one at which the trailer's axle does not slide."""
    platform = EXAMPLES[name]
    for _ in range(20):
        qp, up = random_qp(platform, rng, 10.0), rng.normal(size=2)
        v, omega = up
        qp_dot = np.zeros(platform.n_p)
        qp_dot[:3] = v * np.cos(qp[2]), v * np.sin(qp[2]), omega
        for i, trailer in enumerate(platform.trailers, 1):
            # Sideways velocity of the axle at rate 0, and what a rate of 1 adds: -length.
            body = bodies(platform, qp, qp_dot)[i]
            sideways = (body.point_velocity(complex(-trailer.length, 0.0)) / body.direction).imag
            qp_dot[2 + i] = sideways / trailer.length
        np.testing.assert_allclose(platform.G(qp) @ up, qp_dot, rtol=0, atol=1e-13)


def test_on_axle_trailers_settle_on_the_tractors_circle() -> None:
    """sin b = -l / R, and the trailer's axle goes on a circle of R' with R'² = R² - l²."""
    first, second, v, omega = 0.6, 0.9, 1.0, 0.5
    platform = Tractor([Trailer(first), Trailer(second, joint="hitch2")])
    radius = v / omega
    inner = np.sqrt(radius**2 - first**2)
    expected = [-np.arcsin(first / radius), -np.arcsin(second / inner)]
    path = drive(platform, np.zeros(5), lambda t: np.array([v, omega]), np.linspace(0.0, 60.0, 6001))
    np.testing.assert_allclose(path[-1, 3:], expected, rtol=0, atol=1e-9)


@pytest.mark.parametrize("hitch", [0.4, -0.3])
def test_an_off_axle_trailer_settles_on_its_circle(hitch: float) -> None:
    """R sin b + h cos b = -l with h the distance of the hitch behind the axle, R = v / ω."""
    length, v, omega = 0.7, 1.0, -0.5
    platform = Tractor([Trailer(length, hitch)])
    radius = v / omega
    reach = np.hypot(radius, hitch)
    expected = np.arcsin(length / reach) + np.arctan2(hitch, -radius)  # clockwise: the mirror image
    path = drive(platform, np.zeros(4), lambda t: np.array([v, omega]), np.linspace(0.0, 60.0, 6001))
    assert path[-1, 3] == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("v", [1.0, -1.0])
def test_a_trailer_straightens_forward_and_folds_backward(v: float) -> None:
    """Behind a tractor that goes straight, tan(b / 2) = tan(b0 / 2) exp(-v t / l), wherever the hitch is."""
    for hitch in (0.0, 0.3):
        platform = Tractor([Trailer(0.8, hitch)])
        times = np.linspace(0.0, 2.0, 401)
        path = drive(platform, np.array([0.0, 0.0, 0.7, 0.4]), lambda t: np.array([v, 0.0]), times)
        expected = 2 * np.arctan(np.tan(0.2) * np.exp(-v * times / 0.8))
        np.testing.assert_allclose(path[:, 3], expected, rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", [name for name in EXAMPLES if isinstance(EXAMPLES[name], Mecanum)])
def test_mecanum_wheel_speeds(name: str, rng: np.random.Generator) -> None:
    platform, omnidirectional = EXAMPLES[name], Omnidirectional()
    for _ in range(20):
        qp, up = rng.normal(size=3), rng.normal(size=3)
        speeds = platform.wheel_speeds(up)
        front_left, front_right, rear_left, rear_right = speeds
        assert front_left + front_right - rear_left - rear_right == pytest.approx(0.0, abs=1e-14)
        assert speeds @ speeds == pytest.approx(4 * up @ up, rel=1e-14)
        # The same motion, from an omnidirectional platform's twist ...
        turning = 2 * platform.radius / (platform.length + platform.width)
        twist = np.array([platform.radius, platform.radius, turning]) * up
        np.testing.assert_allclose(platform.G(qp) @ up, omnidirectional.G(qp) @ twist, rtol=0, atol=1e-15)
        # ... and each wheel's speed from that of its centre along the direction in which it grips.
        for wheel, speed in zip(contacts(platform, qp, up), speeds, strict=True):
            center = complex(twist[0], twist[1]) + 1j * twist[2] * wheel.center
            gamma = platform.roller(wheel.center.real, wheel.center.imag)
            assert abs(gamma) == pi / 4
            grip = (center * np.exp(-1j * gamma)).real
            assert grip / (platform.radius * np.cos(gamma)) == pytest.approx(speed, abs=1e-13)


@pytest.mark.parametrize("name", SKIDDING)
def test_skidding_wheels_slide_as_fast_as_is_said(name: str, rng: np.random.Generator) -> None:
    """Not where a side's centre of rotation is: there the ground sees the side's wheels at rest."""
    platform = EXAMPLES[name]
    qp, up = rng.normal(size=(20, 3)), rng.normal(size=(20, 2))
    for place, inputs, told in zip(qp, up, platform.sliding(up), strict=True):
        qp_dot = platform.G(place) @ inputs
        found = slips(platform, place, qp_dot, inputs).reshape(-1, 2)
        assert told == pytest.approx(np.linalg.norm(found, axis=1).max(), rel=1e-12)
        (body,) = bodies(platform, place, qp_dot)
        for y, speed in ((platform.left, inputs[0]), (platform.right, inputs[1])):
            center = body.point_velocity(complex(platform.ahead, y)) / body.direction
            assert abs(center - platform.radius * speed) <= 1e-14
    np.testing.assert_array_equal(platform.sliding(np.array([2.0, 2.0])), 0.0)


def test_viscous_ground_puts_the_centres_where_the_wheels_slide_least(rng: np.random.Generator) -> None:
    """Four equal wheels whose friction is as their slip: they take the motion with the least Σ slip², and
    that is skid steering about centres at ±(width/2) (1 + (length/width)²)."""
    length, width = 0.5, 0.6
    out = 0.5 * width * (1.0 + (length / width) ** 2)
    platform = SkidSteer(0.1, length, width, left=out, right=-out)
    for _ in range(20):
        qp, up = rng.normal(size=3), rng.normal(size=2)
        rates = np.column_stack(
            [slips(platform, qp, qp_dot, np.zeros(2)) for qp_dot in np.eye(3)]
        )  # of all bodies' motions, with the wheels locked
        driven = slips(platform, qp, np.zeros(3), up)
        expected = np.linalg.lstsq(rates, -driven, rcond=None)[0]
        np.testing.assert_allclose(platform.G(qp) @ up, expected, rtol=0, atol=1e-14)


def test_skid_steering_without_numbers_is_a_differential_drive(rng: np.random.Generator) -> None:
    qp = rng.normal(size=3)
    found, expected = SkidSteer(0.1, 0.7, 0.6), DifferentialDrive(0.1, 0.6)
    np.testing.assert_allclose(found.G(qp), expected.G(qp), rtol=0, atol=1e-16)
    np.testing.assert_allclose(found.A(qp), expected.A(qp), rtol=0, atol=0)
    assert np.all(expected.sliding(rng.normal(size=(5, 2))) == 0.0)
    assert found.sliding(np.array([0.0, 1.0])) == pytest.approx(0.1 / 0.6 * 0.35)


def test_only_mecanum_wheels_have_rollers() -> None:
    for platform in EXAMPLES.values():
        if not isinstance(platform, Mecanum | WheeledPlatform):
            assert platform.roller(0.2, 0.1) == 0.0


def test_a_fixed_base_has_nothing_to_move() -> None:
    base = FixedBase()
    assert (base.n_p, base.p) == (0, 0)
    assert base.G([]).shape == base.A([]).shape == base.G_dot([], []).shape == (0, 0)
    with pytest.raises(InputError, match=r"qp: expected 0 numbers"):
        base.G([1.0])
