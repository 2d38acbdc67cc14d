"""A platform that is not what the file holds is told, with both numbers, and by `nmm check` and runs too."""

from __future__ import annotations

from pathlib import Path

import pytest
from ackermann_car import RADIUS, TRACK, WHEELBASE, car
from urdf_parts import write

import nmm
from nmm.cli.exit_status import status_of
from nmm.platforms import (
    Car,
    DifferentialDrive,
    FixedWheel,
    FrontDriveCar,
    Mecanum,
    Omnidirectional,
    Platform,
    SteeredWheel,
    Tractor,
    Trailer,
    Unicycle,
    WheeledPlatform,
)
from nmm.robots.loading.provenance import provenance_of

AXLE = [
    FixedWheel(f"rear_{side}_wheel_joint", 0, y, RADIUS) for side, y in (("left", 0.28), ("right", -0.28))
]

#: Robot, platform, and what is told.
TOLD: list[tuple[str, Platform, list[str]]] = [
    ("car_base", Car(5.0), ["wheelbase is 5 m as given, and 0.7 m in the file"]),
    ("car_base", FrontDriveCar(0.72), ["wheelbase is 0.72 m as given, and 0.7 m in the file"]),
    (
        "differential_base",
        DifferentialDrive(0.5, 2.0),
        ["radius is 0.5 m as given, and 0.1 m in the file", "track is 2 m as given, and 0.5 m in the file"],
    ),
    (
        "trailer_base",
        Tractor([Trailer(1.0, 0.25, "hitch1"), Trailer(0.7, joint="hitch2")]),
        ["length of trailer hitch1 is 1 m as given, and 0.7 m in the file"],
    ),
    ("omni_base", Mecanum(0.1, 1.0, 0.5), ["length is 1 m as given, and 0.5 m in the file"]),
    (
        "car_base",
        Unicycle(),
        ["would have to steer to 90 degrees; steering ends at -34.38 and 34.38 degrees: platform car?"],
    ),
    ("car_base", DifferentialDrive(0.1, 0.5), ["platform differential turns on the spot"]),
    ("differential_base", Mecanum(0.1, 0.5, 0.5), ["expects four wheels", "the root's body carries 2"]),
    ("differential_base", Omnidirectional(), ["moves sideways", "left_wheel_joint at (0, 0.25) m"]),
    (
        "car_base",
        WheeledPlatform([*AXLE, SteeredWheel("front", 0.7, 0, 0.12, joint="steering")]),
        [f"radius of rear_left_wheel_joint is {RADIUS:g} m as given, and 0.12 m in the file"],
    ),
]


@pytest.mark.parametrize(("name", "platform", "told"), TOLD)
def test_what_the_file_says_otherwise_is_told(name: str, platform: Platform, told: list[str]) -> None:
    robot = nmm.load(name, platform=platform)
    found = provenance_of(robot).contradictions
    for text in told:
        assert sum(text in one for one in found) == 1, found
    assert set(found) <= set(robot.notes)


@pytest.mark.parametrize(
    ("name", "platform"),
    [
        ("car_base", Car(0.7)),
        ("car_base", Car(0.7049)),
        ("car_base", FrontDriveCar(0.7)),
        ("differential_base", DifferentialDrive(0.1, 0.5009)),
        ("differential_base", Unicycle()),
        ("unicycle_2r", DifferentialDrive(0.1, 0.4)),
        ("small_arm", DifferentialDrive(0.1, 0.4)),  # no wheels: nothing to say
        ("small_arm", Omnidirectional()),
        ("omni_base", Omnidirectional()),
        *(
            (name, None)
            for name in ("car_base", "differential_base", "omni_base", "trailer_base", "unicycle_3r")
        ),
    ],
)
def test_what_fits_is_not_told(name: str, platform: Platform | None) -> None:
    assert provenance_of(nmm.load(name, platform=platform)).contradictions == ()


def test_a_car_without_a_steering_joint_between_its_wheels(tmp_path: Path) -> None:
    path = write(tmp_path / "car.urdf", car())
    robot = nmm.load(path, platform=Car(5.0, steering="steer"))
    (told,) = provenance_of(robot).contradictions
    assert told == f"platform car: wheelbase is 5 m as given, and {WHEELBASE:g} m in the file"
    *steering, told = provenance_of(nmm.load(path, platform=DifferentialDrive(RADIUS, 0.4))).contradictions
    assert len(steering) == 2
    assert all("turns on the spot" in one for one in steering)
    assert told == f"platform differential: track is 0.4 m as given, and {TRACK:g} m in the file"


def test_a_run_warns_of_it(tmp_path: Path) -> None:
    scenario = nmm.Scenario.load(
        "unicycle_2r_position",
        {
            "robot.platform": {"kind": "differential", "radius": 0.3, "track": 0.4},
            "duration": 0.05,
            "q0": {"q2": 1},
            "resolver": {"kind": "pg"},
        },
    )
    assert any("radius is 0.3 m as given, and 0.1 m" in text for text in scenario.run().warnings)


def test_check_warns_of_a_unicycle_that_is_a_car(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write(tmp_path / "car.urdf", car(front=-WHEELBASE))
    assert status_of(["check", str(path)]) == 0
    assert "left_steering_joint ends at -45.84 and 45.84 degrees: platform car?" in capsys.readouterr().out
