"""Save and restore the controller's mutable state.

It is what a call leaves for its sample's stages and the next call, as one snapshot: all fields of sampled
kinds (`kernels/record_layout.py`). As none is named here or in compiled code, new fields are included.

`evaluate`, `errors`, `without_limits` and an integrator's stages restore it; a step that is repeated, and a
compiled loop that stops, return to their sample's; a run, and each of many rollouts, begins with `reset`.
"""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TypeAlias

from nmm.base.arrays import Array, Integers
from nmm.base.kernels.record_layout import Blocks, sampled
from nmm.control.limits.bounds import LimitNumbers
from nmm.control.step.equations import ControlStep

#: Copies of the integers and floats that a sample changes.
Snapshot: TypeAlias = tuple[Integers, Array]


class SampleState:
    """What the last call of one controller left; to be constructed before the first call."""

    def __init__(self, blocks: Blocks, step: ControlStep) -> None:
        self._integers, self._floats = sampled(*blocks)
        self._limits: LimitNumbers = step.limits
        self._active, self._dt = step.problem.active, step.problem.dt
        self._inputs = step.problem.before[: step.second.u_dot.size]  # none at first order
        self._new = self.snapshot()

    def snapshot(self) -> Snapshot:
        return self._integers.copy(), self._floats.copy()

    def restore(self, snapshot: Snapshot) -> None:
        self._integers[:], self._floats[:] = snapshot

    def reset(self) -> None:
        """Restore the state before the first call."""
        self.restore(self._new)

    def end_stages(self, snapshot: Snapshot) -> None:
        """`restore` after an integrator's stages, except the active bounds, where the next search begins, and
        the inputs that second order integrates."""
        active, inputs = self._active.copy(), self._inputs.copy()
        self.restore(snapshot)
        self._active[:], self._inputs[:] = active, inputs

    @property
    def elapsed(self) -> float:
        """Time over which accelerations count, s: the controller's dt unless set."""
        elapsed = float(self._limits.elapsed)
        return float(self._dt) if math.isnan(elapsed) else elapsed

    @elapsed.setter
    def elapsed(self, elapsed: float | None) -> None:
        self._limits.elapsed[()] = math.nan if elapsed is None else elapsed

    @contextmanager
    def preserve_state(self, mode: int | None = None) -> Iterator[None]:
        """Restore the state after the block; meanwhile `mode` of limits, the current one by default."""
        usual, snapshot = int(self._limits.mode), self.snapshot()
        self._limits.mode[()] = usual if mode is None else mode
        try:
            yield
        finally:
            self._limits.mode[()] = usual
            self.restore(snapshot)
