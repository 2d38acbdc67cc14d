"""What disturbs many runs: noise, delay and slip as a user gives them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from nmm.arrays import Array
from nmm.errors import InputError
from nmm.rollouts.disturbed import Disturbed


@dataclass(frozen=True)
class Plant:
    """What disturbs the runs: noise (n,), delay, slip (B, m), and the seed of the noise."""

    noise: Array
    delay: int
    slip: Array
    seed: int

    @classmethod
    def of(
        cls, n: int, m: int, count: int, noise: ArrayLike, delay: int, slip: ArrayLike, seed: int
    ) -> Plant:
        """From what a user gives."""
        sizes = _broadcast(noise, (n,), "noise")
        if np.any(sizes < 0.0):
            raise InputError("noise: expected standard deviations, at least 0")
        if isinstance(delay, bool) or not isinstance(delay, (int, np.integer)) or delay < 0:
            raise InputError(f"delay: expected whole samples, at least 0, got {delay!r}")
        return cls(sizes, int(delay), _broadcast(slip, (count, m), "slip"), int(seed))

    @property
    def disturbs(self) -> bool:
        """Whether a run is another one than without it."""
        return bool(np.any(self.noise > 0.0) or self.delay or np.any(self.slip != 1.0))

    def at(self, i: int, samples: int) -> Disturbed:
        """What disturbs the i-th run."""
        noise = np.zeros((0, len(self.noise)))
        if np.any(self.noise > 0.0):
            drawn = np.random.default_rng([self.seed, i]).standard_normal((samples, len(self.noise)))
            noise = drawn * self.noise
        return Disturbed(noise, self.delay, self.slip[i].copy())


def _broadcast(value: ArrayLike, shape: tuple[int, ...], what: str) -> Array:
    try:
        found = np.broadcast_to(np.asarray(value, dtype=np.float64), shape).copy()
    except (TypeError, ValueError):
        raise InputError(f"{what}: expected a number or shape {shape}, got {value!r}") from None
    if not np.all(np.isfinite(found)):
        raise InputError(f"{what}: expected finite numbers")
    return found
