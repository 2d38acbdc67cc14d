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
from nmm.control.integrators import integrator
from nmm.control.step.recorded import NOTE_SAMPLE, Recorded, note_sample, room
from nmm.motion.joining import join
from nmm.motion.leg import Leg, RunEnd
from nmm.motion.recording import Recorder
from nmm.motion.trajectory import Trajectory
from nmm.motion.verdict import Outcome, Verdict

#: So many findings are kept, the last ones.
FINDINGS = 200
#: Of tasks that begin and end: samples that have room before there are any.
FIRST = 256


class LoopFindings:
    """Findings of a loop; what is found in one call after the other is one, with `samples` and its `end`."""

    def __init__(self, within: float) -> None:
        self._within = within
        self._found: deque[tuple[str, dict[str, Any], float]] = deque(maxlen=FINDINGS)

    def add(self, code: str, t: float, within: float | None = None, /, **values: Any) -> None:
        """Found at t, s; of numbers that go on the largest counts. It goes on if it is `within` so many s of
        the last time, the next call or two unless given."""
        within = self._within if within is None else within
        for known, earlier, _ in reversed(self._found):
            if known == code and all(earlier[name] == x for name, x in values.items() if _names(x)):
                if t - earlier["end"] > within:
                    break
                numbers = {name: max(earlier[name], x) for name, x in values.items() if not _names(x)}
                earlier.update(numbers, end=t, samples=earlier["samples"] + 1)
                return
        self._found.append((code, {**values, "samples": 1, "end": t}, t))

    def as_findings(self) -> tuple[Finding, ...]:
        return tuple(Finding(code, dict(values), {"t": t}) for code, values, t in self._found)


def _names(value: Any) -> bool:
    return not isinstance(value, float)


class LogPart:
    """The last samples of a controller, at most `count`, with the room for them made as they come."""

    def __init__(self, controller: Controller, active: tuple[bool, ...], count: int, first: int) -> None:
        self.controller, self.active, self._count = controller, active, count
        self._t, self._found = np.zeros(first), room(first, *controller.solver.sizes)
        self._places: deque[tuple[Any, ...]] = deque(maxlen=count)
        self._written = 0
        self._note = checked_by_caller(note_sample, NOTE_SAMPLE)

    def __len__(self) -> int:
        return min(self._written, self._count)

    def add(self, t: float, q: Array) -> None:
        if self._written == len(self._t) < self._count:
            more = min(len(self._t), self._count - len(self._t))
            self._t = np.append(self._t, np.zeros(more))
            added = room(more, *self.controller.solver.sizes)
            both = zip(self._found, added, strict=True)
            self._found = Recorded._make(np.concatenate(pair) for pair in both)
        k = self._written % self._count
        self._t[k] = t
        self._note(*self.controller.solver.blocks, q, 0, 1.0, k, self._found)
        if (scene := self.controller.solver.scene) is not None:
            self._places.append(scene.places(t))
        self._written += 1

    def leg(self, last: int) -> Leg:
        """The `last` of its samples."""
        count = len(self)
        begin = self._written % self._count if self._written > self._count else 0
        order = ((begin + np.arange(count)) % self._count)[count - last :]
        found, t = Recorded._make(values[order] for values in self._found), self._t[order]
        recorder = Recorder.of(self.controller, t, found, [*self._places][count - last :])
        solver, held = self.controller.solver, integrator("zoh", self.controller.robot, 1e-9)
        ended = RunEnd(Outcome.COMPLETED, (), found.q[-1], solver.derivatives[0])
        return Leg(self.controller, self.active, held, recorder, ended, float(t[-1]))


class LoopLog:
    """The last `count` samples of a controller's loop, by the tasks that were active."""

    def __init__(self, controller: Controller, count: int) -> None:
        self._controller, self._count = controller, count
        self._parts: deque[LogPart] = deque()
        self._begin_part()

    def _begin_part(self) -> None:
        schedule = self._controller.schedule
        active, first = ((), self._count) if schedule is None else (schedule.moment.active, 1)
        inner: Controller = getattr(self._controller, "current", self._controller)
        self._parts.append(LogPart(inner, active, self._count, min(self._count, max(first, FIRST))))

    def __len__(self) -> int:
        return min(sum(map(len, self._parts)), self._count)

    def add(self, t: float, q: Array) -> None:
        """The sample that the controller has just computed at (t, q)."""
        if self._controller.solver is not self._parts[-1].controller.solver:
            self._begin_part()
            while sum(map(len, self._parts)) - len(self._parts[0]) >= self._count:
                self._parts.popleft()
        self._parts[-1].add(t, q)

    def trajectory(self, dt: float, findings: tuple[Finding, ...]) -> Trajectory:
        """The samples as a trajectory with these findings; `RunError` where there are none yet."""
        if not len(self):
            raise RunError("has no samples yet", where="loop")
        legs: deque[Leg] = deque()
        room_left = self._count
        for part in reversed(self._parts):
            if (last := min(len(part), room_left)) > 0:
                legs.appendleft(part.leg(last))
                room_left -= last
        schedule = self._controller.schedule
        if schedule is None:
            run = legs[0].recorder.trajectory(dt, "zoh")
        else:
            run, _ = join(self._controller, schedule, [*legs], dt, "zoh")
        return replace(run, verdict=Verdict(warnings=tuple((one,) for one in findings)), label="loop")
