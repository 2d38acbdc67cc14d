"""Where compiled functions are kept on disk: a folder of nmm's own for each text of its kernels."""

from __future__ import annotations

import hashlib
import os
import shutil
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numba
import platformdirs
from numba.core import caching

#: How many folders of compiled kernels are kept.
KEPT_CACHES = 8

KERNELS = Path(__file__).resolve().parent
PACKAGE = KERNELS.parent


@cache
def cache_folder() -> str:
    """Folder of numba's cache for this very text of nmm's kernels.

    numba notices a change of the file that holds a compiled function, but not of the files that
    hold what it calls; a digest of all sources that hold compiled functions does.
    """
    digest = hashlib.sha256(numba.__version__.encode())
    for source in sorted(PACKAGE.rglob("*.py")):
        text = source.read_bytes()
        if b"nmm.kernels" in text or source.parent == KERNELS:
            digest.update(text)
    folder = Path(platformdirs.user_cache_dir("nmm")) / digest.hexdigest()[:16]
    if not folder.exists():
        _forget_old_caches(folder.parent)
    return str(folder)


def _forget_old_caches(parent: Path) -> None:
    """Keep the latest few: each text of the kernels, each version of nmm, leaves a folder behind."""
    siblings = [path for path in parent.glob("*") if path.is_dir()]
    siblings.sort(key=lambda path: path.stat().st_mtime, reverse=True)
    for old in siblings[KEPT_CACHES - 1 :]:
        shutil.rmtree(old, ignore_errors=True)


class _InFolder(caching._SourceFileBackedLocatorMixin, caching._CacheLocator):
    """What numba asks where a function's compiled form lies: in `cache_folder`."""

    def __init__(self, function: Callable[..., Any], source: str) -> None:
        self._py_file = source
        self._lineno = function.__code__.co_firstlineno

    @property
    def _room(self) -> Path | None:
        """Folder of the source below nmm's own; None if the function is somebody else's."""
        place = Path(self._py_file).resolve().parent
        return place.relative_to(PACKAGE) if place.is_relative_to(PACKAGE) else None

    def get_cache_path(self) -> str:
        if self._room is None:
            return os.path.join(cache_folder(), self.get_suitable_cache_subpath(self._py_file))
        return os.path.join(cache_folder(), self._room)

    def get_source_stamp(self) -> object:
        """The folder is that of nmm's very text: where and when it was installed makes no difference."""
        return super().get_source_stamp() if self._room is None else None


class _Storing(caching.CompileResultCacheImpl):
    # Where the user's cache folder cannot be written, numba looks for a place as it does for any function.
    _locator_classes = (_InFolder, *caching.CompileResultCacheImpl._locator_classes)


class KernelCache(caching.FunctionCache):
    """numba's cache of one function, in `cache_folder`; other users of numba in the process keep theirs."""

    _impl_class = _Storing
