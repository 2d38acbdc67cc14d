"""`nmm.calibrate`: what drives show of a robot's numbers, what they do not, and what is refused."""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers.simulated_drives import composed, drive, every_way, placed, steered, tractor, two_wheels
from scipy.optimize import least_squares

import nmm
from nmm.base.errors import InputError
from nmm.plugins.robot.calibration.report import rest_rows
from nmm.plugins.robot.calibration.stretches import stretches
from nmm.plugins.robot.odometry import Counters

Array = np.ndarray
MOUNT = {"reference.x": 0.2, "reference.y": 0.05, "reference.yaw": 0.1, "delay": 0.03}
#: Of clocks that run alike.
CLOCK = {"clock": 0.0}
LEFT, RIGHT = "radius.left_wheel_joint", "radius.right_wheel_joint"


#: Of a robot the numbers that it truly has, and its inputs.
TRUTHS: dict[str, tuple[dict[str, float], Callable[[Array], Array]]] = {
    "differential_base": ({LEFT: 0.097, RIGHT: 0.102, "track": 0.56}, two_wheels),
    "car_base": (
        {"wheelbase": 0.74, "track": 0.58, "offset.steering": 0.03, "ratio.steering": 1.04},
        steered,
    ),
    "omni_base": ({"radius.front_left_wheel_joint": 0.098, "half_length_plus_width": 0.53}, every_way),
    "trailer_base": ({LEFT: 0.101, "track": 0.46, "H1": 0.27, "L1": 0.66, "L2": 0.74}, tractor),
}


@cache
def robot_of(name: str = "differential_base") -> nmm.Robot:
    return nmm.load(name)


def log_of(robot: str = "differential_base", **options: Any) -> nmm.DriveLog:
    truth, inputs = TRUTHS[robot]
    return drive(robot_of(robot), options.pop("truth", truth), **{"inputs": inputs, **options})


@cache
def calibration(robot: str = "differential_base", **options: Any) -> nmm.Calibration:
    return nmm.calibrate(robot_of(robot), log_of(robot, **options))


def off(found: nmm.Calibration, truth: dict[str, float]) -> dict[str, float]:
    """By how many standard deviations numbers that were learned are off."""
    known = (
        {name: number.value for name, number in nmm.robot_numbers(found.robot).items()}
        | MOUNT
        | CLOCK
        | truth
    )
    numbers = found.numbers
    for kind in ("delay", "clock"):  # of several drives
        known |= {n: known.get(n, known[kind]) for n in numbers if n.startswith(f"{kind}.")}
    return {n: (numbers[n].after - known[n]) / numbers[n].deviation for n in found.learned}


def codes(found: nmm.Calibration) -> list[str]:
    return [finding.code for finding in found.findings]


@pytest.mark.parametrize("name", TRUTHS)
def test_the_robots_own_numbers_come_back(name: str) -> None:
    """Off by no more than their deviations say (5 of them), which are small."""
    truth, found = TRUTHS[name][0], calibration(name)
    far = off(found, truth)
    assert {*truth, *MOUNT} <= {*far}
    assert max(map(abs, far.values())) < 5.0, far
    for number in truth:
        learned = found.numbers[number]
        assert learned.deviation < 0.02 * max(abs(learned.before), 0.5), number
    assert found.held_out is not None
    assert found.held_out.verdict == "better"
    assert found.held_out.after < 0.5 * found.held_out.before
    assert found.whiteness > 1e-4
    assert found.covariance.shape == (len(found.learned),) * 2
    assert np.sqrt(np.diag(found.covariance)) == pytest.approx(
        [found.numbers[n].deviation for n in found.learned]
    )


def test_a_robot_with_hitches_is_told_what_they_turn_by_themselves() -> None:
    rows = {name: [*rest_rows(calibration(name))] for name in ("differential_base", "trailer_base")}
    assert "noise of a hitch" not in [row[0] for row in rows["differential_base"]]
    assert ["noise of a hitch", "0.05 mrad from look to look"] in rows["trailer_base"]


