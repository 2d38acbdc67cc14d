"""The list of commands that makes a page: who draws what where, in order."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from nmm.arrays import Array
from nmm.playback.encoding import encode, packed
from nmm.playback.keyframes import Keyframes
from nmm.playback.placements import Placements, position_and_quaternion
from nmm.playback.shapes import shapes
from nmm.playback.sticks import appearance
from nmm.robots.robot import Robot

Rgb = tuple[float, float, float]
Command = dict[str, Any]


class Drawing:
    """Commands in the order in which the page carries them out; a geometry is sent once."""

    def __init__(self) -> None:
        self.commands: list[Command] = []
        self._geometries: dict[str, str] = {}

    def add(self, kind: str, **fields: Any) -> None:
        """Append a command."""
        self.commands.append({"type": kind, **fields})

    def transform(self, path: str, matrix: Array) -> None:
        """Place a node in its parent's frame."""
        self.add("set_transform", path=path, matrix=matrix.T.ravel().tolist())

    def object(
        self,
        path: str,
        geometry: Mapping[str, Any],
        color: Rgb,
        *,
        opacity: float = 1.0,
        rank: int = 0,
        sheet: bool = False,
    ) -> None:
        """A mesh. Where surfaces coincide, the one of the lowest rank is seen. A sheet hides nothing and has
        no shadow."""
        identity = hashlib.sha1(encode(geometry).encode("utf-8"), usedforsecurity=False).hexdigest()
        if identity not in self._geometries:
            self._geometries[identity] = f"geometry{len(self._geometries)}"
            self.add("geometry", id=self._geometries[identity], data=dict(geometry))
        material = {"color": list(color), "opacity": opacity, "rank": rank, "sheet": sheet}
        self.add("object", path=path, geometry=self._geometries[identity], material=material)


class DrawnRobot:
    """A robot in the page: a node for each joint, in its parent's, and below the joints what is seen.

    Attributes
    ----------
    paths : path of each joint of the display model, joint 1 first
    root : path of the node that is the platform's root link
    """

    def __init__(
        self, drawing: Drawing, robot: Robot, path: str, *, tint: Rgb | None = None, rank: int = 0
    ) -> None:
        model = robot.display_model
        self.placements = Placements(robot)
        below = [path]
        for joint in range(1, model.njoints):
            below.append(f"{below[model.parents[joint]]}/{segment(model.names[joint])}")
        self.paths = below[1:]
        # A fixed base stands where the robot's own node is.
        self.root = below[model.getJointId("theta") if robot.platform.n_p else 0]
        seen = appearance(robot).shapes.geometryObjects
        self.visuals = [
            f"{below[geometry.parentJoint]}/visual {i} {segment(geometry.name)}"
            for i, geometry in enumerate(seen)
        ]
        self._drawing = drawing
        for at, geometry in zip(self.visuals, seen, strict=True):
            drawing.transform(at, np.array(geometry.placement.homogeneous))
            for k, shape in enumerate(shapes(geometry)):
                color = _mixed(shape.color[:3], tint)
                drawing.object(f"{at}/{k}", shape.geometry, color, opacity=shape.color[3], rank=rank)
                if not np.array_equal(shape.matrix, np.eye(4)):
                    drawing.transform(f"{at}/{k}", shape.matrix)

    def place(self, q: Array, wheels: Array) -> None:
        """Put the robot at coordinates q (n,) with wheel angles (W,)."""
        for path, matrix in zip(self.paths, self.placements.relative(q, wheels), strict=True):
            self._drawing.transform(path, matrix)

    def pose(self, q: Array, wheels: Array) -> Command:
        """The command that moves it to coordinates q (n,) with wheel angles (W,) in a page that shows it."""
        matrices = self.placements.relative(q, wheels)
        transforms = [
            [path, matrix.T.ravel().tolist()] for path, matrix in zip(self.paths, matrices, strict=True)
        ]
        return {"type": "pose", "transforms": transforms}

    def animations(self, frames: Keyframes, start: float) -> list[Command]:
        """MeshCat's animations: a clip for each joint that moves. Times count from `start`."""
        matrices = np.array(
            [self.placements.relative(q, w) for q, w in zip(frames.q, frames.wheels, strict=True)]
        )
        times, kept = page_times(frames.t - start)
        positions, quaternions = position_and_quaternion(matrices[kept])
        animations = []
        for joint, path in enumerate(self.paths):
            animations += animation(
                path, times, {"position": positions[:, joint], "quaternion": quaternions[:, joint]}
            )
        return animations

    def ghosts(self, path: str, q: Array, wheels: Array, texts: Sequence[str]) -> None:
        """Transparent copies at q (G, n), each with its text above it; the page makes them from the robot's
        own geometry."""
        matrices = np.array([self.placements.world(*at) for at in zip(q, wheels, strict=True)])
        poses = np.concatenate(position_and_quaternion(matrices), axis=-1)
        self._drawing.add(
            "ghosts",
            path=path,
            texts=list(texts),
            joints=[
                {"path": joint, "poses": packed(poses[:, i], np.float64)}
                for i, joint in enumerate(self.paths)
            ],
        )


def animation(path: str, times: Array, tracks: Mapping[str, Array]) -> list[Command]:
    """MeshCat's animation of a node; none where nothing changes.

    Parameters
    ----------
    times : (K,) from `page_times`
    tracks : "position" (K, 3), "quaternion" (K, 4), "scale" (K, 3)
    """
    moving = [
        {
            "name": f".{name}",
            "type": "quaternion" if name == "quaternion" else "vector3",
            "times": packed(times, np.float32),
            "values": packed(values, np.float32),
        }
        for name, values in tracks.items()
        if np.ptp(values, axis=0).max() > 1e-12
    ]
    return [{"path": path, "clip": {"fps": 1, "name": "motion", "tracks": moving}}] if moving else []


def segment(name: str) -> str:
    """A name as one segment of a path."""
    return name.replace("/", "_") or "_"


def _mixed(color: Sequence[float], tint: Rgb | None) -> Rgb:
    """A colour drawn towards a tint; dark parts stay dark."""
    red, green, blue = color[:3]
    if tint is None:
        return red, green, blue
    light = min(0.45 + 0.7 * (0.3 * red + 0.6 * green + 0.1 * blue), 1.0)
    mixed = [0.25 * c + 0.75 * light * t for c, t in zip((red, green, blue), tint, strict=True)]
    return mixed[0], mixed[1], mixed[2]


def page_times(t: Array) -> tuple[Array, Array]:
    """Times in the browser's single precision, ascending, and which of them are kept.

    The last one is rounded down: seeking to the end must find it.
    """
    times = t.astype(np.float32)
    if times[-1] > t[-1]:
        times[-1] = np.nextafter(times[-1], np.float32(0.0))
    kept = np.concatenate([times[:-1] < times[-1], [True]])
    kept[1:-1] &= np.diff(times)[:-1] > 0.0
    return times[kept], kept
