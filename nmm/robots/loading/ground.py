"""Where a robot's wheels touch the ground, from their shapes, and what is odd about it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from nmm.arrays import Array
from nmm.robots.loading.joint_kinds import axis
from nmm.robots.loading.layout import ROUNDED, Measured
from nmm.robots.robot import Robot
from nmm.robots.wheel import Wheel

#: Lowest points that differ by no more than this, m, are on one ground: so much do casters give way.
LEVEL = 5e-3
#: In the name of a frame that is on the ground (REP-120).
FOOTPRINT = "footprint"
#: A radius and a height that differ by less are the same number, m.
SAME = 1e-9


@dataclass(frozen=True)
class Ground:
    """Where wheels touch the ground.

    Attributes
    ----------
    lowest : the height of each wheel's lowest point over the platform's reference point, m, by its joint
    shapes : how far each wheel's shapes reach from its axis, m; of those that have some
    doubtful : each wheel's height that was taken for its radius and is not that of its shape, m
    near : what counts as one height, m
    """

    lowest: dict[str, float]
    shapes: dict[str, float]
    doubtful: dict[str, float]
    near: float

    @classmethod
    def of(cls, robot: Robot) -> Ground | None:
        """Of a robot's wheels; None without any."""
        if not robot.wheels:
            return None
        measured = Measured(robot.model, (), robot.name)
        near = max(LEVEL, ROUNDED * max(wheel.radius for wheel in robot.wheels))
        ground = cls({}, {}, {}, near)
        for wheel in robot.wheels:
            carrier = measured.placements[robot.model.getJointId(wheel.carrier)]
            height, radius = float(carrier.act(wheel.center)[2]), wheel.radius
            shape = _reach(robot, wheel)
            if shape > 0.0:
                ground.shapes[wheel.joint] = shape
                if abs(height - radius) < SAME:  # no one gave it
                    radius = shape
                    if abs(shape - height) > near:
                        ground.doubtful[wheel.joint] = height
            ground.lowest[wheel.joint] = height - radius
        return ground

    @property
    def z(self) -> float:
        """The height of most wheels' lowest points, m."""
        return round(float(np.median([*self.lowest.values()])), 6) + 0.0  # no -0

    def fact(self, root: str) -> str:
        """In words; `root` is the root link's name."""
        if not self.shapes:
            return "taken to be at z = 0: no wheel has a shape"
        if abs(self.z) <= self.near:
            return "the wheels touch it at z = 0"
        return (
            f"the wheels touch it at z = {self.z:.4g} m in link {root!r}; heights count from the ground with "
            f"--axle 0,0,{self.z:.4g} (axle=(0, 0, {self.z:.4g}))"
        )

    def warnings(self, robot: Robot) -> Iterator[str]:
        """Radii that are not those of shapes, wheels not on one level, footprints that are not on it."""
        for name, height in self.doubtful.items():
            radius = self.shapes[name]
            yield (
                f"wheel {name!r}: its height over the root link's xy plane, {height:.4g} m, is taken for its "
                f"radius, and its shape's is {radius:.4g} m: give it, --wheels {name}={radius:.4g},... "
                f"(wheels={{{name!r}: {radius:.4g}, ...}})"
            )
        heights = self.lowest.values()
        if max(heights) - min(heights) > self.near:
            told = ", ".join(f"{name} at z = {z + 0.0:.4g} m" for name, z in self.lowest.items())
            yield (
                f"the wheels do not touch one level ground: {told}; expected within {1e3 * self.near:.3g} mm "
                "of each other. Heights or radii are wrong, or the robot stands tilted"
            )
            return
        for frame in robot.model.frames:
            if frame.type != pin.FrameType.BODY:
                continue
            if FOOTPRINT in frame.name and robot.model.names[frame.parentJoint] == "theta":
                off = float(frame.placement.translation[2]) - self.z
                if abs(off) > self.near:
                    side = "above" if off > 0.0 else "below"
                    yield (
                        f"frame {frame.name!r} is {abs(off):.4g} m {side} the ground that the wheels touch: "
                        "a footprint is on it"
                    )


def _reach(robot: Robot, wheel: Wheel) -> float:
    """How far a wheel's shapes reach from its axis, m: collision shapes, or those shown; 0 without any."""
    shown = robot.display_model
    joint = shown.getJointId(wheel.joint)
    links = {frame.name for frame in shown.frames if frame.parentJoint == joint}
    carried = [  # by what carries the wheel, which is no joint where things collide
        _farthest(shape, wheel.center, wheel.axis)
        for shape in robot.shapes.collision_model.geometryObjects
        if robot.model.frames[shape.parentFrame].name in links
    ]
    along = axis(shown.joints[joint], pin.neutral(shown))
    return max(carried, default=0.0) or max(
        (
            _farthest(shape, np.zeros(3), along)
            for shape in robot.shapes.visual_model.geometryObjects
            if shape.parentJoint == joint
        ),
        default=0.0,
    )


def _farthest(shape: pin.GeometryObject, point: Array, along: Array) -> float:
    """The largest distance (m) of a shape's points from an axis through a point, in its joint's frame."""
    points, around = _points(shape.geometry)
    placed = points @ shape.placement.rotation.T + shape.placement.translation - point
    across = placed - np.outer(placed @ along, along)
    return float(np.linalg.norm(across, axis=1).max(initial=0.0)) + around


def _points(geometry: Any) -> tuple[Array, float]:
    """Points (k, 3) of a shape, m, and the radius of the balls around them that fill it; none of a box, which
    stands for a wheel that is round."""
    kind = type(geometry).__name__
    turns = np.linspace(0.0, 2.0 * np.pi, 72, endpoint=False)
    match kind:
        case "Sphere":
            return np.zeros((1, 3)), float(geometry.radius)
        case "Capsule":
            return np.outer((-1.0, 1.0), (0.0, 0.0, geometry.halfLength)), float(geometry.radius)
        case "Cylinder":
            rim = geometry.radius * np.column_stack([np.cos(turns), np.sin(turns)])
            ends = [np.column_stack([rim, np.full(72, end * geometry.halfLength)]) for end in (-1.0, 1.0)]
            return np.vstack(ends), 0.0
    mesh = getattr(geometry, "vertices", None)
    return (np.zeros((0, 3)) if mesh is None else np.array(mesh())), 0.0
