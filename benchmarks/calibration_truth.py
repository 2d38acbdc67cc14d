"""Calibrations beside true numbers of another engine: `python benchmarks/calibration_truth.py --runs 200`.

Robots in MuJoCo (`calibration_worlds`), whose numbers, motion and noise are drawn anew in each run, are
driven for a minute, and calibrated. Prints the table of docs/calibration.md: how far numbers are off on
average, and how often they are within two of their deviations. Differential drives also go along squares, for
UMBmark (`--squares`). Runs are appended to a file (`--file`), and those that it has are not made again.
"""

from __future__ import annotations

import argparse
import json
import math
import time
import warnings
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from calibration_drives import DELAY, drive
from calibration_squares import squares_run
from calibration_worlds import PLATFORMS

import nmm

#: What is known of a robot beforehand: without it, a skid-steer robot's reference point may be anywhere.
KNOWN = {"skid-steer": ("reference.x", "reference.y")}
SECONDS = 60.0
#: Squares take as long as several drives.
SQUARES = "squares"
COLUMNS = "platform | number | runs | within 2 | mean, deviations | spread, deviations | bias | deviation"


def run(platform: str, seed: int, seconds: float = SECONDS) -> dict[str, Any]:
    """By name, what is true, found and its deviation, of a robot by its seed."""
    rng = np.random.default_rng([seed, [*PLATFORMS].index(platform)])
    world = PLATFORMS[platform](rng)
    log, reference = drive(world, seconds, rng)
    truth = {**reference, **world.truth, "delay": DELAY + world.truth.get("delay", 0.0)}
    begin = time.process_time()
    found = nmm.calibrate(world.robot, log, hold={name: truth[name] for name in KNOWN.get(platform, ())})
    spent = time.process_time() - begin
    numbers = {
        name: (truth[name], number.after, number.deviation)
        for name, number in found.numbers.items()
        if number.why == "learned"
    }
    held_out = found.held_out.verdict if found.held_out else "none"
    rest = {"white": found.whiteness, "verdict": held_out, "spent": spent}
    return {"platform": platform, "seed": seed, "numbers": numbers, **rest, "noise": found.noise._asdict()}


def runs(platforms: Sequence[str], count: int, file: Path | None) -> list[dict[str, Any]]:
    """Those of a file, and those that it lacks."""
    made = [json.loads(line) for line in file.read_text().splitlines()] if file and file.exists() else []
    known = {(one["platform"], one["seed"]) for one in made}
    for seed in range(count):
        for platform in platforms:
            if (platform, seed) in known:
                continue
            made.append(squares_run(seed) if platform == SQUARES else run(platform, seed))
            if file:
                with file.open("a") as lines:
                    lines.write(json.dumps(made[-1]) + "\n")
    return [one for one in made if one["platform"] in platforms and one["seed"] < count]


def rows(made: Iterable[dict[str, Any]]) -> list[tuple[str, str, int, float, float, float, float, float]]:
    """platform, number, runs, share within two deviations, mean and spread of what is off in deviations, its
    mean and the mean deviation in the number's unit."""
    by: dict[tuple[str, str], list[Sequence[float]]] = {}
    for one in made:
        for name, values in one["numbers"].items():
            by.setdefault((one["platform"], name), []).append(values)
    found = []
    for (platform, name), values in by.items():
        true, after, deviation = np.array(values).T
        off = (after - true) / deviation
        share = float(np.mean(np.abs(off) < 2.0))
        numbers = (
            share,
            float(off.mean()),
            float(off.std()),
            float((after - true).mean()),
            float(deviation.mean()),
        )
        found.append((platform, name, len(values), *numbers))
    return found


def table(made: Sequence[dict[str, Any]]) -> list[str]:
    """Lines of a table."""
    lines = [f"| {COLUMNS} |", "|" + "---|" * len(COLUMNS.split("|"))]
    for platform, name, count, share, mean, spread, bias, deviation in rows(made):
        numbers = f"{100 * share:.1f} % | {mean:+.2f} | {spread:.2f} | {bias:+.2g} | {deviation:.2g}"
        lines.append(f"| {platform} | {name} | {count} | {numbers} |")
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=20)
    parser.add_argument("--platforms", nargs="+", default=[*PLATFORMS], choices=[*PLATFORMS, SQUARES])
    parser.add_argument("--squares", action="store_true", help="square drives, beside UMBmark")
    parser.add_argument("--file", type=Path, help="runs are kept in it")
    told = parser.parse_args()
    platforms = [SQUARES] if told.squares else told.platforms
    made = runs(platforms, told.runs, told.file)
    print("\n".join(table(made)))
    for platform in platforms:
        some = [one for one in made if one["platform"] == platform]
        white = float(
            np.mean([one["white"] < 0.01 for one in some if not math.isnan(one["white"])] or [math.nan])
        )
        better = float(np.mean([one["verdict"] == "better" for one in some]))
        spent = float(np.median([one["spent"] for one in some]))
        print(f"{platform}: {100 * better:.0f} % better, {100 * white:.0f} % not white, {spent:.2f} s each")


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    main()
