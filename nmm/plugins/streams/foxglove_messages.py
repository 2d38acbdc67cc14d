"""Foxglove's messages of poses, lines and surfaces."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from nmm.base.arrays import Array
from nmm.plugins.streams.pictures import Pose, Transform, Triangles
from nmm.plugins.streams.tools import FOXGLOVE, imported

BLUE, ORANGE, GREEN, RED = (0.12, 0.47, 0.71), (1.0, 0.5, 0.05), (0.17, 0.63, 0.17), (0.84, 0.15, 0.16)
GREY = (0.6, 0.6, 0.6)
Rgb = tuple[float, float, float]
UPRIGHT = np.array([0.0, 0.0, 0.0, 1.0])
#: Pixels of a line; m of a target; pixels of a text.
WIDTH, SIZE, TEXT = 2.0, 0.06, 12.0


class FoxgloveMessages:
    """Makes messages; entities are in the frame `world`. `kinds` has the classes."""

    def __init__(self, world: str) -> None:
        self.kinds = imported(f"{FOXGLOVE}.messages")
        self._world = world

    def time(self, stamp: int) -> Any:
        """The clock's time, ns."""
        return self.kinds.Timestamp(*divmod(stamp, 1_000_000_000))

    def vector(self, values: Array) -> Any:
        """Of (3,)."""
        x, y, z = (float(value) for value in values)
        return self.kinds.Vector3(x=x, y=y, z=z)

    def points(self, rows: Array) -> list[Any]:
        """Of (N, 3)."""
        return [self.kinds.Point3(x=x, y=y, z=z) for x, y, z in np.asarray(rows, dtype=np.float64).tolist()]

    def turn(self, values: Array) -> Any:
        """Of a quaternion (4,) x y z w."""
        x, y, z, w = (float(value) for value in values)
        return self.kinds.Quaternion(x=x, y=y, z=z, w=w)

    def pose(self, pose: Pose) -> Any:
        """Of a position and a quaternion."""
        return self.kinds.Pose(position=self.vector(pose[0]), orientation=self.turn(pose[1]))

    def color(self, rgb: Rgb, a: float = 1.0) -> Any:
        """Of parts from 0 to 1."""
        r, g, b = rgb
        return self.kinds.Color(r=r, g=g, b=b, a=a)

    def frames(self, transforms: Sequence[Transform], stamp: int) -> Any:
        """Transforms at a time of the clock, ns."""
        at = self.time(stamp)
        return self.kinds.FrameTransforms(
            transforms=[
                self.kinds.FrameTransform(
                    timestamp=at,
                    parent_frame_id=parent,
                    child_frame_id=child,
                    translation=self.vector(position),
                    rotation=self.turn(turn),
                )
                for parent, child, position, turn in transforms
            ]
        )

    def entity(self, name: str, stamp: int, frame: str = "", **drawn: Any) -> tuple[str, Any]:
        """An entity in a frame, the world's unless given, with which it moves; with its name."""
        return name, self.kinds.SceneEntity(
            id=name, timestamp=self.time(stamp), frame_id=frame or self._world, frame_locked=True, **drawn
        )

    def line(self, points: Array, rgb: Rgb) -> Any:
        """A line through points (N, 3), some pixels wide."""
        return self.kinds.LinePrimitive(
            type=self.kinds.LinePrimitiveLineType.LineStrip,
            points=self.points(points),
            thickness=WIDTH,
            scale_invariant=True,
            color=self.color(rgb),
        )

    def at(self, points: Array) -> list[Any]:
        """Balls at points (N, 3)."""
        size = self.kinds.Vector3(x=SIZE, y=SIZE, z=SIZE)
        poses = (self.pose((point, UPRIGHT)) for point in points)
        return [self.kinds.SpherePrimitive(pose=pose, size=size, color=self.color(GREEN)) for pose in poses]

    def text(self, words: str, point: Array) -> Any:
        """Words at a point (3,), which face the camera."""
        return self.kinds.TextPrimitive(
            pose=self.pose((point, UPRIGHT)),
            text=words,
            billboard=True,
            scale_invariant=True,
            font_size=TEXT,
            color=self.color(RED),
        )

    def surface(self, surface: Triangles, pose: Pose) -> Any:
        """A surface, half transparent."""
        return self.kinds.TriangleListPrimitive(
            pose=self.pose(pose),
            points=self.points(surface.vertices),
            indices=surface.faces.ravel().tolist(),
            color=self.color(GREY, 0.6),
        )
