"""Predictive control: the best motion of the next seconds, looked for anew in each sample of a loop."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import Array, counted, positive, scalar
from nmm.base.errors import InputError, expect_kind
from nmm.base.findings import Finding
from nmm.base.kernels.compiled import checked_by_caller
from nmm.base.kernels.record_layout import Memory, views
from nmm.control.functions.tasks.task import Task
from nmm.control.goal import Goal, error_sizes
from nmm.control.limits.collisions import Collisions
from nmm.control.limits.limits import Limits
from nmm.model.collisions.obstacle import shifts
from nmm.model.robots.joint_table import as_row
from nmm.model.robots.robot import Robot
from nmm.motion.disturbances import Disturbances
from nmm.motion.trajectory import Outcome, Trajectory
from nmm.motion.verdict import Verdict
from nmm.plugins.planning.collisions.motion_check import MotionCheck
from nmm.plugins.planning.goals import goal_task
from nmm.plugins.planning.interior import SHOOT, shoot
from nmm.plugins.planning.plan import Plan
from nmm.plugins.planning.problem import END, MARGIN, largest_inputs, shooting_problem
from nmm.plugins.planning.recorded import recorded
from nmm.plugins.planning.samples import MotionSamples, SampledMotion
from nmm.plugins.planning.shooting import LOOK, Shooting, first_blocked_sample
from nmm.plugins.planning.targets import TaskError

#: Speeds of inputs without limits, m/s and rad/s.
USUAL = 1.0
#: What a square metre or radian of a task's error costs in each sample, and of the distance to a plan, where
#: an input at its limit costs `problem.EFFORT`; the last error counts so many times.
PULL, ALONG, LAST = 10.0, 1000.0, 5.0
#: Products of slacks and multipliers to begin with; rounds at most; gaps that are left, m, rad.
MU, ROUNDS, EXACT = 10.0, 25, 1e-5
#: Rounds at least, to a task and along a plan: after fewer, what is near pushes away from the plan's end.
LEAST, LEAST_ALONG = 4, 8
#: Looks at samples between their ends, of which one that is blocked keeps so much more, m.
LOOKS, MORE = 3, 0.015
#: A run is recorded about so often, s.
SHOWN = 0.02
#: The robot is looked for on its plan up to so many s ahead, at so many points.
WINDOW, POINTS = 1.0, 51
#: The end of a plan is asked for exactly where it is within this share of the time ahead.
NEAR = 0.9


class Horizon:
    """A controller that looks ahead: u = horizon(t, q), in a loop of 10 to 50 Hz.

    In each call it looks for the best motion of the next seconds, within all limits and accelerations, that
    keeps all distances to obstacles *where they will be*, and gives the inputs with which that begins. It
    begins with the motion of the call before. Where none is found, it goes on along that one, which ends at
    rest, and says so (`solved`).

    Parameters
    ----------
    goal : a `Task` (its target may move), coordinates by name, or a `Plan` to follow: the way to a pose of a
        platform that rolls, which no such cost shows
    collisions : distances to keep; the robot's from itself when not given. Obstacles with a `motion` are
        where that says, others go on with the velocity that `move_to` set
    limits : of velocity, acceleration and position; the robot's own when not given
    dt : time between two calls, s
    ahead : how far it looks, s; samples : in how many

    Attributes
    ----------
    solved : whether the last call found a motion

    Raises
    ------
    InputError : limits of functions; a goal with more rows than the robot's inputs can steer at once

    Examples
    --------
    >>> robot = nmm.load("unicycle_3r")
    >>> ball = nmm.Obstacle(nmm.Sphere(0.2), motion=lambda t: [1.5, 1.5 - 0.5 * t, 0.3], name="ball")
    >>> task = nmm.Task(nmm.Position("ee", "xy"), [3.0, 0.2])
    >>> limits = nmm.Limits(velocity={"v": 1.0, "omega": 1.5, "arm": 1.5}, acceleration=2.0)
    >>> horizon = nmm.Horizon(robot, task, nmm.Collisions(0.03, obstacles=[ball]), limits, dt=0.1)
    >>> run = horizon.run({"q2": 0.5, "q3": 0.9}, 10.0, nmm.Goal(0.01))
    >>> run.complete, bool(run.clearance_between.min() > 0.029)
    (True, True)
    """

    def __init__(
        self,
        robot: Robot,
        goal: Task | Mapping[str, float] | Plan,
        collisions: Collisions | None = None,
        limits: Limits | None = None,
        *,
        dt: float = 0.05,
        ahead: float = 4.0,
        samples: int = 20,
    ) -> None:
        expect_kind(goal, Task | Mapping | Plan, "horizon: goal", "a Task, coordinates by name or a Plan")
        if isinstance(goal, Task) and goal.when:
            raise InputError(
                "a horizon has one task for all the time ahead, and this one begins or ends",
                where="horizon: goal",
                expected="a task without when",
            )
        limits = Limits() if limits is None else limits
        if limits.bounds:
            raise InputError("limits of functions are not looked at ahead", where="horizon: limits")
        self.robot, self.dt, self.limits = robot, positive(dt, "dt"), limits.on(robot)
        self.plan = goal if isinstance(goal, Plan) else None
        N = counted(samples, "samples", 2)
        self._times = np.linspace(0.0, positive(ahead, "ahead"), N + 1)
        if isinstance(goal, Plan):
            self.task = goal_task(robot, goal.found.goal, goal.end)
        else:
            self.task = goal_task(robot, goal, np.zeros(0) if isinstance(goal, Task) else robot.q(goal))
        self._error = TaskError(robot, self.task)
        if self.plan is None:
            self._check_steered()
        if self.dt > self._times[1] + 1e-9:
            raise InputError(where="horizon: dt", expected="at most ahead / samples", got=self.dt)
        settings = Collisions() if collisions is None else collisions
        pairs = len(robot.collision_model.collisionPairs) if settings.self_collisions else 0
        self.scene = settings.on(robot) if settings.obstacles or pairs else None
        self._check = MotionCheck(robot, self.scene)
        obstacles = () if self.scene is None else self.scene.obstacles
        shapes = 0 if self.scene is None else len(self.scene.queries.shapes.geometryObjects)
        self._movers = tuple(enumerate(obstacles, shapes - len(obstacles)))
        memory = Memory()
        memory.add(
            shooting_problem(
                robot,
                self.limits,
                largest_inputs(robot, self.limits, USUAL),
                self._check,
                np.tile(robot.rest if self.plan is None else self.plan.end, (N + 1, 1)),
                np.zeros((N + 1, robot.n_u)),
                float(self._times[1]),
                False,
                robot.n if self.plan is not None else len(self._error.rows),
                [shape for shape, _ in self._movers],
            )
        )
        self._blocks = memory.blocks()
        self._x = views(Shooting, *self._blocks, 0)
        if self.plan is None:  # else what pairs keep beyond the distance is less where its end is near
            self._x.room[:] = np.inf
        self._shoot = checked_by_caller(shoot, SHOOT)
        self._first_blocked = checked_by_caller(first_blocked_sample, LOOK)
        self.reset()

    def reset(self) -> None:
        """Forget the motion of the call before, which a call begins with."""
        self._check.forget()
        self.solved, self._begun, self._along = False, 0.0, 0.0
        self._motion: SampledMotion | None = None

    def __call__(self, t: float, q: ArrayLike | Mapping[str, float]) -> Array:
        """The inputs (n_u,) at the end of the sample that begins at t, s, with q: limits of acceleration are
        kept where they get there along a straight line."""
        t, current, x = scalar(t, "t"), self.robot.q(q), self._x
        self._begin(t, current)
        self._place_movers(t)
        self._write_aims(t)
        x.margin[:] = MARGIN
        self.solved = self._found()
        if not self.solved and x.ends[0] > 0.0:  # the plan's end, now, is too much to ask
            self._begin(t, current)
            x.ends[: self.robot.n] = 0.0
            self.solved = self._found()
        if self.solved:
            x.u[-1] = 0.0
            samples = MotionSamples(x.inputs, self._times, x.substeps, x.q, x.u, x.a)
            self._motion, self._begun = SampledMotion(samples, ()), t
        return self._ahead(t + self.dt, current)[1][0]

    def run(
        self,
        q0: ArrayLike | Mapping[str, float],
        duration: float,
        until: Goal | None = None,
        disturbances: Disturbances | None = None,
    ) -> Trajectory:
        """The closed loop from q0 at t = 0, inputs linear within samples: until the task's error is within
        tolerances, or over all of `duration`, s. Samples without a motion are told (`horizon_unsolved`).
        With `disturbances` the robot does otherwise than it is told; their samples are dt apart."""
        robot = self.robot
        q = [robot.following.placed(robot.q(q0))]
        robot.check_limits(q[0])
        if self.scene is not None:
            self.scene.check_start(0.0, q[0])
        self.reset()
        parts = max(1, round(self.dt / SHOWN))
        t, u, unsolved, reached = [0.0], [np.zeros(robot.n_u)], [], False
        last = positive(duration, "duration") - 1e-9
        plant = None if disturbances is None else disturbances.plant(robot, self.dt)
        plant = plant if plant is not None and plant.disturbs else None
        while t[-1] < last and not reached:
            seen = q[-1] if plant is None else plant.see(q[-1])
            self(t[-1], seen)
            if not self.solved:
                unsolved.append(t[-1])
            times = t[-1] + self.dt * np.arange(1, parts + 1) / parts
            configurations, inputs = self._ahead(times, seen)
            if plant is not None:
                configurations = plant.go_on(
                    robot, q[-1], u[-1], (inputs[-1] - u[-1]) / self.dt, times - t[-1]
                )
            t, q, u = [*t, *times.tolist()], [*q, *configurations], [*u, *inputs]
            sizes = error_sizes(self._error.evaluate(q[-1], t[-1])[2], self._error.rows)
            reached = until is not None and sizes[0] <= until.m and sizes[1] <= until.rad
        count = {"samples": len(unsolved), "of": (len(t) - 1) // parts}
        warnings = tuple((Finding("horizon_unsolved", count, {"t": time}),) for time in unsolved[:1])
        verdict = Verdict(warnings=warnings)
        if until is not None:
            missed = Finding("not_reached", {"within": t[-1], "m": float(sizes[0]), "rad": float(sizes[1])})
            finding = Finding("reached", {}, {"t": t[-1]}) if reached else missed
            verdict = Verdict(Outcome.COMPLETED if reached else Outcome.MISSED, (finding,), warnings)
        arrays = np.array(t), np.array(q), np.array(u)
        of = self.task, self.limits, self.scene
        return recorded(robot, *arrays, self.dt / parts, *of, "horizon", verdict)

    def _ahead(self, times: ArrayLike, q: Array) -> tuple[Array, Array]:
        """q (K, n) and u (K, n_u) along the motion at times, s; at rest at q where there is none."""
        times = np.atleast_1d(times)
        if self._motion is None:
            return np.tile(q, (len(times), 1)), np.zeros((len(times), self.robot.n_u))
        return self._motion.at(np.minimum(times - self._begun, self._motion.duration))

    def _begin(self, t: float, q: Array) -> None:
        """Begin with the motion of the call before, or at rest."""
        x = self._x
        x.q[:], x.u[:] = self._ahead(t + self._times, q)
        if self._motion is None and self.plan is not None:
            x.q[:], x.u[:] = self.plan(self._times)
            x.u[0] = 0.0
        x.q[0], x.u[-1] = q, 0.0
        x.a[:] = np.diff(x.u, axis=0) / x.step
        x.s[:], x.z[:], x.duals[:], x.mu[()] = 0.0, 0.0, 0.0, MU

    def _found(self) -> bool:
        """Whether a motion was found that keeps everything at the samples' ends, and distances between."""
        blocks = (*self._check.blocks, *self._blocks)
        least = LEAST if self.plan is None else LEAST_ALONG
        for _ in range(LOOKS):
            if self._shoot(*blocks, least, ROUNDS, EXACT) < 0:
                return False
            blocked = self._first_blocked(*blocks)
            if blocked < 0:
                return True
            self._x.margin[blocked : blocked + 2] += MORE
        return False

    def _place_movers(self, t: float) -> None:
        """Where obstacles are from t on: by their motions, else along their velocities."""
        x, second = self._x, self._check.pairs[:, 1]
        for i, (shape, obstacle) in enumerate(self._movers):
            turns = not obstacle.moves and obstacle.twist(t)[3:].any()
            mover = obstacle.going_on(t) if turns else obstacle
            if mover.moves:
                x.tracks[:, i] = [as_row(mover.at(float(time))) for time in t + self._times]
                far = shifts([mover], t + self._times)
            else:
                x.tracks[:, i] = as_row(obstacle.at(t))
                x.tracks[:, i, 9:] += np.outer(self._times, obstacle.twist(t)[:3])
                far = np.linalg.norm(np.diff(x.tracks[:, i, 9:], axis=0), axis=1)
            x.drift[:, second == shape] = far[:, np.newaxis]

    def _write_aims(self, t: float) -> None:
        """The cost: errors of the task, linear about the motion to begin with, or distances to the plan."""
        x, n = self._x, self.robot.n
        if self.plan is None:
            x.pull[:] = PULL
            x.pull[-1] *= LAST
            for k, (time, q) in enumerate(zip(t + self._times, x.q, strict=True)):
                _, _, error, error_q = self._error.evaluate(q, float(time))
                x.aims[k], x.aimed[k] = -error_q, error - error_q @ q
            return
        near = np.minimum(self._along + np.linspace(0.0, WINDOW, POINTS), self.plan.duration)
        off = self.robot.short_way(self.plan(near)[0] - x.q[0])
        self._along = float(near[np.einsum("ki,ki->k", off, off).argmin()])
        x.aims[:], x.pull[:] = np.eye(n), ALONG
        wanted = self.plan(self._along + self._times)[0]
        x.aimed[:] = wanted + (self.robot.short_way(wanted[:1] - x.q[0]) - (wanted[0] - x.q[0]))
        x.goal[:] = x.aimed[-1]
        x.ends[:n] = END * (self._along + NEAR * self._times[-1] > self.plan.duration)

    def _check_steered(self) -> None:
        """Refuse what is steered only by turning to and fro: no cost of distances shows the way there."""
        robot, rng = self.robot, np.random.default_rng(0)
        q = robot.rest + rng.uniform(-1.0, 1.0, robot.n)
        error_q = self._error.evaluate(q)[3]
        if np.linalg.matrix_rank(error_q @ robot.S(q)) < np.linalg.matrix_rank(error_q):
            raise InputError(
                f"the inputs of {robot.name} do not move all of it at once",
                where="horizon: goal",
                expected="a plan to it, Horizon(robot, nmm.plan(robot, q, goal))",
            )
