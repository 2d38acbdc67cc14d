"""The list of commands that makes a page: JSON that a browser reads back without loss."""

import base64
import hashlib
import json
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import Array

Rgb = tuple[float, float, float]
Command = dict[str, Any]

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


class Drawing:
    """Commands in the order in which the page carries them out; a geometry is sent once."""

    def __init__(self) -> None:
        self.commands: list[Command] = []
        self._geometries: dict[str, str] = {}

    def add(self, kind: str, **fields: Any) -> None:
        self.commands.append({"type": kind, **fields})

    def transform(self, path: str, matrix: Array) -> None:
        """Place a node in its parent's frame."""
        self.add("set_transform", path=path, matrix=matrix.T.ravel().tolist())

    def object(
        self,
        path: str,
        geometry: Mapping[str, Any],
        color: Rgb,
        *,
        opacity: float = 1.0,
        rank: int = 0,
        sheet: bool = False,
    ) -> None:
        """Where surfaces coincide, the lowest rank is seen. A sheet hides nothing and has no shadow."""
        identity = hashlib.sha1(encode(geometry).encode("utf-8"), usedforsecurity=False).hexdigest()
        if identity not in self._geometries:
            self._geometries[identity] = f"geometry{len(self._geometries)}"
            self.add("geometry", id=self._geometries[identity], data=dict(geometry))
        material = {"color": list(color), "opacity": opacity, "rank": rank, "sheet": sheet}
        self.add("object", path=path, geometry=self._geometries[identity], material=material)


def animation(path: str, times: Array, tracks: Mapping[str, Array]) -> list[Command]:
    """MeshCat's animation of a node: its "position" (K, 3), "quaternion" (K, 4) and "scale" (K, 3) at times
    (K,) from `page_times`; empty where nothing changes."""
    moving = [
        {
            "name": f".{name}",
            "type": "quaternion" if name == "quaternion" else "vector3",
            "times": packed(times, np.float32),
            "values": packed(values, np.float32),
        }
        for name, values in tracks.items()
        if np.ptp(values, axis=0).max() > 1e-12
    ]
    return [{"path": path, "clip": {"fps": 1, "name": "motion", "tracks": moving}}] if moving else []


def segment(name: str) -> str:
    return name.replace("/", "_") or "_"


def page_times(t: Array) -> tuple[Array, Array]:
    """Ascending times in the browser's single precision, and which ones are kept; the last is rounded down,
    because seeking to the end must find it."""
    times = t.astype(np.float32)
    if times[-1] > t[-1]:
        times[-1] = np.nextafter(times[-1], np.float32(0.0))
    distinct = np.concatenate([times[:-1] < times[-1], [True]])
    distinct[1:-1] &= np.diff(times)[:-1] > 0.0
    return times[distinct], distinct
