"""The libraries of the extra `nmm[sweep]`, imported where needed, or a line that says how to get them."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from nmm.errors import InputError


def needed(module: str, what: str) -> Any:
    """A module of the extra; `InputError` says what needs it where it is not installed."""
    try:
        return import_module(module)
    except ImportError:
        package = module.split(".")[0]
        raise InputError(
            f'{what} needs {package}, which is not installed: pip install "nmm[sweep]"'
        ) from None


def arrow() -> Any:
    """pyarrow."""
    return needed("pyarrow", "a sweep's table in Parquet")


def parquet() -> Any:
    """pyarrow.parquet."""
    return needed("pyarrow.parquet", "a sweep's table in Parquet")
