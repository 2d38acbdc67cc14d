"""Functions compiled by other processes at once (`nmm.base.kernels.parallel_compile`)."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from nmm.base.cores import cores

pytestmark = pytest.mark.skipif(cores() < 2 or os.name != "posix", reason="one core: nobody compiles ahead")

FUNCTIONS = """
import time
from numba import types
from nmm.base.kernels.compiled import compiled, kernel

CELL = types.void(types.float64[::1])

@compiled
def sine(x):
    return x * 2.0

@kernel(CELL)
def clear_first(x):
    x[0] = sine(0.0)

@kernel(CELL)
def count(x):
    x[0] = 1.0

NUMBER = types.float64(types.float64)
"""

# No guard of __main__: the processes that compile must not run this script.
SCRIPT = """
import os, sys, time
from pathlib import Path
import functions
from nmm.base.cores import cores
from nmm.base.kernels import parallel_compile
from nmm.base.kernels.cache import cache_folder, under_way
parallel_compile.OURS = "functions"
parallel_compile.cores = {cores}
print("script", flush=True)
wanted = functions.clear_first, functions.count, (functions.sine, functions.NUMBER)
parallel_compile.compile_in_parallel(*wanted)
print(len(parallel_compile._children), len(under_way), flush=True)
{then}
"""

ALL_THERE = """
waits = [under_way.pop(path) for path in list(under_way)]
parallel_compile._children[0].wait(60)
print([child.wait(60) for child in parallel_compile._children])
parallel_compile.compile_in_parallel(*wanted)
print(len(under_way))
for one in (functions.clear_first, functions.count):
    assert one.address
    assert sum(one.compiled.stats.cache_hits.values()) == 1, one
print(sorted(path.name.split(".")[1] for path in cache_folder().rglob("*") if path.is_file()))
"""


def environment(folder: Path, **more: str) -> dict[str, str]:
    return os.environ | {"XDG_CACHE_HOME": str(folder / "cache")} | more


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "functions.py").write_text(FUNCTIONS)
    return tmp_path


def run(folder: Path, then: str, cores: str = "cores", **more: str) -> subprocess.CompletedProcess[str]:
    (folder / "script.py").write_text(SCRIPT.format(then=then, cores=cores))
    return subprocess.run(
        [sys.executable, "script.py"],
        cwd=folder,
        env=environment(folder, **more),
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )


def test_others_compile_what_this_process_then_reads(folder: Path) -> None:
    done = run(folder, ALL_THERE)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert lines.count("script") == 1
    children = min(cores() - 1, 3)
    assert lines[1:4] == [f"{children} 3", str([0] * children), "0"]
    assert [name.partition("-")[0] for name in eval(lines[4])] == ["clear_first", "count", "sine"]
    assert done.stderr == ""


def test_what_does_not_come_is_compiled_here(folder: Path) -> None:
    """Its process was killed; so does what nobody has begun."""
    then = """
for child in parallel_compile._children:
    child.kill()
assert functions.count.address and functions.clear_first.address
print(sum(functions.count.compiled.stats.cache_misses.values()))
"""
    done = run(folder, then)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == "1"


def test_who_waits_takes_what_has_not_been_begun(folder: Path) -> None:
    """The other process ends its first function only when all others have been compiled here."""
    held = """
from pathlib import Path
for _ in range(400 if __import__("sys").argv[0] == "-c" else 0):
    time.sleep(0.0 if Path("go").exists() else 0.05)
"""
    (folder / "functions.py").write_text(FUNCTIONS + held)
    then = """
child, compile_one = under_way[min(under_way)].func.__self__, parallel_compile._compile
def report(*one):
    compile_one(*one)
    print(one[1], flush=True)
    if one[1] == "count":
        Path("go").touch()
parallel_compile._compile = report
while not child._begun:
    child._begun += child._from_child.read() or b""
assert functions.clear_first.address
print(sum(functions.clear_first.compiled.stats.cache_hits.values()))
"""
    done = run(folder, then, cores="lambda: 2")
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[2:] == ["sine", "count", "1"]


def test_a_cache_that_cannot_be_written_starts_nobody(folder: Path) -> None:
    (folder / "file").write_text("")
    used = "assert functions.count.address and functions.clear_first.address"
    done = run(folder, used, XDG_CACHE_HOME=str(folder / "file" / "cache"))
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[1] == "0 0"


def test_users_modules_are_not_imported_elsewhere(folder: Path) -> None:
    (folder / "script.py").write_text(
        SCRIPT.format(then="", cores="cores").replace("parallel_compile.OURS = ", "_ = ")
    )
    done = subprocess.run(
        [sys.executable, "script.py"],
        cwd=folder,
        env=environment(folder),
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.splitlines()[1] == "0 0"


def test_plain_python_starts_nobody(folder: Path) -> None:
    done = run(folder, "", NUMBA_DISABLE_JIT="1")
    assert (done.returncode, done.stdout.splitlines()[1]) == (0, "0 0")


def alive(process: int) -> bool:
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="no /proc")
@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGINT, None])
def test_nobody_outlives_who_asked(folder: Path, how: signal.Signals | None) -> None:
    """Killed, interrupted, or through: no process and no half-written file stays."""
    (folder / "functions.py").write_text(FUNCTIONS + "if __import__('sys').argv[0] == '-c': time.sleep(60)\n")
    then = "print(*(child.pid for child in parallel_compile._children), flush=True)\n"
    (folder / "script.py").write_text(
        SCRIPT.format(then=then + ("" if how is None else "time.sleep(60)"), cores="cores")
    )
    process = subprocess.Popen(
        [sys.executable, "script.py"],
        cwd=folder,
        env=environment(folder),
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
    assert process.stdout is not None
    lines = [process.stdout.readline() for _ in range(3)]
    children = [int(word) for word in lines[2].split()]
    assert children
    if how is not None:
        process.send_signal(how)
    process.wait(30)
    process.stdout.close()
    patience = time.monotonic() + 20.0
    while any(alive(child) for child in children) and time.monotonic() < patience:
        time.sleep(0.05)
    assert not any(alive(child) for child in children)
    assert not [path for path in (folder / "cache").rglob("*") if path.is_file()]
