"""redundancy and laps, with their options and their help."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from nmm.cli.groups import Browser, Loading, Subject, command
from nmm.cli.options import (
    ResolversOption,
    ScenarioArgument,
    SetOption,
    out_option,
    resolvers_of,
    settings_of,
)


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
) -> int:
    """Say what a task leaves free.

    Degrees of static and kinematic redundancy, the ranks at a configuration, the motions of the inputs that
    leave the task at rest, in words, and those of the coordinates that the wheels withhold.

    \b
    nmm redundancy unicycle_2r --task position --at q2=pi/3
    nmm redundancy unicycle_2r --task position --at q2=pi/3 --self-motion 0 --play
    nmm redundancy ur5_unicycle_pose --self-motion v --html self_motion.html
    """
    from nmm.cli.redundancy_tables import show_redundancy

    return show_redundancy(
        subject.subject,
        along=self_motion,
        duration=duration,
        speed=speed,
        html=html,
        play=play,
        **browser.keywords(),
        **subject.keywords(),
        **loading.keywords(),
    )


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
) -> int:
    """Go round a closed path several times: does the posture come back?

    How far each coordinate drifts in each lap, for each resolver, and whether the drift falls.

    \b
    nmm laps unicycle_2r_position
    nmm laps unicycle_2r_extended_jacobian --resolvers ej --laps 8 --set task.0.reference.radius=0.5

    The folder holds laps.png, laps.csv, summary.json and, for each resolver, a folder with its run.
    """
    from nmm.cli.laps import run_laps

    kinds = resolvers_of(resolvers)
    return run_laps(scenario, kinds, settings_of(settings), laps=number, period=period, out=out)
