"""The commands in the order in which the help lists them; those that list what is bundled."""

import re
from collections.abc import Callable, Mapping
from typing import Annotated, Any

import typer

from nmm.base.bundled import bundled_robots, bundled_scenarios
from nmm.base.plugins import additions, complain, plugins
from nmm.cli.descriptions import info
from nmm.cli.mapping import map_measures
from nmm.cli.options import flag
from nmm.cli.output import show_table, show_text
from nmm.cli.redundancy import laps, redundancy
from nmm.cli.robot_files import check, init
from nmm.cli.runs import compare, paper, run
from nmm.cli.singularities import singularities
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
        from nmm.base.machine import versions

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


def with_plugins(commands: Mapping[str, Callable[..., Any]]) -> dict[str, Callable[..., Any]]:
    """The commands with those of plugins, each behind the one that its plugin names, or at the end."""
    functions, order = dict(commands), list(commands)
    added = additions("commands", commands)
    for plugin in plugins():
        for name in (name for name in plugin.commands if name in added and added[name].plugin == plugin.name):
            function = added[name].load()
            if function is None:
                continue
            try:
                single = typer.Typer()
                single.command(name)(function)
                typer.main.get_command(single)
            except Exception as error:  # whatever a stranger's function takes
                complain(plugin.name, f"command {name}: {type(error).__name__}: {error}; it is left out")
                continue
            functions[name] = function
            before = plugin.after.get(name)
            order.insert(order.index(before) + 1 if before in order else len(order), name)
    return {name: functions[name] for name in order}


COMMANDS: dict[str, Callable[..., Any]] = {
    command.__name__: command for command in (run, compare, paper, info, init, check, singularities)
}
COMMANDS["map"] = map_measures
COMMANDS |= {command.__name__: command for command in (redundancy, laps, torques, scenarios, robots)}
for _name, _command in with_plugins(COMMANDS).items():
    app.command(_name)(_command)
