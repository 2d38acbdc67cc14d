"""Angles and rates of rolling wheels and their swivels. These are upright joints that carry wheels and are no
coordinates: casters, and wheels steered along with others."""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple, TypeVar

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from nmm.base.arrays import Array, vector
from nmm.model.robots.loading.joint_kinds import axis
from nmm.model.robots.motion import Motion
from nmm.model.robots.robot import Robot
from nmm.model.robots.wheel import Wheel
from nmm.views.playback.placements import Carriers, at_point, rolling_joints


class Rolling:
    """The rolling of a robot's W wheels and of their swivels.

    A wheel of centre c, axis a and radius r rolls along d = a × z and grips along d(γ), d turned by its
    rollers' angle γ. It turns at v_c·d(γ) / (r cos γ), so that its contact point has no velocity along d(γ).
    Of a wheel that slides along d by design, c is where it would not (`Platform.rolls_at`).
    Angles (D,), rad, are of `joints` (`rolling_joints`); `steered` are the swivels whose angle is a function
    of q (see `settled`).
    """

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self.joints = rolling_joints(robot)
        wheels = robot.wheels
        self._carriers = Carriers(robot, [wheel.carrier for wheel in wheels])
        carriers = [self._carriers.names.index(wheel.carrier) for wheel in wheels]
        self._carrier = np.array(carriers, dtype=int)
        planar = [
            [self._carriers.planar(k, part) for part in (wheel.rolls_at, wheel.axis)]
            for k, wheel in zip(carriers, wheels, strict=True)
        ]
        centers, axes = np.array(planar).reshape(-1, 2, 2).transpose(1, 0, 2)
        # d = a × z, and d(γ) / (r cos γ), divided only once.
        self._rolling = np.column_stack([axes[:, 1], -axes[:, 0]])
        roller = np.array([wheel.roller for wheel in wheels])
        cosine, sine = np.cos(roller)[:, np.newaxis], np.sin(roller)[:, np.newaxis]
        across = np.column_stack([-self._rolling[:, 1], self._rolling[:, 0]])
        self._radii = np.array([wheel.radius for wheel in wheels])
        self._gripping = (cosine * self._rolling + sine * across) / (self._radii[:, np.newaxis] * cosine)
        self._levers = np.column_stack([-centers[:, 1], centers[:, 0]])
        names = self.joints[len(wheels) :]
        self._swivels = [Swivel.of(robot, self._carriers, name, wheels) for name in names]
        swivels = zip(names, self._swivels, strict=True)
        self.steered = tuple(
            name for name, swivel in swivels if swivel.drive is not None and not swivel.trail
        )

    def rates(self, q: ArrayLike, u: ArrayLike, angles: ArrayLike | None = None) -> Array:
        """Rates (D,) rad/s at q (n,) for constant inputs u (n_u,) and angles (D,), those of `settled` when
        not given; `InputError` for wrong lengths and numbers that are not finite."""
        q, u = self.robot.q(q), vector(u, self.robot.n_u, "u")
        at = self.settled(q, u) if angles is None else vector(angles, len(self.joints), "angles")
        twists = self._carriers.twists(q, self.robot.S(q) @ u)
        rates = np.concatenate([self._turned(twists), np.zeros(len(self._swivels))])
        for k, swivel in enumerate(self._swivels, len(self._radii)):
            twist, angle = twists[swivel.carrier], swivel.sign * float(at[k])
            rates[k] = swivel.rate(q, u, twist, float(at[k]))
            turn = float(twist[2]) + swivel.sign * float(rates[k])
            for wheel in swivel.wheels:
                rates[wheel.index] = wheel.spin(wheel.along(at_point(twist, swivel.pivot), angle), turn)
        return rates

    def settled(self, q: ArrayLike, u: ArrayLike | None = None) -> Array:
        """Angles (D,) at which a robot starts at q (n,): steered wheels point where they move, or are at 0
        where that depends on inputs u (n_u,) that are not given or 0; all others are at 0."""
        q = self.robot.q(q)
        u = np.zeros(self.robot.n_u) if u is None else vector(u, self.robot.n_u, "u")
        return np.array([0.0 for _ in self._radii] + [swivel.settled(q, u) for swivel in self._swivels])

    def angles(self, q: Array, u: Array | None = None, start: Array | None = None) -> Array:
        """Angles (N, D) at q (N, n), with bodies moving along arcs in between; u (N, n_u) is estimated from q
        when not given, and by default `start` (D,) is 0 for wheels and settled for swivels."""
        twists, count = self._carriers.steps(q), len(self._radii)
        angles = np.zeros((len(q), len(self.joints)))
        if start is not None:
            angles[:] = start
        turned = self._turned(twists)
        for k, swivel in enumerate(self._swivels, count):
            own = twists[:, swivel.carrier]
            path = swivel.path(q, u, own, None if start is None else float(start[k]))
            angles[:, k] = path.angles
            turns = own[:, 2] + swivel.sign * np.diff(path.angles)
            for wheel in swivel.wheels:
                turned[:, wheel.index] = wheel.spin(wheel.same * path.ways, turns)
        angles[1:, :count] += np.cumsum(turned, axis=0)
        return angles

    def _turned(self, twists: Array) -> Array:
        """Spins (…, W) of wheels fixed on their carriers, for the carriers' twists (…, C, 3)."""
        at = twists[..., self._carrier, :]
        velocity = at[..., :2] + at[..., 2:] * self._levers
        return np.asarray(np.sum(velocity * self._gripping, axis=-1))


