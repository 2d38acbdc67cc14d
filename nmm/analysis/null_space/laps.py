"""Repeatability: whether the robot comes back to its posture when the task has gone round a closed path.

A fixed base with the extended Jacobian does (Baillieul 1985): (r, y) fix q locally. With the pseudoinverse
it does not (Klein and Huang 1983). On wheels (r, y) leave n - m coordinates open, which the rolling carries
along, from lap to lap by a map of their own. With the unicycle and its extended Jacobian that is the map of a
trailer, or of the hatchet planimeter: round a large path the platform is drawn into a motion that repeats
itself, round one smaller than the trailer's length it turns on and on (Foote, Levi and Tabachnikov 2013).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias, Union

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import Array, Integers, counted, positive
from nmm.base.errors import InputError, expect, no_such
from nmm.base.findings import Finding
from nmm.base.kernels.rotations import exp3
from nmm.base.progress import Progress, between
from nmm.control.controller import Controller
from nmm.control.functions.function import Function
from nmm.control.functions.program import evaluate
from nmm.control.functions.references import Bearing, Circle, PiecewisePolynomial, PoseReference
from nmm.model.robots.configuration import Configuration
from nmm.model.robots.robot import Robot
from nmm.motion.simulation import simulate
from nmm.motion.trajectory import Outcome, Trajectory

if TYPE_CHECKING:
    from nmm.scenario import Scenario

#: A drift below this has closed: what the integrator and the feedback leave, m and rad.
CLOSED = 1e-6
#: A drift that falls at least by this factor from lap to lap converges.
FALLS = 0.9

#: What goes round: a scenario, or controllers by name with their start.
Rounds: TypeAlias = Union["Scenario", tuple[Mapping[str, Controller], ArrayLike | Mapping[str, float]]]


@dataclass(frozen=True, eq=False)
class Laps:
    """The laps of one resolver: K of those asked for, fewer where the run ended early.

    Attributes
    ----------
    name : the resolver's, or the controller's
    trajectory : the run, sampled at each lap's end
    period : s
    asked : how many laps were asked for
    q (K + 1, n) : at the start and at each lap's end, angles not wrapped
    errors (K + 1,) : norm of the task error there

    Examples
    --------
    >>> scenario = nmm.Scenario.load("unicycle_2r_position")
    >>> both = nmm.analysis.repeatability(scenario, laps=2, dt=0.02, resolvers=["pg"])
    >>> laps = both.laps[0]
    >>> laps.finished, laps.q.shape
    (True, (3, 5))
    """

    name: str
    trajectory: Trajectory
    period: float
    asked: int
    q: Array
    errors: Array

    @property
    def robot(self) -> Robot:
        """The robot that went round."""
        return self.trajectory.robot

    @property
    def drift(self) -> Array:
        """(K, n): q(kT) - q((k - 1)T), angles not wrapped, m and rad."""
        return np.diff(self.q, axis=0)

    @property
    def turns(self) -> Integers:
        """(K, n): full turns of each lap, counted where one is the same posture (`Robot.continuous`)."""
        robot = self.robot
        turned = np.round(self.drift[:, robot.own_or_leader] / (2.0 * np.pi))
        return (turned * robot.turns()).astype(np.int64)

    @property
    def posture_drift(self) -> Array:
        """(K, n): `drift` without the full turns."""
        return self.drift - 2.0 * np.pi * self.turns

    @property
    def distance(self) -> Array:
        """(K,): norm of `posture_drift`, m and rad together."""
        return np.asarray(np.linalg.norm(self.posture_drift, axis=1))

    @property
    def displacement(self) -> Array:
        """(K,): how far the platform stands from where it stood a lap before, m; 0 for a fixed base."""
        xy = min(self.robot.platform.n_p, 2)
        return np.asarray(np.linalg.norm(self.drift[:, :xy], axis=1))

    @property
    def factor(self) -> float | None:
        """The last lap's drift over the one before (infinite if that was 0); None with fewer than three laps,
        of which the first holds the transient."""
        distance = self.distance
        if len(distance) < 3:
            return None
        return float(distance[-1] / distance[-2]) if distance[-2] > 0.0 else math.inf

    @property
    def finished(self) -> bool:
        """Whether it went as many laps as asked."""
        return len(self.distance) == self.asked

    @property
    def closes(self) -> bool:
        """Whether the last lap led back to the posture it began in."""
        return bool(len(self.distance)) and float(self.distance[-1]) < CLOSED

    @property
    def converges(self) -> bool:
        """Whether the drift has closed, or falls from lap to lap since the second."""
        later = self.distance[1:]
        falls = len(later) > 1 and bool(np.all(later[1:] < np.maximum(FALLS * later[:-1], CLOSED)))
        return self.closes or falls

    @property
    def winding(self) -> Finding | None:
        """Full turns of the last lap, "full_turns"; None where there is none. Cables wind up with them."""
        last = self.turns[-1:].sum(axis=0).tolist()
        turned = {name: turns for name, turns in zip(self.robot.q_names, last, strict=True) if turns}
        return Finding("full_turns", {"turns": turned}) if turned else None

    @property
    def verdict(self) -> Finding:
        """Whether the motion repeats itself, converges or drifts, or that too little was seen."""
        if not self.finished:
            values = {"lap": len(self.distance) + 1, "message": str(self.trajectory.message)}
            return Finding("laps_ended", values)
        drift = {"drift": float(self.distance[-1])}
        if self.closes:
            return Finding("laps_repeat", drift)
        if self.factor is None:
            return Finding("laps_too_few", drift)
        return Finding("laps_converge" if self.converges else "laps_drift", {**drift, "factor": self.factor})


@dataclass(frozen=True, eq=False)
class Repeatability:
    """Laps of several resolvers round the same path.

    Attributes
    ----------
    laps : of each, in the order given
    period : s

    Examples
    --------
    >>> both = nmm.analysis.repeatability(nmm.Scenario.load("unicycle_2r_position"), laps=1, dt=0.02)
    >>> round(both.period), both["pg"].q.shape
    (25, (2, 5))
    """

    laps: tuple[Laps, ...]
    period: float

    def __getitem__(self, name: str) -> Laps:
        for run in self.laps:
            if run.name == name:
                return run
        raise no_such("resolver", name, [run.name for run in self.laps], "laps")

    @property
    def complete(self) -> bool:
        """Whether all went the requested laps."""
        return all(run.finished for run in self.laps)

    @property
    def transient(self) -> Finding:
        """How far from the path the first lap begins, "first_lap"."""
        first = max((float(run.errors[0]) for run in self.laps if len(run.errors)), default=0.0)
        return Finding("first_lap", {"error": first, "on_path": first <= CLOSED})

    def text(self) -> str:
        """Drift and verdict of each, for people."""
        lines = [f"period {self.period:.6g} s; {self.transient}"]
        for run in self.laps:
            drifts = ", ".join(f"{value:.2g}" for value in run.distance)
            lines.append(f"{run.name}: {run.verdict}" + (f" (lap by lap {drifts})" if drifts else ""))
            if run.winding:
                lines.append(f"{' ' * len(run.name)}  {run.winding}")
        return "\n".join(lines)


def repeatability(
    subject: Rounds,
    *,
    laps: int = 5,
    resolvers: Sequence[str] = ("rg", "pg"),
    period: float | None = None,
    dt: float | None = None,
    progress: Progress | None = None,
) -> Repeatability:
    """Go round a closed path several times, with each resolver.

    Parameters
    ----------
    subject : a scenario, or (controllers by name, q0)
    laps : how many, at least 1; 3 or more tell whether the drift falls
    resolvers : kinds, for a scenario
    period : s; not needed where all that moves are circles and periodic splines
    dt : s, at most; made to divide the period; the scenario's, or 0.005, when not given
    progress : called with the fraction done

    Raises
    ------
    InputError : the task's references do not repeat themselves with a period, or one has to be given

    Examples
    --------
    >>> both = nmm.analysis.repeatability(nmm.Scenario.load("unicycle_2r_position"), laps=2, dt=0.02)
    >>> both.complete, [run.name for run in both.laps]
    (True, ['rg', 'pg'])
    """
    laps = counted(laps, "laps")
    from nmm.scenario import Scenario  # imported by those who have one: it brings pydantic

    scenarios: dict[str, Scenario] = {}
    controllers: Mapping[str, Controller]
    if isinstance(subject, Scenario):
        scenarios = {kind: subject.with_resolver(kind) for kind in resolvers}
        controllers = {kind: scenario.controller() for kind, scenario in scenarios.items()}
        q0: ArrayLike | Mapping[str, float] = subject.parts.q0
        dt = subject.parts.dt if dt is None else dt
    elif isinstance(subject, tuple) and len(subject) == 2 and isinstance(subject[0], Mapping):
        controllers, q0 = subject
    else:
        expected = "a Scenario or ({name: Controller}, q0)"
        raise InputError(where="repeatability", expected=expected, got=subject)
    expect(controllers, "resolvers", "at least one")
    start = next(iter(controllers.values())).robot.q(q0)
    T = common_period(controllers.values(), start) if period is None else positive(period, "period")
    for controller in controllers.values():
        expect_periodic(controller, start, T, laps)
    samples = max(1, math.ceil(T / positive(0.005 if dt is None else dt, "dt") - 1e-9))
    runs = []
    for k, (name, controller) in enumerate(controllers.items()):
        report = between(progress, k / len(controllers), 1.0 / len(controllers))
        if name in scenarios:
            timed = scenarios[name].override("duration", laps * T).override("dt", T / samples)
            trajectory = timed.run(report)
        else:
            trajectory = simulate(controller, q0, laps * T, T / samples, progress=report)
        ends = np.arange(min(laps, (len(trajectory) - 1) // samples) + 1) * samples
        runs.append(Laps(name, trajectory, T, laps, trajectory.q[ends], trajectory.error_norm[ends]))
        if trajectory.outcome is Outcome.INTERRUPTED:
            break
    return Repeatability(tuple(runs), T)


#: References may differ by this after a period, m and rad.
SAME = 1e-6
#: Periods of several references are taken together up to so many of the longest.
MOST_ROUNDS = 12


def common_period(controllers: Iterable[Controller], q: Array) -> float:
    """The common period of all task references, s; those that depend on q are evaluated at q (n,)."""
    periods: list[float] = []
    for controller in controllers:
        configuration = Configuration(controller.robot, q)
        for task in (*controller.task, *controller.given.added_task):
            periods += _periods(task.reference, configuration)
    if not periods:
        expected = "a reference that goes round, as a circle, or the time in which it does"
        raise InputError("the task stands still", where="period", expected=expected)
    longest = max(periods)
    for rounds in range(1, MOST_ROUNDS + 1):
        T = rounds * longest
        if all(abs(T / period - round(T / period)) < 1e-9 * T / period for period in periods):
            return T
    each = ", ".join(f"{period:.6g} s" for period in dict.fromkeys(periods))
    what = f"the references go round in {each}, which have no common period"
    raise InputError(what, where="period", expected="the time after which all are back")


def _periods(reference: Function, configuration: Configuration) -> list[float]:
    """The periods of what moves in a reference, s; none for what stands still."""
    if isinstance(reference, Circle) and not reference.run_up:
        return [2.0 * math.pi / abs(reference.rate)] if reference.rate else []
    if isinstance(reference, PiecewisePolynomial) and reference.repeats:
        return [float(reference.breaks[-1] - reference.breaks[0])]
    if isinstance(reference, Bearing):
        return _periods(reference.of, configuration)
    if isinstance(reference, PoseReference):
        return _periods(reference.position, configuration) + _periods(reference.orientation, configuration)
    values = [evaluate(reference, t, configuration).value for t in (0.0, 0.37, 1.7, 7.3, 31.0)]
    if all(np.array_equal(values[0], value) for value in values[1:]):
        return []
    what = f"{type(reference).__name__} does not say its period"
    raise InputError(what, where="period", expected="the time in which the reference goes round")


def expect_periodic(controller: Controller, q: Array, T: float, laps: int) -> None:
    """`InputError` where a reference is elsewhere a period later, at any time of the laps."""
    configuration = Configuration(controller.robot, q)
    starts = T * np.array([0.0, 0.1234, 0.3579, 0.61803, 0.9])
    for task in (*controller.task, *controller.given.added_task):
        rows, turns = task.rows(controller.robot), task.function.comparison is not None
        angular = [row.angular for row in rows]
        values = [evaluate(task.reference, t, configuration).value for t in starts]
        first = [_comparable(value, angular, turns) for value in values]
        for lap in range(1, laps + 1):
            for k, t in enumerate(starts[:1] if lap == laps else starts):
                value = evaluate(task.reference, t + lap * T, configuration).value
                moved = np.abs(_comparable(value, angular, turns) - first[k]).max()
                if not moved < SAME:
                    names = ", ".join(row.name for row in rows)
                    raise InputError(
                        f"the reference of {names} is not where it was {T:.6g} s before, at "
                        f"t = {t + lap * T:.4g} s ({moved:.3g} away): "
                        "expected a path that goes round, and its period",
                        where="period",
                    )


def _comparable(value: Array, angular: Sequence[bool], turns: bool) -> Array:
    """The same for the same target: of an angle its cosine and sine, of a turn its matrix."""
    if turns:
        R = np.empty((3, 3))
        exp3(np.ascontiguousarray(value[-3:]), R)
        return np.concatenate([value[:-3], R.ravel()])
    parts = [[np.cos(v), np.sin(v)] if is_angle else [v] for v, is_angle in zip(value, angular, strict=True)]
    return np.concatenate(parts)
