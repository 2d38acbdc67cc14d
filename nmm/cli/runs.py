"""run, compare and paper: what a scenario does, written and told."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from nmm.base.errors import InputError
from nmm.base.kinds import RESOLVERS
from nmm.base.text_format import listed
from nmm.cli.groups import (
    AddedOptions,
    Browser,
    EllipsoidGroup,
    Figures,
    OfRobot,
    PlaceOfOptions,
    command,
)
from nmm.cli.interrupts import shielded
from nmm.cli.options import (
    LIMITS,
    ChosenResolver,
    ResolversOption,
    ScenarioArgument,
    SetOption,
    TableOption,
    check_different,
    chosen,
    flag,
    form_of,
    named,
    of_several,
    option,
    out_option,
    settings_of,
)
from nmm.cli.output import FAILED, INTERRUPTED, OK, complain, print_table, progress, show_table, warn

if TYPE_CHECKING:
    from nmm.control.controller import Controller
    from nmm.motion.recording import Recorder
    from nmm.motion.trajectory import Trajectory
    from nmm.scenario import Scenario
    from nmm.views.playback import LiveRun


@command
def run(
    scenario: ScenarioArgument,
    *,
    resolver: str | None = option(
        "|".join(RESOLVERS),
        f"Resolve the redundancy with the "
        f"{listed([f'{RESOLVERS.words(name)} ({name})' for name in RESOLVERS], 'or')}, "
        "with those of the scenario's settings that it knows; or as in --resolvers of `nmm compare`.",
    ),
    settings: SetOption = None,
    limits: bool | None = LIMITS,
    of_robot: OfRobot,
    out: Annotated[Path | None, out_option("runs/<scenario>-<resolver>")] = None,
    html: bool = flag("--html", "Write playback.html too: the motion in 3D, one file, works offline."),
    play: bool = flag(
        "--play", "Show the motion in the browser as it is computed, then play it; Ctrl-C ends it."
    ),
    browser: Browser,
    beside: Annotated[AddedOptions, PlaceOfOptions("run")],
    ellipsoids: EllipsoidGroup,
    figures: Figures,
) -> int:
    """Run a scenario and write what happened.

    \b
    nmm run unicycle_2r_position --resolver pg
    nmm run unicycle_2r_position --set dt=0.001 --set resolver.alpha=5
    nmm run unicycle_2r_position --set task.0.reference.radius=2 --set robot.arguments.d=0.5
    nmm run unicycle_3r_spline --set 'q0={x: 0.2, q2: pi/3}' --html --out here
    nmm run unicycle_3r_position --ellipsoids --html
    nmm run unicycle_2r_position --format png,pdf --width column
    nmm run unicycle_2r_position --stream rerun --stream foxglove=run.mcap

    The folder holds trajectory.npz and trajectory.csv (times, coordinates, inputs, errors, objective),
    summary.json (the numbers of the table), scenario.yaml (every key, to be run again) and figures as PNG,
    with --ellipsoids ellipses.png among them.
    Ctrl-C ends the run and writes the part that was computed, marked incomplete.
    """
    from nmm.views.folders.comparison import folder_name
    from nmm.views.folders.run import is_run
    from nmm.views.folders.whole import check_folder

    if not play:
        browser.refuse("--play")
    beside.check()
    choice = None if resolver is None else chosen(resolver, "--resolver")
    changed, shown_ellipsoids = settings_of(settings), ellipsoids.wanted()
    drawn = figures.options()
    made = _load(scenario, choice, changed, limits, of_robot)
    label = "" if choice is None else choice.label
    called = label or _called(made)
    folder = out or Path("runs") / f"{made.name}-{folder_name(called)}"
    check_folder(folder, is_run)
    if not made.parts.searches:
        controller = made.controller()  # complains before there is a progress bar
    else:
        with progress(f"{made.name}, plan") as report:
            controller = made.controller(report)
    shown: AbstractContextManager[LiveRun | None] = nullcontext()
    planned = bool(made.parts.moved_by)
    if play and not planned:
        from nmm.views.playback import LiveRun

        title = f"{made.title or made.name}, {called}"
        around = made.surroundings(controller.robot)
        shown = LiveRun(
            controller, made.parts.q0, made.parts.duration,
            title=title, surroundings=around, **browser.keywords(),
        )  # fmt: skip
    with shown as page, beside.beside(made, controller) as others:
        watching = [one.watch for one in (page, *others) if one is not None]
        trajectory = _run(made, controller, lambda recorder: [watch(recorder) for watch in watching], label)
        with shielded() as asked_to_end:
            tell_and_save(trajectory, folder, html=html, ellipsoids=shown_ellipsoids, figures=drawn)
        status = _status("nmm run", [trajectory], folder)
        ends = asked_to_end.is_set() or trajectory.outcome == "interrupted"
        for other in others:
            other.end(trajectory, ends)
        if page is not None and len(trajectory) and not ends:
            page.stay(trajectory, ellipsoids=shown_ellipsoids)
    faults = [fault for other in others for fault in other.faults]
    for fault in faults:
        complain("nmm run", f"{fault}; the run is in {folder}")
    if play and planned and not ends:
        trajectory.play(**browser.keywords(), ellipsoids=shown_ellipsoids)
    return FAILED if faults else status


def _called(scenario: Scenario) -> str:
    return (scenario.parts.moved_by or scenario.parts.resolver.kind).upper()


@command
def compare(
    scenario: ScenarioArgument,
    bag: Annotated[
        Path | None,
        typer.Argument(metavar="[BAG]", help="A robot's log, beside a run's folder.", show_default=False),
    ] = None,
    *,
    resolvers: ResolversOption = "rg,pg",
    settings: SetOption = None,
    limits: bool | None = LIMITS,
    of_robot: OfRobot,
    of_log: Annotated[AddedOptions, PlaceOfOptions("compare")],
    out: Annotated[Path | None, out_option("runs/<scenario>-compare")] = None,
    html: Annotated[bool, typer.Option("--html", hidden=True)] = True,  # it always is written
    table: TableOption = None,
    ellipsoids: EllipsoidGroup,
    figures: Figures,
) -> int:
    """Run a scenario with several resolvers, or with one at several settings.

    One table, one figure, one playback. A scenario with a plan is run with it, and with each resolver
    without it. With a rosbag2 folder, .mcap, .db3 or .bag after a run's folder: how far the robot's motion
    in this log is from the run; its topics and frames are options.

    \b
    nmm compare unicycle_2r_position
    nmm compare unicycle_2r_pointing --resolvers rg,pg,ej --set resolver.alpha=5
    nmm compare unicycle_2r_position --resolvers rg,rg:alpha=5,pg:alpha=50
    nmm compare unicycle_2r_position --table latex > table.tex
    nmm compare unicycle_2r_position --resolvers rg,my_laws.py:law
    nmm compare runs/unicycle_2r_position-rg on_the_robot.mcap
    nmm compare runs/unicycle_2r_position-rg fleet.mcap --namespace robot1 --odometry odometry/filtered

    The folder holds comparison.png, playback.html (all robots in one scene), summary.json and, for each
    resolver, a folder with its run.
    """
    from nmm.motion.table import step_time
    from nmm.views.folders import comparison
    from nmm.views.folders.whole import check_folder

    if str(bag).partition(":")[0] in RESOLVERS and resolvers.endswith(","):
        raise InputError(f"no blanks in --resolvers {resolvers}{bag}")
    if bag is not None:
        status = of_log.answer(scenario, bag, out)
        if status is None:
            raise InputError("no plugin reads it", where=bag)
        return status
    of_log.refuse()
    several = [chosen(text, "--resolvers") for text in named(resolvers, "--resolvers")]
    changed = settings_of(settings)
    drawn: dict[str, Any] = {"ellipsoids": ellipsoids.wanted(), "figures": figures.options()}
    form = form_of(table)
    scenarios = []
    for choice in several:
        with of_several(several, choice, changed):
            scenarios.append(_load(scenario, choice, changed, limits, of_robot))
    check_different(several, scenarios, "--resolvers")
    name = scenarios[0].name
    run_labels = [choice.label for choice in several]
    if section := scenarios[0].parts.moved_by:
        scenarios = [scenarios[0], *(made.override(section, False) for made in scenarios)]
        several = [several[0], *several]
        run_labels = ["", *run_labels]
    folder = out or Path("runs") / f"{name}-compare"
    check_folder(folder, comparison.is_comparison)
    # What is wrong with the last one shows before the first one runs.
    controllers = []
    for made, choice in zip(scenarios, several, strict=True):
        with of_several(several, choice, changed):
            controllers.append(made.controller())
    trajectories: list[Trajectory] = []
    for made, controller, label in zip(scenarios, controllers, run_labels, strict=True):
        trajectories.append(_run(made, controller, label=label))
        if trajectories[-1].outcome == "interrupted":
            break
    if trajectories[-1].outcome == "interrupted" and comparison.is_comparison(folder):
        ended = f"run {len(trajectories)} of {len(scenarios)}"
        warn(f"{ended} was interrupted: the comparison in {folder} stays")
        return INTERRUPTED
    with shielded():
        comparison.save(trajectories, folder, name, **drawn)
    columns = [dict(describe(trajectory, trajectory.summary())) for trajectory in trajectories]
    if form is not None:
        from nmm.views.tables import comparison_table

        print_table(comparison_table(trajectories), form, folder)
        return _status("nmm compare", trajectories, folder)
    for column, made, trajectory in zip(columns, scenarios, trajectories, strict=False):
        if len(trajectory) and not made.parts.moved_by:
            controller = made.controller()
            controller.dt = trajectory.dt
            column["a control step"] = f"{1e6 * step_time(controller, trajectory):.3g} µs here"
    labels = list(dict.fromkeys(label for column in columns for label in column))
    show_table(
        ["", *(trajectory.called for trajectory in trajectories)],
        [[label, *(column.get(label, "") for column in columns)] for label in labels],
        title=f"{name}: {scenarios[0].title}".removesuffix(": "),
    )
    show_table(["", ""], [["files in", str(folder)]])
    return _status("nmm compare", trajectories, folder)


@command
def paper(
    *,
    out: Path = option("DIR", "Where to write, as for `nmm run`.", default=Path("paper")),
    table: TableOption = None,
    figures: Figures,
) -> int:
    """Redo the paper's cases and figures.

    Section VI: the four cases with RG and PG, figures 3 to 10, and the numbers that the paper claims.
    Open index.html in the folder: it shows all of it, with the motions to play. Takes less than a minute.
    """
    from nmm.cli.paper import write_paper

    drawn, form = figures.options(), form_of(table)
    with progress("the paper's four cases") as report:
        made = write_paper(out, progress=report, figures=drawn)
    if form is not None:
        print_table(made.table(), form, out)
    else:
        show_table(
            ["case", "what the paper claims", "holds"],
            [
                [str(case.number), claim.statement, "yes" if claim.holds else "NO"]
                for case in made.cases
                for claim in case.claims
            ],
        )
        show_table(["", ""], [["open", str(made.index)]])
    if not made.holds:
        complain("nmm paper", f"a claim does not hold; what came out is in {made.index}")
    return OK if made.holds else FAILED


def _load(
    name: str,
    resolver: ChosenResolver | None,
    settings: Mapping[str, object],
    limits: bool | None,
    of_robot: OfRobot,
) -> Scenario:
    from nmm.cli.subjects import scenario_with
    from nmm.scenario import Scenario

    keywords = of_robot.keywords()
    kind = {} if resolver is None or resolver.own is not None else {"resolver.kind": resolver.kind}
    scenario = scenario_with(Scenario.load(name, kind | dict(settings)), keywords)
    if resolver is not None:
        scenario = resolver.scenario(scenario)
    if limits is None or limits is (scenario.parts.limits is not None):
        return scenario
    return scenario.override("limits", limits)


def _run(
    scenario: Scenario,
    controller: Controller,
    watch: Callable[[Recorder], object] | None = None,
    label: str = "",
) -> Trajectory:
    from nmm.base.findings import Finding
    from nmm.motion.verdict import Outcome, Verdict

    with progress(f"{scenario.name}, {label or _called(scenario)}") as report:
        trajectory = replace(scenario.run(report, controller, watch), label=label)
        try:
            _ = trajectory.findings  # a shorter dt is tried here, where Ctrl-C still ends it
        except KeyboardInterrupt:
            finding = Finding("interrupted_judging")
            return replace(trajectory, verdict=Verdict(Outcome.INTERRUPTED, (finding,)))
        return trajectory


def tell_and_save(trajectory: Trajectory, folder: Path, **asked: Any) -> None:
    """Print a run's table and write its folder."""
    from nmm.views.folders.run import save

    width = 0
    gone: OSError | None = None

    def tell(numbers: dict[str, Any]) -> None:
        nonlocal width, gone
        try:
            width = show_run(trajectory, numbers)
        except OSError as error:  # their reader has gone (`nmm run … | head -3`): the folder is written still
            gone = error

    save(trajectory, folder, tell=tell, **asked)
    if gone is not None:
        raise gone
    show_table(["", ""], [["files in".ljust(width), str(folder)]])


