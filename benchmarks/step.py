"""Time of a control step u = controller(t, q), in µs, all in one run:

    python benchmarks/step.py            (--short: a tenth of the calls, to see that all of it runs)

fused     through the public API, as a user's loop calls it
floor     Pinocchio's calls and one function written by hand for the case (`floor.py`)
unfused   the same controller with every kernel run as plain Python (NUMBA_DISABLE_JIT=1)
callable  fused, with the objective as a user's own Python function in the middle
limits    a step without limits, with all of velocity, position and acceleration, and with some that bind;
          of tasks in one level, and of position before orientation
order 2   u_dot beside u, as bundled and with compiled kinematics
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
import timeit
from collections.abc import Callable
from pathlib import Path

import numpy as np

import nmm

CASES = {1: "unicycle_2r_position", 4: "unicycle_3r_position"}
RESOLVERS = ("rg", "pg")
T = 0.3
SHORT = [word for word in sys.argv if word == "--short"]


def microseconds(function: Callable[[], object], seconds: float = 1.0) -> float:
    """The best of nine means, in processor time: the step's own, without what else the machine does."""
    once = min(timeit.repeat(function, number=3, repeat=3)) / 3
    number = max(1, int(seconds / (90 if SHORT else 9) / once))
    return min(timeit.repeat(function, number=number, repeat=9, timer=time.process_time)) / number * 1e6


def controllers() -> dict[str, tuple[nmm.Controller, np.ndarray]]:
    """The cases' controllers, each with a configuration near the start of its motion."""
    found = {}
    for case, name in CASES.items():
        for resolver in RESOLVERS:
            scenario = nmm.Scenario.load(name).with_resolver(resolver)
            robot = scenario.robot()
            q = robot.q(scenario.parts.q0) + 0.1 * np.arange(robot.n)
            found[f"case {case} {resolver}"] = (scenario.controller(), q)
    return found


def with_python_objective(controller: nmm.Controller) -> nmm.Controller:
    """The same controller, its objective evaluated by a Python function with its gradient."""
    objective = controller.given.objective
    squares = objective.squares
    robot = controller.robot
    A = np.array([[dict(_named(s)).get(name, 0.0) for name in robot.q_names] for s in squares])
    c = np.array([s.target for s in squares])
    by_hand = nmm.CallableObjective(
        lambda configuration: 0.5 * float(np.sum((A @ configuration.q - c) ** 2)),
        lambda configuration: A.T @ (A @ configuration.q - c),
    )
    return nmm.Controller(robot, controller.task, controller.resolver, by_hand)


def _named(square: nmm.QuadraticTerm) -> list[tuple[str, float]]:
    of = square.combination
    return [(of, 1.0)] if isinstance(of, str) else list(of.items())


def unfused() -> dict[str, float]:
    """Times of the plain form, measured in a process of its own."""
    environment = os.environ | {"NUMBA_DISABLE_JIT": "1"}
    command = [sys.executable, str(Path(__file__).resolve()), "--plain", *SHORT]
    answer = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    times: dict[str, float] = json.loads(answer.stdout)
    return times


def compare(name: str, controller: nmm.Controller, q: np.ndarray) -> tuple[float, float, float]:
    """Times of floor, fused, and fused with a Python objective, for the same inputs."""
    from floor import floor_controller

    by_hand = floor_controller(int(name.split()[1]), name.split()[2], controller.robot.model)
    difference = np.abs(by_hand(T, q) - controller(T, q)).max()
    if difference > 1e-11:
        raise SystemExit(f"{name}: the floor and the toolkit differ by {difference:.1e}")
    floors, fused = [], []
    for _ in range(3):  # interleaved, so that a slow moment of the machine does not fall on one alone
        floors.append(microseconds(lambda: by_hand(T, q), 0.5))
        fused.append(microseconds(lambda: controller(T, q), 0.5))
    user = with_python_objective(controller)
    return min(floors), min(fused), microseconds(lambda: user(T, q))


def far_pose() -> tuple[nmm.Controller, np.ndarray]:
    """A controller without limits for two levels, position before orientation, and where it starts."""
    from reaching import FRAME, HOME, the_robot

    robot = the_robot()
    position = nmm.Task(nmm.Position(FRAME), [1.0, 0.3, 0.6], gain=3.5)
    orientation = nmm.Task(nmm.Orientation(FRAME), [0.3, 1.5, 0.4], gain=3.5, priority=2)
    return nmm.Controller(robot, [position, orientation], nmm.ProjectedGradient(), dt=0.05), robot.q(HOME)


