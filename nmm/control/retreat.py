"""A way out of a local minimum: when the error stalls, back off for a while, then start again.

Joints at their stops leave too few columns for what is left of the task, and no input within the limits
makes the error smaller. The way out is not downhill: so the task is dropped for a while, joints go towards
their home and the platform goes backwards, turning to one side and to the other by turns, limits kept all
along.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from nmm.arrays import Array, positive
from nmm.control.goal import Goal, sizes
from nmm.errors import InputError
from nmm.functions.function import Row
from nmm.robots.robot import Robot

#: What 1 rad of error counts, in robot's reaches.
RADIAN = 0.3


class Retreat:
    """An event of a controller that has to reach a target, not to track a path.

    Parameters
    ----------
    stalled : s; where the error has not fallen by the share `progress` in that time, the robot backs off
    progress : share, between 0 and 1
    durations : s, how long it does so the first time, the second, ...; the last holds for all later ones;
        or one number for all
    posture : where joints go meanwhile, (n,) or by name; None for the middle of their limits, or rest
    speed, turn : of the platform, m/s and rad/s
    gain : 1/s, of the joints on their way
    goal : within its tolerances nothing stalls

    Raises
    ------
    InputError : numbers that are not above 0, no durations, a progress of 1 or more, a goal that is none

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
        durations: Sequence[float] | float = (1.0, 1.5, 2.0),
        posture: ArrayLike | Mapping[str, float] | None = None,
        speed: float = 0.5,
        turn: float = 1.0,
        gain: float = 2.0,
        goal: Goal | None = None,
    ) -> None:
        self.stalled = positive(stalled, "retreat: stalled")
        self.progress = positive(progress, "retreat: progress")
        if self.progress >= 1.0:
            raise InputError(f"retreat: progress: expected below 1, got {self.progress:g}")
        self.durations = tuple(
            positive(duration, "retreat: durations") for duration in np.ravel(np.asarray(durations)).tolist()
        )
        if not self.durations:
            raise InputError("retreat: durations: expected at least one, got none")
        self.posture = posture
        self.speed = positive(speed, "retreat: speed")
        self.turn = positive(turn, "retreat: turn")
        self.gain = positive(gain, "retreat: gain")
        if goal is not None and not isinstance(goal, Goal):
            raise InputError(f"retreat: goal: expected a Goal, got {goal!r}")
        self.goal = Goal() if goal is None else goal

    def on(self, robot: Robot, rows: Sequence[Row]) -> Backing:
        """Its state for one robot and one task."""
        return Backing(self, robot, rows)


class Backing:
    """What a controller remembers of its retreats.

    Attributes
    ----------
    count : retreats so far
    left : s, how long the one under way lasts; 0 where there is none
    now : whether the sample is a retreat's
    """

    def __init__(self, retreat: Retreat, robot: Robot, rows: Sequence[Row]) -> None:
        self._retreat, self._robot = retreat, robot
        self._units = [row.unit for row in rows]
        self._home = self._posture()
        self.reset()

    def _posture(self) -> Array:
        robot, posture = self._robot, self._retreat.posture
        if posture is not None:
            return robot.q(posture)
        middle = robot.rest
        ranged = robot.limited.all(axis=1)
        middle[ranged] = robot.q_limits[ranged].mean(axis=1)
        return robot.following.placed(middle)

    def reset(self) -> None:
        """Forget: nothing has stalled yet."""
        self.count = 0
        self.left = 0.0
        self.now = False
        self._best = np.inf
        self._waited = 0.0

    def snapshot(self) -> tuple[float, ...]:
        """What is remembered, for `restore`."""
        return self.count, self.now, self.left, self._best, self._waited

    def restore(self, snapshot: tuple[float, ...]) -> None:
        """Remember what was remembered then."""
        count, now, self.left, self._best, self._waited = snapshot
        self.count, self.now = int(count), bool(now)

    def watch(self, error: Array, dt: float) -> None:
        """See whether the next dt is a retreat's, given the error (s,) now."""
        self.now = self._stalls(error, dt)

    def pass_over(self, errors: Array, dt: float) -> int:
        """`watch` samples with errors (N, s) one after the other, up to the first that is a retreat's.

        Returns how many there are before it.
        """
        for k, error in enumerate(errors):
            self.watch(error, dt)
            if self.now:
                return k
        return len(errors)

    def quiet(self, errors: Array, dt: float) -> int:
        """What `pass_over` finds, while nothing is remembered of it."""
        before = self.snapshot()
        try:
            return self.pass_over(errors, dt)
        finally:
            self.restore(before)

    def _stalls(self, error: Array, dt: float) -> bool:
        retreat = self._retreat
        if self.left > 1e-9:
            self.left -= dt
            return True
        self.left = 0.0
        metres, radians = sizes(error, self._units)
        size = metres / self._robot.reach + RADIAN * radians
        there = metres <= retreat.goal.m and radians <= retreat.goal.rad
        if size < (1.0 - retreat.progress) * self._best or there:
            self._best, self._waited = size, 0.0
            return False
        self._waited += dt
        if self._waited < retreat.stalled:
            return False
        self.left = retreat.durations[min(self.count, len(retreat.durations) - 1)] - dt
        self.count += 1
        self._best, self._waited = np.inf, 0.0
        return True

    def inputs(self, q: Array, G: Array) -> Array:
        """What the retreat asks of the inputs (m,) at q, before limits."""
        robot, retreat = self._robot, self._retreat
        p = robot.platform.p
        u = np.zeros(robot.n_u)
        u[p:] = retreat.gain * (self._home - q)[robot.arm_coordinates]
        if p and robot.platform.n_p >= 3:
            c, s = np.cos(q[2]), np.sin(q[2])
            twist = np.vstack([c * G[0] + s * G[1], c * G[1] - s * G[0], G[2]])
            side = 1.0 if self.count % 2 else -1.0
            u[:p] = np.linalg.lstsq(twist, [-retreat.speed, 0.0, side * retreat.turn], rcond=None)[0]
        return u
