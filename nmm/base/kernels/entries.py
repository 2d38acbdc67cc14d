"""Compiled functions that Python calls, or other compiled functions by their address; cached on disk."""

from __future__ import annotations

import pickle
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

from nmm.base import disk_cache
from nmm.base.kernels.cache import file_of, key_of, log_unwritable_once, tell_of_the_first
from nmm.base.kernels.machine_code import load
from nmm.base.kernels.python_calls import python_function
from nmm.base.kernels.signatures import Type
from nmm.base.lazy_call import lazy_call


class CompileOptions(NamedTuple):
    """nogil : whether other threads run meanwhile; vectorized : whether loops are; cached : on disk"""

    nogil: bool = False
    vectorized: bool = False
    cached: bool = True


PLAIN_OPTIONS, UNCACHED = CompileOptions(), CompileOptions(cached=False)


class Entry(NamedTuple):
    """A function's machine code.

    address : by which compiled functions call it
    call : by which Python does; it does not check its arguments
    read : whether it was in the cache
    """

    address: int
    call: Any
    read: bool


def entry(function: Any, arguments: tuple[Type, ...], options: CompileOptions) -> Entry:
    """A function's machine code for these types of arguments, from the cache or compiled."""
    key = key_of(function, arguments, options) if options.cached else None
    path = None if key is None else file_of(function, key)
    stored = None if path is None else _stored(path, key)
    if stored is None:
        if options.cached:
            tell_of_the_first()
        compile_whole = lazy_call("nmm.base.kernels.wholes:compile_whole")
        names, code, lasting = compile_whole(function, arguments, options.nogil, options.vectorized)
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
