"""When a path of legs is where: as fast along each as the limits of velocity and acceleration allow, at rest
between."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nmm.base.arrays import Array, Integers
from nmm.control.limits.limits import LimitsOn
from nmm.model.robots.robot import Robot
from nmm.model.robots.wheel_rates import wheel_shares
from nmm.plugins.planning.path import Guide


@dataclass(frozen=True)
class TimedLegs:
    """Legs with the time that each takes: its share is 0 to 1, at rest at both ends.

    guide : along them
    legs (L, 3 + n); corners (L + 1, n); inputs (L, n_u) : what the inputs add up to on each leg
    speed, acceleration, braking (L,) : the largest of its share, 1/s and 1/s²; stops (L + 1,) : when each
    begins, s
    """

    guide: Guide
    legs: Array
    corners: Array
    inputs: Array
    speed: Array
    acceleration: Array
    braking: Array
    stops: Array

    @property
    def duration(self) -> float:
        return float(self.stops[-1])

    def at(self, t: Array) -> tuple[Array, Array]:
        """q (N, n) and u (N, n_u) at times t (N,), s."""
        if not len(self.legs):
            return np.tile(self.corners[-1], (len(t), 1)), np.zeros((len(t), self.inputs.shape[1]))
        leg, share, rate = self.shares(t)
        return self.guide.points(self.corners, self.legs, leg, share), self.inputs[leg] * rate[:, np.newaxis]

    def shares(self, t: Array) -> tuple[Integers, Array, Array]:
        """The leg at each time (N,), s, how much of it is gone, and its rate, 1/s."""
        leg = np.clip(np.searchsorted(self.stops, t, side="right") - 1, 0, max(len(self.legs) - 1, 0))
        after, length = t - self.stops[leg], self.stops[leg + 1] - self.stops[leg]
        V, A, B = self.speed[leg], self.acceleration[leg], self.braking[leg]
        ramp = V / A
        to_end = np.maximum(length - after, 0.0)
        rising, falling = after < ramp, to_end < V / B
        A, B = (np.where(np.isfinite(values), values, 0.0) for values in (A, B))
        share = V * (after - 0.5 * ramp)
        share = np.where(rising, 0.5 * A * after**2, np.where(falling, 1.0 - 0.5 * B * to_end**2, share))
        rate = np.where(rising, A * after, np.where(falling, B * to_end, V))
        return leg, np.clip(share, 0.0, 1.0), rate


def timed(guide: Guide, robot: Robot, start: Array, legs: Array, limits: LimitsOn, usual: Array) -> TimedLegs:
    """The legs from start (n,), each as fast as the limits allow; usual (3 + n,) : speeds of
    a leg's numbers where inputs have none."""
    corners = guide.corners(start, legs)
    inputs = inputs_of_legs(robot, corners[:-1], legs)
    falling, rising = -limits.changes[:, 0], limits.changes[:, 1]
    forwards = inputs >= 0.0
    reached = np.where(forwards, limits.inputs[:, 1], -limits.inputs[:, 0])
    with np.errstate(divide="ignore"):
        speed = np.min(reached / np.abs(inputs), axis=1, initial=np.inf)
        speed = np.minimum(speed, np.min(usual / np.abs(legs), axis=1, initial=np.inf))
        for q in (corners[:-1], corners[1:]) if len(limits.spin) else ():
            speed = np.minimum(speed, np.min(limits.spin / spins_of(robot, q, legs, limits), axis=1))
        acceleration, braking = (
            np.min(change / np.abs(inputs), axis=1, initial=np.inf)
            for change in (np.where(forwards, rising, falling), np.where(forwards, falling, rising))
        )
        # Too short to reach its speed: first faster, then slower.
        slow = 1.0 / acceleration + 1.0 / braking
        speed = np.minimum(speed, np.sqrt(2.0 / slow))
    ramps = 0.5 * np.where(slow > 0.0, speed, 0.0) * slow
    return TimedLegs(
        *(guide, legs, corners, inputs, speed, acceleration, braking),
        np.cumsum([0.0, *(1.0 / speed + ramps)]),
    )


def ways_of_legs(robot: Robot, q: Array, legs: Array) -> Array:
    """Legs (L, 3 + n) as ways of the coordinates, (L, n), at q (L, n): the platform's twist in the world."""
    ways = legs[:, 3:].copy()
    if robot.platform.n_p >= 3:
        c, s = np.cos(q[:, 2]), np.sin(q[:, 2])
        ways[:, 0], ways[:, 1] = c * legs[:, 0] - s * legs[:, 1], s * legs[:, 0] + c * legs[:, 1]
        ways[:, 2] = legs[:, 2]
    return ways


def spins_of(robot: Robot, q: Array, legs: Array, limits: LimitsOn) -> Array:
    """How far limited wheels turn on each leg, (L, w), rad: at q (L, n), where it begins or ends."""
    turned = np.einsum("kwi,ki->kw", wheel_shares(limits.wheels, q), ways_of_legs(robot, q, legs))
    return np.asarray(np.abs(turned))


def inputs_of_legs(robot: Robot, q: Array, legs: Array) -> Array:
    """What the inputs add up to on legs from q (L, n): by G⁺ those of the platform (S u = the legs' ways)."""
    n_p, p, ways = robot.platform.n_p, robot.platform.p, ways_of_legs(robot, q, legs)
    inputs = np.zeros((len(legs), robot.n_u))
    inputs[:, p:] = ways[:, robot.arm_coordinates]
    if len(legs) and p:
        G = np.array([robot.platform.G(corner[:n_p]) for corner in q])
        inputs[:, :p] = np.einsum("kji,ki->kj", np.linalg.pinv(G), ways[:, :n_p])
    return inputs
