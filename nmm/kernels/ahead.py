"""Functions compiled at once, by processes of their own: what a first run on several cores waits for.

Kernels are called by their addresses and know nothing of each other, so each can be compiled by another
process, which leaves it in the cache. The process that asks takes the rest of them meanwhile, and reads what
it comes to need; what nobody has begun, and what never came, it compiles itself. Nobody has to say anything
in a script: these processes run code of nmm's own and never the script that started them.
"""

from __future__ import annotations

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
from numba.core.registry import cpu_target

from nmm import kept
from nmm.cores import cores
from nmm.kernels.cache import KernelCache, cache_folder, tell_of_the_first, under_way
from nmm.kernels.compiled import Kernel

#: The child's first lines: where modules are found is told before nmm is.
_BEGIN = """
import pickle, sys
sys.path[:] = pickle.load(sys.stdin.buffer)
from nmm.kernels.ahead import serve
serve()
"""
#: How long a child may take to leave nothing behind when nobody needs it any more, s.
PATIENCE = 1.0
#: Between two looks whether a function is there, s.
AGAIN = 0.01

#: Only what is in this package: to import a user's module may do anything.
OURS = "nmm"

_children: list[subprocess.Popen[bytes]] = []


def compile_ahead(*wanted: Kernel | tuple[Any, Any]) -> None:
    """Have other processes compile what the cache on disk lacks; returns at once.

    Parameters
    ----------
    wanted : kernels, or compiled functions with a signature, attributes of their modules, those that are
        needed last first: others begin with these while this process begins with what it needs first

    There are as many processes as there are further cores, and none where the cache cannot be written. They
    end with this one, however it ends.
    """
    others = cores() - 1 - sum(child.poll() is None for child in _children)
    if others < 1 or os.name != "posix" or numba.config.DISABLE_JIT or not sys.executable:
        return
    if getattr(sys, "frozen", False):  # its executable is no Python
        return
    missing: dict[Path, tuple[str, str, Any]] = {}
    for one in wanted:
        function, signature = (one.plain, one.signature) if isinstance(one, Kernel) else one
        function = getattr(function, "py_func", function)
        path = KernelCache(function).path_of(signature.args, cpu_target.target_context.codegen())
        if function.__module__.partition(".")[0] != OURS or path is None:
            continue
        if path not in under_way and not path.exists():
            missing[path] = (function.__module__, function.__qualname__, signature)
    if not missing:
        return
    tell_of_the_first()
    try:
        kept.write(probe := cache_folder() / f"probe-{os.getpid()}", bytes(1 << 20))
        probe.unlink()
    except OSError:
        return
    for first in range(min(others, len(missing))):
        with suppress(OSError):
            _Child(dict(list(missing.items())[first::others]))


class _Child:
    """A process that compiles some functions, one after the other."""

    def __init__(self, functions: dict[Path, tuple[str, str, Any]]) -> None:
        (theirs_in, asked), (told, theirs_out) = os.pipe(), os.pipe()
        self._asked, self._told = os.fdopen(asked, "wb"), os.fdopen(told, "rb", buffering=0)
        try:
            self._process = subprocess.Popen(
                [sys.executable, "-c", _BEGIN],
                stdin=theirs_in,
                stdout=theirs_out,
                stderr=subprocess.DEVNULL,
                start_new_session=True,  # Ctrl-C is for us
            )
        finally:
            os.close(theirs_in)
            os.close(theirs_out)
        _children.append(self._process)
        self._begun = b""
        self._left = [*functions.values()]
        atexit.register(self._end)
        os.set_blocking(told, False)
        for what in (sys.path, self._left):
            self._asked.write(pickle.dumps(what))
        self._asked.flush()
        for number, path in enumerate(functions):
            under_way[path] = partial(self._wait, number, path)

    def _wait(self, number: int, path: Path) -> None:
        """Until the function is there, or is not going to be; at once if it has not been begun.

        Meanwhile this process takes what has not been begun, the last first.
        """
        while not path.exists() and self._process.poll() is None:
            self._begun += self._told.read() or b""
            # The last that was begun: what was begun before it and is not there, failed.
            if len(self._begun) != number + 1:
                return
            if len(self._left) > len(self._begun):
                _compile(*self._left.pop())
                continue
            with suppress(subprocess.TimeoutExpired):
                self._process.wait(AGAIN)

    def _end(self) -> None:
        """What is left of its work is not needed any more."""
        with suppress(OSError):
            self._asked.close()
        try:
            self._process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._told.close()


def serve() -> None:
    """In a child: compile what is asked for, as long as whoever asked is there."""
    functions = pickle.load(sys.stdin.buffer)
    gc.disable()  # it does not live long enough
    # Interrupted, not killed: files are then written whole or removed.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    threading.Thread(target=_end_with_the_other, daemon=True).start()
    with suppress(KeyboardInterrupt):
        for module, name, signature in functions:
            os.write(1, b".")
            _compile(module, name, signature)


def _compile(module: str, name: str, signature: Any) -> None:
    """Compile a function, or read it from the cache where another process has been sooner."""
    function = getattr(importlib.import_module(module), name)
    if isinstance(function, Kernel):
        _ = function.address
    else:
        function.compile(signature.args)


def _end_with_the_other() -> None:
    """End this process when nobody holds the other end of its input."""
    os.read(0, 1)  # the file itself: Python's buffer could not be closed meanwhile
    _thread.interrupt_main(signal.SIGTERM)
    threading.Event().wait(PATIENCE)
    os._exit(1)
