"""What a resolver is: inputs u with J u = rate, and a use of the redundancy left. Arrays in, arrays out."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from nmm.arrays import Array, Integers, array, vector
from nmm.errors import InputError
from nmm.kernels.compiled import Kernel


class Status(IntEnum):
    """How a resolution went; the kernels write these numbers into report[0]."""

    SOLVED = 0
    SINGULAR_J = 1
    SINGULAR_JA = 2
    SINGULAR_JE = 3
    NOT_FINITE = 4

    @property
    def meaning(self) -> str:
        """A sentence for people, with advice."""
        return _MEANINGS[self]


_MEANINGS = {
    Status.SOLVED: "solved",
    Status.SINGULAR_J: "the task Jacobian J lost rank: the task asks for a motion that no input gives here",
    Status.SINGULAR_JA: "the block Ja of the reduced gradient is singular though J is not: "
    "give more partitions, or partitions: automatic",
    Status.SINGULAR_JE: "the extended Jacobian J_e is singular though J is not (algorithmic singularity): "
    "the constraint asks here for what the task already fixes",
    Status.NOT_FINITE: "an input is not finite: the task, its reference or the objective is undefined here",
}

#: state[0]: what the kernel chose (RG's partition) may change; it is kept; it was kept although it fell below
#: its threshold.
FREE, HELD, OVERDUE = 0, 1, 2

#: report = [status, ‖J u - rate‖, measure of the matrix inverted, with a sign where it is a determinant's]
REPORT = 3


class Shape(NamedTuple):
    """What a resolver must know of a problem: rows of task and constraint, names of the inputs.

    groups : inputs that are spoken of together, by the group's name ("platform", "arm")
    """

    s: int
    k: int
    inputs: tuple[str, ...]
    groups: Mapping[str, tuple[str, ...]] = {}

    @property
    def m(self) -> int:
        """Number of inputs."""
        return len(self.inputs)


class Setup(NamedTuple):
    """The numbers that a resolver's kernel reads, and its state at the start.

    state[0] is FREE, HELD or OVERDUE; what follows is the kernel's own (RG: the columns of Ja).
    """

    parameters: Array
    options: Integers
    state: Integers


@dataclass(frozen=True, eq=False)
class Resolution:
    """A resolver's answer, with its certificate.

    Attributes
    ----------
    u : (m,) the inputs
    residual : ‖J u - rate‖
    status : solved, or what was singular
    measure : of the matrix inverted: PG and EJ, smallest over largest pivot; RG, |det Ja|, divided
        by sqrt(det J Jᵀ) with automatic partitions
    state : pass it to the next call (RG's partition)
    """

    u: Array
    residual: float
    status: Status
    measure: float
    state: Integers

    @property
    def singular(self) -> bool:
        """Whether the matrix to invert lost rank; u is then not a number."""
        return self.status is not Status.SOLVED


class Resolver(ABC):
    """u = resolve(J, rate, h). To add one, write in a file of its own a kernel and a subclass with:

    1. `kernel`, of signature `compiled.RESOLVER`, which solves J u = rate (the constraint
       Jc u = rate_c too, if it takes one) and writes u and report = [status, residual, measure];
    2. `setup(shape)`, the numbers it reads; raises `InputError` for a shape that it cannot resolve.

    `uses_constraint` says whether it takes the constraint's rows Jc.
    """

    name: ClassVar[str]
    uses_constraint: ClassVar[bool] = False

    @property
    @abstractmethod
    def kernel(self) -> Kernel:
        """The kernel that resolves."""

    @abstractmethod
    def setup(self, shape: Shape) -> Setup:
        """The kernel's numbers for problems of this shape."""

    def finish(self, J: Array, rate: Array, h: Array, u: Array, report: Array) -> None:
        """What is left to do after the kernel, in Python: nothing, unless a subclass says otherwise."""
        return

    def check(self, shape: Shape) -> None:
        """`InputError` when the task has more rows than there are inputs."""
        if shape.s < 1:
            raise InputError("task: expected at least one row")
        if shape.s > shape.m:
            raise InputError(
                f"task: {shape.s} rows for {shape.m} inputs ({', '.join(shape.inputs)}); "
                f"expected at most {shape.m}"
            )

    def resolve(
        self,
        J: ArrayLike,
        rate: ArrayLike,
        h: ArrayLike,
        *,
        Jc: ArrayLike | None = None,
        rate_c: ArrayLike | None = None,
        inputs: Sequence[str] | None = None,
        state: Integers | None = None,
    ) -> Resolution:
        """Inputs u with J u = rate.

        Parameters
        ----------
        J : (s, m) task Jacobian, rate : (s,) task velocity
        h : (m,) gradient of the objective seen by the inputs, Sᵀ ∂H/∂q
        Jc, rate_c : (k, m) and (k,), the constraint of the extended Jacobian
        inputs : names of the inputs, for partitions and weights given by name
        state : of the previous `Resolution`
        """
        J = array(J, "J")
        if J.ndim != 2:
            raise InputError(f"J: expected a matrix, got shape {J.shape}")
        s, m = J.shape
        Jc = np.zeros((0, m)) if Jc is None else array(Jc, "Jc")
        if Jc.ndim != 2 or Jc.shape[1] != m:
            raise InputError(f"Jc: expected {m} columns, got shape {Jc.shape}")
        rate_c = vector(np.zeros(0) if rate_c is None else rate_c, len(Jc), "rate_c")
        names = tuple(inputs) if inputs is not None else tuple(f"u{i}" for i in range(m))
        if len(names) != m:
            raise InputError(f"inputs: expected {m} names, as J has columns, got {len(names)}")
        setup = self.setup(Shape(s, len(Jc), names))
        state = setup.state.copy() if state is None else np.array(state, dtype=np.int64)
        if state.shape != setup.state.shape or not np.all((state[1:] >= -1) & (state[1:] < m)):
            raise InputError(f"state: expected one of {s} rows and {m} inputs, got {state}")
        u, report = np.full(m, np.nan), np.full(REPORT, np.nan)
        rate, h = vector(rate, s, "rate"), vector(h, m, "h")
        self.kernel(J, rate, Jc, rate_c, h, setup.parameters, setup.options, state, u, report)
        self.finish(J, rate, h, u, report)
        return Resolution(u, float(report[1]), Status(int(report[0])), abs(float(report[2])), state)
