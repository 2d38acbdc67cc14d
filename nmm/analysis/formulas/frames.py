"""What kernels read of a robot, as formulas: placements and Jacobians of frames; auxiliary quantities."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

import numpy as np

from nmm.analysis.formulas.center_of_mass import center
from nmm.analysis.formulas.expansion import Expansion
from nmm.analysis.formulas.geometry import Geometry
from nmm.analysis.formulas.kinematics import Step, position, steps_to, turns, twists
from nmm.analysis.formulas.quotient import Linear, Quotient, Untraceable
from nmm.analysis.formulas.row_values import Auxiliary
from nmm.analysis.formulas.turning import Vector, turned, unit_vectors
from nmm.kernels import records
from nmm.robots.robot import CENTER_OF_MASS, Robot


class Lazy:
    """An array whose entries are made when they are read."""

    def __init__(
        self, entry: Callable[..., Any], shape: tuple[int, ...], first: tuple[int, ...] = ()
    ) -> None:
        self._entry = entry
        self._first = first
        self.shape = shape

    def __getitem__(self, index: int | tuple[int, ...]) -> Any:
        found = index if isinstance(index, tuple) else (index,)
        if len(found) == len(self.shape):
            return self._entry(*self._first, *found)
        return Lazy(self._entry, self.shape[len(found) :], (*self._first, *found))


def lazy(entry: Callable[..., Any], *shape: int) -> Any:
    """Such an array, for what takes numpy's."""
    return Lazy(entry, shape)


def unread(what: str, dimensions: int) -> Any:
    """An array that has no formulas."""

    def refuse(*index: int) -> None:
        raise Untraceable(f"it reads {what}")

    return Lazy(refuse, (0,) * dimensions)


@dataclass(eq=False)
class Frames:
    """What kernels read of a robot, each quantity made once.

    Attributes
    ----------
    auxiliaries : what the auxiliary symbols mean
    undefined : what a function that was traced is undefined without: the lengths, squared, of atan2's vectors
    """

    robot: Robot
    geometry: Geometry
    auxiliaries: list[Auxiliary] = field(default_factory=list)
    undefined: list[Expansion] = field(default_factory=list)
    _made: dict[Any, Any] = field(default_factory=dict)

    def coordinates(self) -> list[Linear]:
        """The robot's coordinates as kernels get them."""
        return [Linear(self.geometry.ring, {index: Fraction(1)}) for index in self._indices()]

    def read(self, frames: tuple[str, ...]) -> records.Frames:
        """Placements and Jacobians of some frames; no second derivatives."""
        k, n = len(frames), self.robot.n
        placements = lazy(lambda k, i, j: Quotient(self._column(frames[k], j)[i]), k, 3, 4)
        jacobians = lazy(lambda k, i, j: Quotient(self._motion(frames[k], i)[j]), k, 6, n)
        return records.Frames(np.arange(k), placements, jacobians, unread("second derivatives of frames", 4))

    def position(self, frame: str, seen_from: str | None = None) -> Vector:
        """A frame's origin, in world axes or as another frame sees it."""
        if frame == CENTER_OF_MASS:
            return self._once(frame, lambda: center(self.robot, self.geometry))
        return self._once(
            (frame, seen_from), lambda: position(steps_to(self.robot, frame, seen_from), self.geometry)
        )

    def _column(self, frame: str, j: int) -> Vector:
        if j == 3:
            return self.position(frame)
        geometry = self.geometry
        return self._once(
            (frame, j),
            lambda: turned(
                turns(steps_to(self.robot, frame), geometry), unit_vectors(geometry.ring)[j], geometry.ring
            ),
        )

    def _motion(self, frame: str, i: int) -> Vector:
        if i < 3:
            return self._once((frame, i, "linear"), lambda: self.gradient(self.position(frame)[i]))
        moving = self._once((frame, "angular"), lambda: self._angular(steps_to(self.robot, frame)))
        zero = [self.geometry.ring.number(0)] * 3
        return [moving.get(name, zero)[i - 3] for name in self.robot.q_names]

    def _angular(self, steps: list[Step]) -> dict[str, Vector]:
        """The twists' angular parts in world axes."""
        forward = turns(steps, self.geometry)
        moving = twists(steps, self.geometry).angular
        return {name: turned(forward, part, self.geometry.ring) for name, part in moving.items()}

    def gradient(self, value: Expansion) -> list[Expansion]:
        """Derivatives by the robot's coordinates."""
        return [value.derivative(index) for index in self._indices()]

    def _indices(self) -> list[int]:
        names = zip(self.robot.q_names, self.robot.q_units, strict=True)
        return [self.geometry.ring.variable(name, unit == "rad") for name, unit in names]

    def _once(self, key: Any, make: Callable[[], Any]) -> Any:
        if key not in self._made:
            self._made[key] = make()
        return self._made[key]

    def free_names(self, *names: str) -> list[str]:
        """The names, with a number behind them when one of them is taken."""
        taken = {*self.robot.q_names, *self.geometry.ring.names}
        for number in range(1, 100):
            found = [name if number == 1 else f"{name}{number}" for name in names]
            if not taken.intersection(found):
                return found
        raise AssertionError("a hundred auxiliary quantities")

    def auxiliary(self, *wanted: tuple[str, str, Sequence[Expansion]]) -> list[str]:
        """Symbols for quantities, each with the name that it has if that is free, its kind and arguments."""
        size, quantities = len(wanted), [(kind, tuple(arguments)) for _, kind, arguments in wanted]
        for i in range(len(self.auxiliaries) - size + 1):
            group = self.auxiliaries[i : i + size]
            if [one[1:] for one in group] == quantities:
                return [one.name for one in group]
        names = self.free_names(*(name for name, _, _ in wanted))
        for name, quantity in zip(names, quantities, strict=True):
            self.auxiliaries.append(Auxiliary(name, *quantity))
        return names

    def positive(self) -> set[int]:
        """Variables that are auxiliary lengths."""
        ring = self.geometry.ring
        kinds = {one.name: one.kind for one in self.auxiliaries}
        return {i for i, name in enumerate(ring.names) if kinds.get(name) in ("length", "root")}

    def angle(self, sine: Expansion, cosine: Expansion) -> Linear | None:
        """atan2 of both, where it is a combination of angles and a number of quarter turns."""
        ring, half = self.geometry.ring, Fraction(1, 2)
        size = cosine.split()[0] if cosine else ring.number(1)
        if size.variables() <= self.positive():
            above = size.inverse()
            above = above.scaled(Fraction(1 if above.at_sample() > 0.0 else -1))
            sine, cosine = sine * above, cosine * above
        turned_by = {(half, 0): 0, (0, half): 1, (-half, 0): 2, (0, -half): -1}
        if not len(cosine.terms) == len(sine.terms) == 2:
            return None
        for key, (re, im) in cosine.terms.items():
            whole = (re, im) in turned_by and all(ring.is_angle[i] for i, _ in key)
            if whole and sine.terms.get(key) == (im, -re):  # β = -i α
                constant = Fraction(turned_by[re, im] * math.pi / 2)
                return Linear(ring, {i: Fraction(n) for i, n in key}, constant)
        return None

    def matrix(self, product: tuple[Any, ...]) -> str:
        """A name for a rotation, by what it is the product of: R, R2, R3."""
        count = sum(isinstance(name, str) and name[0] == "R" for name in self._made.values()) + 1
        return str(self._once(("matrix", product), lambda: "R" if count == 1 else f"R{count}"))
