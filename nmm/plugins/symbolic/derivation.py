"""From a robot and a task to the rows of f and the matrix of J u = rate, as trigonometric polynomials."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from nmm.base.errors import InputError, expect, expect_known
from nmm.base.findings import Finding
from nmm.control.functions.tasks.task import Stack
from nmm.model.platforms.base import Platform
from nmm.model.robots.robot import Robot
from nmm.plugins.symbolic.expansion import Expansion, Ring, exact
from nmm.plugins.symbolic.frames import SymbolicFrames
from nmm.plugins.symbolic.geometry import Geometry
from nmm.plugins.symbolic.quotient import Quotient, Untraceable, common_multiple, quotient
from nmm.plugins.symbolic.task_rows import TracedRow, task_rows
from nmm.plugins.symbolic.tracing import traced
from nmm.plugins.symbolic.written import Auxiliary, Value, value_without

#: Most digits of a number in G; more, as of roots, are not readable.
_READABLE = 20
#: G times one factor a column, and these factors.
Columns = tuple[list[list[Expansion]], list[Expansion]]


def platform_columns(frames: SymbolicFrames) -> Columns:
    """The rows of G (n_p, p), each column times a common denominator that may vanish, such as cos(steering),
    and these denominators (p); `InputError` says why a platform's kernel has no formula."""
    platform, ring = frames.robot.platform, frames.geometry.ring
    try:
        G = traced_G(platform, frames)[0]
        columns = [[quotient(entry, ring) for entry in column] for column in G.T]
        parts = [part for column in columns for entry in column for part in (entry.over, entry.under)]
        numbers = (number for part in parts for pair in part.terms.values() for number in pair)
        if any(len(str(number)) > _READABLE for number in numbers):
            raise Untraceable("its numbers have too many digits to be read")
    except (Untraceable, TypeError) as error:  # TypeError: of numbers alone
        problem = f"no formula for G of the platform {platform.name!r}: {error}"
        raise InputError(f"{problem} (the numeric analysis takes every platform)", where="symbolic") from None
    below = [common_multiple(entry.under for entry in column) for column in columns]
    above = [[entry.above(under) for entry in column] for column, under in zip(columns, below, strict=True)]
    return [[column[i] for column in above] for i in range(platform.n_p)], below


def traced_G(platform: Platform, frames: SymbolicFrames) -> tuple[np.ndarray, np.ndarray]:
    """G (n_p, p) and G_q (n_p, p, n_p) as the platform's kernel writes them; see `Platform.velocity_map`."""
    geometry, names = frames.geometry, platform.parameter_names
    parameters: list[object] = list(platform.parameters)
    if names:
        pairs = zip(platform.parameters, names, strict=True)
        parameters = [Quotient(geometry.length(float(value), name)) for value, name in pairs]
        geometry.notes += [
            Finding("length_symbol", {"name": name, "meaning": what})
            for name, what in names.items()
            if what and name in geometry.values
        ]
    n_p = platform.n_p
    qp = np.array(frames.coordinates()[:n_p], dtype=object)
    G = np.full((n_p, platform.p), 0.0, dtype=object)
    G_q = np.full((n_p, platform.p, n_p), 0.0, dtype=object)
    traced(platform.velocity_map, frames)(qp, np.array(parameters, dtype=object), G, G_q)
    return G, G_q


