"""Packages that only some of nmm needs: imported when asked for, or named in an error."""

from importlib import import_module
from typing import Any

from nmm.base.errors import InputError


def needed(module: str, what: str) -> Any:
    """A module of an extra; `InputError` if it is not installed says what needs it."""
    try:
        return import_module(module)
    except ImportError:
        package = module.split(".")[0]
        problem = f"{what} needs {package}, which is not installed: pip install {package}"
        raise InputError(problem) from None
