"""torques: what a run asks of the motors, and how near it is to tipping."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from nmm.base.errors import InputError
from nmm.base.text_format import listed
from nmm.cli.groups import Figures, opening_command
from nmm.cli.interrupts import shielded
from nmm.cli.options import SetOption, flag, option, out_option, values_of
from nmm.cli.output import OK, progress, show_table, show_text, warn

if TYPE_CHECKING:
    from nmm.model.dynamics.torques import Torques


@opening_command
def torques(
    source: Annotated[
        str, typer.Argument(metavar="RUN|SCENARIO", help="A run's folder; or a scenario, which is run.")
    ],
    *,
    payload: list[str] | None = option(
        "FRAME=KG", "A mass carried by a frame, or KG@X,Y,Z: at that point of it, m. May be repeated."
    ),
    settings: SetOption = None,
    out: Annotated[Path | None, out_option("runs/<name>-torques")] = None,
    as_json: bool = flag("--json", "The numbers as JSON on standard output, for scripts."),
    figures: Figures,
) -> int:
    """Say what a run asks of the motors, and how near it is to tipping.

    Rigid bodies on rolling wheels: the peak and RMS of each motor's torque beside its limit in the robot's
    file, power, energy, and the least distance of the zero-moment point to the polygon of the wheels.

    \b
    nmm torques runs/ur5_differential_line-rg
    nmm torques tiago_pose --payload arm_tool_link=1.5@0,0,0.1
    nmm torques unicycle_2r_position --json

    Not in it: friction, tyres that scrub, the motors' own inertia, the motion of casters. The folder holds
    torques.csv, torques.png and summary.json.
    """
    from nmm.cli.document import print_json
    from nmm.cli.subjects import opened
    from nmm.views.folders.torques import is_torques, save
    from nmm.views.folders.whole import check_folder

    drawn = figures.options()
    run, scenario, robot = opened(source, settings, {})
    name = scenario.name if run is None and scenario is not None else Path(source).resolve().name
    folder = out or Path("runs") / f"{name}-torques"
    check_folder(folder, is_torques)
    if run is None:
        if scenario is None:
            what = f"{robot.name} is a robot"
            raise InputError(what, where=source, expected="a run's folder or a scenario")
        with progress(name) as report:
            run = scenario.run(progress=report)
    expected = "FRAME=KG or FRAME=KG@X,Y,Z, as in ee=1.5"
    result = run.torques(values_of(payload, "--payload", expected, _load))
    with shielded():
        save(result, folder, figures=drawn)
    for finding in result.findings:
        warn(str(finding))
    if as_json:
        print_json({**result.summary(), "folder": str(folder)}, [*result.findings])
    else:
        _show(result, folder)
    return OK


def _load(text: str) -> float | tuple[float, list[float]]:
    """KG or KG@X,Y,Z: a mass, or a mass and its place in the frame, m."""
    from nmm.scenario.numbers import evaluate

    mass, at, place = text.partition("@")
    return (evaluate(mass), [evaluate(part) for part in place.split(",")]) if at else evaluate(mass)


def _show(result: Torques, folder: Path) -> None:
    summary = result.summary()
    rows = [
        [
            name,
            motor["unit"],
            f"{motor['peak']:.3g}",
            f"{motor['t']:.4g} s",
            f"{motor['rms']:.3g}",
            "none" if motor["effort"] is None else f"{motor['effort']:.4g}",
            "" if motor["effort"] is None else f"{100 * motor['share']:.0f} %",
        ]
        for name, motor in summary["actuators"].items()
    ]
    columns = ["motor", "unit", "peak", "at", "RMS", "limit", "of it"]
    show_table(columns, rows, numeric=columns[2:])
    show_text()
    balance, least = "the wheels of its file are too few to say", summary["tipping"]
    if least is not None:
        where = f"at {least['t']:.4g} s, over the edge from {' to '.join(least['edge'])}"
        balance = f"{1e3 * least['margin']:.3g} mm to tipping, {where}"
    rows = [
        ["power", f"{summary['power_peak']:.3g} W at most"],
        ["energy", f"{summary['energy']:.4g} J, without what braking gives back"],
        ["balance", balance],
    ]
    if summary["jumps"]:
        times = [f"{t:.4g}" for t in summary["jumps"]]
        more = " …" if len(times) > 5 else ""
        rows.append(["inputs jump", f"after {listed(times[:5])} s{more}: what that takes is not in it"])
    if summary["left_out"]:
        rows.append(["held still", listed(summary["left_out"])])
    show_table(["", ""], [*rows, ["files in", str(folder)]])
