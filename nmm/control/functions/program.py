"""From functions to numbers: a list of functions laid out so that one compiled call evaluates them all."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from nmm.base.arrays import Array, Integers
from nmm.base.kernels.compiled import call_platform, clear, compiled, view
from nmm.base.kernels.kinematics import Kinematics, place_frames
from nmm.base.kernels.record_layout import (
    BLOCKS,
    Blocks,
    IntegerCell,
    IntegerVector,
    Matrices,
    Matrix,
    Memory,
    SampledVector,
    Tensors,
    Vector,
    header_length,
    views,
)
from nmm.base.kernels.records import At, Frames, Rows, call_function
from nmm.base.kernels.signatures import float64, int64, void
from nmm.control.functions.function import Callback, Evaluation, Function, Renewal, Stage
from nmm.model.robots.configuration import Configuration, kinematics_updater
from nmm.model.robots.joint_table import frame_table
from nmm.model.robots.robot import CENTER_OF_MASS, Robot


class Buffers(NamedTuple):
    """Kernels read k frames' placements (k, 3, 4), jacobians (k, 6, n) and hessians (k or 0, 6, n, n), G
    (n_p, p) and G_q (n_p, p, n_p); and write value and value_t (rows,) and value_q (rows, n)."""

    placements: Matrices
    jacobians: Matrices
    hessians: Tensors
    G: Matrix
    G_q: Matrices
    value: Vector
    value_t: Vector
    value_q: Matrix


class LaidOut(NamedTuple):
    """A program in memory, the first record there. `kinematics` () is where its record `Kinematics` is, or 0
    while Pinocchio computes them before the program runs; `stands` () is 1 while what functions remember
    stays as it is; `stages` is where each `LaidOutStage` is."""

    buffers: Buffers
    kinematics: IntegerCell
    stands: IntegerCell
    platform_kernel: int
    platform_numbers: Vector
    stages: IntegerVector


class LaidOutStage(NamedTuple):
    """A stage in memory: its kernel, which rows it sees (from, to), its frames' slots, its numbers, which are
    `memory` where the kernel writes them."""

    kernel: int
    first_row: int
    end_row: int
    slots: IntegerVector
    numbers: Vector
    memory: SampledVector


NONE = np.zeros(0)

#: What computes the kinematics of a program's frames.
PINOCCHIO, COMPILED = "pinocchio", "compiled"

#: Where a caller's own record begins (see `Program.lay_out`).
BESIDE = header_length(LaidOut)


def no_preparation(t: float, q: Array) -> None:
    """Prepares a program that needs nothing: compiled kinematics, no users' functions."""


@compiled
def run_program(t: float, q: Array, integers: Integers, floats: Array) -> None:
    """Evaluate the platform and every stage at (t, q), into the program's buffers; the kinematics of the
    frames are there already, unless they are compiled."""
    program = views(LaidOut, integers, floats, 0)
    run_stages(t, q, integers, floats, program.buffers, program.stages.size)


@compiled
def run_stages(t: float, q: Array, integers: Integers, floats: Array, b: Buffers, count: int) -> None:
    """Evaluate the platform and the first `count` stages at (t, q), as `run_program`, into buffers."""
    program = views(LaidOut, integers, floats, 0)
    n = q.shape[0]
    if program.kinematics[()] > 0:
        kinematics = views(Kinematics, integers, floats, int(program.kinematics[()]))
        place_frames(kinematics.joints, kinematics.frames, q, b.placements, b.jacobians, b.hessians)
    clear(b.G)
    clear(b.G_q)
    clear(b.value)
    clear(b.value_t)
    clear(b.value_q)
    call_platform(program.platform_kernel, view(q, 0, (b.G.shape[0],)), program.platform_numbers, b.G, b.G_q)
    at = At(t, view(q, 0, (n,)), b.G, b.G_q)
    for i in range(count):
        stage = views(LaidOutStage, integers, floats, program.stages[i])
        first = stage.first_row
        rows_here = stage.end_row - first
        rows = Rows(
            view(b.value, first, (rows_here,)),
            view(b.value_t, first, (rows_here,)),
            view(b.value_q, first * n, (rows_here, n)),
        )
        frames = Frames(stage.slots, b.placements, b.jacobians, b.hessians)
        if stage.memory.size > 0:
            stage.memory[0] = float(program.stands[()])
            call_function(stage.kernel, at, frames, stage.memory, rows)
        else:
            call_function(stage.kernel, at, frames, stage.numbers, rows)


