"""What LeRobot normalises by: the least, largest and mean value of each number, its spread and quantiles."""

from __future__ import annotations

from typing import Any

import numpy as np

QUANTILES = (0.01, 0.1, 0.5, 0.9, 0.99)


def statistics(rows: Any) -> dict[str, list[float]]:
    """Of rows (N, k): lists of k numbers by name, and how many rows there are.

    The quantiles are those of the rows. LeRobot's own are read off a histogram of each episode, and averaged
    over episodes.
    """
    values = np.asarray(rows, dtype=np.float64)
    found = {
        "min": values.min(axis=0),
        "max": values.max(axis=0),
        "mean": values.mean(axis=0),
        "std": values.std(axis=0),
        "count": np.array([len(values)]),
    }
    quantiles = np.quantile(values, QUANTILES, axis=0)
    found |= {f"q{100 * share:02.0f}": row for share, row in zip(QUANTILES, quantiles, strict=True)}
    return {name: row.tolist() for name, row in found.items()}
