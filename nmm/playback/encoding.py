"""Commands as text that a browser reads back without loss: JSON, with arrays as base64."""

from __future__ import annotations

import base64
import json
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

_KEYS: Mapping[type, str] = {np.float32: "f32", np.float64: "f64", np.uint32: "u32", np.uint16: "u16"}


def packed(values: ArrayLike, dtype: type) -> dict[str, str]:
    """An array for the page: {"f32": base64 of its little-endian bytes}, likewise f64, u32 and u16."""
    flat = np.ascontiguousarray(values, dtype=np.dtype(dtype).newbyteorder("<"))
    return {_KEYS[dtype]: base64.b64encode(flat.tobytes()).decode("ascii")}


def encode(command: Mapping[str, Any]) -> str:
    """One command as one line of JSON that may stand inside a <script> element."""
    text = json.dumps(command, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    # U+2028 and U+2029 end a line for some readers; "<" could end the element.
    return text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")
