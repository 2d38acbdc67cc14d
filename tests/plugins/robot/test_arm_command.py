"""nmm calibrate --seen-on: what it prints and writes of an arm, and what it refuses."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from command_line import Result, refused
from helpers import simulated_sightings as sim
from places import UR5

import nmm
from nmm.cli.exit_status import status_of

UNITS = ("--units", "joints=deg,position=mm")
SI = ("--units", "SI")
CAMERA = """image_width: 1280
image_height: 720
camera_matrix: {rows: 3, cols: 3, data: [800, 0, 640, 0, 805, 360, 0, 0, 1]}
distortion_model: plumb_bob
distortion_coefficients: {rows: 1, cols: 5, data: [-0.12, 0.05, 0.001, -0.0005, 0.0]}
"""


@pytest.fixture(scope="module")
def tables(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with touched.csv in degrees and mm, corners.csv, camera.yaml, and other.csv, whose last
    postures are of an arm with other zeros."""
    folder = tmp_path_factory.mktemp("sightings")
    arm = sim.Arm(sim.TRUTH, folder)
    log = sim.points(arm, sim.postures(40))
    head = ",".join([*sim.UR5, "x", "y", "z"])
    rows = np.column_stack([*(np.degrees(x) for x in log.readings.values()), 1000.0 * log.seen])
    np.savetxt(folder / "touched.csv", rows, "%.6f", ",", header=head, comments="")
    seen = sim.corners(arm, sim.looking(15))
    names = [f"{axis}{j + 1}" for j in range(len(sim.GRID)) for axis in "uv"]
    rows = np.column_stack([*seen.readings.values(), seen.seen.reshape(len(seen), -1)])
    lines = [",".join("" if np.isnan(x) else f"{x:.6f}" for x in row) for row in rows]
    (folder / "corners.csv").write_text("\n".join([",".join([*sim.UR5, *names]), *lines]) + "\n")
    (folder / "camera.yaml").write_text(CAMERA)
    return folder


@pytest.fixture(scope="module")
def done(tables: Path) -> Path:
    out = tables / "out"
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tables)
        given = ["calibrate", UR5, "touched.csv", "--seen-on", "tool0", *UNITS, "--out", str(out)]
        assert status_of(given) == 0
    return out


def run(captured: pytest.CaptureFixture[str], *arguments: str) -> Result:
    result = refused(captured, "calibrate", UR5, *arguments)
    assert "Traceback" not in result.err
    assert all(len(line) <= 300 for line in result.err.splitlines())
    return result


def test_it_writes_what_load_takes(done: Path) -> None:
    robot = nmm.load(UR5, calibration=done / "calibration.yaml")
    file = nmm.CalibrationFile.load(done / "calibration.yaml")
    for name, true in sim.TRUTH.items():
        deviation = file.numbers[name].deviation
        assert 0.0 < deviation < 1e-3
        assert abs(nmm.robot_numbers(robot)[name].value - true) < 4.0 * deviation, name
    told = json.loads((done / "summary.json").read_text("utf-8"))
    noise = told["noise"]["touched.csv"]
    assert noise["place"] == pytest.approx(2e-4, rel=0.3)
    assert (noise["turn"], noise["pixel"]) == (None, None)
    assert told["held_out"]["verdict"] == "better"
    assert told["covariance"]["of"][:6] == [f"tracker.{p}" for p in ("x", "y", "z", "roll", "pitch", "yaw")]
    assert told["numbers"]["offset.shoulder_pan_joint"]["why"] == "as others"
    assert {path.name for path in done.glob("*.png")} == {"residuals.png", "correlation.png"}
    assert (done / "ur5_robot.urdf").is_file()


def test_the_corrected_file_is_the_robot_that_the_calibration_makes(done: Path) -> None:
    file = nmm.load(done / "ur5_robot.urdf", missing_meshes="skip")
    by_file = nmm.load(UR5, calibration=done / "calibration.yaml")
    told = json.loads((done / "summary.json").read_text("utf-8"))["file"]
    assert not told["left"]
    q = by_file.q_from(dict.fromkeys(sim.UR5, 0.3), base=[0.0, 0.0, 0.0])
    again = file.q_from(dict.fromkeys(sim.UR5, 0.3), base=[0.0, 0.0, 0.0])
    np.testing.assert_allclose(
        nmm.Configuration(file, again).placement("tool0").homogeneous,
        nmm.Configuration(by_file, q).placement("tool0").homogeneous,
        atol=1e-6,
    )


