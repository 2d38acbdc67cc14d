"""The last samples of a loop, and what it found, in memory that does not grow."""

from __future__ import annotations

from collections import deque
from dataclasses import replace
from typing import Any

import numpy as np

from nmm.base.arrays import Array
from nmm.base.errors import RunError
from nmm.base.findings import Finding
from nmm.base.kernels.compiled import checked_by_caller
from nmm.control.controller import Controller
from nmm.control.step.recorded import NOTE_SAMPLE, Recorded, note_sample, room
from nmm.motion.recording import Recorder
from nmm.motion.trajectory import Trajectory
from nmm.motion.verdict import Verdict

#: So many findings are kept, the last ones.
FINDINGS = 200


class LoopFindings:
    """Findings of a loop; what is found in one call after the other is one, with `samples` and its `end`."""

    def __init__(self, apart: float) -> None:
        self._apart = apart
        self._found: deque[tuple[str, dict[str, Any], float]] = deque(maxlen=FINDINGS)

    def add(self, code: str, t: float, apart: float | None = None, **values: Any) -> None:
        """Found at t, s; of numbers that go on the largest counts. It goes on if it is `apart` (s, the next
        call or two unless given) from the last time."""
        apart = self._apart if apart is None else apart
        for known, earlier, _ in reversed(self._found):
            if known == code and all(earlier[name] == x for name, x in values.items() if _names(x)):
                if t - earlier["end"] > apart:
                    break
                numbers = {name: max(earlier[name], x) for name, x in values.items() if not _names(x)}
                earlier.update(numbers, end=t, samples=earlier["samples"] + 1)
                return
        self._found.append((code, {**values, "samples": 1, "end": t}, t))

    def as_findings(self) -> tuple[Finding, ...]:
        return tuple(Finding(code, dict(values), {"t": t}) for code, values, t in self._found)


def _names(value: Any) -> bool:
    return not isinstance(value, float)


class LoopLog:
    """The last `count` samples of a controller's loop."""

    def __init__(self, controller: Controller, count: int) -> None:
        self._controller, self._count = controller, count
        self._found: Recorded = room(count, *controller.solver.sizes)
        self._t = np.zeros(count)
        self._places: deque[tuple[Any, ...]] = deque(maxlen=count)
        self._written = 0
        self._note = checked_by_caller(note_sample, NOTE_SAMPLE)

    def __len__(self) -> int:
        return min(self._written, self._count)

    def add(self, t: float, q: Array) -> None:
        """The sample that the controller has just computed at (t, q)."""
        k = self._written % self._count
        self._t[k] = t
        self._note(*self._controller.solver.blocks, q, 0, 1.0, k, self._found)
        if (scene := self._controller.solver.scene) is not None:
            self._places.append(scene.places(t))
        self._written += 1

    def trajectory(self, dt: float, findings: tuple[Finding, ...]) -> Trajectory:
        """The samples as a trajectory with these findings; `RunError` where there are none yet."""
        if not len(self):
            raise RunError("has no samples yet", where="loop")
        first = self._written % self._count if self._written > self._count else 0
        order = (first + np.arange(len(self))) % self._count
        found = Recorded._make(values[order] for values in self._found)
        run = Recorder.of(self._controller, self._t[order], found, self._places).trajectory(dt, "zoh")
        return replace(run, verdict=Verdict(warnings=tuple((one,) for one in findings)), label="loop")
