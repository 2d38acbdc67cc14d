"""Skid steering: the wheels of each side turn together and do not steer, so that turning makes them slide."""

from __future__ import annotations

import math
import statistics
from collections.abc import Mapping, Sequence
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import Array, positive, scalar
from nmm.base.errors import expect
from nmm.base.kernels.compiled import PLATFORM, kernel
from nmm.model.platforms.base import Platform, of_many
from nmm.model.platforms.unicycle import across
from nmm.model.platforms.wheel_layout import NEAR, Layout, RollingJoint, common_radius, main_wheels, same


@kernel(PLATFORM)
def skid_steer(qp: Array, parameters: Array, G: Array, G_q: Array) -> None:
    """ω = r (ω_r - ω_l) / (a - b), vx = r (a ω_r - b ω_l) / (a - b), vy = -c ω; parameters = [r, a, b, c]:
    a and b are y of the centres of rotation to the left and right, c is x of the platform's (Mandow et al.
    2007, eq. 4 to 6, with x ahead and y to the left)."""
    left = parameters[1]
    right = parameters[2]
    turn = parameters[0] / (left - right)
    cosine = math.cos(qp[2])
    sine = math.sin(qp[2])
    for side in range(2):
        rate = turn if side == 1 else -turn
        vx = turn * left if side == 1 else -turn * right
        vy = -parameters[3] * rate
        G[0, side] = cosine * vx - sine * vy
        G[1, side] = sine * vx + cosine * vy
        G[2, side] = rate
        G_q[0, side, 2] = -sine * vx - cosine * vy
        G_q[1, side, 2] = cosine * vx - sine * vy


class SkidSteer(Platform):
    """qp = [x, y, theta] (m, m, rad), up = [omega_left, omega_right] (rad/s, positive rolls forward).

    x, y is the middle of the wheels, theta their heading from the world's x axis. In a turn, wheels that are
    not at their side's centre of rotation slide by design; `sliding` says how fast. Where these centres are
    depends on the ground, the load and the tires, and changes little with the speed. They are measured by
    driving: on hard ground they lie 1.5 to 2 times farther out than the wheels, so that the robot turns less
    than its wheels say. Without numbers they are at the wheels, as if these slid sideways only.

    A. Mandow, J. L. Martínez, J. Morales, J. L. Blanco, A. García-Cerezo, J. González, *Experimental
    Kinematics for Wheeled Skid-Steer Mobile Robots*, IROS 2007; J. L. Martínez et al., *Approximating
    Kinematics for Tracked Mobile Robots*, IJRR 24 (10), 2005.

    Parameters
    ----------
    radius : of the wheels, m
    length : distance between the first and the last axle, m
    width : distance between the left and right wheels, m
    left, right : y of the instantaneous centres of rotation of the left and right wheels, left > right, m;
        ±width/2 when not given
    ahead : x of the platform's instantaneous centre of rotation, m: it slides sideways behind it and ahead
    limits : largest absolute value of each input by name, rad/s

    Raises
    ------
    InputError : a length that is not above zero; centres that are not finite or in the wrong order; a limit
        of an input that does not exist

    Examples
    --------
    >>> husky = nmm.SkidSteer(radius=0.17, length=0.51, width=0.57, left=0.4, right=-0.4)
    >>> (husky.G([0, 0, 0]) @ [-5, 5]).round(3)
    array([0.   , 0.   , 2.125])
    """

    name = "skid_steer"
    inputs = ("omega_left", "omega_right")
    input_units = ("rad/s", "rad/s")
    velocity_map = skid_steer
    _fitted = ("radius", "length", "width")

    def __init__(
        self,
        radius: ArrayLike,
        length: ArrayLike,
        width: ArrayLike,
        *,
        left: ArrayLike | None = None,
        right: ArrayLike | None = None,
        ahead: ArrayLike = 0.0,
        limits: Mapping[str, float] | None = None,
    ) -> None:
        self.radius = positive(radius, f"{self.name}: radius")
        self.length = positive(length, f"{self.name}: length")
        self.width = positive(width, f"{self.name}: width")
        half = 0.5 * self.width
        self.left = half if left is None else scalar(left, f"{self.name}: left")
        self.right = -half if right is None else scalar(right, f"{self.name}: right")
        self.ahead = scalar(ahead, f"{self.name}: ahead")
        centres = (self.left, self.right)
        expected = "the left wheels' centre of rotation to the left of the right wheels', y in m"
        expect(self.left - self.right > 0.0, f"{self.name}: left, right", expected, centres)
        super().__init__(limits=limits)

    @classmethod
    def fit(cls, layout: Layout) -> Self:
        """Radius, length and width of the file's wheels, with the centres of rotation there; `InputError`
        unless the root's body carries wheels of one radius that roll forward on two axles or more, as many to
        the left as to the right of the reference point, midway between the outer axles."""
        expected = (
            "wheels of one radius that roll forward on two axles or more, equally far to the left and right"
        )
        expected += ", with the reference point in their middle"
        wheels = main_wheels(layout, cls.name, expected, _why_no_two_sides, 4)
        length = max(wheel.x for wheel in wheels) - min(wheel.x for wheel in wheels)
        width = 2.0 * statistics.mean(abs(wheel.y) for wheel in wheels)
        return cls(common_radius(cls.name, wheels), length, width)

    @property
    def parameters(self) -> Array:
        return np.array([self.radius, self.left, self.right, self.ahead])

    def described(self) -> dict[str, str]:
        centres = f"left {self.left:g} m, right {self.right:g} m, ahead {self.ahead:g} m"
        return super().described() | {"centres of rotation": centres}

    @of_many
    def pfaffian(self, qp: Array) -> Array:
        """The point at `ahead` does not move across the heading: -sin θ x_dot + cos θ y_dot + c θ_dot = 0."""
        row = across(qp)
        row[..., 0, 2] = self.ahead
        return row

    def rolls_at(self, x: float, y: float) -> tuple[float, float]:
        """Each wheel turns as one would that rolls at its side's centre of rotation."""
        return x, self.left if y > 0.0 else self.right

    def sliding(self, up: Array) -> Array:
        """The fastest of the wheels at the corners."""
        turn = self.radius * (up[..., 1] - up[..., 0]) / (self.left - self.right)
        out = max(abs(0.5 * self.width - self.left), abs(0.5 * self.width + self.right))
        return np.abs(turn) * math.hypot(out, 0.5 * self.length + abs(self.ahead))


def _why_no_two_sides(wheels: Sequence[RollingJoint]) -> str | None:
    if not same(abs(wheel.y) for wheel in wheels) or abs(wheels[0].y) <= NEAR:
        return "they are not equally far to the left and right of the reference point: give axle (--axle X,Y)"
    left, right = (sorted(wheel.x for wheel in wheels if wheel.y * side > 0.0) for side in (1.0, -1.0))
    if len(left) != len(right) or any(abs(a - b) > 2 * NEAR for a, b in zip(left, right, strict=True)):
        return "they do not stand in pairs, one to the left and one to the right"
    if left[-1] - left[0] <= NEAR:
        return "they are on one axle"
    if abs(left[-1] + left[0]) > 2.0 * NEAR:
        return "the reference point is not midway between the first and the last axle: give axle (--axle X,Y)"
    return None
