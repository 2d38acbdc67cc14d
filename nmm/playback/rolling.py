"""How far the wheels turn and their swivels with them: wheels roll where they touch the ground."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from nmm.arrays import Array, vector
from nmm.playback.carriers import Carriers, at_point
from nmm.playback.placements import rolling_joints
from nmm.playback.swivels import Swivel
from nmm.robots.motion import Motion
from nmm.robots.robot import Robot


class Rolling:
    """The rolling of a robot's W wheels and of their swivels, with what does not change worked out once.

    A wheel of centre c, axis a and radius r, which grips along the direction d in which it rolls turned by
    γ (its rollers' angle), turns at v_c·d(γ) / (r cos γ), with v_c the velocity of its centre: the point
    that touches the ground then has no velocity along d(γ). d = a × z. Of a wheel that slides along d by
    design, c is where it would not (`Platform.rolls_at`).

    Attributes
    ----------
    joints : names of the D joints of the display model that are no coordinates: the W wheels', then the
        swivels'. All angles (D,) here are theirs, rad
    steered : the swivels among them whose angle is a function of q: see `settled`
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
        # d = a × z, and d turned by γ; dividing by r cos γ once.
        self._rolling = np.column_stack([axes[:, 1], -axes[:, 0]])
        roller = np.array([wheel.roller for wheel in wheels])
        cosine, sine = np.cos(roller)[:, np.newaxis], np.sin(roller)[:, np.newaxis]
        across = np.column_stack([-self._rolling[:, 1], self._rolling[:, 0]])
        self._radii = np.array([wheel.radius for wheel in wheels])
        self._gripping = (cosine * self._rolling + sine * across) / (self._radii * np.cos(roller))[
            :, np.newaxis
        ]
        self._levers = np.column_stack([-centers[:, 1], centers[:, 0]])
        self._swivels = [
            Swivel.of(robot, self._carriers, name, wheels) for name in self.joints[len(wheels) :]
        ]
        swivels = zip(self.joints[len(wheels) :], self._swivels, strict=True)
        self.steered = tuple(
            name for name, swivel in swivels if swivel.drive is not None and not swivel.trail
        )

    def rates(self, q: ArrayLike, u: ArrayLike, angles: ArrayLike | None = None) -> Array:
        """Rates (D,) rad/s at coordinates q (n,), inputs u (n_u,) that do not change, and angles (D,).

        Without angles, those of `settled`.

        Raises
        ------
        InputError : wrong lengths, numbers that are not finite
        """
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
        """Angles (D,) at which a robot starts at q (n,): steered wheels look the way they go, the rest at 0.

        Where that depends on the inputs, and u (n_u,) is not given or keeps still, they are at 0 too.
        """
        q = self.robot.q(q)
        u = np.zeros(self.robot.n_u) if u is None else vector(u, self.robot.n_u, "u")
        return np.array([0.0 for _ in self._radii] + [swivel.settled(q, u) for swivel in self._swivels])

    def angles(self, q: Array, u: Array | None = None, start: Array | None = None) -> Array:
        """Angles (N, D) at the configurations q (N, n).

        Parameters
        ----------
        q : between two, each body that carries wheels is taken to move along an arc, at a constant twist
        u : (N, n_u) the inputs there; estimated from q when not given
        start : (D,) angles at the first; wheels at 0 and swivels settled when not given
        """
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
        """Spins (…, W) of wheels that are fixed on their carriers, for the carriers' twists (…, C, 3)."""
        at = twists[..., self._carrier, :]
        velocity = at[..., :2] + at[..., 2:] * self._levers
        return np.asarray(np.sum(velocity * self._gripping, axis=-1))


def wheel_rates(robot: Robot, q: ArrayLike, u: ArrayLike, angles: ArrayLike | None = None) -> Array:
    """Rates of the wheels and their swivels, (D,) rad/s: see `Rolling.rates`.

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> nmm.playback.wheel_rates(robot, robot.rest, [0.5, 0.0, 0.0, 0.0]).round(3)
    array([5., 5.])
    """
    return Rolling(robot).rates(q, u, angles)


def wheel_angles(motion: Motion) -> Array:
    """Angles of the wheels, then of their swivels, (N, D) rad; wheels at zero at the first sample: see
    `Rolling.angles`.

    Examples
    --------
    >>> run = nmm.Scenario.load("unicycle_2r_position").run()
    >>> angles = nmm.playback.wheel_angles(nmm.playback.Motion(run.robot, run.t, run.q, run.u))
    >>> angles.shape
    (5001, 2)
    """
    return Rolling(motion.robot).angles(motion.q, motion.u)
