"""nmm calibrate: what it prints and writes, how logs are named to it, and what it refuses."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from command_line import NMM, Result, refused
from simulated_drives import drive, write

import nmm
from nmm.plugins.robot.calibration import calibration as learning
from nmm.plugins.robot.calibration import report

LEFT, RIGHT = "left_wheel_joint", "right_wheel_joint"
TRUTH = {"radius.left_wheel_joint": 0.098, "radius.right_wheel_joint": 0.1005, "track": 0.54}
SI = ("--reference", "drive_seen.csv", "--units", "SI")


def curves(t: np.ndarray) -> np.ndarray:
    """Wheels' rates (N, 2), rad/s, for curves to both sides and turns on the spot."""
    v, w = 3.0 + 2.0 * np.sin(0.5 * t), 2.0 * np.sin(0.7 * t)
    return np.stack([v - w, v + w], axis=1)


@pytest.fixture(scope="module")
def tables(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with drive.csv in rad, ticks.csv of 1000 a turn, still.csv, each with a reference's table."""
    folder = tmp_path_factory.mktemp("drives")
    robot = nmm.load("differential_base")
    log = drive(robot, TRUTH, inputs=curves, seconds=40.0, rate=25.0, looks=5.0)
    write(log, folder / "drive.csv")
    write(log, folder / "ticks.csv", turn=1000.0)
    still = np.column_stack([log.t, np.full((len(log), 2), 3.0)])
    np.savetxt(folder / "still.csv", still, header=f"t,{LEFT},{RIGHT}", delimiter=",", comments="")
    return folder


@pytest.fixture(scope="module")
def done(tables: Path) -> Path:
    """The folder that the command writes for ticks."""
    out = tables / "out"
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tables)
        from nmm.cli.exit_status import status_of

        units = "wheels=ticks:1000,time=s,position=m,heading=rad"
        given = ["ticks.csv", "--reference", "ticks_seen.csv", "--units", units, "--out", str(out)]
        status = status_of(["calibrate", "differential_base", *given, "--hold", "reference.yaw=0.1"])
    assert status == 0
    return out


def run(captured: pytest.CaptureFixture[str], *arguments: str) -> Result:
    result = refused(captured, "calibrate", *arguments)
    assert "Traceback" not in result.err
    assert all(len(line) <= 300 for line in result.err.splitlines())
    return result


def test_it_writes_what_load_takes(done: Path) -> None:
    robot = nmm.load("differential_base", calibration=done / "calibration.yaml")
    file = nmm.CalibrationFile.load(done / "calibration.yaml")
    numbers = nmm.robot_numbers(robot)
    for name, true in TRUTH.items():
        deviation = file.numbers[name].deviation
        assert 0.0 < deviation < 0.02 * true
        assert abs(numbers[name].value - true) < 4.0 * deviation, name
    assert file.logs == ("ticks.csv",)


def test_the_summary_is_plain_and_whole(done: Path) -> None:
    told = json.loads((done / "summary.json").read_text("utf-8"))
    assert told["numbers"]["reference.yaw"] == {
        "before": 0.0, "after": 0.1, "deviation": 0.0, "unit": "rad", "why": "held",
    }  # fmt: skip
    of, matrix = told["covariance"]["of"], np.array(told["covariance"]["matrix"])
    assert of == [name for name, one in told["numbers"].items() if one["why"] == "learned"]
    deviations = [told["numbers"][name]["deviation"] for name in of]
    np.testing.assert_allclose(np.sqrt(np.diag(matrix)), deviations)
    assert told["held_out"]["verdict"] == "better"
    assert told["held_out"]["after"] < told["held_out"]["before"]
    assert 0.001 < told["noise"]["place"] < 0.01
    assert told["file"]["arguments"].keys() == {"track", "wheel_radius"}
    assert report.is_calibration(done)


