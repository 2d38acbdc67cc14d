"""Self-motion: the robot moves along J's null space, there and back, while its task stays where it is."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from nmm.analysis.null_space.motion_words import input_words, motion_text
from nmm.analysis.null_space.null_fields import (
    ALONE,
    FOLLOW,
    FOLLOWED,
    UNDEFINED,
    WORDS,
    Direction,
    Field,
    MotionEnded,
    direction_at,
    expect_direction,
    follow,
    null_field,
)
from nmm.analysis.singular.jacobians import Jacobians, Reached, Subject, checked
from nmm.analysis.singular.singularity import TOLERANCE
from nmm.base.arrays import Array, positive
from nmm.base.errors import InputError, SingularError, expect
from nmm.base.findings import Finding
from nmm.base.kernels.compiled import checked_by_caller
from nmm.base.kernels.record_layout import views
from nmm.base.text_format import listed
from nmm.control.controller import Controller
from nmm.control.functions.program import BESIDE, COMPILED, evaluate
from nmm.control.functions.references.polynomial import Constant
from nmm.control.functions.tasks.task import Stack, Task
from nmm.control.integrators import RK4
from nmm.control.resolvers.answer import Status
from nmm.control.resolvers.projected_gradient import ProjectedGradient
from nmm.control.step.equations import ControlStep
from nmm.control.step.step import Step
from nmm.model.robots.configuration import Configuration
from nmm.model.robots.robot import Robot
from nmm.motion.diagnosis.diagnose import lines, noticed
from nmm.motion.recording import Recorder
from nmm.motion.trajectory import Trajectory
from nmm.motion.verdict import Outcome, Verdict

#: How fast the task is brought back from the integrator's drift, 1/s.
GAIN = 10.0
#: A motion that must end early is done again this much shorter, so that it comes to rest before the end.
SHORTER = 0.98
#: The integration's steps are at most so long, s, and along the path, m and rad.
STEP, STRIDE = 0.01, 0.005
#: The most samples and steps of a way.
MOST_SAMPLES, MOST_STEPS = 100_000, 1_000_000
#: Half the range about q in which J's rank is looked at, m and rad.
AROUND = 1e-2


@dataclass(frozen=True, eq=False)
class SelfMotion:
    """A self-motion there and back.

    Attributes
    ----------
    trajectory : its samples; the second half is the first one backwards, q to the last bit, inputs negated
    text : in words, as it begins, the largest rate 1
    length : of the way there, ∫‖u‖ dt, in m and rad
    ended : why the way there is shorter than asked; "" where it is not

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> moved = nmm.analysis.self_motion((robot, nmm.Posture("q1", "q2")), robot.rest, duration=1.0)
    >>> moved.text
    'the platform drives forward at 1 m/s alone'
    """

    trajectory: Trajectory
    text: str
    length: float
    ended: str

    @property
    def turning(self) -> int:
        """The sample at which it turns back."""
        return len(self.trajectory) // 2


def self_motion(
    subject: Subject,
    q: ArrayLike | Mapping[str, float],
    *,
    direction: Direction = 0,
    duration: float = 4.0,
    speed: float = 0.5,
    dt: float = 0.01,
    t: float = 0.0,
) -> SelfMotion:
    """Move along J's null space from q, then back, holding the task at its value at (t, q).

    The inputs are u = ṡ(t) n(q) + J⁺ K (e - e0): n, of length 1, lies in null J and is continuous, the path
    length s begins and ends at rest, and the feedback takes out the integrator's drift of the task's error e
    (fourth-order Runge-Kutta). For the number of a readable null vector, n is the null vector of its few
    inputs alone, at every q (unless they depend on each other only at the q given); for wished inputs w it is
    (I - J⁺ J) w.

    Parameters
    ----------
    subject : a controller, or (robot, task); a reference that moves in time is held at rest
    q : (n,) m and rad, or by name; within the limits
    direction : number of a vector of `redundancy(subject, q).readable`, or wished inputs: a name, numbers by
        name, or (m,)
    duration : of the way there, s; that back takes as long
    speed : the largest ‖u‖, m/s and rad/s together
    dt, t : s between samples; s, of the references

    Raises
    ------
    InputError : no such direction, one that moves the task, numbers that are not above zero, q outside limits
    SingularError : J is singular at q, though not nearby: its null space there is not that of the motion; or
        the motion cannot begin, at a limit

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> moved = nmm.analysis.self_motion((robot, nmm.Position("ee", "xy")), {"q2": 0.5}, duration=1.0)
    >>> bool(np.ptp(moved.trajectory.r, axis=0).max() < 1e-6)
    True
    """
    jacobians = Jacobians(subject)
    t, q = checked(jacobians, t, q)
    robot = jacobians.robot
    duration, speed = positive(duration, "duration"), positive(speed, "speed")
    dt = positive(dt, "dt")
    expect(dt <= duration / 4.0, "dt", f"at most a quarter of the duration, {duration / 4.0:g} s", dt)
    robot.check_limits(q)
    length = 2.0 * speed * duration / np.pi
    if not duration / dt <= MOST_SAMPLES:
        what = f"{duration:g} s in steps of {dt:g} s are {duration / dt:.3g} samples"
        raise InputError(what, where="duration", expected=f"at most {MOST_SAMPLES}")
    strides = length * np.pi / 2.0 / STRIDE
    if not strides <= MOST_STEPS:
        way = f"a way of {length:.3g} m and rad (speed {speed:g}, duration {duration:g} s)"
        raise InputError(f"{way} takes {strides:.3g} steps", where="speed", expected=f"at most {MOST_STEPS}")
    J = jacobians.J(t, q)
    rank = jacobians.rank(J, TOLERANCE)
    expect_direction(robot, J, rank, direction)
    nearby = _nearby(jacobians, t, q, rank)
    motion = _SelfMotionPath(
        robot, held(jacobians, t, q), t, q, null_field(robot, J, nearby, rank, direction)
    )
    steps = max(4, round(duration / dt))
    times = np.linspace(0.0, duration, steps + 1)
    samples, ended = motion.run(times, length)
    why = ended
    while ended:
        reached = length * (1.0 - np.cos(np.pi * times[len(samples) - 1] / duration)) / 2.0
        if len(samples) < 3 or reached < 1e-3 * 2.0 * speed * duration / np.pi:
            raise SingularError(
                f"the self-motion cannot begin: {ended} (the other way may be free: the inputs negated)"
            )
        length, why = SHORTER * reached, ended
        samples, ended = motion.run(times, length)
    return motion.there_and_back(samples, times, length, why)


def held(jacobians: Jacobians, t: float, q: Array) -> Stack:
    """The task with its values at q as targets; references that depend on the configuration stay."""
    tasks = []
    configuration = Configuration(jacobians.robot, q)
    for task in jacobians.task:
        reference = task.reference
        if isinstance(reference, Reached) or not np.any(evaluate(reference, t, configuration).value_q):
            value = evaluate(task.function, t, configuration).value
            reference = Constant(value, task.rows(jacobians.robot)[0].unit)
        tasks.append(Task(task.function, reference, GAIN))
    return Stack(tuple(tasks))


def _nearby(jacobians: Jacobians, t: float, q: Array, rank: int) -> Array:
    """J (k, s, m) at random configurations about q; `SingularError` where its rank is larger there."""
    near = q + AROUND * np.random.default_rng(0).uniform(-1.0, 1.0, (8, q.size))
    J_near = jacobians.batch(near, t)
    J_near = J_near[np.isfinite(J_near).all(axis=(1, 2))]
    most = max((jacobians.rank(J, TOLERANCE) for J in J_near), default=rank)
    if most > rank:
        raise SingularError(
            f"J has rank {rank} at q and {most} nearby: q is singular, and a motion that leaves "
            "the task at rest there moves it a little further on; expected a q that is not singular"
        )
    return J_near


class _SelfMotionPath:
    def __init__(self, robot: Robot, task: Stack, t: float, q: Array, field: Field) -> None:
        self.robot, self.t, self.q, self.field = robot, t, q, field
        self.controller = Controller(robot, task, ProjectedGradient(), steering=False, kinematics=COMPILED)
        self.e0 = self.controller.evaluate(t, q).error
        self.angular = np.array([row.angular for row in task.rows(robot)], dtype=bool)
        self.last, self.along = np.zeros(robot.n_u), np.zeros(robot.n_u)
        self._solve = self.controller.solver.solve
        self._follow = checked_by_caller(follow, FOLLOW)
        self._q_dot = views(ControlStep, *self.controller.solver.blocks, BESIDE).q_dot

    def run(self, times: Array, length: float) -> tuple[list[Step], str]:
        """Samples at the times, or as far as the motion goes, and why it ended."""
        duration, dt = float(times[-1]), float(times[1])
        substeps = int(np.ceil(max(dt / STEP, dt * length * np.pi / (2.0 * duration) / STRIDE) - 1e-9))
        self.last[:] = 0.0

        def velocity(time: float, q: Array) -> Array:
            return self._velocity(q, length * np.pi / (2.0 * duration) * math.sin(np.pi * time / duration))

        samples: list[Step] = []
        q = self.q
        try:
            q_dot = velocity(0.0, q)
            for k, time in enumerate(times.tolist()):
                samples.append(self._sample(time, q))
                if k + 1 == len(times):
                    break
                for h in range(substeps):
                    self.last[:] = self.along
                    at = time + h * dt / substeps
                    q = RK4.advance(velocity, at, q, q_dot, samples[-1].u, dt / substeps)
                    q_dot = velocity(time + (h + 1) * dt / substeps, q)
        except MotionEnded as ended:
            return samples, str(ended)
        return samples, ""

    def _velocity(self, q: Array, rate: float) -> Array:
        """q_dot at q (n,), ‖u‖ being `rate` but for what holds the task."""
        self._solve(self.t, q)
        arguments = self.field, self.e0, self.angular, self.last, rate, GAIN, self.along
        outcome = self._follow(*self.controller.solver.blocks, *arguments)
        if outcome == UNDEFINED:
            raise MotionEnded(
                self.robot.platform.problem(q[: self.robot.platform.n_p]) or "the task is undefined"
            )
        if outcome == ALONE:
            names = listed([self.robot.u_names[column] for column in self.field.columns])
            raise MotionEnded(f"{names} alone come close to a singular configuration")
        if outcome != FOLLOWED:
            raise MotionEnded(WORDS[outcome])
        return self._q_dot.copy()

    def _sample(self, time: float, q: Array) -> Step:
        step = self.controller.last(time, q)
        lower, upper = self.robot.q_limits.T
        beyond = np.flatnonzero((q < lower - 1e-9) | (q > upper + 1e-9))
        names = [self.robot.q_names[i] for i in beyond if i in self.robot.following.independent]
        if names:
            raise MotionEnded(f"{listed(names)} at the limit")
        problem = self.robot.platform.problem(q[: self.robot.platform.n_p])
        if problem is not None:
            raise MotionEnded(problem)
        return replace(step, r_d=step.r + step.error, status=Status.SOLVED)

    def there_and_back(self, samples: list[Step], times: Array, length: float, ended: str) -> SelfMotion:
        """The way there and the same way back: q at mirrored times, the inputs negated."""
        back = [
            replace(sample, t=2.0 * float(times[-1]) - sample.t, u=-sample.u, q_dot=-sample.q_dot)
            for sample in samples[-2::-1]
        ]
        every = [*samples, *back]
        recorder = Recorder(self.controller, np.array([sample.t for sample in every]))
        for sample in every:
            recorder.add(sample)
        if ended:
            recorder.findings.append(Finding("turned_back_early", {"text": ended}))
        robot = self.robot
        first = direction_at(samples[0].J, self.field)
        words = input_words(robot, self.q)
        text = motion_text(first / np.abs(first).max(), robot.u_names, robot.u_units, words, robot.platform.p)
        trajectory = recorder.trajectory(float(times[1]), "rk4")
        verdict = Verdict(warnings=lines(noticed(recorder), Outcome.COMPLETED)).after(recorder.findings)
        # The task rests: there is no path that it should follow.
        trajectory = replace(trajectory, resolver="self-motion", desired=None, verdict=verdict)
        return SelfMotion(trajectory, text, length, ended)
