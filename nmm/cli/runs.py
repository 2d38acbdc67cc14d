"""run, compare, paper and play."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from nmm.cli.chosen_resolvers import Chosen, check_different
from nmm.cli.interrupts import shielded
from nmm.cli.output import complain, progress, show_table
from nmm.cli.paper_table import print_table
from nmm.cli.report import describe, show_run
from nmm.cli.subjects import scenario_with
from nmm.errors import InputError
from nmm.folders import comparison
from nmm.folders.run import is_run
from nmm.folders.run import save as save_run
from nmm.folders.whole import check_folder, steady
from nmm.runs.figure_options import PLAIN, FigureOptions
from nmm.scenario import Scenario

if TYPE_CHECKING:
    from nmm.control.controller import Controller
    from nmm.paper import PaperReport
    from nmm.playback import LiveRun
    from nmm.runs.ellipsoid_options import Wanted
    from nmm.runs.recording import Recorder
    from nmm.runs.trajectory import Trajectory

OK, FAILED = 0, 1


def run_scenario(
    name: str,
    resolver: Chosen | None,
    settings: Mapping[str, object],
    limits: bool | None,
    out: Path | None,
    *,
    html: bool,
    play: bool,
    port: int | None = None,
    open_browser: bool = True,
    ellipsoids: Wanted = False,
    figures: FigureOptions = PLAIN,
    of_robot: Mapping[str, Any] = MappingProxyType({}),
) -> int:
    """Run a scenario, in a page that shows it meanwhile if wanted; write its folder, print its table."""
    scenario = _load(name, resolver, settings, limits, of_robot)
    label = "" if resolver is None else resolver.label
    called = label or scenario.parts.resolver.kind.upper()
    folder = out or Path("runs") / f"{scenario.name}-{comparison.folder_name(called)}"
    check_folder(folder, is_run)
    controller = scenario.controller()  # complains before there is a progress bar
    title = f"{scenario.title or scenario.name}, {called}"
    with _shown(scenario, controller, title, port, open_browser) if play else nullcontext() as page:
        trajectory = _run(scenario, controller, None if page is None else page.watch, label)
        with shielded() as asked_to_end:
            _tell_and_save(trajectory, folder, html=html, ellipsoids=ellipsoids, figures=figures)
        status = _status("nmm run", [trajectory], folder)
        ends = asked_to_end.is_set() or trajectory.outcome == "interrupted"
        if page is not None and len(trajectory) and not ends:
            page.stay(trajectory, ellipsoids=ellipsoids)
    return status


def _shown(
    scenario: Scenario, controller: Controller, title: str, port: int | None, open_browser: bool
) -> AbstractContextManager[LiveRun]:
    """A page for a run that is about to begin."""
    from nmm.playback import LiveRun

    parts = scenario.parts
    return LiveRun(controller, parts.q0, parts.duration, title=title, port=port, open_browser=open_browser)


def _tell_and_save(trajectory: Trajectory, folder: Path, **asked: Any) -> None:
    """The numbers first: nobody has to wait for figures to see them."""
    width = 0
    gone: OSError | None = None

    def tell(numbers: dict[str, Any]) -> None:
        nonlocal width, gone
        try:
            width = show_run(trajectory, numbers)
        except OSError as error:  # their reader has gone (`nmm run … | head -3`): the folder is written still
            gone = error

    save_run(trajectory, folder, tell=tell, **asked)
    if gone is not None:
        raise gone
    show_table(["", ""], [["files in".ljust(width), str(folder)]])


def compare_resolvers(
    name: str,
    resolvers: Sequence[Chosen],
    settings: Mapping[str, object],
    limits: bool | None,
    out: Path | None,
    *,
    ellipsoids: Wanted = False,
    figures: FigureOptions = PLAIN,
    of_robot: Mapping[str, Any] = MappingProxyType({}),
    form: str | None = None,
) -> int:
    """Run a scenario with several resolvers, or settings of one; write and print how they compare.

    form : of the table, for a paper; a terminal's when not given
    """
    from nmm.runs.timing import step_time

    scenarios = [_load(name, one, settings, limits, of_robot) for one in resolvers]
    check_different(resolvers, scenarios, "--resolvers")
    folder = out or Path("runs") / f"{scenarios[0].name}-compare"
    check_folder(folder, comparison.is_comparison)
    # What is wrong with the last one shows before the first one runs.
    controllers = [scenario.controller() for scenario in scenarios]
    trajectories: list[Trajectory] = []
    for scenario, controller, one in zip(scenarios, controllers, resolvers, strict=True):
        trajectories.append(_run(scenario, controller, label=one.label))
        if trajectories[-1].outcome == "interrupted":
            break
    with shielded():
        comparison.save(trajectories, folder, scenarios[0].name, ellipsoids=ellipsoids, figures=figures)
    table = [dict(describe(trajectory, trajectory.summary())) for trajectory in trajectories]
    if form is not None:
        from nmm.tables import comparison_table

        print_table(comparison_table(trajectories), form, folder)
        return _status("nmm compare", trajectories, folder)
    for column, scenario, trajectory in zip(table, scenarios, trajectories, strict=False):
        if len(trajectory):
            controller = scenario.controller()
            controller.dt = trajectory.dt
            column["a control step"] = f"{1e6 * step_time(controller, trajectory):.3g} µs here"
    labels = list(dict.fromkeys(label for column in table for label in column))
    show_table(
        ["", *(trajectory.called for trajectory in trajectories)],
        [[label, *(column.get(label, "") for column in table)] for label in labels],
        title=f"{scenarios[0].name}: {scenarios[0].title}",
    )
    show_table(["", ""], [["files in", str(folder)]])
    return _status("nmm compare", trajectories, folder)


def write_the_paper(folder: Path, figures: FigureOptions = PLAIN, form: str | None = None) -> int:
    """The paper's cases and figures; 0 when every claim holds.

    form : of a table with the numbers of the runs, for a paper; the claims are printed when not given
    """
    from nmm.paper import write_paper

    with progress("the paper's four cases") as report:
        paper = write_paper(folder, progress=report, figures=figures)
    if form is not None:
        print_table(paper.table(), form, folder)
        return _paper_status(paper)
    show_table(
        ["case", "what the paper claims", "holds"],
        [
            [str(case.number), claim.statement, "yes" if claim.holds else "NO"]
            for case in paper.cases
            for claim in case.claims
        ],
    )
    show_table(["", ""], [["open", str(paper.index)]])
    return _paper_status(paper)


def _paper_status(paper: PaperReport) -> int:
    if not paper.holds:
        complain("nmm paper", f"a claim does not hold; what came out is in {paper.index}")
    return OK if paper.holds else FAILED


def play_folder(folder: Path, port: int | None, *, open_browser: bool, ellipsoids: Wanted = False) -> None:
    """Play a run, or the runs of a comparison in one scene."""
    from nmm.playback import play

    play(runs_in(folder), port=port, open_browser=open_browser, ellipsoids=ellipsoids)


def runs_in(folder: Path) -> list[Trajectory]:
    """The run of a folder, or those of a comparison, that have samples; `InputError` for none."""
    from nmm.runs.trajectory import Trajectory

    def read() -> list[Trajectory]:
        folders = comparison.runs_of(folder) if comparison.is_comparison(folder) else [folder]
        return [trajectory for trajectory in (Trajectory.load(path) for path in folders) if len(trajectory)]

    runs = steady(folder, read)
    if not runs:
        raise InputError(f"{folder}: expected a run with at least one sample")
    return runs


def _load(
    name: str,
    resolver: Chosen | None,
    settings: Mapping[str, object],
    limits: bool | None,
    of_robot: Mapping[str, Any],
) -> Scenario:
    kind = {} if resolver is None or resolver.own is not None else {"resolver.kind": resolver.kind}
    scenario = scenario_with(Scenario.load(name, kind | dict(settings)), of_robot)
    if resolver is not None:
        scenario = resolver.scenario(scenario)
    if limits is None or limits is (scenario.parts.limits is not None):
        return scenario
    return scenario.override("limits", limits)


def _run(
    scenario: Scenario,
    controller: Controller,
    watch: Callable[[Recorder], None] | None = None,
    label: str = "",
) -> Trajectory:
    with progress(f"{scenario.name}, {label or scenario.parts.resolver.kind.upper()}") as report:
        return replace(scenario.run(report, controller, watch), label=label)


def _status(command: str, trajectories: Sequence[Trajectory], folder: Path) -> int:
    """0, or 1 with a line for each run that did not end as asked."""
    failed = [trajectory for trajectory in trajectories if not trajectory.complete]
    for trajectory in failed:
        whole = trajectory.outcome == "missed"
        where = "" if whole else f"; the part that was computed is in {folder}"
        complain(command, f"{trajectory.called} {trajectory.outcome}: {trajectory.message}{where}")
    return FAILED if failed else OK
