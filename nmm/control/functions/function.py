"""Differentiable functions φ(t, q): f(q) of a task, g(t, q) of a reference, H(q) of an objective."""

from __future__ import annotations

import math
import weakref
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from threading import Lock
from types import MappingProxyType
from typing import ClassVar, NamedTuple

import numpy as np

from nmm.base.arrays import Array
from nmm.base.errors import expect
from nmm.base.findings import Finding
from nmm.base.kernels.compiled import Kernel, clear, kernel
from nmm.base.kernels.linear_algebra import copied
from nmm.base.kernels.records import FUNCTION, At, Frames, Rows
from nmm.model.robots.configuration import Configuration
from nmm.model.robots.motion import NORMALISED
from nmm.model.robots.robot import Robot


class Row(NamedTuple):
    """One component of a function.

    Attributes
    ----------
    name, unit : "ee.x", "m"
    angular : whether it is an angle whose differences wrap
    scale : its natural size in its unit, by which a loss of rank is judged; None for the robot's reach in m,
        and 1 in any other unit

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
    """The natural size of a unit on a robot: its reach for m, 1 for any other."""
    return robot.reach if unit == "m" else 1.0


def named(rows: Sequence[Row]) -> list[str]:
    return [f"{row.name} ({row.unit})" for row in rows]


def row_scales(rows: Sequence[Row], robot: Robot) -> Array:
    """The natural size of each row in its unit, (s,), by which a loss of rank is judged."""
    return np.array([natural_size(row.unit, robot) if row.scale is None else row.scale for row in rows])


class Evaluation(NamedTuple):
    """A function's value (s,), its partial time derivative (s,) and its Jacobian (s, n) in q.

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> here = nmm.Configuration(robot, robot.q({"q2": 0.5}))
    >>> found = nmm.evaluate(nmm.Position("ee", "xy"), 0.0, here)
    >>> isinstance(found, nmm.extending.Evaluation), found.value.shape, found.value_q.shape
    (True, (2,), (2, 5))
    """

    value: Array
    value_t: Array
    value_q: Array


Callback = Callable[[float, Configuration], Evaluation]


class LiveNumbers:
    """Numbers of a stage that are set from outside: `set` writes them wherever compiled code reads them.
    Readers are held by weak references; copies and pickles have the numbers, not the readers.

    Attributes
    ----------
    numbers : their present values; replaced as a whole, never written into

    Examples
    --------
    >>> live, read = nmm.extending.LiveNumbers(np.array([1.0, 2.0])), np.zeros(2)
    >>> live.read_by(read)
    >>> live.set(np.array([3.0, 4.0]))
    >>> read
    array([3., 4.])
    """

    def __init__(self, numbers: Array) -> None:
        self.numbers = numbers
        self._readers: list[weakref.ref[Array]] = []
        self._lock = Lock()

    def read_by(self, block: Array) -> None:
        """Write them to `block` now and whenever they are set, as long as something else holds it."""
        with self._lock:
            self._readers = [reader for reader in self._readers if reader() is not None]
            self._readers.append(weakref.ref(block))
            block[:] = self.numbers

    def set(self, numbers: Array) -> None:
        """As many other numbers, for every program from its next step on."""
        with self._lock:
            self.numbers = numbers
            for reader in self._readers:
                block = reader()
                if block is not None:
                    block[:] = numbers  # at once: numpy holds the interpreter's lock meanwhile

    def __reduce__(self) -> tuple[object, ...]:
        return LiveNumbers, (self.numbers.copy(),)


class Renewal(LiveNumbers, ABC):
    """A stage's parameters that are updated at samples of a run (by a camera, by replanning).

    `events` are those of the run: t, s; the task's name; what happened; why.
    """

    events: list[tuple[float, str, str, str]]
    #: Whether values jump where the numbers change, as measured ones do.
    jumps: ClassVar[bool] = False

    @property
    def due(self) -> float:
        """A time, s, before which no others are needed; infinite where only `stays` says."""
        return math.inf

    @abstractmethod
    def begin(self) -> None:
        """A run begins: the numbers are the first ones."""

    @abstractmethod
    def stays(self, times: Array, q: Array) -> int:
        """How many samples at times (N,), s, and q (N, n), in order, need no others."""

    @abstractmethod
    def renew(self, t: float, q: Array, real: Array | None = None) -> None:
        """Make others for a sample at t, s, and q (n,), where it needs them; real (n,) : where the robot is,
        if that is not what the controller sees."""

    @abstractmethod
    def planned(self, t: Array) -> Array | None:
        """As of a function, with what took the place of what."""

    def left(self, t: float, q: Array, roughly: bool = False) -> tuple[float, float] | None:
        """As of a function."""
        return None

    @abstractmethod
    def noticed(self, end: float) -> Iterable[Finding]:
        """What happened in a run that ended at a time, s."""


@dataclass(frozen=True, eq=False)
class Stage:
    """A kernel with what it reads. The stages of a function run in order on the same rows.

    Attributes
    ----------
    kernel : of signature `records.FUNCTION`
    rows : how many rows it reads or writes
    before : how many rows before the function's own it reads too
    frames : names of the frames whose placement and Jacobian it reads
    numbers : the numbers that it reads
    hessians : whether it reads the frames' kinematic Hessians
    callback : a user's Python function, run before the kernels; its results are the numbers
    live : sets the numbers from outside, between two steps, or as a run goes on
    remembers : whether the kernel writes its numbers: a memory from sample to sample, which is kept and put
        back with all else that a sample changes. The first is 1 where none may change, between two samples

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> (stage,) = nmm.Position("ee", "xy").stages(robot)
    >>> isinstance(stage, nmm.extending.Stage), stage.rows, stage.frames
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
    remembers: bool = False


