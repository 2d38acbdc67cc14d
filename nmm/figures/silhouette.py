"""What of a robot a drawing shows: its platform's outline, its wheels, its heading and its arm.

Everything comes from the robot's own models: the outline from the shapes that the platform carries,
the arm's lines from the placements of its joints. No robot is known by name.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from nmm.arrays import Array
from nmm.configuration import Configuration
from nmm.robot import Robot, Wheel

#: Directions, spread evenly over the sphere, in which a mesh's outermost points are kept.
_DIRECTIONS = 200
#: Points on a circle that stands for a round edge.
_AROUND = 28
#: Half width and half length of the neutral outline of a platform without shapes, m.
_NEUTRAL = 0.2


@dataclass(frozen=True, eq=False)
class Solid:
    """Points (k, 3), m, whose convex hull is a shape, in the frame of joint `joint`."""

    joint: int
    points: Array


@dataclass(frozen=True, eq=False)
class Pose:
    """A robot's drawing at one configuration, in world axes, m.

    Attributes
    ----------
    body, wheels : (k, 3) points of each convex shape of the platform, and of each wheel
    heading : (3, 3) a triangle on the platform that points ahead
    links : (2, 3) the ends of each line of the arm
    joints : (k, 3) the arm's joints
    tip : (k, 3) the ends of the arm
    """

    body: list[Array]
    wheels: list[Array]
    heading: Array
    links: list[Array]
    joints: Array
    tip: Array

    def points(self) -> Array:
        """All points, (k, 3), for the limits of the axes."""
        return np.vstack([*self.body, *self.wheels, self.heading, *self.links, self.joints, self.tip])


class Silhouette:
    """The drawing of `robot`; `at(q)` places it.

    Parameters
    ----------
    robot : the robot
    frame : the frame at which the arm ends; the outermost frame of each branch when not given
    """

    def __init__(self, robot: Robot, frame: str | None = None) -> None:
        self.robot = robot
        model = robot.model
        self._anchors = _anchors(robot)
        platform = [
            joint for joint in range(1, model.njoints) if model.joints[joint].idx_q < robot.platform.n_p
        ]
        #: The platform's main joint: the last of x, y, theta.
        self._root = next(joint for joint in platform if model.joints[joint].idx_q == 2)
        self._arm = [joint for joint in range(1, model.njoints) if joint not in platform]
        self._body = _platform_shapes(robot, platform)
        self._wheels = [Solid(self._root, _wheel_points(wheel)) for wheel in robot.wheels]
        if not self._body:
            self._body = [Solid(self._root, _neutral_outline(self._wheels))]
        self._heading = _heading_mark(self._body, self._root)
        self._tips = _tips(robot, self._arm, frame)

    def at(self, q: Array) -> Pose:
        """The drawing at configuration q, (n,)."""
        configuration = Configuration(self.robot, q)
        places: dict[int, tuple[Array, Array]] = {}

        def world(joint: int, points: Array) -> Array:
            if joint not in places:
                places[joint] = self._place(configuration, joint)
            R, p = places[joint]
            return points @ R.T + p

        origin = np.zeros((1, 3))
        joints = {joint: world(joint, origin)[0] for joint in self._arm}
        parents = {joint: int(self.robot.model.parents[joint]) for joint in self._arm}
        links = [
            np.array([joints[parents[joint]], joints[joint]])
            for joint in self._arm
            if parents[joint] in joints
        ]
        tips = [(joint, world(joint, point[None])[0]) for joint, point in self._tips]
        links += [np.array([joints[joint], tip]) for joint, tip in tips if joint in joints]
        return Pose(
            body=[world(solid.joint, solid.points) for solid in self._body],
            wheels=[world(solid.joint, solid.points) for solid in self._wheels],
            heading=world(self._root, self._heading),
            links=links,
            joints=np.array(list(joints.values())).reshape(-1, 3),
            tip=np.array([tip for _, tip in tips]).reshape(-1, 3),
        )

    def _place(self, configuration: Configuration, joint: int) -> tuple[Array, Array]:
        """Rotation and position of a joint's frame in the world."""
        name, offset = self._anchors[joint]
        placement = configuration.placement(name) * offset
        return np.array(placement.rotation), np.array(placement.translation)


def _anchors(robot: Robot) -> dict[int, tuple[str, Any]]:
    """For each joint a frame that it carries, and the joint's placement seen from that frame."""
    anchors: dict[int, tuple[str, Any]] = {}
    for name in robot.frames:
        frame = robot.model.frames[robot.frame_id(name)]
        anchors.setdefault(int(frame.parentJoint), (name, frame.placement.inverse()))
    return anchors


def _platform_shapes(robot: Robot, platform: Sequence[int]) -> list[Solid]:
    """The shapes that the platform's joints carry: what is seen, or else what collides."""
    names = {robot.model.names[joint]: joint for joint in platform}
    for model, geometry in ((robot.display_model, robot.visual_model), (robot.model, robot.collision_model)):
        solids = []
        for shape in geometry.geometryObjects:
            joint = names.get(model.names[shape.parentJoint])
            if joint is not None:
                solids.append(Solid(joint, _shape_points(shape)))
        if solids:
            return _outermost(solids)
    return []


