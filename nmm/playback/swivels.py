"""Upright joints that are no coordinates and carry wheels: casters, and wheels steered along with others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple, TypeVar

import numpy as np
import pinocchio as pin

from nmm.arrays import Array
from nmm.playback.carriers import Carriers, at_point
from nmm.playback.caster import caster_step
from nmm.robots.loading.joint_kinds import axis
from nmm.robots.robot import Robot
from nmm.robots.wheel import Wheel

# A wheel whose centre is nearer to its swivel's axis than this part of its radius does not trail.
_NO_TRAIL = 1e-4
# Speed (m/s) below which a point stands still and has no direction.
_STILL = 1e-9

Number = TypeVar("Number", float, Array)


@dataclass(frozen=True, eq=False)
class SwivelWheel:
    """A wheel on a swivel.

    Attributes
    ----------
    index : its place among the robot's wheels
    radius : m
    ahead : (2,) unit, in which it rolls with the swivel at zero, along the carrier's level axes
    trail, side : its centre from the pivot, along `ahead` and to the left of it, m
    same : 1 or -1: whether it rolls the same way as the swivel's first wheel
    """

    index: int
    radius: float
    ahead: Array
    trail: float
    side: float
    same: float = 1.0

    def along(self, velocity: Array, angle: float) -> float:
        """Part of a velocity (2,) along the direction in which it rolls, with the swivel at an angle."""
        cosine, sine = np.cos(angle), np.sin(angle)
        x, y = self.ahead
        return float(velocity @ [cosine * x - sine * y, sine * x + cosine * y])

    def across(self, velocity: Array, angle: float) -> float:
        """Part of it to the left of that direction."""
        return self.along(np.array([velocity[1], -velocity[0]]), angle)

    def spin(self, way: Number, turn: Number) -> Number:
        """Spin: from the pivot's way along its direction (m), and the fork's turn over the ground (rad)."""
        return (way - turn * self.side) / self.radius


class SwivelPath(NamedTuple):
    """Angles (N,) of the joint, rad, and ways (N - 1,) of the pivot along the first wheel's direction, m."""

    angles: Array
    ways: Array


