"""What a calibration refuses or doubts: values to hold, logs given twice, jumps, drives that do not close."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from helpers.simulated_drives import drive

import nmm
from nmm.base.errors import InputError

Array = np.ndarray
LEFT, RIGHT = "radius.left_wheel_joint", "radius.right_wheel_joint"
WHEELS = ("left_wheel_joint", "right_wheel_joint")
TRUTH = {LEFT: 0.0986, RIGHT: 0.0994, "track": 0.54}
MOUNT = {"reference.x": 0.18, "reference.y": -0.06, "reference.yaw": 0.05, "delay": 0.03, "clock": 0.0}
#: The look from which on something is otherwise.
FROM = 300


def curves(t: Array) -> Array:
    """Wheels' rates (N, 2), rad/s, for curves to both sides."""
    v, turn = 4.0 + 2.0 * np.sin(0.5 * t), 1.3 * np.cos(0.35 * t) + 1.0 * np.sin(0.9 * t)
    return np.stack([v - turn, v + turn], axis=1)


@cache
def robot() -> nmm.Robot:
    return nmm.load("differential_base")


@cache
def log(**options: Any) -> nmm.DriveLog:
    mount = tuple(MOUNT[f"reference.{name}"] for name in ("x", "y", "yaw"))
    return drive(robot(), TRUTH, **{"inputs": curves, "mount": mount, **options})


def seen_otherwise(seen: Array) -> nmm.DriveLog:
    one = log()
    return nmm.DriveLog("drive", one.t, one.readings, one.reference_t, seen, "poses")


def far_off(found: nmm.Calibration) -> dict[str, float]:
    """By how many deviations numbers are off."""
    return {
        n: abs(found.numbers[n].after - (TRUTH | MOUNT)[n]) / found.numbers[n].deviation
        for n in found.learned
    }


def codes(found: nmm.Calibration) -> list[str]:
    return [finding.code for finding in found.findings]


HELD: list[tuple[Any, str]] = [
    ({"track": 1e308}, "hold track: expected 0.15 to 1.5 m, got 1e+308"),
    ({"track": 1e-300}, "hold track: expected 0.15 to 1.5 m, got 1e-300"),
    ({"track": float("nan")}, "hold track: expected finite"),
    ({LEFT: -0.1}, f"hold {LEFT}: expected 0.03 to 0.3 m, got -0.1"),
    ({"reference.x": 1e308}, "hold reference.x: expected -10 to 10 m"),
    ({"reference.yaw": 90.0}, "hold reference.yaw: expected -6.28 to 6.28 rad, got 90"),
    ({"clock": 1.0}, "hold clock: expected -0.01 to 0.01, got 1"),
    ({"delay": 5}, "hold delay: expected -1 to 1 s, got 5"),
    ({"track": "wide"}, "hold track: expected"),
    (5, "hold: expected names of numbers, or values by name"),
    ([0.5], "hold: expected names of numbers, or values by name"),
]


@pytest.mark.parametrize(("hold", "said"), HELD, ids=[said for _, said in HELD])
def test_what_is_held_is_a_number_of_such_a_robot(hold: Any, said: str) -> None:
    with pytest.raises(InputError) as caught:
        nmm.calibrate(robot(), log(), hold=hold)
    assert said in str(caught.value)
    assert str(caught.value).startswith("calibrate differential_base: hold")


def test_a_log_counts_once() -> None:
    one = log()
    again = nmm.DriveLog("again", one.t, one.readings, one.reference_t, one.reference, one.kind)
    half = one.part(10.0, 50.0)
    for logs in ([one, again], [one, one], [one, half]):
        with pytest.raises(InputError, match="have the same counts at the same stamps"):
            nmm.calibrate(robot(), logs)


def test_after_a_jump_noise_is_what_it_is() -> None:
    """Noise that explained the jump is not where the search for it goes on."""
    seen = log().reference.copy()
    seen[FROM:, 0] += 0.5
    found = nmm.calibrate(robot(), seen_otherwise(seen))
    assert max(far_off(found).values()) < 3.0, far_off(found)
    assert found.noise.place == pytest.approx(0.003, rel=0.2)
    assert found.noise.heading == pytest.approx(0.003, rel=0.2)
    assert found.noise.counters == pytest.approx(0.01, rel=0.3)
    assert found.whiteness > 0.01
    assert "reference_jumped" in codes(found)
    assert found.held_out is not None
    assert found.held_out.verdict == "better"


