"""Plans whose motors keep their torque limits: what needs more of them is driven slower."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from nmm.base.arrays import Array
from nmm.base.errors import InputError, RunError
from nmm.model.dynamics.dynamics import Dynamics
from nmm.model.robots.robot import Robot
from nmm.plugins.planning.samples import SampledMotion
from nmm.plugins.planning.timing import TimedLegs

#: Places at which torques are looked at, of a leg and of a sample; between them they may rise by the rest of
#: their limits.
PLACES, KEPT = 24, 0.98


class Efforts:
    """The torque limits of a robot's motors, and what its motions need of them.

    Torques are those that hold the robot still, and what its motion adds. In a motion that takes k times as
    long the second are k² times smaller; the first remain.
    """

    def __init__(self, dynamics: Dynamics) -> None:
        self._dynamics = dynamics
        self._most = KEPT * dynamics.actuators.efforts

    def legs(self, motion: TimedLegs) -> TimedLegs:
        """The legs, each no faster than its motors allow."""
        if not np.isfinite([motion.acceleration, motion.braking]).all():
            raise InputError(where="plan: effort", expected="limits of acceleration for all inputs")
        shares = np.linspace(0.0, 1.0, PLACES)
        factors = np.ones(len(motion.legs))
        for k, (corner, leg, way) in enumerate(zip(motion.corners, motion.legs, motion.inputs, strict=False)):
            q = np.array([motion.guide.at(corner, leg, share) for share in shares])
            u, none = np.tile(way, (PLACES, 1)), np.zeros((PLACES, len(way)))
            held = self._torques(q, none, none)
            speeding = self._torques(q, none, u) - held
            up, down = speeding * motion.acceleration[k], -speeding * motion.braking[k]
            moving = (self._torques(q, u, none) - held) * motion.speed[k] ** 2
            factors[k] = self._factor(
                held,
                np.maximum(up, down) + np.maximum(moving, 0.0),
                np.minimum(up, down) + np.minimum(moving, 0.0),
            )
        times = np.diff(motion.stops) / np.sqrt(factors)
        return replace(
            motion,
            speed=motion.speed * np.sqrt(factors),
            acceleration=motion.acceleration * factors,
            braking=motion.braking * factors,
            stops=np.cumsum([0.0, *times]),
        )

    def samples(self, motion: SampledMotion) -> SampledMotion:
        """The same way, slower as a whole where its motors ask for it."""
        samples = motion.samples
        shares = (np.arange(PLACES) + 0.5) / PLACES
        steps = np.diff(samples.begin)
        t = (samples.begin[:-1, np.newaxis] + steps[:, np.newaxis] * shares).ravel()
        q, u = motion.at(t)
        held = self._torques(q, 0.0 * u, 0.0 * u)
        moving = self._torques(q, u, np.repeat(samples.a, PLACES, axis=0)) - held
        factor = self._factor(held, moving, moving)
        pace = np.sqrt(factor)
        slower = samples._replace(begin=samples.begin / pace, u=samples.u * pace, a=samples.a * factor)
        rests = np.searchsorted(samples.begin, motion.stops)[1:-1].tolist()
        return SampledMotion(slower, rests)

    def _torques(self, q: Array, u: Array, u_dot: Array) -> Array:
        f, _ = self._dynamics.forces(q, u, u_dot)
        return self._dynamics.actuators.torques(q, f)

    def _factor(self, held: Array, high: Array, low: Array) -> float:
        """By how much accelerations shrink, at most 1, so that held + what motion adds (N, A), between low
        and high, is within the limits; `RunError` where standing still needs more."""
        weights = np.abs(held).max(axis=0)
        if np.any(weights >= self._most):
            j = int((weights / self._most).argmax())
            actuators = self._dynamics.actuators
            name, unit, most = actuators.names[j], actuators.units[j], actuators.efforts[j]
            what = f"{name} cannot hold the robot on the way: it takes {weights[j]:.3g} {unit} of {most:.3g}"
            raise RunError(what, where="plan")
        with np.errstate(divide="ignore", invalid="ignore"):
            up, down = (self._most - held) / high, (self._most + held) / -low
        up, down = np.where(high > 0.0, up, np.inf), np.where(low < 0.0, down, np.inf)
        return float(min(1.0, up.min(initial=1.0), down.min(initial=1.0)))


def efforts_of(robot: Robot, effort: bool | Mapping[str, Any]) -> Efforts | None:
    """None where torques do not count; `effort` as of `nmm.plan`."""
    if effort is False:
        return None
    return Efforts(Dynamics(robot, None if effort is True else effort))
