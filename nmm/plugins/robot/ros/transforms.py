"""Transforms of TFMessages as numbers: logs have a million, and objects for them take five times as long."""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache
from struct import Struct, error
from typing import Any

from nmm.plugins.robot.ros.reading import nanoseconds

#: Of a transform the frame and its child, the stamp, ns, and x, y, z, m, with a quaternion x, y, z, w.
Told = tuple[str, str, int, tuple[float, ...]]
#: Of CDR by its second byte: a count, a stamp with the length of a name, a length, a transform.
_LAYOUTS = {
    bytes([0, little]): tuple(Struct(order + kind) for kind in ("I", "iII", "I", "7d"))
    for little, order in enumerate(("<", ">")[::-1])
}


def told_in_cdr(data: bytes) -> list[Told]:
    """The transforms of a TFMessage of ROS 2; `ValueError` for bytes that are none."""
    data = bytes(data)
    layout = _LAYOUTS.get(data[:2])
    if layout is None:
        raise ValueError(f"its encoding is {data[:2].hex(' ') or 'none'}, not plain CDR")
    try:
        return _told(data, *layout)
    except error:
        raise ValueError("a message ends within its transforms") from None


def _told(data: bytes, count: Struct, stamp: Struct, length: Struct, pose: Struct) -> list[Told]:
    made, at = list[Told](), 8
    (many,) = count.unpack_from(data, 4)
    for _ in range(many):
        at += -at % 4
        seconds, nanos, size = stamp.unpack_from(data, at)
        at += 12 + size
        frame = name_in(data[at - size : at])
        at += -at % 4
        (size,) = length.unpack_from(data, at)
        at += 4 + size
        child = name_in(data[at - size : at])
        at += -(at - 4) % 8  # counted from behind the four bytes of CDR's head
        made.append((frame, child, seconds * 1_000_000_000 + nanos, pose.unpack_from(data, at)))
        at += 56
    if at + 3 < len(data):
        raise ValueError("bytes behind the last transform")
    return made


def told_in(message: Any) -> Iterable[Told]:
    """Those of a message, which may be a list of them already."""
    if not hasattr(message, "transforms"):
        numbers: Iterable[Told] = message
        return numbers
    return (
        (each.header.frame_id, each.child_frame_id, nanoseconds(each), _numbers(each.transform))
        for each in message.transforms
    )


@lru_cache(maxsize=1024)  # few names differ, and each is read a million times
def name_in(raw: bytes) -> str:
    """A frame's name of bytes with their end; `ValueError` for bytes that are none."""
    if raw[-1:] != b"\0":
        raise ValueError("a name without its end")
    return raw[:-1].decode()


def _numbers(transform: Any) -> tuple[float, ...]:
    at, turn = transform.translation, transform.rotation
    return at.x, at.y, at.z, turn.x, turn.y, turn.z, turn.w
