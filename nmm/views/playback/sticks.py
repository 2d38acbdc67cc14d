"""What is drawn of a robot: visuals; for bodies without any, collision shapes or sticks between joints."""

from collections.abc import Container, Iterator
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from nmm.base.arrays import Array
from nmm.base.errors import RobotError
from nmm.model.robots.loading.joint_kinds import axis, is_revolute, kind
from nmm.model.robots.loading.provenance import loaded_parts
from nmm.model.robots.meshes import read_meshes
from nmm.model.robots.robot import Robot
from nmm.model.robots.wheel import Wheel
from nmm.views.playback.placements import joint_screw

fcl = pin.hppfcl

Color = tuple[float, float, float, float]
GREY, DARK = (0.62, 0.65, 0.69, 1.0), (0.25, 0.27, 0.30, 1.0)
#: Radius of a stick over the median length of one, and its bounds, m; a joint's ball, a rail over a stick.
SLIM, THINNEST, THICKEST, BALL, RAIL = 0.05, 0.002, 0.025, 1.8, 0.5
#: Radius of a root link without shapes and wheels, m; of a fixed one at most this share of the arm.
BASE, FOOT = 0.2, 0.15
#: Points nearer than this, m, are one; a prismatic joint's limits beyond LONGEST, m, are none.
SAME, LONGEST = 1e-6, 10.0


@dataclass(frozen=True, eq=False)
class Appearance:
    """What is drawn: shapes on `display_model`, or `visual_model` itself if every body has a visual; and the
    links drawn by their collision shapes (`solids`) and as sticks."""

    shapes: pin.GeometryModel
    solids: tuple[str, ...] = ()
    sticks: tuple[str, ...] = ()

    def notes(self) -> list[str]:
        solids = f"links without visuals are drawn by their collision shapes: {_listed(self.solids)}"
        sticks = f"links without shapes are drawn as sticks: {_listed(self.sticks)}"
        return [solids] * bool(self.solids) + [sticks] * bool(self.sticks)


def appearance(robot: Robot) -> Appearance:
    """What to draw of a robot, whose models stay unchanged; sticks come after visuals."""
    model, visuals = robot.display_model, robot.visual_model
    seen = {int(geometry.parentJoint) for geometry in visuals.geometryObjects}
    bare = [joint for joint in range(_root(robot), model.njoints) if joint not in seen]
    if not bare:
        return Appearance(visuals)
    solids = _solids(robot, bare)
    solid = {int(geometry.parentJoint) for geometry in solids}
    figure = _StickFigure(robot, [joint for joint in bare if joint not in solid])
    drawn = list(figure.shapes())
    if not solids and not drawn:  # links without length between others, at a wrist's crossing axes
        return Appearance(visuals)
    shapes = visuals.copy()
    for geometry in (*solids, *drawn):
        shapes.addGeometryObject(geometry)
    sticks = {int(geometry.parentJoint) for geometry in drawn}
    return Appearance(shapes, _links(robot, solid), _links(robot, sticks.intersection(figure.bare)))


@dataclass(frozen=True, eq=False)
class _Plate:
    """A root link: its middle (3,), half its sides or twice its radius, (2,), and thickness; m."""

    middle: Array
    half: Array
    thick: float
    round: bool


def _plate(robot: Robot) -> _Plate:
    """A disc through wheels equally far from the reference point, a box between others, and a disc on the
    ground for a root link without wheels."""
    wheels = [wheel for wheel in robot.wheels if wheel.carrier == "theta"]
    if not wheels:
        return _Plate(np.array([0.0, 0.0, 0.1 * BASE]), np.full(2, BASE), 0.2 * BASE, round=True)
    centers = np.array([wheel.center for wheel in wheels])
    height, thick = float(centers[:, 2].mean()), 0.5 * min(wheel.radius for wheel in wheels)
    away = np.linalg.norm(centers[:, :2], axis=1)
    if np.ptp(away) <= 0.1 * away.max():
        # A single wheel right below the reference point has no distance from it.
        return _Plate(np.array([0.0, 0.0, height]), np.full(2, max(away.max(), thick)), thick, round=True)
    points = np.vstack([centers[:, :2], np.zeros(2)])
    low, high = points.min(axis=0), points.max(axis=0)
    half = 0.5 * np.maximum(high - low, 0.25 * np.max(high - low))
    return _Plate(np.array([*(0.5 * (low + high)), height]), half, thick, round=False)


