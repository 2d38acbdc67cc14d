"""Logs of drives from text files: columns, units that are asked for, counters that begin anew, bad tables."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drives import Drive, drive, write_table
from robot_logs import wheeled

import nmm
from nmm.base.errors import InputError
from nmm.model.robots.robot import Robot

SI = {"time": "s", "wheels": "rad", "steering": "rad", "position": "m", "heading": "rad"}
LEFT, RIGHT = "left_wheel_joint", "right_wheel_joint"
Columns = dict[str, Any]


@pytest.fixture(scope="module")
def robot() -> Robot:
    return nmm.load("differential_base")


@pytest.fixture(scope="module")
def driven(robot: Robot) -> Drive:
    return drive(robot, lambda t: (4.0 + 2.0 * np.sin(0.7 * t), 4.5 + 2.5 * np.cos(0.5 * t)))


@pytest.fixture(scope="module")
def car() -> Robot:
    return nmm.load("car_base")


@pytest.fixture(scope="module")
def driven_car(car: Robot) -> Drive:
    return drive(car, lambda t: (0.8, 0.4 * np.cos(0.9 * t)))


@pytest.fixture
def columns(driven: Drive) -> Columns:
    x, y, theta = driven.q.T[:3]
    return {"t": driven.t.copy(), **{name: driven.wheels[name].copy() for name in (LEFT, RIGHT)},
            "x": x.copy(), "y": y.copy(), "theta": theta.copy()}  # fmt: skip


def read(folder: Path, table: Columns, robot: Robot, delimiter: str = ",", /, **options: Any) -> nmm.DriveLog:
    return nmm.DriveLog.from_csv(
        write_table(folder / "a.csv", table, delimiter), robot, **({"units": SI} | options)
    )


def refused(folder: Path, table: Columns, robot: Robot, /, **options: Any) -> str:
    with pytest.raises(InputError) as caught:
        read(folder, table, robot, **options)
    text = str(caught.value)
    assert len(text) <= 300
    assert "a.csv" in text
    return text


def same(log: nmm.DriveLog, driven: Drive) -> None:
    """Counters up to where they began, the reference as it is."""
    np.testing.assert_allclose(log.t, driven.t, atol=1e-9)
    for name in log.readings.keys() & driven.wheels.keys():
        found, true = log.readings[name], driven.wheels[name]
        np.testing.assert_allclose(found - found[0], true - true[0], atol=1e-6)
    np.testing.assert_allclose(log.reference, driven.q[:, : log.reference.shape[1]], atol=1e-9)


@pytest.mark.parametrize("delimiter", [",", ";", "\t", " ", "|"])
def test_the_delimiter_is_found(
    delimiter: str, tmp_path: Path, robot: Robot, driven: Drive, columns: Columns
) -> None:
    log = read(tmp_path, columns, robot, delimiter)
    assert (log.kind, log.name, [*log.readings]) == ("poses", "a.csv", [LEFT, RIGHT])
    same(log, driven)


def test_blanks_in_rows_remarks_and_numbers_with_a_comma(
    tmp_path: Path, robot: Robot, driven: Drive, columns: Columns
) -> None:
    file = write_table(tmp_path / "a.csv", columns, " ")
    lines = file.read_text("utf-8").splitlines()
    spaced = [
        lines[0].replace(" ", "   "),
        "# a remark",
        "",
        *(line.replace(" ", "  ") for line in lines[1:]),
    ]
    file.write_text("# " + "\n".join(spaced), encoding="utf-8")
    same(nmm.DriveLog.from_csv(file, robot, units=SI), driven)
    file.write_text("\ufeff" + "\r\n".join(lines).replace(" ", "; ").replace(".", ","), encoding="utf-8")
    same(nmm.DriveLog.from_csv(file, robot, units=SI), driven)


def test_columns_are_mapped_and_others_left_out(
    tmp_path: Path, robot: Robot, driven: Drive, columns: Columns
) -> None:
    names = {"t": "stamp", LEFT: "enc l", RIGHT: "enc r", "x": "px", "y": "py", "theta": "yaw"}
    renamed = {"battery": 0.0 * driven.t + np.nan} | {names[one]: values for one, values in columns.items()}
    mapped = {one: column for one, column in names.items() if one != "t"}
    log = read(tmp_path, renamed, robot, time="stamp", columns=mapped)
    assert [*log.readings] == [LEFT, RIGHT]
    same(log, driven)
    assert read(tmp_path, columns, robot, name="first").name == "first"


ANGLES = {"rad": 1.0, "deg": 180 / np.pi, "rev": 0.5 / np.pi, "ticks:2048": 1024 / np.pi, "m:0.25": 0.25}
ANGLES |= {"mm:0.25": 250.0, "ticks:-64": -32 / np.pi}


@pytest.mark.parametrize("unit", ANGLES)
def test_wheels_are_read_in_any_unit(
    unit: str, tmp_path: Path, robot: Robot, driven: Drive, columns: Columns
) -> None:
    for name in (LEFT, RIGHT):
        columns[name] *= ANGLES[unit]
    same(read(tmp_path, columns, robot, units=SI | {"wheels": unit}), driven)
    columns[RIGHT] /= ANGLES[unit]
    same(read(tmp_path, columns, robot, units=SI | {"wheels": unit, RIGHT: "rad"}), driven)


@pytest.mark.parametrize(
    ("unit", "by"), [("rad/s", 1.0), ("deg/s", 180 / np.pi), ("rpm", 30 / np.pi), ("ticks/s:64", 32 / np.pi)]
)
def test_rates_are_integrated(
    unit: str, by: float, tmp_path: Path, robot: Robot, driven: Drive, columns: Columns
) -> None:
    """By the trapezoidal rule, whose error is a twelfth of the second derivative times dt²."""
    t = driven.t
    rates = 4.0 + 2.0 * np.sin(0.7 * t), 4.5 + 2.5 * np.cos(0.5 * t)
    log = read(tmp_path, columns | dict(zip((LEFT, RIGHT), np.multiply(by, rates), strict=True)), robot,
               units=SI | {"wheels": unit})  # fmt: skip
    for name in (LEFT, RIGHT):
        true = driven.wheels[name]
        np.testing.assert_allclose(log.readings[name], true - true[0], atol=1.0 * t[-1] * 0.02**2 / 12)


def test_what_was_counted_since_the_row_before_is_added_up(
    tmp_path: Path, robot: Robot, driven: Drive, columns: Columns
) -> None:
    for name in (LEFT, RIGHT):
        columns[name] = np.diff(columns[name], prepend=-1.0) * 100 / np.pi
    row = SI | {"wheels": "ticks/row:200"}
    same(read(tmp_path, columns, robot, units=row), driven)
    columns["t"][7] = columns["t"][8]
    with pytest.warns(RuntimeWarning, match="the next has the same stamp"):
        log = read(tmp_path, columns, robot, units=row)
    np.testing.assert_allclose(log.readings[LEFT][-1], driven.wheels[LEFT][-1], atol=1e-9)
    columns[LEFT][9] = np.nan
    text = refused(tmp_path, columns, robot, units=row)
    assert "left_wheel_joint: line 11: what was counted since the row before is not known" in text


@pytest.mark.parametrize(("unit", "by"), [("ms", 1e3), ("us", 1e6), ("ns", 1e9)])
def test_times_are_read_in_any_unit(
    unit: str, by: float, tmp_path: Path, robot: Robot, driven: Drive, columns: Columns
) -> None:
    columns["t"] *= by
    log = read(tmp_path, columns, robot, units=SI | {"time": unit})
    same(log, driven)
    np.testing.assert_allclose(log.reference_t, driven.t, atol=1e-9)


def test_places_are_read_in_any_unit_and_wrapped_headings_count_on(
    tmp_path: Path, robot: Robot, driven: Drive, columns: Columns
) -> None:
    columns["x"] *= 1e3
    columns["y"] *= 100.0
    columns["theta"] = np.rad2deg(columns["theta"]) % 360.0
    assert np.abs(np.diff(columns["theta"])).max() > 300.0
    log = read(tmp_path, columns, robot, units=SI | {"x": "mm", "y": "cm", "heading": "deg"})
    same(log, driven)
    si = {name: columns[name] for name in ("t", LEFT, RIGHT)} | dict(
        zip(("x", "y", "theta"), driven.q.T, strict=False)
    )
    same(read(tmp_path, si, robot, units="SI"), driven)


def test_units_are_asked_for_all_at_once(tmp_path: Path, robot: Robot, columns: Columns) -> None:
    text = refused(tmp_path, columns, robot, units=None)
    assert "units of time, wheels, position and heading must be stated" in text
    assert "units={'time': 's', 'wheels': 'rad', 'position': 'm', 'heading': 'rad'}" in text
    del columns["theta"]
    text = refused(tmp_path, columns, robot, units={"time": "s", LEFT: "rad", "x": "m"})
    assert "units of wheels and position must be stated" in text
    text = refused(tmp_path, {"t": columns["t"], "omega_left": columns[LEFT], "omega_right": columns[RIGHT]},
                   robot, units="SI", ends="closed")  # fmt: skip
    assert "units of omega_left and omega_right must be stated" in text


@pytest.mark.parametrize(
    ("units", "words"),
    [
        ({"wheels": "furlong"}, "units: wheels: expected a unit of a wheel: rad, deg, rev, ticks:COUNTS"),
        ({"wheels": "m"}, "m:RADIUS"),
        ({"wheels": "ticks"}, "counts of a turn behind the colon"),
        ({"wheels": "ticks:none"}, "counts of a turn behind the colon"),
        ({"wheels": "ticks:0"}, "counts of a turn behind the colon"),
        ({"wheels": "rad/min"}, "expected a unit of a wheel"),
        ({"wheels": 2048}, "got 2048"),
        ({"position": "rad"}, "expected a unit of length"),
        ({"position": "m/s"}, "expected a unit of length"),
        ({"time": "h"}, "expected a unit of time: s, ms, us, ns"),
        ({"wheel": "rad"}, "unknown group or column 'wheel' (did you mean 'wheels'?)"),
    ],
)
def test_units_that_are_none_are_named(
    units: dict[str, str], words: str, tmp_path: Path, robot: Robot, columns: Columns
) -> None:
    assert words in refused(tmp_path, columns, robot, units=SI | units)
    assert "expected 'SI', or by group or column" in refused(tmp_path, columns, robot, units="rad")


MEANT: list[tuple[dict[str, float], dict[str, str], str]] = [
    ({LEFT: 180 / np.pi, RIGHT: 180 / np.pi}, {}, "deg"),
    ({LEFT: 2e4, RIGHT: 2e4}, {}, "ticks:COUNTS of at least"),
    ({LEFT: 64 / np.pi / 2, RIGHT: 64 / np.pi / 2}, {}, "counters in ticks:6"),
    ({}, {"wheels": "deg"}, "counters in rad"),
    ({}, {"wheels": "rad/s"}, "rad/s"),
    ({}, {"position": "mm"}, "positions in m "),
    ({"x": 1e3, "y": 1e3}, {}, "positions in mm "),
    ({"theta": 180 / np.pi}, {}, "headings in deg "),
    ({}, {"heading": "deg"}, "headings in rad "),
    ({"t": 1e3}, {}, "ms would fit"),
    ({}, {"time": "us"}, "s would fit"),
]


@pytest.mark.parametrize(("factors", "stated", "meant"), MEANT)
def test_another_unit_than_stated_is_named_with_what_would_fit(
    factors: dict[str, float], stated: dict[str, str], meant: str,
    tmp_path: Path, robot: Robot, columns: Columns,
) -> None:  # fmt: skip
    for name, factor in factors.items():
        columns[name] *= factor
    text = refused(tmp_path, columns, robot, units=SI | stated)
    assert meant in text
    assert " fit" in text


@pytest.mark.parametrize("wrong", [0.4, 2.5])
def test_a_robot_that_is_far_from_its_file_is_no_unit(
    wrong: float, tmp_path: Path, robot: Robot, columns: Columns
) -> None:
    """Wheels whose radius or slip is far off, a reference that jumps and stands beside the axle."""
    x, y, theta = columns["x"], columns["y"], columns["theta"]
    x, y = x + 0.4 * np.cos(theta), y + 0.4 * np.sin(theta)
    x[500:] += 300.0
    y[700] = -1e4
    columns |= {LEFT: wrong * columns[LEFT], RIGHT: wrong * columns[RIGHT], "x": x, "y": y}
    assert len(read(tmp_path, columns, robot)) == len(x)


def test_a_robot_that_turns_on_the_spot_is_no_unit(tmp_path: Path, robot: Robot) -> None:
    """Wheels go on and on, and the reference nearly stands."""
    spun = drive(robot, lambda t: (-3.0, 3.0))
    rng = np.random.default_rng(3)
    seen = spun.q[:, :3] + rng.normal(size=(len(spun.t), 3)) * [0.002, 0.002, 0.01]
    columns = {"t": spun.t, **{one: spun.wheels[one] for one in (LEFT, RIGHT)}}
    columns |= dict(zip(("x", "y", "theta"), seen.T, strict=True))
    assert read(tmp_path, columns, robot).kind == "poses"


def wrapped(values: Any) -> Any:
    return (values + np.pi) % (2 * np.pi) - np.pi


def test_wheels_that_begin_anew_are_counted_on_with_a_warning(
    tmp_path: Path, robot: Robot, driven: Drive, columns: Columns
) -> None:
    columns[LEFT], columns[RIGHT] = wrapped(columns[LEFT]), columns[RIGHT] % (2 * np.pi)
    with pytest.warns(RuntimeWarning, match=r"left_wheel_joint.*and right_wheel_joint.*begin anew"):
        same(read(tmp_path, columns, robot), driven)
    for one in (True, [LEFT, RIGHT], {LEFT: 2 * np.pi, RIGHT: True}):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            same(read(tmp_path, columns, robot, wrapped=one), driven)


def test_ticks_that_begin_anew_are_counted_on(
    tmp_path: Path, robot: Robot, driven: Drive, columns: Columns
) -> None:
    for name, factor in ((LEFT, 20000 / 2 / np.pi), (RIGHT, 20000 / 2 / np.pi)):
        columns[name] = np.round(columns[name] * factor) % 65536
    ticks = SI | {"wheels": "ticks:20000"}
    with pytest.warns(RuntimeWarning, match="after 65536 ticks"):
        log = read(tmp_path, columns, robot, units=ticks)
    stated = read(tmp_path, columns, robot, units=ticks, wrapped={LEFT: 65536, RIGHT: 65536})
    for name in (LEFT, RIGHT):
        np.testing.assert_allclose(log.readings[name], driven.wheels[name], atol=4e-4)
        np.testing.assert_array_equal(stated.readings[name], log.readings[name])


def test_what_may_begin_anew_is_named_by_column_and_line(
    tmp_path: Path, robot: Robot, columns: Columns
) -> None:
    columns[LEFT] = columns[LEFT] % 11.0
    text = refused(tmp_path, columns, robot)
    line = 2 + int(np.argmax(np.diff(columns[LEFT]) < 0)) + 1
    assert f"left_wheel_joint leaps at line {line}: it begins anew" in text
    assert "wrapped={'left_wheel_joint': NUMBER}, about 10.9" in text
    assert "unknown counter 'x'" in refused(tmp_path, columns, robot, wrapped="x")


def test_a_car_s_steering_has_units_and_turns_of_its_own(
    tmp_path: Path, car: Robot, driven_car: Drive
) -> None:
    """By the wheels' joints, each about the point that all axes pass, in degrees from 0 to 360."""
    wheelbase, track = 0.7, 0.56
    delta = driven_car.q[:, 3]
    assert np.ptp(np.sign(delta)) == 2
    inner = np.tan(delta) / wheelbase
    steer = {
        f"front_{side}_steer_joint": np.arctan(wheelbase * inner / (1.0 - sign * 0.5 * track * inner))
        for side, sign in (("left", 1), ("right", -1))
    }
    rear = {
        name: driven_car.wheels[name] * 1000 for name in ("rear_left_wheel_joint", "rear_right_wheel_joint")
    }
    degrees = {name: np.rad2deg(values) % 360.0 for name, values in steer.items()}
    x, y, theta = driven_car.q.T[:3]
    columns = {"t": driven_car.t} | rear | degrees | {"x": x, "y": y, "theta": theta}
    units = SI | {"wheels": "ticks:6283.185307179586", "steering": "deg"}
    with pytest.warns(RuntimeWarning, match=r"front_left_steer_joint.*begin anew"):
        log = read(tmp_path, columns, car, units=units)
    for name, true in steer.items():
        np.testing.assert_allclose(wrapped(log.readings[name] - true), 0.0, atol=1e-9)
        assert np.abs(np.diff(log.readings[name])).max() < 0.1
    for name in rear:
        np.testing.assert_allclose(log.readings[name], driven_car.wheels[name], atol=1e-8)


