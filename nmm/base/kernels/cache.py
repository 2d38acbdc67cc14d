"""Cache of compiled functions on disk: a folder for each version of the kernels' source text."""

import hashlib
import logging
import os
import pickle
import re
import shutil
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import numba
import platformdirs

from nmm.base import disk_cache
from nmm.base.kernels import numba_internals

#: Number of folders to keep.
KEPT_CACHES = 8

#: Files that other processes are writing, each with the function that waits for it (`parallel_compile`).
under_way: dict[Path, Callable[[], None]] = {}

KERNELS = Path(__file__).resolve().parent
PACKAGE = KERNELS.parent.parent


@cache
def cache_folder() -> Path:
    """Named after a digest of all kernels' text, as numba misses changes in functions that one calls."""
    digest = hashlib.sha256(numba.__version__.encode())
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


class KernelCache(numba_internals.FunctionCache):
    """numba's cache of one function, in `cache_folder`; other users of numba in the process keep theirs.

    Each signature has its own file, written atomically and verified when read, without numba's index, where
    processes overwrite each other's entries. A function that cannot be written stays in memory.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        # Not numba's __init__, which tests at each start, for each function, whether the folder is writable.
        self._py_func, self._name = function, repr(function)
        self._source = Path(function.__code__.co_filename)
        self.enable()

    @cached_property
    def _ours(self) -> bool:
        return self._source.resolve().is_relative_to(PACKAGE)

    @cached_property
    def cache_path(self) -> str:
        """The folder of the function's files, by its source file."""
        place = self._source.resolve().parent
        if place.is_relative_to(PACKAGE):
            return str(cache_folder() / place.relative_to(PACKAGE))
        return str(cache_folder() / f"{place.name}_{hashlib.sha256(os.fsencode(place)).hexdigest()[:16]}")

    def flush(self) -> None:
        for path in Path(self.cache_path).glob(f"{self._stem}.*.nbc"):
            with suppress(OSError):
                path.unlink()

    def load_overload(self, sig: Any, target_context: Any) -> Any | None:
        """The compiled form on disk, or None. Cached kernels of nmm need only the C functions that create
        arrays, not all that numba loads for compilation."""
        if self._ours:
            numba_internals.rtsys.initialize(target_context)
        else:
            _get_ready(target_context)
        found = self._load_overload(sig, target_context)
        if found is None:
            _get_ready(target_context)
        return found

    def _load_overload(self, sig: Any, target_context: Any) -> Any | None:
        key = self._key(sig, target_context.codegen())
        data = None if key is None else disk_cache.read(self._path(key))
        if data is None and key is not None and (wait := under_way.pop(self._path(key), None)) is not None:
            wait()
            data = disk_cache.read(self._path(key))
        if data is None:
            tell_of_the_first()
            return None
        try:
            found, parts = pickle.loads(data)
            return numba_internals.CompileResult._rebuild(target_context, *parts) if found == key else None
        except Exception:  # intact, but it refers to something that no longer exists
            return None

    def _save_overload(self, sig: Any, data: Any) -> None:
        key = self._key(sig, data.codegen)
        # Addresses valid only in this process cannot be cached.
        if key is None or data.library.has_dynamic_globals:
            return
        try:
            disk_cache.write(self._path(key), numba_internals.dumps((key, data._reduce())))
        except OSError:
            _tell_once()

    def _key(self, sig: Any, codegen: Any) -> object | None:
        """What the compiled form depends on besides nmm's text; None for a function that cannot be cached."""
        if self._ours:
            text = ""  # the folder already depends on nmm's text
        else:
            try:
                text = hashlib.sha256(self._source.read_bytes()).hexdigest()
            except OSError:
                return None
        return text, sys.implementation.cache_tag, *self._index_key(sig, codegen)

    def path_of(self, arguments: tuple[Any, ...], codegen: Any) -> Path | None:
        """The file of the compiled form for these types of arguments; None where it cannot be cached."""
        key = self._key(arguments, codegen)
        return None if key is None else self._path(key)

    def _path(self, key: object) -> Path:
        digest = hashlib.sha256(repr(key).encode()).hexdigest()[:24]
        return Path(self.cache_path) / f"{self._stem}.{digest}.nbc"

    @property
    def _stem(self) -> str:
        code = self._py_func.__code__
        name = re.sub(r"[^\w.]", "", code.co_qualname)[-80:]
        return f"{self._source.stem[:80]}.{name}-{code.co_firstlineno}"


def _get_ready(target_context: Any) -> None:
    """Load all that numba can compile except SciPy's linear algebra, which matrix products load."""
    from numba.np import linalg

    ensure, linalg.ensure_blas = linalg.ensure_blas, lambda: None
    try:
        from numba.np import arraymath

        arraymath.ensure_blas = ensure
    finally:
        linalg.ensure_blas = ensure
    target_context.refresh()


@cache
def tell_of_the_first() -> None:
    if not cache_folder().exists():
        logging.getLogger("nmm").info("compiling for this machine, once: this takes about half a minute")


@cache  # the same for every function
def _tell_once() -> None:
    logging.getLogger("nmm").warning(
        "%s cannot be written: what nmm compiles lasts for this process only", cache_folder()
    )
