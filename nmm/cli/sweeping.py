"""The command `nmm sweep`: its options and its help, progress in rollouts, and the tables at the end."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from nmm.cli.options import SetOption, settings_of
from nmm.cli.output import complain, show_table
from nmm.errors import InputError

if TYPE_CHECKING:
    from nmm.sweeps.sweep import Sweep
    from nmm.sweeps.swept import Swept

OK, FAILED = 0, 1
#: Times between two steps of the bar by which the time left is estimated, s.
WINDOW = 300.0


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
    vary: Annotated[
        list[str] | None,
        typer.Option(
            metavar="KEY=LO:HI[:N]|A,B,...",
            help="What varies: a key by its dotted path, as for --set, over a range that is sampled; over N "
            "values at equal distances; or over values that are listed. May be repeated.",
        ),
    ] = None,
    samples: Annotated[
        str | None,
        typer.Option(
            metavar="N", help="Points of the ranges; each is run with every combination of what is listed."
        ),
    ] = None,
    sampler: Annotated[
        str | None,
        typer.Option(
            metavar="grid|sobol|lhs|random",
            help="How ranges are sampled; grid where every key has its values.",
            show_default="sobol, or grid",
        ),
    ] = None,
    seed: Annotated[str | None, typer.Option(metavar="S", help="Of the sampler.", show_default="0")] = None,
    settings: SetOption = None,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Where to write. A sweep that was begun there goes on; a folder of another one is refused.",
            show_default="runs/<scenario>-sweep",
        ),
    ] = None,
    keep: Annotated[
        str | None,
        typer.Option(
            metavar="trajectories|playback",
            help="Keep each rollout's run folder, or with playback.html too.",
            show_default="rows only",
        ),
    ] = None,
    jobs: Annotated[
        int | None,
        typer.Option(metavar="N", help="Rollouts at a time on this machine.", show_default="one a core"),
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(metavar="tcp://HOST:PORT", help="Let the workers of this Dask cluster compute instead."),
    ] = None,
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
    it was. Needs `pip install "nmm[sweep]"`.
    """
    made = _sweep(scenario, vary, samples, sampler, seed, settings_of(settings), keep)
    folder = out or Path("runs") / f"{made.definition.name}-sweep"
    with _progress(made) as report:
        try:
            swept = made.run(folder, jobs=jobs, scheduler=scheduler, progress=report)
        except KeyboardInterrupt:
            share = f"{report.rows} of {made.definition.rows} rollouts are" if report.rows else "nothing is"
            complain("nmm sweep", f"interrupted: {share} in {folder}; the same command goes on there")
            return FAILED
    _show(swept)
    return OK


def _sweep(
    name: str,
    vary: Sequence[str] | None,
    samples: str | None,
    sampler: str | None,
    seed: str | None,
    settings: dict[str, object],
    keep: str | None,
) -> Sweep:
    """The sweep of a scenario, or one that a file says, with what the options change in it."""
    from nmm.bundled import bundled_scenarios, bundled_sweeps
    from nmm.errors import unknown
    from nmm.scenario.scenario import SUFFIXES
    from nmm.sweeps.files import is_sweep_file, read_sweep
    from nmm.sweeps.sweep import Sweep
    from nmm.sweeps.varied import parsed

    given: dict[str, Any] = {"samples": samples, "sampler": sampler, "seed": seed, "keep": keep}
    given = {option: value for option, value in given.items() if value is not None}
    varying: dict[str, object] = {}
    for text in vary or ():
        key = parsed(text).key
        if key in varying:
            raise InputError(f"--vary: {key} is given twice")
        varying[key] = text.partition("=")[2].strip()
    if is_sweep_file(name):
        said = read_sweep(name)
        return Sweep(
            **{
                **said,
                **given,
                "vary": {**said["vary"], **varying},
                "settings": {**said.get("settings", {}), **settings},
            }
        )
    known = {**bundled_scenarios(), **bundled_sweeps()}
    path = Path(name)
    if name not in known and path.suffix not in SUFFIXES and not path.is_file() and len(path.parts) < 2:
        raise InputError(unknown("scenario or sweep", name, known))
    if not varying:
        raise InputError("--vary: expected at least one key to vary, as in --vary q0.x=-1:1")
    return Sweep(name, varying, settings=settings, **given)


class _Report:
    """How far a sweep is, in rollouts; on a terminal shown with the time left."""

    def __init__(self, total: int, show: Callable[[int], None] | None) -> None:
        self.rows, self._total, self._show = 0, total, show

    def __call__(self, fraction: float) -> None:
        self.rows = round(fraction * self._total)
        if self._show is not None:
            self._show(self.rows)


@contextmanager
def _progress(made: Sweep) -> Iterator[_Report]:
    total = made.definition.rows
    if not sys.stderr.isatty():
        yield _Report(total, None)
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    bar = Progress(
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[speed]}"),
        TimeRemainingColumn(elapsed_when_finished=True),
        console=Console(stderr=True),
        transient=True,
        speed_estimate_period=WINDOW,
    )
    with bar:
        task: Any = None
        began = first = 0.0

        def show(rows: int) -> None:
            nonlocal task, began, first
            if task is None:  # rows of an earlier start took none of this one's time
                task = bar.add_task(made.definition.name, total=total, completed=rows, speed="")
                began, first = time.monotonic(), rows
            passed = time.monotonic() - began
            speed = f"{(rows - first) / passed:.3g} a second" if rows > first and passed > 0.0 else ""
            bar.update(task, completed=rows, speed=speed)

        yield _Report(total, show)


def _show(swept: Swept) -> None:
    """Print how many ended how, quantities from least to largest, and the listed values beside each other."""
    from nmm.sweeps.told import compared, spreads

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
    numbers = [[one.name, *(f"{value:.4g}" for value in one[1:])] for one in spreads(swept)]
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
                    *one.values.values(),
                    f"{one.completed:.1%}",
                    *(f"{one.medians[name]:.4g}" if name in one.medians else "-" for name in medians),
                    *([] if one.best is None else [f"at {one.best:.1%} of the points"]),
                ]
                for one in beside
            ],
            numeric=columns,
        )
    show_table(["", ""], [["files in", str(swept.folder)], ["open", str(swept.page)]])
