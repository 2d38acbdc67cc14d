"""Advice about a robot's wheels: where they touch the ground, where their axle is, which were missed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from nmm.arrays import Array
from nmm.findings import Finding
from nmm.platforms.wheel_layout import HITCHES
from nmm.robots.loading.extents import farthest
from nmm.robots.loading.joint_kinds import axis
from nmm.robots.loading.measured_joints import ROUNDED, Measured
from nmm.robots.robot import Robot
from nmm.robots.wheel import Wheel

#: Lowest points that differ by no more than this, m, are on one ground: so much do casters give way.
LEVEL = 5e-3
#: In the name of a frame that is on the ground (REP-120).
FOOTPRINT = "footprint"
#: A radius and a height that differ by less are the same number, m.
SAME = 1e-9
#: How far the axle's midpoint may be from the reference point, m.
NEAR = 2e-3
#: How far two directions may differ, rad.
PARALLEL = 1e-3


@dataclass(frozen=True)
class Ground:
    """Where wheels touch the ground, m, by the wheels' joints.
    lowest : heights of their lowest points over the reference point; near : what counts as one height
    shapes : how far a wheel's shapes reach from its axis, where it has some"""

    lowest: dict[str, float]
    shapes: dict[str, float]
    near: float

    @classmethod
    def of(cls, robot: Robot) -> Ground | None:
        if not robot.wheels:
            return None
        measured = Measured(robot.model, (), robot.name)
        near = max(LEVEL, ROUNDED * max(wheel.radius for wheel in robot.wheels))
        ground = cls({}, {}, near)
        for wheel in robot.wheels:
            carrier = measured.placements[robot.model.getJointId(wheel.carrier)]
            height, radius = float(carrier.act(wheel.center)[2]), wheel.radius
            shape = _reach(robot, wheel)
            if shape > 0.0:
                ground.shapes[wheel.joint] = shape
                if abs(height - radius) < SAME:  # no one gave it
                    radius = shape
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

    def warnings(self, robot: Robot) -> Iterator[Finding]:
        if np.ptp([*self.lowest.values()]) > self.near:
            heights = {name: z + 0.0 for name, z in self.lowest.items()}  # no -0
            yield Finding("ground_uneven", {"heights": heights, "near": self.near})
            return
        for frame in robot.model.frames:
            on_root = robot.model.names[frame.parentJoint] == "theta"
            if frame.type == pin.FrameType.BODY and FOOTPRINT in frame.name and on_root:
                off = float(frame.placement.translation[2]) - self.z
                if abs(off) > self.near:
                    yield Finding("footprint_off_ground", {"frame": frame.name, "off": off})


def _reach(robot: Robot, wheel: Wheel) -> float:
    """How far a wheel's shapes reach from its axis, m: collision shapes, or those shown; 0 without any."""
    shown = robot.display_model
    joint = shown.getJointId(wheel.joint)
    links = {frame.name for frame in shown.frames if frame.parentJoint == joint}
    carried = [  # by what carries the wheel, which is no joint where things collide
        farthest(shape, wheel.center, wheel.axis)
        for shape in robot.shapes.collision_model.geometryObjects
        if robot.model.frames[shape.parentFrame].name in links
    ]
    along = axis(shown.joints[joint], pin.neutral(shown))
    return max(carried, default=0.0) or max(
        (
            farthest(shape, np.zeros(3), along)
            for shape in robot.shapes.visual_model.geometryObjects
            if shape.parentJoint == joint
        ),
        default=0.0,
    )


def wheel_advice(robot: Robot, root: str) -> list[Finding]:
    """Warnings about the wheels of a robot loaded without `axle` and `wheels`."""
    if not robot.platform.coordinates:
        return []
    notes = [note for note in robot.notes if note.code == "not_a_wheel"]
    return [*notes, *_hitches(robot), *_nameless(robot), *_about_axle(robot, root)]


def _hitches(robot: Robot) -> Iterator[Finding]:
    """Joints with wheels that are called hitches and are no hitch of the platform's."""
    between = [note.values.get("between", "") for note in robot.notes if note.code == "not_a_wheel"]
    for name in dict.fromkeys([*(wheel.swivel for wheel in robot.wheels), *between]):
        if any(word in name.lower() for word in HITCHES):
            yield Finding("hitch_unused", {"name": name})


