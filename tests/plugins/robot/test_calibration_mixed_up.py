"""Logs whose counters or reference are mixed up are refused with what would fit; right ones are not."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from helpers.simulated_drives import drive, every_way, steered, tractor, two_wheels

import nmm
from nmm.base.errors import InputError
from nmm.plugins.robot.calibration.drives import counters_of, drive_of
from nmm.plugins.robot.calibration.mixed_up import check_mixed_up

Array = np.ndarray
LEFT, RIGHT = "left_wheel_joint", "right_wheel_joint"
MIRRORED = "the reference's y and heading the other way round"
SWAPPED = f"with {LEFT} and {RIGHT} swapped or {MIRRORED};"
#: The robots.
TWO, CAR, OMNI, TRAILER = "differential_base", "car_base", "omni_base", "trailer_base"
FRONT = ("front_left_wheel_joint", "front_right_wheel_joint")
FRONT_SWAPPED = "with {} and {} swapped;".format(*FRONT)
WHEELS = {f"radius.{LEFT}": 0.097, f"radius.{RIGHT}": 0.102, "track": 0.56}


def weaving(t: Array) -> Array:
    v, turn = 4.0 + 2.0 * np.sin(0.5 * t), 1.3 * np.cos(0.35 * t) + 1.0 * np.sin(0.9 * t)
    return np.stack([v - turn, v + turn], axis=1)


BASES: dict[str, tuple[dict[str, float], Callable[[Array], Array]]] = {
    TWO: (WHEELS, two_wheels),
    CAR: ({"wheelbase": 0.74, "offset.steering": 0.03, "ratio.steering": 1.04}, steered),
    OMNI: ({"half_length_plus_width": 0.53}, every_way),
    TRAILER: ({"track": 0.46, "H1": 0.27, "L1": 0.66}, tractor),
}


def log_of(base: str = "differential_base", **options: object) -> nmm.DriveLog:
    truth, inputs = BASES[base]
    given = {"truth": truth, "inputs": inputs, "seconds": 40.0} | options
    return drive(nmm.load(base), **given)  # type: ignore[arg-type]


def checked(base: str, log: nmm.DriveLog) -> None:
    robot = nmm.load(base)
    counters = counters_of(robot, [log])
    check_mixed_up(robot, counters, drive_of(robot, log, counters), {})


def swapped(log: nmm.DriveLog, first: str, second: str) -> nmm.DriveLog:
    told = {**log.readings, first: log.readings[second], second: log.readings[first]}
    return nmm.DriveLog(log.name, log.t, told, log.reference_t, log.reference, log.kind)


def scaled(log: nmm.DriveLog, seen: tuple[float, ...] = (), **by: float) -> nmm.DriveLog:
    told = {name: by.get(name, 1.0) * values for name, values in log.readings.items()}
    seen = seen or (1.0,) * log.reference.shape[1]
    return nmm.DriveLog(log.name, log.t, told, log.reference_t, log.reference * seen, log.kind)


def positions() -> nmm.DriveLog:
    return log_of(kind="positions")


MIXED: dict[str, tuple[str, Callable[[], nmm.DriveLog], str]] = {
    "wheels swapped": (TWO, lambda: swapped(log_of(), LEFT, RIGHT), SWAPPED),
    "wheels swapped, so that screening leaves nothing": (
        TWO,
        lambda: swapped(log_of(inputs=weaving, seconds=90.0), LEFT, RIGHT),
        SWAPPED,
    ),
    "a wheel's sign": (
        TWO,
        lambda: scaled(log_of(), left_wheel_joint=-1.0),
        f"with the other sign of {LEFT};",
    ),
    "both wheels' signs": (
        TWO,
        lambda: scaled(log_of(), left_wheel_joint=-1.0, right_wheel_joint=-1.0),
        "with the other sign of all wheels;",
    ),
    "a mirrored reference": (TWO, lambda: scaled(log_of(), (1.0, -1.0, -1.0)), MIRRORED),
    "a heading clockwise": (
        TWO,
        lambda: scaled(log_of(), (1.0, 1.0, -1.0)),
        "with the reference's heading the other way round;",
    ),
    "places mirrored": (
        TWO,
        lambda: scaled(positions(), (1.0, -1.0)),
        "the reference's y the other way round",
    ),
    "steering's sign": (CAR, lambda: scaled(log_of(CAR), steering=-1.0), "with the other sign of steering;"),
    "front wheels swapped": (CAR, lambda: swapped(log_of(CAR), *FRONT), FRONT_SWAPPED),
    "mecanum wheels swapped": (OMNI, lambda: swapped(log_of(OMNI), *FRONT), FRONT_SWAPPED),
    "a hitch's sign": (
        TRAILER,
        lambda: scaled(log_of(TRAILER), hitch1=-1.0),
        "with the other sign of hitch1;",
    ),
    "the second hitch's sign": (
        TRAILER,
        lambda: scaled(log_of(TRAILER), hitch2=-1.0),
        "with the other sign of hitch2;",
    ),
    "hitches swapped": (
        TRAILER,
        lambda: swapped(log_of(TRAILER), "hitch1", "hitch2"),
        "with hitch1 and hitch2 swapped;",
    ),
}
#: By cases, who disagrees, and of what it is a share.
OF_HITCHES = dict.fromkeys(
    ("a hitch's sign", "the second hitch's sign", "hitches swapped"),
    ("wheels and hitches", " of a hitch's turns; by "),
)


@pytest.mark.parametrize("case", MIXED)
def test_what_is_mixed_up_is_refused_with_what_would_fit(case: str) -> None:
    base, make, words = MIXED[case]
    with pytest.raises(InputError) as caught:
        nmm.calibrate(nmm.load(base), make())
    said = str(caught.value)
    who, share = OF_HITCHES.get(case, ("wheels and reference", " of the way; by "))
    assert said.startswith(f"calibrate {base}: drive: {who} disagree by "), said
    assert share in said, said
    assert words in said, said
    assert len(said) <= 300


RIGHT_LOGS: dict[str, tuple[str, Callable[[], nmm.DriveLog]]] = {
    **{base: (base, lambda base=base: log_of(base)) for base in BASES},  # type: ignore[misc]
    "straight ahead": (TWO, lambda: log_of(inputs=lambda t: np.full((len(t), 2), 5.0))),
    "a trailer straight ahead": (
        TRAILER, lambda: log_of(TRAILER, inputs=lambda t: np.full((len(t), 2), [0.5, 0.0]))
    ),
    "on the spot": (
        TWO, lambda: log_of(inputs=lambda t: 5.0 * np.sin(t)[:, np.newaxis] * [1.0, -1.0])
    ),
    "positions": (TWO, positions),
    "a reference mounted backwards": (TWO, lambda: log_of(mount=(0.2, 0.05, 3.0))),
    "a receiver of satellites": (
        TWO, lambda: log_of(kind="positions", place=0.3, looks=5.0, seconds=120.0)
    ),
    "wheels off by 30 %": (
        TWO, lambda: log_of(truth={f"radius.{LEFT}": 0.07, f"radius.{RIGHT}": 0.13})
    ),
    "much slip": (TWO, lambda: log_of(slip=0.2)),
    "another ratio of steering": (CAR, lambda: scaled(log_of(CAR), steering=1.0 / 5.5)),
}  # fmt: skip


@pytest.mark.parametrize("case", RIGHT_LOGS)
def test_right_logs_pass(case: str) -> None:
    """However far the file is off, and where a drive shows only some of its motion."""
    base, make = RIGHT_LOGS[case]
    checked(base, make())


@pytest.mark.parametrize("slip", [1.3, 2.0])
def test_skid_steering_with_much_slip_passes(slip: float) -> None:
    robot = nmm.load(OMNI, platform="skid_steer")
    log = drive(robot, {"left": 0.25 * slip, "right": -0.25 * slip}, inputs=two_wheels, seconds=40.0)
    counters = counters_of(robot, [log])
    check_mixed_up(robot, counters, drive_of(robot, log, counters), {})


def test_a_ratio_of_steering_that_is_far_off_is_told_with_its_value() -> None:
    with pytest.raises(InputError, match=r"ratio.steering would be \d"):
        nmm.calibrate(nmm.load(CAR), scaled(log_of(CAR), steering=1.0 / 5.5))