def test_what_steers_too_far_is_another_unit(tmp_path: Path, car: Robot, driven_car: Drive) -> None:
    rear = {name: driven_car.wheels[name] for name in ("rear_left_wheel_joint", "rear_right_wheel_joint")}
    x, y, theta = driven_car.q.T[:3]
    columns = {"t": driven_car.t} | rear | {"steering": np.rad2deg(driven_car.q[:, 3]), "x": x, "y": y}
    text = refused(tmp_path, columns | {"theta": theta}, car)
    assert "steering steers to " in text
    assert "were it in rad; deg or ticks:COUNTS" in text
    log = read(tmp_path, columns | {"theta": theta}, car, units=SI | {"steering": "deg"})
    np.testing.assert_allclose(log.readings["steering"], driven_car.q[:, 3], atol=1e-9)
    words = "expected a unit of angle: rad, deg"
    assert words in refused(tmp_path, columns, car, units=SI | {"steering": "rad/s"})
    del columns["steering"]
    assert "steering" in refused(tmp_path, columns, car)


def test_inputs_are_read_as_rates_or_as_their_integrals(
    tmp_path: Path, car: Robot, driven_car: Drive
) -> None:
    x, y = driven_car.q.T[:2]
    columns = {"t": driven_car.t, "v": 800.0 + 0.0 * x, "steering": driven_car.q[:, 3], "x": x, "y": y}
    log = read(tmp_path, columns, car, units=SI | {"v": "mm/s"})
    assert (log.kind, [*log.readings]) == ("positions", ["steering", "v"])
    np.testing.assert_allclose(log.readings["v"], 0.8 * driven_car.t, atol=1e-9)
    columns["v"] = 0.8 * driven_car.t + 5.0
    log = read(tmp_path, columns, car, units=SI | {"v": "m"})
    np.testing.assert_allclose(log.readings["v"], 0.8 * driven_car.t + 5.0, atol=1e-9)
    assert "positions in mm" in refused(
        tmp_path, columns | {"x": 1e3 * x, "y": 1e3 * y}, car, units=SI | {"v": "m"}
    )


