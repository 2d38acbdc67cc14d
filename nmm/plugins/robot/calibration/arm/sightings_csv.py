"""Sightings from text files: a row for each posture, joints beside what was seen."""

from __future__ import annotations

import re
import warnings
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import Array, Integers, array
from nmm.base.errors import InputError, expect, expect_kind, expect_known
from nmm.base.findings import Finding
from nmm.model.robots.robot import Robot
from nmm.plugins.robot.calibration.arm.chain import Chain
from nmm.plugins.robot.calibration.arm.intrinsics import CameraIntrinsics
from nmm.plugins.robot.calibration.arm.sightings import Kind, Sightings
from nmm.plugins.robot.calibration.log_table import Columns, TextTable
from nmm.plugins.robot.calibration.log_units import Unit, Units, near_names

POINT, TURN = ("x", "y", "z"), ("qx", "qy", "qz", "qw")
BASE = ("base_x", "base_y", "base_theta")
#: The groups of columns that have a unit in common, each with what it measures, and its unit of SI.
GROUPS = {
    "joints": ("angle", "rad"),
    "slides": ("length", "m"),
    "position": ("length", "m"),
    "base": ("length", "m"),
    "heading": ("angle", "rad"),
}
_CORNER = re.compile(r"[uv](\d{1,9})$")
_BOARD = re.compile(r"\s*(\d+)\s*x\s*(\d+)\s*:\s*([0-9.eE+-]+)\s*$")


def from_csv(
    path: str | Path,
    robot: Robot,
    on: str,
    by: str,
    *,
    units: Mapping[str, str] | str | None = None,
    columns: Mapping[str, str] | None = None,
    camera: CameraIntrinsics | str | Path | None = None,
    board: ArrayLike | str | None = None,
    sensor: str = "",
    target: str = "",
    delimiter: str | None = None,
    name: str | None = None,
) -> Sightings:
    """See `Sightings.from_csv`."""
    expect_kind(path, str | Path, "sightings", "a file's path")
    file = Path(path)
    where = str(file)
    expect_kind(robot, Robot, f"{where}: robot", "a Robot, as nmm.load gives it")
    expect_kind(columns, Mapping | None, f"{where}: columns", "columns by what they are: {'x': 'X [mm]'}")
    table = TextTable(file, delimiter)
    chain = Chain(robot, by, on, where)
    joints = dict(zip(chain.names(chain.coordinates), chain.coordinates, strict=True))
    corners = camera is not None or board is not None
    if corners and (camera is None or board is None):
        missing = "camera" if camera is None else "board"
        raise InputError("corners need both camera and board", where=f"{where}: {missing}")
    points = None if board is None else board_points(board, f"{where}: board")
    many = 0 if points is None else len(points)
    seen = [f"{axis}{j + 1}" for j in range(many) for axis in "uv"]
    if points is not None:
        _expect_all_corners(table, points, where)
    asked = {role: str(column) for role, column in (columns or {}).items()}
    for role in asked:
        expect_known("role", role, [*joints, *POINT, *TURN, *BASE, *seen], f"{where}: columns")
    called = {role: asked.get(role, role) for role in (*joints, *POINT, *TURN, *BASE, *seen)}
    visible = {role for role, column in called.items() if role in asked or column in table.header}
    if missing_joints := [joint for joint in joints if joint not in visible]:
        raise near_names(missing_joints, table.header, where)
    kind: Kind = "corners" if corners else "poses" if visible & {*TURN} else "points"
    roles = {"corners": seen, "poses": [*POINT, *TURN], "points": [*POINT]}[kind]
    based = bool(visible & {*BASE}) and chain.on_platform
    stated = Units(units, called.values(), where, GROUPS)
    factors: dict[str, Unit | None] = {}
    for joint, c in joints.items():
        group = "joints" if robot.q_units[c] == "rad" else "slides"
        factors[joint] = stated.group(group, called[joint])
    if not corners:
        factors |= {role: stated.group("position", called[role]) for role in POINT}
    if based:
        factors |= {
            role: stated.group("heading" if role == BASE[2] else "base", called[role]) for role in BASE
        }
    stated.expect_all()
    wanted = [*joints, *roles, *(BASE if based else ())]
    read = table.read([called[role] for role in wanted])
    values = {role: read.columns[called[role]] * getattr(factors.get(role), "factor", 1.0) for role in wanted}
    whole = _whole(read, values, [role for role in wanted if role not in seen], seen, file)
    rows = np.column_stack([values[role][whole] for role in roles])
    if isinstance(camera, str | Path):
        camera = CameraIntrinsics.load(camera)
    if kind == "corners":
        rows = rows.reshape(len(rows), many, 2)
    base = np.column_stack([values[role][whole] for role in BASE]) if based else None
    return Sightings(
        file.name if name is None else name,
        {joint: values[joint][whole] for joint in joints},
        rows, kind, on, by, camera, points, base, sensor, target,
    )  # fmt: skip


def board_points(board: ArrayLike | str, where: str) -> Array:
    """Points (m, 3), m, of a board: as they are, or by "9x6:0.025", along x first."""
    if not isinstance(board, str):
        points = array(board, where)
        expect(points.ndim == 2 and points.shape[1] == 3, where, "points (m, 3), m, or 9x6:0.025", board)
        return points
    result = _BOARD.match(board)
    expected = "COLUMNSxROWS:METRES, corners and how far apart these are: 9x6:0.025"
    if result is None:
        raise InputError(where=where, expected=expected, got=board)
    try:
        across, down, apart = int(result[1]), int(result[2]), float(result[3])
    except ValueError:
        raise InputError(where=where, expected=expected, got=board) from None
    if across < 2 or down < 2 or not 0.0 < apart < np.inf or across * down > 10_000:
        raise InputError(where=where, expected=expected, got=board)
    j, i = np.divmod(np.arange(across * down), across)
    return np.column_stack([i * apart, j * apart, np.zeros(len(i))])


def _expect_all_corners(table: TextTable, points: Array, where: str) -> None:
    """`InputError` for a table with more corners than the board has."""
    matches = (_CORNER.match(name) for name in table.header)
    most = max((int(match[1]) for match in matches if match), default=0)
    if most > len(points):
        what = f"the table has {most} corners, the board {len(points)}"
        raise InputError(
            what, where=f"{where}: board", expected="the board that was seen, with all its corners"
        )


def _whole(
    read: Columns, values: Mapping[str, Array], needed: list[str], corners: list[str], file: Path
) -> Integers:
    """The rows that have all numbers, and a corner; how many have not is told."""
    finite = {role: np.isfinite(values[role]) for role in (*needed, *corners)}
    good = np.all([finite[role] for role in needed], axis=0)
    if corners:
        good &= np.any([finite[role] for role in corners], axis=0)
    lost = ~good
    findings = [Finding("row_cut", {"file": file.name})] if read.cut else []
    if lost.any():
        names = [role for role in needed if (~finite[role] & lost).any()] or ["corners"]
        count = {"count": int(lost.sum()), "of": len(lost)}
        findings.append(Finding("rows_left_out", {"file": file.name, **count, "names": names}))
    for finding in findings:
        warnings.warn(str(finding), RuntimeWarning, stacklevel=4)
    return np.flatnonzero(good)
