"""What a resolver is: inputs u with J u = rate, and a use of the redundancy left. Arrays in, arrays out."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar, Literal, NamedTuple, TypeAlias, get_args

import numpy as np
from numba import types

from nmm.arrays import Array, Integers
from nmm.errors import InputError, expect_known
from nmm.kernels.compiled import Kernel, caller, compiled
from nmm.kernels.memory import LaidOutRecord, Memory, header_length, views
from nmm.resolvers.answer import Answer, AnswerArrays, unanswered
from nmm.resolvers.problem import Dimensions, Problem
from nmm.resolvers.problem_arrays import ProblemArrays
from nmm.resolvers.state import State
from nmm.resolvers.within import keep_limits

#: A resolver's kernel: (problem, numbers, options, state, answer), of `ProblemArrays`, the numbers and
#: options of its `Setup`, the integers of its `State`, and the `AnswerArrays` that it writes.
RESOLVER = types.void(
    LaidOutRecord(ProblemArrays),
    types.float64[::1],
    types.int64[::1],
    types.int64[::1],
    LaidOutRecord(AnswerArrays),
)

call_resolver = caller(RESOLVER)

#: Where the answer is in memory, behind the problem.
ANSWER = header_length(ProblemArrays)


@compiled
def resolve_one(
    address: int, integers: Integers, floats: Array, numbers: Array, options: Integers, state: Integers
) -> None:
    """Call the kernel that begins at an address, for a problem and its answer in memory."""
    problem = views(ProblemArrays, integers, floats, 0)
    answer = views(AnswerArrays, integers, floats, ANSWER)
    call_resolver(address, problem, numbers, options, state, answer)


#: How the step size of the objective's gradient is chosen: as it is given, or at most that, by Armijo's rule.
StepRule: TypeAlias = Literal["constant", "armijo"]


def step_rule(step: StepRule) -> StepRule:
    """It, if there is such a rule; `InputError` lists the names."""
    expect_known("step", step, get_args(StepRule))
    return step


class Setup(NamedTuple):
    """The numbers and the integers that a resolver's kernel reads.

    Examples
    --------
    >>> dimensions = nmm.Dimensions(s=1, k=0, inputs=("v", "omega"))
    >>> setup = nmm.ProjectedGradient(alpha=2.0).setup(dimensions)
    >>> isinstance(setup, nmm.Setup), 2.0 in setup.numbers
    (True, True)
    """

    numbers: Array
    options: Integers


class Resolver(ABC):
    """u = resolve(problem). To add one, write in a file of its own a kernel and a subclass with:

    1. `kernel`, of signature `RESOLVER`, which solves J u = rate, writes u and measure, and ends with
       `certify` (residual and status), or writes the status of what went wrong and leaves u; it
       may end with `bring_within` in its metric, else that is done after it, in the Euclidean one;
    2. `setup(dimensions)`, the numbers that it reads; raises `InputError` for a problem that it cannot
       resolve.

    `takes_added_task` says whether it solves the added task's rows too, `start(dimensions)` gives the state
    of one that remembers, `alpha_at` where the step size α is among its numbers, if it has one. With `step`
    "armijo" a controller shortens α at each sample; the resolver itself, which knows no motion, does not.

    Examples
    --------
    >>> from nmm.resolvers.problem import Problem
    >>> resolver = nmm.ProjectedGradient(alpha=1.0)
    >>> problem = Problem(J=[[1.0, 1.0]], rate=[2.0], h=[0.0, 1.0])
    >>> isinstance(resolver, nmm.Resolver), resolver.resolve(problem).u.round(3)
    (True, array([1.5, 0.5]))
    """

    name: ClassVar[str]
    takes_added_task: ClassVar[bool] = False
    alpha_at: ClassVar[int | None] = None
    step: StepRule = "constant"

    @property
    @abstractmethod
    def kernel(self) -> Kernel:
        """The kernel that resolves."""

    @abstractmethod
    def setup(self, dimensions: Dimensions) -> Setup:
        """The kernel's numbers for problems of these dimensions."""

    def start(self, dimensions: Dimensions) -> State:
        """The state before the first call; nothing is remembered unless a subclass says otherwise."""
        return State()

    def finish(self, problem: ProblemArrays, dimensions: Dimensions, answer: AnswerArrays) -> None:
        """What is left to do after the kernel, in Python: nothing, unless a subclass says otherwise."""
        return

    def check(self, dimensions: Dimensions, *, all_levels: bool = False) -> None:
        """`InputError` when the task's first level, or all of them, have more rows than there are inputs."""
        if dimensions.s < 1:
            raise InputError("task: expected at least one row")
        rows = dimensions.s if all_levels or not dimensions.levels else dimensions.levels[0]
        if rows > dimensions.m:
            which = "task" if rows == dimensions.s else "task: first level"
            raise InputError(
                f"{which}: {rows} rows for {dimensions.m} inputs ({', '.join(dimensions.inputs)}); "
                f"expected at most {dimensions.m}"
            )

    def resolve(self, problem: Problem, state: State | None = None) -> Answer:
        """The answer to one problem; `state` (of `start`) is what it remembers, and is changed."""
        dimensions, memory = problem.dimensions, Memory()
        memory.add(problem.arrays)
        memory.add(unanswered(dimensions.m, len(dimensions.levels)))
        blocks = memory.blocks()
        setup = self.setup(dimensions)
        state = self.start(dimensions) if state is None else state
        resolve_one(self.kernel.address, *blocks, setup.numbers, setup.options, state.memory)
        arrays, answer = views(ProblemArrays, *blocks, 0), views(AnswerArrays, *blocks, ANSWER)
        self.finish(arrays, dimensions, answer)
        keep_limits(arrays, answer)
        return Answer.of(answer)


NO_OPTIONS: Integers = np.zeros(0, dtype=np.int64)
