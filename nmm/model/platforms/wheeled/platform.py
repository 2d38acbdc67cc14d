"""The general platform: wheels say how it moves."""

from __future__ import annotations

import cmath
import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import Array, scalar, vector
from nmm.base.errors import InputError, expect, expect_known
from nmm.model.platforms.base import Platform
from nmm.model.platforms.steering import SteeredAxle, SteeringPivot
from nmm.model.platforms.wheel_layout import Layout
from nmm.model.platforms.wheeled.descriptions import (
    MAIN,
    CasterWheel,
    FixedWheel,
    Hitch,
    OmniWheel,
    SteeredWheel,
    WheelDescription,
    parts_from,
)
from nmm.model.platforms.wheeled.geometry import Bodies, Term, rolling_term
from nmm.model.platforms.wheeled.inputs import Input
from nmm.model.platforms.wheeled.kernel import BODIES, SIZE, pack, wheeled
from nmm.model.platforms.wheeled.structure import Constraint, Structure


class WheelRate(NamedTuple):
    """Spin about the wheel's axis, and turn of its pivot relative to the carrier (0 without), rad/s.

    Examples
    --------
    >>> sides = [nmm.FixedWheel(name, 0.0, y, radius=0.1) for name, y in (("left", 0.3), ("right", -0.3))]
    >>> platform = nmm.WheeledPlatform(sides)
    >>> rate = platform.wheel_rates([0, 0, 0], [1.0, 0.0])["left"]
    >>> isinstance(rate, nmm.extending.WheelRate), round(rate.spin, 6), rate.turn
    (True, 10.0, 0.0)
    """

    spin: float
    turn: float