def show_run(trajectory: Trajectory, numbers: dict[str, Any]) -> int:
    """Print the table of a run, from its summary, and its warnings; returns the width of its first column."""
    scenario = trajectory.scenario or {}
    title = f"{scenario.get('name', '')}: {scenario.get('title', '')}".strip(": ")
    lines = describe(trajectory, numbers)
    show_table(["", ""], lines, title=title)
    sys.stdout.flush()
    return max(len(label) for label, _ in lines)


def describe(trajectory: Trajectory, numbers: dict[str, Any]) -> list[tuple[str, str]]:
    """Labels and values of a run's summary; its warnings go to standard error."""
    from nmm.motion.table import summary_rows

    for warning in numbers["warnings"]:
        warn(f"{trajectory.called}: {warning}")
    return list(summary_rows(trajectory, numbers))


def _status(command: str, trajectories: Sequence[Trajectory], folder: Path) -> int:
    """0, or 1 with a line for each run that did not end as asked."""
    failed = [trajectory for trajectory in trajectories if not trajectory.complete]
    for trajectory in failed:
        whole = trajectory.outcome == "missed"
        where = "" if whole else f"; the part that was computed is in {folder}"
        complain(command, f"{trajectory.called} {trajectory.outcome}: {trajectory.message}{where}")
    return FAILED if failed else OK