class RolledRobot:
    """A robot's pose and how its wheels have rolled there; `now`, q (n,) and the angles (D,) rad, is replaced
    as a whole, so that any thread may read it."""

    def __init__(self, robot: Robot, q: Array) -> None:
        self.robot, self.rolling = robot, Rolling(robot)
        self.stand(q)

    def stand(self, q: Array) -> None:
        self.now: tuple[Array, Array] = q, self.rolling.settled(q)

    def roll(self, path: Array) -> None:
        """Roll through configurations (K, n) to the last."""
        q, wheels = self.now
        self.now = path[-1], self.rolling.angles(np.vstack([q, path]), start=wheels)[-1]


def wheel_rates(robot: Robot, q: ArrayLike, u: ArrayLike, angles: ArrayLike | None = None) -> Array:
    """Rates of the wheels, then of their swivels, (D,) rad/s, at q for constant inputs u and angles (D,).

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> nmm.playback.wheel_rates(robot, robot.rest, [0.5, 0.0, 0.0, 0.0]).round(3)
    array([5., 5.])
    """
    return Rolling(robot).rates(q, u, angles)


def wheel_angles(motion: Motion) -> Array:
    """Angles of the wheels, then of their swivels, (N, D) rad; wheels are at zero at the first sample.

    Examples
    --------
    >>> run = nmm.Scenario.load("unicycle_2r_position").run()
    >>> angles = nmm.playback.wheel_angles(nmm.playback.Motion(run.robot, run.t, run.q, run.u))
    >>> angles.shape
    (5001, 2)
    """
    return Rolling(motion.robot).angles(motion.q, motion.u)


# A wheel whose centre is nearer to its swivel's axis than this share of its radius does not trail.
_NO_TRAIL = 1e-4
# Speed (m/s) below which a point has no direction.
_STILL = 1e-9
Number = TypeVar("Number", float, Array)
# Largest turn (rad) and path (in trails) of a part of a step: the swivel then turns by less than half a turn.
_TURN, _WAY = 0.5, 3.0


@dataclass(frozen=True, eq=False)
class SwivelWheel:
    """Wheel number `index` of a robot, on a swivel; radius in m. With the swivel at zero it rolls along
    `ahead`, (2,) of length 1 in the carrier's level axes; from the pivot its centre is `trail` along that and
    `side` to its left, m. `same` is -1 where the swivel's first wheel rolls the other way, else 1."""

    index: int
    radius: float
    ahead: Array
    trail: float
    side: float
    same: float = 1.0

    def along(self, velocity: Array, angle: float) -> float:
        """Component of a velocity (2,) along its rolling direction, with the swivel at an angle."""
        cosine, sine = np.cos(angle), np.sin(angle)
        x, y = self.ahead
        return float(velocity @ [cosine * x - sine * y, sine * x + cosine * y])

    def across(self, velocity: Array, angle: float) -> float:
        """Component to the left of that direction."""
        return self.along(np.array([velocity[1], -velocity[0]]), angle)

    def spin(self, way: Number, turn: Number) -> Number:
        """The spin for the pivot's path along its direction (m) and the fork's turn over the ground (rad)."""
        return (way - turn * self.side) / self.radius


