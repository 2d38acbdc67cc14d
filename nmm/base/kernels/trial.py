"""A trial of `instructions` with the numba that is installed."""

from __future__ import annotations

import math
from contextlib import suppress
from typing import Any

from nmm.base.kernels import instructions
from nmm.base.kernels.compiled import Compiled, caller
from nmm.base.kernels.declared import register
from nmm.base.kernels.entries import UNCACHED
from nmm.base.kernels.signatures import float64

#: What the functions below call.
_part: Any = None
_through: Any = None


def _root(x: float) -> float:
    if x < 0.0:
        raise ValueError("below zero")
    return math.sqrt(x)


def _both(address: int, x: float) -> float:
    return float(_through(address, x) + _part(x))


def fault() -> str | None:
    """What does not work of `instructions`, or None; `instructions.missing` is the same."""
    register()
    if instructions.missing is None:
        instructions.missing = _tried()
    return instructions.missing


def _tried() -> str | None:
    global _part, _through
    signature = float64(float64)
    try:
        _part, _through = Compiled(_root, options=UNCACHED), caller(signature)
        root, both = _part, Compiled(_both, options=UNCACHED)
        if root(9.0) != 3.0:
            return "a function called from Python answers wrongly"
        if both(root.entry(signature.args).address, 4.0) != 4.0:
            return "a function with parts answers wrongly"
        with suppress(RuntimeError):
            both(root.entry(signature.args).address, -1.0)
            return "errors are lost"
    except Exception as error:  # other internals may raise anything
        return f"{type(error).__name__}: {(str(error).splitlines() or [''])[0]}"
    return None
