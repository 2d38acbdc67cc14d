"""A robot's loop in which something goes wrong, and what it does then.

python tests/helpers/loop_faults.py            the table of docs/deploy.md
python tests/helpers/loop_faults.py 1000000    so many calls: memory, and how long they take
"""

from __future__ import annotations

import resource
import sys
from collections.abc import Callable
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from wandering import beyond

import nmm
from nmm.base.text_format import listed
from nmm.model.robots.zero_order_hold import HeldInputs

PERIOD = 0.01
#: When the fault begins, s: the robot moves.
BEGINS = 1.5
#: A measurement as it reaches the loop.
Measured = tuple[np.ndarray | None, float]


def make_loop(target: Any = (2.4, 0.6), **given: Any) -> nmm.Loop:
    robot = nmm.load("unicycle_2r")
    task = nmm.Task(nmm.Position("ee", "xy"), target, gain=2.0, speed=0.5)
    limits = nmm.Limits(
        {"platform": 0.8, "arm": 1.5}, {"q1": [-2.0, 2.0]}, acceleration={"platform": 2.0, "arm": 4.0}
    )
    posture = nmm.PreferredPosture({"q1": 0.3, "q2": 0.9})
    resolver = nmm.DampedLeastSquares(alpha=1.0)
    controller = nmm.Controller(robot, task, resolver, posture, limits=limits, kinematics="compiled")
    return nmm.Loop(controller, PERIOD, **given)


class Tried(NamedTuple):
    """What became of a loop: codes found, the time from the fault to rest (nan for none), by how much limits
    of velocity, acceleration and position were broken, and where the robot is."""

    loop: nmm.Loop
    codes: tuple[str, ...]
    to_rest: float
    broken: float
    q: np.ndarray


def drive(
    loop: nmm.Loop,
    duration: float = 4.0,
    measure: Callable[[float, np.ndarray], Measured] | None = None,
    clock: Callable[[float], float] = float,
    called: Callable[[float], bool] | None = None,
    each: Callable[[float], None] | None = None,
) -> Tried:
    """Drive a robot that does as it is told. measure(t, q) : what the loop is given; clock(t) : what the
    clock shows; called(t) : whether the loop runs; each(t) : before each call."""
    controller = loop.controller
    kept, held = controller.solver.limits_on, HeldInputs(controller.robot)
    change = kept.accelerations * PERIOD * (1 + 1e-9)
    q, u = controller.robot.q({"q1": 0.3, "q2": 0.9}), np.zeros(controller.robot.n_u)
    broken, rest = 0.0, float("nan")
    for k in range(round(duration / PERIOD)):
        t = k * PERIOD
        if called is None or called(t):
            if each is not None:
                each(t)
            read, at = (q.copy(), t) if measure is None else measure(t, q.copy())
            before, u = u, loop.step(clock(t), read, clock(at))
            broken = max(
                broken,
                beyond(u, kept.inputs),
                beyond(u - before, np.column_stack([-change, change])),
                beyond(q, kept.coordinates),
            )
            if loop.state is nmm.LoopState.STOPPED and np.isnan(rest):
                rest = t - BEGINS
        q = held(q, u, PERIOD)
    return Tried(loop, tuple(one.code for one in loop.findings), rest, broken, q)


def from_then(wrong: Callable[[float, np.ndarray], Measured], lasts: float = 9.0) -> dict[str, Any]:
    return {"measure": lambda t, q: wrong(t, q) if BEGINS <= t < BEGINS + lasts else (q, t)}


def frozen() -> dict[str, Any]:
    seen: list[np.ndarray] = []

    def measure(t: float, q: np.ndarray) -> Measured:
        if t < BEGINS:
            seen[:] = [q]
        return seen[0], t

    return {"measure": measure}


def late(by: float) -> dict[str, Any]:
    past: list[Measured] = []

    def measure(t: float, q: np.ndarray) -> Measured:
        past.append((q, t))
        return past[max(0, len(past) - 1 - round(by / PERIOD))] if t >= BEGINS else (q, t)

    return {"measure": measure}


