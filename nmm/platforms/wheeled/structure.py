"""Which wheels constrain a platform, which repeat others, and which inputs are left.

Decided once, at construction, at configurations that stand for all: rows count as dependent when they are so
at zero and at some angles picked at random.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from nmm.arrays import Array
from nmm.errors import InputError
from nmm.platforms.wheeled.descriptions import MAIN, FixedWheel, SteeredWheel, WheelDescription
from nmm.platforms.wheeled.geometry import Bodies
from nmm.platforms.wheeled.inputs import Input
from nmm.platforms.wheeled.read_inputs import Named, read
from nmm.platforms.wheeled.rows import Closure, Rate, Row, Velocity, axis_of

#: Rows are dependent when a unit combination of them is smaller: files give angles and lengths rounded.
DEPENDENT = 1e-4


@dataclass
class Constraint:
    """A no-slip row and the wheels for which it stands: those of one axle, say."""

    wheels: list[WheelDescription]
    row: Row

    @property
    def names(self) -> str:
        return ", ".join(wheel.name for wheel in self.wheels)


@dataclass
class Followed:
    """A steered wheel that two others leave one direction, with the row that keeps it there."""

    wheel: SteeredWheel
    others: tuple[Constraint, Constraint]
    row: Closure


@dataclass
class Structure:
    """The rows of M, as chosen by `choose`."""

    constraints: list[Constraint] = field(default_factory=list)
    followed: list[Followed] = field(default_factory=list)
    inputs: list[Named] = field(default_factory=list)
    mobility: int = 0

    @property
    def pfaffian(self) -> list[Row]:
        return [*(c.row for c in self.constraints), *(f.row for f in self.followed)]


class Chooser:
    """Makes the structure, step by step: fixed wheels, steered wheels, inputs."""

    def __init__(
        self, bodies: Bodies, wheels: Sequence[WheelDescription], inputs: Sequence[Input] | None
    ) -> None:
        self.bodies = bodies
        self.n = 2 + len(bodies.all)
        self.wheels = {wheel.name: wheel for wheel in wheels}
        self.asked = None if inputs is None else [read(given, bodies, self.wheels) for given in inputs]
        spread = [abs(complex(w.x, w.y)) for w in wheels] + [abs(body.place) for body in bodies.all]
        self.length = max(spread, default=0.0) or 1.0
        angles = np.random.default_rng(0).uniform(-1.0, 1.0, (4, self.n))
        self.samples = np.vstack([np.zeros(self.n), angles])
        centered = [w for w in wheels if isinstance(w, SteeredWheel) and w.centered]
        #: Rates of pivots without trail: inputs, unless others are asked for.
        self.held = [Rate(2 + bodies.number(joint)) for joint in dict.fromkeys(w.joint for w in centered)]
        #: How many coordinates the motion does not turn of itself.
        self.room = self.n - len(bodies.steering) + len(self.held)
        self.structure = Structure()

    def rank(self, rows: Sequence[Row], samples: Array | None = None) -> int:
        """The largest rank at the samples, with angles weighed by the platform's size."""
        if not rows:
            return 0
        ranks = []
        for qp in self.samples if samples is None else samples:
            M = np.array([row.at(self.bodies, qp) for row in rows])
            M[:, 2:] /= self.length
            M /= np.maximum(np.linalg.norm(M, axis=1, keepdims=True), 1e-12)
            ranks.append(int(np.linalg.matrix_rank(M, tol=DEPENDENT)))
        return max(ranks)

    def add_fixed(self) -> None:
        for wheel in self.wheels.values():
            if isinstance(wheel, FixedWheel):
                constraint = self._no_slip(wheel)
                if not self._repeats(constraint):
                    self.structure.constraints.append(constraint)

    def add_steered(self) -> None:
        """Those that take motions away; those that others leave one direction; those with a trail."""
        steered = [wheel for wheel in self.wheels.values() if isinstance(wheel, SteeredWheel)]
        pending = [wheel for wheel in steered if wheel.centered]
        # Wheels whose axes differ when all point ahead come first: their rows are regular there.
        for samples in (self.samples[:1], self.samples):
            for wheel in list(pending):
                constraint = self._no_slip(wheel)
                if self._repeats(constraint):
                    pending.remove(wheel)
                elif self._takes_a_motion(constraint.row, samples):
                    self.structure.constraints.append(constraint)
                    pending.remove(wheel)
        self.structure.followed += [self._follow(wheel) for wheel in pending]
        for wheel in steered:
            if not wheel.centered:
                self._let_swing(self._no_slip(wheel))

    def add_inputs(self) -> None:
        """Those asked for, or motions of the platform; then steering rates, while they are free."""
        followed = {2 + self.bodies.number(f.wheel.joint) for f in self.structure.followed}
        rates = [self._rate(row.coordinate) for row in self.held if row.coordinate not in followed]
        A = self.structure.pfaffian
        chosen: list[Named] = []
        if self.asked is not None:
            for named in self.asked:
                if not self._is_new(named[2], A, chosen):
                    raise InputError(
                        f"input {named[0]} says nothing new: the wheels "
                        f"{self._and_inputs(chosen)} determine it already"
                    )
                chosen.append(named)
            rates = [self._rate(k) for k in self.bodies.steering if k not in followed]
        else:
            fixed = [*A, *(row for _, _, row in rates)]
            for named in self._motions():
                if self._is_new(named[2], fixed, chosen):
                    chosen.append(named)
        for named in rates:
            if self._is_new(named[2], A, chosen):
                chosen.append(named)
        p = self.n - len(A)
        if len(chosen) != p:
            found = ", ".join(name for name, _, _ in chosen) or "nothing"
            raise InputError(
                f"inputs: the wheels leave {p} motions, {found} determine {len(chosen)} of them; add v, vx, "
                "vy, omega, a joint's rate, or a wheel's Speed or Spin"
            )
        self.structure.inputs = chosen
        self.structure.mobility = self.n - self.rank([*A, *self.held])

    def _no_slip(self, wheel: WheelDescription) -> Constraint:
        return Constraint([wheel], Velocity((self.bodies.contact(wheel, np.pi / 2),)))

    def _repeats(self, constraint: Constraint) -> bool:
        """Whether a wheel's row follows from the others'; it joins the one that it equals, if any."""
        rows = self.structure.pfaffian
        if self.rank([*rows, constraint.row]) > self.rank(rows):
            return False
        for other in self.structure.constraints:
            if self.rank([other.row, constraint.row]) == 1:
                other.wheels += constraint.wheels
        return True

    def _takes_a_motion(self, row: Row, samples: Array) -> bool:
        """Whether the row leaves the inputs asked for independent or, without, a motion besides steering."""
        kept: list[Row] = [*self.structure.pfaffian]
        kept += self.held if self.asked is None else [named[2] for named in self.asked]
        before = self.rank(kept, samples)
        room = self.asked is not None or before + 1 < self.room
        return room and self.rank([*kept, row], samples) > before

    def _let_swing(self, constraint: Constraint) -> None:
        """The motion turns a wheel with a trail, unless its rate was asked for as an input."""
        kept: list[Row] = [*self.structure.pfaffian]
        kept += self.held if self.asked is None else [named[2] for named in self.asked]
        if self._repeats(constraint):
            return
        if self.rank([*kept, constraint.row]) == self.rank(kept):
            raise self._no_room(constraint.wheels[0])
        self.structure.constraints.append(constraint)

    def _no_room(self, wheel: WheelDescription) -> InputError:
        names = ", ".join(name for name, _, _ in self.asked or ())
        return InputError(
            f"wheel {wheel.name} does not let the inputs {names or 'of steering'} be chosen freely"
        )

    def _follow(self, wheel: SteeredWheel) -> Followed:
        """The row that keeps the wheel's axis through the point where two others of its carrier meet."""
        others = [c for c in self.structure.constraints if c.wheels[0].body == wheel.body]
        others = [c for c in others if getattr(c.wheels[0], "joint", None) != wheel.joint]
        pairs = [(a, b) for i, a in enumerate(others) for b in others[i + 1 :]]
        for samples in (self.samples[:1], self.samples):
            for a, b in pairs:
                axes = [axis_of(self.bodies, c.wheels[0]) for c in (a, b)]
                lines = [[axis.line(qp) / (1, 1, self.length) for axis in axes] for qp in samples]
                if max(np.linalg.matrix_rank(pair, tol=DEPENDENT) for pair in np.array(lines)) == 2:
                    third = axis_of(self.bodies, wheel)
                    return Followed(wheel, (a, b), Closure((axes[0], axes[1], third), self.length))
        if self.asked is not None:
            raise self._no_room(wheel)
        raise InputError(
            f"wheel {wheel.name}: the other wheels leave one motion, and no two of them are on {wheel.body}, "
            "so where its axis must go is not known; describe the axle by one wheel in its middle"
        )

    def _rate(self, coordinate: int) -> Named:
        return f"{self.bodies.names[coordinate - 2]}_rate", "rad/s", Rate(coordinate)

    def _motions(self) -> list[Named]:
        """Inputs in the order in which they are tried."""
        standing = [w for c in self.structure.constraints for w in c.wheels[:1] if w.body == MAIN]
        standing = [w for w in standing if not isinstance(w, SteeredWheel) or w.centered]
        names = ["v", "omega", "vx", "vy"] if standing else ["vx", "vy", "omega"]
        names += [f"{body.name}_rate" for body in self.bodies.all[1:] if not body.steers]
        found = [read(name, self.bodies, self.wheels) for name in names]
        fixed = [axis_of(self.bodies, w) for w in standing if isinstance(w, FixedWheel)]
        lines = [axis.line(np.zeros(self.n)) for axis in fixed]
        turns_only = len(lines) == 2 and abs(np.cross(lines[0], lines[1])[2]) > DEPENDENT
        return [found[1], found[0], *found[2:]] if turns_only else found

    def _is_new(self, row: Row, rows: Sequence[Row], chosen: Sequence[Named]) -> bool:
        before = [*rows, *(named[2] for named in chosen)]
        return self.rank([*before, row]) > self.rank(before)

    def _and_inputs(self, chosen: Sequence[Named]) -> str:
        return f"and {', '.join(named[0] for named in chosen)}" if chosen else "alone"


def choose(bodies: Bodies, wheels: Sequence[WheelDescription], inputs: Sequence[Input] | None) -> Structure:
    """The rows of M for these wheels and inputs; `InputError` where they do not fit."""
    chooser = Chooser(bodies, wheels, inputs)
    chooser.add_fixed()
    chooser.add_steered()
    chooser.add_inputs()
    return chooser.structure
