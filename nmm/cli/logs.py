"""export, and compare with a bag: runs as logs of ROS 2's messages, and a robot's logs beside runs."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

from nmm.cli.groups import command
from nmm.cli.interrupts import shielded
from nmm.cli.options import flag, option
from nmm.cli.output import OK, show_table, show_text
from nmm.errors import InputError


@command
def export(
    folder: Annotated[Path, typer.Argument(metavar="RUN_DIR", help="A folder of `nmm run`.")],
    file: Annotated[
        Path | None, typer.Argument(metavar="[FILE]", help="Ends in .mcap.", show_default="RUN_DIR.mcap")
    ] = None,
    *,
    mcap: bool = flag("--mcap", "An MCAP file of ROS 2's messages."),
    start: float = option("S", "The clock's time at the run's t = 0, s since 1970.", default=0.0),
) -> int:
    """Write a run as a log that Foxglove, Rerun and ROS 2's tools open.

    Joint states, TF, odometry, poses, twist, inputs, task error, paths, events, the robot's description
    (docs/ros.md). Needs pip install rosbags.

    \b
    nmm export runs/unicycle_2r_position-rg --mcap
    nmm export runs/unicycle_2r_position-rg --mcap here.mcap --start 1700000000
    """
    from nmm.ros.description import packaged
    from nmm.runs.trajectory import Trajectory

    if not mcap:
        raise InputError("say what to write", where="nmm export", expected="--mcap")
    path = Path(f"{folder.resolve()}.mcap") if file is None else file
    run = Trajectory.load(folder)
    with shielded():
        run.save_mcap(path, start)
    show_text(f"written: {path}")
    if folders := dict.fromkeys(folder for folder, _ in packaged(run.robot).values()):
        show_text(f"its meshes are found with ROS_PACKAGE_PATH={os.pathsep.join(folders)}")
    return OK


def compare_with_bag(source: str, bag: Path, out: Path | None) -> int:
    """Tell how far a bag's motion is from a run's, and write both as a comparison."""
    from nmm.folders import comparison
    from nmm.folders.whole import check_folder
    from nmm.ros.bag import read_bag
    from nmm.ros.difference import difference
    from nmm.runs.trajectory import Trajectory

    run = Trajectory.load(source)
    folder = out or Path("runs") / f"{Path(source).resolve().name}-compare"
    check_folder(folder, comparison.is_comparison)
    measured = read_bag(bag, run.robot, frame=run.frame)
    found = difference(run, measured)
    with shielded():
        comparison.save([run, measured], folder, f"{run.robot.name}: {run.called} and {bag.name}")
    rows = [
        [name, one["unit"], f"{one['rms']:.3g}", f"{one['max']:.3g}", f"{one['t']:.4g} s"]
        for name, one in found["differences"].items()
    ]
    columns = ["difference of", "unit", "RMS", "largest", "at"]
    title = f"{bag.name} beside {run.called}, {found['duration']:.4g} s"
    show_table(columns, rows, title=title, numeric=columns[2:4])
    show_table(["", ""], [["files in", str(folder)]])
    return OK
