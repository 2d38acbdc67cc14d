"""Repeatability: whether the robot comes back to its posture when the task has gone round a closed path.

A fixed base with the extended Jacobian does (Baillieul 1985): (r, y) fix q locally. With the pseudoinverse
it does not (Klein and Huang 1983). On wheels (r, y) leave n - m coordinates open, which the rolling carries
along, from lap to lap by a map of their own. With the unicycle and its extended Jacobian that is the map of a
trailer, or of the hatchet planimeter: round a large path the platform is drawn into a motion that repeats
itself, round one smaller than the trailer's length it turns on and on (Foote, Levi and Tabachnikov 2013).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias, Union

import numpy as np
from numpy.typing import ArrayLike

from nmm.analysis.redundancy.periods import common_period, expect_periodic
from nmm.arrays import Array, Integers, counted, positive
from nmm.control.controller import Controller
from nmm.errors import InputError, unknown
from nmm.progress import Progress, between
from nmm.robots.robot import Robot
from nmm.runs.simulation import simulate
from nmm.runs.trajectory import Outcome, Trajectory

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
        """(K, n): full turns of each lap, counted where one is the same posture: of angles without limits."""
        free = ~self.robot.limited.any(axis=1) & (np.array(self.robot.q_units) == "rad")
        return np.where(free, np.round(self.drift / (2.0 * np.pi)), 0.0).astype(np.int64)

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
        """The last lap's drift over that of the lap before (infinite where that was 0); None with fewer than
        three laps, of which the first holds the transient."""
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
    def winding(self) -> str:
        """Full turns of the last lap, in words; "" where there is none. Cables wind up with them."""
        last = self.turns[-1] if len(self.turns) else np.zeros(self.robot.n, dtype=np.int64)
        turned = [f"{name} {turns:+d}" for name, turns in zip(self.robot.q_names, last, strict=True) if turns]
        return f"full turns in the last lap: {', '.join(turned)}" if turned else ""

    @property
    def verdict(self) -> str:
        """A phrase: repeats, converges, drifts, or that too little was seen."""
        if not self.finished:
            return f"ended in lap {len(self.distance) + 1}: {self.trajectory.message}"
        last = f"{self.distance[-1]:.2g} in the last lap"
        if self.closes:
            return f"repeats itself: drift {last}"
        if self.factor is None:
            return f"drift {last}; expected at least 3 laps to tell whether it falls"
        if self.converges:
            return f"converges: drift {last}, {self.factor:.2g} times that of the lap before"
        return f"drifts: {last}, {self.factor:.2g} times that of the lap before"


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
        for one in self.laps:
            if one.name == name:
                return one
        raise InputError(unknown("resolver", name, [one.name for one in self.laps], "laps"))

    @property
    def complete(self) -> bool:
        """Whether all went as many laps as asked."""
        return all(one.finished for one in self.laps)

    @property
    def transient(self) -> str:
        """What to know of the first lap."""
        first = max((float(one.errors[0]) for one in self.laps if len(one.errors)), default=0.0)
        begins = f"begins {first:.3g} off the path" if first > CLOSED else "begins on the path"
        return f"lap 1 {begins}, in the posture given: its drift holds the transient"

    def text(self) -> str:
        """Drift and verdict of each, for people."""
        lines = [f"period {self.period:.6g} s; {self.transient}"]
        for one in self.laps:
            drifts = ", ".join(f"{value:.2g}" for value in one.distance)
            lines.append(f"{one.name}: {one.verdict}" + (f" (lap by lap {drifts})" if drifts else ""))
            if one.winding:
                lines.append(f"{' ' * len(one.name)}  {one.winding}")
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
    period : s; not needed where all that moves are circles
    dt : s, at most; made to divide the period; the scenario's, or 0.005, when not given
    progress : called with the fraction done

    Raises
    ------
    InputError : the task's references do not repeat themselves with a period, or one has to be given

    Examples
    --------
    >>> both = nmm.analysis.repeatability(nmm.Scenario.load("unicycle_2r_position"), laps=2, dt=0.02)
    >>> both.complete, [one.name for one in both.laps]
    (True, ['rg', 'pg'])
    """
    laps = counted(laps, "laps")
    from nmm.scenario import Scenario  # imported by those who have one: it brings pydantic

    scenarios: dict[str, Scenario] = {}
    controllers: Mapping[str, Controller]
    if isinstance(subject, Scenario):
        kinds = list(dict.fromkeys(resolvers))
        scenarios = {kind: subject.with_resolver(kind) for kind in kinds}
        controllers = {kind: scenario.controller() for kind, scenario in scenarios.items()}
        q0: ArrayLike | Mapping[str, float] = subject.parts.q0
        step = subject.parts.dt if dt is None else dt
    elif isinstance(subject, tuple) and len(subject) == 2 and isinstance(subject[0], Mapping):
        controllers, q0 = subject
        step = 0.005 if dt is None else dt
    else:
        raise InputError(f"repeatability: expected a Scenario or ({{name: Controller}}, q0), got {subject!r}")
    if not controllers:
        raise InputError("resolvers: expected at least one")
    start = next(iter(controllers.values())).robot.q(q0)
    T = common_period(controllers.values(), start) if period is None else positive(period, "period")
    for controller in controllers.values():
        expect_periodic(controller, start, T, laps)
    samples = max(1, math.ceil(T / positive(step, "dt") - 1e-9))
    found = []
    for k, (name, controller) in enumerate(controllers.items()):
        report = between(progress, k / len(controllers), 1.0 / len(controllers))
        if name in scenarios:
            timed = scenarios[name].override("duration", laps * T).override("dt", T / samples)
            trajectory = timed.run(report)
        else:
            trajectory = simulate(controller, q0, laps * T, T / samples, progress=report)
        ends = np.arange(min(laps, (len(trajectory) - 1) // samples) + 1) * samples
        errors = trajectory.error_norm
        found.append(Laps(name, trajectory, T, int(laps), trajectory.q[ends], errors[ends]))
        if trajectory.outcome is Outcome.INTERRUPTED:
            break
    return Repeatability(tuple(found), T)
