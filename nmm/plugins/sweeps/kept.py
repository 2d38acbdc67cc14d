"""What is kept of many runs: measures, and quantities in memory or in files, one bounded part at a time."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from nmm.base.arrays import Array
from nmm.base.errors import InputError, expect_known
from nmm.base.files import whole_file, written_at
from nmm.base.kernels.compiled import compiled, compiled_without_gil, scratch, view
from nmm.base.kernels.spectra import write_spectrum
from nmm.base.machine import expect_memory
from nmm.control.step.quantities import saved
from nmm.control.step.recorded import Recorded

#: Quantities of a sample that can be kept, named as in a trajectory.
QUANTITIES = (*(quantity.name for quantity in saved() if quantity.noted), "believed")
#: Largest size of a part's file, bytes.
PART = 64e6
#: What `measure` writes, in order. Norms are over the task's rows in their mixed units, as in a summary.
MEASURES = (
    "t_end",
    "error_initial",
    "error_final",
    "error_rms",
    "error_max",
    "objective_final",
    "objective_integral",
    "sigma_min",
    "residual_max",
    "scale_min",
    "partition_switches",
    "input_rms",
    "input_peak",
    "input_integral",
    "drift",
)

#: The least singular value is sought at every 64th sample, then at every 8th, then at all.
STRIDES = (64, 8, 1)
#: Effect of rounding on a singular value, as a share of the largest one.
ROUNDING = 1e-13


class Kept:
    """Room for some of QUANTITIES, shaped as one run's `shapes`, at every `every`-th of the times (N,), s, of
    `count` runs; in `folder` as npz files of some runs each, or all in memory if None."""

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
            raise InputError(where="folder", expected="names of what to keep", available=QUANTITIES)
        self._every, self._folder = every, folder
        self.t = times[::every].copy()
        like = {**shapes._asdict(), "believed": shapes.q}
        self._each = {name: like[name][::every] for name in names}
        of_one = sum(array.nbytes for array in self._each.values())
        self.part = count if folder is None else max(1, min(count, int(PART / max(of_one, 1))))
        expect_memory(
            of_one * self.part,
            f"keep: {', '.join(names)} of {count} runs with {len(self.t)} samples each are",
            "keep less, every so many samples (every=), or in files (folder=)",
        )
        self.files: list[Path] = []

    def room(self, runs: int) -> dict[str, Array]:
        """Arrays for so many runs, filled with NaN (-1 for integers)."""
        return {
            name: np.full((runs, *array.shape), -1 if array.dtype.kind == "i" else np.nan, dtype=array.dtype)
            for name, array in self._each.items()
        }

    def put(
        self, room: dict[str, Array], row: int, recorded: Recorded, believed: Array | None, count: int
    ) -> None:
        """Write a run into `room`; believed (N, n): what its controller takes q for, q itself if None."""
        of_run = {**recorded._asdict(), "believed": recorded.q if believed is None else believed}
        for name, whole in room.items():
            some = of_run[name][: count : self._every]
            whole[row, : len(some)] = some

    def write(self, first: int, room: dict[str, Array]) -> None:
        """Write a part as a file, whole or not at all."""
        if self._folder is None:
            return
        path = self._folder / f"rollouts-{first:09d}.npz"
        arrays: dict[str, Any] = {"t": self.t, "first": np.array(first), **room}
        with written_at(self._folder):
            self._folder.mkdir(parents=True, exist_ok=True)
            with whole_file(path) as temporary:
                np.savez(temporary, **arrays)
        self.files.append(path)


@compiled
def least_singular_value(J: Array, count: int) -> float:
    """The least singular value of J[:count] (N, s, m), of which few are decomposed: singular values move by
    at most J's change in the Frobenius norm (Weyl 1912), so a matrix that near to the last one decomposed
    that its own stays above the least so far is skipped."""
    s, m = J.shape[1], J.shape[2]
    sigma = scratch(min(s, m))
    least = math.inf
    for stride in STRIDES:
        last = -1
        for k in range(0, count, stride):
            if last >= 0:
                square = 0.0
                for i in range(s):
                    for j in range(m):
                        square += (J[k, i, j] - J[last, i, j]) ** 2
                if sigma[sigma.shape[0] - 1] - math.sqrt(square) > least + ROUNDING * sigma[0]:
                    continue
            write_spectrum(view(J, k * s * m, (s, m)), sigma)
            least, last = min(least, sigma[sigma.shape[0] - 1]), k
    return least


@compiled_without_gil
def measure(times: Array, count: int, recorded: Recorded, out: Array) -> None:
    """Write the measures (len(MEASURES),) of the first `count` samples into `out`; NaN if there are none."""
    for i in range(out.shape[0]):
        out[i] = math.nan
    if count == 0:
        return
    s, m = recorded.error.shape[1], recorded.u.shape[1]
    errors, inputs, H, effort = 0.0, 0.0, 0.0, 0.0
    largest, peak, missed, scale, switches = 0.0, 0.0, 0.0, math.inf, 0
    before, norm = 0.0, 0.0
    for k in range(count):
        square, size = 0.0, 0.0
        for i in range(s):
            square += recorded.error[k, i] * recorded.error[k, i]
        for j in range(m):
            size += recorded.u[k, j] * recorded.u[k, j]
        norm = math.sqrt(square)
        if k == 0:
            out[1] = norm
        else:
            dt = times[k] - times[k - 1]
            H += 0.5 * dt * (recorded.objective[k] + recorded.objective[k - 1])
            effort += 0.5 * dt * (size + before)
            changed = 0
            for i in range(s):
                if recorded.partition[k, i] != recorded.partition[k - 1, i]:
                    changed = 1
            switches += changed
        before = size
        errors += square
        inputs += size
        largest, peak = max(largest, norm), max(peak, math.sqrt(size))
        missed = max(missed, recorded.residual[k])
        for level in range(recorded.scale.shape[1]):
            scale = min(scale, recorded.scale[k, level])
    out[0] = times[count - 1]
    out[2], out[3], out[4] = norm, math.sqrt(errors / count), largest
    out[5], out[6] = recorded.objective[count - 1], H
    out[7], out[8], out[9], out[10] = least_singular_value(recorded.J, count), missed, scale, switches
    out[11], out[12], out[13] = math.sqrt(inputs / count), peak, effort