def test_the_arm_of_a_robot_needs_no_readings(tmp_path: Path) -> None:
    robot = wheeled(tmp_path)
    driven = drive(robot, lambda t: (0.4, 0.5), duration=5.0)
    columns = {"t": driven.t, **driven.wheels, "x": driven.q[:, 0], "y": driven.q[:, 1]}
    assert [*read(tmp_path, columns, robot).readings] == [LEFT, RIGHT]


def test_a_reference_in_a_table_of_its_own(
    tmp_path: Path, robot: Robot, driven: Drive, columns: Columns
) -> None:
    mine = {name: columns[name] for name in ("t", LEFT, RIGHT)}
    x, y, theta = (np.interp(driven.t[5:-5:3] + 0.007, driven.t, column) for column in driven.q.T)
    away = {"stamp": 1e3 * (driven.t[5:-5:3] + 0.007), "px": x, "y": y, "theta": theta}
    other = write_table(tmp_path / "b.csv", away, ";")
    log = read(
        tmp_path, mine, robot, reference=other, reference_time="stamp", columns={"x": "px"},
        units=SI | {"reference_time": "ms"},
    )  # fmt: skip
    np.testing.assert_allclose(log.reference_t, driven.t[5:-5:3] + 0.007, atol=1e-9)
    np.testing.assert_allclose(log.reference, np.column_stack([x, y, theta]), atol=1e-9)
    np.testing.assert_allclose(log.t, driven.t)
    far = write_table(tmp_path / "c.csv", away | {"stamp": away["stamp"] + 1.7e12}, ",")
    options: Any = {"reference": far, "reference_time": "stamp", "columns": {"x": "px"}}
    units = SI | {"reference_time": "ms"}
    with pytest.raises(InputError, match=r"the reference's stamps begin 1.7e\+09 s after the counters'"):
        read(tmp_path, mine, robot, units=units, **options)
    np.testing.assert_allclose(
        read(tmp_path, mine, robot, units=units, shift=-1.7e9, **options).reference_t,
        log.reference_t,
        atol=1e-5,
    )


