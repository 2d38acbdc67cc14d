"""The interface of resolvers: inputs u with J u = rate that use the redundancy."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Literal, NamedTuple, Self, TypeAlias, get_args

import numpy as np

from nmm.base.arrays import Array, Integers, array
from nmm.base.errors import InputError, expect, expect_known
from nmm.base.findings import Finding
from nmm.base.kernels.compiled import Kernel, caller, compiled
from nmm.base.kernels.record_layout import Memory, header_length, views
from nmm.base.kernels.signatures import RecordPlace, float64, int64, void
from nmm.control.resolvers.answer import Answer, AnswerArrays, unanswered
from nmm.control.resolvers.limit_check import keep_limits
from nmm.control.resolvers.problem import Dimensions, Problem
from nmm.control.resolvers.problem_arrays import ProblemArrays
from nmm.model.robots.input_weights import Weights as Weights
from nmm.model.robots.input_weights import by_name

#: Signature of a resolver's kernel: `ProblemArrays`, the numbers and options of its `Setup`, the integers of
#: its `State`, and the `AnswerArrays` that it writes.
_floats, _integers = float64[::1], int64[::1]
RESOLVER = void(RecordPlace(ProblemArrays), _floats, _integers, _integers, RecordPlace(AnswerArrays))

call_resolver = caller(RESOLVER)

#: The place of the answer, after the problem.
ANSWER = header_length(ProblemArrays)


@compiled
def resolve_one(
    address: int, integers: Integers, floats: Array, numbers: Array, options: Integers, state: Integers
) -> None:
    """Call the kernel at an address, for a problem and its answer in memory."""
    problem = views(ProblemArrays, integers, floats, 0)
    answer = views(AnswerArrays, integers, floats, ANSWER)
    call_resolver(address, problem, numbers, options, state, answer)


#: The step size of the objective's gradient: constant, or reduced by Armijo's rule.
StepRule: TypeAlias = Literal["constant", "armijo"]


def step_rule(step: StepRule) -> StepRule:
    expect_known("step", step, get_args(StepRule))
    return step


def weight_matrix(weights: Weights, dimensions: Dimensions) -> Array:
    """W (m, m) of the norm sqrt(uᵀ W u); `InputError` unless it is symmetric and positive definite."""
    if isinstance(weights, Mapping):
        W = np.diag(by_name(weights, dimensions.inputs, dimensions.groups))
    else:
        values = array(weights, "weights")
        W = np.diag(values) if values.ndim == 1 else values
    m = dimensions.m
    expect(W.shape == (m, m), "weights", f"{m} numbers or a {m} x {m} matrix", W)
    if not np.array_equal(W, W.T) or np.linalg.eigvalsh(W).min() <= 0.0:
        raise InputError(where="weights", expected="numbers above 0, or a symmetric positive definite matrix")
    return W


def metric_root(weights: Weights | None, dimensions: Dimensions) -> Array:
    """C (m m,), row by row, with C Cᵀ = W⁻¹: ũ = C⁻¹ u has the norm sqrt(uᵀ W u); (0,) without weights."""
    if weights is None:
        return np.zeros(0)
    return np.asarray(np.linalg.inv(np.linalg.cholesky(weight_matrix(weights, dimensions))).T).ravel()


def weight_diagonal(weights: Weights, dimensions: Dimensions) -> Array:
    """The diagonal of W, (m,); `InputError` also where W is not diagonal, as it then couples the inputs."""
    W = weight_matrix(weights, dimensions)
    diagonal = np.diag(W).copy()
    if np.any(np.diag(diagonal) != W):
        raise InputError("a matrix that couples inputs is for pg", where="weights", expected="a number each")
    return diagonal


NO_OPTIONS: Integers = np.zeros(0, dtype=np.int64)


class Setup(NamedTuple):
    """The numbers and the integers that a resolver's kernel reads.

    Examples
    --------
    >>> dimensions = nmm.extending.Dimensions(s=1, k=0, inputs=("v", "omega"))
    >>> setup = nmm.ProjectedGradient(alpha=2.0).setup(dimensions)
    >>> isinstance(setup, nmm.extending.Setup), 2.0 in setup.numbers
    (True, True)
    """

    numbers: Array
    options: Integers = NO_OPTIONS


class State:
    """What a resolver remembers from call to call: nothing here; subclasses define their own.

    Controllers and simulations use these methods only, and do not know what a state holds.

    Parameters
    ----------
    start : the integers before the kernel's first call

    Attributes
    ----------
    memory : the integers, which the kernel reads and writes; a controller's are part of its snapshots

    Examples
    --------
    >>> state = nmm.extending.State([3, 1])
    >>> state.memory[0] = 7
    >>> state.reset()
    >>> state.memory.tolist(), nmm.extending.State().partition(2).tolist()
    ([3, 1], [-1, -1])
    """

    def __init__(self, start: Sequence[int] | Integers = ()) -> None:
        self._start: Integers = np.array(start, dtype=np.int64)
        self.memory: Integers = self._start.copy()

    def reset(self) -> None:
        """Forget everything."""
        self.memory[:] = self._start

    def held(self) -> Self:
        """`with state.held():` keeps decisions constant through the stages of an integration step."""
        return self

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        return

    def may_stand(self, before: Integers) -> bool:
        """Whether an integration step that began with `before`, a copy of `memory`, is valid; if not, it is
        repeated after a `reset` at its beginning."""
        return True

    def reservation(self, before: Integers, inputs: Sequence[str], t: float) -> Finding | None:
        """What to report of a step from t (s) that was repeated and may still be invalid."""
        return None

    def partition(self, s: int) -> Integers:
        """(s,) columns of the block that does the task (RG); -1 without such a block."""
        return np.full(s, -1, dtype=np.int64)


class Resolver(ABC):
    """u = resolve(problem). A new resolver is a file with a kernel and a subclass with:

    1. `kernel`, of signature `RESOLVER`: it solves J u = rate, writes u and measure, and ends with `certify`
       (residual and status), or writes the status of a failure and leaves u. It may then call `bring_within`
       in its own metric; otherwise limits are enforced afterwards, in the Euclidean metric.
    2. `setup(dimensions)`: the numbers that the kernel reads; raises `InputError` for a problem that it
       cannot resolve.

    `exact` states what it guarantees: True if its inputs solve J u = rate, up to rounding, wherever J is
    regular and no limit holds them back, or its status says that it found none; else False. A subclass
    declares it beside its kernel; it has no default.

    `more_rows` states whether it takes tasks with more rows than inputs, by least squares.

    `takes_added_task` states whether it solves the added task's rows too; `start(dimensions)` returns the
    state of a resolver with memory; `alpha_at` is the place of the step size α among its numbers. With `step`
    "armijo" the controller, which knows the motion, shortens α at each sample.

    Raises
    ------
    InputError : when a subclass is defined that does not declare `exact`

    Examples
    --------
    >>> from nmm.control.resolvers.problem import Problem
    >>> resolver = nmm.ProjectedGradient(alpha=1.0)
    >>> problem = Problem(J=[[1.0, 1.0]], rate=[2.0], h=[0.0, 1.0])
    >>> isinstance(resolver, nmm.extending.Resolver), resolver.resolve(problem).u.round(3)
    (True, array([1.5, 0.5]))
    """

    name: ClassVar[str]
    exact: ClassVar[bool]
    takes_added_task: ClassVar[bool] = False
    more_rows: ClassVar[bool] = False
    alpha_at: ClassVar[int | None] = None
    step: StepRule = "constant"

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        own, exact = vars(cls), getattr(cls, "exact", None)
        if not isinstance(exact, bool) or ("exact" not in own and {"kernel", "finish"} & own.keys()):
            raise InputError(
                "declare whether its inputs solve J u = rate where J is regular and nothing limits them",
                where=f"resolver class {cls.__name__}",
                expected="exact: ClassVar[bool] = True, or = False, beside its kernel",
            )

    @property
    @abstractmethod
    def kernel(self) -> Kernel:
        """The kernel that resolves; may be a class attribute."""

    @abstractmethod
    def setup(self, dimensions: Dimensions) -> Setup:
        """The kernel's numbers for problems of these dimensions."""

    def start(self, dimensions: Dimensions) -> State:
        """The state before the first call; empty by default."""
        return State()

    def finish(self, problem: ProblemArrays, dimensions: Dimensions, answer: AnswerArrays) -> None:
        """Python code that runs after the kernel; none by default."""
        return

    def check(self, dimensions: Dimensions, *, all_levels: bool = False) -> None:
        """`InputError` when the task's first level, or all of them, have more rows than there are inputs, and
        the resolver does not take these."""
        expect(dimensions.s >= 1, "task", "at least one row")
        rows = dimensions.s if all_levels or not dimensions.levels else dimensions.levels[0]
        if rows > dimensions.m and not self.more_rows:
            which = "task" if rows == dimensions.s else "task: first level"
            raise InputError(
                where=which,
                expected=f"at most {dimensions.m} rows, as many as inputs; or priorities (position 1, "
                "orientation 2, say) with resolver pg or dls; or dls alone, all in the least-squares sense",
                got=rows,
            )

    def resolve(self, problem: Problem, state: State | None = None) -> Answer:
        """The answer to one problem; it updates `state` (from `start`)."""
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
