"""Every kind of platform with some of its parameters, for the tests that go through all of them.

A new platform is tested by a new entry in `EXAMPLES`; `test_platforms.py` notices when one is missing.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from wheeled_examples import EXAMPLES as WHEELED

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

Array = NDArray[np.float64]

#: Those described by their wheels that are regular at all random angles of the shared tests.
REGULAR = (
    *("axle", "wheel speeds", "front drive", "trailers", "two trailers side by side", "hitch with nothing"),
    *(
        "omni",
        "mecanum",
        "one steered",
        "two steered",
        "driven casters",
        "axles and a driven caster",
        "stuck",
    ),
)

#: Examples by a name for the test's id.
EXAMPLES: dict[str, Platform] = {
    "unicycle": Unicycle(),
    "differential": DifferentialDrive(0.1, 0.5),
    "differential_of_a_truck": DifferentialDrive(0.45, 2.2, limits={"omega_left": 20.0}),
    "skid_steer": SkidSteer(0.1, 0.5, 0.6),
    "skid_steer_on_grass": SkidSteer(0.1, 0.5, 0.6, left=0.5, right=-0.42, ahead=-0.07),
    "car": Car(0.4, max_steering=0.6),
    "car_without_limit": Car(2.7, steering="front_wheel"),
    "front_drive_car": FrontDriveCar(0.4, max_steering=np.pi),
    "front_drive_car_without_limit": FrontDriveCar(2.7, steering="front_wheel"),
    "tractor_on_axle": Tractor([Trailer(0.8)]),
    "tractor_off_axle": Tractor([Trailer(0.8, 0.3, max_angle=1.4)]),
    "tractor_two": Tractor([Trailer(0.6, 0.2), Trailer(0.9, 0.0, "hitch2")]),
    "tractor_three": Tractor(
        [Trailer(0.5, -0.1, "a"), Trailer(0.7, 0.3, "b", max_angle=2.0), Trailer(0.4, 0.2, "c")]
    ),
    "omnidirectional": Omnidirectional(),
    "mecanum": Mecanum(0.05, 0.3, 0.2),
    "mecanum_wide": Mecanum(0.2, 0.5, 1.1),
    "fixed": FixedBase(),
    **{f"wheeled, {name}": WHEELED[name] for name in REGULAR},
}

#: Where G is so many times larger than at its smallest, the wheels nearly cannot roll: a rear-driven car
#: steered to 90 degrees. Finite differences, too, lose their digits there.
LARGEST = 2.0


def random_qp(platform: Platform, rng: np.random.Generator, size: float) -> Array:
    """Coordinates within ±size (m, rad) and the platform's limits, where G is not too large.

    Near a singular steering angle G and its derivatives grow without bound, and so do the differences that
    they are compared with.
    """
    lower, upper = np.clip(platform.coordinate_limits.T, -size, size)

    def size_of_G(qp: Array) -> float:
        return float(np.abs(platform.G(qp)).max(initial=0.0))

    sample = np.random.default_rng(0).uniform(lower, upper, (20, platform.n_p))
    usual = max(1.0, min(size_of_G(qp) for qp in sample))
    for _ in range(1000):
        qp = rng.uniform(lower, upper)
        if size_of_G(qp) <= LARGEST * usual:
            return qp
    raise AssertionError(f"{platform.name}: no configuration found where its wheels roll well")
