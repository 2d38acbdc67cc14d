"""calibration.yaml: written, read, checked, and what robots, scenarios, runs and commands make of it."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from command_line import Result
from findings import of_code

import nmm
from nmm.base.errors import InputError
from nmm.cli.exit_status import status_of
from nmm.model.robots.robot import Robot
from nmm.model.robots.wheel_rates import wheel_rates

VALUES = {"radius.left_wheel_joint": 0.0981, "track": 0.5 + 1 / 17}
DEVIATIONS = {"track": 0.004}
MEASURED = {
    "delay": {"value": 0.04, "deviation": 1e-5},
    "mount": [0.1, 0.0, 0.3],
    "ground": "hard",
    "laps": 4,
}


@pytest.fixture
def robot() -> Robot:
    return nmm.load("differential_base")


@pytest.fixture
def file(robot: Robot, tmp_path: Path) -> Path:
    logs = [tmp_path / "drives" / "one.mcap", "two.csv"]
    learned = nmm.CalibrationFile.of(
        robot, VALUES, DEVIATIONS, measured=MEASURED, logs=logs, date="2026-03-01"
    )
    return learned.save(tmp_path / "calibration.yaml")


def text_with(file: Path, change: tuple[str, str]) -> Path:
    text = file.read_text(encoding="utf-8")
    assert change[0] in text
    file.write_text(text.replace(*change), encoding="utf-8")
    return file


def test_it_comes_back_to_the_last_digit(file: Path) -> None:
    read = nmm.CalibrationFile.load(file)
    assert (read.robot, read.platform, read.date, read.logs) == (
        "differential_base", "differential", "2026-03-01", ("one.mcap", "two.csv"),
    )  # fmt: skip
    assert read.measured == MEASURED
    assert {name: number.value for name, number in read.numbers.items()} == VALUES
    assert {name: number.nominal for name, number in read.numbers.items()} == {
        "radius.left_wheel_joint": 0.1, "track": 0.5,
    }  # fmt: skip
    assert read.numbers["track"].deviation == 0.004
    assert math.isnan(read.numbers["radius.left_wheel_joint"].deviation)
    again = file.with_name("again.yaml")
    read.save(again)
    assert again.read_bytes() == file.read_bytes()
    assert str(file.parent) not in file.read_text(encoding="utf-8")
    assert {*yaml.safe_load(file.read_text(encoding="utf-8"))} == {
        "format", "robot", "platform", "date", "logs", "numbers", "measured",
    }  # fmt: skip


def test_a_robot_is_loaded_with_it(robot: Robot, file: Path) -> None:
    learned = nmm.CalibrationFile.load(file)
    for calibration in (file, str(file), learned):
        loaded = nmm.load("differential_base", calibration=calibration)
        assert loaded.changed_numbers == VALUES
        expected = nmm.with_numbers(robot, VALUES)
        np.testing.assert_array_equal(wheel_rates(loaded)[1], wheel_rates(expected)[1])
        np.testing.assert_array_equal(loaded.platform.parameters, expected.platform.parameters)
        (note,) = of_code(loaded.notes, "calibrated")
        assert note.values["numbers"]["track"] == [0.5, VALUES["track"]]
    # what is learned anew of it counts from the robot's file
    again = nmm.CalibrationFile.of(loaded, {"track": 0.55})
    assert again.numbers["track"] == nmm.Calibrated(0.5, 0.55)
    assert nmm.load("differential_base", calibration=again).nominal == {"track": 0.5}


def test_what_has_applied_is_a_calibration(robot: Robot) -> None:
    class Result:
        def applied(self, robot: Robot) -> Robot:
            return nmm.with_numbers(robot, {"track": 0.6})

    assert nmm.load("differential_base", calibration=Result()).nominal == {"track": 0.5}
    with pytest.raises(InputError) as error:
        nmm.load("differential_base", calibration=0.6)
    assert "a file, a CalibrationFile or a Calibration" in str(error.value)


@pytest.mark.parametrize(
    ("name", "keywords", "told"),
    [
        ("car_base", {}, ["differential_base", "kind car", "'differential'"]),
        ("differential_base", {"platform": "unicycle"}, ["another differential_base", "kind unicycle"]),
        ("differential_base", {"arguments": {"track": 0.6}}, ["track", "0.5 m", "0.6 m"]),
        ("unicycle_2r", {"platform": "differential"}, ["differential_base", "0.4 m", "0.5 m"]),
        ("unicycle_2r", {"platform": nmm.DifferentialDrive(0.1, 0.5), "wheels": ()}, ["has no radius.left"]),
    ],
)
def test_a_calibration_of_another_robot_is_refused_by_name(
    file: Path, name: str, keywords: dict[str, Any], told: list[str]
) -> None:
    with pytest.raises(InputError) as error:
        nmm.load(name, calibration=file, **keywords)
    assert str(file) in str(error.value)
    assert [text for text in told if text not in str(error.value)] == [], error.value
    assert len(str(error.value)) <= 300 + len(str(file))


def test_a_nominal_may_be_off_by_a_millionth(file: Path) -> None:
    text_with(file, ("nominal: 0.5,", "nominal: 0.5000004,"))
    assert nmm.load("differential_base", calibration=file).nominal["track"] == 0.5
    text_with(file, ("nominal: 0.5000004,", "nominal: 0.500002,"))
    with pytest.raises(InputError) as error:
        nmm.load("differential_base", calibration=file)
    assert "nominal track of 0.5 m" in str(error.value)
    assert "0.500002 m" in str(error.value)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (("nmm calibration 1", "nmm calibration 2"), ["format", "nmm calibration 1"]),
        (("platform: differential", "plattform: differential"), ["plattform", "platform"]),
        (("robot: differential_base\n", ""), ["robot", "missing"]),
        (("value: 0.0981", "value: wide"), [":7:", "numbers.radius.left_wheel_joint.value", "wide"]),
        (("value: 0.0981", "value: .nan"), ["value", "finite"]),
        (("value: 0.0981", "value: -0.1"), ["radius.left_wheel_joint", "above 0"]),
        (("deviation: 0.004", "deviation: -0.004"), ["deviation"]),
        (("deviation: 0.004", "spread: 0.004"), ["spread", "deviation"]),
        (("logs: [one.mcap, two.csv]", "logs: one.mcap"), ["logs", "a list"]),
        (("track:", "trak:"), ["has no trak"]),
        (("ground: hard", "ground: !!python/none x"), ["tag"]),
        (("robot:", "robot: ["), ["YAML"]),
        (("robot: differential_base", "robot: [1, 2]"), ["robot", "text"]),
    ],
)
def test_a_bad_file_is_refused_with_its_key(file: Path, change: tuple[str, str], told: list[str]) -> None:
    text_with(file, change)
    with pytest.raises(InputError) as error:
        nmm.load("differential_base", calibration=file)
    assert "calibration.yaml" in str(error.value)
    assert [text for text in told if text not in str(error.value)] == [], error.value


def test_files_that_are_none(tmp_path: Path) -> None:
    (tmp_path / "binary.yaml").write_bytes(b"\xff\xfe\x00")
    (tmp_path / "list.yaml").write_text("- 1\n", encoding="utf-8")
    for name, told in (("absent.yaml", "cannot be read"), ("binary.yaml", "UTF-8"), ("list.yaml", "mapping")):
        with pytest.raises(InputError) as error:
            nmm.load("differential_base", calibration=tmp_path / name)
        assert told in str(error.value)
        assert name in str(error.value)


def test_what_cannot_be_said_is_refused(robot: Robot, tmp_path: Path) -> None:
    of = nmm.CalibrationFile.of
    for call, told in (
        (lambda: of(robot, {"trak": 0.5}), "trak"),
        (lambda: of(robot, {"track": 0.5}, {"left": 0.1}), "left"),
        (lambda: of(robot, {"track": 0.5}, {"track": -0.1}), "deviation of track"),
        (lambda: of(robot, {"track": 0.5}, measured={"x": math.inf}), "measured: x"),
        (lambda: of(robot, {"track": 0.5}, measured={"x": object()}), "measured: x"),
        (lambda: nmm.CalibrationFile("r", "p", {"track": nmm.Calibrated(0.5, math.nan)}), "track: value"),
    ):
        with pytest.raises(InputError) as error:
            call()  # type: ignore[no-untyped-call]
        assert told in str(error.value)
    learned = of(robot, VALUES)
    with pytest.raises(InputError):
        learned.save(tmp_path / "nowhere" / "calibration.yaml")
    with pytest.raises(InputError):
        learned.save(tmp_path)
    assert [*tmp_path.iterdir()] == []


def test_arrays_become_lists(robot: Robot, tmp_path: Path) -> None:
    measured = {"spread": np.array([[1.0, 2.0]]), "count": np.int64(3), "of": np.float64(0.5), "none": None}
    learned = nmm.CalibrationFile.of(robot, VALUES, measured=measured)
    read = nmm.CalibrationFile.load(learned.save(tmp_path / "c.yaml")).measured
    assert read == {"spread": [[1.0, 2.0]], "count": 3, "of": 0.5, "none": None}


def scenario_text(**robot: Any) -> str:
    keys = {
        "robot": {"source": "unicycle_2r", **robot},
        "task": {"kind": "position", "frame": "ee", "axes": "xy", "gain": 1, "reference": [1, 0]},
        "resolver": {"kind": "pg"},
        "q0": {"q1": 0.5, "q2": 0.6},
        "duration": 0.05, "dt": 0.01,
    }  # fmt: skip
    return yaml.safe_dump(keys)


def test_a_scenario_and_its_run_keep_it(tmp_path: Path) -> None:
    base = nmm.load("unicycle_2r")
    nmm.CalibrationFile.of(base, VALUES).save(tmp_path / "calibration.yaml")
    (tmp_path / "go.yaml").write_text(scenario_text(calibration="calibration.yaml"), encoding="utf-8")
    scenario = nmm.Scenario.load(tmp_path / "go.yaml")
    assert scenario.robot().changed_numbers == VALUES
    assert scenario.resolved()["robot"]["calibration"] == str(tmp_path / "calibration.yaml")
    run = scenario.run()
    folder = run.save(tmp_path / "run", figures=False)
    assert nmm.Trajectory.load(folder).robot.changed_numbers == VALUES
    # the run stays as it was, whatever is learned later
    nmm.CalibrationFile.of(base, {"track": 0.7}).save(tmp_path / "calibration.yaml")
    again = nmm.Trajectory.load(folder)
    assert again.robot.changed_numbers == VALUES
    np.testing.assert_array_equal(wheel_rates(again.robot)[1], wheel_rates(run.robot)[1])
    assert nmm.Scenario.load(tmp_path / "go.yaml").robot().changed_numbers == {"track": 0.7}
    plain = nmm.Scenario.load(tmp_path / "go.yaml", {"robot.calibration": None})
    assert plain.robot().nominal == {}
    with pytest.raises(InputError) as error:
        nmm.Scenario.load(tmp_path / "go.yaml", {"robot.calibration": "none.yaml"}).robot()
    assert "robot.calibration" in str(error.value)
    assert "none.yaml" in str(error.value)


def test_a_run_without_a_scenario_keeps_its_numbers(tmp_path: Path) -> None:
    robot = nmm.with_numbers(nmm.load("car_base"), {"wheelbase": 0.72, "offset.steering": 0.03})
    task = nmm.Task(nmm.Position("base_link", "xy"), nmm.Constant([1.0, 0.0]))
    controller = nmm.Controller(robot, task, nmm.DampedLeastSquares())
    run = nmm.simulate(controller, robot.q({"steering": 0.1}), 0.05, 0.01)
    folder = run.save(tmp_path / "run", figures=False)
    read = nmm.Trajectory.load(folder).robot
    assert read.changed_numbers == robot.changed_numbers
    assert read.corrections == robot.corrections
    assert read.fingerprint == robot.fingerprint


def test_a_mounted_platform_has_its_own(tmp_path: Path) -> None:
    file = nmm.CalibrationFile.of(nmm.load("differential_base"), VALUES).save(tmp_path / "c.yaml")
    platform = {"source": "differential_base", "calibration": file.name}
    text = yaml.safe_load(scenario_text())
    text["robot"] = {"platform": platform, "arm": "small_arm"}
    text["q0"] = {}
    (tmp_path / "go.yaml").write_text(yaml.safe_dump(text), encoding="utf-8")
    assert nmm.Scenario.load(tmp_path / "go.yaml").robot().changed_numbers == VALUES


def test_commands_take_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    def command(*arguments: str) -> Result:
        return Result(status_of(arguments), *capfd.readouterr())

    monkeypatch.chdir(tmp_path)
    file = nmm.CalibrationFile.of(nmm.load("unicycle_2r"), VALUES).save(tmp_path / "c.yaml")
    told = command("info", "unicycle_2r", "--calibration", str(file))
    assert "not as its file says: radius.left_wheel_joint 0.0981 (file: 0.1)" in told.out
    (tmp_path / "go.yaml").write_text(scenario_text(), encoding="utf-8")
    out = tmp_path / "out"
    ran = command("run", str(tmp_path / "go.yaml"), "--calibration", str(file), "--out", str(out))
    assert ran.status == 0, ran.err
    assert nmm.Trajectory.load(out).robot.changed_numbers == VALUES
    started = tmp_path / "first.yaml"
    command("init", "unicycle_2r", "--calibration", str(file), "--out", str(started))
    assert nmm.Scenario.load(started).robot().changed_numbers == VALUES
    assert "./c.yaml" in started.read_text(encoding="utf-8")
    refused = command("check", "car_base", "--calibration", str(file))
    assert refused.status == 2
    assert "another robot" in refused.out + refused.err
    mistaken = command("info", "unicycle_2r", "--calibration", "absent.yaml")
    assert mistaken.status == 2
    assert "absent.yaml" in mistaken.err
