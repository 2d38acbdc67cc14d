"""Robots' files read as descriptions by wheels."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy import pi
from wheeled_examples import AXLE, trailer

from nmm.errors import InputError
from nmm.platforms.wheel_layout import Layout, Pivot, RollingJoint
from nmm.platforms.wheeled.descriptions import CasterWheel, Hitch, SteeredWheel
from nmm.platforms.wheeled.platform import WheeledPlatform


def pivot(joint: str, x: float, y: float = 0.0, carrier: str = "theta") -> Pivot:
    return Pivot(joint, carrier, x, y, -1.0, 1.0)


def rolling(joint: str, x: float, y: float, carrier: str = "theta", heading: float = 0.0) -> RollingJoint:
    return RollingJoint(joint, carrier, x, y, heading, 0.1)


REAR = (rolling("rl", 0, 0.3), rolling("rr", 0, -0.3))


def test_a_robots_file_becomes_a_description(rng: np.random.Generator) -> None:
    layout = Layout(
        "truck",
        (
            pivot("front_steer", 0.8),
            pivot("hitch1", -0.2),
            pivot("swivel", -0.1, 0.1, "hitch1"),
            pivot("lamp", 0.2),
        ),
        (
            *REAR,
            rolling("front", 0, 0, "front_steer"),
            rolling("tl", -0.5, 0.2, "hitch1"),
            rolling("tr", -0.5, -0.2, "hitch1"),
            rolling("caster", 0.0, -0.04, "swivel", pi / 2),
        ),
    )  # fmt: skip
    platform = WheeledPlatform.fit(layout)
    assert platform.coordinates == ("x", "y", "theta", "front_steer", "hitch1")
    assert platform.inputs == ("v", "front_steer_rate")
    assert {type(wheel).__name__ for wheel in platform.wheels} == {
        "FixedWheel",
        "SteeredWheel",
        "CasterWheel",
    }
    caster = platform.wheels[-1]
    assert isinstance(caster, CasterWheel)
    assert caster.trail == pytest.approx(0.04)
    np.testing.assert_array_equal(platform.coordinate_limits[3:], [[-1, 1], [-1, 1]])
    expected = WheeledPlatform(
        [*AXLE, SteeredWheel("front", 0.8, 0, 0.1), *trailer("t", "h", 0.5)], [Hitch("h", -0.2)]
    )
    qp = rng.uniform(-1, 1, 5)
    np.testing.assert_allclose(platform.G(qp), expected.G(qp), atol=1e-14)


def test_a_steered_wheel_beside_and_behind_its_pivot() -> None:
    wheel = rolling("w", -0.03, 0.02, "steer", 0.0)
    (found,) = WheeledPlatform.fit(Layout("r", (pivot("steer", 0.5, 0.1),), (wheel,))).wheels
    assert isinstance(found, SteeredWheel)
    assert (found.trail, found.offset, found.lower, found.upper) == (0.03, 0.02, -1.0, 1.0)


@pytest.mark.parametrize(
    ("pivots", "wheels", "where", "said"),
    [
        ((), (), "r", "no wheels found"),
        ((), (*REAR, rolling("fl", 1, 0.3)), "r", "wheels rl, rr and fl are on different axles of one body"),
        ((), (rolling("w", 0, 0, "elbow"),), "r: wheel w", "hangs on elbow, which is no upright joint"),
        (
            (pivot("p", 0.5),),
            (rolling("w", 0, 0, "p"),),
            "r: wheel w",
            "it is on the axis of p, so it is no caster",
        ),
        (
            (pivot("p", 0.5),),
            (rolling("w", -0.1, 0.05, "p"),),
            "r: wheel w",
            "it is 0.05 m beside the axis of p",
        ),
        (
            (pivot("a", 0), pivot("b", 0, 0, "a")),
            (rolling("w", -0.1, 0, "b"),),
            "r: wheel w",
            "its pivot b hangs on a",
        ),
    ],
)
def test_files_that_say_too_little(pivots: Any, wheels: Any, where: str, said: str) -> None:
    with pytest.raises(InputError) as caught:
        WheeledPlatform.fit(Layout("r", pivots, wheels))
    assert caught.value.where == where
    assert caught.value.what.startswith(said)
