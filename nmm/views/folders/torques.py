"""The folder of a motion's torques: numbers, a row a sample, and the figure."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from nmm.base.arrays import finite
from nmm.base.figure_options import PLAIN, FigureOptions
from nmm.views.folders.whole import FolderKind, replaced_folder

if TYPE_CHECKING:
    from nmm.model.dynamics.torques import Torques

is_torques = FolderKind("nmm torques 1")


def save(result: Torques, folder: str | Path, *, figures: FigureOptions = PLAIN) -> Path:
    """Write summary.json, torques.csv and torques.png, replacing a folder of torques; InputError for one of
    anything else, or one that cannot be written."""
    from nmm.views.figures.style import save_as
    from nmm.views.figures.torques import torques

    with replaced_folder(folder, is_torques) as temporary:
        is_torques.write(temporary, finite(result.summary()))
        columns = result.columns()
        with (temporary / "torques.csv").open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(columns)
            writer.writerows(np.column_stack([*columns.values()]).tolist())
        save_as(torques(result, **figures.across()), temporary, "torques", figures)
    return Path(folder)
