"""How far the wheels turn: they roll and do not slip along the direction in which they roll."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from nmm.arrays import Array, vector
from nmm.playback.motion import Motion
from nmm.robot import Robot


class Rolling:
    """The rolling of a robot's W wheels, with what does not change worked out once.

    A wheel of centre c, axis a and radius r turns at (a × z)·v_c / r, with v_c the velocity of its
    centre, all in the root's axes: the point that touches the ground then has no velocity along a × z.
    """

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        axes = np.array([wheel.axis for wheel in robot.wheels]).reshape(-1, 3)
        centers = np.array([wheel.center for wheel in robot.wheels]).reshape(-1, 3)
        self._directions = np.column_stack([axes[:, 1], -axes[:, 0]])
        self._levers = np.column_stack([-centers[:, 1], centers[:, 0]])
        self._radii = np.array([wheel.radius for wheel in robot.wheels])

    def rates(self, q: ArrayLike, u: ArrayLike) -> Array:
        """Spin rates, (W,) rad/s, at coordinates q (n,) and inputs u (n_u,), from q_dot = G(qp) up.

        Raises
        ------
        InputError : wrong lengths, numbers that are not finite
        """
        platform, q = self.robot.platform, self.robot.q(q)
        qp_dot = platform.G(q[: platform.n_p]) @ vector(u, self.robot.n_u, "u")[: platform.p]
        return self._turned(qp_dot[np.newaxis, :3], q[np.newaxis, 2])[0]

    def steps(self, q: Array) -> Array:
        """Angles turned from each configuration in q (N, n) to the next, (N - 1, W) rad.

        The platform is taken to move along an arc in between, at a constant twist: exact for inputs that
        are constant in between, third order in the step otherwise.
        """
        moved = np.diff(q[:, :3], axis=0)
        turn = moved[:, 2].copy()
        # The chord of an arc is shorter than the arc by this factor. A turn of more than half a
        # revolution between two samples says nothing about the arc, so the chord is taken as it is.
        shorter = np.where(np.abs(turn) < np.pi, np.sinc(turn / (2.0 * np.pi)), 1.0)
        moved[:, :2] /= shorter[:, np.newaxis]
        return self._turned(moved, q[:-1, 2] + 0.5 * turn)

    def _turned(self, moved: Array, heading: Array) -> Array:
        """Angles (N, W) for displacements or velocities (x, y, θ) (N, 3) in the world at headings (N,)."""
        cosine, sine = np.cos(heading), np.sin(heading)
        x, y, turn = moved.T
        forward = (cosine * x + sine * y)[:, np.newaxis] + turn[:, np.newaxis] * self._levers[:, 0]
        sideways = (cosine * y - sine * x)[:, np.newaxis] + turn[:, np.newaxis] * self._levers[:, 1]
        angles: Array = (forward * self._directions[:, 0] + sideways * self._directions[:, 1]) / self._radii
        return angles


def wheel_rates(robot: Robot, q: ArrayLike, u: ArrayLike) -> Array:
    """Spin rates of the wheels, (W,) rad/s: see `Rolling.rates`."""
    return Rolling(robot).rates(q, u)


def wheel_angles(motion: Motion) -> Array:
    """Angles of the wheels, (N, W) rad, zero at the first sample: see `Rolling.steps`."""
    angles = np.zeros((len(motion.t), len(motion.robot.wheels)))
    angles[1:] = np.cumsum(Rolling(motion.robot).steps(motion.q), axis=0)
    return angles