def _nameless(robot: Robot) -> Iterator[Finding]:
    measured = Measured(robot.model, (), robot.name)
    for name, joint in measured.joints.items():
        on_root = int(robot.model.parents[joint]) == measured.root
        endless = not np.isfinite(robot.q_limits[robot.coordinate(name)]).any()
        named = measured.is_named_wheel(joint)  # of which the notes speak
        if on_root and endless and not named and measured.why_not_rolling(joint) is None:
            yield Finding("wheel_unnamed", {"name": name})


def _about_axle(robot: Robot, root: str) -> Iterator[Finding]:
    """Where the axle is of wheels that neither steer nor swivel nor have rollers."""
    fixed = _only_rolling(robot)
    if not fixed:
        return
    names = {"names": [wheel.joint for wheel in fixed]}
    along = _rolling(fixed)
    if along is None:
        yield Finding("wheels_not_parallel", names)
        return
    if abs(along[1]) > PARALLEL:
        yield Finding("axle_turned", names)
    ahead = np.array([along @ wheel.center[:2] for wheel in fixed])
    if np.ptp(ahead) > NEAR:
        yield Finding("wheels_on_several_axles", names)
        return
    centers = [wheel.center[:2] for wheel in fixed]
    middle = 0.5 * (np.min(centers, axis=0) + np.max(centers, axis=0))
    if np.linalg.norm(middle) > NEAR:
        yield Finding("axle_elsewhere", {"root": root, "at": middle.tolist(), **names})


def _rolling(wheels: list[Wheel]) -> Array | None:
    """The way (2,) that wheels roll; None where they are not parallel."""
    axis = wheels[0].axis[:2] / np.linalg.norm(wheels[0].axis[:2])
    if any(abs(axis[0] * wheel.axis[1] - axis[1] * wheel.axis[0]) > PARALLEL for wheel in wheels):
        return None
    return np.array([axis[1], -axis[0]])


#: Sideways speeds of a wheel below this, for an input of 1 m/s or 1 rad/s, are the file's rounding.
SLACK = 1e-3


def _only_rolling(robot: Robot) -> list[Wheel]:
    """The root link's fixed wheels without rollers; none where wheels slide by the platform's design."""
    platform = robot.platform
    by_design = platform.p > 2 or np.any(platform.sliding(np.eye(platform.p)))  # three inputs: rollers
    return [] if by_design else [wheel for wheel in robot.wheels if wheel.is_fixed]


def slipping_wheels(robot: Robot) -> dict[str, float]:
    """Wheels whose axle misses the reference point: their largest sideways speed for an input of 1, m/s."""
    platform, plain = robot.platform, _only_rolling(robot)
    if not plain or platform.n_p < 3:
        return {}
    own = platform.coordinate_limits[3:]
    found: dict[str, float] = {}
    for share in (0.5, 0.6):
        qp = np.zeros(platform.n_p)
        lower, upper = np.clip(own.T, -0.5, 0.5)
        qp[3:] = lower + share * (upper - lower)
        twists = platform.G(qp)[:3]  # at theta = 0 the body's own axes
        if not np.all(np.isfinite(twists)):
            continue
        for wheel in plain:
            x, y = wheel.center[:2]
            velocity = np.array([twists[0] - y * twists[2], twists[1] + x * twists[2]])
            sideways = float(np.abs(wheel.axis[:2] @ velocity).max(initial=0.0))
            if sideways > SLACK:
                found[wheel.joint] = max(sideways, found.get(wheel.joint, 0.0))
    return found


def slip_warnings(robot: Robot) -> list[Finding]:
    """The wheels that slide, if there are any."""
    slipping = slipping_wheels(robot)
    if not slipping:
        return []
    plain = _only_rolling(robot)
    along = _rolling(plain)
    several = along is None or bool(np.ptp([along @ wheel.center[:2] for wheel in plain]) > SLACK)
    roll = "apart" if along is None else "aside" if abs(along[1]) > PARALLEL else "ahead"
    values = {"platform": robot.platform.name, "speeds": slipping, "several_axles": several, "roll": roll}
    return [Finding("wheels_slide", values)]