def test_a_camera_on_the_hand_is_calibrated(
    tables: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tables)
    given = ("--seen-on", "world", "--seen-by", "tool0", "--sensor", "eye", "--camera", "camera.yaml")
    held = ("--hold", "origin", "--hold", "board.z=0.02", "--json", "--out", "hand")
    result = run(capsys, "corners.csv", *given, "--board", "9x6:0.03", *SI, *held)
    assert result.status == 0
    told = json.loads(result.out)
    assert told["numbers"]["board.z"] == {
        "before": 0.0, "after": 0.02, "deviation": 0.0, "unit": "m", "why": "held",
    }  # fmt: skip
    eye = [told["numbers"][f"eye.{part}"]["after"] for part in ("x", "y", "z", "roll", "pitch", "yaw")]
    np.testing.assert_allclose(eye, [*sim.CAMERA[0], *sim.CAMERA[1]], atol=6e-3)
    assert {path.name for path in (tables / "hand").glob("*.png")} == {"residuals.png", "correlation.png"}


def test_a_tracker_that_was_set_up_anew_has_another_name(
    tables: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two logs of one file's name, each with a tracker of its own; the ball is the same."""
    monkeypatch.chdir(tables)
    for folder, (first, last), moved in (("run1", (0, 20), 0.0), ("run2", (20, 40), 700.0)):
        Path(folder).mkdir()
        rows = np.loadtxt("touched.csv", delimiter=",", skiprows=1)[first:last]
        rows[:, -1] += moved
        np.savetxt(
            f"{folder}/touched.csv", rows, "%.6f", ",", header=",".join([*sim.UR5, *"xyz"]), comments=""
        )
    given = ("run1/touched.csv", "run2/touched.csv", "--seen-on", "tool0", *UNITS, "--hold", "origin")
    named = ("--sensor", "before", "--sensor", "after", "--target", "ball", "--json", "--out", "twice")
    result = run(capsys, *given, *named)
    assert result.status == 0
    told = json.loads(result.out)
    assert told["logs"] == ["run1/touched.csv", "run2/touched.csv"]
    assert [*told["noise"]] == told["logs"]
    assert {"before.x", "after.x", "ball.x"} <= {*told["covariance"]["of"]}
    apart = [
        np.array([told["numbers"][f"{name}.{part}"]["after"] for part in "xyz"])
        for name in ("before", "after")
    ]
    assert np.linalg.norm(apart[1] - apart[0]) == pytest.approx(0.7, abs=0.02)
    result = run(capsys, *given, "--sensor", "a", "--sensor", "b", "--sensor", "c")
    assert "--sensor: expected one, or one for each of 2 logs, got 3" in result.err


REFUSED = [
    (("touched.csv", "./touched.csv", "--seen-on", "tool0", *UNITS), "touched.csv: expected each log once"),
    (("touched.csv", "--target", "ball"), "--target: it is of sightings of an arm"),
    (
        (
            "corners.csv",
            "--seen-on",
            "world",
            "--seen-by",
            "tool0",
            "--camera",
            "camera.yaml",
            "--board",
            "9x6:0.03",
            *SI,
            "--hold",
            "origin",
            "--hold",
            "offset",
        ),
        "expected --sensor a name for what tool0 only carries",
    ),
    (
        ("touched.csv", "--seen-by", "tool0"),
        "--seen-by: it is of sightings of an arm; expected --seen-on FRAME",
    ),
    (("touched.csv", "--seen-on", "tool0"), r"as --units joints=rad,position=m"),
    (("touched.csv", "--seen-on", "hand", *UNITS), "--seen-on: unknown frame 'hand'"),
    (
        ("touched.csv", "--seen-on", "tool0", "--seen-by", "base", *UNITS, "--time", "t"),
        "--time: it is of drives",
    ),
    (("touched.csv", "--seen-on", "tool0", *UNITS, "--reference", "tf"), "--reference: it is of bags"),
    (
        ("touched.csv", "--seen-on", "tool0", *UNITS, "--map", "map"),
        "--map: it is of bags, and all logs are tables",
    ),
    (("touched.csv", "--seen-on", "tool0", *SI), "were it in rad; deg would fit"),
    (("touched.csv", "--seen-on", "tool0", *UNITS, "--hold", "tracer"), "unknown number or group 'tracer'"),
    (("touched.csv", "--seen-on", "tool0", *UNITS, "--ratios", "elbow"), "unknown joint 'elbow'"),
    (("none.csv", "--seen-on", "tool0", *UNITS), "none.csv"),
    (("touched.csv", "--seen-on", "tool0", *UNITS, "--board", "9x6:0.03"), "both camera and board"),
]


@pytest.mark.parametrize(("arguments", "message"), REFUSED)
def test_what_it_refuses(
    arguments: tuple[str, ...],
    message: str,
    tables: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tables)
    result = run(capsys, *arguments, "--out", "not_made")
    assert result.status != 0
    assert message in result.err
    assert not (tables / "not_made").exists()
