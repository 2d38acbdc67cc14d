"""Plain data in files: what YAML and JSON have words for."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from nmm.base.errors import expect


def plain(value: Any, where: str) -> Any:
    """Mappings by name, lists, numbers, texts, True, False and None; texts that are numbers become these."""
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, Mapping):
        return {str(key): plain(item, f"{where}: {key}") for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item, where) for item in value]
    if isinstance(value, str):
        try:
            number = float(value)
        except ValueError:
            return value
        whole = value.strip().lstrip("+-").isdecimal()
        return value if not math.isfinite(number) else int(value) if whole else number
    fits = (
        value is None or isinstance(value, bool | int) or (isinstance(value, float) and math.isfinite(value))
    )
    expect(fits, where, "plain data: finite numbers, texts, lists and mappings by name", value)
    return value
