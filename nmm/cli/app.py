"""The commands in the order in which the help lists them; those that list what is bundled."""

import re
from typing import Annotated

import typer

from nmm.bundled import bundled_robots, bundled_scenarios
from nmm.cli.descriptions import info
from nmm.cli.logs import export
from nmm.cli.mapping import map_measures
from nmm.cli.options import flag
from nmm.cli.output import show_table, show_text
from nmm.cli.planning import plan
from nmm.cli.playing import drive, play, render, view
from nmm.cli.redundancy import laps, redundancy
from nmm.cli.robot_files import check, init
from nmm.cli.runs import compare, paper, run
from nmm.cli.singularities import singularities
from nmm.cli.sweeping import sweep
from nmm.cli.torques import torques

app = typer.Typer(
    name="nmm",
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)


def _version(wanted: bool) -> None:
    if wanted:
        from nmm.machine import versions

        print(versions())
        raise typer.Exit


@app.callback(invoke_without_command=True)
def nmm(
    context: typer.Context,
    version: Annotated[
        bool,
        typer.Option(
            "--version",
            help="Show the version, and those of Python and libraries, and exit.",
            callback=_version,
            is_eager=True,
        ),
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


def scenarios(keys: bool = flag("--keys", "List the keys of a scenario file instead.")) -> None:
    """List the bundled scenarios.

    They are YAML files; to make your own, start from the scenario.yaml that a run writes.
    """
    if not keys:
        from nmm.scenario.document import read_file

        titles = [[name, read_file(path).data.get("title", "")] for name, path in bundled_scenarios().items()]
        show_table(["scenario", "what it shows"], titles)
        return
    from nmm.scenario.reference import sections

    for section in sections():
        show_text(f"{section.title} ({section.summary.rstrip('.')})")
        if section.keys:
            show_table(["key", "default", "meaning"], section.keys)
        show_text()


def robots() -> None:
    """List the bundled robots: whole ones, bases and arms."""
    rows = []
    for name, path in bundled_robots().items():
        text = path.read_text(encoding="utf-8")
        about = re.search(r"<!--\s*(.+?)\s*(?:\n\s*\n|-->)", text, re.DOTALL)
        declared = re.search(r'<nmm\s+platform="([^"]+)"', text)
        platform = f" Platform: {declared.group(1)}." if declared else ""
        words = " ".join(about.group(1).split()) if about else ""
        arguments = re.findall(r'<xacro:arg\s+name="([^"]+)"\s+default="([^"]*)"', text)
        rows.append([name, words + platform, ", ".join(map("=".join, arguments))])
    show_table(["robot", "what it is", "arguments (m, rad)"], rows)


for _command in (
    run,
    compare,
    plan,
    paper,
    play,
    render,
    export,
    info,
    init,
    check,
    view,
    drive,
    singularities,
):
    app.command()(_command)
app.command("map")(map_measures)
for _command in (redundancy, laps, torques, sweep, scenarios, robots):
    app.command()(_command)
