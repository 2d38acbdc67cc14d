"""The commands of `nmm`, with their help."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from nmm.cli.gallery import gallery
from nmm.cli.groups import Browser, Ellipsoids, Figures, OfRobot, command
from nmm.cli.mapping import map_measures
from nmm.cli.options import (
    LimitsOption,
    ResolverOption,
    ResolversOption,
    ScenarioArgument,
    SetOption,
    out_option,
    settings_of,
)
from nmm.cli.paper_table import TableOption, form_of
from nmm.cli.redundancy import laps, redundancy
from nmm.cli.robot_commands import check, drive, info, init, robots, scenarios, view
from nmm.cli.singularities import singularities
from nmm.cli.sweeping import sweep
from nmm.errors import InputError

app = typer.Typer(
    name="nmm",
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)


def _version(wanted: bool) -> None:
    if wanted:
        from nmm import __version__

        print(f"nmm {__version__}")
        raise typer.Exit


def _always_written(wanted: bool) -> None:
    if wanted:
        raise InputError(
            "--html: there is no need: `nmm compare` always writes playback.html, with all runs in it"
        )


@app.callback(invoke_without_command=True)
def nmm(
    context: typer.Context,
    version: Annotated[
        bool, typer.Option("--version", help="Show the version and exit.", callback=_version, is_eager=True)
    ] = False,
) -> None:
    """Motion generation for nonholonomic mobile manipulators: a manipulator on a wheeled platform.

    \b
    nmm scenarios                             what there is to run (nmm gallery shows it)
    nmm init my_robot.urdf                    a first scenario for a robot of your own
    nmm run unicycle_2r_position              run it: figures and numbers in runs/
    nmm run unicycle_2r_position --play       and watch it in the browser
    nmm compare unicycle_2r_position          reduced against projected gradient
    nmm paper                                 the paper's four cases and figures
    nmm view unicycle_3r                      a robot in the browser, with sliders
    nmm check my_robot.urdf                   everything that is wrong with a file
    nmm singularities unicycle_2r_position    where J loses rank, and why

    Units are metres, radians and seconds. Exit status: 0; 1 when a run failed (what there is of it is
    written); 2 for bad input, with one line on standard error that says what was expected.
    """
    if context.invoked_subcommand is None:
        print(context.get_help())


@app.command()
@command
def run(
    scenario: ScenarioArgument,
    *,
    resolver: ResolverOption = None,
    settings: SetOption = None,
    limits: LimitsOption = None,
    of_robot: OfRobot,
    out: Annotated[Path | None, out_option("runs/<scenario>-<resolver>")] = None,
    html: Annotated[
        bool,
        typer.Option("--html", help="Write playback.html too: the motion in 3D, one file, works offline."),
    ] = False,
    play: Annotated[
        bool,
        typer.Option(
            "--play",
            help="Show the motion in the browser as it is computed, then play it; Ctrl-C ends it.",
        ),
    ] = False,
    browser: Browser,
    ellipsoids: Ellipsoids,
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

    The folder holds trajectory.npz and trajectory.csv (times, coordinates, inputs, errors, objective),
    summary.json (the numbers of the table), scenario.yaml (every key, to be run again) and figures as PNG,
    with --ellipsoids ellipses.png among them.
    Ctrl-C ends the run and writes the part that was computed, marked incomplete.
    """
    from nmm.cli.chosen_resolvers import chosen
    from nmm.cli.runs import run_scenario

    if not play:
        browser.refuse("--play")
    return run_scenario(
        scenario,
        None if resolver is None else chosen(resolver, "--resolver"),
        settings_of(settings),
        limits,
        out,
        html=html,
        play=play,
        **browser.keywords(),
        ellipsoids=ellipsoids.wanted(),
        figures=figures.options(),
        of_robot=of_robot.keywords(),
    )


