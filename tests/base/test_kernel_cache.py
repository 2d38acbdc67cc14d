"""Compiled code kept on disk: damage heals, no disk is no hindrance, processes at once share it."""

from __future__ import annotations

import errno
import json
import logging
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numba
import numpy as np
import pytest

from nmm.base import disk_cache
from nmm.base.arrays import Array
from nmm.base.kernels import cache
from nmm.base.kernels.compiled import compiled
from nmm.base.kernels.signatures import float64, void

pytestmark = pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="nothing is compiled")
SIGNATURE = void(float64[::1], float64)


def shift(values: Array, by: float) -> None:
    for i in range(values.shape[0]):
        values[i] += by


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """An empty cache."""
    place = tmp_path / "cache"
    monkeypatch.setattr(cache, "cache_folder", lambda: place)
    cache.log_unwritable_once.cache_clear()
    yield place
    cache.log_unwritable_once.cache_clear()


def found_on_disk() -> bool:
    """Whether `shift`, asked for anew, came from the cache; it does what it should either way."""
    function: Any = compiled(shift)
    function.compile(SIGNATURE.args)
    values = np.arange(3.0)
    function(values, 0.5)
    assert values.tolist() == [0.5, 1.5, 2.5]
    return bool(function.entries[SIGNATURE.args].read)


def files(folder: Path) -> list[Path]:
    return [path for path in folder.rglob("*") if path.is_file()]


def test_what_was_compiled_is_kept(folder: Path) -> None:
    assert not found_on_disk()
    assert found_on_disk()
    (file,) = files(folder)
    assert file.name.startswith("test_kernel_cache.shift-")
    file.unlink()
    assert not found_on_disk()


def test_damage_heals(folder: Path, rng: np.random.Generator) -> None:
    found_on_disk()
    (file,) = files(folder)
    whole = file.read_bytes()
    cuts = [0, 1, 31, 32, 33, len(whole) - 1, *rng.integers(34, len(whole) - 1, size=4)]
    damaged = [whole[:cut] for cut in cuts]
    damaged += [rng.bytes(length) for length in (1, 40, len(whole))]
    for place in rng.integers(0, len(whole), size=6):
        flipped = bytearray(whole)
        flipped[place] ^= 1 << int(rng.integers(8))
        damaged.append(bytes(flipped))
    damaged += [whole + b"x", whole[:32] + whole[:32] + whole[32:]]
    for content in damaged:
        file.write_bytes(content)
        assert disk_cache.read(file) is None
    # To compile takes a while: some of each kind.
    for content in (damaged[0], damaged[5], damaged[7], damaged[12], damaged[-3], damaged[-1]):
        file.write_bytes(content)
        assert not found_on_disk()
        assert found_on_disk(), "it was not written anew"


def test_what_is_whole_but_of_no_use_is_compiled_anew(folder: Path) -> None:
    """Of another function, or made of things that are no longer there."""
    found_on_disk()
    (file,) = files(folder)
    for content in (b"", b"(S'another'\nS'key'\nt.", b"cnmm.no_such_module\nthing\n."):
        disk_cache.write(file, content)
        assert not found_on_disk()
        assert found_on_disk()


def test_a_folder_where_the_file_should_be(folder: Path, caplog: pytest.LogCaptureFixture) -> None:
    found_on_disk()
    (file,) = files(folder)
    file.unlink()
    file.mkdir()
    assert not found_on_disk()
    assert len(caplog.records) == 1