@dataclass(frozen=True, eq=False)
class Derivation:
    """What the formulas are written from: the rows of f (s), and J's entries (s, m) times a denominator for
    each row and column. `lengths` are the robot's own, with fixed angles; those in `zero` were set to 0. If
    `target_moves`, a target depends on q and the matrix is J_bar of eq. 13."""

    ring: Ring
    values: tuple[Value, ...]
    matrix: tuple[tuple[Expansion, ...], ...]
    row_denominators: tuple[Expansion, ...]
    column_denominators: tuple[Expansion, ...]
    auxiliaries: tuple[Auxiliary, ...]
    lengths: Mapping[str, float]
    target_moves: bool = False
    zero: tuple[str, ...] = ()
    notes: tuple[Finding, ...] = ()

    def without(self, names: Sequence[str]) -> Derivation:
        """The same with lengths set to 0; `InputError` for an unknown one or one that J is divided by."""
        for name in names:
            expect_known("length", name, self.lengths)
            is_angle = self.ring.is_angle[self.ring.names.index(name)]
            expect(not is_angle, name, "a length, it is an angle")
        gone = {self.ring.names.index(name) for name in names}
        self.ring.renewed()

        def less(entries: tuple[Expansion, ...]) -> tuple[Expansion, ...]:
            for entry in entries:
                if any(i in gone and n < 0 for key in entry.terms for i, n in key):
                    raise InputError("J is divided by it", where=f"{', '.join(names)} = 0")
            return tuple(entry.without(gone) for entry in entries)

        rows, columns = less(self.row_denominators), less(self.column_denominators)
        if not all(rows) or not all(columns):
            raise InputError("J is divided by a quantity that is 0 then", where=f"{', '.join(names)} = 0")
        return replace(
            self,
            values=tuple(value_without(value, gone) for value in self.values),
            matrix=tuple(less(row) for row in self.matrix),
            row_denominators=rows,
            column_denominators=columns,
            auxiliaries=tuple(aux._replace(arguments=less(aux.arguments)) for aux in self.auxiliaries),
            lengths={name: value for name, value in self.lengths.items() if name not in names},
            zero=(*self.zero, *names),
        )


def derived(robot: Robot, stack: Stack, geometry: Geometry) -> Derivation:
    """Derive the rows of f, and (∂f/∂q - ∂g/∂q) S."""
    frames = SymbolicFrames(robot, geometry)
    frames.coordinates()
    rows = task_rows(stack, frames)
    G, columns = platform_columns(frames)
    unit = geometry.ring.number(1)
    below = [_denominator(row, frames) for row in rows]
    notes = list(geometry.notes)
    for joint in robot.mimic_joints:
        names = ("joint", "leader", "multiplier", "offset")
        notes.append(Finding("mimic_joint", {name: getattr(joint, name) for name in names}))
    return Derivation(
        ring=geometry.ring,
        values=tuple(row.value for row in rows),
        matrix=tuple(_times_S(numerators, G, frames) for numerators, _ in below),
        row_denominators=tuple(denominator for _, denominator in below),
        column_denominators=(*columns, *[unit] * len(robot.arm_coordinates)),
        auxiliaries=tuple(frames.auxiliaries),
        lengths=geometry.values,
        target_moves=any(row.target_moves for row in rows),
        notes=tuple({str(note): note for note in notes}.values()),
    )


def _denominator(row: TracedRow, frames: SymbolicFrames) -> tuple[list[Expansion], Expansion]:
    """The gradient times a common denominator (all that may vanish, auxiliary lengths too), and this."""
    under = common_multiple([entry.under for entry in row.gradient] + [*row.defined])
    above = [entry.above(under) for entry in row.gradient]
    powers = [dict(key) for entry in above for key in entry.terms]
    lacking = {i: max((-power.get(i, 0) for power in powers), default=0) for i in frames.positive()}
    key = tuple(sorted((i, n) for i, n in lacking.items() if n > 0))
    scalars = Expansion(under.ring, {key: (Fraction(1), Fraction(0))})
    return [entry * scalars for entry in above], under * scalars


def _times_S(
    row: Sequence[Expansion], G: list[list[Expansion]], frames: SymbolicFrames
) -> tuple[Expansion, ...]:
    """A row times S = blkdiag(G, C)."""
    robot, ring = frames.robot, frames.geometry.ring
    platform, gradient = robot.platform, list(row)
    for mimic in robot.mimic_joints:
        leader, follower = robot.coordinate(mimic.leader), robot.coordinate(mimic.joint)
        gradient[leader] = gradient[leader] + gradient[follower].scaled(exact(mimic.multiplier))
    products = [
        [gradient[i] * G[i][j] for i in range(platform.n_p) if G[i][j] and gradient[i]]
        for j in range(platform.p)
    ]
    moved = (sum(column, ring.number(0)) for column in products)
    return (*moved, *(gradient[i] for i in robot.arm_coordinates))