def old(by: float) -> Callable[[float, np.ndarray], Measured]:
    """Where the robot was so long ago, s, as if it were now."""
    past: list[np.ndarray] = []

    def measure(t: float, q: np.ndarray) -> Measured:
        past.append(q)
        return past[max(0, len(past) - 1 - round(by / PERIOD))], t

    return measure


def to_its_limit() -> nmm.Loop:
    """q1 goes fast to its limit."""
    loop = make_loop((-2.4, 1.6))
    given = loop.controller.given
    posture, resolver = nmm.PreferredPosture({"q1": 3.0, "q2": 0.9}), nmm.DampedLeastSquares(alpha=3.0)
    controller = nmm.Controller(
        given.robot, given.task, resolver, posture, limits=given.limits, kinematics="compiled"
    )
    return nmm.Loop(controller, PERIOD)


def twice() -> dict[str, Any]:
    seen: list[Measured] = []

    def measure(t: float, q: np.ndarray) -> Measured:
        if not seen or round(t / PERIOD) % 2:
            seen[:] = [(q, t)]
        return seen[0]

    return {"measure": measure}


def swapped() -> dict[str, Any]:
    past: list[Measured] = []

    def measure(t: float, q: np.ndarray) -> Measured:
        past.append((q, t))
        return past[-1] if len(past) < 4 or len(past) % 2 else past[-4]

    return {"measure": measure}


def shifted(by: list[float], lasts: float = 9.0) -> dict[str, Any]:
    return from_then(lambda t, q: (q + by, t), lasts)


def silent(lasts: float) -> dict[str, Any]:
    """A task without a value."""
    target = nmm.LiveTarget([2.4, 0.6])
    loop = make_loop(target)

    def each(t: float) -> None:
        gains = loop.controller.solver.step_memory.task.gain
        gains[:] = np.nan if BEGINS <= t < BEGINS + lasts else 2.0 * np.eye(2)

    return {"loop": loop, "each": each}