class WheeledPlatform(Platform):
    """A platform described by its wheels: A from their rolling without slip, G spans the null space of A.

    qp = [x, y, theta, steering angles and hitch angles], each body's steered wheels before its hitches,
    each hitch before what it carries. G = M⁻¹ [0; I], where M has the rows of A and, below, those of the
    inputs: smooth in qp wherever the inputs determine the motion.

    Wheels that repeat others (the second on an axle) add no row. Steered wheels beyond those that fix the
    centre of rotation follow: their steering rates are no inputs, and keep the axes concurrent. Those with a
    trail are driven casters, which the motion turns, unless their rates are inputs.

    Parameters
    ----------
    wheels : their descriptions
    hitches : joints with further bodies
    inputs : "v", "vx", "vy", "omega", "<joint>_rate", `WheelSpeed`, `WheelSpin`, `WeightedSpins`,
        `CommonSpeed`; the steering rates that are missing are added while they are free. By default v and
        omega where there is an axle, v where it is steered too, vx, vy, omega where no wheel constrains the
        main body; then the steering rates of wheels without trail
    limits : largest absolute value of each input, by name

    Raises
    ------
    InputError : a name given twice or unknown, wheels that leave nothing to steer, inputs that repeat others

    Source: Campion, Bastin, D'Andréa-Novel, "Structural properties and classification of kinematic and
    dynamic models of wheeled mobile robots", IEEE Trans. Robotics and Automation 12(1), 1996.

    Examples
    --------
    >>> axle = [nmm.FixedWheel("left", 0, 0.3, 0.1), nmm.FixedWheel("right", 0, -0.3, 0.1)]
    >>> car = nmm.WheeledPlatform([*axle, nmm.SteeredWheel("front", 0.8, 0, 0.1)])
    >>> car.coordinates, car.inputs
    (('x', 'y', 'theta', 'steering'), ('v', 'steering_rate'))
    >>> car.wheel_rates([0, 0, 0, 0], [0.5, 0.0])["left"]
    WheelRate(spin=5.0, turn=0.0)
    """

    name = "wheeled"
    velocity_map = wheeled

    def __init__(
        self,
        wheels: Sequence[WheelDescription],
        hitches: Sequence[Hitch] = (),
        inputs: Sequence[Input] | None = None,
        *,
        limits: Mapping[str, float] | None = None,
    ) -> None:
        self.wheels = tuple(wheels)
        self.hitches = tuple(hitches)
        self._asked = inputs
        for part, kind in [(w, WheelDescription) for w in self.wheels] + [(h, Hitch) for h in self.hitches]:
            of_kind = isinstance(part, kind) and type(part) is not WheelDescription
            expect(of_kind, self.name, "wheels of a kind, and hitches", part)
        _check_distinct([wheel.name for wheel in self.wheels], "wheel")
        self._bodies = Bodies(self.wheels, self.hitches)
        self._structure = Structure(self._bodies, self.wheels, inputs)
        self.coordinates = ("x", "y", *self._bodies.names)
        self.inputs = tuple(name for name, _, _ in self._structure.inputs)
        self.input_units = tuple(unit for _, unit, _ in self._structure.inputs)
        _check_distinct(self.inputs, "input")
        self._parameters = self._packed()
        super().__init__(limits=limits)

    @classmethod
    def fit(cls, layout: Layout) -> Self:
        """The platform of a robot's file: see `parts_from` for which joint becomes what, and its errors; a
        body with fixed wheels on two axles, which could not turn, is one more."""
        platform = cls(*parts_from(layout))
        axles: dict[str, Constraint] = {}
        for constraint in platform._structure.constraints:
            wheel = constraint.wheels[0]
            if isinstance(wheel, FixedWheel) and axles.setdefault(wheel.body, constraint) is not constraint:
                raise InputError(
                    f"wheels {axles[wheel.body].names} and {constraint.names} are on different axles of one "
                    "body, which could not turn; for omni or mecanum wheels, or some that skid, choose "
                    "another platform",
                    where=layout.robot,
                )
        return platform

    def with_parts(self, wheels: Sequence[WheelDescription], hitches: Sequence[Hitch]) -> Self:
        """The same platform with other wheels and hitches of the same names."""
        return type(self)(wheels, hitches, self._asked, limits=self._limits)

    @property
    def lengths(self) -> Mapping[str, float]:
        return _lengths(self.wheels, self.hitches)

    def measured(self, layout: Layout) -> Mapping[str, float]:
        """Of the wheels and hitches that have the names of the file's joints."""
        return _lengths(*parts_from(layout))

    @property
    def parameters(self) -> Array:
        return self._parameters

    @property
    def coordinate_limits(self) -> Array:
        limits = super().coordinate_limits
        for number, body in enumerate(self._bodies.all[1:], start=1):
            limits[2 + number] = body.lower, body.upper
        return limits

    @property
    def mobility(self) -> int:
        """δ_m: independent motions with the centred steered wheels held (Campion), hitched bodies' too."""
        return self._structure.mobility

    @property
    def steerability(self) -> int:
        """δ_s: independent steering rates of centred wheels; p = δ_m + δ_s."""
        return self.p - self.mobility

    def described(self) -> dict[str, str]:
        parts = {}
        for wheel in self.wheels:
            at = f"({wheel.x:.4g}, {wheel.y:.4g}) m on {wheel.body}"
            parts[f"{type(wheel).__name__} {wheel.name}"] = f"at {at}, radius {wheel.radius:.4g} m"
        return parts | {
            f"Hitch {hitch.joint}": f"at ({hitch.x:.4g}, {hitch.y:.4g}) m" for hitch in self.hitches
        }

    def pfaffian(self, qp: Array) -> Array:
        """No sideways motion of a wheel on each independent axis, and steering that keeps axes concurrent."""
        rows = [row.at(self._bodies, qp) for row in self._structure.pfaffian]
        return np.array(rows).reshape(self.n_p - self.p, self.n_p)

    def problem(self, qp: ArrayLike) -> str | None:
        """Which wheels' axes contradict each other, or with which wheel an input ceases to say anything."""
        qp = vector(qp, self.n_p, "qp")
        reason = self._structure.contradiction(qp)
        if reason is None and not np.all(np.isfinite(self.G(qp))):
            reason = self._structure.singularity(qp)
        return reason or self._structure.folded(qp)

    def roller(self, x: float, y: float) -> float:
        """Angle γ of the rollers of the main body's wheel that is nearest to (x, y)."""
        wheels = [wheel for wheel in self.wheels if wheel.body == MAIN]
        nearest = min(wheels, key=lambda wheel: math.hypot(wheel.x - x, wheel.y - y), default=None)
        return nearest.roller if isinstance(nearest, OmniWheel) else 0.0

    def steered_axle(self, body: str) -> SteeredAxle | None:
        """The main body's, where one speed and the steering angles say all (mobility 1): the point of the
        fixed axle that is beside the reference point, and the pivots whose rates are inputs.

        Without fixed wheels all wheels steer, and the reference point follows the body's x axis.
        """
        if body != MAIN or self.mobility != 1:
            return None
        own = [wheel for wheel in self.wheels if wheel.body == MAIN]
        fixed = next((wheel for wheel in own if isinstance(wheel, FixedWheel)), None)
        middle, heading = 0j, 0.0
        if fixed is not None:
            heading = fixed.heading
            forward = cmath.rect(1.0, heading)
            middle = forward * (complex(fixed.x, fixed.y) * forward.conjugate()).real
        pivots: dict[str, SteeringPivot] = {}
        for wheel in own:
            if isinstance(wheel, SteeredWheel) and wheel.centered and f"{wheel.joint}_rate" in self.inputs:
                at = (complex(wheel.x, wheel.y) - middle) * cmath.rect(1.0, -heading)
                zero = math.remainder(wheel.heading - heading, math.pi)  # a wheel's line has no front
                rate = f"{wheel.joint}_rate"
                pivots[wheel.joint] = SteeringPivot(wheel.joint, rate, at.real, at.imag, zero)
        return SteeredAxle(tuple(pivots.values()), middle.real, middle.imag, heading) if pivots else None

    def wheel_rates(
        self, qp: ArrayLike, up: ArrayLike, swivels: Mapping[str, float] | None = None
    ) -> dict[str, WheelRate]:
        """How fast every wheel spins and turns about its pivot, rad/s, at qp (n_p,) under the inputs up (p,).

        Parameters
        ----------
        swivels : the casters' angles by wheel, rad; zero for those not named

        Raises
        ------
        InputError : the wheels cannot roll at qp, an unknown caster, wrong lengths
        """
        qp = vector(qp, self.n_p, "qp")
        problem = self.problem(qp)
        if problem is not None:
            raise InputError(problem, where=self.name)
        qp_dot = self.G(qp) @ vector(up, self.p, "up")
        angles = swivels or {}
        casters = [wheel.name for wheel in self.wheels if isinstance(wheel, CasterWheel)]
        for name in angles:
            expect_known("caster", name, casters, "swivels")
        rates = {}
        for wheel in self.wheels:
            if isinstance(wheel, CasterWheel):
                angle = scalar(angles.get(wheel.name, 0.0), f"swivel of {wheel.name}")
                rates[wheel.name] = _caster(self._bodies, wheel, qp, qp_dot, angle)
                continue
            spin = float(self._bodies.row([rolling_term(self._bodies, wheel)], qp) @ qp_dot)
            turn = 0.0
            if isinstance(wheel, SteeredWheel):
                turn = float(qp_dot[2 + self._bodies.number(wheel.joint)])
            rates[wheel.name] = WheelRate(spin, turn)
        return rates

    def _packed(self) -> Array:
        sections: list[list[list[float]]] = [[] for _ in range(SIZE + 1)]
        sections[BODIES] = [[body.carrier, body.place.real, body.place.imag] for body in self._bodies.all]
        # All closures were given the platform's size.
        sections[SIZE] = [[followed.row.length] for followed in self._structure.followed[:1]] or [[1.0]]
        rows = [*self._structure.pfaffian, *(row for _, _, row in self._structure.inputs)]
        for number, row in enumerate(rows):
            section, lines = row.packed(number)
            sections[section] += lines
        return pack([np.array(section, dtype=float) for section in sections])