def test_a_reference_may_come_in_some_rows(
    tmp_path: Path, robot: Robot, driven: Drive, columns: Columns
) -> None:
    """Rows of the reference alone, too, without a warning."""
    some = np.arange(len(driven.t)) % 5 == 0
    for name in ("x", "y", "theta"):
        columns[name][~some] = np.nan
    columns[LEFT][::10] = columns[RIGHT][::10] = np.nan
    log = read(tmp_path, columns, robot)
    np.testing.assert_allclose(log.reference_t, driven.t[some], atol=1e-9)
    np.testing.assert_allclose(log.reference, driven.q[some, :3], atol=1e-9)
    assert len(log) == len(driven.t) - len(driven.t[::10])


def test_ends_stand_for_a_reference(tmp_path: Path, robot: Robot, driven: Drive, columns: Columns) -> None:
    mine = {name: columns[name] for name in ("t", LEFT, RIGHT)}
    units = {"time": "s", "wheels": "rad"}
    log = read(tmp_path, mine, robot, units=units, ends="closed")
    assert log.kind == "ends"
    np.testing.assert_array_equal(log.reference, np.zeros((2, 3)))
    np.testing.assert_array_equal(log.reference_t, driven.t[[0, -1]])
    for ends in (driven.q[[0, -1], :3], driven.q[[0, -1], :2]):
        np.testing.assert_array_equal(read(tmp_path, mine, robot, units=units, ends=ends).reference, ends)
    assert "ends: expected 'closed'" in refused(tmp_path, mine, robot, units=units, ends="open")
    assert "ends: expected no reference beside them" in refused(
        tmp_path, mine, robot, units=units, ends="closed", reference=tmp_path / "a.csv"
    )
    assert "no reference; expected reference=" in refused(tmp_path, mine, robot)


