"""What is kept of many runs: in memory, or in files, a bounded part at a time."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from nmm.arrays import Array
from nmm.errors import InputError, expect_known
from nmm.memory import expect_memory
from nmm.runs.recorded import Recorded
from nmm.words import listed

#: What can be kept: quantities of a sample, by the names of a trajectory.
QUANTITIES = ("q", "q_dot", "u", "r", "r_d", "error", "objective", "residual", "scale", "partition")
#: How large a file of a part is, bytes.
PART = 64e6


class Kept:
    """Room for some quantities of every `every`-th sample of B runs.

    Parameters
    ----------
    names : of QUANTITIES
    times (N,) : of the samples, s
    count : how many runs there are
    shapes : of one run's quantities
    folder : where parts go as npz files; None to hold all in memory

    Raises
    ------
    InputError : a name that is none; a folder with nothing to keep in it; more than there is memory for
    """

    def __init__(
        self,
        names: Sequence[str],
        times: Array,
        every: int,
        count: int,
        shapes: Recorded,
        folder: Path | None,
    ) -> None:
        for name in names:
            expect_known("keep", name, QUANTITIES, "rollout")
        if folder is not None and not names:
            raise InputError(f"folder: there is nothing to write; name what to keep, of {listed(QUANTITIES)}")
        self.names, self.every, self._folder = tuple(names), every, folder
        self.t = times[::every].copy()
        each = {name: getattr(shapes, name)[::every] for name in names}
        of_one = sum(one.nbytes for one in each.values())
        self.part = count if folder is None else max(1, min(count, int(PART / max(of_one, 1))))
        expect_memory(
            of_one * self.part,
            f"keep: {', '.join(names)} of {count} runs with {len(self.t)} samples each are",
            "keep less, every so many samples (every=), or in files (folder=)",
        )
        self._each, self.count = each, count
        self.files: list[Path] = []

    def room(self, runs: int) -> dict[str, Array]:
        """Room for so many runs: not numbers (-1 for integers) where a run has no sample."""
        return {
            name: np.full((runs, *one.shape), -1 if one.dtype.kind == "i" else np.nan, dtype=one.dtype)
            for name, one in self._each.items()
        }

    def put(self, room: dict[str, Array], row: int, found: Recorded, count: int) -> None:
        """The first `count` samples of a run, in a row of the room."""
        for name, whole in room.items():
            some = getattr(found, name)[: count : self.every]
            whole[row, : len(some)] = some

    def write(self, first: int, room: dict[str, Array]) -> None:
        """A part as a file, whole or not at all."""
        if self._folder is None:
            return
        self._folder.mkdir(parents=True, exist_ok=True)
        path = self._folder / f"rollouts-{first:09d}.npz"
        unfinished = path.with_suffix(".part")
        with unfinished.open("wb") as file:
            arrays: dict[str, Any] = {"t": self.t, "first": np.array(first), **room}
            np.savez(file, **arrays)
        os.replace(unfinished, path)
        self.files.append(path)
