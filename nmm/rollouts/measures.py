"""A motion in numbers, worked out in compiled code."""

from __future__ import annotations

import math

import numpy as np

from nmm.arrays import Array
from nmm.kernels.compiled import compiled, compiled_without_gil, scratch, view
from nmm.kernels.spectra import write_spectrum
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

#: Every so many samples are looked at, then every so many, then all, for the least singular value.
STRIDES = (64, 8, 1)
#: What rounding may do to a singular value, as a share of the largest one.
ROUNDING = 1e-13


@compiled
def least_singular_value(J: Array, count: int) -> float:
    """The least singular value of J[:count] (N, s, m), which few of them are decomposed for.

    A singular value moves by no more than J does in the norm of Frobenius (Weyl 1912): of a matrix so near
    to the last one decomposed that it stays above the least so far nothing more need be known.
    """
    s, m = J.shape[1], J.shape[2]
    found = scratch(min(s, m))
    least = math.inf
    for stride in STRIDES:
        last = -1
        for k in range(0, count, stride):
            if last >= 0:
                square = 0.0
                for i in range(s):
                    for j in range(m):
                        square += (J[k, i, j] - J[last, i, j]) ** 2
                if found[found.shape[0] - 1] - math.sqrt(square) > least + ROUNDING * found[0]:
                    continue
            write_spectrum(view(J, k * s * m, (s, m)), found)
            least, last = min(least, found[found.shape[0] - 1]), k
    return least


@compiled_without_gil
def measure(times: Array, count: int, found: Recorded, out: Array) -> None:
    """out (len(MEASURES),) of the first `count` samples; not numbers where there are none."""
    for i in range(out.shape[0]):
        out[i] = math.nan
    if count == 0:
        return
    s, m = found.error.shape[1], found.u.shape[1]
    errors, inputs, H, effort = 0.0, 0.0, 0.0, 0.0
    largest, peak, missed, scale, switches = 0.0, 0.0, 0.0, math.inf, 0
    before, norm = 0.0, 0.0
    for k in range(count):
        square, size = 0.0, 0.0
        for i in range(s):
            square += found.error[k, i] * found.error[k, i]
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
        for level in range(found.scale.shape[1]):
            scale = min(scale, found.scale[k, level])
    out[0] = times[count - 1]
    out[2], out[3], out[4] = norm, math.sqrt(errors / count), largest
    out[5], out[6] = found.objective[count - 1], H
    out[7], out[8], out[9], out[10] = least_singular_value(found.J, count), missed, scale, switches
    out[11], out[12], out[13] = math.sqrt(inputs / count), peak, effort


def measures(times: Array, count: int, found: Recorded) -> Array:
    """`measure`'s row."""
    out = np.empty(len(MEASURES))
    measure(times, count, found, out)
    return out
