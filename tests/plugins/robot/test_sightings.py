"""Sightings: what they hold, read from tables, and what is refused; intrinsics, by OpenCV's projection."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from helpers import simulated_sightings as sim

import nmm
from nmm.base.errors import InputError

Array = np.ndarray
TURNS = np.linspace(-1.0, 1.0, 6)
SQUARE = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]])


def sightings(**changed: Any) -> nmm.Sightings:
    given = {
        "name": "log",
        "readings": {"q1": TURNS, "q2": -TURNS},
        "seen": np.column_stack([TURNS, TURNS**2, 0.3 + 0.0 * TURNS]),
        "kind": "points",
        "on": "ee",
    }
    return nmm.Sightings(**(given | changed))


def with_corners(**changed: Any) -> nmm.Sightings:
    pixels = np.full((6, 4, 2), 300.0)
    given = {"seen": pixels, "kind": "corners", "on": "world", "by": "ee", "camera": sim.INTRINSICS}
    return sightings(**(given | {"board": SQUARE} | changed))


def test_poses_may_be_quaternions_or_matrices() -> None:
    at = np.array([[0.1, 0.2, 0.3, 0.0, 0.0, np.sin(0.4), np.cos(0.4)]] * 6)
    log = sightings(seen=at, kind="poses")
    np.testing.assert_allclose(log.seen[0, :2, 0], [np.cos(0.8), np.sin(0.8)], atol=1e-12)
    again = sightings(seen=log.seen, kind="poses")
    np.testing.assert_array_equal(again.seen, log.seen)
    assert (again.sensor, again.target, again.own_frame) == ("tracker", "body", False)


def test_a_part_has_the_rows_of_all() -> None:
    log = sightings(base=np.column_stack([TURNS, TURNS, TURNS]))
    part = log.part(2, 5)
    assert len(part) == 3
    np.testing.assert_array_equal(part.readings["q1"], TURNS[2:5])
    np.testing.assert_array_equal(part.base[:, 0], TURNS[2:5])
    assert len(log) == 6


REFUSED: list[tuple[dict[str, Any], str]] = [
    ({"kind": "dots"}, "unknown kind 'dots'"),
    ({"on": "world"}, "two frames"),
    ({"on": 3}, "on: expected a frame"),
    ({"readings": {}}, "readings by joint"),
    ({"readings": {"q1": TURNS[:4]}}, "readings of q1: expected 6 numbers"),
    ({"readings": {"q1": TURNS * np.nan}}, "finite numbers"),
    ({"seen": np.zeros((6, 2))}, r"points of shape \(N, 3\)"),
    ({"seen": np.full((6, 3), np.nan)}, "finite numbers"),
    ({"seen": np.zeros((2, 3))}, "at least three samples"),
    ({"base": np.zeros((4, 3))}, r"base: expected a matrix of shape \(6, 3\)"),
    ({"sensor": "origin"}, "sensor: expected a plain name"),
    ({"target": "a b"}, "target: expected a plain name"),
    ({"sensor": "it", "target": "it"}, "two names"),
    ({"camera": sim.INTRINSICS}, "camera: expected none"),
    ({"kind": "poses", "seen": np.zeros((6, 7))}, "sample 0: expected a quaternion of length 1"),
    ({"kind": "poses", "seen": np.zeros((6, 4, 4))}, r"expected a placement"),
    ({"kind": "poses", "seen": np.zeros((6, 5))}, r"\(N, 7\) or \(N, 4, 4\)"),
]


@pytest.mark.parametrize(("changed", "message"), REFUSED)
def test_sightings_that_are_none_are_refused(changed: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message) as error:
        sightings(**changed)
    assert len(str(error.value)) <= 300


CORNERS: list[tuple[dict[str, Any], str]] = [
    ({"camera": None}, "camera: expected a nmm.CameraIntrinsics"),
    ({"board": None}, r"board: expected its points"),
    ({"board": [[0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]]}, "not in one line"),
    ({"board": SQUARE[:3]}, r"pixels of shape \(N, 3, 2\)"),
    ({"seen": np.full((6, 4, 2), 5000.0)}, "sample 0, corner 0: expected pixels in the picture"),
    ({"seen": np.full((6, 4, 2), [np.nan, 3.0])}, "both of u and v"),
    ({"seen": np.full((6, 4, 2), np.nan)}, "at least one corner seen"),
]


@pytest.mark.parametrize(("changed", "message"), CORNERS)
def test_corners_that_cannot_be_are_refused(changed: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message) as error:
        with_corners(**changed)
    assert len(str(error.value)) <= 300
    assert with_corners().target == "board"


MODELS = {
    "plumb_bob": [-0.3, 0.12, 0.002, -0.001, 0.03],
    "rational_polynomial": [-0.3, 0.12, 0.002, -0.001, 0.03, 0.1, -0.05, 0.02],
    "equidistant": [0.05, -0.02, 0.01, -0.003],
}


@pytest.mark.parametrize("model", [*MODELS, "none"])
def test_projection_is_opencv_s(model: str) -> None:
    k = MODELS.get(model, [])
    camera = nmm.CameraIntrinsics(610.0, 615.0, 320.0, 242.0, k, "plumb_bob" if model == "none" else model)
    rng = np.random.default_rng(0)
    points = rng.uniform([-0.5, -0.4, 1.0], [0.5, 0.4, 2.0], (30, 3))
    points[0] = [0.0, 0.0, 1.0]
    zero = np.zeros(3)
    if model == "equidistant":
        seen, _ = cv2.fisheye.projectPoints(points[:, None], zero, zero, camera.matrix, np.array(k))
    else:
        seen, _ = cv2.projectPoints(points, zero, zero, camera.matrix, np.array(k) if k else None)
    np.testing.assert_allclose(camera.project(points), seen.reshape(-1, 2), atol=1e-6)
    _, slopes = camera.seen(points)
    for axis in range(3):
        step = 1e-6 * np.eye(3)[axis]
        difference = (camera.project(points + step) - camera.project(points - step)) / 2e-6
        np.testing.assert_allclose(slopes[:, :, axis], difference, atol=2e-3)


def test_what_is_not_before_a_camera_has_no_pixels() -> None:
    camera = nmm.CameraIntrinsics(600.0, 600.0, 320.0, 240.0)
    seen = camera.project([[0.1, 0.0, 1.0], [0.1, 0.0, -1.0], [0.0, 0.0, 0.0]])
    np.testing.assert_array_equal(seen, [[380.0, 240.0], [np.nan, np.nan], [np.nan, np.nan]])
    for points in ("a", [1.0, 2.0], 5.0, None):
        with pytest.raises(InputError, match="points: expected"):
            camera.project(points)
    with pytest.raises(InputError, match=r"unknown distortion model \['a'\]"):
        nmm.CameraIntrinsics(600.0, 600.0, 320.0, 240.0, model=["a"])
    with pytest.raises(InputError, match="a file's path"):
        nmm.CameraIntrinsics.load(None)


def test_intrinsics_are_those_of_ros_s_file(tmp_path: Path) -> None:
    file = tmp_path / "camera.yaml"
    file.write_text(
        "image_width: 640\nimage_height: 480\ndistortion_model: fisheye\n"
        "camera_matrix: {rows: 3, cols: 3, data: [600, 0, 320, 0, 610, 240, 0, 0, 1]}\n"
        "distortion_coefficients: {rows: 1, cols: 4, data: [0.1, 0, 0, 0]}\n"
    )
    camera = nmm.CameraIntrinsics.load(file)
    assert (camera.fx, camera.fy, camera.cx, camera.cy) == (600.0, 610.0, 320.0, 240.0)
    assert (camera.model, camera.width, camera.height) == ("equidistant", 640, 480)


WHOLE = """image_width: 640
image_height: 480
camera_matrix: {data: [600, 0, 320, 0, 600, 240, 0, 0, 1]}
distortion_coefficients: {data: []}
"""


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a: [", "YAML"),
        ("3", "expected a mapping"),
        ("[" * 20000, "nested"),
        (f"{WHOLE}x: 2020-13-45\ndistortion_model: [a]", "unknown distortion model"),
        (f"{WHOLE}x: !!int abc", "it has the tag !!int"),
        ("camera_matrix: {data: &x [*x]}", "holds itself"),
        ("image_width: 3", r"camera_matrix: expected data"),
        ("camera_matrix: {data: [1, 2, 3]}", "9 numbers"),
        ("camera_matrix: {data: [6, 1, 3, 0, 6, 2, 0, 0, 1]}", "fx, 0, cx"),
        (
            "camera_matrix: {data: [6, 0, 3, 0, 6, 2, 0, 0, 1]}\ndistortion_coefficients: {data: [1, 2]}",
            "0 or 4 or 5 coefficients",
        ),
        (
            "camera_matrix: {data: [6, 0, 3, 0, 6, 2, 0, 0, 1]}\ndistortion_coefficients: {data: []}\n"
            "distortion_model: ftheta",
            "unknown distortion model",
        ),
    ],
)
def test_intrinsics_that_are_none_are_refused(tmp_path: Path, text: str, message: str) -> None:
    file = tmp_path / "camera.yaml"
    file.write_text(text)
    with pytest.raises(InputError, match=message) as error:
        nmm.CameraIntrinsics.load(file)
    assert str(error.value).count(str(file)) == 1
    assert len(str(error.value)) <= 300
    with pytest.raises(InputError, match=r"none\.yaml: cannot be read"):
        nmm.CameraIntrinsics.load("none.yaml")


def table(path: Path, columns: dict[str, Array], gap: tuple[int, str] | None = None) -> Path:
    rows = np.column_stack([*columns.values()])
    lines = [",".join(columns)]
    for k, row in enumerate(rows):
        cells = [f"{x:.9g}" if np.isfinite(x) else "" for x in row]
        if gap == (k, gap[1] if gap else ""):
            cells[[*columns].index(gap[1])] = ""
        lines.append(",".join(cells))
    path.write_text("\n".join(lines) + "\n")
    return path


def joints(unit: float = 1.0) -> dict[str, Array]:
    return {name: unit * x for name, x in sim.postures(8).items()}


def test_points_are_read_in_their_units(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    place = rng.uniform(-500.0, 500.0, (8, 3))
    columns = joints(180.0 / np.pi) | {
        "X": place[:, 0],
        "y": place[:, 1],
        "z": place[:, 2],
        "note": place[:, 0],
    }
    file = table(tmp_path / "touched.csv", columns)
    log = nmm.Sightings.from_csv(
        file, sim.ur5(), "tool0", units={"joints": "deg", "position": "mm"}, columns={"x": "X"}
    )
    assert (log.name, log.kind, log.by) == ("touched.csv", "points", "world")
    np.testing.assert_allclose(log.seen, place / 1000.0, rtol=1e-8)
    np.testing.assert_allclose(log.readings["elbow_joint"], joints()["elbow_joint"], rtol=1e-8)
    one = {"joints": "deg", "elbow_joint": "ticks:4096", "position": "m"}
    log = nmm.Sightings.from_csv(file, sim.ur5(), "tool0", units=one, columns={"x": "X"})
    ticks = np.degrees(joints()["elbow_joint"]) * 2.0 * np.pi / 4096
    np.testing.assert_allclose(log.readings["elbow_joint"], ticks, rtol=1e-8)


def test_poses_and_a_base_that_moved_are_read(tmp_path: Path) -> None:
    columns = joints() | {name: np.full(8, 0.1) for name in ("x", "y", "z")}
    columns |= {"qx": np.zeros(8), "qy": np.zeros(8), "qz": np.ones(8), "qw": np.zeros(8)}
    columns |= {"base_x": np.arange(8.0), "base_y": np.zeros(8), "base_theta": np.full(8, 90.0)}
    file = table(tmp_path / "mocap.csv", columns)
    units = {"joints": "rad", "position": "m", "base": "cm", "heading": "deg"}
    log = nmm.Sightings.from_csv(file, sim.ur5(), "tool0", units=units)
    assert log.kind == "poses"
    np.testing.assert_allclose(log.base[3], [0.03, 0.0, np.pi / 2])
    np.testing.assert_allclose(log.seen[0, :3, :3], np.diag([-1.0, -1.0, 1.0]), atol=1e-12)


def test_corners_are_read_and_may_lack(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    pixels = rng.uniform(10.0, 700.0, (8, 4, 2))
    pixels[2, 1] = np.nan
    pixels[5] = np.nan
    columns = joints() | {f"{a}{j + 1}": pixels[:, j, k] for j in range(4) for k, a in enumerate("uv")}
    file = table(tmp_path / "corners.csv", columns)
    given = {"camera": sim.INTRINSICS, "board": "2x2:0.05", "units": "SI"}
    with pytest.warns(RuntimeWarning, match="1 row of 8"):
        log = nmm.Sightings.from_csv(file, sim.ur5(), "world", "tool0", **given)
    assert len(log) == 7
    assert log.own_frame
    np.testing.assert_allclose(log.board, [[0, 0, 0], [0.05, 0, 0], [0, 0.05, 0], [0.05, 0.05, 0]])
    assert np.isnan(log.seen[2, 1]).all()
    np.testing.assert_allclose(log.seen[3], pixels[3], rtol=1e-8)


def test_a_table_with_more_corners_than_the_board_is_refused(tmp_path: Path) -> None:
    pixels = np.random.default_rng(1).uniform(10.0, 700.0, (8, 6, 2))
    columns = joints() | {f"{a}{j + 1}": pixels[:, j, k] for j in range(6) for k, a in enumerate("uv")}
    file = table(tmp_path / "corners.csv", columns)
    given = {"camera": sim.INTRINSICS, "units": "SI"}
    with pytest.raises(InputError, match="the table has 6 corners, the board 4"):
        nmm.Sightings.from_csv(file, sim.ur5(), "world", "tool0", board="2x2:0.05", **given)
    assert len(nmm.Sightings.from_csv(file, sim.ur5(), "world", "tool0", board="3x2:0.05", **given)) == 8


TABLES: list[tuple[dict[str, Any], str]] = [
    ({}, "units of joints and position must be stated"),
    ({"units": {"joints": "rad"}}, "unit of position must be stated"),
    ({"units": {"joints": "mm", "position": "m"}}, "a unit of angle"),
    ({"units": {"wheels": "rad"}}, "unknown group or column 'wheels'"),
    ({"units": "SI", "columns": {"q": "x"}}, "unknown role 'q'"),
    ({"units": "SI", "on": "hand"}, "unknown frame 'hand'"),
    ({"units": "SI", "on": "base_link"}, "no joint of the arm moves base_link"),
    ({"units": "SI", "board": "2x2:0.05"}, "both camera and board"),
    ({"units": "SI", "board": "2x2", "camera": sim.INTRINSICS}, "COLUMNSxROWS:METRES"),
    ({"units": "SI", "board": "1x9:0.05", "camera": sim.INTRINSICS}, "COLUMNSxROWS:METRES"),
    ({"units": "SI", "board": "2x2:0.05", "camera": sim.INTRINSICS}, "unknown column 'u1'"),
    ({"units": "SI", "board": 5.0, "camera": sim.INTRINSICS}, r"board: expected points \(m, 3\)"),
    ({"units": "SI", "columns": "abc"}, "columns: expected columns by what they are"),
    ({"units": "SI", "robot": "ur5"}, "robot: expected a Robot"),
    ({"units": "SI", "path": None}, "expected a file's path, got None"),
]


@pytest.mark.parametrize(("given", "message"), TABLES)
def test_tables_that_cannot_be_read_are_refused(tmp_path: Path, given: dict[str, Any], message: str) -> None:
    columns = joints() | {name: np.full(8, 0.1) for name in ("x", "y", "z")}
    file = table(tmp_path / "touched.csv", columns)
    given = {"path": file, "robot": sim.ur5(), "on": "tool0"} | given
    with pytest.raises(InputError, match=message) as error:
        nmm.Sightings.from_csv(**given)
    assert len(str(error.value)) <= 300


def test_a_table_without_a_joint_says_which(tmp_path: Path) -> None:
    columns = joints() | {name: np.full(8, 0.1) for name in ("x", "y", "z")}
    del columns["elbow_joint"]
    with pytest.raises(InputError, match="no column of elbow_joint"):
        nmm.Sightings.from_csv(table(tmp_path / "few.csv", columns), sim.ur5(), "tool0", units="SI")


def still(count: int = 10) -> nmm.Sightings:
    return nmm.Sightings(
        "still", {n: np.full(count, 0.3) for n in sim.UR5}, np.zeros((count, 3)), "points", on="tool0"
    )


def degrees() -> nmm.Sightings:
    readings = {name: np.degrees(x) for name, x in sim.postures(12).items()}
    return nmm.Sightings("degrees", readings, np.zeros((12, 3)), "points", on="tool0")


def unread() -> nmm.Sightings:
    readings = {name: x for name, x in sim.postures(12).items() if name != "wrist_2_joint"}
    return nmm.Sightings("unread", readings, np.zeros((12, 3)), "points", on="tool0")


def few() -> nmm.Sightings:
    rng = np.random.default_rng(0)
    return nmm.Sightings("few", sim.postures(8), rng.normal(size=(8, 3)), "points", on="tool0")


def unlike() -> nmm.Sightings:
    rng = np.random.default_rng(0)
    return nmm.Sightings("unlike", sim.postures(30), rng.normal(size=(30, 3)), "points", on="tool0")


@pytest.mark.parametrize(
    ("log", "more", "message"),
    [
        (still(), {}, "the arm stands still"),
        (degrees(), {}, r"reads -?\d+.*, were it in rad; deg would fit"),
        (unread(), {}, "no readings of wrist_2_joint"),
        (few(), {}, r"8 samples tell 24 things, fewer than 27 numbers"),
        (unlike(), {}, "disagree by"),
        (few(), {"hold": "tracer"}, "unknown number or group 'tracer'"),
        (few(), {"hold": {"origin": 0.1}}, "a value for one number"),
        (few(), {"hold": {"tracker.x": "far"}}, "expected numbers"),
        (few(), {"hold": 5}, "hold: expected names of numbers"),
        (few(), {"hold": [["origin"]]}, "hold: expected names of numbers"),
        (few(), {"ratios": 5}, "ratios: expected a name, or several, got 5"),
    ],
)
def test_what_cannot_be_calibrated_is_refused(log: nmm.Sightings, more: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message) as error:
        nmm.calibrate(sim.ur5(), log, **more)
    assert len(str(error.value)) <= 300
    assert "calibrate ur5" in str(error.value)


def test_drives_and_sightings_are_told_apart() -> None:
    robot = sim.ur5()
    t = np.linspace(0.0, 1.0, 3)
    drive = nmm.DriveLog("d", t, {"v": t}, t, np.column_stack([t, t, t]), "poses")
    for logs in ([], [drive, few()], "x", None):
        with pytest.raises(InputError):
            nmm.calibrate(robot, logs)  # type: ignore[call-overload]
    with pytest.raises(InputError, match="a Robot"):
        nmm.calibrate("ur5", few())  # type: ignore[call-overload]
