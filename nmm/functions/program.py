"""From functions to numbers: a list of functions laid out so that one compiled call evaluates them all."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from nmm.arrays import Array
from nmm.functions.function import Callback, Evaluation, Function, Stage
from nmm.kernels.compiled import call_function, call_platform, compiled, inlined, view
from nmm.kernels.packing import pack, section
from nmm.robots.configuration import Configuration, kinematics_updater
from nmm.robots.robot import Robot


class Buffers(NamedTuple):
    """What the kernels read and write: views of one block of memory, at fixed places.

    placements (k, 3, 4), jacobians (k, 6, n), hessians (k or 0, 6, n, n): kinematics of k frames
    G (n_p, p), G_q (n_p, p, n_p): the platform's velocity map and its derivatives
    value (rows,), value_t (rows,), value_q (rows, n): the functions, one below the other
    """

    placements: Array
    jacobians: Array
    hessians: Array
    G: Array
    G_q: Array
    value: Array
    value_t: Array
    value_q: Array


# Sections of the packed tables (integers), numbers and memory; a controller adds its own after them.
SIZES, STAGES, SLOTS, TABLES = 0, 1, 2, 3
PARAMETERS, NUMBERS = 0, 1
WORK, MEMORY = 0, 1


@inlined
def buffers(tables: Array, memory: Array) -> Buffers:
    """The views; sizes = [n, n_p, p, frames, frames with Hessians, rows, ...]."""
    sizes = section(tables, SIZES)
    n, n_p, p, k, kh, rows = sizes[0], sizes[1], sizes[2], sizes[3], sizes[4], sizes[5]
    a = int(memory[WORK])
    b = a + k * 12
    c = b + k * 6 * n
    d = c + kh * 6 * n * n
    e = d + n_p * p
    f = e + n_p * p * n_p
    return Buffers(
        view(memory, a, (k, 3, 4)),
        view(memory, b, (k, 6, n)),
        view(memory, c, (kh, 6, n, n)),
        view(memory, d, (n_p, p)),
        view(memory, e, (n_p, p, n_p)),
        view(memory, f, (rows,)),
        view(memory, f + rows, (rows,)),
        view(memory, f + 2 * rows, (rows, n)),
    )


@compiled
def run(t: float, q: Array, tables: Array, numbers: Array, memory: Array) -> Buffers:
    """Evaluate the platform and every stage at (t, q), into the buffers returned.

    The kinematics of the frames are in `memory` already.
    sizes[6:8] = [platform kernel, number of its parameters, which come first]; a stage is
    [kernel, first row, last row, first slot, last slot, first parameter, last parameter].
    """
    sizes = section(tables, SIZES)
    stages = section(tables, STAGES)
    slots = section(tables, SLOTS)
    parameters = section(numbers, PARAMETERS)
    b = buffers(tables, memory)
    work = section(memory, WORK)
    n, k = sizes[0], sizes[3]
    for i in range(k * (12 + 6 * n) + sizes[4] * 6 * n * n, work.shape[0]):  # all but the kinematics
        work[i] = 0.0
    call_platform(sizes[6], view(q, 0, (sizes[1],)), view(parameters, 0, (sizes[7],)), b.G, b.G_q)
    for i in range(0, stages.shape[0], 7):
        row = stages[i + 1]
        rows = stages[i + 2] - row
        call_function(
            stages[i],
            t,
            q,
            b.placements,
            b.jacobians,
            b.hessians,
            b.G,
            b.G_q,
            view(slots, stages[i + 3], (stages[i + 4] - stages[i + 3],)),
            view(parameters, stages[i + 5], (stages[i + 6] - stages[i + 5],)),
            view(b.value, row, (rows,)),
            view(b.value_t, row, (rows,)),
            view(b.value_q, row * n, (rows, n)),
        )
    return b


class Program:
    """Functions of one robot, with the tables and the memory in which they are evaluated.

    Attributes
    ----------
    first_rows : where the rows of each function begin in `buffers.value`
    tables, numbers, memory : the packed vectors, made by `pack`
    buffers : the memory, as views
    prepare : prepare(t, q) does Pinocchio's part at q and the users' Python functions at (t, q)
    """

    tables: Array
    numbers: Array
    memory: Array
    buffers: Buffers
    prepare: Callable[[float, Array], None]

    def __init__(self, robot: Robot, functions: Sequence[Function]) -> None:
        self.robot = robot
        self.first_rows: list[int] = []
        self._lengths = [len(function.rows(robot)) for function in functions]
        self._frames: list[str] = []
        self._stages: list[int] = []
        self._slots: list[int] = []
        self._parameters = [robot.platform.parameters]
        self._placed_callbacks: list[tuple[Callback, int, int]] = []
        self._hessians = False
        self._rows = 0
        for function in functions:
            self.first_rows.append(self._rows)
            self._rows += self._place(function.stages(robot))

    def _place(self, stages: Sequence[Stage]) -> int:
        """Lay out one function's stages; returns the rows that they share."""
        first = self._rows
        for stage in stages:
            for frame in stage.frames:
                if frame not in self._frames:
                    self._frames.append(frame)
            begin = sum(len(block) for block in self._parameters)
            end = begin + stage.parameters.size
            slots = len(self._slots)
            self._stages += [stage.kernel.address, first - stage.before, first + stage.rows]
            self._stages += [slots, slots + len(stage.frames), begin, end]
            self._slots += [self._frames.index(frame) for frame in stage.frames]
            self._parameters.append(stage.parameters)
            if stage.callback is not None:
                self._placed_callbacks.append((stage.callback, begin, end))
            self._hessians = self._hessians or stage.hessians
        return max((stage.rows for stage in stages), default=0)

    def pack(
        self,
        tables: Sequence[ArrayLike] = (),
        numbers: Sequence[ArrayLike] = (),
        memory: Sequence[ArrayLike] = (),
    ) -> None:
        """Allocate, with sections of the caller's after the program's own."""
        platform = self.robot.platform
        n, n_p, p = self.robot.n, platform.n_p, platform.p
        frames, rows = len(self._frames), self._rows
        with_hessians = frames if self._hessians else 0
        sizes = [
            n,
            n_p,
            p,
            frames,
            with_hessians,
            rows,
            platform.velocity_map.address,
            platform.parameters.size,
        ]
        floats = frames * (12 + 6 * n) + with_hessians * 6 * n * n + n_p * p * (1 + n_p) + rows * (2 + n)
        self.tables = pack([sizes, self._stages, self._slots, *tables], np.int64)
        self.numbers = pack([np.concatenate(self._parameters), *numbers], np.float64)
        self.memory = pack([np.zeros(floats), *memory], np.float64)
        self.buffers = buffers(self.tables, self.memory)
        parameters = section(self.numbers, PARAMETERS)
        callbacks = [(callback, parameters[a:z]) for callback, a, z in self._placed_callbacks]
        views = self.buffers
        self.prepare = update = kinematics_updater(
            self.robot, tuple(self._frames), views.placements, views.jacobians, views.hessians
        )
        if callbacks:
            self.prepare = _with_callbacks(self.robot, update, callbacks)

    def evaluate(self, t: float, q: Array) -> list[Evaluation]:
        """Every function's value, time derivative and Jacobian at (t, q), as copies."""
        q = np.array(q, dtype=np.float64)
        self.prepare(t, q)
        run(float(t), q, self.tables, self.numbers, self.memory)
        b = self.buffers
        return [
            Evaluation(b.value[a:z].copy(), b.value_t[a:z].copy(), b.value_q[a:z].copy())
            for a, z in (
                (first, first + length) for first, length in zip(self.first_rows, self._lengths, strict=True)
            )
        ]


def _with_callbacks(
    robot: Robot, update: Callable[[float, Array], None], callbacks: Sequence[tuple[Callback, Array]]
) -> Callable[[float, Array], None]:
    """`update`, then the users' Python functions, whose results go where their kernels read them."""

    def prepare(t: float, q: Array) -> None:
        update(t, q)
        configuration = Configuration(robot, q)
        for callback, block in callbacks:
            value, value_t, value_q = callback(t, configuration)
            block[:] = np.concatenate([value, value_t, value_q.ravel()])

    return prepare
