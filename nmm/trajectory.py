"""A trajectory: what a run recorded, with the names, the outcome and what people look at in it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from nmm.arrays import Array, Integers
from nmm.controller import Controller, Step
from nmm.references.bearing import Bearing
from nmm.robot import Robot
from nmm.tasks.position import AXES, Position

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from nmm.playback import Motion


#: Below this ratio of smallest to largest singular value a run is warned about.
NEARLY_SINGULAR = 1e-3


class Outcome(StrEnum):
    """How a run ended."""

    COMPLETED = "completed"
    SINGULAR = "singular"
    DIVERGED = "diverged"
    UNSTABLE = "unstable"
    FAILED = "failed"
    INTERRUPTED = "interrupted"


@dataclass(frozen=True, eq=False)
class Trajectory:
    """N samples of a closed loop, both ends included.

    Attributes
    ----------
    robot : the robot that moved
    t (N,) s; q (N, n); u (N, n_u): times, coordinates, inputs, in `robot.q_units`, `robot.u_units`
    q_dot (N, n): S(q) u, per second
    r, r_d, error (N, s): task value, target and error (angles wrapped), in `r_units`
    objective (N,): H(q)
    sigma_min (N,): smallest singular value of J_bar
    partition (N, s): columns of Ja (RG), -1 elsewhere
    residual (N,): ‖J u - rate‖
    r_names, r_units : the task's rows
    resolver, method, dt : how it was made
    outcome, message, warnings : how it ended and why
    frame : the end-effector frame that the task positions, if any
    path, desired (N, 3): its path and, where the task says, the desired one, m in the world
    target (3,): the fixed point that a bearing looks at, if any
    scenario : the scenario as resolved, if it came from one
    """

    robot: Robot
    t: Array
    q: Array
    u: Array
    q_dot: Array
    r: Array
    r_d: Array
    error: Array
    objective: Array
    sigma_min: Array
    partition: Integers
    residual: Array
    r_names: tuple[str, ...]
    r_units: tuple[str, ...]
    resolver: str
    method: str
    dt: float
    outcome: Outcome = Outcome.COMPLETED
    message: str = ""
    warnings: tuple[str, ...] = ()
    frame: str | None = None
    path: Array | None = None
    desired: Array | None = None
    target: Array | None = None
    scenario: dict[str, Any] | None = field(default=None)

    def __len__(self) -> int:
        return len(self.t)

    def __repr__(self) -> str:
        end = f"{self.t[-1]:g} s in {len(self)} samples" if len(self) else "no samples"
        return f"Trajectory({self.robot.name}, {self.resolver}, {self.outcome}, {end})"

    @property
    def complete(self) -> bool:
        """Whether the run reached its end as asked."""
        return self.outcome is Outcome.COMPLETED

    @property
    def error_norm(self) -> Array:
        """‖e‖ at each sample, (N,), in the mixed units of the rows."""
        norm: Array = np.linalg.norm(self.error, axis=1)
        return norm

    @property
    def switches(self) -> int:
        """How often RG changed its partition."""
        if len(self) < 2:
            return 0
        return int(np.sum(np.any(np.diff(self.partition, axis=0) != 0, axis=1)))

    def with_scenario(self, scenario: dict[str, Any]) -> Trajectory:
        """The same trajectory with the scenario that it came from."""
        return replace(self, scenario=scenario)

    def summary(self) -> dict[str, Any]:
        """The run in numbers, ready for JSON."""
        from nmm.summary import summarise

        return summarise(self)

    def save(self, folder: str | Path, *, figures: bool = True, html: bool = False) -> Path:
        """Write the run's folder (see `nmm.storage.save`): arrays, tables, summary, figures, playback."""
        from nmm.storage import save

        return save(self, folder, figures=figures, html=html)

    @staticmethod
    def load(folder: str | Path) -> Trajectory:
        """Read a run's folder; `InputError` when it is none."""
        from nmm.storage import load

        return load(folder)

    def plot(self) -> Figure:
        """One figure that shows the run: the motion from above, errors, objective, inputs."""
        from nmm.figures import overview

        return overview(self)

    def motion(self, label: str | None = None) -> Motion:
        """What playback shows of it."""
        from nmm.playback import Motion

        return Motion(
            robot=self.robot,
            t=self.t,
            q=self.q,
            u=self.u,
            path=self.path,
            desired=self.desired,
            target=self.target,
            label=self.resolver.upper() if label is None else label,
            frame=self.frame,
        )

    def play(self, *, port: int | None = None, open_browser: bool = True) -> None:
        """Play the motion in a browser with MeshCat; returns when the user ends it (Ctrl-C)."""
        from nmm.playback import play

        play([self.motion()], port=port, open_browser=open_browser)


