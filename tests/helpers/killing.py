"""Command lines that are ended at a moment: at the n-th file that they touch, or some seconds after it.

`python killing.py` imports the command line once, forks a process for each line that it reads (a `Request` as
JSON), and answers with its exit status. `Commands` talks to it. An audit hook counts the files that the
process makes, moves and removes, so that a signal meets it while it writes, and not by luck.
"""

from __future__ import annotations

import atexit
import contextlib
import gc
import importlib
import json
import os
import pkgutil
import resource
import signal
import subprocess
import sys
import tempfile
import threading
import time
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from types import TracebackType
from typing import Any

import pytest
from expanding import expanded_once
from small_pictures import draw_only

#: What touches files, by the name of Python's audit event; `open` counts where it is for writing.
TOUCHING = {
    "os.mkdir", "os.rename", "os.remove", "os.rmdir", "os.link", "os.chmod", "shutil.rmtree", "ctypes.dlsym",
}  # fmt: skip
WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT


@dataclass(frozen=True)
class Request:
    """A command line in a folder, and the signal that it gets at a touched file, so many seconds later."""

    folder: str
    scratch: str
    arguments: list[str]
    number: int = 0
    at: int = -1
    later: float = 0.0
    #: A module, and a function in it that is called before the command begins.
    prepared: tuple[str, str] | None = None
    #: No file gets longer, bytes; 0 for any.
    longest: int = 0


@dataclass(frozen=True)
class Ended:
    """How a command ended; below 0: by a signal."""

    status: int
    out: str
    err: str
    touched: list[str]


class Commands:
    """`with Commands(scratch) as commands: commands.run(folder, ["run", …])`."""

    def __init__(self, scratch: Path) -> None:
        self._scratch = scratch

    def __enter__(self) -> Commands:
        self._process = subprocess.Popen(
            [sys.executable, __file__], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._process.kill()
        self._process.communicate()

    def run(self, folder: Path, arguments: list[str], **when: Any) -> Ended:
        """How a command ends, with all processes that it started."""
        asked = Request(str(folder), str(self._scratch), arguments)
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(json.dumps(asdict(replace(asked, **when))) + "\n")
        self._process.stdin.flush()
        group, status = json.loads(self._process.stdout.readline())
        while any_alive(group):
            time.sleep(0.005)
        out, err, touched = (
            (self._scratch / name).read_text(encoding="utf-8") for name in ("out", "err", "touched")
        )
        return Ended(status, out, err, touched.splitlines())


def any_alive(session: int) -> bool:
    """Whether a process of the session runs; one that has ended and that nobody has asked about does not."""
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            state, _, _, its = stat.read_text().rpartition(")")[2].split()[:4]
            if int(its) == session and state != "Z":
                return True
    return False


class _Touching:
    """An audit hook: what the process touches, and the signal that it gets then."""

    def __init__(self, request: Request) -> None:
        self._request, self._pid = request, os.getpid()
        self.touched: list[str] = []

    def __call__(self, event: str, arguments: tuple[Any, ...]) -> None:
        if event == "open":
            if not isinstance(arguments[0], str) or not arguments[2] & WRITING or arguments[0] == os.devnull:
                return
        elif event not in TOUCHING or (event == "ctypes.dlsym" and "renameat2" not in arguments):
            return
        if os.getpid() != self._pid:
            return
        self.touched.append(event)
        if len(self.touched) == self._request.at + 1:
            if self._request.later:
                threading.Thread(target=self._end).start()
            else:
                os.kill(self._pid, self._request.number)

    def _end(self) -> None:
        time.sleep(self._request.later)
        os.kill(self._pid, self._request.number)


def _begin(request: Request) -> None:
    """In the forked process: it ends as the command does."""
    os.setsid()
    os.chdir(request.folder)
    for number, path in enumerate((os.devnull, f"{request.scratch}/out", f"{request.scratch}/err")):
        handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_TRUNC)
        os.dup2(handle, number)
        os.close(handle)
    # What a killed process leaves for good is in the system's temporary folder.
    tempfile.tempdir = os.environ["TMPDIR"] = request.scratch
    told = Path(request.scratch, "touched")
    told.write_text("", encoding="utf-8")
    if request.prepared:
        module, name = request.prepared
        getattr(importlib.import_module(module), name)()
    touching = _Touching(request)
    unlimited = resource.getrlimit(resource.RLIMIT_FSIZE)

    def tell() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, unlimited)
        told.write_text("\n".join(touching.touched), encoding="utf-8")

    atexit.register(tell)
    if request.longest:
        resource.setrlimit(resource.RLIMIT_FSIZE, (request.longest, unlimited[1]))
    sys.argv = ["nmm", *request.arguments]
    sys.addaudithook(touching)
    from nmm.cli import main

    try:
        main()
    except SystemExit as ended:
        if request.number:  # Python's own end belongs to the moments at which a signal may come
            raise
        threading._shutdown()  # type: ignore[attr-defined]  # as the interpreter does at its end
        atexit._run_exitfuncs()
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(ended.code if isinstance(ended.code, int) else 0)


def _practise(arguments: list[str]) -> None:
    """The command, once, in this process: each one forked has what it loads and compiles from the start."""
    from nmm.cli.exit_status import status_of

    kept = [os.dup(handle) for handle in (1, 2)]
    null = os.open(os.devnull, os.O_WRONLY)
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        for handle in (1, 2):
            os.dup2(null, handle)
        status_of(arguments)
        for handle, ours in zip((1, 2), kept, strict=True):
            os.dup2(ours, handle)
    for handle in (null, *kept):
        os.close(handle)


def _load_everything() -> None:
    """For commands that cannot be practised here."""
    import nmm

    for module in pkgutil.walk_packages(nmm.__path__, "nmm."):
        importlib.import_module(module.name)
    for name in ("matplotlib.backends.backend_agg", "pyarrow.parquet"):
        importlib.import_module(name)


def _serve() -> None:
    everything = False
    draw_only([], pytest.MonkeyPatch())  # it writes no other files than this
    importlib.import_module("nmm.model.robots.loading.description").expand = expanded_once
    practised: list[list[str]] = []
    for line in sys.stdin:
        request = Request(**json.loads(line))
        if request.prepared:
            if not everything:
                _load_everything()
                everything = True
        elif request.arguments not in practised:
            _practise(request.arguments)
            practised.append(request.arguments)
        gc.freeze()  # else each forked process would look for garbage in all of it, and copy it for that
        process = os.fork()
        if not process:
            _begin(request)
        _, status = os.waitpid(process, 0)
        print(json.dumps([process, os.waitstatus_to_exitcode(status)]), flush=True)


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _serve()
