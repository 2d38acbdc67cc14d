"""nmm beside roboplan, placo, Pink and mink, and how a step grows with the problem; one command:

    python benchmarks/run.py                                     everything
    python benchmarks/run.py --only peers --rounds 60            the comparison alone
    python benchmarks/run.py --only growth
    python benchmarks/run.py --no-peers                          nothing but nmm, nothing downloaded
    python benchmarks/run.py --markdown docs/performance.md      the tables go into that page

Each other library runs in an environment of its own, made by venv and pip the first time (names and versions:
`environments.py`); --env-dir says where, by default the user's cache. What is measured and how:
`docs/performance.md`.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

from contest import TURNS, Contestant, Followed, all_jobs, follow, rounds
from environments import LIBRARIES, default_folder, python_of
from growth import growth
from machine import described
from tables import Section, comparison, into, text
from workloads import WORKLOADS, Workload, write

OURS = (("nmm", "pinocchio"), ("nmm", "compiled"), ("floor", "floor"))


def enter(folder: Path, workloads: Path, peers: bool) -> tuple[list[Contestant], list[str]]:
    """The workers, started, and a line for each library that is not among them."""
    entered = [Contestant(name, sys.executable, "of_nmm.py", variant, workloads) for name, variant in OURS]
    absent = []
    for library in LIBRARIES if peers else ():
        python, reason = python_of(library, folder)
        if python is None:
            absent.append(f"{library.name} ({', '.join(library.packages)}): {reason}")
            continue
        for variant in library.variants:
            one = Contestant(library.name, python, library.worker, variant, workloads)
            if one.reason:
                absent.append(f"{library.name}, {variant}: {one.reason}")
                one.close()
            else:
                entered.append(one)
    return entered, absent


def compare(folder: Path, count: int, peers: bool) -> list[Section]:
    """The comparison."""
    before = described()
    with tempfile.TemporaryDirectory() as temporary:
        workloads = {name: Workload(name) for name in WORKLOADS}
        entered, absent = enter(folder, write(Path(temporary)), peers)
        try:
            followed: dict[tuple[str, str, str], Followed] = {}
            racing: dict[str, list[Contestant]] = {job: [] for job in all_jobs()}
            for one in entered:
                absent += [f"{one.name}, {one.variant}, {job}: {why}" for job, why in one.failed.items()]
                for job in one.jobs:
                    found = followed[job, one.name, one.variant] = follow(one, job, workloads)
                    if not found.reason:
                        racing[job].append(one)
            steps = {job: len(workloads[job.split(",")[0]].t) // TURNS for job in racing}
            times = rounds(entered, racing, count, steps)
            versions = {one.name: one.versions for one in entered if one.name != "floor"}
        finally:
            for one in entered:
                one.close()
    return comparison(times, followed, absent, versions, before, count, steps)


def main(arguments: list[str] | None = None) -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--only", choices=("peers", "growth"), help="one of the two parts")
    parser.add_argument("--no-peers", action="store_true", help="nmm alone: nothing is downloaded")
    parser.add_argument("--rounds", type=int, default=40, help="turns of each library (40)")
    parser.add_argument("--env-dir", type=Path, help="where the libraries' environments are")
    parser.add_argument("--markdown", type=Path, metavar="PAGE", help="a page with the sections' marks")
    asked = parser.parse_args(arguments)
    sections: list[Section] = []
    if asked.only != "growth":
        sections += compare(asked.env_dir or default_folder(), asked.rounds, not asked.no_peers)
    if asked.only != "peers":
        sections += growth()
    for section in sections:
        print(text(section))
    if asked.markdown:
        into(asked.markdown, sections)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
