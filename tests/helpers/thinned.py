"""Grids of which the usual tests take a part, `pytest -m thorough` the rest."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import pytest


def thinned(cases: Iterable[Any], usual: Callable[[Any], bool]) -> list[Any]:
    """Parameters for pytest: the cases that `usual` picks run always, the others with `-m thorough`."""
    parameters, picked = [], 0
    for case in cases:
        if usual(case):
            parameters.append(case)
            picked += 1
        else:
            values = case if isinstance(case, tuple) else (case,)
            parameters.append(pytest.param(*values, marks=pytest.mark.thorough))
    assert 0 < picked < len(parameters), "expected some usual cases, and some others"
    return parameters