def of_scenario(name: str) -> tuple[nmm.Controller, np.ndarray]:
    """A scenario's controller without limits, and where it starts."""
    scenario = nmm.Scenario.load(name).override("limits", False)
    free = nmm.Controller(*scenario.controller().given._replace(dt=scenario.parts.dt))
    return free, free.robot.q(scenario.parts.q0)


def limited(name: str, free: nmm.Controller, q: np.ndarray, q_dot: float) -> tuple[float, float, float]:
    """Times of a step at q without limits, with all of them, and with some that bind (interleaved)."""

    def with_limits(limits: nmm.Limits) -> nmm.Controller:
        return nmm.Controller(*free.given._replace(limits=limits))

    every = with_limits(nmm.Limits({"platform": 1e3, "arm": 1e3}, acceleration=1e4))
    binding = with_limits(nmm.Limits({"platform": q_dot, "arm": q_dot}, acceleration=1e4))
    if every.evaluate(T, q).scale.min() < 1.0 or binding.evaluate(T, q).scale.min() == 1.0:
        raise SystemExit(f"{name}: expected limits that bind only where they are meant to")
    times: list[list[float]] = [[], [], []]
    for _ in range(5):
        for controller, found in zip((free, every, binding), times, strict=True):
            found.append(microseconds(lambda c=controller: c(T, q), 0.2))
    return min(times[0]), min(times[1]), min(times[2])


def both_orders(controller: nmm.Controller, q: np.ndarray) -> tuple[float, float, float]:
    """Times of order 1, as bundled and with compiled kinematics, and of order 2 (interleaved)."""
    given = controller.given._replace(dt=controller.dt)
    first, compiled, second = (
        nmm.Controller(*one)
        for one in (given, given._replace(kinematics="compiled"), given._replace(order=2))
    )
    u = 0.1 * np.arange(controller.robot.n_u)
    calls = (lambda: first(T, q), lambda: compiled(T, q), lambda: second(T, q, u))
    times: list[list[float]] = [[], [], []]
    for _ in range(5):
        for call, found in zip(calls, times, strict=True):
            found.append(microseconds(call, 0.2))
    return min(times[0]), min(times[1]), min(times[2])


def main() -> int:
    """Print the table; exit status 1 when a fused step takes more than 1.8 times its floor."""
    found = controllers()
    if "--plain" in sys.argv:
        print(json.dumps({name: microseconds(lambda c=c, q=q: c(T, q)) for name, (c, q) in found.items()}))
        return 0
    plain = unfused()
    print(f"{'µs a step':12s}{'floor':>8s}{'fused':>8s}{'ratio':>8s}{'unfused':>9s}{'callable':>10s}")
    worst = 0.0
    for name, (controller, q) in found.items():
        floor, fused, user = compare(name, controller, q)
        worst = max(worst, fused / floor)
        print(f"{name:12s}{floor:8.2f}{fused:8.2f}{fused / floor:8.2f}{plain[name]:9.1f}{user:10.1f}")
    print(f"worst ratio {worst:.2f} (aim: at most 1.8)")
    print(f"\n{'limits':24s}{'none':>8s}{'all':>8s}{'ratio':>8s}{'binding':>9s}{'ratio':>8s}")
    cases = (
        ("unicycle_2r_position", of_scenario("unicycle_2r_position"), 0.05, 1.3, 1.6),
        ("tiago_pose", of_scenario("tiago_pose"), 0.02, 1.5, 1.6),
        ("Panda, two levels", far_pose(), 0.5, 1.5, 2.0),
    )
    for name, there, q_dot, of_all, of_binding in cases:
        free, every, binding = limited(name, *there, q_dot)
        print(
            f"{name:24s}{free:8.2f}{every:8.2f}{every / free:8.2f}{binding:9.2f}{binding / free:8.2f}"
            f"  (aims: {of_all} for all, {of_binding} for binding)"
        )
    print(f"\n{'order 2':24s}{'order 1':>8s}{'compiled':>10s}{'order 2':>9s}{'ratio':>8s}{'ratio':>8s}")
    for name in (
        "unicycle_2r_position",
        "unicycle_3r_position",
        "ur5_unicycle_pose",
        "tiago_pose",
        "pan_tilt_follow",
    ):
        bundled, compiled, second = both_orders(*of_scenario(name))
        ratios = f"{second / bundled:8.2f}{second / compiled:8.2f}"
        print(f"{name:24s}{bundled:8.2f}{compiled:10.2f}{second:9.2f}{ratios}  (aim: 2)")
    return int(worst > 1.8)


if __name__ == "__main__":
    raise SystemExit(main())
