"""Where compiled functions are kept on disk: a folder of nmm's own for each text of its kernels."""

from __future__ import annotations

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
from numba.core import caching
from numba.core.compiler import CompileResult
from numba.core.runtime import rtsys

from nmm import kept

#: How many folders of compiled kernels are kept.
KEPT_CACHES = 8

#: Files that other processes are about to write, each with what waits for it (`nmm.kernels.ahead`).
under_way: dict[Path, Callable[[], None]] = {}

KERNELS = Path(__file__).resolve().parent
PACKAGE = KERNELS.parent


@cache
def cache_folder() -> Path:
    """Folder of what is compiled from this very text of nmm's kernels.

    numba notices a change of the file that holds a compiled function, but not of the files that
    hold what it calls; a digest of all sources that hold compiled functions does.
    """
    digest = hashlib.sha256(numba.__version__.encode())
    for source in sorted(PACKAGE.rglob("*.py")):
        text = source.read_bytes()
        if b"nmm.kernels" in text or source.parent == KERNELS:
            digest.update(text)
    folder = Path(platformdirs.user_cache_dir("nmm")) / digest.hexdigest()[:16]
    with suppress(OSError):  # nobody else's to see, or gone in the meantime
        if not folder.exists():
            _forget_old_caches(folder.parent)
    return folder


def _forget_old_caches(parent: Path) -> None:
    """Keep the latest few: each text of the kernels, each version of nmm, leaves a folder behind."""
    siblings = [path for path in parent.iterdir() if re.fullmatch("[0-9a-f]{16}", path.name)]
    siblings.sort(key=lambda path: path.stat().st_mtime, reverse=True)
    for old in siblings[KEPT_CACHES - 1 :]:
        shutil.rmtree(old, ignore_errors=True)


class KernelCache(caching.FunctionCache):
    """numba's cache of one function, in `cache_folder`; other users of numba in the process keep theirs.

    A file for each signature, written whole or not at all, and read only as it was written. numba keeps
    an index beside them, in which two processes that compile at once lose each other's entries, and
    trusts whatever it reads. Where nothing can be written, functions are compiled in memory.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        # Not numba's, which tries to write into the folder, for each function of each start.
        self._py_func, self._name = function, repr(function)
        self._source = Path(function.__code__.co_filename)
        self.enable()

    @cached_property
    def _ours(self) -> bool:
        """Whether the function is nmm's."""
        return self._source.resolve().is_relative_to(PACKAGE)

    @property
    def cache_path(self) -> str:
        """Folder of the function's files: the source's place in nmm, or one for each other source."""
        place = self._source.resolve().parent
        if place.is_relative_to(PACKAGE):
            return str(cache_folder() / place.relative_to(PACKAGE))
        return str(cache_folder() / f"{place.name}_{hashlib.sha256(os.fsencode(place)).hexdigest()[:16]}")

    def flush(self) -> None:
        """Forget what is kept of the function."""
        for path in Path(self.cache_path).glob(f"{self._stem}.*.nbc"):
            with suppress(OSError):
                path.unlink()

    def load_overload(self, sig: Any, target_context: Any) -> CompileResult | None:
        """The compiled form kept on disk, None where there is none.

        numba first loads all that it can compile, which nmm's own kernels, once compiled, do without: of the
        C functions that come with it they call those alone that make arrays (none takes hashes).
        """
        if self._ours:
            rtsys.initialize(target_context)
        else:
            _get_ready(target_context)
        found = self._load_overload(sig, target_context)
        if found is None:
            _get_ready(target_context)
        return found

    def _load_overload(self, sig: Any, target_context: Any) -> CompileResult | None:
        key = self._key(sig, target_context.codegen())
        data = None if key is None else kept.read(self._path(key))
        if data is None and key is not None and (wait := under_way.pop(self._path(key), None)) is not None:
            wait()
            data = kept.read(self._path(key))
        if data is None:
            tell_of_the_first()
            return None
        try:
            found, parts = pickle.loads(data)
            return CompileResult._rebuild(target_context, *parts) if found == key else None
        except Exception:  # whole, but what it names is no longer to be had
            return None

    def _save_overload(self, sig: Any, data: Any) -> None:
        key = self._key(sig, data.codegen)
        # Addresses that only this process has cannot be kept.
        if key is None or data.library.has_dynamic_globals:
            return
        try:
            kept.write(self._path(key), caching.dumps((key, data._reduce())))
        except OSError:
            _tell_once()

    def _key(self, sig: Any, codegen: Any) -> object | None:
        """What the compiled form depends on beside nmm's text; None for a function that no file holds."""
        if self._ours:
            text = ""  # the folder is that of nmm's very text, wherever and whenever it was installed
        else:
            try:
                text = hashlib.sha256(self._source.read_bytes()).hexdigest()
            except OSError:
                return None
        return text, sys.implementation.cache_tag, *self._index_key(sig, codegen)

    def path_of(self, arguments: tuple[Any, ...], codegen: Any) -> Path | None:
        """The file of the compiled form for arguments of these types; None where no file can hold it."""
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
    """Load all that numba can compile, but SciPy's linear algebra.

    numba imports it to see whether it is installed, which nmm's requirements say; compiled code that
    multiplies matrices still loads it, and checks it, when it is compiled.
    """
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
    """Say why this takes longer than it will."""
    if not cache_folder().exists():
        logging.getLogger("nmm").info("compiling for this machine, once: this takes about half a minute")


@cache  # it has not changed when the next function is compiled
def _tell_once() -> None:
    logging.getLogger("nmm").warning(
        "%s cannot be written: what nmm compiles lasts for this process only", cache_folder()
    )
