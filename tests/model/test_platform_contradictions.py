"""A platform that is not what the file holds is told, with both numbers, and by `nmm check` and runs too."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from ackermann_car import RADIUS, TRACK, WHEELBASE, car
from findings import Expected, assert_found, every, holds
from urdf_parts import write

import nmm
from nmm import Finding
from nmm.cli.exit_status import status_of
from nmm.model.platforms import (
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
from nmm.model.robots.loading.provenance import provenance_of

AXLE = [
    FixedWheel(f"rear_{side}_wheel_joint", 0, y, RADIUS) for side, y in (("left", 0.28), ("right", -0.28))
]


def length(name: str, given: float, measured: float) -> Expected:
    return "platform_length_differs", {
        "name": name,
        "given": given,
        "measured": pytest.approx(measured, abs=1e-6),
    }


NARROW = pytest.approx(34.38, abs=0.01)
#: Robot, platform, and what is found.
FOUND: list[tuple[str, Platform, list[Expected]]] = [
    ("car_base", Car(5.0), [length("wheelbase", 5.0, 0.7)]),
    ("car_base", FrontDriveCar(0.72), [length("wheelbase", 0.72, 0.7)]),
    (
        "differential_base",
        DifferentialDrive(0.5, 2.0),
        [length("radius", 0.5, 0.1), length("track", 2.0, 0.5)],
    ),
    (
        "trailer_base",
        Tractor([Trailer(1.0, 0.25, "hitch1"), Trailer(0.7, joint="hitch2")]),
        [length("length of trailer hitch1", 1.0, 0.7)],
    ),
    ("omni_base", Mecanum(0.1, 1.0, 0.5), [length("length", 1.0, 0.5)]),
    ("car_base", Unicycle(), [("steering_too_narrow", {"name": "steering", "upper": NARROW})]),
    (
        "car_base",
        DifferentialDrive(0.1, 0.5),
        [("steering_too_narrow", {"platform": "differential", "name": "steering"})],
    ),
    ("differential_base", Mecanum(0.1, 0.5, 0.5), [("platform_misfit", {"platform": "mecanum"})]),
    ("differential_base", Omnidirectional(), [("moves_sideways", {"platform": "omnidirectional"})]),
    (
        "car_base",
        WheeledPlatform([*AXLE, SteeredWheel("front", 0.7, 0, 0.12, joint="steering")]),
        [length(f"radius of rear_{side}_wheel_joint", RADIUS, 0.12) for side in ("left", "right")],
    ),
]


@pytest.mark.parametrize(("name", "platform", "expected"), FOUND)
def test_what_the_file_says_otherwise_is_found(
    name: str, platform: Platform, expected: list[Expected]
) -> None:
    robot = nmm.load(name, platform=platform)
    found = provenance_of(robot).contradictions
    for code, values in expected:
        assert sum(holds(one, code, **values) for one in found) == 1, found
    assert all(one in robot.notes for one in found)


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
    assert_found(provenance_of(robot).contradictions, length("wheelbase", 5.0, WHEELBASE))
    robot = nmm.load(path, platform=DifferentialDrive(RADIUS, 0.4))
    narrow: Expected = ("steering_too_narrow", {"platform": "differential"})
    assert_found(provenance_of(robot).contradictions, narrow, narrow, length("track", 0.4, TRACK))


def test_a_wheels_radius_against_its_shape(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """In mm by mistake, or by more than 1 %: loading tells it, and so do runs, check and info."""
    joints = ("left_wheel_joint", "right_wheel_joint")
    near = nmm.load("unicycle_2r", wheels=dict.fromkeys(joints, 0.1009))
    assert provenance_of(near).contradictions == ()
    wide = dict(zip(joints, (100.0, 0.1), strict=True))
    robot = nmm.load("unicycle_2r", wheels=wide)
    told: Expected = ("wheel_radius_differs", {"name": joints[0], "given": 100.0, "measured": 0.1})
    assert_found(provenance_of(robot).contradictions, told)
    assert_found([note for note in robot.notes if note.code == told[0]], told)
    asked = ("--wheels", ",".join(f"{name}={radius}" for name, radius in wide.items()))
    for command in ("check", "info"):
        assert status_of([command, "unicycle_2r", *asked]) == 0
        printed = capsys.readouterr()
        assert joints[0] in printed.err + printed.out
        assert "100 m as given" in printed.err + printed.out
    changes = {"robot.wheels": wide, "duration": 0.05, "q0": {"q2": 1}, "resolver": {"kind": "pg"}}
    run = nmm.Scenario.load("unicycle_2r_position", changes).run()
    assert_found(every(run, told[0]), told)


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
    found = every(scenario.run(), "platform_length_differs")
    assert_found(found, length("radius", 0.3, 0.1))


def test_check_warns_of_a_unicycle_that_is_a_car(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write(tmp_path / "car.urdf", car(front=-WHEELBASE))
    assert status_of(["check", str(path), "--platform", "unicycle"]) == 0
    capsys.readouterr()
    assert status_of(["check", str(path), "--json", "--platform", "unicycle"]) == 0
    found = [Finding.from_json(one) for one in json.loads(capsys.readouterr().out)["warnings"]]
    assert any(holds(one, "steering_too_narrow", name="left_steering_joint") for one in found)