@app.command()
@command
def compare(
    scenario: ScenarioArgument,
    *,
    resolvers: ResolversOption = "rg,pg",
    settings: SetOption = None,
    limits: LimitsOption = None,
    of_robot: OfRobot,
    out: Annotated[Path | None, out_option("runs/<scenario>-compare")] = None,
    html: Annotated[bool, typer.Option("--html", hidden=True, callback=_always_written)] = False,
    table: TableOption = None,
    ellipsoids: Ellipsoids,
    figures: Figures,
) -> int:
    """Run a scenario with several resolvers, or with one at several settings.

    One table, one figure, one playback.

    \b
    nmm compare unicycle_2r_position
    nmm compare unicycle_2r_pointing --resolvers rg,pg,ej --set resolver.alpha=5
    nmm compare unicycle_2r_position --resolvers rg,rg:alpha=5,pg:alpha=50
    nmm compare unicycle_2r_position --table latex > table.tex
    nmm compare unicycle_2r_position --resolvers rg,my_laws.py:law

    The folder holds comparison.png, playback.html (all robots in one scene), summary.json and, for each
    resolver, a folder with its run.
    """
    from nmm.cli.chosen_resolvers import several
    from nmm.cli.runs import compare_resolvers

    return compare_resolvers(
        scenario,
        several(resolvers, "--resolvers"),
        settings_of(settings),
        limits,
        out,
        ellipsoids=ellipsoids.wanted(),
        figures=figures.options(),
        of_robot=of_robot.keywords(),
        form=form_of(table),
    )


@app.command()
@command
def paper(
    *,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Where to write, as for `nmm run`.")] = Path(
        "paper"
    ),
    table: TableOption = None,
    figures: Figures,
) -> int:
    """Redo the paper's cases and figures.

    Section VI: the four cases with RG and PG, figures 3 to 10, and the numbers that the paper claims.
    Open index.html in the folder: it shows all of it, with the motions to play. Takes less than a minute.
    """
    from nmm.cli.runs import write_the_paper

    return write_the_paper(out, figures.options(), form_of(table))


@app.command()
@command
def play(
    folder: Annotated[
        Path, typer.Argument(metavar="RUN_DIR", help="A folder of `nmm run` or `nmm compare`.")
    ],
    browser: Browser,
    ellipsoids: Ellipsoids,
) -> None:
    """Play a run in the browser.

    In 3D, with MeshCat; only this machine can reach it. Ctrl-C ends it.
    """
    from nmm.cli.runs import play_folder

    play_folder(folder, **browser.keywords(), ellipsoids=ellipsoids.wanted())


@app.command()
@command
def render(
    folder: Annotated[
        Path, typer.Argument(metavar="RUN_DIR", help="A folder of `nmm run` or `nmm compare`.")
    ],
    video: Annotated[Path, typer.Option(metavar="FILE", help="Ends in .mp4, .webm or .gif.")],
    *,
    size: Annotated[str, typer.Option(metavar="WxH", help="Of a picture, px.")] = "1280x720",
    view: Annotated[str, typer.Option(metavar="FROM", help="iso, top, front or wall.")] = "iso",
    fps: Annotated[float, typer.Option(metavar="N", help="Pictures a second.")] = 30.0,
    speed: Annotated[float, typer.Option(metavar="X", help="2 shows the motion twice as fast.")] = 1.0,
    start: Annotated[
        float | None, typer.Option("--from", metavar="S", help="First instant, s.", show_default="the first")
    ] = None,
    end: Annotated[
        float | None, typer.Option("--to", metavar="S", help="Last instant, s.", show_default="the last")
    ] = None,
    follow: Annotated[bool, typer.Option("--follow", help="The camera goes with the robots.")] = False,
    plots: Annotated[bool, typer.Option("--plots", help="The curves are beside the robot.")] = False,
    apart: Annotated[
        float, typer.Option(metavar="SHARE", help="Compared robots over one another (0) or side by side (1).")
    ] = 0.0,
    ellipsoids: Ellipsoids,
) -> None:
    """Make a video of a run.

    Picture by picture through Chromium without a window, and ffmpeg (pip install 'nmm[video]').

    \b
    nmm render runs/unicycle_2r_position-rg --video motion.mp4
    nmm render runs/unicycle_2r_position-compare --video apart.gif --size 640x400 --fps 12 --apart 1
    """
    from nmm.cli.rendering import render_folder

    render_folder(
        folder, video, size=size, view=view, fps=fps, speed=speed, start=start, end=end, follow=follow,
        plots=plots, apart=apart, ellipsoids=ellipsoids.wanted(),
    )  # fmt: skip


for _name, _command in (
    ("info", info),
    ("init", init),
    ("check", check),
    ("view", view),
    ("drive", drive),
    ("singularities", singularities),
    ("map", map_measures),
    ("redundancy", redundancy),
    ("laps", laps),
    ("sweep", sweep),
    ("gallery", gallery),
    ("scenarios", scenarios),
    ("robots", robots),
):
    app.command(_name)(_command)
