"""Platforms measured in a robot's file: what fits, and what each error says about what does not."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import pytest
from findings import refused
from numpy import pi

from nmm.model.platforms import (
    Car,
    DifferentialDrive,
    FixedBase,
    FrontDriveCar,
    Layout,
    Mecanum,
    Omnidirectional,
    Pivot,
    Platform,
    RollingJoint,
    SkidSteer,
    Tractor,
    Unicycle,
)


def wheel(
    joint: str, x: float, y: float, on: str = "theta", heading: float = 0.0, r: float = 0.1
) -> RollingJoint:
    return RollingJoint(joint, on, x, y, heading, r)


def pivot(joint: str, x: float, y: float = 0.0, on: str = "theta", limit: float = math.inf) -> Pivot:
    return Pivot(joint, on, x, y, -limit, limit)


@contextmanager
def misfit(platform: str, message: str) -> Iterator[None]:
    """The block raises the error of a `fit`: what is wrong, and, in brackets, the first parts found."""
    with refused(f"robot: platform {platform}") as caught:
        yield
    what, _, found = message.removesuffix(")").partition("(found: ")
    assert what.strip() in caught.value.what
    assert found in ("; ".join(caught.value.got) or "none")


LEFT, RIGHT = wheel("left", 0.0, 0.2), wheel("right", 0.0, -0.2)


@pytest.mark.parametrize("kind", [Unicycle, Omnidirectional, FixedBase])
def test_what_has_no_parameters_fits_every_file(kind: type[Platform]) -> None:
    for layout in (Layout("bare"), Layout("two", (), (LEFT, RIGHT))):
        assert type(kind.fit(layout)) is kind


def test_fit_differential() -> None:
    for wheels in ((LEFT, RIGHT), (RIGHT, replace(LEFT, heading=pi))):
        caster = wheel("ball", 0.3, 0.0, on="swivel", heading=1.0, r=0.02)
        found = DifferentialDrive.fit(Layout("robot", (), (*wheels, caster)))
        assert (found.radius, found.track) == (0.1, 0.4)


DIFFERENTIAL_MISFITS = {
    "none": ((), "the root's body carries 0 (found: none)"),
    "one": ((LEFT,), "the root's body carries 1 (found: left at (0, 0.2) m, radius 0.1 m)"),
    "three": (
        (LEFT, RIGHT, wheel("third", 0.3, 0.0)),
        "carries 3 (found: left at (0, 0.2) m, radius 0.1 m; right at (0, -0.2) m, radius 0.1 m; third at",
    ),
    "across": (
        (LEFT, replace(RIGHT, heading=pi / 2)),
        "right does not roll forward (found: left at (0, 0.2) m, radius 0.1 m; right at (0, -0.2) m rolling",
    ),
    "two axles": ((LEFT, replace(RIGHT, x=0.1)), "they are not on one axle"),
    "ahead": (
        (replace(LEFT, x=0.2), replace(RIGHT, x=0.2)),
        "their axle is 0.2 m ahead of the reference point: give axle (--axle X,Y) (found: left at (0.2,",
    ),
    "behind": (
        (replace(LEFT, x=-0.2), replace(RIGHT, x=-0.2)),
        "their axle is 0.2 m behind the reference point: give axle (--axle X,Y)",
    ),
    "one side": ((LEFT, replace(RIGHT, y=0.1)), "they are not equally far to the left and right"),
    "off centre": ((LEFT, replace(RIGHT, y=-0.3)), "they are not equally far to the left and right"),
    "radii": (
        (LEFT, replace(RIGHT, radius=0.12)),
        "their radii differ (found: left at (0, 0.2) m, radius 0.1 m",
    ),
}


@pytest.mark.parametrize("case", DIFFERENTIAL_MISFITS)
def test_misfit_of_a_differential_drive(case: str) -> None:
    wheels, message = DIFFERENTIAL_MISFITS[case]
    with misfit("differential", message):
        DifferentialDrive.fit(Layout("robot", (), wheels))


@pytest.mark.parametrize("kind", [Car, FrontDriveCar])
def test_fit_car(kind: type[Car | FrontDriveCar]) -> None:
    ackermann = (pivot("left_steer", 0.4, 0.2, limit=0.8), pivot("right_steer", 0.4, -0.2, limit=0.8))
    shoulder = pivot("shoulder", 0.2)
    for limit, expected in ((0.6, 0.6), (math.inf, None), (2.0, None if kind is Car else 2.0)):
        pivots = (shoulder, *ackermann, pivot("Front_Steering", 0.4, limit=limit))
        found = kind.fit(Layout("robot", pivots, (LEFT, RIGHT)))
        assert type(found) is kind
        assert found.coordinates == ("x", "y", "theta", "Front_Steering")
        assert (found.wheelbase, found.max_steering) == (0.4, expected)
    lopsided = Pivot("steer", "theta", 0.4, 0.0, -0.3, 0.6)
    assert kind.fit(Layout("robot", (lopsided,))).max_steering is None


CAR_MISFITS = {
    "none": (Layout("robot"), "there is none (found: none)"),
    "unnamed": (Layout("robot", (pivot("yaw", 0.4),)), "there is none (found: yaw at (0.4, 0) m on theta)"),
    "behind": (Layout("robot", (pivot("steer", -0.4),)), "there is none (found: steer at (-0.4, 0) m on"),
    "aside": (Layout("robot", (pivot("steer", 0.4, 0.1),)), "there is none (found: steer at (0.4, 0.1) m"),
    "on another": (Layout("robot", (pivot("steer", 0.4, on="arm"),)), "(found: steer at (0.4, 0) m on arm)"),
    "two": (
        Layout("robot", (pivot("steer_a", 0.4), pivot("steer_b", 0.5))),
        "there are 2 (found: steer_a at (0.4, 0) m on theta; steer_b at (0.5, 0) m on theta)",
    ),
    "axle": (
        Layout("robot", (pivot("steer", 0.4),), (wheel("left", -0.25, 0.2), wheel("right", -0.25, -0.2))),
        "the nearest wheel, left, is 0.25 m behind the reference point: give axle (--axle X,Y) (found: left",
    ),
}


@pytest.mark.parametrize("case", CAR_MISFITS)
def test_misfit_of_a_car(case: str) -> None:
    layout, message = CAR_MISFITS[case]
    for kind in (Car, FrontDriveCar):
        with misfit(kind.name, message):
            kind.fit(layout)


TRAILERS = (
    pivot("hitch1", -0.3, limit=1.2),
    pivot("second_trailer", -0.9, on="hitch1"),
    pivot("shoulder", 0.1, on="hitch1"),
)
TRAILER_WHEELS = (
    wheel("l1", -0.7, 0.2, on="hitch1"),
    wheel("r1", -0.7, -0.2, on="hitch1", heading=pi),
    wheel("middle", -0.5, 0.0, on="second_trailer"),
)


def test_fit_tractor() -> None:
    found = Tractor.fit(Layout("robot", TRAILERS[::-1], (LEFT, RIGHT, *TRAILER_WHEELS)))
    first, second = found.trailers
    assert (first.joint, first.length, first.hitch, first.max_angle) == ("hitch1", 0.7, 0.3, 1.2)
    assert (second.joint, second.length, second.max_angle) == ("second_trailer", 0.5, None)
    assert second.hitch == pytest.approx(0.2)
    assert found.coordinates == ("x", "y", "theta", "hitch1", "second_trailer")


TRACTOR_MISFITS = {
    "none": (TRAILERS[1:], TRAILER_WHEELS, "there is none (found: second_trailer at (-0.9, 0) m on hitch1"),
    "two": (
        (*TRAILERS, pivot("hitch9", -0.5)),
        TRAILER_WHEELS,
        "theta carries several (found: hitch1 at (-0.3, 0) m on theta; hitch",
    ),
    "aside": ((pivot("hitch", -0.3, 0.1),), (), "hitch is off the x axis (found: hitch at (-0.3, 0.1) m on"),
    "no wheels": (TRAILERS, TRAILER_WHEELS[:2], "the trailer on second_trailer has none (found: none)"),
    "axles": (
        TRAILERS,
        (*TRAILER_WHEELS, wheel("l2", -0.9, 0.2, on="hitch1")),
        "those on hitch1 are on several axles (found: l1 at (-0.7, 0.2) m, radius 0.1 m; r1",
    ),
    "ahead": (
        TRAILERS[:1],
        (wheel("l1", 0.1, 0.0, on="hitch1"),),
        "those on hitch1 are not behind it (found: l1",
    ),
    "across": (
        TRAILERS[:1],
        (wheel("l1", -0.7, 0.0, on="hitch1", heading=pi / 2),),
        "those on hitch1 do not all roll forward (found: l1 at (-0.7, 0) m rolling at 90 degrees, radius 0.1",
    ),
    "axle": (
        TRAILERS,
        (*TRAILER_WHEELS, wheel("left", 0.1, 0.2)),
        "the nearest wheel, left, is 0.1 m ahead of the reference point: give axle (--axle X,Y)",
    ),
}


@pytest.mark.parametrize("case", TRACTOR_MISFITS)
def test_misfit_of_a_tractor(case: str) -> None:
    pivots, wheels, message = TRACTOR_MISFITS[case]
    with misfit("tractor", message):
        Tractor.fit(Layout("robot", pivots, wheels))


CORNERS = tuple(
    wheel(f"{end}_{side}", x, y, r=0.05)
    for end, x in (("front", 0.15), ("rear", -0.15))
    for side, y in (("left", 0.1), ("right", -0.1))
)


def test_fit_mecanum() -> None:
    found = Mecanum.fit(Layout("robot", (), CORNERS[::-1]))
    assert (found.radius, found.length, found.width) == (0.05, 0.3, 0.2)


MECANUM_MISFITS = {
    "three": (
        CORNERS[:3],
        "the root's body carries 3 (found: front_left at (0.15, 0.1) m, radius 0.05 m; fro",
    ),
    "across": ((*CORNERS[:3], replace(CORNERS[3], heading=1.0)), "rear_right does not roll forward"),
    "ahead": (
        tuple(replace(w, x=w.x + 0.3) for w in CORNERS),
        "they are not one in each quarter around it: give",
    ),
    "shifted": (tuple(replace(w, x=w.x + 0.02) for w in CORNERS), "they are not equally far from it to"),
    "one line": (tuple(replace(w, y=w.y / 200) for w in CORNERS), "they are on one line"),
    "radii": ((*CORNERS[:3], replace(CORNERS[3], radius=0.06)), "their radii differ"),
}


@pytest.mark.parametrize("case", MECANUM_MISFITS)
def test_misfit_of_mecanum(case: str) -> None:
    wheels, message = MECANUM_MISFITS[case]
    with misfit("mecanum", message):
        Mecanum.fit(Layout("robot", (), wheels))


def test_fit_skid_steer() -> None:
    middle = tuple(wheel(f"middle_{side}", 0.01, y, r=0.05) for side, y in (("left", 0.1), ("right", -0.1)))
    for wheels in (CORNERS, CORNERS[::-1], (*CORNERS, *middle)):
        found = SkidSteer.fit(Layout("rover", (), wheels))
        assert (found.radius, found.length, found.width) == (0.05, 0.3, 0.2)
        assert (found.left, found.right, found.ahead) == (0.1, -0.1, 0.0)


SKID_STEER_MISFITS = {
    "two": (CORNERS[:2], "the root's body carries 2 (found: front_left at (0.15, 0.1) m, radius 0.05 m; fro"),
    "across": ((*CORNERS[:3], replace(CORNERS[3], heading=1.0)), "rear_right does not roll forward"),
    "ahead": (
        tuple(replace(w, x=w.x + 0.02) for w in CORNERS),
        "the reference point is not midway between the first and the last axle: give axle (--axle X,Y)",
    ),
    "aside": (tuple(replace(w, y=w.y + 0.02) for w in CORNERS), "they are not equally far to the left and"),
    "one line": (tuple(replace(w, y=0.0) for w in CORNERS), "they are not equally far to the left and"),
    "one axle": (tuple(replace(w, x=0.0) for w in CORNERS), "they are on one axle"),
    "not in pairs": ((*CORNERS, wheel("odd", 0.0, 0.1, r=0.05)), "they do not stand in pairs"),
    "radii": ((*CORNERS[:3], replace(CORNERS[3], radius=0.06)), "their radii differ"),
}


@pytest.mark.parametrize("case", SKID_STEER_MISFITS)
def test_misfit_of_skid_steer(case: str) -> None:
    wheels, message = SKID_STEER_MISFITS[case]
    with misfit("skid_steer", message):
        SkidSteer.fit(Layout("robot", (), wheels))
