"""Sightings of an arm that is not quite its file's, by yourdfpy's kinematics and OpenCV's projection."""

from __future__ import annotations

import warnings
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import yourdfpy
from scipy.spatial.transform import Rotation

import nmm
from nmm.model.robots.loading.packages import Packages

Array = np.ndarray
UR5 = tuple(
    f"{name}_joint" for name in ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
)
#: The arm that stands there: its numbers beside its file's.
TRUTH = {
    "offset.shoulder_lift_joint": 0.012,
    "offset.elbow_joint": -0.02,
    "offset.wrist_1_joint": 0.015,
    "offset.wrist_2_joint": -0.01,
    "origin.shoulder_lift_joint.y": 0.001,
    "origin.elbow_joint.z": 0.0015,
    "origin.wrist_2_joint.z": -0.001,
    "origin.elbow_joint.yaw": 0.003,
}
#: Where a tracker stands in the world, where a camera and a board are, and where a ball and a marker sit.
TRACKER = ([3.0, -2.0, 1.1], [2.0, 1.4, -3.0])
POINT = [0.05, 0.1, 0.04]
BODY = ([0.03, 0.05, -0.02], [0.4, -1.2, 2.0])
CAMERA = ([0.01, 0.06, 0.03], [-1.4, 0.1, -0.3])
BOARD = ([0.55, 0.05, 0.02], [0.02, 0.03, 0.5])
GRID = np.array([[0.03 * i, 0.03 * j, 0.0] for j in range(6) for i in range(9)])
INTRINSICS = nmm.CameraIntrinsics(
    800.0, 805.0, 640.0, 360.0, [-0.12, 0.05, 0.001, -0.0005, 0.0], width=1280, height=720
)


def matrix(at: tuple[Any, Any]) -> Array:
    """(4, 4) of a place and roll, pitch, yaw, by scipy."""
    made = np.eye(4)
    made[:3, :3] = Rotation.from_euler("xyz", at[1]).as_matrix()
    made[:3, 3] = at[0]
    return made


@cache
def ur5_file() -> Path:
    share = next(f for f in Packages(Path(__file__)).folders if (f / "example-robot-data").is_dir())
    return share / "example-robot-data/robots/ur_description/urdf/ur5_robot.urdf"


@cache
def ur5() -> nmm.Robot:
    return nmm.load(ur5_file())


class Arm:
    """The arm that stands there, by yourdfpy: its file with other origins, its joints with other zeros."""

    def __init__(self, truth: Mapping[str, float], folder: Path, file: Path | None = None) -> None:
        root = ET.parse(file or ur5_file())
        self._zeros = {n.removeprefix("offset."): x for n, x in truth.items() if n.startswith("offset.")}
        self._ratios = {n.removeprefix("ratio."): x for n, x in truth.items() if n.startswith("ratio.")}
        moved: dict[str, dict[str, float]] = {}
        for name, value in truth.items():
            if name.startswith("origin."):
                _, joint, part = name.split(".")
                moved.setdefault(joint, {})[part] = value
        for joint, parts in moved.items():
            element = next(j for j in root.iter("joint") if j.get("name") == joint)
            origin = element.find("origin")
            if origin is None:
                origin = ET.SubElement(element, "origin")
            before = [[float(x) for x in origin.get(key, "0 0 0").split()] for key in ("xyz", "rpy")]
            by = [[parts.get(p, 0.0) for p in group] for group in (("x", "y", "z"), ("roll", "pitch", "yaw"))]
            after = matrix((before[0], before[1])) @ matrix((by[0], by[1]))
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # at a quarter turn one of two angles is 0
                angles = Rotation.from_matrix(after[:3, :3]).as_euler("xyz")
            origin.set("xyz", " ".join(f"{x:.17g}" for x in after[:3, 3]))
            origin.set("rpy", " ".join(f"{x:.17g}" for x in angles))
        path = folder / "there.urdf"
        root.write(path)
        self._urdf = yourdfpy.URDF.load(str(path), load_meshes=False, build_scene_graph=True)
        self._base = self._urdf.base_link

    def placements(self, readings: Mapping[str, Array], frame: str) -> Array:
        """(N, 4, 4) of a frame in the base's, at encoders' readings."""
        made = []
        for row in zip(*readings.values(), strict=True):
            at = {
                joint: self._ratios.get(joint, 1.0) * x + self._zeros.get(joint, 0.0)
                for joint, x in zip(readings, row, strict=True)
            }
            self._urdf.update_cfg(at)
            made.append(self._urdf.get_transform(frame, self._base))
        return np.array(made)