def _check_distinct(names: Sequence[str], what: str) -> None:
    twice = [name for k, name in enumerate(names) if name in names[:k]]
    if twice:
        raise InputError("the name is given twice", where=f"{what} {twice[0]}", got=tuple(names))


def _lengths(wheels: Sequence[WheelDescription], hitches: Sequence[Hitch]) -> dict[str, float]:
    places = {wheel.name: wheel for wheel in wheels} | {hitch.joint: hitch for hitch in hitches}
    lengths = {f"{axis} of {name}": getattr(at, axis) for name, at in places.items() for axis in ("x", "y")}
    return lengths | {f"radius of {wheel.name}": wheel.radius for wheel in wheels}


def _caster(bodies: Bodies, wheel: CasterWheel, qp: Array, qp_dot: Array, angle: float) -> WheelRate:
    """The pivot's velocity along the heading rolls the wheel, across it swings the trail: at pivot - trail t,
    sideways speed n·v - trail (Ω + turn) is 0 for turn = n·v / trail - Ω, Ω the carrier's rate."""
    pivot = bodies.contact(wheel, angle)
    sideways = Term(pivot.body, pivot.point, pivot.direction + math.pi / 2)
    along, across = (float(bodies.row([term], qp) @ qp_dot) for term in (pivot, sideways))
    carrier = sum(float(qp_dot[2 + body]) for body in bodies.chain(pivot.body))
    turn = across / wheel.trail  # of the fork over the ground: the wheel beside its pivot rolls by it, too
    return WheelRate((along - turn * wheel.offset) / wheel.radius, turn - carrier)