def _shape_points(shape: Any) -> Array:
    """Points whose convex hull is that of a Pinocchio geometry object, in its joint's frame."""
    geometry = shape.geometry
    if hasattr(geometry, "halfSide"):
        points = _corners(-np.array(geometry.halfSide), np.array(geometry.halfSide))
    elif type(geometry).__name__ == "Cylinder":
        points = _cylinder(float(geometry.radius), float(geometry.halfLength))
    elif hasattr(geometry, "vertices") or hasattr(geometry, "points"):
        vertices = geometry.vertices() if hasattr(geometry, "vertices") else geometry.points()
        points = _extremes(np.array(vertices).reshape(-1, 3) * np.array(shape.meshScale))
    else:
        geometry.computeLocalAABB()
        box = geometry.aabb_local
        points = _corners(np.array(box.min_), np.array(box.max_))
    return points @ np.array(shape.placement.rotation).T + np.array(shape.placement.translation)


def _corners(low: Array, high: Array) -> Array:
    x, y, z = np.meshgrid(*zip(low, high, strict=True), indexing="ij")
    return np.column_stack([x.ravel(), y.ravel(), z.ravel()])


def _cylinder(radius: float, half_length: float) -> Array:
    """Points on the two rims of a cylinder about z."""
    angles = np.linspace(0.0, 2.0 * np.pi, _AROUND, endpoint=False)
    rim = np.column_stack([radius * np.cos(angles), radius * np.sin(angles), np.full(_AROUND, half_length)])
    return np.vstack([rim, rim * (1.0, 1.0, -1.0)])


def _extremes(vertices: Array) -> Array:
    """The outermost of many points in directions spread over the sphere: nearly their convex hull."""
    if len(vertices) <= _DIRECTIONS:
        return vertices
    k = np.arange(_DIRECTIONS) + 0.5
    z = 1.0 - 2.0 * k / _DIRECTIONS
    angle = k * np.pi * (3.0 - np.sqrt(5.0))  # the golden angle: Fibonacci's sphere
    level = np.sqrt(1.0 - z * z)
    directions = np.column_stack([level * np.cos(angle), level * np.sin(angle), z])
    chosen: Array = vertices[np.unique(np.argmax(vertices @ directions.T, axis=0))]
    return chosen


def _outermost(solids: list[Solid]) -> list[Solid]:
    """Without the shapes that another of the same joint hides from above and from the side."""
    boxes = [(solid.joint, solid.points.min(axis=0), solid.points.max(axis=0)) for solid in solids]
    kept = []
    for i, (joint, low, high) in enumerate(boxes):
        hidden = any(
            i != j
            and joint == other
            and np.all(low >= outer_low - 1e-3)
            and np.all(high <= outer_high + 1e-3)
            and (i > j or not np.allclose([low, high], [outer_low, outer_high], atol=1e-3))
            for j, (other, outer_low, outer_high) in enumerate(boxes)
        )
        if not hidden:
            kept.append(solids[i])
    return kept


def _wheel_points(wheel: Wheel) -> Array:
    """A tyre about the wheel's axis, half as wide as its radius."""
    axis = wheel.axis / np.linalg.norm(wheel.axis)
    up = np.array([0.0, 0.0, 1.0])
    R = np.column_stack([np.cross(axis, up), up, axis])
    return _cylinder(wheel.radius, 0.25 * wheel.radius) @ R.T + wheel.center


def _neutral_outline(wheels: list[Solid]) -> Array:
    """A box around the wheels, or of a neutral size where there is none."""
    if not wheels:
        return _corners(np.array([-_NEUTRAL, -_NEUTRAL, 0.0]), np.array([_NEUTRAL, _NEUTRAL, _NEUTRAL]))
    points = np.vstack([wheel.points for wheel in wheels])
    low, high = points.min(axis=0), points.max(axis=0)
    ahead = max(high[0], 0.5 * (high[1] - low[1]))
    return _corners(np.array([low[0], low[1], 0.0]), np.array([ahead, high[1], high[2]]))


def _heading_mark(body: list[Solid], root: int) -> Array:
    """A triangle on the rear half of the platform, where no arm hides it, that points along its x axis."""
    points = np.vstack([solid.points for solid in body if solid.joint == root] or [body[0].points])
    low, high = points.min(axis=0), points.max(axis=0)
    length, width = high[0] - low[0], high[1] - low[1]
    middle = 0.5 * (low[1] + high[1])
    back = low[0] + 0.16 * length
    return np.array(
        [
            [back + 0.28 * length, middle, high[2]],
            [back, middle + 0.18 * width, high[2]],
            [back, middle - 0.18 * width, high[2]],
        ]
    )


def _tips(robot: Robot, arm: Sequence[int], frame: str | None) -> list[tuple[int, Array]]:
    """Where the arm's lines end: joint and point in the joint's frame."""
    model = robot.model
    if frame is not None:
        wanted = model.frames[robot.frame_id(frame)]
        found = [(int(wanted.parentJoint), np.array(wanted.placement.translation))]
        leaves = [joint for joint in _leaves(robot, arm) if joint != found[0][0]]
    else:
        found, leaves = [], _leaves(robot, arm)
    for leaf in leaves:
        carried = [frame.placement.translation for frame in model.frames if frame.parentJoint == leaf]
        outermost = max(carried, key=np.linalg.norm, default=np.zeros(3))
        if np.linalg.norm(outermost) > 1e-6:
            found.append((leaf, np.array(outermost)))
    return found


def _leaves(robot: Robot, arm: Sequence[int]) -> list[int]:
    parents = {int(robot.model.parents[joint]) for joint in arm}
    return [joint for joint in arm if joint not in parents]
