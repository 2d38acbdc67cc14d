"""Calibrations of real drives: `python benchmarks/real_drives.py FOLDER`, a clone of
github.com/sousarbarb/optiodom (MIT licence; its README names the papers), whose robots were seen by motion
capture. Prints the numbers of docs/calibration.md.
"""

from __future__ import annotations

import sys
import tempfile
import warnings
from pathlib import Path

import numpy as np

import nmm

#: Ticks of a wheel's turn (gear 43.7, encoder 64), nominal radius and track, m.
TICKS, ARGUMENTS = 2796.8, {"wheel_radius": 0.042, "track": 0.2}
UNITS = {"time": "s", "wheels": f"ticks/row:{TICKS}", "position": "m", "heading": "rad"}
COLUMNS = "t,x,y,theta,right_wheel_joint,left_wheel_joint\n"
FREE = ("free/030120210001", "free/030120210006")
SQUARES = (("square/230620202042", "square/230620202317"), ("square/231220200029", "square/231220200040"))


def logs_of(folder: Path, kind: str, robot: nmm.Robot) -> list[nmm.DriveLog]:
    """The drives of a set, in order."""
    logs = []
    with tempfile.TemporaryDirectory() as made:
        for file in sorted((folder / "data" / "diff" / kind).glob("*_run-??.csv")):
            copy = Path(made) / file.name
            copy.write_text(COLUMNS + file.read_text())
            logs.append(nmm.DriveLog.from_csv(copy, robot, units=UNITS))
    return logs


def ends_off(robot: nmm.Robot, logs: list[nmm.DriveLog]) -> float:
    """How far off squares end by dead reckoning, m: the farther centre of gravity of both ways (E_max)."""
    return nmm.UMBmark.from_logs(robot, logs).largest_error


def main(folder: Path) -> None:
    robot = nmm.load("differential_base", arguments=ARGUMENTS)
    free = [log for kind in FREE for log in logs_of(folder, kind, robot)[:2]]
    found = nmm.calibrate(robot, free)
    print(f"{len(free)} free drives, {sum(log.duration for log in free):.0f} s")
    for name in ("radius.left_wheel_joint", "radius.right_wheel_joint", "track"):
        number = found.numbers[name]
        print(f"  {name}: {number.before:g} -> {number.after:.5f} ± {number.deviation:.5f} m")
    print(f"  {found.held_out}")
    for learn, test in SQUARES:
        squares, others = logs_of(folder, learn, robot), logs_of(folder, test, robot)
        found = nmm.calibrate(robot, squares)
        report = nmm.UMBmark.from_logs(robot, squares, by="both")
        by_paper = nmm.with_numbers(
            robot,
            {
                "radius.left_wheel_joint": 0.042 * report.c_left,
                "radius.right_wheel_joint": 0.042 * report.c_right,
                "track": report.true_track,
            },
        )
        ends = [
            nmm.DriveLog(
                log.name, log.t, log.readings, log.reference_t[[0, -1]], log.reference[[0, -1]], "ends"
            )
            for log in squares
        ]
        by_ends = nmm.calibrate(robot, ends)
        print(f"{learn} ({len(squares)} squares) on {test} ({len(others)}): E_max of the ends")
        found_by = {"file": robot, "UMBmark": by_paper, "looks": found.calibrated, "ends": by_ends.calibrated}
        for title, wheels in found_by.items():
            track = nmm.robot_numbers(wheels)["track"].value
            print(f"  {title}: {1e3 * ends_off(wheels, others):.1f} mm, track {track:.4f} m")


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    np.set_printoptions(precision=5)
    main(Path(sys.argv[1]))