def told(folder: Path, columns: Columns, robot: Robot, count: int = 1) -> tuple[nmm.DriveLog, list[str]]:
    with pytest.warns(RuntimeWarning) as caught:
        log = read(folder, columns, robot)
    assert len(caught) == count
    assert all(one.filename == __file__ for one in caught)
    return log, [str(one.message) for one in caught]


def test_rows_without_numbers_are_left_out_and_counted(
    tmp_path: Path, robot: Robot, columns: Columns
) -> None:
    columns[LEFT][[3, 8]] = np.nan
    columns["t"][20] = np.nan
    log, texts = told(tmp_path, columns, robot, 2)
    assert len(log) == 998
    assert texts[0] == "a.csv: 3 rows of 1001 of a.csv left out: no number in left_wheel_joint and t"
    assert texts[1] == "a.csv: 1 row of 1001 of a.csv left out: no number in t"
    assert len(log.reference) == 1000


def test_rows_with_the_stamp_of_the_next_are_left_out(tmp_path: Path, robot: Robot, columns: Columns) -> None:
    columns["t"][[7, 30]] = columns["t"][[8, 31]]
    log, texts = told(tmp_path, columns, robot, 2)
    assert len(log) == 999
    assert texts[0] == "a.csv: 2 rows of a.csv left out: the next has the same stamp, first in line 10"
    columns["t"] = np.floor(columns["t"])
    assert "981 of 1001 rows have the stamp of the row before" not in (
        text := refused(tmp_path, columns, robot)
    )
    assert "980 of 1001 rows have the stamp of the row before" in text


