"""Plain data, text and bytes with something changed in them; what was changed is plain data, too."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from typing import Any

from hypothesis import strategies as st

#: What people and programs write where something else is meant.
VALUES = st.sampled_from(
    ["0", "-1", "1", "2", "1e308", "-1e308", "1e-308", "nan", "inf", "-.inf", "1/0", "pi", "2**9999", "1e400",
     "true", "null", "", " ", "x", "q1", "ee", "theta", "rg", "pg", "ej", "dls", "0x10", "1_000", "٣",
     "é", "\u202e", "\x1b[31m", "a" * 3000, "__import__('os')", "../../etc/passwd", "/dev/zero", "[1, 2]",
     "{a: 1}", "- - -", "0.001", "1000000", "3.7", "all", "none", "platform", "arm"]
)  # fmt: skip
KEYS = st.sampled_from(
    ["kind", "frame", "gain", "x", "q1", "weights", "limits", "alpha", "", "0", "é", "name"]
)
#: What stands for a value in a case: text as it is, or a shape of its own.
SHAPES = st.one_of(
    VALUES,
    st.lists(VALUES, max_size=3),
    st.dictionaries(KEYS, VALUES, max_size=2),
    st.none(),
    st.booleans(),
)
#: (how, where of all places as a share, with what).
CHANGES = st.lists(
    st.tuples(
        st.sampled_from(["set", "drop", "add", "copy", "nest"]),
        st.floats(0.0, 1.0, exclude_max=True),
        SHAPES,
        KEYS,
    ),
    min_size=1,
    max_size=3,
)


def places(data: Any, at: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """All places of nested mappings and lists, but the top."""
    pairs = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    for key, value in pairs:
        yield (*at, key)
        yield from places(value, (*at, key))


def changed(data: Any, changes: list[Any], fixed: tuple[str, ...] = ()) -> Any:
    """Nested data after changes; the top's keys `fixed` stay."""
    data = copy.deepcopy(data)
    for how, share, value, key in changes:
        there = [place for place in places(data) if place[0] not in fixed]
        if not there:
            return data
        place = there[int(share * len(there))]
        holder = data
        for step in place[:-1]:
            holder = holder[step]
        last = place[-1]
        if how == "set":
            holder[last] = value
        elif how == "drop":
            del holder[last]
        elif how == "nest":
            holder[last] = [holder[last]] if isinstance(value, list) else {key: holder[last]}
        elif isinstance(holder, dict):
            holder[key] = copy.deepcopy(holder[last]) if how == "copy" else value
        else:
            holder.insert(last, copy.deepcopy(holder[last]) if how == "copy" else value)
    return data


#: (how, where as a share, how many bytes, which byte).
CUTS = st.lists(
    st.tuples(
        st.sampled_from(["cut", "flip", "drop", "repeat", "fill"]),
        st.floats(0.0, 1.0, exclude_max=True),
        st.integers(1, 300),
        st.integers(0, 255),
    ),
    min_size=1,
    max_size=3,
)


def damaged(whole: bytes, cuts: list[Any]) -> bytes:
    """Bytes after damage."""
    for how, share, count, byte in cuts:
        place = int(share * len(whole))
        before, part, after = whole[:place], whole[place : place + count], whole[place + count :]
        if how == "cut":
            whole = before
        elif how == "flip":
            whole = before + bytes(one ^ (byte or 1) for one in part[:1]) + part[1:] + after
        elif how == "drop":
            whole = before + after
        elif how == "repeat":
            whole = before + part + part + after
        else:
            whole = before + bytes([byte]) * len(part) + after
    return whole
