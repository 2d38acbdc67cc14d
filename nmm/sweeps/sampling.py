"""Points of the unit cube by their number: the same whoever asks, and for however many at a time."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from functools import lru_cache

import numpy as np

from nmm.arrays import Array
from nmm.errors import InputError

#: The most points of a Latin hypercube, which is made whole: each process holds all of it.
MOST_OF_A_HYPERCUBE = 10_000_000
#: As many points as SciPy's Sobol sequence has by default.
MOST_OF_SOBOL = 2**30


def sobol(seed: int, total: int, dimensions: int, first: int, count: int) -> Array:
    """Owen-scrambled Sobol points (count, dimensions) from number `first` on, whatever `total`."""
    from scipy.stats import qmc

    engine = qmc.Sobol(dimensions, scramble=True, rng=np.random.default_rng(seed))
    if first:  # SciPy cannot go forward by nothing
        engine.fast_forward(first)
    with warnings.catch_warnings():
        # Their balance is that of powers of two, asked for or not.
        warnings.filterwarnings("ignore", message=".*balance properties.*")
        return np.asarray(engine.random(count))


def lhs(seed: int, total: int, dimensions: int, first: int, count: int) -> Array:
    """Points of a Latin hypercube of `total` points: one in each of `total` strata of every dimension."""
    return _hypercube(seed, total, dimensions)[first : first + count]


@lru_cache(maxsize=1)
def _hypercube(seed: int, total: int, dimensions: int) -> Array:
    from scipy.stats import qmc

    return np.asarray(qmc.LatinHypercube(dimensions, rng=np.random.default_rng(seed)).random(total))


def random(seed: int, total: int, dimensions: int, first: int, count: int) -> Array:
    """Independent uniform points: the generator's counter is the point's number (Philox)."""
    blocks = -(-dimensions // 4)  # a step of Philox's counter gives four numbers
    generator = np.random.Generator(np.random.Philox(np.random.SeedSequence(seed)).advance(first * blocks))
    return generator.random((count, 4 * blocks))[:, :dimensions]


#: How the ranges of a sweep are sampled, by name.
SAMPLERS: dict[str, Callable[[int, int, int, int, int], Array]] = {
    "sobol": sobol,
    "lhs": lhs,
    "random": random,
}
#: The name of what samples nothing: every key has its values.
GRID = "grid"


def check_total(sampler: str, total: int) -> None:
    """`InputError` for more points than a sampler has."""
    most = {"lhs": MOST_OF_A_HYPERCUBE, "sobol": MOST_OF_SOBOL}.get(sampler, total)
    if total > most:
        other = "sobol or random" if sampler == "lhs" else "random"
        raise InputError(
            f"samples: sampler {sampler} has at most {most} points, got {total}; sampler {other} has more"
        )
