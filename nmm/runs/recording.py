"""Recording: the samples of a run collected, and what people look at in them worked out."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from nmm.arrays import Array
from nmm.control.controller import Controller
from nmm.control.guard import Counts
from nmm.control.limits import Limits
from nmm.control.step import Step
from nmm.functions.function import Row
from nmm.functions.program import COMPILED
from nmm.kernels.spectra import spectra
from nmm.memory import expect_memory
from nmm.resolvers.answer import Status
from nmm.runs.binding import binding
from nmm.runs.broken_limits import broken_limits, broken_rows
from nmm.runs.clearance import ran_into, swept, told
from nmm.runs.crossings import crossed
from nmm.runs.feedback import Feedback
from nmm.runs.margins import margin, shares, standing
from nmm.runs.promise import Samples
from nmm.runs.reasons import weakest_words
from nmm.runs.recorded import Recorded, room
from nmm.runs.residuals import residuals
from nmm.runs.shown_frame import shown
from nmm.runs.trajectory import Outcome, Trajectory
from nmm.words import counted, listed

#: What `Recorded` and `Step` call by one name.
SAME_NAME = tuple(name for name in Recorded._fields if name not in ("limited", "unanswered"))

#: A run fills its record's memory so many times: with copies, and what is worked out of it.
COPIES = 2.5
#: Below this ratio of smallest to largest singular value a run is warned about.
NEARLY_SINGULAR = 1e-3
#: Below this one J has lost rank.
LOST = 1e-9


class Recorder:
    """Collects the samples of a run.

    Attributes
    ----------
    goes_on : whether the run goes on after the last sample, with other tasks
    backed_off : how often the robot had backed off before the first sample, with other tasks
    """

    def __init__(self, controller: Controller, times: Array) -> None:
        self._controller = controller
        self._times = times
        self._shown = shown(controller.task, controller.robot)
        self._feedback = Feedback.of(controller.task, controller.robot)
        robot, s = controller.robot, len(controller.rows)
        count = len(times)
        kept = controller.kept.row_limits if controller.limits is not None else ()
        sizes = robot.n, robot.n_u, s, len(controller.task.levels(robot)), len(kept)
        expect_memory(
            COPIES * count * sum(one.nbytes for one in room(1, *sizes)),
            f"{count} samples need",
            "expected a larger dt or a shorter duration; nmm.rollout keeps every so many samples (every=)",
        )
        self.found = room(count, *sizes)
        # By sample: one that is taken again counts once.
        self._beyond: dict[int, dict[str, float]] = {}
        self._against: dict[str, str] = {}
        self._retreats = np.zeros(count, dtype=np.int64)
        self._count = 0
        self.warnings: list[str] = []
        self.blocking: tuple[str, ...] = ()
        self._counts = Counts()
        self._places: list[tuple[Any, ...]] = []
        self.goes_on = self._flown = False
        self.backed_off = 0

    def __len__(self) -> int:
        return self._count

    def clear(self) -> None:
        """Forget all samples: another run over the same times follows."""
        self._count, self._flown = 0, False
        self._beyond.clear()
        self._places.clear()
        self.warnings.clear()

    @property
    def so_far(self) -> Recorded:
        """What was recorded so far."""
        return Recorded._make(whole[: self._count] for whole in self.found)

    @property
    def q(self) -> Array:
        """The configurations, (N, n); those that come are not written yet."""
        return self.found.q

    @property
    def t(self) -> Array:
        """The times recorded so far."""
        return self._times[: self._count]

    @property
    def start(self) -> float:
        """The time of the first sample, s."""
        return float(self._times[0])

    @property
    def reached(self) -> float:
        """The time of the last sample."""
        return float(self._times[self._count - 1]) if self._count else 0.0

    @property
    def duration(self) -> float:
        """What the run was to take, s."""
        return float(self._times[-1] - self._times[0])

    @property
    def target(self) -> Array:
        """The targets recorded so far, (N, s)."""
        return self.so_far.r_d

    @property
    def places(self) -> list[tuple[Any, ...]]:
        """Where obstacles were at the samples so far (`Setting.places`)."""
        return self._places[: self._count]

    @property
    def scale(self) -> Array:
        """The shares of the task's rate that were left so far, (N, levels)."""
        return self.so_far.scale

    @property
    def samples(self) -> Samples:
        """What was recorded of the task so far; feedback that a task bounds is asked as bounded."""
        feedback, found = self._feedback, self.so_far
        error, rate, residual, J, u = found.error, found.rate, found.residual, found.J, found.u
        if feedback.has_bounds:
            rate = rate - error @ feedback.K.T + feedback.rates(error)
            residual = np.linalg.norm(np.einsum("kij,kj->ki", J, u) - rate, axis=1)
        return Samples(self.t, error, rate, J, u, residual, found.partition, feedback)

    def add(self, sample: Step) -> None:
        """Record one sample."""
        self._write(self._count, sample)
        self._count += 1

    def replace_last(self, sample: Step) -> None:
        """Record a sample in the place of the last one."""
        self._write(self._count - 1, sample)

    def _write(self, k: int, sample: Step) -> None:
        found = self.found
        for name in SAME_NAME:
            getattr(found, name)[k] = getattr(sample, name)
        if found.limited.shape[1]:
            found.limited[k] = self._controller.report.row_values()
        found.unanswered[k] = sample.status is Status.FALLBACK
        if (setting := self._controller.setting) is not None:
            self._places[k:] = [setting.places(sample.t)]
        self._retreats[k] = sample.retreats
        self._beyond.pop(k, None)
        if sample.excess > 0.0:
            self._beyond[k] = beyond = self._controller.report.beyond()
            if not beyond.keys() <= self._against.keys():
                against = ", ".join(self._controller.report.contradiction())
                self._against |= dict.fromkeys(beyond.keys() - self._against.keys(), against)

    def flown(self, last: int) -> None:
        """Compiled code has recorded all samples up to that one."""
        self._flown = True
        self._retreats[self._count : last + 1] = self._retreats[self._count - 1]
        self._count = last + 1

    @property
    def avoided(self) -> bool:
        """Whether the inputs were changed to keep distances, or could come too near within a sample."""
        return self._counts != Counts()

    def guarded(self, controller: Controller) -> None:
        """What the controller kept off at the end of the run, and what that took."""
        self.blocking = controller.report.blocking()
        self._counts = Counts() if controller.guard is None else controller.guard.counts

    def warn_once(self, t: float, warning: str) -> None:
        """A warning about the time t, s, said once a run; an empty one is none."""
        if warning and not any(warning in said for said in self.warnings):
            self.warnings.append(f"at t = {t:.3g} s {warning}")

    def _kinematics_off(self) -> float:
        """By how much compiled kinematics are off at the first, the middle and the last sample."""
        if not len(self) or not (self._flown or self._controller.kinematics == COMPILED):
            return np.nan
        return self._controller.kinematics_off(self.so_far.q[[0, len(self) // 2, -1]])

    def _warn_of_singularities(self, singular_values: Array) -> None:
        if not len(singular_values):
            return
        largest = singular_values[:, 0]
        ratio = np.divide(singular_values[:, -1], largest, out=np.ones(len(largest)), where=largest > 0.0)
        worst = int(np.argmin(ratio))
        if ratio[worst] < NEARLY_SINGULAR:
            self.warnings.append(
                f"at t = {self._times[worst]:.3g} s the task Jacobian is nearly singular (condition "
                f"number {1.0 / max(ratio[worst], 1e-300):.2g}), nearly lost: "
                f"{weakest_words(self._controller, self.found.q[worst], self.found.J[worst])}; inputs reach "
                f"{np.abs(self.so_far.u).max():.3g}"
            )

    def _warn_of_events(self, singular_values: Array) -> None:
        times = self.t
        for name in dict.fromkeys(name for beyond in self._beyond.values() for name in beyond):
            broken = {k: beyond[name] for k, beyond in self._beyond.items() if name in beyond}
            self.warnings.append(
                f"the limit of {name} could not be kept with the others in {counted(len(broken), 'sample')}, "
                f"from t = {times[min(broken)]:.3g} s on: its rate was beyond what would keep it by up to "
                f"{max(broken.values()):.3g} {self._rate_unit(name)}"
                f"{f' (what contradicts each other: {against})' if (against := self._against[name]) else ''}"
            )
        backed_off = times[np.diff(self._retreats[: len(self)], prepend=self.backed_off) > 0]
        if len(backed_off):
            at = ", ".join(f"{t:.3g} s" for t in backed_off)
            self.warnings.append(f"the error stalled and the robot backed off, at t = {at}")
        added = self.so_far.added_residual
        if np.any(added > 0.0):
            missed = times[added > 0.0]
            back = ", and is done again from there on" if missed[-1] < self.reached else ""
            self.warnings.append(
                f"the added task was not done in {counted(len(missed), 'sample')}, from "
                f"t = {missed[0]:.4g} to {missed[-1]:.4g} s{back}: its rate was "
                f"missed by up to {added.max():.3g} {_of_rates(row.unit for row in self._added_rows)}"
            )
        unanswered = times[self.so_far.unanswered > 0]
        if len(unanswered):
            values = singular_values[self.so_far.unanswered > 0]
            lost = np.any(values[:, -1] <= LOST * values[:, 0])
            self.warnings.append(
                f"the resolver had no answer in {counted(len(unanswered), 'sample')}, from "
                f"t = {unanswered[0]:.3g} s on, {'where J has lost rank' if lost else 'within the limits'}: "
                "its inputs were those nearest to rest"
            )

    @property
    def _added_rows(self) -> tuple[Row, ...]:
        return self._controller.added_task.rows(self._controller.robot)

    def _rate_unit(self, limit: str) -> str:
        """Of the rate of what a limit is about; what no row of the limits names is a distance."""
        units = {row.name: row.unit for row in self._controller.kept.row_limits}
        return _of_rates([units.get(limit, "m").removesuffix("/s")])

    def trajectory(self, outcome: Outcome, message: str, dt: float, method: str) -> Trajectory:
        """What was recorded."""
        found, controller = self.so_far, self._controller
        robot, rows = controller.robot, controller.rows
        singular_values = spectra(found.J, threads=1)
        self._warn_of_events(singular_values)
        if outcome is not Outcome.SINGULAR:  # which says so itself
            self._warn_of_singularities(singular_values)
        ended = outcome in (Outcome.COMPLETED, Outcome.MISSED)
        if ended or outcome is Outcome.INTERRUPTED:  # of one that failed it goes without saying
            self.warnings += broken_limits(robot, self.t, found.q, found.u)
            self.warnings += broken_rows(controller.kept, self.t, found.limited)
        kept = controller.kept if controller.limits is not None else Limits().on(robot)
        distances: dict[str, Any] = {}
        if controller.setting is not None:
            distance = swept(controller.setting, self.t, found.q, found.u, self.places)
            self.warnings += told(controller.setting, distance, self.t, self._counts)
            if ended and (into := ran_into(controller.setting, distance, self.t)):
                message = into if outcome is Outcome.COMPLETED else f"{into}; {message}"
                outcome = Outcome.MISSED
            distances = {
                "clearance": distance.clearance,
                "clearance_pairs": distance.pairs,
                "clearance_between": distance.between,
                "clearance_points": distance.points,
                "clearance_names": tuple(" and ".join(names) for names in controller.setting.names),
                "clearance_asked": controller.setting.distance,
                "obstacles": distance.obstacles,
            }
        limited, within = shares(kept, robot, found.q, found.u, found.limited)
        moving = np.flatnonzero(~standing(robot, limited, within))
        if outcome is Outcome.MISSED and controller.limits is not None:
            held = binding([limited[i] for i in moving], within[:, moving], found.scale)
            message = "; ".join(filter(None, [message, held]))
        path = self._shown.path(robot, found.q)
        desired = self._shown.desired(path, found.r_d) if path is not None and self._shown.rows else None
        return Trajectory(
            robot=robot,
            t=self.t.copy(),
            q=found.q.copy(),
            u=found.u.copy(),
            q_dot=found.q_dot.copy(),
            r=found.r.copy(),
            r_d=found.r_d.copy(),
            error=found.error.copy(),
            objective=found.objective.copy(),
            sigma_min=singular_values[:, -1],
            partition=found.partition.copy(),
            residual=found.residual.copy(),
            scale=found.scale.copy(),
            step_size=found.step_size.copy(),
            crossed=crossed(found.side),
            limited=controller.limits is not None,
            margin=margin(within[:, moving]),
            shares=within,
            limit_names=limited,
            unmet=residuals(self.t, found.residual, found.rate),
            r_names=tuple(row.name for row in rows),
            r_units=tuple(row.unit for row in rows),
            resolver=controller.resolver.name,
            method=method,
            dt=dt,
            outcome=outcome,
            message=message,
            warnings=tuple(self.warnings),
            frame=self._shown.frame,
            path=path,
            desired=desired,
            target=self._shown.mark(path),
            kinematics_off=self._kinematics_off(),
            **distances,
        )


def _of_rates(units: Iterable[str]) -> str:
    """The unit of a rate of such quantities, or of several together."""
    return listed([f"{unit}/s" for unit in dict.fromkeys(units)])
