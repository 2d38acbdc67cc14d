"""Mecanum: four wheels with rollers at 45 degrees, whose speeds move the platform in any direction."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from nmm.arrays import Array, positive, vector
from nmm.kernels.compiled import PLATFORM, Kernel, kernel
from nmm.platforms.base import Platform
from nmm.platforms.layout import Layout, RollingJoint
from nmm.platforms.measuring import NEAR, misfit, rolls_forward, same, say_wheels, wheels_on


@kernel(PLATFORM)
def mecanum(qp: Array, parameters: Array, G: Array, G_q: Array) -> None:
    """vx = r drive, vy = r strafe, ω = r turn / k; parameters = [r, k], k = (length + width) / 2."""
    radius = parameters[0]
    cosine = radius * math.cos(qp[2])
    sine = radius * math.sin(qp[2])
    G[0, 0] = cosine
    G[0, 1] = -sine
    G[1, 0] = sine
    G[1, 1] = cosine
    G[2, 2] = radius / parameters[1]
    G_q[0, 0, 2] = -sine
    G_q[0, 1, 2] = -cosine
    G_q[1, 0, 2] = cosine
    G_q[1, 1, 2] = -sine


class Mecanum(Platform):
    """qp = [x, y, theta] (m, m, rad), up = [drive, strafe, turn] (rad/s): the parts of the wheels' speeds.

    x, y is the middle of the four wheels at (±length/2, ±width/2). Seen from above their upper rollers form
    an X. Four speeds have to agree on three motions: front_left + front_right = rear_left + rear_right.
    What is left are the three inputs, of which each speed is a sum with signs ±1 (see `wheel_speeds`), so
    that |speeds|² = 4 |up|²: the inputs of least norm are the wheel speeds of least norm.

    Parameters
    ----------
    radius : of the wheels, m
    length, width : distances between the axles and between the left and right wheels, m
    limits : largest absolute value of each input by name, rad/s

    Raises
    ------
    InputError : a length that is not above zero; a limit of an input that does not exist

    Examples
    --------
    >>> base = nmm.Mecanum(radius=0.1, length=0.5, width=0.4)
    >>> base.inputs
    ('drive', 'strafe', 'turn')
    >>> (base.G([0, 0, 0]) @ [0.0, 5.0, 0.0]).round(3)
    array([0. , 0.5, 0. ])
    """

    name = "mecanum"
    inputs = ("drive", "strafe", "turn")
    input_units = ("rad/s", "rad/s", "rad/s")
    #: The order of `wheel_speeds`.
    wheels = ("front_left", "front_right", "rear_left", "rear_right")
    #: The parts of each wheel's speed, in the order of `inputs`.
    _parts = np.array([[1.0, -1.0, -1.0], [1.0, 1.0, 1.0], [1.0, 1.0, -1.0], [1.0, -1.0, 1.0]])

    def __init__(
        self,
        radius: ArrayLike,
        length: ArrayLike,
        width: ArrayLike,
        *,
        limits: Mapping[str, float] | None = None,
    ) -> None:
        self.radius = positive(radius, f"{self.name}: radius")
        self.length = positive(length, f"{self.name}: length")
        self.width = positive(width, f"{self.name}: width")
        super().__init__(limits=limits)

    @classmethod
    def fit(cls, layout: Layout) -> Self:
        """Radius, length and width of the file's four wheels.

        Raises
        ------
        InputError : the root's body does not carry exactly four wheels, of one radius, that roll forward at
            the corners of a rectangle whose middle is the reference point
        """
        wheels = wheels_on(layout, "theta")
        wrong = _misfit(wheels)
        if wrong is not None:
            expected = (
                "four wheels of one radius that roll forward at the corners of a rectangle around the "
                "reference point"
            )
            raise misfit(layout, cls.name, expected, wrong, say_wheels(wheels))
        return cls(wheels[0].radius, 2.0 * abs(wheels[0].x), 2.0 * abs(wheels[0].y))

    @property
    def lengths(self) -> Mapping[str, float]:
        return {"radius": self.radius, "length": self.length, "width": self.width}

    @property
    def parameters(self) -> Array:
        return np.array([self.radius, (self.length + self.width) / 2.0])

    @property
    def parameter_names(self) -> Mapping[str, str]:
        return {"r": "", "k": "half the sum of the mecanum wheels' length and width"}

    def described(self) -> dict[str, str]:
        return {"radius": f"{self.radius:g} m", "length": f"{self.length:g} m", "width": f"{self.width:g} m"}

    @property
    def velocity_map(self) -> Kernel:
        return mecanum

    def pfaffian(self, qp: Array) -> Array:
        """Whatever the motion, four speeds make the wheels grip without slip: shape (0, 3)."""
        return np.zeros((0, 3))

    def roller(self, x: float, y: float) -> float:
        """-π/4 for the wheels in front to the left and behind to the right, π/4 for the other two."""
        return -math.pi / 4.0 if x * y > 0.0 else math.pi / 4.0

    def wheel_speeds(self, up: ArrayLike) -> Array:
        """Speeds of the four wheels, (4,) rad/s in the order of `wheels`, positive rolls forward.

        front_left = drive - strafe - turn, front_right = drive + strafe + turn,
        rear_left = drive + strafe - turn, rear_right = drive - strafe + turn.
        """
        return np.asarray(self._parts @ vector(up, 3, "up"))


def _misfit(wheels: tuple[RollingJoint, ...]) -> str | None:
    """What is wrong with them, or None."""
    if len(wheels) != 4:
        return f"the root's body carries {len(wheels)}"
    for wheel in wheels:
        if not rolls_forward(wheel):
            return f"{wheel.joint} does not roll forward"
    corners = {(wheel.x > 0.0, wheel.y > 0.0) for wheel in wheels}
    if len(corners) != 4:
        return "they are not one in each quarter around it: give axle (--axle X,Y)"
    if not same(abs(wheel.x) for wheel in wheels) or not same(abs(wheel.y) for wheel in wheels):
        return "they are not equally far from it to the front, rear, left and right: give axle (--axle X,Y)"
    if abs(wheels[0].x) <= NEAR or abs(wheels[0].y) <= NEAR:
        return "they are on one line"
    if not same(wheel.radius for wheel in wheels):
        return "their radii differ"
    return None
