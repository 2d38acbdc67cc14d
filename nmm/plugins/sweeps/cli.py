"""The command `nmm sweep`: its options and its help, progress in rollouts, and the tables at the end."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from nmm.base.errors import InputError, expect, no_such
from nmm.cli.groups import opening_command
from nmm.cli.options import SetOption, option, settings_of
from nmm.cli.output import FAILED, OK, bar_of, complain, show_table, warn

if TYPE_CHECKING:
    from nmm.plugins.sweeps.result import SweepResult
    from nmm.plugins.sweeps.sweep import Sweep

#: Times between two steps of the bar by which the time left is estimated, s.
WINDOW = 300.0


@opening_command
def sweep(
    scenario: Annotated[
        str,
        typer.Argument(
            metavar="SCENARIO",
            help="A scenario (see `nmm scenarios`, or a YAML file); or a sweep: a bundled one "
            "(unicycle_2r_starts, tiago_reach) or a YAML file with what varies.",
        ),
    ],
    *,
    vary: list[str] | None = option(
        "KEY=LO:HI[:N]|A,B,...",
        "What varies: a key by its dotted path, as for --set, over a range that is sampled; over N "
        "values at equal distances; or over values that are listed. May be repeated.",
    ),
    samples: str | None = option(
        "N", "Points of the ranges; each is run with every combination of what is listed."
    ),
    sampler: str | None = option(
        "grid|sobol|lhs|random",
        "How ranges are sampled; grid where every key has its values.",
        show="sobol, or grid",
    ),
    seed: str | None = option("S", "Of the sampler.", show="0"),
    settings: SetOption = None,
    out: Path | None = option(
        "DIR",
        "Where to write. A sweep that was begun there goes on; a folder of another one is refused.",
        show="runs/<scenario>-sweep",
    ),
    keep: str | None = option(
        "trajectories|playback",
        "Keep each rollout's run folder, or with playback.html too.",
        show="rows only",
    ),
    jobs: int | None = option("N", "Rollouts at a time on this machine.", show="one a core"),
    scheduler: str | None = option(
        "tcp://HOST:PORT", "Let the workers of this Dask cluster compute instead."
    ),
) -> int:
    """Run a scenario many times, over ranges of its keys.

    One row a rollout: what varied, how it ended, errors, objective, λ, singular values, margins, effort.

    \b
    nmm sweep unicycle_2r_position --vary q0.x=-3:3 --vary q0.y=-3:3 --samples 256
    nmm sweep unicycle_2r_position --vary resolver.alpha=1:20:20 --vary resolver.kind=rg,pg
    nmm sweep unicycle_3r_position --vary robot.arguments.d=0.2:0.5 --samples 64 --sampler lhs
    nmm sweep unicycle_2r_starts --samples 50000 --scheduler tcp://10.0.0.1:8786
    nmm sweep my_sweep.yaml --keep playback

    The folder holds rows.parquet, sweep.json (what was swept) and index.html: maps, fronts, parallel
    coordinates and a table that filters, offline. Ctrl-C, or worse, ends it: the same command goes on where
    it was. Needs `pip install pyarrow distributed`.
    """
    asked = {"samples": samples, "sampler": sampler, "seed": seed, "keep": keep}
    keywords = {name: value for name, value in asked.items() if value is not None}
    made = _sweep(scenario, vary or (), settings_of(settings), keywords)
    folder = out or Path("runs") / f"{made.definition.name}-sweep"
    total, done = made.definition.rows, 0
    with _progress(made) as show:

        def report(fraction: float) -> None:
            nonlocal done
            done = round(fraction * total)
            show(done)

        try:
            swept = made.run(folder, jobs=jobs, scheduler=scheduler, progress=report)
        except KeyboardInterrupt:
            share = f"{done} of {total} rollouts are" if done else "nothing is"
            complain("nmm sweep", f"interrupted: {share} in {folder}; the same command goes on there")
            return FAILED
    if swept.computed_again:
        warn(f"{swept.computed_again} rollouts in damaged files of {folder} were computed again")
    _show(swept)
    return OK


def _sweep(name: str, vary: Sequence[str], settings: dict[str, object], keywords: dict[str, Any]) -> Sweep:
    from nmm.base.bundled import bundled_scenarios, bundled_sweeps
    from nmm.plugins.sweeps.definition import parsed
    from nmm.plugins.sweeps.sweep import Sweep, is_sweep_file, read_sweep
    from nmm.scenario.scenario import SUFFIXES

    varying: dict[str, object] = {}
    for text in vary:
        key = parsed(text).key
        if key in varying:
            raise InputError(f"{key} is given twice", where="--vary")
        varying[key] = text.partition("=")[2].strip()
    if is_sweep_file(name):
        in_file = read_sweep(name)
        changed = {"vary": in_file["vary"] | varying, "settings": in_file.get("settings", {}) | settings}
        return Sweep(**{**in_file, **keywords, **changed})
    known = {**bundled_scenarios(), **bundled_sweeps()}
    path = Path(name)
    if name not in known and path.suffix not in SUFFIXES and not path.is_file() and len(path.parts) < 2:
        raise no_such("scenario or sweep", name, known)
    expect(varying, "--vary", "at least one key to vary, as in --vary q0.x=-1:1")
    return Sweep(name, varying, settings=settings, **keywords)


@contextmanager
def _progress(made: Sweep) -> Iterator[Callable[[int], None]]:
    """A function that shows how many rollouts are done, with the time left; nothing without a terminal."""
    if not sys.stderr.isatty():
        yield lambda rows: None
        return
    from rich.progress import MofNCompleteColumn, TextColumn, TimeRemainingColumn

    speed, left = TextColumn("{task.fields[speed]}"), TimeRemainingColumn(elapsed_when_finished=True)
    with bar_of(MofNCompleteColumn(), speed, left, speed_estimate_period=WINDOW) as bar:
        task: Any = None
        began = first = 0.0

        def show(rows: int) -> None:
            nonlocal task, began, first
            if task is None:  # rows of an earlier start took none of this one's time
                total = made.definition.rows
                task = bar.add_task(made.definition.name, total=total, completed=rows, speed="")
                began, first = time.monotonic(), rows
            passed = time.monotonic() - began
            rate = f"{(rows - first) / passed:.3g} a second" if rows > first and passed > 0.0 else ""
            bar.update(task, completed=rows, speed=rate)

        yield show


def _show(swept: SweepResult) -> None:
    from nmm.plugins.sweeps.result import compared, spreads

    definition = swept.definition
    rows = definition.rows
    title = f"{definition.name}: {rows} rollouts"
    if definition.ranges and definition.combinations > 1:
        title += f", {definition.samples} points with {definition.combinations} combinations each"
    show_table(
        ["outcome", "rollouts", "share"],
        [[outcome, str(count), f"{count / rows:.1%}"] for outcome, count in swept.outcomes.items()],
        title=title,
        numeric=["rollouts", "share"],
    )
    numbers = [[name, *(f"{value:.4g}" for value in values)] for name, *values in spreads(swept)]
    if numbers:
        show_table(["", "least", "median", "largest"], numbers, numeric=["least", "median", "largest"])
    beside = compared(swept)
    if beside:
        medians = {"error_rms": "error RMS", "objective_integral": "∫ H dt", "effort": "effort"}
        columns = ["completed", *(f"median {words}" for words in medians.values())]
        best = ["least ∫ H dt"] if beside[0].best is not None else []
        show_table(
            [*beside[0].values, *columns, *best],
            [
                [
                    *row.values.values(),
                    f"{row.completed:.1%}",
                    *(f"{row.medians[name]:.4g}" if name in row.medians else "-" for name in medians),
                    *([] if row.best is None else [f"at {row.best:.1%} of the points"]),
                ]
                for row in beside
            ],
            numeric=columns,
        )
    show_table(["", ""], [["files in", str(swept.folder)], ["open", str(swept.page)]])