def test_figures_are_drawn(done: Path) -> None:
    assert {file.name for file in done.glob("*.png")} == {"path.png", "residuals.png", "correlation.png"}
    assert all(file.read_bytes()[:8] == b"\x89PNG\r\n\x1a\n" for file in done.glob("*.png"))


def test_the_table_says_what_is_known(
    tables: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tables)
    result = run(capfd, "differential_base", "drive.csv", *SI, "--hold", "track=0.54", "--hold", "delay=0.03")
    assert result.status == 0, result.err
    lines = result.out.splitlines()
    assert lines[0] == "differential_base by drive.csv"
    assert re.fullmatch(r"track +0\.5 +0\.54 +m +held", result_line(lines, "track"))
    row = result_line(lines, "radius.left_wheel_joint")
    found = re.fullmatch(r"\S+ +0\.1 +(0\.0\d+) +(0\.0\d+) +m +learned", row)
    assert found, row
    assert len(found[1]) == len(found[2]), "as many decimals as the deviation"
    assert abs(float(found[1]) - 0.098) < 4.0 * float(found[2])
    said = (
        r"dead reckoning over \d+ windows of \S+ m: \S+ mm off before, \S+ mm after: (better|no difference)"
    )
    assert re.fullmatch(said, result.value("held out"))
    assert result.value("files in") == "runs/differential_base-calibration"
    assert (tables / "runs" / "differential_base-calibration" / "calibration.yaml").exists()


def result_line(lines: list[str], label: str) -> str:
    return next(line for line in lines if line.startswith(f"{label} ")).strip()


def test_json_is_the_summary(
    tables: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tables)
    result = run(
        capfd, "differential_base", "drive.csv", *SI, "--hold", "delay", "--json", "--out", "by_json"
    )
    assert result.status == 0, result.err
    told = json.loads(result.out)
    assert told["folder"] == "by_json"
    assert told["numbers"]["delay"]["why"] == "held"
    stored = json.loads((tables / "by_json" / "summary.json").read_text("utf-8"))
    assert stored["numbers"] == told["numbers"]


