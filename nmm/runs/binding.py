"""Which limits a motion was held back by."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from nmm.arrays import Array

#: A quantity is at its limit within this share of its range.
AT_LIMIT = 1e-6
#: So many limits are named.
_SHOWN = 3


def binding(names: Sequence[str], shares: Array, scale: Array) -> str:
    """A sentence on the limits that bind where they leave less than the task's whole rate; "" for none.

    Parameters
    ----------
    names, shares (N, limited) : see `nmm.runs.margins.shares`
    scale (N, levels) : λ
    """
    relaxed = np.any(scale < 1.0, axis=1)
    if not relaxed.any() or not len(names):
        return ""
    often = np.mean(np.minimum(shares, 1.0 - shares)[relaxed] <= AT_LIMIT, axis=0)
    order = [i for i in np.argsort(-often, kind="stable")[:_SHOWN] if often[i] > 0.0]
    if not order:
        return ""
    told = [f"{_words(names[i])} ({100 * often[i]:.0f} %)" for i in order]
    return f"limits that bind at λ < 1: {', '.join(told)}"


def _words(name: str) -> str:
    return f"input {name.removeprefix('u_')}" if name.startswith("u_") else name