def test_a_last_line_that_was_cut_is_left_out(tmp_path: Path, robot: Robot, columns: Columns) -> None:
    file = write_table(tmp_path / "a.csv", columns)
    text = file.read_text("utf-8")
    file.write_text(text + "20.02,4.1", encoding="utf-8")
    with pytest.warns(RuntimeWarning, match="the last line of a.csv lacks its end"):
        assert len(nmm.DriveLog.from_csv(file, robot, units=SI)) == 1001
    file.write_text(text + "20.02,4.1\n", encoding="utf-8")
    with pytest.raises(InputError, match="line 1003: expected 6 cells, got 2"):
        nmm.DriveLog.from_csv(file, robot, units=SI)


def test_a_counter_that_leaps_is_told(tmp_path: Path, robot: Robot, columns: Columns) -> None:
    turned = columns[LEFT].copy()
    columns[LEFT][500:] += 40.0
    columns[LEFT][100:] += 12.0
    match = r"left_wheel_joint goes faster than it can 2 times, first by 12.*t = 2 s"
    with pytest.warns(RuntimeWarning, match=match):
        read(tmp_path, columns, robot)
    columns[LEFT] = np.where(np.arange(1001) < 900, turned, turned - turned[900])  # switched off and on
    text = refused(tmp_path, columns, robot)
    assert "left_wheel_joint leaps at line 902: it begins anew, or went so far" in text


