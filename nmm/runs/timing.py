"""How long a control step takes on this machine."""

from __future__ import annotations

from time import perf_counter

import numpy as np

from nmm.control.controller import Controller
from nmm.errors import RunError
from nmm.runs.trajectory import Trajectory

#: Steps that are timed.
STEPS = 500


def step_time(controller: Controller, trajectory: Trajectory) -> float:
    """Median time of a control step, s, at the samples of a run one after the other; 0 where none answers.

    `controller` is one of the run's kind, with its dt; it forgets what it remembered.
    """
    times = []
    controller.reset()
    for t, q in zip(trajectory.t[:STEPS].tolist(), trajectory.q[:STEPS], strict=True):
        begun = perf_counter()
        try:
            controller(t, q)
        except RunError:
            break
        times.append(perf_counter() - begun)
    controller.reset()
    return float(np.median(times)) if times else 0.0