class Sight(NamedTuple):
    """What a function sees of points.

    Attributes
    ----------
    camera : the camera's frame (z ahead, x right, y down); "" for the only one that is called optical
    points : what it sees, each with three rows, m, world axes
    rows : the rows of x and y of each point in the picture; () where the function has none
    intrinsics : fx, fy, cx, cy of these rows, px; 1, 1, 0, 0 for normalised coordinates
    line : whether it is the line through its points that is seen
    of_others : makes the same function of as many other points, for a page on which points are dragged

    Examples
    --------
    >>> sight = nmm.ImagePoints([[2.0, 0.5, 0.6]]).shown().sees
    >>> isinstance(sight, nmm.extending.Sight), len(sight.points), sight.rows
    (True, 1, ((0, 1),))
    """

    camera: str
    points: tuple[Function, ...]
    rows: tuple[tuple[int, int], ...] = ()
    intrinsics: tuple[float, float, float, float] = NORMALISED
    line: bool = False
    of_others: Callable[[tuple[Function, ...]], Function] | None = None


class Shown(NamedTuple):
    """What figures and playback draw of a function.

    Attributes
    ----------
    positions : the frame whose origin it positions in the world
    axes : the world axes ("x", "y", "z") of that position, each with its row, m
    turns : the frame that it turns
    rotation : the rows of that frame's rotation vector in the world, rad; () where it has not all three
    looks_at : the fixed point that it looks at, (2,) or (3,), m, world axes
    sees : what a camera sees of points

    Examples
    --------
    >>> shown = nmm.Position("ee", "xy").shown()
    >>> isinstance(shown, nmm.extending.Shown), shown.positions, dict(shown.axes)
    (True, 'ee', {'x': 0, 'y': 1})
    """

    positions: str | None = None
    axes: Mapping[str, int] = MappingProxyType({})
    turns: str | None = None
    rotation: tuple[int, ...] = ()
    looks_at: Array | None = None
    sees: Sight | None = None


