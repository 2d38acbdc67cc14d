"""A reference's clock that runs 10 % fast or slow is told as such, not as wheels of another size; and wheels
of another size are learned, not told as a clock."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from helpers.simulated_drives import drive, every_way, steered, tractor, two_wheels

import nmm
from nmm.base.errors import InputError
from nmm.plugins.robot.calibration.clocks import check_clocks, likeness, told_by_clocks
from nmm.plugins.robot.calibration.drives import RobotDrive, counters_of, drive_of
from nmm.plugins.robot.odometry import Counters

Array = np.ndarray
BASES: dict[str, Callable[[Array], Array]] = {
    "differential_base": two_wheels,
    "car_base": steered,
    "omni_base": every_way,
    "trailer_base": tractor,
}
LARGER = {"radius.left_wheel_joint": 0.11, "radius.right_wheel_joint": 0.11}


def steady(t: Array) -> Array:
    """Rates of two wheels, rad/s, straight ahead."""
    return np.full((len(t), 2), 5.0)


def by_another_clock(log: nmm.DriveLog, share: float) -> nmm.DriveLog:
    """The log with a reference whose clock runs faster by a share."""
    stamps = log.reference_t * (1.0 + share)
    return nmm.DriveLog(log.name, log.t, log.readings, stamps, log.reference, log.kind)


@pytest.mark.parametrize("kind", ["poses", "positions"])
@pytest.mark.parametrize("base", BASES)
def test_speeds_tell_the_clock(base: str, kind: str) -> None:
    """Fast and slow, to a percent or so, and nothing is said of clocks that run alike."""
    robot = nmm.load(base)
    log = drive(robot, inputs=BASES[base], kind=kind)
    counters = counters_of(robot, [log])
    check_clocks(counters, drive_of(robot, log, counters))
    for share, way in ((0.1, "fast"), (-0.1, "slow")):
        told = drive_of(robot, by_another_clock(log, share), counters)
        shares, alike = likeness(counters, told)
        assert shares[np.argmax(alike)] == pytest.approx(share, abs=0.015)
        check = check_clocks if kind == "poses" else refused
        with pytest.raises(InputError, match=rf"^drive: the reference's clock runs about \S+ % {way} beside"):
            check(counters, told)


def refused(counters: Counters, drive: RobotDrive) -> None:
    """Whatever a clock explains."""
    with told_by_clocks(counters, [drive]):
        raise InputError("what a clock explains", where="drive")


@pytest.mark.parametrize("rest", [0.2, 1.0, 4.0])
@pytest.mark.parametrize("ramp", [0.5, 2.0])
@pytest.mark.parametrize("seconds", [30.0, 60.0, 120.0])
def test_a_drive_straight_on_is_not_refused_for_a_clock(seconds: float, ramp: float, rest: float) -> None:
    """It speeds up once and brakes once: a faster clock leaves one of them out, and what is left fits."""
    robot = nmm.load("differential_base")

    def ahead(t: Array) -> Array:
        rate = np.clip(np.minimum(t - rest, seconds - rest - t) * 6.0 / ramp, 0.0, 6.0)
        return np.stack([rate, rate], axis=1)

    log = drive(robot, inputs=ahead, seconds=seconds)
    counters = counters_of(robot, [log])
    check_clocks(counters, drive_of(robot, log, counters))
    told = drive_of(robot, by_another_clock(log, 0.1), counters)
    shares, alike = likeness(counters, told)
    assert shares[np.argmax(alike)] == pytest.approx(0.1, abs=0.03)


def test_who_holds_the_clock_is_not_asked_about_it() -> None:
    robot = nmm.load("differential_base")
    log = by_another_clock(drive(robot, inputs=two_wheels), 0.1)
    with pytest.raises(InputError, match="the reference's clock runs about"):
        nmm.calibrate(robot, log)
    with pytest.raises(InputError) as raised:
        nmm.calibrate(robot, log, {"clock": 0.0})
    assert "clock runs" not in str(raised.value)


def test_a_short_part_of_a_drive_is_calibrated() -> None:
    robot = nmm.load("differential_base")
    log = drive(robot, inputs=two_wheels, rate=100.0, looks=50.0, seconds=10.0).part(4.0, 4.8)
    assert nmm.calibrate(robot, log, {"delay": 0.03}).learned


@pytest.mark.parametrize("seconds", [20.0, 30.0])
def test_of_curves_to_and_fro_larger_wheels_are_learned(seconds: float) -> None:
    robot = nmm.load("differential_base")
    found = nmm.calibrate(robot, drive(robot, LARGER, inputs=two_wheels, seconds=seconds))
    assert "size_or_clock" not in [one.code for one in found.findings]


@pytest.mark.parametrize("kind", ["poses", "positions"])
def test_larger_wheels_are_no_clock(kind: str) -> None:
    """They are learned; with such wheels a clock is told as well as with others."""
    robot = nmm.load("differential_base")
    log = drive(robot, LARGER, inputs=two_wheels, kind=kind)
    found = nmm.calibrate(robot, log)
    for name, radius in LARGER.items():
        assert found.numbers[name].after == pytest.approx(radius, rel=0.01)
    assert "size_or_clock" not in [one.code for one in found.findings]
    with pytest.raises(InputError, match=r"the reference's clock runs about .* % slow") as raised:
        nmm.calibrate(robot, by_another_clock(log, -0.1))
    assert len(str(raised.value)) <= 300
    assert "wheels disagree" not in str(raised.value)


def test_a_smaller_share_is_told_where_something_else_would_be() -> None:
    """3 % over a minute move the looks by two seconds: that was said to be late clocks."""
    robot = nmm.load("car_base")
    log = by_another_clock(drive(robot, inputs=steered), 0.03)
    with pytest.raises(InputError, match=r"the reference's clock runs about [23].* % fast"):
        nmm.calibrate(robot, log)


@pytest.mark.parametrize(("truth", "share"), [({}, -0.1), (LARGER, 0.0)], ids=["clock", "wheels"])
def test_of_steady_motion_both_are_said(truth: dict[str, float], share: float) -> None:
    """Where nothing speeds up, larger wheels and a slow clock are the same."""
    robot = nmm.load("differential_base")
    log = by_another_clock(drive(robot, truth, inputs=steady), share)
    (told,) = [one for one in nmm.calibrate(robot, log).findings if one.code == "size_or_clock"]
    assert told.values["larger"]
    assert told.values["by"] == pytest.approx(10.5, abs=1.0)
    assert told.values["clock"] == pytest.approx(9.5, abs=1.0)


def test_of_steady_motion_nothing_is_said_where_wheels_are_right() -> None:
    robot = nmm.load("differential_base")
    found = nmm.calibrate(robot, drive(robot, inputs=steady))
    assert "size_or_clock" not in [one.code for one in found.findings]
