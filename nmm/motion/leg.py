"""A run between two events, at which tasks come or go: what it was, how it ended, when it is left."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from nmm.base.arrays import Array
from nmm.control.controller import Controller
from nmm.control.integrators import Integrator
from nmm.control.sequencing.sequence import Schedule
from nmm.motion.recording import Recorder
from nmm.motion.verdict import FindingLine, Outcome


class RunEnd(NamedTuple):
    """How a run ended: q (n,) is the last configuration recorded, or the start; J (s, m) the task's matrix in
    the controller's last call, at q or a step from it."""

    outcome: Outcome
    reasons: FindingLine
    q: Array
    J: Array


@dataclass
class Leg:
    """The samples of a run, or those between two events: the controller of the active tasks, which tasks
    these are, the integrator without the safety filter, and the latest end, s."""

    controller: Controller
    active: tuple[bool, ...]
    integrator: Integrator
    recorder: Recorder
    ended: RunEnd
    end: float


@dataclass
class Leaving:
    """The start of a leg, after a sample at `earlier`, s, and its end: q (n,) at the event, if any."""

    schedule: Schedule
    earlier: float
    q: Array | None = None

    def stays(self, times: Array, q: Array) -> int:
        """How many samples at times (N,), s, and q (N, n) belong to this leg."""
        return self.schedule.stays(times, q)

    def changes(self, t: float, q: Array, seen: Array) -> bool:
        """Whether the sample at t and q, which the controller takes for `seen`, belongs to another leg."""
        if self.schedule.changes(t, seen):
            self.q = q
        return self.q is not None
