"""How often and how far J u differed from the rate that the task asked for."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from nmm.base.arrays import Array
from nmm.base.findings import Finding
from nmm.control.resolvers.answer import EXACT


class Residuals(NamedTuple):
    """At how many samples of a run J u differed from the rate, and at which share of all.

    Attributes
    ----------
    largest : ‖J u - rate‖ at most, in the mixed units of the rows per second; 0 where none differed
    relative, t : that beside ‖rate‖ there, and when, s

    Examples
    --------
    >>> run = nmm.Scenario.load("unicycle_2r_position").with_settings({"duration": 1}).run()
    >>> isinstance(run.unmet, nmm.extending.Residuals), run.unmet.samples, run.unmet.sentence
    (True, 0, '')
    """

    samples: int
    share: float
    largest: float
    relative: float
    t: float

    @property
    def sentence(self) -> str:
        """For a warning; "" where J u equalled the rate everywhere."""
        return str(self.finding()) if self.samples else ""

    def finding(self, **more: Any) -> Finding:
        """What is to be said of it, and more: the least λ, and what was kept."""
        values = {**self._asdict(), **more}
        return Finding("inputs_unmet", values, {"t": values.pop("t")})


#: Of a run whose inputs did all that the task asked.
NO_RESIDUALS = Residuals(0, 0.0, 0.0, 0.0, 0.0)


def differs(residual: Array, rate: Array) -> Array:
    """At which samples the residual (N,) is significant beside the rate (N, s)."""
    return np.asarray(residual > EXACT * (1.0 + np.linalg.norm(rate, axis=1)))


def residuals(t: Array, residual: Array, rate: Array) -> Residuals:
    (samples,) = np.nonzero(differs(residual, rate))
    if not samples.size:
        return NO_RESIDUALS
    k = int(samples[np.argmax(residual[samples])])
    largest, asked = float(residual[k]), float(np.linalg.norm(rate[k]))
    relative = largest / asked if asked > 0.0 else 1.0
    return Residuals(len(samples), len(samples) / len(t), largest, relative, float(t[k]))


def run_up(t: Array, u: Array, changes: Array, dt: float) -> int:
    """Number of samples that a run from rest, u (N, m) at t (N,), the first dt from rest, spends accelerating
    at the limits (m, 2); shortfalls then are by design."""
    lasted = np.append(dt, np.diff(t))[:, np.newaxis] * (1.0 - 1e-6)
    lower, upper = (lasted * ends for ends in changes.T)
    changed = np.diff(u, axis=0, prepend=0.0)
    fast = np.any((changed <= lower) | (changed >= upper), axis=1)
    return len(t) if fast.all() else int(np.argmin(fast))
