"""What a drawing shows of a robot, from its models: platform's outline, wheels, heading and arm. It is made
of convex solids: the shapes of the robot's bodies, its tyres."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, TypeAlias

import numpy as np
import pinocchio as pin
from matplotlib.axes import Axes
from matplotlib.collections import Collection, LineCollection, PolyCollection

from nmm.base.arrays import Array
from nmm.base.convex_hull import convex_corners
from nmm.model.robots.loading.joint_kinds import axis
from nmm.model.robots.meshes import read_meshes
from nmm.model.robots.robot import Robot
from nmm.views.figures.views import ABOVE, View
from nmm.views.playback.extent import corners
from nmm.views.playback.placements import Placements, joint_screw
from nmm.views.playback.rolling import Rolling
from nmm.views.playback.sticks import appearance

Color: TypeAlias = str | tuple[float, float, float]
#: A joint that is not farther beside its link's axis than this stands on a column, m.
_COLUMN = 0.01


@dataclass(frozen=True)
class Ink:
    """Colours and widths, pt, of a robot's drawing: `edge` of edges, wheels and heading; `body` of faces;
    `links` of each line along the arm's links; `outline`, `joint`, `rim`, `tip` of the platform's edge, a
    joint's mark and its rim, an arm's end (0: none); `lift` of the arm above `zorder`."""

    edge: Color
    body: Color
    links: tuple[tuple[Color, float], ...]
    outline: float
    joint: float
    rim: float = 1.0
    tip: float = 0.0
    heading: bool = False
    zorder: float = 2.0
    lift: float = 0.3

    def times(self, share: float) -> Ink:
        """With all lines and marks thinner by a share."""
        links = tuple((color, share * width) for color, width in self.links)
        sizes = {name: share * getattr(self, name) for name in ("outline", "joint", "rim", "tip")}
        return replace(self, links=links, **sizes)


@dataclass(frozen=True, eq=False)
class DrawnPose:
    """A robot's drawing at one configuration, points (k, 3) in world axes, m: each convex shape and wheel;
    `main`, the root link's body, or all where it has no shape; `heading`, a triangle that points ahead; the
    ends of each of the arm's links, its joints, its ends."""

    body: list[Array]
    wheels: list[Array]
    main: Array
    heading: Array
    links: list[Array]
    joints: Array
    tip: Array
    _outlines: dict[View, tuple[list[Array], list[Array]]] = field(default_factory=dict, repr=False)

    def outlines(self, view: View) -> tuple[list[Array], list[Array]]:
        """The platform's shapes and the wheels as outlines (k, 2) as they are seen in a view."""
        if view not in self._outlines:
            bodies, wheels = (
                [hull(view.of(shape)) for shape in shapes] for shapes in (self.body, self.wheels)
            )
            self._outlines[view] = bodies, wheels
        return self._outlines[view]

    def draw(self, axes: Axes, view: View, ink: Ink) -> None:
        bodies, marks = self.outlines(view)
        if view == ABOVE and ink.heading and len(self.heading):
            marks = [*marks, view.of(self.heading)]
        z, lines = ink.zorder, [view.of(ends) for ends in self.links]
        # Edges of all shapes first, faces above them: what stays visible is the edge of their union.
        drawn: list[Collection] = [
            PolyCollection(
                bodies, facecolors="none", edgecolors=[ink.edge], linewidths=ink.outline, zorder=z
            ),
            PolyCollection(bodies, facecolors=[ink.body], linewidths=0, zorder=z),
            PolyCollection(marks, facecolors=[ink.edge], linewidths=0, zorder=z),
        ]
        z += ink.lift
        for color, width in ink.links:
            drawn.append(LineCollection(lines, colors=[color], linewidths=width, capstyle="round", zorder=z))
        for collection in drawn:
            axes.add_collection(collection, autolim=False)
        axes.plot(
            *view.of(self.joints).T, "o", markersize=ink.joint, color="white", markeredgecolor=ink.edge,
            markeredgewidth=ink.rim, zorder=z, linestyle="none",
        )  # fmt: skip
        if ink.tip:
            tips = view.of(self.tip)
            axes.plot(*tips.T, "o", markersize=ink.tip, color=ink.edge, zorder=z, linestyle="none")

    def points(self) -> Array:
        return np.vstack([*self.body, *self.wheels, self.heading, *self.links, self.joints, self.tip])