_TABLES, _TENSORS = float64[:, :, ::1], float64[:, :, :, ::1]
PLACE = void(BLOCKS, int64, float64[::1], _TABLES, _TABLES, _TENSORS)


@compiled
def place(blocks: Blocks, table: int, q: Array, placements: Array, jacobians: Array, hessians: Array) -> None:
    kinematics = views(Kinematics, blocks.integers, blocks.floats, table)
    place_frames(kinematics.joints, kinematics.frames, q, placements, jacobians, hessians)


class Program:
    """Functions of one robot, with the tables and the memory in which they are evaluated.

    Parameters
    ----------
    kinematics : PINOCCHIO, in `prepare`, or COMPILED, by `nmm.base.kernels.kinematics` in `run_program`
    frames : names of further frames whose kinematics the caller reads, at their `slots`

    Attributes
    ----------
    first_rows : where the rows of each function begin in `buffers.value`
    remembers : whether some function does
    stands () : whether what they remember stays as it is, 1 or 0
    blocks, buffers : what `run_program` takes, made by `lay_out`, and what it reads and writes, as views
    calls_python : whether users' Python functions are among them
    costs : what makes such functions slow, a sentence each
    renewals : numbers that a run replaces
    prepare : (t, q) -> None, Pinocchio's part at q and the users' Python functions, or `no_preparation`
    """

    blocks: Blocks
    buffers: Buffers
    stands: Integers
    calls_python: bool
    costs: tuple[str, ...]
    prepare: Callable[[float, Array], None]

    def __init__(
        self,
        robot: Robot,
        functions: Sequence[Function],
        kinematics: str = PINOCCHIO,
        frames: Sequence[str] = (),
    ) -> None:
        self.robot = robot
        self._compiled = kinematics == COMPILED
        self.first_rows: list[int] = []
        self._functions = functions
        self._stages: list[tuple[Stage, int]] = []
        self._rows = 0
        for function in functions:
            stages = function.stages(robot)
            self.first_rows.append(self._rows)
            self._stages += [(stage, self._rows) for stage in stages]
            self._rows += max((stage.rows for stage in stages), default=0)
        live = [stage.live for stage, _ in self._stages]
        self.renewals = tuple(numbers for numbers in live if isinstance(numbers, Renewal))
        self.remembers = any(stage.remembers for stage, _ in self._stages)
        own = [frame for stage, _ in self._stages for frame in stage.frames]
        self._frames = tuple(dict.fromkeys([*own, *frames]))

    def slots(self, frames: Sequence[str]) -> Integers:
        """Where the buffers have the kinematics of frames, (frames,)."""
        return np.array([self._frames.index(frame) for frame in frames], dtype=np.int64)

    def place_after(self, beside: type) -> int:
        """The place of the first record after its own, with a record of type `beside` at `BESIDE`."""
        stages = len(self._stages) * header_length(LaidOutStage)
        return int(BESIDE + header_length(beside) + stages + header_length(Kinematics))

    def rows_of(self, functions: int) -> tuple[int, Buffers]:
        """How many stages the first so many functions have, and buffers for them alone."""
        last = self.first_rows[functions] if functions < len(self.first_rows) else self._rows
        some = [stage for stage, row in self._stages if row < last]
        return len(some), self._room(any(stage.hessians for stage in some))

    def _room(self, hessians: bool) -> Buffers:
        n, n_p, p, k, rows = (
            *(self.robot.n, self.robot.platform.n_p, self.robot.platform.p),
            *(len(self._frames), self._rows),
        )
        shapes: list[tuple[int, ...]] = [(k, 3, 4), (k, 6, n), (k if hessians else 0, 6, n, n)]
        shapes += [(n_p, p), (n_p, p, n_p), (rows,), (rows,), (rows, n)]
        return Buffers(*(np.zeros(shape) for shape in shapes))

    def lay_out(self, beside: tuple[Any, ...] | None = None, after: Sequence[tuple[Any, ...]] = ()) -> None:
        """Allocate, with a record of the caller's at `BESIDE`, and others from `place_after` on."""
        robot, platform = self.robot, self.robot.platform
        length = header_length(LaidOutStage)
        first = BESIDE + (0 if beside is None else header_length(type(beside)))
        places = first + length * np.arange(len(self._stages))
        table = first + length * len(self._stages)
        buffers = self._room(any(stage.hessians for stage, _ in self._stages))
        kinematics = np.array(table if self._compiled else 0, dtype=np.int64)
        memory = Memory()
        kernel, numbers = platform.velocity_map.address, platform.parameters
        stands = np.array(0, dtype=np.int64)
        memory.add(LaidOut(buffers, kinematics, stands, kernel, numbers, places))
        if beside is not None:
            memory.add(beside)
        for stage, row in self._stages:
            slots = self.slots(stage.frames)
            bounds = row - stage.before, row + stage.rows
            fixed, remembered = (NONE, stage.numbers) if stage.remembers else (stage.numbers, NONE)
            memory.add(LaidOutStage(stage.kernel.address, *bounds, slots, fixed, remembered))
        ids = [None if name == CENTER_OF_MASS else robot.frame_id(name) for name in self._frames]
        memory.add(Kinematics(robot.joints, frame_table(robot.model, robot.joint_axes, ids)))
        for record in after:
            memory.add(record)
        self.blocks = memory.blocks()
        laid = views(LaidOut, *self.blocks, 0)
        self._kinematics, self._table, self.stands = laid.kinematics, table, laid.stands
        self.buffers = arrays = laid.buffers
        update = no_preparation if self._compiled else kinematics_updater(robot, self._frames, *arrays[:3])
        self._numbers = [views(LaidOutStage, *self.blocks, int(place)).numbers for place in places]
        callbacks = []
        for (stage, _), block in zip(self._stages, self._numbers, strict=True):
            if stage.live is not None:
                stage.live.read_by(block)
            if stage.callback is not None:
                callbacks.append((stage.callback, block))
        self.calls_python = bool(callbacks)
        costs = (getattr(callback, "costs", "") for callback, _ in callbacks)
        self.costs = tuple(dict.fromkeys(sentence for sentence in costs if sentence))
        self.prepare = _with_callbacks(robot, update, callbacks) if callbacks else update

    @contextmanager
    def compiled_kinematics(self) -> Iterator[None]:
        """In the block `run_program` computes the kinematics itself; nothing has to be prepared."""
        usual = int(self._kinematics)
        self._kinematics[()] = self._table
        try:
            yield
        finally:
            self._kinematics[()] = usual

    def kinematics_off(self, configurations: Array) -> float:
        """The most by which Pinocchio's kinematics and the compiled ones differ at q (N, n), m and rad."""
        robot, b = self.robot, self.buffers
        theirs, ours = ([np.zeros_like(array) for array in b[:3]] for _ in range(2))
        update = kinematics_updater(robot, self._frames, *theirs)
        off = 0.0
        for q in configurations:
            update(0.0, q)
            place(self.blocks, self._table, q, *ours)
            pairs = zip(theirs, ours, strict=True)
            off = max(off, *(float(np.abs(a - z).max(initial=0.0)) for a, z in pairs))
        return off

    def evaluate(self, t: float, q: Array) -> list[Evaluation]:
        """Every function's value, time derivative and Jacobian at (t, q), as copies."""
        q = np.array(q, dtype=np.float64)
        self.prepare(t, q)
        run_program(float(t), q, *self.blocks)
        *_, value, value_t, value_q = self.buffers
        return [
            Evaluation(*(part[first : first + length].copy() for part in (value, value_t, value_q)))
            for first, length in zip(self.first_rows, self._lengths, strict=True)
        ]

    @cached_property
    def _lengths(self) -> list[int]:
        return [len(function.rows(self.robot)) for function in self._functions]


