"""A way out of a local minimum: when the error stalls, back off for a while, then try again.

Where joints at their limits leave too few columns for the rest of the task, no inputs within the limits
reduce the error. So for a while joints move towards their home, and the platform does of the task what it can
alone, or, each third time, drives backwards, turning to either side by turns; all within the limits.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import Array, positive, scalar
from nmm.base.errors import InputError
from nmm.base.kernels.compiled import compiled
from nmm.base.kernels.record_layout import Cell, IntegerVector, SampledCell, SampledIntegerCell, Vector
from nmm.control.functions.function import Row
from nmm.control.goal import METRES, Goal, norms, unit_codes
from nmm.control.resolvers.problem_arrays import ProblemArrays
from nmm.model.robots.robot import Robot

#: The weight of 1 rad of error, in robot's reaches.
RADIAN = 0.3
#: The platform drives backwards in each of so many retreats.
BACKWARDS = 3
#: The square of the damping of a platform that does the task alone, rows in their scales.
DAMPING = 1e-3
#: From 1 to 3.5 s, evenly spread, no two alike: retreats of the same lengths can repeat for ever.
GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0
DURATIONS = tuple(1.0 + 2.5 * (k * GOLDEN % 1.0) for k in range(500))


class Retreat:
    """What a controller that has to reach a target does when its error stalls.

    Parameters
    ----------
    stalled : s in which the error has to fall by the share `progress`, else the robot backs off; the time in
        which the platform speeds up does not count
    progress : share, between 0 and 1
    durations : s, of the first retreat, the second, ...; the last holds for all later ones; or one for
        all; None for 1 to 3.5, no two alike
    posture : where joints move meanwhile, (n,) or by name; None for the middle of their limits, or rest
    speed, turn : of the platform where it drives backwards, m/s and rad/s
    gain : 1/s, of the joints' motion to the posture
    goal : within its tolerances nothing counts as stalled

    Raises
    ------
    InputError : numbers that are not above 0, no durations, a progress of 1 or more, a goal of another kind

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> task = nmm.Task(nmm.Position("ee", "xy"), [1.5, 0.5])
    >>> keeps = {"limits": nmm.Limits(), "retreat": nmm.Retreat(stalled=0.5)}
    >>> controller = nmm.Controller(robot, task, nmm.ProjectedGradient(), dt=0.02, **keeps)
    >>> nmm.simulate(controller, robot.q({"q2": 0.5}), 10, 0.02, "zoh", until=nmm.Goal()).complete
    True
    """

    def __init__(
        self,
        stalled: float = 0.5,
        progress: float = 0.03,
        durations: Sequence[float] | float | None = None,
        posture: ArrayLike | Mapping[str, float] | None = None,
        speed: float = 0.5,
        turn: float = 1.0,
        gain: float = 2.0,
        goal: Goal | None = None,
    ) -> None:
        self.stalled = positive(stalled, "retreat: stalled")
        self.progress = scalar(progress, "retreat: progress", above=0.0, below=1.0)
        self.durations = DURATIONS
        if durations is not None:
            values = np.ravel(np.asarray(durations)).tolist()
            self.durations = tuple(positive(duration, "retreat: durations") for duration in values)
        if not self.durations:
            raise InputError(where="retreat: durations", expected="at least one", got=None)
        self.posture = posture
        self.speed = positive(speed, "retreat: speed")
        self.turn = positive(turn, "retreat: turn")
        self.gain = positive(gain, "retreat: gain")
        if goal is not None and not isinstance(goal, Goal):
            raise InputError(where="retreat: goal", expected="a Goal", got=goal)
        self.goal = Goal() if goal is None else goal


class RetreatNumbers(NamedTuple):
    """A retreat's parameters and state, as a step reads them.

    units (s,) : of the task's rows (`unit_codes`)
    durations (d,) : s; (0,) without a retreat
    reach () : the robot's, m; metres (), radians () : the goal's tolerances
    retreats () : so far; now () : whether the sample belongs to one
    left () : remaining time of the current one, s, else 0
    best () : the smallest error since the last one; waited () : how long it has not fallen, s
    """

    units: IntegerVector
    stalled: Cell
    progress: Cell
    durations: Vector
    reach: Cell
    metres: Cell
    radians: Cell
    retreats: SampledIntegerCell
    now: SampledIntegerCell
    left: SampledCell
    best: SampledCell
    waited: SampledCell


def retreat_numbers(retreat: Retreat | None, robot: Robot, rows: Sequence[Row]) -> RetreatNumbers:
    settings = retreat or Retreat()
    return RetreatNumbers(
        units=unit_codes(rows),
        stalled=np.array(settings.stalled),
        progress=np.array(settings.progress),
        durations=np.array(settings.durations if retreat else ()),
        reach=np.array(robot.reach if retreat else 0.0),
        metres=np.array(settings.goal.m),
        radians=np.array(settings.goal.rad),
        retreats=np.array(0),
        now=np.array(0),
        left=np.array(0.0),
        best=np.array(np.inf),
        waited=np.array(0.0),
    )


@compiled
def stalls(r: RetreatNumbers, error: Array, dt: float, speeds_up: bool) -> bool:
    """Whether the next dt belongs to a retreat, given the error (s,) now, and whether the platform gathers
    speed, which is no stalling."""
    r.now[()] = 1
    if r.left[()] > 1e-9:
        r.left[()] -= dt
        return True
    r.left[()] = 0.0
    metres, radians = norms(error, r.units)
    size = metres / r.reach[()] + RADIAN * radians
    at_goal = metres <= r.metres[()] and radians <= r.radians[()]
    if size < (1.0 - r.progress[()]) * r.best[()] or at_goal:
        r.now[()], r.best[()], r.waited[()] = 0, size, 0.0
        return False
    if not speeds_up:
        r.waited[()] += dt
    if r.waited[()] < r.stalled[()]:
        r.now[()] = 0
        return False
    r.left[()] = r.durations[min(r.retreats[()], r.durations.shape[0] - 1)] - dt
    r.retreats[()] += 1
    r.best[()], r.waited[()] = math.inf, 0.0
    return True


class RetreatState:
    """The retreats of one controller, with `numbers` in its memory."""

    def __init__(self, retreat: Retreat, robot: Robot, numbers: RetreatNumbers) -> None:
        self._retreat, self._robot, self._numbers = retreat, robot, numbers
        middle, ranged = robot.rest, robot.limited.all(axis=1)
        middle[ranged] = robot.q_limits[ranged].mean(axis=1)
        posture = retreat.posture
        self._home = robot.following.placed(middle) if posture is None else robot.q(posture)

    @property
    def count(self) -> int:
        return int(self._numbers.retreats)

    @property
    def now(self) -> bool:
        return bool(self._numbers.now)

    def take_over(self, other: RetreatState) -> None:
        """Continue another controller's retreat, without its history of the error."""
        mine, theirs = self._numbers, other._numbers
        mine.retreats[()], mine.now[()], mine.left[()] = theirs.retreats, theirs.now, theirs.left
        mine.best[()], mine.waited[()] = np.inf, 0.0

    def inputs(self, q: Array, G: Array, problem: ProblemArrays) -> Array:
        robot, retreat = self._robot, self._retreat
        p = robot.platform.p
        u = np.zeros(robot.n_u)
        u[p:] = retreat.gain * robot.short_way(self._home - q)[robot.arm_coordinates]
        if self.count % BACKWARDS:
            u[:p] = self._task_alone(problem, p)
        elif p and robot.platform.n_p >= 3:
            c, s = np.cos(q[2]), np.sin(q[2])
            twist = np.vstack([c * G[0] + s * G[1], c * G[1] - s * G[0], G[2]])
            side = 1.0 if self.count % 2 else -1.0
            u[:p] = np.linalg.lstsq(twist, [-retreat.speed, 0.0, side * retreat.turn], rcond=None)[0]
        return u

    def _task_alone(self, problem: ProblemArrays, p: int) -> Array:
        """Inputs (p,) of the platform that do the first level as far as they can without the arm: its rows in
        metres, or all where there are none; it stands where the task has no value."""
        first = np.arange(problem.ends[0])
        metres = first[self._numbers.units[first] == METRES]
        rows = metres if metres.size else first
        J = problem.J[rows, :p] / problem.row_scales[rows, np.newaxis]
        rate = problem.rate[rows] / problem.row_scales[rows]
        return np.nan_to_num(np.linalg.solve(J.T @ J + DAMPING * np.eye(p), J.T @ rate))
