"""Recording: collects the samples of a run, and computes the quantities of its trajectory from them."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from nmm.base.arrays import Array, Integers
from nmm.base.findings import Finding
from nmm.base.kernels.compiled import checked_by_caller
from nmm.base.kernels.spectra import spectra
from nmm.base.machine import expect_memory
from nmm.control.controller import Controller
from nmm.control.functions.program import COMPILED
from nmm.control.limits.limits import Limits
from nmm.control.sequencing.sequence import Event
from nmm.control.step.quantities import Record, saved
from nmm.control.step.recorded import NOTE_HELD, Recorded, note_held, room
from nmm.control.step.safety_filter import Counts
from nmm.control.step.step import Step
from nmm.motion.clearance import Swept, swept
from nmm.motion.margins import margin, shares, standing
from nmm.motion.residuals import residuals
from nmm.motion.seen import SeenPoints
from nmm.motion.shown_frame import shown_frame
from nmm.motion.trajectory import Trajectory

#: Memory of a run, in sizes of its record: copies and derived arrays.
COPIES = 2.5


class Recorder:
    """Collects the samples of a run.

    beyond : at which samples limits could not be kept, and by what rate each; repeated samples count once
    against : which limits contradict each, by name
    retreats (N,) : how often the robot had backed off; backed_off : before the first sample, with other tasks
    counts : how often distances changed the inputs; blocking : what held the robot back at the end
    at_middle : whether inputs are those of the middle between samples
    disturbed : whether the robot does not do as it is told; believed (N, n): where it is believed to be
    goes_on : whether the run goes on after the last sample, with other tasks
    singular_values (N, s) of J, swept : known once the trajectory is made
    """

    def __init__(self, controller: Controller, times: Array) -> None:
        rows, count, sizes = controller.rows, len(times), controller.solver.sizes
        self.controller, self._times, self._count = controller, times, 0
        self._shown = shown_frame(controller.task, controller.robot)
        self._seen = SeenPoints(controller.task, controller.limits, controller.robot)
        expect_memory(
            COPIES * count * sum(array.nbytes for array in room(1, *sizes)),
            f"{count} samples need",
            "expected a larger dt or a shorter duration; nmm.rollout keeps every so many samples (every=)",
        )
        self.found = room(count, *sizes)
        self.retreats = np.zeros(count, dtype=np.int64)
        self._beyond: dict[int, dict[str, float]] = {}
        self.against: dict[str, tuple[str, ...]] = {}
        self.findings: list[Finding] = []
        self.blocking: tuple[str, ...] = ()
        self.counts, self.backed_off = Counts(), 0
        self.goes_on = self.at_middle = self.disturbed = self._compiled = False
        self.believed: Array | None = None
        self.singular_values: Array = np.zeros((0, len(rows)))
        self.swept: Swept | None = None
        self._places: list[tuple[Any, ...]] = []

    @classmethod
    def of(
        cls, controller: Controller, times: Array, found: Recorded, places: Iterable[tuple[Any, ...]]
    ) -> Recorder:
        """With samples that were noted elsewhere, and where obstacles were at each."""
        recorder = cls(controller, times)
        recorder.found, recorder._places = found, list(places)
        recorder.passed_over(len(times) - 1)
        return recorder

    def __len__(self) -> int:
        return self._count

    def clear(self) -> None:
        self._count, self._compiled = 0, False
        self._beyond.clear()
        self._places.clear()
        self.findings.clear()

    @property
    def so_far(self) -> Recorded:
        return Recorded._make(whole[: self._count] for whole in self.found)

    @property
    def q(self) -> Array:
        """The configurations (N, n), including those not written yet."""
        return self.found.q

    @property
    def t(self) -> Array:
        return self._times[: self._count]

    @property
    def start(self) -> float:
        return float(self._times[0])

    @property
    def reached(self) -> float:
        return float(self._times[self._count - 1]) if self._count else 0.0

    @property
    def duration(self) -> float:
        """The planned duration, s."""
        return float(self._times[-1] - self._times[0])

    @property
    def beyond(self) -> dict[int, dict[str, float]]:
        return {k: beyond for k, beyond in self._beyond.items() if k < self._count}

    @property
    def places(self) -> list[tuple[Any, ...]]:
        """Obstacles' places at the samples so far (`Scene.places`)."""
        return self._places[: self._count]

    def add(self, sample: Step) -> None:
        self._write(self._count, sample)
        self._count += 1

    def replace_last(self, sample: Step) -> None:
        self._write(self._count - 1, sample)

    def hold(self, u: Array) -> None:
        """Record the inputs u (m,) that are held after the last sample, where they are not its own."""
        k = self._count - 1
        note = checked_by_caller(note_held, NOTE_HELD)
        note(*self.controller.solver.blocks, self.found.q[k].copy(), u, k, self.found)

    def _write(self, k: int, sample: Step) -> None:
        noted = sample.by_name
        for name, values in zip(self.found._fields, self.found, strict=True):
            values[k] = noted[name]
        if (scene := self.controller.solver.scene) is not None:
            self._places[k:] = [scene.places(sample.t)]
        self.retreats[k] = sample.retreats
        self._beyond.pop(k, None)
        if sample.excess > 0.0:
            beyond = self.controller.report.beyond()
            if not beyond.keys() <= self.against.keys():
                against = self.controller.report.contradiction()
                self.against |= dict.fromkeys(beyond.keys() - self.against.keys(), against)
            self._beyond[k] = beyond  # last: Ctrl-C may come at any line

    def passed_over(self, last: int) -> None:
        self._compiled = True
        self.retreats[self._count : last + 1] = self.retreats[self._count - 1]
        self._count = last + 1

    @property
    def avoided(self) -> bool:
        """Whether the inputs were changed to keep distances, or could come too near within a sample."""
        return self.counts != Counts()

    def find_once(self, found: Finding | None) -> None:
        """Keep a finding, once a run."""
        known = [(finding.code, finding.values) for finding in self.findings]
        if found is not None and (found.code, found.values) not in known:
            self.findings.append(found)

    def noticed(self) -> list[Finding]:
        """Findings of the numbers that the run replaces; once where two tasks have one camera."""
        findings: list[Finding] = []
        for renewal in self.controller.solver.program.renewals:
            findings += (finding for finding in renewal.noticed(self.reached) if finding not in findings)
        return findings

    @property
    def _planned(self) -> Array | None:
        """The configurations (N, n) of the plan followed, at the samples; None without one."""
        renewed = [renewal.planned(self.t) for renewal in self.controller.solver.program.renewals]
        plans = (*renewed, *(task.function.planned(self.t) for task in self.controller.task))
        return next((plan for plan in plans if plan is not None), None)

    def trajectory(self, dt: float, method: str) -> Trajectory:
        recorded, controller = self.so_far, self.controller
        robot, rows, scene = controller.robot, controller.rows, controller.solver.scene
        self.singular_values = spectra(recorded.J, threads=1)
        limits = controller.solver.limits_on if controller.limits is not None else Limits().on(robot)
        distances: dict[str, Any] = {}
        if scene is not None:
            self.swept = swept(scene, self.t, recorded.q, recorded.u, self.places)
            names = tuple(" and ".join(pair) for pair in scene.names)
            distances = {**self.swept.kept, "clearance_names": names, "clearance_asked": scene.distance}
        compiled = len(self) > 0 and (self._compiled or controller.given.kinematics == COMPILED)
        three = recorded.q[[0, len(self) // 2, -1]] if compiled else None
        limited, within = shares(limits, robot, recorded.q, recorded.u, recorded.limited)
        moving = np.flatnonzero(~standing(robot, limited, within))
        path = self._shown.path(robot, recorded.q)
        desired, planned = None, self._planned
        if path is not None and self._shown.rows:
            desired = self._shown.desired(path, recorded.r_d)
        elif path is not None and planned is not None:
            desired = self._shown.path(robot, planned)
        worked_out = {
            "t": self.t.copy(),
            "u_dot": recorded.u_dot.copy() if controller.order == 2 else None,
            "sigma_min": self.singular_values[:, -1],
            "crossed": crossed(recorded.side),
            "margin": margin(within[:, moving]),
            "shares": within,
            "path": path,
            "desired": desired,
            "planned": planned,
            "believed": None if self.believed is None else self.believed[: len(self)].copy(),
            "target": self._shown.mark(path),
            "seen": self._seen.at(self.t, recorded.q),
            **distances,
        }
        quantities = [quantity for quantity in saved() if quantity.name not in worked_out]
        noted = {
            quantity.name: getattr(recorded, quantity.name).copy()
            for quantity in quantities
            if quantity.noted
        }
        record = Record(robot, {"t": self.t, **recorded._asdict()})
        more = {quantity.name: quantity.of(record) for quantity in quantities if quantity.of is not None}
        return Trajectory.of(
            noted | more | worked_out,
            robot=robot,
            limited=controller.limits is not None,
            limit_names=limited,
            unmet=residuals(self.t, recorded.residual, recorded.rate),
            r_names=tuple(row.name for row in rows),
            r_units=tuple(row.unit for row in rows),
            resolver=controller.resolver.name,
            method=method,
            dt=dt,
            events=tuple(
                Event(*event) for renewal in controller.solver.program.renewals for event in renewal.events
            ),
            frame=self._shown.frame,
            cameras=self._seen.cameras,
            kinematics_off=np.nan if three is None else controller.solver.program.kinematics_off(three),
        )


def crossed(side: Integers) -> Integers:
    """1 at the samples before which J_e was singular on the way, else 0; side (N,): the sign of det J_e, 0
    (unknown) where J_e was not inverted. An even number of singularities between samples goes unnoticed."""
    crossings = np.zeros(len(side), dtype=np.int64)
    crossings[1:] = side[1:] * side[:-1] < 0
    return crossings