def evaluate(function: Function, t: float, configuration: Configuration) -> Evaluation:
    """φ (s,), ∂φ/∂t (s,) and ∂φ/∂q (s, n) at time t, s, and a configuration, in the units of its rows. For
    many configurations, lay out one `Program` or use a controller.

    Raises
    ------
    InputError : a frame or coordinate that the robot lacks; a sum of objectives, which is its terms'

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> found = nmm.evaluate(nmm.Circle([0, 0], 1, rate=2.0), 0.0, nmm.Configuration(robot, robot.rest))
    >>> found.value, found.value_t
    (array([1., 0.]), array([-0.,  2.]))
    """
    program = Program(configuration.robot, (function,))
    program.lay_out()
    return program.evaluate(t, configuration.q)[0]


def _with_callbacks(
    robot: Robot, update: Callable[[float, Array], None], callbacks: Sequence[tuple[Callback, Array]]
) -> Callable[[float, Array], None]:
    """Return `update` followed by users' Python functions, whose results go where their kernels read them."""

    def prepare(t: float, q: Array) -> None:
        update(t, q)
        configuration = Configuration(robot, q)
        for callback, block in callbacks:
            value, value_t, value_q = callback(t, configuration)
            block[:] = np.concatenate([value, value_t, value_q.ravel()])
        configuration.forget_neighbours()

    return prepare