class _StickFigure:
    def __init__(self, robot: Robot, bare: list[int]) -> None:
        self.robot, self.model, self.bare = robot, robot.display_model, bare
        self.root, self.plate = _root(robot), _plate(robot)
        self.wheels = {self.model.getJointId(wheel.joint): wheel for wheel in robot.wheels}
        self.lines = {joint: list(self._lines(joint)) for joint in bare if joint not in self.wheels}
        of_platform = {self.root} if robot.platform.n_p else set()
        arms = [line for joint, lines in self.lines.items() if joint not in of_platform for line in lines]
        lengths = [float(np.linalg.norm(end - start)) for start, end in arms]
        usual = float(np.median(lengths)) if lengths else BASE
        self.radius = float(np.clip(SLIM * usual, THINNEST, THICKEST))
        self.reach = sum(lengths)

    def shapes(self) -> Iterator[pin.GeometryObject]:
        for joint in self.bare:
            name = str(self.model.names[joint])
            if joint in self.wheels:
                yield self._tyre(joint, self.wheels[joint])
                continue
            for k, (start, end) in enumerate(self.lines[joint]):
                yield _stick(f"stick {k} of {name}", joint, start, end, self.radius)
            if joint == self.root:
                yield self._base()
                continue
            parent = int(self.model.parents[joint])
            # Links without length between others with shapes stay unseen.
            if not self.lines[joint] and not self.lines.get(parent):
                continue
            if is_revolute(self.model.joints[joint]):
                ball = fcl.Sphere(BALL * self.radius)
                yield _shape(f"joint {name}", joint, pin.SE3.Identity(), ball)
            elif (way := self._way(joint)) is not None:
                yield _stick(f"rail of {name}", parent, *way, RAIL * self.radius)

    def _lines(self, joint: int) -> Iterator[tuple[Array, Array]]:
        """From the joint's origin to its children's and to the farthest frame, (3,) each, in its frame."""
        model = self.model
        children = [child for child in range(joint + 1, model.njoints) if model.parents[child] == joint]
        ends = [np.array(model.jointPlacements[child].translation) for child in children]
        frames = [frame for frame in model.frames if frame.parentJoint == joint]
        carried = [np.array(frame.placement.translation) for frame in frames]
        # The platform's own frames are no ends.
        if carried and joint != self.root:
            far = max(carried, key=np.linalg.norm)
            if not any(np.linalg.norm(far - end) < SAME for end in ends):
                ends.append(far)
        for end in ends:
            start = self._foot(end) if joint == self.root else np.zeros(3)
            if np.linalg.norm(end - start) > SAME:
                yield start, end

    def _foot(self, end: Array) -> Array:
        """Where a stick stands on the root link: on a platform as nearly below its end as possible."""
        if not self.robot.platform.n_p:
            return np.zeros(3)
        plate = self.plate
        half, middle = 0.7 * plate.half if plate.round else plate.half, plate.middle
        return np.array([*np.clip(end[:2], middle[:2] - half, middle[:2] + half), middle[2]])

    def _base(self) -> pin.GeometryObject:
        plate = self.plate
        fixed = not self.robot.platform.n_p and self.reach > 0.0
        x, y = (np.minimum(plate.half, FOOT * self.reach) if fixed else plate.half).tolist()
        shape = fcl.Cylinder(x, plate.thick) if plate.round else fcl.Box(2.0 * x, 2.0 * y, plate.thick)
        return _shape("base", self.root, pin.SE3(np.eye(3), plate.middle), shape)

    def _tyre(self, joint: int, wheel: Wheel) -> pin.GeometryObject:
        along = axis(self.model.joints[joint], pin.neutral(self.model))
        tyre = fcl.Cylinder(wheel.radius, 0.4 * wheel.radius)
        return _shape(f"wheel {wheel.joint}", joint, pin.SE3(_towards(along), np.zeros(3)), tyre, DARK)

    def _way(self, joint: int) -> tuple[Array, Array] | None:
        """The ends (3,) of a prismatic joint in its parent's frame; None if unknown."""
        model, sliding = self.model, self.model.joints[joint]
        if not kind(sliding).startswith("P") or sliding.nq != 1:
            return None
        along, _ = joint_screw(model, joint)
        ends = [float(limit[sliding.idx_q]) for limit in (model.lowerPositionLimit, model.upperPositionLimit)]
        if not all(abs(end) < LONGEST for end in ends) or ends[1] - ends[0] < SAME:
            return None
        placement = model.jointPlacements[joint]
        return placement.act(ends[0] * along), placement.act(ends[1] * along)


def _root(robot: Robot) -> int:
    return int(robot.display_model.getJointId("theta")) if robot.platform.n_p else 0


def _solids(robot: Robot, joints: Container[int]) -> list[pin.GeometryObject]:
    display = robot.display_model
    try:
        names, collisions = display.names, loaded_parts(robot).collision_model
    except RobotError:  # not from a file: the wheels' shapes are those of what carries them
        names, collisions = robot.model.names, robot.shapes.collision_model
    places = {i: display.getJointId(name) for i, name in enumerate(names) if display.existJointName(name)}
    drawn = [
        geometry for geometry in collisions.geometryObjects if places.get(geometry.parentJoint) in joints
    ]
    read_meshes(drawn, robot.name)
    solids = [pin.GeometryObject(geometry) for geometry in drawn]
    for geometry in solids:
        geometry.parentJoint = places[geometry.parentJoint]
        geometry.meshColor, geometry.overrideMaterial = np.array(GREY), True
    return solids


def _links(robot: Robot, joints: set[int]) -> tuple[str, ...]:
    """The link right below each joint, or the joint itself if there is none."""
    model = robot.display_model
    names: dict[int, str] = {}
    for frame in model.frames:
        if frame.type == pin.FrameType.BODY:
            names.setdefault(int(frame.parentJoint), frame.name)
    return tuple(names.get(joint, str(model.names[joint])) for joint in sorted(joints))


def _listed(names: tuple[str, ...], most: int = 8) -> str:
    more = len(names) - most
    return ", ".join(names[:most]) + (f" and {more} more" if more > 0 else "")


def _stick(name: str, joint: int, start: Array, end: Array, radius: float) -> pin.GeometryObject:
    """A capsule whose round ends are centred on the two points."""
    length = float(np.linalg.norm(end - start))
    at = pin.SE3(_towards((end - start) / length), 0.5 * (start + end))
    return _shape(name, joint, at, fcl.Capsule(radius, length))


def _towards(direction: Array) -> Array:
    """A rotation that takes z to a unit vector."""
    return np.asarray(pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), direction).matrix())


def _shape(
    name: str, joint: int, at: pin.SE3, shape: pin.hppfcl.CollisionGeometry, color: Color = GREY
) -> pin.GeometryObject:
    geometry = pin.GeometryObject(name, joint, at, shape)
    geometry.meshColor = np.array(color)
    return geometry
