"""What a controller's call leaves for the stages of its sample and for the next call."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import NamedTuple

from nmm.arrays import Array, Integers
from nmm.control.bounds import LimitNumbers
from nmm.control.retreat import Backing
from nmm.control.step_size import StepSize
from nmm.resolvers.problem_arrays import ProblemArrays


class Snapshot(NamedTuple):
    """Copies: arrays, α's share, the retreat's."""

    arrays: tuple[Array | Integers, ...]
    share: float
    backing: tuple[float, ...]


class SampleState:
    """Bounds, the inputs before, the step size, a retreat; what the resolver remembers is its own `State`.

    Parameters
    ----------
    problem, limits : the controller's, in memory
    step_size, backing : its own, None for none
    rows : of distances, in memory

    Attributes
    ----------
    elapsed () : time since the call before, s, over which accelerations count; whoever sets the controller's
        dt sets it, too
    """

    def __init__(
        self,
        problem: ProblemArrays,
        limits: LimitNumbers,
        step_size: StepSize | None,
        backing: Backing | None,
        rows: Sequence[Array | Integers] = (),
    ) -> None:
        bounds = (problem.u_lower, problem.u_upper, problem.lower, problem.upper)
        self._arrays = (*bounds, problem.stops, problem.before, problem.active, *rows)
        self._mode = limits.mode
        self.elapsed = limits.elapsed
        self._step_size, self._backing = step_size, backing

    def snapshot(self) -> Snapshot:
        """A copy, for `restore`."""
        return Snapshot(
            tuple(one.copy() for one in self._arrays),
            1.0 if self._step_size is None else self._step_size.share,
            () if self._backing is None else self._backing.snapshot(),
        )

    def restore(self, snapshot: Snapshot) -> None:
        """Be as it was then."""
        for one, before in zip(self._arrays, snapshot.arrays, strict=True):
            one[...] = before
        if self._step_size is not None:
            self._step_size.share = snapshot.share
        if self._backing is not None:
            self._backing.restore(snapshot.backing)

    @contextmanager
    def aside(self, mode: int | None = None) -> Iterator[None]:
        """What the block asks of the controller leaves no trace here; `mode` of limits, the usual one."""
        usual, snapshot = int(self._mode), self.snapshot()
        self._mode[()] = usual if mode is None else mode
        try:
            yield
        finally:
            self._mode[()] = usual
            self.restore(snapshot)
