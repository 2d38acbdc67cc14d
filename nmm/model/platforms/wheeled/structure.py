"""Which wheels constrain a platform or repeat others, which inputs are left, why wheels cannot roll.

Decided at construction: rows count as dependent if they are at zero and at some random angles."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from nmm.base.arrays import Array
from nmm.base.errors import InputError
from nmm.base.text_format import apart, listed
from nmm.model.platforms.wheeled.descriptions import MAIN, FixedWheel, SteeredWheel, WheelDescription
from nmm.model.platforms.wheeled.geometry import Bodies, Closure, Rate, Row, Velocity, axis_of
from nmm.model.platforms.wheeled.inputs import Input, Named, read
from nmm.model.platforms.wheeled.kernel import CONTRADICTION

#: Rows are dependent when a unit combination of them is smaller: files give angles and lengths rounded.
DEPENDENT = 1e-4
#: Beyond its limit a hitch is folded by more than this, rad.
_SLACK = 1e-9


@dataclass
class Constraint:
    """A no-slip row and the wheels that it represents, such as those of one axle."""

    wheels: list[WheelDescription]
    row: Row

    @property
    def names(self) -> str:
        return ", ".join(wheel.name for wheel in self.wheels)


@dataclass
class AlignedWheel:
    """A steered wheel that two others leave one direction, with the row that keeps it there."""

    wheel: SteeredWheel
    others: tuple[Constraint, Constraint]
    row: Closure


class Structure:
    """The rows of M: no slip of `constraints`, then what `followed` wheels keep, then `inputs`; `InputError`
    for wheels or inputs that do not fit."""

    def __init__(
        self, bodies: Bodies, wheels: Sequence[WheelDescription], inputs: Sequence[Input] | None
    ) -> None:
        self.bodies = bodies
        self.constraints: list[Constraint] = []
        self.followed: list[AlignedWheel] = []
        self._n = 2 + len(bodies.all)
        self._wheels = {wheel.name: wheel for wheel in wheels}
        self._asked = (
            None if inputs is None else [read(requested, bodies, self._wheels) for requested in inputs]
        )
        spread = [abs(complex(w.x, w.y)) for w in wheels] + [abs(body.place) for body in bodies.all]
        self._length = max(spread, default=0.0) or 1.0
        angles = np.random.default_rng(0).uniform(-1.0, 1.0, (4, self._n))
        self._samples = np.vstack([np.zeros(self._n), angles])
        steered = [wheel for wheel in wheels if isinstance(wheel, SteeredWheel)]
        joints = dict.fromkeys(wheel.joint for wheel in steered if wheel.centered)
        #: Rates of pivots without trail: inputs, unless others are asked for.
        self._held = [Rate(2 + bodies.number(joint)) for joint in joints]
        for wheel in wheels:
            if isinstance(wheel, FixedWheel) and not self._repeats(constraint := self._no_slip(wheel)):
                self.constraints.append(constraint)
        self._add_steered(steered)
        self.inputs = self._chosen_inputs()
        self.mobility = self._n - self._rank([*self.pfaffian, *self._held])

    @property
    def pfaffian(self) -> list[Row]:
        return [*(c.row for c in self.constraints), *(f.row for f in self.followed)]

    def contradiction(self, qp: Array) -> str | None:
        """The first wheel that would have to slip, with those whose axes do not meet on its own."""
        for followed in self.followed:
            share = followed.row.share(qp)
            if share > CONTRADICTION:
                wheels = [*_wheels(followed.others), followed.wheel]
                return (
                    f"the axes of wheels {_listed(wheels)} do not meet in one point: {followed.wheel.name} "
                    f"would slip sideways at {share:.3g} of the platform's speed{self._angles(wheels, qp)}"
                )
        return None

    def folded(self, qp: Array) -> str | None:
        """The first hitch beyond its limits."""
        for angle, body in zip(qp[3:], self.bodies.all[1:], strict=True):
            if not body.steers and not body.lower - _SLACK <= angle <= body.upper + _SLACK:
                folded, lower, upper = apart(*np.degrees([angle, body.lower, body.upper]).tolist())
                return f"{body.name} is folded to {folded} deg, beyond its limits {lower} and {upper}"
        return None

    def singularity(self, qp: Array) -> str:
        """Which wheels and inputs depend on each other where M(qp) is singular."""
        count = len(self.constraints)
        wheels_only = self._dependent([c.row for c in self.constraints], qp)
        if wheels_only:
            wheels = _wheels(self.constraints[k] for k in wheels_only)
            return (
                f"the no-slip conditions of wheels {_listed(wheels)} are not independent here (their "
                f"axes coincide or meet): the platform gains a motion{self._angles(wheels, qp)}"
            )
        A = self.pfaffian
        dependent = self._dependent([*A, *(row for _, _, row in self.inputs)], qp)
        wheels = _wheels(self.constraints[k] for k in dependent if k < count)
        wheels += [self.followed[k - count].wheel for k in dependent if count <= k < len(A)]
        chosen = [self.inputs[k - len(A)][0] for k in dependent if k >= len(A)]
        names = " and ".join(chosen) or "the inputs"
        verb = "do" if len(chosen) != 1 else "does"
        where = f", because of {_listed(wheels)}{self._angles(wheels, qp)}" if wheels else ""
        return f"here {names} {verb} not determine the motion{where}"

    def _dependent(self, rows: Sequence[Row], qp: Array) -> list[int]:
        """The rows in the combination that is closest to zero, when it is zero."""
        if not rows:
            return []
        values = [row.at(self.bodies, qp) for row in rows]
        left, sizes, _ = np.linalg.svd(np.array([row / (np.linalg.norm(row) or 1.0) for row in values]))
        if len(sizes) == len(rows) and sizes[-1] > 1e-7:
            return []
        return [k for k, share in enumerate(left[:, -1]) if abs(share) > 1e-4]

    def _angles(self, wheels: Sequence[WheelDescription], qp: Array) -> str:
        joints = dict.fromkeys(wheel.joint for wheel in wheels if isinstance(wheel, SteeredWheel))
        at = {joint: math.degrees(qp[2 + self.bodies.number(joint)]) for joint in joints}
        degrees = ", ".join(f"{joint} = {angle:.6g} deg" for joint, angle in at.items())
        return f" ({degrees})" if degrees else ""

    def _rank(self, rows: Sequence[Row], samples: Array | None = None) -> int:
        """The largest rank at the samples, with angles weighed by the platform's size."""
        if not rows:
            return 0
        ranks = []
        for qp in self._samples if samples is None else samples:
            M = np.array([row.at(self.bodies, qp) for row in rows])
            M[:, 2:] /= self._length
            M /= np.maximum(np.linalg.norm(M, axis=1, keepdims=True), 1e-12)
            ranks.append(int(np.linalg.matrix_rank(M, tol=DEPENDENT)))
        return max(ranks)

    def _is_new(self, row: Row, *rows: Row, samples: Array | None = None) -> bool:
        """Whether a row is independent of the others."""
        return self._rank([*rows, row], samples) > self._rank(rows, samples)

    def _no_slip(self, wheel: WheelDescription) -> Constraint:
        return Constraint([wheel], Velocity((self.bodies.contact(wheel, np.pi / 2),)))

    def _repeats(self, constraint: Constraint) -> bool:
        """Whether a wheel's row follows from the others'; it joins the one that it equals, if any."""
        if self._is_new(constraint.row, *self.pfaffian):
            return False
        for other in self.constraints:
            if self._rank([other.row, constraint.row]) == 1:
                other.wheels += constraint.wheels
        return True

    def _add_steered(self, steered: Sequence[SteeredWheel]) -> None:
        """Those that take motions away; those that others leave one direction; those with a trail."""
        pending = [wheel for wheel in steered if wheel.centered]
        # Wheels whose axes differ when all point ahead come first: their rows are regular there.
        for samples in (self._samples[:1], self._samples):
            for wheel in list(pending):
                constraint = self._no_slip(wheel)
                if self._repeats(constraint):
                    pending.remove(wheel)
                elif self._takes_a_motion(constraint.row, samples):
                    self.constraints.append(constraint)
                    pending.remove(wheel)
        # Of wheels on one pivot, whose axes are one, the last.
        self.followed += [self._follow(wheel) for wheel in {wheel.joint: wheel for wheel in pending}.values()]
        for wheel in steered:
            # The motion turns a wheel with a trail, unless its rate was asked for as an input.
            if not wheel.centered and not self._repeats(constraint := self._no_slip(wheel)):
                if not self._is_new(constraint.row, *self._kept):
                    raise self._no_room(wheel)
                self.constraints.append(constraint)

    @property
    def _kept(self) -> list[Row]:
        """What a steered wheel has to leave: the rows so far, and the inputs asked for or the steering."""
        asked = self._held if self._asked is None else [row for _, _, row in self._asked]
        return [*self.pfaffian, *asked]

    def _takes_a_motion(self, row: Row, samples: Array) -> bool:
        """Whether the row leaves requested inputs independent; without such, a motion besides steering."""
        rows = self._kept
        # Coordinates that the motion does not turn of itself.
        free = self._n - len(self.bodies.steering) + len(self._held)
        room = self._asked is not None or self._rank(rows, samples) + 1 < free
        return room and self._is_new(row, *rows, samples=samples)

    def _no_room(self, wheel: WheelDescription) -> InputError:
        names = ", ".join(name for name, _, _ in self._asked or ()) or "of steering"
        return InputError(f"does not let the inputs {names} be chosen freely", where=f"wheel {wheel.name}")

    def _follow(self, wheel: SteeredWheel) -> AlignedWheel:
        """The row that keeps the wheel's axis through the point where two others of its carrier meet."""
        others = [c for c in self.constraints if c.wheels[0].body == wheel.body]
        others = [c for c in others if getattr(c.wheels[0], "joint", None) != wheel.joint]
        pairs = [(a, b) for i, a in enumerate(others) for b in others[i + 1 :]]
        for samples in (self._samples[:1], self._samples):
            for a, b in pairs:
                axes = [axis_of(self.bodies, c.wheels[0]) for c in (a, b)]
                lines = [[axis.line(qp) / (1, 1, self._length) for axis in axes] for qp in samples]
                if max(np.linalg.matrix_rank(pair, tol=DEPENDENT) for pair in np.array(lines)) == 2:
                    third = axis_of(self.bodies, wheel)
                    return AlignedWheel(wheel, (a, b), Closure((axes[0], axes[1], third), self._length))
        if self._asked is not None:
            raise self._no_room(wheel)
        what = f"the others leave one motion, and no two of them are on {wheel.body}"
        what += ": its axis is not determined"
        expected = "one wheel in the middle of the axle"
        raise InputError(what, where=f"wheel {wheel.name}", expected=expected)

    def _chosen_inputs(self) -> list[Named]:
        """The inputs asked for, or motions of the platform; then steering rates, while they are free."""
        followed = {2 + self.bodies.number(f.wheel.joint) for f in self.followed}
        steering = [row.coordinate for row in self._held] if self._asked is None else self.bodies.steering
        rates = [self._rate(k) for k in steering if k not in followed]
        A = self.pfaffian
        chosen: list[Named] = []

        def is_new(named: Named, *others: Named) -> bool:
            return self._is_new(named[2], *A, *(row for _, _, row in (*others, *chosen)))

        for named in self._asked or ():
            if not is_new(named):
                earlier = ["the wheels", *(name for name, _, _ in chosen)]
                raise InputError(f"determined by {listed(earlier)} already", where=f"input {named[0]}")
            chosen.append(named)
        for named in self._motions() if self._asked is None else ():
            if is_new(named, *rates):
                chosen.append(named)
        for named in rates:
            if is_new(named):
                chosen.append(named)
        p = self._n - len(A)
        if len(chosen) != p:
            kinds = "v, vx, vy, omega, a joint's rate, a WheelSpeed or WheelSpin"
            expected = f"{p} of them, as many as the motions that the wheels leave: {kinds}"
            raise InputError(where="inputs", expected=expected, got=tuple(name for name, _, _ in chosen))
        return chosen

    def _rate(self, coordinate: int) -> Named:
        return f"{self.bodies.names[coordinate - 2]}_rate", "rad/s", Rate(coordinate)

    def _motions(self) -> list[Named]:
        """Inputs in the order in which they are tried."""
        standing = [w for c in self.constraints for w in c.wheels[:1] if w.body == MAIN]
        standing = [w for w in standing if not isinstance(w, SteeredWheel) or w.centered]
        names = ["v", "omega", "vx", "vy"] if standing else ["vx", "vy", "omega"]
        names += [f"{body.name}_rate" for body in self.bodies.all[1:] if not body.steers]
        inputs = [read(name, self.bodies, self._wheels) for name in names]
        fixed = [axis_of(self.bodies, w) for w in standing if isinstance(w, FixedWheel)]
        lines = [axis.line(np.zeros(self._n)) for axis in fixed]
        turns_only = len(lines) == 2 and abs(np.cross(lines[0], lines[1])[2]) > DEPENDENT
        return [inputs[1], inputs[0], *inputs[2:]] if turns_only else inputs


def _wheels(constraints: Iterable[Constraint]) -> list[WheelDescription]:
    return [wheel for constraint in constraints for wheel in constraint.wheels]


def _listed(wheels: Sequence[WheelDescription]) -> str:
    return listed([wheel.name for wheel in wheels])
