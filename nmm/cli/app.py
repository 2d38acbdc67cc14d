"""The commands of `nmm`, with their help, and how every error becomes one line and an exit status."""

from __future__ import annotations

import gc
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, NoReturn

import typer

from nmm.cli.groups import Browser, Ellipsoids, Figures, command
from nmm.cli.interrupts import raise_interrupts
from nmm.cli.mapping import map_measures
from nmm.cli.options import (
    LimitsOption,
    ResolverOption,
    ResolversOption,
    ScenarioArgument,
    SetOption,
    out_option,
    resolvers_of,
    settings_of,
)
from nmm.cli.output import complain, tell_what_takes_long
from nmm.cli.redundancy import laps, redundancy
from nmm.cli.robot_commands import check, drive, info, init, robots, scenarios, view
from nmm.cli.singularities import singularities
from nmm.cli.sweeping import sweep
from nmm.errors import InputError, NmmError

#: What typer raises for wrong usage: options that do not exist, arguments that are missing.
_USAGE_ERROR: type[Exception] = typer.BadParameter.mro()[2]

OK, FAILED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130

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


@app.callback(invoke_without_command=True)
def nmm(
    context: typer.Context,
    version: Annotated[
        bool, typer.Option("--version", help="Show the version and exit.", callback=_version, is_eager=True)
    ] = False,
) -> None:
    """Motion generation for nonholonomic mobile manipulators: a manipulator on a wheeled platform.

    \b
    nmm scenarios                             what there is to run
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
    from nmm.cli.runs import run_scenario

    return run_scenario(
        scenario,
        resolver,
        settings_of(settings),
        limits,
        out,
        html=html,
        play=play,
        **browser.keywords(),
        ellipsoids=ellipsoids.wanted(),
        figures=figures.options(),
    )


@app.command()
@command
def compare(
    scenario: ScenarioArgument,
    *,
    resolvers: ResolversOption = "rg,pg",
    settings: SetOption = None,
    limits: LimitsOption = None,
    out: Annotated[Path | None, out_option("runs/<scenario>-compare")] = None,
    ellipsoids: Ellipsoids,
    figures: Figures,
) -> int:
    """Run a scenario with several resolvers.

    One table, one figure, one playback.

    \b
    nmm compare unicycle_2r_position
    nmm compare unicycle_2r_pointing --resolvers rg,pg,ej --set resolver.alpha=5

    The folder holds comparison.png, playback.html (all robots in one scene), summary.json and, for each
    resolver, a folder with its run.
    """
    from nmm.cli.runs import compare_resolvers

    return compare_resolvers(
        scenario,
        resolvers_of(resolvers),
        settings_of(settings),
        limits,
        out,
        ellipsoids=ellipsoids.wanted(),
        figures=figures.options(),
    )


@app.command()
@command
def paper(
    *,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Where to write, as for `nmm run`.")] = Path(
        "paper"
    ),
    figures: Figures,
) -> int:
    """Redo the paper's cases and figures.

    Section VI: the four cases with RG and PG, figures 3 to 10, and the numbers that the paper claims.
    Open index.html in the folder: it shows all of it, with the motions to play. Takes less than a minute.
    """
    from nmm.cli.runs import write_the_paper

    return write_the_paper(out, figures.options())


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
    ("scenarios", scenarios),
    ("robots", robots),
):
    app.command(_name)(_command)


def status_of(arguments: Sequence[str]) -> int:
    """Run the command line; every error that a user can cause is one line on standard error.

    Returns
    -------
    0; 1 for a run that failed; 2 for bad input; 130 for Ctrl-C where there is nothing to write
    """
    prefix = "nmm"
    if arguments and arguments[0] in _commands():
        prefix = f"nmm {arguments[0]}"
    try:
        result = app(args=list(arguments), prog_name="nmm", standalone_mode=False)
        sys.stdout.flush()
        return result if isinstance(result, int) else OK
    except KeyboardInterrupt:
        return INTERRUPTED
    except BrokenPipeError:
        _discard_output()
        return FAILED
    except InputError as error:
        return _complain(prefix, str(error), BAD_INPUT)
    except NmmError as error:
        return _complain(prefix, str(error), FAILED)
    except typer.Abort:
        return INTERRUPTED
    except _USAGE_ERROR as error:
        message = error.format_message() if hasattr(error, "format_message") else str(error)
        return _complain(prefix, f"{message} (see {prefix} --help)", BAD_INPUT)
    except OSError as error:
        return _complain(prefix, str(error), FAILED)


def _commands() -> list[str]:
    return [
        command.name or command.callback.__name__
        for command in app.registered_commands
        if command.callback is not None
    ]


def _complain(prefix: str, text: str, status: int) -> int:
    complain(prefix, text)
    return status


def _discard_output() -> None:
    """The reader of our output has gone (`nmm info | head -1`): write the rest to nowhere."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def main() -> NoReturn:
    """Entry point of `nmm` and `python -m nmm`."""
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")  # a terminal that knows no Greek gets "?"
    # The libraries' objects stay: looking through them for garbage, again and again and once more at the
    # end, is a fifth of a short run's time.
    gc.set_threshold(1_000_000, 50, 50)
    raise_interrupts()
    tell_what_takes_long()
    status = status_of(sys.argv[1:])
    gc.freeze()
    sys.exit(status)