@pytest.mark.parametrize("kind", ["file", "full", "forbidden"])
def test_no_cache_is_told_once_and_costs_nothing_else(
    kind: str, folder: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    if kind == "file":
        folder.write_text("no folder")
    elif kind == "full":
        monkeypatch.setattr(disk_cache.os, "replace", refusal(errno.ENOSPC))
    else:
        monkeypatch.setattr(disk_cache.tempfile, "mkstemp", refusal(errno.EROFS))
    for _ in range(2):
        assert not found_on_disk()
    (record,) = caplog.records
    assert record.levelno == logging.WARNING
    assert "\n" not in record.getMessage()
    assert record.getMessage().startswith(str(folder))
    assert not files(folder), "nothing is left behind"


def refusal(number: int) -> Any:
    def refuse(*arguments: Any, **options: Any) -> None:
        raise OSError(number, os.strerror(number))

    return refuse


def test_a_cache_that_can_only_be_read_is_read(
    folder: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    found_on_disk()
    monkeypatch.setattr(disk_cache.tempfile, "mkstemp", refusal(errno.EROFS))
    assert found_on_disk()
    assert not caplog.records


def test_an_interrupted_write_leaves_what_was_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "sub" / "kept"
    disk_cache.write(file, b"before")

    def interrupt(*arguments: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(disk_cache.os, "replace", interrupt)
    with pytest.raises(KeyboardInterrupt):
        disk_cache.write(file, b"after")
    assert disk_cache.read(file) == b"before"
    assert files(tmp_path) == [file]


MODULE = """
import json, sys
import numpy as np
from nmm.base.kernels.compiled import compiled

@compiled
def double(x):
    return 2.0 * x
@compiled
def quadruple(x):
    return double(double(x))
@compiled
def total(values):
    result = 0.0
    for value in values:
        result += quadruple(value)
    return result

if __name__ == "__main__":
    print("ready", flush=True)
    sys.stdin.readline()  # all begin at once
    assert total(np.arange(4.0)) == 24.0 and total(np.arange(4)) == 24.0 and quadruple(1) == 4.0
    misses = sum(not made.read for f in (total, quadruple, double) for made in f.entries.values())
    print(json.dumps(misses))
"""


def test_processes_at_once_take_nothing_from_each_other(tmp_path: Path) -> None:
    """Several signatures of the same functions, by two processes at once: a third compiles nothing."""
    script = tmp_path / "script.py"
    script.write_text(MODULE)
    command = [sys.executable, str(script)]
    environment = os.environ | {"XDG_CACHE_HOME": str(tmp_path / "cache")}

    def start() -> subprocess.Popen[str]:
        process = subprocess.Popen(
            command, env=environment, text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE
        )
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        return process

    together = [start(), start()]
    for process in together:
        assert process.stdin is not None
        process.stdin.write("\n")
        process.stdin.flush()
    compiled_here = [json.loads(process.communicate()[0]) for process in together]
    assert sum(compiled_here) > 0  # on a busy machine one may come when the other has compiled all
    assert json.loads(start().communicate("\n")[0]) == 0
    assert not list((tmp_path / "cache").rglob("*.tmp"))


def test_a_command_without_any_cache(tmp_path: Path) -> None:
    """A home that cannot be written: the command runs, with one line about it."""
    (tmp_path / "home").write_text("no folder")
    environment = os.environ | {"XDG_CACHE_HOME": str(tmp_path / "home"), "MPLCONFIGDIR": str(tmp_path)}
    command = [sys.executable, "-m", "nmm", "info", "unicycle_2r"]
    done = subprocess.run(command, env=environment, capture_output=True, text=True)
    assert done.returncode == 0
    assert "unicycle_2r" in done.stdout
    (line,) = done.stderr.splitlines()
    assert line.startswith(str(tmp_path / "home"))


def test_functions_that_no_file_holds_are_compiled(folder: Path) -> None:
    scope: dict[str, Any] = {}
    exec("def double(x):\n    return 2.0 * x", scope)
    assert compiled(scope["double"])(1.5) == 3.0
    assert not files(folder)


def test_only_folders_of_kernels_are_forgotten(tmp_path: Path) -> None:
    names = [f"{number:016x}" for number in range(12)]
    for age, name in enumerate([*names, "hulls"]):
        (tmp_path / name).mkdir()
        os.utime(tmp_path / name, (1e9 - age, 1e9 - age))
    cache._forget_old_caches(tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {*names[: cache.KEPT_CACHES - 1], "hulls"}


PARTS = """
import json, sys
from nmm.base.kernels.cache import cache_folder
from nmm.base.kernels.compiled import compiled

@compiled
def root(x):
    if x < 0.0:
        raise ValueError("below zero")
    return x**0.5
@compiled
def twice(x):
    return 2.0 * root(x)
@compiled
def fourfold(x):
    return twice(x) + 2.0 * root(x)

answers = [fourfold(4.0)]
for function in (fourfold, root):
    try:
        function(-1.0)
    except RuntimeError as error:
        answers.append("an exception" in str(error))
hits = [sum(made.read for made in f.entries.values()) for f in (root, twice, fourfold)]
print(json.dumps([answers, hits]))
"""


def test_what_others_call_is_a_part_of_them(tmp_path: Path) -> None:
    """No machine code of its own until Python calls it; errors come through, from the cache too."""
    script = tmp_path / "script.py"
    script.write_text(PARTS)
    for hits in ([0, 0, 0], [1, 0, 1]):
        done = subprocess.run(
            [sys.executable, str(script)],
            env=os.environ | {"XDG_CACHE_HOME": str(tmp_path / "cache")},
            check=True,
            capture_output=True,
            text=True,
        )
        assert json.loads(done.stdout) == [[8.0, True, True], hits]
        assert not done.stderr
    names = sorted(path.name.split("-")[0] for path in (tmp_path / "cache").rglob("*.o"))
    assert names == ["script.fourfold", "script.root"]


def test_the_first_compilation_of_all_is_told(folder: Path, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO, "nmm")
    cache.tell_of_the_first.cache_clear()
    found_on_disk()
    (record,) = caplog.records
    assert record.getMessage().startswith("compiling for this machine, once")
    cache.tell_of_the_first.cache_clear()
    assert found_on_disk()
    folder.rename(folder.with_name("kept"))
    folder.mkdir()
    assert not found_on_disk()
    assert len(caplog.records) == 1, "a folder is there: others were compiled before"
