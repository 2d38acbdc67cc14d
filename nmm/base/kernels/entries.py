"""Compiled functions that Python calls, or other compiled functions by their address; cached on disk."""

from __future__ import annotations

import pickle
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from nmm.base import disk_cache
from nmm.base.kernels import instructions
from nmm.base.kernels.cache import file_of, key_of, log_unwritable_once, tell_of_the_first
from nmm.base.kernels.doors import python_function, write_door
from nmm.base.kernels.machine_code import load, object_file


class Options(NamedTuple):
    """nogil : whether other threads run meanwhile; vectorized : whether loops are; cached : on disk"""

    nogil: bool = False
    vectorized: bool = False
    cached: bool = True


PLAIN_OPTIONS, UNCACHED = Options(), Options(cached=False)


class Entry(NamedTuple):
    """A function's machine code.

    address : by which compiled functions call it
    call : by which Python does; it does not check its arguments
    read : whether it was in the cache
    """

    address: int
    call: Any
    read: bool


def entry(function: Any, arguments: tuple[Any, ...], options: Options) -> Entry:
    """A function's machine code for these types of arguments, from the cache or compiled."""
    key = key_of(function, arguments, options) if options.cached else None
    path = None if key is None else file_of(function, key)
    stored = None if path is None else _stored(path, key)
    if stored is None:
        if options.cached:
            tell_of_the_first()
        names, code, lasting = _compiled(function, arguments, options)
        if path is not None and lasting:
            try:
                disk_cache.write(path, pickle.dumps((key, names, code)))
            except OSError:
                log_unwritable_once()
    else:
        names, code = stored
    address, door = load(code, names)
    return Entry(address, python_function(function.__name__, door), stored is not None)


def _stored(path: Path, key: object) -> tuple[tuple[str, str], bytes] | None:
    """The names and the object file in the cache, or None."""
    data = disk_cache.read(path)
    if data is not None:
        with suppress(Exception):  # intact, but something else
            stored_key, names, code = pickle.loads(data)
            if stored_key == key:
                return names, code
    return None


def _compiled(
    function: Any, arguments: tuple[Any, ...], options: Options
) -> tuple[tuple[str, str], bytes, bool]:
    """The names of the function and of its door, the object file, and whether other processes can use it."""
    door = f"nmm_door_{function.__name__}"
    module, name = instructions.whole(function, arguments, partial(write_door, door, options.nogil))
    code = object_file(module, (name, door), options.vectorized)
    lasting = not any(map(_only_here, (*module.global_variables, *module.functions)))
    return (name, door), code, lasting


def _only_here(part: Any) -> bool:
    """Whether other processes lack it: functions that numba registers, and addresses in this process."""
    if part.is_declaration:
        return "numba" in part.name or part.name.startswith("NRT_")
    return bool(part.name.startswith("numba.dynamic.globals"))
