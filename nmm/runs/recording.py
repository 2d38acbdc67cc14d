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
from nmm.errors import InputError
from nmm.functions.function import Function, Shown
from nmm.functions.program import Program
from nmm.functions.tasks.position import AXES, Position
from nmm.functions.tasks.task import Task
from nmm.resolvers.answer import Status
from nmm.robots.robot import Robot
from nmm.runs.broken_limits import broken_limits, broken_rows
from nmm.runs.clearance import ran_into, swept, told
from nmm.runs.feedback import Feedback
from nmm.runs.margins import margin, shares
from nmm.runs.promise import Samples
from nmm.runs.reasons import weakest_words
from nmm.runs.residuals import residuals
from nmm.runs.trajectory import Outcome, Trajectory

#: Below this ratio of smallest to largest singular value a run is warned about.
NEARLY_SINGULAR = 1e-3


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
        self.q = np.empty((count, robot.n))
        self._u = np.empty((count, robot.n_u))
        self._q_dot = np.empty((count, robot.n))
        self._rows = np.empty((4, count, s))
        self._scalars = np.empty((2, count))
        self._scale: Array | None = None
        kept = controller.kept.row_limits if controller.limits is not None else ()
        self._limited = np.empty((count, len(kept)))
        # By sample: one that is taken again counts once.
        self._beyond: dict[int, dict[str, float]] = {}
        self._against: dict[str, str] = {}
        self._unanswered = np.zeros(count, dtype=bool)
        self._retreats = np.zeros(count, dtype=np.int64)
        self._step_size = np.ones(count)
        self._added = np.zeros(count)
        self._J = np.empty((count, s, robot.n_u))
        self._partition = np.empty((count, s), dtype=np.int64)
        self._count = 0
        self.warnings: list[str] = []
        self.blocking: tuple[str, ...] = ()
        self._counts = Counts()
        self._places: list[tuple[Any, ...]] = []
        self.goes_on = False
        self.backed_off = 0

    def __len__(self) -> int:
        return self._count

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
        return self._rows[1, : self._count]

    @property
    def places(self) -> list[tuple[Any, ...]]:
        """Where obstacles were at the samples so far (`Setting.places`)."""
        return self._places[: self._count]

    @property
    def scale(self) -> Array:
        """The shares of the task's rate that were left so far, (N, levels)."""
        return np.ones((0, 1)) if self._scale is None else self._scale[: self._count]

    @property
    def samples(self) -> Samples:
        """What was recorded of the task so far; feedback that a task bounds is asked as bounded."""
        count, feedback = self._count, self._feedback
        error, rate, residual = self._rows[2, :count], self._rows[3, :count], self._scalars[1, :count]
        J, u = self._J[:count], self._u[:count]
        if feedback.has_bounds:
            rate = rate - error @ feedback.K.T + feedback.rates(error)
            residual = np.linalg.norm(np.einsum("kij,kj->ki", J, u) - rate, axis=1)
        return Samples(self.t, error, rate, J, u, residual, self._partition[:count], feedback)

    def add(self, sample: Step) -> None:
        """Record one sample."""
        self._write(self._count, sample)
        self._count += 1

    def replace_last(self, sample: Step) -> None:
        """Record a sample in the place of the last one."""
        self._write(self._count - 1, sample)

    def _write(self, k: int, sample: Step) -> None:
        self.q[k] = sample.q
        self._u[k] = sample.u
        self._q_dot[k] = sample.q_dot
        self._rows[0, k] = sample.r
        self._rows[1, k] = sample.r_d
        self._rows[2, k] = sample.error
        self._rows[3, k] = sample.rate
        self._scalars[0, k] = sample.objective
        self._scalars[1, k] = sample.residual
        self._J[k] = sample.J
        if (setting := self._controller.setting) is not None:
            self._places[k:] = [setting.places(sample.t)]
        if self._scale is None:
            self._scale = np.ones((len(self._times), len(sample.scale)))
        self._scale[k] = sample.scale
        if self._limited.shape[1]:
            self._limited[k] = self._controller.report.row_values()
        self._partition[k] = sample.partition
        self._step_size[k] = sample.step_size
        self._unanswered[k] = sample.status is Status.FALLBACK
        self._retreats[k] = sample.retreats
        self._added[k] = sample.added_residual
        self._beyond.pop(k, None)
        if sample.excess > 0.0:
            self._beyond[k] = beyond = self._controller.report.beyond()
            if not beyond.keys() <= self._against.keys():
                against = ", ".join(self._controller.report.contradiction())
                self._against |= dict.fromkeys(beyond.keys() - self._against.keys(), against)

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
                f"{weakest_words(self._controller, self.q[worst], self._J[worst])}; inputs reach "
                f"{np.abs(self._u[: self._count]).max():.3g}"
            )

    def _warn_of_events(self) -> None:
        times = self.t
        for name in dict.fromkeys(name for beyond in self._beyond.values() for name in beyond):
            broken = {k: beyond[name] for k, beyond in self._beyond.items() if name in beyond}
            self.warnings.append(
                f"the limit of {name} could not be kept with the others in {len(broken)} samples, from "
                f"t = {times[min(broken)]:.3g} s on: its rate was beyond what would keep it by up to "
                f"{max(broken.values()):.3g} a second"
                f"{f' (what contradicts each other: {against})' if (against := self._against[name]) else ''}"
            )
        backed_off = times[np.diff(self._retreats[: len(self)], prepend=self.backed_off) > 0]
        if len(backed_off):
            at = ", ".join(f"{t:.3g} s" for t in backed_off)
            self.warnings.append(f"the error stalled and the robot backed off, at t = {at}")
        added = self._added[: len(self)]
        if np.any(added > 0.0):
            missed = times[added > 0.0]
            back = ", and is done again from there on" if missed[-1] < self.reached else ""
            self.warnings.append(
                f"the added task was not done in {len(missed)} samples, from t = {missed[0]:.4g} to "
                f"{missed[-1]:.4g} s{back}: its rate was missed by up to {added.max():.3g} a second"
            )
        unanswered = times[self._unanswered[: len(self)]]
        if len(unanswered):
            self.warnings.append(
                f"the resolver had no answer in {len(unanswered)} samples, from "
                f"t = {unanswered[0]:.3g} s on, where J has lost rank: its inputs were those nearest "
                "to rest within the limits"
            )

    def trajectory(self, outcome: Outcome, message: str, dt: float, method: str) -> Trajectory:
        """What was recorded."""
        count, controller = self._count, self._controller
        robot, rows = controller.robot, controller.rows
        singular_values = np.linalg.svd(self._J[:count], compute_uv=False).astype(np.float64)
        self._warn_of_events()
        if outcome is not Outcome.SINGULAR:  # which says so itself
            self._warn_of_singularities(singular_values)
        ended = outcome in (Outcome.COMPLETED, Outcome.MISSED)
        if ended or outcome is Outcome.INTERRUPTED:  # of one that failed it goes without saying
            self.warnings += broken_limits(robot, self.t, self.q[:count], self._u[:count])
            self.warnings += broken_rows(controller.kept, self.t, self._limited[:count])
        kept = controller.kept if controller.limits is not None else Limits().on(robot)
        distances: dict[str, Any] = {}
        if controller.setting is not None:
            found = swept(controller.setting, self.t, self.q[:count], self._u[:count], self.places)
            self.warnings += told(controller.setting, found, self.t, self._counts)
            if ended and (into := ran_into(controller.setting, found, self.t)):
                message = into if outcome is Outcome.COMPLETED else f"{into}; {message}"
                outcome = Outcome.MISSED
            distances = {
                "clearance": found.clearance,
                "clearance_pairs": found.pairs,
                "clearance_between": found.between,
                "clearance_points": found.points,
                "clearance_names": tuple(" and ".join(names) for names in controller.setting.names),
                "clearance_asked": controller.setting.distance,
                "obstacles": found.obstacles,
            }
        limited, within = shares(kept, robot, self.q[:count], self._u[:count], self._limited[:count])
        frame, columns, target = self._shown
        path, desired = None, None
        if frame is not None:
            path = frame_path(robot, frame, self.q[:count])
            desired = path.copy()
            for axis, column in columns.items():
                desired[:, axis] = self._rows[1, :count, column]
            desired = desired if columns else None
        if target is not None and path is not None and len(path) and target.size == 2:
            target = np.array([*target, path[0, 2]])
        return Trajectory(
            robot=robot,
            t=self.t.copy(),
            q=self.q[:count].copy(),
            u=self._u[:count].copy(),
            q_dot=self._q_dot[:count].copy(),
            r=self._rows[0, :count].copy(),
            r_d=self._rows[1, :count].copy(),
            error=self._rows[2, :count].copy(),
            objective=self._scalars[0, :count].copy(),
            sigma_min=singular_values[:, -1],
            partition=self._partition[:count].copy(),
            residual=self._scalars[1, :count].copy(),
            scale=self.scale.copy(),
            step_size=self._step_size[:count].copy(),
            limited=controller.limits is not None,
            margin=margin(within),
            shares=within,
            limit_names=limited,
            unmet=residuals(self.t, self._scalars[1, :count], self._rows[3, :count]),
            r_names=tuple(row.name for row in rows),
            r_units=tuple(row.unit for row in rows),
            resolver=controller.resolver.name,
            method=method,
            dt=dt,
            outcome=outcome,
            message=message,
            warnings=tuple(self.warnings),
            frame=frame,
            path=path,
            desired=desired,
            target=target if path is not None else None,
            **distances,
        )


