"""Parallel compilation by child processes, for a first run on several cores.

Kernels are called by their addresses and do not depend on each other. The parent reads what its children have
compiled from the cache, and compiles itself what is unclaimed or what a child failed at. Children run only
nmm's own code, never the script that started the parent.
"""

import _thread
import atexit
import gc
import importlib
import os
import pickle
import signal
import subprocess
import sys
import threading
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import numba

from nmm.base import disk_cache
from nmm.base.cores import cores
from nmm.base.kernels import numba_internals
from nmm.base.kernels.cache import KernelCache, cache_folder, tell_of_the_first, under_way
from nmm.base.kernels.compiled import Kernel, problem

#: The child's first lines: it receives `sys.path` before it imports nmm.
_BEGIN = """
import pickle, sys
sys.path[:] = pickle.load(sys.stdin.buffer)
from nmm.base.kernels.parallel_compile import serve
serve()
"""
#: Time for a child to clean up when it is no longer needed, s.
PATIENCE = 1.0
#: Interval of checks for a function, s.
AGAIN = 0.01

#: Only functions of this package: importing a user's module may do anything.
OURS = "nmm"

_children: list[subprocess.Popen[bytes]] = []


def compile_in_parallel(*wanted: Kernel | tuple[Any, Any]) -> None:
    """Have one process per further core compile what the cache on disk lacks; returns at once.

    wanted : kernels, or compiled functions with a signature, attributes of their modules; those needed last
        come
    first, as children begin with these. The processes end with this one; there are none without a writable
    cache.
    """
    others = cores() - 1 - sum(child.poll() is None for child in _children)
    if others < 1 or os.name != "posix" or numba.config.DISABLE_JIT or not sys.executable:
        return
    if getattr(sys, "frozen", False) or problem() is not None:  # a frozen executable is no Python
        return
    codegen = numba_internals.cpu_target.target_context.codegen()
    missing: dict[Path, tuple[str, str, Any]] = {}
    for one in wanted:
        function, signature = (one.plain, one.signature) if isinstance(one, Kernel) else one
        function = getattr(function, "py_func", function)
        path = KernelCache(function).path_of(signature.args, codegen)
        if function.__module__.partition(".")[0] != OURS or path is None:
            continue
        if path not in under_way and not path.exists():
            missing[path] = (function.__module__, function.__qualname__, signature)
    if not missing:
        return
    tell_of_the_first()
    try:
        disk_cache.write(probe := cache_folder() / f"probe-{os.getpid()}", bytes(1 << 20))
        probe.unlink()
    except OSError:
        return
    for first in range(min(others, len(missing))):
        with suppress(OSError):
            _Child(dict(list(missing.items())[first::others]))


class _Child:
    """A process that compiles functions one by one."""

    def __init__(self, functions: dict[Path, tuple[str, str, Any]]) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-c", _BEGIN],
            bufsize=0,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            start_new_session=True,  # Ctrl-C reaches the parent only
        )
        asked, from_child = self._process.stdin, self._process.stdout
        if asked is None or from_child is None:
            raise OSError("a child without pipes")
        self._asked, self._from_child = asked, from_child
        _children.append(self._process)
        self._begun = b""
        self._left = [*functions.values()]
        atexit.register(self._end)
        os.set_blocking(self._from_child.fileno(), False)
        for what in (sys.path, self._left):
            self._asked.write(pickle.dumps(what))
        for number, path in enumerate(functions):
            under_way[path] = partial(self._wait, number, path)

    def _wait(self, number: int, path: Path) -> None:
        """Wait until the child has compiled the function or failed; return at once if it has not begun it, as
        the parent then compiles the last unclaimed function."""
        while not path.exists() and self._process.poll() is None:
            self._begun += self._from_child.read() or b""
            # Of the functions begun, all but the last have been compiled or have failed.
            if len(self._begun) != number + 1:
                return
            if len(self._left) > len(self._begun):
                _compile(*self._left.pop())
                continue
            with suppress(subprocess.TimeoutExpired):
                self._process.wait(AGAIN)

    def _end(self) -> None:
        """End the child: its remaining work is no longer needed."""
        with suppress(OSError):
            self._asked.close()
        try:
            self._process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._from_child.close()


def serve() -> None:
    """In a child: compile what the parent requests, while the parent lives."""
    functions = pickle.load(sys.stdin.buffer)
    gc.disable()  # not worthwhile in a short-lived process
    # Interrupted rather than killed, so files are written whole or removed.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    threading.Thread(target=_end_with_the_other, daemon=True).start()
    with suppress(KeyboardInterrupt):
        for module, name, signature in functions:
            os.write(1, b".")
            _compile(module, name, signature)


def _compile(module: str, name: str, signature: Any) -> None:
    """Compile a function, or read it from the cache if another process was faster."""
    function = getattr(importlib.import_module(module), name)
    if isinstance(function, Kernel):
        _ = function.address
    else:
        function.compile(signature.args)


def _end_with_the_other() -> None:
    os.read(0, 1)  # unbuffered, as Python's buffer could not be closed meanwhile
    _thread.interrupt_main(signal.SIGTERM)
    threading.Event().wait(PATIENCE)
    os._exit(1)