class Silhouette:
    """A robot's drawing, whose arm ends at the frame or at the outermost frame of each branch."""

    def __init__(self, robot: Robot, frame: str | None = None) -> None:
        model, display = robot.model, robot.display_model
        self._rolling, self._placements = Rolling(robot), Placements(robot)
        own = [joint for joint in range(1, model.njoints) if model.joints[joint].idx_q < robot.platform.n_p]
        #: The platform's main joint: the last of x, y, theta; the world itself under a fixed base.
        self._root = next((joint for joint in own if model.joints[joint].idx_q == 2), 0)
        self._arm = [joint for joint in range(1, model.njoints) if joint not in own]
        self._parents = {joint: int(model.parents[joint]) for joint in self._arm}
        #: Joints of the display model by those of the model.
        self._shown = [0, *(display.getJointId(name) for name in list(model.names)[1:])]
        self._body = platform_shapes(robot, own or [self._root])
        # How a caster stands follows from the path that it has taken, which q does not determine.
        self._wheels = [
            HullPoints(joint, tyre(wheel.radius, axis(display.joints[joint], np.zeros(display.nq))))
            for joint, wheel in ((display.getJointId(wheel.joint), wheel) for wheel in robot.wheels)
            if not wheel.swivel or wheel.swivel in self._rolling.steered
        ]
        self._heading = _heading_mark(self._body, self._root) if own else np.zeros((0, 3))
        self._tips = _tips(robot, self._arm, frame)
        self._feet = _feet(robot, self._arm)

    def at(self, q: Array) -> DrawnPose:
        places = [np.eye(4), *self._placements.world(q, self._rolling.settled(q))]

        def world(shown: int, points: Array) -> Array:
            return points @ places[shown][:3, :3].T + places[shown][:3, 3]

        shown = self._shown
        joints = {joint: places[shown[joint]][:3, 3] for joint in self._arm}
        tips = [(joint, world(shown[joint], point)) for joint, point in self._tips]
        ends = [
            (joints[parent], joints[child]) for child, parent in self._parents.items() if parent in joints
        ]
        ends += [(joints[joint], tip) for joint, tip in tips if joint in joints]
        ends += [(world(shown[self._parents[joint]], foot), joints[joint]) for joint, foot in self._feet]
        body = [world(shown[solid.joint], solid.points) for solid in self._body]
        of_root = [part for solid, part in zip(self._body, body, strict=True) if solid.joint == self._root]
        return DrawnPose(
            body=body,
            main=np.vstack(of_root or body),
            wheels=[world(wheel.joint, wheel.points) for wheel in self._wheels],
            heading=world(shown[self._root], self._heading),
            links=[np.array(both) for both in ends],
            joints=np.array(list(joints.values())).reshape(-1, 3),
            tip=np.array([tip for _, tip in tips]).reshape(-1, 3),
        )


def _heading_mark(body: list[HullPoints], root: int) -> Array:
    """A triangle on the rear half of the platform, where no arm hides it, that points along its x axis."""
    points = np.vstack([solid.points for solid in body if solid.joint == root] or [body[0].points])
    low, high = points.min(axis=0), points.max(axis=0)
    length, width = high[0] - low[0], high[1] - low[1]
    middle = 0.5 * (low[1] + high[1])
    back = low[0] + 0.16 * length
    x = [back + 0.28 * length, back, back]
    y = [middle, middle + 0.18 * width, middle - 0.18 * width]
    return np.column_stack([x, y, np.full(3, high[2])])


def _tips(robot: Robot, arm: Sequence[int], frame: str | None) -> list[tuple[int, Array]]:
    """Where the arm's lines end: joint and point in the joint's frame."""
    model, tips = robot.model, []
    if frame is not None:
        wanted = model.frames[robot.frame_id(frame)]
        tips.append((int(wanted.parentJoint), np.array(wanted.placement.translation)))
    inner = {int(model.parents[joint]) for joint in arm} | {joint for joint, _ in tips}
    for leaf in (joint for joint in arm if joint not in inner):
        carried = [frame.placement.translation for frame in model.frames if frame.parentJoint == leaf]
        outermost = max(carried, key=np.linalg.norm, default=np.zeros(3))
        if np.linalg.norm(outermost) > 1e-6:
            tips.append((leaf, np.array(outermost)))
    return tips