def test_noise_is_what_was_put_in() -> None:
    found = calibration(place=0.004, heading=0.002, slip=0.03)
    noise, as_filters = found.noise, found.filter_noise
    assert as_filters["spread"] == pytest.approx(0.03**2, rel=0.3)
    still, P = {"left_wheel_joint": 0.0, "right_wheel_joint": 0.0}, np.eye(3)
    nmm.PoseFilter(found.calibrated, found.robot.rest, still, 0.0, covariance=P, **as_filters)
    assert noise.place == pytest.approx(0.004, rel=0.15)
    assert noise.heading == pytest.approx(0.002, rel=0.15)
    assert noise.counters == pytest.approx(0.03, rel=0.15)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_wheels_that_disagree_show_how_noisy_they_are(seed: int) -> None:
    """Four of them, for three inputs: where a short drive leaves open what the ground did and what they did,
    it is no less than that."""
    robot, rng = nmm.load("omni_base", platform="mecanum"), np.random.default_rng(seed)
    log = drive(robot, inputs=every_way, seconds=30.0, slip=0.0, place=0.005, heading=0.005, seed=seed)
    readings = {}
    for name, values in log.readings.items():
        steps = 0.01 * np.sqrt(np.abs(np.diff(values))) * rng.normal(size=len(values) - 1)
        readings[name] = values + np.concatenate([[0.0], np.cumsum(steps)])
    found = nmm.calibrate(robot, replace(log, readings=readings))
    assert found.noise.counters == pytest.approx(0.01, rel=0.2)
    assert max(map(abs, off(found, {}).values())) < 4.0


def test_least_squares_of_a_plain_model_finds_the_same() -> None:
    """Without slip, the likelihood is that of poses beside one dead-reckoned path: least squares by numeric
    derivatives of all its numbers, the first pose among them. A reference that is good to a hundredth of a
    mm."""
    log = log_of(slip=0.0, delay=0.0, seconds=30.0, place=1e-5, heading=1e-5)
    found = nmm.calibrate(robot_of(), log, hold={"delay": 0.0, "clock": 0.0})
    used = found.model.drives[0]
    counts = np.stack([log.readings[n] for n in found.model.counters.names], axis=1)

    def residuals(numbers: Array) -> Array:
        left, right, track, x, y, yaw, *first = numbers
        ways = counts * [left, right]
        grid = np.linspace(used.at[0], used.at[-1], 8 * (len(used.at) - 1) + 1)
        steps = np.diff(np.stack([np.interp(grid, log.t, way) for way in ways.T], axis=1), axis=0)
        turns, went = (steps[:, 1] - steps[:, 0]) / track, steps.mean(axis=1)
        share = np.sinc(turns / (2.0 * np.pi))
        motions = np.stack(
            [went * share * np.cos(turns / 2), went * share * np.sin(turns / 2), turns], axis=1
        )
        pose = composed(np.vstack([first, motions]))[1:]
        return ((used.z - placed(pose[::8], (x, y, yaw))) * 1e5).ravel()

    start = np.array([0.1, 0.1, 0.5, 0.0, 0.0, 0.0, *used.z[0]])
    plain = least_squares(residuals, start).x[:6]
    ours = np.array([found.numbers[name].after for name in found.learned[:6]])
    assert found.learned[:6] == [LEFT, RIGHT, "track", "reference.x", "reference.y", "reference.yaw"]
    assert ours == pytest.approx(plain, abs=3e-5)
    assert np.abs(plain - start[:6]).max() > 0.05


def test_a_straight_drive_shows_no_track() -> None:
    found = calibration(inputs=lambda t: np.full((len(t), 2), 5.0), seconds=20.0)
    assert {n for n, x in found.numbers.items() if x.why == "not shown"} >= {"track", "reference.x", "delay"}
    assert {LEFT, RIGHT, "reference.yaw"} <= {*found.learned}
    assert found.numbers["track"].after == 0.5
    assert found.numbers["delay"].after == 0.0
    told = next(f for f in found.findings if f.code == "not_shown" and f.values["name"] == "track")
    assert "turn on the spot" in str(told)


