"""What a run asks of its motors and wheels, for its summary and its page."""

from __future__ import annotations

from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

import numpy as np

from nmm.base.errors import InputError
from nmm.base.findings import Finding

if TYPE_CHECKING:
    from nmm.model.dynamics.torques import Torques
    from nmm.motion.trajectory import Trajectory

#: Longer runs take seconds: of these `nmm torques` tells when asked.
MOST_SAMPLES = 50_000

#: A run's summary and its page ask one after the other.
_looked_at: WeakKeyDictionary[Trajectory, Torques | None] = WeakKeyDictionary()


def motor_torques(run: Trajectory) -> Torques | None:
    """`run.torques()`; None of a robot without masses, of a run without samples, or with more than
    `MOST_SAMPLES`, or that diverged."""
    if run not in _looked_at:
        _looked_at[run] = _torques(run)
    return _looked_at[run]


def _torques(run: Trajectory) -> Torques | None:
    finite = bool(np.all(np.isfinite(run.q)) and np.all(np.isfinite(run.u)))
    if not 0 < len(run) <= MOST_SAMPLES or not finite or run.outcome == "diverged":
        return None
    try:
        return run.torques()
    except InputError:  # it has no masses
        return None


def motor_findings(run: Trajectory) -> tuple[Finding, ...]:
    """Motors over their effort, and a robot that tips."""
    torques = motor_torques(run)
    return () if torques is None else torques.findings
