"""Platforms whose wheels exclude no motion: omnidirectional, mecanum; and the fixed base, which has none."""

from __future__ import annotations

import math
import statistics
from collections.abc import Mapping, Sequence
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import Array, positive, vector
from nmm.base.findings import Finding
from nmm.base.kernels.compiled import PLATFORM, compiled, kernel
from nmm.model.platforms.base import Platform
from nmm.model.platforms.wheel_layout import (
    NEAR,
    Layout,
    RollingJoint,
    common_radius,
    described,
    main_wheels,
    same,
    standing_wheels,
)


@kernel(PLATFORM)
def fixed(qp: Array, parameters: Array, G: Array, G_q: Array) -> None:
    """G is empty, (0, 0)."""


@compiled
def turned(cosine: float, sine: float, G: Array, G_q: Array) -> None:
    """The first two inputs move the platform along its own axes, which are turned by θ."""
    G[0, 0] = cosine
    G[0, 1] = -sine
    G[1, 0] = sine
    G[1, 1] = cosine
    G_q[0, 0, 2] = -sine
    G_q[0, 1, 2] = -cosine
    G_q[1, 0, 2] = cosine
    G_q[1, 1, 2] = -sine


@kernel(PLATFORM)
def omnidirectional(qp: Array, parameters: Array, G: Array, G_q: Array) -> None:
    """G = [[cos θ, -sin θ, 0], [sin θ, cos θ, 0], [0, 0, 1]]."""
    turned(math.cos(qp[2]), math.sin(qp[2]), G, G_q)
    G[2, 2] = 1.0


@kernel(PLATFORM)
def mecanum(qp: Array, parameters: Array, G: Array, G_q: Array) -> None:
    """vx = r drive, vy = r strafe, ω = r turn / k; parameters = [r, k], k = (length + width) / 2."""
    radius = parameters[0]
    turned(radius * math.cos(qp[2]), radius * math.sin(qp[2]), G, G_q)
    G[2, 2] = radius / parameters[1]


class _Unconstrained(Platform):
    """As many inputs as coordinates."""

    def pfaffian(self, qp: Array) -> Array:
        """No motion is excluded: (0, n_p)."""
        return np.zeros((0, self.n_p))


class FixedBase(_Unconstrained):
    """qp = [], up = []: the root link stands where the world's axes are.

    Examples
    --------
    >>> arm = nmm.load("unicycle_3r", platform="fixed")
    >>> arm.q_names
    ('q1', 'q2', 'q3')
    """

    name = "fixed"
    coordinates = ()
    inputs = ()
    input_units = ()
    velocity_map = fixed


class Omnidirectional(_Unconstrained):
    """qp = [x, y, theta] (m, m, rad), up = [vx, vy, omega] (m/s, m/s, rad/s).

    vx and vy are the velocity of the point x, y along the platform's own axes, forward and to the left.

    Examples
    --------
    >>> nmm.Omnidirectional().inputs
    ('vx', 'vy', 'omega')
    """

    name = "omnidirectional"
    inputs = ("vx", "vy", "omega")
    input_units = ("m/s", "m/s", "rad/s")
    velocity_map = omnidirectional

    def compared(self, layout: Layout) -> tuple[Finding, ...]:
        """That the main body stands on one or two wheels, which have to be plain ones: they roll one way."""
        wheels = standing_wheels(layout)
        if not 0 < len(wheels) < 3 or layout.drive == self.name:
            return ()
        return (Finding("moves_sideways", {"platform": self.name, "wheels": "; ".join(described(wheels))}),)


class Mecanum(_Unconstrained):
    """qp = [x, y, theta] (m, m, rad), up = [drive, strafe, turn] (rad/s): the parts of the wheels' speeds.

    x, y is the middle of the four wheels at (±length/2, ±width/2), whose upper rollers form an X seen from
    above. Four speeds have to agree on three motions: front_left + front_right = rear_left + rear_right. Each
    is a sum of the three inputs with signs ±1 (see `wheel_speeds`), so that |speeds|² = 4 |up|²: the inputs
    of least norm are the wheel speeds of least norm.

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
    parameter_names: Mapping[str, str] = {
        "r": "",
        "k": "half the sum of the mecanum wheels' length and width",
    }
    velocity_map = mecanum
    _fitted = ("radius", "length", "width")
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
        """Radius, length and width of the file's wheels; `InputError` unless the root's body carries exactly
        four, of one radius, that roll forward at the corners of a rectangle around the reference point."""
        expected = "four wheels of one radius that roll forward, in a rectangle around the reference point"
        wheels = main_wheels(layout, cls.name, expected, _why_no_rectangle, 4, 4)
        length = 2.0 * statistics.mean(abs(wheel.x) for wheel in wheels)
        width = 2.0 * statistics.mean(abs(wheel.y) for wheel in wheels)
        return cls(common_radius(cls.name, wheels), length, width)

    @property
    def parameters(self) -> Array:
        return np.array([self.radius, (self.length + self.width) / 2.0])

    def roller(self, x: float, y: float) -> float:
        """-π/4 for the wheels in front to the left and behind to the right, π/4 for the other two."""
        return -math.pi / 4.0 if x * y > 0.0 else math.pi / 4.0

    def wheel_speeds(self, up: ArrayLike) -> Array:
        """Speeds of the four wheels, (4,) rad/s in the order of `wheels`, positive rolls forward.

        front_left = drive - strafe - turn, front_right = drive + strafe + turn,
        rear_left = drive + strafe - turn, rear_right = drive - strafe + turn.
        """
        return np.asarray(self._parts @ vector(up, 3, "up"))


def _why_no_rectangle(wheels: Sequence[RollingJoint]) -> str | None:
    corners = {(wheel.x > 0.0, wheel.y > 0.0) for wheel in wheels}
    if len(corners) != 4:
        return "they are not one in each quarter around it: give axle (--axle X,Y)"
    if not same(abs(wheel.x) for wheel in wheels) or not same(abs(wheel.y) for wheel in wheels):
        return "they are not equally far from it to the front, rear, left and right: give axle (--axle X,Y)"
    if abs(wheels[0].x) <= NEAR or abs(wheels[0].y) <= NEAR:
        return "they are on one line"
    return None