def test_turning_on_the_spot_shows_no_radius() -> None:
    found = calibration(inputs=lambda t: 5.0 * np.sin(t)[:, np.newaxis] * [1.0, -1.0], seconds=20.0)
    assert {n for n, x in found.numbers.items() if x.why == "not shown"} >= {LEFT, RIGHT}
    assert "track" in found.learned
    named = [f.values["name"] for f in found.findings if f.code == "not_shown"]
    assert {LEFT, RIGHT} <= {*named}


def test_what_is_held_stays() -> None:
    log = log_of()
    found = nmm.calibrate(robot_of(), log, hold=["track"])
    assert (found.numbers["track"].after, found.numbers["track"].why) == (0.5, "held")
    found = nmm.calibrate(robot_of(), log, hold={"track": 0.56, "delay": 0.03})
    assert (found.numbers["track"].after, found.numbers["track"].deviation) == (0.56, 0.0)
    assert found.numbers[LEFT].after == pytest.approx(0.097, abs=5 * found.numbers[LEFT].deviation)
    with pytest.raises(InputError, match="track"):
        nmm.calibrate(robot_of(), log, hold=["trakc"])


def test_positions_are_enough() -> None:
    found = calibration(kind="positions")
    assert "reference.yaw" not in found.numbers
    assert max(map(abs, off(found, TRUTHS["differential_base"][0]).values())) < 5.0


def test_drives_with_several_looks_count_together() -> None:
    logs = [
        log_of(seed=i, seconds=30.0, name=f"drive {i}", looks=looks, inputs=after(30.0 * i))
        for i, looks in enumerate((10, 5))
    ]
    both = nmm.calibrate(robot_of(), logs)
    one = nmm.calibrate(robot_of(), logs[0])
    assert max(map(abs, off(both, TRUTHS["differential_base"][0]).values())) < 5.0
    assert both.numbers["track"].deviation < one.numbers["track"].deviation


def after(seconds: float) -> Callable[[Array], Array]:
    """What the wheels do later."""
    return lambda t: two_wheels(t + seconds)


def test_each_drive_has_its_own_delay() -> None:
    late = {"delay.1": 0.03, "delay.2": 0.28}
    logs = [
        log_of(seed=i, seconds=30.0, delay=delay, inputs=after(30.0 * i))
        for i, delay in enumerate(late.values())
    ]
    found = nmm.calibrate(robot_of(), logs)
    assert {*late} <= {*found.learned}
    assert max(map(abs, off(found, TRUTHS["differential_base"][0] | late).values())) < 5.0
    assert found.whiteness > 1e-4


def test_delays_of_all_drives_or_of_one_are_held() -> None:
    logs = [log_of(seed=i, seconds=10.0, inputs=after(10.0 * i)) for i in range(2)]
    found = nmm.calibrate(robot_of(), logs, hold={"delay": 0.03, "delay.2": 0.02, "clock": None})
    held = {name: number.after for name, number in found.numbers.items() if number.why == "held"}
    assert held == {"delay.1": 0.03, "delay.2": 0.02, "clock.1": 0.0, "clock.2": 0.0}
    with pytest.raises(InputError, match=r"delay\.2"):
        nmm.calibrate(robot_of(), logs, hold=["delay.3"])


def test_a_drive_that_stands_still_at_last_is_calibrated() -> None:
    """What is held out has no window to go along."""
    log = log_of(inputs=lambda t: two_wheels(t) * (t < 12.0)[:, np.newaxis], seconds=30.0)
    found = nmm.calibrate(robot_of(), log)
    assert found.held_out is None
    assert max(map(abs, off(found, TRUTHS["differential_base"][0]).values())) < 5.0