@pytest.mark.parametrize(("turn", "step"), [(0.3, 0.0), (1.0, 5.0)])
def test_a_heading_that_jumps_beside_places_is_not_used(turn: float, step: float) -> None:
    """A marker twisted, a compass disturbed: what is learned is right, and it is said."""
    seen = log().reference.copy()
    seen[FROM:] += [step, 0.0, turn]
    found = nmm.calibrate(robot(), seen_otherwise(seen))
    assert max(far_off(found).values()) < 3.0, far_off(found)
    told = next(finding for finding in found.findings if finding.code == "reference_twisted")
    assert told.values["by"] == pytest.approx(turn, abs=0.02)
    assert told.where["t"] == pytest.approx(log().reference_t[FROM])
    assert found.whiteness > 0.01
    assert found.held_out is not None
    assert found.held_out.verdict == "better"


def test_a_reference_that_was_moved_on_the_robot_is_refused() -> None:
    seen = log().reference.copy()
    heading = seen[FROM:, 2] - MOUNT["reference.yaw"]
    seen[FROM:, :2] += 0.1 * np.stack([np.cos(heading), np.sin(heading)], axis=1)
    with pytest.raises(InputError, match=r"drive: from \S+ s on reference.x is [+-]0.1 m beside"):
        nmm.calibrate(robot(), seen_otherwise(seen))


def ends(first: float, last: float) -> nmm.DriveLog:
    """A part of the drive, which goes somewhere, said to close."""
    one = log().part(first, last)
    return nmm.DriveLog.closed(f"from {first:g} s", one.t, one.readings)


def test_drives_that_do_not_close_teach_nothing() -> None:
    for logs in ([ends(0.0, 30.0), ends(20.0, 60.0)], ends(0.0, 60.0)):
        with pytest.raises(InputError, match="drives that end on the marks") as caught:
            nmm.calibrate(robot(), logs)
        assert len(str(caught.value)) <= 300


def test_what_one_closed_drive_shows_given_others_is_not_shown() -> None:
    """A square that closes, of wheels that do not: too small a track, or unequal wheels?"""
    t = np.linspace(0.0, 16.0, 801)
    ahead = np.where(t % 4.0 < 2.0, 0.5, 0.0)
    turn = np.where(t % 4.0 < 2.0, 0.0, np.pi / 4.0)
    left, right = ((np.cumsum(ahead + side * 0.5 * 0.51 * turn) * 0.02) / 0.1 for side in (-1.0, 1.0))
    found = nmm.calibrate(
        robot(), nmm.DriveLog.closed("square", t, dict(zip(WHEELS, (left, right), strict=True)))
    )
    assert not found.learned
    assert {number.why for number in found.numbers.values()} == {"not shown"}
    assert not found.file().numbers


def verdict(**told: Any) -> str:
    usual = {"windows": 15, "length": 2.0, "before": 0.1, "after": 0.01, "heading_before": 0.1}
    usual |= {"heading_after": 0.01, "share": 0.005, "left": 0.1, "p": 1e-4, "closer": True}
    return nmm.extending.HeldOut(**(usual | told)).verdict


def test_better_is_what_leaves_little() -> None:
    assert verdict() == "better"
    assert verdict(left=0.97) == "no difference"
    assert verdict(share=0.3) == "far off"
    assert verdict(p=0.06) == "no difference"
    assert verdict(closer=False, left=1.2) == "worse"
    assert verdict(closer=False, left=1.2, share=0.3) == "worse"


def test_on_the_spot_the_delay_is_found() -> None:
    """Wheels go nowhere then, while a reference beside the axle does: that says nothing of clocks."""
    found = nmm.calibrate(
        robot(), log(inputs=lambda t: 5.0 * np.sin(t)[:, np.newaxis] * [1.0, -1.0], seconds=40.0)
    )
    assert found.numbers["delay"].after == pytest.approx(0.03, abs=5.0 * found.numbers["delay"].deviation)
    apart = 0.54 * 0.1 / 0.099  # radii are held at the file's, of which turns show the track's share alone
    assert found.numbers["track"].after == pytest.approx(apart, abs=5.0 * found.numbers["track"].deviation)