class SwivelPath(NamedTuple):
    """Angles (N,) of the joint, rad, and the pivot's paths (N - 1,) along the first wheel's direction, m."""

    angles: Array
    ways: Array


@dataclass(frozen=True, eq=False)
class Swivel:
    """A swivel on body number `carrier`, at `pivot` (2,) m in its level axes, and its wheels.

    - the wheel trails: a caster, turned by rolling without sideways slip;
    - one input alone moves the pivot (a car's v): the wheel points along that motion, so that its angle is a
      function of q (Ackermann steering), within a quarter turn from straight;
    - several do: the wheel points along the pivot's motion, and keeps its angle while that rests.

    `sign` is -1 where the joint's axis points down, else 1; `drive` is the one input that moves the pivot.
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
        own = [(index, wheel) for index, wheel in enumerate(wheels) if wheel.swivel == name]
        carrier = carriers.names.index(own[0][1].carrier)
        pivot = carriers.planar(carrier, own[0][1].pivot)
        swivel_wheels: list[SwivelWheel] = []
        for index, wheel in own:
            left = carriers.planar(carrier, wheel.axis)
            ahead = np.array([left[1], -left[0]])
            offset = carriers.planar(carrier, wheel.center) - pivot
            same = float(np.sign(ahead @ swivel_wheels[0].ahead)) if swivel_wheels else 1.0
            trail, side = float(offset @ ahead), float(offset @ left)
            swivel_wheels.append(SwivelWheel(index, wheel.radius, ahead, trail, side, same))
        inputs = carriers.moving_inputs(carrier, pivot)
        drive = inputs[0] if len(inputs) == 1 else None
        return cls(robot, carriers, carrier, pivot, tuple(swivel_wheels), _sign(robot, name), drive)

    @property
    def trail(self) -> float:
        """The first wheel's trail, m; 0 for one that does not trail."""
        trail = self.wheels[0].trail
        return trail if abs(trail) > _NO_TRAIL * self.wheels[0].radius else 0.0

    def rate(self, q: Array, u: Array, twist: Array, angle: float) -> float:
        """Rate of the joint at an angle, for the carrier's twist (3,) and constant inputs u."""
        if self.trail:
            across = self.wheels[0].across(at_point(twist, self.pivot), self.sign * angle)
            return self.sign * (-across / self.trail - float(twist[2]))
        robot, S = self.robot, self.robot.S(q)
        driving = u if self.drive is None else np.eye(robot.n_u)[self.drive]
        x, y = velocity = self._velocity(q, S @ driving)
        if np.linalg.norm(velocity) <= _STILL:
            return 0.0
        # How the velocity due to `driving` changes as the robot moves with u.
        platform, q_dot, change = robot.platform, S @ u, np.zeros(robot.n)
        n_p, p = platform.n_p, platform.p
        change[:n_p] = platform.G_dot(q[:n_p], q_dot[:n_p]) @ driving[:p]
        who = robot.following
        change[who.columns] = who.multipliers * change[who.leaders]
        rates = self.carriers.twist_rates(q, q_dot, S @ driving, change)[self.carrier]
        x_dot, y_dot = at_point(rates, self.pivot)
        return self.sign * float(x * y_dot - y * x_dot) / float(velocity @ velocity)

    def settled(self, q: Array, u: Array) -> float:
        """The joint's initial angle at q (n,) with inputs u (n_u,): 0 for a caster."""
        if self.trail:
            return 0.0
        return float(self.path(q[np.newaxis], u[np.newaxis], np.zeros((0, 3)), None).angles[0])

    def path(self, q: Array, u: Array | None, twists: Array, start: float | None) -> SwivelPath:
        """Its motion over q (N, n) with inputs u (N, n_u), if known, and the carrier's twists (N - 1, 3) in
        between, from a joint angle `start`, or from where it settles."""
        pivots, first = at_point(twists, self.pivot), self.wheels[0]
        if self.trail:
            return self._caster_path(twists, pivots, start or 0.0)
        if self.drive is not None:
            driven = [self._velocity(at, np.asarray(self.robot.S(at)[:, self.drive])) for at in q]
            angles = np.remainder(self._directions(np.array(driven)) + 0.5 * np.pi, np.pi) - 0.5 * np.pi
            angles = np.where(np.isfinite(angles), angles, 0.0)
        else:
            if u is not None:
                moved = np.array([self._velocity(a, self.robot.S(a) @ b) for a, b in zip(q, u, strict=True)])
            else:
                # The motion up to a sample is the best guess of its direction there.
                moved = np.vstack([pivots[:1] if start is None else np.zeros((1, 2)), pivots])[: len(q)]
            angles = _followed(self._directions(moved), None if start is None else self.sign * start)
        middle = 0.5 * (angles[1:] + angles[:-1])
        ways = [first.along(velocity, float(at)) for velocity, at in zip(pivots, middle, strict=True)]
        return SwivelPath(self.sign * angles, np.array(ways))

    def _caster_path(self, twists: Array, pivots: Array, start: float) -> SwivelPath:
        angles, ways = np.full(len(twists) + 1, self.sign * start), np.zeros(len(twists))
        first = self.wheels[0]
        for k, velocity in enumerate(pivots):
            motion = first.along(velocity, 0.0), first.across(velocity, 0.0), float(twists[k, 2])
            angles[k + 1], ways[k] = caster_step(float(angles[k]), motion, self.trail)
        return SwivelPath(self.sign * angles, ways)

    def _velocity(self, q: Array, q_dot: Array) -> Array:
        return at_point(self.carriers.twists(q, q_dot)[self.carrier], self.pivot)

    def _directions(self, velocities: Array) -> Array:
        """Angles (N,) at which the first wheel rolls along the pivot's velocities (N, 2); NaN at rest."""
        x, y = self.wheels[0].ahead
        angles = np.arctan2(velocities @ [-y, x], velocities @ [x, y])
        return np.where(np.linalg.norm(velocities, axis=-1) > _STILL, angles, np.nan)


