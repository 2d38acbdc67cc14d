"""Settling: when a run's error has come down for good."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from nmm.runs.trajectory import Trajectory

#: The band that the error settles into, as a share of what it was at the start.
BAND = 0.02
#: A run that starts with an error this small has nothing to settle from, m and rad.
NO_ERROR = 1e-6


def settling_time(trajectory: Trajectory) -> float | None:
    """How long after the start ‖e‖ last comes down to 2 % of ‖e(t0)‖, s; exp(-K t) settles after ln 50 / K.

    Between samples the error's logarithm is linear. None where it is not there at the end, where there was no
    error to begin with, and for tasks that come and go, each of which begins with an error of its own.
    """
    t, norm = trajectory.t, trajectory.error_norm
    if not len(t) or trajectory.events or not NO_ERROR < norm[0] < np.inf:
        return None
    band = BAND * float(norm[0])
    last = int(np.flatnonzero(norm > band)[-1])
    if last == len(t) - 1:
        return None
    before, after = float(norm[last]), max(float(norm[last + 1]), np.finfo(float).tiny)
    share = math.log(before / band) / math.log(before / after)
    return float(t[last] - t[0] + share * (t[last + 1] - t[last]))
