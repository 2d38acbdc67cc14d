"""Differentiable functions of time and configuration, phi(t, q): what tasks, references and
objectives are made of.

A task's f(q), a reference's g(t, q) and an objective's H(q) are one kind of thing: a vector, its
partial derivative in time and its Jacobian in the coordinates. Each says which rows it has and
which kernels compute them; how they are run is `program.py`'s business.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from nmm.arrays import Array
from nmm.functions.live import LiveNumbers
from nmm.kernels.compiled import Kernel
from nmm.robots.configuration import Configuration
from nmm.robots.robot import Robot


class Row(NamedTuple):
    """One component of a function.

    Attributes
    ----------
    name, unit : for people, and to tell metres from radians
    angular : whether it is an angle whose differences wrap
    scale : its natural size in its unit, against which ranks are judged; None for the robot's reach in
        metres, and 1 in any other unit

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> [(row.name, row.unit) for row in nmm.Position("ee", "xy").rows(robot)]
    [('ee.x', 'm'), ('ee.y', 'm')]
    """

    name: str
    unit: str
    angular: bool = False
    scale: float | None = None


def natural_size(unit: str, robot: Robot) -> float:
    """What counts as 1 of a unit on a robot: its reach for metres, 1 of anything else."""
    return robot.reach if unit == "m" else 1.0


def row_scales(rows: Sequence[Row], robot: Robot) -> Array:
    """The natural size of each row in its unit, (s,): what a lost rank is measured by."""
    return np.array([natural_size(row.unit, robot) if row.scale is None else row.scale for row in rows])


class Evaluation(NamedTuple):
    """A function's value (s,), its partial time derivative (s,) and its Jacobian (s, n) in q.

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> here = nmm.Configuration(robot, robot.q({"q2": 0.5}))
    >>> found = nmm.evaluate(nmm.Position("ee", "xy"), 0.0, here)
    >>> isinstance(found, nmm.Evaluation), found.value.shape, found.value_q.shape
    (True, (2,), (2, 5))
    """

    value: Array
    value_t: Array
    value_q: Array


Callback = Callable[[float, Configuration], Evaluation]


@dataclass(frozen=True, eq=False)
class Stage:
    """A kernel with what it reads. The stages of a function run in order on the same rows.

    Attributes
    ----------
    kernel : of signature `records.FUNCTION`
    rows : how many rows it reads or writes
    before : how many of the rows that come before the function's own it sees too, above them
    frames : names of the frames whose placement and Jacobian it reads
    numbers : the numbers that it reads
    hessians : whether it reads the frames' kinematic Hessians
    callback : a user's Python function, run before the kernels; its results are the numbers
    live : what sets the numbers from outside, between two steps

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> (stage,) = nmm.Position("ee", "xy").stages(robot)
    >>> isinstance(stage, nmm.Stage), stage.rows, stage.frames
    (True, 2, ('ee',))
    """

    kernel: Kernel
    rows: int
    frames: tuple[str, ...] = ()
    numbers: Array = field(default_factory=lambda: np.zeros(0))
    hessians: bool = False
    callback: Callback | None = None
    before: int = 0
    live: LiveNumbers | None = None


class Shown(NamedTuple):
    """What a function is about, for those who draw a run.

    Attributes
    ----------
    positions : the frame whose origin it puts somewhere in the world
    axes : the world axes ("x", "y", "z") along which it does, each with the row that holds it, in m
    turns : the frame that it turns
    looks_at : the fixed point that it looks at, (2,) or (3,), m, world axes

    Examples
    --------
    >>> shown = nmm.Position("ee", "xy").shown()
    >>> isinstance(shown, nmm.Shown), shown.positions, dict(shown.axes)
    (True, 'ee', {'x': 0, 'y': 1})
    """

    positions: str | None = None
    axes: Mapping[str, int] = MappingProxyType({})
    turns: str | None = None
    looks_at: Array | None = None


class Function(ABC):
    """phi(t, q). To add one, write in a file of its own a kernel and a subclass that implements:

    1. `rows(robot)`: names, units and angularity of the components; raises `InputError` for
       what the robot does not have;
    2. `stages(robot)`: the kernels that compute value, time derivative and Jacobian.

    Where it moves a frame or looks at a point, `shown()` says so, for figures and playback.

    `comparison` is for values that cannot be subtracted (orientations, poses): a kernel of signature
    `records.FUNCTION` that sees the rows [value, target, error], s of each, with their derivatives, and
    writes those of the error. Without it the error is target - value, wrapped where a row is an angle.

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> heading = nmm.Heading("ee")
    >>> isinstance(heading, nmm.Function), heading.rows(robot)[0].unit
    (True, 'rad')
    """

    comparison: Kernel | None = None

    @abstractmethod
    def rows(self, robot: Robot) -> tuple[Row, ...]:
        """The components, in order."""

    @abstractmethod
    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        """The kernels that compute them, in order."""

    def shown(self) -> Shown:
        """What figures and playback draw of it; nothing unless it says so."""
        return Shown()