def _followed(directions: Array, start: float | None) -> Array:
    """Angles (N,) of a wheel that points along directions (N,), forwards or backwards, whichever is nearer to
    its last angle, and keeps still where there is none; by default it starts at the first direction."""
    if start is None:
        start = float(next(iter(directions[np.isfinite(directions)]), 0.0))
        start -= np.pi * round(start / np.pi)
    angles = np.empty(len(directions))
    for k, direction in enumerate(directions):
        if np.isfinite(direction):
            start = direction - np.pi * round((direction - start) / np.pi)
        angles[k] = start
    return angles


def _sign(robot: Robot, name: str) -> float:
    model = robot.display_model
    data, neutral = model.createData(), pin.neutral(model)
    pin.forwardKinematics(model, data, neutral)
    joint = model.getJointId(name)
    up = data.oMi[joint].rotation @ axis(model.joints[joint], neutral)
    return 1.0 if up @ model.jointPlacements[1].rotation[:, 2] > 0.0 else -1.0


def caster_step(angle: float, twist: tuple[float, float, float], trail: float) -> tuple[float, float]:
    """The swivel's angle (rad) after one second at a constant twist, and how far the wheel has rolled (m).

    With the pivot's velocity (v, w) along and across the rolling direction at angle 0, the body's turning
    rate Ω and the wheel's centre at `trail` from the pivot along that direction (negative: behind it),
    rolling without sideways slip means

        angle_dot = (v sin angle - w cos angle) / trail - Ω.

    For s = exp(j angle) this is a Riccati equation, s_dot = c2 s² + c1 s + c0 with constant coefficients: s
    is the quotient of two solutions of a linear one, and the path a logarithm of the denominator.
    """
    v, w, turn = twist
    parts = math.ceil(max(abs(turn) / _TURN, math.hypot(v, w) / (abs(trail) * _WAY), 1.0))
    along, across, turn = v / trail / parts, w / trail / parts, turn / parts
    c2, c1, c0 = complex(along, -across) / 2.0, complex(0.0, -turn), -complex(along, across) / 2.0
    square = (along**2 + across**2 - turn**2) / 4.0
    kappa = math.sqrt(abs(square))
    if square > 0.0:
        grown, ratio = math.cosh(kappa), math.tanh(kappa) / kappa if kappa > 1e-8 else 1.0
    else:
        grown, ratio = math.cos(kappa), math.tan(kappa) / kappa if kappa > 1e-8 else 1.0
    way = 0.0
    for _ in range(parts):
        s = cmath.exp(1j * angle)
        numerator = s + ratio * (0.5 * c1 * s + c0)
        denominator = 1.0 - ratio * (c2 * s + 0.5 * c1)
        change = cmath.phase(numerator / denominator / s)
        angle += change
        way -= 2.0 * trail * math.log(grown * abs(denominator))
    return angle, way