class Recorder:
    """Collects the samples of a run."""

    def __init__(self, controller: Controller, times: Array) -> None:
        self._controller = controller
        self._times = times
        robot, s = controller.robot, len(controller.rows)
        count = len(times)
        self.q = np.empty((count, robot.n))
        self._u = np.empty((count, robot.n_u))
        self._q_dot = np.empty((count, robot.n))
        self._rows = np.empty((3, count, s))
        self._scalars = np.empty((2, count))
        self._J = np.empty((count, s, robot.n_u))
        self._partition = np.empty((count, s), dtype=np.int64)
        self._count = 0
        self.warnings: list[str] = []

    def __len__(self) -> int:
        return self._count

    @property
    def t(self) -> Array:
        """The times recorded so far."""
        return self._times[: self._count]

    @property
    def reached(self) -> float:
        """The time of the last sample."""
        return float(self._times[self._count - 1]) if self._count else 0.0

    @property
    def keeps_erring(self) -> bool:
        """Whether the task error of the second half is still of the size of the first half's."""
        error = np.linalg.norm(self._rows[2, : self._count], axis=1)
        half = self._count // 2
        return bool(half and error[half:].max() > 0.1 * error[:half].max())

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
        self._rows[1, k] = sample.target
        self._rows[2, k] = sample.error
        self._scalars[0, k] = sample.objective
        self._scalars[1, k] = sample.residual
        self._J[k] = sample.J
        self._partition[k] = sample.partition

    def _warn_of_singularities(self, singular_values: Array) -> None:
        if not len(singular_values):
            return
        ratio = singular_values[:, -1] / singular_values[:, 0]
        worst = int(np.argmin(ratio))
        if ratio[worst] < NEARLY_SINGULAR:
            self.warnings.append(
                f"at t = {self._times[worst]:.3g} s the task Jacobian is nearly singular (condition "
                f"number {1.0 / max(ratio[worst], 1e-300):.2g}); inputs reach "
                f"{np.abs(self._u[: self._count]).max():.3g}"
            )

    def trajectory(self, outcome: Outcome, message: str, dt: float, method: str) -> Trajectory:
        """What was recorded."""
        count, controller = self._count, self._controller
        robot, rows = controller.robot, controller.rows
        singular_values = np.linalg.svd(self._J[:count], compute_uv=False).astype(np.float64)
        if outcome is not Outcome.SINGULAR:  # which says so itself
            self._warn_of_singularities(singular_values)
        frame, columns, target = _shown(controller)
        path, desired = None, None
        if frame is not None:
            path = _frame_path(robot, frame, self.q[:count])
            desired = path.copy()
            for axis, column in columns.items():
                desired[:, axis] = self._rows[1, :count, column]
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
        )


def _shown(controller: Controller) -> tuple[str | None, dict[int, int], Array | None]:
    """The positioned frame, for each world axis the task's row that holds it, and the target looked at."""
    frame: str | None = None
    columns: dict[int, int] = {}
    target: Array | None = None
    row = 0
    for task in controller.task:
        if isinstance(task.function, Position) and frame in (None, task.function.frame):
            frame = task.function.frame
            columns |= {AXES[axis]: row + i for i, axis in enumerate(task.function.axes)}
        if isinstance(task.reference, Bearing):
            target = task.reference.towards
        row += len(task.rows(controller.robot))
    return frame, columns, target


def _frame_path(robot: Robot, frame: str, q: Array) -> Array:
    """Position of a frame's origin at each configuration, (N, 3)."""
    from nmm.program import Program

    program = Program(robot, (Position(frame, "xyz"),))
    program.pack()
    path = np.empty((len(q), 3))
    for k in range(len(q)):
        program.prepare(0.0, q[k])
        path[k] = program.buffers.placements[0, :, 3]
    return path
