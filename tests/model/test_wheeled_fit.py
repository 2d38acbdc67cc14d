"""Robots' files read as descriptions by wheels."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy import pi
from wheeled_examples import AXLE, trailer

from nmm.base.errors import InputError
from nmm.model.platforms.recognition import with_roles
from nmm.model.platforms.wheel_layout import Layout, Pivot, RollingJoint
from nmm.model.platforms.wheeled.descriptions import CasterWheel, Hitch, SteeredWheel
from nmm.model.platforms.wheeled.platform import WheeledPlatform


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
            (rolling("w", 0, 0.05, "p"),),
            "r: wheel w",
            "it is on the axis of p, so it is no caster",
        ),
        (
            (Pivot("p", "theta", 0.5, 0.0, -np.inf, np.inf, role="swivel"),),
            (rolling("w", 0, 0, "p"),),
            "r",
            "all wheels swivel freely",
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


def role(joint: str, x: float, y: float, role: Any) -> Pivot:
    return Pivot(joint, "theta", x, y, -np.inf, np.inf, role=role)


def slip(platform: WheeledPlatform, wheels: Any, rates: dict[str, tuple[complex, complex]]) -> float:
    """The largest sideways speed of points at (pivot, offset from it at zero), by rigid-body motion alone:
    v + i omega c, in complex numbers; wheels roll along x at zero."""
    rng = np.random.default_rng(2)
    worst = 0.0
    for _ in range(20):
        theta, angles = rng.uniform(-1, 1), dict.fromkeys(platform.coordinates[3:], 0.0)
        center = complex(*rng.uniform(-2, 2, 2))  # of rotation: all axes pass it where wheels are centred
        for name in angles:
            at = rates[name][0] - center
            angles[name] = float(np.angle(at / 1j))
        qp = np.array([0.3, -0.2, theta, *angles.values()])
        moved = platform.G(qp) @ rng.uniform(-1, 1, platform.p)
        body = complex(moved[0], moved[1]) * np.exp(-1j * theta)
        for joint, offset in wheels:
            k = platform.coordinates.index(joint)
            lever = offset * np.exp(1j * qp[k])
            velocity = body + 1j * moved[2] * rates[joint][0] + 1j * (moved[2] + moved[k]) * lever
            worst = max(worst, abs((velocity * np.exp(-1j * qp[k])).imag))
    return worst


def test_two_wheels_on_each_of_four_pivots() -> None:
    """As a PR2 has them: the second on a pivot repeats the first, and all eight roll without slip."""
    places = {
        f"{a}{b}": complex(x, y) for a, x in (("f", 0.22), ("b", -0.22)) for b, y in (("l", 0.2), ("r", -0.2))
    }
    pivots = [role(name, at.real, at.imag, "steering") for name, at in places.items()]
    wheels = [
        rolling(f"{name}_{side}", 0, y, name) for name in places for side, y in (("l", 0.05), ("r", -0.05))
    ]
    platform = WheeledPlatform.fit(Layout("r", tuple(pivots), tuple(wheels)))
    assert platform.coordinates[3:] == tuple(places)
    assert platform.inputs == ("v", "fl_rate", "bl_rate")
    ends = [(name, 1j * y) for name in places for y in (0.05, -0.05)]
    assert slip(platform, ends, {name: (at, 0j) for name, at in places.items()}) < 1e-9


def test_wheels_a_few_millimetres_off_their_pivots_steer() -> None:
    """They have rates for inputs, and are no casters that the ground turns."""
    pivots = [role("a", 0.3, 0.2, "steering"), role("b", 0.3, -0.2, "steering")]
    wheels = [rolling("wa", 0.006, 0.01, "a"), rolling("wb", -0.003, -0.01, "b"), *REAR]
    platform = WheeledPlatform.fit(Layout("r", tuple(pivots), tuple(wheels)))
    assert platform.inputs == ("v", "a_rate")
    assert [wheel.trail for wheel in platform.wheels[:2]] == [0.0, 0.0]  # type: ignore[attr-defined]


def test_swivels_right_above_their_wheels_constrain_nothing() -> None:
    pivots = (role("a", 0.3, 0.0, "swivel"), role("b", -0.3, 0.0, "swivel"))
    wheels = (*REAR, rolling("wa", 0.0, 0.0, "a"), rolling("wb", 0.0, 0.04, "b"))
    platform = WheeledPlatform.fit(Layout("r", pivots, wheels))
    assert [wheel.name for wheel in platform.wheels] == ["rl", "rr"]
    assert platform.inputs == ("v", "omega")


def test_a_caster_beside_its_pivot_rolls_by_the_forks_turn_too() -> None:
    pivots = (role("swivel", 0.5, 0.1, "swivel"),)
    wheels = (*REAR, rolling("caster", -0.04, 0.02, "swivel"))
    platform = WheeledPlatform.fit(Layout("r", pivots, wheels))
    v, omega, angle = 0.4, 0.7, 0.3
    rate = platform.wheel_rates([0, 0, 0], [v, omega], {"caster": angle})["caster"]
    at_pivot = v + 1j * omega * (0.5 + 0.1j)
    center = at_pivot + 1j * (omega + rate.turn) * (-0.04 + 0.02j) * np.exp(1j * angle)
    rolled = center * np.exp(-1j * angle)  # along the wheel, and across: none
    assert rolled.imag == pytest.approx(0.0, abs=1e-12)
    assert rate.spin == pytest.approx(rolled.real / 0.1)


def test_offset_casters_beside_steered_wheels_are_no_coordinates() -> None:
    """As a Vega has it: two steered wheels drive, the third wheel trails."""
    pivots = (pivot("l", 0.2, 0.2), pivot("r", 0.2, -0.2), pivot("back", -0.3))
    wheels = (rolling("wl", 0, 0, "l"), rolling("wr", 0, 0, "r"), rolling("wb", -0.034, 0.017, "back"))
    layout = with_roles(Layout("vega", pivots, wheels))
    assert [one.role for one in layout.pivots] == ["steering", "steering", "swivel"]
    assert WheeledPlatform.fit(layout).inputs == ("v", "l_rate", "r_rate")