@dataclass(frozen=True, eq=False)
class Swivel:
    """A swivel and its wheels. Three kinds:

    - the wheel trails: a caster, turned by rolling without sideways slip;
    - one input alone moves the pivot (a car's v): the wheel looks the way in which that moves it, so that its
      angle is a function of q (Ackermann steering), within a quarter turn from straight;
    - several do: the wheel looks the way in which the pivot moves, and stays as it is where that rests.

    Attributes
    ----------
    carrier : index of the body that it hangs on
    pivot : (2,) on that body, along its level axes, m
    wheels : at least one
    sign : 1, or -1 where the joint's axis points down
    drive : the one input that moves the pivot, or None
    """

    robot: Robot = field(repr=False)
    carriers: Carriers = field(repr=False)
    carrier: int
    pivot: Array
    wheels: tuple[SwivelWheel, ...]
    sign: float
    drive: int | None

    @classmethod
    def of(cls, robot: Robot, carriers: Carriers, name: str, wheels: Sequence[Wheel]) -> Swivel:
        """The swivel of that name, with its wheels out of the robot's."""
        own = [(index, wheel) for index, wheel in enumerate(wheels) if wheel.swivel == name]
        carrier = carriers.names.index(own[0][1].carrier)
        pivot = carriers.planar(carrier, own[0][1].pivot)
        found: list[SwivelWheel] = []
        for index, wheel in own:
            left = carriers.planar(carrier, wheel.axis)
            ahead = np.array([left[1], -left[0]])
            offset = carriers.planar(carrier, wheel.center) - pivot
            same = float(np.sign(ahead @ found[0].ahead)) if found else 1.0
            trail, side = float(offset @ ahead), float(offset @ left)
            found.append(SwivelWheel(index, wheel.radius, ahead, trail, side, same))
        inputs = carriers.moving_inputs(carrier, pivot)
        drive = inputs[0] if len(inputs) == 1 else None
        return cls(robot, carriers, carrier, pivot, tuple(found), _sign(robot, name), drive)

    @property
    def trail(self) -> float:
        """The first wheel's trail, m; 0 for one that does not trail."""
        trail = self.wheels[0].trail
        return trail if abs(trail) > _NO_TRAIL * self.wheels[0].radius else 0.0

    def rate(self, q: Array, u: Array, twist: Array, angle: float) -> float:
        """Rate of the joint at an angle, for the carrier's twist (3,) and inputs u that do not change."""
        if self.trail:
            across = self.wheels[0].across(at_point(twist, self.pivot), self.sign * angle)
            return self.sign * (-across / self.trail - float(twist[2]))
        robot, S = self.robot, self.robot.S(q)
        driving = u if self.drive is None else np.eye(robot.n_u)[self.drive]
        x, y = velocity = self._velocity(q, S @ driving)
        if np.linalg.norm(velocity) <= _STILL:
            return 0.0
        # How the velocity that belongs to `driving` changes as the robot moves with u.
        platform, q_dot, change = robot.platform, S @ u, np.zeros(robot.n)
        n_p, p = platform.n_p, platform.p
        change[:n_p] = platform.G_dot(q[:n_p], q_dot[:n_p]) @ driving[:p]
        who = robot.following
        change[who.columns] = who.multipliers * change[who.leaders]
        rates = self.carriers.twist_rates(q, q_dot, S @ driving, change)[self.carrier]
        x_dot, y_dot = at_point(rates, self.pivot)
        return self.sign * float(x * y_dot - y * x_dot) / float(velocity @ velocity)

    def settled(self, q: Array, u: Array) -> float:
        """Angle of the joint at which it starts at q (n,) with inputs u (n_u,): 0 for a caster."""
        if self.trail:
            return 0.0
        return float(self.path(q[np.newaxis], u[np.newaxis], np.zeros((0, 3)), None).angles[0])

    def path(self, q: Array, u: Array | None, twists: Array, start: float | None) -> SwivelPath:
        """Its motion over q (N, n), with the carrier's twists (N - 1, 3) in between.

        Parameters
        ----------
        u : (N, n_u), or None when they are not known
        start : angle of the joint at the first sample; where it settles when not given
        """
        pivots, first = at_point(twists, self.pivot), self.wheels[0]
        if self.trail:
            return self._caster_path(twists, pivots, start or 0.0)
        if self.drive is not None:
            directions = self._directions(np.array([self._velocity(at, self._driven(at)) for at in q]))
            angles = np.remainder(directions + 0.5 * np.pi, np.pi) - 0.5 * np.pi
            angles = np.where(np.isfinite(angles), angles, 0.0)
        else:
            if u is not None:
                moved = np.array([self._velocity(a, self.robot.S(a) @ b) for a, b in zip(q, u, strict=True)])
            else:
                # The way that it went until a sample is the best guess of where it looks there.
                moved = np.vstack([pivots[:1] if start is None else np.zeros((1, 2)), pivots])[: len(q)]
            angles = _followed(self._directions(moved), None if start is None else self.sign * start)
        middle = 0.5 * (angles[1:] + angles[:-1])
        ways = [first.along(velocity, float(at)) for velocity, at in zip(pivots, middle, strict=True)]
        return SwivelPath(self.sign * angles, np.array(ways))

    def _caster_path(self, twists: Array, pivots: Array, start: float) -> SwivelPath:
        angles, ways = np.full(len(twists) + 1, self.sign * start), np.zeros(len(twists))
        for k, velocity in enumerate(pivots):
            first = self.wheels[0]
            motion = first.along(velocity, 0.0), first.across(velocity, 0.0), float(twists[k, 2])
            angles[k + 1], ways[k] = caster_step(float(angles[k]), motion, self.trail)
        return SwivelPath(self.sign * angles, ways)

    def _driven(self, q: Array) -> Array:
        return np.asarray(self.robot.S(q)[:, self.drive])

    def _velocity(self, q: Array, q_dot: Array) -> Array:
        """Velocity (2,) of the pivot."""
        return at_point(self.carriers.twists(q, q_dot)[self.carrier], self.pivot)

    def _directions(self, velocities: Array) -> Array:
        """Angles (N,) at which the first wheel rolls along velocities (N, 2) of the pivot; NaN at rest."""
        x, y = self.wheels[0].ahead
        angles = np.arctan2(velocities @ [-y, x], velocities @ [x, y])
        return np.where(np.linalg.norm(velocities, axis=-1) > _STILL, angles, np.nan)


def _followed(directions: Array, start: float | None) -> Array:
    """Angles (N,) of a wheel that looks along directions (N,) forwards or backwards, whichever is nearer to
    where it looked, and keeps still where there is none. It starts where it will look, when not given."""
    moving = np.flatnonzero(np.isfinite(directions))
    if start is None:
        start = float(directions[moving[0]]) if moving.size else 0.0
        start -= np.pi * round(start / np.pi)
    angles = np.full(len(directions), start)
    for k in range(len(angles)):
        if np.isfinite(directions[k]):
            start = directions[k] - np.pi * round((directions[k] - start) / np.pi)
        angles[k] = start
    return angles


def _sign(robot: Robot, name: str) -> float:
    model = robot.display_model
    data, neutral = model.createData(), pin.neutral(model)
    pin.forwardKinematics(model, data, neutral)
    joint = model.getJointId(name)
    up = data.oMi[joint].rotation @ axis(model.joints[joint], neutral)
    return 1.0 if up @ model.jointPlacements[1].rotation[:, 2] > 0.0 else -1.0
