"""Damaged files of compiled kernels: noticed, and compiled again."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from nmm.base.arrays import Array
from nmm.base.kernels import cache
from nmm.base.kernels.compiled import compiled
from nmm.base.kernels.signatures import float64, void

from .hunting import Hunt
from .mutants import CUTS, damaged

SIGNATURE = void(float64[::1], float64)


def shift(values: Array, by: float) -> None:
    """Something small to compile."""
    for i in range(values.shape[0]):
        values[i] += by


def _shifted() -> bool:
    """Whether it came from the cache; it does what it should either way."""
    function: Any = compiled(shift)
    function.compile(SIGNATURE.args)
    values = np.arange(3.0)
    function(values, 0.5)
    assert values.tolist() == [0.5, 1.5, 2.5]
    return bool(function.entries[SIGNATURE.args].read)


def check(case: Any) -> str:
    ours, known = cache.cache_folder, cache.log_unwritable_once.cache_clear
    with tempfile.TemporaryDirectory() as place:
        cache.cache_folder = lambda: Path(place) / "cache"  # type: ignore[assignment]  # put back below
        known()
        try:
            _shifted()
            (file,) = [path for path in Path(place).rglob("*") if path.is_file()]
            whole = file.read_bytes()
            file.write_bytes(damaged(whole, case))
            same = file.read_bytes() == whole
            assert _shifted() == same
            assert _shifted(), "not healed"
        finally:
            cache.cache_folder = ours
            known()
    return "untouched" if same else "healed"


HUNT = Hunt("caches", CUTS, check)
