"""What authors of platforms, tasks, resolvers and of packages above the wall need beside `nmm` itself.

The list of names is `extending.pyi`; docs/api/extending.md says what they are. Names are loaded when they are
first used.
"""

import re
from importlib import import_module
from pathlib import Path
from typing import Any

_STUB = Path(__file__).with_suffix(".pyi").read_text("utf-8")
_HOMES = {name: home for home, name in re.findall(r"^from (\S+) import \w+ as (\w+)$", _STUB, re.M)}
__all__ = tuple(_HOMES)


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"nmm.extending has no {name}")
    found = globals()[name] = getattr(import_module(_HOMES[name], "nmm"), name)
    return found


def __dir__() -> list[str]:
    return [*_HOMES]
