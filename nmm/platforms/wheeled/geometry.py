"""The bodies of a platform that is described by its wheels, and velocities of their points, in world axes.

Points and directions of the plane are complex numbers. The kernel (`kernel`) has formulas of its own,
in the main body's axes: the tests compare the two.
"""

from __future__ import annotations

import cmath
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from nmm.arrays import Array
from nmm.errors import InputError, expect_known
from nmm.platforms.wheeled.descriptions import (
    MAIN,
    CasterWheel,
    Hitch,
    OmniWheel,
    SteeredWheel,
    WheelDescription,
)


@dataclass(frozen=True)
class Body:
    """What coordinate 2 + number turns: the main body, or what hangs on a hitch or a steering pivot.

    place is the joint in the carrier's frame, m; the main body carries itself.
    """

    name: str
    carrier: int
    place: complex
    lower: float = -np.inf
    upper: float = np.inf
    steers: bool = False


@dataclass(frozen=True)
class Term:
    """weight times the velocity of a point of a body along a direction; both in the body's frame."""

    body: int
    point: complex
    direction: float
    weight: float = 1.0


class Bodies:
    """All bodies, the main one first, each before those it carries (Pinocchio's order of joints)."""

    def __init__(self, wheels: Sequence[WheelDescription], hitches: Sequence[Hitch]) -> None:
        names = [MAIN, *(hitch.joint for hitch in hitches)]
        for hitch in hitches:
            expect_known("carrier", hitch.carrier, names, f"hitch {hitch.joint}")
        for wheel in wheels:
            expect_known("body", wheel.body, names, f"wheel {wheel.name}")
        self.all: list[Body] = [Body(MAIN, 0, 0j)]
        self._add_carried_by(0, wheels, hitches)
        left = [hitch.joint for hitch in hitches if hitch.joint not in self.names]
        if left:
            raise InputError(
                f"hitches {', '.join(left)}: they carry each other, and the main body none of them"
            )

    def _add_carried_by(
        self, carrier: int, wheels: Sequence[WheelDescription], hitches: Sequence[Hitch]
    ) -> None:
        name = self.all[carrier].name
        for wheel in wheels:
            if isinstance(wheel, SteeredWheel) and wheel.body == name:
                self._add_pivot(carrier, wheel)
        for hitch in hitches:
            if hitch.carrier == name:
                self._add(Body(hitch.joint, carrier, complex(hitch.x, hitch.y), hitch.lower, hitch.upper))
                self._add_carried_by(len(self.all) - 1, wheels, hitches)

    def _add_pivot(self, carrier: int, wheel: SteeredWheel) -> None:
        body = Body(wheel.joint, carrier, complex(wheel.x, wheel.y), wheel.lower, wheel.upper, steers=True)
        if body not in self.all:
            self._add(body)

    def _add(self, body: Body) -> None:
        if body.name in (*self.names, "x", "y"):
            what = "pivots with another place or other limits" if body.steers else "joints or coordinates"
            raise InputError(f"joint {body.name}: the name is given twice, to {what}")
        self.all.append(body)

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(body.name for body in self.all)

    @property
    def steering(self) -> list[int]:
        """Coordinates that are steering angles."""
        return [2 + b for b, body in enumerate(self.all) if body.steers]

    def number(self, name: str) -> int:
        return self.names.index(name)

    def contact(self, wheel: WheelDescription, direction: float = 0.0, weight: float = 1.0) -> Term:
        """The velocity of the wheel's centre (a caster's pivot) along its heading, turned by `direction`."""
        if isinstance(wheel, SteeredWheel):
            place = cmath.rect(1.0, wheel.heading) * complex(-wheel.trail, wheel.offset)
            return Term(self.number(wheel.joint), place, wheel.heading + direction, weight)
        body = self.number(wheel.body)
        return Term(body, complex(wheel.x, wheel.y), wheel.heading + direction, weight)

    def frames(self, qp: Array) -> list[tuple[complex, float]]:
        """Origin (m) and angle (rad) of every body in the world."""
        found = [(complex(qp[0], qp[1]), float(qp[2]))]
        for number, body in enumerate(self.all[1:], start=1):
            origin, angle = found[body.carrier]
            found.append((origin + cmath.rect(1.0, angle) * body.place, angle + float(qp[2 + number])))
        return found

    def row(self, terms: Iterable[Term], qp: Array) -> Array:
        """The row over qp_dot, (n_p,), of a sum of terms."""
        frames = self.frames(qp)
        row = np.zeros(2 + len(self.all))
        for term in terms:
            origin, angle = frames[term.body]
            point = origin + cmath.rect(1.0, angle) * term.point
            direction = cmath.rect(term.weight, angle + term.direction)
            row[0] += direction.real
            row[1] += direction.imag
            for body in self.chain(term.body):
                lever = 1j * (point - frames[body][0])
                row[2 + body] += (direction.conjugate() * lever).real
        return row

    def chain(self, body: int) -> list[int]:
        """The body and those that carry it, down to the main one."""
        chain = [body]
        while chain[-1] != 0:
            chain.append(self.all[chain[-1]].carrier)
        return chain


def rolling_term(bodies: Bodies, wheel: WheelDescription) -> Term:
    """The wheel's spin rate, rad/s: radius times spin is the speed of the centre along the heading.

    With rollers at γ only the components along the grip agree: r spin cos γ = v · grip.
    """
    if isinstance(wheel, CasterWheel):
        raise InputError(
            f"wheel {wheel.name} is a caster: its swivel is no coordinate, so neither its speed nor its spin "
            "can be an input"
        )
    roller = wheel.roller if isinstance(wheel, OmniWheel) else 0.0
    return bodies.contact(wheel, roller, 1.0 / (wheel.radius * float(np.cos(roller))))