def postures(count: int = 50, seed: int = 0, reach: float = 2.0) -> dict[str, Array]:
    """Readings of UR5's joints, by joint, rad."""
    rng = np.random.default_rng(seed)
    return {joint: rng.uniform(-reach, reach, count) for joint in UR5}


def points(
    arm: Arm, readings: Mapping[str, Array], noise: float = 2e-4, seed: int = 1, **more: Any
) -> nmm.Sightings:
    """A tracker in the world and a ball on the hand."""
    hand = arm.placements(readings, "tool0")
    seen = (np.linalg.inv(matrix(TRACKER)) @ hand @ np.array([*POINT, 1.0]))[:, :3]
    seen = seen + noise * np.random.default_rng(seed).normal(size=seen.shape)
    return nmm.Sightings("tracker.csv", dict(readings), seen, "points", **{"on": "tool0", **more})


def poses(
    arm: Arm,
    readings: Mapping[str, Array],
    noise: tuple[float, float] = (2e-4, 1e-3),
    seed: int = 1,
    **more: Any,
) -> nmm.Sightings:
    """Motion capture in the world and a body on the hand."""
    seen = np.linalg.inv(matrix(TRACKER)) @ arm.placements(readings, "tool0") @ matrix(BODY)
    rng = np.random.default_rng(seed)
    turns = Rotation.from_rotvec(noise[1] * rng.normal(size=(len(seen), 3)))
    quaternions = (Rotation.from_matrix(seen[:, :3, :3]) * turns).as_quat()
    places = seen[:, :3, 3] + noise[0] * rng.normal(size=(len(seen), 3))
    rows = np.concatenate([places, quaternions], axis=1)
    return nmm.Sightings("mocap.csv", dict(readings), rows, "poses", **{"on": "tool0", **more})


@cache
def looking(count: int, seed: int = 0) -> dict[str, Array]:
    """Readings at which the camera on the hand has the board in its picture."""
    model = ur5().model
    data, tool = model.createData(), model.getFrameId("tool0")
    rng = np.random.default_rng(seed)
    found: list[Array] = []
    camera, board = matrix(CAMERA), matrix(BOARD)
    middle = board @ np.array([*GRID.mean(axis=0), 1.0])
    while len(found) < count:
        row = rng.uniform(-2.6, 2.6, 6)
        pin.framesForwardKinematics(model, data, np.concatenate([np.zeros(3), row]))
        eye = data.oMf[tool].homogeneous @ camera
        at = np.linalg.inv(eye) @ middle
        facing = np.linalg.inv(eye)[2, :3] @ board[:3, 2]
        near = 0.35 < at[2] < 0.9 and np.hypot(*(at[:2] / at[2])) < 0.25
        if near and abs(facing) > 0.6 and eye[2, 3] > 0.1:
            found.append(row)
    return dict(zip(UR5, np.array(found).T, strict=True))


def corners(
    arm: Arm, readings: Mapping[str, Array], noise: float = 0.2, seed: int = 1,
    camera: nmm.CameraIntrinsics = INTRINSICS, **more: Any,
) -> nmm.Sightings:  # fmt: skip
    """A camera on the hand and a board on a table, by OpenCV."""
    import cv2

    eyes = arm.placements(readings, "tool0") @ matrix(CAMERA)
    seen = []
    for eye in eyes:
        at = np.linalg.inv(eye) @ matrix(BOARD)
        turn = cv2.Rodrigues(at[:3, :3])[0]
        pixels, _ = cv2.projectPoints(GRID, turn, at[:3, 3], camera.matrix, camera.distortion)
        seen.append(pixels[:, 0])
    rows = np.array(seen) + noise * np.random.default_rng(seed).normal(size=(len(eyes), len(GRID), 2))
    outside = ((rows < 0.0) | (rows > [camera.width - 1, camera.height - 1])).any(axis=2)
    rows[outside] = np.nan
    return nmm.Sightings(
        "corners.csv", dict(readings), rows, "corners", camera=camera, board=GRID,
        **{"on": "world", "by": "tool0", "sensor": "eye", **more},
    )  # fmt: skip
