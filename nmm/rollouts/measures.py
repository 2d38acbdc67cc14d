"""A motion in numbers, worked out in compiled code."""

from __future__ import annotations

import math

import numpy as np

from nmm.arrays import Array
from nmm.kernels.compiled import compiled_without_gil, scratch
from nmm.kernels.singular_values import singular_rows
from nmm.runs.recorded import Recorded

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
)


@compiled_without_gil
def measure(times: Array, count: int, found: Recorded, out: Array) -> None:
    """out (len(MEASURES),) of the first `count` samples; not numbers where there are none."""
    for i in range(out.shape[0]):
        out[i] = math.nan
    if count == 0:
        return
    s, m = found.J.shape[1], found.J.shape[2]
    J, R = scratch((s, m)), scratch((s, s))
    errors, inputs, H, effort = 0.0, 0.0, 0.0, 0.0
    largest, peak, least, missed, scale, switches = 0.0, 0.0, math.inf, 0.0, math.inf, 0
    before, norm = 0.0, 0.0
    for k in range(count):
        square, size = 0.0, 0.0
        for i in range(s):
            square += found.error[k, i] * found.error[k, i]
            for j in range(m):
                J[i, j] = found.J[k, i, j]
        for j in range(m):
            size += found.u[k, j] * found.u[k, j]
        norm = math.sqrt(square)
        if k == 0:
            out[1] = norm
        else:
            dt = times[k] - times[k - 1]
            H += 0.5 * dt * (found.objective[k] + found.objective[k - 1])
            effort += 0.5 * dt * (size + before)
            changed = 0
            for i in range(s):
                if found.partition[k, i] != found.partition[k - 1, i]:
                    changed = 1
            switches += changed
        before = size
        errors += square
        inputs += size
        largest, peak = max(largest, norm), max(peak, math.sqrt(size))
        missed = max(missed, found.residual[k])
        sigma, _ = singular_rows(J, R)
        least = min(least, sigma)
        for level in range(found.scale.shape[1]):
            scale = min(scale, found.scale[k, level])
    out[0] = times[count - 1]
    out[2], out[3], out[4] = norm, math.sqrt(errors / count), largest
    out[5], out[6] = found.objective[count - 1], H
    out[7], out[8], out[9], out[10] = least, missed, scale, switches
    out[11], out[12], out[13] = math.sqrt(inputs / count), peak, effort


def measures(times: Array, count: int, found: Recorded) -> Array:
    """`measure`'s row."""
    out = np.empty(len(MEASURES))
    measure(times, count, found, out)
    return out