class Function(ABC):
    """φ(t, q). A new function is a kernel and a subclass with two methods: `rows(robot)` returns the
    components' names and units, and raises `InputError` for what the robot lacks; `stages(robot)` returns the
    kernels that compute value, time derivative and Jacobian. One that moves a frame, or looks at or sees
    points, overrides `shown()`, one whose values deserve a warning `noticed()`, one without a value somewhere
    `undefined()`.

    `comparison` is for values that cannot be subtracted (orientations, poses): a kernel of signature
    `records.FUNCTION` that reads the rows [value, target, error], s of each, and writes the error and its
    derivatives. Without it the error is target - value, wrapped where a row is an angle.

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> heading = nmm.Heading("ee")
    >>> isinstance(heading, nmm.extending.Function), heading.rows(robot)[0].unit
    (True, 'rad')
    """

    comparison: Kernel | None = None
    #: Whether limits cut each of its rows by itself, where others are cut by one share, which keeps
    #: directions.
    separate: ClassVar[bool] = False
    #: Pairs, by name, that it leads nearer to each other than a controller keeps others, and how near, m.
    nearer: Mapping[tuple[str, str], float] = MappingProxyType({})

    @abstractmethod
    def rows(self, robot: Robot) -> tuple[Row, ...]:
        """The components, in order."""

    @abstractmethod
    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        """The kernels that compute them, in order."""

    def shown(self) -> Shown:
        """What figures and playback draw of it; nothing by default."""
        return Shown()

    def undefined(self, robot: Robot, t: float, q: Array) -> str:
        """Why it has no value at t (s) and q (n,), for people; empty where that is not known."""
        return ""

    def planned(self, t: Array) -> Array | None:
        """The configurations (N, n) of the plan that it follows, at times (N,), s; None for most."""
        return None

    def dependence(self, configuration: Configuration) -> Array | None:
        """Rows (r, n) that are not 0 where it changes with a coordinate somewhere, though not everywhere;
        None where its derivative at any configuration says it."""
        return None

    def left(self, t: float, q: Array, roughly: bool = False) -> tuple[float, float] | None:
        """What is left at t (s) and q (n,) to the end that it leads to, m and rad; None where that is reached
        (`roughly`: by a robot that does not do as it is told), or where it leads to none."""
        return None

    def noticed(self, t: Array, q: Array) -> Iterable[Finding]:
        """What a task of it warns of after a run, by the samples at times (N,), s, and q (N, n)."""
        return ()


def only_row(function: Function, robot: Robot, where: str, expected: str) -> Row:
    """The row of a function that has one; `InputError` where it has several."""
    rows = function.rows(robot)
    expect(len(rows) == 1, where, expected, [row.name for row in rows])
    return rows[0]


@kernel(FUNCTION)
def move_rows(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
    """Moves the rows from `source` to `target`, then clears the first rows; numbers = [source, target, number
    of rows, number of first rows to clear]."""
    source, target, count = int(numbers[0]), int(numbers[1]), int(numbers[2])
    for moved in range(count):
        i = moved if target < source else count - 1 - moved  # so that none is overwritten before it is read
        rows.value[target + i] = rows.value[source + i]
        rows.value_t[target + i] = rows.value_t[source + i]
        copied(rows.value_q[source + i], rows.value_q[target + i])
    for i in range(int(numbers[3])):
        rows.value[i] = 0.0
        rows.value_t[i] = 0.0
        clear(rows.value_q[i])


def stacked(functions: Sequence[Function], robot: Robot) -> tuple[Stage, ...]:
    """Stages that leave the functions' rows one below the other, for the stage after them."""
    stages: tuple[Stage, ...] = ()
    count = 0
    # The last first: what is there is moved out of the way of the next, which begins on clean rows.
    for function in reversed(functions):
        own, rows = function.stages(robot), len(function.rows(robot))
        if count:
            used, aside = max(stage.rows for stage in stages), max(stage.rows for stage in own)
            away = Stage(move_rows, max(used, aside + count), (), np.array([0.0, aside, count, aside]))
            stages = (*stages, away, *own)
            if aside != rows:
                back = np.array([aside, rows, count, 0.0], dtype=float)
                stages = (*stages, Stage(move_rows, aside + count, (), back))
        else:
            stages = own
        count += rows
    return stages
