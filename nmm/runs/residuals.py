"""How often and how far J u differed from the rate that the task asked for."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from nmm.arrays import Array
from nmm.resolvers.answer import EXACT
from nmm.words import counted


class Residuals(NamedTuple):
    """The samples of a run at which J u differed from the rate.

    Attributes
    ----------
    samples : how many; share : of all samples
    largest : ‖J u - rate‖ at most, in the mixed units of the rows per second; 0 where none differed
    relative : that beside ‖rate‖ there
    t : when, s

    Examples
    --------
    >>> run = nmm.Scenario.load("unicycle_2r_position").with_settings({"duration": 1}).run()
    >>> isinstance(run.unmet, nmm.Residuals), run.unmet.samples, run.unmet.sentence
    (True, 0, '')
    """

    samples: int
    share: float
    largest: float
    relative: float
    t: float

    @property
    def sentence(self) -> str:
        """For a warning; "" where J u was the rate everywhere."""
        if not self.samples:
            return ""
        share = f"{100 * self.relative:.3g} % of it" if self.relative <= 1.0 else "more than the rate itself"
        return (
            f"the inputs did not do all that the task asked in {counted(self.samples, 'sample')} "
            f"({100 * self.share:.3g} %): J u differed from the rate by up to {self.largest:.3g} "
            f"({share}), at t = {self.t:.4g} s"
        )


#: Of a run whose inputs did all that the task asked.
NONE = Residuals(0, 0.0, 0.0, 0.0, 0.0)


def differs(residual: Array, rate: Array) -> Array:
    """At which samples the residual (N,) says so, beside the rate (N, s)."""
    return np.asarray(residual > EXACT * (1.0 + np.linalg.norm(rate, axis=1)))


def residuals(t: Array, residual: Array, rate: Array) -> Residuals:
    """What the residual (N,) says of a run at times t (N,) whose rate is (N, s)."""
    (found,) = np.nonzero(differs(residual, rate))
    if not found.size:
        return NONE
    k = int(found[np.argmax(residual[found])])
    asked = float(np.linalg.norm(rate[k]))
    relative = float(residual[k]) / asked if asked > 0.0 else 1.0
    return Residuals(len(found), len(found) / len(t), float(residual[k]), relative, float(t[k]))


def run_up(t: Array, u: Array, accelerations: Array, dt: float) -> int:
    """How many samples a run from rest spends on taking up speed as fast as accelerations (m,) allow.

    t (N,) s, u (N, m), the first of them dt from rest. What is not done meanwhile is not done by design.
    """
    most = np.append(dt, np.diff(t))[:, np.newaxis] * accelerations
    fast = np.any(np.abs(np.diff(u, axis=0, prepend=0.0)) >= most * (1.0 - 1e-6), axis=1)
    return len(t) if fast.all() else int(np.argmin(fast))