def shown(tasks: Iterable[Task], robot: Robot) -> tuple[str | None, dict[int, int], Array | None]:
    """The positioned frame, for each world axis the task's row that holds it, and the target looked at.

    Where no task positions a frame, the one that a task turns. `InputError` for what cannot be drawn.
    """
    frame: str | None = None
    turned: str | None = None
    columns: dict[int, int] = {}
    target: Array | None = None
    row = 0
    for task in tasks:
        count = len(task.rows(robot))
        said = _said(task.function, robot, count)
        if said.positions is not None and frame in (None, said.positions):
            frame = said.positions
            columns |= {AXES[axis]: row + i for axis, i in said.axes.items()}
        turned = turned or said.turns
        for part in (_said(task.reference, robot, count), said):
            target = target if part.looks_at is None else np.array(part.looks_at, dtype=np.float64)
        row += count
    return frame or turned, columns, target


def _said(function: Function, robot: Robot, rows: int) -> Shown:
    """What the function shows, checked before the run that is to be shown."""
    said, name = function.shown(), f"{type(function).__name__}.shown"
    for frame in (said.positions, said.turns):
        if frame is not None:
            robot.frame_id(frame)
    if not all(axis in AXES and row in range(rows) for axis, row in said.axes.items()):
        raise InputError(
            f"{name}: expected axes from x, y, z with rows from 0 to {rows - 1}, got {dict(said.axes)}"
        )
    if said.looks_at is not None and np.shape(said.looks_at) not in ((2,), (3,)):
        raise InputError(f"{name}: expected 2 or 3 numbers as looks_at, got {said.looks_at!r}")
    return said


def frame_path(robot: Robot, frame: str, q: Array) -> Array:
    """Position of a frame's origin at each configuration, (N, 3)."""
    program = Program(robot, (Position(frame, "xyz"),))
    program.lay_out()
    path = np.empty((len(q), 3))
    for k in range(len(q)):
        program.prepare(0.0, q[k])
        path[k] = program.buffers.placements[0, :, 3]
    return path
