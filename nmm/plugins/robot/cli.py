"""export, and compare with a bag: runs as logs of ROS 2 and as data sets, a robot's logs beside runs."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from nmm.base.errors import InputError, expect
from nmm.base.plugins import OptionGroup
from nmm.cli.groups import opening_command
from nmm.cli.interrupts import shielded
from nmm.cli.options import flag, named, names_of, option, size_of
from nmm.cli.output import OK, show_table, show_text, warn

if TYPE_CHECKING:
    from nmm.motion.trajectory import Trajectory


#: What ROS's logs end in; others are tables.
BAGS = (".mcap", ".db3", ".bag")


def is_bag(file: str) -> bool:
    """Whether it is a log of ROS's, by its name."""
    path = Path(file)
    return path.suffix in BAGS or path.is_dir()


@opening_command
def export(
    folders: Annotated[
        list[Path],
        typer.Argument(
            metavar="RUN_DIR", help="Folders of `nmm run`; with --mcap one, and the log, RUN_DIR.mcap."
        ),
    ],
    *,
    mcap: bool = flag("--mcap", "An MCAP file of ROS 2's messages."),
    lerobot: Path | None = option("DIR", "A data set of LeRobot's, an episode a run.", show="none"),
    start: float | None = option("S", "The clock's time at the run's t = 0, s since 1970.", show="0"),
    task: str | None = option("TEXT", "What is done, in a data set.", show="the scenario's title"),
    fps: int | None = option("N", "Frames a second of a data set.", show="30"),
    video: str | None = option(
        "FROM", "A data set's pictures, from iso, top, front or wall, or several: iso,top.", show="none"
    ),
    size: str | None = option("WxH", "Of a data set's pictures, px.", show="640x480"),
) -> int:
    """Write a run as a log that Foxglove, Rerun and ROS 2's tools open, or runs as a data set of LeRobot's.

    A log has joint states, TF, odometry, poses, twist, inputs, task error, paths, events, the robot's
    description (docs/ros.md); it needs pip install rosbags. A data set, v3.0, has states, actions and
    targets in SI units, which it states (docs/data_sets.md); it needs pip install pyarrow, and its pictures
    Chromium and pip install imageio-ffmpeg.

    \b
    nmm export runs/unicycle_2r_position-rg --mcap
    nmm export runs/unicycle_2r_position-rg --mcap here.mcap --start 1700000000
    nmm export runs/pick-* --lerobot picks --task "pick up the cube" --fps 20
    nmm export runs/pick-* --lerobot picks --video front,top --size 320x240
    """
    if mcap == (lerobot is not None):
        raise InputError("say what to write", expected="--mcap or --lerobot DIR")
    for name, value, fits in (
        ("task", task, not mcap), ("fps", fps, not mcap), ("start", start, mcap),
        ("video", video, not mcap), ("size", size, not mcap),
    ):  # fmt: skip
        expect(value is None or fits, f"--{name}", f"--{'lerobot' if mcap else 'mcap'}, which it is of")
    if lerobot is None:
        return _write_log(folders, start or 0.0)
    from nmm.plugins.robot.lerobot.writing import write_lerobot

    expect(size is None or video is not None, "--size", "--video, which it is of")
    write_lerobot(
        _runs_of(folders),
        lerobot,
        task=task,
        fps=30 if fps is None else fps,
        video=() if video is None else named(video, "--video"),
        size=size_of(size or "640x480"),
    )
    show_text(f"written: {lerobot}")
    return OK


def _runs_of(folders: list[Path]) -> Iterator[Trajectory]:
    """The runs of folders, called as these are."""
    from nmm.motion.trajectory import Trajectory

    for folder in folders:
        run = Trajectory.load(folder)
        if not run.complete:
            warn(f"{folder}: {run.outcome}: {run.message}")
        yield replace(run, label=str(folder))


def _write_log(folders: list[Path], start: float) -> int:
    from nmm.motion.trajectory import Trajectory
    from nmm.plugins.robot.ros.description import packaged

    expect(len(folders) <= 2, "--mcap", "a run, and a file", [str(folder) for folder in folders])
    folder = folders[0]
    path = folders[1] if len(folders) == 2 else Path(f"{folder.resolve()}.mcap")
    run = Trajectory.load(folder)
    with shielded():
        run.save_mcap(path, start)
    show_text(f"written: {path}")
    if found := dict.fromkeys(folder for folder, _ in packaged(run.robot).values()):
        show_text(f"its meshes are found with ROS_PACKAGE_PATH={os.pathsep.join(found)}")
    return OK


@dataclass(frozen=True)
class LogOptions(OptionGroup):
    """Where a robot's messages are in a log, and what its frames are called."""

    joints: str | None = option("TOPIC,...", "Joint states of the robot's log.", show="joint_states")
    odometry: str | None = option("TOPIC", "Its odometry.", show="odom")
    tf: str | None = option("TOPIC", "Its transforms; with _static behind, those that are static.", show="tf")
    map_frame: str | None = option("FRAME", "The frame in which a localisation works.", "--map", show="map")
    odom_frame: str | None = option("FRAME", "The frame of its odometry in TF.", "--odom", show="odom")
    base: str | None = option(
        "FRAME", "A frame of its platform.", show="any that the robot's file has fixed to the platform"
    )
    namespace: str | None = option(
        "NAME", "The namespace of its topics, of those without a slash in front.", show="none"
    )
    prefix: str | None = option(
        "TEXT", "What the names of its frames begin with: robot1/", show="the namespace, where frames have it"
    )

    def keywords(self) -> dict[str, Any]:
        """As `nmm.read_bag` takes them, without those not given."""
        told = {
            "joints": None if self.joints is None else names_of(self.joints, "--joints"),
            "odometry": self.odometry,
            "tf": self.tf,
            "map": self.map_frame,
            "odom": self.odom_frame,
            "base": self.base,
            "namespace": self.namespace,
            "prefix": self.prefix,
        }
        return {name: value for name, value in told.items() if value is not None}

    def refuse(self) -> None:
        """`InputError` where there is no log that they are of."""
        if asked := [*self.keywords()]:
            raise InputError("there is no log: nmm compare RUN BAG", where=f"--{asked[0]}")

    def answer(self, *subject: Any) -> int | None:
        """Of a run's folder, a log and where to write: how far the log's motion is from the run's."""
        source, log, out = subject
        return compare_with_bag(source, log, out, self)


def compare_with_bag(source: str, bag: Path, out: Path | None, names: LogOptions) -> int:
    """Tell how far a bag's motion is from a run's, and write both as a comparison."""
    from nmm.motion.trajectory import Trajectory
    from nmm.plugins.robot.ros.bag import read_bag
    from nmm.plugins.robot.ros.difference import difference
    from nmm.views.folders import comparison
    from nmm.views.folders.whole import check_folder

    run = Trajectory.load(source)
    folder = out or Path("runs") / f"{Path(source).resolve().name}-compare"
    check_folder(folder, comparison.is_comparison)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # each is one of the trajectory's, too
        measured = read_bag(bag, run.robot, frame=run.frame, **names.keywords())
    for warning in measured.warnings:
        warn(f"{bag.name}: {warning}")
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
