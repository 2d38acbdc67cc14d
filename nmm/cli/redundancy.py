"""redundancy and laps, with their options and their help."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from nmm.cli.groups import Browser, Figures, Loading, Subject, command
from nmm.cli.options import (
    ResolversOption,
    ScenarioArgument,
    SetOption,
    out_option,
    settings_of,
)
from nmm.cli.output import show_text
from nmm.cli.paper_table import TableOption, form_of
from nmm.errors import InputError, SingularError

#: Between samples of a self-motion, s; less for short ones.
DT = 0.01
#: A page's title does not hide the robot: a longer sentence is left to the table.
LONGEST_TITLE = 100


@command
def redundancy(
    subject: Subject,
    *,
    self_motion: Annotated[
        str | None,
        typer.Option(
            metavar="K|INPUT|INPUT=RATE,...",
            help="Move along a motion that leaves the task at rest, and back: its number in the list, an "
            "input, or inputs with rates, as v=-1,q2=0.5, of which what moves the task is taken off.",
        ),
    ] = None,
    duration: Annotated[float, typer.Option(metavar="S", help="Of the self-motion one way, s.")] = 4.0,
    speed: Annotated[
        float, typer.Option(metavar="SIZE", help="Largest size of its inputs, m/s and rad/s together.")
    ] = 0.5,
    html: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Write the self-motion in 3D: one file, works offline."),
    ] = None,
    play: Annotated[bool, typer.Option("--play", help="Play it in the browser; Ctrl-C ends it.")] = False,
    browser: Browser,
    loading: Loading,
) -> None:
    """Say what a task leaves free.

    Degrees of static and kinematic redundancy, the ranks at a configuration, the motions of the inputs that
    leave the task at rest, in words, and those of the coordinates that the wheels withhold.

    \b
    nmm redundancy unicycle_2r --task position --at q2=pi/3
    nmm redundancy unicycle_2r --task position --at q2=pi/3 --self-motion 0 --play
    nmm redundancy ur5_unicycle_pose --self-motion v --html self_motion.html
    """
    from nmm.analysis.redundancy import report
    from nmm.analysis.redundancy.moving import self_motion as moved_along
    from nmm.analysis.redundancy.null_fields import expect_direction
    from nmm.arrays import positive
    from nmm.cli.redundancy_tables import check_file, direction_of, show_report, show_self_motion
    from nmm.cli.subjects import studied

    if self_motion is None and (html is not None or play):
        raise InputError(
            "--html and --play show a self-motion: expected --self-motion, as in --self-motion 0"
        )
    duration, speed = positive(duration, "--duration"), positive(speed, "--speed")
    if html is not None:
        check_file(html, "--html")
    direction = None if self_motion is None else direction_of(self_motion)
    found = studied(subject.subject, **subject.keywords(), **loading.keywords())
    free = report.redundancy(found.subject, found.q, found.t)
    if direction is None:
        show_report(free)
        return
    expect_direction(found.robot, free.J, free.rank_J, direction, "--self-motion")
    dt = min(DT, duration / 4.0)
    try:
        moved = moved_along(
            found.subject, found.q, t=found.t, direction=direction, duration=duration, speed=speed, dt=dt
        )
    except SingularError:
        show_report(free)
        raise
    show_report(free)
    show_self_motion(moved)
    short = moved.text if len(moved.text) <= LONGEST_TITLE else "self-motion"
    title = f"{found.robot.name}: {short}"
    motion = moved.trajectory.motion("self-motion")
    if html is not None:
        from nmm.playback import write_html

        show_text(f"written: {write_html([motion], html, title=title)}")
    if play:
        from nmm.playback import play as play_motions

        play_motions([motion], **browser.keywords(), title=title)


@command
def laps(
    scenario: ScenarioArgument,
    number: Annotated[
        int, typer.Option("--laps", metavar="N", help="How many; 3 or more tell whether the drift falls.")
    ] = 5,
    resolvers: ResolversOption = "rg,pg",
    period: Annotated[
        float | None,
        typer.Option(metavar="S", help="Of the path, s.", show_default="that of the circles in the task"),
    ] = None,
    settings: SetOption = None,
    out: Annotated[Path | None, out_option("runs/<scenario>-laps")] = None,
    *,
    table: TableOption = None,
    figures: Figures,
) -> int:
    """Go round a closed path several times: does the posture come back?

    How far each coordinate drifts in each lap, for each resolver, and whether the drift falls.

    \b
    nmm laps unicycle_2r_position
    nmm laps unicycle_2r_extended_jacobian --resolvers ej --laps 8 --set task.0.reference.radius=0.5

    The folder holds laps.png, laps.csv, summary.json and, for each resolver, a folder with its run.
    """
    from nmm.cli.chosen_resolvers import named
    from nmm.cli.laps import run_laps

    kinds = named(resolvers, "--resolvers", "kinds with commas between them, as in rg,pg")
    asked = figures.options()
    return run_laps(
        scenario,
        kinds,
        settings_of(settings),
        laps=number,
        period=period,
        out=out,
        figures=asked,
        form=form_of(table),
    )