def test_counters_that_are_only_rolled_along_are_not_made_smaller_by_their_noise() -> None:
    """Front wheels of a car whose encoders slip (they do not move it) are compared with the others over long
    windows: by looks 0.05 s apart, their radii seemed smaller by the noise's share, together by 7 of their
    deviations."""
    log, rng = log_of("car_base", slip=0.0, looks=20.0, seconds=120.0), np.random.default_rng(0)
    front = ("front_left_wheel_joint", "front_right_wheel_joint")
    readings = dict(log.readings)
    for name in front:
        steps = np.diff(readings[name], prepend=readings[name][0])
        readings[name] = readings[name] + np.cumsum(
            0.04 * np.sqrt(np.abs(steps)) * rng.normal(size=len(steps))
        )
    slipping = nmm.DriveLog(log.name, log.t, readings, log.reference_t, log.reference, log.kind)
    found = nmm.calibrate(robot_of("car_base"), slipping)
    far = off(found, TRUTHS["car_base"][0])
    assert abs(sum(far[f"radius.{name}"] for name in front)) < 4.0


def test_ten_minutes_at_100_hz_take_no_more_than_four_times_their_memory() -> None:
    log = log_of("car_base", seconds=600.0, rate=100.0, looks=100.0)
    arrays = (log.t, log.reference_t, log.reference, *log.readings.values())
    nmm.calibrate(robot_of("car_base"), log_of("car_base", seconds=5.0))  # what is loaded once
    tracemalloc.start()
    found = nmm.calibrate(robot_of("car_base"), log)
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most < 4.0 * sum(array.nbytes for array in arrays)
    assert found.held_out is not None


def with_reference(log: nmm.DriveLog, t: Array, seen: Array) -> nmm.DriveLog:
    return nmm.DriveLog(log.name, log.t, log.readings, t, seen, log.kind)


def test_outliers_are_left_out_and_jumps_begun_anew() -> None:
    log = log_of()
    seen = log.reference.copy()
    seen[100, 0] += 1.0
    seen[177, 2] += 0.5
    c, s = np.cos(0.1), np.sin(0.1)
    x, y, yaw = seen[300:].T
    seen[300:] = np.stack([c * x - s * y + 0.5, s * x + c * y + 0.2, yaw + 0.1], axis=1)
    found = nmm.calibrate(robot_of(), with_reference(log, log.reference_t, seen))
    assert max(map(abs, off(found, TRUTHS["differential_base"][0]).values())) < 5.0
    told = {f.code: f for f in found.findings}
    assert told["looks_left_out"].values["count"] == 2
    assert told["reference_jumped"].values["count"] == 1
    assert told["reference_jumped"].where["t"] == pytest.approx(log.reference_t[300])
    assert found.noise.place == pytest.approx(0.003, rel=0.2)


def test_clocks_that_run_apart_are_told() -> None:
    log = log_of()
    found = nmm.calibrate(robot_of(), with_reference(log, 1.001 * log.reference_t, log.reference))
    told = next(f for f in found.findings if f.code == "clocks_apart")
    assert told.values["faster"]
    assert told.values["rate"] == pytest.approx(60.0, rel=0.3)
    assert found.numbers["clock"].after == pytest.approx(1e-3, abs=5 * found.numbers["clock"].deviation)
    clock = {"clock": 1e-3, "delay": 0.03 + 1e-3 * 30.0}  # in the middle of the drive
    truth = TRUTHS["differential_base"][0] | clock
    assert max(map(abs, off(found, truth).values())) < 5.0
    assert "clocks_apart" not in codes(calibration())


@pytest.mark.parametrize("delay", [-0.4, 0.5])
def test_a_clock_half_a_second_off_is_found(delay: float) -> None:
    found = calibration(delay=delay)
    assert found.numbers["delay"].after == pytest.approx(delay, abs=5 * found.numbers["delay"].deviation)


def test_nothing_is_better_where_the_file_is_right() -> None:
    found = calibration(truth=(), seconds=40.0)
    assert found.held_out is not None
    assert found.held_out.verdict == "no difference"
    assert "not_better" in codes(found)


