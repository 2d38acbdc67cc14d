"""What a resolver remembers from one call to the next."""

from __future__ import annotations

from collections.abc import Sequence
from types import TracebackType
from typing import Self

import numpy as np

from nmm.arrays import Integers


class State:
    """The state of a resolver that remembers nothing; subclasses say what theirs means.

    Whoever drives a resolver (a controller, a simulation) asks the state these questions and knows nothing
    of what it holds.

    Parameters
    ----------
    start : the integers that the kernel finds at its first call; none for a resolver without state

    Attributes
    ----------
    memory : the integers, which the kernel reads and writes

    Examples
    --------
    >>> state = nmm.State([3, 1])
    >>> state.memory[0] = 7
    >>> before = state.snapshot()
    >>> state.reset()
    >>> before.tolist(), state.memory.tolist(), nmm.State().partition(2).tolist()
    ([7, 1], [3, 1], [-1, -1])
    """

    def __init__(self, start: Sequence[int] | Integers = ()) -> None:
        self._start: Integers = np.array(start, dtype=np.int64)
        self.memory: Integers = self._start.copy()

    def reset(self) -> None:
        """Forget: the next call decides anew."""
        self.memory[:] = self._start

    def snapshot(self) -> Integers:
        """A copy of what is remembered, for `restore` and `may_stand`."""
        return self.memory.copy()

    def restore(self, snapshot: Integers) -> None:
        """Remember what was remembered then."""
        self.memory[:] = snapshot

    def held(self) -> Self:
        """`with state.held():` keeps what was decided through the stages of an integration step."""
        return self

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        return

    def may_stand(self, before: Integers) -> bool:
        """Whether an integration step that began with the snapshot `before` may stand; if not, it is taken
        again after a `reset` at its beginning."""
        return True

    def reservation(self, before: Integers, inputs: Sequence[str]) -> str:
        """What is to be said of a step that was taken again and may still not stand; empty for nothing."""
        return ""

    def partition(self, s: int) -> Integers:
        """(s,) columns of the block that does the task (RG); -1 where there is no such block."""
        return np.full(s, -1, dtype=np.int64)
