"""What a real robot does to a sampled controller: noise, delay, slip, creep, odometry."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import Array, counted, positive, scalar
from nmm.base.errors import InputError, expect, expect_known
from nmm.control.integrators import Integrator, integrator
from nmm.control.plant import UNDISTURBED, Disturbed, Plant
from nmm.model.robots.robot import Robot
from nmm.motion.localisation import Localisation


class Disturbances:
    """What a real robot does to a sampled controller; by default nothing. `simulate` and `rollout` take them
    with method "zoh".

    q, r and errors of such a run are the robot's, not those that the controller sees; u is what it asks for.

    Parameters
    ----------
    noise : standard deviation of each coordinate that the controller sees, m and rad: a number, (n,), or by
        name
    delay : samples until inputs act; the robot is at rest before
    slip : the share of each input that acts: a number, (m,), or by name
    creep : s; the platform slides to its left with creep v ω
    odometry : whether the controller sees the platform where its wheels' encoders have it, without slip and
        creep; recorded as `believed`
    localisation : what it has beside encoders; the controller sees the platform where a filter of it all has
        it, in place of odometry; none by default
    correct : s, after which odometry is put right each time; never when not given
    seed : of the noise

    Raises
    ------
    InputError : a negative noise, numbers that are not finite, `correct` without odometry, or beside a
        localisation

    Examples
    --------
    >>> scenario = nmm.Scenario.load("unicycle_2r_position")
    >>> worn = nmm.Disturbances(slip={"v": 0.99}, creep=-0.01, odometry=True)
    >>> run = nmm.simulate(scenario.controller(), scenario.parts.q0, 5.0, 0.01, "zoh", disturbances=worn)
    >>> bool(run["drift"][-1] > 0.01)
    True
    """

    def __init__(
        self,
        noise: ArrayLike | Mapping[str, float] = 0.0,
        delay: int = 0,
        slip: ArrayLike | Mapping[str, float] = 1.0,
        creep: float = 0.0,
        odometry: bool = False,
        correct: float | None = None,
        seed: int = 0,
        localisation: Localisation | None = None,
    ) -> None:
        self.noise, self.slip = _numbers(noise, "noise"), _numbers(slip, "slip")
        for deviation in self.noise.values() if isinstance(self.noise, dict) else [self.noise]:
            expect(not np.any(np.asarray(deviation) < 0.0), "noise", "standard deviations, at least 0")
        self.delay, self.seed = counted(delay, "delay", 0), counted(seed, "seed", 0)
        self.creep, self.odometry = scalar(creep, "creep"), bool(odometry)
        self.correct = None if correct is None else positive(correct, "correct")
        self.localisation = localisation
        alone = localisation is None
        expect(
            alone or correct is None, "correct", "nothing beside a localisation, which puts it right", correct
        )
        expect(self.odometry or correct is None, "correct", "nothing without odometry", correct)

    def on(self, robot: Robot, dt: float, count: int | None = None) -> Disturbing:
        """What disturbs one run of the robot, sampled every dt, s, or `count` runs, which may have slip of
        their own, (count, m); `InputError` for what the robot does not have."""
        asked = {"odometry": self.odometry, "creep": self.creep, "localisation": self.localisation}
        for name in (name for name, value in asked.items() if value and robot.platform.n_p < 3):
            raise InputError("is a mobile platform's", where=f"{name}: {robot.name}")
        shape = (robot.n_u,) if count is None else (count, robot.n_u)
        slip = _each(self.slip, 1.0, robot.u_names, shape, "slip")
        return Disturbing(
            noise=_each(self.noise, 0.0, robot.q_names, (robot.n,), "noise"),
            delay=self.delay,
            slip=slip.reshape(-1, robot.n_u),
            creep=self.creep,
            odometry=self.odometry or self.localisation is not None,
            correct=0 if self.correct is None else max(1, round(self.correct / dt)),
            seed=self.seed,
            localisation=self.localisation,
            robot=robot,
            dt=dt,
        )

    def plant(self, robot: Robot, dt: float) -> Plant:
        """A robot that does so, for `Controller.step`: one run of it, sampled every dt, s.

        Examples
        --------
        >>> robot = nmm.load("unicycle_2r")
        >>> task = nmm.Task(nmm.Position("ee", "xy"), [2.0, 1.0])
        >>> controller = nmm.Controller(robot, task, nmm.ProjectedGradient())
        >>> worn, q = nmm.Disturbances(slip={"v": 0.9}).plant(robot, 0.01), robot.q({"q2": 0.5})
        >>> for k in range(500):
        ...     q, u = controller.step(0.01 * k, q, 0.01, "zoh", plant=worn)
        >>> bool(np.linalg.norm(controller.evaluate(5.0, q).error) < 0.02)
        True
        """
        disturbing = self.on(robot, dt)
        plant = disturbing.plant(integrator("zoh", robot, 1e-9), 0, 1)
        return replace(plant, longer=lambda N: disturbing.at(0, N))


class Disturbing(NamedTuple):
    """Disturbances of B runs of a robot, sampled every dt, s: noise (n,), slip (B, m), and what all have in
    common; `correct` in samples."""

    noise: Array
    delay: int
    slip: Array
    creep: float
    odometry: bool
    correct: int
    seed: int
    localisation: Localisation | None
    robot: Robot
    dt: float

    def plant(self, moved_by: Integrator, i: int, samples: int) -> Plant:
        """The robot of run i."""
        localisation, disturbed = self.localisation, self.at(i, samples)
        if localisation is None:
            return Plant(moved_by, disturbed)
        believing = localisation.on(self.robot, self.dt, (self.seed, i, 1))
        return Plant(moved_by, disturbed, believing=believing)

    def at(self, i: int, samples: int) -> Disturbed:
        """Of run i."""
        noisy = bool(np.any(self.noise > 0.0))
        acts = self.delay or self.creep or np.any(self.slip != 1.0)
        if not (noisy or self.odometry or acts):
            return UNDISTURBED
        n, m = len(self.noise), self.slip.shape[1]
        noise = np.zeros((0, n))
        if noisy:
            noise = np.random.default_rng([self.seed, i]).standard_normal((samples, n)) * self.noise
        return Disturbed(
            noise=noise,
            delay=self.delay,
            slip=self.slip[i].copy(),
            creep=self.creep,
            believed=np.zeros((samples if self.odometry else 0, n)),
            correct=self.correct,
            first=0,
            asked=np.zeros((self.delay + samples, 2 * m)),
        )


def check_disturbed(disturbed: Disturbed, method: str) -> None:
    """`InputError` for a method by which a disturbed robot does not move."""
    if len(disturbed.slip) and method != "zoh":
        raise InputError(
            "disturbances are a sampled controller's, whose inputs are held",
            where="method",
            expected="zoh",
            got=method,
        )


def _numbers(value: ArrayLike | Mapping[str, float], what: str) -> Array | dict[str, float]:
    if isinstance(value, Mapping):
        return {str(name): scalar(number, f"{what}: {name}") for name, number in value.items()}
    try:
        numbers = np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(where=what, expected="numbers, or some by name", got=value) from None
    expect(np.all(np.isfinite(numbers)), what, "finite numbers")
    return numbers


def _each(
    numbers: Array | dict[str, float], rest: float, names: Sequence[str], shape: tuple[int, ...], what: str
) -> Array:
    """The numbers for all names, (len(names),) or (B, len(names)); `rest` for those that are not given."""
    if isinstance(numbers, dict):
        for name in numbers:
            expect_known("name", name, names, what)
        numbers = np.array([numbers.get(name, rest) for name in names])
    try:
        return np.broadcast_to(numbers, shape).copy()
    except ValueError:
        raise InputError(where=what, expected=f"a number or shape {shape}", got=numbers.tolist()) from None
