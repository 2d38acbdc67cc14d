"""Doors: the one place where a call runs up. Imports run one way, from the rooms above to those below.

A run's record or a map is data. What saves, draws or plays it stands in rooms above, which import the data.
So that `trajectory.save(folder)` can be written all the same, such a method is one line: it opens the
function by its name when it is called. Nothing else of a room below knows a room above.
"""

from __future__ import annotations

from collections.abc import Callable
from pkgutil import resolve_name
from typing import Any


def door(name: str) -> Callable[..., Any]:
    """The function "package.module:function", imported now."""
    return resolve_name(name)
