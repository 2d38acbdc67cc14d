"""How many runs a second come out of a batch, by its size and by cores:

    python benchmarks/batch.py                                   printed
    python benchmarks/batch.py --markdown docs/performance.md    into that page

*Rollouts* are `nmm.rollout`, measures alone; *rows* are those of `nmm.Sweep.run`, judged and written, with
whatever a sweep needs besides (a process each, a table, a page). Runs of 5 s by RK4 from starts about the
scenario's, its projected gradient: 1000 samples of the planar robot, 500 of TIAGo, four steps each. The
best of two up to 100, in wall time; what is compiled and loaded once is so before anything is timed.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from machine import described
from tables import Section, into, text

import nmm

SIZES, CORES, DURATION, STAGES = (1, 10, 100, 1000), (1, 2), 5.0, 4
NAMES = {"planar": "unicycle_2r_position", "TIAGo": "tiago_pose"}


def best(call: Callable[[], object], size: int) -> float:
    """The least wall time of two, of large batches of one, s."""
    times = []
    for _ in range(2 if size <= 100 else 1):
        began = time.perf_counter()
        call()
        times.append(time.perf_counter() - began)
    return min(times)


def rollouts(scenario: nmm.Scenario, size: int, threads: int) -> float:
    """Rollouts a second."""
    q0 = scenario.robot().q(scenario.parts.q0)
    starts = q0 + 0.01 * np.random.default_rng(0).standard_normal((size, len(q0)))
    return size / best(lambda: nmm.rollout(scenario, starts, threads=threads), size)


def rows(scenario: nmm.Scenario, size: int, jobs: int) -> float:
    """Rows of a sweep a second."""
    x = float(scenario.robot().q(scenario.parts.q0)[0])
    sweep = nmm.Sweep(scenario, {"q0.x": (x - 0.02, x + 0.02)}, samples=size, sampler="random")

    def run() -> None:
        with tempfile.TemporaryDirectory() as folder:
            sweep.run(Path(folder) / "out", jobs=jobs)

    return size / best(run, size)


def batch() -> Section:
    """The table."""
    found = []
    for called, name in NAMES.items():
        scenario = nmm.Scenario.load(name, {"duration": DURATION, "method": "rk4"}).with_resolver("pg")
        evaluations = STAGES * round(DURATION / scenario.parts.dt)
        rollouts(scenario, 2, 1)
        rows(scenario, 2, 1)
        for size in SIZES:
            flown = [rollouts(scenario, size, cores) for cores in CORES]
            swept = [rows(scenario, size, cores) for cores in CORES]
            cells = [f"{called}, {size}"]
            for one in flown:
                cells += [f"{one:.0f}", f"{evaluations * one:.2g}"]
            found.append([*cells, *(f"{one:.1f}" for one in swept)])
    heads = ["batch"]
    for cores in CORES:
        on = f"{cores} {'core' if cores == 1 else 'cores'}"
        heads += [f"rollouts/s, {on}", "steps/s"]
    heads += [f"rows/s, {cores} {'core' if cores == 1 else 'cores'}" for cores in CORES]
    return Section("batch", described(), heads, found, [])


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--markdown", type=Path, metavar="PAGE", help="a page with the mark <!-- batch -->")
    asked = parser.parse_args()
    section = batch()
    print(text(section))
    if asked.markdown:
        into(asked.markdown, [section])


if __name__ == "__main__":
    main()