def test_a_reference_that_is_often_looked_at_is_thinned() -> None:
    found = calibration(looks=50.0, seconds=30.0)
    told = next(f for f in found.findings if f.code == "looks_thinned")
    assert told.values["every"] == 3
    assert max(map(abs, off(found, TRUTHS["differential_base"][0]).values())) < 5.0


def closed(sign: float, seed: int) -> nmm.DriveLog:
    """A square of 4 m that truly closes, of which only that is known."""
    truth = {LEFT: 0.0998, RIGHT: 0.1002, "track": 0.505}
    true, rng = nmm.with_numbers(robot_of(), truth), np.random.default_rng(seed)
    names = ("left_wheel_joint", "right_wheel_joint")
    M, B = Counters(true, dict.fromkeys(names, 0.0), "square").matrix(np.zeros(0))
    legs = np.array([[4.0, 0.0, 0.0], [0.0, 0.0, sign * 0.5 * np.pi]] * 4)
    steps = np.repeat(legs @ (M @ np.linalg.pinv(B)).T / 200.0, 200, axis=0)
    steps = steps + 0.01 * rng.normal(size=steps.shape) * np.sqrt(np.abs(steps))
    counts = np.vstack([[0.0, 0.0], np.cumsum(steps, axis=0)])
    t = 0.02 * np.arange(len(counts))
    return nmm.DriveLog.closed(f"{sign:g} {seed}", t, dict(zip(names, counts.T, strict=True)))


def test_closed_squares_show_unequal_wheels_and_track_as_umbmark_does() -> None:
    logs = [closed(sign, seed) for seed in range(5) for sign in (1.0, -1.0)]
    found = nmm.calibrate(robot_of(), logs)
    left, right, track = (found.numbers[name] for name in (LEFT, RIGHT, "track"))
    assert left.after + right.after == pytest.approx(0.2, abs=1e-12)
    assert right.after / left.after == pytest.approx(0.1002 / 0.0998, abs=5e-4)
    assert abs(track.after - 0.505) < 5.0 * track.deviation
    assert track.deviation < 0.005
    assert "scale_held" in codes(found)
    assert found.held_out is not None
    assert found.held_out.verdict == "better"
    paper = nmm.UMBmark.from_logs(robot_of(), logs)
    assert paper.E_d == pytest.approx(right.after / left.after, abs=1e-3)
    assert paper.true_track == pytest.approx(track.after, rel=5e-3)


def test_squares_of_one_direction_do_not_tell_wheels_from_track() -> None:
    found = nmm.calibrate(robot_of(), [closed(1.0, seed) for seed in range(3)])
    assert {n for n, x in found.numbers.items() if x.why == "not shown"}


def test_the_calibrated_robot_moves_as_the_true_one() -> None:
    truth, _ = TRUTHS["differential_base"]
    found, log = calibration(), log_of(slip=0.0)
    names = ("left_wheel_joint", "right_wheel_joint")
    counts = np.stack([log.readings[name] for name in names], axis=1)

    def end(robot: nmm.Robot) -> Array:
        record = Counters(robot, dict.fromkeys(names, 0.0), "end").record
        return stretches(record, log.t, counts, np.zeros((len(log.t), 0)), log.t[[0, -1]]).motions[0]

    true = end(nmm.with_numbers(robot_of(), truth))
    assert np.linalg.norm(end(found.calibrated) - true) < 0.1 * np.linalg.norm(end(robot_of()) - true)


def test_a_saved_calibration_is_loaded_with_the_robot(tmp_path: Path) -> None:
    found, file = calibration(), tmp_path / "calibration.yaml"
    found.save(file)
    for given in (file, found):
        loaded = nmm.load("differential_base", calibration=given)
        learned = {name: found.numbers[name].after for name in (LEFT, RIGHT, "track")}
        assert loaded.changed_numbers == pytest.approx(learned)
    kept = nmm.CalibrationFile.load(file)
    assert kept.numbers["track"].deviation == pytest.approx(found.numbers["track"].deviation)
    assert kept.measured["delay"]["value"] == pytest.approx(found.numbers["delay"].after)
    with pytest.raises(InputError, match="unicycle"):
        nmm.load("unicycle_2r", calibration=found)


