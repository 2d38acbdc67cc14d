"""A recorded quantity component by component: names, what people call them, units."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from nmm.base.arrays import Array
from nmm.control.step.quantities import RecordedQuantity
from nmm.model.robots.robot import Robot
from nmm.motion.trajectory import Trajectory


class Component(NamedTuple):
    """A component over time: its column in trajectory.csv, legend entry, unit and values (N,)."""

    column: str
    text: str
    unit: str
    values: Array


class Axes(NamedTuple):
    """Names along recorded quantities' axes: the task's rows (s,), priority levels, limits (L,)."""

    robot: Robot
    r_names: tuple[str, ...]
    r_units: tuple[str, ...]
    levels: int
    limits: tuple[str, ...] = ()

    def names(self, letter: str) -> tuple[str, ...]:
        """Along the axis of that letter (`RecordedQuantity.shape`)."""
        return {
            "n": self.robot.q_names,
            "m": self.robot.u_names,
            "s": self.r_names,
            "l": tuple(map(str, range(self.levels))),
            "L": self.limits,
        }[letter]

    def labels(self, one: RecordedQuantity) -> list[tuple[str, str, str]]:
        units = {"rows": self.r_units, "inputs": self.robot.u_units, "coordinates": self.robot.q_units}
        text = (one.curve.text if one.curve else "") or one.symbol
        column = one.column or one.name
        if len(one.shape) == 1:
            together = units.get(one.unit)
            return [(column, text, one.unit if together is None else ", ".join(dict.fromkeys(together)))]
        letter = one.shape[1]
        names = self.names(letter)
        each = units.get(one.unit, (one.unit,) * len(names))
        # Whole numbers of a row say nothing of the row: RG's columns are a set.
        columns = tuple(map(str, range(len(names)))) if one.whole else names
        pattern = column if "{}" in column else column + "_{}"
        texts = {
            "s": [f"{text} of {name}" for name in names],
            "l": [text] if len(names) == 1 else [f"{text} of level {i + 1}" for i in range(len(names))],
        }.get(letter, list(names))
        return [(pattern.format(c), t, u) for c, t, u in zip(columns, texts, each, strict=True)]


def components(run: Trajectory, one: RecordedQuantity) -> Iterator[Component]:
    values = run[one.name]
    axes = Axes(run.robot, run.r_names, run.r_units, run.scale.shape[1], run.limit_names)
    columns = values[:, None] if values.ndim == 1 else values
    for (column, text, unit), x in zip(axes.labels(one), columns.T, strict=True):
        yield Component(column, text, unit, x)
