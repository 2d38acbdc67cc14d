"""What users give to platforms, parameters, limits and angles: each error names what is wrong."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from findings import refused
from numpy import pi

from nmm.model.platforms import (
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
)

UNCHECKED = object()

BAD: dict[str, tuple[Callable[[], object], str, object]] = {
    "radius 0": (lambda: DifferentialDrive(0.0, 0.5), "differential: radius", 0.0),
    "track": (lambda: DifferentialDrive(0.1, -0.5), "differential: track", -0.5),
    "no number": (lambda: DifferentialDrive("wide", 0.5), "differential: radius", "wide"),
    "wheelbase": (lambda: Car(-1.0), "car: wheelbase", -1.0),
    "infinite": (lambda: FrontDriveCar(math.inf), "front_drive_car: wheelbase", math.inf),
    "steering": (lambda: Car(1.0, steering="theta"), "car: joints", "theta"),
    "no name": (lambda: Car(1.0, steering=""), "car: joints", ""),
    "rear to 90": (lambda: Car(1.0, max_steering=pi / 2), "car: max_steering", 1.5707963267948966),
    "left only": (lambda: Car(1.0, max_steering=-0.5), "car: max_steering", -0.5),
    "front to 190": (
        lambda: FrontDriveCar(1.0, max_steering=math.radians(190)),
        "front_drive_car: max_steering",
        3.3161255787892263,
    ),
    "length": (lambda: Trailer(0.0), "length of trailer hitch1", 0.0),
    "hitch": (lambda: Trailer(1.0, math.nan), "hitch of trailer hitch1", math.nan),
    "max_angle": (lambda: Trailer(1.0, max_angle=0.0), "max_angle of trailer hitch1", 0.0),
    "no trailers": (lambda: Tractor([]), "tractor: trailers", ()),
    "no list": (lambda: Tractor(Trailer(1.0)), "tractor: trailers", UNCHECKED),
    "lengths": (lambda: Tractor([1.0]), "tractor: trailers", (1.0,)),
    "twice": (lambda: Tractor([Trailer(1.0), Trailer(1.0)]), "tractor: joints", "hitch1"),
    "x": (lambda: Tractor([Trailer(1.0, joint="x")]), "tractor: joints", "x"),
    "skid_steer": (lambda: SkidSteer(0.1, 0.0, 0.4), "skid_steer: length", 0.0),
    "skid_steer turned about": (
        lambda: SkidSteer(0.1, 0.5, 0.4, left=-0.3),
        "skid_steer: left, right",
        (-0.3, -0.2),
    ),
    "mecanum": (lambda: Mecanum(0.1, 0.5, 0.0), "mecanum: width", 0.0),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_parameters_are_named(case: str) -> None:
    make, where, got = BAD[case]
    with refused(where) as caught:
        make()
    if got is not UNCHECKED:
        np.testing.assert_array_equal(caught.value.got, got)


KINDS: dict[str, Callable[..., Platform]] = {
    "unicycle": Unicycle,
    "differential": lambda **options: DifferentialDrive(0.1, 0.5, **options),
    "car": lambda **options: Car(1.0, **options),
    "front_drive_car": lambda **options: FrontDriveCar(1.0, **options),
    "tractor": lambda **options: Tractor([Trailer(1.0)], **options),
    "omnidirectional": Omnidirectional,
    "mecanum": lambda **options: Mecanum(0.1, 0.5, 0.4, **options),
    "skid_steer": lambda **options: SkidSteer(0.1, 0.5, 0.4, **options),
    "fixed": FixedBase,
}


@pytest.mark.parametrize("kind", KINDS)
def test_input_limits(kind: str) -> None:
    free = KINDS[kind]()
    assert np.all(free.input_limits == np.inf)
    for k, name in enumerate(free.inputs):
        limited = KINDS[kind](limits={name: 1.5})
        expected = np.full(free.p, np.inf)
        expected[k] = 1.5
        np.testing.assert_array_equal(limited.input_limits, expected)
        with refused(f"limit of {name}", got=0):
            KINDS[kind](limits={name: 0})
    with refused(f"limits of platform {kind}", got="warp", available=free.inputs):
        KINDS[kind](limits={"warp": 1.0})


def test_coordinate_limits() -> None:
    limits = Car(1.0, max_steering=0.6).coordinate_limits
    np.testing.assert_array_equal(limits, [[-np.inf, np.inf]] * 3 + [[-0.6, 0.6]])
    # Without a limit of its own, a rear-driven car's steering ends where its wheels' axes contradict.
    np.testing.assert_allclose(Car(1.0).coordinate_limits[3], [-np.pi / 2, np.pi / 2], atol=1e-5)
    assert np.all(np.isinf(FrontDriveCar(1.0).coordinate_limits))
    assert FrontDriveCar(1.0, max_steering=pi).coordinate_limits[3, 1] == pi
    tractor = Tractor([Trailer(1.0), Trailer(1.0, joint="hitch2", max_angle=1.2)])
    np.testing.assert_array_equal(tractor.coordinate_limits, [[-np.inf, np.inf]] * 4 + [[-1.2, 1.2]])


@pytest.mark.parametrize("angle", [pi / 2, -pi / 2, 3 * pi / 2])
def test_a_rear_driven_car_cannot_steer_across(angle: float) -> None:
    car = Car(1.0, steering="wheel")
    qp = np.array([1.0, 2.0, 0.3, angle])
    degrees = f"{math.degrees(angle):g}"
    assert f"wheel is at {degrees} degrees, where the wheels' axes contradict v" in str(car.problem(qp))
    assert car.problem(qp - [0, 0, 0, 1e-3]) is None
    # What the message says: with v at 1 the rear axle's midpoint moves, and the steered wheel forbids it.
    forward = np.array([np.cos(0.3), np.sin(0.3), 0.0, 0.0])
    assert np.abs(car.A(qp) @ forward).max() == pytest.approx(1.0)
    assert np.linalg.matrix_rank(np.vstack([car.A(qp), np.eye(4)[:2]]), tol=1e-9) == 2


def test_a_hitch_folded_beyond_its_limit() -> None:
    tractor = Tractor([Trailer(1.0, max_angle=0.5), Trailer(1.0, joint="hitch2", max_angle=pi / 2)])
    assert tractor.problem([0, 0, 9, 0.5, -pi / 2]) is None
    found = tractor.problem([0, 0, 9, 0.2, -math.radians(100)])
    assert found == "hitch2 is folded to 100 degrees, beyond its limit of 90"
    assert "hitch1 is folded to 30 degrees" in str(tractor.problem([0, 0, 9, math.radians(30), 3.0]))