def test_a_number_of_an_earlier_calibration_that_is_held_stays_in_the_file(tmp_path: Path) -> None:
    before = nmm.with_numbers(robot_of(), {"track": 0.53})
    found = nmm.calibrate(before, log_of(), hold="track")
    found.save(tmp_path / "calibration.yaml")
    loaded = nmm.load("differential_base", calibration=tmp_path / "calibration.yaml")
    assert loaded.changed_numbers == pytest.approx(dict(found.calibrated.changed_numbers))
    assert loaded.changed_numbers["track"] == 0.53


def test_a_calibration_of_positions_or_of_closed_drives_is_saved_too(tmp_path: Path) -> None:
    squares = [closed(1.0, 0), closed(-1.0, 1)]
    for found in (calibration(kind="positions"), nmm.calibrate(robot_of(), squares)):
        found.save(tmp_path / "calibration.yaml")
        assert nmm.CalibrationFile.load(tmp_path / "calibration.yaml").robot == "differential_base"


def test_a_held_number_is_not_judged_by_the_files() -> None:
    found = nmm.calibrate(robot_of(), log_of(), hold={"track": 0.56, "reference.x": 0.2, "delay": 0.03})
    assert found.held_out is not None
    assert found.held_out.verdict == "better"


def test_steering_that_was_calibrated_is_calibrated_again() -> None:
    truth = TRUTHS["car_base"][0]
    steering = {name: truth[name] for name in ("offset.steering", "ratio.steering")}
    first = nmm.with_numbers(robot_of("car_base"), steering)
    again = nmm.calibrate(first, log_of("car_base"))
    assert again.numbers["ratio.steering"].before == 1.04
    assert max(map(abs, off(again, truth).values())) < 5.0
    assert again.calibrated.corrections["steering"] == pytest.approx((1.04, 0.03), abs=0.01)


def test_a_few_outliers_hide_nothing() -> None:
    log = log_of(seconds=15.0)
    seen = log.reference.copy()
    seen[[20, 55, 90, 120], 0] += 5.0
    found = nmm.calibrate(robot_of(), with_reference(log, log.reference_t, seen))
    assert {*TRUTHS["differential_base"][0], "delay"} <= {*found.learned}
    assert max(map(abs, off(found, TRUTHS["differential_base"][0]).values())) < 5.0


def test_a_receiver_of_satellites_is_no_other_unit() -> None:
    found = calibration(kind="positions", place=0.3, looks=5.0, seconds=120.0)
    assert found.noise.place == pytest.approx(0.3, rel=0.2)
    assert {LEFT, RIGHT} <= {*found.learned}
    assert max(map(abs, off(found, TRUTHS["differential_base"][0]).values())) < 5.0


def test_poses_and_positions_go_together() -> None:
    positions = log_of(name="positions", kind="positions", seed=3, seconds=30.0, inputs=after(30.0))
    found = nmm.calibrate(robot_of(), [log_of(name="poses", seconds=30.0), positions])
    assert "reference.yaw" in found.learned
    assert max(map(abs, off(found, TRUTHS["differential_base"][0]).values())) < 5.0


def test_a_radius_that_is_held_tells_closed_drives_their_scale() -> None:
    logs = [closed(sign, seed) for seed in range(3) for sign in (1.0, -1.0)]
    found = nmm.calibrate(robot_of(), logs, hold={LEFT: 0.0998})
    assert found.numbers[RIGHT].after == pytest.approx(0.1002, abs=5e-4)
    assert found.numbers["track"].after == pytest.approx(0.505, abs=5.0 * found.numbers["track"].deviation)
    assert "scale_held" not in codes(found)


