"""The curves of a run that is being computed: what is plotted, and what of it has been recorded."""

from __future__ import annotations

import numpy as np

from nmm.arrays import Array, Integers
from nmm.control.controller import Controller
from nmm.control.sequenced import SequencedController
from nmm.functions.tasks.task import Stack
from nmm.kernels.spectra import spectra
from nmm.playback.channels import Channel, partition_text, still_channels
from nmm.robots.frame_path import FramePath
from nmm.runs.joining import row_names
from nmm.runs.recording import Recorder
from nmm.runs.shown_frame import shown


class Growing:
    """What a page plots of a run while it is recorded, and draws of its path.

    A run of tasks that come and go has the rows of all: not numbers where a task is not active.

    Parameters
    ----------
    controller : of the run

    Attributes
    ----------
    channels : what is plotted, without values
    partitions : what each of RG's partitions is called, by its number, as they come
    drawn : whether a frame's way is drawn, and whether where it shall be
    """

    def __init__(self, controller: Controller) -> None:
        self._robot = robot = controller.robot
        self._sequence = controller if isinstance(controller, SequencedController) else None
        tasks = controller.task if self._sequence is None else self._sequence.all_tasks
        self._counts = [len(task.rows(robot)) for task in tasks]
        self._rows = sum(self._counts)
        self._shown = shown(tasks, robot)
        self._path = None if self._shown.frame is None else FramePath(robot, self._shown.frame)
        self.drawn = self._path is not None, self._path is not None and bool(self._shown.rows)
        self.partitions: list[str] = []
        self._numbers: dict[tuple[int, ...], int] = {}
        self.channels = self._channels(controller, tasks)

    def _channels(self, controller: Controller, tasks: Stack) -> tuple[Channel, ...]:
        none, robot = np.zeros(0), controller.robot
        rows = [row for task in tasks for row in task.rows(robot)]
        names = [row.name for row in rows] if self._sequence is None else row_names(self._sequence)
        units = ", ".join(dict.fromkeys(row.unit for row in rows))
        # Of tasks that come and go the levels come and go, too.
        levels = 0 if controller.limits is None or self._sequence is not None else len(tasks.levels(robot))
        scales = ["λ"] if levels == 1 else [f"λ of level {i + 1}" for i in range(levels)]
        partitioned = controller.resolver.name.lower() == "rg"
        return (
            Channel("error_norm", "‖e‖", units, "error", none, log=True),
            *([] if controller.objective is None else [Channel("objective", "H", "", "H", none)]),
            Channel("sigma_min", "σ_min", "", "sigma", none),
            *(Channel(f"scale_{i}", text, "", "scale", none) for i, text in enumerate(scales)),
            *([Channel("partition", "partition", "", "partition", none)] if partitioned else []),
            Channel("residual", "‖J u − rate‖", "", "residual", none, log=True),
            *(
                Channel(f"error_{name}", f"e of {name}", row.unit, "components", none)
                for name, row in zip(names, rows, strict=True)
            ),
            *still_channels(robot),
        )

    def active_rows(self) -> Integers:
        """Which of all rows are those of the tasks that are active now; asked as a leg of the run begins."""
        first = np.cumsum([0, *self._counts])
        on = [True] * len(self._counts) if self._sequence is None else self._sequence.moment.active
        parts = [np.arange(first[i], first[i + 1]) for i, active in enumerate(on) if active]
        return np.concatenate([np.zeros(0, dtype=np.int64), *parts])

    def values(self, recorder: Recorder, rows: Integers, at: Integers) -> Array:
        """The samples numbered `at` (K,) of a recorder whose tasks have those rows of all: (K, channels) and
        after them where the drawn frame is (3) and shall be (3), m, as `drawn` says."""
        found = recorder.found
        error, desired = np.full((2, len(at), self._rows), np.nan)
        known = slice(len(rows))  # without a task, a recorder has a row of its own
        error[:, rows], desired[:, rows] = found.error[at][:, known], found.r_d[at][:, known]
        of: dict[str, Array] = {
            "error_norm": np.linalg.norm(found.error[at], axis=1),
            "objective": found.objective[at],
            "sigma_min": spectra(found.J[at], threads=1)[:, -1],
            "partition": self._partition(found.partition[at]),
            "residual": found.residual[at],
            **{f"scale_{i}": column for i, column in enumerate(found.scale[at].T)},
        }
        ahead = len(self.channels) - self._rows - self._robot.n_u - self._robot.n
        parts = [*(of[channel.name] for channel in self.channels[:ahead]), error, found.u[at], found.q[at]]
        if self._path is not None:
            place = self._path.positions(found.q[at])
            parts.append(place)
            if self._shown.rows:
                parts.append(self._shown.desired(place, desired))
        return np.column_stack(parts)

    def _partition(self, columns: Integers) -> Array:
        """The partitions' numbers (K,) by their columns (K, s); one that is new gets the next."""
        found = []
        for one in np.sort(columns, axis=1):
            key = tuple(int(column) for column in one if column >= 0)
            if key not in self._numbers:
                self._numbers[key] = len(self._numbers)
                self.partitions.append(partition_text(self._robot, key))
            found.append(self._numbers[key])
        return np.array(found, dtype=np.float64)