def test_worse_is_a_status_of_its_own(
    tables: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """What there is is written."""
    monkeypatch.chdir(tables)
    real = learning.held_out

    def spoilt(*given: object) -> object:
        one = real(*given)  # type: ignore[arg-type]
        assert one is not None
        return one._replace(before=one.after, after=one.before, closer=False)

    monkeypatch.setattr(learning, "held_out", spoilt)
    result = run(capfd, "differential_base", "drive.csv", *SI, "--out", "worse")
    assert result.status == 1
    assert "after: worse" in result.out
    assert "warning: over" in result.err
    assert (tables / "worse" / "calibration.yaml").exists()


def test_a_urdf_of_ones_own_gets_its_corrected_file(
    tables: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tables)
    wheel = (
        '<link name="{0}_wheel"><visual><origin rpy="1.5708 0 0"/><geometry><cylinder radius="0.1" '
        'length="0.04"/></geometry></visual></link>\n<joint name="{0}_wheel_joint" type="continuous">'
        '<origin xyz="0 {1} 0.1"/><parent link="base"/><child link="{0}_wheel"/><axis xyz="0 1 0"/></joint>\n'
    )
    body = '<link name="base"/>\n' + wheel.format("left", 0.25) + wheel.format("right", -0.25)
    Path("mine.urdf").write_text(f'<robot name="mine">\n{body}</robot>\n', "utf-8")
    result = run(capfd, "mine.urdf", "drive.csv", *SI, "--platform", "differential", "--out", "of_mine")
    assert result.status == 0, result.err
    assert "mine.urdf" in result.value("in the robot's file")
    corrected = nmm.load("of_mine/mine.urdf", platform="differential")
    assert abs(corrected.platform.track - 0.54) < 0.01  # type: ignore[attr-defined]
    assert "+" in Path("of_mine/mine.urdf.diff").read_text("utf-8")


ERRORS = [
    ((), "--reference, columns x and y or --columns x=COLUMN,…, or --reference closed"),
    (("--reference", "drive_seen.csv"), "expected as --units time=s,wheels=rad,position=m,heading=rad"),
    (("--reference", "drive_seen.csv", "--units", "wheels"), "--units: expected GROUP=UNIT"),
    (("--reference", "drive_seen.csv", "--units", "wheels=rad,wheels=deg"), "wheels is given twice"),
    (("--reference", "drive_seen.csv", "--units", "wheels=deg,time=s,position=m,heading=rad"), "would fit"),
    (("--reference", "no.csv", "--units", "SI"), "no.csv: cannot be read"),
    (("--reference", "a", "--reference", "b", "--units", "SI"), "one, or one for each of 1 logs, got 2"),
    ((*SI, "--hold", "trak"), "unknown number 'trak' (did you mean 'track'?)"),
    ((*SI, "--hold", "track=far"), "--hold: track: unknown name 'far'"),
    ((*SI, "--hold", "=0.5"), "--hold: expected NAME or NAME=VALUE"),
    ((*SI, "--hold", "track", "--hold", "track=1"), "--hold: track is given twice"),
    ((*SI, "--hold", "track=-1"), "hold track: expected 0.15 to 1.5 m, got -1"),
    ((*SI, "--hold", "track=1e308"), "hold track: expected 0.15 to 1.5 m, got 1e+308"),
    ((*SI, "--hold", "clock=1"), "hold clock: expected -0.01 to 0.01, got 1"),
    ((*SI, "--columns", f"{LEFT}={RIGHT},{RIGHT}={LEFT}"), f"with {LEFT} and {RIGHT} swapped"),
    ((*SI, "--columns", f"{LEFT}={RIGHT}"), f"{LEFT} and {RIGHT} count the same"),
    (("drive.csv", *SI), "drive.csv and drive.csv have the same counts at the same stamps"),
    ((*SI, "--joints", "/joints"), "--joints: it is of bags, and all logs are tables"),
    ((*SI, "--wrapped", "left_wheel_joint=x"), "--wrapped: left_wheel_joint: expected a number, or no"),
    ((*SI, "--shift", "100"), "the reference's stamps begin 100 s after the counters'"),
    ((*SI, "--time", "seconds"), "seconds"),
    ((*SI, "--format", "bmp"), "unknown format 'bmp'"),
    ((*SI, "--out", "."), "exists and is not what this writes"),
]


@pytest.mark.parametrize(("options", "said"), ERRORS, ids=[said[:40] for _, said in ERRORS])
def test_what_it_refuses(
    options: tuple[str, ...], said: str, tables: Path, monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    monkeypatch.chdir(tables)
    result = run(capfd, "differential_base", "drive.csv", *options)
    assert result.status == 2
    assert said in result.err, result.err
    assert result.err.startswith("nmm calibrate: ")
    assert not result.out


def test_a_log_that_stands_still_and_wheels_of_others(
    tables: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tables)
    result = run(capfd, "differential_base", "still.csv", *SI)
    assert result.status == 2
    assert "still.csv: it stands still" in result.err
    result = run(capfd, "car_base", "drive.csv", *SI)
    assert result.status == 2
    assert "--columns front_left_wheel_joint=COLUMN" in result.err
    result = run(capfd, "differential_base", "nothing.mcap", "--reference", "closed")
    assert result.status == 2
    assert "--reference closed: of a bag; expected a topic, or tf" in result.err
    result = run(capfd, "differential_base", "nothing.mcap", "--units", "SI")
    assert result.status == 2


@pytest.mark.parametrize("during", ["fit", "held_out"])
def test_an_interrupt_leaves_nothing(
    during: str, tables: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tables)

    def interrupted(*_: object) -> object:
        raise KeyboardInterrupt

    monkeypatch.setattr(learning, during, interrupted)
    result = refused(capfd, "calibrate", "differential_base", "drive.csv", *SI, "--out", "never")
    assert result.status == 130
    assert not (tables / "never").exists()
    assert not result.out


def square(file: Path, sign: float, seed: int) -> None:
    """A table of a square of 3 m that closes, of a robot with a track of 0.52 m."""
    legs = np.array([[3.0, 0.0], [0.0, sign * np.pi / 2.0]] * 4)
    steps = np.repeat(legs / 100.0, 100, axis=0)
    ways = np.stack([steps[:, 0] - 0.26 * steps[:, 1], steps[:, 0] + 0.26 * steps[:, 1]], axis=1) / 0.1
    ways += 0.005 * np.random.default_rng(seed).normal(size=ways.shape) * np.sqrt(np.abs(ways))
    counts = np.vstack([[0.0, 0.0], np.cumsum(ways, axis=0)])
    rows = np.column_stack([0.05 * np.arange(len(counts)), counts])
    np.savetxt(file, rows, header=f"t,{LEFT},{RIGHT}", delimiter=",", comments="")


def test_closed_squares_teach_the_track_beside_umbmarks_report(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    for i in range(4):
        square(Path(f"{i}.csv"), (-1.0) ** i, i)
    files = [f"{i}.csv" for i in range(4)]
    given = ("--reference", "closed", "--units", "wheels=rad,time=s", "--json", "--out", "out")
    result = run(capfd, "differential_base", *files, *given)
    assert result.status == 0, result.err
    told = json.loads(result.out)["numbers"]
    assert abs(told["track"]["after"] - 0.52) < 4.0 * told["track"]["deviation"] < 0.02
    assert told["track"]["why"] == "learned"
    rows = report.umbmark_rows(nmm.load("differential_base"), logs_of(files))
    capfd.readouterr()
    result = run(capfd, "differential_base", *files, *given[:4], "--out", "out")
    assert result.value("UMBmark") == rows[0][1]
    assert abs(float(rows[0][1].split("E_b ")[1].split(",")[0]) - 1.04) < 0.01


def logs_of(files: list[str]) -> list[nmm.DriveLog]:
    robot, units = nmm.load("differential_base"), {"wheels": "rad", "time": "s"}
    return [nmm.DriveLog.from_csv(file, robot, units=units, ends="closed") for file in files]


def test_a_drive_that_does_not_close_is_offered_to_no_file(
    tables: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tables)
    given = ("--reference", "closed", "--units", "wheels=rad,time=s", "--out", "closed")
    result = run(capfd, "differential_base", "drive.csv", *given)
    assert result.status == 2, result.out
    assert "expected drives that end on the marks" in result.err
    assert not (tables / "closed").exists()


def test_bags_are_logs_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """A simulated run's bag, with a localisation in TF."""
    monkeypatch.chdir(tmp_path)
    worn = {"disturbances": {"odometry": True, "slip": {"v": 0.98}}, "method": "zoh", "dt": 0.01}
    nmm.Scenario.load("unicycle_2r_position", worn | {"duration": 6}).run().save_mcap("drive.mcap")
    result = run(capfd, "unicycle_2r", "drive.mcap", "--units", "SI")
    assert result.status == 2
    assert "--units: it is of tables, and all logs are bags" in result.err
    result = run(capfd, "unicycle_2r", "drive.mcap", "--hold", "track")
    assert result.status in (0, 1), result.err
    assert result.out.startswith("unicycle_2r by drive")


def test_help_names_the_page() -> None:
    import subprocess

    text = subprocess.run([*NMM, "calibrate", "--help"], capture_output=True, text=True, check=True).stdout
    assert "docs/calibration.md" in text
    for name in (
        "--units",
        "--columns",
        "--reference",
        "--hold",
        "--joints",
        "--map",
        "--platform",
        "--axle",
    ):
        assert name in text
