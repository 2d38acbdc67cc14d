"""Cache of compiled functions on disk: a folder for each version of the kernels' source text."""

import hashlib
import logging
import os
import re
import shutil
import sys
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

import platformdirs

from nmm.base.kernels.machine_code import processor
from nmm.base.machine import numba_version

#: Number of folders to keep.
KEPT_CACHES = 8

KERNELS = Path(__file__).resolve().parent
PACKAGE = KERNELS.parent.parent


@cache
def cache_folder() -> Path:
    """Named after a digest of all kernels' text, as numba misses changes in functions that one calls."""
    digest = hashlib.sha256(numba_version().encode())
    for source in sorted(PACKAGE.rglob("*.py")):
        text = source.read_bytes()
        if b"nmm.base.kernels" in text or source.parent == KERNELS:
            digest.update(text)
    folder = Path(platformdirs.user_cache_dir("nmm")) / digest.hexdigest()[:16]
    with suppress(OSError):  # unreadable, or removed meanwhile
        if not folder.exists():
            _forget_old_caches(folder.parent)
    return folder


def _forget_old_caches(parent: Path) -> None:
    siblings = [path for path in parent.iterdir() if re.fullmatch("[0-9a-f]{16}", path.name)]
    siblings.sort(key=lambda path: path.stat().st_mtime, reverse=True)
    for old in siblings[KEPT_CACHES - 1 :]:
        shutil.rmtree(old, ignore_errors=True)


@cache
def tell_of_the_first() -> None:
    if not cache_folder().exists():
        logging.getLogger("nmm").info("compiling for this machine, once: this takes about half a minute")


@cache  # the same for every function
def log_unwritable_once() -> None:
    logging.getLogger("nmm").warning(
        "%s cannot be written: what nmm compiles lasts for this process only", cache_folder()
    )


def key_of(function: Any, arguments: tuple[Any, ...], options: Any) -> object | None:
    """What the compiled form depends on besides nmm's text; None for a function that cannot be cached."""
    source = Path(function.__code__.co_filename)
    text = ""  # the folder already depends on nmm's text
    if not source.resolve().is_relative_to(PACKAGE):
        try:
            text = hashlib.sha256(source.read_bytes()).hexdigest()
        except OSError:
            return None
    if function.__closure__:  # what its variables are worth is not in the text
        return None
    return text, sys.implementation.cache_tag, processor(), str(arguments), tuple(options)


def file_of(function: Any, key: object) -> Path:
    """The file of a compiled function, written atomically and verified when read."""
    source, code = Path(function.__code__.co_filename).resolve(), function.__code__
    if source.is_relative_to(PACKAGE):
        folder = cache_folder() / source.parent.relative_to(PACKAGE)
    else:
        place = source.parent
        folder = cache_folder() / f"{place.name}_{hashlib.sha256(os.fsencode(place)).hexdigest()[:16]}"
    digest = hashlib.sha256(repr(key).encode()).hexdigest()[:24]
    name = re.sub(r"[^\w.]", "", code.co_qualname)[-80:]
    return folder / f"{source.stem[:80]}.{name}-{code.co_firstlineno}.{digest}.o"


def works_marker() -> Path:
    """The folder that is there when this numba and Python have been tried."""
    return cache_folder() / f"works_{sys.implementation.cache_tag}"