BAD: list[tuple[Callable[[Columns], Any], str]] = [
    (lambda c: c.update(t=c["t"][::-1]), "stamps go back by 0.02 s at line 3"),
    (
        lambda c: c.update({"t": np.where(c["t"] > 10, c["t"] - 10.007, c["t"])}),
        "stamps go back by 9.99 s at line 503",
    ),
    (lambda c: c.pop("t"), "time: unknown column 't'"),
    (
        lambda c: c.update(left_whel_joint=c.pop(LEFT)),
        "available: t, right_wheel_joint, x, y, theta, left_whel_joint",
    ),
    (lambda c: c.pop("y"), "no reference"),
    (lambda c: c.update({LEFT: 1e-4 * c[LEFT], RIGHT: 1e-4 * c[RIGHT]}), "it stands still"),
    (lambda c: c.update({LEFT: np.nan * c[LEFT]}), "at least two rows with numbers of all counters"),
    (lambda c: c.update(x=0 * c["x"], y=0 * c["y"], theta=0 * c["y"]), "the reference stands still"),
    (lambda c: (c.pop(LEFT), c.pop(RIGHT)), "no column of"),
]


@pytest.mark.parametrize(("spoil", "words"), BAD)
def test_bad_tables_are_named(
    spoil: Callable[[Columns], Any], words: str, tmp_path: Path, robot: Robot, columns: Columns
) -> None:
    spoil(columns)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        assert words in refused(tmp_path, columns, robot)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "expected a table with a header"),
        (b"\n\n", "expected a table with a header"),
        (b"1,2,3\n4,5,6\n", "expected a header"),
        (b"t,left_wheel_joint,right_wheel_joint,x,y\n0,1,2,a,4\n", "line 2: x: expected a number, got 'a'"),
        (b"t,left_wheel_joint,t,x,y\n0,1,2,3,4\n", "time: expected one column 't', got 2"),
        (b"t,left_wheel_joint,right_wheel_joint,x,y\n0,1,2,3,4\n", "at least two rows"),
        (b"t,left_wheel_joint\n\xff\xfe\n", "is no text in UTF-8"),
        (b"t,x\n" + b"0" * 200000, "expected at most 100000 characters"),
    ],
)  # fmt: skip
def test_what_is_no_table_is_named(content: bytes, words: str, tmp_path: Path, robot: Robot) -> None:
    file = tmp_path / "a.csv"
    file.write_bytes(content)
    with pytest.raises(InputError) as caught:
        nmm.DriveLog.from_csv(file, robot, units=SI)
    assert words in str(caught.value)
    assert len(str(caught.value)) <= 300


def test_files_and_columns_that_are_not_there(tmp_path: Path, robot: Robot, columns: Columns) -> None:
    for path in (tmp_path / "none.csv", tmp_path):
        with pytest.raises(InputError, match="cannot be read"):
            nmm.DriveLog.from_csv(path, robot, units=SI)
    text = refused(tmp_path, columns, robot, columns={"left_wheel": LEFT})
    assert "columns: unknown joint 'left_wheel' (did you mean 'left_wheel_joint'?)" in text
    assert "unknown column 'enc'" in refused(tmp_path, columns, robot, columns={LEFT: "enc"})
    assert "expected what a column is and its name" in refused(tmp_path, columns, robot, columns=LEFT)
    arm = nmm.load("unicycle_2r", platform="fixed")
    with pytest.raises(InputError, match="expected a platform that moves"):
        read(tmp_path, columns, arm)


def test_a_long_log_takes_little_memory_and_is_counted_on_at_once(tmp_path: Path, robot: Robot) -> None:
    """60,000 rows, ten minutes at 100 Hz: no more than four times the file, and few calls for each row."""
    import cProfile
    import pstats
    import tracemalloc

    t = np.arange(60000) * 0.01
    turned = np.cumsum(5.0 + np.sin(0.1 * t)) * 0.01
    columns = {"t": t, LEFT: wrapped(turned), RIGHT: wrapped(1.02 * turned)}
    file = write_table(tmp_path / "a.csv", columns)
    options: Any = {"units": SI, "ends": "closed", "wrapped": True}
    nmm.DriveLog.from_csv(file, robot, **options)
    tracemalloc.start()
    log = nmm.DriveLog.from_csv(file, robot, **options)
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert most < 4 * file.stat().st_size
    np.testing.assert_allclose(log.readings[LEFT] - log.readings[LEFT][0], turned - turned[0], atol=1e-6)
    profile = cProfile.Profile()
    profile.runcall(nmm.DriveLog.from_csv, file, robot, **options)
    assert pstats.Stats(profile).total_calls < 25 * len(t)  # type: ignore[attr-defined]  # typeshed has it not
