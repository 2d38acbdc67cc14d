"""What every kind of limit is: rows lower <= A u <= upper on the inputs, which one kernel writes at a sample.

    @kernel(LIMIT_ROWS)
    def sideways(sample: LimitSample, frames: Frames, numbers: Array, rows: LimitRows) -> None:
        gradient = scratch((1, sample.q.shape[0]))
        copied(frames.jacobians[frames.slots[0], 1], gradient[0])
        by_inputs(sample, gradient, rows.A[0])
        rows.lower[0], rows.upper[0] = -numbers[0], numbers[0]

A new kind is such a kernel with a subclass of `Limit`, and a line in `nmm/base/kinds.py`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from nmm.base.arrays import Array, counted
from nmm.base.errors import expect
from nmm.base.kernels.compiled import Kernel, caller, compiled
from nmm.base.kernels.record_layout import IntegerVector, Matrices, Matrix, Vector, record_type
from nmm.base.kernels.records import Frames
from nmm.base.kernels.signatures import float64, void
from nmm.base.kernels.velocity_map import to_inputs
from nmm.model.robots.robot import Robot


class RowLimit(NamedTuple):
    """A limited quantity: its value is recorded of each sample, and is in margins, figures and findings.

    Attributes
    ----------
    name, unit : "speed of ee", "m/s"
    lower, upper : its limits; infinite for none

    Examples
    --------
    >>> (row,) = nmm.HandSpeed("ee", 0.25).rows(nmm.load("unicycle_2r"))
    >>> isinstance(row, nmm.extending.RowLimit), row.name, row.unit, row.upper
    (True, 'speed of ee', 'm/s', 0.25)
    """

    name: str
    unit: str
    lower: float
    upper: float


class LimitSample(NamedTuple):
    """A sample as a limit's kernel sees it.

    t, dt : the time, s, and how long the inputs will be applied, s
    elapsed : the time since the previous inputs, s
    q (n,) : coordinates; G (n_p, p), G_q (n_p, p, n_p) : the platform's velocity map, dG[i, j] / dqp[k]
    before (m,), q_dot (n,) : the previous inputs u, and S(q) u of them
    moved, mimic_joints : of C in S = blkdiag(G, C), for `by_inputs`
    """

    t: float
    dt: float
    elapsed: float
    q: Vector
    G: Matrix
    G_q: Matrices
    before: Vector
    q_dot: Vector
    moved: IntegerVector
    mimic_joints: Vector


class LimitRows(NamedTuple):
    """lower (rows,) <= A (rows, m) u <= upper (rows,); without limits before the kernel runs."""

    A: Matrix
    lower: Vector
    upper: Vector


#: The signature of a limit's kernel: (sample, frames, numbers, rows).
LIMIT_ROWS = void(record_type(LimitSample), record_type(Frames), float64[::1], record_type(LimitRows))
#: The signature of what computes the limited quantities: (sample, frames, numbers, u_dot, values), where the
#: sample's `before` and `q_dot` are of its own inputs u; u_dot (m,) : their change from those before, per s.
LIMIT_VALUES = void(
    *(record_type(LimitSample), record_type(Frames), float64[::1], float64[::1]),
    float64[::1],
)

call_limit_rows, call_limit_values = caller(LIMIT_ROWS), caller(LIMIT_VALUES)


@compiled
def by_inputs(sample: LimitSample, gradient: Array, out: Array) -> None:
    """out (m,) = gradient S, of one row by the rates of the coordinates, (1, n), which is changed."""
    to_inputs(gradient, 0, sample.G, sample.G.shape[1], sample.moved, sample.mimic_joints, out)


@dataclass(frozen=True, eq=False)
class LimitStage:
    """A limit's kernel with what it reads, on one robot.

    Attributes
    ----------
    kernel : of signature `LIMIT_ROWS`
    values : of signature `LIMIT_VALUES`: the quantities of `Limit.rows` at a sample, as they are
    rows : how many rows the kernel writes
    unit : of A u
    frames : names of the frames whose placement and Jacobian both read
    numbers : the numbers that both read
    sizes : the natural range of each quantity that has one limit, in its unit; when not given, the robot's
        reach in m, else 1
    losses : how far before its limit the rows hold each quantity, at most; 0 when not given
    rates : whether A u are rates of what depends on q: the kernel then writes A at an integrator's stages,
        too, where a sample's bounds stay, and at order 2 the change of A u along the motion is allowed for

    Examples
    --------
    >>> stage = nmm.HandSpeed("ee", 0.25).stage(nmm.load("unicycle_2r"))
    >>> isinstance(stage, nmm.extending.LimitStage), stage.rows, stage.frames
    (True, 3, ('ee',))
    """

    kernel: Kernel
    values: Kernel
    rows: int
    unit: str
    frames: tuple[str, ...] = ()
    numbers: Array = field(default_factory=lambda: np.zeros(0))
    sizes: tuple[float, ...] = ()
    losses: tuple[float, ...] = ()
    rates: bool = False


class Limit(ABC):
    """What a motion is kept within: rows lower <= A u <= upper on the inputs u, at each sample.

    A new kind is a kernel of signature `nmm.extending.LIMIT_ROWS` and a subclass with two methods:
    `rows(robot)` returns the limited quantities, with their limits, and raises `InputError` for what the
    robot lacks; `stage(robot)` returns the kernel with what it reads. It goes into `Limits(bounds=...)`.

    Rows hold from one sample to the next. Where they contradict other limits, all are missed as little as
    possible, and the run reports it.

    Attributes
    ----------
    priority : None for a limit that is kept before any task; 1, 2, ... for one that is kept if possible: as
        far as tasks of a lower number allow, before those of this number and higher ones

    Examples
    --------
    >>> limit = nmm.HandSpeed("ee", 0.25)
    >>> isinstance(limit, nmm.Limit), limit.priority
    (True, None)
    """

    priority: int | None = None

    @abstractmethod
    def rows(self, robot: Robot) -> Sequence[RowLimit]:
        """The limited quantities, in order."""

    @abstractmethod
    def stage(self, robot: Robot) -> LimitStage:
        """The kernel, with what it reads."""


def checked_priority(priority: int | None) -> int | None:
    return None if priority is None else counted(priority, "priority")


def checked_stage(limit: Limit, robot: Robot) -> LimitStage:
    """Its stage; `InputError` for a kernel of another signature, which would run on other memory."""
    stage = limit.stage(robot)
    own = type(limit).__name__
    expect(isinstance(stage, LimitStage), f"{own}.stage", "a LimitStage", type(stage).__name__)
    for name, signature in (("kernel", LIMIT_ROWS), ("values", LIMIT_VALUES)):
        made = getattr(stage, name)
        fits = isinstance(made, Kernel) and made.signature == signature
        wanted = f"a kernel of signature {'LIMIT_ROWS' if name == 'kernel' else 'LIMIT_VALUES'}"
        expect(fits, f"{own}.stage: {name}", wanted, getattr(made, "signature", made))
    counted(stage.rows, f"{own}.stage: rows")
    return stage
