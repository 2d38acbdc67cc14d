"""What is wrong with a recorded run: modes that its dt is too long for, an error that left its promise."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from nmm.arrays import Array
from nmm.control.controller import Controller
from nmm.control.integrators import Integrator
from nmm.runs.promise import ENDS, Departure, Samples, adaptive_errors, decay, departure, step_errors
from nmm.runs.recording import Recorder
from nmm.runs.stability import Instability, instabilities

#: At how many instants of a run the integrator's stability is examined.
EXAMINED = 20
#: A target that moves otherwise than its rate says in more than this share of the steps does not only jump.
OFTEN = 0.05


class Assessment(NamedTuple):
    """What is wrong with a run.

    Attributes
    ----------
    unstable, examined : the instabilities, and at how many instants they were looked for
    departure : where the error left its promise
    target : in how many steps the target moved otherwise than its rate says, where that matters
    """

    unstable: list[Instability]
    examined: int
    departure: Departure | None
    target: int

    @property
    def missed(self) -> bool:
        """Whether the error was not what was promised."""
        return self.departure is not None and self.departure.missed


def assess(
    controller: Controller, recorder: Recorder, advance: Integrator, dt: float, held: bool = True
) -> Assessment:
    """What is wrong with a run whose samples were recorded; held: to what its gain promised."""
    with controller.without_limits():
        return _assess(controller, recorder, advance, dt, held)


def _assess(
    controller: Controller, recorder: Recorder, advance: Integrator, dt: float, held: bool
) -> Assessment:
    unstable, examined = _examine(controller, recorder, advance, dt)
    samples = recorder.samples
    if len(recorder) < 3 or not held:
        return Assessment(unstable, examined, None, 0)
    if advance.tolerance:
        steps = adaptive_errors(samples, recorder.q[: len(recorder)], advance.tolerance)
    else:
        steps = step_errors(samples, advance.order)
    found, own = departure(samples, steps, goes_on=recorder.goes_on), 0
    if found is not None:  # then it is worth the time to ask the target
        moved = _target_moves(controller, recorder)
        found = departure(samples, steps, moved, goes_on=recorder.goes_on)
        own = _own_moves(samples, moved)
    return Assessment(unstable, examined, found, own)


def _own_moves(samples: Samples, moved: Array) -> int:
    """In how many steps the target moved otherwise than its rate says, by what counts; 0 where seldom.

    What counts, were it so in every step, would add to the error as much as is judged: less is what the
    trapezoids of `_target_moves` miss of any target that does not move uniformly.
    """
    decays = decay(samples.t, samples.error, samples.feedback)
    counts = ENDS * (1.0 + float(np.linalg.norm(samples.error[0])))
    own = int(np.sum(moved > counts * np.maximum(1.0 - decays, 1.0 / len(moved))))
    return own if own > OFTEN * len(moved) else 0


def _target_moves(controller: Controller, recorder: Recorder) -> Array:
    """By how much the error changed along each step with q held, otherwise than its rate says, (N - 1,)."""
    samples = recorder.samples
    error, rate = controller.errors(samples.t[1:], recorder.so_far.q[:-1])
    controller.reset()
    feedback = samples.feedback
    moved = samples.rate - feedback.rates(samples.error)
    rates = moved[:-1] + rate - error @ feedback.K.T  # a step's rate is that of unbounded feedback
    change = error - samples.error[:-1] - 0.5 * np.diff(samples.t)[:, np.newaxis] * rates
    return np.nan_to_num(np.linalg.norm(change, axis=1))


def _examine(
    controller: Controller, recorder: Recorder, advance: Integrator, dt: float
) -> tuple[list[Instability], int]:
    """The instabilities at some instants of the run, and how many instants were looked at."""
    if not advance.stability:
        return [], 0
    chosen = np.unique(np.linspace(0, len(recorder) - 1, EXAMINED).astype(int))
    return instabilities(controller, recorder.t[chosen], recorder.q[chosen], dt, advance.stability), len(
        chosen
    )