def test_encoders_that_said_nothing_for_long_are_told() -> None:
    log = log_of()
    kept = (log.t < 20.0) | (log.t > 24.0)
    readings = {name: values[kept] for name, values in log.readings.items()}
    other = nmm.DriveLog("gap", log.t[kept], readings, log.reference_t, log.reference, "poses")
    found = nmm.calibrate(robot_of(), other)
    assert next(f for f in found.findings if f.code == "counters_silent").values["count"] == 1
    assert "reference_jumped" not in codes(found)
    assert max(map(abs, off(found, TRUTHS["differential_base"][0]).values())) < 5.0


def test_counted_inputs_are_told_to_be_the_logs_own() -> None:
    """Of an arm, which wheels do not show, what was known stays."""
    robot = nmm.with_numbers(nmm.load("unicycle_2r"), {"offset.q1": 0.1, "origin.ee.x": 0.02})
    t = np.linspace(0.0, 40.0, 2001)
    v, omega = 0.4 + 0.2 * np.sin(0.5 * t), 0.5 * np.sin(0.3 * t)
    counts = {"v": np.cumsum(v) * 0.02, "omega": np.cumsum(omega) * 0.02}
    true = np.stack([1.04 * np.gradient(counts["v"]), 0.0 * t, 0.97 * np.gradient(counts["omega"])], axis=1)
    log = nmm.DriveLog("inputs", t, counts, t[::5], composed(true[1:])[::5], "poses")
    found = nmm.calibrate(robot, log)
    assert found.numbers["scale.v"].after == pytest.approx(1.04, abs=0.005)
    assert found.numbers["scale.omega"].after == pytest.approx(0.97, abs=0.005)
    assert "of_the_log" in codes(found)
    assert not any(name.startswith(("offset.", "ratio.", "origin.")) for name in found.numbers)
    assert {"offset.q1": 0.1, "origin.ee.x": 0.02}.items() <= {
        name: number.value for name, number in found.file().numbers.items()
    }.items()


def changed(log: nmm.DriveLog, **readings: Callable[[Array], Array]) -> nmm.DriveLog:
    told = {name: readings.get(name, np.asarray)(values) for name, values in log.readings.items()}
    return nmm.DriveLog(log.name, log.t, told, log.reference_t, log.reference, log.kind)


def bad_logs() -> dict[str, tuple[Callable[[], Any], str]]:
    log = log_of(seconds=20.0)

    def in_degrees() -> nmm.DriveLog:
        return changed(log, left_wheel_joint=np.degrees, right_wheel_joint=np.degrees)

    def reversed_wheel() -> nmm.DriveLog:
        return changed(log, left_wheel_joint=np.negative)

    def far_clock() -> nmm.DriveLog:
        return with_reference(log, log.reference_t[:30] + 17.8, log.reference[:30])

    return {
        "degrees": (in_degrees, "for each m by the wheels|disagree"),
        "a wheel with another sign": (reversed_wheel, "signs"),
        "another part of the drive": (far_clock, "a second apart|in common"),
        "no log": (list, "nmm.DriveLog"),
    }


@pytest.mark.parametrize("case", bad_logs())
def test_bad_logs_are_refused_by_name(case: str) -> None:
    make, words = bad_logs()[case]
    with pytest.raises(InputError, match=words) as caught:
        nmm.calibrate(robot_of(), make())
    assert len(str(caught.value)) <= 300


def test_a_fixed_base_has_no_wheels_to_calibrate() -> None:
    with pytest.raises(InputError, match="a platform that moves"):
        nmm.calibrate(nmm.load("small_arm", platform="fixed"), log_of(seconds=5.0))


@pytest.mark.thorough
@pytest.mark.parametrize(("name", "runs"), [("differential_base", 60), ("omni_base", 40)])
def test_deviations_hold_as_often_as_they_claim(name: str, runs: int) -> None:
    """Within two of them in 95 % of drives: all numbers together, at most four of binomial's deviations
    off."""
    truth, far = TRUTHS[name][0], []
    for seed in range(runs):
        far += [*off(nmm.calibrate(robot_of(name), log_of(name, seed=seed)), truth).values()]
    share = float(np.mean(np.abs(far) < 2.0))
    assert abs(share - 0.954) < 4.0 * np.sqrt(0.954 * 0.046 / runs)