def _feet(robot: Robot, arm: Sequence[int]) -> list[tuple[int, Array]]:
    """Joint and foot (3,), in its parent joint's frame, of columns that carry an arm's first joint: the
    origin of the link below, where the joint turns or slides along the line from there."""
    model, feet = robot.model, []
    for joint in arm:
        name = model.names[joint]
        if model.parents[joint] in arm or not model.existFrame(name, pin.FrameType.JOINT):
            continue
        below = model.frames[model.frames[model.getFrameId(name, pin.FrameType.JOINT)].parentFrame]
        foot = np.array(below.placement.translation)
        column = model.jointPlacements[joint].translation - foot
        linear, angular = joint_screw(model, joint)
        along = model.jointPlacements[joint].rotation @ (angular if angular.any() else linear)
        offset = float(np.linalg.norm(np.cross(column, along)))
        high = float(np.linalg.norm(column)) > _COLUMN
        if below.parentJoint == model.parents[joint] and high and offset < _COLUMN:
            feet.append((joint, foot))
    return feet


#: Directions, spread evenly over the sphere, in which a mesh's outermost points are kept.
_DIRECTIONS = 200
#: Points on a circle that stands for a round edge.
_AROUND = 28


@dataclass(frozen=True, eq=False)
class HullPoints:
    """Points (k, 3), m, whose convex hull is a shape, in the frame of joint `joint`."""

    joint: int
    points: Array


def platform_shapes(robot: Robot, platform: Sequence[int]) -> list[HullPoints]:
    """The visual shapes on the platform's joints, or else the collision shapes, or else what a page draws."""
    names = {robot.model.names[joint]: joint for joint in platform}
    visual, collision = robot.shapes

    def carried(model: pin.Model, shapes: pin.GeometryModel) -> list[pin.GeometryObject]:
        return [shape for shape in shapes.geometryObjects if model.names[shape.parentJoint] in names]

    model, shapes = robot.display_model, carried(robot.display_model, visual)
    if not shapes:
        model, shapes = robot.model, carried(robot.model, collision)
    if not shapes:
        model, shapes = robot.display_model, carried(robot.display_model, appearance(robot).shapes)
    read_meshes(shapes, robot.name)  # not the arm's, which is drawn as lines
    outlines = ((shape, outline_points(shape.geometry)) for shape in shapes)
    return _outermost(
        [
            HullPoints(
                names[model.names[shape.parentJoint]],
                points @ np.array(shape.placement.rotation).T + np.array(shape.placement.translation),
            )
            for shape, points in outlines
            if points is not None
        ]
    )


def outline_points(geometry: Any) -> Array | None:
    """Points (k, 3), m, whose convex hull is nearly a shape of Coal's, in its axes; None for a half-space."""
    name = type(geometry).__name__
    if name == "Halfspace":
        return None
    if name in ("Sphere", "Capsule"):
        k = np.linspace(-0.5 * np.pi, 0.5 * np.pi, _AROUND // 2 + 1)
        radius, lift = float(geometry.radius), float(geometry.halfLength) if name == "Capsule" else 0.0
        return np.vstack([_cylinder(radius * np.cos(a), lift + radius * np.sin(a)) for a in k[k >= 0.0]])
    if name == "Cylinder":
        return _cylinder(float(geometry.radius), float(geometry.halfLength))
    if hasattr(geometry, "vertices") or hasattr(geometry, "points"):
        vertices = geometry.vertices() if hasattr(geometry, "vertices") else geometry.points()
        return _extremes(np.array(vertices).reshape(-1, 3))  # Pinocchio has scaled them
    geometry.computeLocalAABB()
    return corners(np.array([geometry.aabb_local.min_, geometry.aabb_local.max_]))


def _cylinder(radius: float, half_length: float) -> Array:
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
    return np.asarray(vertices[np.unique(np.argmax(vertices @ directions.T, axis=0))])


def _outermost(solids: list[HullPoints]) -> list[HullPoints]:
    """The shapes without those hidden by another of the same joint from above and from the side."""
    # Lower ends with their signs changed: what a box holds is less throughout.
    boxes = [np.array([-solid.points.min(axis=0), solid.points.max(axis=0)]) for solid in solids]

    def hides(j: int, i: int) -> bool:
        within = solids[i].joint == solids[j].joint and bool(np.all(boxes[i] <= boxes[j] + 1e-3))
        return within and (i > j or not np.allclose(boxes[i], boxes[j], atol=1e-3))

    every = range(len(solids))
    return [solids[i] for i in every if not any(hides(j, i) for j in every if j != i)]


def tyre(radius: float, along: Array) -> Array:
    """A tyre around the origin about an axis, half as wide as its radius."""
    across = np.eye(3)[int(np.argmin(np.abs(along)))]
    first = np.cross(along, across)
    first /= np.linalg.norm(first)
    R = np.column_stack([first, np.cross(along, first), along])
    return _cylinder(radius, 0.25 * radius) @ R.T


def hull(points: Array) -> Array:
    """The corners of the convex hull of points (k, 2), counterclockwise."""
    return points[convex_corners(points)]
