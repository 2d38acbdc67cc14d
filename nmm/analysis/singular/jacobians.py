"""What is analysed: the task's J_bar and an added task's, evaluated anywhere, with names, units and sizes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from nmm.analysis.singular.many import matrices
from nmm.analysis.singular.parts import rank_of
from nmm.analysis.singular.reached import Tasks as Tasks
from nmm.analysis.singular.reached import stacked
from nmm.arrays import Array, array, positive, scalar, vector
from nmm.control.controller import Controller
from nmm.errors import InputError, SingularError, expect_known
from nmm.functions.function import Row, row_scales
from nmm.functions.program import COMPILED
from nmm.functions.tasks.task import Stack
from nmm.platforms.base import Platform
from nmm.progress import Progress
from nmm.resolvers.projected_gradient import ProjectedGradient
from nmm.resolvers.reduced_gradient import Partition
from nmm.robots.robot import Robot

#: What can be analysed: a controller, or a robot and its task (functions are enough, without targets).
Subject: TypeAlias = Controller | tuple[Robot, Tasks]
#: Candidates for RG's partition: "automatic" or lists of inputs; None for the controller's own.
Candidates: TypeAlias = str | Sequence[Partition] | None

#: Step of the central differences, m and rad: the cube root of the machine's precision.
STEP = float(np.cbrt(np.finfo(float).eps))


class Jacobians:
    """J (s, m) of the task and added_J (k, m) of the added task at any (t, q).

    The subject's own controller is never run, so that its partition stays as it is.

    Parameters
    ----------
    subject : a controller, or (robot, task)
    added_task : EJ's added task; None for the controller's own, if it has one

    Raises
    ------
    InputError : the subject is neither; a task of more rows than the robot has inputs; a
        added task that does not make J_e square
    """

    def __init__(self, subject: Subject, added_task: Tasks | None = None) -> None:
        self.resolver = None
        if isinstance(subject, Controller):
            self.robot, self.task, self.resolver = subject.robot, subject.task, subject.resolver
            added = subject.added_task if added_task is None else stacked(added_task)
        elif isinstance(subject, tuple) and len(subject) == 2 and isinstance(subject[0], Robot):
            self.robot, self.task = subject[0], stacked(subject[1])
            added = Stack() if added_task is None else stacked(added_task)
        else:
            raise InputError(f"analysis: expected a Controller or (robot, task), got {subject!r}")
        self._of_task = self._controller(self.task)
        self._of_added = self._controller(added) if len(added) else None
        self.rows: tuple[Row, ...] = self._of_task.rows
        self.scales = row_scales(self.rows, self.robot)
        self.added_rows: tuple[Row, ...] = self._of_added.rows if self._of_added else ()
        free = self.robot.n_u - len(self.rows)
        if self.added_rows and len(self.added_rows) != free:
            raise InputError(
                f"added_task: expected {free} rows ({self.robot.n_u} inputs less {len(self.rows)} rows of "
                f"the task), got {len(self.added_rows)}"
            )

    def _controller(self, task: Stack) -> Controller:
        """What evaluates a task; compiled, so that single configurations have what loops over many find."""
        return Controller(self.robot, task, ProjectedGradient(), steering=False, kinematics=COMPILED)

    @property
    def row_names(self) -> tuple[str, ...]:
        """Names of the task's rows."""
        return tuple(row.name for row in self.rows)

    def J(self, t: float, q: Array) -> Array:
        """J_bar of the task (s, m), paper, eq. 13.

        Raises
        ------
        SingularError : there is none at q: the wheels cannot roll, or the task is undefined there
        """
        return self._finite(self._of_task, t, q)

    def added_J(self, t: float, q: Array) -> Array:
        """J_bar of the added task (k, m); no rows without one."""
        if self._of_added is None:
            return np.zeros((0, self.robot.n_u))
        return self._finite(self._of_added, t, q)

    def along(self, t: float, q: Array, directions: Array) -> Array:
        """dJ/dε at q + ε directions[:, j] and the same t, shape (columns, s, m), by central differences."""
        found = [
            (self.J(t, q + STEP * direction) - self.J(t, q - STEP * direction)) / (2.0 * STEP)
            for direction in directions.T
        ]
        return np.array(found).reshape(directions.shape[1], len(self.rows), self.robot.n_u)

    def batch(self, q: Array, t: float = 0.0, progress: Progress | None = None) -> Array:
        """J (N, s, m) at N configurations (N, n) and one time, in compiled code and over the cores.

        Joints that follow others are taken to be where these have them.

        Where there is none (the wheels cannot roll, the task is undefined), it is not a number.

        Parameters
        ----------
        progress : called with the fraction done
        """
        points = self.robot.following.placed(np.asarray(q, dtype=np.float64))
        return self._many(self._of_task, np.full(len(points), float(t)), points, progress)

    def history(self, t: Array, q: Array) -> tuple[Array, Array]:
        """J (N, s, m) and added_J (N, k, m) at t (N,) and q (N, n), as `J` and `added_J` find them."""
        J = self._many(self._of_task, t, q)
        added_J = np.zeros((len(t), 0, self.robot.n_u))
        if self._of_added is not None:
            added_J = self._many(self._of_added, t, q)
        undefined = ~np.isfinite(np.concatenate([J, added_J], axis=1)).all(axis=(1, 2))
        for k in np.flatnonzero(undefined):  # the first one raises, and says why
            self.J(float(t[k]), q[k])
            self.added_J(float(t[k]), q[k])
        return J, added_J

    def _many(self, controller: Controller, t: Array, q: Array, progress: Progress | None = None) -> Array:
        """J (N, rows, m) of a controller at t (N,) and q (N, n); not a number where there is none."""
        found = matrices(controller, t, q, progress)
        platform = self.robot.platform
        if type(platform).problem is not Platform.problem and len(q):
            places = q[:, : platform.n_p]
            if np.all(places == places[0]):  # it stands, as in maps of the workspace
                places = places[:1]
            stuck = [platform.problem(place) is not None for place in places]
            found[np.broadcast_to(stuck, len(q))] = np.nan
        return found

    def sizes(self, length: float | None, sizes: Mapping[str, float] | None) -> tuple[Array, Array, Array]:
        """How much of each row (s,), added row (k,) and input (m,) counts as 1, in their own units.

        Raises
        ------
        InputError : a size that is not above zero, or of something that is neither row nor input
        """
        L = 1.0 if length is None else positive(length, "length")
        given = {} if sizes is None else dict(sizes)
        names = (*self.row_names, *(row.name for row in self.added_rows), *self.robot.u_names)
        for name, value in given.items():
            expect_known("row or input", name, names, "sizes")
            given[name] = positive(value, f"size of {name}")

        def of(named: Sequence[tuple[str, str]]) -> Array:
            return np.array(
                [given.get(name, L if unit.split("/")[0] == "m" else 1.0) for name, unit in named]
            )

        return (
            of([(row.name, row.unit) for row in self.rows]),
            of([(row.name, row.unit) for row in self.added_rows]),
            of(list(zip(self.robot.u_names, self.robot.u_units, strict=True))),
        )

    def natural(self, sizes: Array) -> float:
        """The least natural size of a row, of those that count as 1 by `sizes` (s,): what singular values are
        judged beside where the largest of them is smaller still, as a J of one row has no other."""
        return float(np.min(self.scales / sizes))

    def rank(self, J: Array, tolerance: float) -> int:
        """Rank of a matrix (s, any) of the task's rows as they are, rows in their natural sizes."""
        return rank_of(J / self.scales[:, np.newaxis], tolerance)

    def samples(self, t: ArrayLike, q: ArrayLike) -> tuple[Array, Array]:
        """Times (N,), increasing, and configurations (N, n), checked."""
        times, points = vector(t, None, "t"), array(q, "q")
        if points.shape != (times.size, self.robot.n) or not times.size:
            raise InputError(
                f"q: expected a row of {self.robot.n} numbers ({', '.join(self.robot.q_names)}) for each of "
                f"{max(times.size, 1)} times, got shape {points.shape}"
            )
        if np.any(np.diff(times) <= 0.0):
            raise InputError("t: expected increasing times")
        return times, points

    def _finite(self, controller: Controller, t: float, q: Array) -> Array:
        J = controller.evaluate(t, q).J
        problem = self.robot.platform.problem(q[: self.robot.platform.n_p])
        if problem is not None or not np.all(np.isfinite(J)):
            raise SingularError(
                f"at t = {t:g} s: {problem or 'the task or its reference is undefined there'}"
            )
        return J


def checked(jacobians: Jacobians, t: float, q: ArrayLike | Mapping[str, float] | None) -> tuple[float, Array]:
    """(t, q) as numbers; `InputError` says what is wrong with them."""
    if q is None:
        raise InputError(f"q: expected {jacobians.robot.n} numbers, got None")
    q = jacobians.robot.q(q)
    jacobians.robot.check_followers(q)
    return scalar(t, "t"), q