#: What goes wrong, in words and as arguments of `drive`; the state at the end, the codes, why most were
#: refused.
FAULTS: dict[str, tuple[Callable[[], dict[str, Any]], str, list[str], str | None]] = {
    "nothing": (dict, "running", [], None),
    "measurements 40 ms late": (lambda: late(0.04), "running", ["measurement_refused"], "out_of_order"),
    "measurements 150 ms late": (
        lambda: late(0.15),
        "stopped",
        ["measurement_refused", "measurements_ended", "stopped"],
        "old",
    ),
    "none for 80 ms": (lambda: from_then(lambda t, q: (None, t), 0.08), "running", [], "lost"),
    "none any more": (
        lambda: from_then(lambda t, q: (None, t)),
        "stopped",
        ["measurements_ended", "stopped"],
        "lost",
    ),
    "each twice": (
        twice,
        "running",
        [],
        "repeated",
    ),
    "each second one out of order": (swapped, "running", ["measurement_refused"], "out_of_order"),
    "made in the future": (
        lambda: from_then(lambda t, q: (q, t + 1.0)),
        "stopped",
        ["measurement_refused", "measurements_ended", "stopped"],
        "from_the_future",
    ),
    "frozen, with new times": (
        frozen,
        "stopped",
        ["measurement_refused", "measurements_ended", "stopped"],
        "frozen",
    ),
    "NaN for 50 ms": (
        lambda: from_then(lambda t, q: (q * np.nan, t), 0.05),
        "running",
        ["measurement_refused"],
        "not_finite",
    ),
    "NaN": (
        lambda: from_then(lambda t, q: (q * np.nan, t)),
        "stopped",
        ["measurement_refused", "measurements_ended", "stopped"],
        "not_finite",
    ),
    "one outlier of 0.5 m": (
        lambda: shifted([0.5, 0.0, 0.0, 0.0, 0.0], PERIOD),
        "running",
        ["measurement_refused"],
        "jump",
    ),
    "the localisation jumps by 0.3 m and 0.2 rad": (
        lambda: shifted([0.3, 0.0, 0.2, 0.0, 0.0]),
        "running",
        ["measurement_refused", "relocated"],
        "jump",
    ),
    "an encoder jumps by 1 rad": (
        lambda: shifted([0.0, 0.0, 0.0, 1.0, 0.0]),
        "stopped",
        ["measurement_refused", "measurements_ended", "stopped"],
        "jump",
    ),
    "an encoder drifts by 3 rad/s": (
        lambda: from_then(lambda t, q: (q + 3.0 * (t - BEGINS) * np.eye(5)[3], t)),
        "stopped",
        ["not_following", "stopped"],
        None,
    ),
    "positions 300 ms old, with new times": (
        lambda: {"loop": to_its_limit(), "measure": old(0.3)},
        "stopped",
        ["not_following", "stopped"],
        None,
    ),
    "an encoder in degrees": (
        lambda: {"measure": lambda t, q: (np.where(np.arange(5) == 3, np.rad2deg(q), q), t)},
        "waiting",
        ["outside_limits"],
        None,
    ),
    "the heading wraps": (lambda: shifted([0.0, 0.0, 2.0 * np.pi, 0.0, 0.0]), "running", [], None),
    "the clock jumps back by 5 s": (
        lambda: {"clock": lambda t: t - 5.0 if t >= BEGINS else t},
        "running",
        ["clock_jumped"],
        None,
    ),
    "the clock jumps ahead by 1 h": (
        lambda: {"clock": lambda t: t + 3600.0 if t >= BEGINS else t},
        "stopped",
        ["not_called", "stopped"],
        None,
    ),
    "the clock stands for 50 ms": (
        lambda: {"clock": lambda t: BEGINS if BEGINS <= t < BEGINS + 0.05 else t},
        "running",
        ["clock_jumped", "call_late"],
        None,
    ),
    "no calls for 30 ms": (
        lambda: {"called": lambda t: not BEGINS <= t < BEGINS + 0.03},
        "running",
        ["call_late"],
        None,
    ),
    "each fifth call is missed": (
        lambda: {"called": lambda t: t < BEGINS or round(t / PERIOD) % 5 != 0},
        "running",
        ["call_late"],
        None,
    ),
    "no calls for 0.3 s": (
        lambda: {"called": lambda t: not BEGINS <= t < BEGINS + 0.3},
        "stopped",
        ["not_called", "stopped"],
        None,
    ),
    "no answer for 30 ms": (lambda: silent(0.03), "running", ["resolver_silent"], None),
    "no answer any more": (lambda: silent(9.0), "stopped", ["resolver_silent", "stopped"], None),
}


def try_fault(name: str) -> Tried:
    made = dict(FAULTS[name][0]())
    return drive(made.pop("loop", None) or make_loop(), **made)


def main() -> None:
    for name in FAULTS:
        tried = try_fault(name)
        rest = "-" if np.isnan(tried.to_rest) else f"{tried.to_rest:.2f} s"
        codes = ", ".join(f"`{one}`" for one in dict.fromkeys(tried.codes)) or "-"
        refused = listed([f"{count} {why}" for why, count in tried.loop.refused.items()]) or "-"
        print(f"| {name} | {tried.loop.state} | {codes} | {refused} | {rest} | {tried.broken:.0e} |")


def endure(calls: int) -> None:
    loop = make_loop(nmm.Circle([2, 0], 1.0, rate=0.2))
    held, q = HeldInputs(loop.controller.robot), loop.controller.robot.q({"q1": 0.3, "q2": 0.9})
    spent = np.ones(calls)  # whose memory is there from the start
    for k in range(calls):
        begun = perf_counter()
        u = loop.step(k * PERIOD, None if k % 7 == 3 else q, k * PERIOD)
        spent[k] = perf_counter() - begun
        q = held(q, u, PERIOD)
        if k in (calls // 10, calls - 1):
            print(k, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024, "MB", loop.state)
    print((1e6 * np.percentile(spent[100:], [50, 99.9, 100])).round(1), "µs median, 99.9 %, most")


if __name__ == "__main__":
    endure(int(sys.argv[1])) if sys.argv[1:] else main()
