"""Time of whole closed loops, and evaluations a second of many at once:

    python benchmarks/loops.py

`simulate` with RK4, judged and made a trajectory, and what its integration alone takes of it; then `rollout`
of as many robots on one thread and on all cores, measures alone. Asked for are at most 40 ms (planar, 25 s
at 5 ms) and 100 ms (TIAGo, 20 s at 10 ms), and 2e6 and 5e5 evaluations a second on two cores.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable

import numpy as np

import nmm
from nmm.control.integrators import RK4
from nmm.motion.closed_loop import drive_loop
from nmm.motion.recorded_run import sample_times
from nmm.motion.recording import Recorder

ROBOTS, ROUNDS, STAGES = 64, 5, 4
CORES = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def best(call: Callable[[], object]) -> float:
    """The least wall time of some, s."""
    times = []
    for _ in range(ROUNDS):
        began = time.perf_counter()
        call()
        times.append(time.perf_counter() - began)
    return min(times)


def measured(name: str) -> tuple[float, float, float, float]:
    """simulate and its integration, s; evaluations a second on one thread and on all cores."""
    scenario = nmm.Scenario.load(name).with_resolver("pg")
    parts, controller = scenario.parts, scenario.controller()
    q0 = controller.robot.q(parts.q0)
    times = sample_times(0.0, parts.dt, round(parts.duration / parts.dt), parts.duration)
    recorder = Recorder(controller, times)
    starts = q0 + 0.01 * np.random.default_rng(0).standard_normal((ROBOTS, len(q0)))

    def integrated() -> None:
        recorder.clear()
        drive_loop(controller, RK4, recorder, times, q0)

    def many(threads: int) -> float:
        each = STAGES * (len(times) - 1)
        return ROBOTS * each / best(lambda: nmm.rollout(scenario, starts, method="rk4", threads=threads))

    whole = best(lambda: nmm.simulate(controller, q0, parts.duration, parts.dt))
    return whole, best(integrated), many(1), many(CORES)


def main() -> None:
    """Print the table."""
    print(f"{'':22}{'simulate, ms':>14}{'integration':>13}{'1 thread, 1/s':>15}{f'{CORES} cores, 1/s':>15}")
    for name in ("unicycle_2r_position", "tiago_pose"):
        whole, alone, one, all_cores = measured(name)
        print(f"{name:22}{1e3 * whole:14.1f}{1e3 * alone:13.1f}{one:15.3g}{all_cores:15.3g}")


if __name__ == "__main__":
    main()
