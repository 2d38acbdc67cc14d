"""Advice about a robot's wheels: where they touch the ground, where their axle is, which were missed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from nmm.base.arrays import Array
from nmm.base.findings import Finding
from nmm.model.platforms.wheel_layout import HITCHES, PARALLEL
from nmm.model.robots.loading.chain import yaw_of
from nmm.model.robots.loading.extents import has_width
from nmm.model.robots.loading.measured_joints import ROUNDED, Measured
from nmm.model.robots.loading.provenance import reference_in_root
from nmm.model.robots.robot import Robot
from nmm.model.robots.wheel import Wheel
from nmm.model.robots.wheel_slip import plain_wheels

#: Lowest points that differ by no more than this, m, are on one ground: so much do casters give way.
LEVEL = 5e-3
#: In the name of a frame that is on the ground (REP-120).
FOOTPRINT = "footprint"


@dataclass(frozen=True)
class GroundContacts:
    """Where wheels touch the ground, m, by the wheels' joints.
    reference : the reference point's pose in the root link, m
    lowest : heights of their lowest points over it; near : what counts as one height
    is_seen : whether a wheel has a shape, without which the ground is where a radius puts it"""

    reference: pin.SE3
    lowest: dict[str, float]
    near: float
    is_seen: bool

    @classmethod
    def of(cls, robot: Robot) -> GroundContacts | None:
        if not robot.wheels:
            return None
        measured = Measured(robot.model, (), robot.name)
        near = max(LEVEL, ROUNDED * max(wheel.radius for wheel in robot.wheels))
        lowest: dict[str, float] = {}
        for wheel in robot.wheels:
            carrier = measured.placements[robot.model.getJointId(wheel.carrier)]
            lowest[wheel.joint] = float(carrier.act(wheel.center)[2]) - wheel.radius
        is_seen = any(_has_shape(robot, wheel) for wheel in robot.wheels)
        return cls(reference_in_root(robot), lowest, near, is_seen)

    @property
    def z(self) -> float:
        """The height of most wheels' lowest points, m."""
        return round(float(np.median([*self.lowest.values()])), 6) + 0.0  # no -0

    def fact(self, root: str) -> str:
        """In words; `root` is the root link's name."""
        if not self.is_seen:
            return "taken to be at z = 0: no wheel has a shape"
        if abs(self.z) <= self.near:
            return "the wheels touch it at z = 0"
        x, y, z = self.reference.act(np.array([0.0, 0.0, self.z])) + 0.0
        z = 0.0 if abs(z) <= self.near else z  # as without a reference point of its own
        touching = f"the wheels touch it at z = {z:.4g} m in link {root!r}"
        yaw = yaw_of(self.reference)
        at = f"{x:.6g},{y:.6g},{z:.4g}{f',{yaw:.6g}' if abs(yaw) > PARALLEL else ''}"
        spaced = at.replace(",", ", ")
        return f"{touching}; heights count from the ground with --axle {at} (axle=({spaced}))"

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


def _has_shape(robot: Robot, wheel: Wheel) -> bool:
    """Whether a wheel has a shape with a radius, that is drawn or that collides."""
    shown, shapes = robot.display_model, robot.shapes
    joint = shown.getJointId(wheel.joint)
    links = {frame.name for frame in shown.frames if frame.parentJoint == joint}
    return any(  # by link: where things collide, the wheel is part of what carries it
        model.frames[shape.parentFrame].name in links and has_width(shape)
        for model, drawn in ((shown, shapes.visual_model), (robot.model, shapes.collision_model))
        for shape in drawn.geometryObjects
    )


#: Notes of loading that a user should know before a first run.
_ADVICE = (
    *(
        "platform_recognized",
        "no_wheels",
        "wheels_fixed",
        "wheels_by_shape",
        "not_a_wheel",
        "taken_for_casters",
    ),
    *("undercarriage_held", "steering_held", "radius_unknown", "tyre_unclear", "wheels_slide"),
)


def wheel_advice(robot: Robot) -> list[Finding]:
    """Warnings about the wheels of a robot."""
    if not robot.platform.coordinates:
        return []
    notes = [note for note in robot.notes if note.code in _ADVICE]
    return [*notes, *_hitches(robot), *_nameless(robot)]


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


def _rolling(wheels: list[Wheel]) -> Array | None:
    """The way (2,) that wheels roll; None where they are not parallel."""
    axis = wheels[0].axis[:2] / np.linalg.norm(wheels[0].axis[:2])
    if any(abs(axis[0] * wheel.axis[1] - axis[1] * wheel.axis[0]) > PARALLEL for wheel in wheels):
        return None
    return np.array([axis[1], -axis[0]])


#: Sideways speeds of a wheel below this, for an input of 1 m/s or 1 rad/s, are the file's rounding.
SLACK = 5e-3


def slipping_wheels(robot: Robot) -> dict[str, float]:
    """Wheels whose axle misses the reference point: their largest sideways speed for an input of 1, m/s."""
    platform = robot.platform
    plain = [wheel for wheel in plain_wheels(robot) if wheel.is_fixed]
    if not plain or platform.n_p < 3:
        return {}
    own = platform.coordinate_limits[3:]
    speeds: dict[str, float] = {}
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
                speeds[wheel.joint] = max(sideways, speeds.get(wheel.joint, 0.0))
    return speeds


def slip_warnings(robot: Robot) -> list[Finding]:
    """The wheels that slide, if there are any."""
    slipping = slipping_wheels(robot)
    if not slipping:
        return []
    plain = [wheel for wheel in plain_wheels(robot) if wheel.is_fixed]
    along = _rolling(plain)
    several = along is None or bool(np.ptp([along @ wheel.center[:2] for wheel in plain]) > SLACK)
    roll = "apart" if along is None else "aside" if abs(along[1]) > PARALLEL else "ahead"
    values = {"platform": robot.platform.name, "speeds": slipping, "several_axles": several, "roll": roll}
    return [Finding("wheels_slide", values)]
