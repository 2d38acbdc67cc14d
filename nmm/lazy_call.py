"""Lazy calls: the only calls from a lower package to a higher one, against the direction of imports.

Packages that save, draw or play data import the data's package. So that `trajectory.save(folder)` works all
the same, such a method imports its function by name when it is called.
"""

from collections.abc import Callable
from pkgutil import resolve_name
from typing import Any


def lazy_call(name: str) -> Callable[..., Any]:
    """The function "package.module:function", imported now."""
    return resolve_name(name)
