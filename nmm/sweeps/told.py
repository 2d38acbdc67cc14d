"""A sweep in a few numbers: its quantities from least to largest, and how the listed values compare."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from nmm.arrays import Array
from nmm.sweeps.swept import Swept

#: What is told of all rollouts.
QUANTITIES = (
    "error_rms", "error_final", "arrival", "objective_integral", "scale_min", "sigma_min", "margin_min",
    "clearance_min", "effort",
)  # fmt: skip
#: Values that differ by less than this share of their size are told as one.
ALIKE = 1e-4
#: Combinations of listed values that are compared in a table.
MOST_COMPARED = 24


class Spread(NamedTuple):
    """A quantity of all rollouts that have it: least, median and largest."""

    name: str
    least: float
    median: float
    largest: float


class Compared(NamedTuple):
    """One combination of the listed values, over all points.

    values : what is listed, as text by key
    completed : share of its rollouts that completed
    medians : of error_rms, objective_integral and effort, where known
    best : share of the points, of those where all combinations completed, where its ∫ H dt is the least;
        None where there is no objective or one point only
    """

    values: dict[str, str]
    completed: float
    medians: dict[str, float]
    best: float | None


def column(table: Any, name: str) -> Array:
    """A column of numbers (N,), not a number where it is not known."""
    return np.asarray(table[name].to_numpy(zero_copy_only=False), dtype=float)


def spreads(swept: Swept) -> Iterator[Spread]:
    """The quantities that some rollouts have, and that are not the same in all."""
    for name in QUANTITIES:
        values = column(swept.table, name)
        values = values[np.isfinite(values)]
        if len(values) and np.ptp(values) > ALIKE * np.abs(values).max():
            yield Spread(name, float(values.min()), float(np.median(values)), float(values.max()))


def compared(swept: Swept) -> list[Compared]:
    """The combinations of the listed values, in their order; none where there are too few or too many."""
    definition = swept.definition
    count = definition.combinations
    if not 2 <= count <= MOST_COMPARED:
        return []
    table = swept.table
    completed = np.array([one == "completed" for one in table["outcome"].to_pylist()]).reshape(-1, count)
    by = {
        name: column(table, name).reshape(-1, count) for name in ("error_rms", "objective_integral", "effort")
    }
    whole = completed.all(axis=1)
    H = by["objective_integral"][whole]
    told = len(H) > 1 and np.ptp(by["objective_integral"][np.isfinite(by["objective_integral"])]) > 0.0
    least = np.argmin(H, axis=1) if told else None
    keys = {one.key for one in definition.listed}
    found = []
    for k, row in enumerate(definition.parameters(range(count))):
        medians = {
            name: float(np.median(known))
            for name, values in by.items()
            if len(known := values[:, k][np.isfinite(values[:, k])])
        }
        best = None if least is None else float(np.mean(least == k))
        values = {
            key: value if isinstance(value, str) else f"{value:.6g}"
            for key, value in row.items()
            if key in keys
        }
        found.append(Compared(values, float(completed[:, k].mean()), medians, best))
    return found
