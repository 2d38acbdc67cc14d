"""Whether an integrator's step can follow the closed loop: eigenvalues of its linearisation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from nmm.arrays import Array
from nmm.control.controller import Controller
from nmm.functions.callbacks import STEP


class Advice(NamedTuple):
    """The dt (s) with which a run behaved when it was tried, and from when to when (s)."""

    dt: float
    start: float
    end: float


@dataclass(frozen=True)
class Instability:
    """A mode that decays in continuous time and grows in the integrator's steps.

    t : when, s; rate : how fast the mode decays, 1/s; limit : the step below which it decays too, s
    """

    t: float
    rate: float
    limit: float

    def describe(self, method: str, dt: float, advice: Advice | None) -> str:
        """One sentence, with advice where a shorter dt was tried and followed the motion."""
        said = (
            f"alpha * dt (or K * dt) is too large: at t = {self.t:.3g} s a mode of the closed loop decays "
            f"with {self.rate:.3g} 1/s, which {method} does not follow with dt = {dt:g} s"
        )
        if advice is None:
            return said
        tried = f"tried from t = {advice.start:g} to {advice.end:g} s"
        return f"{said}; a dt below {advice.dt:.3g} s follows it ({tried})"


def linearisation(controller: Controller, t: float, q: Array) -> Array:
    """F = ∂(S u)/∂q of the closed loop at (t, q), shape (n, n), with the partition of (t, q) kept."""
    if controller.step_size is None:
        controller.velocity(t, q)
    else:  # α is the sample's
        controller(t, q)
    F = np.empty((q.size, q.size))
    with controller.state.held():
        for j in range(q.size):
            offset = np.zeros(q.size)
            offset[j] = STEP
            difference = controller.velocity(t, q + offset) - controller.velocity(t, q - offset)
            F[:, j] = difference / (2 * offset[j])
    return F


def find_instability(
    controller: Controller, t: float, q: Array, dt: float, stability: tuple[float, ...]
) -> Instability | None:
    """The fastest mode at (t, q) that dt is too long for, if there is one."""
    if not stability:
        return None
    eigenvalues = np.linalg.eigvals(linearisation(controller, t, q))
    grows = np.abs(np.polyval(stability[::-1], eigenvalues * dt)) > 1.0 + 1e-6
    # A mode of a few 1/s that the differences show as barely decaying is not what breaks a run.
    guilty = eigenvalues[
        grows & (-eigenvalues.real * dt > 1e-3) & (-eigenvalues.real > 0.1 * np.abs(eigenvalues))
    ]
    if guilty.size == 0:
        return None
    fastest = guilty[np.argmin(guilty.real)]
    fractions = np.linspace(0.0, 1.0, 1001)[1:]
    stable = np.abs(np.polyval(stability[::-1], fastest * dt * fractions)) <= 1.0
    limit = fractions[np.argmin(stable) - 1] * dt if np.argmin(stable) else fractions[0] * dt
    return Instability(t, float(-fastest.real), float(limit))
