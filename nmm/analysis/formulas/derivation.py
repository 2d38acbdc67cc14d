"""From a robot and a task to the rows of f and the matrix of J u = rate, as trigonometric polynomials."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from nmm.analysis.formulas.expansion import Expansion, Ring, exact
from nmm.analysis.formulas.frames import Frames
from nmm.analysis.formulas.geometry import Geometry
from nmm.analysis.formulas.platform_columns import platform_columns
from nmm.analysis.formulas.quotient import common_multiple
from nmm.analysis.formulas.row_values import Auxiliary, Value, value_without
from nmm.analysis.formulas.task_rows import TracedRow, task_rows
from nmm.errors import InputError, expect_known
from nmm.functions.tasks.task import Stack
from nmm.robots.robot import Robot


@dataclass(frozen=True, eq=False)
class Derivation:
    """What the formulas are written from.

    Attributes
    ----------
    ring : the variables
    values : the rows of f (s)
    matrix : J's entries (s, m) times a denominator for each row and each column
    row_denominators, column_denominators : these
    auxiliaries : the symbols for quantities that would make the formulas long
    lengths : the robot's own values of lengths and fixed angles, by name
    target_moves : whether a target depends on q, so that the matrix is J_bar of eq. 13
    zero : lengths that were set to 0
    notes : what was rounded or summed up
    """

    ring: Ring
    values: tuple[Value, ...]
    matrix: tuple[tuple[Expansion, ...], ...]
    row_denominators: tuple[Expansion, ...]
    column_denominators: tuple[Expansion, ...]
    auxiliaries: tuple[Auxiliary, ...]
    lengths: Mapping[str, float]
    target_moves: bool = False
    zero: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    def without(self, names: Sequence[str]) -> Derivation:
        """The same with lengths set to 0.

        Raises
        ------
        InputError : a name that is no length, or a length that J is divided by
        """
        for name in names:
            expect_known("length", name, self.lengths)
            if self.ring.is_angle[self.ring.names.index(name)]:
                raise InputError(f"{name}: expected a length, it is an angle")
        gone = {self.ring.names.index(name) for name in names}
        self.ring.renewed()

        def less(entries: tuple[Expansion, ...]) -> tuple[Expansion, ...]:
            for entry in entries:
                if any(i in gone and n < 0 for key in entry.terms for i, n in key):
                    raise InputError(f"{', '.join(names)} = 0: J is divided by it")
            return tuple(entry.without(gone) for entry in entries)

        rows, columns = less(self.row_denominators), less(self.column_denominators)
        if not all(rows) or not all(columns):
            raise InputError(f"{', '.join(names)} = 0: J is divided by a quantity that is 0 then")
        return replace(
            self,
            values=tuple(value_without(value, gone) for value in self.values),
            matrix=tuple(less(row) for row in self.matrix),
            row_denominators=rows,
            column_denominators=columns,
            auxiliaries=tuple(one._replace(arguments=less(one.arguments)) for one in self.auxiliaries),
            lengths={name: value for name, value in self.lengths.items() if name not in names},
            zero=(*self.zero, *names),
        )


def derived(robot: Robot, stack: Stack, geometry: Geometry) -> Derivation:
    """The rows of f, and (∂f/∂q - ∂g/∂q) S."""
    frames = Frames(robot, geometry)
    frames.coordinates()
    rows = task_rows(stack, frames)
    G, columns = platform_columns(frames)
    one = geometry.ring.number(1)
    below = [_denominator(row, frames) for row in rows]
    return Derivation(
        ring=geometry.ring,
        values=tuple(row.value for row in rows),
        matrix=tuple(_times_S(numerators, G, frames) for numerators, _ in below),
        row_denominators=tuple(denominator for _, denominator in below),
        column_denominators=(*columns, *[one] * len(robot.arm_coordinates)),
        auxiliaries=tuple(frames.auxiliaries),
        lengths=geometry.values,
        target_moves=any(row.target_moves for row in rows),
        notes=tuple(dict.fromkeys([*geometry.notes, *map(str, robot.followers)])),
    )


def _denominator(row: TracedRow, frames: Frames) -> tuple[list[Expansion], Expansion]:
    """The gradient times a common denominator, and this; with auxiliary lengths, and all that may vanish."""
    under = common_multiple([entry.under for entry in row.gradient] + [*row.defined])
    above = [entry.above(under) for entry in row.gradient]
    powers = [dict(key) for entry in above for key in entry.terms]
    lacking = {i: max((-power.get(i, 0) for power in powers), default=0) for i in frames.positive()}
    key = tuple(sorted((i, n) for i, n in lacking.items() if n > 0))
    scalars = Expansion(under.ring, {key: (Fraction(1), Fraction(0))})
    return [entry * scalars for entry in above], under * scalars


def _times_S(row: Sequence[Expansion], G: list[list[Expansion]], frames: Frames) -> tuple[Expansion, ...]:
    """A row times S = blkdiag(G, C)."""
    robot, ring = frames.robot, frames.geometry.ring
    platform, gradient = robot.platform, list(row)
    for one in robot.followers:
        leader, follower = robot.coordinate(one.leader), robot.coordinate(one.joint)
        gradient[leader] = gradient[leader] + gradient[follower].scaled(exact(one.multiplier))
    moved = []
    for j in range(platform.p):
        total = ring.number(0)
        for i in range(platform.n_p):
            if G[i][j] and gradient[i]:
                total = total + gradient[i] * G[i][j]
        moved.append(total)
    return (*moved, *(gradient[i] for i in robot.arm_coordinates))
